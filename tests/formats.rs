//! Does a colour target of every format hold what shaders write to it, and does blending do there what it should?

mod images;

use crate::{
    colors,
    common::{gpu, on_each_gpu, random::Random},
    parity, targets, twin,
};
use std::sync::Arc;
use tilewright::{
    Error, classic, compute,
    format::{Format, Numeric, Packing},
    image::{Extent, Picture},
    pass::{Executor, Frame, Pass},
    shader::{Scalar, Shader, Stage},
    state::{Blend, ColorState, Cull, DepthState, LogicOp, Topology},
    target::{ClearColor, ColorTarget, LoadOp},
    vk::Gpu,
};

/// The formats of colour targets.
fn formats() -> impl Iterator<Item = Format> {
    Format::ALL.iter().copied().filter(|format| format.is_color())
}

/// A fragment shader that writes what targets of `format` hold, and more than that.
fn fragment(format: Format) -> Arc<Shader> {
    let (kind, value) = match Scalar::of(format) {
        Scalar::Float => ("vec4", "color * 1.5 - 0.25 + vec4(gl_FragCoord.xyx / 700.0, 0.0)"),
        Scalar::Uint => ("uvec4", "uvec4(gl_FragCoord.xyxy * vec4(3.0, 5.0, 500.0, 1e5))"),
        Scalar::Int => ("ivec4", "ivec4((gl_FragCoord.xyxy - 50.0) * vec4(3.0, 5.0, 500.0, 1e5))"),
    };
    let source = format!(
        "#version 450
        layout(location = 0) in vec4 color;
        layout(location = 0) out {kind} written;
        void main() {{ written = {value}; }}"
    );
    let shader = Shader::from_glsl(Stage::Fragment, "formats.frag", &source);
    Arc::new(shader.unwrap_or_else(|e| panic!("{e}")))
}

/// A colour that targets of `format` are cleared to.
fn clear(format: Format) -> ClearColor {
    match Scalar::of(format) {
        Scalar::Float => [0.25, 0.5, 0.75, 0.5].into(),
        Scalar::Uint => [1, 70_000, 3, 0x1234_5678u32].into(),
        Scalar::Int => [-1, 70_000, -70_000, 0x1234_5678].into(),
    }
}

/// Layers of triangles in a target of `format`, with a state.
fn pass(format: Format, state: ColorState, depth: DepthState, seed: u64) -> Pass {
    let template = (*twin::random_pass(0, &twin::shaders()).pipelines[0]).clone();
    let pipeline = template
        .fragment(fragment(format))
        .topology(Topology::TriangleList)
        .cull(Cull::None)
        .depth(depth)
        .colors([state]);
    let mut pass = parity::overlapping(&pipeline, Format::Rgba8Unorm, seed);
    pass.colors = vec![ColorTarget::cleared(format, clear(format))];
    pass
}

/// The distance of two neighbouring values of each channel near `value`.
fn steps(format: Format, value: [f32; 4]) -> [f32; 4] {
    let float = |bits: i32, value: f32| {
        let exponent = value.abs().max(2f32.powi(-14)).log2().floor() as i32;
        2f32.powi(exponent - bits)
    };
    match (format.numeric(), format.packing()) {
        (Numeric::Uint | Numeric::Sint | Numeric::Depth, _) => [0.0; 4],
        (Numeric::Float, Packing::Bits16) => value.map(|v| float(10, v)),
        (Numeric::Float, Packing::Rg11b10) => {
            [float(6, value[0]), float(6, value[1]), float(5, value[2]), 0.0]
        }
        (Numeric::Float, _) => value.map(|v| float(20, v)),
        (Numeric::Snorm, Packing::Bits8) => [1.0 / 127.0; 4],
        (Numeric::Snorm, _) => [1.0 / 32767.0; 4],
        (_, Packing::Bits16) => [1.0 / 65535.0; 4],
        (_, Packing::Rgb10a2) => [1.0 / 1023.0, 1.0 / 1023.0, 1.0 / 1023.0, 1.0 / 3.0],
        (_, Packing::R5g6b5) => [1.0 / 31.0, 1.0 / 63.0, 1.0 / 31.0, 0.0],
        (_, Packing::A1r5g5b5) => [1.0 / 31.0, 1.0 / 31.0, 1.0 / 31.0, 1.0],
        _ => [1.0 / 255.0; 4],
    }
}

