//! Plans the batches of a pass: pure arithmetic, no device.
//!
//! A pass is a list of draws in API order. The planner cuts it into *pieces*, runs of consecutive
//! primitives of one draw, and gathers pieces into *batches*, each one sweep of all stages over the
//! bins. A batch ends where its buffers could overflow in the worst case ([`Capacities`]), where the
//! resource table is full and another one begins, or where the method of drawing changes:
//!
//! * **opaque** work (a depth comparison towards or away from the viewer with write, no blending, no
//!   discard, no depth export, no side effects) has a result that does not depend on its order and
//!   goes through visibility;
//! * everything else is **ordered**, one fragment shader at a time.
//!
//! All batches run, in their order. If a draw needs several batches and its vertices fit one, the first batch
//! shades the vertices, and the other batches find them in place.
//!
//! Nothing in a batch needs a decision by the CPU. The number of batches depends on the pass alone, not on
//! what is visible.

mod draw;

use crate::{
    abi::{self, Attribute, Piece},
    error::{Error, Result},
    grid::Capacities,
    pass::{
        BindingEntry, BindingSet, Buffer, Draw, IndexRanges, Pass, Pipeline, StepRate,
        VertexAttribute, VertexBinding,
    },
    shader::{Reflection, Shader, Varying},
    state::Compare,
};
use std::{collections::HashMap, sync::Arc};

/// Where the executor put a resource: gives the planner slots of the resource table.
pub trait Slots {
    /// The slot of a whole buffer, for vertices and indices. A buffer of more than 2^[`abi::WINDOW_LOG2`]
    /// bytes has several consecutive slots, each for so many bytes; this is the first of them.
    fn buffer(&mut self, buffer: &Arc<Buffer>) -> Result<u32>;
    /// The first of consecutive slots of the elements of one shader variable, which `set` binds by the
    /// entry `entry`. If the variable is a block, `block` is its size in bytes.
    fn bindings(&mut self, set: &Arc<BindingSet>, entry: &BindingEntry, block: u32) -> Result<u32>;
    /// The slot of a push-constant block.
    fn push_constants(&mut self, bytes: &[u8]) -> Result<u32>;
    /// Whether the table has no slot left of some kind, so that a full table was the reason to refuse a draw.
    fn is_full(&self) -> bool;
    /// Begins another table, which has all slots free.
    fn next_table(&mut self) -> Result<()>;
}

/// A shader with its specialization: one kernel to build. Equal shaders make equal keys, even if a caller
/// makes the same shader twice.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub struct KernelKey {
    /// The shader.
    pub shader: Arc<Shader>,
    /// Its specialization constants.
    pub specialization: Vec<(u32, u32)>,
    /// A vertex shader's attributes: location and format, as [`abi::SPEC_ATTRIBUTE`] has it.
    pub attributes: Vec<(u32, u32)>,
    /// A bit for each output location of a vertex shader that is read, as [`abi::SPEC_READ`] has it.
    pub read: u32,
}

/// How a batch is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Visibility first, then shading; all draws have this depth comparison.
    Opaque(Compare),
    /// In API order with one fragment kernel; the depth mode is one of `abi::DEPTH_*`.
    Ordered {
        /// Index into [`Plan::fragment_kernels`].
        kernel: usize,
        /// When the depth test happens.
        depth: u32,
    },
}

/// One dispatch of the vertex stage: all slots of a batch that one vertex shader fills.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VertexWork {
    /// Index into [`Plan::vertex_kernels`].
    pub kernel: usize,
    /// First of its runs in [`Plan::runs`].
    pub run_first: u32,
    /// Its runs.
    pub run_count: u32,
    /// First vertex slot.
    pub slot_first: u32,
    /// Vertex slots.
    pub slot_count: u32,
}

/// One sweep of all stages.
#[derive(Clone, Debug)]
pub struct BatchPlan {
    /// How it is drawn.
    pub method: Method,
    /// Primitives.
    pub primitives: u32,
    /// First piece in [`Plan::pieces`].
    pub piece_first: u32,
    /// Pieces.
    pub piece_count: u32,
    /// Vertex slots, those left in place from the batch before included.
    pub vertices: u32,
    /// Words of varyings, in the same way.
    pub varying_words: u32,
    /// Dispatches of the vertex stage.
    pub vertex_work: Vec<VertexWork>,
    /// Indices into [`Plan::fragment_kernels`]; a piece's `fragment_kernel` counts in this list.
    pub fragment_kernels: Vec<usize>,
    /// The number of the resource table that its slots belong to.
    pub table: usize,
}

