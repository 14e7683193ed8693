//! Do shaders sample and store images of every format, and are those refused that no image can be?

use super::{difference, formats};
use crate::{
    common::{gpu, on_each_gpu, random::Random},
    targets,
};
use std::sync::Arc;
use tilewright::{
    Error, classic, compute,
    format::{Format, Numeric, Packing},
    image::{Extent, Picture, srgb_to_linear},
    pass::{Binding, BindingEntry, BindingSet, Executor, Pipeline},
    shader::{Scalar, Shader, Stage},
    target::ColorTarget,
    texture::{Sampler, Texture, Wrap},
    vk::{Image, ImageInfo, ImageUse},
};

/// Textures of every format give shaders the values that they hold, to compute and to classic: drawn by one pass and sampled
/// by the next.
#[test]
fn every_format_is_sampled() {
    on_each_gpu("every format is sampled", |gpu| {
        let mut executors: [(&str, Box<dyn Executor>); 2] = [
            ("compute", Box::new(compute::Renderer::new(gpu).unwrap())),
            ("classic", Box::new(classic::Renderer::new(gpu).unwrap())),
        ];
        let mut random = Random::new(9500);
        let extent = Extent::new(13, 5);
        for format in formats() {
            let image = targets::target(gpu, "sampled", extent, format);
            // Of floats, no infinity and none too small for a normal one, which devices may take for zero.
            let texel = format.texel_bytes();
            let bytes: Vec<u8> = (0..extent.pixels() * texel)
                .map(|_| match format.numeric() {
                    Numeric::Float => 0x34 + random.below(8) as u8,
                    _ => random.bits() as u8,
                })
                .collect();
            image.upload(&[&bytes]).unwrap();
            let (sampler, held, kind) = match Scalar::of(format) {
                Scalar::Float => ("sampler2D", Format::Rgba32Float, "vec4"),
                Scalar::Uint => ("usampler2D", Format::Rgba32Uint, "uvec4"),
                Scalar::Int => ("isampler2D", Format::Rgba32Sint, "ivec4"),
            };
            let fragment = format!(
                "#version 450
                layout(binding = 0) uniform {sampler} image;
                layout(location = 0) out {kind} shown;
                void main() {{
                    vec2 size = vec2(textureSize(image, 0));
                    shown = textureLod(image, gl_FragCoord.xy / size, 0.0);
                }}"
            );
            let color = match Scalar::of(format) {
                Scalar::Float => ColorTarget::cleared(held, [0.0; 4]),
                Scalar::Uint => ColorTarget::cleared(held, [0u32; 4]),
                Scalar::Int => ColorTarget::cleared(held, [0i32; 4]),
            };
            let mut pass = targets::whole(extent, color, &fragment);
            pass.draws[0].sets = vec![targets::textures(&[&image])];
            let picture = Picture { extent, format, bytes: bytes.clone() };
            for (name, executor) in &mut executors {
                let shown = executor.render(&pass).unwrap().into_color().unwrap();
                for (n, (shown, wanted)) in shown.values().zip(picture.values()).enumerate() {
                    let mut wanted = wanted;
                    if format.numeric() == Numeric::Srgb {
                        wanted[..3].iter_mut().for_each(|c| *c = srgb_to_linear(*c));
                    }
                    let near = |(a, b): (f32, f32)| {
                        // Devices divide by 255 as they like. Lavapipe approximates sRGB, and samples texels of 16
                        // bits by way of 8 bits a channel.
                        let allowed = match (format.numeric(), format.packing()) {
                            (Numeric::Srgb, _) => 1.0 / 255.0,
                            (_, Packing::R5g6b5 | Packing::A1r5g5b5) => 1.0 / 255.0,
                            _ => 1e-6,
                        };
                        a == b || a.is_nan() && b.is_nan() || (a - b).abs() <= allowed
                    };
                    let equal = shown.into_iter().zip(wanted).all(near);
                    let what = format!("{}, {name}, {format:?}, pixel {n}", gpu.info());
                    assert!(equal, "{what}: {shown:?}, not {wanted:?}");
                }
            }
        }
    });
}

