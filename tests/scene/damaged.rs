//! Good files with random damage: whatever comes of it, it is a scene or a sentence.

use super::{check, files};
use std::path::Path;
use tilewright::{
    Error,
    image::Extent,
    scene::{LoadOptions, PassOptions, Scene},
};

/// Numbers from a seed (xorshift).
struct Random(u64);

impl Random {
    fn below(&mut self, n: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % n.max(1)
    }
}

/// Changes a few places: numbers of the text become others, bytes flip, pieces go or come twice.
fn damage(bytes: &[u8], random: &mut Random) -> Vec<u8> {
    let mut out = bytes.to_vec();
    for _ in 0..1 + random.below(3) {
        if out.is_empty() {
            break;
        }
        let at = random.below(out.len());
        match random.below(8) {
            0 => out[at] ^= 1 << random.below(8),
            1 => drop(out.splice(at..(at + random.below(9)).min(out.len()), [])),
            2 => {
                let piece = out[at..(at + random.below(30)).min(out.len())].to_vec();
                out.splice(at..at, piece);
            }
            _ => {
                let numbers = ["0", "1", "-1", "3", "255", "65536", "4294967295", "1e30", "5126"];
                let Some(digit) = out[at..].iter().position(u8::is_ascii_digit) else { continue };
                let start = at + digit;
                let end = out[start..].iter().position(|b| !b.is_ascii_digit());
                let end = end.map_or(out.len(), |n| start + n);
                out.splice(start..end, numbers[random.below(numbers.len())].bytes());
            }
        }
    }
    out
}

fn load(path: &Path) -> Result<(), Error> {
    let scene = Scene::load(path, &LoadOptions { time: Some(0.5) })?;
    let extent = Extent::new(16, 16);
    let camera = scene.default_camera(extent);
    // A camera may have become one that sees nothing; the pass says so.
    match scene.pass(extent, &camera, &PassOptions::default()) {
        Ok(pass) => check(&pass),
        Err(Error::Usage(_)) => {}
        Err(other) => return Err(other),
    }
    Ok(())
}

fn try_damaged(name: &str, bytes: &[u8], folder: &Path, rounds: u64) {
    let path = folder.join(format!("damaged-{name}"));
    for round in 0..rounds {
        let seed = 0x5eed_0000 + round;
        let damaged = damage(bytes, &mut Random(seed));
        std::fs::write(&path, &damaged).unwrap();
        let outcome = std::panic::catch_unwind(|| load(&path));
        match outcome {
            Ok(Ok(()) | Err(Error::Input { .. })) => {}
            Ok(Err(other)) => panic!("{name}, seed {seed}: {other}"),
            Err(_) => panic!("{name}, seed {seed}: it panics"),
        }
    }
}

#[test]
fn damaged_files_of_our_own() {
    let folder = tempfile::tempdir().unwrap();
    let gltf = super::loaded::triangle(r#","rotation":[0,0,0,1],"children":[]"#, r#","mode":4"#);
    try_damaged("a.gltf", gltf.as_bytes(), folder.path(), 600);
    let obj = b"v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvn 0 0 1\n\
        usemtl a\ns 1\nf 1/1/1 2/2/1 3/3/1 4/3/1\nf -4//1 -3//1 -2//1\ng b\nf 1 2 3 4\n";
    try_damaged("a.obj", obj, folder.path(), 600);
}

#[test]
fn damaged_files_of_others() {
    let Some(source) = files::folder("feature-tests") else { return };
    let folder = tempfile::tempdir().unwrap();
    for name in [
        "BoxAnimated/BoxAnimated.glb",
        "BoxInterleaved/BoxInterleaved.glb",
        "SimpleMorph/SimpleMorph.gltf",
        "SimpleSparseAccessor/SimpleSparseAccessor.gltf",
        "MorphPrimitivesTest/MorphPrimitivesTest.glb",
        "NegativeScaleTest/NegativeScaleTest.glb",
        "TextureTransformTest/TextureTransformTest.gltf",
        "MeshPrimitiveModes/MeshPrimitiveModes.gltf",
    ] {
        let path = source.join(name);
        let bytes = std::fs::read(&path).unwrap();
        let file = path.file_name().unwrap().to_string_lossy().into_owned();
        try_damaged(&file, &bytes, folder.path(), 150);
    }
}
