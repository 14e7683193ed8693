//! The features that a device must offer and those that it may offer, as data.
//!
//! The list is kept short on purpose: no 64-bit integers, no 64-bit floats, no graphics queue, no
//! extension. Everything on it is in Vulkan 1.3 and is offered by every desktop driver since 2022 and
//! by both CPU drivers.

use super::{
    extension::{EXTENSIONS, Structure},
    features::{Feature, Features, named},
};
use ash::vk;

/// The properties of a physical device, read before it is opened; plain copies, no chains.
#[derive(Clone, Default)]
pub(super) struct Probe {
    pub properties: vk::PhysicalDeviceProperties,
    pub vulkan11: vk::PhysicalDeviceVulkan11Properties<'static>,
    pub vulkan12: vk::PhysicalDeviceVulkan12Properties<'static>,
    pub vulkan13: vk::PhysicalDeviceVulkan13Properties<'static>,
    /// Those that it offers or, of a device that was opened, those that are enabled.
    pub features: Features,
    pub memory: vk::PhysicalDeviceMemoryProperties,
    pub queues: Vec<vk::QueueFamilyProperties>,
    /// Extensions that it offers or, of a device that was opened, those that are enabled.
    pub extensions: Vec<String>,
    /// Whether `features` and `extensions` are those that are enabled.
    pub opened: bool,
}

// SAFETY: the only pointers are the structures' `p_next`, which are null.
unsafe impl Send for Probe {}
// SAFETY: as above.
unsafe impl Sync for Probe {}

/// Derivative instructions in compute.
pub(super) const COMPUTE_DERIVATIVES: Feature =
    named!("computeDerivativeGroupLinear", extended[OF_DERIVATIVES][1]);
/// Divisors of vertex bindings in the device's own pipeline.
pub(super) const DIVISORS: [Feature; 2] = [
    named!("vertexAttributeInstanceRateDivisor", extended[OF_DIVISORS][0]),
    named!("vertexAttributeInstanceRateZeroDivisor", extended[OF_DIVISORS][1]),
];
/// Clipping at the depth planes as a switch of the device's own pipeline.
pub(super) const DEPTH_CLIP: Feature = named!("depthClipEnable", extended[OF_DEPTH_CLIP][0]);
/// Modes of lines and of provoking vertices of the device's own pipeline.
pub(super) const RECTANGULAR_LINES: Feature = named!("rectangularLines", extended[OF_LINES][0]);
pub(super) const BRESENHAM_LINES: Feature = named!("bresenhamLines", extended[OF_LINES][1]);
pub(super) const PROVOKED_LAST: Feature = named!("provokingVertexLast", extended[OF_PROVOKING][0]);

/// Something a device must offer.
pub struct Requirement {
    /// What, in Vulkan's words.
    pub name: &'static str,
    /// Why the engine needs it.
    pub why: &'static str,
    /// The features of Vulkan that belong to it: they are enabled when the device is opened.
    pub features: &'static [Feature],
    /// What else belongs to it. `Some` says what the device offers instead, and the fix where there is one.
    check: fn(&Probe) -> Option<String>,
}

/// Something a device may offer and the engine then uses.
pub struct Optional {
    /// What, in Vulkan's words.
    pub name: &'static str,
    /// The engine's use of it, and the replacement without it.
    pub why: &'static str,
    /// The features of Vulkan that belong to it: they are enabled when the device is opened.
    pub features: &'static [Feature],
    /// What else belongs to it.
    check: fn(&Probe) -> bool,
}

/// A requirement that a device does not meet.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Missing {
    /// [`Requirement::name`].
    pub name: &'static str,
    /// [`Requirement::why`].
    pub why: &'static str,
    /// The device's own value, and the fix if there is one.
    pub found: String,
}

/// The subgroup operations that kernels use.
const SUBGROUP_OPERATIONS: vk::SubgroupFeatureFlags = vk::SubgroupFeatureFlags::from_raw(
    vk::SubgroupFeatureFlags::BASIC.as_raw()
        | vk::SubgroupFeatureFlags::VOTE.as_raw()
        | vk::SubgroupFeatureFlags::ARITHMETIC.as_raw()
        | vk::SubgroupFeatureFlags::BALLOT.as_raw()
        | vk::SubgroupFeatureFlags::SHUFFLE.as_raw()
        | vk::SubgroupFeatureFlags::QUAD.as_raw(),
);