/// The first colours of two pictures of which a channel differs by more than `most` steps of the format, or than the
/// executors' interpolation.
fn difference(a: &Picture, b: &Picture, most: f32) -> Option<[[f32; 4]; 2]> {
    assert_eq!((a.extent, a.format), (b.extent, b.format));
    let format = a.format;
    let far = |a: f32, b: f32, step: f32| {
        let is_equal = a == b || a.is_nan() && b.is_nan();
        !is_equal && (a.is_nan() || b.is_nan() || (a - b).abs() > most * step * 1.01 + 5e-5)
    };
    let far = |[a, b]: &[[f32; 4]; 2]| {
        let steps = steps(format, *a);
        (0..4).any(|n| far(a[n], b[n], steps[n]))
    };
    a.values().zip(b.values()).map(|(a, b)| [a, b]).find(far)
}

/// By the device's own pipeline: opaque work, work that writes some channels, and work that blends.
#[test]
fn every_format_holds_what_the_device_writes() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    let (mut compared, mut lacking) = (0, Vec::new());
    for (seed, format) in (9300..).zip(formats()) {
        let mut random = Random::new(seed);
        for kind in 0..5 {
            let state = match kind {
                0 => ColorState::OVERWRITE,
                1 => ColorState::OVERWRITE.write([(); 4].map(|()| random.below(2) == 0)),
                _ if format.is_integer() => continue,
                _ => colors::state(&mut random, true),
            };
            let depth = [DepthState::OFF, DepthState::LESS][random.below(2)];
            let pass = pass(format, state, depth, seed);
            let a = compute.render(&pass).unwrap();
            let b = match classic.render(&pass) {
                Ok(b) => b,
                Err(Error::Device(fault)) => {
                    lacking.push((format, kind, fault));
                    continue;
                }
                Err(fault) => panic!("{fault}"),
            };
            // Each layer of blending may be rounded to another side.
            let most = if state.blend.is_some() { 4.0 } else { 1.0 };
            let differs = difference(&a.colors[0], &b.colors[0], most);
            assert!(differs.is_none(), "{format:?}, seed {seed}, {state:?}: {differs:?}");
            compared += 1;
        }
    }
    // Lavapipe draws to all of these formats; it blends in none that is signed and normalized.
    let known = |(format, kind, _): &&(Format, i32, String)| {
        format.numeric() == Numeric::Snorm && *kind > 1
    };
    assert!(lacking.iter().all(|one| known(&one)), "{lacking:?}");
    assert!(compared > 140, "{compared} comparisons");
}

/// Every logic operation in targets that take it and in those that do not, to the bit by both executors: the shader writes
/// numbers that every format holds exactly.
#[test]
fn logic_operations_are_the_devices_own() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    for (n, format) in formats().enumerate() {
        let (kind, value) = match (format.numeric(), format.packing()) {
            (Numeric::Uint, _) => ("uvec4", "n"),
            (Numeric::Sint, _) => ("ivec4", "ivec4(n) - 64"),
            // 0 and 1 alone are exact in all of them.
            (_, Packing::Bits8 | Packing::Bgra8) if format.numeric() == Numeric::Unorm => {
                ("vec4", "vec4(n * 2) / 255.0")
            }
            _ => ("vec4", "vec4(n & 1)"),
        };
        let source = format!(
            "#version 450
            layout(location = 0) out {kind} written;
            void main() {{
                uvec4 n = uvec4(ivec4(gl_FragCoord.xyxy) * ivec4(1, 3, 5, 7) + ivec4(gl_FragCoord.z * 1e4)) & 127u;
                written = {value};
            }}"
        );
        let shader = Arc::new(Shader::from_glsl(Stage::Fragment, "logic.frag", &source).unwrap());
        for &op in LogicOp::ALL {
            // Blending counts for nothing.
            let blend = (!format.is_integer()).then_some(Blend::ALPHA);
            let write = [true, !(op as usize + n).is_multiple_of(3), true, true];
            let state = ColorState::OVERWRITE.blend(blend).write(write);
            let mut pass = pass(format, state, DepthState::OFF, 9600);
            let pipeline = (*pass.pipelines[0]).clone();
            pass.pipelines = vec![Arc::new(pipeline.fragment(shader.clone()).logic_op(op))];
            let ours = compute.render(&pass).unwrap();
            let theirs = match classic.render(&pass) {
                Err(Error::Device(_)) if format.numeric() == Numeric::Snorm => continue,
                theirs => theirs.unwrap(),
            };
            // Lavapipe takes the bits of this format for others.
            if format == Format::Rgb10a2Uint {
                continue;
            }
            let wrong =
                ours.colors[0].values().zip(theirs.colors[0].values()).find(|(a, b)| a != b);
            assert!(wrong.is_none(), "{format:?}, {op:?}, {write:?}: {wrong:?}");
        }
    }
}

