//! Does each of several colour targets hold what the shader writes to it, by its own state?

use crate::{
    common::{gpu, on_each_gpu, random::Random},
    parity, targets, twin,
};
use std::sync::Arc;
use tilewright::{
    Error, classic, compute,
    format::{Format, Packing},
    image::{Extent, Picture, half_to_f32},
    pass::{Draw, Executor, Pass},
    shader::{Shader, Stage},
    state::{Blend, BlendEquation, ColorState, Compare, Cull, DepthState, Topology},
    target::{ColorTarget, DepthTarget, LoadOp, StoreOp},
    vk::Gpu,
};

/// Those that kernels have variants for, which all drivers compile in little time.
const FORMATS: [Format; 5] = [
    Format::Rgba8Unorm,
    Format::Rgba8Srgb,
    Format::Rgba16Float,
    Format::Bgra8Unorm,
    Format::Bgra8Srgb,
];

/// The value of output `n`, whose inputs are `color` and `gl_FragCoord`.
fn value(n: usize) -> String {
    let turned = ["rgba", "gbra", "brga", "bgra"][n % 4];
    format!("vec4(color.{turned}) * {}.0 / 8.0 + vec4(gl_FragCoord.xyx / 400.0, 0.0)", 8 - n / 2)
}

/// A fragment shader that writes the values of `outputs`, by location.
fn fragment(outputs: &[usize]) -> Arc<Shader> {
    let declared = |(location, _): (usize, &usize)| {
        format!("layout(location = {location}) out vec4 out{location};\n")
    };
    let written = |(location, n): (usize, &usize)| format!("    out{location} = {};\n", value(*n));
    let all = || outputs.iter().enumerate();
    let (declared, written): (String, String) =
        (all().map(declared).collect(), all().map(written).collect());
    let source = format!(
        "#version 450\nlayout(location = 0) in vec4 color;\n{declared}void main() {{\n{written}}}\n"
    );
    let shader = Shader::from_glsl(Stage::Fragment, "colors.frag", &source);
    Arc::new(shader.unwrap_or_else(|e| panic!("{e}")))
}

/// Any state. If it is `tame`, no layer makes an error of the layers below it larger: the two executors may round each one
/// differently.
pub fn state(random: &mut Random, tame: bool) -> ColorState {
    let (factors, ops) = (parity::FACTORS, parity::OPS);
    let mut equation = || {
        let mut any = |n| random.below(n);
        match tame {
            true => BlendEquation {
                src: factors[[0, 1, 2, 3, 6, 7][any(6)]],
                dst: factors[[0, 1, 2, 3, 6, 7][any(6)]],
                op: ops[[0, 3, 4][any(3)]],
            },
            false => BlendEquation {
                src: factors[any(factors.len())],
                dst: factors[any(factors.len())],
                op: ops[any(5)],
            },
        }
    };
    let (color, alpha) = (equation(), equation());
    let state = match random.below(3) {
        0 => ColorState::OVERWRITE.blend(Blend { color, alpha }),
        1 => ColorState::OVERWRITE.blend(Blend::ALPHA),
        _ => ColorState::OVERWRITE,
    };
    match random.below(3) {
        0 => state.write([(); 4].map(|()| random.below(2) == 0)),
        1 if random.below(3) == 0 => state.write([false; 4]),
        _ => state,
    }
}

/// `pass` with the state of target `n` for its target 0, which alone it has, and with output `n` written to it.
fn alone(pass: &Pass, n: usize) -> Pass {
    let shader = fragment(&[n]);
    let mut pass = pass.clone();
    pass.colors = vec![pass.colors[n].clone()];
    for pipeline in &mut pass.pipelines {
        let state = pipeline.color_state(n);
        *pipeline = Arc::new((**pipeline).clone().fragment(shader.clone()).colors([state]));
    }
    pass
}

/// A random pass of 1 to 8 targets of these formats, of any states.
fn random_pass(gpu: &Gpu, seed: u64, vertex: &Arc<Shader>, formats: &[Format]) -> Pass {
    let mut random = Random::new(seed);
    let count = 1 + random.below(8);
    let shader = fragment(&(0..count).collect::<Vec<_>>());
    let mut pass = twin::random_pass(seed, &(vertex.clone(), shader));
    let extent = pass.extent;
    let color = |random: &mut Random| [(); 4].map(|()| random.below(5) as f32 / 4.0);
    let targets = (0..count).map(|n| {
        let (format, clear) =
            (formats[random.below(formats.len())], LoadOp::clear(color(&mut random)));
        match random.below(3) {
            0 => {
                let image = targets::target(gpu, &format!("target {n}"), extent, format);
                ColorTarget::on_device(&image, clear)
            }
            _ => ColorTarget::cleared(format, color(&mut random)),
        }
    });
    pass.colors = targets.collect();
    for pipeline in &mut pass.pipelines {
        // Some lists are shorter than the targets.
        let states = 1 + random.below(count);
        let states: Vec<_> = match random.below(3) {
            0 => vec![ColorState::OVERWRITE],
            1 => vec![ColorState::OVERWRITE.write([false; 4])],
            _ => (0..states).map(|_| state(&mut random, false)).collect(),
        };
        *pipeline = Arc::new((**pipeline).clone().colors(states));
    }
    pass
}

