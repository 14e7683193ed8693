//! The shader pair of scenes: ordinary Vulkan GLSL, compiled before (see `prebuilt`).
//!
//! Two fragment modules from one source: with `discard` for MASK, and without it for everything
//! else, because a shader that may discard loses the early depth test for every triangle that it draws. All
//! other differences between materials are flags in the material's block: a specialization constant would
//! need another pipeline to compile, only to save a branch that all lanes of a quad take alike.

use super::{
    camera::{Camera, Projection},
    light::Light,
    place::direction_matrix,
};
use crate::{
    Result,
    image::Extent,
    pass::{Binding, BindingEntry, BindingSet, BufferRange, BufferSource},
    prebuilt::scene as prebuilt,
    shader::{Shader, Stage},
};
use glam::{DMat4, DVec3, Mat4};
use std::sync::{Arc, OnceLock};

/// The modules, shared by all scenes of a process.
#[derive(Clone)]
pub(super) struct Shaders {
    pub vertex: Arc<Shader>,
    pub opaque: Arc<Shader>,
    pub mask: Arc<Shader>,
}

/// The modules, reflected once per process.
pub(super) fn shaders() -> Result<Shaders> {
    static MADE: OnceLock<Shaders> = OnceLock::new();
    if let Some(made) = MADE.get() {
        return Ok(made.clone());
    }
    let module = |stage, label: &str, words| Shader::own(stage, label, words).map(Arc::new);
    let made = Shaders {
        vertex: module(Stage::Vertex, "scene/material.vert", prebuilt::VERTEX)?,
        opaque: module(Stage::Fragment, "scene/material.frag", prebuilt::FRAGMENT)?,
        mask: module(Stage::Fragment, "scene/material.frag (mask)", prebuilt::MASK_FRAGMENT)?,
    };
    Ok(MADE.get_or_init(|| made).clone())
}

/// `Frame` of both shaders, in std140: vectors of four only.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Frame {
    /// Columns of the matrix from x, y and w of clip space to the direction towards the viewer.
    to_viewer_x: [f32; 4],
    to_viewer_y: [f32; 4],
    to_viewer_w: [f32; 4],
    key_direction: [f32; 4],
    key_color: [f32; 4],
    sky: [f32; 4],
    horizon: [f32; 4],
    ground: [f32; 4],
}

/// The descriptor set 0 of a pass.
pub(super) fn frame_set(camera: &Camera, extent: Extent, light: &Light) -> Arc<BindingSet> {
    let projection = camera.projection.matrix(f64::from(extent.width) / f64::from(extent.height));
    // The rows of the view are the camera's axes in the world. With a perspective, x and y of clip
    // space are those of the view times a factor, and w is how far in front a place is.
    let [right, up, backward] = [0, 1, 2].map(|i| camera.view.row(i).truncate());
    let [x, y] = match camera.projection {
        Projection::Perspective { .. } => [-right / projection.x_axis.x, -up / projection.y_axis.y],
        Projection::Orthographic { .. } => [DVec3::ZERO; 2],
    };
    let column = |v: DVec3| v.as_vec3().extend(0.0).to_array();
    let frame = Frame {
        to_viewer_x: column(x),
        to_viewer_y: column(y),
        to_viewer_w: column(backward),
        key_direction: light.key_direction.extend(0.0).to_array(),
        key_color: light.key_color.extend(0.0).to_array(),
        sky: light.sky.extend(0.0).to_array(),
        horizon: light.horizon.extend(0.0).to_array(),
        ground: light.ground.extend(0.0).to_array(),
    };
    let bytes = bytemuck::bytes_of(&frame).to_vec();
    let buffer = Arc::new(BufferSource::new("frame", bytes));
    let resources = vec![Binding::Uniform(BufferRange::whole(&buffer))];
    Arc::new(BindingSet { entries: vec![BindingEntry { binding: 0, resources }] })
}

/// `Draw` of the vertex shader.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Draw {
    /// From the draw's space to clip space in one step: each component is rounded once, and what
    /// cancels between model, view and projection has cancelled in double precision.
    clip: Mat4,
    /// Columns of the matrix that turns directions to the world; w of the first is -1 if the draw is
    /// mirrored, its instances included, and 1 otherwise.
    model_x: [f32; 4],
    model_y: [f32; 4],
    model_z: [f32; 4],
}

// What every device has for push constants.
const _: () = assert!(size_of::<Draw>() <= 128);

/// The push constants of a draw; `clip` and `model` lead to clip space and to the world.
pub(super) fn push_constants(clip: Mat4, model: &DMat4, mirrored: bool) -> Vec<u8> {
    let turn = direction_matrix(model);
    let hand = if mirrored { -1.0 } else { 1.0 };
    let [model_x, model_y, model_z] =
        [turn.x_axis, turn.y_axis, turn.z_axis].map(|c| c.as_vec3().extend(hand).to_array());
    bytemuck::bytes_of(&Draw { clip, model_x, model_y, model_z }).to_vec()
}

#[cfg(test)]
mod tests {
    use super::super::material::Block;
    use super::*;
    use rspirv::{
        dr::{Instruction, Module, Operand},
        spirv::{Decoration, Op},
    };
    use std::mem::offset_of;

    /// The offset of a member of a block, as the compiler laid it out.
    fn offset(module: &Module, block: &str, member: &str) -> usize {
        let name = |i: &Instruction| match i.operands.last() {
            Some(Operand::LiteralString(name)) => name.clone(),
            _ => String::new(),
        };
        let found = module.debug_names.iter().find_map(|i| {
            let id = i.operands[0].unwrap_id_ref();
            let holder = module
                .debug_names
                .iter()
                .find(|n| n.class.opcode == Op::Name && n.operands[0].unwrap_id_ref() == id)?;
            let matches =
                i.class.opcode == Op::MemberName && name(i) == member && name(holder) == block;
            matches.then(|| (id, i.operands[1].unwrap_literal_bit32()))
        });
        let (id, number) = found.unwrap_or_else(|| panic!("{block}.{member} is in no shader"));
        module
            .annotations
            .iter()
            .find_map(|i| match i.operands.as_slice() {
                [
                    Operand::IdRef(of),
                    Operand::LiteralBit32(n),
                    Operand::Decoration(Decoration::Offset),
                    Operand::LiteralBit32(offset),
                ] if (*of, *n) == (id, number) => Some(*offset as usize),
                _ => None,
            })
            .unwrap_or_else(|| panic!("{block}.{member} has no offset"))
    }

    #[test]
    fn blocks_have_the_layout_of_the_shaders() {
        let [vertex, fragment, mask] =
            [prebuilt::VERTEX, prebuilt::FRAGMENT, prebuilt::MASK_FRAGMENT]
                .map(|words| rspirv::dr::load_words(words).unwrap());
        macro_rules! same {
            ($modules:expr, $block:literal, $rust:ty: $($member:ident)*) => {
                for module in $modules {
                    $(assert_eq!(
                        offset(module, $block, stringify!($member)),
                        offset_of!($rust, $member),
                        "{}.{}", $block, stringify!($member)
                    );)*
                }
            };
        }
        same!([&vertex, &fragment, &mask], "Frame", Frame:
            to_viewer_x to_viewer_y to_viewer_w key_direction key_color sky horizon ground);
        same!([&fragment, &mask], "Material", Block: base_color emissive surface specular flags uv_rows);
        same!([&vertex], "Draw", Draw: clip model_x model_y model_z);
    }
}
