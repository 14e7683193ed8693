//! Pipelines that are compiled before a pass needs them, if wanted by a thread.

use super::{
    Renderer, attach,
    kernels::{self, Kernels},
    maker::{Fragments, KernelRequest, Maker, STACK_BYTES},
};
use crate::{
    error::{Error, Result},
    format::Format,
    pass::{Pass, Pipeline, check_color_targets, check_outputs, check_samples},
    plan::{PipelineKernels, TargetKinds},
    target::TargetFormats,
    vk::{Kernel, generate_code},
};
use std::{
    panic::{AssertUnwindSafe, catch_unwind},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread::{self, JoinHandle},
};

/// A pipeline that was compiled. Its kernels stay as long as somebody holds this.
#[derive(Clone)]
#[must_use = "kernels that nobody holds go after 64 passes that do not use them"]
pub struct Compiled {
    _kernels: Arc<[Kernel]>,
}

/// A pipeline that a thread compiles, see [`Renderer::compile_in_background`]. If it is dropped, the thread goes on, and the
/// renderer takes over what the thread makes; the pass that needs the pipeline meets the error, if there is one.
#[must_use = "it has the error, if the pipeline cannot be compiled"]
pub struct Compilation(Pending);

impl Compilation {
    /// Whether [`Compilation::wait`] returns at once.
    pub fn is_done(&self) -> bool {
        self.0.outcome().is_some()
    }

    /// Waits for the end.
    ///
    /// # Errors
    /// As [`Renderer::compile`].
    pub fn wait(self) -> Result<Compiled> {
        let mut outcome = self.0.wait();
        let Outcome { made, fault } = outcome.as_mut().expect("it has ended");
        match fault.take() {
            Some(fault) => Err(fault),
            None => {
                Ok(Compiled { _kernels: made.iter().map(|(_, kernel)| kernel.clone()).collect() })
            }
        }
    }
}

impl Renderer {
    /// Compiles `pipeline` for passes with such targets, so that the first of them finds it compiled. There is
    /// no need to: a pass compiles what it needs. For a pass without colour targets or without depth, with a stencil target
    /// or with several samples, the pipeline is another one, as with targets of other formats. Depth and stencil values are taken to keep sample 0
    /// of several ([`crate::DepthTarget::resolve`]). [`Renderer::compile_pass`] takes the formats from a pass,
    /// and finds out whether depths are adjusted in it, by a bias or by a clamp, which takes other kernels.
    ///
    /// Drivers for CPUs generate code when a kernel is dispatched for the first time, which takes longest of all. So on them
    /// the kernels are dispatched over nothing, and waited for; but not on a device of the caller, whose queue somebody else
    /// may be using.
    ///
    /// A kernel is known by the content of its shaders. So all pipelines that are equal share their kernels, whoever made
    /// them. They stay as long as somebody holds what is returned, and as [`Renderer`] says otherwise.
    ///
    /// # Errors
    /// [`Error::Usage`] if the pipeline contradicts itself, or if a format is not one of such a target; [`Error::Shader`] if a
    /// shader is out of reach; [`Error::Device`] if the driver refuses a kernel.
    pub fn compile(&mut self, pipeline: &Pipeline, targets: &TargetFormats) -> Result<Compiled> {
        let adjusted = pipeline.adjusts_depths();
        let kernels = self.kernels.get(wanted((pipeline, adjusted), targets)?)?;
        Ok(Compiled { _kernels: kernels.into() })
    }

    /// As [`Renderer::compile`], by a thread. A pass that needs the pipeline before waits for the thread.
    ///
    /// # Errors
    /// [`Error::Usage`] as [`Renderer::compile`]. [`Compilation::wait`] returns the other ones.
    pub fn compile_in_background(
        &mut self,
        pipeline: &Pipeline,
        targets: &TargetFormats,
    ) -> Result<Compilation> {
        let adjusted = pipeline.adjusts_depths();
        Ok(Compilation(self.kernels.start(wanted((pipeline, adjusted), targets)?)))
    }

