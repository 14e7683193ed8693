//! The figures by which two drawings of one pass differ.

use crate::{
    error::{Error, Result},
    format::Format,
    image::Picture,
    pass::Frame,
};

/// The id of a pixel that no primitive covers: the clear value of the id pass.
pub const NO_PRIMITIVE: u32 = 0;

/// The pictures that one executor drew of a pass and of its id pass.
#[derive(Clone, Copy, Debug)]
pub struct Drawn<'a> {
    /// The pass as it is.
    pub frame: &'a Frame,
    /// Its id pass.
    pub ids: &'a Frame,
}

/// The figures; the names are the keys of the command-line tool's JSON.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Difference {
    /// Pixels compared.
    pub pixels: u64,
    /// Pixels that one side covers and the other does not.
    pub coverage_differing: u64,
    /// Pixels that both sides cover, but with different primitives.
    pub winner_differing: u64,
    /// Pixels of which some channel of a colour target differs by more than 1 of 255, or the stored stencil value.
    pub colour_over_1: u64,
    /// The largest difference of a channel, of 255.
    pub colour_max: u8,
    /// The largest difference of depth where the same primitive won; 0 without a depth target.
    pub depth_max: f32,
}

/// The primitive ids of an id pass's colour target, [`NO_PRIMITIVE`] where nothing is covered.
///
/// # Errors
/// [`Error::Usage`] if the image is not [`Format::Rgba8Unorm`].
pub fn ids(image: &Picture) -> Result<Vec<u32>> {
    if image.format != Format::Rgba8Unorm {
        return Err(Error::Usage(format!("an id image is Rgba8Unorm, not {:?}", image.format)));
    }
    Ok(image.bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect())
}

/// The colour target of `frame`.
///
/// # Errors
/// [`Error::Usage`] if it has none.
pub(crate) fn color(frame: &Frame) -> Result<&Picture> {
    frame.colors.first().ok_or_else(|| Error::Usage("the pass stores no colour target".into()))
}

/// Compares two drawings of the same pass, which stores a colour target.
///
/// # Errors
/// [`Error::Usage`] if the two are of different sizes or formats.
pub fn compare(a: Drawn<'_>, b: Drawn<'_>) -> Result<Difference> {
    let (color_a, color_b) = (color(a.frame)?, color(b.frame)?);
    let (image_a, image_b) = (color(a.ids)?, color(b.ids)?);
    same_shape(color_a, color_b)?;
    same_shape(image_a, image_b)?;
    if color_a.extent != image_a.extent {
        let (ids, pass) = (image_a.extent, color_a.extent);
        return Err(Error::Usage(format!("the id pass is {ids}, its pass {pass}")));
    }

    let mut difference =
        Difference { pixels: color_a.extent.pixels() as u64, ..Difference::default() };
    let (ids_a, ids_b) = (ids(image_a)?, ids(image_b)?);
    for (&id_a, &id_b) in ids_a.iter().zip(&ids_b) {
        if (id_a == NO_PRIMITIVE) != (id_b == NO_PRIMITIVE) {
            difference.coverage_differing += 1;
        } else if id_a != id_b {
            difference.winner_differing += 1;
        }
    }
    for delta in color_deltas(a.frame, b.frame)? {
        difference.colour_max = difference.colour_max.max(delta);
        difference.colour_over_1 += u64::from(delta > 1);
    }
    match (&a.ids.depth, &b.ids.depth) {
        (Some(depth_a), Some(depth_b)) => {
            same_shape(depth_a, depth_b)?;
            let depths = depth_a.depths().into_iter().zip(depth_b.depths());
            for ((depth_a, depth_b), (id_a, id_b)) in depths.zip(ids_a.iter().zip(&ids_b)) {
                if id_a == id_b && *id_a != NO_PRIMITIVE {
                    difference.depth_max = difference.depth_max.max(distance(depth_a, depth_b));
                }
            }
        }
        (None, None) => {}
        _ => return Err(Error::Usage("only one of the two drawings has a depth image".into())),
    }
    Ok(difference)
}

