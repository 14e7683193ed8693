//! Puts the resources of a pass into resource tables.

use crate::{
    abi,
    error::{Error, Result},
    pass::{self, Binding},
    plan::Slots,
    vk::{Buffer, Gpu, Memory, ResourceTable, Resources},
};
use std::{collections::HashMap, sync::Arc};

/// Push-constant blocks begin at multiples of this: the largest alignment a device may ask for.
const PUSH_ALIGNMENT: usize = 256;
/// Bytes of a buffer of push-constant blocks, if one block is not more.
const PUSH_BYTES: usize = 1 << 20;

/// Uploads what the planner asks for and hands out slots.
pub struct TableSlots<'a> {
    gpu: &'a Gpu,
    resources: &'a mut Resources,
    tables: Tables,
    /// Slots of push-constant blocks by content: draws often share theirs.
    pushed: HashMap<Vec<u8>, u32>,
    /// The push-constant buffer that is being filled, and the bytes that are.
    open: Option<(Buffer<u8>, usize)>,
    /// First slots of buffers that have several.
    long: HashMap<*const pass::Buffer, u32>,
}

/// The resource tables of a pass: one, unless it binds more than that has room for.
pub struct Tables {
    /// In the order of [`crate::plan::BatchPlan::table`].
    pub tables: Vec<ResourceTable>,
    /// For each of them its vertex and index buffers by slot.
    pub buffers: Vec<HashMap<u32, Arc<pass::Buffer>>>,
}

impl<'a> TableSlots<'a> {
    pub fn new(gpu: &'a Gpu, resources: &'a mut Resources) -> Result<TableSlots<'a>> {
        let mut slots = TableSlots {
            gpu,
            resources,
            tables: Tables { tables: Vec::new(), buffers: Vec::new() },
            pushed: HashMap::new(),
            open: None,
            long: HashMap::new(),
        };
        slots.next_table()?;
        Ok(slots)
    }

    /// What was filled.
    pub fn into_tables(self) -> Tables {
        self.tables
    }

    /// The table that is being filled.
    fn table(&mut self) -> &mut ResourceTable {
        self.tables.tables.last_mut().expect("there is always one")
    }

    /// The first of the slots that `insert` takes for `0..count`. They follow each other, whatever is
    /// in the table already.
    fn consecutive(
        &mut self,
        count: usize,
        mut insert: impl FnMut(&mut Self, usize) -> Result<u32>,
    ) -> Result<u32> {
        let mut first = None;
        for n in 0..count {
            self.table().forget();
            let slot = insert(self, n)?;
            first.get_or_insert(slot);
        }
        self.table().forget();
        Ok(first.unwrap_or(0))
    }

    /// The slot of a resource; `block` is the bytes of the block that it is, if it is one.
    fn insert(&mut self, binding: &Binding, block: u32) -> Result<u32> {
        match binding {
            Binding::Uniform(range) => {
                let block = self.resources.block(range, block as usize)?;
                self.table().insert_buffer(&block)
            }
            Binding::Storage(range) => {
                let buffer = self.resources.buffer(&range.buffer)?;
                let slice = buffer.slice(range.offset..range.offset + range.bytes)?;
                self.table().insert_buffer(&slice)
            }
            Binding::Sampled(texture, sampler) => {
                let image = self.resources.texture(texture)?;
                let sampler = self.resources.sampler(sampler)?;
                self.table().insert_sampled(&image, &sampler)
            }
            Binding::Texture(texture) => {
                let image = self.resources.texture(texture)?;
                self.table().insert_texture(&image)
            }
            Binding::Sampler(sampler) => {
                let sampler = self.resources.sampler(sampler)?;
                self.table().insert_sampler(&sampler)
            }
        }
    }
}

impl Slots for TableSlots<'_> {
    fn buffer(&mut self, buffer: &Arc<pass::Buffer>) -> Result<u32> {
        let (uploaded, window) = (self.resources.buffer(buffer)?, 1 << abi::WINDOW_LOG2);
        if uploaded.bytes() > u64::from(u32::MAX) {
            return Err(Error::Capacity {
                what: format!("buffer `{}`", buffer.label),
                wanted: uploaded.bytes(),
                limit_of: "vertices and indices".into(),
                limit: u32::MAX.into(),
                advice: "spread them over several buffers and draws".into(),
            });
        }
        let slot = if uploaded.len() <= window {
            self.table().insert_buffer(&uploaded)?
        } else if let Some(&first) = self.long.get(&Arc::as_ptr(buffer)) {
            return Ok(first);
        } else {
            let windows = uploaded.len().div_ceil(window);
            let first = self.consecutive(windows, |slots, n| {
                let end = uploaded.len().min((n + 1) * window + abi::WINDOW_OVERLAP as usize);
                slots.table().insert_buffer(&uploaded.slice(n * window..end)?)
            })?;
            self.long.insert(Arc::as_ptr(buffer), first);
            first
        };
        if let Some(buffers) = self.tables.buffers.last_mut() {
            buffers.insert(slot, buffer.clone());
        }
        Ok(slot)
    }

    fn bindings(&mut self, resources: &[Binding], block: u32) -> Result<u32> {
        if let [one] = resources {
            return self.insert(one, block);
        }
        self.consecutive(resources.len(), |slots, n| slots.insert(&resources[n], block))
    }

    fn push_constants(&mut self, bytes: &[u8]) -> Result<u32> {
        if let Some(&slot) = self.pushed.get(bytes) {
            return Ok(slot);
        }
        let stride = bytes.len().next_multiple_of(PUSH_ALIGNMENT);
        if self.open.as_ref().is_none_or(|(buffer, used)| used + stride > buffer.len()) {
            let length = PUSH_BYTES.max(stride);
            self.open = Some((Buffer::new(self.gpu, "push constants", length, Memory::Upload)?, 0));
        }
        let Some((buffer, used)) = &mut self.open else { unreachable!("it was opened") };
        buffer.write(*used, bytes)?;
        let block = buffer.slice(*used..*used + stride)?;
        *used += stride;
        let slot = self.table().insert_buffer(&block)?;
        self.pushed.insert(bytes.to_vec(), slot);
        Ok(slot)
    }

    fn is_full(&self) -> bool {
        self.tables.tables.last().is_some_and(ResourceTable::is_full)
    }

    fn next_table(&mut self) -> Result<()> {
        self.tables.tables.push(ResourceTable::new(self.gpu)?);
        self.tables.buffers.push(HashMap::new());
        self.pushed.clear();
        self.long.clear();
        Ok(())
    }
}
