//! Users' cases: a command line, an environment, and the outcome.

use super::tool::{Run, command, decode, finish};
use std::{
    fs,
    path::Path,
    process::{Command, Stdio},
};

fn render(scene: impl AsRef<std::ffi::OsStr>, more: &[&str]) -> Run {
    let mut command = command();
    command.arg("render").arg(scene).args(["--size", "32x32", "-o", "-"]).args(more);
    finish(&mut command)
}

/// A quad from -1 to 1 in the plane z = 0.
const QUAD: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nf 1 2 3 4\n";

#[test]
fn the_same_scene_by_two_paths_gives_the_same_bytes() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("sub")).unwrap();
    let (one, two) = (folder.path().join("a.obj"), folder.path().join("sub/../a.obj"));
    fs::write(&one, QUAD).unwrap();
    let [by_one, by_two] = [&one, &two].map(|path| render(path, &[]).expect(0).stdout);
    assert!(by_one == by_two);
    let text = decode(&by_one).text;
    assert!(text.contains(&("Scene".into(), "a.obj".into())), "{text:?}");
    let plain = render(&one, &["--no-metadata"]).expect(0);
    assert!(decode(&plain.stdout).text.is_empty());
    assert_eq!(decode(&plain.stdout).rgba, decode(&by_one).rgba);
}

#[cfg(unix)]
#[test]
fn paths_that_are_no_utf_8_are_opened() {
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let name = |bytes: &[u8]| folder.path().join(std::ffi::OsStr::from_bytes(bytes));
    let (scene, picture, stats) = (name(b"caf\xe9.obj"), name(b"caf\xe9.png"), name(b"\xff.json"));
    fs::write(&scene, QUAD).unwrap();
    let small = ["--size", "16x16"];
    let mut line = command();
    line.arg("render").arg(&scene).args(small).arg("-o").arg(&picture).arg("--stats").arg(&stats);
    finish(&mut line).expect(0);
    assert!(picture.is_file() && stats.is_file());
    let diff = name(b"\xfe.png");
    finish(command().arg("parity").arg(&scene).args(small).arg("--diff").arg(&diff)).expect(0);
    assert!(diff.is_file());
    finish(command().arg("render").arg(name(b"no\xe9.obj")).args(["-o", "x.png"]))
        .expect(4)
        .saying(&["no such file"]);
}

#[test]
fn a_picture_with_nothing_in_it_is_warned_of() {
    let folder = tempfile::tempdir().unwrap();
    let scene = folder.path().join("a.obj");
    fs::write(&scene, QUAD).unwrap();
    let away = ["--eye", "0,0,3", "--target", "0,0,9"];
    render(&scene, &away).expect(0).saying(&["warning: the camera sees nothing"]);
    let aside = ["--eye", "0,0,3", "--target", "0,2.2,0", "--fov", "20"];
    let toward = ["--eye", "0,0,3", "--target", "0,0,0"];
    assert!(render(&scene, &aside).expect(0).stderr.contains("warning"));
    assert!(!render(&scene, &toward).expect(0).stderr.contains("warning"));
    // In front of the camera, and between two pixels.
    fs::write(&scene, "v -1 -1 0\nv 1 -1 0\nv 1 -1.000001 0\nf 1 2 3\n").unwrap();
    render(&scene, &toward).expect(0).saying(&["warning: nothing of the scene is visible"]);
    // What is blended writes no depth. All over the picture, it leaves one colour.
    let places = [-90f32, -90.0, 0.0, 90.0, -90.0, 0.0, 0.0, 180.0, 0.0];
    let bytes: Vec<u8> = places.into_iter().flat_map(f32::to_le_bytes).collect();
    fs::write(folder.path().join("a.bin"), bytes).unwrap();
    let scene = folder.path().join("a.gltf");
    let background = ["--eye", "0,0,3", "--target", "0,0,0", "--background", "#ff0000"];
    for line in [&toward[..], &background] {
        for (alpha, is_warned_of) in [("0.5", false), ("0.0", true)] {
            fs::write(&scene, BLENDED.replace("ALPHA", alpha)).unwrap();
            let said = render(&scene, line).expect(0).stderr;
            assert_eq!(said.contains("nothing of the scene"), is_warned_of, "{alpha}: {said}");
        }
    }
}

/// A blue triangle in the plane z = 0, blended and unlit.
const BLENDED: &str = r#"{"asset":{"version":"2.0"},"nodes":[{"mesh":0}],
    "meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]}],
    "materials":[{"alphaMode":"BLEND","extensions":{"KHR_materials_unlit":{}},
        "pbrMetallicRoughness":{"baseColorFactor":[0,0,1,ALPHA]}}],
    "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}],
    "bufferViews":[{"buffer":0,"byteLength":36}],
    "buffers":[{"byteLength":36,"uri":"a.bin"}]}"#;

/// Runs `line` by a shell that has done `redirect` to it.
#[cfg(unix)]
fn redirected(line: &[&str], redirect: &str) -> Run {
    let tool = command();
    let mut shell = Command::new("sh");
    shell.arg("-c").arg(format!("exec \"$0\" \"$@\" {redirect}"));
    shell.arg(tool.get_program()).args(line);
    shell.envs(tool.get_envs().filter_map(|(name, value)| Some((name, value?))));
    finish(&mut shell)
}