/// A pass, ready to be recorded.
#[derive(Debug, Default)]
pub struct Plan {
    /// In API order.
    pub batches: Vec<BatchPlan>,
    /// All pieces, batch after batch.
    pub pieces: Vec<Piece>,
    /// For each piece the index of its draw. Kernels need no such number; a trace names primitives by it.
    pub piece_draws: Vec<u32>,
    /// Attributes, [`Piece::attribute_base`] counts here.
    pub attributes: Vec<Attribute>,
    /// Pieces in the order of their vertex slots, batch after batch.
    pub runs: Vec<u32>,
    /// Table slots, [`Piece::vertex_resources`] and [`Piece::fragment_resources`] count here.
    pub resource_slots: Vec<u32>,
    /// Distinct vertex kernels.
    pub vertex_kernels: Vec<KernelKey>,
    /// Distinct fragment kernels.
    pub fragment_kernels: Vec<KernelKey>,
}

impl Plan {
    /// Plans `pass`, which has been validated. No batch outgrows `limit`.
    ///
    /// # Errors
    /// What `slots` returns, and [`Error::Capacity`] if a single primitive is too much for `limit`.
    pub fn new(
        pass: &Pass,
        limit: Capacities,
        ranges: &mut IndexRanges,
        slots: &mut dyn Slots,
    ) -> Result<Plan> {
        let mut planner = Planner {
            pass,
            limit,
            ranges,
            slots,
            plan: Plan::default(),
            numbers: Numbers::default(),
            open: None,
            table: 0,
            in_table: 0,
        };
        let mut pipelines = vec![None; pass.pipelines.len()];
        for (number, draw) in pass.draws.iter().enumerate() {
            let pipeline = &pass.pipelines[draw.pipeline];
            let info =
                *pipelines[draw.pipeline].get_or_insert_with(|| planner.pipeline_info(pipeline));
            planner.draw(number as u32, draw, info)?;
        }
        planner.close();
        Ok(planner.plan)
    }

    /// The capacities that the buffers of the largest batch need.
    pub fn capacities(&self) -> Capacities {
        let most =
            |of: fn(&BatchPlan) -> u32| self.batches.iter().map(of).max().unwrap_or(0).max(1);
        Capacities {
            primitives: most(|b| b.primitives),
            vertices: most(|b| b.vertices),
            varying_words: most(|b| b.varying_words),
        }
    }
}

/// The facts that the planner derives from a pipeline, once.
#[derive(Clone, Copy)]
struct PipelineInfo {
    method: Method,
    vertex_kernel: usize,
    fragment_kernel: usize,
    varying_stride: u32,
}

/// A batch that still takes pieces. Vertex slots are given out when it closes.
struct OpenBatch {
    method: Method,
    piece_first: u32,
    primitives: u32,
    vertices: u32,
    varying_words: u32,
    /// Vertex slots and words of varyings that are left in place from the batch before; the draw they
    /// belong to goes on.
    kept: (u32, u32),
    /// For each piece its vertex kernel and the vertex slots it needs, `None` if it uses the kept ones.
    vertex_needs: Vec<(usize, Option<u32>)>,
    fragment_kernels: Vec<usize>,
}

impl OpenBatch {
    fn new(method: Method, piece_first: u32, kept: (u32, u32)) -> Self {
        Self {
            method,
            piece_first,
            primitives: 0,
            vertices: kept.0,
            varying_words: kept.1,
            kept,
            vertex_needs: Vec::new(),
            fragment_kernels: Vec::new(),
        }
    }
}

/// Numbers of the plan's kernels.
#[derive(Default)]
struct Numbers {
    vertex: HashMap<KernelKey, usize>,
    fragment: HashMap<KernelKey, usize>,
}

/// The number of `key` in `kernels`; a new key is added.
fn number_of(
    kernels: &mut Vec<KernelKey>,
    numbers: &mut HashMap<KernelKey, usize>,
    key: KernelKey,
) -> usize {
    *numbers.entry(key).or_insert_with_key(|key| {
        kernels.push(key.clone());
        kernels.len() - 1
    })
}

