//! Is a second source blended as Vulkan does?

use crate::{
    colors,
    common::{gpu, on_each_gpu, random::Random},
    parity, targets, twin,
};
use std::sync::Arc;
use tilewright::{
    Error, classic, compute,
    format::Format,
    image::Extent,
    pass::{BufferRange, Draw, Executor, Pass, Pipeline},
    shader::{Shader, Stage},
    state::{Blend, BlendEquation, BlendFactor, BlendOp, Cull, DepthState, LogicOp, Topology},
    target::{ColorTarget, LoadOp},
};

/// The vertex colour, and another one made of it.
const FRAGMENT: &str = "#version 450
    layout(location = 0) in vec4 color;
    layout(location = 0) out vec4 source;
    layout(location = 0, index = 1) out vec4 second;
    void main() { source = color; second = vec4(1.0 - color.a, color.bgr); }";

fn fragment(text: &str) -> Arc<Shader> {
    Arc::new(Shader::from_glsl(Stage::Fragment, "second.frag", text).unwrap())
}

fn pipeline(blend: Blend) -> Pipeline {
    let template = (*twin::random_pass(0, &twin::shaders()).pipelines[0]).clone();
    template
        .fragment(fragment(FRAGMENT))
        .topology(Topology::TriangleList)
        .cull(Cull::None)
        .depth(DepthState::OFF)
        .blend(blend)
}

fn seconds() -> impl Iterator<Item = BlendFactor> + Clone {
    let all = BlendFactor::ALL.iter().copied();
    all.filter(|factor| format!("{factor:?}").contains("Src1"))
}

/// One layer over a known colour, in floats: what the equation says, to the last bits.
#[test]
fn each_factor_is_the_one_of_its_name() {
    assert_eq!(seconds().count(), 4);
    on_each_gpu("each factor is the one of its name", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let shader = fragment(
            "#version 450
            layout(location = 0) out vec4 source;
            layout(location = 0, index = 1) out vec4 second;
            void main() {
                source = vec4(0.5, 0.25, 0.75, 0.125);
                second = vec4(0.25, 0.5, 1.0, 0.75);
            }",
        );
        let (source, second, target) =
            ([0.5, 0.25, 0.75, 0.125], [0.25, 0.5, 1.0, 0.75f32], [1.0, 0.5, 0.25, 0.5f32]);
        for factor in seconds() {
            let weight: [f32; 4] = std::array::from_fn(|n| match factor {
                BlendFactor::Src1Color => second[n],
                BlendFactor::OneMinusSrc1Color => 1.0 - second[n],
                BlendFactor::Src1Alpha => second[3],
                _ => 1.0 - second[3],
            });
            for of_source in [true, false] {
                let (src, dst) = match of_source {
                    true => (factor, BlendFactor::One),
                    false => (BlendFactor::One, factor),
                };
                let op = BlendOp::Add;
                let made = pipeline(Blend::all(BlendEquation { src, dst, op }));
                let corners =
                    [[-1.0f32, -1.0, 0.5, 1.0], [3.0, -1.0, 0.5, 1.0], [-1.0, 3.0, 0.5, 1.0]];
                let range = BufferRange::host("corners", bytemuck::cast_slice(&corners).to_vec());
                let pass = Pass::new("second", Extent::new(5, 5))
                    .colors([ColorTarget::cleared(Format::Rgba32Float, target)])
                    .pipelines([Arc::new(made.fragment(shader.clone()))])
                    .draws([Draw::new(0, 3).vertex_buffers([range])]);
                let expected: [f32; 4] = std::array::from_fn(|n| match of_source {
                    true => source[n] * weight[n] + target[n],
                    false => source[n] + target[n] * weight[n],
                });
                let frame = compute.render(&pass).unwrap();
                assert!(
                    frame.colors[0].values().all(|found| found == expected),
                    "{factor:?}, of the source: {of_source}: {:?}, not {expected:?}",
                    frame.colors[0].values().next()
                );
            }
        }
    });
}

/// Layers with any equations of which a factor is the second source's.
#[test]
fn layers_are_those_of_the_device() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    // No layer makes an error of the layers below it larger.
    let tame = [0, 1, 2, 3, 6, 7].map(|n| BlendFactor::ALL[n]);
    let seconds: Vec<_> = seconds().collect();
    for seed in 9900..9932 {
        let mut random = Random::new(seed);
        let mut equation = || {
            let (second, other) = (seconds[random.below(4)], tame[random.below(6)]);
            let op = parity::OPS[[0, 3, 4][random.below(3)]];
            match random.below(2) {
                0 => BlendEquation { src: second, dst: other, op },
                _ => BlendEquation { src: other, dst: second, op },
            }
        };
        let blend = Blend { color: equation(), alpha: equation() };
        for format in [Format::Rgba8Unorm, Format::Rgba16Float] {
            let pass = parity::overlapping(&pipeline(blend), format, seed);
            let [ours, theirs] = [compute.render(&pass).unwrap(), classic.render(&pass).unwrap()];
            if format == Format::Rgba16Float {
                let found = colors::difference(&ours.colors[0], &theirs.colors[0]);
                assert!(found.is_none(), "seed {seed}, {blend:?}: {found:?}");
            }
            let steps = parity::largest_step(&gpu, &pass);
            let allowed = parity::remains::blended_steps(format) + 2.0;
            assert!(steps <= allowed, "seed {seed}, {blend:?}, {format:?}: {steps}");
        }
    }
}