/// Everything a device must offer. Published so that `devices`, `doctor` and the documentation
/// cannot disagree with the check.
pub const REQUIREMENTS: &[Requirement] = &[
    Requirement {
        name: "Vulkan 1.3",
        why: "the base of everything below",
        features: &[],
        check: |p| {
            let version = p.properties.api_version;
            (version < vk::API_VERSION_1_3).then(|| {
                format!(
                    "offers Vulkan {}.{}; a newer driver may offer 1.3",
                    vk::api_version_major(version),
                    vk::api_version_minor(version)
                )
            })
        },
    },
    Requirement {
        name: "a lavapipe of Mesa 23 or newer",
        why: "older ones stop loops after 65,535 iterations without a word",
        features: &[],
        check: |p| {
            if p.vulkan12.driver_id != vk::DriverId::MESA_LLVMPIPE {
                return None;
            }
            let info = p.vulkan12.driver_info_as_c_str().ok()?.to_string_lossy();
            let major = mesa_major(&info)?;
            (major < 23).then(|| {
                format!(
                    "is {info}; on Debian 12: apt install -t bookworm-backports mesa-vulkan-drivers"
                )
            })
        },
    },
    Requirement {
        name: "a compute queue",
        why: "the kernels run on it",
        features: &[],
        check: |p| {
            let compute = |q: &vk::QueueFamilyProperties| {
                q.queue_count > 0 && q.queue_flags.contains(vk::QueueFlags::COMPUTE)
            };
            (!p.queues.iter().any(compute)).then(|| "has none".into())
        },
    },
    Requirement {
        name: "scalarBlockLayout",
        why: "host structures and kernels agree byte for byte",
        features: &[named!("scalarBlockLayout", v12.scalar_block_layout)],
        check: nothing_else,
    },
    Requirement {
        name: "runtimeDescriptorArray",
        why: "all resources of users' shaders live in one table",
        features: &[named!("runtimeDescriptorArray", v12.runtime_descriptor_array)],
        check: nothing_else,
    },
    Requirement {
        name: "descriptorBindingPartiallyBound",
        why: "the table is filled as far as a pass needs",
        features: &[named!(
            "descriptorBindingPartiallyBound",
            v12.descriptor_binding_partially_bound
        )],
        check: nothing_else,
    },
    Requirement {
        name: "descriptorBinding*UpdateAfterBind for sampled images, storage images, storage buffers",
        why: "the table is larger than the limits of ordinary sets",
        features: &[
            named!(
                "descriptorBindingSampledImageUpdateAfterBind",
                v12.descriptor_binding_sampled_image_update_after_bind
            ),
            named!(
                "descriptorBindingStorageImageUpdateAfterBind",
                v12.descriptor_binding_storage_image_update_after_bind
            ),
            named!(
                "descriptorBindingStorageBufferUpdateAfterBind",
                v12.descriptor_binding_storage_buffer_update_after_bind
            ),
        ],
        check: nothing_else,
    },
    Requirement {
        name: "non-uniform indexing of sampled images, storage images, storage buffers",
        why: "neighbouring pixels may belong to different draws",
        features: &[
            named!(
                "shaderSampledImageArrayNonUniformIndexing",
                v12.shader_sampled_image_array_non_uniform_indexing
            ),
            named!(
                "shaderStorageImageArrayNonUniformIndexing",
                v12.shader_storage_image_array_non_uniform_indexing
            ),
            named!(
                "shaderStorageBufferArrayNonUniformIndexing",
                v12.shader_storage_buffer_array_non_uniform_indexing
            ),
        ],
        check: nothing_else,
    },
    Requirement {
        name: "subgroup basic, vote, arithmetic, ballot, shuffle and quad operations in compute",
        why: "a subgroup works on one bin and its quads share derivatives",
        features: &[],
        check: |p| {
            let operations = p.vulkan11.subgroup_supported_operations;
            let compute =
                p.vulkan11.subgroup_supported_stages.contains(vk::ShaderStageFlags::COMPUTE);
            (!compute || !operations.contains(SUBGROUP_OPERATIONS))
                .then(|| format!("lacks {:?}", SUBGROUP_OPERATIONS & !operations))
        },
    },
    Requirement {
        name: "subgroups of 4 to 128 invocations",
        why: "a quad fits a subgroup and a ballot fits four words",
        features: &[],
        check: |p| {
            let (min, max) = (p.vulkan13.min_subgroup_size, p.vulkan13.max_subgroup_size);
            let size = p.vulkan11.subgroup_size;
            (!(4..=128).contains(&size) || min > 128 || max < 4)
                .then(|| format!("has subgroups of {size} ({min} to {max})"))
        },
    },
    Requirement {
        name: "subgroupSizeControl and computeFullSubgroups",
        why: "lanes 4m to 4m+3 are a quad only in a full subgroup",
        features: &[
            named!("subgroupSizeControl", v13.subgroup_size_control),
            named!("computeFullSubgroups", v13.compute_full_subgroups),
        ],
        check: nothing_else,
    },
    Requirement {
        name: "synchronization2",
        why: "barriers",
        features: &[named!("synchronization2", v13.synchronization2)],
        check: nothing_else,
    },
    Requirement {
        name: "timelineSemaphore",
        why: "one semaphore counts what was submitted",
        features: &[named!("timelineSemaphore", v12.timeline_semaphore)],
        check: nothing_else,
    },
    Requirement {
        name: "robustBufferAccess and robustImageAccess",
        why: "shaders that index beyond a block or an image reach no other memory",
        features: &[
            named!("robustBufferAccess", core.robust_buffer_access),
            named!("robustImageAccess", v13.robust_image_access),
        ],
        check: nothing_else,
    },
    Requirement {
        name: "maintenance4",
        why: "workgroup sizes by specialization, limits of buffers",
        features: &[named!("maintenance4", v13.maintenance4)],
        check: nothing_else,
    },
    Requirement {
        name: "shaderDemoteToHelperInvocation",
        why: "`discard` keeps derivatives defined",
        features: &[named!(
            "shaderDemoteToHelperInvocation",
            v13.shader_demote_to_helper_invocation
        )],
        check: nothing_else,
    },
    Requirement {
        name: "8 storage buffers and 128 bytes of push constants for the kernels themselves",
        why: "the buffers between stages",
        features: &[],
        check: |p| {
            let limits = &p.properties.limits;
            (limits.max_per_stage_descriptor_storage_buffers < 16
                || limits.max_push_constants_size < 128)
                .then(|| {
                    format!(
                        "has {} and {}",
                        limits.max_per_stage_descriptor_storage_buffers,
                        limits.max_push_constants_size
                    )
                })
        },
    },
];

