//! Vertex input: where the attributes of a pipeline lie in memory.

use super::{Draw, Pipeline};
use crate::format::VertexFormat;
use std::sync::Arc;

/// How often a vertex binding advances.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum StepRate {
    /// Once per vertex.
    #[default]
    Vertex,
    /// Once per instance.
    Instance,
    /// Once per so many instances, Vulkan's divisor, at most 2^20 - 1. With 0 all instances of a draw read the element of the
    /// first one.
    Instances(u32),
}

impl StepRate {
    /// Instances that read the same element, 0 for all; `None` if it advances per vertex.
    pub const fn divisor(self) -> Option<u32> {
        match self {
            StepRate::Vertex => None,
            StepRate::Instance => Some(1),
            StepRate::Instances(divisor) => Some(divisor),
        }
    }
}

/// One vertex buffer slot of a pipeline.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct VertexBinding {
    /// Bytes from one element to the next; 0 reads the same element for all.
    pub stride: u32,
    /// How often it advances.
    pub rate: StepRate,
}

impl VertexBinding {
    /// A slot that advances by `stride` bytes once per vertex.
    pub const fn per_vertex(stride: u32) -> Self {
        Self { stride, rate: StepRate::Vertex }
    }

    /// A slot that advances by `stride` bytes once per instance.
    pub const fn per_instance(stride: u32) -> Self {
        Self { stride, rate: StepRate::Instance }
    }
}

/// One attribute: the memory that a location of the vertex shader reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct VertexAttribute {
    /// `layout(location = …)` of the vertex shader.
    pub location: u32,
    /// Index into [`super::Pipeline::vertex_bindings`] and [`super::Draw::vertex_buffers`].
    pub binding: u32,
    /// Layout in memory.
    pub format: VertexFormat,
    /// Bytes from the start of the element.
    pub offset: u32,
}

impl VertexAttribute {
    /// What `location` reads from vertex buffer slot `binding`, `offset` bytes from the start of the element.
    pub const fn new(location: u32, binding: u32, format: VertexFormat, offset: u32) -> Self {
        Self { location, binding, format, offset }
    }
}

fn is_divided(binding: &VertexBinding) -> bool {
    matches!(binding.rate, StepRate::Instances(_))
}

/// The pipeline for draws of [`instance_alone`].
pub(crate) fn pipeline_alone(pipeline: &Arc<Pipeline>) -> Arc<Pipeline> {
    if !pipeline.vertex_bindings.iter().any(is_divided) {
        return pipeline.clone();
    }
    let mut alone = Pipeline::clone(pipeline);
    for binding in alone.vertex_bindings.iter_mut().filter(|binding| is_divided(binding)) {
        *binding = VertexBinding { stride: 0, rate: StepRate::Instance };
    }
    Arc::new(alone)
}

/// The draw of the instance number `n` of `draw` alone, as a draw of its own: a binding of `pipeline` that several instances
/// share has one element there, since Vulkan counts instances from the first of a draw.
pub(crate) fn instance_alone(pipeline: &Pipeline, draw: &Draw, n: u32) -> Draw {
    let first_instance = draw.first_instance.wrapping_add(n);
    let mut alone = Draw { instances: 1, first_instance, ..draw.clone() };
    let ranges = pipeline.vertex_bindings.iter().zip(&mut alone.vertex_buffers);
    for (number, (binding, range)) in ranges.enumerate() {
        let StepRate::Instances(divisor) = binding.rate else { continue };
        let attributes = pipeline.vertex_attributes.iter();
        let ends = attributes.filter(|a| a.binding as usize == number);
        let end = ends.map(|a| a.offset as usize + a.format.bytes()).max().unwrap_or(0);
        // No attribute begins beyond the range, whatever a command says.
        let stride = binding.stride as usize;
        let last = range.bytes.saturating_sub(end).checked_div(stride).unwrap_or(0);
        let element = draw.first_instance as usize + n.checked_div(divisor).unwrap_or(0) as usize;
        let skipped = element.min(last) * stride;
        range.offset = range.offset.saturating_add(skipped);
        range.bytes -= skipped;
    }
    alone
}
