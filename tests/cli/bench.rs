//! `tilewright bench`: its output, its files and its refusals.

use super::tool::{command, finish, run};
use serde_json::Value;
use std::{
    fs,
    io::{BufRead, BufReader, Read},
    path::Path,
    process::{Command, ExitStatus, Stdio},
};

/// The verdicts that a row can have if its pictures are the same; which of them it has depends on the machine.
const VERDICTS: [&str; 5] = ["FASTER", "SLOWER", "SAME", "AMBIGUOUS", "BUSY"];

/// A run with everything in it; the processes of its own compile without caches.
#[test]
fn a_row_says_all_there_is_and_a_page_shows_it() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("report.html");
    let line =
        ["bench", "large", "--size", "64x48", "--rounds", "7", "--warm-up", "1", "--seed", "5"];
    let run = finish(command().args(line).args(["--json", "--report"]).arg(&page)).expect(0);
    let results = run.json();
    assert_eq!((&results["schema_version"], &results["complete"]), (&2.into(), &true.into()));
    let environment = &results["environment"];
    for path in
        ["/device/name", "/device/driver", "/kernel_hash", "/tilewright", "/system", "/date"]
    {
        assert!(environment.pointer(path).is_some_and(Value::is_string), "{path}");
    }
    assert!(environment["cores"].as_u64().unwrap() > 0);
    assert!(environment["rates"]["copy_bytes_per_second"].as_f64().unwrap() > 0.0);
    let settings = &results["settings"];
    assert_eq!((&settings["rounds"], &settings["warm_up"]), (&7.into(), &1.into()));
    assert_eq!((&settings["seed"], &settings["rows"]), (&5.into(), &1.into()));

    let rows = results["rows"].as_array().unwrap();
    let row = &rows[0];
    assert_eq!(rows.len(), 1);
    assert_eq!((&row["scene"], &row["size"]), (&"large".into(), &"64x48".into()));
    assert_eq!(row["images_equal"], true);
    assert_eq!(row["difference"]["winner_differing"], 0);
    assert!(row["difference"]["colour_max"].is_u64());
    // Each line has its own verdict, and its own reasons for BUSY.
    for row in [row, &row["changing"]] {
        let verdict = row["verdict"].as_str().unwrap();
        assert!(VERDICTS.contains(&verdict), "{verdict}");
        let quiet = &row["quiet"];
        assert_eq!(quiet["is_quiet"] == false, verdict == "BUSY", "{quiet}");
        assert_eq!(quiet["reasons"].as_array().unwrap().is_empty(), quiet["is_quiet"] == true);
        assert!(quiet["spread"]["compute"].is_number(), "{quiet}");
    }
    let (verdict, quiet) = (row["verdict"].as_str().unwrap(), &row["quiet"]);
    assert!(quiet["calibration_ms"][1].as_f64().unwrap() > 0.0);
    assert!(quiet["drift"].as_f64().unwrap() >= 1.0);

    // The warm frames, and those in which everything changes.
    for row in [row, &row["changing"]] {
        let frame = |side: &str| row[side]["frame_ms"].as_f64().unwrap();
        let ratio = row["ratio"].as_f64().unwrap();
        assert!((ratio - frame("classic") / frame("compute")).abs() < 1e-3 * ratio);
        let sure = &row["ratio_interval"];
        assert!(sure[0].as_f64().unwrap() <= ratio && ratio <= sure[1].as_f64().unwrap());
        assert_eq!(row["rounds"], 7);
        for side in ["compute", "classic"] {
            let samples = row[side]["samples_ms"].as_array().unwrap();
            let mut samples: Vec<f64> = samples.iter().map(|ms| ms.as_f64().unwrap()).collect();
            samples.sort_by(f64::total_cmp);
            assert_eq!((samples.len(), samples[3]), (7, frame(side)), "{side}: the median of 7");
        }
    }

    // Stages and the remainder add up to the frame.
    let compute = &row["compute"];
    let stages = compute["stages"].as_array().unwrap();
    let ms = |value: &Value| value.as_f64().unwrap();
    let shares: f64 = stages.iter().map(|stage| ms(&stage["ms"])).sum();
    let sum = shares + ms(&compute["remainder_ms"]);
    assert!(stages.len() > 3 && ms(&compute["remainder_ms"]) >= 0.0);
    assert!((sum - ms(&compute["frame_ms"])).abs() < 1e-4, "{sum} {compute}");
    assert_eq!(row["counts"]["triangles"], 216);
    for side in ["compute", "classic"] {
        let figure =
            |name: &str| row[side][name].as_f64().unwrap_or_else(|| panic!("{side} {name}"));
        for name in ["first_frame_ms", "second_run_first_frame_ms", "prepared_again_ms"] {
            assert!(figure(name) > 0.0, "{side} {name}");
        }
        if cfg!(target_os = "linux") {
            assert!(figure("peak_bytes") >= figure("before_bytes"));
            assert!(figure("before_bytes") > 1e6);
        }
    }

    let html = fs::read_to_string(&page).unwrap();
    assert!(html.contains("large") && html.contains(verdict) && html.contains("<svg"));
    assert!(html.contains("everything changes"));
    assert!(!html.contains("http") && !html.contains("<script"));

    // The results compared with themselves, and shown again.
    let file = folder.path().join("results.json");
    fs::write(&file, &run.stdout).unwrap();
    let file = file.to_str().unwrap();
    let compared = super::tool::run(["bench", "compare", file, file, "--json"]).expect(0).json();
    assert_eq!(compared["rows"][0]["change"], 1.0);
    assert_eq!(compared["rows"][0]["verdict"], "SAME");
    assert_eq!(compared["environment_differs_in"], serde_json::json!([]));
    let shown = super::tool::run(["bench", "show", file]).expect(0);
    for part in ["large", "everything changes", "7 rounds after 1 frames of warm-up; seed 5"] {
        assert!(shown.stdout_text().contains(part), "{part}: {}", shown.stdout_text());
    }
}

