//! Does the stencil test do what Vulkan says: values, their order, targets in images, and work whose order does not matter?

use crate::common::{
    gpu,
    mesh::{Corner, FRAGMENT, draw, pipeline},
    on_each_gpu,
    random::Random,
};
use std::sync::Arc;
use tilewright::{
    Error, Frame, Image, ImageInfo, ImageUse, Picture, Samples, classic, compute,
    format::Format,
    image::Extent,
    pass::{Binding, BindingSet, Draw, Executor, Pass, Pipeline},
    state::{Blend, Compare, Cull, DepthState, ResolveMode},
    stencil::{StencilFace, StencilOp, StencilState},
    target::{ColorTarget, DepthTarget, LoadOp, StencilTarget, StoreOp},
    texture::{Sampler, Texture},
};

mod images;
mod order;

const SIDE: u32 = 48;

/// A triangle over everything, at this depth. It is a front face, unless it is reversed.
fn over_all(pipeline: usize, depth: f32, reversed: bool) -> Draw {
    let corner = |[x, y]: [f32; 2]| [[x, y, depth, 1.0], [1.0; 4]];
    let mut corners = [[-1.0, -1.0], [-1.0, 3.0], [3.0, -1.0]].map(corner);
    if reversed {
        corners.swap(1, 2);
    }
    draw(pipeline, &corners)
}

fn compute(gpu: &tilewright::Gpu) -> compute::Renderer {
    compute::Renderer::new(gpu).unwrap()
}

/// A target whose pixels hold 0 to 255.
fn all_values() -> Picture {
    let (extent, bytes) = (Extent::new(16, 16), (0..=255).collect());
    Picture { extent, format: Format::S8Uint, bytes }
}

/// The tables of the specification: every operation and every comparison, of every value.
#[test]
fn each_value_becomes_what_the_specification_says() {
    on_each_gpu("stencil values become what the specification says", |gpu| {
        let mut compute = compute(gpu);
        let plain = pipeline(FRAGMENT);
        let mut random = Random::new(12_900);
        let compares = |op| Compare::ALL.iter().map(move |&compare| (op, compare));
        for (op, compare) in StencilOp::ALL.iter().copied().flat_map(compares) {
            let byte = |random: &mut Random| {
                [0, 1, 0x0f, 0x55, 0xfe, 0xff, random.bits() as u8][random.below(7)]
            };
            let [reference, compare_mask, write_mask] = [(); 3].map(|()| byte(&mut random));
            // Which of the three operations it is.
            let case = random.below(3);
            let face = StencilFace::new(compare).compare_mask(compare_mask).write_mask(write_mask);
            let face = match case {
                0 => face.fail(op),
                1 => face.depth_fail(op),
                _ => face.pass(op),
            };
            let (reversed, never) = (random.below(2) == 0, StencilFace::new(Compare::Never));
            let state = match reversed {
                true => StencilState::new(never).back(face),
                false => StencilState::new(never).front(face),
            };
            let depth = DepthState::new(if case == 1 { Compare::Never } else { Compare::Always });
            let mut draw = over_all(0, 0.5, reversed);
            draw.stencil_reference = if reversed { [7, reference] } else { [reference, 7] };
            let begin = all_values();
            let mut target = StencilTarget::cleared(0);
            target.load = LoadOp::Picture(Arc::new(begin.clone()));
            let pass = Pass::new("values", begin.extent)
                .depth(DepthTarget::transient(1.0))
                .stencil(target)
                .pipelines([plain.clone().depth(depth).stencil(state)])
                .draws([draw]);
            let frame = compute.render(&pass).unwrap();
            let found = frame.stencil.unwrap();
            assert_eq!((found.format, found.extent), (Format::S8Uint, begin.extent));
            for (held, (now, texel)) in
                (0..=255).zip(found.bytes.iter().zip(frame.colors[0].bytes.chunks_exact(4)))
            {
                let (left, right) = (reference & compare_mask, held & compare_mask);
                let passes = match compare {
                    Compare::Never => false,
                    Compare::Less => left < right,
                    Compare::Equal => left == right,
                    Compare::LessOrEqual => left <= right,
                    Compare::Greater => left > right,
                    Compare::NotEqual => left != right,
                    Compare::GreaterOrEqual => left >= right,
                    Compare::Always => true,
                };
                let happens = if case == 0 { !passes } else { passes };
                let value: i32 = match op {
                    _ if !happens => held.into(),
                    StencilOp::Keep => held.into(),
                    StencilOp::Zero => 0,
                    StencilOp::Replace => reference.into(),
                    StencilOp::IncrementAndClamp => (i32::from(held) + 1).min(255),
                    StencilOp::DecrementAndClamp => (i32::from(held) - 1).max(0),
                    StencilOp::Invert => 255 - i32::from(held),
                    StencilOp::IncrementAndWrap => (i32::from(held) + 1) % 256,
                    StencilOp::DecrementAndWrap => (i32::from(held) + 255) % 256,
                };
                let wanted = held & !write_mask | value as u8 & write_mask;
                let what = format!("{state:?} of {held}, reference {reference}, depth {depth:?}");
                assert_eq!(*now, wanted, "{what}");
                let is_drawn = passes && case != 1;
                assert_eq!(texel[3] != 0, is_drawn, "{what}");
            }
        }
    });
}

