//! What has to be enabled on a device that the caller opens.

use super::{
    device,
    extension::{EXTENSIONS, Extension, Structure, VULKAN_14},
    features::{Feature, Features},
    requirements::{OPTIONAL, Optional, Probe, REQUIREMENTS},
};
use crate::error::Result;
use ash::vk::{self, TaggedStructure};
use std::ffi::{CStr, c_char, c_void};

/// What this library needs and uses on one device: features and extensions for the `VkDeviceCreateInfo` of a caller who
/// opens the device and then has it adopted ([`super::Gpu::adopt`]).
pub struct Enable {
    /// Required, or optional and offered.
    features: Vec<Feature>,
    /// The extensions that some of them belong to.
    needed: Vec<&'static CStr>,
    /// What the chain points to once something was added to it.
    core: vk::PhysicalDeviceFeatures,
    extensions: Vec<*const c_char>,
    added: Vec<Structure>,
}

impl Enable {
    /// What to enable on `physical`.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if it lacks something that is required; the message names it.
    ///
    /// # Safety
    /// The instance is alive and was created for Vulkan 1.3 or later. `physical` belongs to it.
    pub unsafe fn on(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Result<Self> {
        let probe = Probe::read(instance, physical);
        device::check(&device::describe(0, &probe), false)?;
        let optional = OPTIONAL.iter().filter(|optional| optional.present(&probe));
        let features = REQUIREMENTS.iter().map(|required| required.features);
        let features: Vec<_> =
            features.chain(optional.map(features_of)).flatten().copied().collect();
        let on = added_to(Features::default(), &features);
        Ok(Self {
            needed: on
                .extended()
                .filter_map(|n| EXTENSIONS[n].offered(&probe.extensions))
                .collect(),
            features,
            core: vk::PhysicalDeviceFeatures::default(),
            extensions: Vec::new(),
            added: Vec::new(),
        })
    }

    /// The features, by Vulkan's names.
    pub fn features(&self) -> impl Iterator<Item = &'static str> {
        self.features.iter().map(|feature| feature.name)
    }

    /// The extensions.
    pub fn extensions(&self) -> impl Iterator<Item = &'static CStr> {
        self.needed.iter().copied()
    }

    /// Adds all of it to `info`. Structures of features that are in the chain of `info` are written to. Structures that
    /// are missing are put in front: those of Vulkan 1.1 to 1.3, or, where the chain holds structures that became part of
    /// one of these, structures of the same kind, since Vulkan does not allow both.
    ///
    /// # Safety
    /// `info` and its chain are valid, and the structures of the chain may be written to.
    pub unsafe fn add_to<'a>(
        &'a mut self,
        mut info: vk::DeviceCreateInfo<'a>,
    ) -> vk::DeviceCreateInfo<'a> {
        // SAFETY: the caller's promise.
        let present = unsafe { structures(&info) };
        let is_there = |kind| present.iter().any(|(there, _)| *there == kind);
        for &(kind, structure) in &present {
            // SAFETY: the caller's promise; the structure is of this kind.
            unsafe { self.turn_on(kind, structure) };
        }
        if !is_there(vk::PhysicalDeviceFeatures2::STRUCTURE_TYPE) {
            // SAFETY: the caller's promise.
            let given = unsafe { info.p_enabled_features.as_ref() };
            let core = given.copied().unwrap_or_default();
            self.core = added_to(Features { core, ..Features::default() }, &self.features).core;
            info.p_enabled_features = &self.core;
        }
        let mut missing = Vec::new();
        for version in VERSIONS {
            let parts = PARTS.iter().filter(|part| part.version == version);
            match parts.clone().any(|part| is_there(part.kind)) {
                true => missing.extend(parts.map(|part| part.kind)),
                false => missing.push(version),
            }
        }
        // Vulkan 1.4 does not allow both.
        let has_14 = is_there(VULKAN_14);
        let others = EXTENSIONS.iter().filter(|extension| !has_14 || extension.in_14.is_none());
        missing.extend(others.map(|extension| extension.kind));
        self.added.clear();
        for kind in missing.into_iter().filter(|kind| !is_there(*kind)) {
            let mut structure = Structure::new(kind);
            // SAFETY: it is of this kind and large enough.
            unsafe { self.turn_on(kind, (&raw mut structure).cast()) };
            if structure.booleans.contains(&vk::TRUE) {
                self.added.push(structure);
            }
        }
        for structure in &mut self.added {
            structure.next = info.p_next.cast_mut().cast();
            info.p_next = (&raw const *structure).cast();
        }
        // SAFETY: the caller's promise.
        let named = unsafe { extensions(&info) };
        self.extensions = named.iter().map(|name| name.as_ptr()).collect();
        let others = self.needed.iter().filter(|name| !named.contains(name));
        self.extensions.extend(others.map(|name| name.as_ptr()));
        info.enabled_extension_names(&self.extensions)
    }

    /// Turns on in `structure` the features of its kind.
    ///
    /// # Safety
    /// It is a structure of this kind.
    unsafe fn turn_on(&self, kind: vk::StructureType, structure: *mut c_void) {
        let mut features = Features::default();
        // SAFETY: the caller's promise. What is not known is left alone, before and after.
        unsafe {
            read(&mut features, kind, structure);
            write(&added_to(features, &self.features), kind, structure);
        }
    }
}

