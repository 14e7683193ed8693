//! Do shaders read and write storage images as on the device itself, and does what follows find what they wrote?

use crate::common::{kernel_spirv, on_each_gpu};
use std::sync::Arc;
use tilewright::{
    Error, classic, compute,
    format::Format,
    image::{Extent, Shape},
    pass::{Binding, BindingEntry, BindingSet, Draw, Executor, Pass, Pipeline},
    shader::{Shader, Stage},
    target::{ColorTarget, LoadOp},
    texture::{Sampler, Texture},
    vk::{Gpu, Image, ImageInfo, ImageUse, Kernel, KernelInfo, ResourceTable},
};

const EXTENT: Extent = Extent::new(60, 44);

/// Three triangles that overlap. Their corners are at sixteenths of a pixel, so that devices with fewer subpixel bits cover
/// the same pixels.
const VERTEX: &str = "#version 450
layout(location = 0) flat out int number;
void main() {
    vec2 corners[9] = vec2[](vec2(3.0625, 4.25), vec2(51.3125, 8.75), vec2(21.1875, 41.5), vec2(57.0625, 24.25),
        vec2(12.4375, 28.625), vec2(36.3125, 2.1875), vec2(27.0625, 42.875), vec2(58.5625, 39.6875),
        vec2(39.1875, 17.5625));
    gl_Position = vec4(corners[gl_VertexIndex] / vec2(30, 22) - 1, 0.5, 1.0);
    number = gl_VertexIndex / 3;
}";

fn image(gpu: &Gpu, format: Format, shape: Shape) -> Image {
    let info = ImageInfo::new("written", EXTENT, format, ImageUse::Storage).shape(shape);
    Image::new(gpu, &info).unwrap()
}

/// A pass that draws the triangles with a fragment shader, to a colour target with 1 where they are.
fn pass(declarations: &str, body: &str, resources: Vec<Binding>) -> Pass {
    let fragment = format!(
        "#version 450
        layout(location = 0) flat in int number;
        layout(location = 0) out vec4 color;
        {declarations}
        void main() {{ color = vec4(1); ivec2 at = ivec2(gl_FragCoord.xy); {body} }}"
    );
    let shader = |stage, source: &str| {
        Arc::new(Shader::from_glsl(stage, "storage", source).unwrap_or_else(|e| panic!("{e}")))
    };
    let mut pass = Pass::new("storage", EXTENT);
    pass.colors = vec![ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])];
    pass.depth = None;
    let pipeline =
        Pipeline::new("storage", shader(Stage::Vertex, VERTEX), shader(Stage::Fragment, &fragment));
    pass.pipelines = vec![Arc::new(pipeline)];
    let entry = |(binding, resource)| BindingEntry { binding, resources: vec![resource] };
    let sets = vec![Arc::new(BindingSet { entries: (0..).zip(resources).map(entry).collect() })];
    pass.draws = vec![Draw::new(0, 9).sets(sets)];
    pass
}

fn stored(image: &Image) -> Binding {
    Binding::StorageImage(Arc::new(Texture::on_device(image)))
}

fn each_executor(gpu: &Gpu, mut case: impl FnMut(&str, &mut dyn Executor)) {
    case("compute", &mut compute::Renderer::new(gpu).unwrap());
    case("classic", &mut classic::Renderer::new(gpu).unwrap());
}

