//! Folders of files that others made: good ones load without a word, bad ones end with a sentence.
//!
//! They are not part of the project; `TILEWRIGHT_SCENES` names the folder that holds them.

use std::{
    path::{Path, PathBuf},
    sync::mpsc,
    time::Duration,
};
use tilewright::{
    Error,
    image::Extent,
    scene::{ColorSpace, LoadOptions, PassOptions, Scene, load_texture},
};

/// The folder `name` of the files, or `None` and a note.
pub fn folder(name: &str) -> Option<PathBuf> {
    let path = std::env::var_os("TILEWRIGHT_SCENES").map(|root| Path::new(&root).join(name));
    let path = path.filter(|path| path.is_dir());
    if path.is_none() {
        crate::did_not_run(
            &format!("scene files under {name}"),
            "set TILEWRIGHT_SCENES to the folder that has them",
        );
    }
    path
}

/// All files below `folder` with one of these extensions, sorted.
pub fn files(folder: &Path, extensions: &[&str]) -> Vec<PathBuf> {
    let (mut found, mut folders) = (Vec::new(), vec![folder.to_path_buf()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).unwrap().flatten() {
            let path = entry.path();
            let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
            if path.is_dir() {
                folders.push(path);
            } else if extensions.contains(&extension.as_str()) {
                found.push(path);
            }
        }
    }
    found.sort();
    found
}

const SCENES: [&str; 3] = ["gltf", "glb", "obj"];

/// Loads `path` and checks a pass of it, at rest and at a moment; a hang fails.
/// After how long a file counts as hanging, on the slowest and busiest machine too.
const HANGS: Duration = Duration::from_secs(30 * 60);

fn load(path: &Path) -> Result<Scene, Error> {
    let (send, receive) = mpsc::channel();
    let owned = path.to_path_buf();
    std::thread::spawn(move || {
        let load = |time| Scene::load(&owned, &LoadOptions { time });
        let scene = load(Some(0.7)).and_then(|moved| {
            draw(&moved);
            let scene = load(None)?;
            draw(&scene);
            Ok(scene)
        });
        // No one listens any more once the time is up.
        let _ = send.send(scene);
    });
    match receive.recv_timeout(HANGS) {
        Ok(result) => result,
        Err(e) => panic!("{}: {e}", path.display()),
    }
}

fn draw(scene: &Scene) {
    let extent = Extent::new(320, 200);
    let options = PassOptions::default();
    let framing = scene.default_camera(extent);
    for camera in scene.cameras().iter().chain([&framing]) {
        super::check(&scene.pass(extent, camera, &options).unwrap());
    }
}

/// Files among the good ones that ask for what no one has, and what the refusal must name.
const REFUSED: [(&str, &str); 2] = [
    ("Compatibility_04.gltf", "2.1"),
    ("Compatibility_05.gltf", "FAKE_materials_quantumRendering"),
];

#[test]
fn good_files_load() {
    for name in ["scenes", "feature-tests", "asset-generator/Positive"] {
        let Some(folder) = folder(name) else { continue };
        for path in files(&folder, &SCENES) {
            let started = std::time::Instant::now();
            let file = path.file_name().unwrap().to_string_lossy();
            let scene = match (load(&path), REFUSED.iter().find(|(name, _)| *name == file)) {
                (Ok(scene), None) => scene,
                (Err(e), Some((_, why))) => {
                    assert!(e.to_string().contains(why), "{e}");
                    continue;
                }
                (Ok(_), Some(_)) => panic!("{file} must be refused"),
                (Err(e), None) => panic!("{e}"),
            };
            println!(
                "{}: {} triangles, {} ms, {:?}",
                path.display(),
                scene.triangles(),
                started.elapsed().as_millis(),
                scene.warnings()
            );
        }
    }
}

#[test]
fn bad_files_load_or_end_with_a_sentence() {
    for name in ["bad-and-odd-input", "asset-generator/Negative"] {
        let Some(folder) = folder(name) else { continue };
        let (mut loaded, mut refused) = (0, 0);
        for path in files(&folder, &SCENES) {
            match load(&path) {
                Ok(scene) => {
                    loaded += 1;
                    println!("{}: loads, {:?}", path.display(), scene.warnings());
                }
                Err(Error::Input { path: named, reason }) => {
                    refused += 1;
                    println!("{}: {reason}", path.display());
                    assert!(named == path && reason.len() > 10, "{}: {reason}", path.display());
                }
                Err(other) => panic!("{}: {other}", path.display()),
            }
        }
        println!("{name}: {loaded} load, {refused} are refused");
        assert!(loaded + refused > 0);
    }
}

#[test]
fn pictures_decode_or_end_with_a_sentence() {
    let Some(folder) = folder("png") else { return };
    for path in files(&folder, &["png"]) {
        // The suite's names start with x for files that are damaged on purpose.
        let damaged = path.file_name().unwrap().to_string_lossy().starts_with('x');
        match load_texture(&path, ColorSpace::Srgb) {
            Ok(texture) => {
                assert!(!damaged, "{} is damaged, but loads", path.display());
                assert_eq!(texture.levels().unwrap()[0].len(), texture.extent().pixels() * 4);
            }
            Err(e) => assert!(damaged, "{e}"),
        }
    }
}
