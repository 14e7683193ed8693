//! Plans the batches of draw commands that only the device knows.
//!
//! The caller says how many primitives there may be, and as many batches are made as these take. Each primitive has a
//! quad of vertex slots of its own, so that the device finds the slots of a primitive by its number.

use super::{BatchPlan, PipelineInfo, Planning, VertexWork};
use crate::{
    abi::{self, Commands, Piece},
    error::{Error, Result},
    pass::{Draw, Indirect, Pipeline},
};

impl Planning<'_> {
    /// Makes batches for the commands of the draw number `number`.
    pub(super) fn indirect(
        &mut self,
        (number, draw, indirect): (u32, &Draw, &Indirect),
        pipeline: &Pipeline,
        info: PipelineInfo,
    ) -> Result<()> {
        if indirect.draws == 0 || indirect.primitives == 0 {
            return Ok(());
        }
        let (template, slot, count_slot) = self.in_a_table(|planning| {
            let template = planning.template(draw, pipeline, info)?;
            let slot = planning.slots.buffer(&indirect.commands.buffer)?;
            let count = indirect.count.as_ref();
            let count = count.map(|count| planning.slots.buffer(&count.buffer)).transpose()?;
            Ok((template, slot, count.unwrap_or(abi::NONE)))
        })?;
        let Some(template) = template else { return Ok(()) };
        self.close();
        let (limit, stride) = (self.limit, info.varying_stride);
        let of_words = limit.varying_words.checked_div(abi::QUAD * stride).unwrap_or(u32::MAX);
        let most =
            limit.primitives_of(info.distances).min(limit.vertices / abi::QUAD).min(of_words);
        if most == 0 {
            return Err(Error::Capacity {
                what: format!("the varyings of one primitive of pipeline `{}`", pipeline.label),
                wanted: u64::from(abi::QUAD * stride) * 4,
                limit_of: "a batch".into(),
                limit: u64::from(limit.varying_words) * 4,
                advice: "allow more memory or use fewer varyings".into(),
            });
        }
        // The commands say where a draw begins.
        let first_element = template.first_element.wrapping_sub(draw.first);
        let template = Piece {
            first_element,
            fragment_kernel: 0,
            vertex_mode: abi::VERTEX_PER_QUAD,
            ..template
        };
        let elements = draw.indices.as_ref();
        let elements = elements.map(|i| (i.range.bytes / i.format.bytes()) as u32);
        let mut first = 0;
        while first < indirect.primitives {
            let primitives = most.min(indirect.primitives - first);
            let piece_first = self.plan.pieces.len() as u32;
            self.plan.pieces.push(template);
            self.plan.piece_draws.push(number);
            let mut vertex_work = self.spare.work.pop().unwrap_or_default();
            vertex_work.push(VertexWork {
                kernel: info.vertex_kernel,
                run_first: 0,
                run_count: indirect.draws + 1,
                slot_first: 0,
                slot_count: abi::QUAD * primitives,
            });
            let mut fragment_kernels = self.spare.kernels.pop().unwrap_or_default();
            fragment_kernels.push(info.fragment_kernel);
            self.plan.batches.push(BatchPlan {
                method: info.method,
                adjusted: self.pass.pipelines[draw.pipeline].adjusts_depth(draw),
                distances: info.distances,
                primitives,
                piece_first,
                piece_count: 1,
                vertices: abi::QUAD * primitives,
                varying_words: abi::QUAD * primitives * stride,
                vertex_work,
                fragment_kernels,
                table: self.slots.table(),
                commands: Some(Commands {
                    piece: piece_first,
                    slot,
                    byte: indirect.commands.offset as u32,
                    stride: indirect.stride,
                    draws: indirect.draws,
                    count_slot,
                    count_byte: indirect.count.as_ref().map_or(0, |count| count.offset as u32),
                    elements: elements.unwrap_or(abi::NONE),
                    first,
                    primitives,
                    of_group: [0; 2],
                }),
            });
            first += primitives;
        }
        Ok(())
    }
}
