//! Limits of an opened device.

use super::{
    device::DeviceInfo,
    requirements::{
        BRESENHAM_LINES, DEPTH_CLIP, DIVISORS, PROVOKED_LAST, Probe, RECTANGULAR_LINES,
    },
};
use ash::vk;

/// Limits of an opened device that callers plan by.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct Limits {
    /// Bytes that one storage-buffer binding reaches.
    pub storage_range_bytes: u64,
    /// Bytes of one buffer.
    pub buffer_bytes: u64,
    /// Bytes of one image, or of anything else that is allocated.
    pub allocation_bytes: u64,
    /// Alignment of a storage-buffer binding's offset.
    pub storage_offset_bytes: u64,
    /// Workgroups of one dispatch, in each direction.
    pub dispatch: [u32; 3],
    /// Invocations of one workgroup.
    pub workgroup_invocations: u32,
    /// Shared memory of one workgroup.
    pub shared_bytes: u32,
    /// The subgroup size that a kernel gets if it asks for none.
    pub subgroup_size: u32,
    /// The subgroup sizes that a kernel may ask for.
    pub subgroup_sizes: (u32, u32),
    /// Pixels of a two-dimensional image, in each direction.
    pub image_side_px: u32,
    /// Pixels of a target that the device draws to itself, in each direction; compute has no such
    /// limit.
    pub target_side_px: u32,
    /// Bytes of device-local memory.
    pub memory_bytes: u64,
}

/// Limits of the device's own pipeline.
#[derive(Clone, Copy)]
pub(crate) struct DrawLimits {
    pub sets: u32,
    pub uniforms: u32,
    pub storages: u32,
    pub images: u32,
    pub storage_images: u32,
    pub samplers: u32,
    /// Bytes of a uniform block.
    pub uniform_bytes: u32,
    pub vertex_bindings: u32,
    /// Locations of vertex attributes, of vertex outputs, of fragment inputs, of fragment outputs.
    pub vertex_attributes: u32,
    pub vertex_outputs: u32,
    pub fragment_inputs: u32,
    pub fragment_outputs: u32,
    /// Colour targets, and whether each may blend in its own way.
    pub colors: u32,
    pub independent_blend: bool,
    /// Whether a depth bias may have a clamp.
    pub clamps_depth_bias: bool,
    /// Locations of fragment outputs where blending takes a second source; 0 if it takes none.
    pub second_sources: u32,
    /// Whether depths are clamped.
    pub clamps_depth: bool,
    /// Whether it has logic operations, and the depth bounds test.
    pub logic_ops: bool,
    pub depth_bounds: bool,
    /// The greatest divisor of a vertex binding; 1 if it takes no other, not even 0.
    pub divisor: u32,
    /// Whether alpha can be 1 whatever shaders return, and whether shaders can run for each sample.
    pub alpha_to_one: bool,
    pub sample_shading: bool,
    /// How depths of several samples become one.
    pub depth_resolves: vk::ResolveModeFlags,
    /// How several samples of stencil values become one texel.
    pub stencil_resolves: vk::ResolveModeFlags,
    /// Whether depths and stencil values are resolved in two ways, and whether one of them may not be resolved at all.
    pub resolves_apart: bool,
    pub resolves_one: bool,
    /// Whether clipping at the depth planes is a switch of its own.
    pub clips_depth_apart: bool,
    /// Which modes of lines may be asked for, and whether lines are rectangles unless one is.
    pub rectangular_lines: bool,
    pub bresenham_lines: bool,
    pub strict_lines: bool,
    /// Whether primitives may have adjacent vertices, and whether their last vertex may provoke them.
    pub adjacency: bool,
    pub provoked_last: bool,
    /// The least and the greatest width of lines.
    pub line_widths: [f32; 2],
    /// Commands of one indirect draw, and whether a buffer may say how many there are.
    pub commands: u32,
    pub counts_commands: bool,
}

