//! Executes a pass by compute kernels: the product.
//!
//! The stages of a batch, in order. Each is a file here, one or more kernels in `glsl/` and, if its result does
//! not depend on user code, a twin in `reference/`:
//!
//! ```text
//! clear      the targets' clear values, once per band; loads are copies (`attach`)
//! vertex     the user's vertex shader, once per vertex slot
//! primitive  assembly, clipping, culling, fixed-point setup; counts what each cell will list
//! binning    scan of the counts, scatter of the keys, sort where order matters
//! raster     which triangle each pixel shows (opaque work)      | ordered  raster, shading and
//! shade      the user's fragment shader at visible pixels       |          blending in API order
//! ```
//!
//! [`Renderer::prepare`] plans a pass, makes its kernels and records one submission for each band;
//! [`Prepared::execute`] runs it, with no decision by the CPU in between; [`Prepared::read`] returns
//! the pictures. [`Renderer::trace`] stops after every batch and copies all intermediates to the host.

mod attach;
mod binning;
mod clear;
mod frame;
mod kernels;
mod ordered;
mod prepared;
mod primitive;
mod raster;
mod shade;
mod slots;
mod target;
mod trace;
mod vertex;

pub use prepared::Prepared;

use crate::{
    error::Result,
    format::Format,
    grid::Capacities,
    pass::{Executor, Frame, IndexRanges, Pass},
    plan::{KernelKey, Plan, depth_mode},
    shader::{Shader, Stage},
    trace::Trace,
    vk::{Cached, Copies, Gpu, Resources},
};
use kernels::{KernelRequest, Kernels};
use slots::{TablePool, TableSlots, Tables};
use std::sync::Arc;

/// Executes passes by compute kernels on one device.
///
/// Kernels are known by the content of their shaders and stay while a prepared pass holds them, and
/// otherwise until 64 passes in a row have not used them. Uploads stay as long as somebody holds the buffer
/// or texture.
pub struct Renderer {
    gpu: Gpu,
    resources: Resources,
    tables: TablePool,
    ranges: IndexRanges,
    kernels: Kernels,
    limit: Capacities,
    timed: bool,
}

impl Renderer {
    /// A renderer on `gpu` with the default batch size.
    ///
    /// # Errors
    /// [`crate::Error::Device`] if the driver refuses a kernel.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        Ok(Self {
            gpu: gpu.clone(),
            resources: Resources::new(gpu),
            tables: TablePool::new(gpu),
            ranges: IndexRanges::default(),
            kernels: Kernels::new(gpu)?,
            limit: Capacities::DEFAULT,
            timed: false,
        })
    }

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

    /// Plans and records `pass`; it can then run any number of times.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if the pass contradicts itself, [`crate::Error::Shader`] if a shader
    /// is out of reach, [`crate::Error::Capacity`] if something does not fit.
    pub fn prepare(&mut self, pass: &Pass) -> Result<Prepared> {
        let (plan, tables, copies) = self.plan(pass)?;
        frame::Setup::new(self, pass, &plan, tables.tables, copies)?.record(self, &plan)
    }

    /// Makes kernels that `shader` takes part in, to see whether the driver refuses any. A vertex shader
    /// gets one without a vertex format: those of pipelines are made when a pass needs them.
    ///
    /// # Errors
    /// [`crate::Error::Shader`] if the shader is out of reach, [`crate::Error::Device`] if the driver
    /// refuses a kernel.
    pub fn make_kernels(&mut self, shader: &Arc<Shader>) -> Result<()> {
        let key = KernelKey {
            shader: shader.clone(),
            specialization: Vec::new(),
            attributes: Vec::new(),
            read: u32::MAX,
        };
        self.kernels.next_pass();
        match shader.stage {
            Stage::Vertex => self.kernels.make(&[KernelRequest::Vertex(key)]),
            Stage::Fragment => {
                let format = kernels::color_format(Format::Rgba8Srgb)?;
                let ordered =
                    KernelRequest::Ordered(key.clone(), format, depth_mode(&shader.reflection));
                self.kernels.make(&[KernelRequest::Shade(key, format), ordered])
            }
        }
    }

    /// Draws `pass` batch by batch and returns every intermediate.
    ///
    /// # Errors
    /// Those of [`Executor::render`].
    pub fn trace(&mut self, pass: &Pass) -> Result<(Frame, Trace)> {
        let (plan, tables, copies) = self.plan(pass)?;
        let setup = frame::Setup::new(self, pass, &plan, tables.tables, copies)?;
        setup.trace(self, &plan, tables.buffers)
    }

    fn plan(&mut self, pass: &Pass) -> Result<(Plan, Tables, Copies)> {
        pass.check(&mut self.ranges)?;
        self.resources.trim();
        self.kernels.next_pass();
        self.tables.next_pass()?;
        let copies = Copies::new(&self.gpu, &mut self.resources, pass)?;
        let (resources, tables) = (&mut self.resources, &mut self.tables);
        let mut slots = TableSlots::new(&self.gpu, resources, tables, &copies)?;
        let plan = Plan::new(pass, self.limit, &mut self.ranges, &mut slots);
        let tables = slots.into_tables();
        match plan.and_then(|plan| self.resources.flush().map(|()| plan)) {
            Ok(plan) => Ok((plan, tables, copies)),
            Err(error) => {
                self.tables.put_back(tables.tables);
                Err(error)
            }
        }
    }
}

impl Executor for Renderer {
    fn render(&mut self, pass: &Pass) -> Result<Frame> {
        let mut prepared = self.prepare(pass)?;
        prepared.execute()?;
        prepared.read()
    }
}