    /// As [`Renderer::compile`], all pipelines of `pass` for its targets.
    ///
    /// # Errors
    /// As [`Renderer::compile`].
    pub fn compile_pass(&mut self, pass: &Pass) -> Result<Compiled> {
        let kernels = self.kernels.get(wanted_by(pass)?)?;
        Ok(Compiled { _kernels: kernels.into() })
    }

    /// As [`Renderer::compile_in_background`], all pipelines of `pass` for its targets.
    ///
    /// # Errors
    /// As [`Renderer::compile_in_background`].
    pub fn compile_pass_in_background(&mut self, pass: &Pass) -> Result<Compilation> {
        Ok(Compilation(self.kernels.start(wanted_by(pass)?)))
    }
}

/// The kernels that `pass` needs, each once.
fn wanted_by(pass: &Pass) -> Result<Vec<KernelRequest>> {
    let targets = TargetFormats::of(pass);
    let adjusts = pass.draws.iter().any(|draw| {
        pass.pipelines.get(draw.pipeline).is_some_and(|pipeline| pipeline.adjusts_depth(draw))
    });
    let mut all = Vec::new();
    for (n, pipeline) in pass.pipelines.iter().enumerate() {
        // A batch of several draws is adjusted if one of them is.
        let mut of_pipeline = pass.draws.iter().filter(|draw| draw.pipeline == n);
        let plain = of_pipeline.any(|draw| !pipeline.adjusts_depth(draw));
        for adjusted in [plain.then_some(false), adjusts.then_some(true)].into_iter().flatten() {
            for one in wanted((pipeline, adjusted), &targets)? {
                if !all.contains(&one) {
                    all.push(one);
                }
            }
        }
        // No draw uses it.
        if !plain && !adjusts {
            all.extend(wanted((pipeline, pipeline.adjusts_depths()), &targets)?);
        }
    }
    all.extend(attach::wanted(pass));
    Ok(all)
}

/// The kernels that passes with such targets need for `pipeline`, with adjusted depths or without.
fn wanted(
    (pipeline, adjusted): (&Pipeline, bool),
    targets: &TargetFormats,
) -> Result<Vec<KernelRequest>> {
    let TargetFormats { colors, depth, stencil, samples } = targets;
    pipeline.validate()?;
    check_color_targets(colors.len())
        .and_then(|()| check_samples(pipeline, *samples))
        .and_then(|()| check_outputs(pipeline, colors.iter().copied()))
        .map_err(|fault| Error::Usage(format!("pipeline `{}`: {fault}", pipeline.label)))?;
    if let Some(format) = depth.filter(|format| !format.is_depth()) {
        return Err(Error::Usage(format!("{format:?} is no format of a depth target")));
    }
    let formats = kernels::color_formats(colors.iter().copied())?;
    let kinds = TargetKinds {
        colors: colors.len(),
        depth: depth.is_some(),
        stencil: *stencil,
        samples: *samples,
    };
    let PipelineKernels { vertex, fragment, method } = PipelineKernels::of(pipeline, kinds);
    let kind = Fragments::new(adjusted, *depth, *samples);
    let mut wanted = vec![KernelRequest::Vertex(vertex)];
    wanted.extend(kernels::of_method((method, kind), fragment, formats));
    if !pipeline.vertex.reflection.distances.is_empty() {
        wanted.push(KernelRequest::ClipByDistances);
    }
    let stencil = stencil.then_some(&Format::S8Uint);
    let formats = colors.iter().chain(depth).chain(stencil);
    wanted.extend(formats.filter_map(|format| attach::resolve(*format, *samples)));
    Ok(wanted)
}

/// Kernels that a thread makes. A clone stands for the same ones.
#[derive(Clone)]
pub(super) struct Pending(Arc<State>);

struct State {
    wanted: Vec<KernelRequest>,
    /// `None` until the thread has ended.
    outcome: Mutex<Option<Outcome>>,
    ended: Condvar,
    /// `None` once somebody has waited for it.
    thread: Mutex<Option<JoinHandle<()>>>,
}

pub(super) struct Outcome {
    pub made: Vec<(KernelRequest, Kernel)>,
    fault: Option<Error>,
}

