//! Kernels: SPIR-V, the names that it binds, and the pipeline.

use super::{
    address,
    capability::{declares, has_compute_derivatives, missing_feature},
    device::DeviceKind,
    fold,
    gpu::{Gpu, Shared},
    instance::WITH_DERIVATIVES,
    reflect::{BlockBinding, KernelReflection, reflect},
    table_bounds,
};
use crate::{
    error::{Error, Result},
    shader,
};
use ash::vk;
use rspirv::spirv::Capability;
use std::{
    borrow::Cow,
    collections::{HashMap, HashSet},
    sync::Arc,
};

/// How to make a [`Kernel`].
#[derive(Clone, Copy, Debug, Default)]
#[non_exhaustive]
pub struct KernelInfo<'a> {
    /// For messages, labels and timings.
    pub name: &'a str,
    /// A module with one compute entry point, `main`, for Vulkan up to 1.2. Its storage and uniform blocks are in set 0 and
    /// keep their names ([`super::Dispatch::bind`] finds them by name). Images and samplers come from a
    /// [`super::ResourceTable`], which is set 1.
    pub spirv: &'a [u32],
    /// The kernel's own specialization constants by name, with the bits of their values.
    pub constants: &'a [(&'a str, u32)],
    /// Specialization constants by `constant_id`: those of a spliced user shader. Ids that the
    /// module does not have are ignored, as Vulkan does.
    pub constant_ids: &'a [(u32, u32)],
    /// Every subgroup is full; the workgroup is then a multiple of the largest subgroup size.
    pub full_subgroups: bool,
    /// The subgroup size, where the device offers several.
    pub subgroup_size: Option<u32>,
}

impl<'a> KernelInfo<'a> {
    /// A kernel without specialization, for subgroups of any size.
    pub fn new(name: &'a str, spirv: &'a [u32]) -> Self {
        Self { name, spirv, ..Self::default() }
    }

    setters! {
        constants: &'a [(&'a str, u32)],
        constant_ids: &'a [(u32, u32)],
        full_subgroups: bool,
        subgroup_size: Option<u32>,
    }
}

/// A compute pipeline and the names that it binds. A clone is the same kernel.
#[derive(Clone)]
pub struct Kernel(pub(super) Arc<RawKernel>);

pub(super) struct RawKernel {
    pub name: String,
    pub pipeline: vk::Pipeline,
    pub layout: vk::PipelineLayout,
    pub set_layout: vk::DescriptorSetLayout,
    pub reflection: KernelReflection,
    pub(super) gpu: Arc<Shared>,
}

impl Kernel {
    /// Makes a kernel of GLSL, whose first line is `#version 460` or another. See [`KernelInfo::spirv`] for what it may bind.
    ///
    /// # Errors
    /// [`Error::Shader`] with the compiler's messages, or because the crate was built without a GLSL compiler (features
    /// `glsl` and `glsl-bundled`); as [`Kernel::new`].
    pub fn from_glsl(gpu: &Gpu, name: &str, source: &str) -> Result<Self> {
        let spirv = shader::compile_kernel(name, source)?;
        Self::own(gpu, &KernelInfo { name, spirv: &spirv, ..KernelInfo::default() })
    }

    /// Makes a kernel: validates the module, reflects it, checks its names against `info`, compiles it. It reaches its
    /// buffers by descriptor, so that the device checks bounds.
    ///
    /// The validator is the program `spirv-val` of SPIRV-Tools, as for [`crate::shader::Shader::from_spirv`].
    ///
    /// # Errors
    /// [`Error::Shader`] if the words are not valid for Vulkan 1.3, or if there is no `spirv-val` in `PATH`.
    /// [`Error::Usage`] names the fault: the module reaches memory by address, which
    /// is not checked against bounds, a constant does not exist, or the workgroup or the push constants are
    /// larger than the device allows. [`Error::Device`] if the driver refuses it.
    pub fn new(gpu: &Gpu, info: &KernelInfo<'_>) -> Result<Self> {
        shader::validate_kernel(info.name, info.spirv)?;
        Self::own(gpu, info)
    }

