//! Typed buffers.

use super::{
    error::{capacity, no_memory},
    gpu::{Gpu, Shared},
    recorder::Recorder,
};
use crate::error::{Error, Result};
use ash::vk;
use bytemuck::Pod;
use gpu_allocator::{MemoryLocation, vulkan::Allocation};
use std::{marker::PhantomData, ops::Range, sync::Arc};

/// Which side reads and writes a buffer most.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Memory {
    /// The device; the host reaches it by copies.
    Device,
    /// Written by the host, read by the device: memory that both reach.
    Mapped,
    /// Written by the device, read by the host.
    Readback,
}

/// `len` elements of `T` in memory that the device reaches; named, for messages and captures.
///
/// A clone or a [slice](Buffer::slice) is the same memory. Every buffer may be bound as storage,
/// uniform, vertex, index and indirect buffer and be copied from and to.
pub struct Buffer<T> {
    raw: Arc<RawBuffer>,
    /// First byte.
    offset: u64,
    len: usize,
    element: PhantomData<fn() -> T>,
}

/// The Vulkan buffer and its memory, freed together.
pub(crate) struct RawBuffer {
    pub handle: vk::Buffer,
    pub name: String,
    /// Bytes of the Vulkan buffer.
    pub size: u64,
    /// Where the device sees it, if kernels reach blocks by address, or 0.
    pub address: vk::DeviceAddress,
    memory: Memory,
    allocation: Option<Allocation>,
    /// Whether it is the caller's.
    adopted: bool,
    pub(super) gpu: Arc<Shared>,
}

impl<T: Pod> Buffer<T> {
    /// A buffer of `len` elements with undefined content.
    ///
    /// # Errors
    /// [`Error::Capacity`] if it is larger than the device allows or has memory for.
    pub fn new(gpu: &Gpu, name: &str, len: usize, memory: Memory) -> Result<Self> {
        let bytes = (len as u64).saturating_mul(size_of::<T>() as u64);
        RawBuffer::check_size(gpu, name, bytes)?;
        let size = bytes.max(1).next_multiple_of(RawBuffer::SIZE_MULTIPLE);
        let shared = gpu.0.clone();
        let info = vk::BufferCreateInfo::default()
            .size(size)
            .usage(shared.buffer_usage())
            .sharing_mode(vk::SharingMode::EXCLUSIVE);
        // SAFETY: the device is alive.
        let handle = unsafe { shared.device.create_buffer(&info, None) }
            .map_err(|e| shared.failure(&format!("creating buffer `{name}`"), e))?;
        // From here on the buffer is destroyed by `RawBuffer` if anything fails.
        let mut raw = RawBuffer {
            handle,
            name: name.to_string(),
            size,
            address: 0,
            memory,
            allocation: None,
            adopted: false,
            gpu: shared.clone(),
        };
        // SAFETY: `handle` is alive and not yet bound; the memory was allocated for it.
        unsafe {
            let requirements = shared.device.get_buffer_memory_requirements(handle);
            let location = match memory {
                Memory::Device => MemoryLocation::GpuOnly,
                Memory::Mapped => MemoryLocation::CpuToGpu,
                Memory::Readback => MemoryLocation::GpuToCpu,
            };
            let what = format!("buffer `{name}`");
            let allocation = shared.allocate(&what, requirements, location, true)?;
            let (memory, offset) = (allocation.memory(), allocation.offset());
            raw.allocation = Some(allocation);
            shared
                .device
                .bind_buffer_memory(handle, memory, offset)
                .map_err(|e| shared.failure(&format!("binding memory of buffer `{name}`"), e))?;
            if shared.addresses {
                let info = vk::BufferDeviceAddressInfo::default().buffer(handle);
                raw.address = shared.device.get_buffer_device_address(&info);
                // Lavapipe, when the system gives it no memory, says that all is well and places the buffer at -1.
                if raw.address == 0 || !raw.address.is_multiple_of(requirements.alignment) {
                    return Err(no_memory(&what, requirements.size));
                }
            }
        }
        shared.set_name(handle, name);
        Ok(Self { raw: Arc::new(raw), offset: 0, len, element: PhantomData })
    }

    /// An [`Memory::Mapped`] buffer that holds `content`.
    ///
    /// # Errors
    /// As [`Buffer::new`].
    pub fn with_content(gpu: &Gpu, name: &str, content: &[T]) -> Result<Self> {
        let buffer = Self::new(gpu, name, content.len(), Memory::Mapped)?;
        // SAFETY: nobody else has the buffer yet.
        unsafe { buffer.write_out_of_turn(0, content)? };
        Ok(buffer)
    }

