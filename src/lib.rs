//! The GPU's graphics pipeline, rebuilt as Vulkan compute kernels.
#![warn(missing_docs)]

pub mod cli;
pub mod compare;
pub mod error;
pub mod format;
pub mod image;
pub mod pass;
pub mod shader;
pub mod state;
pub mod target;
pub mod texture;

pub use error::{Error, Result};
