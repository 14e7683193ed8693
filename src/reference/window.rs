//! The viewport and the scissor of a draw: where its clip space lies in the target.
//!
//! Reads: draws, the extent of the target.
//! Contract: Vulkan's, chapter "Controlling the Viewport" and section "Scissor Test". A pixel belongs to a draw if
//! its centre lies in the viewport and the scissor contains it. A pixel of several samples belongs to it if it has a part in
//! the viewport: clipping finds which samples have.

use crate::{
    pass::{Draw, Pass},
    samples::Samples,
    state::{Rect, Viewport},
};

/// The part of the target that a draw can reach, and the way from clip space to it.
#[derive(Clone, Copy, Debug)]
pub struct Window {
    /// Factors of x, y and z.
    pub scale: [f32; 3],
    /// Offsets of x, y and z.
    pub offset: [f32; 3],
    /// First and last column.
    pub columns: [i32; 2],
    /// First and last row.
    pub rows: [i32; 2],
    /// Whether some pixel of the target does not belong to the draw.
    pub cut: bool,
}

impl Window {
    /// The window of `draw`; `None` if no pixel belongs to it.
    pub fn of(pass: &Pass, draw: &Draw) -> Option<Self> {
        let extent = pass.extent;
        let Viewport { x, y, width, height, min_depth, max_depth } = draw.viewport_in(extent);
        let scissor: Rect = draw.scissor_in(extent);
        let several = pass.samples != Samples::One;
        let columns = pixels(several, extent.width, [x, x + width], (scissor.x, scissor.width))?;
        let rows = pixels(several, extent.height, [y, y + height], (scissor.y, scissor.height))?;
        let whole = |length: u32| [0, length as i32 - 1];
        Some(Self {
            scale: [width / 2.0, height / 2.0, max_depth - min_depth],
            offset: [x + width / 2.0, y + height / 2.0, min_depth],
            columns,
            rows,
            cut: columns != whole(extent.width) || rows != whole(extent.height),
        })
    }
}

/// The first and the last of the target's `count` columns (or rows) that belong to a draw whose viewport has these
/// two `edges` and whose scissor has `length` of them from `first` on.
fn pixels(
    several: bool,
    count: u32,
    edges: [f32; 2],
    (first, length): (u32, u32),
) -> Option<[i32; 2]> {
    // A viewport of negative height has its top below its bottom.
    let (low, high) = (edges[0].min(edges[1]), edges[0].max(edges[1]));
    let belongs = |&pixel: &u32| {
        let start = pixel as f32;
        let inside = match several {
            true => low < start + 1.0 && start < high,
            false => low <= start + 0.5 && start + 0.5 < high,
        };
        inside && pixel >= first && pixel - first < length
    };
    let mut all = (0..count).filter(belongs);
    let first = all.next()?;
    Some([first as i32, all.next_back().unwrap_or(first) as i32])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pixel_belongs_if_its_centre_does() {
        let whole = |edges| pixels(false, 10, edges, (0, 10));
        assert_eq!(whole([0.0, 10.0]), Some([0, 9]));
        assert_eq!(whole([10.0, 0.0]), Some([0, 9]));
        assert_eq!(whole([2.5, 4.5]), Some([2, 3]));
        assert_eq!(whole([2.6, 4.6]), Some([3, 4]));
        assert_eq!(whole([2.6, 3.4]), None);
        assert_eq!(whole([-9.0, 99.0]), Some([0, 9]));
        let cut = |edges, scissor| pixels(false, 10, edges, scissor);
        assert_eq!(cut([0.0, 10.0], (4, 1)), Some([4, 4]));
        assert_eq!(cut([0.0, 10.0], (4, 99)), Some([4, 9]));
        assert_eq!(cut([0.0, 10.0], (4, 0)), None);
        assert_eq!(cut([0.0, 3.0], (4, 9)), None);
    }

    #[test]
    fn a_pixel_of_several_samples_belongs_if_a_part_of_it_does() {
        let whole = |edges| pixels(true, 10, edges, (0, 10));
        assert_eq!(whole([0.0, 10.0]), Some([0, 9]));
        assert_eq!(whole([2.9, 4.1]), Some([2, 4]));
        assert_eq!(whole([3.0, 4.0]), Some([3, 3]));
        assert_eq!(whole([2.6, 3.4]), Some([2, 3]));
    }
}
