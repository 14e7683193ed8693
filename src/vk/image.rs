//! Images: sampled textures, storage images and attachments.

use super::{
    adopt::CallerImage,
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
    /// What Vulkan lets commands do with it.
    flags: vk::ImageUsageFlags,
    /// The layout between recordings.
    layout: vk::ImageLayout,
    allocation: Option<Allocation>,
    /// Whether it is the caller's.
    adopted: bool,
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
        let attached = info.usage == ImageUse::Attachment && gpu.has_graphics();
        RawImage::check_queue(gpu, &what, info.format)?;
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
        RawImage::check_size(&what, info.extent, info.levels)?;
        let shared = gpu.0.clone();
        let mut flags = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
        flags |= match info.usage {
            ImageUse::Sampled | ImageUse::Attachment => vk::ImageUsageFlags::SAMPLED,
            ImageUse::Storage => vk::ImageUsageFlags::STORAGE,
        };
        if attached {
            flags |= attachment_flag(info.format);
        }
        let create = vk::ImageCreateInfo::default()
            .image_type(vk::ImageType::TYPE_2D)
            .format(vk_format(info.format))
            .extent(vk::Extent3D { width: info.extent.width, height: info.extent.height, depth: 1 })
            .mip_levels(info.levels)
            .array_layers(1)
            .samples(vk::SampleCountFlags::TYPE_1)
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(flags)
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
            flags,
            layout: match info.usage {
                ImageUse::Sampled | ImageUse::Attachment => {
                    vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL
                }
                ImageUse::Storage => vk::ImageLayout::GENERAL,
            },
            allocation: None,
            adopted: false,
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
        }
        raw.make_views()?;
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
    /// An image of the caller.
    ///
    /// # Safety
    /// The image belongs to the device and was created with what `image` says.
    pub unsafe fn adopted(gpu: &Gpu, image: &CallerImage<'_>) -> Result<Self> {
        let mut raw = Self {
            handle: image.image,
            view: vk::ImageView::null(),
            first_level: None,
            name: image.name.to_string(),
            extent: image.extent,
            format: image.format,
            levels: image.levels,
            usage: ImageUse::Attachment,
            flags: image.usage,
            layout: image.layout,
            allocation: None,
            adopted: true,
            gpu: gpu.0.clone(),
        };
        raw.make_views()?;
        Ok(raw)
    }

    /// Refuses sizes that no image has.
    pub fn check_size(what: &str, extent: Extent, levels: u32) -> Result<()> {
        if extent.width.min(extent.height) == 0 {
            return Err(Error::Usage(format!(
                "{what} has a side without pixels: each side has at least one"
            )));
        }
        let most = extent.width.max(extent.height).ilog2() + 1;
        if !(1..=most).contains(&levels) {
            return Err(Error::Usage(format!(
                "{what} cannot have {levels} levels: an image of this size has 1 to {most}"
            )));
        }
        Ok(())
    }

    /// Refuses depth images where the queue does not draw.
    pub fn check_queue(gpu: &Gpu, what: &str, format: Format) -> Result<()> {
        if format == Format::D32Float && !gpu.has_graphics() {
            return Err(Error::Device(format!(
                "{what} cannot be made on {}, which has no queue that both draws and computes: depth images need one",
                gpu.name()
            )));
        }
        Ok(())
    }

    /// Makes the views that commands need.
    fn make_views(&mut self) -> Result<()> {
        let view_of = |range| {
            let view = vk::ImageViewCreateInfo::default()
                .image(self.handle)
                .view_type(vk::ImageViewType::TYPE_2D)
                .format(vk_format(self.format))
                .subresource_range(range);
            // SAFETY: the image is alive, has its memory, and has these levels.
            let view = unsafe { self.gpu.device.create_image_view(&view, None) };
            view.map_err(|e| {
                let what = format!("creating the view of image `{}` ({})", self.name, self.extent);
                self.gpu.failure(&what, e)
            })
        };
        let attached = self.flags.contains(attachment_flag(self.format));
        // Vulkan makes no views of images that are only copied.
        let in_shaders = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE;
        if attached || self.flags.intersects(in_shaders) {
            self.view = view_of(self.range())?;
        }
        if attached && self.levels > 1 {
            self.first_level = Some(view_of(self.range().level_count(1))?);
        }
        Ok(())
    }

    /// Refuses commands that the image was not created for, which are those that `use` it.
    pub fn check_flags(&self, flags: vk::ImageUsageFlags, used: &str) -> Result<()> {
        let missing = flags & !self.flags;
        match missing.is_empty() {
            true => Ok(()),
            false => Err(Error::Usage(format!(
                "image `{}` cannot be {used}: it was created without the usage {missing:?}",
                self.name
            ))),
        }
    }

    /// Refuses to sample an image that shaders may not sample.
    pub fn check_sampled(&self) -> Result<()> {
        self.check_flags(vk::ImageUsageFlags::SAMPLED, "sampled")?;
        match self.layout {
            vk::ImageLayout::SHADER_READ_ONLY_OPTIMAL
            | vk::ImageLayout::READ_ONLY_OPTIMAL
            | vk::ImageLayout::GENERAL => Ok(()),
            layout => Err(Error::Usage(format!(
                "image `{}` cannot be sampled: it is in the layout {layout:?}, and shaders sample images in \
                 SHADER_READ_ONLY_OPTIMAL, READ_ONLY_OPTIMAL or GENERAL",
                self.name
            ))),
        }
    }

    /// Refuses to load from an image or to store to it, if it was not created for that.
    pub fn check_copied(&self, loads: bool, stores: bool) -> Result<()> {
        if loads {
            self.check_flags(vk::ImageUsageFlags::TRANSFER_SRC, "loaded or downloaded")?;
        }
        if stores {
            self.check_flags(vk::ImageUsageFlags::TRANSFER_DST, "stored to or uploaded")?;
        }
        Ok(())
    }

    /// Refuses to attach an image that the device cannot draw to.
    pub fn check_attached(&self) -> Result<()> {
        self.check_flags(attachment_flag(self.format), "drawn to by the device itself")
    }

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
        self.layout
    }
}

impl Drop for RawImage {
    fn drop(&mut self) {
        // SAFETY: the last handle goes; recordings and tables that use it hold it.
        unsafe {
            self.gpu.device.destroy_image_view(self.view, None);
            self.gpu.device.destroy_image_view(self.first_level.unwrap_or_default(), None);
            if !self.adopted {
                self.gpu.device.destroy_image(self.handle, None);
            }
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

/// The usage of an image that the device draws to itself.
fn attachment_flag(format: Format) -> vk::ImageUsageFlags {
    match format {
        Format::D32Float => vk::ImageUsageFlags::DEPTH_STENCIL_ATTACHMENT,
        Format::Rgba8Unorm | Format::Rgba8Srgb | Format::Rgba16Float => {
            vk::ImageUsageFlags::COLOR_ATTACHMENT
        }
    }
}

pub(crate) fn vk_format(format: Format) -> vk::Format {
    match format {
        Format::Rgba8Unorm => vk::Format::R8G8B8A8_UNORM,
        Format::Rgba8Srgb => vk::Format::R8G8B8A8_SRGB,
        Format::Rgba16Float => vk::Format::R16G16B16A16_SFLOAT,
        Format::D32Float => vk::Format::D32_SFLOAT,
    }
}
