//! The range of vertices that a run of elements uses, remembered between passes.

use super::{BufferSource, IndexFormat, Indices};
use std::{
    collections::HashMap,
    ops::Range,
    sync::{Arc, Weak},
};

/// A run of elements: the buffer's address, its offset, the first and last element, the width.
type Run = (usize, usize, u64, u64, IndexFormat);

/// Smallest and largest index of runs of index buffers, each looked up once.
#[derive(Debug, Default)]
pub struct IndexRanges {
    /// The weak reference keeps the buffer's address from being used for another buffer.
    known: HashMap<Run, (Weak<BufferSource>, (u32, u32))>,
    /// Runs that were known after the last sweep.
    kept: usize,
    /// Runs that all sweeps together have looked at.
    #[cfg(test)]
    swept: usize,
}

/// Runs that are remembered before the first sweep.
const FEW: usize = 1 << 16;

impl IndexRanges {
    /// Smallest and largest index among `elements`, which are not empty and lie in the buffer: those that the
    /// caller declares, or those that the host finds there. `None` if only the device can know.
    pub fn of(&mut self, indices: &Indices, elements: Range<u64>) -> Option<(u32, u32)> {
        let Indices { range, format, vertices } = indices;
        if let Some(declared) = vertices {
            return Some((*declared.start(), *declared.end()));
        }
        let bytes = range.buffer.host_bytes()?;
        let address = Arc::as_ptr(&range.buffer) as usize;
        let key = (address, range.offset, elements.start, elements.end, *format);
        if let Some((_, found)) = self.known.get(&key) {
            return Some(*found);
        }
        self.sweep();
        let first = range.offset + elements.start as usize * format.bytes();
        let end = range.offset + elements.end as usize * format.bytes();
        let found = extent(&bytes[first..end], *format);
        self.known.insert(key, (Arc::downgrade(&range.buffer), found));
        Some(found)
    }

    /// Forgets the runs of buffers that are gone, once there are twice as many runs as the last sweep
    /// left. So a sweep looks at no more than twice the runs that were added since the one before, and
    /// the cost of a run does not depend on how many there are.
    fn sweep(&mut self) {
        if self.known.len() < FEW.max(2 * self.kept) {
            return;
        }
        #[cfg(test)]
        {
            self.swept += self.known.len();
        }
        self.known.retain(|_, (buffer, _)| buffer.strong_count() > 0);
        self.kept = self.known.len();
    }
}

/// Smallest and largest of the indices in `bytes`.
fn extent(bytes: &[u8], format: IndexFormat) -> (u32, u32) {
    let of = |(low, high): (u32, u32), index: u32| (low.min(index), high.max(index));
    let none = (u32::MAX, 0);
    match format {
        IndexFormat::U16 => {
            let (all, _) = bytes.as_chunks::<2>();
            all.iter().map(|&index| u16::from_ne_bytes(index).into()).fold(none, of)
        }
        IndexFormat::U32 => {
            let (all, _) = bytes.as_chunks::<4>();
            all.iter().map(|&index| u32::from_ne_bytes(index)).fold(none, of)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pass::BufferRange;

    fn indices(values: &[u16]) -> Indices {
        let bytes = bytemuck::cast_slice(values).to_vec();
        let buffer = Arc::new(BufferSource::new("indices", bytes));
        Indices::new(BufferRange::whole(&buffer), IndexFormat::U16)
    }

    #[test]
    fn sweeps_look_at_a_run_a_bounded_number_of_times() {
        let one = indices(&[7, 3, 9]);
        let mut ranges = IndexRanges::default();
        for n in 0..10 * FEW {
            // The buffer lives on, so that a sweep finds nothing to forget.
            let holder = Arc::downgrade(&one.range.buffer);
            ranges.known.insert((n, 0, 0, 3, one.format), (holder, (3, 9)));
            ranges.sweep();
        }
        assert_eq!(ranges.known.len(), 10 * FEW);
        assert!(ranges.swept <= 2 * ranges.known.len(), "{} runs were looked at", ranges.swept);
    }

    #[test]
    fn runs_of_buffers_that_are_gone_are_forgotten() {
        let mut ranges = IndexRanges::default();
        for n in 0..3 * FEW {
            let value = (n % 1000) as u16;
            let found = ranges.of(&indices(&[value + 5, value]), 0..2);
            assert_eq!(found, Some((value.into(), u32::from(value) + 5)));
        }
        assert!(ranges.known.len() <= FEW, "{} runs are remembered", ranges.known.len());
    }
}
