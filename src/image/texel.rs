//! Texels: the words that kernels make of colours, and the colours that texels stand for.
//!
//! What is encoded here is encoded to the bit as `glsl/lib/color.glsl` encodes it: a target that the host clears is as one
//! that a shader fills.

use crate::{
    format::{Format, Numeric, Packing},
    target::ClearColor,
};

/// The words of a texel in the rows of a target. A texel of fewer than four words leaves 0 in the others.
pub(crate) fn encode(format: Format, color: ClearColor) -> [u32; 4] {
    let masks = masks(format);
    let each = |of: &dyn Fn(usize) -> u32| std::array::from_fn(|n| of(n) & masks[n]);
    let numbers = match limited_integers(format, color.converted(format)) {
        ClearColor::Uint(c) => each(&|n| c[n]),
        ClearColor::Sint(c) => each(&|n| c[n] as u32),
        ClearColor::Float(c) => match (format.numeric(), format.packing()) {
            (Numeric::Snorm, _) => each(&|n| {
                // As in the kernels, not-a-number becomes 0.
                let limited = if c[n].is_nan() { 0.0 } else { c[n].clamp(-1.0, 1.0) };
                (limited * (masks[n] >> 1) as f32).round_ties_even() as i32 as u32
            }),
            (Numeric::Float, Packing::Bits16) => each(&|n| f32_to_half(c[n]).into()),
            (Numeric::Float, Packing::Rg11b10) => {
                let bits = [6, 6, 5, 0];
                each(&|n| {
                    let number = small_float(c[n], bits[n]);
                    // What is finite stays finite.
                    let is_too_large = number == 31 << bits[n] && c[n].is_finite();
                    number - u32::from(is_too_large)
                })
            }
            (Numeric::Float, _) => c.map(f32::to_bits),
            (Numeric::Depth, _) => each(&|n| depth_number(format, c[n])),
            (Numeric::Srgb, _) => {
                let [r, g, b, a] = c.map(limited);
                let c = [kernel_srgb(r), kernel_srgb(g), kernel_srgb(b), a];
                each(&|n| unorm(c[n], masks[n]))
            }
            (_, _) => each(&|n| unorm(c[n], masks[n])),
        },
    };
    let shifted: [u32; 4] = std::array::from_fn(|n| numbers[n] << shifts(format)[n]);
    let [r, g, b, a] = shifted;
    let mut words = match format.packing() {
        Packing::Bits32 => shifted,
        Packing::Bits16 => [r | g, b | a, 0, 0],
        _ => [r | g | b | a, 0, 0, 0],
    };
    words[format.row_bytes() / 4..].fill(0);
    words
}

/// The colour that the bytes of a texel stand for. A sRGB-encoded one is not decoded; integers become floats.
pub(crate) fn decode(format: Format, texel: &[u8]) -> [f32; 4] {
    let mut bytes = [0; 16];
    bytes[..texel.len()].copy_from_slice(texel);
    let words: [u32; 4] = bytemuck::cast(bytes);
    let (masks, shifts) = (masks(format), shifts(format));
    let channel = |n: usize| {
        let word = match format.packing() {
            Packing::Bits32 => words[n],
            Packing::Bits16 => words[n / 2],
            _ => words[0],
        };
        let number = word >> shifts[n] & masks[n];
        let signed = |number: u32| {
            let sign = (masks[n] >> 1) + 1;
            i64::from(number ^ sign) - i64::from(sign)
        };
        match format.numeric() {
            Numeric::Unorm | Numeric::Srgb => number as f32 / masks[n] as f32,
            Numeric::Snorm => (signed(number) as f32 / (masks[n] >> 1) as f32).max(-1.0),
            Numeric::Uint | Numeric::Uscaled | Numeric::Stencil => number as f32,
            Numeric::Sint | Numeric::Sscaled => signed(number) as f32,
            Numeric::Depth => depth_of_number(format, number),
            Numeric::Float => match format.packing() {
                Packing::Bits16 => half_to_f32(number as u16),
                // The exponent is that of a half float.
                Packing::Rg11b10 if n < 2 => half_to_f32((number << 4) as u16),
                Packing::Rg11b10 => half_to_f32((number << 5) as u16),
                _ => f32::from_bits(number),
            },
        }
    };
    let missing = |n| if n == 3 { 1.0 } else { 0.0 };
    std::array::from_fn(|n| if n < format.channels() { channel(n) } else { missing(n) })
}

/// The same, with integers that `format` holds.
pub(crate) fn limited_integers(format: Format, color: ClearColor) -> ClearColor {
    let masks = masks(format);
    match color {
        ClearColor::Float(_) => color,
        ClearColor::Uint(c) => ClearColor::Uint(std::array::from_fn(|n| c[n].min(masks[n]))),
        ClearColor::Sint(c) => ClearColor::Sint(std::array::from_fn(|n| {
            let most = (masks[n] >> 1) as i32;
            c[n].clamp(-most - 1, most)
        })),
    }
}

/// The greatest number of each channel.
fn masks(format: Format) -> [u32; 4] {
    match format.packing() {
        Packing::Bits8 | Packing::Bgra8 => [0xff; 4],
        Packing::Bits16 => [0xffff; 4],
        Packing::Bits32 => [u32::MAX; 4],
        Packing::Low24 => [0xff_ffff; 4],
        Packing::Rgb10a2 | Packing::Bgr10a2 => [0x3ff, 0x3ff, 0x3ff, 3],
        Packing::Rg11b10 => [0x7ff, 0x7ff, 0x3ff, 0],
        Packing::R5g6b5 => [0x1f, 0x3f, 0x1f, 0],
        Packing::A1r5g5b5 => [0x1f, 0x1f, 0x1f, 1],
    }
}

