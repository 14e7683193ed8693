//! Counts the parts of a pass as the planner sees them.

use crate::{
    error::Result,
    grid::Capacities,
    pass::{BindingEntry, BindingSet, BufferSource, IndexRanges, Pass},
    plan::{Plan, Slots},
};
use std::sync::Arc;

/// Pipeline statistics. They hold for both executors, except for those that begin with "Compute".
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Primitives of all draws, instances included.
    pub triangles: u64,
    /// Draws.
    pub draws: usize,
    /// Pipelines that draws use.
    pub pipelines: usize,
    /// Samples of a pixel.
    pub samples: u32,
    /// Colour targets.
    pub targets: usize,
    /// Whether there is a stencil target.
    pub stencil: bool,
    /// Bytes of a sample in all colour targets together.
    pub color_bytes: u64,
    /// Compute: runs of vertex shaders, each vertex of a batch once.
    pub vertices: u64,
    /// Compute: bytes of attributes that these runs read.
    pub attribute_bytes: u64,
    /// Compute: sweeps of all stages.
    pub batches: usize,
    /// Compute: words that vertices leave for shading.
    pub varying_words: u64,
}

/// Nothing is uploaded to count.
struct Nowhere;

impl Slots for Nowhere {
    fn buffer(&mut self, _: &Arc<BufferSource>) -> Result<u32> {
        Ok(0)
    }

    fn bindings(&mut self, _: &Arc<BindingSet>, _: &BindingEntry, _: u32) -> Result<u32> {
        Ok(0)
    }

    fn push_constants(&mut self, _: &[u8]) -> Result<u32> {
        Ok(0)
    }

    fn is_full(&self) -> bool {
        false
    }

    fn next_table(&mut self) -> Result<()> {
        Ok(())
    }

    fn table(&self) -> usize {
        0
    }

    fn is_shared(&self) -> bool {
        false
    }
}

impl Counts {
    /// The counts of `pass`, which has to be valid.
    ///
    /// # Errors
    /// [`Error::Capacity`](crate::Error::Capacity) for a primitive that fits no batch.
    pub fn new(pass: &Pass) -> Result<Self> {
        let plan = Plan::new(pass, Capacities::DEFAULT, &mut IndexRanges::default(), &mut Nowhere)?;
        let mut used: Vec<usize> = pass.draws.iter().map(|draw| draw.pipeline).collect();
        used.sort_unstable();
        used.dedup();
        let triangles = pass.draws.iter().map(|draw| {
            let topology = pass.pipelines[draw.pipeline].topology;
            u64::from(topology.primitives(draw.count)) * u64::from(draw.instances)
        });
        // Bytes that one vertex of a draw reads; draws of one pass are similar enough to take the mean.
        let attributes = pass.draws.iter().map(|draw| {
            let pipeline = &pass.pipelines[draw.pipeline];
            pipeline.vertex_attributes.iter().map(|a| a.format.bytes() as u64).sum::<u64>()
        });
        let vertices = plan.batches.iter().map(|batch| u64::from(batch.vertices)).sum::<u64>();
        let color_bytes = pass.colors.iter().map(|color| color.format.texel_bytes() as u64);
        let draws = pass.draws.len();
        Ok(Self {
            attribute_bytes: vertices * attributes.sum::<u64>() / (draws as u64).max(1),
            triangles: triangles.sum(),
            draws,
            pipelines: used.len(),
            samples: pass.samples.count(),
            targets: pass.colors.len(),
            stencil: pass.stencil.is_some(),
            color_bytes: color_bytes.sum(),
            vertices,
            batches: plan.batches.len(),
            varying_words: plan.batches.iter().map(|batch| u64::from(batch.varying_words)).sum(),
        })
    }
}
