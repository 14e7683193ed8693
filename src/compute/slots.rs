//! Puts the resources of a pass into the resource table.

use crate::{
    error::Result,
    pass::{self, Binding},
    plan::Slots,
    vk::{Buffer, Gpu, Memory, ResourceTable, Resources},
};
use std::{collections::HashMap, sync::Arc};

/// Push-constant blocks lie this far apart: the largest alignment a device may ask for.
const PUSH_STRIDE: usize = 256;
/// Push-constant blocks of one buffer.
const PUSH_BLOCKS: usize = 4096;

/// Uploads what the planner asks for and hands out slots.
pub struct TableSlots<'a> {
    gpu: &'a Gpu,
    resources: &'a mut Resources,
    table: &'a mut ResourceTable,
    /// Slots of push-constant blocks by content: draws often share theirs.
    pushed: HashMap<Vec<u8>, u32>,
    /// The push-constant buffer that is being filled, and the blocks in it.
    open: Option<(Buffer<u8>, usize)>,
    /// Vertex and index buffers by slot.
    buffers: HashMap<u32, Arc<pass::Buffer>>,
}

impl<'a> TableSlots<'a> {
    pub fn new(
        gpu: &'a Gpu,
        resources: &'a mut Resources,
        table: &'a mut ResourceTable,
    ) -> TableSlots<'a> {
        TableSlots {
            gpu,
            resources,
            table,
            pushed: HashMap::new(),
            open: None,
            buffers: HashMap::new(),
        }
    }

    /// Vertex and index buffers by slot.
    pub fn into_buffers(self) -> HashMap<u32, Arc<pass::Buffer>> {
        self.buffers
    }

    fn insert(&mut self, binding: &Binding) -> Result<u32> {
        match binding {
            Binding::Uniform(range) | Binding::Storage(range) => {
                let buffer = self.resources.buffer(&range.buffer)?;
                let slice = buffer.slice(range.offset..range.offset + range.bytes)?;
                self.table.insert_buffer(&slice)
            }
            Binding::Sampled(texture, sampler) => {
                let image = self.resources.texture(texture)?;
                let sampler = self.resources.sampler(sampler)?;
                self.table.insert_sampled(&image, &sampler)
            }
            Binding::Texture(texture) => {
                let image = self.resources.texture(texture)?;
                self.table.insert_texture(&image)
            }
            Binding::Sampler(sampler) => {
                let sampler = self.resources.sampler(sampler)?;
                self.table.insert_sampler(&sampler)
            }
        }
    }
}

impl Slots for TableSlots<'_> {
    fn buffer(&mut self, buffer: &Arc<pass::Buffer>) -> Result<u32> {
        let uploaded = self.resources.buffer(buffer)?;
        let slot = self.table.insert_buffer(&uploaded)?;
        self.buffers.insert(slot, buffer.clone());
        Ok(slot)
    }

    fn bindings(&mut self, resources: &[Binding]) -> Result<u32> {
        if let [one] = resources {
            return self.insert(one);
        }
        // The elements of an array follow each other, whatever they share with other variables.
        let mut first = None;
        for resource in resources {
            self.table.forget();
            let slot = self.insert(resource)?;
            first.get_or_insert(slot);
        }
        self.table.forget();
        Ok(first.unwrap_or(0))
    }

    fn push_constants(&mut self, bytes: &[u8]) -> Result<u32> {
        if let Some(&slot) = self.pushed.get(bytes) {
            return Ok(slot);
        }
        let (buffer, used) = match self.open.take() {
            Some((buffer, used)) if used < PUSH_BLOCKS => (buffer, used),
            _ => {
                let bytes = PUSH_STRIDE * PUSH_BLOCKS;
                (Buffer::new(self.gpu, "push constants", bytes, Memory::Upload)?, 0)
            }
        };
        let at = used * PUSH_STRIDE;
        buffer.write(at, bytes)?;
        let slot = self.table.insert_buffer(&buffer.slice(at..at + PUSH_STRIDE)?)?;
        self.pushed.insert(bytes.to_vec(), slot);
        self.open = Some((buffer, used + 1));
        Ok(slot)
    }
}
