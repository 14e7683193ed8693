//! `tilewright bench`: what it prints, writes and refuses.

use super::tool::{command, finish, run};
use serde_json::Value;
use std::{fs, time::Duration};

/// A run with everything in it; the processes of its own compile without caches.
#[test]
fn a_row_says_all_there_is_and_a_page_shows_it() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("report.html");
    let run = finish(
        command()
            .args(["bench", "large", "--size", "64x48", "--budget", "1", "--json", "--report"])
            .arg(&page),
        Duration::from_secs(240),
    )
    .expect(0);
    let results = run.json();
    assert_eq!(results["schema_version"], 1);
    let environment = &results["environment"];
    for path in ["/device/name", "/device/driver", "/kernel_hash", "/tilewright", "/system"] {
        assert!(environment.pointer(path).is_some_and(Value::is_string), "{path}");
    }
    assert!(environment["cores"].as_u64().unwrap() > 0);
    assert!(environment["rates"]["copy_bytes_per_second"].as_f64().unwrap() > 1e6);

    let rows = results["rows"].as_array().unwrap();
    let row = &rows[0];
    assert_eq!(rows.len(), 1);
    assert_eq!((&row["scene"], &row["size"]), (&"large".into(), &"64x48".into()));
    assert_eq!(row["images_equal"], true);
    let verdict = row["verdict"].as_str().unwrap();
    assert!(["FASTER", "SLOWER", "SAME", "AMBIGUOUS"].contains(&verdict), "{verdict}");
    let frame = |side: &str| row[side]["frame_ms"].as_f64().unwrap();
    let ratio = row["ratio"].as_f64().unwrap();
    assert!((ratio - frame("classic") / frame("compute")).abs() < 1e-3 * ratio);
    let sure = &row["ratio_interval"];
    assert!(sure[0].as_f64().unwrap() <= ratio && ratio <= sure[1].as_f64().unwrap());
    assert!(row["rounds"].as_u64().unwrap() >= 6);
    let stages = row["compute"]["stages"].as_array().unwrap();
    assert!(stages.len() > 3 && stages.iter().all(|stage| stage["ms"].as_f64().unwrap() >= 0.0));
    assert_eq!(row["counts"]["triangles"], 216);
    for side in ["compute", "classic"] {
        let figure =
            |name: &str| row[side][name].as_f64().unwrap_or_else(|| panic!("{side} {name}"));
        // What was never compiled takes longer than what was.
        assert!(figure("first_frame_ms") > figure("prepared_again_ms"), "{side}");
        assert!(figure("second_run_first_frame_ms") > 0.0);
        if cfg!(target_os = "linux") {
            assert!(figure("peak_bytes") >= figure("before_bytes"));
            assert!(figure("before_bytes") > 1e6);
        }
    }
    assert!(!run.stderr.contains("warning"), "{}", run.stderr);

    let html = fs::read_to_string(&page).unwrap();
    assert!(html.contains("large") && html.contains(verdict) && html.contains("<svg"));
    assert!(!html.contains("http") && !html.contains("<script"));

    // The results compared with themselves.
    let file = folder.path().join("results.json");
    fs::write(&file, &run.stdout).unwrap();
    let line = ["bench", "compare", file.to_str().unwrap(), file.to_str().unwrap(), "--json"];
    let compared = super::tool::run(line).expect(0).json();
    assert_eq!(compared["rows"][0]["change"], 1.0);
    assert_eq!(compared["environment_differs_in"], serde_json::json!([]));
}

#[test]
fn axes_make_rows_and_files_are_scenes_too() {
    let line = ["bench", "--axis", "area=64,full", "--axis", "depth=2", "--size", "32x32"];
    let more = ["--size", "40x30", "--warm-only", "--budget", "5", "--csv"];
    let csv = run(line.into_iter().chain(more)).expect(0);
    let lines: Vec<&str> = csv.stdout_text().lines().collect();
    assert!(lines[0].starts_with("scene,size,images_equal,verdict,ratio"));
    let rows: Vec<_> =
        lines[1..].iter().map(|l| l.split(',').take(3).collect::<Vec<_>>()).collect();
    assert_eq!(rows[0], ["sheet area=64 depth=2", "32x32", "true"]);
    assert_eq!(rows[3], ["sheet area=full depth=2", "40x30", "true"]);
    assert_eq!(rows.len(), 4);

    let line = ["bench", "builtin:triangle", "--size", "33x17", "--warm-only", "--budget", "1"];
    let table = run(line).expect(0);
    let said = table.stdout_text();
    assert!(
        said.contains("builtin:triangle") && said.contains("geometric mean of 1 ratio:"),
        "{said}"
    );
}

#[test]
fn what_does_not_fit_into_the_budget_is_listed() {
    let line = ["bench", "large", "slivers", "--size", "16x16", "--warm-only", "--budget", "0.001"];
    let run = run(line.into_iter().chain(["--json"])).expect(0).json();
    assert_eq!(run["rows"].as_array().unwrap().len(), 1);
    assert_eq!(run["skipped"][0]["name"], "slivers");
}

#[test]
fn a_scene_that_cannot_be_drawn_leaves_the_others_their_rows() {
    let folder = tempfile::tempdir().unwrap();
    let broken = folder.path().join("broken.glb");
    fs::write(&broken, "glTF but not really").unwrap();
    let line = ["bench", broken.to_str().unwrap(), "builtin:triangle", "--size", "16x16"];
    let run = run(line.into_iter().chain(["--warm-only", "--json"])).expect(4);
    let results = run.json();
    assert_eq!(results["rows"][0]["scene"], "builtin:triangle");
    assert_eq!(results["skipped"][0]["name"], "broken.glb");
    run.saying(&["broken.glb"]);
}

#[test]
fn a_line_that_makes_no_sense_is_refused_before_a_device_is_opened() {
    for (line, said) in [
        (&["no-such-scene"][..], "--list"),
        (&["--axis", "area"], "NAME=A,B,C"),
        (&["--axis", "colour=1"], "there are area, count"),
        (&["--axis", "area=0"], "0.25 or more"),
        (&["--axis", "area="], "0.25 or more"),
        (&["--axis", "area=1", "--axis", "area=2"], "twice"),
        (&["large", "--axis", "area=1"], "`sheet`"),
        (&["builtin:cube", "--axis", "draws=3"], "builtin:cube"),
        (&["--axis", "size=7"], "WxH"),
        (&["--axis", "area=1", "--axis", "count=9", "--axis", "depth=2"], "leave one out"),
        (&["--budget", "0"], "more than 0"),
        (&["--json", "--csv"], "--csv"),
        (&["--report", "-"], "--report"),
        (&["compare", "one.json"], "B.json"),
    ] {
        let mut tool = command();
        // No driver is there: whoever looked for one would end with 3.
        tool.env("VK_DRIVER_FILES", "nowhere.json").arg("bench").args(line);
        finish(&mut tool, Duration::from_secs(20)).expect(2).saying(&[said]);
    }
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("other.json");
    fs::write(&other, "{\"rows\": []}").unwrap();
    let line = ["bench", "compare", other.to_str().unwrap(), other.to_str().unwrap()];
    run(line).expect(4).saying(&["other.json", "no result"]);
    run(["bench", "missing/scene.glb"]).expect(4).saying(&["missing/scene.glb"]);
}

#[test]
fn scenes_and_axes_are_listed() {
    let run = run(["bench", "--list"]).expect(0);
    for name in ["small-4m", "layers-blended", "foliage", "area", "varyings"] {
        assert!(run.stdout_text().contains(&format!("  {name} ")), "{name}");
    }
}
