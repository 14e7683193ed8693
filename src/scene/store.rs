//! Where a scene's vertices and indices lie: a few large buffers that all passes share.
//!
//! One buffer per mesh would mean thousands of device allocations for a CAD file; one buffer for
//! everything would exceed what small devices bind as one storage buffer (lavapipe and SwiftShader:
//! 128 MiB). So blocks are appended to chunks of at most [`CHUNK_BYTES`]; only a block that is
//! larger by itself gets a larger buffer of its own.

use crate::pass::{BufferRange, BufferSource};
use std::sync::Arc;

/// A chunk is closed before it grows beyond this.
const CHUNK_BYTES: usize = 64 << 20;

/// More geometry than this is refused: beyond any device's memory for one scene, and the guard
/// against small files that ask for gigabytes.
const MAX_BYTES: usize = 4 << 30;

/// Alignment of a block: the largest vertex attribute.
const ALIGN: usize = 16;

/// A block in a [`Store`].
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) struct Slice {
    chunk: usize,
    /// First byte in the chunk, a multiple of 16 for whole blocks.
    pub offset: usize,
    /// Bytes.
    pub bytes: usize,
}

impl Slice {
    /// The part from `offset` of `bytes`; the caller has checked that it lies inside.
    pub fn part(self, offset: usize, bytes: usize) -> Self {
        debug_assert!(offset + bytes <= self.bytes);
        Self { chunk: self.chunk, offset: self.offset + offset, bytes }
    }

    /// The range of the finished buffers.
    pub fn range(self, chunks: &[Arc<BufferSource>]) -> BufferRange {
        BufferRange { buffer: chunks[self.chunk].clone(), offset: self.offset, bytes: self.bytes }
    }
}

/// Collects blocks while a scene is loaded.
#[derive(Default)]
pub(super) struct Store {
    chunks: Vec<Vec<u8>>,
    total: usize,
}

impl Store {
    /// Appends `bytes`.
    pub fn push(&mut self, bytes: &[u8]) -> Result<Slice, String> {
        self.total += bytes.len();
        if self.total > MAX_BYTES {
            return Err(format!(
                "the geometry needs more than {} GiB once it is expanded; the limit is there \
                 because a small file can ask for any amount",
                MAX_BYTES >> 30
            ));
        }
        let fits =
            |chunk: &Vec<u8>| chunk.len().next_multiple_of(ALIGN) + bytes.len() <= CHUNK_BYTES;
        if !self.chunks.last().is_some_and(fits) {
            self.chunks.push(Vec::new());
        }
        let index = self.chunks.len() - 1;
        let chunk = &mut self.chunks[index];
        chunk.resize(chunk.len().next_multiple_of(ALIGN), 0);
        let offset = chunk.len();
        chunk.extend_from_slice(bytes);
        Ok(Slice { chunk: index, offset, bytes: bytes.len() })
    }

    /// The buffers.
    pub fn finish(self, label: &str) -> Vec<Arc<BufferSource>> {
        let buffer = |(i, mut bytes): (usize, Vec<u8>)| {
            bytes.shrink_to_fit();
            Arc::new(BufferSource::new(format!("{label} geometry {i}"), bytes))
        };
        self.chunks.into_iter().enumerate().map(buffer).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_aligned_and_chunks_stay_small() {
        let mut store = Store::default();
        let a = store.push(&[1, 2, 3]).unwrap();
        let b = store.push(&[4; 5]).unwrap();
        let large = store.push(&vec![5; CHUNK_BYTES + 1]).unwrap();
        let c = store.push(&[6; 7]).unwrap();
        let chunks = store.finish("test");
        assert_eq!((a.offset, b.offset), (0, 16));
        for (slice, value) in [(b, 4), (large, 5), (c, 6)] {
            let range = slice.range(&chunks);
            assert_eq!(range.offset % ALIGN, 0);
            let bytes = range.host_bytes().expect("a scene lies on the host");
            assert!(bytes.iter().all(|&v| v == value) && bytes.len() == slice.bytes);
        }
        assert_eq!(chunks.len(), 3);
    }
}
