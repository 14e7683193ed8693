//! Are pipelines compiled when a program asks for it, with the error at that moment, and once for all that are equal?

use crate::common::on_each_gpu;
use std::sync::Arc;
use tilewright::{
    Error, Samples, TargetFormats, compute,
    format::Format,
    image::Extent,
    pass::{Draw, Pass, Pipeline},
    shader::{Shader, Stage},
    state::{Blend, Compare, DepthBias, DepthState},
    target::{ColorTarget, DepthTarget},
};

const VERTEX: &str = "#version 450
layout(location = 0) out vec2 at;
void main() {
    at = vec2(4 * (gl_VertexIndex & 1) - 1, 4 * (gl_VertexIndex >> 1) - 1);
    gl_Position = vec4(at, 0.5, 1.0);
}";
const FRAGMENT: &str = "#version 450
layout(location = 0) in vec2 at;
layout(location = 0) out vec4 color;
void main() { if (at.x < -0.9 && DISCARDS) discard; color = vec4(at, FACTOR, 0.5); }";
/// A feature that Vulkan has and this library does not.
const REFUSED: &str = "#version 450
#extension GL_EXT_fragment_shader_barycentric : require
layout(location = 0) in vec2 at;
layout(location = 0) out vec4 color;
void main() { color = vec4(at, gl_BaryCoordEXT.x, 1.0); }";

fn pipeline(fragment: &str) -> Pipeline {
    let shader = |stage, source| {
        Arc::new(Shader::from_glsl(stage, "compile", source).unwrap_or_else(|e| panic!("{e}")))
    };
    Pipeline::new("compile", shader(Stage::Vertex, VERTEX), shader(Stage::Fragment, fragment))
}

fn fragment(factor: u32, discards: bool) -> String {
    let factor = format!("{factor}.0 / 255.0");
    FRAGMENT.replace("FACTOR", &factor).replace("DISCARDS", &discards.to_string())
}

fn pass(pipeline: Pipeline, color: Option<Format>, depth: bool) -> Pass {
    let mut pass = Pass::new("compile", Extent::new(16, 16));
    pass.colors = color.map(|format| ColorTarget::cleared(format, [0.0; 4])).into_iter().collect();
    pass.depth = depth.then(|| DepthTarget::cleared(1.0));
    pass.pipelines = vec![Arc::new(pipeline)];
    pass.draws = vec![Draw::new(0, 3)];
    pass
}

/// All ways in which a pipeline is drawn: the pass finds everything compiled, whoever compiled it.
#[test]
fn a_pass_finds_its_pipeline_compiled() {
    on_each_gpu("a pass finds its pipeline compiled", |gpu| {
        let blended = |pipeline: Pipeline| pipeline.blend(Blend::ALPHA);
        let equal = |pipeline: Pipeline| pipeline.depth(DepthState::new(Compare::Equal));
        let formats = [None, Some(Format::Rgba16Float)];
        let clamped = |pipeline: Pipeline| pipeline.depth_clamp(true);
        let kinds: [fn(Pipeline) -> Pipeline; 4] = [|pipeline| pipeline, blended, equal, clamped];
        let mut factor = 0;
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for (kind, discards) in kinds.iter().flat_map(|kind| [(kind, false), (kind, true)]) {
            for (color, depth) in formats.iter().flat_map(|f| [(*f, false), (*f, true)]) {
                factor += 1;
                let made = || kind(pipeline(&fragment(factor, discards)));
                let samples = if factor % 3 == 0 { Samples::Four } else { Samples::One };
                let depth_format = depth.then_some(Format::D32Float);
                let targets = TargetFormats::new(color).depth(depth_format).samples(samples);
                let background = factor % 4 == 0;
                let compiled = match background {
                    true => renderer
                        .compile_in_background(&made(), &targets)
                        .and_then(compute::Compilation::wait),
                    false => renderer.compile(&made(), &targets),
                };
                let compiled = compiled.unwrap();
                // Takes over what a thread has made.
                drop(renderer.compile(&made(), &targets).unwrap());
                let before = renderer.cached().pipelines_made;
                renderer.render(&pass(made(), color, depth).samples(samples)).unwrap();
                let after = renderer.cached().pipelines_made;
                assert_eq!(after, before, "{color:?} {depth} {discards} {background}");
                drop(compiled);
            }
        }
    });
}

/// All pipelines of a pass at once, two of which share a shader; a fault of any of them is told.
#[test]
fn a_pass_is_compiled_as_a_whole() {
    on_each_gpu("a pass is compiled as a whole", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for background in [false, true] {
            let first = 10 + 2 * u32::from(background);
            let mut pass = pass(pipeline(&fragment(first, false)), Some(Format::Rgba8Srgb), true);
            pass.pipelines.push(Arc::new(pipeline(&fragment(first + 1, true))));
            pass.draws.push(Draw::new(1, 3));
            let before = renderer.cached().pipelines_made;
            let compiled = match background {
                true => renderer.compile_pass_in_background(&pass).unwrap().wait().unwrap(),
                false => renderer.compile_pass(&pass).unwrap(),
            };
            renderer.render(&pass).unwrap();
            // Kernels of two fragment shaders, and of the vertex shader at first.
            let made = renderer.cached().pipelines_made - before;
            assert_eq!(made, if background { 2 } else { 3 });
            drop(compiled);
            pass.pipelines.push(Arc::new(pipeline(REFUSED)));
            assert!(matches!(renderer.compile_pass(&pass), Err(Error::Shader { .. })));
        }
    });
}