/// In an image, in two passes: the same bytes.
#[test]
fn a_second_source_is_blended_in_images_too() {
    on_each_gpu("a second source is blended in images too", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let equation = BlendEquation {
            src: BlendFactor::Src1Color,
            dst: BlendFactor::OneMinusSrc1Alpha,
            op: BlendOp::Add,
        };
        let mut pass =
            parity::overlapping(&pipeline(Blend::all(equation)), Format::Rgba8Unorm, 9940);
        pass.draws.push(pass.draws[0].clone());
        let expected = compute.render(&pass).unwrap();
        let image = targets::target(gpu, "color", pass.extent, Format::Rgba8Unorm);
        let clear = pass.colors[0].load.clone();
        let draws = std::mem::take(&mut pass.draws);
        for (n, draw) in draws.into_iter().enumerate() {
            let load = if n == 0 { clear.clone() } else { LoadOp::Load };
            pass.colors = vec![ColorTarget::on_device(&image, load)];
            pass.draws = vec![draw];
            compute.render(&pass).unwrap();
        }
        assert_eq!(image.download(0).unwrap(), expected.colors[0]);
    });
}

#[test]
fn a_second_source_needs_one_target_and_a_shader_that_writes_it() {
    let gpu = gpu();
    let equation =
        BlendEquation { src: BlendFactor::Src1Alpha, dst: BlendFactor::One, op: BlendOp::Add };
    let refused =
        |pass: &Pass, words: &[&str]| match compute::Renderer::new(&gpu).unwrap().render(pass) {
            Err(Error::Usage(text)) if words.iter().all(|word| text.contains(word)) => {}
            other => panic!("not refused with {words:?}: {other:?}"),
        };
    let mut two = parity::overlapping(&pipeline(Blend::all(equation)), Format::Rgba8Unorm, 9950);
    two.colors.push(two.colors[0].clone());
    refused(&two, &["second source", "single colour target", "there are 2"]);
    let lacking = pipeline(Blend::all(equation)).fragment(twin::shaders().1);
    let lacking = parity::overlapping(&lacking, Format::Rgba8Unorm, 9951);
    refused(&lacking, &["second source", "twin.frag", "index = 1"]);
    // Under a logic operation nothing is blended, and states beyond the targets do not count.
    let logic = two.pipelines[0].as_ref().clone().logic_op(LogicOp::Copy);
    two.pipelines = vec![Arc::new(logic)];
    two.validate().unwrap();
}

/// A shader may write it for nobody: to several targets, and in opaque work.
#[test]
fn a_second_source_that_nothing_blends_changes_nothing() {
    on_each_gpu("a second source that nothing blends changes nothing", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let second = "layout(location = 0, index = 1) out vec4 second;";
        let alone =
            FRAGMENT.replace(second, "").replace("second = vec4(1.0 - color.a, color.bgr);", "");
        assert!(!alone.contains("second"));
        for (blend, depth) in [(Some(Blend::ALPHA), DepthState::OFF), (None, DepthState::LESS)] {
            for targets in [1, 2] {
                let [with, without] = [FRAGMENT, &alone].map(|text| {
                    let made =
                        pipeline(Blend::ALPHA).fragment(fragment(text)).blend(blend).depth(depth);
                    let mut pass = parity::overlapping(&made, Format::Rgba8Unorm, 9953);
                    pass.colors = vec![pass.colors[0].clone(); targets];
                    compute.render(&pass).unwrap().colors
                });
                assert_eq!(with, without, "{blend:?}, {targets} targets");
            }
        }
    });
}

/// A second source beyond what the format holds is limited before it is a factor, as the first one is.
#[test]
fn a_second_source_is_limited_as_the_format_is() {
    on_each_gpu("a second source is limited as the format is", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let beyond = fragment(
            "#version 450
            layout(location = 0) out vec4 source;
            layout(location = 0, index = 1) out vec4 second;
            void main() { source = vec4(0.0); second = vec4(2.0, -3.0, 1.0, -0.5); }",
        );
        let equation = |dst| BlendEquation { src: BlendFactor::One, dst, op: BlendOp::Add };
        for (format, factor, expected) in [
            (Format::Rgba8Unorm, BlendFactor::Src1Color, [1.0, 0.0, 1.0, 0.0]),
            (Format::Rgba8Unorm, BlendFactor::OneMinusSrc1Color, [0.0, 1.0, 0.0, 1.0]),
            (Format::Rgba8Snorm, BlendFactor::Src1Color, [1.0, -1.0, 1.0, -0.5]),
            (Format::Rgba8Snorm, BlendFactor::OneMinusSrc1Color, [0.0, 1.0, 0.0, 1.0]),
            (Format::Rgba32Float, BlendFactor::Src1Color, [2.0, -3.0, 1.0, -0.5]),
        ] {
            let made = pipeline(Blend::all(equation(factor))).fragment(beyond.clone());
            let corners = [[-1.0f32, -1.0, 0.5, 1.0], [3.0, -1.0, 0.5, 1.0], [-1.0, 3.0, 0.5, 1.0]];
            let range = BufferRange::host("corners", bytemuck::cast_slice(&corners).to_vec());
            let pass = Pass::new("limited", Extent::new(3, 3))
                .colors([ColorTarget::cleared(format, [1.0; 4])])
                .pipelines([made])
                .draws([Draw::new(0, 3).vertex_buffers([range])]);
            let frame = compute.render(&pass).unwrap();
            let found = frame.colors[0].values().next().unwrap();
            let near = found.iter().zip(expected).all(|(a, b): (&f32, f32)| (a - b).abs() < 0.01);
            assert!(near, "{format:?}, {factor:?}: {found:?}, not {expected:?}");
        }
    });
}