#[test]
fn axes_make_rows_and_files_are_scenes_too() {
    let line = ["bench", "--axis", "area=64,full", "--axis", "depth=2", "--size", "32x32"];
    let more = ["--size", "40x30", "--warm-only", "--rounds", "1", "--csv"];
    let csv = run(line.into_iter().chain(more)).expect(0);
    let lines: Vec<&str> = csv.stdout_text().lines().collect();
    assert!(lines[0].starts_with("scene,size,images_equal,verdict,ratio"));
    let rows: Vec<_> =
        lines[1..].iter().map(|l| l.split(',').take(3).collect::<Vec<_>>()).collect();
    assert_eq!(rows[0], ["sheet area=64 depth=2", "32x32", "true"]);
    assert_eq!(rows[3], ["sheet area=full depth=2", "40x30", "true"]);
    assert_eq!(rows.len(), 4);

    let line = ["bench", "builtin:triangle", "--size", "33x17", "--warm-only", "--rounds", "1"];
    let table = run(line).expect(0);
    let said = table.stdout_text();
    assert!(
        said.contains("builtin:triangle") && said.contains("geometric mean of 1 ratio:"),
        "{said}"
    );
    assert!(!said.contains("everything changes"), "{said}");
}

/// Rows of several samples and targets, the frames and processes of their own among them.
#[test]
fn samples_and_targets_are_axes() {
    let axes = ["--axis", "samples=4", "--axis", "targets=3", "--size", "40x30"];
    let rows = |line: &mut dyn Iterator<Item = &str>| {
        let run = run(line.chain(["--rounds", "1", "--json"])).expect(0);
        run.json()["rows"].as_array().unwrap().clone()
    };
    let made = rows(&mut ["bench", "foliage"].into_iter().chain(axes));
    let file = ["bench", "builtin:still-life"].into_iter().chain(["--axis", "samples=4"]);
    let seen = rows(&mut file.chain(["--size", "40x30"]));
    for (row, targets) in [(&made[0], 3), (&seen[0], 1)] {
        assert_eq!(row["axes"]["samples"], 4.0, "{row}");
        assert_eq!(
            (&row["counts"]["samples"], &row["counts"]["targets"]),
            (&4.into(), &targets.into())
        );
        assert_eq!(row["images_equal"], true, "{row}");
        let stages = row["compute"]["stages"].as_array().unwrap();
        let resolve = stages.iter().find(|stage| stage["stage"] == "resolve").unwrap();
        assert_eq!(resolve["dispatches"].as_u64(), Some(targets + 1), "colours and depth");
        assert!(row["changing"]["ratio"].as_f64().unwrap() > 0.0, "{row}");
        for side in ["compute", "classic"] {
            assert!(
                row[side]["second_run_first_frame_ms"].as_f64().unwrap() > 0.0,
                "{side}: {row}"
            );
        }
    }
}

