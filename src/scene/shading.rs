//! The shader pair of scenes: ordinary Vulkan GLSL, compiled once per process.
//!
//! Two fragment modules from one source: with `discard` for MASK, and without it for everything
//! else, because a shader that may discard costs every triangle it draws its early depth test.
//! All else that varies between materials is a flag in the material's block: a specialization
//! constant would be another pipeline to compile for a branch that every quad takes alike.

use super::{camera::Camera, light::Light};
use crate::{
    Result,
    image::Extent,
    pass::{Binding, BindingEntry, BindingSet, Buffer, BufferRange},
    shader::{Shader, Stage},
};
use glam::{Mat3, Mat4};
use std::sync::{Arc, OnceLock};

/// The modules, shared by all scenes of a process.
#[derive(Clone)]
pub(super) struct Shaders {
    pub vertex: Arc<Shader>,
    pub opaque: Arc<Shader>,
    pub mask: Arc<Shader>,
}

/// Compiles the modules, or returns those that are there.
pub(super) fn shaders() -> Result<Shaders> {
    static MADE: OnceLock<Shaders> = OnceLock::new();
    if let Some(made) = MADE.get() {
        return Ok(made.clone());
    }
    let vertex = include_str!("../../glsl/scene/material.vert");
    let fragment = include_str!("../../glsl/scene/material.frag");
    let (version, rest) = fragment.split_once('\n').unwrap_or((fragment, ""));
    let mask = format!("{version}\n#define ALPHA_MASK\n#line 2\n{rest}");
    let compile =
        |stage, label: &str, source: &str| Shader::from_glsl(stage, label, source).map(Arc::new);
    let made = Shaders {
        vertex: compile(Stage::Vertex, "scene/material.vert", vertex)?,
        opaque: compile(Stage::Fragment, "scene/material.frag", fragment)?,
        mask: compile(Stage::Fragment, "scene/material.frag (mask)", &mask)?,
    };
    Ok(MADE.get_or_init(|| made).clone())
}

/// `Frame` of both shaders, in std140: a matrix and vectors of four only.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Frame {
    view_projection: Mat4,
    /// w: 1 if the view is a perspective
    eye: [f32; 4],
    /// From the scene to the viewer.
    backward: [f32; 4],
    key_direction: [f32; 4],
    key_color: [f32; 4],
    sky: [f32; 4],
    horizon: [f32; 4],
    ground: [f32; 4],
}

/// The descriptor set 0 of a pass.
pub(super) fn frame_set(camera: &Camera, extent: Extent, light: &Light) -> Arc<BindingSet> {
    let perspective = matches!(camera.projection, super::Projection::Perspective { .. });
    let frame = Frame {
        view_projection: camera.view_projection(extent),
        eye: camera.eye().extend(f32::from(u8::from(perspective))).to_array(),
        backward: camera.backward().extend(0.0).to_array(),
        key_direction: light.key_direction.extend(0.0).to_array(),
        key_color: light.key_color.extend(0.0).to_array(),
        sky: light.sky.extend(0.0).to_array(),
        horizon: light.horizon.extend(0.0).to_array(),
        ground: light.ground.extend(0.0).to_array(),
    };
    let bytes = bytemuck::bytes_of(&frame).to_vec();
    let buffer = Arc::new(Buffer { label: "frame".into(), bytes });
    let resources = vec![Binding::Uniform(BufferRange::whole(&buffer))];
    Arc::new(BindingSet { entries: vec![BindingEntry { binding: 0, resources }] })
}

/// `Draw` of the vertex shader.
pub(super) fn push_constants(model: &Mat4, normal: &Mat3) -> Vec<u8> {
    // w tells whether the model mirrors, which turns bitangents round.
    let mirror = if model.determinant() < 0.0 { -1.0 } else { 1.0 };
    let columns =
        [normal.x_axis, normal.y_axis, normal.z_axis].map(|c| c.extend(mirror).to_array());
    [bytemuck::bytes_of(model), bytemuck::bytes_of(&columns)].concat()
}
