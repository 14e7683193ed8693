//! Are the colours of targets encoded, decoded and blended as the host does it?

use super::{ANY_COLOR, CASES, constants, probe};
use crate::common::{on_each_gpu, random::Random};
use tilewright::{
    abi,
    format::{Format, Numeric},
    image::{Extent, Picture, linear_to_srgb},
    shader::Scalar,
    target::ClearColor,
};

/// The steps by which kernels know of the colours of `format`: all kernels of any format, and some for common ones.
fn color_steps(format: Format) -> Vec<&'static [&'static str]> {
    let is_common = [
        Format::Rgba8Unorm,
        Format::Rgba8Srgb,
        Format::Bgra8Unorm,
        Format::Bgra8Srgb,
        Format::Rgba16Float,
    ]
    .contains(&format);
    let common = is_common.then_some(&ANY_COLOR[..2]);
    common.into_iter().chain([&ANY_COLOR[..]]).collect()
}

#[test]
fn srgb_is_what_the_standard_says() {
    on_each_gpu("sRGB", |gpu| {
        let mut random = Random::new(5);
        let includes = ["lib/small_float.glsl", "lib/color.glsl"];
        let lights: Vec<[f32; 4]> = (0..CASES)
            .map(|i| match i {
                0 => [0.0; 4],
                1 => [1.0, 0.0031308, 0.0031309, 1.0],
                _ => std::array::from_fn(|_| 2f32.powf(-12.0 * random.unit())),
            })
            .collect();
        let body = "r.xyz = floatBitsToUint(srgb_encode(uintBitsToFloat(v.rgb)));";
        let encoded: Vec<[f32; 4]> = probe(gpu, &includes, body, &lights);
        for (light, encoded) in lights.iter().zip(&encoded) {
            for (light, encoded) in light.iter().zip(&encoded[..3]) {
                let error = 255.0 * (encoded - linear_to_srgb(*light)).abs();
                assert!(error < 0.004, "{light} is {encoded}, wrong by {error} of 255");
            }
        }
        let codes: Vec<[u32; 4]> = (0..256).map(|code| [code * 0x01_01_01, 0, 0, 0]).collect();
        let body = "uvec4 c = floatBitsToUint(color_decode(FORMAT_RGBA8_SRGB, v));
            r = uvec4(c.r, color_encode(FORMAT_RGBA8_SRGB, c).x, 0u, 0u);";
        let decoded: Vec<[u32; 4]> = probe(gpu, &includes, body, &codes);
        for ([code, ..], [light, back, ..]) in codes.iter().zip(decoded) {
            assert_eq!(*code, back, "decoded and encoded again");
            let error = 255.0 * linear_to_srgb(f32::from_bits(light)) - (code & 0xff) as f32;
            assert!(error.abs() < 0.014, "{code:#x} decodes to a light wrong by {error} of 255");
        }
    });
}

/// The macro of a format: `FORMAT_RGBA8_UNORM`.
fn macro_of(format: Format) -> String {
    let known = Format::NUMBERS.iter().find(|(_, number)| *number == format as u32).unwrap();
    constants::macro_name(known.0)
}

#[test]
fn texels_are_encoded_as_the_host_encodes_clears() {
    on_each_gpu("texels", |gpu| {
        let mut random = Random::new(6);
        let colors: Vec<[f32; 4]> = (0..CASES)
            .map(|i| match i {
                0..256 => [(i as f32 + 0.5) / 255.0; 4],
                256..267 => [(i - 256) as f32 / 10.0; 4],
                267 => [f32::NAN, -1.0, 2.0, 1e-30],
                268 => [f32::INFINITY, f32::NEG_INFINITY, -f32::NAN, -0.0],
                // Ties, and what is nearer to infinity than to the greatest float.
                269 => [1.0 + 2f32.powi(-11), 1.0 + 2f32.powi(-7), 65519.0, 65520.0],
                270 => [65535.0, 1e9, 1.0 + 2f32.powi(-6), -7e4],
                271..400 => std::array::from_fn(|_| 2f32.powf(18.0 - 40.0 * random.unit())),
                400..2000 => std::array::from_fn(|_| 1.5 * random.signed()),
                _ => std::array::from_fn(|_| 2f32.powf(-12.0 * random.unit())),
            })
            .collect();
        let integers: Vec<[u32; 4]> = (0..CASES)
            .map(|i| {
                let c: [u32; 4] = std::array::from_fn(|_| random.bits() as u32 >> (i % 32));
                if i % 2 == 0 { c.map(|c| !c) } else { c }
            })
            .collect();
        for &format in Format::ALL.iter().filter(|format| format.is_color()) {
            let body = format!("r = color_encode({}, v);", macro_of(format));
            let inputs: Vec<[u32; 4]> = match format.is_integer() {
                true => integers.clone(),
                false => colors.iter().map(|c| c.map(f32::to_bits)).collect(),
            };
            let texels = color_steps(format)
                .into_iter()
                .flat_map(|steps| probe::<_, [u32; 4]>(gpu, steps, &body, &inputs));
            for (input, texel) in inputs.iter().cycle().zip(texels) {
                let color = match Scalar::of(format) {
                    Scalar::Float => ClearColor::Float(input.map(f32::from_bits)),
                    Scalar::Uint => ClearColor::Uint(*input),
                    Scalar::Int => ClearColor::Sint(input.map(|c| c as i32)),
                };
                let host = Picture::filled(Extent::new(1, 1), format, color);
                let device = &bytemuck::cast_slice(&texel)[..format.texel_bytes()];
                let is_equal = match format.numeric() {
                    // Of 32-bit floats, nobody says which not-a-number they are.
                    Numeric::Float => {
                        let device =
                            Picture { extent: host.extent, format, bytes: device.to_vec() };
                        let both = host.values().zip(device.values());
                        let equal = |(a, b): (f32, f32)| {
                            a.to_bits() == b.to_bits() || a.is_nan() && b.is_nan()
                        };
                        both.into_iter().all(|(a, b)| a.into_iter().zip(b).all(equal))
                    }
                    _ => host.bytes == device,
                };
                assert!(
                    is_equal,
                    "{color:?} in {format:?}: {device:x?} is not {host:x?} {:x?}",
                    host.bytes
                );
            }
        }
    });
}

