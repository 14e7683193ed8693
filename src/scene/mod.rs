//! Scenes: glTF 2.0, OBJ and built-in ones, as passes for any executor.
//!
//! A [`Scene`] is loaded once, at one moment of its animations, and is immutable from then on.
//! [`Scene::pass`] records it for a camera; all passes of a scene share its buffers, textures and
//! pipelines by [`Arc`], so an executor uploads and compiles them once and a moved camera costs a
//! new list of draws.
//!
//! The engine has no shading of its own: materials are an ordinary Vulkan shader pair,
//! `glsl/scene/material.vert` and `material.frag`, metallic-roughness under one key light and a
//! sky and ground. Loaders are strict about memory and lenient about the rest. Data that would make them read
//! outside a buffer or never end is an error with a sentence. Data that can be left out while the rest is
//! still right is a [warning](Scene::warnings).
//!
//! Code map: `gltf` and `obj` describe a file to `build`, which keeps geometry in `store`,
//! materials by `material` and textures by `texture`; `place` turns the hierarchy into draws, in the
//! double precision of `anchor` and `bounds`; `mesh` completes what files leave out; `pass` culls,
//! sorts and draws; `builtin` needs no file.

mod anchor;
mod bounds;
mod build;
mod builtin;
mod camera;
mod content;
mod files;
mod gltf;
mod hash;
mod light;
mod load;
mod material;
mod mesh;
mod obj;
mod pass;
mod place;
mod shading;
mod store;
mod texture;
mod uri;

pub use bounds::{Bounds, Containment, Frustum};
pub use camera::{Camera, Projection};
pub use light::Light;
pub use load::LoadOptions;
pub use pass::PassOptions;
pub use texture::{ColorSpace, load_texture};

use crate::{
    pass::{BindingSet, BufferSource, Pipeline},
    state::PrimitiveKind,
};
use std::{path::PathBuf, sync::Arc};

/// Things to draw, lit and placed.
#[derive(Clone, Debug)]
pub struct Scene {
    name: String,
    warnings: Vec<String>,
    files: Vec<PathBuf>,
    cameras: Vec<Camera>,
    bounds: Bounds,
    light: Light,
    pipelines: Vec<Arc<Pipeline>>,
    chunks: Vec<Arc<BufferSource>>,
    /// What missing attributes read.
    constants: store::Slice,
    parts: Vec<build::Part>,
    nodes: Vec<place::CullNode>,
    items: Vec<place::Item>,
    /// By material.
    sets: Vec<Arc<BindingSet>>,
    /// Whether it blends, by material.
    blended: Vec<bool>,
}

impl Scene {
    /// The file's name without its folder, or the name of the built-in scene.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// A sentence for each thing that was left out or replaced while loading.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The files that it was read from, its own first: materials, buffers and pictures too. None if it is built in.
    pub fn files(&self) -> &[PathBuf] {
        &self.files
    }

    /// The cameras of the file, in the order of its nodes.
    pub fn cameras(&self) -> &[Camera] {
        &self.cameras
    }

    /// The box around everything, in world space.
    pub fn bounds(&self) -> Bounds {
        self.bounds
    }

    /// The light of the scene.
    pub fn light(&self) -> Light {
        self.light
    }

    /// Replaces the light; passes made before keep theirs.
    pub fn set_light(&mut self, light: Light) {
        self.light = light;
    }

    /// Triangles of all draws, instances included.
    pub fn triangles(&self) -> u64 {
        let of = |item: &place::Item| {
            let part = &self.parts[item.part];
            let instances = item.instances.map_or(1, |(_, count)| u64::from(count));
            let is_drawn = part.topology.kind() == PrimitiveKind::Triangle;
            let primitives = if is_drawn { part.topology.primitives(part.count) } else { 0 };
            u64::from(primitives) * instances
        };
        self.items.iter().map(of).sum()
    }
}
