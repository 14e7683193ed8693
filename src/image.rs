//! Pictures in host memory. Executors return them, and textures are made of them.

pub mod png;
mod shape;

pub use shape::Shape;

use crate::{
    error::{Error, Result},
    format::Format,
};
use std::borrow::Cow;

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

    /// The bytes of the pixel at `x`, `y`.
    pub fn texel(&self, x: u32, y: u32) -> &[u8] {
        let n = self.format.texel_bytes();
        let at = (y as usize * self.extent.width as usize + x as usize) * n;
        &self.bytes[at..at + n]
    }

    /// All pixels as floats, for [`Format::D32Float`]; native byte order as the device wrote it.
    pub fn depths(&self) -> Vec<f32> {
        assert_eq!(self.format, Format::D32Float, "only a depth image holds depths");
        bytemuck::pod_collect_to_vec(&self.bytes)
    }

    /// The picture as a screen shows it: four bytes a pixel, RGB as sRGB, alpha linear.
    ///
    /// 8-bit formats are taken as they are, also [`Format::Rgba8Unorm`], whose shaders chose their
    /// own encoding; linear half floats are clamped to 0..=1, encoded and rounded.
    ///
    /// # Errors
    /// [`Error::Usage`] for a depth image, which has no colours.
    pub fn display_rgba8(&self) -> Result<Cow<'_, [u8]>> {
        match self.format {
            Format::Rgba8Unorm | Format::Rgba8Srgb => Ok(Cow::Borrowed(&self.bytes)),
            Format::Rgba16Float => Ok(Cow::Owned(self.half_texels().flat_map(shown).collect())),
            Format::D32Float => {
                Err(Error::Usage("a depth image cannot be shown as a picture".into()))
            }
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
        let divided = self.half_texels().flat_map(|[r, g, b, a]| match a {
            0.0 => [0; 4],
            _ => shown([r / a, g / a, b / a, a]),
        });
        Ok(Picture { extent: self.extent, format: Format::Rgba8Srgb, bytes: divided.collect() })
    }

    /// The texels of [`Format::Rgba16Float`].
    fn half_texels(&self) -> impl Iterator<Item = [f32; 4]> {
        let half = |texel: &[u8], at: usize| {
            half_to_f32(u16::from_ne_bytes([texel[2 * at], texel[2 * at + 1]]))
        };
        self.bytes.chunks_exact(8).map(move |texel| std::array::from_fn(|at| half(texel, at)))
    }
}

/// The texel that a linear RGBA value becomes in an 8-bit format, to the bit as kernels encode it; `None`
/// for other formats.
pub fn texel_rgba8(format: Format, linear: [f32; 4]) -> Option<[u8; 4]> {
    match format {
        Format::Rgba8Unorm => Some(linear.map(to_unorm8)),
        Format::Rgba8Srgb => {
            let [r, g, b, a] = linear.map(|c| if c > 0.0 { c.min(1.0) } else { 0.0 });
            Some([kernel_srgb(r), kernel_srgb(g), kernel_srgb(b), a].map(to_unorm8))
        }
        Format::Rgba16Float | Format::D32Float => None,
    }
}

/// A half float's value; exact, because every half is a float.
pub fn half_to_f32(half: u16) -> f32 {
    let sign = if half & 0x8000 == 0 { 1.0 } else { -1.0 };
    let exponent = i32::from(half >> 10 & 0x1f);
    let mantissa = f32::from(half & 0x3ff);
    match exponent {
        0 => sign * mantissa * 2f32.powi(-24),
        31 if mantissa == 0.0 => sign * f32::INFINITY,
        31 => f32::NAN,
        _ => sign * (1024.0 + mantissa) * 2f32.powi(exponent - 25),
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

/// The sRGB transfer function as `glsl/lib/color.glsl` has it, operation for operation.
fn kernel_srgb(c: f32) -> f32 {
    if c <= 0.003_130_8 {
        return 12.92 * c;
    }
    let m = f32::from_bits(c.to_bits() & 0x7f_ffff | 0x3f80_0000);
    let k = 127 - (c.to_bits() >> 23);
    let mut power = 0.433_846_95
        + m * (0.874_447_5 + m * (-0.335_793_08 + m * (0.093_934_77 - m * 0.011_425_173)));
    let factors = [0.749_153_55, 0.561_231, 0.314_980_27, 0.099_212_565];
    for (bit, factor) in factors.into_iter().enumerate() {
        power *= if k >> bit & 1 != 0 { factor } else { 1.0 };
    }
    power - 0.055
}

/// A linear colour as a screen shows it.
fn shown([r, g, b, a]: [f32; 4]) -> [u8; 4] {
    let [r, g, b] = [r, g, b].map(linear_to_srgb);
    [r, g, b, a].map(to_unorm8)
}

/// Rounds to the nearest of 0..=255, ties to even, as kernels do;
/// not-a-number becomes 0, as the specification of UNORM says.
fn to_unorm8(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0).round_ties_even() as u8
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn halves_convert_exactly() {
        for (half, value) in [
            (0x0000, 0.0),
            (0x0001, 2f32.powi(-24)),
            (0x03ff, 1023.0 * 2f32.powi(-24)),
            (0x0400, 2f32.powi(-14)),
            (0x3c00, 1.0),
            (0xc000, -2.0),
            (0x7bff, 65504.0),
            (0x7c00, f32::INFINITY),
        ] {
            assert_eq!(half_to_f32(half), value, "{half:#06x}");
        }
        assert!(half_to_f32(0x7e00).is_nan());
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
