//! Are textures of all dimensions and samplers of all states sampled as by the device's own pipeline, drawn to layer by
//! layer, and refused where a shader declares something else?

use crate::common::{on_each_gpu, random::Random};
use std::sync::Arc;
use tilewright::{
    Error, classic, compute,
    format::Format,
    image::{Extent, Shape},
    pass::{Binding, BindingEntry, BindingSet, Draw, Executor, Frame, Pass, Pipeline},
    shader::{Shader, Stage},
    state::Compare,
    target::{ColorTarget, DepthTarget, LoadOp},
    texture::{Border, Filter, Sampler, Texture, Wrap},
    vk::{Gpu, Image, ImageInfo, ImageUse},
};

const EXTENT: Extent = Extent::new(48, 40);

/// A triangle that covers everything. `at` runs from -0.6 to 1.7 in four directions, so that samples fall outside, and
/// between levels.
const VERTEX: &str = "#version 450
layout(location = 0) out vec4 at;
void main() {
    vec2 corner = vec2(2 * (gl_VertexIndex & 1), 2 * (gl_VertexIndex >> 1));
    gl_Position = vec4(2 * corner - 1, 0.5, 1.0);
    at = vec4(corner.x, corner.y, 1.0 - corner.x, corner.x * corner.y) * 2.3 - 0.6;
}";

fn shader(stage: Stage, source: &str) -> Result<Shader, Error> {
    Shader::from_glsl(stage, "textures", source)
}

fn fragment(declarations: &str, color: &str) -> String {
    format!(
        "#version 450
        layout(location = 0) in vec4 at;
        layout(location = 0) out vec4 color;
        {declarations}
        void main() {{ color = {color}; }}"
    )
}

/// A pass that draws with a fragment shader and these resources at set 0.
pub fn pass(declarations: &str, color: &str, resources: Vec<Binding>) -> Pass {
    let mut pass = Pass::new("textures", EXTENT);
    pass.colors = vec![ColorTarget::cleared(Format::Rgba16Float, [0.0; 4])];
    let made =
        |stage, source: &str| Arc::new(shader(stage, source).unwrap_or_else(|e| panic!("{e}")));
    let (vertex, fragment) =
        (made(Stage::Vertex, VERTEX), made(Stage::Fragment, &fragment(declarations, color)));
    pass.pipelines = vec![Arc::new(Pipeline::new("textures", vertex, fragment))];
    let entry = |(binding, resource)| BindingEntry { binding, resources: vec![resource] };
    let entries = (0..).zip(resources).map(entry).collect();
    pass.draws = vec![Draw::new(0, 3).sets([Arc::new(BindingSet { entries })])];
    pass
}

/// Random texels for all levels.
pub fn levels(random: &mut Random, shape: Shape, extent: Extent, count: u32) -> Vec<Vec<u8>> {
    let bytes = |level: u32| {
        let (width, height) = ((extent.width >> level).max(1), (extent.height >> level).max(1));
        (width * height * 4 * shape.pictures(level)) as usize
    };
    (0..count).map(|n| (0..bytes(n)).map(|_| random.below(256) as u8).collect()).collect()
}

/// Shapes with an extent, the type in GLSL, the coordinates, and those of whole texels.
const KINDS: [(Shape, Extent, &str, &str, &str); 7] = [
    (Shape::D1, Extent::new(13, 1), "sampler1D", "at.x", "p.x"),
    (
        Shape::D1Array(5),
        Extent::new(8, 1),
        "sampler1DArray",
        "vec2(at.x, at.y * 4)",
        "ivec2(p.x, p.z)",
    ),
    (Shape::D2, Extent::new(12, 9), "sampler2D", "at.xy", "p.xy"),
    (Shape::D2Array(6), Extent::new(7, 10), "sampler2DArray", "vec3(at.xy, at.z * 5)", "p"),
    (Shape::D3(11), Extent::new(9, 6), "sampler3D", "at.xyz", "p"),
    (Shape::Cube, Extent::new(8, 8), "samplerCube", "at.xyz - 0.4", ""),
    (
        Shape::CubeArray(3),
        Extent::new(4, 4),
        "samplerCubeArray",
        "vec4(at.zyx - 0.5, at.w * 3)",
        "",
    ),
];

