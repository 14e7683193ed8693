//! Puts the resources of a pass into resource tables.

use crate::{
    abi,
    error::{Error, Result},
    kept::KEPT_PASSES,
    pass::{self, Binding, BindingEntry, BindingSet},
    plan::Slots,
    vk::{Arena, Copies, Gpu, ResourceTable, Resources, Unfinished},
};
use std::{
    collections::{HashMap, hash_map::DefaultHasher},
    hash::{Hash, Hasher},
    ops::Range,
    sync::Arc,
};

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
            None => ResourceTable::for_passes(&self.gpu),
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

/// The resource tables of a pass that is prepared, or of all passes of a frame: one, unless they bind more than that has
/// room for.
#[derive(Default)]
pub struct Tables {
    /// In the order of [`crate::plan::BatchPlan::table`].
    pub tables: Vec<ResourceTable>,
    /// For each table its vertex and index buffers by slot, if they are wanted.
    pub buffers: Option<Vec<HashMap<u32, Arc<pass::BufferSource>>>>,
    /// The commands of the frame that the tables are for, if they are for one.
    commands: Option<Unfinished>,
    /// Whether another pass has slots in the last table.
    shared: bool,
    pushed: Pushed,
    /// First slots of what sets bind. The pass holds the sets while it is planned, so that an address
    /// stands for one of them.
    bound: HashMap<(usize, u32, u32), u32>,
    /// First slots of buffers that have several.
    long: HashMap<usize, u32>,
}

/// Slots of push-constant blocks by content: draws often share theirs.
#[derive(Default)]
struct Pushed {
    /// The contents, one after the other.
    bytes: Vec<u8>,
    /// By hash: where a content is in `bytes`, and its slot.
    slots: HashMap<u64, (Range<usize>, u32)>,
}

impl Tables {
    /// No tables, of which a trace will want the buffers.
    pub fn traced() -> Self {
        Self { buffers: Some(Vec::new()), ..Self::default() }
    }

    /// Begins a pass, whose slots come behind those of the passes before.
    pub fn begin_pass(&mut self) {
        self.shared = !self.tables.is_empty();
        self.bound.clear();
        self.long.clear();
    }

    /// Empties the tables, all but the first of which go, and begins a frame that `commands` record.
    pub fn begin_frame(&mut self, commands: Unfinished) -> Result<()> {
        self.tables.truncate(1);
        self.pushed.clear();
        for table in &mut self.tables {
            table.clear()?;
            table.open_for(&commands)?;
        }
        self.commands = Some(commands);
        Ok(())
    }
}

impl Pushed {
    fn hash(content: &[u8]) -> u64 {
        let mut hasher = DefaultHasher::new();
        content.hash(&mut hasher);
        hasher.finish()
    }

    fn find(&self, hash: u64, content: &[u8]) -> Option<u32> {
        let (range, slot) = self.slots.get(&hash)?;
        (self.bytes[range.clone()] == *content).then_some(*slot)
    }

    fn insert(&mut self, hash: u64, content: &[u8], slot: u32) {
        let first = self.bytes.len();
        self.bytes.extend_from_slice(content);
        self.slots.insert(hash, (first..self.bytes.len(), slot));
    }

    fn clear(&mut self) {
        self.bytes.clear();
        self.slots.clear();
    }
}

/// Uploads resources for the planner and hands out their slots.
pub struct TableSlots<'a> {
    pool: &'a mut TablePool,
    resources: &'a mut Resources,
    copies: &'a Copies,
    arena: &'a mut Arena,
    tables: &'a mut Tables,
}

