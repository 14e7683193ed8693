//! Cuts one draw into pieces.

use super::{PipelineInfo, Planning, facts::is_colorless, without_repetition};
use crate::{
    abi::{self, Attribute, Piece},
    error::{Error, Result},
    format::{Format, Numeric},
    pass::{Draw, Pass, Pipeline, StepRate, VertexAttribute},
    samples::Samples,
    shader::Distances,
    state::{
        BlendEquation, ColorState, Compare, DepthState, LogicOp, PrimitiveKind, ProvokingVertex,
        Topology,
    },
    stencil::StencilFace,
};
use std::ops::Range;

impl Planning<'_> {
    /// Cuts `draw`, the pass's number `number`, into pieces of the open batch and of as many more as it takes.
    pub(super) fn draw(&mut self, number: u32, draw: &Draw, info: PipelineInfo) -> Result<()> {
        let pipeline = self.pass.pipelines[draw.pipeline].clone();
        if let Some(indirect) = &draw.indirect {
            return self.indirect((number, draw, indirect), &pipeline, info);
        }
        let per_instance = pipeline.topology.primitives(draw.count);
        let total = u64::from(per_instance) * u64::from(draw.instances);
        if total == 0 {
            return Ok(());
        }
        let total = u32::try_from(total).map_err(|_| {
            Error::Usage(format!(
                "a draw of {per_instance} primitives and {} instances has more than 2^32 primitives",
                draw.instances
            ))
        })?;
        let template = self.in_a_table(|planning| planning.template(draw, &pipeline, info))?;
        let Some(template) = template else { return Ok(()) };
        let shared = self.shared(draw, &pipeline, template, total, info)?;
        let most_words = match shared {
            Some(_) => self.limit.shared_varying_words(),
            None => u64::from(self.limit.varying_words),
        };
        let mut next = 0;
        while next < total {
            let limit = self.limit;
            if let Some((_, slots)) = shared.filter(|_| next > 0 && self.open.is_none()) {
                self.keep(info, slots);
            }
            let room = self.limit.primitives_of(info.distances) - self.batch(info).primitives;
            let mut take = room.min(total - next);
            let (piece, slots) = loop {
                let (piece, slots) = match shared {
                    Some((piece, _)) if next > 0 => {
                        break (Piece { first_in_draw: next, ..piece }, None);
                    }
                    Some(whole) => whole,
                    None => self.piece(draw, &pipeline, template, next..next + take)?,
                };
                let words = u64::from(slots) * u64::from(info.varying_stride);
                let open = self.batch(info);
                let fits = u64::from(open.vertices) + u64::from(slots) <= u64::from(limit.vertices)
                    && u64::from(open.varying_words) + words <= most_words;
                if fits {
                    break (piece, Some(slots));
                }
                if open.primitives > 0 {
                    self.close();
                } else if take > 1 {
                    take = take.div_ceil(2);
                } else {
                    return Err(Error::Capacity {
                        what: format!(
                            "the varyings of one primitive of pipeline `{}`",
                            pipeline.label
                        ),
                        wanted: words * 4,
                        limit_of: "a batch".into(),
                        limit: u64::from(limit.varying_words) * 4,
                        advice: "allow more memory or use fewer varyings".into(),
                    });
                }
            };
            let open = self.batch(info);
            let kernel = open.fragment_kernels.iter().position(|&k| k == info.fragment_kernel);
            let kernel = kernel.unwrap_or_else(|| {
                open.fragment_kernels.push(info.fragment_kernel);
                open.fragment_kernels.len() - 1
            });
            let piece =
                Piece { first_primitive: open.primitives, fragment_kernel: kernel as u32, ..piece };
            open.adjusted |= pipeline.adjusts_depth(draw);
            open.primitives += take;
            open.vertices += slots.unwrap_or(0);
            open.varying_words += slots.unwrap_or(0) * info.varying_stride;
            open.vertex_needs.push((info.vertex_kernel, slots));
            self.plan.pieces.push(piece);
            self.plan.piece_draws.push(number);
            next += take;
            if shared.is_some() && next < total {
                self.close();
            }
        }
        Ok(())
    }

    /// What `bind` returns, in another table if this one is full.
    pub(super) fn in_a_table<T>(&mut self, bind: impl Fn(&mut Self) -> Result<T>) -> Result<T> {
        let bound = match bind(self) {
            Err(Error::Full(_)) if self.in_table > 0 && self.slots.is_full() => {
                self.close();
                self.slots.next_table()?;
                self.in_table = 0;
                bind(self)?
            }
            bound => bound?,
        };
        self.in_table += 1;
        Ok(bound)
    }

    /// The piece and the vertex slots of a whole draw, if the draw needs several batches and its vertices fit
    /// one. Then a new batch is begun, which shades all vertices, and they stay in place for the following
    /// batches. The indices of scanned meshes jump about, so that otherwise each batch would shade most of the
    /// vertices again.
    fn shared(
        &mut self,
        draw: &Draw,
        pipeline: &Pipeline,
        template: Piece,
        total: u32,
        info: PipelineInfo,
    ) -> Result<Option<(Piece, u32)>> {
        let limit = self.limit;
        if total <= limit.primitives_of(info.distances) {
            return Ok(None);
        }
        let (piece, slots) = self.piece(draw, pipeline, template, 0..total)?;
        let words = u64::from(slots) * u64::from(info.varying_stride);
        let fits = slots <= limit.vertices && words <= limit.shared_varying_words();
        if piece.vertex_mode != abi::VERTEX_RANGED || !fits {
            return Ok(None);
        }
        self.close();
        Ok(Some((piece, slots)))
    }

    /// What all pieces of a draw have in common; `None` if viewport and scissor leave no pixel.
    pub(super) fn template(
        &mut self,
        draw: &Draw,
        pipeline: &Pipeline,
        info: PipelineInfo,
    ) -> Result<Option<Piece>> {
        let extent = self.pass.extent;
        let (viewport, scissor) = (draw.viewport_in(extent), draw.scissor_in(extent));
        let several = self.pass.samples != Samples::One;
        let (left, right) = pixel_span(several, viewport.x, viewport.width);
        let (top, bottom) = pixel_span(several, viewport.y, viewport.height);
        let last = |start: u32, length: u32, limit: u32| {
            (u64::from(start) + u64::from(length)).min(u64::from(limit)) as i32 - 1
        };
        let rect_min = [left.max(scissor.x as i32), top.max(scissor.y as i32)];
        let rect_max = [
            right.min(last(scissor.x, scissor.width, extent.width)),
            bottom.min(last(scissor.y, scissor.height, extent.height)),
        ];
        if rect_min[0] > rect_max[0] || rect_min[1] > rect_max[1] {
            return Ok(None);
        }
        let full = [extent.width as i32 - 1, extent.height as i32 - 1];
        let scale = [viewport.width / 2.0, viewport.height / 2.0];
        let offset = [viewport.x + scale[0], viewport.y + scale[1]];
        let (index_slot, index_bytes, first_element) = match &draw.indices {
            Some(indices) => {
                let bytes = indices.format.bytes();
                let skipped = (indices.range.offset / bytes) as u32;
                (self.slots.buffer(&indices.range.buffer)?, bytes as u32, skipped + draw.first)
            }
            None => (abi::NONE, 0, draw.first),
        };
        Ok(Some(Piece {
            primitives_per_instance: pipeline.topology.primitives(draw.count),
            topology: pipeline.topology as u32,
            index_slot,
            index_bytes,
            first_element,
            base_vertex: if draw.indices.is_some() { draw.base_vertex } else { 0 },
            first_instance: draw.first_instance,
            varying_stride: info.varying_stride,
            attribute_base: self.attributes(draw, pipeline)?,
            vertex_resources: self.resources(&pipeline.vertex, draw)?,
            fragment_resources: self.resources(&pipeline.fragment, draw)?,
            cull: pipeline.cull as u32,
            front_face: pipeline.front_face as u32,
            scale,
            offset,
            depth_scale: viewport.max_depth - viewport.min_depth,
            depth_offset: viewport.min_depth,
            rect_min,
            rect_max,
            cut: u32::from(rect_min != [0, 0] || rect_max != full),
            fragment_state: depth_state(&pipeline.depth, self.pass.depth.is_some())
                | if pipeline.adjusts_depth(draw) { abi::DEPTH_STATE_ADJUSTED } else { 0 }
                | if pipeline.clips_depth() { 0 } else { abi::DEPTH_STATE_UNCLIPPED }
                | sample_state(pipeline)
                | match is_colorless(pipeline, self.pass.colors.len()) {
                    true => abi::FRAGMENT_STATE_COLORLESS,
                    false => 0,
                }
                | match pipeline.provoking_vertex {
                    ProvokingVertex::First => 0,
                    ProvokingVertex::Last => abi::FRAGMENT_STATE_PROVOKED_LAST,
                },
            depth_bias: draw
                .depth_bias
                .filter(|_| pipeline.topology.kind() == PrimitiveKind::Triangle)
                .map_or([0.0; 3], |bias| [bias.constant, bias.slope, bias.clamp]),
            color_states: std::array::from_fn(|target| {
                let format = self.pass.colors.get(target).map(|color| color.format);
                let logic = pipeline.logic_op.filter(|_| format.is_some_and(takes_logic));
                color_state(pipeline.color_state(target), (pipeline.logic_op.is_some(), logic))
            }),
            depth_bounds: draw.depth_bounds,
            depth_limits: match pipeline.depth_clamp {
                true => viewport.depths(),
                false => [0.0, 1.0],
            },
            blend_constants: draw.blend_constants,
            stencil: stencil_states(self.pass, pipeline, draw),
            line_width: pipeline.line_width,
            line_mode: pipeline.line_mode as u32,
            distances: {
                let Distances { clip, cull } = pipeline.vertex.reflection.distances;
                clip | cull << abi::CULL_DISTANCES_SHIFT
            },
            ..Piece::default()
        }))
    }

    /// One entry for each location the vertex shader might read, in order.
    fn attributes(&mut self, draw: &Draw, pipeline: &Pipeline) -> Result<u32> {
        let locations = pipeline.vertex.reflection.inputs.iter().map(|v| v.location + 1).max();
        let base = self.plan.attributes.len();
        for location in 0..locations.unwrap_or(0) {
            let attribute = pipeline.vertex_attributes.iter().find(|a| a.location == location);
            let Some(attribute) = attribute else {
                let none = Attribute { slot: abi::NONE, ..Attribute::default() };
                self.plan.attributes.push(none);
                continue;
            };
            let binding = pipeline.vertex_bindings[attribute.binding as usize];
            let range = &draw.vertex_buffers[attribute.binding as usize];
            self.plan.attributes.push(Attribute {
                slot: self.slots.buffer(&range.buffer)?,
                offset: range.offset as u32 + attribute.offset,
                stride: match binding.rate {
                    StepRate::Vertex | StepRate::Instance => binding.stride,
                    StepRate::Instances(n) => binding.stride | n << abi::ATTRIBUTE_DIVISOR_SHIFT,
                },
                last: last_element(range.bytes, attribute, binding.stride),
            });
        }
        Ok(without_repetition(&mut self.plan.attributes, base))
    }

    /// The piece of `primitives` (counted through the draw's instances) and its vertex slots, those
    /// included that fill up its last quad.
    fn piece(
        &mut self,
        draw: &Draw,
        pipeline: &Pipeline,
        template: Piece,
        primitives: Range<u32>,
    ) -> Result<(Piece, u32)> {
        let per_instance = template.primitives_per_instance;
        let (first, last) = (primitives.start / per_instance, (primitives.end - 1) / per_instance);
        let within = if first == last {
            primitives.start - first * per_instance..primitives.end - first * per_instance
        } else {
            0..per_instance
        };
        let count = primitives.end - primitives.start;
        let per_corner = pipeline.topology.kind() as u64 * u64::from(count);
        let piece = Piece { first_in_draw: primitives.start, ..template };
        // Vertex slots of a range of vertices, for each instance.
        let ranged = self.vertex_range(draw, pipeline.topology, within).map(|(low, high)| {
            let span = u64::from(high - low) + 1;
            (low, span, span * (u64::from(last - first) + 1))
        });
        let (piece, slots) = match ranged {
            Some((low, span, slots)) if slots <= per_corner.min(u64::from(u32::MAX)) => {
                let piece = Piece {
                    vertex_mode: abi::VERTEX_RANGED,
                    vertex_min: low,
                    vertices_per_instance: span as u32,
                    instance_min: first,
                    ..piece
                };
                (piece, slots)
            }
            _ => (Piece { vertex_mode: abi::VERTEX_PER_CORNER, ..piece }, per_corner),
        };
        // So many slots never fit a batch.
        let whole = |slots: u64| u32::try_from(slots).unwrap_or(u32::MAX);
        let piece = Piece { vertex_slots: whole(slots), ..piece };
        Ok((piece, whole(slots.next_multiple_of(u64::from(abi::QUAD)))))
    }

    /// Smallest and largest vertex of the primitives `within` one instance, before the base vertex is added; `None`
    /// if only the device can know them.
    fn vertex_range(
        &mut self,
        draw: &Draw,
        topology: Topology,
        within: Range<u32>,
    ) -> Option<(u32, u32)> {
        let elements = match topology {
            Topology::PointList => within,
            Topology::LineList => 2 * within.start..2 * within.end,
            Topology::LineStrip => within.start..within.end + 1,
            Topology::TriangleList => 3 * within.start..3 * within.end,
            Topology::TriangleStrip => within.start..within.end + 2,
            Topology::TriangleFan => within.start + 1..within.end + 2,
            Topology::LineListWithAdjacency => 4 * within.start..4 * within.end,
            Topology::LineStripWithAdjacency => within.start + 1..within.end + 2,
            Topology::TriangleListWithAdjacency => 6 * within.start..6 * within.end,
            Topology::TriangleStripWithAdjacency => 2 * within.start..2 * within.end + 3,
        };
        let mut of = |elements: Range<u32>| match &draw.indices {
            Some(indices) => {
                let element = |element| u64::from(draw.first) + u64::from(element);
                self.ranges.of(indices, element(elements.start)..element(elements.end))
            }
            // The last vertex may be the last there is: its number plus 1 has no room.
            None => Some((draw.first + elements.start, draw.first + (elements.end - 1))),
        };
        let (low, high) = of(elements)?;
        if topology == Topology::TriangleFan {
            let (hub, _) = of(0..1)?;
            return Some((low.min(hub), high.max(hub)));
        }
        Some((low, high))
    }
}

