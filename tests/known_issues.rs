//! Known faults that are not mended yet. Each test asserts today's behaviour, so that it fails when the behaviour
//! changes. It then becomes a test of the right behaviour, among the tests of its kind.

use crate::golden::gltf::{Gltf, Mesh};
use serde_json::json;
use tilewright::scene::{LoadOptions, Scene};

fn load(gltf: Gltf, time: Option<f64>) -> Scene {
    let folder = tempfile::tempdir().unwrap();
    let file = gltf.write(folder.path());
    Scene::load(&folder.path().join(file), &LoadOptions { time }).unwrap_or_else(|e| panic!("{e}"))
}

/// Right: both are drawn, a pixel wide.
#[test]
fn points_and_lines_of_a_scene_are_not_drawn() {
    for mode in [0, 1, 2, 3] {
        let mut gltf = Gltf::new();
        let material = gltf.unlit([1.0; 4]);
        let whole = gltf.mesh(&Mesh::square(0.0, 1.0), material, json!({}));
        gltf.node(json!({ "mesh": whole }));
        let mesh = gltf.mesh(&Mesh::square(0.0, 1.0), material, json!({ "mode": mode }));
        gltf.node(json!({ "mesh": mesh }));
        assert_eq!(load(gltf, None).triangles(), 2, "mode {mode}");
    }
}

/// Right: the animation can be chosen.
#[test]
fn of_several_animations_that_move_a_node_the_first_wins() {
    let mut gltf = Gltf::new();
    let material = gltf.unlit([1.0; 4]);
    let mesh = gltf.mesh(&Mesh::square(0.0, 1.0), material, json!({}));
    let node = gltf.node(json!({ "mesh": mesh }));
    let input = gltf.floats(&[[0.0], [1.0]]);
    for x in [3.0, -5.0] {
        let output = gltf.floats(&[[x, 0.0, 0.0], [x, 0.0, 0.0]]);
        let target = json!({ "node": node, "path": "translation" });
        gltf.add(
            "animations",
            json!({
                "samplers": [{ "input": input, "output": output }],
                "channels": [{ "sampler": 0, "target": target }],
            }),
        );
    }
    let scene = load(gltf, Some(0.5));
    let middle = scene.bounds().center();
    assert!((middle.x - 3.0).abs() < 1e-4, "{middle}");
}
