//! Executes a pass by compute kernels: the product.
//!
//! The stages of a batch, in order. Each is a file here, one or more kernels in `glsl/` and, if its result does
//! not depend on user code, a twin in `reference/`:
//!
//! ```text
//! clear      the targets' clear values, once per band; loads are copies (`attach`)
//! commands   pieces of draw commands that only the device knows, where there are any
//! vertex     the user's vertex shader, once per vertex slot
//! primitive  assembly, clipping, culling, fixed-point setup; counts what each cell will list
//! binning    scan of the counts, scatter of the keys, sort where order matters
//! raster     which triangle each pixel shows (opaque work)      | ordered  raster, shading and
//! shade      the user's fragment shader at visible pixels       |          blending in API order
//! resolve    texels of samples, once per band, where pixels have several samples
//! ```
//!
//! A draw is *opaque* if the order of triangles does not decide its picture: the depth test is on, with a depth target, writes,
//! and compares by `Less`, `LessOrEqual`, `Greater` or `GreaterOrEqual`; nothing blends; all channels of all colour targets are
//! written, or none; the fragment shader neither discards, nor writes depth, a stencil value or memory; neither it nor the pipeline
//! chooses among the samples of a pixel; and the stencil test only compares, or writes values that do not depend on each other
//! ([`crate::StencilState`]). All other draws are *ordered*, also those without any depth test.
//!
//! [`Renderer::begin`] begins a frame: an [`Encoder`] records passes that draw to images of the device, in one submission
//! that nobody waits for. [`Renderer::prepare`] records a pass once, one submission for each band;
//! [`Prepared::execute`] runs it and waits, and [`Prepared::read`] returns the pictures. In neither, the CPU decides
//! anything while the device is at work. `Renderer::trace` stops after every batch and copies all intermediates to the
//! host.

mod attach;
mod binning;
mod clear;
mod commands;
mod compile;
mod encoder;
mod frame;
mod kernels;
mod maker;
mod narrow;
mod ordered;
mod prepared;
mod primitive;
mod raster;
mod resolve;
mod scratch;
mod shade;
mod slots;
mod sources;
mod target;
mod trace;
mod vertex;

pub use compile::{Compilation, Compiled};
pub use encoder::{Encoder, Recorded};
pub use prepared::Prepared;

/// The engine's GLSL: names of files and their texts, for [`Renderer::with_glsl`]. Names that end in `.comp` are kernels, the
/// stages of [`crate::compute`]; the others are included by these. Each file begins with a comment that says what it is.
pub const GLSL: &[(&str, &str)] = crate::prebuilt::FILES;

use crate::{
    error::{Error, Result},
    format::Format,
    grid::Capacities,
    pass::{Executor, Frame, Known, Pass},
    plan::{KernelKey, Plan, Planner, depth_mode},
    shader::{Shader, Stage},
    state::PrimitiveKind,
    trace::Trace,
    vk::{Arena, Cached, CallerCommands, Copies, Gpu, Recorder, Resources},
};
use frame::{Setup, Workspace};
use kernels::{Kernels, PlanKernels};
use maker::{Fragments, KernelRequest, Maker};
use prepared::Results;
use scratch::Scratch;
use slots::{TablePool, TableSlots, Tables};
use sources::Sources;
use std::sync::{Arc, Mutex};

/// Executes passes by compute kernels on one device.
///
/// Kernels are known by the content of their shaders and stay while a prepared pass holds them, and
/// otherwise until 64 passes in a row have not used them. Uploads stay as long as somebody holds the buffer
/// or texture.
pub struct Renderer {
    gpu: Gpu,
    resources: Resources,
    tables: TablePool,
    known: Known,
    planner: Planner,
    kernels: Kernels,
    limit: Capacities,
    timed: bool,
    /// What the passes of frames have while they run.
    scratch: Scratch,
    plan_kernels: PlanKernels,
    /// Frames in the order of their submissions.
    frames: Vec<encoder::Slot>,
    frames_in_flight: usize,
    /// The memory of frames in command buffers of the caller, once the caller is done with them.
    returned: Arc<Mutex<Vec<encoder::Slot>>>,
}

