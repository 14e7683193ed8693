//! The engine's kernels on one device, and users' shaders spliced into them, each made once.

use super::vertex;
use crate::{
    abi,
    error::Result,
    format::Format,
    kernels,
    plan::KernelKey,
    shader::splice::{Blocks, Derivatives, SpliceOptions, splice},
    state::Compare,
    vk::{DeviceKind, Gpu, Kernel, KernelInfo},
};

/// What a spliced kernel is made for, beside its shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Variant {
    Vertex,
    Shade(u32),
    Ordered { format: u32, depth: u32 },
}

/// All kernels of a renderer.
pub struct Kernels {
    gpu: Gpu,
    /// The subgroup width that kernels are made for.
    width: u32,
    pub clear: Kernel,
    pub primitive: Kernel,
    pub scan: Kernel,
    pub scatter: Kernel,
    pub sort: Kernel,
    raster: Vec<(Compare, Kernel)>,
    spliced: Vec<(Variant, KernelKey, Kernel)>,
}

/// The `abi` number of a colour format.
pub fn color_format(format: Format) -> u32 {
    match format {
        Format::Rgba8Srgb => abi::FORMAT_RGBA8_SRGB,
        Format::Rgba16Float => abi::FORMAT_RGBA16_FLOAT,
        _ => abi::FORMAT_RGBA8_UNORM,
    }
}

impl Kernels {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let width = gpu.limits().subgroup_size;
        let plain =
            |name, spirv| Kernel::new(gpu, &KernelInfo { name, spirv, ..KernelInfo::default() });
        let wide = |name, spirv| wide(gpu, name, spirv, width, &[]);
        Ok(Self {
            width,
            clear: plain("clear", kernels::CLEAR)?,
            primitive: plain("primitive", kernels::PRIMITIVE)?,
            scan: wide("binning_scan", kernels::BINNING_SCAN)?,
            scatter: plain("binning_scatter", kernels::BINNING_SCATTER)?,
            sort: wide("binning_sort", kernels::BINNING_SORT)?,
            raster: Vec::new(),
            spliced: Vec::new(),
            gpu: gpu.clone(),
        })
    }

    pub fn raster(&mut self, compare: Compare) -> Result<Kernel> {
        let known = self.raster.iter().find(|(known, _)| *known == compare);
        if let Some((_, kernel)) = known {
            return Ok(kernel.clone());
        }
        // To a CPU, shared memory is nothing special, and the driver does not read it by address.
        let in_place = self.gpu.reads_by_address().into();
        let constants = [("COMPARE", compare as u32), ("IN_PLACE", in_place)];
        let kernel = wide(&self.gpu, "raster", kernels::RASTER, self.width, &constants)?;
        self.raster.push((compare, kernel.clone()));
        Ok(kernel)
    }

    pub fn vertex(&mut self, key: &KernelKey) -> Result<Kernel> {
        self.spliced(Variant::Vertex, key)
    }

    pub fn shade(&mut self, key: &KernelKey, format: u32) -> Result<Kernel> {
        self.spliced(Variant::Shade(format), key)
    }

    pub fn ordered(&mut self, key: &KernelKey, format: u32, depth: u32) -> Result<Kernel> {
        self.spliced(Variant::Ordered { format, depth }, key)
    }

    fn spliced(&mut self, variant: Variant, key: &KernelKey) -> Result<Kernel> {
        let known = self.spliced.iter().find(|(v, k, _)| *v == variant && k == key);
        if let Some((.., kernel)) = known {
            return Ok(kernel.clone());
        }
        let (stage, words) = match variant {
            Variant::Vertex => ("vertex", kernels::VERTEX),
            Variant::Shade(_) => ("shade", kernels::SHADE),
            Variant::Ordered { .. } => ("ordered", kernels::ORDERED),
        };
        let native = self.gpu.has_compute_derivatives();
        let options = SpliceOptions {
            derivatives: if native { Derivatives::Native } else { Derivatives::Quad },
            blocks: if self.gpu.info().kind == DeviceKind::Cpu {
                Blocks::Prefetched
            } else {
                Blocks::InPlace
            },
            specialization: &key.specialization,
        };
        let spliced = splice(words, &key.shader, &options)?;
        let name = format!("{stage} {}", key.shader.label);
        let width = self.width;
        let constants: &[(&str, u32)] = match variant {
            Variant::Vertex => &[("LANES", vertex::lanes(width))],
            Variant::Shade(format) => &[("WIDTH", width), ("FORMAT", format)],
            Variant::Ordered { format, depth } => {
                &[("WIDTH", width), ("FORMAT", format), ("DEPTH", depth)]
            }
        };
        let attributes = key.attributes.iter();
        let attributes = attributes.map(|&(location, f)| (abi::SPEC_ATTRIBUTE + location, f));
        let constant_ids: Vec<_> = key.specialization.iter().copied().chain(attributes).collect();
        let info = KernelInfo {
            name: &name,
            spirv: &spliced.spirv,
            constants,
            constant_ids: &constant_ids,
            full_subgroups: true,
            subgroup_size: Some(width),
        };
        let kernel = Kernel::new(&self.gpu, &info)?;
        self.spliced.push((variant, key.clone(), kernel.clone()));
        Ok(kernel)
    }
}

/// A kernel whose workgroup is one subgroup.
fn wide(gpu: &Gpu, name: &str, spirv: &[u32], width: u32, more: &[(&str, u32)]) -> Result<Kernel> {
    let constants: Vec<_> = [("WIDTH", width)].into_iter().chain(more.iter().copied()).collect();
    Kernel::new(
        gpu,
        &KernelInfo {
            name,
            spirv,
            constants: &constants,
            full_subgroups: true,
            subgroup_size: Some(width),
            ..KernelInfo::default()
        },
    )
}
