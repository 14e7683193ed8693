//! Plans the batches of a pass: pure arithmetic, no device.
//!
//! A pass is a list of draws in API order. The planner cuts it into *pieces*, runs of consecutive
//! primitives of one draw, and gathers pieces into *batches*, each one sweep of all stages over the
//! bins. A batch ends where its buffers could overflow in the worst case ([`Capacities`]), where the
//! resource table is full and another one begins, or where the method of drawing changes:
//!
//! * **opaque** work (a depth comparison towards or away from the viewer with write, no blending, all channels of
//!   all targets or none, no discard, no export of depth or of stencil values, no side effects, no stencil test in which
//!   values depend on each other) has a result that does not depend on its order and
//!   goes through visibility;
//! * everything else is **ordered**, one fragment shader at a time.
//!
//! All batches run, in their order. If a draw needs several batches and its vertices fit one, the first batch
//! shades the vertices, and the other batches find them in place.
//!
//! Nothing in a batch needs a decision by the CPU. The number of batches depends on the pass alone, not on
//! what is visible.

mod draw;
mod facts;
mod indirect;

use crate::{
    abi::{self, Attribute, Commands, Piece},
    error::{Error, Result},
    grid::Capacities,
    kept::ByIdentity,
    pass::{BindingEntry, BindingSet, BufferSource, Draw, IndexRanges, Pass, Pipeline},
    shader::{ResourceArray, Shader},
    state::{Compare, PrimitiveKind},
};
use facts::{Facts, method};
use std::{collections::HashMap, sync::Arc};

pub use facts::Stencil;
pub(crate) use facts::{PipelineKernels, TargetKinds, depth_mode};

/// Where the executor put a resource: gives the planner slots of the resource table.
pub trait Slots {
    /// The slot of a whole buffer, for vertices and indices. A buffer of more than 2^[`abi::WINDOW_LOG2`]
    /// bytes has several consecutive slots, each for so many bytes; this is the first of them.
    fn buffer(&mut self, buffer: &Arc<BufferSource>) -> Result<u32>;
    /// The first of consecutive slots of the elements of one shader variable, which `set` binds by the
    /// entry `entry`. If the variable is a block, `block` is its size in bytes.
    fn bindings(&mut self, set: &Arc<BindingSet>, entry: &BindingEntry, block: u32) -> Result<u32>;
    /// The slot of a push-constant block.
    fn push_constants(&mut self, bytes: &[u8]) -> Result<u32>;
    /// Whether the table has no slot left of some kind, so that a full table was the reason to refuse a draw.
    fn is_full(&self) -> bool;
    /// Begins another table, which has all slots free.
    fn next_table(&mut self) -> Result<()>;
    /// The number of the table that slots are in now.
    fn table(&self) -> usize;
    /// Whether another pass has slots in that table.
    fn is_shared(&self) -> bool;
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
    /// Whether a fragment shader runs for each sample.
    pub per_sample: bool,
    /// Whether its alpha says which samples are covered, or is replaced by 1.
    pub by_alpha: bool,
    /// What a fragment shader runs for; of all vertex shaders the same.
    pub primitives: PrimitiveKind,
}

