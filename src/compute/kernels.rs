//! The engine's kernels on one device, and users' shaders spliced into them, each made once.

use super::vertex;
use crate::{
    abi,
    error::{Error, Result},
    format::Format,
    plan::KernelKey,
    prebuilt,
    shader::splice::{Blocks, Derivatives, SpliceOptions, splice},
    state::Compare,
    vk::{DeviceKind, Gpu, Kernel, KernelInfo},
};
use std::sync::atomic::{AtomicUsize, Ordering};

/// A kernel that is made when a pass wants it.
#[derive(Clone, Debug, PartialEq)]
pub enum Wanted {
    /// Raster with a depth comparison.
    Raster(Compare),
    /// Vertex shading.
    Vertex(KernelKey),
    /// Shading of opaque work into a colour format.
    Shade(KernelKey, u32),
    /// Ordered work into a colour format, with a depth mode.
    Ordered(KernelKey, u32, u32),
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
    made: Vec<(Wanted, Kernel)>,
}

/// The number that a colour format has in kernels.
///
/// # Errors
/// [`Error::Usage`] for a format that holds no colours.
pub fn color_format(format: Format) -> Result<u32> {
    match format {
        Format::Rgba8Unorm | Format::Rgba8Srgb | Format::Rgba16Float => Ok(format as u32),
        Format::D32Float => Err(Error::Usage("D32Float is no format of a colour target".into())),
    }
}

impl Kernels {
    pub fn new(gpu: &Gpu) -> Result<Self> {
        let width = gpu.limits().subgroup_size;
        let plain = |name, spirv| KernelInfo { name, spirv, ..KernelInfo::default() };
        let constants = [("WIDTH", width)];
        let wide = |name, spirv| wide(width, name, spirv, &constants);
        let infos = [
            plain("clear", prebuilt::CLEAR),
            plain("primitive", prebuilt::PRIMITIVE),
            wide("binning_scan", prebuilt::BINNING_SCAN),
            plain("binning_scatter", prebuilt::BINNING_SCATTER),
            wide("binning_sort", prebuilt::BINNING_SORT),
        ];
        let made = in_parallel(&infos, |info| Kernel::trusted(gpu, info));
        let made = made.into_iter().collect::<Result<Vec<_>>>()?;
        let [clear, primitive, scan, scatter, sort] =
            made.try_into().expect("as many kernels as infos");
        Ok(Self {
            gpu: gpu.clone(),
            width,
            clear,
            primitive,
            scan,
            scatter,
            sort,
            made: Vec::new(),
        })
    }

    /// Makes those of `wanted` that are not there yet, as many at a time as the machine has cores:
    /// drivers take tens of milliseconds for each.
    ///
    /// # Errors
    /// [`crate::Error::Shader`] if a shader is out of reach, [`crate::Error::Device`] if the driver
    /// refuses a kernel.
    pub fn make(&mut self, wanted: &[Wanted]) -> Result<()> {
        let mut missing: Vec<&Wanted> = Vec::new();
        for one in wanted {
            if !missing.contains(&one) && !self.made.iter().any(|(known, _)| known == one) {
                missing.push(one);
            }
        }
        let made = in_parallel(&missing, |wanted| self.kernel(wanted));
        let mut outcome = Ok(());
        let missing: Vec<Wanted> = missing.into_iter().cloned().collect();
        for (wanted, made) in missing.into_iter().zip(made) {
            match made {
                Ok(kernel) => self.made.push((wanted, kernel)),
                Err(error) => outcome = outcome.and(Err(error)),
            }
        }
        outcome
    }

    /// A kernel, made if it is not there yet.
    ///
    /// # Errors
    /// As [`Kernels::make`].
    pub fn get(&mut self, wanted: &Wanted) -> Result<Kernel> {
        self.make(std::slice::from_ref(wanted))?;
        let found = self.made.iter().find(|(known, _)| known == wanted);
        Ok(found.expect("it was made").1.clone())
    }

    fn kernel(&self, wanted: &Wanted) -> Result<Kernel> {
        let width = self.width;
        let (stage, words, key, constants) = match wanted {
            Wanted::Raster(compare) => {
                // To a CPU, shared memory is nothing special, and the driver does not read it by
                // address.
                let in_place = self.gpu.reads_by_address().into();
                let constants =
                    [("WIDTH", width), ("COMPARE", *compare as u32), ("IN_PLACE", in_place)];
                let info = wide(width, "raster", prebuilt::RASTER, &constants);
                return Kernel::trusted(&self.gpu, &info);
            }
            Wanted::Vertex(key) => {
                ("vertex", prebuilt::VERTEX, key, vec![("LANES", vertex::lanes(width))])
            }
            Wanted::Shade(key, format) => {
                ("shade", prebuilt::SHADE, key, vec![("WIDTH", width), ("FORMAT", *format)])
            }
            Wanted::Ordered(key, format, depth) => {
                let constants = vec![("WIDTH", width), ("FORMAT", *format), ("DEPTH", *depth)];
                ("ordered", prebuilt::ORDERED, key, constants)
            }
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
        let attributes = key.attributes.iter();
        let attributes = attributes.map(|&(location, f)| (abi::SPEC_ATTRIBUTE + location, f));
        let read = (abi::SPEC_READ, key.read);
        let own = key.specialization.iter().copied();
        let constant_ids: Vec<_> = own.chain(attributes).chain([read]).collect();
        let name = format!("{stage} {}", key.shader.label);
        let info = wide(width, &name, &spliced.spirv, &constants);
        Kernel::trusted(&self.gpu, &KernelInfo { constant_ids: &constant_ids, ..info })
    }
}

/// A kernel that is made for full subgroups of one width.
fn wide<'a>(
    width: u32,
    name: &'a str,
    spirv: &'a [u32],
    constants: &'a [(&'a str, u32)],
) -> KernelInfo<'a> {
    let subgroup_size = Some(width);
    KernelInfo {
        name,
        spirv,
        constants,
        full_subgroups: true,
        subgroup_size,
        ..KernelInfo::default()
    }
}

/// Stack of a thread that makes kernels: drivers and the splicer expect that of a main thread.
const STACK_BYTES: usize = 8 << 20;

/// `make` of each of `inputs`, on as many threads as the machine has cores.
fn in_parallel<I: Sync, O: Send>(
    inputs: &[I],
    make: impl Fn(&I) -> Result<O> + Sync,
) -> Vec<Result<O>> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(inputs.len());
    let next = AtomicUsize::new(0);
    let work = || {
        let taken = std::iter::from_fn(|| Some(next.fetch_add(1, Ordering::Relaxed)));
        let taken = taken.map_while(|n| Some((n, inputs.get(n)?)));
        taken.map(|(n, input)| (n, make(input))).collect::<Vec<_>>()
    };
    let mut made: Vec<(usize, Result<O>)> = std::thread::scope(|scope| {
        // Where the system refuses a thread, the others do its work.
        let thread = || std::thread::Builder::new().stack_size(STACK_BYTES);
        let spawned: Vec<_> =
            (1..threads).filter_map(|_| thread().spawn_scoped(scope, work).ok()).collect();
        let mut all = work();
        for thread in spawned {
            all.extend(thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        all
    });
    made.sort_by_key(|(n, _)| *n);
    made.into_iter().map(|(_, one)| one).collect()
}
