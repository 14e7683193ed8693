//! Extensions that bring features of their own.

use super::features::Features;
use ash::vk;
use std::ffi::CStr;

/// An extension whose features are in a structure of its own.
pub(super) struct Extension {
    /// Its name, and the one of the extension that it was made from: structure and features are the same. The first one that
    /// the device has is taken.
    pub names: &'static [&'static CStr],
    /// The type of the structure.
    pub kind: vk::StructureType,
    /// How many features the structure holds.
    pub features: usize,
    /// The number of its first feature in the structure of Vulkan 1.4, if they became part of it.
    pub in_14: Option<usize>,
}

/// The structure of the features of Vulkan 1.4, which ash does not know yet.
pub(super) const VULKAN_14: vk::StructureType = vk::StructureType::from_raw(55);

/// Derivatives in compute: quads, then linear groups.
pub(super) const OF_DERIVATIVES: usize = 0;
/// Divisors of vertex bindings: other than 1, then 0.
pub(super) const OF_DIVISORS: usize = 1;
/// Clipping at the depth planes by itself.
pub(super) const OF_DEPTH_CLIP: usize = 2;

/// Lines: rectangular, Bresenham, smooth, then the same with stipples.
pub(super) const OF_LINES: usize = 3;
/// Provoking vertices: the last one, then that transform feedback keeps it.
pub(super) const OF_PROVOKING: usize = 4;

/// The extensions whose features the engine uses on devices that have them, by the numbers above.
pub(super) const EXTENSIONS: [Extension; 5] = [
    Extension {
        names: &[c"VK_KHR_compute_shader_derivatives", c"VK_NV_compute_shader_derivatives"],
        kind: vk::StructureType::PHYSICAL_DEVICE_COMPUTE_SHADER_DERIVATIVES_FEATURES_NV,
        features: 2,
        in_14: None,
    },
    Extension {
        // The older one first: validation layers know it.
        names: &[c"VK_EXT_vertex_attribute_divisor", c"VK_KHR_vertex_attribute_divisor"],
        kind: vk::StructureType::PHYSICAL_DEVICE_VERTEX_ATTRIBUTE_DIVISOR_FEATURES_KHR,
        features: 2,
        in_14: Some(11),
    },
    Extension {
        names: &[c"VK_EXT_depth_clip_enable"],
        kind: vk::StructureType::PHYSICAL_DEVICE_DEPTH_CLIP_ENABLE_FEATURES_EXT,
        features: 1,
        in_14: None,
    },
    Extension {
        // The older one first, as above.
        names: &[c"VK_EXT_line_rasterization", c"VK_KHR_line_rasterization"],
        kind: vk::StructureType::PHYSICAL_DEVICE_LINE_RASTERIZATION_FEATURES_KHR,
        features: 6,
        in_14: Some(5),
    },
    Extension {
        names: &[c"VK_EXT_provoking_vertex"],
        kind: vk::StructureType::PHYSICAL_DEVICE_PROVOKING_VERTEX_FEATURES_EXT,
        features: 2,
        in_14: None,
    },
];

/// The most features of one structure of Vulkan.
pub(super) const MAX_FEATURES: usize = 64;

/// The layout of all structures that hold features: nothing but booleans comes after the chain. It has room for any of them.
#[repr(C)]
pub(super) struct Structure {
    pub kind: vk::StructureType,
    pub next: *mut Structure,
    pub booleans: [vk::Bool32; MAX_FEATURES],
}

impl Structure {
    /// One of this kind, with nothing on.
    pub fn new(kind: vk::StructureType) -> Self {
        Self { kind, next: std::ptr::null_mut(), booleans: [vk::FALSE; MAX_FEATURES] }
    }
}

impl Extension {
    /// The first of its names that is among `names`.
    pub fn offered(&self, names: &[String]) -> Option<&'static CStr> {
        let is_there = |name: &CStr| names.iter().any(|e| e.as_bytes() == name.to_bytes());
        self.names.iter().copied().find(|name| is_there(name))
    }
}

impl Features {
    /// The extensions of which a feature is on, by their numbers.
    pub fn extended(&self) -> impl Iterator<Item = usize> {
        let numbered = self.extended.iter().enumerate();
        numbered.filter(|(_, booleans)| booleans.contains(&vk::TRUE)).map(|(number, _)| number)
    }
}
