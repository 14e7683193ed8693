//! Command lines that make no sense, and help.

use super::tool::run;

#[test]
fn nonsense_ends_with_2_and_says_what_is_expected() {
    for (line, expected) in [
        (&["polish", "x.glb"][..], "polish"),
        (&["render", "builtin:teapot"], "--output"),
        (&["render", "builtin:teapot", "-o", "x.png", "--size", "0x5"], "like 1920x1080"),
        (&["render", "builtin:teapot", "-o", "x.png", "--size", "16385x5"], "16384"),
        (&["render", "builtin:teapot", "-o", "x.png", "--eye", "1,2"], "three numbers"),
        (&["render", "builtin:teapot", "-o", "x.png", "--eye", "1,2,3"], "--target"),
        (&["render", "builtin:teapot", "-o", "x.png", "--fov", "180"], "degrees"),
        (&["render", "builtin:teapot", "-o", "x.png", "--background", "red"], "hexadecimal"),
        (&["render", "builtin:teapot", "-o", "x.png", "--backend", "magic"], "compute"),
        (&["render", "builtin:teapot", "-o", "x.png", "--time", "soon"], "seconds"),
        (&["render", "builtin:teapot", "-o", "x.png", "--timeout", "0"], "more than 0"),
        (
            &["render", "builtin:teapot", "-o", "x.png", "--require-gpu", "--require-cpu"],
            "--require",
        ),
        (&["parity", "builtin:teapot", "--diff", "-"], "--diff"),
        (&["conform"], "shaders"),
        (&["render", "builtin:no-such-scene", "-o", "x.png"], "no-such-scene"),
        (
            &["render", "builtin:teapot", "-o", "x.png", "--eye", "0,0,0", "--target", "0,0,0"],
            "same point",
        ),
    ] {
        // In a folder of its own, since `x.png` is a good place to write to.
        let folder = tempfile::tempdir().unwrap();
        let run = super::tool::finish(
            super::tool::command().args(line).current_dir(folder.path()),
            std::time::Duration::from_secs(60),
        );
        let run = run.expect(2).saying(&[expected]);
        assert!(run.stdout.is_empty(), "{line:?}");
        assert!(super::tool::names(folder.path()).is_empty(), "{line:?}");
    }
}

#[test]
fn help_goes_to_standard_output() {
    for line in [
        &["--help"][..],
        &["render", "--help"],
        &["parity", "--help"],
        &["conform", "shaders", "--help"],
        &["devices", "--help"],
        &["doctor", "--help"],
    ] {
        let run = run(line).expect(0);
        assert!(run.stdout_text().contains("Usage: tilewright"), "{line:?}");
        assert!(run.stdout_text().contains("Example"), "{line:?}");
        assert!(run.stderr.is_empty(), "{line:?}");
    }
    assert!(run(["--version"]).expect(0).stdout_text().starts_with("tilewright "));
}