#[test]
fn what_is_encoded_stays_when_it_is_decoded_and_encoded_again() {
    on_each_gpu("texels there and back", |gpu| {
        // Blending leaves pixels alone to which a transparent fragment adds nothing.
        let mut random = Random::new(7);
        let texels: Vec<[u32; 4]> = (0..CASES as u32)
            .map(|v| match v {
                0..256 => [v * 0x0101_0101; 4],
                _ => std::array::from_fn(|_| random.bits() as u32),
            })
            .collect();
        for &format in Format::ALL.iter().filter(|f| !f.is_depth() && !f.is_integer()) {
            let name = macro_of(format);
            let body = format!("r = floatBitsToUint(color_decode({name}, v));");
            let steps = || color_steps(format).into_iter();
            let colors = steps().flat_map(|steps| probe::<_, [f32; 4]>(gpu, steps, &body, &texels));
            let body =
                format!("r = color_encode({name}, floatBitsToUint(color_decode({name}, v)));");
            let back = steps().flat_map(|steps| probe::<_, [u32; 4]>(gpu, steps, &body, &texels));
            for ((texel, color), back) in texels.iter().cycle().zip(colors).zip(back) {
                let bytes = |words: &[u32; 4]| -> Vec<u8> {
                    bytemuck::cast_slice(words)[..format.texel_bytes()].to_vec()
                };
                let picture = Picture { extent: Extent::new(1, 1), format, bytes: bytes(texel) };
                let host = picture.values().next().unwrap();
                let missing = format.channels().max(3);
                for (n, (host, device)) in host.iter().zip(color).enumerate() {
                    let counts = n < format.channels() || n >= missing;
                    // The host does not decode sRGB. A product with a reciprocal may be off by one in the last place.
                    let near = (host - device).abs() <= f32::EPSILON * 0.5 || *host == device;
                    let srgb = format.numeric() == Numeric::Srgb && n < 3;
                    let nan = host.is_nan() && device.is_nan();
                    assert!(
                        !counts || near || srgb || nan,
                        "{format:?} {texel:x?}: {device}, not {host}"
                    );
                }
                // The least number of a signed format means the same as the next one. No format keeps which
                // not-a-number it is.
                let is_least = format.numeric() == Numeric::Snorm && host.contains(&-1.0);
                if !is_least && !host.iter().any(|c| c.is_nan()) {
                    assert_eq!(bytes(&back), bytes(texel), "{format:?}: {host:?}");
                }
            }
        }
    });
}

#[test]
fn transparent_fragments_leave_texels_alone() {
    on_each_gpu("transparent fragments", |gpu| {
        let mut random = Random::new(10);
        // A texel, both equations, and a source of three half floats, any bits.
        let inputs: Vec<[u32; 4]> = (0..CASES)
            .map(|i| {
                let mut equation = || {
                    // One or source alpha, and one or one minus that, are among those that keep texels.
                    let [src, dst, op] = match random.below(2) {
                        0 => [[6, 1, 0], [6, 7, 0], [1, 7, 0], [1, 1, 0]][random.below(4)],
                        _ => [random.below(15), random.below(15), random.below(5)],
                    };
                    src as u32
                        | (dst as u32) << abi::BLEND_TARGET_SHIFT
                        | (op as u32) << abi::BLEND_OP_SHIFT
                };
                let equations = equation() | equation() << abi::COLOR_ALPHA_SHIFT;
                let texel = (i as u32 % 256) * 0x0101_0101;
                [texel, equations, random.bits() as u32, random.bits() as u32]
            })
            .collect();
        let body = "uint c = v.y & ((1u << BLEND_BITS) - 1u), a = v.y >> COLOR_ALPHA_SHIFT;
            vec4 constants = vec4(0.25, 0.5, 0.75, 0.125);
            vec4 source = saturate(vec4(unpackHalf2x16(v.z), unpackHalf2x16(v.w).x, -0.0));
            r = uvec4(v.x, v.x, blend_keeps(c, a) ? 1u : 0u, 0u);
            if (r.z != 0u) {
                vec4 unorm = blend(c, a, source, color_decode(FORMAT_RGBA8_UNORM, v.xxxx), constants, vec4(0.0), false);
                vec4 srgb = blend(c, a, source, color_decode(FORMAT_RGBA8_SRGB, v.xxxx), constants, vec4(0.0), false);
                r.x = color_encode(FORMAT_RGBA8_UNORM, floatBitsToUint(unorm)).x;
                r.y = color_encode(FORMAT_RGBA8_SRGB, floatBitsToUint(srgb)).x;
            }";
        let steps = ["lib/small_float.glsl", "lib/color.glsl", "lib/blend.glsl"];
        let outputs: Vec<[u32; 4]> = probe(gpu, &steps, body, &inputs);
        let mut kept = 0;
        for ([texel, equations, ..], [unorm, srgb, keeps, _]) in inputs.iter().zip(outputs) {
            assert_eq!([unorm, srgb], [*texel; 2], "{texel:x} by {equations:x}");
            kept += keeps;
        }
        assert!(kept > 1000, "{kept} cases test nothing");
    });
}
