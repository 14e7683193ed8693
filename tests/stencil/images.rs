//! Stencil values in images of a device, alone and beside depths.

use super::*;

/// The passes of a mirror: one marks where it is, the next draws there alone, a last one takes depth apart.
#[test]
fn values_outlive_a_pass() {
    on_each_gpu("stencil values outlive a pass", |gpu| {
        let extent = Extent::new(SIDE, 30);
        for format in [Format::S8Uint, Format::D24UnormS8Uint, Format::D32FloatS8Uint] {
            let info = ImageInfo::new("mirror", extent, format, ImageUse::Attachment);
            let image = match Image::new(gpu, &info) {
                Ok(image) => image,
                Err(Error::Device(text)) => {
                    println!("{format:?}: {text}");
                    continue;
                }
                Err(fault) => panic!("{fault}"),
            };
            let zeros = image.download_stencil(0, 0).unwrap();
            assert!(zeros.bytes.iter().all(|value| *value == 0));
            for ours in [true, false] {
                let mut executor: Box<dyn Executor> = match ours {
                    true => Box::new(compute(gpu)),
                    false => Box::new(classic::Renderer::new(gpu).unwrap()),
                };
                let mark = StencilFace::new(Compare::Always).pass(StencilOp::Replace);
                let there = StencilFace::new(Compare::Equal);
                let small = [[-0.5, -0.5], [0.7, -0.5], [-0.5, 0.9]]
                    .map(|[x, y]| [[x, y, 0.25, 1.0], [1.0; 4]]);
                let mut pass = Pass::new("mark", extent)
                    .stencil(StencilTarget::on_device(&image, LoadOp::Clear(3)))
                    .pipelines([pipeline(FRAGMENT).stencil(StencilState::new(mark))])
                    .draws([draw(0, &small).stencil_reference([9, 9])]);
                if format.is_depth() {
                    pass.depth = Some(DepthTarget::on_device(&image, LoadOp::Clear(1.0)));
                }
                let marked = executor.render(&pass).unwrap();
                let values = marked.stencil.unwrap();
                let shown = marked.colors[0].bytes.chunks_exact(4).map(|texel| texel[3] != 0);
                let wanted: Vec<u8> = shown.map(|shown| if shown { 9 } else { 3 }).collect();
                assert_eq!(values.bytes, wanted, "{format:?} {ours}");
                assert_eq!(image.download_stencil(0, 0).unwrap(), values);
                assert!(wanted.contains(&9) && wanted.contains(&3));

                // Nothing of the depths changes, which the pass does not have.
                let before = format.is_depth().then(|| image.download(0).unwrap());
                let pass = Pass::new("there", extent)
                    .stencil(StencilTarget::on_device(&image, LoadOp::Load).store(StoreOp::Store))
                    .pipelines([pipeline(FRAGMENT).stencil(StencilState::new(there))])
                    .draws([over_all(0, 0.5, false).stencil_reference([9, 9])]);
                let drawn = executor.render(&pass).unwrap();
                let shown = drawn.colors[0].bytes.chunks_exact(4).map(|texel| texel[3] != 0);
                assert!(shown.eq(wanted.iter().map(|value| *value == 9)), "{format:?} {ours}");
                if let Some(before) = before {
                    assert_eq!(before.format, format.without_stencil());
                    assert_eq!(image.download(0).unwrap(), before);
                    let pass = Pass::new("depth", extent)
                        .depth(DepthTarget::on_device(&image, LoadOp::Load))
                        .pipelines([pipeline(FRAGMENT)])
                        .draws([over_all(0, 0.5, false)]);
                    let depths = executor.render(&pass).unwrap().depth.unwrap();
                    let near = |depth: f32, wanted| (depth - wanted as f32).abs() < 1e-6;
                    let kept = depths.depths().into_iter().zip(&wanted);
                    let mut kept = kept.map(|(d, v)| near(d, if *v == 9 { 0.25 } else { 0.5 }));
                    assert!(kept.all(|same| same), "{format:?} {ours}");
                    assert_eq!(image.download_stencil(0, 0).unwrap(), values, "{format:?} {ours}");
                }
            }
        }
    });
}

