//! Results as text: a table to read, and comma-separated values.

use super::rows::Means;
use serde_json::{Value, json};
use std::fmt::Write;

/// Names of the columns. The first two and the last are aligned to the left.
const HEADER: [&str; 11] = [
    "scene",
    "size",
    "triangles",
    "compute ms",
    "classic ms",
    "ratio",
    "95 % interval",
    "rounds",
    "winners",
    "colour",
    "verdict",
];

/// What the row of frames in which everything changes is called.
const CHANGING: &str = "  everything changes";

/// The columns of a table whose rows are written one by one: their widths are known before.
pub struct Columns([usize; HEADER.len()]);

impl Columns {
    /// Wide enough for scenes of these names and sizes.
    pub fn new<'a>(cases: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let mut widths = HEADER.map(|name| name.chars().count());
        // Triangles, milliseconds, ratio, interval: as wide as usual figures are.
        for (width, usual) in widths.iter_mut().skip(2).zip([9, 10, 10, 6, 14]) {
            *width = usual.max(*width);
        }
        widths[0] = CHANGING.len();
        for (name, size) in cases {
            widths[0] = widths[0].max(name.chars().count());
            widths[1] = widths[1].max(size.chars().count());
        }
        Self(widths)
    }

    /// The line of names.
    pub fn header(&self) -> String {
        self.line(&HEADER.map(String::from))
    }

    /// The lines of a row: the warm frames, those in which everything changes, and what is to be said
    /// of it.
    pub fn row(&self, row: &Value) -> String {
        let difference = &row["difference"];
        let mut out = self.line(&[
            text(&row["name"]),
            text(&row["size"]),
            text(&row["counts"]["triangles"]),
            number(&row["compute"]["frame_ms"], 2),
            number(&row["classic"]["frame_ms"], 2),
            number(&row["ratio"], 2),
            interval(&row["ratio_interval"]),
            text(&row["rounds"]),
            text(&difference["winner_differing"]),
            text(&difference["colour_max"]),
            text(&row["verdict"]),
        ]);
        let changing = &row["changing"];
        if changing.is_object() {
            let blank = String::new;
            out += &self.line(&[
                CHANGING.into(),
                blank(),
                blank(),
                number(&changing["compute"]["frame_ms"], 2),
                number(&changing["classic"]["frame_ms"], 2),
                number(&changing["ratio"], 2),
                interval(&changing["ratio_interval"]),
                text(&changing["rounds"]),
                blank(),
                blank(),
                text(&changing["verdict"]),
            ]);
        }
        for remark in remarks(row) {
            let _ = writeln!(out, "    {remark}");
        }
        out
    }

    fn line(&self, cells: &[String; HEADER.len()]) -> String {
        let cells = cells.iter().enumerate().map(|(column, cell)| {
            pad(cell, self.0[column], column < 2 || column == HEADER.len() - 1)
        });
        let line: Vec<_> = cells.collect();
        line.join("  ").trim_end().to_string() + "\n"
    }
}

/// Sentences on a row that is not like others.
pub(super) fn remarks(row: &Value) -> Vec<String> {
    let mut remarks = Vec::new();
    if row["images_equal"] == false {
        let d = &row["difference"];
        remarks.push(format!(
            "the pictures differ (coverage {}, winner {}, colour {}, depth {}): its times say nothing",
            d["coverage_differing"], d["winner_differing"], d["colour_over_1"], d["depth_max"],
        ));
    }
    let reasons_of = |measured: &Value| -> Vec<String> {
        measured["quiet"]["reasons"].as_array().into_iter().flatten().map(text).collect()
    };
    let reasons = reasons_of(row);
    if !reasons.is_empty() {
        remarks.push(format!("the machine was busy: {}", reasons.join("; ")));
    }
    // What both lines share is said once.
    let mut changing = reasons_of(&row["changing"]);
    changing.retain(|reason| !reasons.contains(reason));
    if !changing.is_empty() {
        let what = CHANGING.trim_start();
        remarks.push(format!("the machine was busy ({what}): {}", changing.join("; ")));
    }
    remarks
}

