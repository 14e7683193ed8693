//! Bars and curves as SVG.

use super::page::escape;
use crate::bench::{
    stages::STAGES,
    table::{number, text},
};
use serde_json::Value;
use std::fmt::Write;

/// Colours of stages and curves, told apart by people who see no red or green too (Okabe and Ito, and
/// their mixtures with black).
const COLORS: [&str; 11] = [
    "#e69f00", "#56b4e9", "#009e73", "#f0e442", "#0072b2", "#d55e00", "#cc79a7", "#8a6000",
    "#33708f", "#005f45", "#7a4964",
];

fn color(number: usize) -> &'static str {
    COLORS[number % COLORS.len()]
}

/// The bar of a ratio: from 1 in the middle to 16 at the right and a sixteenth at the left.
pub fn ratio_bar(ratio: Option<f64>, class: &str) -> String {
    let (width, height) = (160.0, 14.0);
    let middle = width / 2.0;
    let reach = ratio.map_or(0.0, |ratio| (ratio.log2() / 4.0).clamp(-1.0, 1.0) * middle);
    let (x, length) = if reach < 0.0 { (middle + reach, -reach) } else { (middle, reach) };
    format!(
        "<svg width={width} height={height} viewBox='0 0 {width} {height}'>\
         <line class=axis x1=0 x2={width} y1=7 y2=7 />\
         <rect class='{class}' x='{x:.1}' y=2 width='{length:.1}' height=10 />\
         <line class=one x1={middle} x2={middle} y1=0 y2={height} /></svg>"
    )
}

/// Every stage that occurs, in the order of first appearance.
pub fn stage_names(rows: &[Value]) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for stage in rows.iter().filter_map(|row| row["compute"]["stages"].as_array()).flatten() {
        let name = text(&stage["stage"]);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    // The pipeline's order, where it is known: rows may begin with different stages.
    names.sort_by_key(|name| place(name));
    names
}

/// The place of a stage in the pipeline's order; one that is not known comes last.
fn place(stage: &str) -> usize {
    STAGES.iter().position(|known| *known == stage).unwrap_or(STAGES.len())
}

/// Which colour is which stage. Colours are the same on all rows of all pages.
pub fn stage_legend(rows: &[Value]) -> String {
    let mut legend = String::from("<p>");
    for name in stage_names(rows) {
        let color = stage_color(&name);
        let _ = write!(
            legend,
            "<span class=key><i style='background:{color}'></i>{}</span>",
            escape(&name)
        );
    }
    legend
        + "<span class=key><i style='background:var(--rest)'></i>remainder</span>\
           <span class=key><i style='background:var(--even)'></i>classic, by the device's clock</span></p>"
}

fn stage_color(name: &str) -> &'static str {
    color(place(name))
}

/// The frames of a row: compute's with its stages and the remainder, classic's below.
pub fn stages(row: &Value) -> String {
    let frame = |side: &str| row[side]["frame_ms"].as_f64().unwrap_or(0.0);
    let (compute, classic) = (frame("compute"), frame("classic"));
    let (width, scale) = (680.0, 680.0 / compute.max(classic).max(1e-9));
    // Room for the figures behind the bars.
    let mut out = format!(
        "<svg width='100%' height=34 viewBox='0 0 {} 34' preserveAspectRatio='xMinYMid'>",
        width + 90.0
    );
    let mut at = 0.0;
    for stage in row["compute"]["stages"].as_array().into_iter().flatten() {
        let (name, ms) = (text(&stage["stage"]), stage["ms"].as_f64().unwrap_or(0.0));
        let fill = format!("fill='{}'", stage_color(&name));
        part(&mut out, (at, ms, scale), (2, 16), &fill, &name);
        at += ms;
    }
    let rest = "class=rest";
    part(&mut out, (at, (compute - at).max(0.0), scale), (2, 16), rest, "remainder");
    figure(&mut out, compute, scale, 15);
    let device = row["classic"]["device_ms"].as_f64().unwrap_or(classic).min(classic);
    part(
        &mut out,
        (0.0, device, scale),
        (21, 9),
        "class=classic",
        "classic, by the device's clock",
    );
    part(&mut out, (device, classic - device, scale), (21, 9), rest, "remainder");
    figure(&mut out, classic, scale, 30);
    out + "</svg>"
}

