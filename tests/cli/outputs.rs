//! Where results go.

use super::tool::{command, decode, finish, names, run};
use std::{fs, path::Path, process::Stdio};

const SMALL: [&str; 4] = ["render", "builtin:teapot", "--size", "33x17"];

#[test]
fn a_picture_and_its_figures_say_where_they_come_from() {
    let folder = tempfile::tempdir().unwrap();
    let (picture, stats) = (folder.path().join("out.png"), folder.path().join("stats.json"));
    let run =
        finish(command().args(SMALL).arg("-o").arg(&picture).arg("--stats").arg(&stats)).expect(0);
    assert!(run.stdout.is_empty());

    let png = decode(&fs::read(&picture).unwrap());
    assert_eq!(png.size, (33, 17));
    let text = |key: &str| {
        let found = png.text.iter().find(|(k, _)| k == key);
        found.unwrap_or_else(|| panic!("no {key} in {:?}", png.text)).1.clone()
    };
    assert!(text("Software").starts_with("tilewright "));
    assert_eq!(text("Scene"), "builtin:teapot");

    let stats: serde_json::Value = serde_json::from_slice(&fs::read(&stats).unwrap()).unwrap();
    assert_eq!(stats["schema_version"], 1);
    assert_eq!(stats["scene"], "builtin:teapot");
    assert_eq!(stats["extent"], serde_json::json!([33, 17]));
    assert!(stats["triangles"].as_u64().unwrap() > 1000);
    assert!(stats["draws"].as_u64().unwrap() > 0);
    assert!(stats["stages"].as_array().is_some_and(|stages| !stages.is_empty()));
    let device = stats["device"]["name"].as_str().unwrap();
    assert!(text("Device").contains(device) && run.stderr.contains(device));

    let mut left = names(folder.path());
    left.sort();
    assert_eq!(left, ["out.png", "stats.json"]);
}

#[test]
fn standard_output_takes_the_same_picture() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.png");
    let streamed = run(SMALL.into_iter().chain(["-o", "-"])).expect(0);
    run(SMALL.into_iter().chain(["-o", path.to_str().unwrap()])).expect(0);
    assert_eq!(decode(&streamed.stdout).rgba, decode(&fs::read(path).unwrap()).rgba);
}

#[test]
fn a_place_that_cannot_be_written_is_refused_before_anything_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let nowhere = folder.path().join("no/such/folder/out.png");
    // No driver is there: a run that looked for one would end with 3.
    let refused = |place: &Path| {
        let mut tool = command();
        tool.env("VK_DRIVER_FILES", "nowhere.json").args(["render", "builtin:teapot", "-o"]);
        finish(tool.arg(place)).expect(4)
    };
    refused(&nowhere).saying(&[nowhere.to_str().unwrap(), "there is no folder"]);
    refused(folder.path()).saying(&[folder.path().to_str().unwrap(), "it is a folder"]);
}

#[test]
fn a_failed_run_leaves_the_old_picture() {
    let folder = tempfile::tempdir().unwrap();
    let (picture, scene) = (folder.path().join("out.png"), folder.path().join("broken.glb"));
    fs::write(&picture, b"old").unwrap();
    fs::write(&scene, b"glTF but not really").unwrap();
    finish(command().arg("render").arg(&scene).arg("-o").arg(&picture))
        .expect(4)
        .saying(&["broken.glb"]);
    assert_eq!(fs::read(&picture).unwrap(), b"old");
    assert_eq!(names(folder.path()).len(), 2);
}

/// A triangle whose buffer, material library and texture are files beside it.
#[test]
fn files_of_the_scene_are_never_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    run(["render", "builtin:cube", "--size", "4x4", "-o", at("t.png").to_str().unwrap()]).expect(0);
    fs::write(at("m.mtl"), "newmtl m\nmap_Kd t.png\n").unwrap();
    let obj = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n";
    fs::write(at("s.obj"), obj).unwrap();
    let positions: Vec<u8> =
        [0f32, 0., 0., 1., 0., 0., 0., 1., 0.].iter().flat_map(|f| f.to_le_bytes()).collect();
    fs::write(at("b.bin"), positions).unwrap();
    let gltf = r#"{"asset":{"version":"2.0"},"buffers":[{"uri":"b.bin","byteLength":36}],
        "bufferViews":[{"buffer":0,"byteLength":36}],"images":[{"uri":"t.png"}],"textures":[{"source":0}],
        "materials":[{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}],
        "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]}],
        "meshes":[{"primitives":[{"attributes":{"POSITION":0},"material":0}]}],
        "nodes":[{"mesh":0}],"scenes":[{"nodes":[0]}],"scene":0}"#;
    fs::write(at("s.gltf"), gltf).unwrap();
    let content = |name: &str| fs::read(at(name)).unwrap();
    for (scene, part) in
        [("s.obj", "m.mtl"), ("s.obj", "t.png"), ("s.gltf", "b.bin"), ("s.gltf", "t.png")]
    {
        let (scene, path, before) = (at(scene), at(part), content(part));
        let refused = |line: &[&str], option: &str| {
            let mut tool = command();
            tool.args(line).arg(&scene).args(["--size", "8x8", option]).arg(&path);
            finish(&mut tool).expect(2).saying(&[part, "a file of the scene"]);
            assert_eq!(content(part), before, "{line:?} {part}");
        };
        refused(&["render"], "-o");
        refused(&["render", "-o", at("out.png").to_str().unwrap()], "--stats");
        refused(&["parity"], "--diff");
    }
}

#[cfg(unix)]
#[test]
fn a_device_node_is_written_to_and_not_replaced() {
    run(SMALL.into_iter().chain(["-o", "/dev/null"])).expect(0);
    assert!(!fs::metadata("/dev/null").unwrap().is_file());
}

#[test]
fn a_closed_pipe_is_no_fault() {
    for line in [
        &["devices"][..],
        &["--help"],
        &["render", "builtin:teapot", "--size", "512x512", "-o", "-"],
    ] {
        let mut child =
            command().args(line).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{line:?}: {said}");
        assert!(!said.contains("panicked") && !said.contains("internal error"), "{line:?}: {said}");
    }
}
