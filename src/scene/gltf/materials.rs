//! glTF materials, textures and samplers.

use super::super::{
    build::Builder,
    material::{AlphaMode, Map, Material, TextureUse},
    texture::{ColorSpace, decode},
    uri,
};
use super::data::{Checks, Data, get};
use crate::texture::{Filter, Sampler, Wrap};
use glam::{Vec2, Vec3, Vec4};
use gltf_json::{
    self as json,
    material::AlphaMode as JsonAlpha,
    texture::{MagFilter, MinFilter, WrappingMode},
    validation::Checked,
};
use serde_json::{Map as JsonMap, Value};
use std::{collections::HashMap, path::Path};

/// Extensions for images of other formats; beside one of them a PNG or JPEG may stand.
pub(super) const OTHER_IMAGES: [&str; 4] =
    ["KHR_texture_basisu", "EXT_texture_webp", "EXT_texture_avif", "MSFT_texture_dds"];

/// The materials of a file in the builder, and what meshes must know of them.
pub(super) struct Materials {
    /// By material, the sets of texture coordinates that the shader's two inputs carry.
    pub uv_sets: Vec<[u32; 2]>,
}

/// A texture as a file refers to it, before it has a place among the shader's inputs.
struct Reference {
    texture: usize,
    tex_coord: u32,
    transform: Option<(Vec2, f32, Vec2)>,
}

/// Adds all materials, and after them glTF's default material.
pub(super) fn add(data: &Data, folder: &Path, builder: &mut Builder) -> Checks<Materials> {
    let mut reader = Reader { data, folder, builder, made: HashMap::new() };
    let mut uv_sets = Vec::new();
    for (i, material) in data.root.materials.iter().enumerate() {
        let (material, sets) =
            reader.material(material).map_err(|e| format!("material {i}: {e}"))?;
        reader.builder.materials.push(material);
        uv_sets.push(sets);
    }
    builder.materials.push(Material::default());
    uv_sets.push([0, 1]);
    Ok(Materials { uv_sets })
}

struct Reader<'a, 'd> {
    data: &'a Data<'d>,
    folder: &'a Path,
    builder: &'a mut Builder,
    /// Textures by image and colour space.
    made: HashMap<(usize, ColorSpace), usize>,
}

impl Reader<'_, '_> {
    fn material(&mut self, m: &json::Material) -> Checks<(Material, [u32; 2])> {
        let pbr = &m.pbr_metallic_roughness;
        let extensions = m.extensions.as_ref();
        let mut out = Material {
            base_color: Vec4::from_array(pbr.base_color_factor.0),
            metallic: pbr.metallic_factor.0,
            roughness: pbr.roughness_factor.0,
            emissive: Vec3::from_array(m.emissive_factor.0),
            alpha: match m.alpha_mode {
                Checked::Valid(JsonAlpha::Opaque) => AlphaMode::Opaque,
                Checked::Valid(JsonAlpha::Mask) => AlphaMode::Mask,
                Checked::Valid(JsonAlpha::Blend) => AlphaMode::Blend,
                Checked::Invalid => return Err("its alpha mode is unknown".into()),
            },
            alpha_cutoff: m.alpha_cutoff.map_or(0.5, |c| c.0),
            double_sided: m.double_sided,
            unlit: extensions.is_some_and(|e| e.unlit.is_some()),
            ..Material::default()
        };
        if let Some(strength) = extensions.and_then(|e| e.emissive_strength.as_ref()) {
            out.emissive *= strength.emissive_strength.0;
        }
        let mut references: [Option<Reference>; 5] = [None, None, None, None, None];
        references[Map::BaseColor as usize] = info(&pbr.base_color_texture);
        references[Map::MetallicRoughness as usize] = info(&pbr.metallic_roughness_texture);
        references[Map::Emissive as usize] = info(&m.emissive_texture);
        if let Some(t) = &m.normal_texture {
            out.normal_scale = t.scale;
            let others = t.extensions.as_ref().map(|e| &e.others);
            references[Map::Normal as usize] =
                Some(with_raw_transform(t.index.value(), t.tex_coord, others));
        }
        if let Some(t) = &m.occlusion_texture {
            out.occlusion_strength = t.strength.0;
            let others = t.extensions.as_ref().map(|e| &e.others);
            references[Map::Occlusion as usize] =
                Some(with_raw_transform(t.index.value(), t.tex_coord, others));
        }
        if let Some(old) = extensions.and_then(|e| e.pbr_specular_glossiness.as_ref()) {
            out.base_color = Vec4::from_array(old.diffuse_factor.0);
            let specular = Vec3::from_array(old.specular_factor.0);
            out.specular = Some(specular.extend(old.glossiness_factor.0));
            references[Map::BaseColor as usize] = info(&old.diffuse_texture);
            references[Map::MetallicRoughness as usize] = info(&old.specular_glossiness_texture);
        }
        let sets = self.place(&mut out, references)?;
        if let Some(glass) = extensions.and_then(|e| e.transmission.as_ref())
            && glass.transmission_factor.0 > 0.0
        {
            // Light that passes straight through, as coverage: no refraction, no blur.
            out.alpha = AlphaMode::Blend;
            out.base_color.w *= 1.0 - 0.85 * glass.transmission_factor.0.min(1.0);
        }
        Ok((out, sets))
    }

