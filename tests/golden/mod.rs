//! Did the picture change? Small scenes, each with one feature of materials, cameras or order, against
//! pictures that a person has looked at. Parity cannot see faults of these: a wrong camera is wrong for both
//! executors.
//!
//! A picture that differs leaves `NAME.DEVICE.new.png`, the new drawing, and `NAME.DEVICE.diff.png`, which shows
//! the differences, beside the golden one. Each device has files of its own, and a device that draws the right
//! picture leaves the files of the others alone. If you have looked at the new one and want it, accept it with
//!
//! ```sh
//! TILEWRIGHT_GOLDEN=accept cargo test --release --features glsl golden
//! ```
//!
//! Pictures are written by that command alone, and never where the variable `CI` is set.

pub mod gltf;
mod materials;
mod scenes;

use crate::common::{gpu, on_each_gpu};
use std::{
    cell::RefCell,
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};
use tilewright::{
    compute,
    image::Extent,
    scene::{LoadOptions, PassOptions, Scene},
    vk::Gpu,
};

/// Large enough to see what is drawn, small enough for a few kilobytes each.
const SIZE: Extent = Extent::new(128, 96);

/// How exactly a picture is drawn again, on any device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Rule {
    /// Every byte: coverage, depth and the winner are exact by the engine's own rules, and colours are
    /// constants or nearest texels, encoded by the engine.
    Exact,
    /// Shaders compute the colour: Vulkan allows a few units in the last place for each operation, square
    /// roots and exponentials more, and a sum of them moves a channel by 2 of 255 at most.
    Shaded,
    /// Textures are filtered: Vulkan leaves the precision of weights and of the level of detail to the
    /// device (8 bits of fraction are usual), which moves a channel further where texels differ much.
    Filtered,
    /// As [`Rule::Shaded`], with highlights whose slope is so steep that the last place of a normal shows.
    Glossy,
}

impl Rule {
    /// The largest difference of a channel, of 255, and how many pixels may be off by more.
    const fn limits(self) -> (u8, usize) {
        match self {
            Rule::Exact => (0, 0),
            Rule::Shaded => (2, 0),
            Rule::Filtered => (6, 12),
            Rule::Glossy => (3, 12),
        }
    }
}

/// A scene in a folder of its own, and how it is seen.
struct Golden {
    name: &'static str,
    rule: Rule,
    /// Writes the scene into the folder and returns the name of its file, or of a built-in scene.
    write: fn(&Path) -> String,
    /// Time of the animation.
    time: Option<f64>,
}

impl Golden {
    fn draw(&self, gpu: &Gpu) -> Vec<u8> {
        let folder = tempfile::tempdir().unwrap();
        let file = (self.write)(folder.path());
        let scene = match file.strip_prefix("builtin:") {
            Some(name) => Scene::builtin(name),
            None => Scene::load(&folder.path().join(file), &LoadOptions { time: self.time }),
        };
        let scene = scene.unwrap_or_else(|e| panic!("{}: {e}", self.name));
        let camera = scene.default_camera(SIZE);
        let pass = scene.pass(SIZE, &camera, &PassOptions::default()).unwrap();
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let frame = renderer.render(&pass).unwrap_or_else(|e| panic!("{}: {e}", self.name));
        frame.into_color().expect("a colour target").bytes
    }
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/pictures")
}

/// Whether new pictures are to be accepted.
fn accepts() -> bool {
    let asked = std::env::var("TILEWRIGHT_GOLDEN").is_ok_and(|value| value == "accept");
    assert!(
        !asked || std::env::var_os("CI").is_none(),
        "CI accepts no pictures, because no person looks at them"
    );
    asked
}

#[test]
fn pictures_are_those_that_were_looked_at() {
    let accepts = accepts();
    let faults = RefCell::new(Vec::new());
    on_each_gpu("golden pictures", |gpu| {
        let device = device(&gpu.info().name);
        let first = device != "swiftshader";
        for golden in all() {
            let drawn = golden.draw(gpu);
            let path = folder().join(format!("{}.png", golden.name));
            if accepts && first {
                write(&path, &drawn);
            }
            if let Err(fault) = compare(&golden, &path, &device, &drawn) {
                faults.borrow_mut().push(format!(
                    "{} on {}: {fault}",
                    golden.name,
                    gpu.info().name
                ));
            }
        }
    });
    let faults = faults.into_inner();
    assert!(
        faults.is_empty(),
        "{}\nLook at NAME.DEVICE.new.png and NAME.DEVICE.diff.png in {}. If the new pictures are right, accept them:\n  \
         TILEWRIGHT_GOLDEN=accept cargo test --release --features glsl golden",
        faults.join("\n"),
        folder().display()
    );
}

/// A device in the names of files.
fn device(name: &str) -> String {
    match name {
        _ if name.contains("SwiftShader") => "swiftshader".into(),
        _ if name.contains("llvmpipe") => "lavapipe".into(),
        _ => name.to_lowercase().replace(|c: char| !c.is_ascii_alphanumeric(), "-"),
    }
}

