//! Makes the engine's kernels on one device, also with users' shaders spliced in. Each is made once.

use super::{compile::Pending, vertex};
use crate::{
    abi,
    error::{Error, Result},
    format::Format,
    kept::Kept,
    plan::{BatchPlan, KernelKey, Method, Plan},
    prebuilt,
    shader::splice::{Blocks, Derivatives, SpliceOptions, splice},
    state::Compare,
    vk::{DeviceKind, Gpu, Kernel, KernelInfo, generate_code},
};
use std::{
    collections::HashSet,
    sync::Arc,
    sync::atomic::{AtomicUsize, Ordering},
};

/// A kernel that is made when the first pass needs it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum KernelRequest {
    /// Raster with a depth comparison.
    Raster(Compare),
    /// Vertex shading.
    Vertex(Arc<KernelKey>),
    /// Shading of opaque work into a colour format.
    Shade(Arc<KernelKey>, u32),
    /// Ordered work into a colour format, with a depth mode.
    Ordered(Arc<KernelKey>, u32, u32),
}

/// All kernels of a renderer.
pub struct Kernels {
    gpu: Gpu,
    /// The subgroup width that kernels are made for.
    width: u32,
    pub clear: Kernel,
    pub commands: Kernel,
    pub primitive: Kernel,
    pub scan: Kernel,
    pub scatter: Kernel,
    pub sort: Kernel,
    made: Kept<KernelRequest, Kernel>,
    /// Kernels that threads make.
    pub(super) pending: Vec<Pending>,
    /// Whether the driver has generated the code of the kernels without users' shaders.
    warm: bool,
}

/// The kernels a plan needs, by the plan's own numbers.
#[derive(Default)]
pub struct PlanKernels {
    pub vertex: Vec<Kernel>,
    /// The fragment kernels of all batches, batch after batch.
    fragment: Vec<Kernel>,
    /// Where those of each batch begin.
    fragment_first: Vec<usize>,
    /// For each batch of opaque work its raster kernel.
    pub raster: Vec<Option<Kernel>>,
    /// The last batch of opaque work.
    pub last_opaque: Option<usize>,
}

impl PlanKernels {
    /// The kernel of each of the fragment kernels of batch number `batch`.
    pub fn fragment(&self, batch: usize) -> &[Kernel] {
        let end = self.fragment_first.get(batch + 1).copied();
        &self.fragment[self.fragment_first[batch]..end.unwrap_or(self.fragment.len())]
    }