/// Rows with a stencil target and of lines, the frames and processes of their own among them.
#[test]
fn stencil_and_lines_are_axes() {
    for (axis, values) in [("stencil", &["none", "order"][..]), ("lines", &["no", "bresenham-2"])] {
        let typed = format!("{axis}={}", values.join(","));
        let line = ["bench", "--axis", &typed, "--size", "40x30", "--rounds", "1"];
        let results = run(line.into_iter().chain(["--json"])).expect(0).json();
        let rows = results["rows"].as_array().unwrap();
        assert_eq!(rows.len(), values.len());
        for (row, value) in rows.iter().zip(values) {
            assert_eq!(row["axes"][axis], *value, "{row}");
            assert_eq!(row["counts"]["stencil"], *value == "order", "{row}");
            // Five by four cells of two triangles, each side once.
            let primitives = if *value == "bresenham-2" { 5 * 5 + 6 * 4 + 20 } else { 40 };
            assert_eq!(row["counts"]["triangles"], primitives, "{row}");
            assert_eq!(row["images_equal"], true, "{row}");
            assert!(row["ratio"].as_f64().unwrap() > 0.0, "{row}");
            assert!(row["changing"]["ratio"].as_f64().unwrap() > 0.0, "{row}");
            for side in ["compute", "classic"] {
                assert!(row[side]["first_frame_ms"].as_f64().unwrap() > 0.0, "{side}: {row}");
            }
        }
    }
}

/// No device has all numbers of samples; what it lacks costs the other rows nothing.
#[test]
fn samples_that_the_device_does_not_draw_are_listed() {
    let line = ["bench", "large", "--axis", "samples=1,2,4,8,16", "--size", "16x16", "--warm-only"];
    let run = run(line.into_iter().chain(["--rounds", "1", "--json"]));
    let results = run.json();
    let names = |of: &str| -> Vec<String> {
        let all = results[of].as_array().unwrap().iter();
        all.map(|row| row["name"].as_str().unwrap().to_string()).collect()
    };
    let (rows, skipped) = (names("rows"), names("skipped"));
    for count in [1, 4] {
        assert!(rows.contains(&format!("large samples={count}")), "{rows:?}");
    }
    assert_eq!(rows.len() + skipped.len(), 5);
    for row in results["skipped"].as_array().unwrap() {
        let count = row["name"].as_str().unwrap().rsplit('=').next().unwrap();
        let reason = row["reason"].as_str().unwrap();
        assert!(reason.contains(&format!("{count} samples")), "{row}");
    }
    run.expect(if skipped.is_empty() { 0 } else { 3 });
}

/// Starts a run of eight rows, sends it `signal` once it has written the first, and returns how it ended and
/// all that it wrote.
fn signalled(signal: &str, page: &Path) -> (ExitStatus, String, String) {
    let line = ["bench", "large", "builtin:triangle", "slivers", "medium-70k", "--size", "16x16"];
    let more = ["--size", "24x24", "--rounds", "40", "--warm-only", "--json", "--report"];
    let mut command = command();
    command.args(line).args(more).arg(page).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut out = BufReader::new(child.stdout.take().unwrap());
    let mut text = String::new();
    while !text.contains("{\"name\":\"large\"") {
        assert!(out.read_line(&mut text).unwrap() > 0, "it ended before its first row: {text}");
    }
    let kill = format!("kill {signal} {}", child.id());
    assert!(Command::new("bash").args(["-c", &kill]).status().unwrap().success());
    out.read_to_string(&mut text).unwrap();
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    (child.wait().unwrap(), text, said)
}

#[cfg(unix)]
#[test]
fn an_interrupted_run_keeps_and_shows_its_rows() {
    use std::os::unix::process::ExitStatusExt;
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("report.html");
    for (signal, number) in [("-INT", 2), ("-TERM", 15)] {
        let (status, text, said) = signalled(signal, &page);
        let results: Value = serde_json::from_str(&text).unwrap_or_else(|e| panic!("{e}: {text}"));
        let measured = results["rows"].as_array().unwrap().len();
        assert_eq!(results["rows"][0]["name"], "large");
        assert!(results["geometric_mean"].is_number());
        // A machine that measured all rows before the signal arrived ended as usual.
        if status.success() {
            assert_eq!(results["complete"], true);
            continue;
        }
        assert_eq!(
            (status.signal(), &results["complete"]),
            (Some(number), &false.into()),
            "{said}"
        );
        assert!(said.contains(&format!("interrupted: {measured} of 8 rows")), "{said}");
        let html = fs::read_to_string(&page).unwrap();
        assert!(html.contains(&format!("{measured} of 8 rows were measured")), "{html}");
    }
}