fn features_of(optional: &Optional) -> &'static [Feature] {
    optional.features
}

/// `given`, with all features on that are `wanted`.
fn added_to(mut given: Features, wanted: &[Feature]) -> Features {
    wanted.iter().for_each(|feature| (feature.set)(&mut given));
    given
}

/// The structures that hold all features of a version of Vulkan.
const VERSIONS: [vk::StructureType; 3] = [
    vk::PhysicalDeviceVulkan11Features::STRUCTURE_TYPE,
    vk::PhysicalDeviceVulkan12Features::STRUCTURE_TYPE,
    vk::PhysicalDeviceVulkan13Features::STRUCTURE_TYPE,
];

/// A structure whose features became part of one of [`VERSIONS`].
struct Part {
    kind: vk::StructureType,
    version: vk::StructureType,
    /// Adds the features that are on in such a structure.
    read: unsafe fn(*const c_void, &mut Features),
    /// Turns features on in such a structure.
    write: unsafe fn(&Features, *mut c_void),
}

/// `part!(structure, number in VERSIONS, field of Features: fields of both)`.
macro_rules! part {
    ($structure:ident, $version:literal, $of:ident: $($field:ident),+ $(,)?) => {{
        const { assert!(size_of::<vk::$structure<'_>>() <= size_of::<Structure>()) };
        Part {
            kind: <vk::$structure<'_> as TaggedStructure>::STRUCTURE_TYPE,
            version: VERSIONS[$version],
            read: |from, features| {
                // SAFETY: the caller of `read` says that it is such a structure.
                let from = unsafe { &*from.cast::<vk::$structure<'_>>() };
                $( features.$of.$field |= from.$field; )+
            },
            write: |features, to| {
                // SAFETY: the caller of `write` says that it is such a structure.
                let to = unsafe { &mut *to.cast::<vk::$structure<'_>>() };
                $( to.$field |= features.$of.$field; )+
            },
        }
    }};
}

/// The structures that became part of those of [`VERSIONS`].
const PARTS: &[Part] = &[
    part!(PhysicalDeviceMultiviewFeatures, 0, v11: multiview),
    part!(PhysicalDeviceShaderDrawParametersFeatures, 0, v11:
        shader_draw_parameters),
    part!(PhysicalDevice16BitStorageFeatures, 0, v11:
        storage_buffer16_bit_access),
    part!(PhysicalDeviceBufferDeviceAddressFeatures, 1, v12:
        buffer_device_address),
    part!(PhysicalDeviceDescriptorIndexingFeatures, 1, v12:
        descriptor_binding_partially_bound, descriptor_binding_sampled_image_update_after_bind,
        descriptor_binding_storage_buffer_update_after_bind,
        descriptor_binding_storage_image_update_after_bind, runtime_descriptor_array,
        shader_sampled_image_array_non_uniform_indexing,
        shader_storage_buffer_array_non_uniform_indexing,
        shader_storage_image_array_non_uniform_indexing),
    part!(PhysicalDeviceScalarBlockLayoutFeatures, 1, v12:
        scalar_block_layout),
    part!(PhysicalDeviceShaderAtomicInt64Features, 1, v12:
        shader_buffer_int64_atomics),
    part!(PhysicalDeviceShaderFloat16Int8Features, 1, v12:
        shader_float16, shader_int8),
    part!(PhysicalDevice8BitStorageFeatures, 1, v12:
        storage_buffer8_bit_access),
    part!(PhysicalDeviceTimelineSemaphoreFeatures, 1, v12:
        timeline_semaphore),
    part!(PhysicalDeviceVulkanMemoryModelFeatures, 1, v12:
        vulkan_memory_model),
    part!(PhysicalDeviceSubgroupSizeControlFeatures, 2, v13:
        compute_full_subgroups, subgroup_size_control),
    part!(PhysicalDeviceDynamicRenderingFeatures, 2, v13:
        dynamic_rendering),
    part!(PhysicalDeviceImageRobustnessFeatures, 2, v13: robust_image_access),
    part!(PhysicalDeviceMaintenance4Features, 2, v13: maintenance4),
    part!(PhysicalDeviceShaderDemoteToHelperInvocationFeatures, 2, v13:
        shader_demote_to_helper_invocation),
    part!(PhysicalDeviceShaderIntegerDotProductFeatures, 2, v13:
        shader_integer_dot_product),
    part!(PhysicalDeviceSynchronization2Features, 2, v13:
        synchronization2),
];

/// Adds to `features` what a structure has on.
///
/// # Safety
/// It is a structure of this kind.
unsafe fn read(features: &mut Features, kind: vk::StructureType, structure: *const c_void) {
    // SAFETY: the caller's promise, for all of this.
    unsafe {
        match kind {
            vk::PhysicalDeviceFeatures2::STRUCTURE_TYPE => {
                features.core = (*structure.cast::<vk::PhysicalDeviceFeatures2<'_>>()).features;
            }
            vk::PhysicalDeviceVulkan11Features::STRUCTURE_TYPE => features.v11 = *structure.cast(),
            vk::PhysicalDeviceVulkan12Features::STRUCTURE_TYPE => features.v12 = *structure.cast(),
            vk::PhysicalDeviceVulkan13Features::STRUCTURE_TYPE => features.v13 = *structure.cast(),
            _ => {
                for (number, first) in extended(kind) {
                    let booleans = &raw const (*structure.cast::<Structure>()).booleans;
                    for n in 0..EXTENSIONS[number].features {
                        features.extended[number][n] |=
                            *booleans.cast::<vk::Bool32>().add(first + n);
                    }
                }
                if let Some(part) = PARTS.iter().find(|part| part.kind == kind) {
                    (part.read)(structure, features);
                }
            }
        }
    }
}

/// The extensions whose features are in structures of this kind, by number, with the number of the first feature there.
fn extended(kind: vk::StructureType) -> impl Iterator<Item = (usize, usize)> {
    let first = move |extension: &Extension| match extension.in_14 {
        Some(first) if kind == VULKAN_14 => Some(first),
        _ => (extension.kind == kind).then_some(0),
    };
    EXTENSIONS.iter().enumerate().filter_map(move |(number, e)| Some((number, first(e)?)))
}

/// The opposite of [`read`].
///
/// # Safety
/// It is a structure of this kind, and [`read`] read it last.
unsafe fn write(features: &Features, kind: vk::StructureType, structure: *mut c_void) {
    // SAFETY: the caller's promise, for all of this. The chains are those that were read.
    unsafe {
        match kind {
            vk::PhysicalDeviceFeatures2::STRUCTURE_TYPE => {
                (*structure.cast::<vk::PhysicalDeviceFeatures2<'_>>()).features = features.core;
            }
            vk::PhysicalDeviceVulkan11Features::STRUCTURE_TYPE => *structure.cast() = features.v11,
            vk::PhysicalDeviceVulkan12Features::STRUCTURE_TYPE => *structure.cast() = features.v12,
            vk::PhysicalDeviceVulkan13Features::STRUCTURE_TYPE => *structure.cast() = features.v13,
            _ => {
                for (number, first) in extended(kind) {
                    let booleans = &raw mut (*structure.cast::<Structure>()).booleans;
                    for n in 0..EXTENSIONS[number].features {
                        *booleans.cast::<vk::Bool32>().add(first + n) =
                            features.extended[number][n];
                    }
                }
                if let Some(part) = PARTS.iter().find(|part| part.kind == kind) {
                    (part.write)(features, structure);
                }
            }
        }
    }
}

/// The structures in the chain of `info`.
///
/// # Safety
/// The chain is valid.
unsafe fn structures(info: &vk::DeviceCreateInfo<'_>) -> Vec<(vk::StructureType, *mut c_void)> {
    let (mut found, mut at) =
        (Vec::new(), info.p_next.cast_mut().cast::<vk::BaseOutStructure<'_>>());
    while !at.is_null() {
        // SAFETY: each structure of a chain begins like this one.
        let structure = unsafe { &*at };
        found.push((structure.s_type, at.cast()));
        at = structure.p_next;
    }
    found
}

/// The extensions that `info` enables.
///
/// # Safety
/// Its list is valid.
unsafe fn extensions<'a>(info: &vk::DeviceCreateInfo<'a>) -> Vec<&'a CStr> {
    let (names, count) = (info.pp_enabled_extension_names, info.enabled_extension_count as usize);
    // SAFETY: the caller's promise.
    (0..count).map(|n| unsafe { CStr::from_ptr(*names.add(n)) }).collect()
}

/// Takes from `probe` the features and extensions that a device does not have which was created with `info`.
///
/// # Safety
/// `info` and its chain are valid.
pub(super) unsafe fn keep_enabled(probe: &mut Probe, info: &vk::DeviceCreateInfo<'_>) {
    let mut enabled = Features::default();
    // SAFETY: the caller's promise, for all of this.
    unsafe {
        if !info.p_enabled_features.is_null() {
            enabled.core = *info.p_enabled_features;
        }
        for (kind, structure) in structures(info) {
            read(&mut enabled, kind, structure);
        }
        enabled.unlink();
        let names = extensions(info);
        probe.extensions = names.iter().map(|name| name.to_string_lossy().into_owned()).collect();
        // Before Vulkan 1.2 had the feature, the extension was enough.
        if names.contains(&ash::khr::draw_indirect_count::NAME) {
            enabled.v12.draw_indirect_count = vk::TRUE;
        }
        if names.contains(&ash::khr::sampler_mirror_clamp_to_edge::NAME) {
            enabled.v12.sampler_mirror_clamp_to_edge = vk::TRUE;
        }
        let has_14 = structures(info).iter().any(|(kind, _)| *kind == VULKAN_14);
        for (booleans, extension) in enabled.extended.iter_mut().zip(&EXTENSIONS) {
            let is_part = has_14 && extension.in_14.is_some();
            if !is_part && extension.offered(&probe.extensions).is_none() {
                booleans.fill(vk::FALSE);
            }
        }
    }
    probe.features = enabled;
    probe.opened = true;
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::vk::{capability, extension::MAX_FEATURES};

    fn all() -> Vec<Feature> {
        let optional = OPTIONAL.iter().flat_map(features_of);
        REQUIREMENTS.iter().flat_map(|r| r.features).chain(optional).copied().collect()
    }

    fn enable(features: Vec<Feature>) -> Enable {
        let needed = EXTENSIONS.iter().map(|extension| extension.names[0]).collect();
        let core = Default::default();
        Enable { features, needed, core, extensions: Vec::new(), added: Vec::new() }
    }

    /// Whatever is left out is missed, and nothing else is, where the structures of the versions are added and where their
    /// parts are.
    #[test]
    fn each_feature_is_added_and_found_by_itself() {
        let all = all();
        for (left_out, feature) in all.iter().enumerate() {
            for parts in [false, true] {
                let mut wanted = all.clone();
                wanted.remove(left_out);
                let mut enable = enable(wanted);
                let mut of_11 = vk::PhysicalDeviceMultiviewFeatures::default();
                let mut of_12 = vk::PhysicalDeviceTimelineSemaphoreFeatures::default();
                let mut of_13 = vk::PhysicalDeviceSynchronization2Features::default();
                let mut info = vk::DeviceCreateInfo::default();
                if parts {
                    info = info.push_next(&mut of_11).push_next(&mut of_12).push_next(&mut of_13);
                }
                let mut probe = Probe::default();
                // SAFETY: the chains are those above.
                unsafe { keep_enabled(&mut probe, &enable.add_to(info)) };
                for other in &all {
                    let expected = other.name != feature.name;
                    assert_eq!(other.is_on(&probe.features), expected, "{other:?} {feature:?}");
                }
                assert!(probe.opened);
                let names = EXTENSIONS.iter().map(|e| e.names[0].to_str().unwrap());
                assert!(probe.extensions.iter().map(String::as_str).eq(names));
            }
        }
    }

    /// Vulkan 1.4 allows its own structure beside none of those that it took the features of.
    #[test]
    fn features_of_vulkan_1_4_are_added_to_its_structure() {
        let mut enable = enable(all());
        let mut of_14 = Structure::new(VULKAN_14);
        let info = vk::DeviceCreateInfo { p_next: (&raw mut of_14).cast(), ..Default::default() };
        let mut probe = Probe::default();
        // SAFETY: the chain is the one structure.
        let kinds: Vec<_> = unsafe {
            let info = enable.add_to(info);
            keep_enabled(&mut probe, &info);
            structures(&info).into_iter().map(|(kind, _)| kind).collect()
        };
        let mut parts = EXTENSIONS.iter().filter(|e| e.in_14.is_some());
        assert!(kinds.contains(&VULKAN_14), "{kinds:?}");
        assert!(parts.all(|part| !kinds.contains(&part.kind)), "{kinds:?}");
        assert_eq!(of_14.booleans[11..13], [vk::TRUE; 2], "divisors");
        assert_eq!(of_14.booleans[5..7], [vk::TRUE; 2], "lines");
        assert!(all().iter().all(|feature| feature.is_on(&probe.features)));
        assert_eq!(of_14.booleans.iter().filter(|b| **b == vk::TRUE).count(), 4);
    }

    /// Users' shaders may need features that this library does not: they are found in all structures.
    #[test]
    fn no_feature_of_users_shaders_is_overlooked() {
        let mut features = Features::default();
        features.extended.as_flattened_mut().fill(vk::TRUE);
        let (next, booleans) = (std::ptr::null_mut(), [vk::TRUE; MAX_FEATURES]);
        for part in PARTS {
            let structure = Structure { kind: part.kind, next, booleans };
            // SAFETY: it is of this kind.
            unsafe { (part.read)((&raw const structure).cast(), &mut features) };
        }
        let core = Structure { kind: vk::PhysicalDeviceFeatures2::STRUCTURE_TYPE, next, booleans };
        // SAFETY: as above.
        unsafe { read(&mut features, core.kind, (&raw const core).cast()) };
        let mut probe = Probe { features, ..Probe::default() };
        probe.extensions = vec!["VK_KHR_compute_shader_derivatives".into()];
        probe.vulkan11.subgroup_supported_operations = vk::SubgroupFeatureFlags::from_raw(!0);
        let lacking = capability::lacking(&probe);
        assert!(lacking.is_empty(), "{lacking:?}");
        assert_eq!(probe.features.v12.draw_indirect_count, vk::FALSE, "no part has it");
    }
}
