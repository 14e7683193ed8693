//! The same [`Pass`] through the device's own graphics pipeline: the opponent and the parity oracle.
//!
//! It takes the very SPIR-V that the user brought, and sets the state that the pass describes,
//! one `vkCmdDraw` for each draw. Nothing is clever here on purpose: what it draws is what any Vulkan
//! program would draw.
//!
//! | file | concept |
//! |---|---|
//! | `layout` | descriptor set layouts merged from the reflection of both stages |
//! | `pipeline` | `VkPipeline` from a [`Pipeline`] |
//! | `bindings` | descriptor sets from binding sets |
//! | `prepared` | targets, recorded draws, reading back |
//!
//! Preparing and executing are separate, so that a benchmark times the device's work alone.

mod bindings;
mod layout;
mod pipeline;
mod prepared;

pub use prepared::Prepared;

use crate::{
    error::{Error, Result},
    pass::{Executor, Frame, Pass, Pipeline},
    vk::{Gpu, Resources},
};
use pipeline::{Compiled, Variant};
use std::{collections::HashMap, sync::Arc};

/// Executes passes by `vkCmdDraw`. Uploads and pipelines are kept for the next pass that uses them.
pub struct Renderer {
    gpu: Gpu,
    resources: Resources,
    pipelines: HashMap<(*const Pipeline, Variant), Held>,
}

/// The pipeline is held, so that its address is not reused while it is a key.
type Held = (Arc<Pipeline>, Arc<Compiled>);

// SAFETY: the pointers are keys only; what they point to is held by the `Arc` beside them.
unsafe impl Send for Renderer {}

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
        Ok(Self { gpu: gpu.clone(), resources: Resources::new(gpu), pipelines: HashMap::new() })
    }

    /// Checks `pass`, uploads what is new in it, compiles its pipelines and records its draws.
    ///
    /// # Errors
    /// [`Error::Usage`] if the pass contradicts itself, [`Error::Capacity`] if it does not fit.
    pub fn prepare(&mut self, pass: &Pass) -> Result<Prepared> {
        pass.validate()?;
        let compiled = self.compiled(pass)?;
        Prepared::new(&self.gpu, &mut self.resources, pass, &compiled)
    }

    /// Records the draws of `pass` anew into `prepared`, which keeps its targets: what a program does in
    /// each frame. The pass is not validated, since such a program would not pay for it either: it must
    /// be valid and have the extent and the formats of the pass that was prepared.
    #[cfg(feature = "glsl")]
    pub(crate) fn record_again(&mut self, prepared: &mut Prepared, pass: &Pass) -> Result<()> {
        let compiled = self.compiled(pass)?;
        prepared.record(&self.gpu, &mut self.resources, pass, &compiled)
    }

    /// The pipelines of `pass`; what no pass uses any more is forgotten.
    fn compiled(&mut self, pass: &Pass) -> Result<Vec<Arc<Compiled>>> {
        self.resources.trim();
        self.pipelines.retain(|_, (held, _)| Arc::strong_count(held) > 1);
        let mut compiled = Vec::with_capacity(pass.pipelines.len());
        for (n, pipeline) in pass.pipelines.iter().enumerate() {
            let variant = Variant::new(pass, n)?;
            let key = (Arc::as_ptr(pipeline), variant);
            let found = match self.pipelines.get(&key) {
                Some((_, found)) => found.clone(),
                None => {
                    let new = Arc::new(Compiled::new(&self.gpu, pipeline, &key.1)?);
                    self.pipelines.insert(key, (pipeline.clone(), new.clone()));
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
