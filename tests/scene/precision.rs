//! The same picture wherever a scene lies and whatever its unit is.

use super::loaded::{Case, clip_positions, floats, pass, positions, triangle, triangle_of, uri};
use glam::{DVec3, Vec3};
use tilewright::{
    image::Extent,
    pass::Pass,
    scene::{PassOptions, Scene},
    state::FrontFace,
};

/// Not square, so that the sides cannot be mixed up.
const EXTENT: Extent = Extent::new(160, 90);

/// The scene as its own camera sees it, or one that frames it.
fn framed(scene: &Scene) -> Pass {
    scene.pass(EXTENT, &scene.default_camera(EXTENT), &PassOptions::default()).unwrap()
}

/// Where on the screen and how deep everything lies: what a picture is made of.
fn places(scene: &Scene) -> Vec<DVec3> {
    let pass = framed(scene);
    assert!(!pass.draws.is_empty());
    let places = pass.draws.iter().flat_map(clip_positions);
    places
        .map(|clip| {
            assert!((1e-4..1e4).contains(&clip.w), "the stages get {clip}");
            clip.truncate() / clip.w
        })
        .collect()
}

#[track_caller]
fn assert_same(found: &[DVec3], expected: &[DVec3], why: &str) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        // A thousandth of a pixel of a picture of 2000.
        assert!(found.abs_diff_eq(*expected, 1e-6), "{why}: {found}, not {expected}");
    }
}

/// The scene of a document.
fn gltf(text: &str) -> Scene {
    Case::new(&[("a.gltf", text.as_bytes())]).load("a.gltf")
}

#[test]
fn a_node_far_away_is_seen_as_at_the_origin() {
    let small = &[0., 0., 0., 0.1, 0., 0., 0., 0.1, 0.1];
    let expected = places(&gltf(&triangle_of(small, "", "")));
    for node in [
        r#","translation":[500000,4649776,100]"#,
        // Not a single-precision number, as coordinates of surveys are.
        r#","translation":[500000.37,4649776.123,-7.7]"#,
        r#","translation":[1e12,-1e12,1e11]"#,
        r#","matrix":[1,0,0,0,0,1,0,0,0,0,1,0,500000.37,4649776.123,100,1]"#,
    ] {
        let wide = if node.contains("1e12") { 1e-2 } else { 1e-6 };
        let found = places(&gltf(&triangle_of(small, node, "")));
        for (found, expected) in found.iter().zip(&expected) {
            assert!(found.abs_diff_eq(*expected, wide), "{node}: {found}, not {expected}");
        }
    }
}

#[test]
fn nodes_far_away_keep_their_distance() {
    // Two parts a tenth apart, each placed by its own coordinates, and one below a parent far away.
    let text = triangle("", "").replace(
        r#""nodes":[{"mesh":0}]"#,
        r#""nodes":[{"mesh":0,"translation":[4649776.3,0,0]},{"mesh":0,"translation":[4649776.4,0,0]},
            {"translation":[4649776,0,0],"children":[3]},{"mesh":0,"translation":[0.5,0,0]}]"#,
    );
    let scene = gltf(&text);
    let near = scene.camera_at(
        DVec3::new(4649776.3, 0.0, 1.0),
        DVec3::new(4649776.3, 0.0, 0.0),
        DVec3::Y,
        1.0,
    );
    let all = PassOptions { cull: false, ..PassOptions::default() };
    let pass = scene.pass(EXTENT, &near, &all).unwrap();
    let mut x: Vec<f64> =
        pass.draws.iter().map(|d| clip_positions(d)[0]).map(|c| c.x / c.w).collect();
    x.sort_by(f64::total_cmp);
    let [a, b, c] = x[..] else { panic!("{x:?}") };
    // Two parts in a row of distances 0.1 and 0.1.
    assert!((b - a - (c - b)).abs() < 1e-6 && b - a > 0.05, "{x:?}");
}

