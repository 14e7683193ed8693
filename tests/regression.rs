//! Do reported faults stay mended? Users' cases, each named after its symptom. A case that belongs to a stage or a
//! format stands with the tests of that stage or format; here are the cases of the tool as a whole.

use crate::cli::tool::run;
use serde_json::{Value, json};
use std::fs;

/// Results as version 0.1 wrote them: schema version 1, indented.
fn old_results(ratio: f64, interval: [f64; 2]) -> String {
    let document = json!({
        "schema_version": 1,
        "environment": { "cpu": "X", "cores": 2, "kernel_hash": "1" },
        "geometric_mean": ratio,
        "rows": [{
            "name": "large", "scene": "large", "size": "64x48", "axes": {}, "images_equal": true,
            "verdict": "AMBIGUOUS", "ratio": ratio, "ratio_interval": interval, "rounds": 6,
            "compute": { "frame_ms": 2.0 }, "classic": { "frame_ms": 2.0 * ratio },
        }],
        "skipped": [],
    });
    format!("{document:#}\n")
}

fn compared(before: &str, after: &str) -> Value {
    let folder = tempfile::tempdir().unwrap();
    let [a, b] = ["a.json", "b.json"].map(|name| folder.path().join(name));
    fs::write(&a, before).unwrap();
    fs::write(&b, after).unwrap();
    let line = ["bench", "compare", a.to_str().unwrap(), b.to_str().unwrap(), "--json"];
    run(line).expect(0).json()["rows"][0].clone()
}

#[test]
fn results_compared_with_themselves_were_ambiguous() {
    let results = old_results(1.1, [0.8, 1.4]);
    let row = compared(&results, &results);
    assert_eq!((&row["verdict"], &row["change"]), (&"SAME".into(), &1.0.into()));
}

#[test]
fn results_of_the_first_schema_are_read() {
    let row = compared(&old_results(1.0, [0.99, 1.01]), &old_results(1.5, [1.49, 1.51]));
    assert_eq!((&row["verdict"], &row["change"]), (&"FASTER".into(), &1.5.into()));
}
