//! What the caller made with Vulkan: a device, buffers, images, command buffers.
//!
//! These functions are the only public ones with types of Vulkan, those of the crate `ash`. They are unsafe, since nobody
//! can check what a handle stands for. Their conditions are written at each of them.

use super::{
    buffer::{Buffer, RawBuffer},
    gpu::{Gpu, Shared},
    image::Image,
    raw_image::RawImage,
};
use crate::{
    error::{Error, Result},
    format::Format,
    image::{Extent, Shape},
};
use ash::vk;
use std::sync::Arc;

/// A device that the caller opened, for [`Gpu::adopt`].
#[derive(Clone, Copy)]
pub struct CallerDevice<'a> {
    /// The instance.
    pub instance: &'a ash::Instance,
    /// The physical device.
    pub physical: vk::PhysicalDevice,
    /// The device.
    pub device: &'a ash::Device,
    /// What the device was created with.
    pub create_info: &'a vk::DeviceCreateInfo<'a>,
    /// The queue that everything runs on.
    pub queue: vk::Queue,
    /// The family of the queue, which computes. Depth images need a family that draws as well.
    pub family: u32,
    /// Whether the instance has the extension `VK_EXT_debug_utils` on. Dispatches then have labels, and objects have names.
    pub debug_utils: bool,
}

/// A buffer of the caller, for [`Buffer::adopt`].
#[derive(Clone, Copy, Debug)]
pub struct CallerBuffer<'a> {
    /// For messages.
    pub name: &'a str,
    /// The buffer.
    pub buffer: vk::Buffer,
    /// The bytes that it was created with.
    pub size: u64,
    /// The usage that it was created with.
    pub usage: vk::BufferUsageFlags,
}

/// An image of the caller, for [`Image::adopt`].
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub struct CallerImage<'a> {
    /// For messages.
    pub name: &'a str,
    /// The image, with one sample a texel.
    pub image: vk::Image,
    /// Size of level 0 of one layer or slice.
    pub extent: Extent,
    /// Dimensions and layers. Cubes need `VK_IMAGE_CREATE_CUBE_COMPATIBLE_BIT`. The classic executor draws to no slices of a
    /// caller's image of three dimensions.
    pub shape: Shape,
    /// Format of a texel.
    pub format: Format,
    /// Mip levels.
    pub levels: u32,
    /// The usage that it was created with. Passes store to an image that has `TRANSFER_DST`, load from one that has
    /// `TRANSFER_SRC`, sample one that has `SAMPLED`, and bind one as a storage image that has `STORAGE` and the layout
    /// `GENERAL`. The classic executor draws to one that is an attachment.
    pub usage: vk::ImageUsageFlags,
    /// The layout in which each recorded pass finds the image and leaves it. Passes sample images that are in
    /// `SHADER_READ_ONLY_OPTIMAL`, `READ_ONLY_OPTIMAL` or `GENERAL`.
    pub layout: vk::ImageLayout,
}

impl CallerImage<'_> {
    /// An image of two dimensions and one level.
    pub fn new(
        image: vk::Image,
        extent: Extent,
        format: Format,
        usage: vk::ImageUsageFlags,
        layout: vk::ImageLayout,
    ) -> Self {
        let (name, shape, levels) = ("an image of the caller", Shape::D2, 1);
        Self { name, image, extent, shape, format, levels, usage, layout }
    }
}

impl<'a> CallerImage<'a> {
    setters! {
        name: &'a str,
        shape: Shape,
        levels: u32,
    }
}

/// A command buffer of the caller, for [`crate::compute::Renderer::record`].
pub struct CallerCommands {
    pub(super) gpu: Gpu,
    pub(super) raw: vk::CommandBuffer,
}

impl CallerCommands {
    /// `commands`, to be recorded into. [`crate::compute::Renderer::record`] does so, and returns
    /// [`crate::compute::Recorded`], which holds what the commands use.
    ///
    /// What comes before and after in the command buffer needs no barriers: a full one is recorded before the first command
    /// and after the last one, from all writes to all that follows, the host's reads after a fence included. Layouts of
    /// images are those of [`CallerImage::layout`], before and after. The bound compute pipeline, its descriptor sets and
    /// its push constants are others afterwards; the state of graphics stays.
    ///
    /// # Safety
    /// * The command buffer belongs to the device of `gpu` and to the queue's family. It is being recorded, outside of a
    ///   render pass, and nobody else records until [`crate::compute::Renderer::record`] has returned.
    /// * If that returns an error, the command buffer is broken: nothing more is recorded, and it is not submitted.
    /// * The command buffer is submitted to the queue of `gpu`, or to another one where semaphores order it with all that
    ///   was started through `gpu` and its clones: by renderers, recordings, uploads and downloads. Recording may start
    ///   uploads as well. An empty frame that is submitted afterwards (`renderer.begin()?.submit()?.vulkan()`) has the
    ///   semaphore and the value that come after all of that. The command buffer is not submitted any more, and has ended,
    ///   when [`crate::compute::Recorded`] is dropped.
    /// * While it runs, nobody calls [`Buffer::write`], [`Buffer::read`] or [`Buffer::append_to`] on what it uses:
    ///   these functions wait for what this library submitted alone.
    pub unsafe fn new(gpu: &Gpu, commands: vk::CommandBuffer) -> Self {
        Self { gpu: gpu.clone(), raw: commands }
    }
}

