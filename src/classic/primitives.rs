//! Points, lines and triangles of the device's own pipeline.

use crate::{
    error::{Error, Result},
    pass::{Pass, Pipeline},
    state::{LineMode, PrimitiveKind, ProvokingVertex, Topology},
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
        Topology::TriangleListWithAdjacency => vk::PrimitiveTopology::TRIANGLE_LIST_WITH_ADJACENCY,
        Topology::TriangleStripWithAdjacency => {
            vk::PrimitiveTopology::TRIANGLE_STRIP_WITH_ADJACENCY
        }
        Topology::LineListWithAdjacency => vk::PrimitiveTopology::LINE_LIST_WITH_ADJACENCY,
        Topology::LineStripWithAdjacency => vk::PrimitiveTopology::LINE_STRIP_WITH_ADJACENCY,
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

/// Which vertex gives flat inputs; `None` if that is the device's default.
pub(super) fn provoking_state(
    pipeline: &Pipeline,
) -> Option<vk::PipelineRasterizationProvokingVertexStateCreateInfoEXT<'static>> {
    let state = vk::PipelineRasterizationProvokingVertexStateCreateInfoEXT::default();
    let state = state.provoking_vertex_mode(vk::ProvokingVertexModeEXT::LAST_VERTEX);
    (pipeline.provoking_vertex == ProvokingVertex::Last).then_some(state)
}

/// Some devices take one mode in all of a pass, and none of them has to take more.
pub(super) fn check_provoking(pass: &Pass) -> Result<()> {
    let used = || pass.draws.iter().map(|draw| &pass.pipelines[draw.pipeline]);
    let Some(first) = used().next() else { return Ok(()) };
    match used().find(|pipeline| pipeline.provoking_vertex != first.provoking_vertex) {
        Some(other) => Err(Error::Device(format!(
            "pass `{}`: the pipelines `{}` and `{}` differ in their provoking vertices; the classic executor takes one mode for \
             all of a pass, the compute executor does not",
            pass.label, first.label, other.label
        ))),
        None => Ok(()),
    }
}

/// What primitives need of a device: whether they do, whether it is there, and what it is.
pub(super) fn of_primitives(
    pipeline: &Pipeline,
    limits: &DrawLimits,
) -> [(bool, bool, &'static str); 7] {
    let lines = draws_lines(pipeline);
    let bresenham = lines && pipeline.line_mode == LineMode::Bresenham;
    let [thinnest, widest] = limits.line_widths;
    let points = pipeline.topology.kind() == PrimitiveKind::Point;
    let adjacency = matches!(
        pipeline.topology,
        Topology::TriangleListWithAdjacency
            | Topology::TriangleStripWithAdjacency
            | Topology::LineListWithAdjacency
            | Topology::LineStripWithAdjacency
    );
    [
        (adjacency, limits.adjacency, "primitives with adjacency (geometryShader)"),
        (
            pipeline.provoking_vertex == ProvokingVertex::Last,
            limits.provoked_last,
            "primitives that their last vertex provokes (provokingVertexLast)",
        ),
        (
            points && !pipeline.vertex.reflection.writes_point_size,
            false,
            "size for points whose vertex shader writes no gl_PointSize, as in Vulkan without maintenance5",
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