pub type Both = (compute::Renderer, classic::Renderer);

pub fn both(gpu: &Gpu) -> Both {
    (compute::Renderer::new(gpu).unwrap(), classic::Renderer::new(gpu).unwrap())
}

/// Both executors draw the pass; how many components of the colours differ by more than `limit`, and the largest difference.
pub fn differences((compute, classic): &mut Both, pass: &Pass, limit: f32) -> (usize, f32) {
    // The device's own pipeline first, see below.
    let theirs = classic.render(pass).unwrap();
    distances(&compute.render(pass).unwrap(), &theirs, limit)
}

/// How many components of the colours of two frames differ by more than `limit`, and the largest difference.
pub fn distances(one: &Frame, other: &Frame, limit: f32) -> (usize, f32) {
    let [one, other] = [one, other].map(|frame| {
        let halves = frame.colors[0].bytes.chunks(2);
        halves.map(|b| half(u16::from_le_bytes([b[0], b[1]]))).collect::<Vec<f32>>()
    });
    let distances: Vec<_> = one.iter().zip(&other).map(|(a, b)| (a - b).abs()).collect();
    let most = distances.iter().fold(0.0f32, |most, d| most.max(*d));
    (distances.iter().filter(|d| **d > limit).count(), most)
}

fn half(bits: u16) -> f32 {
    let (sign, exponent, fraction) = (bits >> 15, bits >> 10 & 31, f32::from(bits & 1023));
    let magnitude = match exponent {
        0 => fraction * 2.0f32.powi(-24),
        e => (1.0 + fraction / 1024.0) * 2.0f32.powi(i32::from(e) - 15),
    };
    if sign == 1 { -magnitude } else { magnitude }
}

#[test]
fn each_shape_is_sampled_as_on_the_device() {
    let samplers = [
        Sampler::default(),
        Sampler::nearest(),
        Sampler::default().wrap_u(Wrap::MirroredRepeat).mip(Some(Filter::Nearest)),
        Sampler::default()
            .wrap_u(Wrap::ClampToBorder)
            .wrap_v(Wrap::ClampToBorder)
            .wrap_w(Wrap::ClampToBorder)
            .border(Border::OpaqueWhite),
        Sampler::nearest()
            .wrap_u(Wrap::ClampToBorder)
            .wrap_v(Wrap::MirroredRepeat)
            .wrap_w(Wrap::ClampToBorder)
            .border(Border::OpaqueBlack),
        Sampler::default().lod_bias(1.25).min_lod(0.5).max_lod(1.75),
    ];
    on_each_gpu("each shape is sampled as on the device", |gpu| {
        let (mut random, mut both) = (Random::new(7), both(gpu));
        for (shape, extent, ty, at, _) in KINDS {
            let label = format!("{shape:?}");
            let content = levels(&mut random, shape, extent, 3);
            let cube = matches!(shape, Shape::Cube | Shape::CubeArray(_));
            let texture = if cube && gpu.info().name.contains("SwiftShader") {
                // SwiftShader brings the edges of a cube in order when it draws with the cube, and forgets to do so when
                // it computes. So an image is sampled that the device's own pipeline samples first.
                let info = ImageInfo::new(&label, extent, Format::Rgba8Unorm, ImageUse::Attachment);
                let image = Image::new(gpu, &info.shape(shape).levels(3)).unwrap();
                image.upload(&content).unwrap();
                Texture::on_device(&image)
            } else {
                Texture::of_shape(&label, shape, extent, Format::Rgba8Unorm, content)
            };
            let texture = Arc::new(texture);
            for (n, sampler) in samplers.into_iter().enumerate() {
                let declared = format!("layout(binding = 0) uniform {ty} image;");
                let given = format!("textureLod(image, {at}, at.w * 1.5)");
                let resources = || vec![Binding::Sampled(texture.clone(), sampler)];
                let found = differences(&mut both, &pass(&declared, &given, resources()), 0.002);
                assert_eq!(found.0, 0, "{label}, sampler {n}: a given level, by up to {}", found.1);
                // How a device rounds an implicit level of detail differs from how it rounds that of gradients.
                let (wrong, most) = differences(
                    &mut both,
                    &pass(&declared, &format!("texture(image, {at})"), resources()),
                    0.02,
                );
                // Of cubes, Vulkan lets a device approximate the level. SwiftShader has another approximation for gradients
                // than for an implicit level, which shows between levels and where a quad lies on two faces.
                let allowed = if cube && !gpu.has_compute_derivatives() { 1000 } else { 60 };
                assert!(wrong < allowed, "{label}, sampler {n}: {wrong} differ, by up to {most}");
            }
        }
    });
}

