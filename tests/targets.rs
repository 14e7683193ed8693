//! Do passes begin with what their targets hold, keep what they are told to keep, and find what other passes drew?

use crate::{
    common::{gpu, on_each_gpu, random::Random},
    parity, twin,
};
use std::sync::Arc;
use tilewright::{
    Error, classic, compare, compute,
    format::Format,
    grid::Capacities,
    image::{self, Extent},
    pass::{Binding, BindingEntry, BindingSet, Draw, Executor, Frame, Pass, Pipeline},
    reference,
    scene::Scene,
    shader::{Shader, Stage},
    target::{ClearColor, ColorTarget, DepthTarget, LoadOp, StoreOp},
    texture::{Filter, Sampler, Texture},
    vk::{Gpu, Image, ImageInfo, ImageUse},
};

pub fn target(gpu: &Gpu, name: &str, extent: Extent, format: Format) -> Image {
    let usage = ImageUse::Attachment;
    Image::new(gpu, &ImageInfo::new(name, extent, format, usage)).unwrap()
}

fn shader(stage: Stage, source: &str) -> Arc<Shader> {
    Arc::new(Shader::from_glsl(stage, "targets", source).unwrap_or_else(|e| panic!("{e}")))
}

/// A triangle that covers everything, at the depth that is pushed.
const WHOLE: &str = "#version 450
layout(push_constant) uniform Push { float depth; };
void main() {
    gl_Position = vec4(4 * (gl_VertexIndex & 1) - 1, 4 * (gl_VertexIndex >> 1) - 1, depth, 1);
}";

/// A pass that covers everything with `fragment`.
pub fn whole(extent: Extent, color: ColorTarget, fragment: &str) -> Pass {
    let (vertex, fragment) = (shader(Stage::Vertex, WHOLE), shader(Stage::Fragment, fragment));
    let mut pass = Pass::new("whole", extent);
    pass.colors = vec![color];
    pass.pipelines = vec![Arc::new(Pipeline::new("whole", vertex, fragment))];
    pass.draws = vec![Draw::new(0, 3).push(&0.5f32)];
    pass
}

/// The set that binds `textures` from binding 0 on, nearest texel.
pub fn textures(textures: &[&Image]) -> Arc<BindingSet> {
    let nearest = Sampler::nearest().mip(Some(Filter::Nearest));
    let entry = |(binding, image): (usize, &&Image)| {
        let texture = Arc::new(Texture::on_device(image));
        let resources = vec![Binding::Sampled(texture, nearest)];
        BindingEntry { binding: binding as u32, resources }
    };
    Arc::new(BindingSet { entries: textures.iter().enumerate().map(entry).collect() })
}

fn same(a: &Frame, b: &Frame) -> bool {
    let bytes = |frame: &Frame| frame.depth.as_ref().map(|depth| depth.bytes.clone());
    a.colors == b.colors && bytes(a) == bytes(b)
}

/// `pass` up to draw `at`, and from there on. The second begins with what `color` and `depth` are told.
pub fn split(
    pass: &Pass,
    at: usize,
    images: Option<&(Image, Image)>,
    second: (LoadOp<ClearColor>, LoadOp<f32>),
) -> [Pass; 2] {
    let part = |draws: &[Draw], load: Option<(LoadOp<ClearColor>, LoadOp<f32>)>| {
        let mut part = pass.clone();
        part.draws = draws.to_vec();
        let depth = part.depth.as_mut().unwrap();
        if let Some((color, depth_image)) = images {
            part.colors[0].image = Some(color.clone());
            depth.image = Some(depth_image.clone());
        }
        if let Some(load) = load {
            (part.colors[0].load, depth.load) = load;
        }
        part
    };
    [part(&pass.draws[..at], None), part(&pass.draws[at..], Some(second))]
}

