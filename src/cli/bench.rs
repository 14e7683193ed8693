//! `tilewright bench`: which of the two draws a pass faster.

mod alone;
mod cases;

use super::{
    args::{BenchArgs, BenchCompareArgs, BenchVerb},
    device,
    exit::Outcome,
    output::{Output, write_json, write_stdout},
    talk,
};
use crate::{
    bench::{self, Axis, Executors, Rates},
    error::{Error, Result},
};
use cases::cases;
use serde_json::{Value, json};
use std::{
    fmt::Write,
    path::Path,
    time::{Duration, Instant},
};

/// Seconds of rounds that a row gets if there is no budget.
const ROW_SECONDS: f64 = 3.0;
/// Steps of the progress bar per row.
const STEPS: u64 = 100;

/// Measures what was asked for.
///
/// # Errors
/// Those of the scenes and of the executors, the first of them after the results of all other rows were
/// printed; [`Error::Device`] if the device has no pipeline of its own to compare with.
pub fn run(args: &BenchArgs) -> Result<Outcome> {
    if let Some(BenchVerb::Compare(args)) = &args.verb {
        return compare(args);
    }
    if args.list {
        return write_stdout(list().as_bytes()).map(|()| Outcome::Done);
    }
    let cases = cases(args)?;
    let report = args.report.as_deref().map(Output::new).transpose()?;
    if let Some(report) = &report {
        if report.is_stdout() {
            return Err(Error::Usage(
                "the results go to standard output, --report needs a file".into(),
            ));
        }
        cases.iter().try_for_each(|case| case.keep_from(report))?;
    }
    let gpu = device::open(&args.device)?;
    device::require_graphics(&gpu)?;
    if let (Some(backend), Some(case)) = (args.alone, cases.first()) {
        return alone::be(&gpu, backend, &case.pass()?);
    }
    let rates = Rates::measure(&gpu)?;
    let mut executors = Executors::new(&gpu)?;

    let started = Instant::now();
    let bar = talk::progress("measuring", cases.len() as u64 * STEPS);
    // The processes of a row take about as long as its rounds.
    let in_here = if args.warm_only { 1.0 } else { 0.5 };
    let (mut rows, mut skipped, mut failed) = (Vec::new(), Vec::new(), None);
    for (number, case) in cases.iter().enumerate() {
        let label = &case.label;
        let before = number as u64 * STEPS;
        bar.say(label.name());
        bar.done(before);
        let mut skip = |reason: String| {
            let (name, size) = (label.name(), label.extent.to_string());
            skipped.push(json!({ "name": name, "size": size, "reason": reason }));
        };
        if matches!(failed, Some(Error::Lost(_))) {
            skip("the device was lost before".into());
            continue;
        }
        let left = args.budget.map(|budget| f64::from(budget) - started.elapsed().as_secs_f64());
        if left.is_some_and(|left| left <= 0.0) && number > 0 {
            skip("the time that --budget allows was used up".into());
            continue;
        }
        let share = left.map_or(ROW_SECONDS, |left| left / (cases.len() - number) as f64);
        let row_budget = Duration::from_secs_f64(share.clamp(0.0, ROW_SECONDS));
        let measured = case.pass().and_then(|pass| {
            bench::measure(&mut executors, &pass, row_budget, &mut |part| {
                bar.done(before + (part * in_here * STEPS as f64) as u64);
            })
        });
        match measured {
            Ok(measured) => {
                let mut row = bench::row(label, &measured);
                if case.alone && !args.warm_only {
                    alone::add_to(&mut row, case, args, gpu.info());
                }
                rows.push(row);
            }
            // The rows that were measured are no worse for it.
            Err(error) => {
                skip(error.to_string());
                failed.get_or_insert(error);
            }
        }
    }
    drop(bar);
    let document = bench::document(bench::environment(gpu.info(), rates), rows, skipped);
    if args.json {
        write_json(&document)?;
    } else if args.csv {
        write_stdout(bench::csv(&document).as_bytes())?;
    } else {
        write_stdout(bench::table(&document).as_bytes())?;
    }
    if let Some(report) = &report {
        report.write(bench::report(&document).as_bytes())?;
    }
    match failed {
        _ if bench::any_invalid(&document) => Ok(Outcome::Differ),
        Some(error) => Err(error),
        None => Ok(Outcome::Done),
    }
}

/// Prints what changed between two results. It is no failure if something became slower: whoever asks
/// reads the verdicts.
fn compare(args: &BenchCompareArgs) -> Result<Outcome> {
    let read = |path: &Path| -> Result<Value> {
        let text = std::fs::read(path).map_err(|e| Error::input(path, e))?;
        let document = serde_json::from_slice(&text).map_err(|e| Error::input(path, e))?;
        bench::check(&document).map_err(|reason| Error::input(path, reason))?;
        Ok(document)
    };
    let diff = bench::diff(&read(&args.before)?, &read(&args.after)?);
    if args.json {
        write_json(&diff)?;
    } else {
        write_stdout(bench::diff_table(&diff).as_bytes())?;
    }
    Ok(Outcome::Done)
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