/// Exactly the pixels that are drawn are written, each fragment in the order of the API; helpers write nothing.
#[test]
fn fragments_write_what_they_cover() {
    on_each_gpu("fragments write what they cover", |gpu| {
        let declared = "layout(binding = 0, rgba8) uniform image2D written;";
        let body = "vec4 before = imageLoad(written, at);
            float slope = dFdx(gl_FragCoord.x);
            imageStore(written, at, vec4(slope, before.g * 0.5 + (number + 1) / 8.0, before.b + 1 / 16.0, 1));";
        let mut pictures = Vec::new();
        each_executor(gpu, |name, executor| {
            let written = image(gpu, Format::Rgba8Unorm, Shape::D2);
            let pass = pass(declared, body, vec![stored(&written)]);
            let color = executor.render(&pass).unwrap().into_color().unwrap();
            let written = written.download(0).unwrap();
            for (covered, texel) in color.bytes.chunks(4).zip(written.bytes.chunks(4)) {
                assert_eq!(covered[0], texel[3], "{name}: {covered:?} {texel:?}");
            }
            pictures.push((color, written));
        });
        assert!(pictures[0].0 == pictures[1].0, "the same pixels are covered");
        // Of two fragments at a pixel, both load before either stores, where the device overlaps them. So only pixels that
        // one triangle covers are compared with `classic`.
        let texels = pictures[0].1.bytes.chunks(4).zip(pictures[1].1.bytes.chunks(4));
        let single = texels.filter(|(ours, _)| ours[2] == 16).inspect(|(ours, theirs)| {
            assert_eq!(ours[1], theirs[1]);
        });
        assert!(single.count() > 500);
        let twice = pictures[0].1.bytes.chunks(4).filter(|texel| texel[2] >= 32).count();
        assert!(twice > 100, "{twice} pixels are written in order");
    });
}

/// Layers, slices and half floats; and a vertex shader that writes.
#[test]
fn all_shapes_are_written() {
    on_each_gpu("all shapes are written", |gpu| {
        for (shape, ty, at) in [
            (Shape::D2Array(3), "image2DArray", "ivec3(at, number)"),
            (Shape::D3(3), "image3D", "ivec3(at, number)"),
        ] {
            let declared = format!("layout(binding = 0, rgba16f) writeonly uniform {ty} written;");
            let body = format!("imageStore(written, {at}, vec4(number + 0.5, -2, 0, 1));");
            let mut pictures = Vec::new();
            each_executor(gpu, |_, executor| {
                let written = image(gpu, Format::Rgba16Float, shape);
                executor.render(&pass(&declared, &body, vec![stored(&written)])).unwrap();
                pictures.push(written.download(0).unwrap());
            });
            assert!(pictures[0] == pictures[1], "{shape:?}");
            for layer in 0..3 {
                let bytes = EXTENT.pixels() * 8;
                let of_layer = &pictures[0].bytes[layer * bytes..(layer + 1) * bytes];
                let half = [0x3800u16, 0x3e00, 0x4100][layer].to_le_bytes();
                let is_written = |texel: &[u8]| texel[..2] == half && texel[2..4] == [0, 0xc0];
                let count = of_layer.chunks(8).filter(|texel| is_written(texel)).count();
                assert!(count > 200, "{shape:?}, layer {layer}: {count}");
                assert!(of_layer.chunks(8).all(|texel| is_written(texel) || texel == [0; 8]));
            }
        }
    });
}

