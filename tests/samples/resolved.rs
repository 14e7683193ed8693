//! Samples to texels, and texels to samples.

use super::*;

/// A pass that draws to each sample alone, in another colour and at another depth.
fn one_by_one(samples: Samples, format: Format, colors: &[[f32; 4]]) -> Pass {
    let masked = |s: usize| {
        let always = DepthState::new(Compare::Always);
        pipeline(FRAGMENT).depth(always).sample_mask(1 << s)
    };
    let count = samples.count() as usize;
    let depth = |s: usize| (s + 1) as f32 / 32.0;
    let draws = (0..count).map(|s| over_all(s, (depth(s), colors[s])));
    pass(samples, format)
        .depth(DepthTarget::cleared(1.0))
        .pipelines((0..count).map(masked))
        .draws(draws.collect::<Vec<_>>())
}

fn srgb_decoded(c: f32) -> f32 {
    if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) }
}

/// The average of what was written to each sample, in linear light; integers and depths keep sample 0.
#[test]
fn texels_are_averages() {
    on_each_gpu("texels are averages of samples", |gpu| {
        let mut compute = compute(gpu);
        for (n, samples) in [Samples::Four, Samples::Eight].into_iter().enumerate() {
            let mut random = Random::new(11_500 + n as u64);
            let count = samples.count() as usize;
            let colors: Vec<_> =
                (0..count).map(|_| [(); 4].map(|()| random.below(256) as f32 / 255.0)).collect();
            let average: [f32; 4] = std::array::from_fn(|channel| {
                colors.iter().map(|color| color[channel]).sum::<f32>() / count as f32
            });
            for (format, limit) in [
                (Format::Rgba32Float, 1e-6),
                (Format::Rgba16Float, 6e-4),
                (Format::Rgba8Unorm, 0.503 / 255.0),
                (Format::Rgb10a2Unorm, f32::INFINITY),
                (Format::R8Unorm, 0.503 / 255.0),
            ] {
                let frame = compute.render(&one_by_one(samples, format, &colors)).unwrap();
                let channels = format.channels();
                let limit = if limit.is_finite() { limit } else { 1.0 / 1023.0 };
                for value in values(&frame) {
                    let far = |c: &usize| (value[*c] - average[*c]).abs() > limit;
                    let channels = if format == Format::Rgb10a2Unorm { 3 } else { channels };
                    let found = (0..channels).find(far);
                    assert_eq!(found, None, "{samples:?} {format:?}: {value:?}, not {average:?}");
                }
            }
            // What is written is rounded to 8 bits of the encoding, and so is the average.
            let frame = compute.render(&one_by_one(samples, Format::Rgba8Srgb, &colors)).unwrap();
            let byte = frame.colors[0].bytes[0];
            let light = srgb_decoded(f32::from(byte) / 255.0);
            assert!((light - average[0]).abs() < 0.006, "{samples:?}: {light}, not {}", average[0]);
        }
    });
}

#[test]
fn integers_keep_sample_zero() {
    on_each_gpu("integers keep sample zero", |gpu| {
        let mut compute = compute(gpu);
        let shader = "#version 450
            layout(location = 0) in vec4 color;
            layout(location = 0) out uvec4 written;
            void main() { written = uvec4(color * 255.0 + 0.5); }";
        for (samples, format) in
            [(Samples::Four, Format::Rgba8Uint), (Samples::Two, Format::R32Uint)]
        {
            let colors: Vec<_> = (1..17).map(|n| [n as f32 / 255.0; 4]).collect();
            let mut pass = one_by_one(samples, format, &colors);
            pass.colors = vec![ColorTarget::cleared(format, [9u32; 4])];
            let shader = Arc::new(Shader::from_glsl(Stage::Fragment, "integers", shader).unwrap());
            pass.pipelines = pass
                .pipelines
                .iter()
                .map(|pipeline| Arc::new((**pipeline).clone().fragment(shader.clone())))
                .collect();
            let frame = compute.render(&pass).unwrap();
            assert_eq!(frame.colors[0].bytes[0], 1, "{format:?}");
        }
    });
}

#[test]
fn depths_are_resolved_as_asked() {
    on_each_gpu("depths are resolved as asked", |gpu| {
        let mut compute = compute(gpu);
        for samples in [Samples::Two, Samples::Sixteen] {
            let count = samples.count() as f32;
            for (mode, expected) in [
                (ResolveMode::SampleZero, 1.0 / 32.0),
                (ResolveMode::Min, 1.0 / 32.0),
                (ResolveMode::Max, count / 32.0),
                (ResolveMode::Average, (count + 1.0) / 64.0),
            ] {
                for format in [Format::D32Float, Format::D16Unorm] {
                    let colors = [[1.0; 4]; 16];
                    let mut pass = one_by_one(samples, Format::Rgba8Unorm, &colors);
                    let depth = DepthTarget::cleared(1.0).format(format).resolve(mode);
                    pass.depth = Some(depth);
                    let frame = compute.render(&pass).unwrap();
                    let limit = if format == Format::D32Float { 0.0 } else { 1.0 / 65535.0 };
                    for depth in frame.depth.unwrap().depths() {
                        let near = (depth - expected).abs() <= limit;
                        assert!(near, "{samples:?} {mode:?} {format:?}: {depth}, not {expected}");
                    }
                }
            }
        }
    });
}

