//! Two results compared: what became faster, what slower, measured against classic.
//!
//! Rows of the same name and size are compared by their ratios, not by their times: classic is the same
//! program in both, so that a busier machine slows both down and cancels out. The times stand beside them.

use super::{
    rows::SCHEMA_VERSION,
    statistics::{Verdict, geometric_mean},
    table::{align, interval, number, text},
};
use serde_json::{Value, json};

/// Whether `document` is a result that can be compared.
///
/// # Errors
/// A sentence.
pub fn check(document: &Value) -> Result<(), String> {
    match document["schema_version"].as_u64() {
        Some(version) if version == u64::from(SCHEMA_VERSION) => {}
        Some(version) => {
            return Err(format!(
                "it has version {version} of the results' schema, this program reads {SCHEMA_VERSION}"
            ));
        }
        None => return Err("it is no result of `tilewright bench --json`".into()),
    }
    match document["rows"].is_array() {
        true => Ok(()),
        false => Err("it has no rows".into()),
    }
}

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
    let differing: Vec<_> = ["/device/driver", "/device/name", "/cpu", "/cores", "/kernel_hash"]
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
    let ratios = before["ratio"].as_f64().zip(after["ratio"].as_f64()).filter(|_| valid);
    let change = ratios.map(|(before, after)| after / before);
    let ends = |row: &Value| {
        let ends = &row["ratio_interval"];
        ends[0].as_f64().zip(ends[1].as_f64())
    };
    // The worst of one against the best of the other: wider than it need be, and never too sure.
    let interval =
        ends(before).zip(ends(after)).filter(|_| valid).map(|(b, a)| [a.0 / b.1, a.1 / b.0]);
    let verdict = match change {
        Some(change) => Verdict::new(change, interval),
        None => Verdict::Invalid,
    };
    json!({
        "name": after["name"],
        "size": after["size"],
        "compute_ms": [before["compute"]["frame_ms"], after["compute"]["frame_ms"]],
        "classic_ms": [before["classic"]["frame_ms"], after["classic"]["frame_ms"]],
        "ratio": [before["ratio"], after["ratio"]],
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
                "ratio_interval": [ratio * 0.99, ratio * 1.01],
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
    fn what_is_no_result_is_refused() {
        assert!(check(&result(&[], "X")).is_ok());
        assert!(check(&json!({})).unwrap_err().contains("no result"));
        assert!(check(&json!({ "schema_version": 99 })).unwrap_err().contains("99"));
        assert!(check(&json!({ "schema_version": 1 })).unwrap_err().contains("no rows"));
    }
}
