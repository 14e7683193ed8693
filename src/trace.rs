//! Every intermediate of a frame, from a device or from the reference, made to be compared.

use crate::{
    abi::{Piece, Triangle},
    grid::Grid,
    pass::Buffer,
};
use std::{collections::HashMap, sync::Arc};

/// The triangles of one primitive: the parts that clipping made of it, `None` for a part that draws
/// nothing. A primitive that draws nothing at all has a single `None`.
pub type Parts = Vec<Option<Triangle>>;

/// Every intermediate of a frame.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// In the order of execution: batch after batch, band after band.
    pub batches: Vec<BatchTrace>,
    /// For each resource table its index and vertex buffers, by the first of their slots.
    pub buffers: Vec<HashMap<u32, Arc<Buffer>>>,
}

/// The intermediates of one batch in one band.
#[derive(Clone, Debug)]
pub struct BatchTrace {
    /// The band.
    pub grid: Grid,
    /// The resource table that it uses.
    pub table: usize,
    /// Its pieces.
    pub pieces: Vec<Piece>,
    /// Number of the first piece.
    pub piece_first: u32,
    /// Primitives.
    pub primitives: u32,
    /// Clip-space position of each vertex slot, as the user's shader left it.
    pub positions: Vec<[f32; 4]>,
    /// The triangles of each primitive.
    pub triangles: Vec<Parts>,
    /// The keys that each cell lists, ascending.
    pub cells: Vec<Vec<u32>>,
    /// The key each pixel of the band got from the batch, row by row; 0 is none.
    pub visibility: Vec<u32>,
    /// Depth of each pixel of the band before the batch.
    pub depth_before: Vec<f32>,
    /// Depth of each pixel of the band after it.
    pub depth: Vec<f32>,
}

impl Trace {
    /// The value of the index buffer of `piece`, which is of `batch`, at `element`.
    pub fn index(&self, batch: &BatchTrace, piece: &Piece, element: u32) -> Option<u32> {
        let bytes = piece.index_bytes as usize;
        let at = element as usize * bytes;
        let value =
            self.buffers.get(batch.table)?.get(&piece.index_slot)?.bytes.get(at..at + bytes)?;
        Some(value.iter().rev().fold(0, |all, &byte| all << 8 | u32::from(byte)))
    }
}

impl BatchTrace {
    /// The first difference between this and `other`, stage by stage, as a sentence; floats are
    /// compared bit by bit.
    pub fn first_difference(&self, other: &BatchTrace) -> Option<String> {
        first("primitive", "triangles of primitive", &self.triangles, &other.triangles, same_parts)
            .or_else(|| first("binning", "list of cell", &self.cells, &other.cells, Vec::eq))
            .or_else(|| {
                let what = "visible key at pixel";
                first("raster", what, &self.visibility, &other.visibility, u32::eq)
            })
            .or_else(|| {
                let same = |a: &f32, b: &f32| a.to_bits() == b.to_bits();
                first("raster", "depth at pixel", &self.depth, &other.depth, same)
            })
    }
}

fn same_parts(a: &Parts, b: &Parts) -> bool {
    let bytes = |part: &Option<Triangle>| part.as_ref().map(|t| bytemuck::bytes_of(t).to_vec());
    a.len() == b.len() && a.iter().zip(b).all(|(a, b)| bytes(a) == bytes(b))
}

fn first<T: std::fmt::Debug>(
    stage: &str,
    what: &str,
    ours: &[T],
    theirs: &[T],
    same: impl Fn(&T, &T) -> bool,
) -> Option<String> {
    if ours.len() != theirs.len() {
        return Some(format!("{stage}: {} against {} of `{what}`", ours.len(), theirs.len()));
    }
    let differing = ours.iter().zip(theirs).filter(|(a, b)| !same(a, b)).count();
    let at = ours.iter().zip(theirs).position(|(a, b)| !same(a, b))?;
    Some(format!(
        "{stage}: {differing} of {} differ, first the {what} {at}: {:?} against {:?}",
        ours.len(),
        ours[at],
        theirs[at]
    ))
}
