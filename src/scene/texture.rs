//! Pictures from files to textures: decoding with limits, and mip levels that keep brightness.

use crate::{
    Error, Result,
    format::Format,
    image::{Extent, linear_to_srgb, srgb_to_linear},
    texture::Texture,
};
use std::{path::Path, sync::OnceLock};

/// Larger pictures are refused: no device takes them as one texture.
const MAX_SIZE: u32 = 16384;

/// A decoder may not allocate more than this (a 16384 x 16384 picture of 4 bytes).
const MAX_ALLOC: u64 = 1 << 30;

/// The meaning of a picture's numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ColorSpace {
    /// Colours as the eye sees them: averaged as light.
    Srgb,
    /// Measures such as roughness or normals: averaged as numbers.
    Linear,
}

/// Loads a PNG or JPEG file as a texture with all mip levels.
///
/// # Errors
/// [`Error::Input`] if the file cannot be read, is no PNG or JPEG, is damaged or is larger than
/// 16384 pixels in a direction.
pub fn load_texture(path: &Path, space: ColorSpace) -> Result<Texture> {
    let bytes = super::files::read(path, &mut Vec::new())?;
    decode(&path.display().to_string(), &bytes, space).map_err(|e| Error::input(path, e))
}

/// Decodes a PNG or JPEG in memory.
pub(super) fn decode(
    label: &str,
    bytes: &[u8],
    space: ColorSpace,
) -> std::result::Result<Texture, String> {
    let (extent, texels) = decode_rgba(bytes)?;
    Ok(with_mips(label, extent, texels, space))
}

/// Decodes a PNG or JPEG to rows of RGBA, 8 bits each.
pub(super) fn decode_rgba(bytes: &[u8]) -> std::result::Result<(Extent, Vec<u8>), String> {
    let mut reader = image::ImageReader::new(std::io::Cursor::new(bytes))
        .with_guessed_format()
        .map_err(|e| e.to_string())?;
    if reader.format().is_none() {
        return Err("the picture is neither PNG nor JPEG".into());
    }
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(MAX_SIZE);
    limits.max_image_height = Some(MAX_SIZE);
    limits.max_alloc = Some(MAX_ALLOC);
    reader.limits(limits);
    let picture = reader.decode().map_err(|e| format!("the picture cannot be decoded: {e}"))?;
    let extent = Extent::new(picture.width(), picture.height());
    if extent.pixels() == 0 {
        return Err("the picture has no pixels".into());
    }
    Ok((extent, picture.into_rgba8().into_raw()))
}

/// Whether the picture in `bytes` can have transparent pixels: a PNG whose colour type has alpha (4 and 6,
/// at byte 25) or that makes a colour transparent by a `tRNS` chunk.
pub(super) fn has_alpha(bytes: &[u8]) -> bool {
    const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
    let Some(mut chunks) = bytes.strip_prefix(SIGNATURE) else { return false };
    if matches!(bytes.get(25), Some(4 | 6)) {
        return true;
    }
    // Each has a length, a name, as many bytes and a checksum; tRNS comes before the pixels.
    while let Some((head, rest)) = chunks.split_first_chunk::<8>() {
        let length = u32::from_be_bytes([head[0], head[1], head[2], head[3]]) as usize;
        match &head[4..] {
            b"tRNS" => return true,
            b"IDAT" => return false,
            _ => chunks = rest.get(length.saturating_add(4)..).unwrap_or_default(),
        }
    }
    false
}

/// A texture of `texels` (RGBA, 8 bits each) with all its mip levels.
///
/// Each level averages the one above it over exactly the area that its texels cover, odd sizes
/// included, and sRGB colours are averaged as light: a checkerboard of black and white becomes
/// 188 of 255, not 128.
pub(super) fn with_mips(
    label: &str,
    extent: Extent,
    texels: Vec<u8>,
    space: ColorSpace,
) -> Texture {
    let format = match space {
        ColorSpace::Srgb => Format::Rgba8Srgb,
        ColorSpace::Linear => Format::Rgba8Unorm,
    };
    let mut levels = vec![texels];
    let (mut width, mut height) = (extent.width as usize, extent.height as usize);
    while width > 1 || height > 1 {
        let next = halve(&levels[levels.len() - 1], width, height, space);
        levels.push(next);
        (width, height) = ((width / 2).max(1), (height / 2).max(1));
    }
    Texture::new(label, extent, format, levels)
}

