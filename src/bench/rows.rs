//! Results as JSON: what every output of the benchmark is made from.

use super::{
    alone::Alone,
    limits::Least,
    recipe::Axis,
    run::{Measurement, Side},
    statistics::{Summary, Verdict, geometric_mean},
};
use crate::image::Extent;
use serde_json::{Map, Value, json};

/// Of the whole object; grows when a key changes its meaning.
pub const SCHEMA_VERSION: u32 = 1;

/// What a row is of.
#[derive(Clone, Debug, PartialEq)]
pub struct Label {
    /// The scene as it was typed.
    pub scene: String,
    /// The scene as it is shown: a file without its folder.
    pub title: String,
    /// Size of the picture.
    pub extent: Extent,
    /// What was set along which axis.
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

/// A row of the results.
pub fn row(label: &Label, m: &Measurement) -> Value {
    let axes: Map<String, Value> = label
        .settings
        .iter()
        .map(|(axis, text)| {
            let number = text.parse::<f64>().ok().map(|n| json!(n));
            (axis.name().to_string(), number.unwrap_or_else(|| json!(text)))
        })
        .collect();
    let stages = m.stages.iter().map(|stage| {
        let least = Least::of(&stage.stage, &m.counts, label.extent);
        json!({
            "stage": stage.stage,
            "dispatches": stage.dispatches,
            "ms": rounded(stage.ms),
            "least_bytes": least.map(|least| least.bytes),
            "least_atomics": least.map(|least| least.atomics),
        })
    });
    let mut compute = side(&m.compute);
    compute["stages"] = stages.collect();
    json!({
        "name": label.name(),
        "scene": label.scene,
        "size": label.extent.to_string(),
        "axes": axes,
        "images_equal": m.images_equal,
        "verdict": m.verdict.name(),
        "ratio": m.ratio.map(|ratio| rounded(ratio.value)),
        "ratio_interval": interval(m.ratio.and_then(|ratio| ratio.interval)),
        "rounds": m.rounds,
        "compute": compute,
        "classic": side(&m.classic),
        "counts": {
            "triangles": m.counts.triangles,
            "draws": m.counts.draws,
            "pipelines": m.counts.pipelines,
            "vertices": m.counts.vertices,
            "batches": m.counts.batches,
            "varying_words": m.counts.varying_words,
        },
        "difference": {
            "pixels": m.difference.pixels,
            "coverage_differing": m.difference.coverage_differing,
            "winner_differing": m.difference.winner_differing,
            "colour_over_1": m.difference.colour_over_1,
            "colour_max": m.difference.colour_max,
            "depth_max": m.difference.depth_max,
        },
    })
}

fn side(side: &Side) -> Value {
    let Summary { median, interval: sure } = side.frame;
    json!({
        "frame_ms": rounded(median),
        "frame_ms_interval": interval(sure),
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

/// All results. `skipped` names what the time did not suffice for.
pub fn document(environment: Value, rows: Vec<Value>, skipped: Vec<Value>) -> Value {
    let mean = geometric_mean(ratios(&rows));
    json!({
        "schema_version": SCHEMA_VERSION,
        "environment": environment,
        "geometric_mean": mean.map(rounded),
        "rows": rows,
        "skipped": skipped,
    })
}

/// The ratios of rows whose pictures are the same.
pub fn ratios(rows: &[Value]) -> impl Iterator<Item = f64> {
    let valid = rows.iter().filter(|row| row["images_equal"] == true);
    valid.filter_map(|row| row["ratio"].as_f64())
}

/// Whether any row's pictures differ.
pub fn any_invalid(document: &Value) -> bool {
    let rows = document["rows"].as_array();
    rows.is_some_and(|rows| rows.iter().any(|row| row["verdict"] == Verdict::Invalid.name()))
}
