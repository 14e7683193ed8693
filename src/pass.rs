//! A recorded pass: targets, pipelines, bindings and draws, as plain data. Its buffers are bytes of the host, or
//! handles of buffers that live on a device.
//!
//! Three executors take the same [`Pass`]: `compute` (the product), `classic` (the device's own
//! graphics pipeline) and `reference` (the CPU). None of them changes it, and each derives from it by itself what has
//! to be drawn. The reference runs no shaders: it takes the positions of vertices from a trace. Resources are shared
//! by [`Arc`]; an executor of a device uploads each of them once and recognises it by the identity of its `Arc`.

use crate::{
    format::Format,
    image::Extent,
    samples::Samples,
    shader::Shader,
    state::{
        ColorState, Cull, DepthBias, DepthState, FrontFace, LineMode, LogicOp, PrimitiveKind,
        ProvokingVertex, Rect, Topology, Viewport,
    },
    stencil::StencilState,
    target::{ColorTarget, DepthTarget, StencilTarget},
    texture::{Sampler, Texture},
    vk,
};
use bytemuck::{Pod, Zeroable};
use std::{ops::RangeInclusive, sync::Arc};

mod buffer;
mod frame;
mod indices;
mod indirect;
mod setters;
mod snapshot;
pub(crate) mod validate;
mod vertex;
mod written;

pub use buffer::{BufferRange, BufferSource};
pub use frame::{Executor, Frame};
pub use indices::IndexRanges;
pub(crate) use validate::{Known, check_color_targets, check_outputs, check_samples};
pub use vertex::{StepRate, VertexAttribute, VertexBinding};
pub(crate) use vertex::{instance_alone, pipeline_alone};

/// A shader pair and its fixed-function state.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Pipeline {
    /// For messages and debug labels.
    pub label: String,
    /// The vertex shader.
    pub vertex: Arc<Shader>,
    /// The fragment shader.
    pub fragment: Arc<Shader>,
    /// Specialization constants of both stages, (`constant_id`, value bits).
    pub specialization: Vec<(u32, u32)>,
    /// Vertex buffer slots.
    pub vertex_bindings: Vec<VertexBinding>,
    /// Vertex attributes.
    pub vertex_attributes: Vec<VertexAttribute>,
    /// Primitive assembly.
    pub topology: Topology,
    /// Which vertex of a primitive gives the inputs that are `flat`.
    pub provoking_vertex: ProvokingVertex,
    /// The width of lines in pixels, up to 1024.
    pub line_width: f32,
    /// What lines cover.
    pub line_mode: LineMode,
    /// Faces of triangles that are not drawn.
    pub cull: Cull,
    /// Which winding is the front.
    pub front_face: FrontFace,
    /// The depth test.
    pub depth: DepthState,
    /// The stencil test; `None` is none. Without a stencil target there is none in any case.
    pub stencil: Option<StencilState>,
    /// Whether depths of fragments, also those that shaders write, are brought into the depth range of the viewport before they
    /// are tested. `gl_FragCoord.z` stays as it is.
    pub depth_clamp: bool,
    /// Whether primitives are clipped at the near and the far plane. `None` stands for the opposite of
    /// [`Pipeline::depth_clamp`], as in Vulkan without `VK_EXT_depth_clip_enable`. Depths of primitives that are not clipped and
    /// not clamped end at 0 and 1.
    pub depth_clip: Option<bool>,
    /// How fragments change the colour targets, one for each; the last one counts for all targets beyond the list. An empty
    /// list stands for [`ColorState::OVERWRITE`].
    pub colors: Vec<ColorState>,
    /// What becomes of the bits of colour targets; `None` leaves that to [`Pipeline::colors`]. With an operation, no target is
    /// blended. Targets of floats and sRGB-encoded ones are overwritten, as Vulkan says.
    pub logic_op: Option<LogicOp>,
    /// A bit for each sample of a pixel that may be drawn to; all, unless set.
    pub sample_mask: u32,
    /// Whether the alpha that the shader writes to location 0 says how many of the covered samples are drawn to: none where it
    /// is 0, all where it is 1. A single sample is drawn to from 0.5 on.
    pub alpha_to_coverage: bool,
    /// Whether alpha is 1 when colours are blended and written, whatever the shader returns.
    pub alpha_to_one: bool,
    /// Whether the fragment shader runs for each sample that is covered (Vulkan's `sampleShadingEnable`, with all samples). It
    /// does so in any case if it reads `gl_SampleID` or `gl_SamplePosition`, or has an input that is a `sample`.
    pub sample_shading: bool,
}