/// Depths in one image and stencil values in another: the device's own pipeline does not take them.
#[test]
fn images_may_be_two() {
    let gpu = gpu();
    let extent = Extent::new(17, 9);
    let image = |format| {
        let info = ImageInfo::new("image", extent, format, ImageUse::Attachment).levels(2);
        Image::new(&gpu, &info).unwrap()
    };
    let (depth, stencil) = (image(Format::D16Unorm), image(Format::D32FloatS8Uint));
    let count = StencilFace::new(Compare::Always).pass(StencilOp::IncrementAndWrap);
    let pass = Pass::new("two", Extent::new(8, 4))
        .depth(DepthTarget::on_device(&depth, LoadOp::Clear(1.0)).level(1))
        .stencil(StencilTarget::on_device(&stencil, LoadOp::Clear(255)).level(1))
        .pipelines([pipeline(FRAGMENT).stencil(StencilState::new(count))])
        .draws([over_all(0, 0.5, false), over_all(0, 0.25, false), over_all(0, 0.75, false)]);
    let frame = compute(&gpu).render(&pass).unwrap();
    assert_eq!(frame.stencil.unwrap().bytes, [1; 32]);
    assert_eq!(stencil.download_stencil(1, 0).unwrap().bytes, [1; 32]);
    assert_eq!(stencil.download_stencil(0, 0).unwrap().bytes, [0; 17 * 9]);
    assert!(depth.download(1).unwrap().depths().iter().all(|depth| (depth - 0.25).abs() < 1e-4));
    let fault = classic::Renderer::new(&gpu).unwrap().render(&pass).unwrap_err();
    assert!(matches!(&fault, Error::Device(text) if text.contains("one image")), "{fault}");
}

/// Bands of a large target have their own rows of values.
#[test]
fn bands_have_their_rows() {
    let gpu = gpu();
    // More pixels than a band has.
    let extent = Extent::new(4099, 2100);
    let mut values = Picture::zeroed(extent, Format::S8Uint);
    for (n, value) in values.bytes.iter_mut().enumerate() {
        *value = (n % 251) as u8;
    }
    let invert = StencilFace::new(Compare::Always).pass(StencilOp::Invert).write_mask(0x0f);
    let mut target = StencilTarget::cleared(0);
    target.load = LoadOp::Picture(Arc::new(values.clone()));
    let pass = Pass::new("bands", extent)
        .colors([])
        .stencil(target)
        .pipelines([pipeline(FRAGMENT).stencil(StencilState::new(invert))])
        .draws([over_all(0, 0.5, false)]);
    let found = compute(&gpu).render(&pass).unwrap().stencil.unwrap();
    let wanted = values.bytes.iter().map(|value| value ^ 0x0f);
    assert!(found.bytes.iter().copied().eq(wanted));
}

/// Shaders sample stencil values as integers, and of an image of both the depths.
#[test]
fn values_are_sampled_as_integers() {
    on_each_gpu("stencil values are sampled as integers", |gpu| {
        let extent = Extent::new(16, 16);
        let info = ImageInfo::new("values", extent, Format::S8Uint, ImageUse::Attachment);
        let Ok(image) = Image::new(gpu, &info) else {
            return println!("the device has no images of S8Uint");
        };
        image.upload(&[all_values().bytes]).unwrap();
        assert_eq!(image.download(0).unwrap(), all_values());
        let fragment = "#version 450
            layout(binding = 0) uniform usampler2D values;
            layout(location = 0) out vec4 written;
            void main() {
                uint value = texelFetch(values, ivec2(gl_FragCoord.xy), 0).r;
                written = vec4(float(value) / 255.0, 0.0, 0.0, 1.0);
            }";
        let binding = Binding::sampled(Texture::on_device(&image), Sampler::nearest());
        let pass = Pass::new("sampled", extent)
            .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
            .pipelines([pipeline(fragment)])
            .draws([over_all(0, 0.5, false).sets([BindingSet::new([(0, binding)])])]);
        let found = compute(gpu).render(&pass).unwrap().colors.remove(0);
        let red = found.bytes.chunks_exact(4).map(|texel| texel[0]);
        assert!(red.eq(0..=255));
    });
}