struct Planner<'a> {
    pass: &'a Pass,
    limit: Capacities,
    ranges: &'a mut IndexRanges,
    slots: &'a mut dyn Slots,
    plan: Plan,
    numbers: Numbers,
    open: Option<OpenBatch>,
    /// The table that `slots` fills, and the draws that bind something there.
    table: usize,
    in_table: usize,
}

impl Planner<'_> {
    fn pipeline_info(&mut self, pipeline: &Pipeline) -> PipelineInfo {
        // Pipelines that differ in a constant of one stage share the kernel of the other.
        let own = |ids: &[u32]| {
            let all = pipeline.specialization.iter();
            all.filter(|(id, _)| ids.contains(id)).copied().collect()
        };
        let key = |shader: &Arc<Shader>, attributes, read| KernelKey {
            shader: shader.clone(),
            specialization: own(&shader.reflection.specialization),
            attributes,
            read,
        };
        let (plan, numbers) = (&mut self.plan, &mut self.numbers);
        let vertex = key(&pipeline.vertex, attributes(pipeline), read_outputs(pipeline));
        let vertex_kernel = number_of(&mut plan.vertex_kernels, &mut numbers.vertex, vertex);
        let fragment = key(&pipeline.fragment, Vec::new(), 0);
        let fragment_kernel =
            number_of(&mut plan.fragment_kernels, &mut numbers.fragment, fragment);
        let inputs = &pipeline.fragment.reflection.inputs;
        let locations = inputs.iter().map(|v| v.location + 1).max();
        PipelineInfo {
            method: method(pipeline, self.pass.depth.is_some(), fragment_kernel),
            vertex_kernel,
            fragment_kernel,
            varying_stride: 4 * locations.unwrap_or(0),
        }
    }

    /// Ends the open batch: gives its pieces their vertex slots. The pieces of one kernel come together.
    fn close(&mut self) {
        let Some(open) = self.open.take() else { return };
        let mut order: Vec<usize> = (0..open.vertex_needs.len()).collect();
        order.sort_by_key(|&i| open.vertex_needs[i].0);
        let (mut slot, mut word) = open.kept;
        let mut vertex_work: Vec<VertexWork> = Vec::new();
        for i in order {
            let (kernel, Some(slots)) = open.vertex_needs[i] else { continue };
            let run = self.plan.runs.len() as u32;
            self.plan.runs.push(open.piece_first + i as u32);
            let piece = &mut self.plan.pieces[open.piece_first as usize + i];
            piece.vertex_base = slot;
            piece.varying_base = word;
            match vertex_work.last_mut() {
                Some(work) if work.kernel == kernel => {
                    work.run_count += 1;
                    work.slot_count += slots;
                }
                _ => vertex_work.push(VertexWork {
                    kernel,
                    run_first: run,
                    run_count: 1,
                    slot_first: slot,
                    slot_count: slots,
                }),
            }
            slot += slots;
            word += slots * piece.varying_stride;
        }
        self.plan.batches.push(BatchPlan {
            method: open.method,
            primitives: open.primitives,
            piece_first: open.piece_first,
            piece_count: self.plan.pieces.len() as u32 - open.piece_first,
            vertices: open.vertices,
            varying_words: open.varying_words,
            vertex_work,
            fragment_kernels: open.fragment_kernels,
            table: self.table,
        });
    }

    /// The open batch for `info`; a new one if the open one has another method or is full.
    fn batch(&mut self, info: PipelineInfo) -> &mut OpenBatch {
        let fits = self.open.as_ref().is_some_and(|open| {
            open.method == info.method
                && open.primitives < self.limit.primitives
                && (open.fragment_kernels.contains(&info.fragment_kernel)
                    || open.fragment_kernels.len() < abi::MAX_FRAGMENT_KERNELS as usize)
        });
        if !fits {
            self.close();
        }
        let piece_first = self.plan.pieces.len() as u32;
        self.open.get_or_insert_with(|| OpenBatch::new(info.method, piece_first, (0, 0)))
    }

    /// Opens a batch in which the first `slots` vertex slots of the one before stay in place.
    fn keep(&mut self, info: PipelineInfo, slots: u32) {
        let kept = (slots, slots * info.varying_stride);
        self.open = Some(OpenBatch::new(info.method, self.plan.pieces.len() as u32, kept));
    }

    /// Lists the numbers that a shader's kernel gets for a draw, in the order of [`Shader::last_element`]. Returns
    /// where they start.
    fn resources(&mut self, shader: &Shader, draw: &Draw) -> Result<u32> {
        let arrays = &shader.details.arrays;
        let mut list = Vec::with_capacity(shader.reflection.resources.len() + 1 + arrays.len());
        // Elements of each resource, if there are arrays at all.
        let mut bound = Vec::new();
        for resource in &shader.reflection.resources {
            let found = draw.sets.get(resource.set as usize).and_then(|set| {
                let entry = set.entries.iter().find(|e| e.binding == resource.binding)?;
                Some((set, entry))
            });
            let Some((set, entry)) = found else {
                return Err(Error::Usage(format!(
                    "shader `{}` binds set {}, binding {}, which the draw does not provide",
                    shader.label, resource.set, resource.binding
                )));
            };
            list.push(self.slots.bindings(set, entry, resource.bytes)?);
            if !arrays.is_empty() {
                // More may be bound than the shader declares.
                let declared = if resource.count == 0 { u32::MAX } else { resource.count };
                bound.push(declared.min(entry.resources.len() as u32));
            }
        }
        if shader.reflection.push_constant_bytes > 0 {
            list.push(self.slots.push_constants(&draw.push_constants)?);
        }
        list.extend(arrays.iter().map(|array| bound[array.number as usize].saturating_sub(1)));
        let base = self.plan.resource_slots.len();
        // Draws that follow each other often bind the same.
        let recent = base.saturating_sub(list.len());
        if self.plan.resource_slots[recent..] == list[..] {
            return Ok(recent as u32);
        }
        self.plan.resource_slots.extend(list);
        Ok(base as u32)
    }
}

