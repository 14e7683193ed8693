//! The GPU's graphics pipeline, rebuilt as Vulkan compute kernels.
//!
//! A [`Pass`] is plain data: targets, pipelines made of ordinary Vulkan shader pairs, bindings
//! and draws. Three executors take the same pass:
//!
//! * [`compute`]: the product. Every stage from vertex fetch to blending is a compute kernel; users'
//!   shaders are spliced into kernels. No hardware raster stage, no decision by the CPU inside a frame.
//! * [`classic`]: `vkCmdDraw` on the same device. The opponent, and the proof that the picture is the one
//!   the device would have drawn.
//! * [`mod@reference`]: exact and on the CPU, each stage in the simplest way that could be right. It defines the
//!   right coverage, depth and primitive ids. It runs no shaders: from a trace of [`compute`] it takes the
//!   vertices' clip-space positions and where each batch ends, and everything else from the pass.
//!
//! Everything else ([`compare`], `scene`, `bench`, `cli`) uses these types like any other program. The engine
//! contains no shading of its own: a glTF material is an ordinary pair of shaders too.
//!
//! # The names that a program needs
//!
//! They are at the root of the crate. The modules have the rest: [`state`] what a pipeline can be set to, [`pass`] draw
//! commands in buffers and arrays of resources, [`mod@image`] PNG files, [`vk`] what a caller with a device of its own needs.
//!
//! | names | what they are |
//! |---|---|
//! | [`Gpu`], [`GpuOptions`] | a device, opened here or adopted from the caller ([`Gpu::adopt`]) |
//! | [`Image`], [`ImageInfo`], [`ImageUse`], [`Buffer`], [`Memory`] | what lives on a device |
//! | [`Shader`], [`Stage`], [`Pipeline`], [`VertexBinding`], [`VertexAttribute`] | how draws are drawn |
//! | [`Texture`], [`Sampler`], [`BufferRange`], [`Binding`], [`BindingSet`] | what shaders read and write |
//! | [`Draw`], [`Indices`], [`IndexFormat`], [`Indirect`] | one draw, with counts that the host or the device knows |
//! | [`Pass`], [`ColorTarget`], [`DepthTarget`], [`LoadOp`], [`StoreOp`], [`Samples`] | draws into targets |
//! | [`Renderer`], [`Frame`] | draws one pass and waits ([`Renderer::render`]), also with stages of yours ([`Renderer::with_glsl`]) |
//! | [`Encoder`], [`Submission`], [`Recorded`] | frames of several passes that nobody waits for ([`Renderer::begin`]), also in a command buffer of the caller ([`Renderer::record`]) |
//! | [`Compiled`], [`Compilation`], [`TargetFormats`] | pipelines that are compiled before they are drawn with ([`Renderer::compile`]) |
//! | [`Kernel`] | a compute shader of yours, between passes |
//! | [`Picture`], [`Extent`], [`Shape`], [`Format`], [`VertexFormat`] | pixels in host memory, sizes, layouts |
//! | [`Error`], [`Result`] | what went wrong, in whose words |
//!
//! Structs that will grow are made by a constructor and have a method of the same name for each field that may be set.
//!
//! The library reads no environment variable of its own and keeps no file unless it is told to: see [`GpuOptions::from_env`],
//! [`GpuOptions::cache`] and [`shader::keep_compiled`].
//!
//! # Code map
//!
//! | module | concept |
//! |---|---|
//! | [`pass`], [`state`], [`target`], [`samples`], [`texture`], [`mod@format`], [`image`] | the public vocabulary: plain data, and handles of what lives on a device |
//! | [`shader`] | GLSL to SPIR-V, reflection, splicing a shader into a kernel |
//! | `plan` | a pass cut into batches whose buffers cannot overflow |
//! | `grid` | all size arithmetic: bands, bins, cells, capacities |
//! | `abi` | the structs and constants that host and kernels share; drift is a compile error |
//! | [`compute`] | the stages in order, one file each; their kernels are in `glsl/` under the same names |
//! | [`mod@reference`], `trace` | the CPU's own plan and the stages' twins; every intermediate of a frame, to be compared |
//! | [`classic`] | the same pass through the device's graphics pipeline |
//! | [`vk`] | devices, memory, kernels, and the only thing that dispatches |
//! | [`compare`] | whether two executors drew the same picture |
//! | `scene` | glTF, OBJ and built-in scenes as passes (feature `scene`) |
//! | `bench` | which of two executors draws a pass faster (feature `scene`) |
//! | `cli` | the `tilewright` tool (feature `cli`) |
//!
//! The modules `abi`, `cli`, `grid`, `plan` and `trace` are open to the project's own tests and tool alone. These pages do
//! not show them, and any release may change them.
//!
//! Dependencies point one way: `cli` to `scene`, `bench` and `compare`, these to the vocabulary, the executors to
//! the vocabulary and to `vk`. To follow a triangle, start at [`compute`] and read its stages in order.
//!
//! # Features
//!
//! Without features the crate is the engine: it draws passes. `scene` adds the modules `scene` and `bench`, and what
//! reads glTF, PNG and JPEG. `cli` (on by default) adds the tool and implies `scene`. `glsl` compiles users' GLSL at
//! run time by the system's libshaderc, `glsl-bundled` by a compiler that is built with the crate. With neither, users
//! hand in their shaders as SPIR-V; the crate's own shaders are always SPIR-V.
//!
//! # Invariants, as things that are absent
//!
//! * No `unsafe` and no Vulkan type outside [`vk`] and [`classic`].
//! * No float operation behind coverage or depth except those that Vulkan defines exactly, and routines made of
//!   them. So no device and no CPU can disagree.
//! * No overflow that loses a pixel: a batch is cut where its buffers could overflow in the worst case.
//! * No assumed subgroup width: any from 4 to 128.
//! * No silent fall-back: an [`Error`] names the feature that a device lacks or that a shader may not use.
//! * No buffers in `glsl/lib`: arithmetic there, buffers in the kernels.
//!
//! `tests/tidy.rs` checks the invariants that no compiler checks.
#![warn(missing_docs)]

