//! Invalid command lines, and help.

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
        let run = super::tool::finish(super::tool::command().args(line).current_dir(folder.path()));
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
        &["bench", "--help"],
        &["bench", "show", "--help"],
        &["completions", "--help"],
        &["man", "--help"],
    ] {
        let run = run(line).expect(0);
        assert!(run.stdout_text().contains("Usage: tilewright"), "{line:?}");
        assert!(run.stdout_text().contains("Example"), "{line:?}");
        assert!(run.stderr.is_empty(), "{line:?}");
    }
    assert!(run(["--version"]).expect(0).stdout_text().starts_with("tilewright "));
}

#[test]
fn completions_are_scripts_of_their_shells() {
    for (shell, part) in [
        ("bash", "complete -F _tilewright"),
        ("zsh", "#compdef tilewright"),
        ("fish", "complete -c tilewright"),
        ("elvish", "edit:completion"),
        ("powershell", "Register-ArgumentCompleter"),
    ] {
        let run = run(["completions", shell]).expect(0);
        let script = run.stdout_text();
        for part in [part, "background", "compare", "quiet"] {
            assert!(script.contains(part), "{shell}: {part}");
        }
        assert!(run.stderr.is_empty());
    }
    run(["completions", "tcsh"]).expect(2).saying(&["bash", "zsh", "fish"]);
    run(["completions"]).expect(2).saying(&["SHELL"]);
}

#[test]
fn each_verb_has_a_page_of_the_manual() {
    for (verbs, parts) in [
        (&[][..], ["tilewright 1", "tilewright\\-bench", "Exit codes"]),
        (&["render"], ["tilewright-render 1", "still\\-life", "\\-\\-quiet"]),
        (&["bench", "compare"], ["tilewright-bench-compare 1", "B.json", "Example"]),
        (&["man"], ["tilewright-man 1", "VERB", "Example"]),
    ] {
        let run = run(["man"].iter().chain(verbs)).expect(0);
        let page = run.stdout_text();
        for part in parts {
            assert!(page.contains(part), "{verbs:?}: {part} in {page}");
        }
        assert!(run.stderr.is_empty());
    }
    run(["man", "polish"]).expect(2).saying(&["no verb `polish`", "render", "doctor"]);
    run(["man", "render", "fast"]).expect(2).saying(&["`render` has no verb `fast`"]);
}

#[test]
fn a_quiet_run_says_what_is_wrong_and_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    let render = |name: &str, more: &[&str]| {
        let line = ["render", "builtin:triangle", "--size", "16x16", "-o", name];
        super::tool::finish(super::tool::command().args(line).args(more).current_dir(folder.path()))
    };
    render("x.png", &[]).expect(0).saying(&["device: "]);
    for quiet in ["-q", "--quiet"] {
        let run = render("x.png", &[quiet]).expect(0);
        assert!(run.stderr.is_empty(), "{}", run.stderr);
    }
    // A warning stays, and so does a fault; the option may stand before the verb.
    let run = render("x.jpg", &["--quiet"]).expect(0).saying(&["warning: x.jpg will be a PNG"]);
    assert_eq!(run.stderr.lines().count(), 1, "{}", run.stderr);
    let run = super::tool::run(["--quiet", "render", "missing.glb", "-o", "-"]).expect(4);
    assert!(
        run.stderr.contains("missing.glb") && run.stderr.lines().count() == 1,
        "{}",
        run.stderr
    );
}
