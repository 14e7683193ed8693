//! Wavefront OBJ with MTL materials.

mod mtl;
mod parse;
mod polygon;

use super::{
    Scene,
    build::{Builder, Outcome},
    files,
    hash::BitMap,
    material::{AlphaMode, Map, Material, TextureUse},
    mesh::Mesh,
    texture::{ColorSpace, decode, decode_rgba, height_to_normal, with_mips},
};
use crate::{
    image::srgb_to_linear,
    texture::{Sampler, Texture, Wrap},
};
use glam::{DMat4, Vec2, Vec3, Vec4};
use mtl::{Mtl, MtlMap};
use parse::{Group, NONE, Obj, Smoothing};
use std::{collections::HashMap, path::Path};

/// Faces within this angle (its cosine, 50 degrees) are smoothed where a file leaves it open.
const CREASE: f32 = 0.64;

/// Loads the OBJ in `bytes`, which come from `path`.
pub(super) fn load(path: &Path, name: &str, bytes: &[u8]) -> Outcome<Scene> {
    let text = String::from_utf8_lossy(bytes);
    let obj = parse::parse(&text)?;
    let mut builder = Builder::default();
    obj.warnings.iter().for_each(|w| builder.warn(w));
    let folder = path.parent().unwrap_or(Path::new(""));
    let library = libraries(&obj, folder, &mut builder);
    let mut textures = Textures { folder, made: HashMap::new() };
    for name in &obj.materials {
        let material = match library.get(name) {
            Some(mtl) => textures.material(mtl, &mut builder),
            None => {
                builder.warn(format!("the material `{name}` is not defined; grey is drawn"));
                grey()
            }
        };
        builder.materials.push(material);
    }
    builder.materials.push(grey());
    let mut steps = polygon::STEPS;
    for group in &obj.groups {
        let material = (group.material as usize).min(builder.materials.len() - 1);
        let mut mesh = mesh(&obj, group, &mut steps);
        if let Some(set) = builder.materials[material].normal_uv_set() {
            mesh.make_tangents(set);
        }
        builder.mesh_node(&mesh, material, DMat4::IDENTITY)?;
    }
    if obj.groups.is_empty() {
        builder.warn("the file has no faces");
    }
    builder.finish(name)
}

/// All materials of all libraries that the file names.
fn libraries(obj: &Obj, folder: &Path, builder: &mut Builder) -> HashMap<String, Mtl> {
    let mut library = HashMap::new();
    let mut read = |name: &str| {
        let path = files::find(folder, name)?;
        let bytes = files::read(&path).ok()?;
        mtl::parse(&String::from_utf8_lossy(&bytes), &mut library);
        Some(())
    };
    for names in &obj.libraries {
        // One name with spaces in it, or several names.
        if read(names).is_some() {
            continue;
        }
        for name in names.split_whitespace() {
            if read(name).is_none() {
                builder.warn(format!("the material library `{name}` cannot be read"));
            }
        }
    }
    library
}

/// The material of faces that have none.
fn grey() -> Material {
    Material {
        base_color: Vec4::new(0.6, 0.6, 0.6, 1.0),
        metallic: 0.0,
        roughness: 0.7,
        double_sided: true,
        ..Material::default()
    }
}