/// The part of [`Piece::fragment_state`] that concerns samples.
fn sample_state(pipeline: &Pipeline) -> u32 {
    let covers = if pipeline.alpha_to_coverage { abi::SAMPLE_STATE_ALPHA_COVERS } else { 0 };
    let one = if pipeline.alpha_to_one { abi::SAMPLE_STATE_ALPHA_ONE } else { 0 };
    covers | one | pipeline.sample_mask << abi::SAMPLE_STATE_MASK_SHIFT
}

/// What is [`Piece::stencil`].
fn stencil_states(pass: &Pass, pipeline: &Pipeline, draw: &Draw) -> [[u32; 2]; 2] {
    let of_face = |face: StencilFace, reference: u8| {
        let test = face.compare as u32
            | (face.fail as u32) << abi::STENCIL_FAIL_SHIFT
            | (face.depth_fail as u32) << abi::STENCIL_DEPTH_FAIL_SHIFT
            | (face.pass as u32) << abi::STENCIL_PASS_SHIFT;
        let values = u32::from(reference)
            | u32::from(face.compare_mask) << abi::STENCIL_COMPARE_MASK_SHIFT
            | u32::from(face.write_mask) << abi::STENCIL_WRITE_MASK_SHIFT;
        [test, values]
    };
    let [front, back] = draw.stencil_reference;
    match pipeline.stencil.filter(|_| pass.stencil.is_some()) {
        Some(stencil) => [of_face(stencil.front, front), of_face(stencil.back, back)],
        None => [[Compare::Always as u32, 0]; 2],
    }
}