    fn clear(&mut self) {
        self.vertex.clear();
        self.fragment.clear();
        self.fragment_first.clear();
        self.raster.clear();
        self.last_opaque = None;
    }
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
        let constants = [("SUBGROUP_WIDTH", width)];
        let wide = |name, spirv| wide(width, name, spirv, &constants);
        let infos = [
            plain("clear", prebuilt::CLEAR),
            wide("commands", prebuilt::COMMANDS),
            plain("primitive", prebuilt::PRIMITIVE),
            wide("binning_scan", prebuilt::BINNING_SCAN),
            plain("binning_scatter", prebuilt::BINNING_SCATTER),
            wide("binning_sort", prebuilt::BINNING_SORT),
        ];
        let made = in_parallel(&infos, |info| Kernel::trusted(gpu, info));
        let made = made.into_iter().collect::<Result<Vec<_>>>()?;
        let [clear, commands, primitive, scan, scatter, sort] =
            made.try_into().expect("as many kernels as infos");
        Ok(Self {
            gpu: gpu.clone(),
            width,
            clear,
            commands,
            primitive,
            scan,
            scatter,
            sort,
            made: Kept::default(),
            pending: Vec::new(),
            warm: false,
        })
    }

    /// Begins another pass: lets go of kernels by the rule of [`crate::kept`].
    pub fn next_pass(&mut self) {
        self.made.next_pass(Kernel::is_shared);
    }

    /// The kernels of `wanted`, made if they do not exist yet.
    ///
    /// # Errors
    /// As [`Kernels::make`].
    pub fn get(&mut self, wanted: Vec<KernelRequest>) -> Result<Vec<Kernel>> {
        let before = self.made.made();
        self.make(wanted.iter().cloned())?;
        let all = wanted.iter().map(|wanted| self.made.get(wanted).expect("it was made").clone());
        let all: Vec<Kernel> = all.collect();
        if self.made.made() > before {
            let plain = self.cold();
            generate_code(&self.gpu, plain.iter().chain(&all))?;
        }
        Ok(all)
    }

    /// The kernels without users' shaders, if nobody has had their code generated yet.
    fn cold(&mut self) -> Vec<Kernel> {
        match std::mem::replace(&mut self.warm, true) {
            true => Vec::new(),
            false => {
                let Self { clear, commands, primitive, scan, scatter, sort, .. } = &*self;
                [clear, commands, primitive, scan, scatter, sort].map(Kernel::clone).to_vec()
            }
        }
    }

    /// As [`Kernels::get`], by a thread.
    pub fn start(&mut self, wanted: Vec<KernelRequest>) -> Pending {
        self.take_finished();
        let earlier = self.pending.iter().filter(|one| one.makes(&wanted)).cloned().collect();
        let plain = self.cold();
        let known = |request: &KernelRequest| self.made.get(request).cloned();
        let pending = Pending::start((&self.gpu, self.width), wanted, known, (earlier, plain));
        self.pending.push(pending.clone());
        pending
    }

    /// Keeps what threads have made.
    fn take_finished(&mut self) {
        let Self { pending, made, .. } = self;
        pending.retain(|pending| {
            if pending.outcome().is_none() {
                return true;
            }
            let outcome = pending.wait();
            let Some(outcome) = &*outcome else { return true };
            for (request, kernel) in &outcome.made {
                if made.get(request).is_none() {
                    made.insert(request.clone(), kernel.clone());
                }
            }
            false
        });
    }

    /// Kernels of users' shaders that are kept, and those that were ever made.
    pub fn counts(&self) -> (usize, u64) {
        (self.made.len(), self.made.made())
    }

    /// Puts the kernels of `plan` for a colour format into `found`. Missing ones are made.
    ///
    /// # Errors
    /// As [`Kernels::make`].
    pub fn of_plan(&mut self, plan: &Plan, format: u32, found: &mut PlanKernels) -> Result<()> {
        let vertex = || plan.vertex_kernels.iter().map(|key| KernelRequest::Vertex(key.clone()));
        let of_batch = |batch: &BatchPlan, kernel: usize| {
            of_method(batch.method, plan.fragment_kernels[kernel].clone(), format)
        };
        let of_batches = plan.batches.iter().flat_map(|batch| {
            batch.fragment_kernels.iter().flat_map(move |&kernel| of_batch(batch, kernel))
        });
        self.make(vertex().chain(of_batches))?;
        found.clear();
        let mut get = |wanted: KernelRequest| self.made.get(&wanted).expect("it was made").clone();
        found.vertex.extend(vertex().map(&mut get));
        for (number, batch) in plan.batches.iter().enumerate() {
            found.fragment_first.push(found.fragment.len());
            let mut raster = None;
            for &kernel in &batch.fragment_kernels {
                for wanted in of_batch(batch, kernel) {
                    match wanted {
                        KernelRequest::Raster(_) => raster = Some(get(wanted)),
                        _ => found.fragment.push(get(wanted)),
                    }
                }
            }
            found.last_opaque = raster.as_ref().map(|_| number).or(found.last_opaque);
            found.raster.push(raster);
        }
        Ok(())
    }

    /// Makes the kernels of `wanted` that do not exist yet, as many at a time as the machine has cores:
    /// drivers take tens of milliseconds for each.
    ///
    /// # Errors
    /// [`crate::Error::Shader`] if a shader is out of reach, [`crate::Error::Device`] if the driver
    /// refuses a kernel.
    pub fn make(&mut self, wanted: impl IntoIterator<Item = KernelRequest>) -> Result<()> {
        self.take_finished();
        let mut seen = HashSet::new();
        let missing = wanted.into_iter().filter(|wanted| self.made.get(wanted).is_none());
        let mut missing: Vec<KernelRequest> =
            missing.filter(|wanted| seen.insert(wanted.clone())).collect();
        if missing.is_empty() {
            return Ok(());
        }
        // What threads make is waited for.
        self.pending.iter().filter(|one| one.makes(&missing)).for_each(|one| drop(one.wait()));
        self.take_finished();
        missing.retain(|wanted| self.made.get(wanted).is_none());
        let made = in_parallel(&missing, |wanted| make(&self.gpu, self.width, wanted));
        let mut outcome = Ok(());
        for (wanted, made) in missing.into_iter().zip(made) {
            match made {
                Ok(kernel) => self.made.insert(wanted, kernel),
                Err(error) => outcome = outcome.and(Err(error)),
            }
        }
        outcome
    }
}

