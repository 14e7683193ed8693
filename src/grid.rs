//! All size arithmetic of a frame, in one pure place: bands, bins, cells, capacities.
//!
//! Kernels work on one *band* of the target at a time, whole rows of bins, so that no buffer outgrows
//! the smallest storage range devices offer (128 MiB) and no dispatch over bins outgrows the smallest
//! limit of workgroups (65,535). Each band has a target of its own, pixel after pixel in rows. Bins lie
//! one after the other in row order; in visibility the pixels of a bin are contiguous, in the
//! order of [`pixel_number`].

use crate::{abi, image::Extent, samples::Samples};
use std::ops::Range;

/// Log2 of the cell edge at each level.
pub const CELL_LOG2: [u32; abi::CELL_LEVELS as usize] =
    [abi::CELL_LOG2_0, abi::CELL_LOG2_1, abi::CELL_LOG2_2, abi::CELL_LOG2_3];

/// Most bins of a band: 2^15 bins are 2^23 pixels, 64 MiB at 8 bytes a pixel.
pub const MAX_BAND_BINS: u32 = 1 << 15;

/// Most bytes of a buffer that a band has.
const MAX_BYTES: usize = 1 << 27;

/// One band of a target and its division into bins and cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Grid {
    /// Pixels of the band; the height is a multiple of the bin size except in the last band.
    pub extent: Extent,
    /// First row of the band in the target.
    pub origin_y: u32,
    /// Columns of bins.
    pub bins_x: u32,
    /// Rows of bins.
    pub bins_y: u32,
    /// First cell of each level.
    pub cell_first: [u32; 4],
    /// Columns of cells at each level.
    pub cell_columns: [u32; 4],
    /// Cells of all levels.
    pub cells: u32,
}

impl Grid {
    /// The bands of targets from top to bottom, whose colours have so many bytes a sample together.
    pub fn bands(
        target: Extent,
        color_bytes: usize,
        samples: Samples,
    ) -> impl Iterator<Item = Grid> + use<> {
        let bin = 1 << abi::BIN_SIZE_LOG2;
        let most = MAX_BYTES / Self::bin_bytes(color_bytes, samples);
        let most = MAX_BAND_BINS.min(most as u32);
        // A valid pass has room for a row of bins.
        let rows = (most / target.width.div_ceil(bin)).max(1) * bin;
        (0..target.height.div_ceil(rows)).map(move |band| {
            let origin_y = band * rows;
            Grid::new(Extent::new(target.width, rows.min(target.height - origin_y)), origin_y)
        })
    }

    /// The most bytes that one buffer has for a bin: colour, or else depth or the keys of what is visible.
    const fn bin_bytes(color_bytes: usize, samples: Samples) -> usize {
        let of_sample = if color_bytes > 4 { color_bytes } else { 4 };
        abi::BIN_PIXELS as usize * samples.count() as usize * of_sample
    }

    /// Whether targets of so many columns have room for a row of bins in one buffer.
    pub const fn fits(width: u32, color_bytes: usize, samples: Samples) -> bool {
        let bins_x = width.div_ceil(1 << abi::BIN_SIZE_LOG2) as usize;
        bins_x * Self::bin_bytes(color_bytes, samples) <= MAX_BYTES
    }

    fn new(extent: Extent, origin_y: u32) -> Grid {
        let (mut cell_first, mut cell_columns, mut cells) = ([0; 4], [0; 4], 0);
        for (level, log2) in CELL_LOG2.into_iter().enumerate() {
            cell_first[level] = cells;
            cell_columns[level] = extent.width.div_ceil(1 << log2);
            cells += cell_columns[level] * extent.height.div_ceil(1 << log2);
        }
        Grid {
            extent,
            origin_y,
            bins_x: cell_columns[0],
            bins_y: extent.height.div_ceil(1 << abi::BIN_SIZE_LOG2),
            cell_first,
            cell_columns,
            cells,
        }
    }

    /// Pixels that each colour target of the band has room for.
    pub const fn plane_pixels(&self) -> usize {
        self.extent.pixels().next_multiple_of(abi::PLANE_PIXELS as usize)
    }

    /// Bins of the band.
    pub const fn bins(&self) -> u32 {
        self.bins_x * self.bins_y
    }

    /// The band's rows of the target.
    pub const fn rows(&self) -> Range<u32> {
        self.origin_y..self.origin_y + self.extent.height
    }

    /// Pixels of the band's working buffers, those of partial bins included.
    pub const fn padded_pixels(&self) -> usize {
        self.bins() as usize * abi::BIN_PIXELS as usize
    }

