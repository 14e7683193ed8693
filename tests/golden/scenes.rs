//! Golden scenes of cameras, transforms, time and order.

use super::{
    Golden, Rule,
    gltf::{Gltf, Mesh},
};
use serde_json::{Value, json};
use std::path::Path;

pub fn all() -> Vec<Golden> {
    let golden = |name, rule, write| Golden { name, rule, write, time: None };
    let at = |name, time, write| Golden { name, rule: Rule::Shaded, write, time: Some(time) };
    vec![
        golden("transforms", Rule::Shaded, transforms),
        golden("camera-perspective", Rule::Exact, perspective),
        golden("camera-orthographic", Rule::Exact, orthographic),
        golden("camera-framing", Rule::Shaded, framing),
        golden("lights", Rule::Glossy, lights),
        golden("topologies", Rule::Exact, topologies),
        golden("depth-order", Rule::Exact, depth_order),
        at("skin", 1.0, skin),
        at("morph", 0.5, morph),
        at("animation-0.25", 0.25, animation),
        at("animation-0.75", 0.75, animation),
        golden("builtin-teapot", Rule::Glossy, |_| "builtin:teapot".into()),
        golden("builtin-alpha", Rule::Filtered, |_| "builtin:alpha".into()),
    ]
}

fn lit(gltf: &mut Gltf, [r, g, b]: [f32; 3]) -> usize {
    let surface = json!({ "baseColorFactor": [r, g, b, 1], "metallicFactor": 0,
        "roughnessFactor": 0.8 });
    gltf.add("materials", json!({ "pbrMetallicRoughness": surface }))
}

fn square(gltf: &mut Gltf, color: [f32; 4]) -> usize {
    let material = gltf.unlit(color);
    gltf.mesh(&Mesh::square(0.0, 1.0), material, json!({}))
}

/// A quaternion that turns by `angle` about z.
fn about_z(angle: f32) -> Value {
    json!([0, 0, (angle / 2.0).sin(), (angle / 2.0).cos()])
}

/// A chain of nodes, each turned and scaled in its parent's space; a node that is mirrored; one with a
/// matrix that shears.
fn transforms(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let colors = [[0.9, 0.3, 0.2], [0.3, 0.8, 0.3], [0.3, 0.4, 0.9]];
    let meshes = colors.map(|color| {
        let material = lit(&mut gltf, color);
        gltf.mesh(&Mesh::square(0.0, 1.0), material, json!({}))
    });
    let last = gltf.add(
        "nodes",
        json!({ "mesh": meshes[2], "translation": [1.6, 0, 0],
        "rotation": about_z(0.5), "scale": [0.6, 0.6, 1] }),
    );
    let middle = gltf.add(
        "nodes",
        json!({ "mesh": meshes[1], "translation": [1.6, 0, 0],
        "rotation": about_z(0.5), "scale": [0.6, 0.6, 1], "children": [last] }),
    );
    gltf.node(json!({ "mesh": meshes[0], "translation": [-1.6, -0.6, 0], "rotation": about_z(0.3),
        "children": [middle] }));
    // A triangle shows which way it is mirrored.
    let material = lit(&mut gltf, [0.9, 0.8, 0.3]);
    let mut flag = Mesh::square(0.0, 1.0);
    flag.indices.truncate(3);
    let flag = gltf.mesh(&flag, material, json!({}));
    gltf.node(json!({ "mesh": flag, "translation": [-1.6, 1.5, 0], "scale": [-0.6, 0.6, 1] }));
    gltf.node(json!({ "mesh": flag, "translation": [1.8, 1.5, 0], "scale": [0.6, 0.6, 1] }));
    gltf.node(json!({ "mesh": meshes[1],
        "matrix": [0.5, 0, 0, 0, 0.3, 0.4, 0, 0, 0, 0, 1, 0, 1.8, -1.3, 0, 1] }));
    gltf.camera_at([0.0, 0.0, 6.0]);
    gltf.write(folder)
}

/// Squares of one size, one behind another: they shrink with the distance.
fn rows(gltf: &mut Gltf) {
    for (n, color) in
        [[0.8, 0.1, 0.1, 1.0], [0.1, 0.6, 0.1, 1.0], [0.1, 0.1, 0.8, 1.0]].iter().enumerate()
    {
        let mesh = square(gltf, *color);
        let n = n as f32;
        gltf.node(json!({ "mesh": mesh, "translation": [n * 1.5 - 1.5, n * 0.8 - 0.8, -3.0 * n] }));
    }
}

/// The file's first camera, from the side and from above.
fn perspective(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    rows(&mut gltf);
    let camera = json!({ "type": "perspective",
        "perspective": { "yfov": 0.9, "aspectRatio": 2.0, "znear": 0.5, "zfar": 50.0 } });
    let number = gltf.add("cameras", camera);
    let (yaw, place) = (0.3f32, json!([2.0, 0.5, 4.0]));
    gltf.node(json!({ "camera": number, "translation": place,
        "rotation": [0, (yaw / 2.0).sin(), 0, (yaw / 2.0).cos()] }));
    gltf.write(folder)
}

