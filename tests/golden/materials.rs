//! Golden scenes of materials and textures.

use super::{
    Golden, Rule,
    gltf::{Gltf, Mesh, png},
};
use serde_json::{Value, json};
use std::{fs, path::Path};

const REPEAT: u32 = 10497;
const MIRROR: u32 = 33648;
const CLAMP: u32 = 33071;
const NEAREST: u32 = 9728;
const LINEAR: u32 = 9729;
const TRILINEAR: u32 = 9987;

pub fn all() -> Vec<Golden> {
    let golden = |name, rule, write| Golden { name, rule, write, time: None };
    vec![
        golden("base-colour-texture", Rule::Shaded, base_colour),
        golden("sampler-wrap", Rule::Exact, wrap),
        golden("sampler-linear", Rule::Filtered, linear),
        golden("sampler-mipmaps", Rule::Filtered, mipmaps),
        golden("texture-transform", Rule::Exact, transform),
        golden("metallic-roughness", Rule::Glossy, metallic_roughness),
        golden("metallic-roughness-texture", Rule::Filtered, metallic_roughness_map),
        golden("normal-map", Rule::Filtered, normal_map),
        golden("emissive", Rule::Filtered, emissive),
        golden("occlusion", Rule::Filtered, occlusion),
        golden("alpha-mask", Rule::Exact, mask),
        golden("alpha-blend-order", Rule::Shaded, blend),
        golden("double-sided", Rule::Shaded, double_sided),
        golden("vertex-colours", Rule::Shaded, vertex_colours),
        golden("obj-materials", Rule::Filtered, obj_materials),
        golden("obj-smoothing", Rule::Shaded, obj_smoothing),
    ]
}

/// Four colours, light and dark by turns: which way is up can be seen.
fn quarters(x: u32, y: u32) -> [u8; 4] {
    let colors = [[230, 60, 50, 255], [60, 180, 75, 255], [60, 90, 220, 255], [250, 220, 60, 255]];
    let [r, g, b, a] = colors[(y / 2 % 2 * 2 + x / 2 % 2) as usize];
    if (x + y).is_multiple_of(2) { [r, g, b, a] } else { [r / 2, g / 2, b / 2, a] }
}

/// An unlit material that shows `texture`, with more of its texture's properties.
fn textured(gltf: &mut Gltf, texture: usize, more: Value) -> usize {
    let mut info = json!({ "index": texture });
    info.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    gltf.add(
        "materials",
        json!({
            "pbrMetallicRoughness": { "baseColorTexture": info },
            "extensions": { "KHR_materials_unlit": {} },
        }),
    )
}

/// A row of squares, each with a material.
fn squares(gltf: &mut Gltf, mesh: &Mesh, materials: &[usize]) {
    let count = materials.len() as f32;
    for (n, material) in materials.iter().enumerate() {
        let mesh = gltf.mesh(mesh, *material, json!({}));
        let x = (n as f32 - (count - 1.0) / 2.0) * 2.3;
        gltf.node(json!({ "mesh": mesh, "translation": [x, 0, 0] }));
    }
    gltf.camera_at([0.0, 0.0, (2.3 * count).max(3.0)]);
}

fn base_colour(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let texture = gltf.texture(4, [CLAMP, CLAMP, NEAREST, NEAREST], quarters);
    let plain = textured(&mut gltf, texture, json!({}));
    let tinted = textured(&mut gltf, texture, json!({}));
    gltf.document["materials"][tinted]["pbrMetallicRoughness"]["baseColorFactor"] =
        json!([1.0, 0.5, 0.25, 1.0]);
    squares(&mut gltf, &Mesh::square(0.0, 1.0), &[plain, tinted]);
    gltf.write(folder)
}

fn wrap(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let materials = [[REPEAT, REPEAT], [MIRROR, MIRROR], [CLAMP, CLAMP], [REPEAT, CLAMP]];
    let materials = materials.map(|[s, t]| {
        let texture = gltf.texture(4, [s, t, NEAREST, NEAREST], quarters);
        textured(&mut gltf, texture, json!({}))
    });
    squares(&mut gltf, &Mesh::square(-0.75, 1.75), &materials);
    gltf.write(folder)
}

fn linear(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let materials = [NEAREST, LINEAR].map(|mag| {
        let texture = gltf.texture(4, [CLAMP, CLAMP, mag, mag], quarters);
        textured(&mut gltf, texture, json!({}))
    });
    squares(&mut gltf, &Mesh::square(0.0, 1.0), &materials);
    gltf.write(folder)
}

