//! Vulkan, hidden: everything above this module says *what* runs, this module knows *how*.
//!
//! | file | concept |
//! |---|---|
//! | `instance` | the loader, the instance, the validation layer's messages |
//! | `requirements` | required and optional features of a device, as data |
//! | `capability` | SPIR-V capabilities that a device may lack |
//! | `device` | listing devices and picking one |
//! | `features` | the features of Vulkan, as its versions have them |
//! | `open`, `gpu`, `limits` | opening a device; its queue, memory, layouts, caches; its limits |
//! | `owner` | which device a handle belongs to: those of two devices are not mixed |
//! | `access` | turns of host and device: neither touches memory that the other one is using |
//! | `buffer`, `image`, `raw_image`, `sampler` | resources; each is freed when its last user lets go |
//! | `kernel`, `reflect` | a compute pipeline and the names its SPIR-V binds |
//! | `edit`, `address`, `table_bounds` | changes to the SPIR-V of kernels: blocks by address, indices inside the table |
//! | `fold` | specialization constants, applied before the driver gets the SPIR-V |
//! | `table` | descriptor set 1: every resource of users' shaders, indexed by number |
//! | `recorder`, `recording` | the only thing that dispatches, and the only thing that submits |
//! | `warm` | code that drivers generate at the first dispatch |
//! | `resources` | host data uploaded once, recognised by the identity of its `Arc` |
//! | `copies` | copies of the host data that the shaders of a pass write |
//! | `inherited` | whether there is a standard output, and a limit of memory |
//! | `adopt`, `enable` | what the caller made: a device, its resources, its command buffers |
//! | `doctor`, `drivers` | the state of Vulkan on this machine, its faults and the exact fixes |
//!
//! # Synchronisation
//! There is one queue and one rule: a global memory barrier before every dispatch, copy and fill,
//! from all earlier writes to everything that follows. Per-resource barriers were rejected: stages
//! of a frame form a chain anyway, so that finer barriers free nothing to overlap, and every missed
//! one is a bug that only some driver shows. Dispatches that are known to be independent go into one
//! [`Recorder::group`], which has a single barrier at its start.
//!
//! # Lifetimes
//! Every handle owns its Vulkan object through an `Arc` that also holds the device. A recording keeps
//! everything that it refers to until it is dropped, which is after its end. If waiting for its end fails,
//! by time-out or otherwise, the recording is leaked on purpose: freeing memory that a device still reads is
//! undefined behaviour. The device then counts as lost: nothing more runs on it, and the host touches no
//! memory that the device might still use.
//!
//! # Threads
//! Every handle may be sent and shared between threads. Host and device take turns (`access`), so that
//! safe code cannot write memory that a submission reads, or read memory that it writes.
//!
//! This module and `classic` are the only ones that contain `unsafe` or know Vulkan's types.

mod access;
mod address;
mod adopt;
mod arena;
mod buffer;
mod cache;
mod capability;
mod commands;
mod copies;
mod device;
mod doctor;
mod drivers;
mod edit;
mod enable;
pub(crate) mod error;
mod extension;
mod features;
mod fold;
mod format;
mod gpu;
mod image;
mod inherited;
mod instance;
mod kernel;
mod limits;
mod open;
mod owner;
mod placeholder;
mod raw_image;
mod recorder;
mod recording;
mod reflect;
mod requirements;
mod resources;
mod sampler;
mod table;
mod table_bounds;
mod table_sizes;
mod transfer;
mod warm;

/// The crate of the types of Vulkan that [`Gpu::adopt`] and its like take, in the version that they are of.
pub use ash;

pub use adopt::{CallerBuffer, CallerCommands, CallerDevice, CallerImage};
pub(crate) use arena::Arena;
pub use buffer::{Buffer, Memory};
pub(crate) use copies::Copies;
pub use device::{DeviceInfo, DeviceKind, QueueInfo, Require, devices};
pub use doctor::{Doctor, Finding, Severity, doctor};
pub use drivers::DriverFile;
pub use enable::Enable;
pub use features::Feature;
pub use gpu::Gpu;
pub use image::{Image, ImageInfo, ImageUse};
pub use kernel::{Kernel, KernelInfo};
pub(crate) use limits::DrawLimits;
pub use limits::Limits;
pub use open::GpuOptions;
pub use recorder::{Dispatch, Recorder};
pub use recording::{Recording, Submission, Timings};
pub use requirements::{Missing, OPTIONAL, Optional, REQUIREMENTS, Requirement};
pub use resources::{Cached, Resources};
pub use sampler::Sampler;
pub use table::ResourceTable;
pub use table_sizes::TableSizes;

pub(crate) use capability::missing_feature;
pub(crate) use commands::{Commands, Unfinished};
pub(crate) use format::{clear_color, vertex_format, vk_format};
pub(crate) use image::{Aspect, Subresource};
#[cfg(feature = "cli")]
pub(crate) use inherited::stdout_was_closed;
pub(crate) use sampler::compare_op;
pub(crate) use warm::generate_code;