    /// As [`Kernel::new`], for a module that is known to be valid: no validator is asked.
    ///
    /// # Safety
    /// The words are a valid module for Vulkan 1.3. Drivers crash on others.
    ///
    /// # Errors
    /// As [`Kernel::new`].
    pub unsafe fn new_unchecked(gpu: &Gpu, info: &KernelInfo<'_>) -> Result<Self> {
        Self::own(gpu, info)
    }

    /// As [`Kernel::new`], for a module that this crate compiled.
    pub(crate) fn own(gpu: &Gpu, info: &KernelInfo<'_>) -> Result<Self> {
        if declares(info.spirv, Capability::PhysicalStorageBufferAddresses) {
            return Err(Error::Usage(format!(
                "kernel `{}` reaches memory by address, which is not checked against bounds",
                info.name
            )));
        }
        let variable = [Capability::VariablePointers, Capability::VariablePointersStorageBuffer];
        if variable.iter().any(|&capability| declares(info.spirv, capability)) {
            return Err(Error::Usage(format!(
                "kernel `{}` computes with pointers (the capability VariablePointers), which are not checked against bounds",
                info.name
            )));
        }
        let kept = table_bounds::keep_arrays(info.spirv)
            .map_err(|fault| Error::Usage(format!("kernel `{}` {fault}", info.name)))?;
        Self::make(gpu, &KernelInfo { spirv: &kept, ..*info }, false)
    }

    /// As [`Kernel::new`], for a module that keeps to the bounds of its own buffers. These are the engine's
    /// kernels, also with a user's shader in them, which sees only the resource table. Such a kernel reaches
    /// its buffers by address if that is faster on this driver.
    pub(crate) fn trusted(gpu: &Gpu, info: &KernelInfo<'_>) -> Result<Self> {
        Self::make(gpu, info, gpu.0.addresses)
    }

    fn make(gpu: &Gpu, info: &KernelInfo<'_>, by_address: bool) -> Result<Self> {
        let fault = |text: String| Error::Usage(format!("kernel `{}` {text}", info.name));
        let mut specialized: HashMap<u32, u32> = info.constant_ids.iter().copied().collect();
        if !info.constants.is_empty() {
            let plain = reflect(info.spirv, &HashMap::new()).map_err(fault)?;
            for (name, value) in info.constants {
                let id = plain.constants.iter().find(|c| c.0 == *name).map(|c| c.1);
                let id = id.ok_or_else(|| {
                    let known: Vec<_> = plain.constants.iter().map(|c| c.0.as_str()).collect();
                    fault(format!("has no constant `{name}`; it has `{}`", known.join("`, `")))
                })?;
                specialized.insert(id, *value);
            }
        }
        let mut reflection = reflect(info.spirv, &specialized).map_err(fault)?;
        check_limits(gpu, info, &reflection).map_err(fault)?;

        let shared = gpu.0.clone();
        let addressed = match by_address {
            true => address::lower(info.spirv, shared.int64).map_err(fault)?,
            false => None,
        };
        if let Some(addressed) = &addressed {
            reflection.replaced(addressed);
        }
        let mut spirv =
            addressed.map_or(Cow::Borrowed(info.spirv), |addressed| Cow::Owned(addressed.spirv));
        if reflection.uses_table {
            spirv = Cow::Owned(table_bounds::keep(&spirv, shared.table_sizes).map_err(fault)?);
        }
        // Other drivers for CPUs than lavapipe compile long what constants rule out.
        if gpu.info().kind == DeviceKind::Cpu
            && !gpu.reads_by_address()
            && let Some(folded) = fold::specialize(&spirv, &specialized)
        {
            spirv = Cow::Owned(folded);
            specialized.clear();
        }
        // From here on `raw` destroys what exists if anything fails.
        let mut raw = RawKernel {
            name: info.name.to_string(),
            pipeline: vk::Pipeline::null(),
            layout: vk::PipelineLayout::null(),
            set_layout: vk::DescriptorSetLayout::null(),
            reflection,
            gpu: shared.clone(),
        };
        raw.create_layouts()?;
        raw.create_pipeline(&spirv, info, &specialized)?;
        shared.set_name(raw.pipeline, info.name);
        Ok(Self(Arc::new(raw)))
    }

