//! Wavefront OBJ with MTL materials.
//!
//! `text` finds lines, words and names, `parse` (with `colors`) and `mtl` read statements, `geometry` makes meshes of
//! lines, points and polygons, which `polygon` cuts, and `materials` makes materials and textures.

mod colors;
mod geometry;
mod materials;
mod mtl;
mod parse;
mod polygon;
mod text;

use super::{
    Scene,
    build::{Builder, Outcome},
};
use crate::state::PrimitiveKind;
use glam::DMat4;
use std::path::Path;

/// Whether `bytes` begin as an OBJ does, whatever the file is called.
pub(super) fn looks_like_obj(bytes: &[u8]) -> bool {
    parse::looks_like_obj(&text::decode(bytes))
}

/// Loads the OBJ in `bytes`, which come from `path`.
pub(super) fn load(path: &Path, name: &str, bytes: &[u8]) -> Outcome<Scene> {
    let obj = parse::parse(&text::decode(bytes))?;
    let mut builder = Builder::default();
    obj.warnings.iter().for_each(|w| builder.warn(w));
    materials::add(&obj, path, &mut builder);
    let mut steps = polygon::STEPS;
    let bare = builder.materials.len() - 1;
    for (group, anchor) in obj.groups.iter().zip(geometry::anchors(&obj)) {
        let mut material = (group.material as usize).min(bare);
        let mut mesh = geometry::mesh(&obj, group, anchor, &mut steps);
        let normal_map = builder.materials[material].normal_uv_set();
        if group.topology.kind() == PrimitiveKind::Triangle {
            normal_map.into_iter().for_each(|set| mesh.make_tangents(set));
        } else if mesh.normals.is_empty() || normal_map.is_some() {
            // Lines and points have no surface that normals and tangents could be made of.
            material = builder.unlit(material);
        }
        builder.mesh_node(&mesh, material, DMat4::IDENTITY)?;
    }
    if steps == 0 {
        builder.warn("polygons of very many corners are cut as fans, which cover hollows too");
    }
    if obj.groups.is_empty() {
        builder.warn("the file has no faces, lines or points");
    }
    builder.finish(name)
}
