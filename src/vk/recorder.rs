//! The recorder: the only thing that dispatches.
//!
//! ```text
//! recorder.kernel(&setup).bind("vertices", &vertices).bind("triangles", &triangles)
//!     .push(&constants).dispatch([groups, 1, 1])?;
//! ```
//! `dispatch` is the one function that checks bindings against reflection, places the barrier, opens
//! the debug label and takes the timestamps, so that no stage can forget one of them.

use super::{
    address::BLOCK_BYTES,
    adopt::CallerCommands,
    buffer::{Buffer, RawBuffer},
    commands::Commands,
    gpu::Gpu,
    image::Image,
    kernel::Kernel,
    owner::{Owned, same_device},
    recording::{Recording, Timings},
    reflect::BindingKind,
    table::{RawTable, ResourceTable, check_binding},
};
use crate::error::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use std::sync::Arc;

/// Records work for the device, in order.
pub struct Recorder {
    pub(super) gpu: Gpu,
    pub(crate) commands: Commands,
    /// `Some` inside a group: whether its barrier was placed.
    group: Option<bool>,
}

/// A dispatch that is being described. Nothing is recorded before [`Dispatch::dispatch`].
#[must_use = "nothing is recorded before `dispatch`"]
pub struct Dispatch<'r> {
    recorder: &'r mut Recorder,
    kernel: Kernel,
    label: Option<String>,
    lists: Lists,
    table: Option<Arc<RawTable>>,
    /// The first fault; reported by `dispatch`, so that the chain of calls stays a sentence.
    fault: Option<Error>,
}

/// What a dispatch binds. The lists keep their memory when they are emptied.
#[derive(Default)]
pub(super) struct Lists {
    bound: Vec<Bound>,
    push: Vec<u8>,
    addresses: Vec<u64>,
}

/// A buffer that is bound.
struct Bound {
    binding: u32,
    kind: BindingKind,
    buffer: Arc<RawBuffer>,
    offset: u64,
    bytes: u64,
}

/// Descriptors that are written by one call.
const WRITES: usize = 16;

/// How many workgroups.
enum Size {
    Direct([u32; 3]),
    Indirect(Arc<RawBuffer>, u64),
}

impl Recorder {
    /// An empty recording; `label` names it in messages and captures.
    ///
    /// # Errors
    /// [`Error::Full`] without memory for commands, as for everything that records.
    pub fn new(gpu: &Gpu, label: &str) -> Result<Self> {
        let (gpu, commands) = (gpu.clone(), Commands::new(gpu, label, None)?);
        Ok(Self { gpu, commands, group: None })
    }

    /// An empty recording into a command buffer of the caller. What it returns when it is finished cannot be run.
    pub(crate) fn borrowing(gpu: &Gpu, label: &str, commands: &CallerCommands) -> Result<Self> {
        same_device(&commands.gpu, gpu)?;
        let (gpu, commands) = (gpu.clone(), Commands::new(gpu, label, Some(commands.raw))?);
        Ok(Self { gpu, commands, group: None })
    }

    /// An empty recording with the memory of `before`, whose commands are forgotten. Waits for the end of its run. It is
    /// recorded into a command buffer of the caller, if there is one ([`Recorder::borrowing`]).
    ///
    /// # Errors
    /// As [`Recorder::new`] and [`Recording::wait`].
    pub(crate) fn instead_of(
        before: Recording,
        label: &str,
        borrowed: Option<&CallerCommands>,
    ) -> Result<Self> {
        let (gpu, mut commands) = before.into_parts()?;
        borrowed.map(|borrowed| same_device(&borrowed.gpu, &gpu)).transpose()?;
        commands.restart(label, borrowed.map(|borrowed| borrowed.raw))?;
        Ok(Self { gpu, commands, group: None })
    }

    /// Times every dispatch that follows by timestamps. They cost a barrier each, so that they are
    /// off unless asked for; [`Timings::total_ns`] is measured always.
    pub fn time_stages(&mut self) {
        self.commands.time_stages = true;
    }

