//! `tilewright bench`: which of the two draws a pass faster.

use super::{
    args::{BenchArgs, BenchVerb},
    device,
    exit::Outcome,
    output::{write_json, write_stdout},
    plan::{SceneName, View},
    shot::Shot,
    talk,
};
use crate::{
    bench::{self, Axis, Executors, Label, Named, Recipe},
    error::{Error, Result},
    image::Extent,
    pass::Pass,
};
use serde_json::json;
use std::{
    fmt::Write,
    time::{Duration, Instant},
};

/// The size that is measured if none is asked for.
const DEFAULT_SIZE: Extent = Extent::new(1920, 1080);
/// Seconds of rounds that a row gets if there is no budget.
const ROW_SECONDS: f64 = 3.0;
/// Steps of the progress bar per row.
const STEPS: u64 = 100;

/// Measures what was asked for.
///
/// # Errors
/// Those of the scenes and of the executors; [`Error::Device`] if the device has no pipeline of its
/// own to compare with.
pub fn run(args: &BenchArgs) -> Result<Outcome> {
    if let Some(BenchVerb::Compare(_args)) = &args.verb {
        return Err(Error::Usage("not yet".into()));
    }
    if args.list {
        return write_stdout(list().as_bytes()).map(|()| Outcome::Done);
    }
    let cases = cases(args)?;
    let gpu = device::open(&args.device)?;
    device::require_graphics(&gpu)?;
    let mut executors = Executors::new(&gpu)?;

    let started = Instant::now();
    let bar = talk::progress("measuring", cases.len() as u64 * STEPS);
    let (mut rows, mut skipped) = (Vec::new(), Vec::new());
    for (number, case) in cases.iter().enumerate() {
        let label = &case.label;
        let before = number as u64 * STEPS;
        bar.say(label.name());
        bar.done(before);
        let left = args.budget.map(|budget| f64::from(budget) - started.elapsed().as_secs_f64());
        if left.is_some_and(|left| left <= 0.0) && number > 0 {
            let reason = "the time that --budget allows was used up";
            skipped.push(json!({
                "name": label.name(), "size": label.extent.to_string(), "reason": reason,
            }));
            continue;
        }
        let share = left.map_or(ROW_SECONDS, |left| left / (cases.len() - number) as f64);
        let row_budget = Duration::from_secs_f64(share.clamp(0.0, ROW_SECONDS));
        let pass = case.pass()?;
        let measured = bench::measure(&mut executors, &pass, row_budget, &mut |part| {
            bar.done(before + (part * STEPS as f64) as u64);
        })?;
        rows.push(bench::row(label, &measured));
    }
    drop(bar);
    let document = bench::document(bench::environment(gpu.info()), rows, skipped);
    if args.json {
        write_json(&document)?;
    } else if args.csv {
        write_stdout(bench::csv(&document).as_bytes())?;
    } else {
        write_stdout(bench::table(&document).as_bytes())?;
    }
    Ok(if bench::any_invalid(&document) { Outcome::Differ } else { Outcome::Done })
}

/// One row to be.
struct Case {
    label: Label,
    source: Source,
}

enum Source {
    Generated(Recipe),
    Seen(View),
}

impl Case {
    fn pass(&self) -> Result<Pass> {
        match &self.source {
            Source::Generated(recipe) => bench::pass(&self.label.name(), recipe, self.label.extent),
            Source::Seen(view) => Shot::new(view).map(|shot| shot.pass),
        }
    }
}