    /// Writes `content` from element `first` on. Waits for all that was started on the device, and whatever starts
    /// waits for it; so a recording finds all of the content or nothing of it.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is not an [`Memory::Mapped`] buffer or too short; [`Error::Lost`] if the
    /// device was lost, which may still be reading.
    pub fn write(&self, first: usize, content: &[T]) -> Result<()> {
        let _turn = self.raw.gpu.host_turn()?;
        // SAFETY: it is the host's turn, and nobody else's.
        unsafe { self.write_out_of_turn(first, content) }
    }

    /// As [`Buffer::write`], without waiting for anybody.
    ///
    /// # Safety
    /// Nobody else, neither the device nor another thread, touches these elements meanwhile.
    pub(super) unsafe fn write_out_of_turn(&self, first: usize, content: &[T]) -> Result<()> {
        if first.checked_add(content.len()).is_none_or(|end| end > self.len) {
            return Err(Error::Usage(format!(
                "buffer `{}` has {} elements; {} at {first} do not fit",
                self.raw.name,
                self.len,
                content.len()
            )));
        }
        let mapped = self.raw.mapped(Memory::Mapped)?;
        let bytes: &[u8] = bytemuck::cast_slice(content);
        let at = self.offset as usize + first * size_of::<T>();
        // SAFETY: `at + bytes.len()` is inside the buffer, which is mapped as a whole. Bytes of
        // mapped memory have no Rust reference, so that writing through a pointer aliases nothing.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), mapped.add(at), bytes.len()) };
        Ok(())
    }

    /// The content, once the recording that wrote it has run. Waits for all that was started on the device.
    ///
    /// # Errors
    /// [`Error::Usage`] if it is not a [`Memory::Readback`] buffer; [`Error::Lost`] if the device was
    /// lost, which may still be writing.
    pub fn read(&self) -> Result<Vec<T>> {
        let mut content = Vec::new();
        self.append_to(&mut content)?;
        Ok(content)
    }

    /// Appends the content, as [`Buffer::read`] returns it. Allocating new memory takes longer than filling it:
    /// a caller that reads several parts should reserve room for all of them first.
    ///
    /// # Errors
    /// As [`Buffer::read`].
    pub fn append_to(&self, content: &mut Vec<T>) -> Result<()> {
        let _turn = self.raw.gpu.host_turn()?;
        let mapped = self.raw.mapped(Memory::Readback)?;
        content
            .try_reserve_exact(self.len)
            .map_err(|_| no_memory(&format!("reading buffer `{}`", self.raw.name), self.bytes()))?;
        let (filled, bytes) = (content.len(), self.bytes() as usize);
        // SAFETY: `offset + bytes` is inside the buffer, which is mapped as a whole; after `filled`, the
        // vector has room for as many elements; any bytes are a `T`, which is plain data.
        unsafe {
            let from = mapped.add(self.offset as usize);
            let to = content.as_mut_ptr().add(filled).cast::<u8>();
            std::ptr::copy_nonoverlapping(from, to, bytes);
            content.set_len(filled + self.len);
        }
        Ok(())
    }

    /// The present content, whatever memory it is in: copied by the device, and waited for.
    ///
    /// # Errors
    /// As [`super::Recording::run`], and [`Error::Capacity`] without memory for the copy.
    pub fn download(&self) -> Result<Vec<T>> {
        let mut recorder = Recorder::new(&Gpu(self.raw.gpu.clone()), "download")?;
        let copy = recorder.download(self)?;
        recorder.submit()?;
        copy.read()
    }

    /// The same bytes as elements of another type.
    ///
    /// # Errors
    /// [`Error::Usage`] if they are no whole number of elements.
    pub fn cast<U: Pod>(&self) -> Result<Buffer<U>> {
        let bytes = self.bytes() as usize;
        if size_of::<U>() == 0 || !bytes.is_multiple_of(size_of::<U>()) {
            return Err(Error::Usage(format!(
                "buffer `{}` has {bytes} bytes, no whole number of {}-byte elements",
                self.raw.name,
                size_of::<U>()
            )));
        }
        Ok(Buffer {
            raw: self.raw.clone(),
            offset: self.offset,
            len: bytes / size_of::<U>(),
            element: PhantomData,
        })
    }