impl Renderer {
    /// A renderer on `gpu` with the default batch size.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the driver refuses a kernel.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Self::with_sources(gpu, Sources::default())
    }

    /// A renderer with stages of the caller's own: each of `files`, a name and a text, takes the place of the file of the
    /// engine's GLSL that has this name ([`GLSL`]), or is a further file that these include. Kernels whose text changes are
    /// compiled here. All passes of the renderer are drawn with them; other renderers on the same device are not concerned,
    /// and their frames may come between those of this one.
    ///
    /// The comment at the top of each kernel says what the kernel reads and writes and what others rely on; the other stages
    /// stay as they are. `raster.comp` tests the pixels of opaque draws and `ordered.comp` those of all others ([`crate::compute`]
    /// says which is which); both take the rules from small files:
    ///
    /// | file | rule |
    /// |---|---|
    /// | `lib/coverage.glsl` | which pixels a triangle covers |
    /// | `lib/depth.glsl` | the depth of a triangle at a pixel, and what a depth target of floats keeps of it |
    /// | `lib/stencil.glsl` | the stencil test |
    /// | `lib/interpolate.glsl` | the value of a varying at a pixel |
    /// | `lib/blend.glsl` | the blend equations |
    /// | `lib/color.glsl` | the texels of colour targets |
    ///
    /// `abi.glsl`, the structs that the host writes and reads, cannot be replaced. A stage that breaks its contract draws a
    /// wrong picture. It may not end, or ask for more work than the device allows, so that the device is lost. All kernels
    /// of such a renderer check bounds and are slower than those of [`Renderer::new`]. The compiler sees the texts as they are:
    /// one that makes the compiler crash ends the process.
    ///
    /// ```no_run
    /// # fn main() -> tilewright::Result<()> {
    /// use tilewright::{Gpu, GpuOptions, Renderer, compute};
    ///
    /// // A screen door: opaque draws and blended ones cover every second pixel.
    /// let gpu = Gpu::open(&GpuOptions::default())?;
    /// let file = "lib/coverage.glsl";
    /// let (_, engine) = compute::GLSL.iter().find(|(name, _)| *name == file).unwrap();
    /// let door = engine
    ///     .replace("COVERS_WHOLE_BINS = true", "COVERS_WHOLE_BINS = false")
    ///     .replace(">= 0;", ">= 0 && ((pixel.x ^ pixel.y) & 1) == 0;");
    /// assert_ne!(door, *engine);
    /// let renderer = Renderer::with_glsl(&gpu, &[(file, &door)])?;
    /// # Ok(())
    /// # }
    /// ```
    ///
    /// # Errors
    /// [`Error::Shader`] with the compiler's messages, which name the file and the line; or because a kernel lacks what shaders
    /// are spliced into; or because the crate was built without a GLSL compiler (features `glsl` and `glsl-bundled`).
    /// [`Error::Usage`] if no kernel includes one of the files. [`Error::Device`] if the driver refuses a kernel. Kernels that
    /// depend on a pass are made when one needs them, and then [`Error::Usage`] says what such a kernel lacks: a constant, a
    /// buffer, a workgroup that the device allows.
    pub fn with_glsl(gpu: &Gpu, files: &[(&str, &str)]) -> Result<Self> {
        Self::with_sources(gpu, Sources::new(files)?)
    }

    fn with_sources(gpu: &Gpu, sources: Sources) -> Result<Self> {
        Ok(Self {
            gpu: gpu.clone(),
            resources: Resources::new(gpu),
            tables: TablePool::new(gpu),
            known: Known::default(),
            planner: Planner::default(),
            kernels: Kernels::new(Maker::new(gpu, sources))?,
            limit: Capacities::DEFAULT,
            timed: false,
            scratch: Scratch::default(),
            plan_kernels: PlanKernels::default(),
            frames: Vec::new(),
            frames_in_flight: encoder::FRAMES_IN_FLIGHT,
            returned: Arc::default(),
        })
    }

    /// Its device.
    pub fn gpu(&self) -> &Gpu {
        &self.gpu
    }

    #[doc(hidden)]
    /// Limits the contents of one batch. The picture does not depend on it. A value below
    /// [`Capacities::LEAST`] or above [`Capacities::MOST`] is replaced by that one.
    pub fn set_batch_limit(&mut self, limit: Capacities) {
        self.limit = limit.clamped();
    }

    /// Times every stage of the passes prepared from now on; costs a little.
    pub fn time_stages(&mut self, timed: bool) {
        self.timed = timed;
    }

    /// Counts of the objects that are kept for later passes.
    pub fn cached(&self) -> Cached {
        let (pipelines, pipelines_made) = self.kernels.counts();
        let tables = self.tables.len();
        Cached { pipelines, pipelines_made, tables, ..self.resources.cached() }
    }

    /// Draws one pass, waits, and returns its targets that are stored. [`Renderer::begin`] is the way to draw frame after
    /// frame without waiting.
    ///
    /// # Errors
    /// As [`Renderer::prepare`] and [`Prepared::execute`].
    pub fn render(&mut self, pass: &Pass) -> Result<Frame> {
        let mut prepared = self.prepare(pass)?;
        prepared.execute()?;
        prepared.read()
    }

    /// Plans and records `pass`; it can then run any number of times.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if the pass contradicts itself, [`crate::Error::Shader`] if a shader
    /// is out of reach, [`crate::Error::Capacity`] if something does not fit.
    pub fn prepare(&mut self, pass: &Pass) -> Result<Prepared> {
        self.next_frame()?;
        let mut tables = Tables::default();
        let prepared = self.prepare_with(pass, &mut tables);
        self.tables.put_back(tables.tables);
        prepared
    }

    fn prepare_with(&mut self, pass: &Pass, tables: &mut Tables) -> Result<Prepared> {
        let (mut arena, mut scratch) = (Arena::new(&self.gpu), Scratch::default());
        let (plan, copies) = self.plan(pass, &mut arena, tables)?;
        self.resources.settle()?;
        let Self { gpu, kernels, timed, plan_kernels, .. } = self;
        let mut workspace =
            Workspace { scratch: &mut scratch, arena: &mut arena, kernels: plan_kernels };
        let setup = Setup::new(gpu, kernels, &mut workspace, (pass, &plan), copies)?;
        let (mut recordings, mut targets) = (Vec::new(), Vec::new());
        for (number, band) in setup.bands().enumerate() {
            let mut recorder = Recorder::new(gpu, "compute pass")?;
            if *timed {
                recorder.time_stages();
            }
            let target = setup.target(workspace.scratch, &band)?;
            let (planned, band) = ((&plan, &tables.tables[..]), (number, &band, &target));
            setup.record(&mut recorder, workspace.arena, kernels, planned, band)?;
            recordings.push(recorder.finish()?);
            targets.push(target);
        }
        let (attachments, _) = setup.into_parts();
        self.planner.recycle(plan);
        Prepared::new(&self.gpu, recordings, Results { extent: pass.extent, attachments, targets })
    }

    /// Begins a frame, which is recorded anew and runs without being waited for. Waits for the oldest frame if as many
    /// are in flight as there may be.
    ///
    /// # Errors
    /// [`crate::Error::Lost`] if the device was lost or does not end that frame in time; [`crate::Error::Full`] without
    /// memory.
    pub fn begin(&mut self) -> Result<Encoder<'_>> {
        Encoder::new(self)
    }

    /// Records a frame into a command buffer of the caller, who submits it once or more often: all that `frame` encodes. It
    /// waits for nobody, but for what [`Encoder`] says of the first use of something. The conditions are those of
    /// [`CallerCommands::new`]. The frame has memory of its own until [`Recorded`] is dropped; as many frames as there are of
    /// these may be in flight. What the frame writes to the renderer's own memory is shared with other frames, so that
    /// everything that the renderer recorded runs one after the other, in the order of submissions.
    ///
    /// The encoder that is lent stays in its place:
    ///
    /// ```compile_fail
    /// # use tilewright::{compute::{Encoder, Renderer}, vk::CallerCommands};
    /// fn exchange(renderer: &mut Renderer, commands: CallerCommands, mut other: Encoder<'static>) {
    ///     let _ = renderer.record(commands, |frame| {
    ///         std::mem::swap(frame, &mut other);
    ///         Ok(())
    ///     });
    /// }
    /// ```
    ///
    /// # Errors
    /// Those of `frame`, and [`crate::Error::Full`] without memory.
    pub fn record(
        &mut self,
        commands: CallerCommands,
        frame: impl FnOnce(&mut Encoder<'_>) -> Result<()>,
    ) -> Result<Recorded> {
        let mut encoder = Encoder::borrowing(self, &commands)?;
        frame(&mut encoder)?;
        encoder.finish()
    }

    /// Frames that may be in flight, at least 1; 2 unless set. Each has memory of its own for what the host writes.
    pub fn set_frames_in_flight(&mut self, frames: usize) {
        self.frames_in_flight = frames.max(1);
    }

    /// Makes kernels that `shader` takes part in, to see whether the driver refuses any. A vertex shader
    /// gets one without a vertex format: those of pipelines are made when a pass needs them.
    ///
    /// # Errors
    /// [`crate::Error::Shader`] if the shader is out of reach, [`crate::Error::Device`] if the driver
    /// refuses a kernel.
    pub fn make_kernels(&mut self, shader: &Arc<Shader>) -> Result<()> {
        let key = Arc::new(KernelKey {
            shader: shader.clone(),
            specialization: Vec::new(),
            attributes: Vec::new(),
            read: u32::MAX,
            per_sample: false,
            by_alpha: false,
            primitives: PrimitiveKind::Triangle,
        });
        self.kernels.next_pass();
        match shader.stage {
            Stage::Vertex => self.kernels.make([KernelRequest::Vertex(key)]),
            Stage::Fragment => {
                let format = kernels::color_formats([Format::Rgba8Srgb].into_iter())?;
                let (kind, mode) = (Fragments::default(), depth_mode(&shader.reflection));
                let ordered = KernelRequest::Ordered(key.clone(), format, kind, (mode, false));
                self.kernels.make([KernelRequest::Shade(key, format, kind), ordered])
            }
        }
    }

    #[doc(hidden)]
    /// Draws `pass` batch by batch and returns every intermediate. Draw commands in buffers are drawn as they are at this
    /// moment, and a trace numbers them as draws of their own.
    ///
    /// # Errors
    /// Those of [`Executor::render`].
    pub fn trace(&mut self, pass: &Pass) -> Result<(Frame, Trace)> {
        if !self.kernels.maker.is_trusted() {
            let fault = "a renderer with stages of the caller's own leaves no trace: its numbers may be any";
            return Err(Error::Usage(fault.into()));
        }
        pass.check(&mut self.known)?;
        let pass = &*pass.with_commands_read()?;
        self.next_frame()?;
        let mut tables = Tables::traced();
        let traced = self.trace_with(pass, &mut tables);
        self.tables.put_back(tables.tables);
        traced
    }

    fn trace_with(&mut self, pass: &Pass, tables: &mut Tables) -> Result<(Frame, Trace)> {
        let (mut arena, mut scratch) = (Arena::new(&self.gpu), Scratch::default());
        let (plan, copies) = self.plan(pass, &mut arena, tables)?;
        let (scratch, arena) = (&mut scratch, &mut arena);
        let mut workspace = Workspace { scratch, arena, kernels: &mut self.plan_kernels };
        let of_pass = (pass, &plan);
        let setup = Setup::new(&self.gpu, &mut self.kernels, &mut workspace, of_pass, copies)?;
        setup.trace(&self.kernels, workspace, (pass, &plan), tables)
    }

    /// Lets go of what frames did not need lately.
    fn next_frame(&mut self) -> Result<()> {
        self.resources.trim();
        self.kernels.next_pass();
        self.tables.next_pass()
    }

    /// Plans `pass`, uploads what is new of it, and gives it slots in `tables`.
    fn plan(
        &mut self,
        pass: &Pass,
        arena: &mut Arena,
        tables: &mut Tables,
    ) -> Result<(Plan, Copies)> {
        pass.check(&mut self.known)?;
        let copies = Copies::new(&self.gpu, &mut self.resources, pass)?;
        let mut slots =
            TableSlots::new(&mut self.tables, &mut self.resources, &copies, arena, tables)?;
        let plan = self.planner.plan(pass, self.limit, &mut self.known.ranges, &mut slots);
        self.resources.flush()?;
        Ok((plan?, copies))
    }
}

impl Executor for Renderer {
    fn render(&mut self, pass: &Pass) -> Result<Frame> {
        Renderer::render(self, pass)
    }
}