/// A floor to the horizon: near it its levels are seen one after another.
fn mipmaps(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let texture = gltf.texture(64, [REPEAT, REPEAT, LINEAR, TRILINEAR], |x, y| {
        let tile = (x / 16 + y / 16) % 2 == 0;
        if tile { [240, 240, 230, 255] } else { [40, 60, 120, 255] }
    });
    let material = textured(&mut gltf, texture, json!({}));
    let mesh = gltf.mesh(&Mesh::square(0.0, 8.0), material, json!({}));
    // The square lies down; far away it is wide.
    let turned = [-std::f32::consts::FRAC_1_SQRT_2, 0.0, 0.0, std::f32::consts::FRAC_1_SQRT_2];
    gltf.node(json!({ "mesh": mesh, "rotation": turned, "scale": [14, 14, 1],
        "translation": [0, -1, -13] }));
    gltf.camera_at([0.0, 0.0, 0.0]);
    gltf.write(folder)
}

fn transform(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let texture = gltf.texture(4, [REPEAT, REPEAT, NEAREST, NEAREST], quarters);
    let materials = [
        json!({ "offset": [0.25, 0.5] }),
        json!({ "scale": [2, 0.5] }),
        json!({ "rotation": 0.5, "scale": [1.5, 1.5] }),
    ]
    .map(|transform| {
        let more = json!({ "extensions": { "KHR_texture_transform": transform } });
        textured(&mut gltf, texture, more)
    });
    squares(&mut gltf, &Mesh::square(0.0, 1.0), &materials);
    gltf.write(folder)
}

fn balls(gltf: &mut Gltf, materials: &[usize], columns: usize) {
    let ball = Mesh::ball();
    for (n, material) in materials.iter().enumerate() {
        let mesh = gltf.mesh(&ball, *material, json!({}));
        let (column, row) = (n % columns, n / columns);
        let rows = materials.len() / columns;
        let at = |n: usize, of: usize| (n as f32 - (of as f32 - 1.0) / 2.0) * 2.1;
        gltf.node(json!({ "mesh": mesh, "translation": [at(column, columns), -at(row, rows), 0] }));
    }
    gltf.camera_at([0.0, 0.0, 3.5 * (materials.len() / columns) as f32]);
}

/// Dielectrics above, metals below; smooth at the left, rough at the right.
fn metallic_roughness(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let materials: Vec<usize> = [0.0, 1.0]
        .iter()
        .flat_map(|metallic| [0.15, 0.5, 1.0].map(|roughness| (metallic, roughness)))
        .map(|(metallic, roughness)| {
            let surface = json!({ "baseColorFactor": [0.9, 0.45, 0.2, 1],
                "metallicFactor": metallic, "roughnessFactor": roughness });
            gltf.add("materials", json!({ "pbrMetallicRoughness": surface }))
        })
        .collect();
    balls(&mut gltf, &materials, 3);
    gltf.write(folder)
}

/// Metal at the left and rough at the top: blue is metallic, green is rough, red says nothing.
fn metallic_roughness_map(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let texture = gltf.texture(2, [CLAMP, CLAMP, NEAREST, NEAREST], |x, y| {
        [77, if y == 0 { 230 } else { 70 }, if x == 0 { 255 } else { 0 }, 255]
    });
    let surface = json!({ "baseColorFactor": [0.9, 0.6, 0.3, 1],
        "metallicRoughnessTexture": { "index": texture } });
    let material = gltf.add("materials", json!({ "pbrMetallicRoughness": surface }));
    let square = gltf.mesh(&Mesh::square(0.0, 1.0), material, json!({}));
    let quarter = 0.3f32;
    gltf.node(json!({ "mesh": square, "translation": [-1.1, 0, 0],
        "rotation": [0, quarter.sin(), 0, quarter.cos()] }));
    let ball = gltf.mesh(&Mesh::ball(), material, json!({}));
    gltf.node(json!({ "mesh": ball, "translation": [1.2, 0, 0] }));
    gltf.camera_at([0.0, 0.0, 3.8]);
    gltf.write(folder)
}

