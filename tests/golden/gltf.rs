//! glTF files made in code: meshes of floats, materials and textures, written with their `.bin` and `.png`.

use serde_json::{Value, json};
use std::{fs, path::Path};

/// A document that grows. Everything of it is in one buffer.
pub struct Gltf {
    pub document: Value,
    bytes: Vec<u8>,
    images: Vec<(String, Vec<u8>)>,
}

/// A mesh: positions and what else its vertices have.
#[derive(Clone, Default)]
pub struct Mesh {
    pub positions: Vec<[f32; 3]>,
    pub normals: Vec<[f32; 3]>,
    pub uvs: Vec<[f32; 2]>,
    pub indices: Vec<u32>,
}

impl Mesh {
    /// A square from -1 to 1 that faces +z, its texture coordinates from `low` to `high`, v downwards.
    pub fn square(low: f32, high: f32) -> Self {
        let corners = [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)];
        let uv = |t: f32| low + (high - low) * (t + 1.0) / 2.0;
        Self {
            positions: corners.map(|(x, y)| [x, y, 0.0]).to_vec(),
            normals: vec![[0.0, 0.0, 1.0]; 4],
            uvs: corners.map(|(x, y)| [uv(x), uv(-y)]).to_vec(),
            indices: vec![0, 1, 2, 0, 2, 3],
        }
    }

    /// A ball of radius 1.
    pub fn ball() -> Self {
        let (columns, rows) = (32u32, 16u32);
        let mut mesh = Mesh::default();
        for j in 0..=rows {
            for i in 0..=columns {
                let (u, v) = (i as f32 / columns as f32, j as f32 / rows as f32);
                let (a, b) = (u * std::f32::consts::TAU, v * std::f32::consts::PI);
                let place = [a.sin() * b.sin(), b.cos(), a.cos() * b.sin()];
                mesh.positions.push(place);
                mesh.normals.push(place);
                mesh.uvs.push([u, v]);
            }
        }
        for j in 0..rows {
            for i in 0..columns {
                let a = j * (columns + 1) + i;
                let b = a + columns + 1;
                mesh.indices.extend([a, b, b + 1, a, b + 1, a + 1]);
            }
        }
        mesh
    }
}

impl Gltf {
    pub fn new() -> Self {
        let document = json!({
            "asset": { "version": "2.0" },
            "scene": 0, "scenes": [{ "nodes": [] }], "nodes": [], "meshes": [], "materials": [],
            "textures": [], "images": [], "samplers": [], "accessors": [], "bufferViews": [],
            "cameras": [], "animations": [], "skins": [],
        });
        Self { document, bytes: Vec::new(), images: Vec::new() }
    }

    /// Appends `value` to the list called `list` and returns its number.
    pub fn add(&mut self, list: &str, value: Value) -> usize {
        let list = self.document[list].as_array_mut().unwrap();
        list.push(value);
        list.len() - 1
    }

    /// Adds a node to the scene.
    pub fn node(&mut self, node: Value) -> usize {
        let number = self.add("nodes", node);
        self.document["scenes"][0]["nodes"].as_array_mut().unwrap().push(number.into());
        number
    }