/// What the shader writes takes the place of the reference; lavapipe's own pipeline is not asked, whose extension is off.
#[test]
fn shaders_write_the_reference() {
    on_each_gpu("shaders write the stencil reference", |gpu| {
        let export = "#version 450
            #extension GL_ARB_shader_stencil_export : require
            layout(location = 0) out vec4 written;
            void main() {
                gl_FragStencilRefARB = int(gl_FragCoord.x) + 256;
                written = vec4(1.0);
            }";
        let face = StencilFace::new(Compare::NotEqual).pass(StencilOp::Replace);
        let mut compute = compute(gpu);
        for samples in [Samples::One, Samples::Four] {
            let pass = Pass::new("export", Extent::new(SIDE, 4))
                .samples(samples)
                .stencil(StencilTarget::cleared(5))
                .pipelines([pipeline(export).stencil(StencilState::new(face))])
                .draws([over_all(0, 0.5, false).stencil_reference([5, 5])]);
            let frame = compute.render(&pass).unwrap();
            let columns: Vec<u8> = (0..SIDE as u8).collect();
            assert_eq!(frame.stencil.unwrap().bytes, columns.repeat(4), "{samples:?}");
            // Where the two are equal, the test fails.
            let drawn = frame.colors[0].bytes.chunks_exact(4).map(|texel| texel[3] != 0);
            assert!(drawn.enumerate().all(|(n, drawn)| drawn == (n % SIDE as usize != 5)));
        }
        let fault = classic::Renderer::new(gpu).unwrap().render(
            &Pass::new("export", Extent::new(8, 8))
                .stencil(StencilTarget::cleared(0))
                .pipelines([pipeline(export)]),
        );
        assert!(matches!(fault, Err(Error::Device(text)) if text.contains("export of stencil")));
    });
}

#[test]
fn targets_that_make_no_sense_are_refused() {
    let gpu = gpu();
    let extent = Extent::new(8, 8);
    let image = |format| {
        let info = ImageInfo::new("image", extent, format, ImageUse::Attachment);
        Image::new(&gpu, &info).unwrap()
    };
    let (depth, color) = (image(Format::D32Float), image(Format::Rgba8Unorm));
    let both = image(Format::D24UnormS8Uint);
    let pass = Pass::new("refused", extent);
    let of_picture = |format| {
        let mut target = StencilTarget::cleared(0);
        target.load = LoadOp::Picture(Arc::new(Picture::zeroed(extent, format)));
        target
    };
    let mut wrong_size = of_picture(Format::S8Uint);
    wrong_size.load = LoadOp::Picture(Arc::new(Picture::zeroed(Extent::new(8, 7), Format::S8Uint)));
    let mut nothing = StencilTarget::cleared(0);
    nothing.load = LoadOp::Load;
    let stencil = |target: StencilTarget| pass.clone().stencil(target);
    let cases = [
        (stencil(StencilTarget::on_device(&depth, LoadOp::Clear(0))), "holds no stencil values"),
        (stencil(StencilTarget::on_device(&color, LoadOp::Clear(0))), "holds no stencil values"),
        (stencil(StencilTarget::cleared(0).resolve(ResolveMode::Average)), "no average"),
        (stencil(of_picture(Format::R8Uint)), "R8Uint"),
        (stencil(wrong_size), "8x7"),
        (stencil(nothing), "to load"),
        (stencil(StencilTarget::on_device(&both, LoadOp::Load).level(1)), "no level 1"),
        (stencil(StencilTarget::cleared(0).layer(1)), "no level 0 or layer 1"),
        (pass.clone().colors([ColorTarget::on_device(&both, LoadOp::Load)]), "colour target"),
        (pass.clone().colors([ColorTarget::cleared(Format::S8Uint, [0; 4])]), "colour target"),
        (pass.clone().depth(DepthTarget::cleared(0.0).format(Format::S8Uint)), "depth target"),
        (
            pass.clone().depth(DepthTarget::cleared(0.0).format(Format::D24UnormS8Uint)),
            "depth target",
        ),
    ];
    let sampled = "#version 450
        layout(binding = 0) uniform sampler2D depths;
        layout(location = 0) out vec4 written;
        void main() { written = texelFetch(depths, ivec2(0), 0); }";
    let set =
        BindingSet::new([(0, Binding::sampled(Texture::on_device(&both), Sampler::nearest()))]);
    let own = stencil(StencilTarget::on_device(&both, LoadOp::Clear(0)))
        .pipelines([pipeline(sampled)])
        .draws([over_all(0, 0.5, false).sets([set])]);
    let cases = cases.into_iter().chain([(own, "is a target of the pass")]);
    let mut compute = compute(&gpu);
    for (pass, text) in cases {
        let fault = compute.render(&pass).unwrap_err();
        assert!(matches!(&fault, Error::Usage(found) if found.contains(text)), "{text}: {fault}");
    }
    // Depths go to an image without its stencil values.
    let mark = StencilTarget::on_device(&both, LoadOp::Clear(77));
    compute.render(&pass.clone().stencil(mark)).unwrap();
    both.upload(&[vec![0u8; 4 * 64]]).unwrap();
    assert_eq!(both.download_stencil(0, 0).unwrap().bytes, [77; 64]);
    assert_eq!(Picture::filled(extent, Format::S8Uint, [5u32; 4]).bytes, [5; 64]);
    let fault = depth.download_stencil(0, 0).unwrap_err();
    assert!(matches!(&fault, Error::Usage(text) if text.contains("no stencil values")), "{fault}");
}