/// Each texel of each layer and level is where it was put, by uploads of textures and of images.
#[test]
fn texels_are_where_they_were_put() {
    on_each_gpu("texels are where they were put", |gpu| {
        let mut random = Random::new(8);
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for (shape, extent, ty, _, texel) in KINDS.into_iter().filter(|kind| !kind.4.is_empty()) {
            let content = levels(&mut random, shape, extent, 3);
            let label = format!("{shape:?}");
            let (format, usage) = (Format::Rgba8Unorm, ImageUse::Attachment);
            let host = Texture::of_shape(&label, shape, extent, format, content.clone());
            let info = ImageInfo::new(&label, extent, format, usage).shape(shape).levels(3);
            let image = Image::new(gpu, &info).unwrap();
            image.upload(&content).unwrap();
            for texture in [host, Texture::on_device(&image)] {
                let texture = Arc::new(texture);
                for (level, content) in (0..).zip(&content) {
                    let size = Extent::new(
                        (extent.width >> level).max(1),
                        (extent.height >> level).max(1),
                    );
                    for layer in 0..shape.pictures(level) {
                        let declared = format!(
                            "layout(binding = 0) uniform {ty} image;
                            layout(push_constant) uniform Push {{ int level; int layer; }};"
                        );
                        let color = format!(
                            "texelFetch(image, {}, level)",
                            texel.replace('p', "ivec3(gl_FragCoord.xy, layer)")
                        );
                        let bound = Binding::Sampled(texture.clone(), Sampler::nearest());
                        let mut pass = pass(&declared, &color, vec![bound]);
                        pass.extent = size;
                        pass.colors = vec![ColorTarget::cleared(format, [0.0; 4])];
                        pass.draws[0].push_constants =
                            bytemuck::cast_slice(&[level, layer]).to_vec();
                        let drawn = renderer.render(&pass).unwrap().into_color().unwrap().bytes;
                        let from = layer as usize * size.pixels() * 4;
                        let expected = &content[from..from + size.pixels() * 4];
                        assert!(drawn == expected, "{label}, level {level}, layer {layer}");
                        let read = image.download_layer(level, layer).unwrap();
                        assert!(read.bytes == expected && read.extent == size, "{label}");
                    }
                    assert!(image.download(level).unwrap().bytes == *content, "{label}");
                }
            }
        }
    });
}

/// Passes draw to single faces, layers, slices and levels; the others keep what they hold.
#[test]
fn passes_draw_to_layers_and_levels() {
    on_each_gpu("passes draw to layers and levels", |gpu| {
        let mut both = both(gpu);
        for (shape, format) in [
            (Shape::Cube, Format::Rgba8Unorm),
            (Shape::D2Array(3), Format::Rgba16Float),
            (Shape::D3(4), Format::Rgba8Unorm),
            (Shape::D2Array(3), Format::D32Float),
            (Shape::D2Array(3), Format::D16Unorm),
        ] {
            let extent = Extent::new(20, 20);
            let info = ImageInfo::new("target", extent, format, ImageUse::Attachment);
            let info = info.shape(shape).levels(3);
            let images = [0; 2].map(|_| Image::new(gpu, &info).unwrap());
            let mut drawn = Vec::new();
            for level in 0..3 {
                for layer in 0..shape.pictures(level) {
                    if (level + layer) % 3 == 2 {
                        continue;
                    }
                    drawn.push((level, layer));
                    let value = (1 + level * 4 + layer) as f32 / 32.0;
                    let color = format!("vec4(step(0.5, at.x) * {value}); gl_FragDepth = color.x");
                    for (n, image) in images.iter().enumerate() {
                        let mut pass = pass("", &color, Vec::new());
                        pass.extent = Extent::new(20 >> level, 20 >> level);
                        (pass.colors, pass.depth) = (Vec::new(), None);
                        let load = layer % 2 == 0;
                        match format {
                            format if format.is_depth() => {
                                let load = if load { LoadOp::Load } else { LoadOp::Clear(0.25) };
                                let mut target = DepthTarget::on_device(image, load);
                                (target.level, target.layer) = (level, layer);
                                pass.depth = Some(target);
                                let pipeline = Arc::make_mut(&mut pass.pipelines[0]);
                                pipeline.depth.compare = Compare::Always;
                            }
                            _ => {
                                let load =
                                    if load { LoadOp::Load } else { LoadOp::clear([0.5; 4]) };
                                let mut target = ColorTarget::on_device(image, load);
                                (target.level, target.layer) = (level, layer);
                                pass.colors.push(target);
                            }
                        }
                        match n {
                            0 => drop(both.0.render(&pass).unwrap()),
                            _ => drop(both.1.render(&pass).unwrap()),
                        }
                    }
                }
            }
            for level in 0..3 {
                for layer in 0..shape.pictures(level) {
                    let [ours, theirs] =
                        [0, 1].map(|n| images[n].download_layer(level, layer).unwrap());
                    assert!(ours == theirs, "{shape:?} {format:?} level {level}, layer {layer}");
                    let is_drawn = ours.bytes.iter().any(|byte| *byte != 0);
                    assert_eq!(is_drawn, drawn.contains(&(level, layer)), "{level} {layer}");
                }
            }
        }
    });
}

