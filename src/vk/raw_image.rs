//! The image of Vulkan behind an [`Image`](super::Image): its memory, its views, and what commands may do with it.

use super::{
    adopt::CallerImage,
    format::{aspect, aspects, attachment_flag, vk_format},
    gpu::{Gpu, Shared},
    image::{Aspect, ImageInfo, ImageUse, Subresource},
};
use crate::{
    error::{Error, Result},
    format::Format,
    image::{Extent, Shape},
    samples::Samples,
};
use ash::vk;
use gpu_allocator::{MemoryLocation, vulkan::Allocation};
use rspirv::spirv::Capability;
use std::{
    collections::HashMap,
    ops::Range,
    sync::{Arc, Mutex, PoisonError},
};

/// An image of Vulkan.
pub(crate) struct RawImage {
    pub handle: vk::Image,
    /// All levels and layers.
    pub view: vk::ImageView,
    /// Single subresources that the device has drawn to.
    targets: Mutex<HashMap<Subresource, vk::ImageView>>,
    pub name: String,
    pub extent: Extent,
    pub shape: Shape,
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

impl RawImage {
    /// A new image without content.
    pub fn new(gpu: &Gpu, info: &ImageInfo<'_>) -> Result<Self> {
        let what = format!("image `{}` ({})", info.name, info.extent);
        Self::check(gpu, &what, (info.extent, info.shape, info.levels), info.format)?;
        let attached =
            info.usage != ImageUse::Sampled && gpu.has_graphics() && gpu.0.draws_to(info.format);
        if attached && info.extent.width.max(info.extent.height) > gpu.limits().target_side_px {
            return Err(Error::Full(format!(
                "{what} is larger than {} allows: targets have at most {} pixels a side",
                gpu.name(),
                gpu.limits().target_side_px
            )));
        }
        let shared = gpu.0.clone();
        let mut flags = vk::ImageUsageFlags::TRANSFER_SRC | vk::ImageUsageFlags::TRANSFER_DST;
        flags |= match info.usage {
            ImageUse::Sampled | ImageUse::Attachment => vk::ImageUsageFlags::SAMPLED,
            ImageUse::Storage => vk::ImageUsageFlags::STORAGE | vk::ImageUsageFlags::SAMPLED,
        };
        if attached {
            flags |= attachment_flag(info.format);
        }
        if info.samples != Samples::One {
            flags = attachment_flag(info.format);
        }
        let create = vk::ImageCreateInfo::default()
            .flags(match info.shape {
                Shape::Cube | Shape::CubeArray(_) => vk::ImageCreateFlags::CUBE_COMPATIBLE,
                Shape::D3(_) if attached => vk::ImageCreateFlags::TYPE_2D_ARRAY_COMPATIBLE,
                _ => vk::ImageCreateFlags::empty(),
            })
            .image_type(match info.shape {
                Shape::D1 | Shape::D1Array(_) => vk::ImageType::TYPE_1D,
                Shape::D3(_) => vk::ImageType::TYPE_3D,
                Shape::D2 | Shape::D2Array(_) | Shape::Cube | Shape::CubeArray(_) => {
                    vk::ImageType::TYPE_2D
                }
            })
            .format(vk_format(info.format))
            .extent(vk::Extent3D {
                width: info.extent.width,
                height: info.extent.height,
                depth: info.shape.slices(0),
            })
            .mip_levels(info.levels)
            .array_layers(info.shape.layers())
            .samples(vk::SampleCountFlags::from_raw(info.samples.count()))
            .tiling(vk::ImageTiling::OPTIMAL)
            .usage(flags)
            .sharing_mode(vk::SharingMode::EXCLUSIVE)
            .initial_layout(vk::ImageLayout::UNDEFINED);
        shared.check_offered(&what, info, &create)?;
        // SAFETY: the device is alive; `RawImage` owns the handle from here on.
        let handle = unsafe { shared.device.create_image(&create, None) }
            .map_err(|e| shared.failure(&format!("creating {what}"), e))?;
        let mut raw = RawImage {
            handle,
            view: vk::ImageView::null(),
            targets: Mutex::default(),
            name: info.name.to_string(),
            extent: info.extent,
            shape: info.shape,
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
        raw.make_view()?;
        shared.set_name(handle, info.name);
        Ok(raw)
    }

    /// An image of the caller.
    ///
    /// # Safety
    /// The image belongs to the device and was created with what `image` says.
    pub unsafe fn adopted(gpu: &Gpu, image: &CallerImage<'_>) -> Result<Self> {
        let what = format!("image `{}` ({})", image.name, image.extent);
        Self::check(gpu, &what, (image.extent, image.shape, image.levels), image.format)?;
        if [vk::ImageLayout::UNDEFINED, vk::ImageLayout::PREINITIALIZED].contains(&image.layout) {
            return Err(Error::Usage(format!(
                "{what} is said to be in the layout {:?}, into which no command brings an image: say in which layout \
                 passes find it and leave it",
                image.layout
            )));
        }
        let mut raw = Self {
            handle: image.image,
            view: vk::ImageView::null(),
            targets: Mutex::default(),
            name: image.name.to_string(),
            extent: image.extent,
            shape: image.shape,
            format: image.format,
            levels: image.levels,
            usage: match image.usage.contains(vk::ImageUsageFlags::STORAGE) {
                true if image.layout == vk::ImageLayout::GENERAL => ImageUse::Storage,
                _ => ImageUse::Attachment,
            },
            flags: image.usage,
            layout: image.layout,
            allocation: None,
            adopted: true,
            gpu: gpu.0.clone(),
        };
        raw.make_view()?;
        Ok(raw)
    }

    /// Refuses what no device, or not this one, has images of.
    fn check(
        gpu: &Gpu,
        what: &str,
        (extent, shape, levels): (Extent, Shape, u32),
        format: Format,
    ) -> Result<()> {
        if extent.width.max(extent.height) > gpu.limits().image_side_px {
            return Err(Error::Full(format!(
                "{what} is larger than {} allows: images have at most {} pixels a side",
                gpu.name(),
                gpu.limits().image_side_px
            )));
        }
        shape.check(extent).map_err(|fault| Error::Usage(format!("{what} {fault}")))?;
        let most = shape.most_levels(extent);
        if !(1..=most).contains(&levels) {
            return Err(Error::Usage(format!(
                "{what} cannot have {levels} levels: an image of this size has 1 to {most}"
            )));
        }
        if !format.is_color() && !gpu.has_graphics() {
            return Err(Error::Device(format!(
                "{what} cannot be made on {}, which has no queue that both draws and computes: images of depths or stencil values need one",
                gpu.name()
            )));
        }
        let cubes = matches!(shape, Shape::CubeArray(_));
        let lacks = |(lacking, _): &(Capability, &str)| *lacking == Capability::SampledCubeArray;
        if cubes && gpu.0.lacking.iter().any(lacks) {
            return Err(Error::Device(format!(
                "{what} cannot be made on {}, which has no arrays of cubes, or was opened without the feature imageCubeArray",
                gpu.name()
            )));
        }
        Ok(())
    }

    /// Makes the view that shaders need.
    fn make_view(&mut self) -> Result<()> {
        // Vulkan makes no views of images that are only copied.
        let in_shaders = vk::ImageUsageFlags::SAMPLED | vk::ImageUsageFlags::STORAGE;
        if self.flags.intersects(in_shaders) {
            let kind = match self.shape {
                Shape::D1 => vk::ImageViewType::TYPE_1D,
                Shape::D1Array(_) => vk::ImageViewType::TYPE_1D_ARRAY,
                Shape::D2 => vk::ImageViewType::TYPE_2D,
                Shape::D2Array(_) => vk::ImageViewType::TYPE_2D_ARRAY,
                Shape::D3(_) => vk::ImageViewType::TYPE_3D,
                Shape::Cube => vk::ImageViewType::CUBE,
                Shape::CubeArray(_) => vk::ImageViewType::CUBE_ARRAY,
            };
            let range = self.range().aspect_mask(aspect(self.format, Aspect::Main));
            self.view = self.new_view(kind, range)?;
        }
        Ok(())
    }

    fn new_view(
        &self,
        kind: vk::ImageViewType,
        range: vk::ImageSubresourceRange,
    ) -> Result<vk::ImageView> {
        let view = vk::ImageViewCreateInfo::default()
            .image(self.handle)
            .view_type(kind)
            .format(vk_format(self.format))
            .subresource_range(range);
        // SAFETY: the image is alive, has its memory, and has these levels and layers.
        let view = unsafe { self.gpu.device.create_image_view(&view, None) };
        view.map_err(|e| {
            let what = format!("creating the view of image `{}` ({})", self.name, self.extent);
            self.gpu.failure(&what, e)
        })
    }

    /// The view of a subresource that the device draws to, which is made if there is none yet.
    ///
    /// # Errors
    /// [`Error::Device`] if the device draws to no image of this format; [`Error::Usage`] if the image was not created for
    /// that; [`Error::Full`] without room for a view.
    pub fn target_view(&self, subresource: Subresource) -> Result<vk::ImageView> {
        if !self.gpu.draws_to(self.format) {
            return Err(Error::Device(format!(
                "image `{}`: {} itself draws to no image of {:?}; the compute executor does",
                self.name, self.gpu.info.name, self.format
            )));
        }
        self.check_flags(attachment_flag(self.format), "drawn to by the device itself")?;
        if self.adopted && matches!(self.shape, Shape::D3(_)) {
            return Err(Error::Usage(format!(
                "image `{}` of the caller has three dimensions: the device itself draws to no slice of it",
                self.name
            )));
        }
        let mut targets = self.targets.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(view) = targets.get(&subresource) {
            return Ok(*view);
        }
        let kind = match self.shape {
            Shape::D1 | Shape::D1Array(_) => vk::ImageViewType::TYPE_1D,
            _ => vk::ImageViewType::TYPE_2D,
        };
        let range = self.range().base_mip_level(subresource.level).level_count(1);
        let view = self.new_view(kind, range.base_array_layer(subresource.layer).layer_count(1))?;
        targets.insert(subresource, view);
        Ok(view)
    }

    /// Refuses subresources that the image does not have.
    pub fn check_subresource(&self, Subresource { level, layer, .. }: Subresource) -> Result<()> {
        if level >= self.levels {
            let (name, levels) = (&self.name, self.levels);
            return Err(Error::Usage(format!(
                "image `{name}` has {levels} levels, and no level {level}"
            )));
        }
        let pictures = self.shape.pictures(level);
        if layer >= pictures {
            let name = &self.name;
            return Err(Error::Usage(format!(
                "level {level} of image `{name}` has {pictures} layers or slices, and no number {layer}"
            )));
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

    /// All levels and layers.
    pub fn range(&self) -> vk::ImageSubresourceRange {
        vk::ImageSubresourceRange::default()
            .aspect_mask(aspects(self.format))
            .level_count(self.levels)
            .layer_count(self.shape.layers())
    }

    /// All layers of one level, and all aspects but the stencil values beside depths.
    pub fn layers(&self, level: u32) -> vk::ImageSubresourceLayers {
        vk::ImageSubresourceLayers::default()
            .aspect_mask(aspect(self.format, Aspect::Main))
            .mip_level(level)
            .layer_count(self.shape.layers())
    }

    /// Bytes of one level: layer after layer or slice after slice, without padding.
    pub fn level_bytes(&self, level: u32) -> usize {
        let picture = self.extent.level(level).pixels() * self.format.texel_bytes();
        picture * self.shape.pictures(level) as usize
    }

    /// The whole of one level, as [`RawImage::level_bytes`] has it.
    pub fn copy_of_level(&self, level: u32, buffer_offset: u64) -> vk::BufferImageCopy {
        vk::BufferImageCopy::default()
            .buffer_offset(buffer_offset)
            .image_subresource(self.layers(level))
            .image_extent(self.vk_extent(level))
    }

    /// Rows of one subresource, without padding.
    pub fn copy_of_rows(
        &self,
        subresource: Subresource,
        rows: Range<u32>,
        buffer_offset: u64,
    ) -> vk::BufferImageCopy {
        let mut copy = self.copy_of_level(subresource.level, buffer_offset);
        match self.shape {
            Shape::D3(_) => copy.image_offset.z = subresource.layer as i32,
            _ => copy.image_subresource.base_array_layer = subresource.layer,
        }
        copy.image_subresource.aspect_mask = aspect(self.format, subresource.aspect);
        copy.image_subresource.layer_count = 1;
        copy.image_offset.y = rows.start as i32;
        copy.image_extent.height = rows.len() as u32;
        copy.image_extent.depth = 1;
        copy
    }

    /// Texels of one level: width, height, slices.
    pub fn vk_extent(&self, level: u32) -> vk::Extent3D {
        let Extent { width, height } = self.extent.level(level);
        vk::Extent3D { width, height, depth: self.shape.slices(level) }
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
            for (_, view) in self.targets.get_mut().unwrap_or_else(PoisonError::into_inner).drain()
            {
                self.gpu.device.destroy_image_view(view, None);
            }
            if !self.adopted {
                self.gpu.device.destroy_image(self.handle, None);
            }
        }
        if let Some(allocation) = self.allocation.take() {
            self.gpu.free(allocation);
        }
    }
}

impl Shared {
    /// Refuses images that the device does not offer, although its limits allow them.
    fn check_offered(
        &self,
        what: &str,
        info: &ImageInfo<'_>,
        create: &vk::ImageCreateInfo<'_>,
    ) -> Result<()> {
        // SAFETY: the physical device belongs to the instance.
        let offered = unsafe {
            self.instance.raw.get_physical_device_image_format_properties(
                self.physical,
                create.format,
                create.image_type,
                create.tiling,
                create.usage,
                create.flags,
            )
        };
        let name = &self.info.name;
        let offered = offered.map_err(|e| match e {
            vk::Result::ERROR_FORMAT_NOT_SUPPORTED => Error::Device(format!(
                "{what} cannot be made on {name}, which has no images {:?} of {:?} for `ImageUse::{:?}`",
                info.shape, info.format, info.usage
            )),
            e => self.failure(&format!("asking for {what}"), e),
        })?;
        if !offered.sample_counts.contains(create.samples) {
            return Err(Error::Device(format!(
                "{what} cannot be made on {name}, which draws to no images of {:?} with {} samples; the compute executor does",
                info.format,
                info.samples.count()
            )));
        }
        let (most, extent) = (offered.max_extent, create.extent);
        let larger = extent.width > most.width || extent.height > most.height;
        if larger || extent.depth > most.depth || create.array_layers > offered.max_array_layers {
            return Err(Error::Full(format!(
                "{what} is larger than {name} allows: images {:?} of {:?} have at most {}x{}x{} texels and {} layers",
                info.shape,
                info.format,
                most.width,
                most.height,
                most.depth,
                offered.max_array_layers
            )));
        }
        Ok(())
    }
}