    /// The elements of `range`, in the same memory. Where a kernel of yours binds the slice, its first byte is aligned to
    /// [`super::Limits::storage_offset_bytes`], and where a pass binds it, to 256 bytes on all devices.
    ///
    /// # Errors
    /// [`Error::Usage`] if the range is outside.
    pub fn slice(&self, range: Range<usize>) -> Result<Buffer<T>> {
        if range.start > range.end || range.end > self.len {
            return Err(Error::Usage(format!(
                "buffer `{}` has {} elements, not {range:?}",
                self.raw.name, self.len
            )));
        }
        Ok(Buffer {
            raw: self.raw.clone(),
            offset: self.offset + (range.start * size_of::<T>()) as u64,
            len: range.len(),
            element: PhantomData,
        })
    }

    /// Elements.
    pub fn len(&self) -> usize {
        self.len
    }

    /// Whether it has no elements.
    pub fn is_empty(&self) -> bool {
        self.len == 0
    }

    /// Bytes of all elements.
    pub fn bytes(&self) -> u64 {
        (self.len * size_of::<T>()) as u64
    }

    /// The name it was made with.
    pub fn name(&self) -> &str {
        &self.raw.name
    }

    /// Whether this is the only handle of its memory.
    pub(crate) fn is_unique(&mut self) -> bool {
        Arc::get_mut(&mut self.raw).is_some()
    }

    /// Bytes that a descriptor covers: all elements, rounded up to whole words where the buffer
    /// goes on, and never 0, which Vulkan does not allow.
    pub(crate) fn descriptor_bytes(&self) -> u64 {
        self.bytes().max(1).next_multiple_of(4).min(self.raw.size - self.offset)
    }
}

impl<T> Buffer<T> {
    /// All of `raw`, which has `len` elements.
    pub(super) fn of_raw(raw: RawBuffer, len: usize) -> Self {
        Self { raw: Arc::new(raw), offset: 0, len, element: PhantomData }
    }

    pub(crate) fn raw(&self) -> &Arc<RawBuffer> {
        &self.raw
    }

    /// First byte in the Vulkan buffer.
    pub(crate) fn offset(&self) -> u64 {
        self.offset
    }
}

impl<T> Clone for Buffer<T> {
    fn clone(&self) -> Self {
        Self { raw: self.raw.clone(), offset: self.offset, len: self.len, element: PhantomData }
    }
}

impl<T> std::fmt::Debug for Buffer<T> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Buffer `{}` of {} x {} bytes", self.raw.name, self.len, size_of::<T>())
    }
}

impl RawBuffer {
    /// Buffers end on a multiple of this, so that kernels may read the last bytes as whole vectors.
    pub const SIZE_MULTIPLE: u64 = 16;

    /// A buffer of the caller, which has this handle and this many bytes.
    pub fn adopted(
        gpu: &Gpu,
        name: &str,
        (handle, size): (vk::Buffer, u64),
        address: vk::DeviceAddress,
    ) -> Self {
        let (gpu, memory) = (gpu.0.clone(), Memory::Device);
        let name = name.to_string();
        Self { handle, name, size, address, memory, allocation: None, adopted: true, gpu }
    }

    /// Refuses more bytes than one buffer may have.
    pub fn check_size(gpu: &Gpu, name: &str, bytes: u64) -> Result<()> {
        let limit = gpu.limits().buffer_bytes;
        if bytes > limit {
            let limit_of = format!("one buffer on {}", gpu.name());
            return Err(capacity(&format!("buffer `{name}`"), bytes, limit_of, limit));
        }
        Ok(())
    }

    /// The mapped memory of a buffer made for `memory`.
    fn mapped(&self, memory: Memory) -> Result<*mut u8> {
        let pointer = self.allocation.as_ref().and_then(Allocation::mapped_ptr);
        match pointer {
            Some(pointer) if self.memory == memory => Ok(pointer.as_ptr().cast()),
            _ => Err(Error::Usage(format!(
                "buffer `{}` was made for `Memory::{:?}`; the host reaches `Memory::{memory:?}` in this way. A recording \
                 reaches all of them: see `Encoder::upload` and `Buffer::download`",
                self.name, self.memory
            ))),
        }
    }
}

impl Drop for RawBuffer {
    fn drop(&mut self) {
        if !self.adopted {
            // SAFETY: the last handle goes; recordings that use it hold it until they have ended.
            unsafe { self.gpu.device.destroy_buffer(self.handle, None) };
        }
        if let Some(allocation) = self.allocation.take() {
            self.gpu.free(allocation);
        }
    }
}