/// State of the device's own pipeline.
const fn of_classic(name: &'static str, features: &'static [Feature]) -> Optional {
    let why = "this state in the classic executor; compute needs nothing for it";
    Optional { name, why, features, check: |_| true }
}

/// The optional features that the engine uses on devices that have them.
pub const OPTIONAL: &[Optional] = &[
    Optional {
        name: "a graphics queue",
        why: "the classic executor, for comparison; compute needs none",
        features: &[named!("dynamicRendering", v13.dynamic_rendering)],
        check: |p| p.graphics_family().is_some(),
    },
    Optional {
        name: "VK_KHR_compute_shader_derivatives",
        why: "derivatives by the device's own rule; otherwise by quad operations",
        features: &[COMPUTE_DERIVATIVES],
        check: |_| true,
    },
    Optional {
        name: "bufferDeviceAddress on lavapipe",
        why: "kernels reach buffers by address, which this driver does faster; otherwise by descriptors",
        features: &[named!("bufferDeviceAddress", v12.buffer_device_address)],
        // Other drivers read storage blocks as well, and check bounds.
        check: |p| p.vulkan12.driver_id == vk::DriverId::MESA_LLVMPIPE,
    },
    Optional {
        name: "samplerAnisotropy",
        why: "samplers that ask for it; otherwise they are refused",
        features: &[named!("samplerAnisotropy", core.sampler_anisotropy)],
        check: |_| true,
    },
    Optional {
        name: "imageCubeArray",
        why: "arrays of cubes; otherwise they are refused",
        features: &[named!("imageCubeArray", core.image_cube_array)],
        check: |_| true,
    },
    Optional {
        name: "fragmentStoresAndAtomics and vertexPipelineStoresAndAtomics",
        why: "the classic executor's shaders that write memory; compute needs neither",
        features: &[
            named!("fragmentStoresAndAtomics", core.fragment_stores_and_atomics),
            named!("vertexPipelineStoresAndAtomics", core.vertex_pipeline_stores_and_atomics),
        ],
        check: |_| true,
    },
    of_classic("VK_EXT_vertex_attribute_divisor", &DIVISORS),
    of_classic("VK_EXT_depth_clip_enable", &[DEPTH_CLIP]),
    of_classic("rectangularLines of VK_EXT_line_rasterization", &[RECTANGULAR_LINES]),
    of_classic("bresenhamLines of VK_EXT_line_rasterization", &[BRESENHAM_LINES]),
    of_classic("VK_EXT_provoking_vertex", &[PROVOKED_LAST]),
    of_classic("geometryShader", &[named!("geometryShader", core.geometry_shader)]),
    of_classic("wideLines", &[named!("wideLines", core.wide_lines)]),
    of_classic("largePoints", &[named!("largePoints", core.large_points)]),
    of_classic("dualSrcBlend", &[named!("dualSrcBlend", core.dual_src_blend)]),
    of_classic("alphaToOne", &[named!("alphaToOne", core.alpha_to_one)]),
    of_classic("sampleRateShading", &[named!("sampleRateShading", core.sample_rate_shading)]),
    of_classic("depthClamp", &[named!("depthClamp", core.depth_clamp)]),
    of_classic("depthBiasClamp", &[named!("depthBiasClamp", core.depth_bias_clamp)]),
    of_classic("depthBounds", &[named!("depthBounds", core.depth_bounds)]),
    of_classic("logicOp", &[named!("logicOp", core.logic_op)]),
    of_classic("independentBlend", &[named!("independentBlend", core.independent_blend)]),
    Optional {
        name: "shaderBufferInt64Atomics",
        why: "depth and primitive in one atomic for tiny triangles; otherwise two 32-bit passes",
        features: &[
            named!("shaderBufferInt64Atomics", v12.shader_buffer_int64_atomics),
            named!("shaderInt64", core.shader_int64),
        ],
        check: |_| true,
    },
    Optional {
        name: "timestamps on the compute queue",
        why: "times per stage; otherwise only the host's clock",
        features: &[],
        check: |p| p.properties.limits.timestamp_compute_and_graphics == vk::TRUE,
    },
];

