//! Metallic-roughness materials, as loaders describe them and as shaders read them.

use crate::{
    pass::{Binding, BindingEntry, BindingSet, BufferRange, BufferSource},
    texture::{Sampler, Texture},
};
use glam::{Vec2, Vec3, Vec4};
use std::sync::Arc;

/// The meaning of the base colour's alpha.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) enum AlphaMode {
    /// Nothing.
    #[default]
    Opaque,
    /// Fragments below the cutoff are discarded.
    Mask,
    /// Straight alpha blending.
    Blend,
}

/// The five maps of a material, in the order of their bindings.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(usize)]
pub(super) enum Map {
    BaseColor = 0,
    /// Or specular colour and glossiness, for a material that has those.
    MetallicRoughness = 1,
    Normal = 2,
    Occlusion = 3,
    Emissive = 4,
}

/// How many maps there are.
const MAPS: usize = 5;

/// A texture as a material uses it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TextureUse {
    /// Number of the texture in the scene.
    pub texture: usize,
    pub sampler: Sampler,
    /// Which texture coordinates, 0 or 1.
    pub uv_set: usize,
    /// Rows of an affine map of texture coordinates: `(x, y, 1)` to u and to v.
    pub transform: [Vec3; 2],
}

impl TextureUse {
    /// `texture` with the sampler's usual settings and untransformed first coordinates.
    pub fn new(texture: usize) -> Self {
        let transform = [Vec3::X, Vec3::Y];
        Self { texture, sampler: Sampler::default(), uv_set: 0, transform }
    }

    /// The map of `KHR_texture_transform`: scale, then rotate, then move.
    pub fn with_transform(mut self, offset: Vec2, rotation: f32, scale: Vec2) -> Self {
        let (s, c) = rotation.sin_cos();
        self.transform = [
            Vec3::new(c * scale.x, s * scale.y, offset.x),
            Vec3::new(-s * scale.x, c * scale.y, offset.y),
        ];
        self
    }
}

/// A material.
#[derive(Clone, Debug)]
pub(super) struct Material {
    /// Linear.
    pub base_color: Vec4,
    /// Linear, strength included.
    pub emissive: Vec3,
    pub metallic: f32,
    pub roughness: f32,
    /// Specular colour (linear) and glossiness, which take the place of the two above.
    pub specular: Option<Vec4>,
    pub normal_scale: f32,
    pub occlusion_strength: f32,
    pub alpha: AlphaMode,
    pub alpha_cutoff: f32,
    pub double_sided: bool,
    pub unlit: bool,
    /// By [`Map`].
    pub maps: [Option<TextureUse>; MAPS],
}

impl Default for Material {
    /// glTF's default material: white, fully metallic and rough.
    fn default() -> Self {
        Self {
            base_color: Vec4::ONE,
            emissive: Vec3::ZERO,
            metallic: 1.0,
            roughness: 1.0,
            specular: None,
            normal_scale: 1.0,
            occlusion_strength: 1.0,
            alpha: AlphaMode::Opaque,
            alpha_cutoff: 0.5,
            double_sided: false,
            unlit: false,
            maps: [None; MAPS],
        }
    }
}

impl Material {
    /// The texture coordinates that tangents must follow, if there is a normal map.
    pub fn normal_uv_set(&self) -> Option<usize> {
        self.maps[Map::Normal as usize].map(|t| t.uv_set)
    }
}

/// Offsets of blocks in a buffer: the largest alignment that Vulkan lets a device ask for.
const BLOCK_ALIGN: usize = 256;

/// `Material` of `material.frag`, in std140: vectors of four only, so nothing is padded.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub(super) struct Block {
    pub base_color: [f32; 4],
    /// w: alpha cutoff
    pub emissive: [f32; 4],
    /// metallic, roughness, normal scale, occlusion strength
    pub surface: [f32; 4],
    /// specular colour and glossiness
    pub specular: [f32; 4],
    /// x: bits of `FLAG_*` in the shader
    pub flags: [u32; 4],
    /// Per map two rows; w of the first is the set of texture coordinates.
    pub uv_rows: [[f32; 4]; 2 * MAPS],
}

