//! Pictures in host memory. Executors return them, and textures are made of them.

pub mod png;
mod shape;
pub(crate) mod texel;

pub use shape::Shape;
pub use texel::{f32_to_half, half_to_f32};

use crate::{
    error::{Error, Result},
    format::{Format, Numeric},
    target::ClearColor,
};
use std::borrow::Cow;
use texel::to_unorm8;

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Extent {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl Extent {
    /// The extent `width` x `height`.
    pub const fn new(width: u32, height: u32) -> Self {
        Self { width, height }
    }

    /// Pixels in all.
    pub const fn pixels(self) -> usize {
        self.width as usize * self.height as usize
    }
}

impl std::fmt::Display for Extent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// A picture: rows from top to bottom, pixels from left to right, no padding.
#[derive(Clone, PartialEq)]
pub struct Picture {
    /// Size in pixels.
    pub extent: Extent,
    /// Layout of one pixel in `bytes`.
    pub format: Format,
    /// `extent.pixels() * format.texel_bytes()` bytes.
    pub bytes: Vec<u8>,
}

/// Without the pixels, which would be millions of numbers.
impl std::fmt::Debug for Picture {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { extent, format, bytes } = self;
        write!(f, "Picture({extent}, {format:?}, {} bytes)", bytes.len())
    }
}

impl Picture {
    /// A picture of zeros.
    pub fn zeroed(extent: Extent, format: Format) -> Self {
        Self { extent, format, bytes: vec![0; extent.pixels() * format.texel_bytes()] }
    }

    /// A picture of one colour: what a target holds that was cleared to `color`. A colour of another kind is converted: 5.0 is
    /// 5 in a format of integers.
    pub fn filled(extent: Extent, format: Format, color: impl Into<ClearColor>) -> Self {
        let words = texel::encode(format, color.into());
        let texel = &bytemuck::cast_slice(&words)[..format.texel_bytes()];
        Self { extent, format, bytes: texel.repeat(extent.pixels()) }
    }

    /// The bytes of the pixel at `x`, `y`.
    pub fn texel(&self, x: u32, y: u32) -> &[u8] {
        let n = self.format.texel_bytes();
        let at = (y as usize * self.extent.width as usize + x as usize) * n;
        &self.bytes[at..at + n]
    }

    /// The values of all pixels: floats and depths, normalized numbers in 0..=1 or -1..=1 (sRGB-encoded ones are not
    /// decoded), integers as floats. Channels that the format lacks are 0, a missing alpha is 1.
    pub fn values(&self) -> impl Iterator<Item = [f32; 4]> + '_ {
        self.bytes
            .chunks_exact(self.format.texel_bytes())
            .map(|texel| texel::decode(self.format, texel))
    }

    /// The depth of all pixels, in 0..=1.
    ///
    /// # Panics
    /// If the picture has a format of colours.
    pub fn depths(&self) -> Vec<f32> {
        assert!(self.format.is_depth(), "only a depth image holds depths");
        match self.format {
            Format::D32Float | Format::D32FloatS8Uint => bytemuck::pod_collect_to_vec(&self.bytes),
            _ => self.values().map(|[depth, ..]| depth).collect(),
        }
    }

    /// The picture as a screen shows it: four bytes a pixel, RGB as sRGB, alpha linear. Channels that the format lacks are 0, a
    /// missing alpha is 1.
    ///
    /// Normalized formats are taken as they are, also those that are not sRGB-encoded, whose shaders chose their own encoding;
    /// floats are linear: they are clamped to 0..=1, encoded and rounded.
    ///
    /// # Errors
    /// [`Error::Usage`] for a picture of depths or of integers, which are no colours.
    pub fn display_rgba8(&self) -> Result<Cow<'_, [u8]>> {
        match self.format.numeric() {
            _ if matches!(self.format, Format::Rgba8Unorm | Format::Rgba8Srgb) => {
                Ok(Cow::Borrowed(&self.bytes))
            }
            Numeric::Unorm | Numeric::Srgb | Numeric::Snorm => {
                Ok(Cow::Owned(self.values().flat_map(|c| c.map(to_unorm8)).collect()))
            }
            Numeric::Float => Ok(Cow::Owned(self.values().flat_map(shown).collect())),
            Numeric::Depth => {
                Err(Error::Usage("a depth image cannot be shown as a picture".into()))
            }
            Numeric::Uint
            | Numeric::Uscaled
            | Numeric::Sint
            | Numeric::Sscaled
            | Numeric::Stencil => Err(Error::Usage(format!(
                "a picture of integers ({:?}) cannot be shown: only a program knows what they mean",
                self.format
            ))),
        }
    }

    /// The picture with each colour divided by its alpha, as [`Format::Rgba8Srgb`].
    ///
    /// Blending over a target that was cleared to a translucent or transparent colour leaves colours
    /// multiplied by their alpha. Files such as PNG hold colours that are not multiplied: without the
    /// division, translucent parts would get dark fringes. Where alpha is 0, the result is black.
    ///
    /// # Errors
    /// [`Error::Usage`] unless the format is [`Format::Rgba16Float`]: 8 bits of a product are too few
    /// to find the factor.
    pub fn unpremultiplied(&self) -> Result<Picture> {
        if self.format != Format::Rgba16Float {
            return Err(Error::Usage(format!(
                "only half floats are divided by their alpha, and the picture is {:?}",
                self.format
            )));
        }
        let divided = self.values().flat_map(|[r, g, b, a]| match a {
            0.0 => [0; 4],
            _ => shown([r / a, g / a, b / a, a]),
        });
        Ok(Picture { extent: self.extent, format: Format::Rgba8Srgb, bytes: divided.collect() })
    }
}