/// The part of it that concerns depth.
fn depth_state(depth: &DepthState, has_target: bool) -> u32 {
    let test = depth.test && has_target;
    let compare = (depth.compare as u32) << abi::DEPTH_STATE_COMPARE_SHIFT;
    let write = if test && depth.write { abi::DEPTH_STATE_WRITE } else { 0 };
    let bounds = if depth.bounds && has_target { abi::DEPTH_STATE_BOUNDS } else { 0 };
    compare | write | bounds | if test { abi::DEPTH_STATE_TEST } else { 0 }
}

/// Whether logic operations are applied to targets of `format`. All others are overwritten.
fn takes_logic(format: Format) -> bool {
    match format.numeric() {
        Numeric::Unorm | Numeric::Snorm | Numeric::Uint | Numeric::Sint => true,
        Numeric::Srgb | Numeric::Float | Numeric::Depth | Numeric::Stencil => false,
        Numeric::Uscaled | Numeric::Sscaled => false,
    }
}

/// One of [`Piece::color_states`], with a logic operation that the target takes. Where a pipeline has one, no target is blended.
fn color_state(state: ColorState, (has_logic, logic): (bool, Option<LogicOp>)) -> u32 {
    let equation = |e: BlendEquation| {
        e.src as u32
            | (e.dst as u32) << abi::BLEND_TARGET_SHIFT
            | (e.op as u32) << abi::BLEND_OP_SHIFT
    };
    let channels = state.write.iter().rev().fold(0, |mask, &on| mask << 1 | u32::from(on));
    let blend = state.blend.filter(|_| !has_logic).map_or(0, |blend| {
        let constants = if blend.has_constants() { abi::COLOR_CONSTANTS } else { 0 };
        let equations = equation(blend.color) | equation(blend.alpha) << abi::COLOR_ALPHA_SHIFT;
        equations | constants | abi::COLOR_BLENDS
    });
    let logic = logic.map_or(0, |op| op as u32 | abi::COLOR_LOGIC);
    blend | logic | channels << abi::COLOR_MASK_SHIFT
}

/// The last element of a range of `bytes` that `attribute` can read, at least one by validation.
fn last_element(bytes: usize, attribute: &VertexAttribute, stride: u32) -> u32 {
    let of_one = attribute.offset as usize + attribute.format.bytes();
    let last = bytes.saturating_sub(of_one).checked_div(stride as usize);
    last.map_or(u32::MAX, |last| u32::try_from(last).unwrap_or(u32::MAX))
}

/// First and last pixel whose centre lies in `start..start + length`; those that have a part there, if pixels have several
/// samples.
fn pixel_span(several: bool, start: f32, length: f32) -> (i32, i32) {
    let (low, high) = if length < 0.0 { (start + length, start) } else { (start, start + length) };
    match several {
        true => (low.floor().max(0.0) as i32, high.ceil() as i32 - 1),
        false => ((low - 0.5).ceil().max(0.0) as i32, (high - 0.5).ceil() as i32 - 1),
    }
}