/// What stands below the rows: means, what was left out, how it was measured.
pub fn footer(document: &Value) -> String {
    let rows = document["rows"].as_array().map_or(&[][..], Vec::as_slice);
    let mut out = String::new();
    let mut sizes: Vec<&Value> = rows.iter().map(|row| &row["size"]).collect();
    sizes.sort_by_key(|size| size.to_string());
    sizes.dedup();
    let mut mean = |what: &str, rows: &[Value]| {
        let means = Means::new(rows);
        let Some(mean) = means.all else { return };
        let count = match means.count {
            1 => "1 ratio".into(),
            count => format!("{count} ratios"),
        };
        let _ = write!(out, "geometric mean of {count}{what}: {mean:.3}");
        if let (Some(best), Some(mean)) = (means.best, means.without_best) {
            let _ = write!(out, "; without the best, {best}: {mean:.3}");
        }
        out.push('\n');
    };
    mean("", rows);
    if sizes.len() > 1 {
        for size in sizes {
            let those: Vec<Value> =
                rows.iter().filter(|row| row["size"] == *size).cloned().collect();
            mean(&format!(" at {}", text(size)), &those);
        }
    }
    let changing: Vec<Value> = rows.iter().filter(|row| row["changing"].is_object()).map(|row| {
        json!({ "name": row["name"], "ratio": row["changing"]["ratio"], "images_equal": row["images_equal"] })
    }).collect();
    mean(" where everything changes", &changing);
    let is_busy = |measured: &Value| measured["quiet"]["is_quiet"] == false;
    let busy = rows.iter().filter(|row| is_busy(row) || is_busy(&row["changing"])).count();
    if busy > 0 {
        let _ = writeln!(
            out,
            "{busy} of {} rows were measured on a busy machine; their ratios are part of the means",
            rows.len()
        );
    }
    for skipped in document["skipped"].as_array().into_iter().flatten() {
        let (name, size) = (text(&skipped["name"]), text(&skipped["size"]));
        let _ = writeln!(out, "{name} at {size}: not measured: {}", text(&skipped["reason"]));
    }
    if let Some(how) = how(&document["settings"]) {
        let _ = writeln!(out, "{how}");
    }
    if document["complete"] == false {
        let _ = writeln!(out, "{}", unfinished(document));
    }
    out
}

/// That the run did not come to its end.
pub(super) fn unfinished(document: &Value) -> String {
    let measured = document["rows"].as_array().map_or(0, Vec::len);
    let planned = document["settings"]["rows"].as_u64().unwrap_or(0);
    format!("the run did not come to its end: {measured} of {planned} rows were measured")
}

/// The settings as a sentence; `None` of results that do not hold them.
pub(super) fn how(settings: &Value) -> Option<String> {
    let rounds = match &settings["rounds"] {
        Value::Array(ends) => format!(
            "{} to {} rounds, about {} s,",
            text(&ends[0]),
            text(&ends[1]),
            text(&settings["seconds_of_a_row"])
        ),
        Value::Number(rounds) => format!("{rounds} rounds"),
        _ => return None,
    };
    Some(format!(
        "each row: {rounds} after {} frames of warm-up; seed {}",
        text(&settings["warm_up"]),
        text(&settings["seed"])
    ))
}

/// All of it at once.
pub fn table(document: &Value) -> String {
    let rows = document["rows"].as_array().map_or(&[][..], Vec::as_slice);
    let names: Vec<_> = rows.iter().map(|row| (text(&row["name"]), text(&row["size"]))).collect();
    let columns = Columns::new(names.iter().map(|(name, size)| (name.as_str(), size.as_str())));
    let rows: String = rows.iter().map(|row| columns.row(row)).collect();
    columns.header() + &rows + &footer(document)
}