/// A part of a bar: where it begins and how long it is, in milliseconds, and its place and height.
fn part(
    out: &mut String,
    (from, ms, scale): (f64, f64, f64),
    (y, height): (u32, u32),
    style: &str,
    name: &str,
) {
    let _ = write!(
        out,
        "<rect x='{:.1}' y={y} width='{:.1}' height={height} {style}><title>{} {ms:.3} ms</title></rect>",
        from * scale,
        ms * scale,
        escape(name)
    );
}

/// The milliseconds behind a bar.
fn figure(out: &mut String, ms: f64, scale: f64, y: u32) {
    let _ = write!(out, "<text x='{:.1}' y={y}>{ms:.2} ms</text>", ms * scale + 6.0);
}

/// A point of a crossover: area in pixels, ratio, its interval.
struct Point {
    area: f64,
    ratio: f64,
    interval: Option<[f64; 2]>,
    name: String,
}

/// A curve for each depth.
type Curves = Vec<(String, Vec<Point>)>;

/// A plot for each size at which rows vary the area.
pub fn crossovers(rows: &[Value]) -> Vec<String> {
    let mut plots: Vec<(String, Curves)> = Vec::new();
    for row in rows.iter().filter(|row| row["images_equal"] == true) {
        let (size, area) = (text(&row["size"]), &row["axes"]["area"]);
        let Some(area) = area.as_f64().or_else(|| half(&size).filter(|_| area == "full")) else {
            continue;
        };
        let Some(ratio) = row["ratio"].as_f64().filter(|ratio| *ratio > 0.0) else { continue };
        let ends = &row["ratio_interval"];
        let interval = ends[0].as_f64().zip(ends[1].as_f64()).map(|(from, to)| [from, to]);
        // Whatever else varies makes another curve.
        let others =
            row["axes"].as_object().into_iter().flatten().filter(|(key, _)| *key != "area");
        let curve: Vec<_> = others
            .map(|(key, value)| match value.as_f64() {
                Some(value) => format!("{key} {value}"),
                None => format!("{key} {}", text(value)),
            })
            .collect();
        let curve = curve.join(", ");
        let point = Point { area, ratio, interval, name: text(&row["name"]) };
        let plot = entry(&mut plots, size);
        entry(plot, curve).push(point);
    }
    plots.iter().map(|(size, curves)| crossover(size, curves)).collect()
}

/// The value of `key`; a new one is added.
fn entry<T: Default>(list: &mut Vec<(String, T)>, key: String) -> &mut T {
    let at = list.iter().position(|(known, _)| *known == key).unwrap_or_else(|| {
        list.push((key, T::default()));
        list.len() - 1
    });
    &mut list[at].1
}

/// Half of the pixels of a picture: the area of the largest triangle that is all on the screen.
fn half(size: &str) -> Option<f64> {
    let (width, height) = size.split_once('x')?;
    Some(width.parse::<f64>().ok()? * height.parse::<f64>().ok()? / 2.0)
}