impl Pipeline {
    /// A shader pair with the usual state: triangle lists without vertex buffers, both faces, nearer
    /// fragments win where there is a depth target, no blending.
    pub fn new(
        label: &str,
        vertex: impl Into<Arc<Shader>>,
        fragment: impl Into<Arc<Shader>>,
    ) -> Self {
        Self {
            label: label.into(),
            vertex: vertex.into(),
            fragment: fragment.into(),
            specialization: Vec::new(),
            vertex_bindings: Vec::new(),
            vertex_attributes: Vec::new(),
            topology: Topology::default(),
            provoking_vertex: ProvokingVertex::default(),
            line_width: 1.0,
            line_mode: LineMode::default(),
            cull: Cull::default(),
            front_face: FrontFace::default(),
            depth: DepthState::default(),
            stencil: None,
            depth_clamp: false,
            depth_clip: None,
            colors: Vec::new(),
            logic_op: None,
            sample_mask: u32::MAX,
            alpha_to_coverage: false,
            alpha_to_one: false,
            sample_shading: false,
        }
    }

    /// Whether one of so many colour targets is blended with a second source.
    pub(crate) fn has_second_source(&self, targets: usize) -> bool {
        let mut blends = (0..targets).filter_map(|target| self.color_state(target).blend);
        self.logic_op.is_none() && blends.any(|blend| blend.has_second())
    }

    /// Whether primitives are clipped at the near and the far plane.
    pub(crate) fn clips_depth(&self) -> bool {
        self.depth_clip.unwrap_or(!self.depth_clamp)
    }

    /// Whether depths of all fragments get limits of their own, or may lie beyond the near and the far plane.
    pub(crate) fn adjusts_depths(&self) -> bool {
        self.depth_clamp || !self.clips_depth()
    }

    /// Whether depths of the fragments of `draw` get a bias or limits of their own.
    pub(crate) fn adjusts_depth(&self, draw: &Draw) -> bool {
        self.biases(draw) || self.adjusts_depths()
    }

    /// Whether depths of `draw` get a bias, which those of points and lines do not.
    fn biases(&self, draw: &Draw) -> bool {
        draw.depth_bias.is_some() && self.topology.kind() == PrimitiveKind::Triangle
    }

    /// Whether the fragment shader runs for each sample.
    pub(crate) fn runs_per_sample(&self) -> bool {
        self.sample_shading || self.fragment.reflection.per_sample
    }

    /// How fragments change the colour target with this number.
    pub fn color_state(&self, target: usize) -> ColorState {
        self.colors.get(target).or(self.colors.last()).copied().unwrap_or_default()
    }
}

/// One resource that a shader binds.
///
/// A range may be shorter than the shader's block, but not empty. A shader never reaches other memory beyond
/// its end. Beyond the end of a uniform block it reads zeros. Beyond the end of a storage block it reads what
/// Vulkan's `robustBufferAccess` allows, which is zeros on most devices, and its writes vanish. The length of
/// a run-time array is the number of elements that the range has room for.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub enum Binding {
    /// A uniform block. A range of a buffer on a device is as long as the block.
    Uniform(BufferRange),
    /// A storage block.
    ///
    /// In a buffer of a device, what shaders write stays there. In a buffer of the host, it is not visible outside
    /// the pass: each execution begins with the bytes of the buffer. Other storage blocks of the pass in the same
    /// buffer see the writes; uniform blocks, vertices and indices do not.
    ///
    /// Targets of more than 8 million pixels are drawn by `compute` in bands of rows. Each band begins with the bytes
    /// of a buffer of the host again, and runs vertex shaders again, which Vulkan allows. Fragment shaders run once
    /// for each fragment in any case.
    Storage(BufferRange),
    /// `sampler2D` and its relatives: other dimensions, cubes, arrays, and with a comparison ([`Sampler::compare`]).
    Sampled(Arc<Texture>, Sampler),
    /// `texture2D` and its relatives.
    Texture(Arc<Texture>),
    /// `sampler` and `samplerShadow`.
    Sampler(Sampler),
    /// `image2D` and its relatives, which shaders read and write: a texture of a device ([`Texture::on_device`]), whose image
    /// is made for [`crate::vk::ImageUse::Storage`]. What shaders write stays there. Mip level 0, all layers.
    ///
    /// As with [`Binding::Storage`], each band of a large target runs vertex shaders again.
    StorageImage(Arc<Texture>),
}

/// The resource of one `(set, binding)`; an array of resources where the shader declares an array.
///
/// If a shader computes an index beyond the array, `compute` takes the last element. `classic` leaves it to the
/// device's driver, and Vulkan does not say what happens then.
#[derive(Clone, Debug)]
pub struct BindingEntry {
    /// `layout(binding = …)`.
    pub binding: u32,
    /// One element, or as many as the shader's array has.
    pub resources: Vec<Binding>,
}