pub(super) fn draw_limits(probe: &Probe) -> DrawLimits {
    let l = &probe.properties.limits;
    DrawLimits {
        sets: l.max_bound_descriptor_sets,
        uniforms: l.max_per_stage_descriptor_uniform_buffers,
        storages: l.max_per_stage_descriptor_storage_buffers,
        images: l.max_per_stage_descriptor_sampled_images,
        storage_images: l.max_per_stage_descriptor_storage_images,
        samplers: l.max_per_stage_descriptor_samplers,
        uniform_bytes: l.max_uniform_buffer_range,
        vertex_bindings: l.max_vertex_input_bindings,
        vertex_attributes: l.max_vertex_input_attributes,
        vertex_outputs: l.max_vertex_output_components / 4,
        fragment_inputs: l.max_fragment_input_components / 4,
        fragment_outputs: l.max_fragment_output_attachments,
        colors: l.max_color_attachments,
        independent_blend: probe.features.core.independent_blend == vk::TRUE,
        depth_bounds: probe.features.core.depth_bounds == vk::TRUE,
        logic_ops: probe.features.core.logic_op == vk::TRUE,
        second_sources: match probe.features.core.dual_src_blend == vk::TRUE {
            true => l.max_fragment_dual_src_attachments,
            false => 0,
        },
        clamps_depth: probe.features.core.depth_clamp == vk::TRUE,
        clamps_depth_bias: probe.features.core.depth_bias_clamp == vk::TRUE,
        divisor: match DIVISORS.iter().all(|feature| feature.is_on(&probe.features)) {
            // What the extension promises; its own property is not read.
            true => 65535,
            false => 1,
        },
        alpha_to_one: probe.features.core.alpha_to_one == vk::TRUE,
        sample_shading: probe.features.core.sample_rate_shading == vk::TRUE,
        depth_resolves: probe.vulkan12.supported_depth_resolve_modes,
        stencil_resolves: probe.vulkan12.supported_stencil_resolve_modes,
        resolves_apart: probe.vulkan12.independent_resolve == vk::TRUE,
        resolves_one: probe.vulkan12.independent_resolve_none == vk::TRUE,
        clips_depth_apart: DEPTH_CLIP.is_on(&probe.features),
        rectangular_lines: RECTANGULAR_LINES.is_on(&probe.features),
        bresenham_lines: BRESENHAM_LINES.is_on(&probe.features),
        strict_lines: l.strict_lines == vk::TRUE,
        adjacency: probe.features.core.geometry_shader == vk::TRUE,
        provoked_last: PROVOKED_LAST.is_on(&probe.features),
        line_widths: match probe.features.core.wide_lines == vk::TRUE {
            true => l.line_width_range,
            false => [1.0; 2],
        },
        commands: match probe.features.core.multi_draw_indirect == vk::TRUE
            && probe.features.core.draw_indirect_first_instance == vk::TRUE
        {
            true => l.max_draw_indirect_count,
            false => 0,
        },
        counts_commands: probe.features.v12.draw_indirect_count == vk::TRUE,
    }
}

pub(super) fn limits(probe: &Probe, info: &DeviceInfo) -> Limits {
    let l = &probe.properties.limits;
    let allocation = probe.vulkan11.max_memory_allocation_size;
    Limits {
        storage_range_bytes: u64::from(l.max_storage_buffer_range),
        buffer_bytes: probe.vulkan13.max_buffer_size.min(allocation),
        allocation_bytes: allocation,
        storage_offset_bytes: l.min_storage_buffer_offset_alignment,
        dispatch: l.max_compute_work_group_count,
        workgroup_invocations: l.max_compute_work_group_invocations,
        shared_bytes: l.max_compute_shared_memory_size,
        subgroup_size: probe.vulkan11.subgroup_size,
        subgroup_sizes: info.subgroup_sizes,
        image_side_px: l.max_image_dimension2_d,
        target_side_px: l
            .max_image_dimension2_d
            .min(l.max_framebuffer_width)
            .min(l.max_framebuffer_height),
        memory_bytes: info.memory_bytes,
    }
}