impl Gpu {
    /// The usage that buffers need which [`Buffer::adopt`] takes. Their memory needs
    /// `VK_MEMORY_ALLOCATE_DEVICE_ADDRESS_BIT` if `SHADER_DEVICE_ADDRESS` is among it.
    pub fn buffer_usage(&self) -> vk::BufferUsageFlags {
        self.0.buffer_usage()
    }
}

impl Shared {
    /// The usage of all buffers.
    pub(super) fn buffer_usage(&self) -> vk::BufferUsageFlags {
        let addressed = match self.addresses {
            true => vk::BufferUsageFlags::SHADER_DEVICE_ADDRESS,
            false => vk::BufferUsageFlags::empty(),
        };
        vk::BufferUsageFlags::STORAGE_BUFFER
            | vk::BufferUsageFlags::UNIFORM_BUFFER
            | vk::BufferUsageFlags::VERTEX_BUFFER
            | vk::BufferUsageFlags::INDEX_BUFFER
            | vk::BufferUsageFlags::INDIRECT_BUFFER
            | vk::BufferUsageFlags::TRANSFER_SRC
            | vk::BufferUsageFlags::TRANSFER_DST
            | addressed
    }
}

impl Buffer<u8> {
    /// All bytes of a buffer of the caller, for everything that a buffer in [`super::Memory::Device`] is for. Use
    /// [`Buffer::slice`] and [`Buffer::cast`] for parts of it.
    ///
    /// # Errors
    /// [`Error::Usage`] if a usage is missing that [`Gpu::buffer_usage`] names, or if kernels reach buffers by address and
    /// the size is no multiple of 16 bytes, which they read at once; [`Error::Capacity`] if the device allows no such size.
    ///
    /// # Safety
    /// The buffer belongs to the device of `gpu`, has memory bound, and was created with this size and usage. It
    /// lives until the last clone and the last [`crate::compute::Recorded`] that uses it are gone. It is owned by the family of the
    /// queue, or shared with it.
    pub unsafe fn adopt(gpu: &Gpu, buffer: &CallerBuffer<'_>) -> Result<Self> {
        let CallerBuffer { name, buffer: handle, size, usage } = *buffer;
        let missing = gpu.buffer_usage() & !usage;
        if !missing.is_empty() {
            return Err(Error::Usage(format!(
                "buffer `{name}` was created without {missing:?}: `Gpu::buffer_usage` says what is needed"
            )));
        }
        RawBuffer::check_size(gpu, name, size)?;
        if gpu.reads_by_address() && !size.is_multiple_of(RawBuffer::SIZE_MULTIPLE) {
            return Err(Error::Usage(format!(
                "buffer `{name}` has {size} bytes: {} takes buffers whose size is a multiple of {} (or open the device \
                 with `GpuOptions::by_address` off)",
                gpu.name(),
                RawBuffer::SIZE_MULTIPLE
            )));
        }
        let address = match gpu.reads_by_address() {
            true => {
                let info = vk::BufferDeviceAddressInfo::default().buffer(handle);
                // SAFETY: the caller's promise; the usage was checked.
                unsafe { gpu.0.device.get_buffer_device_address(&info) }
            }
            false => 0,
        };
        Ok(Self::of_raw(RawBuffer::adopted(gpu, name, (handle, size), address), size as usize))
    }
}

impl<T> Buffer<T> {
    /// The buffer of Vulkan that the elements are in, and the first of their bytes.
    pub fn vulkan(&self) -> (vk::Buffer, u64) {
        (self.raw().handle, self.offset())
    }
}

impl Image {
    /// An image of the caller, for passes to draw to and to sample ([`super::ImageUse::Attachment`]).
    ///
    /// # Errors
    /// As [`Image::new`], and [`Error::Full`] without room for a view.
    ///
    /// # Safety
    /// * The image belongs to the device of `gpu`, has memory bound, and was created with what `image` says. It lives until
    ///   the last clone and the last [`crate::compute::Recorded`] that uses it are gone. It is owned by the family of the
    ///   queue, or shared with it.
    /// * Whenever a pass, an upload or a download that names the image begins to run, all its levels are in
    ///   [`CallerImage::layout`].
    /// * If it holds depths, they are in 0..=1 when a pass loads them.
    pub unsafe fn adopt(gpu: &Gpu, image: &CallerImage<'_>) -> Result<Self> {
        // SAFETY: the caller's promise.
        let raw = unsafe { RawImage::adopted(gpu, image)? };
        Ok(Self(Arc::new(raw)))
    }

    /// The image of Vulkan. Between the commands of this library, it is in [`Image::layout`].
    pub fn vulkan(&self) -> vk::Image {
        self.0.handle
    }

    /// The layout in which commands find the image and leave it.
    pub fn layout(&self) -> vk::ImageLayout {
        self.0.shader_layout()
    }
}
