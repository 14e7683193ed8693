//! Checks of images and samplers: that the shader reads and writes them as it may.

use super::{Binding, Fault};
use crate::{
    image::Shape,
    shader::{Resource, Scalar},
    texture::Texture,
    vk,
};

/// Checks that the shader samples what is bound as it may be sampled.
pub(super) fn check_sampling(binding: &Binding, resource: &Resource) -> Fault {
    let (texture, sampler) = match binding {
        Binding::Sampled(texture, sampler) => (Some(texture), Some(sampler)),
        Binding::Texture(texture) => (Some(texture), None),
        Binding::Sampler(sampler) => (None, Some(sampler)),
        Binding::StorageImage(texture) => {
            check_storage(texture, resource)?;
            (Some(texture), None)
        }
        Binding::Uniform(_) | Binding::Storage(_) => (None, None),
    };
    if let Some((texture, image)) = texture.zip(resource.image) {
        let (label, shape) = (texture.label(), texture.shape());
        if !image.is(shape) {
            return Err(format!(
                "the image is {image} in the shader; texture `{label}` is `Shape::{shape:?}`"
            ));
        }
        let (reads, holds) = (image.texel, Scalar::of(texture.format()));
        if reads != holds {
            return Err(format!(
                "the shader reads {reads}; texture `{label}` is {:?}, from which shaders read {holds}",
                texture.format()
            ));
        }
        if resource.compares && !texture.format().is_depth() {
            return Err(format!(
                "the shader compares with depths (sampler2DShadow and relatives); texture `{label}` holds colours"
            ));
        }
    }
    let Some(sampler) = sampler else { return Ok(()) };
    if resource.samples_integers && (sampler.is_linear() || sampler.has_border()) {
        return Err("the shader samples integers, which are neither filtered nor have a border: sample the nearest \
                    texel, and clamp to the edge, repeat or mirror"
            .into());
    }
    sampler.check().map_err(|fault| format!("sampler: {fault}"))?;
    if resource.compares && sampler.compare.is_none() {
        return Err("the shader compares (sampler2DShadow, samplerShadow and relatives); the sampler has no \
                    `compare`"
            .into());
    }
    if sampler.unnormalized {
        if texture.is_none() {
            return Err("the coordinates of the sampler are not normalized: bind it together with its texture \
                        (sampler2D, `Binding::Sampled`)"
                .into());
        }
        if resource.needs_normalized {
            return Err("the coordinates of the sampler are not normalized; the shader samples with implicit level \
                        of detail, a comparison, projection or an offset, which Vulkan does not allow then"
                .into());
        }
        if let Some(texture) = texture {
            let flat = matches!(texture.shape(), Shape::D1 | Shape::D2);
            let levels = texture
                .image()
                .map_or(texture.levels().map_or(0, <[_]>::len), |image| image.levels() as usize);
            if !flat || levels != 1 {
                return Err(format!(
                    "the coordinates of the sampler are not normalized; texture `{}` has layers, three dimensions or \
                     several levels, which Vulkan does not allow then",
                    texture.label()
                ));
            }
        }
    }
    Ok(())
}

/// Checks that shaders may write an image, in the format that the shader declares.
fn check_storage(texture: &Texture, resource: &Resource) -> Fault {
    let label = texture.label();
    if texture.image().is_none_or(|image| image.usage() != vk::ImageUse::Storage) {
        return Err(format!(
            "texture `{label}` is no storage image: these are images of a device that are made with `ImageUse::Storage`"
        ));
    }
    match resource.image.and_then(|image| image.format) {
        Some(format) if format != texture.format() => Err(format!(
            "the storage image is {format:?} in the shader; `{label}` is {:?}",
            texture.format()
        )),
        _ => Ok(()),
    }
}