    /// The name it was made with.
    pub fn name(&self) -> &str {
        &self.0.name
    }

    /// Whether somebody else holds a clone, a recording for example.
    pub(crate) fn is_shared(&self) -> bool {
        Arc::strong_count(&self.0) > 1
    }

    /// Invocations of one workgroup, in each direction.
    pub fn workgroup(&self) -> [u32; 3] {
        self.0.reflection.workgroup
    }

    /// Names of the buffers it binds, by binding number.
    pub fn buffers(&self) -> impl Iterator<Item = &str> {
        self.0.reflection.bindings.iter().map(|b| b.name.as_str())
    }

    /// Whether it uses the resource table.
    pub fn uses_table(&self) -> bool {
        self.0.reflection.uses_table || self.0.reflection.table_address
    }

    /// Bytes of its push constants.
    pub fn push_constant_bytes(&self) -> u32 {
        self.0.reflection.push_constant_bytes
    }
}

impl std::fmt::Debug for Kernel {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Kernel `{}`", self.0.name)
    }
}

fn check_limits(
    gpu: &Gpu,
    info: &KernelInfo<'_>,
    reflection: &KernelReflection,
) -> std::result::Result<(), String> {
    if let Some(feature) = missing_feature(&gpu.0.lacking, info.spirv) {
        return Err(format!("needs {feature}, which {} does not offer", gpu.name()));
    }
    let limits = gpu.limits();
    let invocations = reflection.workgroup.iter().map(|&n| u64::from(n)).product::<u64>();
    if invocations == 0 || invocations > u64::from(limits.workgroup_invocations) {
        return Err(format!(
            "has workgroups of {invocations} invocations; {} allows {}",
            gpu.name(),
            limits.workgroup_invocations
        ));
    }
    if reflection.push_constant_bytes > gpu.0.push_constant_bytes {
        return Err(format!(
            "has {} bytes of push constants; {} allows {}",
            reflection.push_constant_bytes,
            gpu.name(),
            gpu.0.push_constant_bytes
        ));
    }
    if reflection.shared_bytes > u64::from(limits.shared_bytes) {
        return Err(format!(
            "shares {} bytes in a workgroup; {} allows {}",
            reflection.shared_bytes,
            gpu.name(),
            limits.shared_bytes
        ));
    }
    let (min, max) = limits.subgroup_sizes;
    if let Some(size) = info.subgroup_size
        && (!size.is_power_of_two() || !(min..=max).contains(&size))
    {
        return Err(format!("asks for subgroups of {size}; {} has {min} to {max}", gpu.name()));
    }
    let widest = info.subgroup_size.unwrap_or(max);
    if info.full_subgroups && !reflection.workgroup[0].is_multiple_of(widest) {
        return Err(format!(
            "asks for full subgroups of {widest} in workgroups {} wide",
            reflection.workgroup[0]
        ));
    }
    Ok(())
}

impl RawKernel {
    /// The block called `name`.
    pub fn binding(&self, name: &str) -> Option<&BlockBinding> {
        self.reflection.bindings.iter().find(|b| b.name == name)
    }

