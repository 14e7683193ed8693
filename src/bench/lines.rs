//! Scenes drawn as lines: the sides of their triangles.

use crate::{pass::validate::LINE_WIDTH_PX, state::LineMode};

/// How the sides of triangles are drawn.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lines {
    /// Their width in pixels.
    pub width: f32,
    /// What they cover.
    pub mode: LineMode,
}

impl Lines {
    /// The value `text` of [`Axis::Lines`](super::Axis::Lines); `None` draws triangles.
    ///
    /// # Errors
    /// A sentence, if it is none.
    pub fn parse(text: &str) -> Result<Option<Self>, String> {
        if text == "no" {
            return Ok(None);
        }
        let (mode, width) = match text.strip_prefix("bresenham-") {
            Some(width) => (LineMode::Bresenham, width),
            None => (LineMode::Rectangular, text),
        };
        let most = LINE_WIDTH_PX;
        let width = width.parse().ok().filter(|width| (1.0..=most).contains(width));
        match width {
            Some(width) => Ok(Some(Self { width, mode })),
            None => Err(format!(
                "`{text}` is no kind of lines: no, a width from 1 to {most}, or bresenham-1 to \
                 bresenham-{most} is"
            )),
        }
    }
}

/// The sides of the triangles that `indices` make, as a list of lines. Triangles that share a side give one line.
pub fn sides(indices: &[u32]) -> Vec<u32> {
    let side = |a: u32, b: u32| [a.min(b), a.max(b)];
    let of = |t: &[u32]| [side(t[0], t[1]), side(t[1], t[2]), side(t[2], t[0])];
    let mut sides: Vec<[u32; 2]> = indices.chunks_exact(3).flat_map(of).collect();
    sides.sort_unstable();
    sides.dedup();
    sides.into_flattened()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_shared_side_is_one_line() {
        assert_eq!(sides(&[0, 1, 2, 0, 2, 3]), [0, 1, 0, 2, 0, 3, 1, 2, 2, 3]);
        assert_eq!(sides(&[]), [0; 0]);
    }
}