/// Opaque work, work that writes depth alone, and ordered work in one pass: each target holds what a pass with this
/// target alone draws, whose batches are others.
#[test]
fn a_target_among_others_is_the_target_alone() {
    on_each_gpu("a target among others is the target alone", |gpu| {
        let (vertex, _) = twin::shaders();
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for seed in 8800..8816 {
            compare_with_alone(&mut renderer, &random_pass(gpu, seed, &vertex, &FORMATS), seed);
        }
    });
}

/// The same with formats of all kinds, for which the kernels are others. SwiftShader takes ten seconds for each of them.
#[test]
fn a_target_of_any_format_among_others_is_the_target_alone() {
    let gpu = gpu();
    let all = Format::ALL.iter().copied();
    let formats: Vec<_> = all.filter(|f| !f.is_depth() && !f.is_integer()).collect();
    let (vertex, _) = twin::shaders();
    let mut renderer = compute::Renderer::new(&gpu).unwrap();
    for seed in 8850..8860 {
        compare_with_alone(&mut renderer, &random_pass(&gpu, seed, &vertex, &formats), seed);
    }
}

fn compare_with_alone(renderer: &mut compute::Renderer, pass: &Pass, seed: u64) {
    let all = renderer.render(pass).unwrap();
    assert_eq!(all.colors.len(), pass.colors.len());
    for (n, color) in all.colors.iter().enumerate() {
        let alone = renderer.render(&alone(pass, n)).unwrap();
        let what = format!("{}, seed {seed}, target {n}", renderer.gpu().info());
        assert!(*color == alone.colors[0], "{what}: {:?}", pass.colors[n].format);
        assert!(all.depth == alone.depth, "{what}: depth");
    }
}

/// Two texels that differ by more than layers of blending may be rounded apart: by two steps of 8 bits (lavapipe
/// approximates sRGB). Of halves, each layer may round the last place, and they may be large.
pub fn difference(a: &Picture, b: &Picture) -> Option<(f32, f32)> {
    let halves = |picture: &Picture| -> Vec<f32> {
        let halves = picture.bytes.chunks(2);
        halves.map(|h| half_to_f32(u16::from_le_bytes([h[0], h[1]]))).collect()
    };
    let bytes = |picture: &Picture| picture.bytes.iter().map(|b| f32::from(*b)).collect();
    let format_is_8_bit = a.format != Format::Rgba16Float;
    let [a, b]: [Vec<f32>; 2] = match a.format {
        Format::Rgba16Float => [halves(a), halves(b)],
        _ => [bytes(a), bytes(b)],
    };
    let allowed = |x: f32, y: f32| match format_is_8_bit {
        true => 2.0,
        false => x.abs().max(y.abs()).max(2.0) / 256.0,
    };
    let far = |(x, y): &(f32, f32)| {
        x != y && (x.is_nan() || y.is_nan() || (x - y).abs() > allowed(*x, *y))
    };
    a.iter().copied().zip(b.iter().copied()).find(far)
}

/// By the device's own pipeline.
#[test]
fn several_targets_are_the_devices_own() {
    let gpu = gpu();
    let template = (*twin::random_pass(0, &twin::shaders()).pipelines[0]).clone();
    for seed in 0..24 {
        let mut random = Random::new(8900 + seed);
        let count = 2 + random.below(7);
        let depth = [DepthState::OFF, DepthState::LESS][random.below(2)];
        let pipeline = template
            .clone()
            .fragment(fragment(&(0..count).collect::<Vec<_>>()))
            .topology(Topology::TriangleList)
            .cull(Cull::None)
            .depth(depth)
            .colors((0..count).map(|_| state(&mut random, true)).collect::<Vec<_>>());
        let mut pass = parity::overlapping(&pipeline, Format::Rgba8Unorm, seed);
        // Lavapipe blends targets of 8 bits in 8 bits, layer by layer.
        let format = |n| match pipeline.color_state(n).blend {
            Some(_) => Format::Rgba16Float,
            None => FORMATS[n % 3],
        };
        pass.colors =
            (0..count).map(|n| ColorTarget::cleared(format(n), [0.25, 0.5, 0.75, 0.5])).collect();
        let [a, b] = [
            compute::Renderer::new(&gpu).unwrap().render(&pass).unwrap(),
            classic::Renderer::new(&gpu).unwrap().render(&pass).unwrap(),
        ];
        for (n, (a, b)) in a.colors.iter().zip(&b.colors).enumerate() {
            let differs = difference(a, b);
            assert!(differs.is_none(), "seed {seed}, target {n}, {:?}: {differs:?}", a.format);
        }
    }
}