    /// Gives each reference one of the shader's two inputs for texture coordinates.
    fn place(
        &mut self,
        material: &mut Material,
        references: [Option<Reference>; 5],
    ) -> Checks<[u32; 2]> {
        let mut used: Vec<u32> = references.iter().flatten().map(|r| r.tex_coord).collect();
        used.sort_unstable();
        used.dedup();
        if used.len() > 2 {
            self.builder.warn("a material uses more than two sets of texture coordinates");
        }
        let mut sets = match used[..] {
            [] | [0] | [1] | [0, 1] => [0, 1],
            [one] => [one, 1],
            [one, two, ..] => [one, two],
        };
        if sets[0] == sets[1] {
            sets[1] = 0;
        }
        for (map, reference) in references.into_iter().enumerate() {
            let Some(reference) = reference else { continue };
            let is = |one: Map| map == one as usize;
            let specular = material.specular.is_some() && is(Map::MetallicRoughness);
            let space = match is(Map::BaseColor) || is(Map::Emissive) || specular {
                true => ColorSpace::Srgb,
                false => ColorSpace::Linear,
            };
            let Some((texture, sampler)) = self.texture(reference.texture, space)? else {
                continue;
            };
            let uv_set = usize::from(sets[0] != reference.tex_coord);
            let mut used = TextureUse { sampler, uv_set, ..TextureUse::new(texture) };
            if let Some((offset, rotation, scale)) = reference.transform {
                used = used.with_transform(offset, rotation, scale);
            }
            material.maps[map] = Some(used);
        }
        Ok(sets)
    }

    /// Number and sampler of a texture; `None` if it has no image that can be read.
    fn texture(&mut self, index: usize, space: ColorSpace) -> Checks<Option<(usize, Sampler)>> {
        let root = self.data.root;
        let texture = get(&root.textures, index, "texture")?;
        let sampler = match texture.sampler {
            Some(sampler) => sampler_of(get(&root.samplers, sampler.value(), "sampler")?)?,
            None => Sampler::default(),
        };
        // The parser marks a texture without a source by the largest index.
        if texture.source.value() == u32::MAX as usize {
            let others = texture.extensions.as_ref().map(|e| &e.others);
            let format = OTHER_IMAGES
                .into_iter()
                .find(|name| others.is_some_and(|extensions| extensions.contains_key(*name)));
            let reason = match format {
                Some(name) => format!(
                    "texture {index} has no PNG or JPEG, only an image of {name}, which cannot be read"
                ),
                None => format!("texture {index} has no PNG or JPEG"),
            };
            if format.is_some_and(|name| root.extensions_required.iter().any(|r| r == name)) {
                return Err(format!("{reason}; export the file with PNG or JPEG"));
            }
            self.builder.warn(format!("{reason}; it is left out"));
            return Ok(None);
        }
        let image = texture.source.value();
        if let Some(&made) = self.made.get(&(image, space)) {
            return Ok(Some((made, sampler)));
        }
        let described = get(&root.images, image, "image")?;
        let bytes = match (&described.buffer_view, &described.uri) {
            (Some(view), _) => self.data.view(view.value()).map(<[u8]>::to_vec),
            (None, Some(uri)) => uri::read(uri, self.folder, &mut self.builder.files),
            (None, None) => Err("it has neither a URI nor a buffer view".into()),
        };
        let label = format!("image {image}");
        let job = move || {
            let decoded = bytes.and_then(|bytes| decode(&label, &bytes, space));
            decoded.map_err(|e| format!("{label}: {e}"))
        };
        let made = self.builder.texture(job);
        self.made.insert((image, space), made);
        Ok(Some((made, sampler)))
    }
}