/// The triangles of a group, with normals.
fn mesh(obj: &Obj, group: &Group, steps: &mut u64) -> Mesh {
    let has_uvs = group.corners.iter().any(|c| c[1] != NONE);
    let has_normals = group.corners.iter().all(|c| c[2] != NONE);
    let mut mesh = Mesh::default();
    let mut numbers: BitMap<parse::Corner, u32> =
        BitMap::with_capacity_and_hasher(group.corners.len() / 2, Default::default());
    let mut indices = Vec::with_capacity(group.corners.len());
    let mut add = |corner: parse::Corner, mesh: &mut Mesh| {
        *numbers.entry(corner).or_insert_with(|| {
            mesh.positions.push(obj.positions[corner[0] as usize]);
            if has_uvs {
                // A corner without texture coordinates beside others that have some.
                mesh.uvs[0].push(obj.uvs.get(corner[1] as usize).copied().unwrap_or(Vec2::ZERO));
            }
            if has_normals {
                mesh.normals.push(obj.normals[corner[2] as usize]);
            }
            if let Some(color) = obj.colors.get(corner[0] as usize) {
                mesh.colors.push(color.extend(1.0));
            }
            mesh.positions.len() as u32 - 1
        })
    };
    let (mut at, mut points, mut triangles) = (0, Vec::new(), Vec::new());
    for &arity in &group.arities {
        let corners = &group.corners[at..at + arity as usize];
        at += arity as usize;
        points.clear();
        points.extend(corners.iter().map(|c| obj.positions[c[0] as usize]));
        triangles.clear();
        polygon::triangulate(&points, steps, &mut triangles);
        for &corner in triangles.as_flattened() {
            indices.push(add(corners[corner], &mut mesh));
        }
    }
    mesh.indices = Some(indices);
    mesh.settle();
    if !has_normals {
        match group.smoothing {
            Smoothing::Off => mesh.make_flat_normals(),
            Smoothing::Unsaid => mesh.make_smooth_normals(CREASE),
            Smoothing::Group(_) => mesh.make_smooth_normals(-1.0),
        }
    }
    mesh
}

/// Textures of the file, each made once.
struct Textures<'a> {
    folder: &'a Path,
    made: HashMap<(String, Kind), usize>,
}

/// What a picture is used for.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Kind {
    Color,
    /// With the alpha from another picture.
    Masked(String),
    /// Normals, or heights with this bump factor (its bits).
    Bump(u32),
    Normal,
}

impl Textures<'_> {
    /// Metallic-roughness from what MTL says: colours were chosen on a screen, so they are sRGB;
    /// the shininess of Blinn and Phong has the same lobe as a roughness of GGX.
    fn material(&mut self, mtl: &Mtl, builder: &mut Builder) -> Material {
        let linear = |c: [f32; 3]| Vec3::from_array(c.map(|v| srgb_to_linear(v.clamp(0.0, 1.0))));
        let mut diffuse = mtl.diffuse.map_or(Vec3::ONE, linear);
        if mtl.diffuse_map.is_some() && diffuse == Vec3::ZERO {
            // Some exporters leave black beside a texture.
            diffuse = Vec3::ONE;
        }
        let shiny = mtl.specular.unwrap_or_default().into_iter().fold(0.0, f32::max);
        let roughness = match mtl.shininess {
            Some(ns) if shiny > 0.0 => (2.0 / (ns.max(0.0) + 2.0)).powf(0.25),
            _ => 0.9,
        };
        let opacity = mtl.opacity.unwrap_or(1.0).clamp(0.0, 1.0);
        let mut material = Material {
            base_color: diffuse.extend(opacity),
            emissive: mtl.emissive.map_or(Vec3::ZERO, linear),
            metallic: mtl.metallic.unwrap_or(0.0),
            roughness: mtl.roughness.unwrap_or(roughness),
            alpha: if opacity < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
            double_sided: true,
            ..Material::default()
        };
        let color = match (&mtl.diffuse_map, &mtl.opacity_map) {
            (Some(color), Some(mask)) => Some((color, Kind::Masked(mask.name.clone()))),
            (None, Some(mask)) => Some((mask, Kind::Masked(mask.name.clone()))),
            (Some(color), None) => Some((color, Kind::Color)),
            (None, None) => None,
        };
        if let Some((map, kind)) = color
            && let Some((used, has_alpha)) = self.texture(map, kind.clone(), builder)
        {
            material.maps[Map::BaseColor as usize] = Some(used);
            if (has_alpha || kind != Kind::Color) && material.alpha == AlphaMode::Opaque {
                material.alpha = AlphaMode::Mask;
            }
        }
        if let Some(map) = &mtl.emissive_map {
            let used = self.texture(map, Kind::Color, builder);
            material.maps[Map::Emissive as usize] = used.map(|(used, _)| used);
            if material.emissive == Vec3::ZERO {
                material.emissive = Vec3::ONE;
            }
        }
        let bump = match (&mtl.normal_map, &mtl.bump_map) {
            (Some(map), _) => Some((map, Kind::Normal)),
            (None, Some(map)) => Some((map, Kind::Bump(map.bump.to_bits()))),
            (None, None) => None,
        };
        if let Some((map, kind)) = bump {
            let used = self.texture(map, kind, builder);
            material.maps[Map::Normal as usize] = used.map(|(used, _)| used);
        }
        material
    }

    /// The texture of `map` and whether its file can have alpha; `None` if there is no such file.
    fn texture(
        &mut self,
        map: &MtlMap,
        kind: Kind,
        builder: &mut Builder,
    ) -> Option<(TextureUse, bool)> {
        let read = |name: &str, builder: &mut Builder| {
            let path = files::find_by_name(self.folder, name);
            let bytes = path.and_then(|path| files::read(&path).ok());
            if bytes.is_none() {
                builder.warn(format!("the texture `{name}` cannot be read and is left out"));
            }
            bytes
        };
        let bytes = read(&map.name, builder)?;
        // Byte 25 of a PNG is its colour type; 4 and 6 have alpha.
        let has_alpha = bytes.starts_with(b"\x89PNG") && matches!(bytes.get(25), Some(4 | 6));
        let number = match self.made.get(&(map.name.clone(), kind.clone())) {
            Some(&number) => number,
            None => {
                let mask = match &kind {
                    Kind::Masked(mask) => Some(read(mask, builder)?),
                    _ => None,
                };
                let (label, job_kind) = (map.name.clone(), kind.clone());
                let job = move || {
                    let made = make(&label, &job_kind, &bytes, mask.as_deref());
                    made.map_err(|e| format!("the texture `{label}`: {e}"))
                };
                let number = builder.texture(job);
                self.made.insert((map.name.clone(), kind), number);
                number
            }
        };
        let wrap = if map.clamp { Wrap::ClampToEdge } else { Wrap::Repeat };
        let sampler = Sampler { wrap_u: wrap, wrap_v: wrap, ..Sampler::default() };
        // MTL scales and moves coordinates that run upwards.
        let ([ou, ov], [su, sv]) = (map.offset, map.scale);
        let offset = Vec2::new(ou, 1.0 - sv - ov);
        let used = TextureUse { sampler, ..TextureUse::new(number) };
        Some((used.with_transform(offset, 0.0, Vec2::new(su, sv)), has_alpha))
    }
}

