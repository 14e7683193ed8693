//! Buffers, images and samplers of a spliced shader.

use super::*;

#[test]
fn each_resource_is_the_draws_own() {
    on_each_gpu("each resource is the draw's own", |gpu| {
        let mut scene = Scene::new(gpu);
        // Other draws' resources lie before and between.
        let unused = words(gpu, &[u32::MAX; 4]);
        let place = |scene: &mut Scene, content: &[Vec<u32>]| {
            scene.table.insert_buffer(&unused).unwrap();
            let slots: Vec<u32> = (content.iter())
                .map(|c| scene.table.insert_buffer(&words(gpu, c)).unwrap())
                .collect();
            scene.slots.push(slots[0]);
        };
        place(&mut scene, &[(0..20).map(|n| (n as f32).to_bits()).collect()]);
        let six: Vec<Vec<u32>> = (0..6).map(|n| vec![100 + n, 200 + n]).collect();
        place(&mut scene, &six);
        place(&mut scene, &[vec![5, 6, 7]]);
        place(&mut scene, &[vec![0x4000_0000, 77]]);
        // The last element of the array.
        scene.slots.push(5);
        let body = "layout(set = 0, binding = 1) uniform Block { float a; mat3 m; vec4 v; } block;
            layout(set = 0, binding = 3) readonly buffer Many { uint first; uint list[]; } many[6];
            layout(set = 2, binding = 0) readonly buffer Words { uint words[]; };
            layout(push_constant) uniform Push { float scale; uint id; } push;
            layout(location = 0) in vec2 p;
            layout(location = 0) out uvec4 color;
            layout(location = 1) out vec4 more;
            void main() {
                int x = int(p.x);
                color = uvec4(many[(x & 1) * 3 + x % 3].list[0], many[5].first, words[2], push.id);
                more = vec4(block.m[2][1], block.v.w, push.scale, many[1].list[0]);
            }";
        let source = format!("#version 460\n{body}");
        let shader = Shader::from_glsl(Stage::Fragment, "test.frag", &source).unwrap();
        let shaded = scene.shade_once(&shader, Derivatives::Quad);
        for pixel in 0..PIXELS {
            let x = center(pixel).0 as u32;
            let which = (x & 1) * 3 + x % 3;
            assert_eq!(shaded.bits(pixel, 0), [200 + which, 105, 7, 77], "pixel {pixel}");
            let more = shaded.bits(pixel, 1).map(f32::from_bits);
            assert_eq!(more, [13.0, 19.0, 2.0, 201.0], "pixel {pixel}");
        }
    });
}

/// SwiftShader crashes when a kernel asks for the length of an array that lanes may choose, so this
/// is a test of the first driver alone.
#[test]
fn run_time_arrays_have_lengths() {
    let gpu = gpu();
    let mut scene = Scene::new(&gpu);
    scene.bind(&words(&gpu, &[0; 9]));
    scene.bind(&words(&gpu, &[0; 5]));
    let body = "layout(set = 0, binding = 0) readonly buffer A { uint first; uvec2 list[]; } a;
        layout(set = 0, binding = 1) readonly buffer B { uint list[]; } b;
        layout(location = 0) out uvec4 color;
        void main() { color = uvec4(a.list.length(), b.list.length(), 0, 0); }";
    // The list of pairs begins at its alignment, byte 8.
    scene.shade(body, |shaded| assert_eq!(shaded.bits(PIXELS - 1, 0), [3, 5, 0, 0]));
}

/// A texture of 16 x 16 whose level `n` is `n / 10` everywhere, and a sampler that takes the nearest
/// level.
fn levels(gpu: &Gpu) -> (Image, Sampler) {
    let info = ImageInfo::new("levels", Extent::new(16, 16), Format::Rgba8Unorm, ImageUse::Sampled)
        .levels(5);
    let image = Image::new(gpu, &info).unwrap();
    let level =
        |n: usize| -> Vec<u8> { vec![(n as f32 * 25.5).round() as u8; 4 * (16 >> n) * (16 >> n)] };
    let mut recorder = Recorder::new(gpu, "levels").unwrap();
    recorder.upload_image(&image, &(0..5).map(level).collect::<Vec<_>>()).unwrap();
    recorder.submit().unwrap();
    let sampler = texture::Sampler::default().mip(Some(texture::Filter::Nearest));
    (image, Sampler::new(gpu, &sampler).unwrap())
}

#[test]
fn implicit_levels_come_from_the_quad() {
    on_each_gpu("implicit levels come from the quad", |gpu| {
        let mut scene = Scene::new(gpu);
        let (image, sampler) = levels(gpu);
        scene.table.insert_texture(&image).unwrap();
        for _ in 0..2 {
            scene.slots.push(scene.table.insert_sampled(&image, &sampler).unwrap());
        }
        scene.slots.push(scene.table.insert_texture(&image).unwrap());
        scene.slots.push(scene.table.insert_sampler(&sampler).unwrap());
        // Texels per pixel, so levels: 1, 2, 4 and 8 are 0, 1, 2 and 3.
        let body = "#extension GL_EXT_samplerless_texture_functions : require
            layout(set = 0, binding = 0) uniform sampler2D image;
            layout(set = 0, binding = 1) uniform texture2D half_image;
            layout(set = 0, binding = 1) uniform sampler half_sampler;
            layout(set = 1, binding = 0) uniform texture2D only_image;
            layout(set = 1, binding = 1) uniform sampler only_sampler;
            layout(location = 0) in vec2 p;
            layout(location = 0) out vec4 color;
            layout(location = 1) out vec4 more;
            vec4 through(sampler2D s, vec2 at) { return texture(s, at); }
            void main() {
                vec2 uv = p / 16.0;
                color = vec4(texture(image, uv * 4.0).x, texture(image, uv, 3.0).x,
                    textureProj(image, vec3(uv * 8.0, 2.0)).x, through(image, uv * 8.0).x);
                more.x = texture(sampler2D(half_image, half_sampler), uv * 2.0, 1.0).x;
                more.y = texture(sampler2D(only_image, only_sampler), uv.yx * 2.0).x;
                more.z = textureLod(image, uv, 1.0).x + texelFetch(half_image, ivec2(0), 4).x;
                if (int(p.x) % 2 == 1) discard;
                more.w = textureProj(image, vec4(uv * 2.0, 0.0, 0.5), -1.0).x;
            }";
        scene.shade(body, |shaded| {
            for pixel in [0, 2, 64, 126] {
                let near = |bits: [u32; 4], expected: [f32; 4]| {
                    for (a, b) in bits.map(f32::from_bits).iter().zip(expected) {
                        assert!((a - b).abs() < 0.01, "pixel {pixel}: {a}, not {b}");
                    }
                };
                near(shaded.bits(pixel, 0), [0.2, 0.3, 0.2, 0.3]);
                near(shaded.bits(pixel, 1), [0.2, 0.1, 0.5, 0.1]);
            }
        });
    });
}
