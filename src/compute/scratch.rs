//! Memory of the device that a pass needs while it runs, and nobody afterwards.

use crate::{
    error::Result,
    vk::{Buffer, Gpu, Memory},
};
use bytemuck::Pod;
use std::collections::HashMap;

/// Buffers by name. They grow to what the largest pass needs. Passes use them in turns: barriers order all that a
/// device runs, and each pass writes what it reads.
#[derive(Default)]
pub struct Scratch {
    buffers: HashMap<&'static str, Buffer<u8>>,
}

impl Scratch {
    /// `len` elements of the buffer `name`, at least one. What was in it may be gone.
    ///
    /// # Errors
    /// [`crate::Error::Capacity`] without memory for it.
    pub fn get<T: Pod>(&mut self, gpu: &Gpu, name: &'static str, len: usize) -> Result<Buffer<T>> {
        let bytes = len.max(1) * size_of::<T>();
        let whole = match self.buffers.get(name).filter(|whole| whole.len() >= bytes) {
            Some(whole) => whole.clone(),
            None => {
                // Passes that grow from frame to frame do not get new memory in each of them.
                let grown = self.buffers.remove(name).map_or(0, |old| old.len() / 2 * 3);
                let new = |bytes| Buffer::new(gpu, name, bytes, Memory::Device);
                let new = match grown.next_multiple_of(16) {
                    grown if grown > bytes => new(grown).or_else(|_| new(bytes))?,
                    _ => new(bytes)?,
                };
                self.buffers.insert(name, new.clone());
                new
            }
        };
        whole.slice(0..bytes)?.cast()
    }
}