/// Decodes a picture for its use.
fn make(label: &str, kind: &Kind, bytes: &[u8], mask: Option<&[u8]>) -> Result<Texture, String> {
    match kind {
        Kind::Color => decode(label, bytes, ColorSpace::Srgb),
        Kind::Normal => decode(label, bytes, ColorSpace::Linear),
        Kind::Masked(_) => {
            let (extent, mut texels) = decode_rgba(bytes)?;
            let (size, alpha) = decode_rgba(mask.unwrap_or(bytes))?;
            for (i, texel) in texels.chunks_exact_mut(4).enumerate() {
                let (x, y) = (i as u64 % extent.width as u64, i as u64 / extent.width as u64);
                let x = x * size.width as u64 / extent.width as u64;
                let y = y * size.height as u64 / extent.height as u64;
                let at = (y * size.width as u64 + x) as usize * 4;
                // A mask is bright where there is something; with alpha, that is the mask.
                texel[3] = if alpha[at + 3] < 255 { alpha[at + 3] } else { alpha[at] };
            }
            Ok(with_mips(label, extent, texels, ColorSpace::Srgb))
        }
        Kind::Bump(bump) => {
            let (extent, texels) = decode_rgba(bytes)?;
            let texels = match looks_like_normals(&texels) {
                true => texels,
                false => height_to_normal(extent, &texels, 2.0 * f32::from_bits(*bump)),
            };
            Ok(with_mips(label, extent, texels, ColorSpace::Linear))
        }
    }
}

/// Whether a "bump map" holds normals: many exporters write them under that name. Normals point
/// outwards on average, so the mean is near (128, 128, 255); heights are grey.
fn looks_like_normals(texels: &[u8]) -> bool {
    let count = (texels.len() / 4).max(1) as u64;
    let mean = |c: usize| texels.iter().skip(c).step_by(4).map(|&v| v as u64).sum::<u64>() / count;
    let near = 104..152;
    near.contains(&mean(0)) && near.contains(&mean(1)) && mean(2) > 200
}