/// The features of the requirement are all that there is to check.
fn nothing_else(_: &Probe) -> Option<String> {
    None
}

/// The major version in `Mesa 25.0.7-2 (LLVM 15.0.6)`.
fn mesa_major(info: &str) -> Option<u32> {
    let rest = info.split_once("Mesa ")?.1;
    rest.split(|c: char| !c.is_ascii_digit()).next()?.parse().ok()
}

impl Requirement {
    pub(super) fn missing(&self, probe: &Probe) -> Option<Missing> {
        let off = self.features.iter().find(|feature| !feature.is_on(&probe.features));
        let found = match off {
            Some(_) if !probe.opened => Some("is not offered; a newer driver may".to_string()),
            Some(feature) => Some(format!("has `{}` not enabled", feature.name)),
            None => (self.check)(probe),
        };
        found.map(|found| Missing { name: self.name, why: self.why, found })
    }
}

impl Optional {
    pub(super) fn present(&self, probe: &Probe) -> bool {
        self.features.iter().all(|feature| feature.is_on(&probe.features)) && (self.check)(probe)
    }
}

impl Probe {
    /// Reads everything that requirements and limits look at.
    pub fn read(instance: &ash::Instance, physical: vk::PhysicalDevice) -> Self {
        let mut probe = Self::default();
        // SAFETY: `physical` comes from `instance`; every chained structure lives on this stack
        // and is one that the queried version knows.
        unsafe {
            probe.properties = instance.get_physical_device_properties(physical);
            probe.features.core = instance.get_physical_device_features(physical);
            probe.memory = instance.get_physical_device_memory_properties(physical);
            probe.queues = instance.get_physical_device_queue_family_properties(physical);
            probe.extensions = instance
                .enumerate_device_extension_properties(physical)
                .unwrap_or_default()
                .iter()
                .filter_map(|e| e.extension_name_as_c_str().ok())
                .map(|name| name.to_string_lossy().into_owned())
                .collect();
            if probe.properties.api_version < vk::API_VERSION_1_1 {
                return probe;
            }
            let has12 = probe.properties.api_version >= vk::API_VERSION_1_2;
            let has13 = probe.properties.api_version >= vk::API_VERSION_1_3;
            let mut properties = vk::PhysicalDeviceProperties2::default();
            if has12 {
                properties =
                    properties.push_next(&mut probe.vulkan11).push_next(&mut probe.vulkan12);
            }
            if has13 {
                properties = properties.push_next(&mut probe.vulkan13);
            }
            instance.get_physical_device_properties2(physical, &mut properties);
            let mut structures = EXTENSIONS.each_ref().map(|e| Structure::new(e.kind));
            let mut features = vk::PhysicalDeviceFeatures2::default();
            if has12 {
                features =
                    features.push_next(&mut probe.features.v11).push_next(&mut probe.features.v12);
            }
            if has13 {
                features = features.push_next(&mut probe.features.v13);
            }
            for (structure, extension) in structures.iter_mut().zip(&EXTENSIONS) {
                if extension.offered(&probe.extensions).is_some() {
                    structure.next = features.p_next.cast();
                    features.p_next = (&raw mut *structure).cast();
                }
            }
            instance.get_physical_device_features2(physical, &mut features);
            probe.features.extended = structures.map(|structure| structure.booleans);
        }
        // The structures are chained again at device creation: a stale link there never ends.
        probe.vulkan11.p_next = std::ptr::null_mut();
        probe.vulkan12.p_next = std::ptr::null_mut();
        probe.vulkan13.p_next = std::ptr::null_mut();
        probe.features.unlink();
        probe
    }