/// Columns of [`csv_header`]: a name, and where it is found in a row.
const COLUMNS: [(&str, &str); 33] = [
    ("scene", "/name"),
    ("size", "/size"),
    ("images_equal", "/images_equal"),
    ("verdict", "/verdict"),
    ("ratio", "/ratio"),
    ("ratio_from", "/ratio_interval/0"),
    ("ratio_to", "/ratio_interval/1"),
    ("rounds", "/rounds"),
    ("compute_ms", "/compute/frame_ms"),
    ("compute_device_ms", "/compute/device_ms"),
    ("compute_cpu_ms", "/compute/cpu_ms"),
    ("compute_first_ms", "/compute/first_frame_ms"),
    ("compute_second_run_ms", "/compute/second_run_first_frame_ms"),
    ("compute_peak_bytes", "/compute/peak_bytes"),
    ("compute_remainder_ms", "/compute/remainder_ms"),
    ("classic_ms", "/classic/frame_ms"),
    ("classic_device_ms", "/classic/device_ms"),
    ("classic_cpu_ms", "/classic/cpu_ms"),
    ("classic_first_ms", "/classic/first_frame_ms"),
    ("classic_second_run_ms", "/classic/second_run_first_frame_ms"),
    ("classic_peak_bytes", "/classic/peak_bytes"),
    ("changing_compute_ms", "/changing/compute/frame_ms"),
    ("changing_classic_ms", "/changing/classic/frame_ms"),
    ("changing_ratio", "/changing/ratio"),
    ("changing_verdict", "/changing/verdict"),
    ("winner_differing", "/difference/winner_differing"),
    ("colour_max", "/difference/colour_max"),
    ("is_quiet", "/quiet/is_quiet"),
    ("others", "/quiet/others"),
    ("triangles", "/counts/triangles"),
    ("draws", "/counts/draws"),
    ("vertices", "/counts/vertices"),
    ("batches", "/counts/batches"),
];

/// The names of comma-separated values (RFC 4180).
pub fn csv_header() -> String {
    separated(COLUMNS.iter().map(|(name, _)| name.to_string()))
}

/// A row as comma-separated values; what was not measured is empty.
pub fn csv_line(row: &Value) -> String {
    separated(COLUMNS.iter().map(|(_, path)| match row.pointer(path) {
        None | Some(Value::Null) => String::new(),
        Some(value) => quoted(&text(value)),
    }))
}

fn separated(cells: impl Iterator<Item = String>) -> String {
    cells.collect::<Vec<_>>().join(",") + "\r\n"
}

fn quoted(text: &str) -> String {
    if text.contains([',', '"', '\n', '\r']) {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.into()
    }
}

/// Columns padded to the widest cell, those of `left` to the right of their text, others to its left.
pub(super) fn align<const N: usize>(rows: &[[String; N]], left: &[usize]) -> String {
    let width = |column: usize| rows.iter().map(|row| row[column].chars().count()).max();
    let widths: [usize; N] = std::array::from_fn(|column| width(column).unwrap_or(0));
    let mut out = String::new();
    for row in rows {
        let cells = row.iter().enumerate();
        let cells = cells.map(|(column, cell)| pad(cell, widths[column], left.contains(&column)));
        let line: Vec<_> = cells.collect();
        let _ = writeln!(out, "{}", line.join("  ").trim_end());
    }
    out
}

fn pad(cell: &str, width: usize, left: bool) -> String {
    if left { format!("{cell:<width$}") } else { format!("{cell:>width$}") }
}

pub(super) fn text(value: &Value) -> String {
    match value {
        Value::String(text) => text.clone(),
        Value::Null => "-".into(),
        other => other.to_string(),
    }
}

pub(super) fn number(value: &Value, decimals: usize) -> String {
    value.as_f64().map_or("-".into(), |value| format!("{value:.decimals$}"))
}