/// The resources of one descriptor set, shared by many draws.
#[derive(Clone, Debug, Default)]
pub struct BindingSet {
    /// In any order; extra entries are ignored.
    pub entries: Vec<BindingEntry>,
}

/// Width of an index.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum IndexFormat {
    /// 16 bits.
    U16,
    /// 32 bits.
    U32,
}

impl IndexFormat {
    /// Bytes of one index.
    pub const fn bytes(self) -> usize {
        match self {
            IndexFormat::U16 => 2,
            IndexFormat::U32 => 4,
        }
    }
}

/// The index buffer of a draw.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Indices {
    /// The indices; the offset is a multiple of the index width.
    pub range: BufferRange,
    /// Their width.
    pub format: IndexFormat,
    /// The smallest and the largest index among those that a draw reads, if the caller knows them. If it is wrong, wrong
    /// vertices are drawn and nothing else happens.
    ///
    /// With `None`, `compute` reads the indices of a buffer of the host. It cannot read those of a buffer of a device: then
    /// the vertex shader runs three times for each triangle. It does so for [`Draw::indirect`] in any case.
    pub vertices: Option<RangeInclusive<u32>>,
}

impl Indices {
    /// The indices in `range`.
    pub fn new(range: BufferRange, format: IndexFormat) -> Self {
        Self { range, format, vertices: None }
    }
}

/// Draw commands that lie in a buffer, and that only the device needs to know: `vkCmdDrawIndirectCount`.
///
/// The commands are [`IndirectCommand`]s, or [`IndexedIndirectCommand`]s if the draw has indices. Kernels and shaders may
/// have written them, also earlier in the same frame.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Indirect {
    /// The commands, the first of them at the beginning of the range; the offset is a multiple of 4.
    pub commands: BufferRange,
    /// Bytes from one command to the next, a multiple of 4.
    pub stride: u32,
    /// Commands that are drawn, or the most of them if [`Indirect::count`] says how many: up to 2^20.
    pub draws: u32,
    /// A 32-bit number of commands, at a multiple of 4 bytes. A kernel that counts needs it at 0 in each frame
    /// ([`crate::compute::Encoder::fill`]).
    pub count: Option<BufferRange>,
    /// The most primitives that all instances of all commands have together, up to 2^24. `compute` leaves out what is
    /// beyond, without an error, and spends time and memory on as many batches as these take.
    pub primitives: u32,
}

impl Indirect {
    /// All commands of `commands`. `primitives` is the most primitives that all instances of all commands have together:
    /// `compute` leaves out what is beyond, see [`Indirect::primitives`].
    pub fn new(commands: &vk::Buffer<IndirectCommand>, primitives: u32) -> Self {
        Self::of(commands, primitives)
    }

    /// As [`Indirect::new`], for a draw with indices.
    pub fn indexed(commands: &vk::Buffer<IndexedIndirectCommand>, primitives: u32) -> Self {
        Self::of(commands, primitives)
    }

    /// One command at the beginning of `commands`. [`Indirect::draws()`] makes it more, `stride` bytes from one to the next.
    pub fn in_range(commands: BufferRange, stride: u32, primitives: u32) -> Self {
        Self { commands, stride, draws: 1, count: None, primitives }
    }

    fn of<T: Pod>(commands: &vk::Buffer<T>, primitives: u32) -> Self {
        let draws = u32::try_from(commands.len()).unwrap_or(u32::MAX);
        Self {
            draws,
            ..Self::in_range(BufferRange::on_device(commands), size_of::<T>() as u32, primitives)
        }
    }
}

/// `VkDrawIndirectCommand`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct IndirectCommand {
    /// Vertices.
    pub count: u32,
    /// Instances.
    pub instances: u32,
    /// First vertex.
    pub first: u32,
    /// First instance.
    pub first_instance: u32,
}

/// `VkDrawIndexedIndirectCommand`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
pub struct IndexedIndirectCommand {
    /// Indices.
    pub count: u32,
    /// Instances.
    pub instances: u32,
    /// First index. `compute` draws nothing if not all indices are in the range that the draw binds.
    pub first: u32,
    /// Added to each index.
    pub base_vertex: i32,
    /// First instance.
    pub first_instance: u32,
}