impl Pending {
    /// Starts to make the kernels of `wanted`, those excepted that are `known` or that `earlier` threads make, and has their
    /// code generated with that of the `plain` ones.
    pub fn start(
        maker: &Arc<Maker>,
        wanted: Vec<KernelRequest>,
        known: impl FnMut(&KernelRequest) -> Option<Kernel>,
        (earlier, plain): (Vec<Pending>, Vec<Kernel>),
    ) -> Self {
        let (outcome, ended, thread) = (Mutex::default(), Condvar::new(), Mutex::default());
        let mut found: Vec<_> = wanted.iter().map(known).collect();
        let pending = Self(Arc::new(State { wanted, outcome, ended, thread }));
        let (state, maker) = (pending.clone(), maker.clone());
        let work = move || {
            let wanted = &state.0.wanted;
            // Each waits for those before it alone, so that nobody waits for ever.
            for other in earlier {
                if let Some(outcome) = &*other.wait() {
                    for (found, request) in found.iter_mut().zip(wanted) {
                        let made = outcome.made.iter().find(|(made, _)| made == request);
                        *found = found.take().or(made.map(|(_, kernel)| kernel.clone()));
                    }
                }
            }
            let made = catch_unwind(AssertUnwindSafe(|| {
                let made = maker.make_all(wanted, &found);
                match generate_code(&maker.gpu, plain.iter().chain(made.iter().flatten())) {
                    Ok(()) => made,
                    Err(fault) => vec![Err(fault)],
                }
            }));
            let made = made.unwrap_or_else(|_| {
                vec![Err(Error::Device(format!("{}: a kernel was not made", maker.gpu.info())))]
            });
            let mut outcome = Outcome { made: Vec::new(), fault: None };
            for (request, made) in wanted.iter().zip(made) {
                match made {
                    Ok(kernel) => outcome.made.push((request.clone(), kernel)),
                    Err(fault) => outcome.fault = outcome.fault.or(Some(fault)),
                }
            }
            // Whoever sees the outcome may close the device.
            drop((maker, found, plain));
            *state.outcome() = Some(outcome);
            state.0.ended.notify_all();
        };
        // Where the system refuses a thread, this one does its work.
        let work: Box<dyn FnOnce() + Send> = Box::new(work);
        let job = Arc::new(Mutex::new(Some(work)));
        let run = |job: &Mutex<Option<Box<dyn FnOnce() + Send>>>| {
            let work = job.lock().unwrap_or_else(PoisonError::into_inner).take();
            if let Some(work) = work {
                work();
            }
        };
        let of_thread = job.clone();
        let builder = thread::Builder::new().stack_size(STACK_BYTES);
        match builder.spawn(move || run(&of_thread)) {
            Ok(thread) => {
                *pending.0.thread.lock().unwrap_or_else(PoisonError::into_inner) = Some(thread);
            }
            Err(_) => run(&job),
        }
        pending
    }

    /// Whether some of the kernels are `wanted`.
    pub fn makes(&self, wanted: &[KernelRequest]) -> bool {
        self.0.wanted.iter().any(|made| wanted.contains(made))
    }

    /// What came out, if the thread has ended.
    pub fn outcome(&self) -> MutexGuard<'_, Option<Outcome>> {
        self.0.outcome.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits for the end of the thread. Nothing of it is left then: drivers do not survive that a process ends, or that its
    /// device is closed, while a thread is at work in them.
    pub fn wait(&self) -> MutexGuard<'_, Option<Outcome>> {
        let is_open = |outcome: &mut Option<Outcome>| outcome.is_none();
        let waited = self.0.ended.wait_while(self.outcome(), is_open);
        drop(waited.unwrap_or_else(PoisonError::into_inner));
        let thread = self.0.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        // Another one of these threads may be the one that waits; nobody waits for itself.
        let _ = thread.map(JoinHandle::join);
        self.outcome()
    }
}

impl Drop for Kernels {
    fn drop(&mut self) {
        self.pending.drain(..).for_each(|pending| drop(pending.wait()));
    }
}