/// What a pass writes, the next one samples, and the frame after it finds; a kernel of the user writes in between.
#[test]
fn what_is_written_is_found_by_what_follows() {
    const KERNEL: &str = "#version 460
#extension GL_EXT_nonuniform_qualifier : require
layout(local_size_x = 8, local_size_y = 8) in;
layout(set = 1, binding = 3, rgba8) uniform image2D images[];
layout(push_constant) uniform Push { uint image; };
void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    if (any(greaterThanEqual(at, imageSize(images[image])))) return;
    vec4 before = imageLoad(images[image], at);
    imageStore(images[image], at, vec4(before.r, before.r * 0.5, before.ba));
}";
    on_each_gpu("what is written is found by what follows", |gpu| {
        let spirv = kernel_spirv(KERNEL);
        let info = KernelInfo::new("halve", &spirv);
        let kernel = Kernel::new(gpu, &info).unwrap();
        let written = image(gpu, Format::Rgba8Unorm, Shape::D2);
        let shown = ImageInfo::new("shown", EXTENT, Format::Rgba8Unorm, ImageUse::Attachment);
        let shown = Image::new(gpu, &shown).unwrap();
        let mut table = ResourceTable::new(gpu).unwrap();
        let slot = table.insert_storage_image(&written).unwrap();
        let mut adds = pass(
            "layout(binding = 0, rgba8) uniform image2D written;",
            "if (number == 0) imageStore(written, at, imageLoad(written, at) + vec4(0.25, 0, 0, 0.25));",
            vec![stored(&written)],
        );
        adds.colors.clear();
        let bound = Binding::Sampled(Arc::new(Texture::on_device(&written)), Sampler::nearest());
        let mut shows = pass(
            "layout(binding = 0) uniform sampler2D written;",
            "color = texelFetch(written, at, 0);",
            vec![bound],
        );
        shows.colors = vec![ColorTarget::on_device(&shown, LoadOp::clear([0.0; 4]))];
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for number in 1..=3u8 {
            let mut frame = renderer.begin().unwrap();
            frame.encode(&adds).unwrap();
            let groups = [EXTENT.width.div_ceil(8), EXTENT.height.div_ceil(8), 1];
            frame.kernel(&kernel).table(&table).push(&slot).dispatch(groups).unwrap();
            frame.encode(&shows).unwrap();
            frame.submit().unwrap().wait().unwrap();
            let picture = shown.download(0).unwrap();
            let red = (u32::from(number) * 255).div_ceil(4) as u8;
            let lit: Vec<_> = picture.bytes.chunks(4).filter(|texel| texel[3] != 0).collect();
            assert!(lit.len() > 300);
            for texel in lit {
                assert!(
                    texel[0].abs_diff(red) <= 1 && texel[1].abs_diff(red / 2) <= 1,
                    "{texel:?}"
                );
            }
        }
        // It is a target, too, and can be uploaded.
        written.upload(&[vec![7; EXTENT.pixels() * 4]]).unwrap();
        let mut draws = pass("", "color = vec4(1);", Vec::new());
        draws.colors = vec![ColorTarget::on_device(&written, LoadOp::Load)];
        each_executor(gpu, |name, executor| {
            let drawn = executor.render(&draws).unwrap().into_color().unwrap();
            let count = drawn.bytes.chunks(4).filter(|texel| *texel == [255; 4]).count();
            let rest = drawn.bytes.chunks(4).filter(|texel| *texel == [7; 4]).count();
            assert!(count > 800 && count + rest == EXTENT.pixels(), "{name}");
        });
    });
}

#[test]
fn what_is_no_storage_image_is_refused() {
    on_each_gpu("what is no storage image is refused", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let mut refused = |binding, declared: &str, parts: &[&str]| {
            let body = "imageStore(written, at, vec4(1));";
            match renderer.render(&pass(declared, body, vec![binding])).map(drop) {
                Err(Error::Usage(fault)) => {
                    assert!(parts.iter().all(|part| fault.contains(part)), "{fault}");
                }
                other => panic!("{parts:?}: {other:?}"),
            }
        };
        let rgba8 = "layout(binding = 0, rgba8) writeonly uniform image2D written;";
        let (extent, format) = (EXTENT, Format::Rgba8Unorm);
        let host = Texture::new("host", extent, format, vec![vec![0; EXTENT.pixels() * 4]]);
        let host = Arc::new(host);
        refused(Binding::StorageImage(host.clone()), rgba8, &["`host`", "`ImageUse::Storage`"]);
        refused(Binding::Texture(host), rgba8, &["a storage image in the shader"]);
        let target = ImageInfo::new("target", extent, format, ImageUse::Attachment);
        refused(stored(&Image::new(gpu, &target).unwrap()), rgba8, &["`target`", "Storage"]);
        let half = image(gpu, Format::Rgba16Float, Shape::D2);
        refused(stored(&half), rgba8, &["Rgba8Unorm", "`written` is Rgba16Float"]);
        let layers = image(gpu, format, Shape::D2Array(2));
        refused(stored(&layers), rgba8, &["two-dimensional", "D2Array(2)"]);
        for format in [Format::Rgba8Srgb, Format::D32Float] {
            let info = ImageInfo::new("odd", EXTENT, format, ImageUse::Storage);
            match Image::new(gpu, &info).map(drop) {
                Err(Error::Device(fault)) => {
                    assert!(fault.contains("`odd`") && fault.contains("Storage"), "{fault}");
                }
                // Some device may have them.
                other => other.unwrap(),
            }
        }
    });
}