/// A batch of pipelines of which one is clamped takes the kernels of adjusted depths for all of them.
#[test]
fn a_pass_of_clamped_and_other_pipelines_finds_its_kernels() {
    on_each_gpu("a pass of clamped and other pipelines finds its kernels", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let made = |factor| pipeline(&fragment(factor, false)).depth(DepthState::LESS);
        let mut pass = pass(made(40), Some(Format::Rgba8Srgb), true);
        pass.pipelines.push(Arc::new(made(41).depth_clamp(true)));
        pass.draws.push(Draw::new(1, 3));
        for depth in [Format::D32Float, Format::D16Unorm] {
            pass.depth.as_mut().unwrap().format = depth;
            let _compiled = renderer.compile_pass(&pass).unwrap();
            let before = renderer.cached().pipelines_made;
            renderer.render(&pass).unwrap();
            assert_eq!(renderer.cached().pipelines_made, before, "{depth:?}");
        }
    });
}

/// A draw with a depth bias has kernels of its own for raster and shading, which the pass finds compiled as well.
#[test]
fn a_pass_with_a_bias_finds_its_kernels() {
    on_each_gpu("a pass with a bias finds its kernels", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let opaque = "#version 450
layout(location = 0) in vec2 at;
layout(location = 0) out vec4 color;
void main() { color = vec4(at, 0.25, 1.0); }";
        let plain = pipeline(opaque).depth(DepthState::LESS);
        let mut pass = pass(plain, Some(Format::Rgba8Srgb), true);
        for expected in [3, 2] {
            let before = renderer.cached().pipelines_made;
            let _compiled = renderer.compile_pass(&pass).unwrap();
            assert_eq!(renderer.cached().pipelines_made - before, expected);
            renderer.render(&pass).unwrap();
            assert_eq!(renderer.cached().pipelines_made - before, expected, "made by the pass");
            pass.draws[0].depth_bias = Some(DepthBias::new(1.0, 1.0));
        }
    });
}

/// Pipelines that are equal have their kernels made once, by whichever thread begins first, and any of them holds them.
#[test]
fn equal_pipelines_are_compiled_once_in_the_background() {
    on_each_gpu("equal pipelines are compiled once in the background", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let color = Format::Rgba8Unorm;
        let targets = TargetFormats::new([color]);
        let made = || pipeline(&fragment(1, true));
        let started = [0; 3].map(|_| renderer.compile_in_background(&made(), &targets).unwrap());
        let [first, second, third] = started.map(|started| started.wait().unwrap());
        drop((first, third));
        let other = pass(pipeline(&fragment(2, true)), Some(color), false);
        for _ in 0..70 {
            renderer.render(&other).unwrap();
        }
        let before = renderer.cached().pipelines_made;
        assert_eq!(before, 3, "vertex, and two ordered");
        renderer.render(&pass(made(), Some(color), false)).unwrap();
        assert_eq!(renderer.cached().pipelines_made, before);
        drop(second);
    });
}

#[test]
fn a_pipeline_stays_as_long_as_it_is_held() {
    on_each_gpu("a pipeline stays as long as it is held", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let color = Format::Rgba8Unorm;
        let targets = TargetFormats::new([color]);
        let compiled = renderer.compile(&pipeline(&fragment(1, true)), &targets).unwrap();
        let also = compiled.clone();
        let kernels = renderer.cached().pipelines;
        assert_eq!(kernels, 2, "vertex and ordered");
        let other = pass(pipeline(&fragment(2, true)), Some(color), false);
        for _ in 0..70 {
            renderer.render(&other).unwrap();
        }
        drop(compiled);
        // They share the vertex kernel.
        assert_eq!(renderer.cached().pipelines, 3);
        drop(also);
        renderer.render(&other).unwrap();
        assert_eq!(renderer.cached().pipelines, 2);
    });
}

#[test]
fn errors_come_when_the_pipeline_is_compiled() {
    on_each_gpu("errors come when the pipeline is compiled", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let color = Format::Rgba8Unorm;
        let targets = TargetFormats::new([color]);
        let good = || pipeline(&fragment(1, false));
        let usage = |fault: Option<Error>, part: &str| match fault {
            Some(Error::Usage(text)) => assert!(text.contains(part), "{text}"),
            other => panic!("{part}: {other:?}"),
        };
        let nine = TargetFormats::new([color; 9]);
        usage(renderer.compile(&good(), &nine).err(), "9 colour targets");
        let depth = TargetFormats::new([Format::D32Float]);
        usage(renderer.compile(&good(), &depth).err(), "D32Float");
        let no_depth = targets.clone().depth(color);
        usage(renderer.compile(&good(), &no_depth).err(), "Rgba8Unorm");
        let mut bad = good();
        bad.fragment = bad.vertex.clone();
        usage(renderer.compile(&bad, &targets).err(), "pipeline `compile`");
        usage(renderer.compile_in_background(&bad, &targets).err(), "pipeline `compile`");
        let refused = pipeline(REFUSED);
        let shader = |fault: Option<Error>| match fault {
            Some(Error::Shader { reason, .. }) => {
                assert!(reason.contains("BaryCoord"), "{reason}")
            }
            other => panic!("{other:?}"),
        };
        shader(renderer.compile(&refused, &targets).err());
        let started = renderer.compile_in_background(&refused, &targets).unwrap();
        shader(started.wait().err());
        // A pass that needs what a thread compiles waits for it, and so does the end of the renderer.
        let started: Vec<_> = (10..14)
            .map(|n| {
                let made = pipeline(&fragment(n, true));
                renderer.compile_in_background(&made, &targets).unwrap()
            })
            .collect();
        let made = pipeline(&fragment(12, true));
        renderer.render(&pass(made, Some(color), false)).unwrap();
        drop(renderer);
        assert!(started.iter().all(compute::Compilation::is_done));
        started.into_iter().for_each(|compilation| drop(compilation.wait().unwrap()));
    });
}