    fn create_layouts(&mut self) -> Result<()> {
        let bindings: Vec<_> = self
            .reflection
            .descriptors()
            .map(|(binding, kind)| {
                vk::DescriptorSetLayoutBinding::default()
                    .binding(binding)
                    .descriptor_type(kind)
                    .descriptor_count(1)
                    .stage_flags(vk::ShaderStageFlags::COMPUTE)
            })
            .collect();
        let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
        let what = || format!("creating the layout of kernel `{}`", self.name);
        // SAFETY: the device is alive.
        self.set_layout = unsafe { self.gpu.device.create_descriptor_set_layout(&info, None) }
            .map_err(|e| self.gpu.failure(&what(), e))?;
        let mut sets = vec![self.set_layout];
        if self.reflection.uses_table {
            sets.push(self.gpu.table_layout);
        }
        let push = [vk::PushConstantRange::default()
            .stage_flags(vk::ShaderStageFlags::COMPUTE)
            .size(self.reflection.push_constant_bytes)];
        let push = if self.reflection.push_constant_bytes > 0 { &push[..] } else { &[] };
        let info =
            vk::PipelineLayoutCreateInfo::default().set_layouts(&sets).push_constant_ranges(push);
        // SAFETY: the set layouts are alive.
        self.layout = unsafe { self.gpu.device.create_pipeline_layout(&info, None) }
            .map_err(|e| self.gpu.failure(&what(), e))?;
        Ok(())
    }

    fn create_pipeline(
        &mut self,
        spirv: &[u32],
        info: &KernelInfo<'_>,
        specialized: &HashMap<u32, u32>,
    ) -> Result<()> {
        let what = format!("compiling kernel `{}`", self.name);
        let module_info = vk::ShaderModuleCreateInfo::default().code(spirv);
        // SAFETY: reflection parsed the module; the driver validates no further, which is why
        // kernels come from our compiler and splicer only.
        let module = unsafe { self.gpu.device.create_shader_module(&module_info, None) }
            .map_err(|e| self.gpu.failure(&what, e))?;
        if has_compute_derivatives(info.spirv) {
            self.gpu.set_name(module, &format!("{} {WITH_DERIVATIVES}", self.name));
        }
        let present: HashSet<u32> = self.reflection.constants.iter().map(|c| c.1).collect();
        let mut values: Vec<_> = specialized
            .iter()
            .filter(|(id, _)| present.contains(id))
            .map(|(i, v)| (*i, *v))
            .collect();
        values.sort_unstable();
        let entries: Vec<_> = values
            .iter()
            .enumerate()
            .map(|(n, (id, _))| vk::SpecializationMapEntry {
                constant_id: *id,
                offset: n as u32 * 4,
                size: 4,
            })
            .collect();
        let data: Vec<u8> = values.iter().flat_map(|(_, v)| v.to_ne_bytes()).collect();
        let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(&data);
        let mut subgroup = vk::PipelineShaderStageRequiredSubgroupSizeCreateInfo::default();
        let mut stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main")
            .specialization_info(&specialization);
        if info.full_subgroups {
            stage = stage.flags(vk::PipelineShaderStageCreateFlags::REQUIRE_FULL_SUBGROUPS);
        }
        if let Some(size) = info.subgroup_size {
            subgroup = subgroup.required_subgroup_size(size);
            stage = stage.push_next(&mut subgroup);
        }
        let create = [vk::ComputePipelineCreateInfo::default().stage(stage).layout(self.layout)];
        // SAFETY: module, layout and all pointers live through the call.
        let created = unsafe {
            let cache = self.gpu.pipeline_cache;
            let created = self.gpu.device.create_compute_pipelines(cache, &create, None);
            self.gpu.device.destroy_shader_module(module, None);
            created
        };
        self.pipeline = created.map_err(|(_, e)| self.gpu.failure(&what, e))?[0];
        Ok(())
    }
}

impl Drop for RawKernel {
    fn drop(&mut self) {
        // SAFETY: recordings that use the kernel hold it until they have ended.
        unsafe {
            self.gpu.device.destroy_pipeline(self.pipeline, None);
            self.gpu.device.destroy_pipeline_layout(self.layout, None);
            self.gpu.device.destroy_descriptor_set_layout(self.set_layout, None);
        }
    }
}
