//! Compares two results: which rows became faster and which slower, measured against classic.
//!
//! Rows of the same name and size are compared by their ratios, not by their times: classic is the same
//! program in both, so that a busier machine slows both down and cancels out. The times stand beside them.
//!
//! The interval of a change follows from the intervals of the two ratios, which were measured independently:
//! on a logarithmic scale, its width is the root of the sum of the squares of their widths. The alternative
//! was to add the two widths; then two quiet runs of one program are nearly always AMBIGUOUS.

use super::{
    rows::SCHEMA_VERSION,
    statistics::{Verdict, geometric_mean},
    table::{align, interval, number, text},
};
use serde_json::{Value, json};

/// Parts of the environment that are reported if they differ between the two results.
const ENVIRONMENT: [&str; 6] =
    ["/device/driver", "/device/name", "/cpu", "/cores", "/kernel_hash", "/commit"];

/// The change from `before` to `after`.
pub fn diff(before: &Value, after: &Value) -> Value {
    let rows = |document: &Value| document["rows"].as_array().cloned().unwrap_or_default();
    let (old, new) = (rows(before), rows(after));
    let key = |row: &Value| (text(&row["name"]), text(&row["size"]));
    let mut compared = Vec::new();
    let mut only_after = Vec::new();
    for row in &new {
        match old.iter().find(|other| key(other) == key(row)) {
            Some(other) => compared.push(change(other, row)),
            None => only_after.push(json!({ "name": row["name"], "size": row["size"] })),
        }
    }
    let gone = old.iter().filter(|row| new.iter().all(|other| key(other) != key(row)));
    let only_before: Vec<_> =
        gone.map(|row| json!({ "name": row["name"], "size": row["size"] })).collect();
    let mean = geometric_mean(compared.iter().filter_map(|row| row["change"].as_f64()));
    let same = |path: &str| before.pointer(path) == after.pointer(path);
    let differing: Vec<_> = ENVIRONMENT
        .into_iter()
        .filter(|path| !same(&format!("/environment{path}")))
        .map(|path| path.trim_start_matches('/').replace('/', " "))
        .collect();
    json!({
        "schema_version": SCHEMA_VERSION,
        "geometric_mean": mean,
        "rows": compared,
        "only_before": only_before,
        "only_after": only_after,
        "environment_differs_in": differing,
    })
}

fn change(before: &Value, after: &Value) -> Value {
    let valid = before["images_equal"] == true && after["images_equal"] == true;
    // One measurement, twice: nothing is unsure about the change, whatever is about the ratio.
    let identical = before == after;
    let busy = [before, after].iter().any(|row| row["verdict"] == Verdict::Busy.name());
    let ratios = before["ratio"].as_f64().zip(after["ratio"].as_f64()).filter(|_| valid);
    let change = ratios.map(|(before, after)| after / before);
    let ends = |row: &Value| {
        let ends = &row["ratio_interval"];
        ends[0].as_f64().zip(ends[1].as_f64())
    };
    let interval = match ratios.zip(ends(before).zip(ends(after))) {
        _ if identical => change.map(|change| [change, change]),
        Some(((old, new), (old_ends, new_ends))) => {
            let reach = |a: f64, b: f64| a.ln().hypot(b.ln()).exp();
            let change = new / old;
            Some([
                change / reach(old_ends.1 / old, new / new_ends.0),
                change * reach(old / old_ends.0, new_ends.1 / new),
            ])
        }
        None => None,
    };
    let verdict = match change {
        Some(change) if identical || !busy => Verdict::new(change, interval),
        Some(_) => Verdict::Busy,
        None => Verdict::Invalid,
    };
    json!({
        "name": after["name"],
        "size": after["size"],
        "compute_ms": [before["compute"]["frame_ms"], after["compute"]["frame_ms"]],
        "classic_ms": [before["classic"]["frame_ms"], after["classic"]["frame_ms"]],
        "ratio": [before["ratio"], after["ratio"]],
        "changing_ratio": [before["changing"]["ratio"], after["changing"]["ratio"]],
        "change": change,
        "change_interval": interval,
        "verdict": verdict.name(),
    })
}

