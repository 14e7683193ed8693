//! Puts the resources of a pass into resource tables.

use crate::{
    abi,
    error::{Error, Result},
    kept::KEPT_PASSES,
    pass::{self, Binding, BindingEntry, BindingSet},
    plan::Slots,
    vk::{Buffer, Copies, Gpu, Memory, ResourceTable, Resources},
};
use std::{collections::HashMap, sync::Arc};

/// Push-constant blocks begin at multiples of this: the largest alignment a device may ask for.
const PUSH_ALIGNMENT: usize = 256;
/// Bytes of a buffer of push-constant blocks, if one block is not more.
const PUSH_BYTES: usize = 1 << 20;

/// Resource tables, kept from pass to pass: making a table costs as much as filling it with thousands of
/// resources, however few a pass needs.
///
/// A table is used again once no recording has it bound, and goes by the rule of [`crate::kept`].
pub struct TablePool {
    gpu: Gpu,
    /// With the last pass that used it.
    tables: Vec<(ResourceTable, u64)>,
    pass: u64,
}

impl TablePool {
    pub fn new(gpu: &Gpu) -> Self {
        Self { gpu: gpu.clone(), tables: Vec::new(), pass: 0 }
    }

    /// Begins another pass: empties the tables that no recording has bound, which drops their resources, and
    /// drops tables that are not needed any more.
    pub fn next_pass(&mut self) -> Result<()> {
        self.pass += 1;
        let pass = self.pass;
        self.tables.retain(|(table, used)| table.is_bound() || pass - used <= KEPT_PASSES);
        let free = self.tables.iter_mut().filter(|(table, _)| !table.is_bound());
        free.map(|(table, _)| table).try_for_each(ResourceTable::clear)
    }

    /// An empty table.
    fn take(&mut self) -> Result<ResourceTable> {
        match self.tables.iter().position(|(table, _)| !table.is_bound()) {
            Some(free) => {
                let (mut table, _) = self.tables.swap_remove(free);
                // Another thread may have let go of it since the pass began.
                table.clear()?;
                Ok(table)
            }
            None => ResourceTable::new(&self.gpu),
        }
    }

    /// Takes back the tables of a pass; recordings may have them bound.
    pub fn put_back(&mut self, tables: Vec<ResourceTable>) {
        self.tables.extend(tables.into_iter().map(|table| (table, self.pass)));
    }

    /// Tables that there are.
    pub fn len(&self) -> usize {
        self.tables.len()
    }
}

/// Uploads resources for the planner and hands out their slots.
pub struct TableSlots<'a> {
    gpu: &'a Gpu,
    pool: &'a mut TablePool,
    resources: &'a mut Resources,
    copies: &'a Copies,
    tables: Tables,
    /// Slots of push-constant blocks by content: draws often share theirs.
    pushed: HashMap<Vec<u8>, u32>,
    /// The push-constant buffer that is being filled, and the bytes that are.
    open: Option<(Buffer<u8>, usize)>,
    /// First slots of what sets bind. The pass holds the sets while it is planned, so that an address
    /// stands for one of them.
    bound: HashMap<(*const BindingSet, u32, u32), u32>,
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
    pub fn new(
        gpu: &'a Gpu,
        resources: &'a mut Resources,
        pool: &'a mut TablePool,
        copies: &'a Copies,
    ) -> Result<TableSlots<'a>> {
        let mut slots = TableSlots {
            gpu,
            pool,
            resources,
            copies,
            tables: Tables { tables: Vec::new(), buffers: Vec::new() },
            pushed: HashMap::new(),
            open: None,
            bound: HashMap::new(),
            long: HashMap::new(),
        };
        slots.next_table()?;
        Ok(slots)
    }

    /// The tables that were filled.
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
        self.table().take_fresh_slots(true);
        let slots: Result<Vec<u32>> = (0..count).map(|n| insert(self, n)).collect();
        self.table().take_fresh_slots(false);
        Ok(slots?.first().copied().unwrap_or(0))
    }

    /// The slot of a resource. If it is a block, `block` is its size in bytes.
    fn insert(&mut self, binding: &Binding, block: u32) -> Result<u32> {
        match binding {
            Binding::Uniform(range) => {
                let block = self.resources.block(range, block as usize)?;
                self.table().insert_buffer(&block)
            }
            Binding::Storage(range) => {
                let buffer = self.copies.storage(self.resources, &range.buffer)?;
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
                what: format!("buffer `{}`", buffer.label()),
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

    fn bindings(&mut self, set: &Arc<BindingSet>, entry: &BindingEntry, block: u32) -> Result<u32> {
        let key = (Arc::as_ptr(set), entry.binding, block);
        if let Some(&first) = self.bound.get(&key) {
            return Ok(first);
        }
        let first = match entry.resources.as_slice() {
            // A run-time array that nothing is bound to.
            [] => 0,
            [one] => self.insert(one, block)?,
            all => self.consecutive(all.len(), |slots, n| slots.insert(&all[n], block))?,
        };
        self.bound.insert(key, first);
        Ok(first)
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
        self.tables.tables.push(self.pool.take()?);
        self.tables.buffers.push(HashMap::new());
        self.pushed.clear();
        self.bound.clear();
        self.long.clear();
        Ok(())
    }
}