/// Mip levels that the device makes of all layers and slices.
#[test]
fn levels_are_made_of_all_layers() {
    on_each_gpu("levels are made of all layers", |gpu| {
        for shape in [Shape::D2Array(3), Shape::D3(4), Shape::Cube] {
            let extent = Extent::new(8, 8);
            let info = ImageInfo::new("levels", extent, Format::Rgba8Unorm, ImageUse::Attachment);
            let image = Image::new(gpu, &info.shape(shape).levels(3)).unwrap();
            let of_layer = |layer: u32| vec![(40 * layer) as u8; 256];
            let first: Vec<u8> = (0..shape.pictures(0)).flat_map(of_layer).collect();
            let rest =
                |level: u32| vec![9; (64 >> (2 * level)) * 4 * shape.pictures(level) as usize];
            image.upload(&[first, rest(1), rest(2)]).unwrap();
            let mut renderer = compute::Renderer::new(gpu).unwrap();
            let mut frame = renderer.begin().unwrap();
            frame.make_levels(&image).unwrap();
            frame.submit().unwrap().wait().unwrap();
            for level in 0..3 {
                for layer in 0..shape.pictures(level) {
                    let expected = match shape {
                        // The mean of two slices, or of four.
                        Shape::D3(_) => [40 * layer, 20 + 80 * layer, 60][level as usize],
                        _ => 40 * layer,
                    };
                    let read = image.download_layer(level, layer).unwrap().bytes;
                    let near = read.iter().all(|byte| byte.abs_diff(expected as u8) <= 1);
                    assert!(near, "{shape:?}, level {level}, layer {layer}: {:?}", &read[..4]);
                }
            }
        }
    });
}