/// Per pixel, the largest difference of a channel of any colour target, in 8 bits. Stencil values count as colours
/// that are integers.
fn color_deltas(a: &Frame, b: &Frame) -> Result<Vec<u8>> {
    let (targets, others) = (a.colors.len(), b.colors.len());
    if targets != others {
        return Err(Error::Usage(format!("drawings of {targets} and {others} colour targets")));
    }
    let mut deltas = vec![0; color(a)?.extent.pixels()];
    if a.stencil.is_some() != b.stencil.is_some() {
        return Err(Error::Usage("only one of the two drawings has stencil values".into()));
    }
    for (a, b) in a.colors.iter().chain(&a.stencil).zip(b.colors.iter().chain(&b.stencil)) {
        same_shape(a, b)?;
        for (most, delta) in deltas.iter_mut().zip(channel_deltas(a, b)?) {
            *most = delta.max(*most);
        }
    }
    Ok(deltas)
}

/// Per pixel, the largest difference of a channel in 8 bits. Integers are equal, or differ by as much as can be.
pub(super) fn channel_deltas(a: &Picture, b: &Picture) -> Result<Vec<u8>> {
    if a.format.is_integer() {
        let texel = a.format.texel_bytes();
        let texels = a.bytes.chunks_exact(texel).zip(b.bytes.chunks_exact(texel));
        return Ok(texels.map(|(a, b)| if a == b { 0 } else { u8::MAX }).collect());
    }
    let (a, b) = (a.display_rgba8()?, b.display_rgba8()?);
    Ok(a.chunks_exact(4)
        .zip(b.chunks_exact(4))
        .map(|(a, b)| a.iter().zip(b).map(|(&a, &b)| a.abs_diff(b)).max().unwrap_or(0))
        .collect())
}

/// Depth is in 0..=1, so a side that is not a number is as wrong as can be: 1.
fn distance(a: f32, b: f32) -> f32 {
    if a.to_bits() == b.to_bits() {
        return 0.0;
    }
    let distance = (a - b).abs();
    if distance.is_nan() { 1.0 } else { distance }
}