#[test]
fn vertices_far_away_are_seen_as_at_the_origin() {
    let plain = [0., 0., 0., 8., 0., 0., 0., 8., 4.];
    let far = plain.map(|v: f32| v + 1e7);
    let normals = floats(&[0., 0., 1., 0., 0., 1., 0., 0., 1.]).0;
    for with_normals in [false, true] {
        let scene = |coordinates: &[f32; 9]| {
            let text = triangle_of(coordinates, "", "");
            // With normals the file's own bytes are drawn, without them they are worked on.
            gltf(&match with_normals {
                false => text,
                true => text
                    .replace(r#""POSITION":0"#, r#""POSITION":0,"NORMAL":1"#)
                    .replace(
                        r#""type":"VEC3"}]"#,
                        r#""type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"}]"#,
                    )
                    .replace(r#""byteLength":36}]"#, r#""byteLength":36},{"buffer":1,"byteLength":36}]"#)
                    .replace(r#""}]}"#, &format!(r#""}},{{"byteLength":36,"uri":"{normals}"}}]}}"#)),
            })
        };
        assert_same(&places(&scene(&far)), &places(&scene(&plain)), "at 1e7");
    }
}

#[test]
fn vertices_far_away_that_primitives_share_are_stored_once() {
    // Unlit, so that the file's own bytes are drawn without normals.
    let primitive = r#"{"attributes":{"POSITION":0}}"#;
    let drawn = r#"{"attributes":{"POSITION":0},"material":0}"#;
    let unlit = r#"{"materials":[{"extensions":{"KHR_materials_unlit":{}}}],"asset""#;
    let text = triangle_of(&[0., 0., 0., 8., 0., 0., 0., 8., 4.].map(|v| v + 1e7), "", "");
    let text = text.replace(r#"{"asset""#, unlit);
    let stored = |count: usize| {
        let pass = framed(&gltf(&text.replace(primitive, &vec![drawn; count].join(","))));
        let ranges: Vec<_> = pass.draws.iter().map(|draw| &draw.vertex_buffers[0]).collect();
        assert_eq!(ranges.len(), count);
        assert!(ranges.iter().all(|range| range.offset == ranges[0].offset), "{ranges:?}");
        ranges[0].buffer.len()
    };
    assert_eq!(stored(9), stored(1));
}

#[test]
fn the_unit_of_a_scene_decides_nothing() {
    let obj = |unit: &str| {
        let text = format!(
            "v 0 0 0\nv 1{unit} 0 0\nv 1{unit} 2{unit} 0\nv 0 2{unit} 3{unit}\nf 1 2 3 4\n"
        );
        Case::new(&[("a.obj", text.as_bytes())]).load("a.obj")
    };
    let expected = places(&obj(""));
    for unit in ["e-30", "e-20", "e-7", "e7", "e10", "e30", "e37"] {
        assert_same(&places(&obj(unit)), &expected, unit);
    }
    let expected = places(&gltf(&triangle("", "")));
    for unit in ["1e-40", "1e-30", "1e-7", "1e10", "1e30", "1e100"] {
        // By the node alone, by the vertices alone, and by both against each other.
        let node = format!(r#","scale":[{unit},{unit},{unit}]"#);
        assert_same(&places(&gltf(&triangle(&node, ""))), &expected, unit);
        let size: f64 = unit.parse().unwrap();
        let Some(size) = Some(size as f32).filter(|size| size.is_normal()) else { continue };
        let corners = &[0., 0., 0., size, 0., 0., 0., size, 0.];
        assert_same(&places(&gltf(&triangle_of(corners, "", ""))), &expected, unit);
        let back = format!(r#","scale":[{0},{0},{0}]"#, 1.0 / f64::from(size));
        let scene = gltf(&triangle_of(corners, &back, ""));
        assert_same(&places(&scene), &expected, unit);
        assert!(scene.bounds().max.abs_diff_eq(DVec3::new(1.0, 1.0, 0.0), 1e-6));
    }
}

#[test]
fn instances_far_away_keep_their_distance() {
    let (offsets, length) = floats(&[1e7, 0., 0., 1e7 + 1., 0., 0., 1e7 + 4., 0., 0.]);
    let text = triangle(
        r#","translation":[-1e7,0,0],"extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":1}}}"#,
        "",
    )
    .replace(
        r#""type":"VEC3"}]"#,
        r#""type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"}]"#,
    )
    .replace(r#""byteLength":36}]"#, r#""byteLength":36},{"buffer":1,"byteLength":36}]"#)
    .replace(r#""}]}"#, &format!(r#""}},{{"byteLength":{length},"uri":"{offsets}"}}]}}"#));
    let scene = gltf(&text);
    assert_eq!(scene.bounds().max, DVec3::new(5.0, 1.0, 0.0));
    let pass = pass(&scene);
    let draw = &pass.draws[0];
    // The rows of the instances place the parts close to the draw's own origin.
    let rows = draw.vertex_buffers.last().unwrap();
    let bytes = rows.host_bytes().unwrap();
    let x = |i: usize| f32::from_le_bytes(bytes[i * 48 + 12..][..4].try_into().unwrap());
    assert_eq!((draw.instances, x(1) - x(0), x(2) - x(1)), (3, 1.0, 3.0));
    assert_eq!(positions(draw)[0] + Vec3::X * x(0), Vec3::ZERO);
}

/// A triangle on one joint, with nodes 1 (the joint) and 2 (above both if `above`) beside its own.
fn skinned(mesh_node: &str, joint: &str, root: &str) -> String {
    let weights = floats(&[1., 0., 0., 0., 1., 0., 0., 0., 1., 0., 0., 0.]).0;
    let joints = uri(&[0; 12]);
    triangle("", "")
        .replace(
            r#""nodes":[{"mesh":0}]"#,
            &format!(
                r#""nodes":[{{"mesh":0,"skin":0{mesh_node}}},{{"name":"joint"{joint}}},
                {{"children":[0,1]{root}}}],"skins":[{{"joints":[1]}}]"#
            ),
        )
        .replace(r#""POSITION":0"#, r#""POSITION":0,"WEIGHTS_0":1,"JOINTS_0":2"#)
        .replace(
            r#""type":"VEC3"}]"#,
            r#""type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC4"},
               {"bufferView":2,"componentType":5121,"count":3,"type":"VEC4"}]"#,
        )
        .replace(
            r#""byteLength":36}]"#,
            r#""byteLength":36},{"buffer":1,"byteLength":48},{"buffer":2,"byteLength":12}]"#,
        )
        .replace(
            r#""}]}"#,
            &format!(r#""}},{{"byteLength":48,"uri":"{weights}"}},{{"byteLength":12,"uri":"{joints}"}}]}}"#),
        )
}

#[test]
fn the_node_of_a_skin_says_which_side_is_its_front() {
    let (mirror, turn) = (r#","scale":[-1,1,1]"#, r#","scale":[-1,-1,1]"#);
    for (node, joint, root, x, front, normal_z) in [
        ("", "", "", 1.0, FrontFace::CounterClockwise, 1.0),
        // The whole model in a mirror: its front is still its front, and looks the same way.
        ("", "", mirror, -1.0, FrontFace::Clockwise, 1.0),
        ("", "", turn, -1.0, FrontFace::CounterClockwise, 1.0),
        // The node alone: it moves nothing, but it turns the front round, as glTF says.
        (mirror, "", "", 1.0, FrontFace::Clockwise, -1.0),
        // The joint alone: the triangle is seen from behind.
        ("", mirror, "", -1.0, FrontFace::CounterClockwise, -1.0),
        (mirror, "", mirror, -1.0, FrontFace::CounterClockwise, -1.0),
    ] {
        let case = format!("node {node}, joint {joint}, root {root}");
        let pass = pass(&gltf(&skinned(node, joint, root)));
        let draw = &pass.draws[0];
        assert_eq!(positions(draw)[1], Vec3::new(x, 0.0, 0.0), "{case}");
        assert_eq!(pass.pipelines[draw.pipeline].front_face, front, "{case}");
        let range = &draw.vertex_buffers[1];
        let z = &range.host_bytes().unwrap()[8..12];
        assert_eq!(f32::from_le_bytes(z.try_into().unwrap()), normal_z, "{case}");
    }
}

#[test]
fn animated_and_nested_mirrors_count() {
    let keys = floats(&[0., 1.]).0;
    let scales = floats(&[1., 1., 1., -1., 1., 1.]).0;
    let text = |parent: &str| {
        triangle("", "")
            .replace(
                r#""nodes":[{"mesh":0}]"#,
                &format!(r#""nodes":[{{"mesh":0}},{{"children":[0]{parent}}}]"#),
            )
            .replace(
                r#""type":"VEC3"}]"#,
                r#""type":"VEC3"},{"bufferView":1,"componentType":5126,"count":2,"type":"SCALAR"},
                   {"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"}]"#,
            )
            .replace(
                r#""byteLength":36}]"#,
                r#""byteLength":36},{"buffer":1,"byteLength":8},{"buffer":2,"byteLength":24}]"#,
            )
            .replace(
                r#""}]}"#,
                &format!(
                    r#""}},{{"byteLength":8,"uri":"{keys}"}},{{"byteLength":24,"uri":"{scales}"}}],
                    "animations":[{{"samplers":[{{"input":1,"output":2,"interpolation":"STEP"}}],
                    "channels":[{{"sampler":0,"target":{{"node":0,"path":"scale"}}}}]}}]}}"#
                ),
            )
    };
    for (parent, time, front) in [
        ("", 0.0, FrontFace::CounterClockwise),
        ("", 1.0, FrontFace::Clockwise),
        (r#","scale":[1,1,-1]"#, 0.0, FrontFace::Clockwise),
        (r#","scale":[1,1,-1]"#, 1.0, FrontFace::CounterClockwise),
    ] {
        let case = Case::new(&[("a.gltf", text(parent).as_bytes())]);
        let scene = case.try_load("a.gltf", Some(time)).unwrap();
        assert_eq!(pass(&scene).pipelines[0].front_face, front, "{parent} at {time}");
    }
}