/// The attributes of a pipeline, ordered by location.
fn attributes(pipeline: &Pipeline) -> Vec<(u32, u32)> {
    let format = |attribute: &VertexAttribute| {
        let format = attribute.format;
        let VertexBinding { stride, rate } = pipeline.vertex_bindings[attribute.binding as usize];
        // One element for all vertices is also one for all vertices of an instance.
        let per_instance = rate == StepRate::Instance || stride == 0;
        let per_instance = u32::from(per_instance) * abi::ATTRIBUTE_PER_INSTANCE;
        let count = u32::from(format.count) << abi::ATTRIBUTE_COUNT_SHIFT;
        (attribute.location, format.component as u32 | count | per_instance)
    };
    let read = |a: &&VertexAttribute| {
        pipeline.vertex.reflection.inputs.iter().any(|input| input.location == a.location)
    };
    let mut all: Vec<_> = pipeline.vertex_attributes.iter().filter(read).map(format).collect();
    all.sort_unstable();
    all
}

/// The locations that the vertex shader of a pipeline writes and its fragment shader reads, a bit each.
fn read_outputs(pipeline: &Pipeline) -> u32 {
    let locations = |varyings: &[Varying]| {
        let of = |v: &Varying| 1u32.checked_shl(v.location).unwrap_or(0);
        varyings.iter().fold(0, |all, varying| all | of(varying))
    };
    let [vertex, fragment] = [&pipeline.vertex, &pipeline.fragment].map(|s| &s.reflection);
    locations(&vertex.outputs) & locations(&fragment.inputs)
}

/// How a pipeline is drawn.
fn method(pipeline: &Pipeline, has_depth: bool, kernel: usize) -> Method {
    let fragment = &pipeline.fragment.reflection;
    let keyed = matches!(
        pipeline.depth.compare,
        Compare::Less | Compare::LessOrEqual | Compare::Greater | Compare::GreaterOrEqual
    );
    let tested = has_depth && pipeline.depth.test && pipeline.depth.write && keyed;
    if tested && is_pure(fragment) && pipeline.blend.is_none() {
        return Method::Opaque(pipeline.depth.compare);
    }
    Method::Ordered { kernel, depth: depth_mode(fragment) }
}

/// Whether a fragment shader does nothing except return a colour.
fn is_pure(fragment: &Reflection) -> bool {
    !fragment.discards && !fragment.writes_depth && !fragment.has_side_effects
}

/// When ordered work tests depth: one of `abi::DEPTH_*`.
pub(crate) fn depth_mode(fragment: &Reflection) -> u32 {
    if fragment.early_fragment_tests || is_pure(fragment) {
        abi::DEPTH_EARLY
    } else if fragment.writes_depth || fragment.has_side_effects {
        abi::DEPTH_LATE
    } else {
        abi::DEPTH_EARLY_TEST
    }
}
