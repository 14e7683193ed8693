//! `tilewright bench`: measures which of the two executors draws a pass faster.

mod alone;
mod cases;
mod interrupt;
mod results;

use super::{
    args::{BenchArgs, BenchCompareArgs, BenchShowArgs, BenchVerb},
    device,
    exit::Outcome,
    messages,
    output::{Output, write_json, write_stdout},
};
use crate::{
    bench::{self, Axis, Executors, Rates, Settings, Watch},
    error::{Error, Result},
    vk::Gpu,
};
use cases::{Case, cases};
use results::{Format, Results};
use serde_json::Value;
use std::{
    fmt::Write,
    path::Path,
    time::{Duration, Instant},
};

/// Seconds of rounds that a row gets if there is no budget.
const ROW_SECONDS: f64 = 3.0;
/// Steps of the progress bar per row.
const STEPS: u64 = 100;

/// Measures the requested rows.
///
/// # Errors
/// Those of the scenes and of the executors, the first of them after the results of all other rows were
/// printed; [`Error::Device`] if the device has no pipeline of its own to compare with.
pub fn run(args: &BenchArgs) -> Result<Outcome> {
    match &args.verb {
        Some(BenchVerb::Compare(args)) => return compare(args),
        Some(BenchVerb::Show(args)) => return show(args),
        None => {}
    }
    if args.list {
        return write_stdout(list().as_bytes()).map(|()| Outcome::Done);
    }
    let cases = cases(args)?;
    let report = args.report.as_deref().map(page).transpose()?;
    if let Some(report) = &report {
        cases.iter().try_for_each(|case| case.keep_from(report))?;
    }
    let gpu = device::open(&args.device)?;
    device::require_graphics(&gpu)?;
    if let (Some(backend), Some(case)) = (alone::executor(), cases.first()) {
        return alone::measure(&gpu, backend, &case.pass()?);
    }
    if let Some(busy) = bench::busy_already() {
        messages::line(format_args!("warning: {busy}"));
    }
    let environment = bench::environment(gpu.info(), Rates::measure(&gpu)?);
    let settings = settings(args, ROW_SECONDS);
    let settings = bench::settings(&settings, args.seed, args.budget, cases.len());
    let format = match (args.json, args.csv) {
        (true, _) => Format::Json,
        (_, true) => Format::Csv,
        _ => Format::Table,
    };
    interrupt::watch(Results::begin(format, report, environment, settings, &cases)?)?;
    let failed = rows(args, &gpu, &cases)?;
    let invalid = interrupt::with(Results::finish)?;
    match failed {
        _ if invalid => Ok(Outcome::Differ),
        Some(error) => Err(error),
        None => Ok(Outcome::Done),
    }
}

fn settings(args: &BenchArgs, seconds: f64) -> Settings {
    Settings {
        rounds: args.rounds.map(|rounds| rounds as usize),
        warm_up: args.warm_up as usize,
        budget: Duration::from_secs_f64(seconds),
        changing: !args.warm_only,
    }
}

/// Measures the cases one by one and hands each row on. A case that fails does not stop the others; the first
/// fault is returned at the end.
fn rows(args: &BenchArgs, gpu: &Gpu, cases: &[Case]) -> Result<Option<Error>> {
    let mut executors = Executors::new(gpu)?;
    let mut watch = Watch::new(gpu)?;
    let started = Instant::now();
    let bar = messages::progress("measuring", cases.len() as u64 * STEPS);
    // The processes of a row take about as long as its rounds.
    let in_here = if args.warm_only { 1.0 } else { 0.5 };
    let mut failed = None;
    for (number, case) in cases.iter().enumerate() {
        let label = &case.label;
        let before = number as u64 * STEPS;
        bar.say(label.name());
        bar.done(before);
        let skip = |reason: &str| interrupt::with(|results| results.skip(label, reason));
        if matches!(failed, Some(Error::Lost(_))) {
            skip("the device was lost before")?;
            continue;
        }
        let left = args.budget.map(|budget| f64::from(budget) - started.elapsed().as_secs_f64());
        if left.is_some_and(|left| left <= 0.0) && number > 0 {
            skip("the time that --budget allows was used up")?;
            continue;
        }
        let share = left.map_or(ROW_SECONDS, |left| left / (cases.len() - number) as f64);
        let mut settings = settings(args, share.clamp(0.0, ROW_SECONDS));
        settings.changing &= case.alone;
        let measured = case.pass().and_then(|pass| {
            watch.start()?;
            let measured = bench::measure(&mut executors, &pass, &settings, &mut |part| {
                bar.done(before + (part * in_here * STEPS as f64) as u64);
            })?;
            let quiet = watch.end(&measured)?;
            Ok(bench::row(label, &measured, &quiet))
        });
        match measured {
            Ok(mut row) => {
                if case.alone && !args.warm_only {
                    alone::add_to(&mut row, case, args, gpu.info());
                }
                interrupt::with(|results| results.row(row))?;
            }
            Err(error) => {
                skip(&error.to_string())?;
                failed.get_or_insert(error);
            }
        }
    }
    Ok(failed)
}

/// Where a page goes: never to standard output, where the results go.
fn page(path: &Path) -> Result<Output> {
    let page = Output::new(path)?;
    match page.is_stdout() {
        true => {
            Err(Error::Usage("the results go to standard output, --report needs a file".into()))
        }
        false => Ok(page),
    }
}

/// Results of a file.
fn read(path: &Path) -> Result<Value> {
    let bytes = std::fs::read(path).map_err(|e| Error::input(path, e))?;
    // A file that was cut may end within a character.
    bench::read(&String::from_utf8_lossy(&bytes)).map_err(|reason| Error::input(path, reason))
}

/// Prints results again.
fn show(args: &BenchShowArgs) -> Result<Outcome> {
    let report = args.report.as_deref().map(page).transpose()?;
    if report.as_ref().is_some_and(|report| report.replaces(&args.results)) {
        return Err(Error::Usage("--report would replace the results themselves".into()));
    }
    let document = read(&args.results)?;
    let text = match args.csv {
        true => {
            let rows = document["rows"].as_array().into_iter().flatten().map(bench::csv_line);
            std::iter::once(bench::csv_header()).chain(rows).collect()
        }
        false => bench::table(&document),
    };
    write_stdout(text.as_bytes())?;
    if let Some(report) = report {
        report.write(bench::report(&document).as_bytes())?;
    }
    Ok(Outcome::Done)
}

/// Prints the changes between two results. A slower row is no failure: the user reads the verdicts.
fn compare(args: &BenchCompareArgs) -> Result<Outcome> {
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
