//! Do images that live on a device hold what is uploaded, drawn and made there?

use crate::{
    common::on_each_gpu,
    targets::{target, textures, whole},
};
use tilewright::{
    Error, classic, compute,
    format::Format,
    image::{self, Extent},
    pass::Executor,
    target::{ColorTarget, LoadOp},
    vk::{Image, ImageInfo, ImageUse, Recorder},
};

#[test]
fn images_begin_with_zeros_and_hold_what_is_uploaded() {
    on_each_gpu("images begin with zeros and hold what is uploaded", |gpu| {
        for format in [
            Format::Rgba8Srgb,
            Format::Rgba16Float,
            Format::D32Float,
            Format::D16Unorm,
            Format::X8D24Unorm,
        ] {
            let extent = Extent::new(5, 3);
            let info = ImageInfo::new("held", extent, format, ImageUse::Attachment).levels(3);
            let image = match Image::new(gpu, &info) {
                // SwiftShader has no images of 24 bits.
                Err(Error::Device(_)) if format == Format::X8D24Unorm => continue,
                image => image.unwrap(),
            };
            // Bits that belong to no channel are 0 in pictures, whatever was uploaded.
            let held = |bytes: &[u8]| -> Vec<u8> {
                let is_rest = |n: usize| format == Format::X8D24Unorm && n % 4 == 3;
                let bytes = bytes.iter().enumerate();
                bytes.map(|(n, byte)| if is_rest(n) { 0 } else { *byte }).collect()
            };
            let zeros = image.download(0).unwrap();
            assert_eq!(zeros, image::Picture::zeroed(extent, format));
            let levels: Vec<Vec<u8>> = [15, 2, 1]
                .map(|texels: usize| {
                    let bytes = texels * format.texel_bytes();
                    (0..bytes).map(|i| if i % 4 == 3 { 0x3e } else { i as u8 }).collect()
                })
                .into();
            image.upload(&levels).unwrap();
            for (n, level) in levels.iter().enumerate() {
                assert_eq!(image.download(n as u32).unwrap().bytes, held(level), "{format:?} {n}");
            }
            let error = image.download(3).unwrap_err();
            assert!(error.to_string().contains("no level 3"), "{error}");
            // The levels below stay.
            let other: Vec<u8> = levels[0].iter().map(|byte| byte ^ 1).collect();
            image.upload(&[&other]).unwrap();
            assert_eq!(image.download(0).unwrap().bytes, held(&other), "{format:?}");
            for (n, level) in levels.iter().enumerate().skip(1) {
                assert_eq!(image.download(n as u32).unwrap().bytes, held(level), "{format:?} {n}");
            }
        }
        let depth = target(gpu, "depth", Extent::new(1, 1), Format::D32Float);
        let error = depth.upload::<&[u8]>(&[]).unwrap_err();
        assert!(error.to_string().contains("1 levels, not 0"), "{error}");
        for wrong in [1.5f32, -0.1, f32::NAN] {
            let error = depth.upload(&[wrong.to_ne_bytes()]).unwrap_err();
            assert!(error.to_string().contains("in 0..=1"), "{error}");
        }
        // What is sampled only may have no content yet.
        let usage = ImageUse::Sampled;
        let (extent, format) = (Extent::new(2, 2), Format::Rgba8Unorm);
        let info = ImageInfo::new("sampled", extent, format, usage);
        let error = Image::new(gpu, &info).unwrap().download(0).unwrap_err();
        assert!(error.to_string().contains("ImageUse::Attachment"), "{error}");
    });
}

/// Passes draw to level 0 of an image with several levels, and shaders sample all of them.
#[test]
fn images_with_levels_are_drawn_to_and_sampled() {
    on_each_gpu("images with levels are drawn to and sampled", |gpu| {
        let (extent, format) = (Extent::new(4, 4), Format::Rgba8Unorm);
        let info = ImageInfo::new("levels", extent, format, ImageUse::Attachment).levels(3);
        let levels = [vec![9; 64], vec![7; 16], vec![5; 4]];
        let red = "#version 450
layout(location = 0) out vec4 color;
void main() { color = vec4(1, 0, 0, 1); }";
        let show = "#version 450
layout(binding = 0) uniform sampler2D image;
layout(location = 0) out vec4 color;
void main() { color = textureLod(image, vec2(0.5), floor(gl_FragCoord.x)); }";
        let mut executors: Vec<Box<dyn Executor>> =
            vec![Box::new(compute::Renderer::new(gpu).unwrap())];
        if gpu.has_graphics() {
            executors.push(Box::new(classic::Renderer::new(gpu).unwrap()));
        }
        for executor in &mut executors {
            let image = Image::new(gpu, &info).unwrap();
            image.upload(&levels).unwrap();
            let color = ColorTarget::on_device(&image, LoadOp::clear([0.0; 4]));
            executor.render(&whole(extent, color, red)).unwrap();
            let color = ColorTarget::cleared(format, [0.0; 4]);
            let mut pass = whole(Extent::new(3, 1), color, show);
            pass.draws[0].sets = vec![textures(&[&image])];
            let shown = executor.render(&pass).unwrap().into_color().unwrap();
            assert_eq!(shown.bytes, [255, 0, 0, 255, 7, 7, 7, 7, 5, 5, 5, 5]);
            assert_eq!(image.download(1).unwrap().bytes, levels[1]);
        }
    });
}

/// Each level is the mean of the one above, as light: the middle of black and white is 188 in sRGB.
#[test]
fn levels_are_made_on_the_device() {
    on_each_gpu("levels are made on the device", |gpu| {
        for (format, middle) in [(Format::Rgba8Unorm, 128), (Format::Rgba8Srgb, 188)] {
            let usage = ImageUse::Attachment;
            let extent = Extent::new(8, 4);
            let image = Image::new(gpu, &ImageInfo::new("levels", extent, format, usage).levels(4));
            let image = image.unwrap();
            let texel =
                |i: u32| if (i % 8 + i / 8).is_multiple_of(2) { [0, 0, 0, 255] } else { [255; 4] };
            let top: Vec<u8> = (0..32).flat_map(texel).collect();
            image.upload(&[top, vec![1; 32], vec![2; 8], vec![3; 4]]).unwrap();
            let mut recorder = Recorder::new(gpu, "levels").unwrap();
            let made = recorder.group(|recorder| recorder.make_levels(&image));
            if !gpu.has_graphics() {
                assert!(matches!(made, Err(tilewright::Error::Device(_))), "{made:?}");
                continue;
            }
            made.unwrap();
            recorder.submit().unwrap();
            for level in 1..4 {
                let made = image.download(level).unwrap();
                for texel in made.bytes.chunks(4) {
                    let near = texel[..3].iter().all(|c| c.abs_diff(middle) <= 2);
                    assert!(near && texel[3] == 255, "{format:?}, level {level}: {texel:?}");
                }
            }
        }
        let depth = target(gpu, "depth", Extent::new(4, 4), Format::D32Float);
        let error = Recorder::new(gpu, "levels").unwrap().make_levels(&depth).unwrap_err();
        assert!(error.to_string().contains("D32Float"), "{error}");
    });
}