/// The bit of its word at which each channel begins.
fn shifts(format: Format) -> [u32; 4] {
    match format.packing() {
        Packing::Bits8 => [0, 8, 16, 24],
        Packing::Bgra8 => [16, 8, 0, 24],
        Packing::Bits16 => [0, 16, 0, 16],
        Packing::Bits32 | Packing::Low24 => [0; 4],
        Packing::Rgb10a2 => [0, 10, 20, 30],
        Packing::Bgr10a2 => [20, 10, 0, 30],
        Packing::Rg11b10 => [0, 11, 22, 0],
        Packing::R5g6b5 => [11, 5, 0, 0],
        Packing::A1r5g5b5 => [10, 5, 0, 15],
    }
}

/// The bits that a depth target of `format` keeps of a depth, as `glsl/lib/depth_format.glsl` has them.
fn depth_number(format: Format, depth: f32) -> u32 {
    match format.depth_bits() {
        0 => depth.to_bits(),
        bits => unorm(depth, (1 << bits) - 1),
    }
}

/// The depth that such bits stand for.
fn depth_of_number(format: Format, number: u32) -> f32 {
    match format.depth_bits() {
        0 => f32::from_bits(number),
        bits => (f64::from(number) / f64::from((1u32 << bits) - 1)) as f32,
    }
}

/// Bytes of texels that a device left, with 0 in the bits that belong to no channel: Vulkan does not say what they hold.
pub(crate) fn without_rest(format: Format, mut bytes: Vec<u8>) -> Vec<u8> {
    if format.depth_bits() == 24 {
        for texel in bytes.as_chunks_mut::<4>().0 {
            *texel = (u32::from_ne_bytes(*texel) & 0xff_ffff).to_ne_bytes();
        }
    }
    bytes
}

/// The depth nearest to `depth`, which is in 0..=1, that a target of `format` holds.
pub(crate) fn kept_depth(format: Format, depth: f32) -> f32 {
    depth_of_number(format, depth_number(format, depth))
}

/// To 0..=1; not-a-number becomes 0, as the specification of UNORM says.
fn limited(value: f32) -> f32 {
    if value > 0.0 { value.min(1.0) } else { 0.0 }
}

/// The nearest number of 0 to `most`, ties to even, as kernels round.
fn unorm(value: f32, most: u32) -> u32 {
    (limited(value) * most as f32).round_ties_even() as u32
}

/// As [`unorm`] of 8 bits.
pub(super) fn to_unorm8(value: f32) -> u8 {
    unorm(value, 255) as u8
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

/// The half float nearest to `value`, ties to even.
pub fn f32_to_half(value: f32) -> u16 {
    let sign = if value.is_sign_negative() { 0x8000 } else { 0 };
    sign | small_float(value.abs(), 10) as u16
}

/// The nearest float of 5 bits of exponent and `bits` bits of mantissa, ties to even. Negative numbers
/// become 0.
fn small_float(value: f32, bits: u32) -> u32 {
    if value.is_nan() {
        return (63 << bits) >> 1;
    }
    let (all, last) = (value.to_bits(), 23 - bits);
    if value < 2f32.powi(-14) {
        // Below the normal ones, a step is 2^-14 / 2^bits.
        return (value * (16384u32 << bits) as f32).round_ties_even() as u32;
    }
    let rounded = u64::from(all) - 0x3800_0000 + (1 << (last - 1)) - 1 + u64::from(all >> last & 1);
    ((rounded >> last) as u32).min(31 << bits)
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
        for half in (0..=u16::MAX).filter(|half| half & 0x7fff <= 0x7c00) {
            assert_eq!(f32_to_half(half_to_f32(half)), half, "{half:#06x}");
        }
        // Ties go to even; what is nearer to infinity than to the greatest half becomes infinity.
        for (value, half) in [
            (1.0 + 2f32.powi(-11), 0x3c00),
            (1.0 + 3.0 * 2f32.powi(-11), 0x3c02),
            (2f32.powi(-25), 0),
            (3.0 * 2f32.powi(-25), 2),
            (65519.0, 0x7bff),
            (65520.0, 0x7c00),
            (-1e9, 0xfc00),
        ] {
            assert_eq!(f32_to_half(value), half, "{value}");
        }
        assert!(half_to_f32(f32_to_half(f32::NAN)).is_nan());
    }

    /// Every number of every channel of a format is decoded and encoded again to itself.
    #[test]
    fn texels_are_decoded_and_encoded_again() {
        for &format in Format::ALL.iter().filter(|f| !f.is_integer() && !f.is_depth()) {
            let texel = format.texel_bytes();
            for seed in 0..4096u32 {
                let words: [u32; 4] = std::array::from_fn(|n| {
                    (seed * 4 + n as u32).wrapping_mul(0x9e37_79b1).rotate_left(seed % 31)
                });
                let bytes: &[u8] = &bytemuck::cast_slice(&words)[..texel];
                let color = decode(format, bytes);
                // The least number of a signed format means the same as the next one. No format keeps which not-a-number it is.
                let is_least = format.numeric() == Numeric::Snorm && color.contains(&-1.0);
                if is_least || color.iter().any(|c| c.is_nan()) {
                    continue;
                }
                let mut color = color;
                if format.numeric() == Numeric::Srgb {
                    color[..3].iter_mut().for_each(|c| *c = crate::image::srgb_to_linear(*c));
                }
                let back = encode(format, ClearColor::Float(color));
                let back: &[u8] = &bytemuck::cast_slice(&back)[..texel];
                assert_eq!(back, bytes, "{format:?}: {color:?}");
            }
        }
    }
}