/// Where the device resolves depths in this way itself, it comes to the same. Lavapipe offers averages of depths, and keeps sample
/// 0 (seen with Mesa 25.0.7): so they are compared with what they should be, above.
#[test]
fn depths_are_resolved_as_on_the_device() {
    let gpu = gpu();
    let (mut ours, mut theirs) = (compute(&gpu), classic::Renderer::new(&gpu).unwrap());
    let mut compared = 0;
    for mode in [ResolveMode::SampleZero, ResolveMode::Min, ResolveMode::Max] {
        let colors = [[1.0; 4]; 16];
        let mut pass = one_by_one(Samples::Four, Format::Rgba8Unorm, &colors);
        pass.depth = Some(DepthTarget::cleared(1.0).resolve(mode));
        let theirs = match theirs.render(&pass) {
            Ok(frame) => frame,
            Err(Error::Device(_)) => continue,
            Err(fault) => panic!("{fault}"),
        };
        let ours = ours.render(&pass).unwrap();
        assert_eq!(ours.depth.unwrap().depths(), theirs.depth.unwrap().depths(), "{mode:?}");
        compared += 1;
    }
    assert!(compared > 0, "sample 0 is always there");
}

/// What a target begins with, each sample of a pixel has: pictures of the host and images, wide and narrow.
#[test]
fn samples_begin_with_the_texel() {
    on_each_gpu("samples begin with the texel", |gpu| {
        let mut compute = compute(gpu);
        let extent = Extent::new(SIDE, SIDE);
        for format in [Format::Rgba8Unorm, Format::R8Unorm, Format::Rgba32Float] {
            let mut random = Random::new(11_600);
            let begin = pass(Samples::One, format)
                .pipelines([pipeline(FRAGMENT).depth(DepthState::OFF)])
                .draws([draw(0, &triangles(&mut random, 20))]);
            let begun = compute.render(&begin).unwrap().colors.remove(0);
            let image = targets::target(gpu, "begun", extent, format);
            for on_device in [false, true] {
                let picture = LoadOp::Picture(Arc::new(begun.clone()));
                let mut pass = pass(Samples::Four, format)
                    .pipelines([pipeline(FRAGMENT).depth(DepthState::OFF).sample_mask(0b0101)])
                    .draws([over_all(0, (0.5, [1.0; 4]))]);
                pass.colors[0].load = picture;
                if on_device {
                    let mut first = begin.clone();
                    first.colors = vec![ColorTarget::on_device(&image, LoadOp::clear([0.0f32; 4]))];
                    compute.render(&first).unwrap();
                    pass.colors = vec![ColorTarget::on_device(&image, LoadOp::Load)];
                }
                let frame = compute.render(&pass).unwrap();
                for (value, before) in values(&frame).into_iter().zip(begun.values()) {
                    for channel in 0..format.channels() {
                        let expected = (before[channel] + 1.0) / 2.0;
                        let near = (value[channel] - expected).abs() < 0.503 / 255.0;
                        assert!(near, "{format:?} {on_device}: {value:?} of {before:?}");
                    }
                }
            }
        }
    });
}

/// Depth of an image is loaded to all samples, tested against, and stored again.
#[test]
fn depth_is_kept_from_pass_to_pass() {
    if !gpu().has_graphics() {
        return;
    }
    on_each_gpu("depth of several samples is kept from pass to pass", |gpu| {
        let mut compute = compute(gpu);
        for format in [Format::D32Float, Format::D16Unorm] {
            let image = targets::target(gpu, "depth", Extent::new(SIDE, SIDE), format);
            let colored = |load, depth, color| {
                let mut pass = pass(Samples::Four, Format::Rgba8Unorm)
                    .pipelines([pipeline(FRAGMENT).depth(DepthState::LESS)])
                    .draws([over_all(0, (depth, color))]);
                pass.depth = Some(DepthTarget::on_device(&image, load));
                pass
            };
            compute.render(&colored(LoadOp::Clear(1.0), 0.5, [1.0; 4])).unwrap();
            let hidden = compute.render(&colored(LoadOp::Load, 0.75, [1.0; 4])).unwrap();
            assert!(values(&hidden).iter().all(|value| *value == [0.0; 4]), "{format:?}");
            let shown = compute.render(&colored(LoadOp::Load, 0.25, [1.0; 4])).unwrap();
            assert!(values(&shown).iter().all(|value| *value == [1.0; 4]), "{format:?}");
            let mut nothing = colored(LoadOp::Load, 0.3, [1.0; 4]);
            nothing.depth.as_mut().unwrap().store = StoreOp::Discard;
            let hidden = compute.render(&nothing).unwrap();
            assert!(values(&hidden).iter().all(|value| *value == [0.0; 4]), "{format:?}");
        }
    });
}