#[cfg(target_os = "linux")]
#[test]
fn a_standard_output_that_takes_nothing_ends_with_4() {
    let picture = ["render", "builtin:teapot", "--size", "16x16", "-o", "-"];
    let parity = ["parity", "builtin:teapot", "--size", "16x16"];
    let json = [&parity[..], &["--json"]].concat();
    for line in [
        &["--help"][..],
        &["render", "--help"],
        &["--version"],
        &["devices"],
        &["devices", "--json"],
        &["doctor"],
        &["bench", "--list"],
        &parity,
        &json,
        &picture,
        &["render", "builtin:teapot", "--size", "16x16", "-o", "/dev/stdout"],
    ] {
        for redirect in [">&-", ">/dev/full"] {
            let run = redirected(line, redirect).expect(4);
            assert!(run.stderr.contains("standard output"), "{line:?} {redirect}: {}", run.stderr);
        }
    }
    // Output that is thrown away on purpose is no fault, however it is opened.
    for redirect in [">/dev/null", "1<>/dev/null"] {
        redirected(&picture, redirect).expect(0);
    }
    // Messages on a closed standard error are lost.
    for redirect in ["2>&-", "2>/dev/full"] {
        assert_eq!(decode(&redirected(&picture, redirect).expect(0).stdout).size, (16, 16));
    }
}

#[cfg(target_os = "linux")]
#[test]
fn pictures_go_where_any_file_goes() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let line = |out: &Path| {
        let mut line = command();
        line.args(["render", "builtin:teapot", "--size", "16x16", "-o"]).arg(out);
        line
    };
    // Into a pipe, while somebody reads.
    let made = Command::new("mkfifo").arg(at("pipe")).status().expect("mkfifo is there");
    assert!(made.success());
    let pipe = at("pipe");
    let reader = std::thread::spawn(move || fs::read(pipe).unwrap());
    finish(&mut line(&at("pipe"))).expect(0);
    assert_eq!(decode(&reader.join().unwrap()).size, (16, 16));
    // To standard output by its name: the file that it is gets the picture.
    let file = fs::File::create(at("out")).unwrap();
    let status = line(Path::new("/dev/stdout"))
        .stdout(Stdio::from(file))
        .stderr(Stdio::null())
        .status()
        .unwrap();
    assert!(status.success());
    assert_eq!(decode(&fs::read(at("out")).unwrap()).size, (16, 16));
    // Where nothing can be made.
    finish(&mut line(Path::new("/proc/out.png"))).expect(4).saying(&["/proc/out.png"]);
}

#[test]
fn faults_of_the_drivers_variables_are_named() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::write(at("broken.json"), "{ \"ICD\": ").unwrap();
    fs::write(at("other.json"), "{}").unwrap();
    fs::create_dir(at("empty")).unwrap();
    fs::create_dir(at("full")).unwrap();
    fs::write(at("full/bad.json"), "no").unwrap();
    for (value, said) in [
        ("", "is empty"),
        ("broken.json", "broken.json is no JSON"),
        ("other.json", "other.json names no library"),
        ("gone.json", "gone.json cannot be read"),
        ("empty", "is a folder without .json files"),
        ("full", "bad.json is no JSON"),
    ] {
        let path = if value.is_empty() { value.into() } else { at(value) };
        for name in ["VK_ICD_FILENAMES", "VK_DRIVER_FILES"] {
            let mut command = command();
            command.args(["render", "builtin:teapot", "-o", "-"]);
            command.env_remove("VK_ICD_FILENAMES").env_remove("VK_DRIVER_FILES");
            command.env_remove("TILEWRIGHT_VALIDATION").env(name, &path);
            let run = finish(&mut command).expect(3).saying(&[name, said, "unset"]);
            assert!(run.stdout.is_empty());
        }
    }
}

#[cfg(target_os = "linux")]
#[test]
fn too_little_address_space_ends_with_6() {
    for (kib, line) in [
        (400_000, &["render", "builtin:teapot", "--size", "16x16", "-o", "-"][..]),
        (600_000, &["parity", "builtin:teapot", "--size", "16x16"]),
        (800_000, &["devices"]),
    ] {
        let tool = command();
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(format!("ulimit -v {kib}; exec \"$0\" \"$@\""));
        shell.arg(tool.get_program()).args(line);
        finish(&mut shell).expect(6).saying(&["ulimit -v", &kib.to_string()]);
    }
}

/// The buffers of the targets get their addresses and no memory behind them, or the host has no room for the picture.
#[cfg(target_os = "linux")]
#[test]
fn a_picture_that_memory_is_too_small_for_ends_with_6() {
    for (kib, size) in
        [(2_000_000, "16384x16384"), (4_000_000, "16384x16384"), (1_500_000, "8000x8000")]
    {
        let tool = command();
        let mut shell = Command::new("sh");
        shell.arg("-c").arg(format!("ulimit -v {kib}; exec \"$0\" \"$@\""));
        shell.arg(tool.get_program()).args([
            "render",
            "builtin:triangle",
            "-o",
            "-",
            "--size",
            size,
        ]);
        finish(&mut shell).expect(6).saying(&["use a smaller size"]);
    }
}