/// The source texels of one destination texel along one direction, with weights of sum 1: two
/// halves for even sizes, three for odd ones.
fn taps(from: usize, to: usize, i: usize) -> ([usize; 3], [f32; 3]) {
    match from {
        1 => ([0; 3], [1.0, 0.0, 0.0]),
        _ if from.is_multiple_of(2) => ([2 * i, 2 * i + 1, 2 * i], [0.5, 0.5, 0.0]),
        _ => {
            let n = from as f32;
            let weights = [(to - i) as f32 / n, to as f32 / n, (i + 1) as f32 / n];
            ([2 * i, 2 * i + 1, 2 * i + 2], weights)
        }
    }
}

/// The next mip level.
fn halve(texels: &[u8], width: usize, height: usize, space: ColorSpace) -> Vec<u8> {
    let (w, h) = ((width / 2).max(1), (height / 2).max(1));
    let decode = decode_table(space);
    let encode = (space == ColorSpace::Srgb).then(encode_table);
    // Alpha and measures are averaged as they are.
    let to_byte = |v: f32| (v + 0.5) as u8;
    let mut out = Vec::with_capacity(w * h * 4);
    let columns: Vec<_> = (0..w).map(|x| taps(width, w, x)).collect();
    for y in 0..h {
        let (rows, row_weights) = taps(height, h, y);
        for (columns, column_weights) in &columns {
            let mut sum = [0.0f32; 4];
            for (row, wy) in rows.into_iter().zip(row_weights).filter(|(_, w)| *w > 0.0) {
                for (&column, &wx) in columns.iter().zip(column_weights).filter(|(_, w)| **w > 0.0)
                {
                    let at = (row * width + column) * 4;
                    let weight = wx * wy;
                    for c in 0..3 {
                        sum[c] += decode[texels[at + c] as usize] * weight;
                    }
                    sum[3] += texels[at + 3] as f32 * weight;
                }
            }
            for v in &sum[..3] {
                out.push(match encode {
                    Some(table) => table[(v * ENCODE_STEPS as f32 + 0.5) as usize],
                    None => to_byte(*v),
                });
            }
            out.push(to_byte(sum[3]));
        }
    }
    out
}

/// Light 0..=1 in this many steps finds its sRGB byte without error: the darkest bytes are 1/3294
/// of full light apart.
const ENCODE_STEPS: usize = 65535;

/// sRGB bytes to light in 0..=1, or bytes to themselves.
fn decode_table(space: ColorSpace) -> &'static [f32; 256] {
    static SRGB: OnceLock<[f32; 256]> = OnceLock::new();
    static LINEAR: OnceLock<[f32; 256]> = OnceLock::new();
    match space {
        ColorSpace::Srgb => {
            SRGB.get_or_init(|| std::array::from_fn(|i| srgb_to_linear(i as f32 / 255.0)))
        }
        ColorSpace::Linear => LINEAR.get_or_init(|| std::array::from_fn(|i| i as f32)),
    }
}

/// Light in steps of 1 / [`ENCODE_STEPS`] to sRGB bytes.
fn encode_table() -> &'static [u8] {
    static TABLE: OnceLock<Vec<u8>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let byte = |i| (linear_to_srgb(i as f32 / ENCODE_STEPS as f32) * 255.0 + 0.5) as u8;
        (0..=ENCODE_STEPS).map(byte).collect()
    })
}

