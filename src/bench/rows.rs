//! Results as JSON. Every output of the benchmark is made from them.
//!
//! The text of the JSON has a line for each row, and lines are written as rows are measured. So a run that
//! is killed leaves a file whose end is missing and whose rows are whole: [`read`] takes it.

use super::{
    alone::Alone,
    limits::Least,
    recipe::Axis,
    run::{MAX_ROUNDS, Measurement, Rounds, Settings, Side},
    statistics::{MIN_SAMPLES, Summary, Verdict, geometric_mean},
    watch::Quiet,
};
use crate::image::Extent;
use serde_json::{Map, Value, json};

/// Version of the whole object; it grows when a key changes its meaning. Version 1 had no samples, no settings, no
/// `quiet` and no `changing`.
pub const SCHEMA_VERSION: u32 = 2;

/// The line behind which the rows stand.
const ROWS: &str = "\"rows\": [";

/// The scene, the size and the settings of a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// The scene as it was typed.
    pub scene: String,
    /// The scene as it is shown: a file without its folder.
    pub title: String,
    /// Size of the picture.
    pub extent: Extent,
    /// The axes that were set, with their values.
    pub settings: Vec<(Axis, String)>,
}

impl Label {
    /// The title and the settings.
    pub fn name(&self) -> String {
        let settings = self.settings.iter().map(|(axis, text)| format!(" {}={text}", axis.name()));
        std::iter::once(self.title.clone()).chain(settings).collect()
    }
}

/// Three significant places more than anyone can measure.
fn rounded(value: f64) -> Value {
    json!((value * 1e6).round() / 1e6)
}

fn interval(interval: Option<[f64; 2]>) -> Value {
    interval.map_or(Value::Null, |[from, to]| json!([rounded(from), rounded(to)]))
}

/// How all rows are measured, as it stands in the results.
pub fn settings(settings: &Settings, seed: u64, budget_s: Option<f32>, rows: usize) -> Value {
    json!({
        "rounds": match settings.rounds {
            Some(rounds) => json!(rounds),
            None => json!([MIN_SAMPLES, MAX_ROUNDS]),
        },
        "seconds_of_a_row": settings.budget.as_secs_f64(),
        "warm_up": settings.warm_up,
        "seed": seed,
        "budget_seconds": budget_s,
        "rows": rows,
    })
}

fn spread([compute, classic]: [f64; 2]) -> Value {
    json!({ "compute": rounded(compute), "classic": rounded(classic) })
}

/// A row of the results.
pub fn row(label: &Label, m: &Measurement, quiet: &Quiet) -> Value {
    let axes: Map<String, Value> = label
        .settings
        .iter()
        .map(|(axis, text)| {
            let number = text.parse::<f64>().ok().map(|n| json!(n));
            (axis.name().to_string(), number.unwrap_or_else(|| json!(text)))
        })
        .collect();
    let reasons = quiet.reasons();
    let changing_reasons = quiet.changing_reasons();
    let verdict = |rounds: &Rounds, reasons: &[String]| match (m.images_equal, reasons.is_empty()) {
        (false, _) => Verdict::Invalid,
        (true, false) => Verdict::Busy,
        (true, true) => rounds.verdict(),
    };
    let mut compute = side(&m.warm.compute);
    add_stages(&mut compute, m, label.extent);
    let mut row = json!({
        "name": label.name(),
        "scene": label.scene,
        "size": label.extent.to_string(),
        "axes": axes,
        "images_equal": m.images_equal,
        "verdict": verdict(&m.warm, &reasons).name(),
        "ratio": m.warm.ratio.map(|ratio| rounded(ratio.value)),
        "ratio_interval": interval(m.warm.ratio.and_then(|ratio| ratio.interval)),
        "rounds": m.warm.compute.samples.len(),
        "compute": compute,
        "classic": side(&m.warm.classic),
    });
    row["changing"] = m.changing.as_ref().map_or(Value::Null, |changing| {
        json!({
            "verdict": verdict(changing, &changing_reasons).name(),
            "ratio": changing.ratio.map(|ratio| rounded(ratio.value)),
            "ratio_interval": interval(changing.ratio.and_then(|ratio| ratio.interval)),
            "rounds": changing.compute.samples.len(),
            "compute": side(&changing.compute),
            "classic": side(&changing.classic),
            "quiet": {
                "is_quiet": changing_reasons.is_empty(),
                "reasons": changing_reasons,
                "spread": spread(quiet.changing_spread.unwrap_or_default()),
            },
        })
    });
    row["quiet"] = json!({
        "is_quiet": reasons.is_empty(),
        "reasons": reasons,
        "load_average": quiet.load_average,
        "others": quiet.others.map(rounded),
        "calibration_ms": quiet.calibration_ms.map(rounded),
        "drift": rounded(quiet.drift),
        "spread": spread(quiet.spread),
    });
    row["counts"] = json!({
        "triangles": m.counts.triangles,
        "draws": m.counts.draws,
        "pipelines": m.counts.pipelines,
        "samples": m.counts.samples,
        "targets": m.counts.targets,
        "stencil": m.counts.stencil,
        "vertices": m.counts.vertices,
        "batches": m.counts.batches,
        "varying_words": m.counts.varying_words,
    });
    row["difference"] = json!({
        "pixels": m.difference.pixels,
        "coverage_differing": m.difference.coverage_differing,
        "winner_differing": m.difference.winner_differing,
        "colour_over_1": m.difference.colour_over_1,
        "colour_max": m.difference.colour_max,
        "depth_max": m.difference.depth_max,
    });
    row
}