/// Storage images of every format that the device writes, by both executors.
#[test]
fn every_format_is_stored() {
    on_each_gpu("every format is stored", |gpu| {
        let mut executors: [(&str, Box<dyn Executor>); 2] = [
            ("compute", Box::new(compute::Renderer::new(gpu).unwrap())),
            ("classic", Box::new(classic::Renderer::new(gpu).unwrap())),
        ];
        let extent = Extent::new(9, 7);
        let mut stored = Vec::new();
        for format in formats() {
            let Some(declared) = glsl_name(format) else { continue };
            let info = ImageInfo::new("stored", extent, format, ImageUse::Storage);
            let image = match Image::new(gpu, &info) {
                Err(Error::Device(_)) => continue,
                image => image.unwrap(),
            };
            let (prefix, value) = match Scalar::of(format) {
                Scalar::Float => ("", "vec4(0.25, 0.5, 0.75, 1.0)"),
                Scalar::Uint => ("u", "uvec4(1, 2, 3, 1)"),
                Scalar::Int => ("i", "ivec4(-1, 2, -3, 4)"),
            };
            let fragment = format!(
                "#version 450
                layout(binding = 0, {declared}) uniform {prefix}image2D image;
                void main() {{ imageStore(image, ivec2(gl_FragCoord.xy), {value}); }}"
            );
            let color = ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4]);
            let mut pass = targets::whole(extent, color, &fragment);
            let resource = Binding::StorageImage(Arc::new(Texture::on_device(&image)));
            let entries = vec![BindingEntry { binding: 0, resources: vec![resource] }];
            pass.draws[0].sets = vec![Arc::new(BindingSet { entries })];
            let wanted = match Scalar::of(format) {
                Scalar::Float => Picture::filled(extent, format, [0.25, 0.5, 0.75, 1.0]),
                Scalar::Uint => Picture::filled(extent, format, [1u32, 2, 3, 1]),
                Scalar::Int => Picture::filled(extent, format, [-1i32, 2, -3, 4]),
            };
            for (name, executor) in &mut executors {
                image.upload(&[vec![0; wanted.bytes.len()]]).unwrap();
                executor.render(&pass).unwrap();
                let found = image.download(0).unwrap();
                let most = if format.is_integer() { 0.0 } else { 1.0 };
                let differs = difference(&wanted, &found, most);
                assert!(differs.is_none(), "{}, {name}, {format:?}: {differs:?}", gpu.info());
            }
            stored.push(format);
        }
        // Vulkan makes 11 of them mandatory for every device.
        assert!(stored.len() >= 11, "{stored:?}");
        println!("{}: {} formats of storage images", gpu.info(), stored.len());
    });
}

/// The qualifier of a storage image.
fn glsl_name(format: Format) -> Option<String> {
    let suffix = match (format.numeric(), format.packing()) {
        (Numeric::Srgb | Numeric::Depth, _) => return None,
        (_, Packing::Bgra8 | Packing::R5g6b5 | Packing::A1r5g5b5) => return None,
        (_, Packing::Rg11b10) => return Some("r11f_g11f_b10f".into()),
        (Numeric::Uint, Packing::Rgb10a2) => return Some("rgb10_a2ui".into()),
        (_, Packing::Rgb10a2) => return Some("rgb10_a2".into()),
        (Numeric::Unorm, _) => "",
        (Numeric::Snorm, _) => "_snorm",
        (Numeric::Float, _) => "f",
        (Numeric::Uint, _) => "ui",
        _ => "i",
    };
    let bits = match format.packing() {
        Packing::Bits8 => 8,
        Packing::Bits16 => 16,
        _ => 32,
    };
    Some(format!("{}{bits}{suffix}", &"rgba"[..format.channels()]))
}