/// A dome in each quarter of the left square, bent half as far in the right one.
fn normal_map(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let texture = gltf.texture(32, [REPEAT, REPEAT, LINEAR, LINEAR], |x, y| {
        let [u, v] = [x, y].map(|t| (t % 16) as f32 / 8.0 - 0.9375);
        let r2 = u * u + v * v;
        let [nx, ny] = if r2 < 0.7 { [u, -v] } else { [0.0, 0.0] };
        let nz = (1.0 - nx * nx - ny * ny).sqrt();
        let byte = |n: f32| ((n * 0.5 + 0.5) * 255.0).round() as u8;
        [byte(nx), byte(ny), byte(nz), 255]
    });
    let materials = [1.0, 0.4].map(|scale| {
        gltf.add(
            "materials",
            json!({
                "pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 0.6 },
                "normalTexture": { "index": texture, "scale": scale },
            }),
        )
    });
    squares(&mut gltf, &Mesh::square(0.0, 1.0), &materials);
    gltf.write(folder)
}

/// Black but for what glows: a factor, a texture, and a strength that goes beyond white.
fn emissive(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let texture = gltf.texture(4, [CLAMP, CLAMP, NEAREST, NEAREST], |x, y| {
        if x == y { [255, 160, 40, 255] } else { [0, 0, 0, 255] }
    });
    let black = json!({ "baseColorFactor": [0, 0, 0, 1], "metallicFactor": 0 });
    let materials = [
        json!({ "emissiveFactor": [0.1, 0.5, 0.2], "pbrMetallicRoughness": black }),
        json!({ "emissiveFactor": [1, 1, 1], "emissiveTexture": { "index": texture },
            "pbrMetallicRoughness": black }),
        json!({ "emissiveFactor": [0.1, 0.5, 0.2], "pbrMetallicRoughness": black,
            "extensions": { "KHR_materials_emissive_strength": { "emissiveStrength": 6 } } }),
    ]
    .map(|material| gltf.add("materials", material));
    squares(&mut gltf, &Mesh::square(0.0, 1.0), &materials);
    gltf.write(folder)
}

/// Light from around is kept away at the right of each square, less in the second.
fn occlusion(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let texture = gltf.texture(4, [CLAMP, CLAMP, NEAREST, NEAREST], |x, _| {
        [[255, 170, 85, 0][x as usize], 0, 0, 255]
    });
    let materials = [1.0, 0.4].map(|strength| {
        gltf.add(
            "materials",
            json!({
                "pbrMetallicRoughness": { "metallicFactor": 0 },
                "occlusionTexture": { "index": texture, "strength": strength },
            }),
        )
    });
    squares(&mut gltf, &Mesh::square(0.0, 1.0), &materials);
    gltf.write(folder)
}

/// A grid of holes before a plain square; alpha rises to the right, and the cutoff is 0.5 and 0.75.
fn mask(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let texture = gltf.texture(8, [CLAMP, CLAMP, NEAREST, NEAREST], |x, y| {
        let alpha = if y % 2 == 0 { 255 } else { (x * 36) as u8 };
        [230, 120, 40, alpha]
    });
    let materials = [0.5, 0.75].map(|cutoff| {
        let material = textured(&mut gltf, texture, json!({}));
        gltf.document["materials"][material]["alphaMode"] = "MASK".into();
        gltf.document["materials"][material]["alphaCutoff"] = cutoff.into();
        material
    });
    squares(&mut gltf, &Mesh::square(0.0, 1.0), &materials);
    let behind = gltf.unlit([0.05, 0.1, 0.3, 1.0]);
    let behind = gltf.mesh(&Mesh::square(0.0, 1.0), behind, json!({}));
    gltf.node(json!({ "mesh": behind, "translation": [0, 0, -1], "scale": [2.2, 0.8, 1] }));
    gltf.write(folder)
}

/// Panes of glass that overlap, named from front to back: blended from back to front all the same. The
/// opaque square in the middle hides what is behind it.
fn blend(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    for (color, place) in [
        ([1.0, 0.0, 0.0, 0.5], [-0.5, 0.4, 1.0]),
        ([0.0, 1.0, 0.0, 0.5], [0.5, 0.4, 0.5]),
        ([0.0, 0.0, 1.0, 0.5], [0.0, -0.4, -0.5]),
    ] {
        let material = gltf.unlit(color);
        gltf.document["materials"][material]["alphaMode"] = "BLEND".into();
        let mesh = gltf.mesh(&Mesh::square(0.0, 1.0), material, json!({}));
        gltf.node(json!({ "mesh": mesh, "translation": place }));
    }
    let material = gltf.unlit([0.9, 0.9, 0.8, 1.0]);
    let mesh = gltf.mesh(&Mesh::square(0.0, 1.0), material, json!({}));
    gltf.node(json!({ "mesh": mesh, "scale": [0.5, 0.5, 1] }));
    gltf.camera_at([0.0, 0.0, 5.0]);
    gltf.write(folder)
}

