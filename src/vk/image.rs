//! Images: sampled textures, storage images and attachments.

use super::{
    gpu::{Gpu, Shared},
    owner::same_device,
    recorder::Recorder,
};
use crate::{
    error::{Error, Result},
    format::Format,
    image::{self, Extent},
};
use ash::vk;
use gpu_allocator::{MemoryLocation, vulkan::Allocation};
use std::sync::Arc;

/// What an image is for; it decides usage and resting layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ImageUse {
    /// Uploaded once, then sampled by kernels of yours through a [`super::ResourceTable`]. Passes sample textures of the
    /// host ([`crate::texture::Texture::new`]) and images for [`ImageUse::Attachment`].
    Sampled,
    /// Read and written by kernels of yours as a storage image, through a [`super::ResourceTable`].
    Storage,
    /// Drawn to by passes and sampled by their shaders, as often as wanted; also a texture that the host uploads. It can be uploaded and read back at any time, and
    /// holds zeros until something else is written.
    Attachment,
}

/// How to make an [`Image`].
#[derive(Clone, Copy, Debug)]
pub struct ImageInfo<'a> {
    /// For messages and captures.
    pub name: &'a str,
    /// Size of level 0.
    pub extent: Extent,
    /// Layout of a texel.
    pub format: Format,
    /// Mip levels.
    pub levels: u32,
    /// Its purpose.
    pub usage: ImageUse,
}

/// A two-dimensional image with its view. A clone is the same image.
#[derive(Clone)]
pub struct Image(pub(crate) Arc<RawImage>);

pub(crate) struct RawImage {
    pub handle: vk::Image,
    /// All levels.
    pub view: vk::ImageView,
    /// Level 0, if there are more and passes draw to it.
    first_level: Option<vk::ImageView>,
    pub name: String,
    pub extent: Extent,
    pub format: Format,
    pub levels: u32,
    pub usage: ImageUse,
    allocation: Option<Allocation>,
    pub(super) gpu: Arc<Shared>,
}

impl Image {
    /// An image. It has no content yet, unless it is for [`ImageUse::Attachment`].
    ///
    /// # Errors
    /// [`Error::Usage`] if a side has no pixels, if there are no levels, or if there are more levels than it takes to
    /// halve the longer side to one pixel. [`Error::Full`] if it has more pixels a side than the device allows,
    /// [`Error::Capacity`] if there is no memory for it. [`Error::Device`] for a depth image on a device that computes
    /// but does not draw: Vulkan lets such a device copy no depth.
    pub fn new(gpu: &Gpu, info: &ImageInfo<'_>) -> Result<Self> {
        let what = format!("image `{}` ({})", info.name, info.extent);
        let depth = info.format == Format::D32Float;
        let attached = info.usage == ImageUse::Attachment && gpu.has_graphics();
        if depth && !gpu.has_graphics() {
            return Err(Error::Device(format!(
                "{what} cannot be made on {}, which has no queue that both draws and computes: depth images need one",
                gpu.name()
            )));
        }
        let (side, of) = match attached {
            true => (gpu.limits().target_side_px, "targets"),
            false => (gpu.limits().image_side_px, "images"),
        };
        if info.extent.width.max(info.extent.height) > side {
            return Err(Error::Full(format!(
                "{what} is larger than {} allows: {of} have at most {side} pixels a side",
                gpu.name()
            )));
        }
        if info.extent.width.min(info.extent.height) == 0 {
            return Err(Error::Usage(format!(
                "{what} has a side without pixels: each side has at least one"
            )));
        }
        let most = info.extent.width.max(info.extent.height).ilog2() + 1;
        if !(1..=most).contains(&info.levels) {
            return Err(Error::Usage(format!(
                "{what} cannot have {} levels: an image of this size has 1 to {most}",
                info.levels
            )));
        }
        let shared = gpu.0.clone();
        let transfer = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
        let mut usage = match info.usage {
            ImageUse::Sampled | ImageUse::Attachment => vk::ImageUsageFlags::SAMPLED,
            ImageUse::Storage => vk::ImageUsageFlags::STORAGE,
        };
        if attached {
            usage |= match depth {
                true => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
                false => vk::ImageUsageFlags::COLOR_ATTACHMENT,
            };
        }
        let create = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk_format(info.format))
            .extent(vk::Extent3D { width: info.extent.width, height: info.extent.height, depth: 1 })
            .mip_levels(info.levels)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(usage | transfer)
            .sharing_mode(vk::SharingMode::EXCLUSIVE)
            .initial_layout(vk::ImageLayout::UNDEFINED);
        // SAFETY: the device is alive; `RawImage` owns the handle from here on.
        let handle = unsafe { shared.device.create_image(&create, None) }
            .map_err(|e| shared.failure(&format!("creating {what}"), e))?;
        let mut raw = RawImage {
            handle,
            view: vk::ImageView::null(),
            first_level: None,
            name: info.name.to_string(),
            extent: info.extent,
            format: info.format,
            levels: info.levels,
            usage: info.usage,
            allocation: None,
            gpu: shared.clone(),
        };
        // SAFETY: `handle` is alive and not yet bound; the memory was allocated for it.
        unsafe {
            let requirements = shared.device.get_image_memory_requirements(handle);
            let allocation =
                shared.allocate(&what, requirements, MemoryLocation::GpuOnly, false)?;
            let (memory, offset) = (allocation.memory(), allocation.offset());
            raw.allocation = Some(allocation);
            shared
                .device
                .bind_image_memory(handle, memory, offset)
                .map_err(|e| shared.failure(&format!("binding memory of {what}"), e))?;
            let view_of = |range| {
                let view = vk::ImageViewCreateInfo::default()
                    .image(handle)
                    .view_type(vk::ImageViewType::TYPE_2D)
                    .format(vk_format(info.format))
                    .subresource_range(range);
                shared
                    .device
                    .create_image_view(&view, None)
                    .map_err(|e| shared.failure(&format!("creating the view of {what}"), e))
            };
            raw.view = view_of(raw.range())?;
            if attached && info.levels > 1 {
                raw.first_level = Some(view_of(raw.range().level_count(1))?);
            }
        }
        shared.set_name(handle, info.name);
        let image = Self(Arc::new(raw));
        if info.usage == ImageUse::Attachment {
            let mut recorder = Recorder::new(gpu, "clear of a new image")?;
            recorder.clear_image(&image);
            recorder.submit()?;
        }
        Ok(image)
    }

    /// The present content of mip level `level`: copied by the device, and waited for.
    ///
    /// # Errors
    /// As [`Recorder::download_image`] and [`super::Recording::run`].
    pub fn download(&self, level: u32) -> Result<image::Image> {
        let mut recorder = Recorder::new(&Gpu(self.0.gpu.clone()), "download")?;
        let copy = recorder.download_image(self, level)?;
        recorder.submit()?;
        let extent = level_extent(self.extent(), level);
        Ok(image::Image { extent, format: self.format(), bytes: copy.read()? })
    }

    /// Replaces the content of all levels, from the largest down, and waits. [`Recorder::upload_image`] does not wait.
    ///
    /// # Errors
    /// As [`Recorder::upload_image`] and [`super::Recording::run`].
    pub fn upload<L: AsRef<[u8]>>(&self, levels: &[L]) -> Result<()> {
        let mut recorder = Recorder::new(&Gpu(self.0.gpu.clone()), "upload")?;
        recorder.upload_image(self, levels)?;
        recorder.submit()?;
        Ok(())
    }

    /// Size of level 0.
    pub fn extent(&self) -> Extent {
        self.0.extent
    }

    /// Layout of a texel.
    pub fn format(&self) -> Format {
        self.0.format
    }

    /// Whether `other` is the same image.
    pub fn is(&self, other: &Image) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }

    /// Mip levels.
    pub fn levels(&self) -> u32 {
        self.0.levels
    }

    /// What it was made for.
    pub fn usage(&self) -> ImageUse {
        self.0.usage
    }

    /// The name it was made with.
    pub fn name(&self) -> &str {
        &self.0.name
    }
}

