//! Each kind of PNG and JPEG, written by hand, becomes the right texels.

use super::*;
use png::{BitDepth, ColorType};

/// The texels of a PNG of two pixels side by side.
fn texels(
    color: ColorType,
    depth: BitDepth,
    samples: &[u8],
    palette: Option<&[u8]>,
    transparent: Option<&[u8]>,
) -> [[u8; 4]; 2] {
    let mut file = Vec::new();
    let mut info = png::Info::with_size(2, 1);
    (info.color_type, info.bit_depth) = (color, depth);
    info.palette = palette.map(|colors| colors.to_vec().into());
    info.trns = transparent.map(|alpha| alpha.to_vec().into());
    let mut writer = png::Encoder::with_info(&mut file, info).unwrap().write_header().unwrap();
    writer.write_image_data(samples).unwrap();
    writer.finish().unwrap();
    let transparent = transparent.is_some();
    let alpha = matches!(color, ColorType::GrayscaleAlpha | ColorType::Rgba) || transparent;
    assert_eq!(has_alpha(&file), alpha, "{color:?}");
    let (extent, texels) = decode_rgba(&file).unwrap_or_else(|e| panic!("{color:?}: {e}"));
    assert_eq!(extent, Extent::new(2, 1));
    let (texels, rest) = texels.as_chunks::<4>();
    assert!(rest.is_empty(), "{color:?}");
    texels.try_into().unwrap_or_else(|_| panic!("{color:?}: {texels:?}"))
}

#[test]
fn each_kind_of_png_becomes_rgba() {
    use BitDepth::{Eight, One, Sixteen, Two};
    use ColorType::{Grayscale, GrayscaleAlpha, Indexed, Rgb, Rgba};
    let (none, black) = (None, [0, 0, 0, 255]);
    for (color, depth, samples, palette, transparent, expected) in [
        (Grayscale, One, &[0b0100_0000][..], none, none, [black, [255; 4]]),
        (Grayscale, Two, &[0b0110_0000], none, none, [[85, 85, 85, 255], [170, 170, 170, 255]]),
        (Grayscale, Eight, &[0, 7], none, Some(&[0, 7][..]), [black, [7, 7, 7, 0]]),
        // 16 bits are rounded: 0x0180 is 1.49 of 255, 0x0182 is 1.50.
        (Grayscale, Sixteen, &[1, 0x80, 1, 0x82], none, none, [[1, 1, 1, 255], [2, 2, 2, 255]]),
        (GrayscaleAlpha, Eight, &[1, 2, 3, 4], none, none, [[1, 1, 1, 2], [3, 3, 3, 4]]),
        (Rgb, Eight, &[1, 2, 3, 4, 5, 6], none, none, [[1, 2, 3, 255], [4, 5, 6, 255]]),
        (Rgba, Eight, &[1, 2, 3, 4, 5, 6, 7, 8], none, none, [[1, 2, 3, 4], [5, 6, 7, 8]]),
        (
            Rgba,
            Sixteen,
            &[255, 255, 0, 0, 0, 128, 0, 129, 1, 1, 2, 2, 3, 3, 4, 4],
            none,
            none,
            [[255, 0, 0, 1], [1, 2, 3, 4]],
        ),
        (Indexed, One, &[0b1000_0000], Some(&[0, 0, 0, 9, 8, 7]), none, [[9, 8, 7, 255], black]),
        (
            Indexed,
            Eight,
            &[1, 0],
            Some(&[0, 0, 0, 9, 8, 7]),
            Some(&[255, 6]),
            [[9, 8, 7, 6], black],
        ),
    ] {
        assert_eq!(
            texels(color, depth, samples, palette, transparent),
            expected,
            "{color:?} {depth:?}"
        );
    }
}

/// A JPEG of 8x8 pixels of one colour, with its components and, if it is of Adobe's kind, how they are turned into
/// three: 0 not at all, 1 from YCbCr, 2 from YCCK.
fn jpeg(components: &[u8], adobe: Option<u8>) -> Vec<u8> {
    let segment = |marker: u8, content: &[u8]| {
        [&[0xff, marker], &(content.len() as u16 + 2).to_be_bytes()[..], content].concat()
    };
    let count = components.len() as u8;
    let each = |per: &dyn Fn(u8) -> Vec<u8>| (0..count).flat_map(per).collect::<Vec<u8>>();
    // The mean of a block is an eighth of its first number. Codes: 4 bits for the length of that number, which is 0
    // to 8 bits, and one bit, 0, for the end of a block.
    let bits: String = components
        .iter()
        .map(|&value| {
            let value = i32::from(value) - 128;
            let length = (32 - value.unsigned_abs().leading_zeros()) as usize;
            let number = if value < 0 { value + (1 << length) - 1 } else { value };
            let number = if length > 0 { format!("{number:0length$b}") } else { String::new() };
            format!("{length:04b}{number}0")
        })
        .collect();
    let bytes = bits.as_bytes().chunks(8).flat_map(|bits| {
        let byte = (0..8).fold(0, |byte, at| byte << 1 | u8::from(bits.get(at) != Some(&b'0')));
        if byte == 0xff { vec![0xff, 0] } else { vec![byte] }
    });
    [
        vec![0xff, 0xd8],
        adobe.map_or(vec![], |kind| segment(0xee, &[b"Adobe\0\x64\0\0\0\0", &[kind][..]].concat())),
        segment(0xdb, &[&[0][..], &[8], &[1; 63]].concat()),
        segment(0xc0, &[&[8, 0, 8, 0, 8, count][..], &each(&|c| vec![c + 1, 0x11, 0])].concat()),
        segment(0xc4, &[&[0, 0, 0, 0, 9][..], &[0; 12], &[0, 1, 2, 3, 4, 5, 6, 7, 8]].concat()),
        segment(0xc4, &[&[0x10, 1][..], &[0; 15], &[0]].concat()),
        segment(0xda, &[&[count][..], &each(&|c| vec![c + 1, 0]), &[0, 63, 0]].concat()),
        bytes.collect(),
        vec![0xff, 0xd9],
    ]
    .concat()
}

#[test]
fn each_kind_of_jpeg_becomes_rgba() {
    for (components, adobe, expected) in [
        (&[200][..], None, [200, 200, 200, 255]),
        (&[100, 128, 128], None, [100, 100, 100, 255]),
        (&[76, 85, 255], Some(1), [254, 0, 0, 255]),
        (&[10, 20, 30], Some(0), [10, 20, 30, 255]),
        // Adobe's inks are inverted: 255 is none.
        (&[255, 255, 255, 100], Some(0), [100, 100, 100, 255]),
    ] {
        let (extent, texels) = decode_rgba(&jpeg(components, adobe)).unwrap();
        assert_eq!((extent, texels.len()), (Extent::new(8, 8), 256));
        for texel in texels.chunks(4) {
            let near = texel.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1);
            assert!(near, "{components:?}: {texel:?}, not {expected:?}");
        }
    }
}
