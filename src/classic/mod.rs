//! The same [`Pass`] through the device's own graphics pipeline: the opponent and the parity oracle.
//!
//! It takes the very SPIR-V that the user brought, and sets the state that the pass describes,
//! one `vkCmdDraw` for each draw. Nothing is clever here on purpose: it draws as any Vulkan program
//! would.
//!
//! | file | concept |
//! |---|---|
//! | `layout` | descriptor set layouts merged from the reflection of both stages |
//! | `pipeline` | `VkPipeline` from a [`Pipeline`](crate::pass::Pipeline) |
//! | `primitives` | its topology, and its lines |
//! | `bindings` | descriptor sets from binding sets |
//! | `prepared` | recorded draws, reading back |
//! | `target` | target images, load and store operations |
//!
//! The driver gets the shaders as they are. So a shader that indexes an array of resources beyond its end does what
//! Vulkan leaves undefined, which may crash the driver. `compute` keeps such an index inside the array.
//!
//! Preparing and executing are separate, so that a benchmark times the device's work alone.

mod bindings;
mod blend;
mod layout;
mod pipeline;
mod prepared;
mod primitives;
mod stencil;
mod target;

pub use prepared::Prepared;

use crate::{
    error::{Error, Result},
    kept::Kept,
    pass::{Executor, Frame, Known, Pass},
    vk::{Cached, Gpu, Resources},
};
use pipeline::{Compiled, Key, Variant};
use std::sync::Arc;

/// Executes passes by `vkCmdDraw`.
///
/// Pipelines are known by their content and stay while a prepared pass holds them, and otherwise until 64
/// passes in a row have not used them. Uploads stay as long as somebody holds the buffer or texture.
pub struct Renderer {
    gpu: Gpu,
    resources: Resources,
    known: Known,
    pipelines: Kept<Key, Arc<Compiled>>,
}

impl Renderer {
    /// A renderer without anything uploaded.
    ///
    /// # Errors
    /// [`Error::Device`] if the device computes but does not draw.
    pub fn new(gpu: &Gpu) -> Result<Self> {
        if !gpu.has_graphics() {
            return Err(Error::Device(format!(
                "{} has no queue that both draws and computes, or no dynamic rendering; the \
                 classic executor needs them, compute does not",
                gpu.info().name
            )));
        }
        Ok(Self {
            gpu: gpu.clone(),
            resources: Resources::new(gpu),
            known: Known::default(),
            pipelines: Kept::default(),
        })
    }

    /// Counts of the objects that are kept for later passes.
    pub fn cached(&self) -> Cached {
        Cached {
            pipelines: self.pipelines.len(),
            pipelines_made: self.pipelines.made(),
            tables: 0,
            ..self.resources.cached()
        }
    }

    /// Checks `pass`, uploads its new resources, compiles its pipelines and records its draws.
    ///
    /// # Errors
    /// [`Error::Usage`] if the pass contradicts itself, [`Error::Capacity`] if it does not fit.
    pub fn prepare(&mut self, pass: &Pass) -> Result<Prepared> {
        pass.check(&mut self.known)?;
        primitives::check_provoking(pass)?;
        let compiled = self.compiled(pass)?;
        Prepared::new(&self.gpu, &mut self.resources, pass, &compiled)
    }

    /// Records the draws of `pass` anew into `prepared`, which keeps its targets. A program does the same in
    /// each frame. The pass is not validated, since such a program would not pay for that either: it must
    /// be valid and have the extent and the formats of the pass that was prepared.
    #[cfg(feature = "scene")] // for `bench`
    pub(crate) fn record_again(&mut self, prepared: &mut Prepared, pass: &Pass) -> Result<()> {
        let compiled = self.compiled(pass)?;
        prepared.record(&self.gpu, &mut self.resources, pass, &compiled)
    }

    /// The pipelines of `pass`. Pipelines that no pass uses any more are dropped.
    fn compiled(&mut self, pass: &Pass) -> Result<Vec<Arc<Compiled>>> {
        self.resources.trim();
        self.pipelines.next_pass(|compiled| Arc::strong_count(compiled) > 1);
        let mut compiled = Vec::with_capacity(pass.pipelines.len());
        for (pipeline, variant) in pass.pipelines.iter().zip(Variant::all(&self.gpu, pass)?) {
            let key = Key(pipeline.clone(), variant);
            let found = match self.pipelines.get(&key) {
                Some(found) => found.clone(),
                None => {
                    let new = Arc::new(Compiled::new(&self.gpu, pipeline, &key.1)?);
                    self.pipelines.insert(key, new.clone());
                    new
                }
            };
            compiled.push(found);
        }
        Ok(compiled)
    }
}

impl Executor for Renderer {
    fn render(&mut self, pass: &Pass) -> Result<Frame> {
        let mut prepared = self.prepare(pass)?;
        prepared.execute()?;
        prepared.read()
    }
}