    /// An accessor of `N` floats each, which names its least and largest values.
    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let kind = ["SCALAR", "VEC2", "VEC3", "VEC4"].get(N - 1).unwrap_or(&"MAT4");
        let ends = |pick: fn(f32, f32) -> f32| -> Vec<f32> {
            (0..N).map(|n| values.iter().map(|v| v[n]).reduce(pick).unwrap()).collect()
        };
        let (min, max) = (ends(f32::min), ends(f32::max));
        let bytes: Vec<u8> =
            values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(
            &bytes,
            json!({
                "componentType": 5126, "count": values.len(), "type": kind, "min": min, "max": max,
            }),
        )
    }

    /// An accessor of indices.
    pub fn indices(&mut self, values: &[u32]) -> usize {
        let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.accessor(
            &bytes,
            json!({
                "componentType": 5125, "count": values.len(), "type": "SCALAR",
            }),
        )
    }

    /// An accessor of four joints each.
    pub fn joints(&mut self, values: &[[u8; 4]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().copied().collect();
        self.accessor(
            &bytes,
            json!({
                "componentType": 5121, "count": values.len(), "type": "VEC4",
            }),
        )
    }

    fn accessor(&mut self, bytes: &[u8], mut accessor: Value) -> usize {
        let offset = self.bytes.len();
        self.bytes.extend_from_slice(bytes);
        accessor["bufferView"] = self
            .add(
                "bufferViews",
                json!({ "buffer": 0, "byteOffset": offset, "byteLength": bytes.len() }),
            )
            .into();
        self.add("accessors", accessor)
    }

    /// The attributes of `mesh`.
    pub fn attributes(&mut self, mesh: &Mesh) -> Value {
        let mut attributes = json!({ "POSITION": self.floats(&mesh.positions) });
        if !mesh.normals.is_empty() {
            attributes["NORMAL"] = self.floats(&mesh.normals).into();
        }
        if !mesh.uvs.is_empty() {
            attributes["TEXCOORD_0"] = self.floats(&mesh.uvs).into();
        }
        attributes
    }

    /// A mesh of one primitive; `more` are further properties of the primitive.
    pub fn mesh(&mut self, mesh: &Mesh, material: usize, more: Value) -> usize {
        let mut primitive = json!({ "attributes": self.attributes(mesh), "material": material });
        if !mesh.indices.is_empty() {
            primitive["indices"] = self.indices(&mesh.indices).into();
        }
        for (key, value) in more.as_object().unwrap() {
            match (key.as_str(), value.as_object()) {
                ("attributes", Some(attributes)) => {
                    for (key, value) in attributes {
                        primitive["attributes"][key] = value.clone();
                    }
                }
                _ => primitive[key] = value.clone(),
            }
        }
        self.add("meshes", json!({ "primitives": [primitive] }))
    }

    /// A material that shows its colour as it is, whatever the light.
    pub fn unlit(&mut self, color: [f32; 4]) -> usize {
        self.add(
            "materials",
            json!({
                "pbrMetallicRoughness": { "baseColorFactor": color },
                "extensions": { "KHR_materials_unlit": {} },
            }),
        )
    }

    /// A texture of `size` x `size` texels; wrap and filters as the numbers of glTF.
    pub fn texture(
        &mut self,
        size: u32,
        [wrap_s, wrap_t, mag, min]: [u32; 4],
        texel: impl Fn(u32, u32) -> [u8; 4],
    ) -> usize {
        let rgba: Vec<u8> = (0..size * size).flat_map(|i| texel(i % size, i / size)).collect();
        let name = format!("{}.png", self.images.len());
        self.images.push((name.clone(), png(size, &rgba)));
        let image = self.add("images", json!({ "uri": name }));
        let sampler = self.add(
            "samplers",
            json!({
                "wrapS": wrap_s, "wrapT": wrap_t, "magFilter": mag, "minFilter": min,
            }),
        );
        self.add("textures", json!({ "source": image, "sampler": sampler }))
    }

    /// A perspective camera at `place` that looks along -z.
    pub fn camera_at(&mut self, place: [f32; 3]) {
        let camera = json!({ "type": "perspective",
            "perspective": { "yfov": 0.8, "znear": 0.1, "zfar": 100.0 } });
        let number = self.add("cameras", camera);
        self.node(json!({ "camera": number, "translation": place }));
    }

    /// Writes everything into `folder`; returns the name of the file.
    pub fn write(mut self, folder: &Path) -> String {
        fs::write(folder.join("scene.bin"), &self.bytes).unwrap();
        self.document["buffers"] = json!([{ "uri": "scene.bin", "byteLength": self.bytes.len() }]);
        let mut used = Vec::new();
        let text = self.document.to_string();
        for name in [
            "KHR_materials_unlit",
            "KHR_texture_transform",
            "KHR_lights_punctual",
            "KHR_materials_emissive_strength",
        ] {
            if text.contains(name) {
                used.push(name);
            }
        }
        self.document["extensionsUsed"] = json!(used);
        // The format has no empty lists.
        let document = self.document.as_object_mut().unwrap();
        document.retain(|_, value| value.as_array().is_none_or(|list| !list.is_empty()));
        fs::write(folder.join("scene.gltf"), self.document.to_string()).unwrap();
        for (name, bytes) in &self.images {
            fs::write(folder.join(name), bytes).unwrap();
        }
        "scene.gltf".into()
    }
}

/// A PNG of `size` x `size` texels.
pub fn png(size: u32, rgba: &[u8]) -> Vec<u8> {
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, size, size);
    encoder.set_color(png::ColorType::Rgba);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.write_header().unwrap().write_image_data(rgba).unwrap();
    bytes
}