/// How a batch is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Method {
    /// Visibility first, then shading.
    Opaque {
        /// The depth comparison of all draws.
        compare: Compare,
        /// Whether the draws write colour: all of them write all targets, or none writes any.
        shades: bool,
        /// Their stencil tests.
        stencil: Stencil,
    },
    /// In API order with one fragment kernel; the depth mode is one of `abi::DEPTH_*`.
    Ordered {
        /// Index into [`Plan::fragment_kernels`].
        kernel: usize,
        /// When the depth test happens.
        depth: u32,
        /// Whether there is a stencil test.
        stencil: bool,
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
    /// Whether depths of some of its draws are adjusted.
    pub adjusted: bool,
    /// Whether its vertices have distances from planes of the user.
    pub distances: bool,
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
    /// Commands of which the device makes its pieces; its one piece in [`Plan::pieces`] is their template.
    pub commands: Option<Commands>,
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
    pub vertex_kernels: Vec<Arc<KernelKey>>,
    /// Distinct fragment kernels.
    pub fragment_kernels: Vec<Arc<KernelKey>>,
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
        Planner::default().plan(pass, limit, ranges, slots)
    }

    /// The most commands that a batch makes its pieces of, if there are any.
    pub fn most_commands(&self) -> Option<u32> {
        self.batches.iter().filter_map(|batch| Some(batch.commands.as_ref()?.draws)).max()
    }

    /// The capacities that the buffers of the largest batch need.
    pub fn capacities(&self) -> Capacities {
        let most =
            |of: fn(&BatchPlan) -> u32| self.batches.iter().map(of).max().unwrap_or(0).max(1);
        Capacities {
            primitives: most(|b| Capacities::room_of(b.primitives, b.distances)),
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
    distances: bool,
}

/// A batch that still takes pieces. Vertex slots are given out when it closes.
struct OpenBatch {
    method: Method,
    adjusted: bool,
    distances: bool,
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

/// Makes plans, and keeps what the next one needs: what follows from pipelines, and the memory of plans that it gets
/// back.
#[derive(Default)]
pub struct Planner {
    facts: ByIdentity<Pipeline, Facts>,
    spare: Spare,
}

/// Lists that keep their memory from plan to plan.
#[derive(Default)]
struct Spare {
    plan: Plan,
    numbers: Numbers,
    pipelines: Vec<Option<PipelineInfo>>,
    order: Vec<usize>,
    open: Vec<OpenBatch>,
    work: Vec<Vec<VertexWork>>,
    kernels: Vec<Vec<usize>>,
    bound: Vec<u32>,
}

/// Numbers of the plan's kernels.
#[derive(Default)]
struct Numbers {
    vertex: HashMap<Arc<KernelKey>, usize>,
    fragment: HashMap<Arc<KernelKey>, usize>,
}

/// The number of `key` in `kernels`; a new key is added.
fn number_of(
    kernels: &mut Vec<Arc<KernelKey>>,
    numbers: &mut HashMap<Arc<KernelKey>, usize>,
    key: &Arc<KernelKey>,
) -> usize {
    *numbers.entry(key.clone()).or_insert_with(|| {
        kernels.push(key.clone());
        kernels.len() - 1
    })
}

impl Planner {
    /// As [`Plan::new`].
    ///
    /// # Errors
    /// As [`Plan::new`].
    pub fn plan(
        &mut self,
        pass: &Pass,
        limit: Capacities,
        ranges: &mut IndexRanges,
        slots: &mut dyn Slots,
    ) -> Result<Plan> {
        let mut spare = std::mem::take(&mut self.spare);
        spare.numbers.vertex.clear();
        spare.numbers.fragment.clear();
        let mut pipelines = std::mem::take(&mut spare.pipelines);
        pipelines.clear();
        pipelines.resize(pass.pipelines.len(), None);
        let mut planning = Planning {
            pass,
            limit,
            ranges,
            in_table: usize::from(slots.is_shared()),
            slots,
            plan: std::mem::take(&mut spare.plan),
            spare,
            open: None,
        };
        for (number, draw) in pass.draws.iter().enumerate() {
            let info = match pipelines[draw.pipeline] {
                Some(info) => info,
                None => {
                    let pipeline = &pass.pipelines[draw.pipeline];
                    let facts =
                        self.facts.get(pipeline, || Ok::<_, Error>(Facts::new(pipeline)))?;
                    let info = planning.pipeline_info(facts, draw);
                    *pipelines[draw.pipeline].insert(info)
                }
            };
            planning.draw(number as u32, draw, info)?;
        }
        planning.close();
        let Planning { plan, spare, .. } = planning;
        self.spare = Spare { pipelines, ..spare };
        Ok(plan)
    }

    /// Takes the memory of a plan that nobody needs any more.
    pub fn recycle(&mut self, mut plan: Plan) {
        for mut batch in plan.batches.drain(..) {
            batch.vertex_work.clear();
            batch.fragment_kernels.clear();
            self.spare.work.push(batch.vertex_work);
            self.spare.kernels.push(batch.fragment_kernels);
        }
        plan.pieces.clear();
        plan.piece_draws.clear();
        plan.attributes.clear();
        plan.runs.clear();
        plan.resource_slots.clear();
        plan.vertex_kernels.clear();
        plan.fragment_kernels.clear();
        self.spare.plan = plan;
    }
}

/// A plan that is being made.
struct Planning<'a> {
    pass: &'a Pass,
    limit: Capacities,
    ranges: &'a mut IndexRanges,
    slots: &'a mut dyn Slots,
    plan: Plan,
    spare: Spare,
    open: Option<OpenBatch>,
    /// Draws that have slots in the table that `slots` fills; those of another pass count as one.
    in_table: usize,
}

impl Planning<'_> {
    fn pipeline_info(&mut self, facts: &Facts, draw: &Draw) -> PipelineInfo {
        let (plan, numbers) = (&mut self.plan, &mut self.spare.numbers);
        let Facts { vertex, fragment, varying_stride } = facts;
        let vertex_kernel = number_of(&mut plan.vertex_kernels, &mut numbers.vertex, vertex);
        let fragment_kernel =
            number_of(&mut plan.fragment_kernels, &mut numbers.fragment, fragment);
        let pipeline = &self.pass.pipelines[draw.pipeline];
        PipelineInfo {
            method: method(pipeline, TargetKinds::of(self.pass), fragment_kernel),
            vertex_kernel,
            fragment_kernel,
            varying_stride: *varying_stride,
            distances: !pipeline.vertex.reflection.distances.is_empty(),
        }
    }

    /// Ends the open batch: gives its pieces their vertex slots. The pieces of one kernel come together.
    fn close(&mut self) {
        let Some(mut open) = self.open.take() else { return };
        let mut order = std::mem::take(&mut self.spare.order);
        order.clear();
        order.extend(0..open.vertex_needs.len());
        // By number within a kernel, as a stable sort would leave them, which takes memory.
        order.sort_unstable_by_key(|&i| (open.vertex_needs[i].0, i));
        let (mut slot, mut word) = open.kept;
        let mut vertex_work = self.spare.work.pop().unwrap_or_default();
        for &i in &order {
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
            adjusted: open.adjusted,
            distances: open.distances,
            primitives: open.primitives,
            piece_first: open.piece_first,
            piece_count: self.plan.pieces.len() as u32 - open.piece_first,
            vertices: open.vertices,
            varying_words: open.varying_words,
            vertex_work,
            fragment_kernels: std::mem::take(&mut open.fragment_kernels),
            table: self.slots.table(),
            commands: None,
        });
        open.vertex_needs.clear();
        self.spare.open.push(open);
        self.spare.order = order;
    }

    /// The open batch for `info`; a new one if the open one has another method or is full.
    fn batch(&mut self, info: PipelineInfo) -> &mut OpenBatch {
        let fits = self.open.as_ref().is_some_and(|open| {
            open.method == info.method
                && open.distances == info.distances
                && open.primitives < self.limit.primitives_of(info.distances)
                && (open.fragment_kernels.contains(&info.fragment_kernel)
                    || open.fragment_kernels.len() < abi::MAX_FRAGMENT_KERNELS as usize)
        });
        if !fits {
            self.close();
        }
        let piece_first = self.plan.pieces.len() as u32;
        if self.open.is_none() {
            self.open_batch(info, piece_first, (0, 0));
        }
        self.open.as_mut().expect("it was opened")
    }

    fn open_batch(&mut self, info: PipelineInfo, piece_first: u32, kept: (u32, u32)) {
        let vertex_needs = self.spare.open.pop().map_or_else(Vec::new, |open| open.vertex_needs);
        let fragment_kernels = self.spare.kernels.pop().unwrap_or_default();
        self.open = Some(OpenBatch {
            method: info.method,
            adjusted: false,
            distances: info.distances,
            piece_first,
            primitives: 0,
            vertices: kept.0,
            varying_words: kept.1,
            kept,
            vertex_needs,
            fragment_kernels,
        });
    }

    /// Opens a batch in which the first `slots` vertex slots of the one before stay in place.
    fn keep(&mut self, info: PipelineInfo, slots: u32) {
        let kept = (slots, slots * info.varying_stride);
        self.open_batch(info, self.plan.pieces.len() as u32, kept);
    }

    /// Lists the numbers that a shader's kernel gets for a draw, in the order of [`Shader::last_element`]. Returns
    /// where they start.
    fn resources(&mut self, shader: &Shader, draw: &Draw) -> Result<u32> {
        let arrays = &shader.details.arrays;
        let base = self.plan.resource_slots.len();
        // Elements of each resource, if there are arrays at all.
        let mut bound = std::mem::take(&mut self.spare.bound);
        bound.clear();
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
            self.plan.resource_slots.push(self.slots.bindings(set, entry, resource.bytes)?);
            if !arrays.is_empty() {
                // More may be bound than the shader declares.
                let declared = if resource.count == 0 { u32::MAX } else { resource.count };
                bound.push(declared.min(entry.resources.len() as u32));
            }
        }
        if shader.reflection.push_constant_bytes > 0 {
            self.plan.resource_slots.push(self.slots.push_constants(&draw.push_constants)?);
        }
        let last = |array: &ResourceArray| bound[array.number as usize].saturating_sub(1);
        self.plan.resource_slots.extend(arrays.iter().map(last));
        self.spare.bound = bound;
        Ok(without_repetition(&mut self.plan.resource_slots, base))
    }
}

/// Where the part of `list` from `base` on begins. Draws that follow each other often bind the same, so it is taken off
/// again where the part before is equal.
fn without_repetition<T: PartialEq>(list: &mut Vec<T>, base: usize) -> u32 {
    let before = base.saturating_sub(list.len() - base);
    if list[before..base] == list[base..] {
        list.truncate(base);
        return before as u32;
    }
    base as u32
}
