//! The push constants of the kernels.

use bytemuck::{Pod, Zeroable};

/// The batch as one dispatch sees it: the push constants of every kernel.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Batch {
    /// Pixels across.
    pub width: u32,
    /// Pixels down, of the band.
    pub height: u32,
    /// First row of the band in the target.
    pub origin_y: u32,
    /// Columns of bins.
    pub bins_x: u32,
    /// Bins in all.
    pub bins: u32,
    /// First cell of each level.
    pub cell_first: [u32; 4],
    /// Columns of cells at each level.
    pub cell_columns: [u32; 4],
    /// Cells of all levels.
    pub cells: u32,
    /// Primitives of the batch.
    pub primitives: u32,
    /// First of the batch's pieces.
    pub piece_first: u32,
    /// Pieces of the batch.
    pub piece_count: u32,
    /// First of the vertex dispatch's runs.
    pub run_first: u32,
    /// Runs of the vertex dispatch.
    pub run_count: u32,
    /// First vertex slot of the vertex dispatch.
    pub slot_first: u32,
    /// Vertex slots of the vertex dispatch.
    pub slot_count: u32,
    /// Fragment kernel that a shade dispatch runs, as an index of the batch's.
    pub fragment_kernel: u32,
    /// Fragment kernels of the batch.
    pub fragment_kernels: u32,
    /// Not 0 if the batch is traced. A trace also records facts that a picture does not need: the primitives
    /// that draw nothing, and the keys of ordered work.
    pub traced: u32,
    /// Not 0 if another batch of opaque work follows, which reads the bounds of the bins.
    pub followed: u32,
    /// How far samples are from the centres of their pixels at most, in 1/256 pixel: to the left, and up.
    pub reach: i32,
}

/// The push constants of the clear kernel.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Clear {
    /// Four words of texels, one or several times the same one.
    pub texels: [u32; 4],
    /// How many times four words there are to write.
    pub count: u32,
    /// Where they begin in the rows, in times four words.
    pub first: u32,
}

/// The push constants of the kernel that makes texels of samples, and samples of texels.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Resolve {
    /// Pixels of the band.
    pub pixels: u32,
    /// The word that is the first of the target's samples.
    pub first_sample: u32,
    /// The word that is its first texel.
    pub first_texel: u32,
    /// 1 from texels to samples, 0 from samples.
    pub to_samples: u32,
}

/// The push constants of the kernel that brings texels to rows and back.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Narrow {
    /// Pixels of the band.
    pub pixels: u32,
    /// The word of the rows that is the target's first.
    pub first: u32,
    /// Bytes of a texel, 1, 2 or 4.
    pub texel_bytes: u32,
    /// Bits of a depth, whose rows hold floats; 0 of texels whose bits the rows hold.
    pub depth_bits: u32,
    /// 1 from an image's texels to the rows, 0 from the rows.
    pub to_rows: u32,
}

/// The push constants of the kernel that makes pieces of draw commands.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct Commands {
    /// The piece that has everything but the numbers of the commands.
    pub piece: u32,
    /// Resource-table slot of the commands.
    pub slot: u32,
    /// First byte of the first command.
    pub byte: u32,
    /// Bytes from one command to the next.
    pub stride: u32,
    /// Most commands.
    pub draws: u32,
    /// Resource-table slot of the number of commands, or [`super::NONE`] if it is the most.
    pub count_slot: u32,
    /// Its first byte.
    pub count_byte: u32,
    /// Elements of the index buffer, or [`super::NONE`] if the commands have no indices.
    pub elements: u32,
    /// Primitives of all commands that the batches before have.
    pub first: u32,
    /// Most primitives of the batch.
    pub primitives: u32,
    /// Vertex slots and primitives that one workgroup takes.
    pub of_group: [u32; 2],
}