/// A texture reference with the transform that the parser understands.
fn info(info: &Option<json::texture::Info>) -> Option<Reference> {
    let info = info.as_ref()?;
    let transform = info.extensions.as_ref().and_then(|e| e.texture_transform.as_ref());
    Some(Reference {
        texture: info.index.value(),
        tex_coord: transform.and_then(|t| t.tex_coord).unwrap_or(info.tex_coord),
        transform: transform
            .map(|t| (Vec2::from_array(t.offset.0), t.rotation.0, Vec2::from_array(t.scale.0))),
    })
}

/// A texture reference whose extensions are raw JSON.
fn with_raw_transform(
    texture: usize,
    tex_coord: u32,
    extensions: Option<&JsonMap<String, Value>>,
) -> Reference {
    let Some(t) = extensions.and_then(|e| e.get("KHR_texture_transform")) else {
        return Reference { texture, tex_coord, transform: None };
    };
    let pair = |name: &str, default: f32| {
        let at = |i: usize| {
            t.get(name).and_then(|v| v.get(i)).and_then(Value::as_f64).map_or(default, |v| v as f32)
        };
        Vec2::new(at(0), at(1))
    };
    let rotation = t.get("rotation").and_then(Value::as_f64).unwrap_or(0.0) as f32;
    let set = t.get("texCoord").and_then(Value::as_u64).and_then(|v| u32::try_from(v).ok());
    Reference {
        texture,
        tex_coord: set.unwrap_or(tex_coord),
        transform: Some((pair("offset", 0.0), rotation, pair("scale", 1.0))),
    }
}

fn sampler_of(s: &json::texture::Sampler) -> Checks<Sampler> {
    let wrap = |mode: &Checked<WrappingMode>| match mode {
        Checked::Valid(WrappingMode::ClampToEdge) => Ok(Wrap::ClampToEdge),
        Checked::Valid(WrappingMode::MirroredRepeat) => Ok(Wrap::MirroredRepeat),
        Checked::Valid(WrappingMode::Repeat) => Ok(Wrap::Repeat),
        Checked::Invalid => Err("a sampler has an unknown wrapping mode".to_owned()),
    };
    let unknown = || Err("a sampler has an unknown filter".to_owned());
    let (min, mip) = match s.min_filter {
        None | Some(Checked::Valid(MinFilter::LinearMipmapLinear)) => {
            (Filter::Linear, Some(Filter::Linear))
        }
        Some(Checked::Valid(MinFilter::Nearest)) => (Filter::Nearest, None),
        Some(Checked::Valid(MinFilter::Linear)) => (Filter::Linear, None),
        Some(Checked::Valid(MinFilter::NearestMipmapNearest)) => {
            (Filter::Nearest, Some(Filter::Nearest))
        }
        Some(Checked::Valid(MinFilter::LinearMipmapNearest)) => {
            (Filter::Linear, Some(Filter::Nearest))
        }
        Some(Checked::Valid(MinFilter::NearestMipmapLinear)) => {
            (Filter::Nearest, Some(Filter::Linear))
        }
        Some(Checked::Invalid) => return unknown(),
    };
    let mag = match s.mag_filter {
        None | Some(Checked::Valid(MagFilter::Linear)) => Filter::Linear,
        Some(Checked::Valid(MagFilter::Nearest)) => Filter::Nearest,
        Some(Checked::Invalid) => return unknown(),
    };
    let (wrap_u, wrap_v) = (wrap(&s.wrap_s)?, wrap(&s.wrap_t)?);
    Ok(Sampler { wrap_u, wrap_v, mag, min, mip, ..Sampler::default() })
}
