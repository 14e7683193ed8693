//! Small files written on the spot: each tests one rule of a format, by the content of the pass.

use super::check;
use glam::{DMat4, DVec3, DVec4, Mat4, Vec3};
use std::path::PathBuf;
use tilewright::{
    Error,
    image::Extent,
    pass::{Binding, Draw, Pass},
    scene::{Camera, LoadOptions, PassOptions, Projection, Scene},
    state::{Cull, FrontFace, Topology},
};

const EXTENT: Extent = Extent::new(64, 64);

/// A folder with the files of one case.
pub struct Case(tempfile::TempDir);

impl Case {
    pub fn new(files: &[(&str, &[u8])]) -> Self {
        let folder = tempfile::tempdir().unwrap();
        for (name, content) in files {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, content).unwrap();
        }
        Self(folder)
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub fn try_load(&self, name: &str, time: Option<f64>) -> Result<Scene, Error> {
        Scene::load(&self.path(name), &LoadOptions { time })
    }

    pub fn load(&self, name: &str) -> Scene {
        self.try_load(name, None).unwrap_or_else(|e| panic!("{e}"))
    }
}

/// A valid pass of everything in the scene, by a camera whose clip space is the world but for powers
/// of two: [`positions`] are exact.
pub fn pass(scene: &Scene) -> Pass {
    let options = PassOptions { cull: false, ..PassOptions::default() };
    let projection = Projection::Orthographic { ymag: 1.0, near: -1024.0, far: 1024.0 };
    let camera = Camera { name: String::new(), view: DMat4::IDENTITY, projection };
    let pass = scene.pass(EXTENT, &camera, &options).unwrap();
    check(&pass);
    pass
}

/// The matrix of a draw to clip space.
fn to_clip(draw: &Draw) -> DMat4 {
    let floats: Vec<f32> = draw.push_constants[..64]
        .chunks_exact(4)
        .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    Mat4::from_cols_slice(&floats).as_dmat4()
}

/// Positions that a draw of [`pass`] reads, in the order it reads them, in the world.
pub fn positions(draw: &Draw) -> Vec<Vec3> {
    let world = |c: DVec4| DVec3::new(c.x, -c.y, (0.5 - c.z) * 2048.0).as_vec3();
    clip_positions(draw).into_iter().map(world).collect()
}

/// Positions that a draw reads, in the order it reads them, in clip space.
pub fn clip_positions(draw: &Draw) -> Vec<DVec4> {
    let range = &draw.vertex_buffers[0];
    let bytes = range.host_bytes().unwrap();
    let to_clip = to_clip(draw);
    let at = |i: usize| {
        let f = |k: usize| f32::from_le_bytes(bytes[i * 12 + k..][..4].try_into().unwrap());
        to_clip * DVec3::new(f(0).into(), f(4).into(), f(8).into()).extend(1.0)
    };
    match &draw.indices {
        None => (0..draw.count as usize).map(at).collect(),
        Some(indices) => {
            let list = indices.range.host_bytes().unwrap();
            let width = indices.format.bytes();
            let index = |b: &[u8]| b.iter().rev().fold(0, |n, &b| n << 8 | b as usize);
            list.chunks_exact(width).map(|b| at(index(b))).collect()
        }
    }
}

/// A `data:` URI of floats.
pub fn floats(values: &[f32]) -> (String, usize) {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    (uri(&bytes), bytes.len())
}

pub fn uri(bytes: &[u8]) -> String {
    let mut text = String::from("data:application/octet-stream,");
    bytes.iter().for_each(|b| text.push_str(&format!("%{b:02x}")));
    text
}

/// A triangle in the plane z = 0 with `node` as its node's properties, and more of the document.
pub fn triangle(node: &str, more: &str) -> String {
    triangle_of(&[0., 0., 0., 1., 0., 0., 0., 1., 0.], node, more)
}

/// As [`triangle`], with these coordinates.
pub fn triangle_of(coordinates: &[f32; 9], node: &str, more: &str) -> String {
    let (uri, length) = floats(coordinates);
    format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0{node}}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}{more}}}]}}],
        "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3"}}],
        "bufferViews":[{{"buffer":0,"byteLength":{length}}}],
        "buffers":[{{"byteLength":{length},"uri":"{uri}"}}]}}"#
    )
}