    /// The cell of `level` that holds the pixel (`x`, `y`) of the band.
    pub const fn cell(&self, level: usize, x: u32, y: u32) -> u32 {
        let log2 = CELL_LOG2[level];
        self.cell_first[level] + (y >> log2) * self.cell_columns[level] + (x >> log2)
    }
}

/// The number in its bin of the pixel (`x`, `y`) of the band. Visibility is stored in this order, and lanes take
/// pixels in this order.
pub fn pixel_number(x: u32, y: u32) -> u32 {
    let (mut number, mut x, mut y) = (0, x, y);
    for bit in 0..abi::BIN_PIXELS.ilog2() {
        let along = if abi::PIXEL_COLUMN_BITS >> bit & 1 != 0 { &mut x } else { &mut y };
        number |= (*along & 1) << bit;
        *along >>= 1;
    }
    number
}

/// The sizes of a batch's buffers. Every capacity is the worst case of [`Capacities::primitives`] primitives,
/// so that no batch can overflow any buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Capacities {
    /// Primitives of a batch.
    pub primitives: u32,
    /// Vertex slots of a batch.
    pub vertices: u32,
    /// Words of varyings of a batch.
    pub varying_words: u32,
}

impl Capacities {
    /// 262,144 primitives: triangles of 112 MiB and lists of 112 MiB if all of them were clipped into
    /// seven, which fits a storage buffer on common devices; untouched memory costs nothing
    /// where the host's is the device's; positions of 16 MiB in clip space and of 16 MiB in the window;
    /// varyings of 16 MiB, which later stages then find near the processor: a mesh without shared
    /// vertices took 5 % longer with 128.
    pub const DEFAULT: Self =
        Self { primitives: 1 << 18, vertices: 1 << 20, varying_words: 1 << 22 };

    /// The least that a batch may hold: one primitive.
    pub const LEAST: Self = Self { primitives: 1, vertices: 4, varying_words: 0 };

    /// The most that a batch may hold: every number in it, keys of primitives and entries of lists in the
    /// worst case, has room in 32 bits.
    pub const MOST: Self = Self { primitives: 1 << 25, vertices: 1 << 28, varying_words: 1 << 28 };

    /// The nearest to this from [`Capacities::LEAST`] to [`Capacities::MOST`].
    pub fn clamped(self) -> Self {
        let (least, most) = (Self::LEAST, Self::MOST);
        Self {
            primitives: self.primitives.clamp(least.primitives, most.primitives),
            vertices: self.vertices.clamp(least.vertices, most.vertices),
            varying_words: self.varying_words.clamp(least.varying_words, most.varying_words),
        }
    }

    /// Words of varyings of a batch whose vertices the following batches share. It is larger than for other
    /// batches: shading vertices only once gains more than keeping them in the caches. With
    /// [`Capacities::VARYING_OVERHANG`], one binding still holds them.
    pub const fn shared_varying_words(&self) -> u64 {
        8 * self.varying_words as u64 - Self::VARYING_OVERHANG as u64
    }

    /// Words that kernels read beyond the last vertex's varyings: they read two locations at a time, and a
    /// vertex may have an odd number of them.
    pub const VARYING_OVERHANG: u32 = 4;

    /// Triangles: each primitive can be clipped into [`abi::MAX_CLIPPED`].
    pub const fn triangles(&self) -> u32 {
        self.primitives * abi::MAX_CLIPPED
    }

    /// The most primitives of a batch, with distances from planes of the user or without. Clipping by distances leaves more
    /// triangles of each.
    pub const fn primitives_of(&self, distances: bool) -> u32 {
        match distances {
            true => {
                let triangles = self.primitives as u64 * abi::MAX_CLIPPED as u64;
                let primitives = triangles / abi::MAX_CLIPPED_BY_DISTANCES as u64;
                if primitives == 0 { 1 } else { primitives as u32 }
            }
            false => self.primitives,
        }
    }

    /// The primitives without distances that take as much room as `primitives`, with distances or without.
    pub const fn room_of(primitives: u32, distances: bool) -> u32 {
        match distances {
            true => {
                let triangles = primitives as u64 * abi::MAX_CLIPPED_BY_DISTANCES as u64;
                triangles.div_ceil(abi::MAX_CLIPPED as u64) as u32
            }
            false => primitives,
        }
    }

    /// Entries of all cells' lists: each triangle is in at most [`abi::MAX_CELLS`].
    pub const fn entries(&self) -> u32 {
        self.triangles() * abi::MAX_CELLS
    }
}

/// Workgroups of `group` invocations for `count` items, spread over two dimensions where one is
/// too few.
pub const fn groups(count: u32, group: u32) -> [u32; 3] {
    let n = count.div_ceil(group);
    const MAX: u32 = 65_535;
    if n <= MAX { [n, 1, 1] } else { [MAX, n.div_ceil(MAX), 1] }
}