impl Image {
    /// Refuses an image of another device.
    pub(crate) fn check_device(&self, gpu: &Gpu) -> Result<()> {
        same_device(self, gpu)
    }
}

impl std::fmt::Debug for Image {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Image `{}` of {} {:?}", self.0.name, self.0.extent, self.0.format)
    }
}

impl RawImage {
    pub fn aspect(&self) -> vk::ImageAspectFlags {
        match self.format {
            Format::D32Float => vk::ImageAspectFlags::DEPTH,
            Format::Rgba8Unorm | Format::Rgba8Srgb | Format::Rgba16Float => {
                vk::ImageAspectFlags::COLOR
            }
        }
    }

    /// All levels.
    pub fn range(&self) -> vk::ImageSubresourceRange {
        vk::ImageSubresourceRange::default()
            .aspect_mask(self.aspect())
            .level_count(self.levels)
            .layer_count(1)
    }

    /// The whole of one level, in the layout of a buffer without padding.
    pub fn copy_of_level(&self, level: u32, buffer_offset: u64) -> vk::BufferImageCopy {
        let extent = level_extent(self.extent, level);
        vk::BufferImageCopy::default()
            .buffer_offset(buffer_offset)
            .image_subresource(
                vk::ImageSubresourceLayers::default()
                    .aspect_mask(self.aspect())
                    .mip_level(level)
                    .layer_count(1),
            )
            .image_extent(vk::Extent3D { width: extent.width, height: extent.height, depth: 1 })
    }

    /// The view that passes draw to.
    pub fn target_view(&self) -> vk::ImageView {
        self.first_level.unwrap_or(self.view)
    }

    /// The layout between recordings, in which shaders find it.
    pub fn shader_layout(&self) -> vk::ImageLayout {
        match self.usage {
            ImageUse::Sampled | ImageUse::Attachment => vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL,
            ImageUse::Storage => vk::ImageLayout::GENERAL,
        }
    }
}

impl Drop for RawImage {
    fn drop(&mut self) {
        // SAFETY: the last handle goes; recordings and tables that use it hold it.
        unsafe {
            self.gpu.device.destroy_image_view(self.view, None);
            self.gpu.device.destroy_image_view(self.first_level.unwrap_or_default(), None);
            self.gpu.device.destroy_image(self.handle, None);
        }
        if let Some(allocation) = self.allocation.take() {
            self.gpu.free(allocation);
        }
    }
}

/// Size of mip level `level` of an image of `extent`.
pub(crate) fn level_extent(extent: Extent, level: u32) -> Extent {
    let shrink = |n: u32| n.checked_shr(level).unwrap_or(0).max(1);
    Extent::new(shrink(extent.width), shrink(extent.height))
}

pub(crate) fn vk_format(format: Format) -> vk::Format {
    match format {
        Format::Rgba8Unorm => vk::Format::R8G8B8A8_UNORM,
        Format::Rgba8Srgb => vk::Format::R8G8B8A8_SRGB,
        Format::Rgba16Float => vk::Format::R16G16B16A16_SFLOAT,
        Format::D32Float => vk::Format::D32_SFLOAT,
    }
}
