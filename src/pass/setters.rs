//! Passes, pipelines and draws step by step: each method sets one field.

use super::{
    Binding, BindingEntry, BindingSet, BufferRange, Draw, Indices, Indirect, Pass, Pipeline,
    VertexAttribute, VertexBinding,
};
use crate::{
    image::Extent,
    samples::Samples,
    shader::Shader,
    state::{
        Blend, ColorState, Cull, DepthBias, DepthState, FrontFace, LineMode, LogicOp,
        ProvokingVertex, Rect, Topology, Viewport,
    },
    stencil::StencilState,
    target::{ColorTarget, DepthTarget, StencilTarget},
    texture::{Sampler, Texture},
    vk,
};
use bytemuck::Pod;
use std::{ops::RangeInclusive, sync::Arc};

impl Pass {
    setters! {
        extent: Extent,
        samples: Samples,
        ;
        into
        colors: Vec<ColorTarget>,
        depth: Option<DepthTarget>,
        stencil: Option<StencilTarget>,
        draws: Vec<Draw>,
    }

    /// The same with these [`pipelines`](#structfield.pipelines).
    #[must_use]
    pub fn pipelines<P: Into<Arc<Pipeline>>>(
        mut self,
        pipelines: impl IntoIterator<Item = P>,
    ) -> Self {
        self.pipelines = pipelines.into_iter().map(Into::into).collect();
        self
    }
}

impl Pipeline {
    setters! {
        topology: Topology,
        provoking_vertex: ProvokingVertex,
        line_width: f32,
        line_mode: LineMode,
        cull: Cull,
        front_face: FrontFace,
        depth: DepthState,
        depth_clamp: bool,
        sample_mask: u32,
        alpha_to_coverage: bool,
        alpha_to_one: bool,
        sample_shading: bool,
        ;
        into
        stencil: Option<StencilState>,
        depth_clip: Option<bool>,
        logic_op: Option<LogicOp>,
        vertex: Arc<Shader>,
        fragment: Arc<Shader>,
        specialization: Vec<(u32, u32)>,
        vertex_bindings: Vec<VertexBinding>,
        vertex_attributes: Vec<VertexAttribute>,
        colors: Vec<ColorState>,
    }

    /// The same with this [`blend`](ColorState::blend) for all colour targets, and with all channels written.
    #[must_use]
    pub fn blend(self, blend: impl Into<Option<Blend>>) -> Self {
        self.colors([ColorState::default().blend(blend)])
    }
}

impl Draw {
    setters! {
        pipeline: usize,
        count: u32,
        first: u32,
        base_vertex: i32,
        instances: u32,
        first_instance: u32,
        depth_bounds: [f32; 2],
        stencil_reference: [u8; 2],
        blend_constants: [f32; 4],
        ;
        into
        push_constants: Vec<u8>,
        vertex_buffers: Vec<BufferRange>,
        indices: Option<Indices>,
        indirect: Option<Indirect>,
        viewport: Option<Viewport>,
        scissor: Option<Rect>,
        depth_bias: Option<DepthBias>,
    }

    /// The same with these [`sets`](#structfield.sets).
    #[must_use]
    pub fn sets<S: Into<Arc<BindingSet>>>(mut self, sets: impl IntoIterator<Item = S>) -> Self {
        self.sets = sets.into_iter().map(Into::into).collect();
        self
    }

    /// The same with the bytes of `block` as its [`push_constants`](#structfield.push_constants).
    #[must_use]
    pub fn push<T: Pod>(self, block: &T) -> Self {
        self.push_constants(bytemuck::bytes_of(block))
    }
}

impl Indices {
    setters! {
        ;
        into
        vertices: Option<RangeInclusive<u32>>,
    }
}

impl Indirect {
    setters! {
        stride: u32,
        draws: u32,
        primitives: u32,
        ;
        into
        count: Option<BufferRange>,
    }
}

impl Binding {
    /// A `sampler2D` or one of its relatives.
    pub fn sampled(texture: impl Into<Arc<Texture>>, sampler: Sampler) -> Self {
        Self::Sampled(texture.into(), sampler)
    }

    /// A `texture2D` or one of its relatives.
    pub fn texture(texture: impl Into<Arc<Texture>>) -> Self {
        Self::Texture(texture.into())
    }

    /// An `image2D` or one of its relatives, in an image made for [`vk::ImageUse::Storage`].
    pub fn storage_image(image: &vk::Image) -> Self {
        Self::StorageImage(Arc::new(Texture::on_device(image)))
    }
}

impl BindingSet {
    /// A set of single resources, each with its `layout(binding = …)`.
    pub fn new(resources: impl IntoIterator<Item = (u32, Binding)>) -> Self {
        let entry = |(binding, resource)| BindingEntry { binding, resources: vec![resource] };
        Self { entries: resources.into_iter().map(entry).collect() }
    }
}
