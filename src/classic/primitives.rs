//! Points, lines and triangles of the device's own pipeline.

use crate::{
    pass::Pipeline,
    state::{LineMode, PrimitiveKind, Topology},
    vk::DrawLimits,
};
use ash::vk;

pub(super) fn primitive_topology(topology: Topology) -> vk::PrimitiveTopology {
    match topology {
        Topology::TriangleList => vk::PrimitiveTopology::TRIANGLE_LIST,
        Topology::TriangleStrip => vk::PrimitiveTopology::TRIANGLE_STRIP,
        Topology::TriangleFan => vk::PrimitiveTopology::TRIANGLE_FAN,
        Topology::PointList => vk::PrimitiveTopology::POINT_LIST,
        Topology::LineList => vk::PrimitiveTopology::LINE_LIST,
        Topology::LineStrip => vk::PrimitiveTopology::LINE_STRIP,
    }
}

fn draws_lines(pipeline: &Pipeline) -> bool {
    pipeline.topology.kind() == PrimitiveKind::Line
}

/// The width of lines. It is 1 where there are none: devices without wide lines take no other, whatever is drawn.
pub(super) fn line_width(pipeline: &Pipeline) -> f32 {
    if draws_lines(pipeline) { pipeline.line_width } else { 1.0 }
}

/// What lines cover; `None` if that is the device's default, or if there are no lines.
pub(super) fn line_state(
    pipeline: &Pipeline,
    limits: &DrawLimits,
) -> Option<vk::PipelineRasterizationLineStateCreateInfoKHR<'static>> {
    let mode = match pipeline.line_mode {
        LineMode::Rectangular if !limits.rectangular_lines => return None,
        LineMode::Rectangular => vk::LineRasterizationModeKHR::RECTANGULAR,
        LineMode::Bresenham => vk::LineRasterizationModeKHR::BRESENHAM,
    };
    let state = vk::PipelineRasterizationLineStateCreateInfoKHR::default();
    draws_lines(pipeline).then(|| state.line_rasterization_mode(mode))
}

/// What points and lines need of a device: whether they do, whether it is there, and what it is.
pub(super) fn of_primitives(
    pipeline: &Pipeline,
    limits: &DrawLimits,
) -> [(bool, bool, &'static str); 5] {
    let lines = draws_lines(pipeline);
    let bresenham = lines && pipeline.line_mode == LineMode::Bresenham;
    let [thinnest, widest] = limits.line_widths;
    let points = pipeline.topology.kind() == PrimitiveKind::Point;
    [
        (
            points && !pipeline.vertex.reflection.writes_point_size,
            false,
            "size for points whose vertex shader writes no gl_PointSize, as in all of Vulkan",
        ),
        (
            lines && !bresenham,
            limits.rectangular_lines || limits.strict_lines,
            "lines that are rectangles (rectangularLines or strictLines)",
        ),
        (bresenham, limits.bresenham_lines, "Bresenham lines (bresenhamLines)"),
        (
            lines,
            (thinnest..=widest).contains(&pipeline.line_width),
            "lines of this width (wideLines, lineWidthRange)",
        ),
        (
            bresenham
                && (pipeline.alpha_to_coverage || pipeline.alpha_to_one || pipeline.sample_shading),
            false,
            "Bresenham lines beside alpha to coverage, alpha to one or shading of samples, as in all of Vulkan",
        ),
    ]
}
