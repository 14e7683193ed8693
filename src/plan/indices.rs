//! The range of vertices that a run of elements uses, remembered between frames.

use crate::pass::{IndexFormat, Indices};
use std::{
    collections::HashMap,
    ops::Range,
    sync::{Arc, Weak},
};

/// A run of elements: the buffer's identity, its offset, the first and last element, the width.
type Run = (usize, usize, u32, u32, IndexFormat);
/// Smallest and largest index of a run, as long as the buffer lives: its identity may come again.
type Known = (Weak<crate::pass::Buffer>, (u32, u32));

/// Smallest and largest index of runs of index buffers, each looked up once.
#[derive(Debug, Default)]
pub struct IndexRanges {
    known: HashMap<Run, Known>,
}

/// Index `at` of `indices`.
pub fn index(indices: &Indices, at: u32) -> u32 {
    let bytes = &indices.range.buffer.bytes[indices.range.offset..];
    match indices.format {
        IndexFormat::U16 => {
            let at = at as usize * 2;
            u16::from_le_bytes([bytes[at], bytes[at + 1]]).into()
        }
        IndexFormat::U32 => {
            let at = at as usize * 4;
            u32::from_le_bytes([bytes[at], bytes[at + 1], bytes[at + 2], bytes[at + 3]])
        }
    }
}

impl IndexRanges {
    /// Smallest and largest index among `elements`, which are not empty.
    pub fn of(&mut self, indices: &Indices, elements: Range<u32>) -> (u32, u32) {
        let buffer = &indices.range.buffer;
        let key = (
            Arc::as_ptr(buffer) as usize,
            indices.range.offset,
            elements.start,
            elements.end,
            indices.format,
        );
        // An address may be used again once its buffer is gone, hence the weak reference.
        if let Some((holder, range)) = self.known.get(&key)
            && holder.upgrade().is_some_and(|held| Arc::ptr_eq(&held, buffer))
        {
            return *range;
        }
        let range = elements
            .map(|e| index(indices, e))
            .fold((u32::MAX, 0), |(low, high), i| (low.min(i), high.max(i)));
        if self.known.len() >= 1 << 16 {
            self.known.retain(|_, (holder, _)| holder.strong_count() > 0);
        }
        self.known.insert(key, (Arc::downgrade(buffer), range));
        range
    }
}
