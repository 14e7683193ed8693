//! Animations, morph targets and skins: where vertices are at one moment.

use super::loaded::{Case, floats, pass, positions, triangle};
use glam::Vec3;
use tilewright::scene::{LoadOptions, Scene};

/// Appends to the arrays of a document of [`triangle`].
fn extend(text: &str, accessors: &[(&[f32], &str)], rest: &str) -> String {
    let (mut list, mut views, mut buffers) = (String::new(), String::new(), String::new());
    for (i, (values, kind)) in accessors.iter().enumerate() {
        let (uri, length) = floats(values);
        let width = match *kind {
            "SCALAR" => 1,
            "VEC3" => 3,
            "VEC4" => 4,
            _ => 16,
        };
        let (number, count) = (i + 1, values.len() / width);
        list += &format!(
            r#",{{"bufferView":{number},"componentType":5126,"count":{count},"type":"{kind}"}}"#
        );
        views += &format!(r#",{{"buffer":{number},"byteLength":{length}}}"#);
        buffers += &format!(r#",{{"byteLength":{length},"uri":"{uri}"}}"#);
    }
    text.replace(r#""type":"VEC3"}]"#, &format!(r#""type":"VEC3"}}{list}]"#))
        .replace(r#""byteLength":36}]"#, &format!(r#""byteLength":36}}{views}]"#))
        .replace(r#""}]}"#, &format!(r#""}}{buffers}]{rest}}}"#))
}

fn at(text: &str, time: Option<f64>) -> Vec<Vec3> {
    let case = Case::new(&[("a.gltf", text.as_bytes())]);
    let scene = Scene::load(&case.path("a.gltf"), &LoadOptions { time });
    let scene = scene.unwrap_or_else(|e| panic!("{e}"));
    positions(&pass(&scene).draws[0])
}

#[test]
fn an_animation_moves_a_node_and_the_rest_pose_does_not() {
    let animation = r#","animations":[{"samplers":[{"input":1,"output":2}],
        "channels":[{"sampler":0,"target":{"node":0,"path":"translation"}}]}]"#;
    let keys: &[(&[f32], &str)] = &[(&[1.0, 3.0], "SCALAR"), (&[0., 0., 0., 0., 0., 8.], "VEC3")];
    let text = extend(&triangle(r#","translation":[0,5,0]"#, ""), keys, animation);
    assert_eq!(at(&text, None)[0], Vec3::new(0.0, 5.0, 0.0));
    for (time, z) in [(0.0, 0.0), (1.5, 2.0), (3.0, 8.0), (9.0, 8.0)] {
        assert_eq!(at(&text, Some(time))[0], Vec3::new(0.0, 0.0, z), "{time}");
    }
}

#[test]
fn morph_targets_are_weighed_by_node_mesh_and_animation() {
    let target: &[(&[f32], &str)] = &[
        (&[0., 0., 4., 0., 0., 0., 0., 0., 0.], "VEC3"),
        (&[0.0, 2.0], "SCALAR"),
        (&[0.0, 1.0], "SCALAR"),
    ];
    let animation = r#","animations":[{"samplers":[{"input":2,"output":3}],
        "channels":[{"sampler":0,"target":{"node":0,"path":"weights"}}]}]"#;
    let targets = r#","targets":[{"POSITION":1}]"#;
    let first =
        |node: &str, time| at(&extend(&triangle(node, targets), target, animation), time)[0];
    assert_eq!(first("", None), Vec3::ZERO);
    assert_eq!(first(r#","weights":[0.5]"#, None), Vec3::new(0.0, 0.0, 2.0));
    assert_eq!(first(r#","weights":[0.5]"#, Some(0.5)), Vec3::new(0.0, 0.0, 1.0));
}

#[test]
fn joints_place_vertices_whatever_the_node_of_the_mesh_says() {
    // The first vertex hangs on joint 1, the others half on each; joint 0 stays where it was bound.
    let bytes: &[(&[f32], &str)] = &[
        (&[1., 0., 0., 0., 0.5, 0.5, 0., 0., 0.5, 0.5, 0., 0.], "VEC4"),
        (
            &[
                1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., //
                1., 0., 0., 0., 0., 1., 0., 0., 0., 0., 1., 0., 0., -1., 0., 1.,
            ],
            "MAT4",
        ),
    ];
    let joints = super::loaded::uri(&[1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0]);
    let node = r#","skin":0,"translation":[100,0,0]"#;
    let text = triangle(node, "").replace(
        r#""attributes":{"POSITION":0}"#,
        r#""attributes":{"POSITION":0,"WEIGHTS_0":1,"JOINTS_0":3}"#,
    );
    let text = text.replace(
        r#"}],
        "meshes""#,
        r#"},{},{"translation":[0,1,2]}],
        "meshes""#,
    );
    let rest = r#","skins":[{"joints":[1,2],"inverseBindMatrices":2}]"#;
    let text = extend(&text, bytes, rest)
        .replace(
            r#""count":2,"type":"MAT4"}]"#,
            r#""count":2,"type":"MAT4"},
               {"bufferView":3,"componentType":5121,"count":3,"type":"VEC4"}]"#,
        )
        .replace(
            r#"{"buffer":2,"byteLength":128}]"#,
            r#"{"buffer":2,"byteLength":128},{"buffer":3,"byteLength":12}]"#,
        )
        .replace(r#"],"skins""#, &format!(r#",{{"byteLength":12,"uri":"{joints}"}}],"skins""#));
    // Joint 1 was bound at height 1 and is 2 further back: it moves by (0, 0, 2).
    assert_eq!(
        at(&text, None),
        [Vec3::new(0.0, 0.0, 2.0), Vec3::new(1.0, 0.0, 1.0), Vec3::new(0.0, 1.0, 1.0)]
    );
}