/// [`diff`] as text.
pub fn diff_table(diff: &Value) -> String {
    let mut cells = vec![
        [
            "scene",
            "size",
            "compute ms",
            "classic ms",
            "ratio",
            "change",
            "95 % interval",
            "verdict",
        ]
        .map(String::from),
    ];
    let pair = |value: &Value| format!("{} to {}", number(&value[0], 2), number(&value[1], 2));
    for row in diff["rows"].as_array().into_iter().flatten() {
        cells.push([
            text(&row["name"]),
            text(&row["size"]),
            pair(&row["compute_ms"]),
            pair(&row["classic_ms"]),
            pair(&row["ratio"]),
            number(&row["change"], 3),
            interval(&row["change_interval"]),
            text(&row["verdict"]),
        ]);
    }
    let mut out = align(&cells, &[0, 1, 7]);
    if diff["geometric_mean"].is_number() {
        out += &format!("geometric mean of the changes: {}\n", number(&diff["geometric_mean"], 3));
    }
    for (key, said) in [("only_before", "only in the first"), ("only_after", "only in the second")]
    {
        for row in diff[key].as_array().into_iter().flatten() {
            out += &format!("{} at {}: {said}\n", text(&row["name"]), text(&row["size"]));
        }
    }
    for what in diff["environment_differs_in"].as_array().into_iter().flatten() {
        out += &format!("not the same {} in both\n", text(what).replace('_', " "));
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn result(rows: &[(&str, f64, bool)], cpu: &str) -> Value {
        let rows = rows.iter().map(|(name, ratio, equal)| {
            json!({
                "name": name, "size": "8x8", "ratio": ratio, "images_equal": equal,
                "ratio_interval": [ratio * 0.99, ratio * 1.01], "verdict": "AMBIGUOUS",
            })
        });
        json!({
            "schema_version": 1, "environment": { "cpu": cpu }, "rows": rows.collect::<Vec<_>>(),
        })
    }

    #[test]
    fn what_changed_and_what_is_not_there() {
        let before =
            result(&[("a", 1.0, true), ("b", 1.0, true), ("c", 1.0, true), ("e", 2.0, true)], "X");
        let after =
            result(&[("a", 1.5, true), ("b", 0.5, true), ("d", 1.0, true), ("e", 1.0, false)], "Y");
        let found = diff(&before, &after);
        let verdicts: Vec<_> =
            found["rows"].as_array().unwrap().iter().map(|r| text(&r["verdict"])).collect();
        assert_eq!(verdicts, ["FASTER", "SLOWER", "INVALID"]);
        assert_eq!(found["only_before"][0]["name"], "c");
        assert_eq!(found["only_after"][0]["name"], "d");
        let mean = found["geometric_mean"].as_f64().unwrap();
        assert!((mean - 0.75f64.sqrt()).abs() < 1e-9, "{mean}");
        let said = diff_table(&found);
        for part in ["c at 8x8: only in the first", "not the same cpu in both", "1.00 to 1.50"] {
            assert!(said.contains(part), "{part} in {said}");
        }
    }

    #[test]
    fn a_result_is_the_same_as_itself_however_unsure_it_is() {
        let mut unsure = result(&[("a", 1.3, true)], "X");
        unsure["rows"][0]["ratio_interval"] = json!([0.7, 1.9]);
        for verdict in ["AMBIGUOUS", "BUSY"] {
            unsure["rows"][0]["verdict"] = verdict.into();
            let row = &diff(&unsure, &unsure)["rows"][0];
            assert_eq!((&row["verdict"], &row["change"]), (&"SAME".into(), &1.0.into()));
        }
    }

    #[test]
    fn two_quiet_runs_are_the_same_and_a_busy_one_says_nothing() {
        let before = result(&[("a", 1.3, true)], "X");
        let mut after = result(&[("a", 1.302, true)], "X");
        let row = diff(&before, &after)["rows"][0].clone();
        assert_eq!(row["verdict"], "SAME", "{row}");
        let [from, to] = [0, 1].map(|end| row["change_interval"][end].as_f64().unwrap());
        let change = 1.302 / 1.3;
        let reach = 1.01f64.ln().hypot(0.99f64.ln()).exp();
        assert!(from > change / reach / 1.001 && to < change * reach * 1.001, "{row}");
        after["rows"][0]["verdict"] = "BUSY".into();
        assert_eq!(diff(&before, &after)["rows"][0]["verdict"], "BUSY");
    }
}
