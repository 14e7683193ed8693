//! Executes a pass on the CPU. The result defines the right coverage, depth and primitive ids.
//!
//! It takes the clip-space positions as given and computes everything after them, each stage in the
//! simplest way that could be right: 64-bit integers for edges, IEEE floats rounded after every
//! operation. It knows the stages' contracts and the shared structs, and nothing of the kernels.

pub mod binning;
pub mod primitive;
pub mod raster;

use crate::{
    abi::{self, Piece},
    grid::Grid,
    trace::{BatchTrace, Trace},
};

/// One batch, as the reference needs it.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// The band.
    pub grid: &'a Grid,
    /// The batch's pieces.
    pub pieces: &'a [Piece],
    /// Number of the first of them, as triangles name it.
    pub piece_first: u32,
    /// Primitives of the batch.
    pub primitives: u32,
    /// Clip-space position of each vertex slot.
    pub positions: &'a [[f32; 4]],
    /// The value of a piece's index buffer at an element.
    pub index: &'a dyn Fn(&Piece, u32) -> u32,
}

/// The key of part `part` of primitive `primitive` of the batch.
pub fn key(primitive: usize, part: usize) -> u32 {
    ((primitive as u32 + 1) << abi::KEY_LOG2) | part as u32
}

/// The clip-space corners of each primitive of the `number`th batch of `trace`.
pub fn corners(trace: &Trace, number: usize) -> Vec<[[f32; 4]; 3]> {
    let given = &trace.batches[number];
    let index = |piece: &Piece, element| trace.index(given, piece, element).unwrap_or(0);
    let input = input(given, &index);
    (0..input.primitives).map(|primitive| primitive::corners(&input, primitive)).collect()
}

fn input<'a>(given: &'a BatchTrace, index: &'a dyn Fn(&Piece, u32) -> u32) -> Input<'a> {
    Input {
        grid: &given.grid,
        pieces: &given.pieces,
        piece_first: given.piece_first,
        primitives: given.primitives,
        positions: &given.positions,
        index,
    }
}

/// What every stage of the `number`th batch of `trace` should have written, given the positions and
/// the depth it started from. Visibility and depth take every fragment for drawn, as if no shader
/// discarded any or wrote a depth of its own.
pub fn batch(trace: &Trace, number: usize) -> BatchTrace {
    let given = &trace.batches[number];
    let index = |piece: &Piece, element| trace.index(given, piece, element).unwrap_or(0);
    let input = input(given, &index);
    let triangles = primitive::run(&input);
    let cells = binning::run(input.grid, &triangles);
    let mut depth = given.depth_before.clone();
    let visibility = raster::run(&input, &triangles, &mut depth);
    BatchTrace { triangles, cells, visibility, depth, ..given.clone() }
}