/// A pass of one triangle over everything, at the pushed depth.
fn whole(extent: Extent, fragment: &str, colors: Vec<ColorTarget>) -> Pass {
    let mut pass = targets::whole(extent, colors[0].clone(), fragment);
    pass.colors = colors;
    pass
}

/// Channels that are not written keep their bytes, also where no colour has such bytes.
#[test]
fn channels_that_are_not_written_keep_their_bytes() {
    on_each_gpu("channels that are not written keep their bytes", |gpu| {
        let extent = Extent::new(37, 21);
        let mut random = Random::new(5);
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for format in FORMATS {
            for mask in 0..16u32 {
                let image = targets::target(gpu, "color", extent, format);
                let bytes: Vec<u8> = (0..extent.pixels() * format.texel_bytes())
                    .map(|_| random.bits() as u8)
                    .collect();
                image.upload(&[&bytes]).unwrap();
                let colors = vec![ColorTarget::on_device(&image, LoadOp::Load)];
                let shader = "#version 450
layout(location = 0) out vec4 color;
void main() { color = vec4(0.25, 0.5, 0.75, 1.0); }";
                let mut pass = whole(extent, shader, colors);
                let on: [bool; 4] = std::array::from_fn(|channel| mask >> channel & 1 != 0);
                let state = ColorState::OVERWRITE.write(on);
                pass.pipelines[0] = Arc::new((*pass.pipelines[0]).clone().colors([state]));
                let drawn = renderer.render(&pass).unwrap();
                let texel = format.texel_bytes();
                let all = drawn.colors[0].bytes.chunks(texel).zip(bytes.chunks(texel));
                let full: Vec<u8> = match format {
                    Format::Rgba8Unorm => vec![64, 128, 191, 255],
                    Format::Rgba8Srgb => vec![137, 188, 225, 255],
                    Format::Bgra8Unorm => vec![191, 128, 64, 255],
                    Format::Bgra8Srgb => vec![225, 188, 137, 255],
                    _ => [0x3400u16, 0x3800, 0x3a00, 0x3c00]
                        .iter()
                        .flat_map(|h| h.to_le_bytes())
                        .collect(),
                };
                for (found, before) in all {
                    for channel in 0..4 {
                        let place = match format.packing() {
                            Packing::Bgra8 => [2, 1, 0, 3][channel],
                            _ => channel,
                        };
                        let part = texel / 4 * place..texel / 4 * (place + 1);
                        let expected = if on[channel] { &full } else { before };
                        assert_eq!(found[part.clone()], expected[part], "{format:?}, {on:?}");
                    }
                }
            }
        }
    });
}

/// A pass of depth alone before the picture, in one pass: work that writes no colour shows nothing and hides.
#[test]
fn draws_that_write_no_colour_hide() {
    on_each_gpu("draws that write no colour hide", |gpu| {
        let extent = Extent::new(64, 48);
        let shader = "#version 450
layout(location = 0) out vec4 color;
layout(location = 1) out vec4 other;
void main() { color = vec4(1.0, 0.0, 0.0, 1.0); other = vec4(0.0, 1.0, 0.0, 1.0); }";
        let colors = vec![
            ColorTarget::cleared(Format::Rgba8Unorm, [0.0, 0.0, 1.0, 1.0]),
            ColorTarget::cleared(Format::Rgba16Float, [0.0, 0.0, 1.0, 1.0]),
        ];
        let mut pass = whole(extent, shader, colors).depth(DepthTarget::cleared(1.0));
        let less = (*pass.pipelines[0]).clone().depth(DepthState::new(Compare::Less));
        let none = less.clone().colors([ColorState::OVERWRITE.write([false; 4])]);
        pass.pipelines = vec![Arc::new(less), Arc::new(none)];
        let draw = |pipeline, depth: f32| Draw::new(0, 3).pipeline(pipeline).push(&depth);
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for (draws, shown, depth) in [
            // Hidden by depth that was written before; in front of it; and drawn before something hides nothing of it.
            (vec![draw(1, 0.25), draw(0, 0.5)], false, 0.25),
            (vec![draw(1, 0.5), draw(0, 0.25)], true, 0.25),
            (vec![draw(0, 0.5), draw(1, 0.25)], true, 0.25),
            (vec![draw(1, 0.5)], false, 0.5),
        ] {
            pass.draws = draws;
            let frame = renderer.render(&pass).unwrap();
            let expected = if shown { [255, 0, 0, 255] } else { [0, 0, 255, 255] };
            assert!(frame.colors[0].bytes.chunks(4).all(|texel| texel == expected));
            let first = &frame.colors[1].bytes[..8];
            let green = [0, 0, 0, 0x3c, 0, 0, 0, 0x3c];
            assert_eq!(first == green, shown, "{first:?}");
            assert!(frame.depth.unwrap().depths().iter().all(|d| *d == depth));
        }
    });
}

