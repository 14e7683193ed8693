//! The list of devices, and the choice of one.

use super::tool::{command, finish, run};

#[test]
fn devices_lists_each_with_what_selects_it() {
    let listed = run(["devices", "--json"]).expect(0).json();
    assert_eq!(listed["schema_version"], 1);
    let first = &listed["devices"][0];
    for key in ["index", "name", "uuid", "kind", "driver", "api_version", "usable", "missing"] {
        assert!(!first[key].is_null(), "{key}: {first}");
    }
    let text = run(["devices"]).expect(0);
    assert!(text.stdout_text().contains(first["name"].as_str().unwrap()));
    assert!(text.stdout_text().contains(first["uuid"].as_str().unwrap()));
}

#[test]
fn doctor_says_that_all_is_well() {
    let text = run(["doctor"]).expect(0);
    assert!(!text.stdout.is_empty());
    assert_eq!(run(["doctor", "--json"]).expect(0).json()["schema_version"], 1);
}

#[test]
fn no_driver_ends_with_3_and_says_what_to_do() {
    for (verb, more) in
        [("render", &["builtin:teapot", "-o", "-"][..]), ("devices", &[]), ("doctor", &[])]
    {
        // Without validation, whose messages would tell of the missing driver as well.
        let mut command = command();
        command.arg(verb).args(more);
        command.env("VK_DRIVER_FILES", "/nonexistent.json").env_remove("TILEWRIGHT_VALIDATION");
        let run = finish(&mut command).expect(3);
        let said = format!("{}{}", run.stderr, run.stdout_text());
        assert!(said.contains("/nonexistent.json"), "{verb}: {said}");
    }
}

#[test]
fn a_device_that_takes_too_long_ends_with_5_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let line = ["render", "builtin:still-life", "--size", "2048x2048", "-o", "x.png"];
    let small = |more: &[&str], variable: Option<&str>| {
        let mut command = command();
        command.args(line).args(more).current_dir(folder.path());
        command.envs(variable.map(|value| ("TILEWRIGHT_TIMEOUT", value)));
        finish(&mut command).expect(5).saying(&["0.000001 s", "--timeout"]);
    };
    small(&["--timeout", "0.000001"], None);
    small(&[], Some("0.000001"));
    assert!(super::tool::names(folder.path()).is_empty());
}

#[test]
fn the_device_that_is_asked_for_is_used_or_none() {
    let device = crate::common::device_under_test();
    let name = device.name.as_str();
    let small = ["render", "builtin:teapot", "--size", "16x16", "-o", "-"];
    for selector in [
        device.index.to_string(),
        device.uuid.clone(),
        name.to_uppercase(),
        format!("{}*", &name[..4]),
    ] {
        finish(command().args(small).args(["--device", &selector])).expect(0).saying(&[name]);
        finish(command().args(small).env("TILEWRIGHT_DEVICE", &selector)).expect(0).saying(&[name]);
    }
    let run = finish(command().args(small).args(["--device", "no-such-device"]))
        .expect(3)
        .saying(&["no-such-device", name]);
    assert!(run.stdout.is_empty());

    // The selector stays in the environment, so no other device can step in.
    let unmet = if device.kind.is_gpu() { "--require-cpu" } else { "--require-gpu" };
    finish(command().args(small).arg(unmet)).expect(3).saying(&[name]);
}