/// Every scene at every size along every axis, all of it checked before anything is done.
fn cases(args: &BenchArgs) -> Result<Vec<Case>> {
    let mut axes = Vec::new();
    for typed in &args.axis {
        let (axis, values) = axis(typed)?;
        if axes.iter().any(|(known, _)| *known == axis) {
            return Err(Error::Usage(format!("--axis {} is given twice", axis.name())));
        }
        axes.push((axis, values));
    }
    let mut sizes = args.size.clone();
    if let Some(at) = axes.iter().position(|(axis, _)| *axis == Axis::Size) {
        for text in axes.remove(at).1 {
            sizes.push(super::args::parse_size(&text).map_err(Error::Usage)?);
        }
    }
    if sizes.is_empty() {
        sizes.push(DEFAULT_SIZE);
    }
    let typed: Vec<String> = match (args.scenes.as_slice(), axes.is_empty()) {
        ([], true) => bench::named()
            .iter()
            .filter(|scene| scene.name != bench::SHEET)
            .map(|scene| scene.name.into())
            .collect(),
        ([], false) => vec![bench::SHEET.into()],
        (typed, _) => typed.to_vec(),
    };
    let settings = combinations(&axes);
    let mut cases = Vec::new();
    for extent in sizes {
        for typed in &typed {
            match bench::find(typed) {
                Some(scene) => {
                    for settings in &settings {
                        cases.push(generated(&scene, extent, settings)?);
                    }
                }
                None if !axes.is_empty() => {
                    return Err(Error::Usage(format!(
                        "--axis {} varies generated scenes, and `{typed}` is none \
                         (tilewright bench --list names them)",
                        axes[0].0.name()
                    )));
                }
                None => cases.push(seen(typed, extent, args)?),
            }
        }
    }
    Ok(cases)
}

fn generated(scene: &Named, extent: Extent, settings: &[(Axis, String)]) -> Result<Case> {
    let mut recipe = scene.recipe.clone();
    for (axis, text) in settings {
        recipe
            .set(*axis, text)
            .map_err(|reason| Error::Usage(format!("--axis {}: {reason}", axis.name())))?;
    }
    recipe.check().map_err(|reason| Error::Usage(format!("--axis: {reason}")))?;
    let label = Label { scene: scene.name.into(), extent, settings: settings.to_vec() };
    Ok(Case { label, source: Source::Generated(recipe) })
}

fn seen(typed: &str, extent: Extent, args: &BenchArgs) -> Result<Case> {
    let scene = SceneName::new(typed).map_err(|error| match error {
        Error::Input { .. } if !typed.contains(['.', '/']) => Error::Usage(format!(
            "there is no scene `{typed}`: tilewright bench --list names those that are generated"
        )),
        other => other,
    })?;
    let view = View::new(scene, extent, &args.view)?;
    let label = Label { scene: typed.into(), extent, settings: Vec::new() };
    Ok(Case { label, source: Source::Seen(view) })
}

/// `name=a,b,c`.
fn axis(typed: &str) -> Result<(Axis, Vec<String>)> {
    let wrong = |reason: String| Error::Usage(format!("--axis {typed}: {reason}"));
    let (name, values) =
        typed.split_once('=').ok_or_else(|| wrong("expected NAME=A,B,C, like area=1,16".into()))?;
    let values: Vec<String> = values.split(',').map(|value| value.trim().to_string()).collect();
    Ok((Axis::named(name.trim()).map_err(wrong)?, values))
}

/// One value of each axis, in every way; the last axis varies fastest. Without axes, one empty way.
fn combinations(axes: &[(Axis, Vec<String>)]) -> Vec<Vec<(Axis, String)>> {
    let mut ways = vec![Vec::new()];
    for (axis, values) in axes {
        ways = ways
            .iter()
            .flat_map(|way| {
                values.iter().map(|value| [way.as_slice(), &[(*axis, value.clone())]].concat())
            })
            .collect();
    }
    ways
}

fn list() -> String {
    let mut text = String::from("scenes\n");
    // Writing to a string cannot fail.
    for scene in bench::named() {
        let _ = writeln!(text, "  {:<16}{}", scene.name, scene.about);
    }
    text += "axes\n";
    for (axis, about) in Axis::ALL {
        let _ = writeln!(text, "  {:<16}{about}", axis.name());
    }
    text
}