#[test]
fn what_does_not_fit_is_refused_by_name() {
    on_each_gpu("textures that do not fit are refused", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let mut refused =
            |ty: &str, sample: &str, shape, levels: u32, sampler: Sampler, parts: &[&str]| {
                let extent = Extent::new(4, if matches!(shape, Shape::D1) { 1 } else { 4 });
                let mut random = Random::new(1);
                let content = self::levels(&mut random, shape, extent, levels);
                let texture = Texture::of_shape("odd", shape, extent, Format::Rgba8Unorm, content);
                let bound = Binding::Sampled(Arc::new(texture), sampler);
                let declared = format!("layout(binding = 0) uniform {ty} image;");
                let fault = renderer.render(&pass(&declared, sample, vec![bound])).map(drop);
                let fault = fault.expect_err(parts[0]).to_string();
                assert!(parts.iter().all(|part| fault.contains(part)), "{parts:?}: {fault}");
            };
        let plain = Sampler::default();
        refused(
            "samplerCube",
            "texture(image, at.xyz)",
            Shape::D2,
            1,
            plain,
            &["a cube", "`odd`", "D2"],
        );
        refused(
            "sampler2D",
            "texture(image, at.xy)",
            Shape::D3(2),
            1,
            plain,
            &["two-dim", "D3(2)"],
        );
        refused("sampler2DArray", "texture(image, at.xyz)", Shape::D2, 1, plain, &["layers", "D2"]);
        let flat = "texture(image, at.xy)";
        let compares = plain.compare(Some(Compare::Less));
        let shadow = "vec4(texture(image, at.xyz))";
        refused("sampler2DShadow", shadow, Shape::D2, 1, compares, &["depths", "`odd`", "colours"]);
        let texels = Sampler::nearest().unnormalized(true);
        refused("sampler2D", flat, Shape::D2, 1, texels, &["not normalized", "implicit level"]);
        let given = "textureLod(image, at.xy, 0)";
        refused("sampler2D", given, Shape::D2, 2, texels, &["not normalized", "several levels"]);
        let mut table = tilewright::vk::ResourceTable::new(gpu).unwrap();
        for shape in [Shape::D2Array(2), Shape::D3(2), Shape::Cube] {
            let info =
                ImageInfo::new("odd", Extent::new(4, 4), Format::Rgba8Unorm, ImageUse::Attachment);
            let image = Image::new(gpu, &info.shape(shape)).unwrap();
            let fault = table.insert_texture(&image).unwrap_err().to_string();
            assert!(fault.contains("`odd`") && fault.contains("two dimensions"), "{fault}");
        }
        for state in [compares, texels] {
            let sampler = tilewright::vk::Sampler::new(gpu, &state).unwrap();
            assert!(matches!(table.insert_sampler(&sampler), Err(Error::Usage(_))));
        }
        let fault = texels.mip(Some(Filter::Nearest));
        refused("sampler2D", given, Shape::D2, 1, fault, &["not normalized", "`mip` is `None`"]);
        let fault = plain.min_lod(2.0).max_lod(1.0);
        refused("sampler2D", flat, Shape::D2, 1, fault, &["least level of detail is 2"]);
        let fault = plain.lod_bias(f32::NAN);
        refused("sampler2D", flat, Shape::D2, 1, fault, &["finite"]);
        let fault = plain.lod_bias(1e9);
        refused("sampler2D", flat, Shape::D2, 1, fault, &["bias", &gpu.info().name]);
        let fault = plain.anisotropy(0.5);
        refused("sampler2D", flat, Shape::D2, 1, fault, &["anisotropy of 0.5"]);
        let fault = plain.anisotropy(1e9);
        refused("sampler2D", flat, Shape::D2, 1, fault, &["anisotropy", &gpu.info().name]);
        let image = |shape, extent, format| {
            let info = ImageInfo::new("odd", extent, format, ImageUse::Attachment).shape(shape);
            Image::new(gpu, &info).map(drop)
        };
        let square = Extent::new(4, 4);
        for (shape, extent, part) in [
            (Shape::Cube, Extent::new(4, 5), "squares"),
            (Shape::D1, square, "4 texels high"),
            (Shape::D2Array(0), square, "one layer"),
            (Shape::D2Array(5000), square, "at most 2048"),
        ] {
            let fault = image(shape, extent, Format::Rgba8Unorm).unwrap_err().to_string();
            assert!(fault.contains(part) && fault.contains("`odd`"), "{fault}");
        }
        // What Vulkan promises of no device.
        match image(Shape::D3(4), square, Format::D32Float) {
            Err(Error::Device(fault)) => assert!(fault.contains("D3(4)"), "{fault}"),
            other => assert!(other.is_ok(), "{other:?}"),
        }
        let info = ImageInfo::new("odd", square, Format::Rgba8Unorm, ImageUse::Attachment);
        let target = Image::new(gpu, &info.shape(Shape::Cube).levels(2)).unwrap();
        for (level, layer, part) in
            [(2, 0, "no level 2"), (0, 6, "no number 6"), (1, 0, "in level 1")]
        {
            let mut pass = pass("", "vec4(1)", Vec::new());
            pass.extent = square;
            let mut color = ColorTarget::on_device(&target, LoadOp::Load);
            (color.level, color.layer) = (level, layer);
            pass.colors = vec![color];
            let fault = renderer.render(&pass).map(drop).unwrap_err().to_string();
            assert!(fault.contains(part), "{fault}");
        }
    });
}
