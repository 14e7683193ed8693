//! Results as text: a table to read, and comma-separated values.

use super::{rows::ratios, statistics::geometric_mean};
use serde_json::Value;
use std::fmt::Write;

/// The table that is printed. Widths follow the content.
pub fn table(document: &Value) -> String {
    let rows = document["rows"].as_array().map_or(&[][..], Vec::as_slice);
    let mut cells = vec![
        [
            "scene",
            "size",
            "triangles",
            "compute ms",
            "classic ms",
            "ratio",
            "95 % interval",
            "verdict",
        ]
        .map(String::from),
    ];
    cells.extend(rows.iter().map(|row| {
        [
            text(&row["name"]),
            text(&row["size"]),
            text(&row["counts"]["triangles"]),
            number(&row["compute"]["frame_ms"], 2),
            number(&row["classic"]["frame_ms"], 2),
            number(&row["ratio"], 2),
            interval(&row["ratio_interval"]),
            text(&row["verdict"]),
        ]
    }));
    let mut out = align(&cells, &[0, 1, 7]);
    let mut sizes: Vec<&Value> = rows.iter().map(|row| &row["size"]).collect();
    sizes.dedup();
    sizes.sort_by_key(|size| size.to_string());
    sizes.dedup();
    let mut mean = |what: &str, rows: &[Value]| {
        let count = match ratios(rows).count() {
            1 => "1 ratio".into(),
            count => format!("{count} ratios"),
        };
        if let Some(mean) = geometric_mean(ratios(rows)) {
            let _ = writeln!(out, "geometric mean of {count}{what}: {mean:.3}");
        }
    };
    mean("", rows);
    if sizes.len() > 1 {
        for size in sizes {
            let those: Vec<Value> =
                rows.iter().filter(|row| row["size"] == *size).cloned().collect();
            mean(&format!(" at {}", text(size)), &those);
        }
    }
    for row in rows.iter().filter(|row| row["images_equal"] == false) {
        let d = &row["difference"];
        let _ = writeln!(
            out,
            "{} at {}: the pictures differ (coverage {}, winner {}, colour {}, depth {}): its times \
             say nothing",
            text(&row["name"]),
            text(&row["size"]),
            d["coverage_differing"],
            d["winner_differing"],
            d["colour_over_1"],
            d["depth_max"],
        );
    }
    for skipped in document["skipped"].as_array().into_iter().flatten() {
        let (name, size) = (text(&skipped["name"]), text(&skipped["size"]));
        let _ = writeln!(out, "{name} at {size}: not measured: {}", text(&skipped["reason"]));
    }
    out
}

/// Columns of [`csv`]: a name, and where it is found in a row.
const COLUMNS: [(&str, &str); 24] = [
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
    ("classic_ms", "/classic/frame_ms"),
    ("classic_device_ms", "/classic/device_ms"),
    ("classic_cpu_ms", "/classic/cpu_ms"),
    ("classic_first_ms", "/classic/first_frame_ms"),
    ("classic_second_run_ms", "/classic/second_run_first_frame_ms"),
    ("classic_peak_bytes", "/classic/peak_bytes"),
    ("triangles", "/counts/triangles"),
    ("draws", "/counts/draws"),
    ("vertices", "/counts/vertices"),
    ("batches", "/counts/batches"),
];

/// The rows as comma-separated values (RFC 4180), with a line of names; what was not measured is empty.
pub fn csv(document: &Value) -> String {
    let line = |cells: Vec<String>| cells.join(",") + "\r\n";
    let mut out = line(COLUMNS.iter().map(|(name, _)| name.to_string()).collect());
    for row in document["rows"].as_array().into_iter().flatten() {
        let cell = |(_, path): &(&str, &str)| match row.pointer(path) {
            None | Some(Value::Null) => String::new(),
            Some(value) => quoted(&text(value)),
        };
        out += &line(COLUMNS.iter().map(cell).collect());
    }
    out
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
        let cells = row.iter().enumerate().map(|(column, cell)| match left.contains(&column) {
            true => format!("{cell:<width$}", width = widths[column]),
            false => format!("{cell:>width$}", width = widths[column]),
        });
        let line: Vec<_> = cells.collect();
        let _ = writeln!(out, "{}", line.join("  ").trim_end());
    }
    out
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
        let rows = [
            row("a, b", "4x4", 2.0, true),
            row("c", "8x8", 8.0, true),
            row("d", "8x8", 100.0, false),
        ];
        let skipped = json!([{ "name": "e", "size": "8x8", "reason": "no time" }]);
        let document = json!({ "rows": rows, "skipped": skipped });
        let said = table(&document);
        assert!(said.contains("geometric mean of 2 ratios: 4.000"), "{said}");
        assert!(said.contains("geometric mean of 1 ratio at 8x8: 8.000"), "{said}");
        assert!(said.contains("d at 8x8: the pictures differ"), "{said}");
        assert!(said.contains("e at 8x8: not measured: no time"), "{said}");
        let csv = csv(&document);
        let lines: Vec<_> = csv.lines().collect();
        assert_eq!(lines.len(), 4);
        assert!(lines[1].starts_with("\"a, b\",4x4,true,FASTER,2.0,2.0,2.0,,1.0,"), "{}", lines[1]);
        assert!(lines.iter().skip(2).all(|line| line.split(',').count() == COLUMNS.len()));
    }
}