/// A pass that is cut in two gives the same bytes: the second part loads from images what the first part stored there,
/// or it begins with the pictures that came to the host. Every intermediate of the second part is the reference's.
#[test]
fn a_pass_in_two_parts_is_the_whole_pass() {
    on_each_gpu("a pass in two parts is the whole pass", |gpu| {
        let shaders = twin::shaders();
        let mut compute = compute::Renderer::new(gpu).unwrap();
        // SwiftShader's own raster stage does not end for some of these meshes.
        let ends = gpu.has_graphics() && !gpu.info().name.contains("SwiftShader");
        let mut classic = ends.then(|| classic::Renderer::new(gpu).unwrap());
        for seed in 7000..7024 {
            let mut random = Random::new(seed);
            let primitives = 1 << (5 + seed % 6);
            compute.set_batch_limit(Capacities {
                primitives,
                vertices: 3 * primitives,
                varying_words: 1 << 16,
            });
            let mut all = twin::random_pass(seed, &shaders);
            all.colors[0].format =
                [Format::Rgba8Unorm, Format::Rgba8Srgb, Format::Rgba16Float][random.below(3)];
            let at = random.below(all.draws.len() + 1);
            let images = (
                target(gpu, "color", all.extent, all.colors[0].format),
                target(gpu, "depth", all.extent, Format::D32Float),
            );
            let loading = (LoadOp::Load, LoadOp::Load);
            let parts = split(&all, at, Some(&images), loading);
            let what = format!("{}, seed {seed}, cut at draw {at}", gpu.info());

            let expected = compute.render(&all).unwrap();
            let first = compute.render(&parts[0]).unwrap();
            let snapshot = parts[1].snapshot().unwrap().into_owned();
            assert!(same(&compute.render(&parts[1]).unwrap(), &expected), "{what}: loaded");
            assert!(expected.colors[0] == images.0.download(0).unwrap(), "{what}: the image");

            let depth = Arc::new(first.depth.unwrap());
            let color = Arc::new(first.colors.into_iter().next().unwrap());
            let pictures = (LoadOp::Picture(color), LoadOp::Picture(depth));
            let [_, second] = split(&all, at, None, pictures);
            for second in [&second, &snapshot] {
                assert!(same(&compute.render(second).unwrap(), &expected), "{what}: uploaded");
                let (frame, trace) = compute.trace(second).unwrap();
                assert!(same(&frame, &expected), "{what}: traced");
                if let Some(found) = reference::first_difference(second, &trace) {
                    panic!("{what}: {found}");
                }
            }
            if let Some(classic) = &mut classic {
                let expected = classic.render(&all).unwrap();
                classic.render(&parts[0]).unwrap();
                assert!(same(&classic.render(&parts[1]).unwrap(), &expected), "{what}: classic");
            }
        }
    });
}

/// The second half of a scene, over the picture and the depth of its first half, covers the pixels that it covers by the
/// device's own raster stage.
#[test]
fn what_is_loaded_hides_as_on_the_device() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    for name in Scene::builtin_names() {
        let scene = Scene::builtin(name).unwrap();
        let all = parity::scene_pass(&scene, Extent::new(320, 200), Format::Rgba16Float);
        let half = all.draws.len() / 2;
        let [first, _] = split(&all, half, None, (LoadOp::Load, LoadOp::Load));
        let first = compute.render(&first).unwrap();
        let depth = LoadOp::Picture(Arc::new(first.depth.clone().unwrap()));
        let color = LoadOp::Picture(Arc::new(first.into_color().unwrap()));
        let [_, second] = split(&all, half, None, (color, depth));
        let both = compare::Both::draw(&mut compute, &mut classic, &second, |_| {}).unwrap();
        let (found, limits) = (both.difference, parity::remains::limits(&gpu, &both.difference, 0));
        assert!(limits.allow(&found), "{name}: {found:?} against {limits:?}");
    }
}

