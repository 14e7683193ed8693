//! Where two drawings differ, as a picture to look at.

use super::{
    Drawn, NO_PRIMITIVE,
    difference::{channel_deltas, color, ids},
};
use crate::{error::Result, format::Format, image::Picture};

/// The most telling difference of a pixel decides its colour, in this order.
const COVERAGE: [u8; 4] = [255, 40, 40, 255];
const WINNER: [u8; 4] = [255, 200, 0, 255];
const COLOUR: [u8; 4] = [255, 0, 255, 255];

/// The first drawing in dark grey; on it, pixels that differ in coverage red, in the winning
/// primitive yellow, in colour by more than 1 of 255 magenta. Each mark is a plus of five pixels,
/// so that one pixel is found in a picture of two million.
///
/// # Errors
/// As [`compare`](super::compare), which comes first.
pub fn difference_picture(a: Drawn<'_>, b: Drawn<'_>) -> Result<Picture> {
    let (color_a, color_b) = (color(a.frame)?, color(b.frame)?);
    let extent = color_a.extent;
    let (width, height) = (extent.width as usize, extent.height as usize);
    let mut picture = Picture::zeroed(extent, Format::Rgba8Srgb);
    let shown = color_a.display_rgba8()?;
    for (out, pixel) in picture.bytes.chunks_exact_mut(4).zip(shown.chunks_exact(4)) {
        let sum: u16 = pixel[..3].iter().map(|&channel| u16::from(channel)).sum();
        let grey = (sum / 9) as u8;
        out.copy_from_slice(&[grey, grey, grey, 255]);
    }

    let (ids_a, ids_b) = (ids(color(a.ids)?)?, ids(color(b.ids)?)?);
    let deltas = channel_deltas(color_a, color_b)?;
    let mark = |i: usize| {
        let (id_a, id_b) = (ids_a[i], ids_b[i]);
        if (id_a == NO_PRIMITIVE) != (id_b == NO_PRIMITIVE) {
            Some(COVERAGE)
        } else if id_a != id_b {
            Some(WINNER)
        } else if deltas[i] > 1 {
            Some(COLOUR)
        } else {
            None
        }
    };
    // Marks of lesser weight first, so that a greater one is never painted over.
    for weight in [COLOUR, WINNER, COVERAGE] {
        for y in 0..height {
            for x in 0..width {
                if mark(y * width + x) != Some(weight) {
                    continue;
                }
                let mut paint = |x: usize, y: usize| {
                    if x < width && y < height {
                        let at = (y * width + x) * 4;
                        picture.bytes[at..at + 4].copy_from_slice(&weight);
                    }
                };
                paint(x, y);
                paint(x + 1, y);
                paint(x.wrapping_sub(1), y);
                paint(x, y + 1);
                paint(x, y.wrapping_sub(1));
            }
        }
    }
    Ok(picture)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{image::Extent, pass::Frame};

    fn drawn(ids: [u32; 25], colour: u8) -> (Frame, Frame) {
        let extent = Extent::new(5, 5);
        let image = |bytes| Picture { extent, format: Format::Rgba8Unorm, bytes };
        let color = image(vec![colour; 100]);
        let ids = image(ids.iter().flat_map(|id| id.to_le_bytes()).collect());
        [color, ids].map(|image| Frame { colors: vec![image], depth: None, stencil: None }).into()
    }

    fn picture(a: &(Frame, Frame), b: &(Frame, Frame)) -> Picture {
        let drawn = |(frame, ids)| Drawn { frame, ids };
        difference_picture(drawn((&a.0, &a.1)), drawn((&b.0, &b.1))).unwrap()
    }

    #[test]
    fn equal_drawings_make_a_grey_picture() {
        let a = drawn([1; 25], 90);
        assert_eq!(picture(&a, &a).bytes, [30, 30, 30, 255].repeat(25));
    }

    #[test]
    fn a_mark_is_a_plus_and_coverage_outweighs_the_winner() {
        let a = drawn([1; 25], 90);
        let mut ids = [1; 25];
        ids[0] = 0; // coverage, in the corner
        ids[1] = 2; // winner, beside it
        let picture = picture(&a, &drawn(ids, 90));
        assert_eq!(picture.texel(0, 0), COVERAGE);
        assert_eq!(picture.texel(1, 0), COVERAGE);
        assert_eq!(picture.texel(0, 1), COVERAGE);
        assert_eq!(picture.texel(2, 0), WINNER);
        assert_eq!(picture.texel(1, 1), WINNER);
        assert_eq!(picture.texel(2, 2), [30, 30, 30, 255]);
    }

    #[test]
    fn colour_is_marked_where_nothing_else_differs() {
        let picture = picture(&drawn([1; 25], 90), &drawn([1; 25], 92));
        assert_eq!(picture.bytes, COLOUR.repeat(25));
    }
}