    /// All requirements that are not met.
    pub fn missing(&self) -> Vec<Missing> {
        let missing = REQUIREMENTS.iter().filter_map(|r| r.missing(self));
        if self.properties.api_version < vk::API_VERSION_1_3 {
            // Nothing else was read, so nothing else can be said.
            return missing.take(1).collect();
        }
        missing.collect()
    }

    /// The family that runs everything: one that draws too, if there is one.
    pub fn family(&self) -> Option<u32> {
        self.graphics_family().or_else(|| {
            let compute = |q: &vk::QueueFamilyProperties| {
                q.queue_count > 0 && q.queue_flags.contains(vk::QueueFlags::COMPUTE)
            };
            self.queues.iter().position(compute).map(|i| i as u32)
        })
    }

    fn graphics_family(&self) -> Option<u32> {
        let both = vk::QueueFlags::COMPUTE | vk::QueueFlags::GRAPHICS;
        let fits =
            |q: &vk::QueueFamilyProperties| q.queue_count > 0 && q.queue_flags.contains(both);
        self.queues.iter().position(fits).map(|i| i as u32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mesa_versions_are_read_from_driver_info() {
        assert_eq!(mesa_major("Mesa 25.0.7-2~bpo12+1 (LLVM 15.0.6)"), Some(25));
        assert_eq!(mesa_major("Mesa 22.3.6 (LLVM 15.0.6)"), Some(22));
        assert_eq!(mesa_major("SwiftShader"), None);
    }

    #[test]
    fn an_empty_probe_misses_only_the_version_that_hides_the_rest() {
        let missing = Probe::default().missing();
        assert_eq!(missing.len(), 1);
        assert_eq!(missing[0].name, "Vulkan 1.3");
    }
}