/// Targets of several bands: each loads and stores its own rows.
#[test]
fn bands_load_and_store_their_rows() {
    let gpu = gpu();
    let extent = Extent::new(4096, 2100); // two bands
    let images = (
        target(&gpu, "color", extent, Format::Rgba8Unorm),
        target(&gpu, "depth", extent, Format::D32Float),
    );
    let mut random = Random::new(1);
    let texels: Vec<u8> =
        (0..extent.pixels()).map(|_| random.bits() as u32).flat_map(u32::to_ne_bytes).collect();
    let depths: Vec<f32> =
        (0..extent.pixels()).map(|i| if i % 3 == 0 { 0.25 } else { 0.75 }).collect();
    images.0.upload(&[&texels]).unwrap();
    images.1.upload(&[bytemuck::cast_slice::<_, u8>(&depths)]).unwrap();
    let color = ColorTarget::on_device(&images.0, LoadOp::Load);
    let mut pass = whole(
        extent,
        color,
        "#version 450
layout(location = 0) out vec4 color;
void main() { color = vec4(mod(gl_FragCoord.xy, 256.0) / 255.0, 0, 1); }",
    );
    pass.depth = Some(DepthTarget::on_device(&images.1, LoadOp::Load));
    compute::Renderer::new(&gpu).unwrap().prepare(&pass).unwrap().execute().unwrap();
    let drawn = images.0.download(0).unwrap();
    for (i, texel) in drawn.bytes.chunks_exact(4).enumerate() {
        let (x, y) = (i % extent.width as usize, i / extent.width as usize);
        let expected = match i % 3 {
            0 => texels[4 * i..][..4].to_vec(),
            _ => vec![x as u8, y as u8, 0, 255], // the pixel's centre is half a step further, and rounds down to even
        };
        let near = texel.iter().zip(&expected).all(|(a, b)| a.abs_diff(*b) <= 1);
        assert!(near, "pixel {x},{y}: {texel:?}, not {expected:?}");
    }
    let depth = images.1.download(0).unwrap().depths();
    assert!(depth.iter().enumerate().all(|(i, z)| *z == if i % 3 == 0 { 0.25 } else { 0.5 }));
}

const SHADOWED: &str = "#version 450
layout(binding = 0) uniform sampler2D depths;
layout(location = 0) out vec4 color;
void main() { color = vec4(texelFetch(depths, ivec2(gl_FragCoord.xy), 0).r); }";

/// A pass without colour leaves depth, which the next pass samples.
#[test]
fn depth_alone_is_drawn_and_sampled() {
    on_each_gpu("depth alone is drawn and sampled", |gpu| {
        let extent = Extent::new(33, 17);
        let depth = target(gpu, "shadow map", extent, Format::D32Float);
        let shown = target(gpu, "shown", extent, Format::Rgba16Float);
        // A shader that writes a colour, one that writes nothing, and one that discards.
        for (fragment, covered) in [
            ("layout(location = 0) out vec4 c; void main() { c = vec4(1); }", [true; 2]),
            ("void main() {}", [true; 2]),
            ("void main() { if (gl_FragCoord.x > 16.0) discard; }", [true, false]),
        ] {
            let fragment = format!("#version 450\n{fragment}");
            let any = ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4]);
            let mut shadow = whole(extent, any.clone(), &fragment);
            shadow.colors.clear();
            shadow.depth = Some(DepthTarget::on_device(&depth, LoadOp::Clear(1.0)));
            let color = ColorTarget::on_device(&shown, LoadOp::clear([0.0; 4]));
            let mut light = whole(extent, color, SHADOWED);
            light.draws[0].sets = vec![textures(&[&depth])];
            let mut executors: Vec<Box<dyn Executor>> =
                vec![Box::new(compute::Renderer::new(gpu).unwrap())];
            if gpu.has_graphics() {
                executors.push(Box::new(classic::Renderer::new(gpu).unwrap()));
            }
            for executor in &mut executors {
                let frame = executor.render(&shadow).unwrap();
                assert!(frame.colors.is_empty());
                let depths = frame.depth.unwrap().depths();
                let expected = covered.map(|c| if c { 0.5 } else { 1.0 });
                assert_eq!((depths[0], depths[32]), expected.into(), "{fragment}");
                let lit = executor.render(&light).unwrap().into_color().unwrap();
                let red = |x| {
                    image::half_to_f32(u16::from_ne_bytes(lit.texel(x, 3)[..2].try_into().unwrap()))
                };
                assert_eq!((red(0), red(32)), expected.into(), "{fragment}");
                assert_eq!(shown.download(0).unwrap(), lit);
            }
        }
    });
}