pub(super) fn interval(value: &Value) -> String {
    match value.as_array().map(Vec::as_slice) {
        Some([from, to]) => format!("{} to {}", number(from, 2), number(to, 2)),
        _ => "-".into(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_table_says_what_is_invalid_and_what_was_left_out() {
        let row = |name: &str, size: &str, ratio: f64, equal: bool| {
            json!({
                "name": name, "size": size, "ratio": ratio, "images_equal": equal,
                "verdict": if equal { "FASTER" } else { "INVALID" },
                "ratio_interval": [ratio, ratio],
                "compute": { "frame_ms": 1.0 }, "classic": { "frame_ms": ratio },
                "counts": { "triangles": 7 }, "difference": { "winner_differing": 99 },
            })
        };
        let mut busy = row("c", "8x8", 8.0, true);
        busy["quiet"] = json!({ "is_quiet": false, "reasons": ["others", "drift"] });
        busy["changing"] =
            json!({ "ratio": 0.25, "quiet": { "reasons": ["drift", "frames vary"] } });
        let rows = [row("a, b", "4x4", 2.0, true), busy, row("d", "8x8", 100.0, false)];
        let skipped = json!([{ "name": "e", "size": "8x8", "reason": "no time" }]);
        let document = json!({
            "rows": rows, "skipped": skipped, "complete": false,
            "settings": { "rounds": [6, 200], "seconds_of_a_row": 3.0, "warm_up": 2, "seed": 5, "rows": 9 },
        });
        let said = table(&document);
        for part in [
            "geometric mean of 2 ratios: 4.000; without the best, c: 2.000",
            "geometric mean of 1 ratio at 8x8: 8.000",
            "geometric mean of 1 ratio where everything changes: 0.250",
            "the pictures differ (coverage null, winner 99",
            "the machine was busy: others; drift",
            "everything changes): frames vary",
            "1 of 3 rows were measured on a busy machine",
            "e at 8x8: not measured: no time",
            "6 to 200 rounds, about 3.0 s, after 2 frames of warm-up; seed 5",
            "3 of 9 rows were measured",
        ] {
            assert!(said.contains(part), "{part}: {said}");
        }
        let lines: Vec<_> = document["rows"].as_array().unwrap().iter().map(csv_line).collect();
        assert!(lines[0].starts_with("\"a, b\",4x4,true,FASTER,2.0,2.0,2.0,,1.0,"), "{}", lines[0]);
        assert!(lines[1..].iter().all(|line| line.split(',').count() == COLUMNS.len()));
        assert!(lines.iter().all(|line| line.ends_with("\r\n")));
    }

    #[test]
    fn rows_that_are_written_one_by_one_stand_below_each_other() {
        let row = json!({
            "name": "large", "size": "1920x1080", "ratio": 0.5, "images_equal": true, "rounds": 20,
            "verdict": "SLOWER", "ratio_interval": [0.49, 0.51], "counts": { "triangles": 4_000_000 },
            "compute": { "frame_ms": 1234.5 }, "classic": { "frame_ms": 617.25 },
            "difference": { "winner_differing": 3, "colour_max": 1 },
            "changing": { "ratio": 0.4, "ratio_interval": [0.3, 0.5], "rounds": 6, "verdict": "SLOWER",
                "compute": { "frame_ms": 2000.0 }, "classic": { "frame_ms": 800.0 } },
        });
        let columns =
            Columns::new([("large", "1920x1080"), ("a-much-longer-name depth=16", "8x8")]);
        let text = columns.header() + &columns.row(&row);
        let lines: Vec<&str> = text.lines().collect();
        assert_eq!(lines.len(), 3, "{text}");
        assert!(lines[2].starts_with("  everything changes "), "{text}");
        for (name, figures) in [("ratio", ["0.50", "0.40"]), ("compute ms", ["1234.50", "2000.00"])]
        {
            let end = lines[0].find(name).unwrap() + name.len();
            for (line, figure) in lines[1..].iter().zip(figures) {
                assert!(line[..end].ends_with(figure), "{name}: {text}");
            }
        }
    }
}