/// Stages with their shares of the frame, which add up to it with the remainder.
fn add_stages(compute: &mut Value, m: &Measurement, extent: Extent) {
    let stages = m.stages.stages.iter().map(|stage| {
        let least = Least::of(&stage.stage, &m.counts, extent);
        json!({
            "stage": stage.stage,
            "dispatches": stage.dispatches,
            "ms": rounded(stage.share_ms),
            "timed_ms": rounded(stage.timed_ms),
            "least_bytes": least.map(|least| least.bytes),
            "least_atomics": least.map(|least| least.atomics),
        })
    });
    compute["stages"] = stages.collect();
    compute["remainder_ms"] = rounded(m.stages.remainder_ms);
    compute["timed_frame_ms"] = rounded(m.stages.timed_frame_ms);
}

fn side(side: &Side) -> Value {
    let Summary { median, interval: sure } = side.frame;
    json!({
        "frame_ms": rounded(median),
        "frame_ms_interval": interval(sure),
        "samples_ms": side.samples.iter().map(|ms| rounded(*ms)).collect::<Value>(),
        "device_ms": side.device_ms.map(rounded),
        "cpu_ms": side.cpu_ms.map(rounded),
    })
}

/// Adds what each executor did in a process of its own.
pub fn add_alone(row: &mut Value, executor: &str, first: &Alone, second: &Alone) {
    let side = &mut row[executor];
    side["first_frame_ms"] = rounded(first.first_frame_ms);
    side["second_run_first_frame_ms"] = rounded(second.first_frame_ms);
    side["prepared_again_ms"] = rounded(second.again_ms);
    // Compiling takes memory too, so the first run may have been the larger.
    side["peak_bytes"] = json!(first.peak_bytes.max(second.peak_bytes));
    side["before_bytes"] = json!(first.before_bytes.max(second.before_bytes));
}

/// The text before the first row.
pub fn opening(environment: &Value, settings: &Value) -> String {
    format!(
        "{{\n\"schema_version\": {SCHEMA_VERSION},\n\"environment\": {environment},\n\
         \"settings\": {settings},\n{ROWS}\n"
    )
}

/// The text of a row; `first` is whether none stands before it.
pub fn line(row: &Value, first: bool) -> String {
    // The comma stands before a row, so that the written rows are complete after each one.
    format!("{}{row}\n", if first { "" } else { "," })
}

/// The text behind the last row. `skipped` names the rows that were not measured, and why; `complete` is whether the
/// run came to its end.
pub fn closing(rows: &[Value], skipped: &[Value], complete: bool) -> String {
    let mut text = String::from("]");
    let Value::Object(end) = ending(rows, skipped, complete) else { return text };
    for (key, value) in &end {
        text += &format!(",\n\"{key}\": {value}");
    }
    text + "\n}\n"
}

fn ending(rows: &[Value], skipped: &[Value], complete: bool) -> Value {
    let means = Means::new(rows);
    json!({
        "skipped": skipped,
        "geometric_mean": means.all.map(rounded),
        "best": means.best,
        "geometric_mean_without_best": means.without_best.map(rounded),
        "complete": complete,
    })
}

/// The results in `text`, also if its end is missing; the rows that are whole are all there then.
///
/// # Errors
/// A sentence, if these are no results that this program can read.
pub fn read(text: &str) -> Result<Value, String> {
    let document = match serde_json::from_str(text) {
        Ok(document) => document,
        Err(error) => unfinished(text).ok_or_else(|| error.to_string())?,
    };
    match document["schema_version"].as_u64() {
        Some(version) if (1..=u64::from(SCHEMA_VERSION)).contains(&version) => {}
        Some(version) => {
            return Err(format!(
                "it has version {version} of the results' schema, this program reads 1 to \
                 {SCHEMA_VERSION}"
            ));
        }
        None => return Err("it is no result of `tilewright bench --json`".into()),
    }
    match document["rows"].is_array() {
        true => Ok(document),
        false => Err("it has no rows".into()),
    }
}

