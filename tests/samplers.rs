//! Do samplers compare, count texels, stretch and mirror as their definitions say, and as the device's own pipeline has it?

use crate::{
    common::{on_each_gpu, random::Random},
    textures::{both, differences, distances, levels, pass},
};
use std::sync::Arc;
use tilewright::{
    Error,
    format::Format,
    image::{Extent, Shape},
    pass::Binding,
    state::Compare,
    target::ColorTarget,
    texture::{Sampler, Texture, Wrap},
    vk::{Image, ImageInfo, ImageUse},
};

/// What samplers with a comparison return, by their definition and as the device's own pipeline has it. The last shader
/// hands texture and sampler to a function.
#[test]
fn samplers_compare() {
    let kinds = [
        (Shape::D2, "sampler2DShadow", "texture(image, vec3(at.xy, at.w))"),
        (Shape::D2Array(4), "sampler2DArrayShadow", "texture(image, vec4(at.xy, at.z * 3, at.w))"),
        (Shape::Cube, "samplerCubeShadow", "texture(image, vec4(at.xyz - 0.4, at.w))"),
        (Shape::D2, "", "lit(depths, comparing)"),
    ];
    on_each_gpu("samplers compare", |gpu| {
        let (mut random, mut both) = (Random::new(9), both(gpu));
        let extent = Extent::new(16, 16);
        for (shape, ty, sample) in kinds {
            let info = ImageInfo::new("depths", extent, Format::D32Float, ImageUse::Attachment);
            let image = Image::new(gpu, &info.shape(shape)).unwrap();
            let depths: Vec<f32> =
                (0..256 * shape.layers()).map(|_| random.below(9) as f32 / 8.0).collect();
            image.upload(&[bytemuck::cast_slice::<f32, u8>(&depths)]).unwrap();
            let texture = Arc::new(Texture::on_device(&image));
            let declared = match ty {
                "" => "layout(binding = 0) uniform texture2D depths;
                    layout(binding = 1) uniform samplerShadow comparing;
                    float lit(texture2D t, samplerShadow s) {
                        return textureLod(sampler2DShadow(t, s), vec3(at.xy, at.w), 0);
                    }"
                .into(),
                ty => format!("layout(binding = 0) uniform {ty} image;"),
            };
            for compare in [Compare::Less, Compare::GreaterOrEqual, Compare::NotEqual] {
                let sampler = Sampler::nearest().compare(Some(compare));
                let bound = |sampler| match ty {
                    "" => vec![Binding::Texture(texture.clone()), Binding::Sampler(sampler)],
                    _ => vec![Binding::Sampled(texture.clone(), sampler)],
                };
                let drawn = pass(&declared, &format!("vec4({sample})"), bound(sampler));
                let (wrong, most) = differences(&mut both, &drawn, 0.002);
                // At the edge of a texel, a rounding decides.
                assert!(wrong < 40, "{shape:?} {compare:?}: {wrong} differ, by up to {most}");
                let fault = both.0.render(&pass(
                    &declared,
                    &format!("vec4({sample})"),
                    bound(Sampler::nearest()),
                ));
                let Err(Error::Usage(fault)) = fault.map(drop) else { panic!("{shape:?}") };
                assert!(fault.contains("`compare`"), "{fault}");
            }
        }
        // Exactly: texel by texel, each comparison.
        let info =
            ImageInfo::new("depths", Extent::new(4, 1), Format::D32Float, ImageUse::Attachment);
        let image = Image::new(gpu, &info).unwrap();
        image.upload(&[bytemuck::cast_slice::<f32, u8>(&[0.25, 0.5, 0.5, 0.75])]).unwrap();
        let texture = Arc::new(Texture::on_device(&image));
        for (compare, expected) in [
            (Compare::Never, [0, 0, 0, 0]),
            (Compare::Less, [0, 0, 0, 255]),
            (Compare::Equal, [0, 255, 255, 0]),
            (Compare::LessOrEqual, [0, 255, 255, 255]),
            (Compare::Greater, [255, 0, 0, 0]),
            (Compare::NotEqual, [255, 0, 0, 255]),
            (Compare::GreaterOrEqual, [255, 255, 255, 0]),
            (Compare::Always, [255; 4]),
        ] {
            let declared = "layout(binding = 0) uniform sampler2DShadow image;";
            let color = "vec4(textureLod(image, vec3(gl_FragCoord.x / 4, 0.5, 0.5), 0))";
            let sampler = Sampler::nearest().compare(Some(compare));
            let mut drawn = pass(declared, color, vec![Binding::Sampled(texture.clone(), sampler)]);
            drawn.extent = Extent::new(4, 1);
            drawn.colors = vec![ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])];
            let bytes = both.0.render(&drawn).unwrap().into_color().unwrap().bytes;
            let red: Vec<_> = bytes.chunks(4).map(|texel| texel[0]).collect();
            assert_eq!(red, expected, "{compare:?}");
        }
    });
}