/// Two images in turns: each frame reads the last one.
#[test]
fn frames_feed_frames() {
    on_each_gpu("frames feed frames", |gpu| {
        let extent = Extent::new(20, 11);
        let images = ["even", "odd"].map(|name| target(gpu, name, extent, Format::Rgba8Unorm));
        let step = "#version 450
layout(binding = 0) uniform sampler2D before;
layout(location = 0) out vec4 color;
void main() { color = texelFetch(before, ivec2(gl_FragCoord.xy), 0) + vec4(1, 2, 3, 4) / 255.0; }";
        let passes = [0, 1].map(|n| {
            let color = ColorTarget::on_device(&images[n], LoadOp::clear([0.0; 4]));
            let mut pass = whole(extent, color, step);
            pass.draws[0].sets = vec![textures(&[&images[1 - n]])];
            pass
        });
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let mut prepared = passes.map(|pass| renderer.prepare(&pass).unwrap());
        for frame in 0..10 {
            prepared[frame % 2].execute().unwrap();
        }
        let last = images[1].download(0).unwrap();
        assert!(
            last.bytes.chunks(4).all(|texel| texel == [10, 20, 30, 40]),
            "{:?}",
            last.texel(0, 0)
        );
    });
}

#[test]
fn targets_that_are_discarded_are_not_returned() {
    on_each_gpu("targets that are discarded are not returned", |gpu| {
        let extent = Extent::new(9, 9);
        let red = "#version 450
layout(location = 0) out vec4 color;
void main() { color = vec4(1, 0, 0, 1); }";
        let mut executors: Vec<Box<dyn Executor>> =
            vec![Box::new(compute::Renderer::new(gpu).unwrap())];
        if gpu.has_graphics() {
            executors.push(Box::new(classic::Renderer::new(gpu).unwrap()));
        }
        for executor in &mut executors {
            let mut pass = whole(extent, ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4]), red);
            let mut depth = DepthTarget::cleared(1.0);
            depth.store = StoreOp::Discard;
            pass.depth = Some(depth);
            let frame = executor.render(&pass).unwrap();
            assert_eq!(frame.colors[0].texel(4, 4), [255, 0, 0, 255]);
            assert!(frame.depth.is_none());
            pass.colors[0].store = StoreOp::Discard;
            assert!(executor.render(&pass).unwrap().colors.is_empty());
        }
        let mut pass = whole(extent, ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4]), red);
        pass.colors[0].store = StoreOp::Discard;
        let mut prepared = compute::Renderer::new(gpu).unwrap().prepare(&pass).unwrap();
        prepared.execute().unwrap();
        let error = prepared.read_color().unwrap_err();
        assert!(
            matches!(&error, Error::Usage(text) if text.contains("stores no colour")),
            "{error}"
        );
    });
}

