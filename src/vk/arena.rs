//! Memory that the host fills for one frame.

use super::{
    buffer::{Buffer, Memory},
    gpu::Gpu,
};
use crate::error::Result;
use bytemuck::Pod;

/// Bytes of the first block.
const FIRST_BLOCK: usize = 1 << 16;
/// Slices begin at multiples of this: the largest alignment that a device asks for.
const ALIGNMENT: usize = 256;

/// Blocks of memory that the host writes and kernels read, given out from the front.
pub(crate) struct Arena {
    gpu: Gpu,
    blocks: Vec<Buffer<u8>>,
    /// Bytes of the last block that are given out.
    used: usize,
}

impl Arena {
    /// An arena without memory.
    pub fn new(gpu: &Gpu) -> Self {
        Self { gpu: gpu.clone(), blocks: Vec::new(), used: 0 }
    }

    /// A slice that holds `content`, or one element of zeros if that is empty: a binding has one at least.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn push<T: Pod>(&mut self, content: &[T]) -> Result<Buffer<T>> {
        let zero = [T::zeroed()];
        let content = if content.is_empty() { &zero } else { content };
        let bytes: &[u8] = bytemuck::cast_slice(content);
        let (block, at) = self.take(bytes.len())?;
        // SAFETY: these bytes were not given out since the last reset, when nobody had a slice of the block. So
        // nobody else knows them.
        unsafe { block.write_out_of_turn(at, bytes)? };
        block.slice(at..at + bytes.len())?.cast()
    }

    /// A slice that holds `content` and zeros up to the next multiple of 256 bytes.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn push_padded(&mut self, content: &[u8]) -> Result<Buffer<u8>> {
        let bytes = content.len().max(1).next_multiple_of(ALIGNMENT);
        let (block, at) = self.take(bytes)?;
        // SAFETY: as in `push`.
        unsafe {
            block.write_out_of_turn(at, content)?;
            let mut zeros = at + content.len()..at + bytes;
            while !zeros.is_empty() {
                let part = &[0; ALIGNMENT][..zeros.len().min(ALIGNMENT)];
                block.write_out_of_turn(zeros.start, part)?;
                zeros.start += part.len();
            }
        }
        block.slice(at..at + bytes)
    }

    /// A block, and where it has `bytes` that were not given out.
    fn take(&mut self, bytes: usize) -> Result<(Buffer<u8>, usize)> {
        let block = match self.blocks.last().filter(|block| self.used + bytes <= block.len()) {
            Some(block) => block.clone(),
            None => {
                let all: usize = self.blocks.iter().map(Buffer::len).sum();
                // As much as all before, so that there are few; less where the device has not so much.
                self.next_block(bytes.max(all).max(FIRST_BLOCK))
                    .or_else(|_| self.next_block(bytes))?
            }
        };
        let at = self.used;
        self.used = (at + bytes).next_multiple_of(ALIGNMENT);
        Ok((block, at))
    }

    /// Takes all slices back. Blocks of which somebody still has a slice are left to them. If there are several blocks,
    /// one that has room for as much takes their place, if the device has it.
    pub fn reset(&mut self) {
        self.used = 0;
        let several = self.blocks.len() > 1;
        let all = self.blocks.iter().map(Buffer::len).sum();
        self.blocks.retain_mut(|block| !several && block.is_unique());
        if several {
            // Without it, the next slice begins a block of its own.
            let _ = self.next_block(all);
        }
    }

    fn next_block(&mut self, bytes: usize) -> Result<Buffer<u8>> {
        let block = Buffer::new(&self.gpu, "data of a frame", bytes, Memory::Mapped)?;
        self.blocks.push(block.clone());
        self.used = 0;
        Ok(block)
    }
}