#[macro_use]
mod setters;
#[macro_use]
mod shared;

#[doc(hidden)]
pub mod abi;
#[cfg(feature = "scene")]
pub mod bench;
mod cache;
pub mod classic;
#[cfg(feature = "cli")]
#[doc(hidden)]
pub mod cli;
pub mod compare;
pub mod compute;
pub mod error;
pub mod format;
#[doc(hidden)]
pub mod grid;
pub mod image;
mod kept;
mod load_spirv;
pub mod pass;
#[doc(hidden)]
pub mod plan;
mod prebuilt;
#[cfg(feature = "scene")]
mod random;
pub mod reference;
pub mod samples;
#[cfg(feature = "scene")]
pub mod scene;
pub mod shader;
pub mod state;
pub mod stencil;
pub mod target;
pub mod texture;
mod topology;
#[doc(hidden)]
pub mod trace;
pub mod vk;

pub use cache::cache_folder;
pub use compute::{Compilation, Compiled, Encoder, Recorded, Renderer};
pub use error::{Error, Result};
pub use format::{Format, VertexFormat};
pub use image::{Extent, Picture, Shape};
pub use pass::{
    Binding, BindingSet, BufferRange, Draw, Frame, IndexFormat, Indices, Indirect, Pass, Pipeline,
    VertexAttribute, VertexBinding,
};
pub use samples::Samples;
pub use shader::{Shader, Stage};
pub use stencil::{StencilFace, StencilOp, StencilState};
pub use target::{
    ClearColor, ColorTarget, DepthTarget, LoadOp, StencilTarget, StoreOp, TargetFormats,
};
pub use texture::{Sampler, Texture};
pub use vk::{Buffer, Gpu, GpuOptions, Image, ImageInfo, ImageUse, Kernel, Memory, Submission};
