//! The GPU's graphics pipeline, rebuilt as Vulkan compute kernels.
#![warn(missing_docs)]

pub mod abi;
pub mod classic;
pub mod cli;
pub mod compare;
pub mod compute;
pub mod error;
pub mod format;
pub mod grid;
pub mod image;
pub mod pass;
pub mod plan;
pub mod reference;
pub mod scene;
pub mod shader;
pub mod state;
pub mod target;
pub mod texture;
pub mod trace;
pub mod vk;

pub use error::{Error, Result};

/// The engine's own kernels and the checks of what they share with the host.
pub(crate) mod kernels {
    use crate::abi;
    include!(concat!(env!("OUT_DIR"), "/kernels.rs"));
    include!(concat!(env!("OUT_DIR"), "/layout.rs"));
}