/// Coordinates that count texels, anisotropy and mirroring once, where the device has them.
#[test]
fn rare_samplers_sample_as_on_the_device() {
    on_each_gpu("rare samplers sample as on the device", |gpu| {
        let mut both = both(gpu);
        let extent = Extent::new(16, 16);
        let pass_of = |sampler: Sampler, count, color: &str| {
            let content = levels(&mut Random::new(3), Shape::D2, extent, count);
            let texture = Texture::new("rare", extent, Format::Rgba8Unorm, content);
            let bound = vec![Binding::Sampled(Arc::new(texture), sampler)];
            pass("layout(binding = 0) uniform sampler2D image;", color, bound)
        };
        let texels = Sampler::nearest().unnormalized(true);
        let drawn = pass_of(texels, 1, "textureLod(image, at.xy * 11 + 3.3, 0)");
        let found = differences(&mut both, &drawn, 0.02);
        assert_eq!(found.0, 0, "texels: {}", found.1);
        // A sampler by itself may meet any texture.
        let apart = pass(
            "layout(binding = 0) uniform texture2D image; layout(binding = 1) uniform sampler texels;",
            "textureLod(sampler2D(image, texels), at.xy, 0)",
            vec![
                Binding::Texture(Arc::new(Texture::new(
                    "rare",
                    extent,
                    Format::Rgba8Unorm,
                    vec![vec![0; 1024]],
                ))),
                Binding::Sampler(texels),
            ],
        );
        let fault = tilewright::compute::Renderer::new(gpu).unwrap().render(&apart).map(drop);
        assert!(fault.unwrap_err().to_string().contains("together with its texture"));
        let steep = "texture(image, vec2(at.x * 9, at.y * 0.7))";
        let long = Sampler::default().anisotropy(4.0);
        let mirrored = Sampler::nearest().wrap_u(Wrap::MirrorClampToEdge);
        let cases = [
            (long, Sampler::default(), "anisotropy"),
            (mirrored, Sampler::nearest(), "mirroring once"),
        ];
        for (sampler, without, what) in cases {
            if let Err(fault) = tilewright::vk::Sampler::new(gpu, &sampler) {
                assert!(matches!(fault, Error::Device(_)), "{fault}");
                crate::did_not_run(what, &fault.to_string());
                continue;
            }
            let drawn = pass_of(sampler, 3, steep);
            let (wrong, most) = differences(&mut both, &drawn, 0.02);
            // Without it, many more differ: so much of it is there.
            let [with, without] =
                [drawn, pass_of(without, 3, steep)].map(|pass| both.0.render(&pass).unwrap());
            let (missed, _) = distances(&with, &without, 0.02);
            assert!(missed > 10 * wrong.max(50), "{what}: {missed} differ without it");
            assert!(wrong < 200, "{what}: {wrong} differ, by up to {most}");
        }
    });
}