#[test]
fn targets_that_cannot_be_are_refused() {
    let gpu = gpu();
    let extent = Extent::new(8, 8);
    let color = target(&gpu, "color", extent, Format::Rgba8Unorm);
    let depth = target(&gpu, "depth", extent, Format::D32Float);
    let plain = || {
        let fragment = "#version 450
layout(binding = 0) uniform sampler2D image;
layout(location = 0) out vec4 color;
void main() { color = texture(image, vec2(0)); }";
        let other = target(&gpu, "other", extent, Format::Rgba8Unorm);
        let mut pass =
            whole(extent, ColorTarget::on_device(&color, LoadOp::clear([0.0; 4])), fragment);
        pass.depth = Some(DepthTarget::on_device(&depth, LoadOp::Clear(1.0)));
        pass.draws[0].sets = vec![textures(&[&other])];
        pass
    };
    plain().validate().unwrap();
    let refused = |words: &[&str], spoil: &dyn Fn(&mut Pass)| {
        let mut pass = plain();
        spoil(&mut pass);
        match pass.validate() {
            Err(Error::Usage(text)) if words.iter().all(|word| text.contains(word)) => {}
            other => panic!("not refused with {words:?}: {other:?}"),
        }
    };
    let picture = |format, extent| Arc::new(image::Picture::zeroed(extent, format));
    refused(&["9 colour targets", "at most 8"], &|p| p.colors = vec![p.colors[0].clone(); 9]);
    refused(&["nothing to load"], &|p| {
        (p.colors[0].image, p.colors[0].load) = (None, LoadOp::Load);
    });
    refused(&["nothing to load"], &|p| {
        let depth = p.depth.as_mut().unwrap();
        (depth.image, depth.load) = (None, LoadOp::Load);
    });
    refused(&["`color`", "8x8", "8x9"], &|p| p.extent.height = 9);
    refused(&["`color`", "Rgba8Unorm", "Rgba8Srgb"], &|p| {
        p.colors[0].format = Format::Rgba8Srgb;
    });
    refused(&["`color`", "Rgba8Unorm", "no format of a depth target"], &|p| {
        p.depth = Some(DepthTarget::on_device(&color, LoadOp::Load));
    });
    refused(&["D32Float", "no format of a colour"], &|p| {
        p.colors = vec![ColorTarget::on_device(&depth, LoadOp::Load)];
    });
    refused(&["picture", "8x7"], &|p| {
        p.colors[0].load = LoadOp::Picture(picture(Format::Rgba8Unorm, Extent::new(8, 7)));
    });
    refused(&["picture", "Rgba8Srgb"], &|p| {
        p.colors[0].load = LoadOp::Picture(picture(Format::Rgba8Srgb, extent));
    });
    refused(&["3 bytes", "256"], &|p| {
        let short = image::Picture { extent, format: Format::Rgba8Unorm, bytes: vec![0; 3] };
        p.colors[0].load = LoadOp::Picture(Arc::new(short));
    });
    refused(&["depth of 2", "0..=1"], &|p| {
        let mut far = image::Picture::zeroed(extent, Format::D32Float);
        far.bytes[..4].copy_from_slice(&2f32.to_ne_bytes());
        p.depth.as_mut().unwrap().load = LoadOp::Picture(Arc::new(far));
    });
    refused(&["3 bytes", "256"], &|p| {
        let short = image::Picture { extent, format: Format::D32Float, bytes: vec![0; 3] };
        p.depth.as_mut().unwrap().load = LoadOp::Picture(Arc::new(short));
    });
    for own in [&color, &depth] {
        refused(&["target of the pass that binds it"], &|p| {
            p.draws[0].sets = vec![textures(&[own])]
        });
    }
    let usage = ImageUse::Sampled;
    let (name, format) = ("sampled", Format::Rgba8Unorm);
    let sampled = Image::new(&gpu, &ImageInfo::new(name, extent, format, usage)).unwrap();
    refused(&["`sampled`", "ImageUse::Attachment"], &|p| p.colors[0].image = Some(sampled.clone()));
    refused(&["`sampled`", "ImageUse::Attachment"], &|p| {
        p.draws[0].sets = vec![textures(&[&sampled])];
    });

    // Images of another device, as target and as texture.
    let other = crate::common::gpu();
    let stranger = target(&other, "stranger", extent, Format::Rgba8Unorm);
    for spoil in
        [&(|p: &mut Pass| p.colors[0].image = Some(stranger.clone())) as &dyn Fn(&mut Pass), &|p| {
            p.draws[0].sets = vec![textures(&[&stranger])]
        }]
    {
        let mut pass = plain();
        spoil(&mut pass);
        let mut executors: Vec<Box<dyn Executor>> =
            vec![Box::new(compute::Renderer::new(&gpu).unwrap())];
        if gpu.has_graphics() {
            executors.push(Box::new(classic::Renderer::new(&gpu).unwrap()));
        }
        for executor in &mut executors {
            let error = executor.render(&pass).unwrap_err();
            assert!(error.to_string().contains("stranger"), "{error}");
        }
    }
}