fn unfinished(text: &str) -> Option<Value> {
    let (before, lines) = text.split_once(ROWS)?;
    let mut document: Value = serde_json::from_str(&format!("{before}{ROWS}]}}")).ok()?;
    let rows = lines.lines().map(|line| line.trim_start_matches(','));
    // The first line is the end of the one that opens the rows.
    let rows: Vec<Value> = rows.skip(1).map_while(|line| serde_json::from_str(line).ok()).collect();
    let Value::Object(end) = ending(&rows, &[], false) else { return None };
    document["rows"] = rows.into();
    document.as_object_mut()?.extend(end);
    Some(document)
}

/// Means of the ratios of rows whose pictures are the same.
#[derive(Clone, Debug, PartialEq)]
pub struct Means {
    /// How many ratios there are.
    pub count: usize,
    /// Of all of them.
    pub all: Option<f64>,
    /// The scene with the highest ratio, if there are others.
    pub best: Option<String>,
    /// Of all rows but those of that scene.
    pub without_best: Option<f64>,
}

impl Means {
    /// Of `rows`. All rows of the best scene are left out, whatever their size.
    pub fn new(rows: &[Value]) -> Self {
        let valid = || rows.iter().filter(|row| row["images_equal"] == true);
        let ratio = |row: &Value| row["ratio"].as_f64();
        let best = valid()
            .filter_map(|row| Some((ratio(row)?, &row["name"])))
            .max_by(|a, b| a.0.total_cmp(&b.0))
            .map(|(_, name)| name);
        let others = valid().filter(|row| Some(&row["name"]) != best).filter_map(ratio);
        let without_best = geometric_mean(others);
        Self {
            count: valid().filter_map(ratio).count(),
            all: geometric_mean(valid().filter_map(ratio)),
            best: best
                .filter(|_| without_best.is_some())
                .and_then(Value::as_str)
                .map(str::to_owned),
            without_best,
        }
    }
}

/// Whether any row's pictures differ.
pub fn any_invalid(rows: &[Value]) -> bool {
    rows.iter().any(|row| row["verdict"] == Verdict::Invalid.name())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn a_row(name: &str, size: &str, ratio: f64) -> Value {
        json!({ "name": name, "size": size, "ratio": ratio, "images_equal": true })
    }

    fn text(rows: &[Value]) -> String {
        let lines = rows.iter().enumerate().map(|(n, row)| line(row, n == 0));
        opening(&json!({ "cpu": "X" }), &json!({ "seed": 0 })) + &lines.collect::<String>()
    }

    #[test]
    fn the_text_is_json_and_whole_rows_survive_any_end() {
        let rows = [a_row("a", "4x4", 2.0), a_row("b, \"rows\": [", "4x4", 0.5)];
        let whole = text(&rows) + &closing(&rows, &[json!({ "name": "c" })], true);
        let document = read(&whole).unwrap();
        assert_eq!(document["rows"], json!(rows));
        assert_eq!(document["skipped"][0]["name"], "c");
        assert_eq!(
            (&document["complete"], &document["geometric_mean"]),
            (&true.into(), &1.0.into())
        );
        // Wherever the text ends, the rows before that are there, and nothing else.
        let first_row = whole.find("[\n").unwrap() + 2;
        let mut seen = [0; 3];
        for end in first_row..whole.len() - 2 {
            let document = read(&whole[..end]).unwrap_or_else(|e| panic!("{end}: {e}"));
            let found = document["rows"].as_array().unwrap();
            assert_eq!(found[..], rows[..found.len()]);
            assert_eq!(document["complete"], false);
            assert_eq!(document["environment"]["cpu"], "X");
            seen[found.len()] += 1;
        }
        assert!(seen.iter().all(|count| *count > 0), "{seen:?}");
        assert!(read(&text(&rows)).unwrap()["rows"].as_array().unwrap().len() == 2);
    }

    #[test]
    fn what_is_no_result_is_refused() {
        assert!(read("{").is_err());
        assert!(read("{}").unwrap_err().contains("no result"));
        assert!(read("{\"schema_version\": 99}").unwrap_err().contains("99"));
        assert!(read("{\"schema_version\": 1}").unwrap_err().contains("no rows"));
        assert!(read("{\"schema_version\": 1, \"rows\": []}").is_ok());
    }

    #[test]
    fn the_best_scene_is_left_out_at_all_sizes() {
        let rows = [
            a_row("a", "4x4", 2.0),
            a_row("best", "4x4", 9.0),
            a_row("best", "8x8", 1.0),
            a_row("b", "8x8", 8.0),
        ];
        let means = Means::new(&rows);
        assert_eq!((means.count, means.best.as_deref()), (4, Some("best")));
        assert!((means.without_best.unwrap() - 4.0).abs() < 1e-12);
        let one = Means::new(&rows[..1]);
        assert_eq!((one.all, one.best, one.without_best), (Some(2.0), None, None));
    }
}