/// The sRGB transfer function (IEC 61966-2-1), from the encoded value to light; both in 0..=1.
pub fn srgb_to_linear(encoded: f32) -> f32 {
    let v = f64::from(encoded);
    (if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }) as f32
}

/// The sRGB transfer function (IEC 61966-2-1), from light to the encoded value; both in 0..=1.
///
/// Computed in double precision, so that rounding to 8 bits afterwards is the only rounding to see.
pub fn linear_to_srgb(linear: f32) -> f32 {
    let v = f64::from(linear);
    (if v <= 0.003_130_8 { v * 12.92 } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 }) as f32
}

/// A linear colour as a screen shows it.
fn shown([r, g, b, a]: [f32; 4]) -> [u8; 4] {
    let [r, g, b] = [r, g, b].map(linear_to_srgb);
    [r, g, b, a].map(to_unorm8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_format_is_shown_but_depths_and_integers() {
        for &format in Format::ALL {
            let picture = Picture::filled(Extent::new(2, 1), format, [1.0, 0.0, 1.0, 1.0]);
            assert_eq!(picture.bytes.len(), 2 * format.texel_bytes(), "{format:?}");
            match picture.display_rgba8() {
                Ok(shown) => {
                    let blue = if format.channels() < 3 { 0 } else { 255 };
                    assert_eq!(*shown, [255, 0, blue, 255].repeat(2), "{format:?}");
                }
                Err(_) => assert!(format.is_depth() || format.is_integer(), "{format:?}"),
            }
        }
    }

    #[test]
    fn half_floats_are_shown_as_srgb() {
        let mut image = Picture::zeroed(Extent::new(1, 1), Format::Rgba16Float);
        let halves: [u16; 4] = [0x3c00, 0x3800, 0x7e00, 0x3800]; // 1, 0.5, NaN, 0.5
        image.bytes = halves.iter().flat_map(|half| half.to_ne_bytes()).collect();
        assert_eq!(image.display_rgba8().unwrap().as_ref(), &[255, 188, 0, 128]);
    }

    #[test]
    fn colours_are_divided_by_their_alpha_before_they_are_encoded() {
        let mut image = Picture::zeroed(Extent::new(3, 1), Format::Rgba16Float);
        // Half of full light under alpha 0.5; opaque; nothing at all, with a trace of red.
        let halves: [u16; 12] =
            [0x3800, 0x3400, 0, 0x3800, 0x3c00, 0x3800, 0, 0x3c00, 0x0001, 0, 0, 0];
        image.bytes = halves.iter().flat_map(|half| half.to_ne_bytes()).collect();
        let straight = image.unpremultiplied().unwrap();
        assert_eq!(straight.format, Format::Rgba8Srgb);
        assert_eq!(straight.bytes, [255, 188, 0, 128, 255, 188, 0, 255, 0, 0, 0, 0]);
        assert!(matches!(straight.unpremultiplied(), Err(Error::Usage(_))));
    }
}