/// Draws `pass`, whose colour target is of `format`, in three ways, between which it makes no difference where the target
/// lives and in how many passes it is drawn.
fn wherever(gpu: &Gpu, renderer: &mut compute::Renderer, pass: &Pass) -> Frame {
    let whole = renderer.render(pass).unwrap();
    let format = pass.colors[0].format;
    let what = |how: &str| format!("{}, {format:?}, {how}", gpu.info());
    let image = targets::target(gpu, "formats", pass.extent, format);
    let mut in_image = pass.clone();
    in_image.colors[0].image = Some(image.clone());
    let drawn = renderer.render(&in_image).unwrap();
    assert!(whole.colors == drawn.colors, "{}", what("in an image"));
    // In two passes, of which the second begins with what the first one left.
    let middle = pass.draws.len() / 2;
    for loads in [true, false] {
        let (mut first, mut second) = (in_image.clone(), in_image.clone());
        (first.draws, second.draws) =
            (pass.draws[..middle].to_vec(), pass.draws[middle..].to_vec());
        let begun = renderer.render(&first).unwrap();
        second.colors[0].load = LoadOp::Load;
        if !loads {
            second.colors[0].image = None;
            second.colors[0].load = LoadOp::Picture(Arc::new(begun.colors[0].clone()));
        }
        let depth = second.depth.as_mut().unwrap();
        depth.load = LoadOp::Picture(Arc::new(begun.depth.unwrap()));
        let both = renderer.render(&second).unwrap();
        assert!(whole.colors == both.colors, "{}", what("in two passes"));
    }
    whole
}

#[test]
fn every_format_holds_the_same_wherever_it_is() {
    on_each_gpu("every format holds the same wherever it is", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for (seed, format) in (9400..).zip(formats()) {
            let mut random = Random::new(seed);
            let state = match format.is_integer() {
                true => ColorState::OVERWRITE.write([(); 4].map(|()| random.below(3) > 0)),
                false => colors::state(&mut random, false),
            };
            let mut pass = pass(format, state, DepthState::LESS, seed);
            let draw = pass.draws[0].clone();
            let half = draw.count / 6 * 3;
            let (mut first, mut second) = (draw.clone(), draw);
            (first.count, second.first, second.count) = (half, half, second.count - half);
            pass.draws = vec![first, second];
            wherever(gpu, &mut renderer, &pass);
        }
    });
}