impl<'a> TableSlots<'a> {
    /// Slots in the last of `tables`, or in one of `pool` if there is none.
    pub fn new(
        pool: &'a mut TablePool,
        resources: &'a mut Resources,
        copies: &'a Copies,
        arena: &'a mut Arena,
        tables: &'a mut Tables,
    ) -> Result<TableSlots<'a>> {
        tables.begin_pass();
        let mut slots = TableSlots { pool, resources, copies, arena, tables };
        if slots.tables.tables.is_empty() {
            slots.next_table()?;
        }
        Ok(slots)
    }

    /// The table that is being filled.
    fn open_table(&mut self) -> &mut ResourceTable {
        self.tables.tables.last_mut().expect("there is always one")
    }

    /// The first of the slots that `insert` takes for `0..count`. They follow each other, whatever is
    /// in the table already.
    fn consecutive(
        &mut self,
        count: usize,
        mut insert: impl FnMut(&mut Self, usize) -> Result<u32>,
    ) -> Result<u32> {
        self.open_table().take_fresh_slots(true);
        let first = (0..count).try_fold(None, |first, n| {
            let slot = insert(self, n)?;
            Ok(first.or(Some(slot)))
        });
        self.open_table().take_fresh_slots(false);
        first.map(Option::unwrap_or_default)
    }

    /// The slot of a resource. If it is a block, `block` is its size in bytes.
    fn insert(&mut self, binding: &Binding, block: u32) -> Result<u32> {
        match binding {
            Binding::Uniform(range) => {
                let block = self.resources.block(range, block as usize)?;
                self.open_table().insert_buffer(&block)
            }
            Binding::Storage(range) => {
                let buffer = self.copies.storage(self.resources, &range.buffer)?;
                let slice = buffer.slice(range.offset..range.offset + range.bytes)?;
                self.open_table().insert_buffer(&slice)
            }
            Binding::Sampled(texture, sampler) => {
                let (image, sampler) = self.resources.sampled(texture, sampler)?;
                self.open_table().insert_sampled(&image, &sampler)
            }
            Binding::Texture(texture) => {
                let image = self.resources.texture(texture)?;
                self.open_table().insert_texture(&image)
            }
            Binding::StorageImage(texture) => {
                let image = self.resources.texture(texture)?;
                self.open_table().insert_storage_image(&image)
            }
            Binding::Sampler(sampler) => {
                let sampler = self.resources.sampler(sampler)?;
                self.open_table().insert_sampler(&sampler)
            }
        }
    }
}

impl Slots for TableSlots<'_> {
    fn buffer(&mut self, buffer: &Arc<pass::BufferSource>) -> Result<u32> {
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
            self.open_table().insert_buffer(&uploaded)?
        } else if let Some(&first) = self.tables.long.get(&(Arc::as_ptr(buffer) as usize)) {
            return Ok(first);
        } else {
            let windows = uploaded.len().div_ceil(window);
            let first = self.consecutive(windows, |slots, n| {
                let end = uploaded.len().min((n + 1) * window + abi::WINDOW_OVERLAP as usize);
                slots.open_table().insert_buffer(&uploaded.slice(n * window..end)?)
            })?;
            self.tables.long.insert(Arc::as_ptr(buffer) as usize, first);
            first
        };
        if let Some(buffers) = self.tables.buffers.as_mut().and_then(|all| all.last_mut()) {
            buffers.insert(slot, buffer.clone());
        }
        Ok(slot)
    }

    fn bindings(&mut self, set: &Arc<BindingSet>, entry: &BindingEntry, block: u32) -> Result<u32> {
        let key = (Arc::as_ptr(set) as usize, entry.binding, block);
        if let Some(&first) = self.tables.bound.get(&key) {
            return Ok(first);
        }
        let first = match entry.resources.as_slice() {
            // A run-time array that nothing is bound to.
            [] => 0,
            [one] => self.insert(one, block)?,
            all => self.consecutive(all.len(), |slots, n| slots.insert(&all[n], block))?,
        };
        self.tables.bound.insert(key, first);
        Ok(first)
    }

    fn push_constants(&mut self, bytes: &[u8]) -> Result<u32> {
        let hash = Pushed::hash(bytes);
        if let Some(slot) = self.tables.pushed.find(hash, bytes) {
            return Ok(slot);
        }
        let block = self.arena.push_padded(bytes)?;
        let slot = self.open_table().insert_buffer(&block)?;
        self.tables.pushed.insert(hash, bytes, slot);
        Ok(slot)
    }

    fn is_full(&self) -> bool {
        self.tables.tables.last().is_some_and(ResourceTable::is_full)
    }

    fn next_table(&mut self) -> Result<()> {
        let mut table = self.pool.take()?;
        if let Some(commands) = &self.tables.commands {
            table.open_for(commands)?;
        }
        self.tables.tables.push(table);
        if let Some(buffers) = &mut self.tables.buffers {
            buffers.push(HashMap::new());
        }
        self.tables.shared = false;
        self.tables.pushed.clear();
        self.tables.bound.clear();
        self.tables.long.clear();
        Ok(())
    }

    fn table(&self) -> usize {
        self.tables.tables.len() - 1
    }

    fn is_shared(&self) -> bool {
        self.tables.shared
    }
}