/// From the left: a front, a back that is not there, a back of a double-sided material, which is lit as if
/// it faced the viewer.
fn double_sided(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let surface = json!({ "baseColorFactor": [0.3, 0.6, 0.9, 1], "metallicFactor": 0 });
    let single = gltf.add("materials", json!({ "pbrMetallicRoughness": surface }));
    let double =
        gltf.add("materials", json!({ "pbrMetallicRoughness": surface, "doubleSided": true }));
    for (n, (material, turned)) in
        [(single, false), (single, true), (double, true)].into_iter().enumerate()
    {
        let mesh = gltf.mesh(&Mesh::square(0.0, 1.0), material, json!({}));
        let rotation = if turned { json!([0, 1, 0, 0]) } else { json!([0, 0, 0, 1]) };
        gltf.node(json!({ "mesh": mesh, "translation": [(n as f32 - 1.0) * 2.3, 0, 0],
            "rotation": rotation }));
    }
    gltf.camera_at([0.0, 0.0, 6.9]);
    gltf.write(folder)
}

/// Red, green, blue and white corners, interpolated as linear light; times grey at the right.
fn vertex_colours(folder: &Path) -> String {
    let mut gltf = Gltf::new();
    let corners = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 1.0, 1.0]];
    for (n, grey) in [1.0, 0.3].into_iter().enumerate() {
        let material = gltf.unlit([grey, grey, grey, 1.0]);
        let colors = gltf.floats(&corners);
        let more = json!({ "attributes": { "COLOR_0": colors } });
        let mesh = gltf.mesh(&Mesh::square(0.0, 1.0), material, more);
        gltf.node(json!({ "mesh": mesh, "translation": [n as f32 * 2.3 - 1.15, 0, 0] }));
    }
    gltf.camera_at([0.0, 0.0, 4.6]);
    gltf.write(folder)
}

/// Colour, texture, transparency and gloss of MTL; negative indices; a polygon of six corners.
fn obj_materials(folder: &Path) -> String {
    let texels: Vec<u8> = (0..16).flat_map(|i| quarters(i % 4, i / 4)).collect();
    fs::write(folder.join("map.png"), png(4, &texels)).unwrap();
    fs::write(
        folder.join("scene.mtl"),
        "newmtl plain\nKd 0.8 0.3 0.2\nnewmtl mapped\nKd 1 1 1\nmap_Kd map.png\n\
         newmtl glass\nKd 0.2 0.5 0.9\nd 0.4\nnewmtl glossy\nKd 0.1 0.4 0.15\nKs 0.8 0.8 0.8\nNs 200\n",
    )
    .unwrap();
    let mut text = String::from("mtllib scene.mtl\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n");
    for (n, material) in ["plain", "mapped", "glass"].iter().enumerate() {
        let (x, z) = (n as f32 * 1.6, if *material == "glass" { 0.5 } else { 0.0 });
        text += &format!(
            "o {material}\nv {x} 0 {z}\nv {} 0 {z}\nv {} 1.5 {z}\nv {x} 1.5 {z}\nusemtl {material}\n\
             f -4/1 -3/2 -2/3 -1/4\n",
            x + 1.5,
            x + 1.5
        );
    }
    text += "o hexagon\n";
    for n in 0..6 {
        let a = n as f32 * std::f32::consts::TAU / 6.0;
        text += &format!("v {} {} -0.2\n", 3.2 + a.cos(), 1.2 + a.sin());
    }
    text += "usemtl glossy\nf -6 -5 -4 -3 -2 -1\n";
    fs::write(folder.join("scene.obj"), text).unwrap();
    "scene.obj".into()
}

/// Two roofs of two slopes: without a smoothing group the ridge is an edge, in one it is round.
fn obj_smoothing(folder: &Path) -> String {
    let mut text = String::new();
    for (x, group) in [(0.0, "off"), (3.0, "1")] {
        text += &format!("s {group}\n");
        for (dx, y) in [(0.0, 0.0), (1.2, 0.9), (2.4, 0.0)] {
            text += &format!("v {} {y} 0\nv {} {y} 2\n", x + dx, x + dx);
        }
        text += "f -6 -5 -3 -4\nf -4 -3 -1 -2\n";
    }
    fs::write(folder.join("scene.obj"), text).unwrap();
    "scene.obj".into()
}