fn same_shape(a: &Picture, b: &Picture) -> Result<()> {
    if (a.extent, a.format) == (b.extent, b.format) {
        return Ok(());
    }
    Err(Error::Usage(format!(
        "images of different shape cannot be compared: {} {:?} and {} {:?}",
        a.extent, a.format, b.extent, b.format
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::image::Extent;

    const EXTENT: Extent = Extent::new(4, 1);

    fn frame(color: [[u8; 4]; 4], depth: Option<[f32; 4]>) -> Frame {
        let (extent, format) = (EXTENT, Format::Rgba8Unorm);
        Frame {
            colors: vec![Picture { extent, format, bytes: color.concat() }],
            depth: depth.map(|depth| Picture {
                extent: EXTENT,
                format: Format::D32Float,
                bytes: bytemuck::cast_slice(&depth).to_vec(),
            }),
            stencil: None,
        }
    }

    fn id_frame(ids: [u32; 4], depth: Option<[f32; 4]>) -> Frame {
        frame(ids.map(u32::to_le_bytes), depth)
    }

    fn of(a: (&Frame, &Frame), b: (&Frame, &Frame)) -> Result<Difference> {
        compare(Drawn { frame: a.0, ids: a.1 }, Drawn { frame: b.0, ids: b.1 })
    }

    #[test]
    fn equal_drawings_do_not_differ() {
        let color = frame([[1, 2, 3, 4]; 4], None);
        let ids = id_frame([0, 1, 2, 0xffff_ffff], Some([1.0, 0.5, f32::NAN, 0.0]));
        let difference = of((&color, &ids), (&color, &ids)).unwrap();
        assert_eq!(difference, Difference { pixels: 4, ..Difference::default() });
    }

    #[test]
    fn each_pixel_counts_once_among_coverage_and_winner() {
        let color = frame([[0; 4]; 4], None);
        let a = id_frame([0, 1, 0x0100_0000, 7], None);
        let b = id_frame([3, 0, 0x0200_0000, 7], None);
        let difference = of((&color, &a), (&color, &b)).unwrap();
        assert_eq!((difference.coverage_differing, difference.winner_differing), (2, 1));
    }

    #[test]
    fn depth_counts_only_where_the_same_primitive_won() {
        let color = frame([[0; 4]; 4], None);
        let a = id_frame([0, 1, 2, 3], Some([0.0, 0.25, 0.5, 0.5]));
        let b = id_frame([0, 1, 9, 0], Some([1.0, 0.25 + 1e-5, 0.9, 1.0]));
        let depth_max = of((&color, &a), (&color, &b)).unwrap().depth_max;
        assert!((depth_max - 1e-5).abs() < 1e-7, "{depth_max}");
    }

    #[test]
    fn a_depth_that_is_no_number_differs_by_all_there_is() {
        let color = frame([[0; 4]; 4], None);
        let a = id_frame([1; 4], Some([0.5; 4]));
        let b = id_frame([1; 4], Some([0.5, 0.5, f32::NAN, 0.5]));
        assert_eq!(of((&color, &a), (&color, &b)).unwrap().depth_max, 1.0);
    }

    #[test]
    fn colour_counts_pixels_and_not_channels() {
        let ids = id_frame([0; 4], None);
        let a = frame([[10; 4]; 4], None);
        let b = frame([[10; 4], [11, 9, 10, 10], [12, 8, 10, 10], [10, 10, 10, 250]], None);
        let difference = of((&a, &ids), (&b, &ids)).unwrap();
        assert_eq!((difference.colour_over_1, difference.colour_max), (2, 240));
    }

    #[test]
    fn every_target_is_compared_and_a_pixel_counts_once() {
        let ids = id_frame([0; 4], None);
        let of_targets = |third: [[u8; 4]; 4], last: [[u8; 4]; 4]| Frame {
            colors: [[[10; 4]; 4], [[10; 4]; 4], third, last]
                .into_iter()
                .flat_map(|color| frame(color, None).colors)
                .collect(),
            depth: None,
            stencil: None,
        };
        let mut third = [[10; 4]; 4];
        let mut last = third;
        let a = of_targets(third, last);
        (third[1], last[1], last[2]) = ([10, 10, 13, 10], [10, 40, 10, 10], [12, 10, 10, 10]);
        let difference = of((&a, &ids), (&of_targets(third, last), &ids)).unwrap();
        assert_eq!((difference.colour_over_1, difference.colour_max), (2, 30));
        let mut fewer = a.clone();
        fewer.colors.pop();
        assert!(of((&a, &ids), (&fewer, &ids)).is_err());
    }

    #[test]
    fn stencil_values_are_equal_or_differ_by_all_there_is() {
        let ids = id_frame([0; 4], None);
        let of_values = |values: [u8; 4]| Frame {
            stencil: Some(Picture {
                extent: EXTENT,
                format: Format::S8Uint,
                bytes: values.to_vec(),
            }),
            ..frame([[10; 4]; 4], None)
        };
        let (a, b) = (of_values([0, 1, 2, 3]), of_values([0, 1, 3, 3]));
        assert_eq!(of((&a, &ids), (&a, &ids)).unwrap().colour_max, 0);
        let difference = of((&a, &ids), (&b, &ids)).unwrap();
        assert_eq!((difference.colour_over_1, difference.colour_max), (1, 255));
        assert!(of((&a, &ids), (&frame([[10; 4]; 4], None), &ids)).is_err());
    }

    #[test]
    fn drawings_of_other_shapes_are_refused() {
        let ids = id_frame([0; 4], None);
        let with_depth = id_frame([0; 4], Some([0.0; 4]));
        let color = frame([[0; 4]; 4], None);
        let zeroed = |extent, format| Frame {
            colors: vec![Picture::zeroed(extent, format)],
            depth: None,
            stencil: None,
        };
        let srgb = zeroed(EXTENT, Format::Rgba8Srgb);
        let small = zeroed(Extent::new(1, 1), Format::Rgba8Unorm);
        assert!(of((&color, &ids), (&srgb, &ids)).is_err());
        assert!(of((&color, &ids), (&small, &ids)).is_err());
        assert!(of((&color, &small), (&color, &small)).is_err());
        assert!(of((&color, &ids), (&color, &with_depth)).is_err());
    }
}