/// Texels of one and of two bytes in images of several bands, with an odd number of pixels a row.
#[test]
fn narrow_texels_are_in_their_place_in_large_images() {
    let gpu = gpu();
    let extent = Extent::new(4097, 2101);
    for format in [Format::R8Uint, Format::R16Uint] {
        let image = targets::target(&gpu, "large", extent, format);
        let mask = if format == Format::R8Uint { 0xff } else { 0xffff };
        let fragment = "#version 450
            layout(location = 0) out uint written;
            void main() {
                uvec2 p = uvec2(gl_FragCoord.xy);
                if ((p.x ^ p.y) % 7u == 0u) discard;
                written = (p.x * 7u + p.y * 13u) & MASK;
            }"
        .replace("MASK", &format!("{mask}u"));
        let color = ColorTarget::on_device(&image, LoadOp::clear([3u32, 0, 0, 0]));
        let mut pass = targets::whole(extent, color, &fragment);
        let mut renderer = compute::Renderer::new(&gpu).unwrap();
        for _ in 0..2 {
            let drawn = renderer.render(&pass).unwrap();
            let texel = format.texel_bytes();
            for (n, found) in drawn.colors[0].bytes.chunks_exact(texel).enumerate() {
                let (x, y) = (n % 4097, n / 4097);
                let wanted = if (x ^ y) % 7 == 0 { 3 } else { (x * 7 + y * 13) & mask };
                let found = found.iter().rev().fold(0, |all, byte| all << 8 | usize::from(*byte));
                assert_eq!(found, wanted, "{format:?} at {x}, {y}");
            }
            // Again over what is there.
            pass.colors[0].load = LoadOp::Load;
        }
    }
}

#[test]
fn what_a_format_does_not_hold_is_refused() {
    let gpu = gpu();
    let mut renderer = compute::Renderer::new(&gpu).unwrap();
    let mut refused = |pass: &Pass, texts: &[&str]| {
        let error = renderer.render(pass).unwrap_err();
        assert!(matches!(error, Error::Usage(_)), "{error:?}");
        assert!(texts.iter().all(|text| error.to_string().contains(text)), "{error}");
    };
    let plain = |format| pass(format, ColorState::OVERWRITE, DepthState::OFF, 1);
    let mut wrong = plain(Format::R32Uint);
    wrong.colors[0].load = LoadOp::clear([0.0; 4]);
    refused(&wrong, &["R32Uint", "cleared", "Float"]);
    let mut wrong = plain(Format::R32Uint);
    wrong.colors = vec![ColorTarget::cleared(Format::R32Sint, [0i32; 4])];
    refused(&wrong, &["`formats.frag` writes uint", "location 0", "R32Sint", "int"]);
    let mut wrong = plain(Format::Rgba8Unorm);
    wrong.colors = vec![ColorTarget::cleared(Format::Rgba8Uint, [0u32; 4])];
    refused(&wrong, &["writes float", "Rgba8Uint", "uint"]);
    let wrong =
        pass(Format::Rgba8Sint, ColorState::OVERWRITE.blend(Blend::ALPHA), DepthState::OFF, 1);
    refused(&wrong, &["blends in colour target 0", "Rgba8Sint", "integers are not blended"]);
    let mut wrong = plain(Format::Rgba8Unorm);
    wrong.colors = vec![ColorTarget::cleared(Format::D32Float, [0.0; 4])];
    refused(&wrong, &["D32Float is no format of a colour target"]);
}

/// Finite colours stay finite in a format whose greatest numbers they exceed.
#[test]
fn large_colours_stay_finite_where_the_format_has_no_sign() {
    let gpu = gpu();
    let fragment = "#version 450
        layout(location = 0) out vec4 written;
        void main() {
            float large = gl_FragCoord.x < 2.0 ? 1e9 : 65200.0;
            written = vec4(large, gl_FragCoord.y < 1.0 ? 1.0 / 0.0 : 65400.0, large, 1.0);
        }";
    let color = ColorTarget::cleared(Format::Rg11b10Ufloat, [1e9, 70_000.0, 65_535.0, 1.0]);
    let mut pass = targets::whole(Extent::new(4, 2), color, fragment);
    for draws in [1, 0] {
        pass.draws.truncate(draws);
        let ours = compute::Renderer::new(&gpu).unwrap().render(&pass).unwrap();
        let theirs = classic::Renderer::new(&gpu).unwrap().render(&pass).unwrap();
        let [ours, theirs] = [&ours, &theirs].map(|frame| frame.colors[0].values());
        assert_eq!(ours.collect::<Vec<_>>(), theirs.collect::<Vec<_>>());
    }
}