#[cfg(unix)]
#[test]
fn a_killed_run_leaves_its_rows() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("report.html");
    let (_, text, _) = signalled("-KILL", &page);
    let results = folder.path().join("results.json");
    // A fast machine may have written the end: it goes. In the worst case the system cuts the last line.
    let rows = text.split("\n]").next().unwrap();
    for text in [format!("{rows}\n"), format!("{rows}\n,{{\"name\":\"sliv")] {
        fs::write(&results, &text).unwrap();
        let again = folder.path().join("again.html");
        let line =
            ["bench", "show", results.to_str().unwrap(), "--report", again.to_str().unwrap()];
        let shown = run(line).expect(0);
        assert!(shown.stdout_text().contains("large "), "{}", shown.stdout_text());
        assert!(shown.stdout_text().contains("of 8 rows were measured"), "{}", shown.stdout_text());
        assert!(fs::read_to_string(again).unwrap().contains("large"));
        let same = ["bench", "compare", results.to_str().unwrap(), results.to_str().unwrap()];
        assert!(run(same).expect(0).stdout_text().contains("SAME"));
    }
}

#[test]
fn what_does_not_fit_into_the_budget_is_listed() {
    let line = ["bench", "large", "slivers", "--size", "16x16", "--warm-only", "--budget", "1e-9"];
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
    let more = ["--warm-only", "--rounds", "1", "--json"];
    let run = run(line.into_iter().chain(more)).expect(4);
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
        (&["builtin:cube", "--axis", "samples=4", "--axis", "targets=2"], "--axis targets"),
        (&["builtin:cube", "--axis", "samples=5"], "1, 2, 4, 8 or 16"),
        (&["--axis", "samples=0"], "1, 2, 4, 8 or 16"),
        (&["--axis", "targets=9"], "1 to 8"),
        (&["--axis", "stencil=some"], "none, test, write or order"),
        (&["--axis", "lines=0"], "a width from 1 to 1024"),
        (&["builtin:cube", "--axis", "lines=1"], "--axis lines"),
        (&["--axis", "size=7"], "WxH"),
        (&["--axis", "area=1", "--axis", "count=9", "--axis", "depth=2"], "leave one out"),
        (&["--budget", "0"], "more than 0"),
        (&["--rounds", "0"], "1..=100000"),
        (&["--seed=-1"], "--seed"),
        (&["show"], "RESULTS.json"),
        (&["show", "a.json", "--report", "-"], "--report"),
        (&["--json", "--csv"], "--csv"),
        (&["--report", "-"], "--report"),
        (&["compare", "one.json"], "B.json"),
    ] {
        let mut tool = command();
        // No driver is there: whoever looked for one would end with 3.
        tool.env("VK_DRIVER_FILES", "nowhere.json").arg("bench").args(line);
        finish(&mut tool).expect(2).saying(&[said]);
    }
    let folder = tempfile::tempdir().unwrap();
    let other = folder.path().join("other.json");
    fs::write(&other, "{\"rows\": []}").unwrap();
    let line = ["bench", "compare", other.to_str().unwrap(), other.to_str().unwrap()];
    run(line).expect(4).saying(&["other.json", "no result"]);
    let line = ["bench", "show", other.to_str().unwrap(), "--report", other.to_str().unwrap()];
    run(line).expect(2).saying(&["replace the results"]);
    run(["bench", "missing/scene.glb"]).expect(4).saying(&["missing/scene.glb"]);
}

#[test]
fn scenes_and_axes_are_listed() {
    let run = run(["bench", "--list"]).expect(0);
    for name in [
        "small-4m",
        "layers-blended",
        "foliage",
        "area",
        "varyings",
        "samples",
        "targets",
        "stencil",
        "lines",
    ] {
        assert!(run.stdout_text().contains(&format!("  {name} ")), "{name}");
    }
}