#[test]
fn integers_are_sampled_as_they_may_be() {
    let gpu = gpu();
    let mut renderer = compute::Renderer::new(&gpu).unwrap();
    let extent = Extent::new(4, 4);
    let image = targets::target(&gpu, "integers", extent, Format::R32Uint);
    let pass = |kind: &str, sampler: Sampler| {
        let fragment = format!(
            "#version 450
            layout(binding = 0) uniform {kind} image;
            layout(location = 0) out vec4 shown;
            void main() {{ shown = vec4(textureLod(image, vec2(0.5), 0.0)); }}"
        );
        let color = ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4]);
        let mut pass = targets::whole(extent, color, &fragment);
        let resource = Binding::Sampled(Arc::new(Texture::on_device(&image)), sampler);
        let entries = vec![BindingEntry { binding: 0, resources: vec![resource] }];
        pass.draws[0].sets = vec![Arc::new(BindingSet { entries })];
        pass
    };
    let nearest = Sampler::nearest();
    renderer.render(&pass("usampler2D", nearest)).unwrap();
    for (kind, sampler, texts) in [
        ("sampler2D", nearest, ["reads float", "R32Uint"]),
        ("isampler2D", nearest, ["reads int", "read uint"]),
        ("usampler2D", Sampler::default(), ["samples integers", "nearest"]),
        ("usampler2D", nearest.wrap(Wrap::ClampToBorder), ["border", "clamp to the edge"]),
    ] {
        let error = renderer.render(&pass(kind, sampler)).unwrap_err();
        assert!(matches!(error, Error::Usage(_)), "{error:?}");
        assert!(texts.iter().all(|text| error.to_string().contains(text)), "{error}");
    }
    // The same of a texture and a sampler that the shader brings together.
    let fragment = "#version 450
        layout(binding = 0) uniform utexture2D image;
        layout(binding = 1) uniform sampler how;
        layout(location = 0) out vec4 shown;
        void main() { shown = vec4(textureLod(usampler2D(image, how), vec2(0.5), 0.0)); }";
    for (sampler, is_fine) in [(nearest, true), (Sampler::default(), false)] {
        let color = ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4]);
        let mut pass = targets::whole(extent, color, fragment);
        let texture = Binding::Texture(Arc::new(Texture::on_device(&image)));
        let set = BindingSet::new([(0, texture), (1, Binding::Sampler(sampler))]);
        pass.draws[0].sets = vec![Arc::new(set)];
        assert_eq!(renderer.render(&pass).is_ok(), is_fine);
    }
}

/// Declarations of one place that no image is both are refused, in one shader and in two.
#[test]
fn images_of_two_kinds_at_one_place_are_refused() {
    let shader = |stage, declared: &str, value: &str| {
        let (output, target) = match stage {
            Stage::Vertex => ("", "gl_Position"),
            _ => ("layout(location = 0) out vec4 color;", "color"),
        };
        let source =
            format!("#version 450\n{declared}\n{output}\nvoid main() {{ {target} = {value}; }}");
        Shader::from_glsl(stage, "alias", &source)
    };
    let float = "layout(binding = 0) uniform sampler2D a;";
    let uint = "layout(binding = 0) uniform usampler2D b;";
    let (of_a, of_b) = ("textureLod(a, vec2(0), 0)", "vec4(textureLod(b, vec2(0), 0))");
    let both = shader(Stage::Fragment, &format!("{float}{uint}"), &format!("{of_a} + {of_b}"));
    let said = both.unwrap_err().to_string();
    assert!(said.contains("images of two kinds") && said.contains("uint"), "{said}");
    let images = "layout(binding = 0, rgba8) uniform image2D a;
        layout(binding = 0, r32f) uniform image2D b;";
    let both = shader(Stage::Fragment, images, "imageLoad(a, ivec2(0)) + imageLoad(b, ivec2(0))");
    let said = both.unwrap_err().to_string();
    assert!(said.contains("Rgba8Unorm") && said.contains("R32Float"), "{said}");
    let vertex = shader(Stage::Vertex, float, of_a).unwrap();
    let fragment = shader(Stage::Fragment, uint, of_b).unwrap();
    let said = Pipeline::new("alias", vertex, fragment).validate().unwrap_err().to_string();
    assert!(said.contains("set 0 binding 0") && said.contains("uint"), "{said}");
    let atomic = "layout(binding = 0, r32f) uniform image2D a;";
    let said = shader(Stage::Fragment, atomic, "vec4(imageAtomicExchange(a, ivec2(0), 1.0))");
    let said = said.unwrap_err().to_string();
    assert!(said.contains("atomically"), "{said}");
    let atomic = "layout(binding = 0, r32ui) uniform uimage2D a;";
    shader(Stage::Fragment, atomic, "vec4(imageAtomicAdd(a, ivec2(0), 1))").unwrap();
}