/// The kernels that draw the fragments of a batch into a colour format.
pub fn of_method(
    method: Method,
    fragment: Arc<KernelKey>,
    format: u32,
) -> impl Iterator<Item = KernelRequest> {
    let (raster, fragment) = match method {
        Method::Opaque(compare) => {
            (Some(KernelRequest::Raster(compare)), KernelRequest::Shade(fragment, format))
        }
        Method::Ordered { depth, .. } => (None, KernelRequest::Ordered(fragment, format, depth)),
    };
    raster.into_iter().chain([fragment])
}

/// The kernels of `wanted`, those that were `found` before included.
pub fn make_all(
    gpu: &Gpu,
    width: u32,
    wanted: &[KernelRequest],
    found: &[Option<Kernel>],
) -> Vec<Result<Kernel>> {
    let all: Vec<_> = wanted.iter().zip(found).collect();
    in_parallel(&all, |(wanted, found)| match found {
        Some(found) => Ok((*found).clone()),
        None => make(gpu, width, wanted),
    })
}

/// Makes one kernel.
fn make(gpu: &Gpu, width: u32, wanted: &KernelRequest) -> Result<Kernel> {
    let (stage, words, key, constants) = match wanted {
        KernelRequest::Raster(compare) => {
            // Shared memory has no advantage on a CPU, and the driver does not access it by
            // address.
            let in_place = gpu.reads_by_address().into();
            let constants =
                [("SUBGROUP_WIDTH", width), ("COMPARE", *compare as u32), ("IN_PLACE", in_place)];
            let info = wide(width, "raster", prebuilt::RASTER, &constants);
            return Kernel::trusted(gpu, &info);
        }
        KernelRequest::Vertex(key) => {
            ("vertex", prebuilt::VERTEX, key, vec![("LANES", vertex::lanes(width))])
        }
        KernelRequest::Shade(key, format) => {
            ("shade", prebuilt::SHADE, key, vec![("SUBGROUP_WIDTH", width), ("FORMAT", *format)])
        }
        KernelRequest::Ordered(key, format, depth) => {
            let constants = vec![("SUBGROUP_WIDTH", width), ("FORMAT", *format), ("DEPTH", *depth)];
            ("ordered", prebuilt::ORDERED, key, constants)
        }
    };
    let native = gpu.has_compute_derivatives();
    let options = SpliceOptions {
        derivatives: if native { Derivatives::Native } else { Derivatives::Quad },
        blocks: if gpu.info().kind == DeviceKind::Cpu {
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
    Kernel::trusted(gpu, &KernelInfo { constant_ids: &constant_ids, ..info })
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
pub const STACK_BYTES: usize = 8 << 20;

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