#[test]
fn a_mirrored_node_turns_the_front_face_round() {
    let case = Case::new(&[
        ("plain.gltf", triangle("", "").as_bytes()),
        ("mirrored.gltf", triangle(r#","scale":[-1,1,1]"#, "").as_bytes()),
        ("twice.gltf", triangle(r#","scale":[-1,-2,1]"#, "").as_bytes()),
    ]);
    for (name, front) in [
        ("plain.gltf", FrontFace::CounterClockwise),
        ("mirrored.gltf", FrontFace::Clockwise),
        ("twice.gltf", FrontFace::CounterClockwise),
    ] {
        let pass = pass(&case.load(name));
        assert_eq!((pass.draws.len(), pass.pipelines.len()), (1, 1));
        assert_eq!(pass.pipelines[0].front_face, front, "{name}");
        assert_eq!(pass.pipelines[0].cull, Cull::Back);
    }
}

#[test]
fn every_mode_is_drawn() {
    for (mode, topology) in [
        (4, Topology::TriangleList),
        (5, Topology::TriangleStrip),
        (6, Topology::TriangleFan),
        (0, Topology::PointList),
        (1, Topology::LineList),
        (2, Topology::LineStrip),
        (3, Topology::LineStrip),
    ] {
        // Unlit, so that no normals are made and triangles stay what they are.
        let text = triangle("", &format!(r#","mode":{mode},"material":0"#)).replace(
            r#""accessors""#,
            r#""materials":[{"extensions":{"KHR_materials_unlit":{}}}],"accessors""#,
        );
        let case = Case::new(&[("a.gltf", text.as_bytes())]);
        let scene = case.load("a.gltf");
        let pass = pass(&scene);
        assert_eq!(pass.pipelines[0].topology, topology, "mode {mode}");
        // A loop ends where it began.
        assert_eq!(pass.draws[0].count, if mode == 2 { 4 } else { 3 }, "mode {mode}");
        assert_eq!(scene.warnings(), [] as [String; 0], "mode {mode}");
    }
}

#[test]
fn the_hierarchy_places_things_and_cameras() {
    let text = triangle("", "").replace(
        r#""nodes":[{"mesh":0}]"#,
        r#""scene":0,"scenes":[{"nodes":[0]}],
        "nodes":[{"translation":[1,0,0],"children":[1,2]},
                 {"scale":[2,2,2],"children":[3]},
                 {"name":"eye","translation":[0,0,5],"camera":0},
                 {"translation":[0,3,0],"mesh":0}],
        "cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.25}}]"#,
    );
    let case = Case::new(&[("a.gltf", text.as_bytes())]);
    let scene = case.load("a.gltf");
    assert_eq!(positions(&pass(&scene).draws[0])[1], Vec3::new(3.0, 6.0, 0.0));
    assert_eq!(scene.bounds().min, DVec3::new(1.0, 6.0, 0.0));
    let camera = &scene.cameras()[0];
    assert_eq!((camera.name.as_str(), camera.eye()), ("eye", DVec3::new(1.0, 0.0, 5.0)));
    assert_eq!(camera.projection, Projection::Perspective { yfov: 0.5, near: 0.25, far: None });
}

#[test]
fn sparse_values_replace_and_missing_buffers_are_zero() {
    let (values, length) = floats(&[5., 6., 7.]);
    let text = format!(
        r#"{{"asset":{{"version":"2.0"}},"nodes":[{{"mesh":0}}],
        "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}}}}]}}],
        "accessors":[{{"componentType":5126,"count":3,"type":"VEC3","sparse":{{"count":1,
            "indices":{{"bufferView":0,"componentType":5121}},"values":{{"bufferView":1}}}}}}],
        "bufferViews":[{{"buffer":0,"byteLength":1}},{{"buffer":1,"byteLength":{length}}}],
        "buffers":[{{"byteLength":1,"uri":"{}"}},{{"byteLength":{length},"uri":"{values}"}}]}}"#,
        uri(&[2])
    );
    let case = Case::new(&[("a.gltf", text.as_bytes())]);
    let drawn = positions(&pass(&case.load("a.gltf")).draws[0]);
    assert_eq!(drawn, [Vec3::ZERO, Vec3::ZERO, Vec3::new(5.0, 6.0, 7.0)]);
    let beyond = text.replace(&uri(&[2]), &uri(&[3]));
    let case = Case::new(&[("a.gltf", beyond.as_bytes())]);
    let fault = case.try_load("a.gltf", None).unwrap_err().to_string();
    assert!(fault.contains("sparse indices") && fault.contains("a.gltf"), "{fault}");
}

#[test]
fn claims_beyond_the_buffer_are_refused_before_they_are_believed() {
    for (from, to, word) in [
        (r#""count":3"#, r#""count":4294967295"#, "accessor 0"),
        (r#""count":3"#, r#""count":18446744073709551615"#, "accessor 0"),
        (r#""count":3"#, r#""count":3,"byteOffset":18446744073709551615"#, "accessor 0"),
        (r#"{"bufferView":0,"#, r#"{"bufferView":7,"#, "buffer view 7"),
        (r#"{"bufferView":0,"#, "{", "no scene asks"),
        (r#""byteLength":36}]"#, r#""byteLength":36,"byteOffset":8}]"#, "buffer view 0"),
        (r#""byteLength":36}]"#, r#""byteLength":36,"byteStride":4}]"#, "4 bytes apart"),
        (r#""mesh":0"#, r#""mesh":4"#, "mesh 4"),
        (r#""version":"2.0""#, r#""version":"3.0""#, "3.0"),
    ] {
        let text = triangle("", "").replace(from, to);
        let case = Case::new(&[("odd.gltf", text.as_bytes())]);
        match case.try_load("odd.gltf", None) {
            Err(Error::Input { path, reason }) => {
                assert!(reason.contains(word) && path.ends_with("odd.gltf"), "{reason}");
            }
            Err(e) => panic!("{e}"),
            // Without a buffer view all positions are zero, as the format says.
            Ok(_) => assert_eq!(to, "{"),
        }
    }
}

#[test]
fn instances_are_one_draw_and_mirrored_ones_another() {
    let (offsets, length) = floats(&[0., 0., 0., 2., 0., 0., 4., 0., 0.]);
    let (scales, _) = floats(&[1., 1., 1., -1., 1., 1., 1., 1., 1.]);
    let text = triangle(
        r#","extensions":{"EXT_mesh_gpu_instancing":{"attributes":{"TRANSLATION":1,"SCALE":2}}}"#,
        "",
    );
    let text = text
        .replace(
            r#""type":"VEC3"}]"#,
            r#""type":"VEC3"},{"bufferView":1,"componentType":5126,"count":3,"type":"VEC3"},
               {"bufferView":2,"componentType":5126,"count":3,"type":"VEC3"}]"#,
        )
        .replace(
            r#""byteLength":36}],"#,
            r#""byteLength":36},{"buffer":1,"byteLength":36},{"buffer":2,"byteLength":36}],"#,
        )
        .replace(
            r#""}]}"#,
            &format!(
                r#""}},{{"byteLength":{length},"uri":"{offsets}"}},
                {{"byteLength":{length},"uri":"{scales}"}}]}}"#
            ),
        );
    let case = Case::new(&[("a.gltf", text.as_bytes())]);
    let scene = case.load("a.gltf");
    let pass = pass(&scene);
    let drawn: Vec<_> =
        pass.draws.iter().map(|d| (d.instances, pass.pipelines[d.pipeline].front_face)).collect();
    assert_eq!(drawn.len(), 2);
    assert!(drawn.contains(&(2, FrontFace::CounterClockwise)));
    assert!(drawn.contains(&(1, FrontFace::Clockwise)));
    assert_eq!(scene.triangles(), 3);
    assert_eq!(scene.bounds().max, DVec3::new(5.0, 1.0, 0.0));
}

#[test]
fn polygons_and_missing_files_of_obj() {
    let obj = b"mtllib Colours.MTL\nv 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nusemtl red\nf 1 2 3 4\n";
    let mtl = b"newmtl red\nKd 1 0 0\nd 0.5\nmap_Kd gone.png\n";
    let case = Case::new(&[("a.obj", obj), ("colours.mtl", mtl)]);
    let scene = case.load("a.obj");
    let pass = pass(&scene);
    assert_eq!(scene.triangles(), 2);
    assert!(
        pass.pipelines[0].color_state(0).blend.is_some(),
        "d 0.5 blends, and the library was found"
    );
    assert!(scene.warnings().iter().any(|w| w.contains("gone.png")), "{:?}", scene.warnings());
    let Binding::Uniform(block) = &pass.draws[0].sets[1].entries[0].resources[0] else {
        panic!("the material's block comes first");
    };
    let color: &[u8] = &block.host_bytes().unwrap()[..16];
    assert_eq!(color[0..4], 1f32.to_le_bytes());
    assert_eq!(color[12..16], 0.5f32.to_le_bytes());
}

#[test]
fn a_scene_that_lies_nowhere_is_said_to() {
    let case = Case::new(&[("nowhere.obj", b"v nan 0 0\nv 0 inf 0\nv -inf 0 0\nf 1 2 3\n")]);
    let scene = case.load("nowhere.obj");
    pass(&scene);
    assert!(scene.warnings().iter().any(|w| w.contains("place")), "{:?}", scene.warnings());
}

#[test]
fn what_is_no_scene_is_named() {
    let case = Case::new(&[("a.txt", b"hello"), ("b.gltf", b"{"), ("c.glb", b"glTF")]);
    for name in ["a.txt", "b.gltf", "c.glb", "not-there.gltf", "."] {
        let fault = case.try_load(name, None).unwrap_err();
        assert!(matches!(fault, Error::Input { .. }), "{fault}");
    }
    let unknown = Scene::builtin("no-such-scene").unwrap_err();
    assert!(matches!(&unknown, Error::Usage(text) if text.contains("teapot")), "{unknown}");
}

#[test]
fn all_built_in_scenes_make_valid_passes() {
    for name in Scene::builtin_names() {
        let scene = Scene::builtin(name).unwrap();
        assert!(scene.warnings().is_empty() && scene.triangles() > 0, "{name}");
        assert!(!pass(&scene).draws.is_empty(), "{name}");
    }
}

#[test]
fn blended_draws_come_last_and_from_the_back() {
    let scene = Scene::builtin("alpha").unwrap();
    for eye in [DVec3::new(1.0, 1.0, 5.0), DVec3::new(-1.0, 0.5, -5.0)] {
        let camera = scene.camera_at(eye, DVec3::ZERO, DVec3::Y, 0.8);
        let pass = scene.pass(EXTENT, &camera, &PassOptions::default()).unwrap();
        let blends = |d: &Draw| pass.pipelines[d.pipeline].color_state(0).blend.is_some();
        let first = pass.draws.iter().position(blends).unwrap();
        assert!(pass.draws[first..].iter().all(blends) && first == 1);
        // w of clip space is the distance.
        let distances: Vec<f64> = pass.draws[first..].iter().map(|d| to_clip(d).w_axis.w).collect();
        assert!(distances.is_sorted_by(|a, b| a >= b), "{distances:?}");
    }
}

#[test]
fn culling_leaves_out_only_what_cannot_be_seen() {
    let scene = Scene::builtin("spheres").unwrap();
    let all = PassOptions { cull: false, ..PassOptions::default() };
    let whole = scene.default_camera(EXTENT);
    assert_eq!(scene.pass(EXTENT, &whole, &PassOptions::default()).unwrap().draws.len(), 35);
    // Close to one corner, looking along the sheet of spheres and away from it.
    let close =
        scene.camera_at(DVec3::new(-6.9, -4.6, 3.0), DVec3::new(-6.9, -4.6, 0.0), DVec3::Y, 0.5);
    let seen = scene.pass(EXTENT, &close, &PassOptions::default()).unwrap().draws.len();
    assert!((1..10).contains(&seen), "{seen}");
    assert_eq!(scene.pass(EXTENT, &close, &all).unwrap().draws.len(), 35);
    let away = scene.camera_at(DVec3::Z * 9.0, DVec3::Z * 20.0, DVec3::Y, 0.5);
    assert_eq!(scene.pass(EXTENT, &away, &PassOptions::default()).unwrap().draws.len(), 0);
}