/// The same squares without foreshortening: all of one size.
fn orthographic(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    rows(&mut gltf);
    let camera = json!({ "type": "orthographic",
        "orthographic": { "xmag": 4.0, "ymag": 3.0, "znear": 0.1, "zfar": 50.0 } });
    let number = gltf.add("cameras", camera);
    gltf.node(json!({ "camera": number, "translation": [0, 0, 4] }));
    gltf.write(folder)
}

/// A file without a camera is framed.
fn framing(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let material = lit(&mut gltf, [0.8, 0.5, 0.3]);
    let ball = gltf.mesh(&Mesh::ball(), material, json!({}));
    gltf.node(json!({ "mesh": ball, "scale": [3, 1, 1], "translation": [40, 10, -20] }));
    gltf.node(json!({ "mesh": ball, "translation": [40, 12, -20] }));
    gltf.write(folder)
}

/// A key light, sky and ground; lights of the file of each kind are passed over.
fn lights(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let surface = json!({ "baseColorFactor": [0.8, 0.8, 0.8, 1], "metallicFactor": 0,
        "roughnessFactor": 0.35 });
    let material = gltf.add("materials", json!({ "pbrMetallicRoughness": surface }));
    let ball = gltf.mesh(&Mesh::ball(), material, json!({}));
    gltf.node(json!({ "mesh": ball, "translation": [-1.2, 0, 0] }));
    let surface = json!({ "metallicFactor": 1, "roughnessFactor": 0.2 });
    let material = gltf.add("materials", json!({ "pbrMetallicRoughness": surface }));
    let ball = gltf.mesh(&Mesh::ball(), material, json!({}));
    gltf.node(json!({ "mesh": ball, "translation": [1.2, 0, 0] }));
    gltf.document["extensions"] = json!({ "KHR_lights_punctual": { "lights": [
        { "type": "directional", "color": [1, 0, 0], "intensity": 5 },
        { "type": "point", "color": [0, 1, 0], "intensity": 50 },
        { "type": "spot", "color": [0, 0, 1], "intensity": 50, "spot": {} },
    ] } });
    for light in 0..3 {
        gltf.node(json!({ "extensions": { "KHR_lights_punctual": { "light": light } },
            "translation": [0, 0, 3] }));
    }
    gltf.camera_at([0.0, 0.0, 4.6]);
    gltf.write(folder)
}

/// A list without indices, a strip and a fan.
fn topologies(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let zigzag: Vec<[f32; 3]> =
        (0..6).map(|n| [n as f32 * 0.4 - 1.0, if n % 2 == 0 { 0.8 } else { -0.8 }, 0.0]).collect();
    let mut fan = vec![[0.0, 0.0, 0.0]];
    fan.extend((0..=5).map(|n| {
        let angle = n as f32 * 1.1;
        [angle.cos(), angle.sin(), 0.0]
    }));
    for (n, (positions, mode, color)) in [
        (zigzag.clone(), 4, [0.8, 0.2, 0.1, 1.0]),
        (zigzag, 5, [0.2, 0.6, 0.2, 1.0]),
        (fan, 6, [0.2, 0.3, 0.8, 1.0]),
    ]
    .into_iter()
    .enumerate()
    {
        let material = gltf.unlit(color);
        gltf.document["materials"][material]["doubleSided"] = true.into();
        let mesh = Mesh { positions, ..Mesh::default() };
        let mesh = gltf.mesh(&mesh, material, json!({ "mode": mode }));
        gltf.node(json!({ "mesh": mesh, "translation": [(n as f32 - 1.0) * 2.3, 0, 0] }));
    }
    gltf.camera_at([0.0, 0.0, 6.0]);
    gltf.write(folder)
}

/// Squares that pass through each other: which one is seen changes along a straight line. Two that lie in
/// one plane: the first stays.
fn depth_order(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    for (color, yaw) in [([0.9, 0.5, 0.1, 1.0], 0.4f32), ([0.1, 0.4, 0.8, 1.0], -0.4)] {
        let material = gltf.unlit(color);
        gltf.document["materials"][material]["doubleSided"] = true.into();
        let mesh = gltf.mesh(&Mesh::square(0.0, 1.0), material, json!({}));
        let turned = [0.0, (yaw / 2.0).sin(), 0.0, (yaw / 2.0).cos()];
        gltf.node(json!({ "mesh": mesh, "rotation": turned, "translation": [-1.2, 0, 0] }));
    }
    let material = [[0.8, 0.8, 0.2, 1.0], [0.6, 0.1, 0.6, 1.0]].map(|color| gltf.unlit(color));
    // Two primitives of one mesh: their order is that of the file.
    let attributes = gltf.attributes(&Mesh::square(0.0, 1.0));
    let indices = gltf.indices(&[0, 1, 2, 0, 2, 3]);
    let primitive = |material: usize| json!({ "attributes": attributes, "indices": indices, "material": material });
    let mesh = gltf
        .add("meshes", json!({ "primitives": [primitive(material[0]), primitive(material[1])] }));
    gltf.node(json!({ "mesh": mesh, "translation": [1.2, 0, 0] }));
    gltf.camera_at([0.0, 0.0, 4.6]);
    gltf.write(folder)
}