/// Targets of so many bytes that they take bands of their own, and of pixels whose number is odd.
#[test]
fn bands_are_cut_by_the_bytes_of_all_targets() {
    let gpu = gpu();
    let extent = Extent::new(4097, 701);
    let shader = format!(
        "#version 450\n{}void main() {{\n{}}}",
        (0..8).map(|n| format!("layout(location = {n}) out vec4 out{n};\n")).collect::<String>(),
        (0..8)
            .map(|n| format!(
                "    out{n} = vec4(mod(gl_FragCoord.xy, 256.0) / 255.0, {n}.0 / 8.0, 1.0);\n"
            ))
            .collect::<String>(),
    );
    let colors: Vec<_> = (0..8)
        .map(|n| {
            let format = if n % 3 == 1 { Format::Rgba8Unorm } else { Format::Rgba16Float };
            let store = if n == 2 { StoreOp::Discard } else { StoreOp::Store };
            ColorTarget::cleared(format, [0.0; 4]).store(store)
        })
        .collect();
    let pass = whole(extent, &shader, colors);
    let drawn = compute::Renderer::new(&gpu).unwrap().render(&pass).unwrap();
    let classic = classic::Renderer::new(&gpu).unwrap().render(&pass).unwrap();
    assert_eq!((drawn.colors.len(), classic.colors.len()), (7, 7));
    for (n, (drawn, classic)) in drawn.colors.iter().zip(&classic.colors).enumerate() {
        let near = |(a, b): (&[u8], &[u8])| {
            let word = |bytes: &[u8]| u16::from_le_bytes([bytes[0], bytes[1]]);
            match drawn.format {
                Format::Rgba16Float => word(a).abs_diff(word(b)) <= 1,
                _ => a[0].abs_diff(b[0]) <= 1 && a[1].abs_diff(b[1]) <= 1,
            }
        };
        assert!(drawn.bytes.chunks(2).zip(classic.bytes.chunks(2)).all(near), "target {n}");
    }
}

#[test]
fn faults_of_targets_are_named() {
    let gpu = gpu();
    let extent = Extent::new(16, 16);
    let float = "#version 450
layout(location = 0) out vec4 color;
layout(location = 2) out uvec4 numbers;
void main() { color = vec4(1.0); numbers = uvec4(1u); }";
    let cleared = || ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4]);
    let mut renderer = compute::Renderer::new(&gpu).unwrap();
    let mut said = |colors: Vec<ColorTarget>| match renderer.render(&whole(extent, float, colors)) {
        Err(Error::Usage(text)) => text,
        Ok(_) => String::new(),
        Err(other) => panic!("{other}"),
    };
    assert_eq!(said(vec![cleared(), cleared()]), "", "outputs without a target vanish");
    let text = said(vec![cleared(), cleared(), cleared()]);
    assert!(text.contains("writes uint to location 2"), "{text}");
    let text = said((0..9).map(|_| cleared()).collect());
    assert!(text.contains("9 colour targets; there are at most 8"), "{text}");
    let image = targets::target(&gpu, "both", extent, Format::Rgba8Unorm);
    let twice = || ColorTarget::on_device(&image, LoadOp::clear([0.0; 4]));
    let text = said(vec![twice(), twice()]);
    assert!(text.contains("colour target 1: image `both` is a target twice"), "{text}");
    let large = targets::target(&gpu, "large", Extent::new(17, 16), Format::Rgba8Unorm);
    let text = said(vec![cleared(), ColorTarget::on_device(&large, LoadOp::clear([0.0; 4]))]);
    assert!(text.contains("colour target 1: image `large` is 17x16"), "{text}");
}