fn crossover(size: &str, curves: &Curves) -> String {
    let points = || curves.iter().flat_map(|(_, points)| points);
    let (left, right, top, bottom) = (70.0, 880.0, 30.0, 330.0);
    let ends = |values: &mut dyn Iterator<Item = f64>| {
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    };
    let (from, to) = ends(&mut points().map(|p| p.area.log2()));
    let span = (to - from).max(1.0);
    // Whole powers of two, with 1 always among them.
    let (low, high) = ends(&mut points().map(|p| p.ratio.log2()));
    let (low, high) = (low.floor().min(-1.0), high.ceil().max(1.0));
    let x = |area: f64| left + (area.log2() - from) / span * (right - left);
    let y = |ratio: f64| {
        bottom - ((ratio.log2() - low) / (high - low)).clamp(0.0, 1.0) * (bottom - top)
    };
    let mut out = format!(
        "<svg width='100%' viewBox='0 0 1060 380'><text x={left} y=16>classic time / compute time, {}</text>",
        escape(size)
    );
    for step in low as i32..=high as i32 {
        let (at, class) = (y(2f64.powi(step)), if step == 0 { "one" } else { "axis" });
        let name = if step < 0 { format!("1/{}", 1 << -step) } else { (1 << step).to_string() };
        let _ = write!(
            out,
            "<line class={class} x1={left} x2={right} y1='{at:.1}' y2='{at:.1}' />\
             <text x={} y='{:.1}' text-anchor=end>{name}</text>",
            left - 8.0,
            at + 4.0
        );
    }
    let mut areas: Vec<f64> = points().map(|p| p.area).collect();
    areas.sort_by(f64::total_cmp);
    areas.dedup();
    for area in areas {
        let at = x(area);
        let _ = write!(
            out,
            "<line class=axis x1='{at:.1}' x2='{at:.1}' y1={top} y2={bottom} />\
             <text x='{at:.1}' y={} text-anchor=middle>{area}</text>",
            bottom + 18.0
        );
    }
    let _ = write!(
        out,
        "<text x={} y={} text-anchor=middle>pixels of a triangle</text>",
        (left + right) / 2.0,
        bottom + 38.0
    );
    for (number, (name, points)) in curves.iter().enumerate() {
        curve(&mut out, color(number), points, (&x, &y));
        let at = top + 12.0 + 20.0 * number as f64;
        let _ = write!(
            out,
            "<rect x={} y='{:.1}' width=12 height=12 fill='{}'></rect><text x={} y='{:.1}'>{}</text>",
            right + 20.0,
            at - 10.0,
            color(number),
            right + 38.0,
            at,
            escape(if name.is_empty() { "one layer" } else { name })
        );
    }
    out + "</svg>"
}

/// A polyline with a dot and the interval at each point.
fn curve(
    out: &mut String,
    color: &str,
    points: &[Point],
    (x, y): (&dyn Fn(f64) -> f64, &dyn Fn(f64) -> f64),
) {
    let mut points: Vec<&Point> = points.iter().collect();
    points.sort_by(|a, b| a.area.total_cmp(&b.area));
    let path: Vec<_> =
        points.iter().map(|p| format!("{:.1},{:.1}", x(p.area), y(p.ratio))).collect();
    let _ = write!(
        out,
        "<polyline points='{}' fill=none stroke='{color}' stroke-width=2 />",
        path.join(" ")
    );
    for p in points {
        let (at, middle) = (x(p.area), y(p.ratio));
        if let Some([from, to]) = p.interval {
            let _ = write!(
                out,
                "<line x1='{at:.1}' x2='{at:.1}' y1='{:.1}' y2='{:.1}' stroke='{color}' />",
                y(from),
                y(to)
            );
        }
        let ratio = number(&Value::from(p.ratio), 2);
        let _ = write!(
            out,
            "<circle cx='{at:.1}' cy='{middle:.1}' r=4 fill='{color}'><title>{}: {ratio}</title></circle>",
            escape(&p.name)
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;
    use std::collections::HashSet;

    #[test]
    fn every_stage_has_its_place_and_its_colour() {
        // Rows that begin with the last stage, and a stage that nobody knows.
        let stages: Vec<Value> = std::iter::once("new")
            .chain(STAGES.into_iter().rev())
            .map(|stage| json!({ "stage": stage, "ms": 1.0 }))
            .collect();
        let names = stage_names(&[json!({ "compute": { "stages": stages } })]);
        let (last, known) = names.split_last().unwrap();
        assert!(known == STAGES && last == "new", "{names:?}");
        let colors: HashSet<_> = names.iter().map(|name| stage_color(name)).collect();
        assert_eq!(colors.len(), names.len());
        // Labels are the names of the kernels' files.
        for stage in STAGES {
            let kernel = format!("{}/glsl/{stage}.comp", env!("CARGO_MANIFEST_DIR"));
            assert!(std::path::Path::new(&kernel).exists(), "{kernel}");
        }
    }
}