    /// Starts a dispatch of `kernel`.
    pub fn kernel(&mut self, kernel: &Kernel) -> Dispatch<'_> {
        let fault = same_device(self, kernel).err();
        let mut lists = std::mem::take(&mut self.commands.lists);
        lists.bound.clear();
        lists.push.clear();
        Dispatch { recorder: self, kernel: kernel.clone(), label: None, lists, table: None, fault }
    }

    /// Records `independent` with a single barrier before all of it: the caller promises that none
    /// of its dispatches, copies and fills reads or writes what another one writes.
    ///
    /// # Errors
    /// Those of `independent`.
    pub fn group<R>(&mut self, independent: impl FnOnce(&mut Self) -> Result<R>) -> Result<R> {
        let outer = self.group;
        self.group = outer.or(Some(false));
        let result = independent(self);
        self.group = outer;
        result
    }

    /// Ends the recording; it can then run, more than once.
    ///
    /// # Errors
    /// [`Error::Full`] without memory for commands.
    pub fn finish(self) -> Result<Recording> {
        Recording::new(self.gpu, self.commands)
    }

    /// Ends the recording, runs it once and waits.
    ///
    /// # Errors
    /// As [`Recording::run`].
    pub fn submit(self) -> Result<Timings> {
        self.finish()?.run()
    }

    /// Everything so far happens before everything that follows. A group has it once.
    pub(super) fn barrier(&mut self) {
        match &mut self.group {
            Some(placed @ false) => *placed = true,
            Some(true) => return,
            None => {}
        }
        self.commands.barrier();
    }

    /// A layout transition, which is a barrier as well.
    pub(crate) fn transition(&mut self, image: &Image, from: vk::ImageLayout, to: vk::ImageLayout) {
        self.commands.transition(&image.0, from, to);
    }
}