/// One draw: `vkCmdDraw` or `vkCmdDrawIndexed` with all it needs bound.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Draw {
    /// Index into [`Pass::pipelines`].
    pub pipeline: usize,
    /// One per `layout(set = …)`, by index.
    pub sets: Vec<Arc<BindingSet>>,
    /// The push-constant block, from offset 0; bytes beyond the block are ignored.
    pub push_constants: Vec<u8>,
    /// One per [`Pipeline::vertex_bindings`].
    pub vertex_buffers: Vec<BufferRange>,
    /// `Some` draws indexed.
    pub indices: Option<Indices>,
    /// Vertices, or indices if indexed.
    pub count: u32,
    /// First vertex, or first index if indexed.
    pub first: u32,
    /// Added to each index; ignored if not indexed.
    pub base_vertex: i32,
    /// Instances.
    pub instances: u32,
    /// First instance.
    pub first_instance: u32,
    /// `Some` draws commands of a buffer. The counts and firsts of this draw, and its base vertex, are ignored then.
    pub indirect: Option<Indirect>,
    /// `None` is the whole target with depth 0..=1 ([`Draw::viewport_in`]).
    pub viewport: Option<Viewport>,
    /// `None` is the whole target ([`Draw::scissor_in`]).
    pub scissor: Option<Rect>,
    /// What is added to depths of triangles; `None` is nothing.
    pub depth_bias: Option<DepthBias>,
    /// Least and greatest depth for pipelines with [`crate::state::DepthState::bounds`]; 0 and 1 unless set.
    pub depth_bounds: [f32; 2],
    /// The reference values of the stencil test, of front faces and of back faces; zeros unless set.
    pub stencil_reference: [u8; 2],
    /// Constant colour and constant alpha of blending, RGBA, for pipelines whose factors ask for them
    /// ([`crate::state::BlendFactor::ConstantColor`]); zeros unless set.
    pub blend_constants: [f32; 4],
}

impl Draw {
    /// A draw of `count` vertices (or indices, once [`Draw::indices`] is set) with nothing bound.
    pub fn new(pipeline: usize, count: u32) -> Self {
        Self {
            pipeline,
            sets: Vec::new(),
            push_constants: Vec::new(),
            vertex_buffers: Vec::new(),
            indices: None,
            count,
            first: 0,
            base_vertex: 0,
            instances: 1,
            first_instance: 0,
            indirect: None,
            viewport: None,
            scissor: None,
            depth_bias: None,
            depth_bounds: [0.0, 1.0],
            stencil_reference: [0; 2],
            blend_constants: [0.0; 4],
        }
    }

    /// The viewport of this draw in a target of `extent`.
    pub fn viewport_in(&self, extent: Extent) -> Viewport {
        self.viewport.unwrap_or(Viewport {
            x: 0.0,
            y: 0.0,
            width: extent.width as f32,
            height: extent.height as f32,
            min_depth: 0.0,
            max_depth: 1.0,
        })
    }

    /// The scissor of this draw in a target of `extent`; it may reach over the target's border.
    pub fn scissor_in(&self, extent: Extent) -> Rect {
        let whole = Rect { x: 0, y: 0, width: extent.width, height: extent.height };
        self.scissor.unwrap_or(whole)
    }
}

/// Everything an executor needs to make a picture.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Pass {
    /// For messages and debug labels.
    pub label: String,
    /// Size of all targets, 1 to 16384 in each direction.
    pub extent: Extent,
    /// The colour targets, by `layout(location = …)` of the fragment shaders: up to 8, or none where only depth matters.
    pub colors: Vec<ColorTarget>,
    /// The depth target, if there is one.
    pub depth: Option<DepthTarget>,
    /// The stencil target, if there is one.
    pub stencil: Option<StencilTarget>,
    /// Samples of a pixel of all targets, which exist during the pass only: images and pictures have a texel for each pixel.
    /// What a target begins with, all samples of a pixel get. At the end, a texel of colours becomes the average of the
    /// samples (of linear light, if the format is sRGB-encoded), one of integers becomes sample 0, and one of depth or stencil what
    /// [`DepthTarget::resolve`] or [`StencilTarget::resolve`] says. This is the model of `VK_EXT_multisampled_render_to_single_sampled`.
    pub samples: Samples,
    /// The pipelines that draws refer to.
    pub pipelines: Vec<Arc<Pipeline>>,
    /// In API order.
    pub draws: Vec<Draw>,
}

impl Pass {
    /// A pass that draws nothing yet: an sRGB colour target cleared to transparent black, no depth, no stencil.
    pub fn new(label: &str, extent: Extent) -> Self {
        Self {
            label: label.into(),
            extent,
            colors: vec![ColorTarget::cleared(Format::Rgba8Srgb, [0.0; 4])],
            depth: None,
            stencil: None,
            samples: Samples::One,
            pipelines: Vec::new(),
            draws: Vec::new(),
        }
    }

    /// Bytes of a sample of all colour targets where kernels write them.
    pub(crate) fn row_bytes(&self) -> usize {
        self.colors.iter().map(|color| color.format.row_bytes()).sum()
    }
}