const _: () = assert!(size_of::<Block>() <= BLOCK_ALIGN);

/// Bits 0 to 4 say which maps exist.
const FLAG_UNLIT: u32 = 1 << 5;
/// Alpha reaches the target; otherwise it is 1.
const FLAG_ALPHA: u32 = 1 << 6;
/// Specular colour and glossiness describe the reflection.
const FLAG_SPECULAR: u32 = 1 << 7;

impl Block {
    fn new(m: &Material) -> Self {
        let mut flags = 0;
        let mut uv_rows = [[0.0; 4]; 2 * MAPS];
        for (i, map) in m.maps.iter().enumerate() {
            let Some(map) = map else { continue };
            flags |= 1 << i;
            let [u, v] = map.transform;
            uv_rows[2 * i] = [u.x, u.y, u.z, map.uv_set as f32];
            uv_rows[2 * i + 1] = [v.x, v.y, v.z, 0.0];
        }
        if m.unlit {
            flags |= FLAG_UNLIT;
        }
        if m.specular.is_some() {
            flags |= FLAG_SPECULAR;
        }
        if m.alpha == AlphaMode::Blend {
            flags |= FLAG_ALPHA;
        }
        Self {
            base_color: m.base_color.to_array(),
            emissive: m.emissive.extend(m.alpha_cutoff).to_array(),
            surface: [m.metallic, m.roughness, m.normal_scale, m.occlusion_strength],
            specular: m.specular.unwrap_or_default().to_array(),
            flags: [flags, 0, 0, 0],
            uv_rows,
        }
    }
}

/// The descriptor set 1 of each material; their blocks share one buffer. Maps that a material does
/// not have are bound to `white` and never sampled.
pub(super) fn binding_sets(
    label: &str,
    materials: &[Material],
    textures: &[Arc<Texture>],
    white: &Arc<Texture>,
) -> Vec<Arc<BindingSet>> {
    let mut bytes = vec![0; materials.len() * BLOCK_ALIGN];
    for (material, slot) in materials.iter().zip(bytes.chunks_exact_mut(BLOCK_ALIGN)) {
        let block = Block::new(material);
        slot[..size_of::<Block>()].copy_from_slice(bytemuck::bytes_of(&block));
    }
    let buffer = Arc::new(BufferSource::new(format!("{label} materials"), bytes));
    let set = |(i, material): (usize, &Material)| {
        let block = BufferRange {
            buffer: buffer.clone(),
            offset: i * BLOCK_ALIGN,
            bytes: size_of::<Block>(),
        };
        let sampled = material.maps.iter().map(|map| match map {
            Some(map) => Binding::Sampled(textures[map.texture].clone(), map.sampler),
            None => Binding::Sampled(white.clone(), Sampler::default()),
        });
        let resources = std::iter::once(Binding::Uniform(block)).chain(sampled);
        let entry = |(binding, resource)| BindingEntry { binding, resources: vec![resource] };
        Arc::new(BindingSet { entries: (0..).zip(resources).map(entry).collect() })
    };
    materials.iter().enumerate().map(set).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texture_transform_scales_rotates_and_moves() {
        let t = TextureUse::new(0).with_transform(
            Vec2::new(0.5, 0.25),
            std::f32::consts::FRAC_PI_2,
            Vec2::new(2.0, 3.0),
        );
        let at = |u: f32, v: f32| {
            let p = Vec3::new(u, v, 1.0);
            Vec2::new(t.transform[0].dot(p), t.transform[1].dot(p))
        };
        // The extension's matrix turns u towards -v.
        assert!(at(0.0, 0.0).abs_diff_eq(Vec2::new(0.5, 0.25), 1e-6));
        assert!(at(1.0, 0.0).abs_diff_eq(Vec2::new(0.5, 0.25 - 2.0), 1e-6));
        assert!(at(0.0, 1.0).abs_diff_eq(Vec2::new(0.5 + 3.0, 0.25), 1e-6));
    }
}