/// Turns a height map (its brightness) into a normal map; `strength` scales the slope of a step
/// from black to white between two texels.
pub(super) fn height_to_normal(extent: Extent, texels: &[u8], strength: f32) -> Vec<u8> {
    let (w, h) = (extent.width as i64, extent.height as i64);
    let height = |x: i64, y: i64| {
        let at = (y.rem_euclid(h) * w + x.rem_euclid(w)) as usize * 4;
        (texels[at] as f32 + texels[at + 1] as f32 + texels[at + 2] as f32) / 765.0
    };
    let mut out = Vec::with_capacity(texels.len());
    for y in 0..h {
        for x in 0..w {
            let dx = (height(x + 1, y) - height(x - 1, y)) * 0.5 * strength;
            // Rows run down, the bitangent runs up.
            let dy = (height(x, y - 1) - height(x, y + 1)) * 0.5 * strength;
            let n = glam::Vec3::new(-dx, -dy, 1.0).normalize() * 127.5 + 127.5;
            out.extend([n.x as u8, n.y as u8, n.z as u8, 255]);
        }
    }
    out
}

#[cfg(test)]
mod formats;

#[cfg(test)]
mod tests {
    use super::*;

    fn solid(extent: Extent, texel: [u8; 4]) -> Vec<u8> {
        texel.repeat(extent.pixels())
    }

    #[test]
    fn mips_keep_a_solid_colour_for_every_size_and_value() {
        for (w, h) in [(1, 1), (2, 2), (7, 5), (1, 9), (16, 3), (13, 1)] {
            let extent = Extent::new(w, h);
            for value in [0, 1, 2, 20, 128, 254, 255] {
                let texel = [value, 255 - value, 7, value];
                for space in [ColorSpace::Srgb, ColorSpace::Linear] {
                    let t = with_mips("solid", extent, solid(extent, texel), space);
                    assert_eq!(t.levels().unwrap().len() as u32, 32 - w.max(h).leading_zeros());
                    for (n, level) in t.levels().unwrap().iter().enumerate() {
                        let texels = (w >> n).max(1) * (h >> n).max(1);
                        assert_eq!(level.len(), texels as usize * 4);
                        assert!(level.chunks(4).all(|t| t == texel), "{w}x{h} level {n}");
                    }
                }
            }
        }
    }

    #[test]
    fn a_checkerboard_averages_as_light() {
        let texels = [[0u8, 0, 0, 255], [255, 255, 255, 255], [255; 4], [0, 0, 0, 255]].concat();
        let t = with_mips("checker", Extent::new(2, 2), texels.clone(), ColorSpace::Srgb);
        assert_eq!(t.levels().unwrap()[1], [188, 188, 188, 255]);
        let t = with_mips("checker", Extent::new(2, 2), texels, ColorSpace::Linear);
        assert_eq!(t.levels().unwrap()[1], [128, 128, 128, 255]);
    }

    #[test]
    fn odd_sizes_weigh_by_area() {
        // 3 texels to 1: each counts a third.
        let texels = [[0u8, 0, 0, 0], [90; 4], [255, 0, 30, 3]].concat();
        let t = with_mips("odd", Extent::new(3, 1), texels, ColorSpace::Linear);
        assert_eq!(t.levels().unwrap()[1], [115, 30, 40, 31]);
        for to in 1..50 {
            for i in 0..to {
                let (columns, weights) = taps(2 * to + 1, to, i);
                assert!(columns.into_iter().all(|c| c <= 2 * to));
                assert!((weights.into_iter().sum::<f32>() - 1.0).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn srgb_round_trip_is_exact() {
        for byte in 0..=255u8 {
            let light = decode_table(ColorSpace::Srgb)[byte as usize];
            let back = encode_table()[(light * ENCODE_STEPS as f32 + 0.5) as usize];
            assert_eq!(back, byte);
        }
    }

    #[test]
    fn a_slope_to_the_right_tilts_the_normal_to_the_left() {
        let extent = Extent::new(4, 1);
        let texels: Vec<u8> = [0u8, 60, 120, 180].iter().flat_map(|&v| [v, v, v, 255]).collect();
        let normals = height_to_normal(extent, &texels, 4.0);
        assert!(normals[4] < 110 && normals[5] == 127 && normals[6] > 128);
    }

    #[test]
    fn what_is_no_picture_is_refused() {
        assert!(decode("x", b"not a picture", ColorSpace::Srgb).is_err());
        assert!(decode("x", b"\x89PNG\r\n\x1a\n", ColorSpace::Srgb).is_err());
    }
}
