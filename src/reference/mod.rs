//! A pass on the CPU: the truth about coverage, depth and primitive ids.
//!
//! Takes the clip-space positions as given and computes everything after them, each stage in the
//! simplest way that could be right: 64-bit integers for edges, IEEE floats rounded after every
//! operation. It knows the stages' contracts and the shared structs, and nothing of the kernels.

pub mod binning;
pub mod primitive;
pub mod raster;

use crate::{abi, grid::Grid};

/// What the reference needs of one batch.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// The band.
    pub grid: &'a Grid,
    /// The batch's pieces.
    pub pieces: &'a [abi::Piece],
    /// Number of the first of them, as triangles name it.
    pub piece_first: u32,
    /// Primitives of the batch.
    pub primitives: u32,
    /// Clip-space position of each vertex slot.
    pub positions: &'a [[f32; 4]],
    /// The value of an index buffer, given by its table slot, at an element.
    pub index: &'a dyn Fn(u32, u32) -> u32,
}

/// The triangles of one primitive after clipping: the parts, in order.
pub type Parts = Vec<Option<abi::Triangle>>;

/// The key of part `part` of primitive `primitive` of the batch.
pub fn key(primitive: usize, part: usize) -> u32 {
    ((primitive as u32 + 1) << abi::KEY_LOG2) | part as u32
}
