//! Draw commands in buffers: whether they are valid, and what they draw.

use super::{
    Draw, IndexedIndirectCommand, Indirect, IndirectCommand, Pass, instance_alone, pipeline_alone,
    validate::Fault,
};
use crate::error::Result;
use std::{borrow::Cow, sync::Arc};

/// Most commands of a draw.
const MOST_DRAWS: u32 = 1 << 20;
/// Most primitives of all commands of a draw: a subgroup of 128 lanes adds so many without an overflow.
const MOST_PRIMITIVES: u32 = 1 << 24;

impl Indirect {
    /// Bytes of a command.
    pub(crate) const fn command_bytes(indexed: bool) -> usize {
        match indexed {
            true => size_of::<IndexedIndirectCommand>(),
            false => size_of::<IndirectCommand>(),
        }
    }

    /// Whether all commands are there. Their ranges lie in their buffers.
    pub(super) fn check(&self, indexed: bool) -> Fault {
        let Self { commands, stride, draws, count, primitives } = self;
        let bytes = Self::command_bytes(indexed);
        for (number, most, what) in [
            (draws, MOST_DRAWS, "commands"),
            (primitives, MOST_PRIMITIVES, "primitives of all commands"),
        ] {
            if *number > most {
                return Err(format!("up to {number} {what}; there are at most {most}"));
            }
        }
        if commands.offset % 4 != 0 || stride % 4 != 0 || (*draws > 1 && (*stride as usize) < bytes)
        {
            let offset = commands.offset;
            return Err(format!(
                "commands from byte {offset} on, {stride} bytes apart; both are multiples of 4, and a command has {bytes}"
            ));
        }
        let last = u64::from(draws.saturating_sub(1)) * u64::from(*stride);
        if last + bytes as u64 > commands.bytes as u64 {
            let (there, label) = (commands.bytes, commands.buffer.label());
            return Err(format!(
                "{draws} commands, {stride} bytes apart, in {there} bytes of buffer `{label}`"
            ));
        }
        match count {
            Some(count) if count.offset % 4 != 0 || count.bytes < 4 => Err(format!(
                "the number of commands in {} bytes from byte {} on of buffer `{}`; it has 4, at a multiple of 4",
                count.bytes,
                count.offset,
                count.buffer.label()
            )),
            _ => Ok(()),
        }
    }
}

impl Pass {
    /// The same pass with a draw for each command that a buffer holds at this moment, as far as `compute` draws them.
    ///
    /// # Errors
    /// As [`super::BufferSource::content`].
    pub(crate) fn with_commands_read(&self) -> Result<Cow<'_, Pass>> {
        if self.draws.iter().all(|draw| draw.indirect.is_none()) {
            return Ok(Cow::Borrowed(self));
        }
        let mut pass = Pass { draws: Vec::new(), ..self.clone() };
        for draw in &self.draws {
            match &draw.indirect {
                Some(indirect) => read(&mut pass, draw, indirect)?,
                None => pass.draws.push(draw.clone()),
            }
        }
        Ok(Cow::Owned(pass))
    }
}

/// Adds to `pass` the draws that the commands of `draw` stand for.
fn read(pass: &mut Pass, draw: &Draw, indirect: &Indirect) -> Result<()> {
    let topology = pass.pipelines[draw.pipeline].topology;
    let count = match &indirect.count {
        Some(range) => {
            let bytes = range.buffer.content()?;
            let number = bytemuck::pod_read_unaligned(&bytes[range.offset..range.offset + 4]);
            indirect.draws.min(number)
        }
        None => indirect.draws,
    };
    let bytes = indirect.commands.buffer.content()?;
    let mut left = indirect.primitives;
    for n in 0..count {
        let at = indirect.commands.offset + n as usize * indirect.stride as usize;
        let command = &bytes[at..at + Indirect::command_bytes(draw.indices.is_some())];
        let one = match &draw.indices {
            Some(indices) => {
                let command: IndexedIndirectCommand = bytemuck::pod_read_unaligned(command);
                let there = indices.range.bytes / indices.format.bytes();
                let end = command.first as usize + command.count as usize;
                Draw {
                    count: if end <= there { command.count } else { 0 },
                    instances: command.instances,
                    first: command.first.min(there as u32),
                    base_vertex: command.base_vertex,
                    first_instance: command.first_instance,
                    indirect: None,
                    ..draw.clone()
                }
            }
            None => {
                let command: IndirectCommand = bytemuck::pod_read_unaligned(command);
                Draw {
                    count: command.count,
                    instances: command.instances,
                    first: command.first,
                    first_instance: command.first_instance,
                    indirect: None,
                    ..draw.clone()
                }
            }
        };
        // The last draw may be cut: first its whole instances, then a part of one.
        let of_one = topology.primitives(one.count);
        let whole = left.checked_div(of_one).unwrap_or(0).min(one.instances);
        let part = if whole < one.instances { (left - whole * of_one).min(of_one) } else { 0 };
        left -= whole * of_one + part;
        pass.draws.push(Draw { instances: whole, ..one.clone() });
        if part > 0 {
            let pipeline = pass.pipelines[draw.pipeline].clone();
            let (last, alone) = (instance_alone(&pipeline, &one, whole), pipeline_alone(&pipeline));
            let mut number = draw.pipeline;
            if !Arc::ptr_eq(&pipeline, &alone) {
                number = pass.pipelines.len();
                pass.pipelines.push(alone);
            }
            pass.draws.push(Draw { count: topology.elements(part), pipeline: number, ..last });
        }
    }
    Ok(())
}
