//! The features of Vulkan, as the structures of its versions hold them.

use super::extension::{EXTENSIONS, MAX_FEATURES};
use ash::vk;

/// Features of Vulkan 1.0 to 1.3, and of the extensions that the engine uses; plain copies, no chains.
#[derive(Clone)]
pub(super) struct Features {
    pub core: vk::PhysicalDeviceFeatures,
    pub v11: vk::PhysicalDeviceVulkan11Features<'static>,
    pub v12: vk::PhysicalDeviceVulkan12Features<'static>,
    pub v13: vk::PhysicalDeviceVulkan13Features<'static>,
    /// The features of each of [`EXTENSIONS`], in the order of its structure.
    pub extended: [[vk::Bool32; MAX_FEATURES]; EXTENSIONS.len()],
}

impl Default for Features {
    fn default() -> Self {
        Self {
            core: Default::default(),
            v11: Default::default(),
            v12: Default::default(),
            v13: Default::default(),
            extended: [[vk::FALSE; MAX_FEATURES]; EXTENSIONS.len()],
        }
    }
}

// SAFETY: the only pointers are the structures' `p_next`, which are null.
unsafe impl Send for Features {}
// SAFETY: as above.
unsafe impl Sync for Features {}

/// One feature.
#[derive(Clone, Copy)]
pub struct Feature {
    /// What Vulkan calls it.
    pub name: &'static str,
    pub(super) get: fn(&Features) -> vk::Bool32,
    pub(super) set: fn(&mut Features),
}

/// The feature of a name, in a field of [`Features`].
macro_rules! named {
    ($name:literal, extended[$extension:ident][$number:literal]) => {
        $crate::vk::features::Feature {
            name: $name,
            get: |features| {
                use $crate::vk::extension;
                const { assert!($number < extension::EXTENSIONS[extension::$extension].features) };
                features.extended[extension::$extension][$number]
            },
            set: |features| {
                features.extended[$crate::vk::extension::$extension][$number] = ash::vk::TRUE;
            },
        }
    };
    ($name:literal, $structure:ident . $field:ident) => {
        $crate::vk::features::Feature {
            name: $name,
            get: |features| features.$structure.$field,
            set: |features| features.$structure.$field = ash::vk::TRUE,
        }
    };
}
pub(super) use named;

impl Feature {
    pub(super) fn is_on(&self, features: &Features) -> bool {
        (self.get)(features) == vk::TRUE
    }
}

impl std::fmt::Debug for Feature {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name)
    }
}

impl Features {
    /// Forgets the chains that the structures are in.
    pub fn unlink(&mut self) {
        self.v11.p_next = std::ptr::null_mut();
        self.v12.p_next = std::ptr::null_mut();
        self.v13.p_next = std::ptr::null_mut();
    }
}