/// Holds `drawn` by `device` against the picture at `path`; what differs is left beside it.
fn compare(golden: &Golden, path: &Path, device: &str, drawn: &[u8]) -> Result<(), String> {
    let [new, diff] =
        ["new.png", "diff.png"].map(|ending| path.with_extension(format!("{device}.{ending}")));
    let Ok(expected) = fs::read(path) else {
        write(&new, drawn);
        return Err("there is no golden picture yet".into());
    };
    let expected = crate::cli::tool::decode(&expected).rgba;
    let deltas: Vec<[u8; 4]> = expected
        .chunks_exact(4)
        .zip(drawn.chunks_exact(4))
        .map(|(a, b)| std::array::from_fn(|channel| a[channel].abs_diff(b[channel])))
        .collect();
    let (limit, may_exceed) = golden.rule.limits();
    let largest = |delta: &[u8; 4]| delta.iter().copied().max().unwrap_or(0);
    let over = deltas.iter().filter(|delta| largest(delta) > limit).count();
    if expected.len() == drawn.len() && over <= may_exceed {
        for stale in [new, diff] {
            let _ = fs::remove_file(stale);
        }
        return Ok(());
    }
    write(&new, drawn);
    // Differences show: each is amplified until the largest is white.
    let most = deltas.iter().map(largest).max().unwrap_or(0).max(1);
    let amplified = |value: u8| (u32::from(value) * 255 / u32::from(most)) as u8;
    let picture: Vec<u8> = deltas
        .iter()
        .flat_map(|[r, g, b, a]| [amplified(*r.max(a)), amplified(*g), amplified(*b), 255])
        .collect();
    write(&diff, &picture);
    Err(format!(
        "{over} pixels are off by more than {limit} of 255, {may_exceed} may be ({:?}); the largest \
         difference is {most}",
        golden.rule
    ))
}

fn write(path: &Path, rgba: &[u8]) {
    use tilewright::{
        format::Format,
        image::{Picture, png::write_png},
    };
    let image = Picture { extent: SIZE, format: Format::Rgba8Srgb, bytes: rgba.to_vec() };
    write_png(&image, &[], fs::File::create(path).unwrap()).unwrap();
}

fn all() -> Vec<Golden> {
    let mut all = scenes::all();
    all.extend(materials::all());
    all
}

#[test]
fn each_picture_has_its_scene_and_they_are_small() {
    let scenes: BTreeSet<String> =
        all().iter().map(|golden| format!("{}.png", golden.name)).collect();
    assert_eq!(scenes.len(), all().len(), "two scenes have one name");
    assert!(scenes.len() >= 20, "{}", scenes.len());
    let (mut pictures, mut bytes) = (BTreeSet::new(), 0);
    for entry in fs::read_dir(folder()).unwrap() {
        let entry = entry.unwrap();
        let name = entry.file_name().to_string_lossy().into_owned();
        if !name.ends_with(".new.png") && !name.ends_with(".diff.png") {
            pictures.insert(name);
            bytes += entry.metadata().unwrap().len();
        }
    }
    assert_eq!(pictures, scenes);
    assert!(bytes < 300_000, "{bytes} bytes of pictures");
}

/// A change of the picture is found, said and left to be looked at.
#[test]
fn a_picture_that_differs_leaves_what_is_needed_to_judge_it() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("x.png");
    let golden = |rule| Golden { name: "x", rule, write: |_| String::new(), time: None };
    let [first, second] = ["llvmpipe (LLVM 15)", "SwiftShader Device"].map(device);
    let mut drawn = vec![100; SIZE.pixels() * 4];
    let fault = compare(&golden(Rule::Exact), &path, &first, &drawn).unwrap_err();
    assert!(fault.contains("no golden picture"), "{fault}");
    let exists = |name: &str| folder.path().join(name).exists();
    assert!(exists("x.lavapipe.new.png"));
    write(&path, &drawn);
    compare(&golden(Rule::Exact), &path, &first, &drawn).unwrap();
    assert!(!exists("x.lavapipe.new.png"), "what is stale goes");
    let right = drawn.clone();
    drawn[4..8].copy_from_slice(&[102, 100, 99, 100]);
    compare(&golden(Rule::Shaded), &path, &first, &drawn).unwrap();
    let fault = compare(&golden(Rule::Exact), &path, &first, &drawn).unwrap_err();
    assert!(fault.contains("1 pixels") && fault.contains("difference is 2"), "{fault}");
    let mut others = right.clone();
    others[0] = 0;
    compare(&golden(Rule::Exact), &path, &second, &others).unwrap_err();
    compare(&golden(Rule::Exact), &path, &second, &right).unwrap();
    assert!(!exists("x.swiftshader.new.png") && !exists("x.swiftshader.diff.png"));
    // What the second device drew touches nothing that the first left.
    let left =
        |name: &str| crate::cli::tool::decode(&fs::read(folder.path().join(name)).unwrap()).rgba;
    assert_eq!(left("x.lavapipe.new.png"), drawn);
    assert_eq!(left("x.lavapipe.diff.png")[4..8], [255, 0, 127, 255]);
}

/// The driver under test is the one whose pictures are accepted.
#[test]
fn pictures_are_drawn_the_same_twice() {
    let gpu = gpu();
    let golden = &all()[0];
    assert_eq!(golden.draw(&gpu), golden.draw(&gpu));
}