impl Dispatch<'_> {
    /// A label for timings and captures; the kernel's name unless given.
    pub fn label(mut self, label: &str) -> Self {
        self.label = Some(label.to_string());
        self
    }

    /// Binds `buffer` to the kernel's block `name`: that of the instance, or of the block if it has no instance name. The elements have the size of the block's, if it
    /// is nothing but an array; [`Buffer::cast`] says that another view of the bytes is meant.
    pub fn bind<T: Pod>(mut self, name: &str, buffer: &Buffer<T>) -> Self {
        if let Err(fault) = self.try_bind(name, buffer) {
            self.fault.get_or_insert(fault);
        }
        self
    }

    fn try_bind<T: Pod>(&mut self, name: &str, buffer: &Buffer<T>) -> Result<()> {
        self.check_device(buffer)?;
        let kernel = &self.kernel.0;
        let fault = |text: String| Err(Error::Usage(format!("kernel `{}` {text}", kernel.name)));
        let Some(block) = kernel.binding(name) else {
            let names = self.kernel.buffers().collect::<Vec<_>>().join("`, `");
            return fault(format!("binds no `{name}`; it binds `{names}`"));
        };
        if let Some(stride) = block.stride.filter(|&s| s as usize != size_of::<T>()) {
            return fault(format!(
                "has {stride}-byte elements in `{name}`; buffer `{}` has {}-byte ones",
                buffer.name(),
                size_of::<T>()
            ));
        }
        if self.lists.bound.iter().any(|b| b.binding == block.binding) {
            return fault(format!("has `{name}` bound twice"));
        }
        let (offset, bytes) = check_binding(&self.recorder.gpu, buffer)?;
        let by_address = matches!(block.kind, BindingKind::Address(_));
        if by_address && !(buffer.raw().address + offset).is_multiple_of(BLOCK_BYTES) {
            return fault(format!(
                "reads `{name}` by address; buffer `{}` from byte {offset} on does not begin at a \
                 multiple of {BLOCK_BYTES} bytes of memory, as it has to",
                buffer.name()
            ));
        }
        self.lists.bound.push(Bound {
            binding: block.binding,
            kind: block.kind,
            buffer: buffer.raw().clone(),
            offset,
            bytes,
        });
        Ok(())
    }

    /// Binds `buffer`, which nobody writes, to all blocks, and zeros as push constants: for a dispatch over nothing.
    pub(super) fn bind_everywhere(mut self, buffer: &Buffer<u32>) -> Self {
        let reflection = &self.kernel.0.reflection;
        self.lists.push.resize(reflection.push_constant_bytes as usize, 0);
        self.lists.bound.extend(reflection.bindings.iter().map(|block| Bound {
            binding: block.binding,
            kind: block.kind,
            buffer: buffer.raw().clone(),
            offset: buffer.offset(),
            bytes: buffer.bytes(),
        }));
        self
    }

    fn check_device(&self, handle: &dyn Owned) -> Result<()> {
        same_device(self.recorder, handle)
    }

    /// Binds the resource table.
    pub fn table(mut self, table: &ResourceTable) -> Self {
        let commands = self.recorder.commands.unfinished();
        if let Err(fault) = self.check_device(table).and_then(|()| table.check_open(&commands)) {
            self.fault.get_or_insert(fault);
        }
        self.table = Some(table.raw().clone());
        self
    }

    /// Sets all push constants: as many bytes as the kernel's block has.
    pub fn push<P: Pod>(mut self, constants: &P) -> Self {
        self.lists.push.clear();
        self.lists.push.extend_from_slice(bytemuck::bytes_of(constants));
        self
    }

    /// Records the dispatch of `groups` workgroups. Nothing is recorded if one of them is 0.
    ///
    /// # Errors
    /// [`Error::Usage`] if a block is not bound, bound twice or unknown, if push constants or
    /// elements have another size; [`Error::Capacity`] if a buffer or the dispatch is larger than
    /// the device allows.
    pub fn dispatch(self, groups: [u32; 3]) -> Result<()> {
        self.record(Size::Direct(groups))
    }

    /// Records a dispatch whose three counts are read from `buffer`, `byte_offset` bytes from its
    /// first element on, when it runs.
    ///
    /// # Errors
    /// As [`Dispatch::dispatch`], and [`Error::Usage`] if the counts are outside the buffer.
    pub fn dispatch_indirect<T: Pod>(self, buffer: &Buffer<T>, byte_offset: u64) -> Result<()> {
        self.check_device(buffer)?;
        let at = buffer.offset().saturating_add(byte_offset);
        if !at.is_multiple_of(4) || byte_offset.saturating_add(12) > buffer.bytes() {
            return Err(Error::Usage(format!(
                "kernel `{}` reads its size at byte {byte_offset} of buffer `{}`, which has {}",
                self.kernel.name(),
                buffer.name(),
                buffer.bytes()
            )));
        }
        self.record(Size::Indirect(buffer.raw().clone(), at))
    }

    fn record(mut self, size: Size) -> Result<()> {
        if let Some(fault) = self.fault.take() {
            return Err(fault);
        }
        self.check()?;
        if let Size::Direct(groups) = size {
            let limit = self.recorder.gpu.limits().dispatch;
            if let Some(n) = (0..3).find(|&n| groups[n] > limit[n]) {
                return Err(Error::Usage(format!(
                    "kernel `{}` is dispatched as {groups:?} workgroups; {} allows {} in direction \
                     {n}",
                    self.kernel.name(),
                    self.recorder.gpu.name(),
                    limit[n]
                )));
            }
            if groups.contains(&0) {
                self.recorder.commands.lists = self.lists;
                return Ok(());
            }
        }
        let set = self.descriptor_set()?;
        let Self { recorder, kernel, label, mut lists, table, .. } = self;
        let raw = &kernel.0;
        recorder.barrier();
        recorder.commands.begin_stage(label.as_ref().unwrap_or(&raw.name))?;
        let table_set = table.as_ref().filter(|_| raw.reflection.uses_table);
        let all = [set, table_set.map_or(vk::DescriptorSet::null(), |table| table.set)];
        let sets = &all[..1 + usize::from(table_set.is_some())];
        if let Some(table) = table {
            recorder.commands.keep(table);
        }
        let (device, cmd) = (&recorder.gpu.0.device, recorder.commands.raw);
        let point = vk::PipelineBindPoint::COMPUTE;
        // SAFETY: pipeline, layout and sets belong together: `check` compared them with the
        // kernel's reflection. All of them are kept until it has ended.
        unsafe {
            device.cmd_bind_pipeline(cmd, point, raw.pipeline);
            device.cmd_bind_descriptor_sets(cmd, point, raw.layout, 0, sets, &[]);
            if !lists.push.is_empty() {
                let stages = vk::ShaderStageFlags::COMPUTE;
                device.cmd_push_constants(cmd, raw.layout, stages, 0, &lists.push);
            }
            match &size {
                Size::Direct([x, y, z]) => device.cmd_dispatch(cmd, *x, *y, *z),
                Size::Indirect(buffer, at) => device.cmd_dispatch_indirect(cmd, buffer.handle, *at),
            }
        }
        recorder.commands.end_stage();
        if let Size::Indirect(buffer, _) = size {
            recorder.commands.keep(buffer);
        }
        for b in lists.bound.drain(..) {
            recorder.commands.keep(b.buffer);
        }
        recorder.commands.keep(kernel.0);
        recorder.commands.lists = lists;
        Ok(())
    }

    /// Compares the bindings with the kernel's reflection.
    fn check(&self) -> Result<()> {
        let r = &self.kernel.0.reflection;
        let fault =
            |text: String| Err(Error::Usage(format!("kernel `{}` {text}", self.kernel.name())));
        let is_bound = |binding| self.lists.bound.iter().any(|b| b.binding == binding);
        if let Some(open) = r.bindings.iter().find(|b| !is_bound(b.binding)) {
            return fault(format!("has nothing bound to `{}`", open.name));
        }
        if (r.uses_table || r.table_address) && self.table.is_none() {
            return fault("has no resource table bound".into());
        }
        if self.lists.push.len() != r.push_constant_bytes as usize {
            return fault(format!(
                "has {} bytes of push constants, not {}",
                r.push_constant_bytes,
                self.lists.push.len()
            ));
        }
        Ok(())
    }

    fn descriptor_set(&mut self) -> Result<vk::DescriptorSet> {
        let layout = self.kernel.0.set_layout;
        let addresses = self.addresses()?;
        let info = |buffer: &RawBuffer, offset, bytes| vk::DescriptorBufferInfo {
            buffer: buffer.handle,
            offset,
            range: bytes,
        };
        let (kernel, recorder) = (&self.kernel.0, &mut *self.recorder);
        let count = kernel.reflection.descriptors().count() as u32;
        let set = recorder.commands.descriptor_set(layout, count)?;
        let mut descriptors = kernel.reflection.descriptors();
        loop {
            let mut infos = [[vk::DescriptorBufferInfo::default()]; WRITES];
            let mut places = [(0, vk::DescriptorType::STORAGE_BUFFER); WRITES];
            let mut written = 0;
            for (binding, kind) in descriptors.by_ref().take(WRITES) {
                let bound = self.lists.bound.iter().find(|b| b.binding == binding);
                let of_bound = bound.map(|b| info(&b.buffer, b.offset, b.bytes));
                let of_addresses =
                    || addresses.as_ref().map(|a| info(a.raw(), a.offset(), a.bytes()));
                if let Some(found) = of_bound.or_else(of_addresses) {
                    (infos[written], places[written]) = ([found], (binding, kind));
                    written += 1;
                }
            }
            if written == 0 {
                return Ok(set);
            }
            let writes: [_; WRITES] = std::array::from_fn(|n| {
                vk::WriteDescriptorSet::default()
                    .dst_set(set)
                    .dst_binding(places[n].0)
                    .descriptor_type(places[n].1)
                    .buffer_info(&infos[n])
            });
            // SAFETY: the set is new, so that no submission uses it; the buffers are kept by `record`.
            unsafe { recorder.gpu.0.device.update_descriptor_sets(&writes[..written], &[]) };
        }
    }

    /// The block of addresses that the kernel reads.
    fn addresses(&mut self) -> Result<Option<Buffer<u64>>> {
        let Some((_, count)) = self.kernel.0.reflection.addresses else { return Ok(None) };
        let list = &mut self.lists.addresses;
        list.clear();
        list.resize(count as usize, 0);
        for b in &self.lists.bound {
            if let BindingKind::Address(n) = b.kind {
                list[n as usize] = b.buffer.address + b.offset;
            }
        }
        if self.kernel.0.reflection.table_address {
            let table = self.table.as_ref().and_then(|table| table.addresses.as_ref());
            list[count as usize - 1] = table.map_or(0, |t| t.raw().address + t.offset());
        }
        self.recorder.commands.constants(list).map(Some)
    }
}