/// Adds an animation of `path` of `node`: its times and values.
fn animate<const N: usize>(
    gltf: &mut Gltf,
    (node, path): (usize, &str),
    how: &str,
    times: &[f32],
    values: &[[f32; N]],
) {
    let times: Vec<[f32; 1]> = times.iter().map(|time| [*time]).collect();
    let (input, output) = (gltf.floats(&times), gltf.floats(values));
    let sampler = json!({ "input": input, "output": output, "interpolation": how });
    if gltf.document["animations"].as_array().unwrap().is_empty() {
        gltf.add("animations", json!({ "samplers": [], "channels": [] }));
    }
    let animation = &mut gltf.document["animations"][0];
    let samplers = animation["samplers"].as_array_mut().unwrap();
    samplers.push(sampler);
    let channel =
        json!({ "sampler": samplers.len() - 1, "target": { "node": node, "path": path } });
    animation["channels"].as_array_mut().unwrap().push(channel);
}

/// A tall strip that bends: its upper half follows a joint that turns by 60 degrees within a second.
fn skin(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let mut strip = Mesh::default();
    let (mut joints, mut weights) = (Vec::new(), Vec::new());
    let rows = 12u32;
    for row in 0..=rows {
        let t = row as f32 / rows as f32;
        // Around the middle the joints share the vertices.
        let upper = ((t - 0.3) / 0.4).clamp(0.0, 1.0);
        for x in [-0.4, 0.4] {
            strip.positions.push([x, t * 4.0 - 2.0, 0.0]);
            strip.normals.push([0.0, 0.0, 1.0]);
            joints.push([0u8, 1, 0, 0]);
            weights.push([1.0 - upper, upper, 0.0, 0.0]);
        }
    }
    for row in 0..rows {
        let a = row * 2;
        strip.indices.extend([a, a + 1, a + 3, a, a + 3, a + 2]);
    }
    let material = lit(&mut gltf, [0.3, 0.7, 0.5]);
    let attributes =
        json!({ "JOINTS_0": gltf.joints(&joints), "WEIGHTS_0": gltf.floats(&weights) });
    let mesh = gltf.mesh(&strip, material, json!({ "attributes": attributes }));
    let upper = gltf.add("nodes", json!({}));
    let lower = gltf.node(json!({ "children": [upper] }));
    gltf.add("skins", json!({ "joints": [lower, upper] }));
    gltf.node(json!({ "mesh": mesh, "skin": 0 }));
    let turned = [0.0, 0.0, 0.5, 0.75f32.sqrt()];
    animate(&mut gltf, (upper, "rotation"), "LINEAR", &[0.0, 1.0], &[[0.0, 0.0, 0.0, 1.0], turned]);
    gltf.camera_at([0.0, 0.0, 6.0]);
    gltf.write(folder)
}

/// A square whose corners move apart and whose other target is half as strong.
fn morph(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let material = lit(&mut gltf, [0.8, 0.4, 0.6]);
    let zero = [0.0f32; 3];
    let wide = gltf.floats(&[zero, [2.0, 0.0, 0.0], [2.0, 0.0, 0.0], zero]);
    let tall = gltf.floats(&[zero, zero, [0.0, 1.0, 0.0], zero]);
    let targets = json!({ "targets": [{ "POSITION": wide }, { "POSITION": tall }] });
    let mesh = gltf.mesh(&Mesh::square(0.0, 1.0), material, targets);
    gltf.document["meshes"][mesh]["weights"] = json!([0, 1]);
    let node = gltf.node(json!({ "mesh": mesh, "translation": [-0.5, -0.3, 0] }));
    animate(&mut gltf, (node, "weights"), "LINEAR", &[0.0, 1.0], &[[0.0], [1.0], [1.0], [0.0]]);
    gltf.camera_at([0.0, 0.0, 4.0]);
    gltf.write(folder)
}

/// From the top: a path in steps, along straight lines, along a spline whose ends stand still.
fn animation(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let (left, right) = ([-2.0, 0.0, 0.0], [2.0, 0.0, 0.0]);
    let zero = [0.0; 3];
    let spline = [zero, left, zero, zero, right, zero];
    for (n, (how, color)) in [
        ("STEP", [0.8, 0.2, 0.2, 1.0]),
        ("LINEAR", [0.2, 0.6, 0.2, 1.0]),
        ("CUBICSPLINE", [0.2, 0.3, 0.8, 1.0]),
    ]
    .into_iter()
    .enumerate()
    {
        let mesh = square(&mut gltf, color);
        let node = gltf.add("nodes", json!({ "mesh": mesh, "scale": [0.4, 0.4, 1] }));
        gltf.node(json!({ "children": [node], "translation": [0, 1.2 - n as f32 * 1.2, 0] }));
        let values = if how == "CUBICSPLINE" { &spline[..] } else { &[left, right] };
        animate(&mut gltf, (node, "translation"), how, &[0.0, 1.0], values);
    }
    gltf.camera_at([0.0, 0.0, 5.5]);
    gltf.write(folder)
}
