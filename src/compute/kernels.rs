//! The kernels of a renderer, also with users' shaders spliced in. Each is made once.

use super::{
    compile::Pending,
    maker::{Fragments, KernelRequest, Maker, in_parallel},
};
use crate::{
    error::{Error, Result},
    format::Format,
    kept::Kept,
    plan::{BatchPlan, KernelKey, Method, Plan, Stencil},
    samples::Samples,
    target::check_color_format,
    vk::{Kernel, generate_code},
};
use std::{collections::HashSet, sync::Arc};

/// All kernels of a renderer.
pub struct Kernels {
    pub(super) maker: Arc<Maker>,
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
    /// Clipping and setup of primitives, if some have distances.
    pub by_distances: Option<Kernel>,
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
        self.by_distances = None;
        self.last_opaque = None;
    }
}

/// The formats of colour targets as kernels have them: a byte each, the first one lowest, [`abi::NO_FORMAT`] where there is
/// no target.
pub type ColorFormats = u64;

/// The formats of `colors`.
///
/// # Errors
/// [`Error::Usage`] for a format that holds no colours.
pub fn color_formats(colors: impl DoubleEndedIterator<Item = Format>) -> Result<ColorFormats> {
    colors.rev().try_fold(ColorFormats::MAX, |formats, format| {
        check_color_format(format).map_err(Error::Usage)?;
        Ok(formats << 8 | format as ColorFormats)
    })
}

impl Kernels {
    pub fn new(maker: Maker) -> Result<Self> {
        let [clear, commands, primitive, scan, scatter, sort] = maker.plain()?;
        Ok(Self {
            maker: Arc::new(maker),
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
            generate_code(&self.maker.gpu, plain.iter().chain(&all))?;
        }
        Ok(all)
    }

    /// The kernel of `wanted`, made if it does not exist yet.
    ///
    /// # Errors
    /// As [`Kernels::make`].
    pub fn one(&mut self, wanted: &KernelRequest) -> Result<Kernel> {
        self.make([wanted.clone()])?;
        Ok(self.made.get(wanted).expect("it was made").clone())
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
        let pending = Pending::start(&self.maker, wanted, known, (earlier, plain));
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

    /// Puts the kernels of `plan` for these formats of targets into `found`. Missing ones are made.
    ///
    /// # Errors
    /// As [`Kernels::make`].
    pub fn of_plan(
        &mut self,
        plan: &Plan,
        (formats, depth, samples): (ColorFormats, Option<Format>, Samples),
        found: &mut PlanKernels,
    ) -> Result<()> {
        let vertex = || plan.vertex_kernels.iter().map(|key| KernelRequest::Vertex(key.clone()));
        let of_batch = |batch: &BatchPlan, kernel: usize| {
            of_method(
                (batch.method, Fragments::new(batch.adjusted, depth, samples)),
                plan.fragment_kernels[kernel].clone(),
                formats,
            )
        };
        let of_batches = plan.batches.iter().flat_map(|batch| {
            batch.fragment_kernels.iter().flat_map(move |&kernel| of_batch(batch, kernel))
        });
        let distances = plan.batches.iter().any(|batch| batch.distances);
        let by_distances = distances.then_some(KernelRequest::ClipByDistances);
        self.make(vertex().chain(of_batches).chain(by_distances.clone()))?;
        found.clear();
        let mut get = |wanted: KernelRequest| self.made.get(&wanted).expect("it was made").clone();
        found.vertex.extend(vertex().map(&mut get));
        found.by_distances = by_distances.map(&mut get);
        for (number, batch) in plan.batches.iter().enumerate() {
            found.fragment_first.push(found.fragment.len());
            let mut raster = None;
            for &kernel in &batch.fragment_kernels {
                for wanted in of_batch(batch, kernel) {
                    match wanted {
                        KernelRequest::Raster(..) => raster = Some(get(wanted)),
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
        let made = in_parallel(&missing, |wanted| self.maker.make(wanted));
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

/// The kernels that draw the fragments of a batch into colour targets.
pub fn of_method(
    (method, kind): (Method, Fragments),
    fragment: Arc<KernelKey>,
    formats: ColorFormats,
) -> impl Iterator<Item = KernelRequest> {
    let (raster, fragment) = match method {
        Method::Opaque { compare, shades, stencil } => (
            Some(KernelRequest::Raster(compare, stencil != Stencil::Off, kind)),
            shades.then_some(KernelRequest::Shade(fragment, formats, kind)),
        ),
        Method::Ordered { depth, stencil, .. } => {
            (None, Some(KernelRequest::Ordered(fragment, formats, kind, (depth, stencil))))
        }
    };
    raster.into_iter().chain(fragment)
}
