//! Vertex input: where the attributes of a pipeline lie in memory.

use crate::format::VertexFormat;

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
