//! Drawing and comparing.

use super::tool::{command, decode, finish, names, run};
use std::fs;
use tilewright::image::{linear_to_srgb, srgb_to_linear};

/// The keys of `parity --json`, all of them and nothing else.
const FIGURES: [&str; 6] = [
    "pixels",
    "coverage_differing",
    "winner_differing",
    "colour_over_1",
    "colour_max",
    "depth_max",
];

#[test]
fn parity_prints_exactly_its_figures() {
    let run = run(["parity", "builtin:teapot", "--size", "320x200", "--json"]).expect(0);
    let figures = run.json();
    let keys: Vec<_> = figures.as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(keys, FIGURES);
    assert_eq!(figures["pixels"], 320 * 200);
    assert_eq!(figures["coverage_differing"], 0);
}

#[test]
fn parity_shows_where_pictures_differ() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("diff.png");
    let line = ["parity", "builtin:teapot", "--size", "64x48", "--diff", path.to_str().unwrap()];
    let run = run(line).expect(0);
    for figure in FIGURES {
        assert!(run.stdout_text().contains(figure), "{figure}: {}", run.stdout_text());
    }
    assert_eq!(decode(&fs::read(&path).unwrap()).size, (64, 48));
    assert_eq!(names(folder.path()), ["diff.png"]);
}

#[test]
fn parity_needs_a_device_that_names_its_triangles() {
    let case = "parity needs a device that names its triangles";
    let Some(gpu) = crate::common::swiftshader(case) else { return };
    assert!(gpu.has_graphics() && !gpu.has_primitive_ids());
    // Said before anything is read or drawn: the scene is not even one.
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    let line = ["parity", scene, "--device", &gpu.info().uuid];
    finish(command().args(line)).expect(3).saying(&[
        &gpu.info().name,
        "gl_PrimitiveID",
        "tilewright devices",
    ]);
}

/// The driver under test has wide vectors where the processor has them: the picture is the same to the
/// byte. (The driver's cache on disk does not tell widths apart, so it is off.)
#[test]
fn the_width_of_subgroups_decides_nothing() {
    if !crate::common::device_under_test().name.contains("llvmpipe") {
        return crate::did_not_run("subgroup widths", "lavapipe, whose width can be chosen");
    }
    for scene in ["builtin:teapot", "builtin:alpha", "builtin:soup-clipped"] {
        let picture = |bits: &str| {
            let mut command = command();
            command.env("LP_NATIVE_VECTOR_WIDTH", bits).env("MESA_SHADER_CACHE_DISABLE", "1");
            command.env("TILEWRIGHT_CACHE", "off");
            let line = ["render", scene, "--size", "323x181", "-o", "-"];
            let run = finish(command.args(line)).expect(0);
            let run = run.saying(&[&format!("{bits} bits")]);
            let picture = decode(&run.stdout);
            (picture.size, picture.rgba)
        };
        let [four, eight, sixteen] = ["128", "256", "512"].map(picture);
        assert!(four == eight, "{scene} depends on subgroups of 4 or 8");
        assert!(sixteen == eight, "{scene} depends on subgroups of 16 or 8");
    }
}

#[test]
fn both_backends_draw_the_teapot() {
    let picture = |backend| {
        let line = ["render", "builtin:teapot", "--size", "96x64", "-o", "-", "--backend", backend];
        decode(&run(line).expect(0).stdout)
    };
    let (compute, classic) = (picture("compute"), picture("classic"));
    let differing = compute.rgba.iter().zip(&classic.rgba).filter(|(a, b)| a.abs_diff(**b) > 1);
    assert!(differing.count() <= 4);
    let colours: std::collections::HashSet<_> = compute.rgba.chunks(4).collect();
    assert!(colours.len() > 50, "the picture is not one colour");
}

#[test]
fn the_background_is_what_was_asked_for() {
    let line = [
        "render",
        "builtin:teapot",
        "--size",
        "8x8",
        "-o",
        "-",
        "--background",
        "33669980",
        "--eye",
        "0,0,9",
        "--target",
        "0,0,10",
    ];
    assert_eq!(decode(&run(line).expect(0).stdout).rgba, [0x33, 0x66, 0x99, 0x80].repeat(64));
}

#[test]
fn a_picture_without_a_background_can_be_laid_over_any() {
    let drawn = |backend, background| {
        let line = ["render", "builtin:alpha", "--size", "120x80", "-o", "-", "--backend", backend];
        let line = line.into_iter().chain(["--background", background]);
        decode(&run(line).expect(0).stdout).rgba
    };
    let ground = [0xff, 0xc0, 0x40];
    let over = |top: u8, bottom: u8, alpha: u8| {
        let [top, bottom, alpha] = [top, bottom, alpha].map(|v| f32::from(v) / 255.0);
        let light = srgb_to_linear(top) * alpha + srgb_to_linear(bottom) * (1.0 - alpha);
        (linear_to_srgb(light) * 255.0).round() as u8
    };
    for backend in ["compute", "classic"] {
        let (alone, whole) = (drawn(backend, "00000000"), drawn(backend, "ffc040"));
        let mut glass = 0;
        for (alone, whole) in alone.chunks(4).zip(whole.chunks(4)) {
            glass += usize::from(!matches!(alone[3], 0 | 255));
            let laid = [0, 1, 2].map(|c| over(alone[c], ground[c], alone[3]));
            let near = laid.iter().zip(whole).all(|(a, b)| a.abs_diff(*b) <= 2);
            assert!(near, "{backend}: {alone:?} over {ground:?} is {laid:?}, drawn {whole:?}");
        }
        assert!(glass > 100, "{backend}: {glass} translucent pixels");
    }
}

#[test]
fn a_camera_that_is_not_there_is_an_error_that_lists_those_that_are() {
    run(["render", "builtin:teapot", "-o", "-", "--camera", "no-such-camera"])
        .expect(2)
        .saying(&["no-such-camera"]);
}

#[test]
fn sizes_that_are_no_multiple_of_anything() {
    for size in ["1x1", "17x13", "1921x3", "3x1079"] {
        let picture = run(["render", "builtin:teapot", "--size", size, "-o", "-"]).expect(0);
        let (width, height) = decode(&picture.stdout).size;
        assert_eq!(format!("{width}x{height}"), size);
        run(["parity", "builtin:teapot", "--size", size]).expect(0);
    }
}

#[test]
fn shaders_are_counted_and_refusals_have_reasons() {
    let folder = tempfile::tempdir().unwrap();
    let shader = |name: &str, body: &str| {
        fs::write(folder.path().join(name), format!("#version 450\n{body}")).unwrap();
    };
    shader("good.vert", "void main() { gl_Position = vec4(0); }");
    shader("bad.frag", "void main() { this is no GLSL; }");
    let line = ["conform", "shaders", folder.path().to_str().unwrap(), "--json"];
    let report = finish(command().args(line));
    assert!(matches!(report.code, Some(0 | 1)), "{}", report.stderr);
    let report = report.json();
    assert_eq!(report["schema_version"], 1);
    assert_eq!((&report["compiled"], &report["spliced"]), (&1.into(), &1.into()));
    assert!(report.to_string().contains("bad.frag"));
}
