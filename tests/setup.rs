//! Does set-up install the missing packages, and leave the installed ones alone?

use std::{
    fs,
    os::unix::fs::PermissionsExt as _,
    path::Path,
    process::{Command, Output},
};

#[path = "../glsl/shaderc.rs"]
#[allow(dead_code)] // the build script uses the rest
mod shaderc;

fn script(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// The source of bookworm's backports that set-up derives from `files` of an apt folder, and its ending.
fn derived(files: &[(&str, &str)]) -> Option<(String, String)> {
    let apt = tempfile::tempdir().unwrap();
    fs::create_dir(apt.path().join("sources.list.d")).unwrap();
    for (name, content) in files {
        fs::write(apt.path().join(name), content).unwrap();
    }
    let output = Command::new("bash")
        .args(["-euc", r#". "$0"; backports_source "$1" bookworm && echo "$source_suffix" >&2"#])
        .arg(script("scripts/backports.sh"))
        .arg(apt.path())
        .output()
        .unwrap();
    output.status.success().then(|| (text(&output.stdout), text(&output.stderr).trim().to_owned()))
}

#[test]
fn backports_come_from_the_machines_own_mirror() {
    let one_line = "# the archive\n\
        deb http://other.example/stuff bookworm contrib\n\
        deb [arch=amd64 signed-by=/keys/a.gpg] http://mirror.example/debian bookworm main contrib # all\n\
        deb http://second.example/debian bookworm main\n";
    assert_eq!(
        derived(&[("sources.list", one_line)]),
        Some((
            "deb [arch=amd64 signed-by=/keys/a.gpg] http://mirror.example/debian bookworm-backports main\n"
                .into(),
            "list".into()
        ))
    );

    let deb822 = "Types: deb deb-src\n# a snapshot\nURIs: http://mirror.example/debian\n\
        Suites: bookworm bookworm-updates\nComponents: main contrib\nSigned-By:\n -----BEGIN KEY-----\n .\n abc\n";
    assert_eq!(
        derived(&[("sources.list.d/debian.sources", deb822)]),
        Some((
            "Types: deb\nSuites: bookworm-backports\nComponents: main\n\
             URIs: http://mirror.example/debian\nSigned-By:\n -----BEGIN KEY-----\n .\n abc\n"
                .into(),
            "sources".into()
        ))
    );
}

#[test]
fn sources_that_do_not_fit_are_passed_over() {
    for (name, content) in [
        ("sources.list", "deb http://mirror.example/debian trixie main\n"),
        ("sources.list", "#deb http://mirror.example/debian bookworm main\n"),
        ("sources.list", "deb-src http://mirror.example/debian bookworm main\n"),
        ("sources.list.d/security.list", "deb http://mirror.example/s bookworm-security main\n"),
        (
            "sources.list.d/a.sources",
            "Types: deb\nURIs: http://x.example/d\nSuites: bookworm\nComponents: contrib\n",
        ),
        (
            "sources.list.d/a.sources",
            "Enabled: no\nTypes: deb\nURIs: http://x.example/d\nSuites: bookworm\nComponents: main\n",
        ),
    ] {
        assert_eq!(derived(&[(name, content)]), None, "{content}");
    }
    let second = "Types: deb\nURIs: http://x.example/s\nSuites: bookworm-security\nComponents: main\n\n\
        Types: deb\nURIs: http://x.example/d\nSuites: bookworm\nComponents: main\n";
    let (source, _) = derived(&[("sources.list.d/a.sources", second)]).unwrap();
    assert!(source.contains("URIs: http://x.example/d\n"), "{source}");
}

/// Runs `scripts/setup check` where whatever could change the machine only leaves a mark.
fn setup_with_watched_tools() -> (Output, String) {
    let shims = tempfile::tempdir().unwrap();
    let mark = shims.path().join("mark");
    for tool in ["apt-get", "sudo", "dpkg"] {
        let shim = shims.path().join(tool);
        fs::write(
            &shim,
            format!("#!/bin/sh\necho {tool} \"$@\" >> '{}'\nexit 1\n", mark.display()),
        )
        .unwrap();
        fs::set_permissions(&shim, fs::Permissions::from_mode(0o755)).unwrap();
    }
    let path = format!("{}:{}", shims.path().display(), std::env::var("PATH").unwrap());
    let output =
        Command::new(script("scripts/setup")).arg("check").env("PATH", path).output().unwrap();
    (output, fs::read_to_string(mark).unwrap_or_default())
}

#[test]
fn set_up_changes_nothing_where_all_is_there() {
    let (output, called) = setup_with_watched_tools();
    assert!(
        output.status.success() && called.is_empty(),
        "run scripts/setup first; it wanted: {called}\n{}",
        text(&output.stderr)
    );
}

#[test]
fn set_up_says_what_a_machine_without_rust_lacks() {
    // All the tools that set-up starts with, and no toolchain.
    let tools = tempfile::tempdir().unwrap();
    for tool in ["bash", "env", "dirname", "sed"] {
        let found =
            ["/usr/bin", "/bin"].iter().map(|bin| Path::new(bin).join(tool)).find(|p| p.exists());
        std::os::unix::fs::symlink(found.unwrap(), tools.path().join(tool)).unwrap();
    }
    let output = Command::new(script("scripts/setup"))
        .arg("demo")
        .env("PATH", tools.path())
        .env_remove("SUDO_USER")
        .output()
        .unwrap();
    let said = text(&output.stderr);
    assert_eq!(output.status.code(), Some(3), "{said}");
    assert!(said.contains("no Rust toolchain") && said.lines().count() == 1, "{said}");
}

#[test]
fn set_up_refuses_a_mode_it_does_not_know() {
    let output = Command::new(script("scripts/setup")).arg("everything").output().unwrap();
    assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
}

#[test]
fn the_demo_explains_itself() {
    let output = Command::new(script("demo")).arg("--help").output().unwrap();
    assert!(output.status.success());
    assert!(text(&output.stdout).contains("./demo scene.glb"), "{}", text(&output.stdout));
}

/// Cargo takes a file that is not there as changed, and would build the crate anew each time.
#[test]
fn only_a_library_that_is_there_is_watched() {
    let folder = tempfile::tempdir().unwrap();
    let library = folder.path().join("libshaderc.so");
    assert_eq!(shaderc::watch(&library), None);
    fs::write(&library, "").unwrap();
    let expected = format!("cargo:rerun-if-changed={}", library.display());
    assert_eq!(shaderc::watch(&library), Some(expected));
}
