//! Fills and copies of buffers and images.

use super::{
    buffer::{Buffer, Memory},
    image::{Image, ImageUse, Subresource},
    owner::same_device,
    recorder::Recorder,
};
use crate::{
    error::{Error, Result},
    format::Format,
};
use ash::vk;
use bytemuck::Pod;
use std::ops::Range;

/// The layout of an image whose next command copies something into it.
const WRITTEN: vk::ImageLayout = vk::ImageLayout::TRANSFER_DST_OPTIMAL;
/// The layout of an image whose next command copies something out of it.
const READ: vk::ImageLayout = vk::ImageLayout::TRANSFER_SRC_OPTIMAL;

impl Recorder {
    /// Fills all of `buffer` with `word`.
    ///
    /// # Errors
    /// [`Error::Usage`] if it does not start and end at a whole word.
    pub fn fill<T: Pod>(&mut self, buffer: &Buffer<T>, word: u32) -> Result<()> {
        same_device(self, buffer)?;
        let (raw, offset) = (buffer.raw().clone(), buffer.offset());
        if buffer.bytes() == 0 {
            return Ok(());
        }
        if !offset.is_multiple_of(4) || !buffer.bytes().is_multiple_of(4) {
            let (name, bytes) = (buffer.name(), buffer.bytes());
            let fault = format!(
                "{bytes} bytes of buffer `{name}` from byte {offset} on are not whole words"
            );
            return Err(Error::Usage(format!("{fault}: a fill writes words of 4 bytes")));
        }
        self.barrier();
        // SAFETY: the range is whole words inside the buffer.
        unsafe {
            self.gpu.0.device.cmd_fill_buffer(
                self.commands.raw,
                raw.handle,
                offset,
                buffer.bytes(),
                word,
            );
        }
        self.commands.keep(raw);
        Ok(())
    }

    /// Copies all of `from` to the start of `to`.
    ///
    /// # Errors
    /// [`Error::Usage`] if it does not fit, or if both are in one buffer and overlap.
    pub fn copy<T: Pod>(&mut self, from: &Buffer<T>, to: &Buffer<T>) -> Result<()> {
        same_device(self, from)?;
        same_device(self, to)?;
        if from.len() > to.len() {
            return Err(Error::Usage(format!(
                "{} elements of buffer `{}` do not fit into the {} of `{}`",
                from.len(),
                from.name(),
                to.len(),
                to.name()
            )));
        }
        if from.bytes() == 0 {
            return Ok(());
        }
        let distance = from.offset().abs_diff(to.offset());
        if from.raw().handle == to.raw().handle && distance < from.bytes() {
            let (name, bytes, at, to) = (from.name(), from.bytes(), from.offset(), to.offset());
            return Err(Error::Usage(format!(
                "{bytes} bytes of buffer `{name}` cannot be copied from byte {at} to byte {to}, since the two ranges \
                 overlap: copy through another buffer"
            )));
        }
        self.barrier();
        let region = [vk::BufferCopy::default()
            .src_offset(from.offset())
            .dst_offset(to.offset())
            .size(from.bytes())];
        // SAFETY: both ranges are inside their buffers.
        unsafe {
            let (from, to) = (from.raw().handle, to.raw().handle);
            self.gpu.0.device.cmd_copy_buffer(self.commands.raw, from, to, &region);
        }
        self.commands.keep(from.raw().clone());
        self.commands.keep(to.raw().clone());
        Ok(())
    }

    /// Copies `content` to the start of `buffer` when the recording runs.
    ///
    /// # Errors
    /// As [`Recorder::copy`].
    pub fn upload<T: Pod>(&mut self, buffer: &Buffer<T>, content: &[T]) -> Result<()> {
        let name = format!("upload of {}", buffer.name());
        let staging = Buffer::with_content(&self.gpu, &name, content)?;
        self.copy(&staging, buffer)
    }

    /// Copies all of `buffer` to memory that can be [read](Buffer::read) once the recording has run.
    ///
    /// # Errors
    /// [`Error::Capacity`] without memory for the copy.
    pub fn download<T: Pod>(&mut self, buffer: &Buffer<T>) -> Result<Buffer<T>> {
        let name = format!("download of {}", buffer.name());
        let copy = Buffer::new(&self.gpu, &name, buffer.len(), Memory::Readback)?;
        self.copy(buffer, &copy)?;
        Ok(copy)
    }

    /// Uploads levels of `image`, from the largest down, and leaves it as shaders expect it. Levels below those that are given
    /// keep what they hold, until [`Recorder::make_levels`] makes them, for example.
    ///
    /// # Errors
    /// [`Error::Usage`] if there is no level, if the image has fewer or its levels have other sizes, or if a depth is outside
    /// 0..=1.
    pub fn upload_image<L: AsRef<[u8]>>(&mut self, image: &Image, levels: &[L]) -> Result<()> {
        same_device(self, image)?;
        let raw = &image.0;
        if !(1..=raw.levels as usize).contains(&levels.len()) {
            let (name, has, given) = (&raw.name, raw.levels, levels.len());
            return Err(Error::Usage(format!(
                "image `{name}` has {has} levels, not {given}: upload one or more, from level 0 on"
            )));
        }
        raw.check_copied(false, true)?;
        // Vulkan wants each level of depths at a multiple of four bytes.
        let room = |bytes: usize| bytes.next_multiple_of(4);
        let total = levels.iter().map(|level| room(level.as_ref().len())).sum();
        let name = format!("upload of {}", raw.name);
        let staging = Buffer::<u8>::new(&self.gpu, &name, total, Memory::Mapped)?;
        let (mut regions, mut at) = (Vec::new(), 0);
        for (n, level) in levels.iter().enumerate() {
            let level = level.as_ref();
            let region = raw.copy_of_level(n as u32, at as u64);
            let bytes = raw.level_bytes(n as u32);
            if level.len() != bytes {
                return Err(Error::Usage(format!(
                    "image `{}` has {bytes} bytes in level {n}, not {}",
                    raw.name,
                    level.len()
                )));
            }
            check_depths(image, level)?;
            // SAFETY: nobody else has the buffer yet.
            unsafe { staging.write_out_of_turn(at, level)? };
            at += room(bytes);
            regions.push(region);
        }
        // Of depths and stencil values, the copy replaces the depths alone.
        let has_other = raw.format.is_depth() && raw.format.is_stencil();
        let before = match levels.len() == raw.levels as usize && !has_other {
            true => vk::ImageLayout::UNDEFINED,
            false => raw.shader_layout(),
        };
        self.transition(image, before, WRITTEN);
        // SAFETY: the regions are the image's levels, and lie in `staging` one after the other.
        unsafe {
            let (from, to) = (staging.raw().handle, raw.handle);
            self.gpu.0.device.cmd_copy_buffer_to_image(
                self.commands.raw,
                from,
                to,
                WRITTEN,
                &regions,
            );
        }
        self.transition(image, WRITTEN, raw.shader_layout());
        self.commands.keep(staging.raw().clone());
        Ok(())
    }

    /// Makes all mip levels of `image` below level 0, each of the one above, by the linear filter of the device. So their
    /// texels may differ a little from device to device.
    ///
    /// # Errors
    /// [`Error::Usage`] if the image was made for [`ImageUse::Sampled`] or holds depths or integers; [`Error::Device`] if
    /// the device does not filter the format, or computes but does not draw: Vulkan lets such a device filter nothing.
    pub fn make_levels(&mut self, image: &Image) -> Result<()> {
        same_device(self, image)?;
        let raw = &image.0;
        if raw.usage == ImageUse::Sampled || !raw.format.is_color() || raw.format.is_integer() {
            return Err(Error::Usage(format!(
                "image `{}` ({:?}, `ImageUse::{:?}`) gets no levels: they are made of colours that are no integers, in images that are made \
                 with `ImageUse::Attachment` or `ImageUse::Storage`",
                raw.name, raw.format, raw.usage
            )));
        }
        raw.check_copied(true, true)?;
        if !self.gpu.has_graphics() {
            return Err(Error::Device(format!(
                "{} makes no mip levels of image `{}`, since it has no queue that both draws and computes: upload them",
                self.gpu.name(),
                raw.name
            )));
        }
        if !self.gpu.0.makes_levels_of(raw.format) {
            return Err(Error::Device(format!(
                "{} makes no mip levels of image `{}`, since it filters no {:?}: upload them",
                self.gpu.name(),
                raw.name,
                raw.format
            )));
        }
        self.transition(image, raw.shader_layout(), WRITTEN);
        let corner = |level| {
            let vk::Extent3D { width, height, depth } = raw.vk_extent(level);
            vk::Offset3D { x: width as i32, y: height as i32, z: depth as i32 }
        };
        for level in 1..raw.levels {
            let region = [vk::ImageBlit::default()
                .src_subresource(raw.layers(level - 1))
                .src_offsets([vk::Offset3D::default(), corner(level - 1)])
                .dst_subresource(raw.layers(level))
                .dst_offsets([vk::Offset3D::default(), corner(level)])];
            // Also a barrier: a level needs the one above.
            self.commands.transition_levels(raw, level - 1..level, WRITTEN, READ);
            // SAFETY: the levels are in these layouts; the image is kept by the transition. The queue draws, and the
            // device filters the format.
            unsafe {
                let (device, commands) = (&self.gpu.0.device, self.commands.raw);
                let (image, filter) = (raw.handle, vk::Filter::LINEAR);
                device.cmd_blit_image(commands, image, READ, image, WRITTEN, &region, filter);
            }
        }
        let (last, rest) = (raw.levels - 1, raw.shader_layout());
        if last > 0 {
            self.commands.transition_levels(raw, 0..last, READ, rest);
        }
        self.commands.transition_levels(raw, last..last + 1, WRITTEN, rest);
        Ok(())
    }

    /// Copies mip level `level` of `image` to memory that can be [read](Buffer::read) once the recording has run: layer after
    /// layer or slice after slice, rows from top to bottom, no padding.
    ///
    /// # Errors
    /// [`Error::Usage`] if the image was made for [`ImageUse::Sampled`] or has no such level; [`Error::Capacity`]
    /// without memory for the copy.
    pub fn download_image(&mut self, image: &Image, level: u32) -> Result<Buffer<u8>> {
        let raw = &image.0;
        raw.check_subresource(Subresource { level, ..Subresource::default() })?;
        let name = format!("download of {}", image.name());
        let copy = Buffer::new(&self.gpu, &name, raw.level_bytes(level), Memory::Readback)?;
        raw.check_copied(true, false)?;
        self.check_content(image)?;
        let region = [raw.copy_of_level(level, 0)];
        self.copy_regions_from_image(image, &region, &copy);
        Ok(copy)
    }

    /// Copies `rows` of a subresource of `image` to the start of `to`.
    ///
    /// # Errors
    /// As [`Recorder::download_image`].
    pub(crate) fn copy_from_image(
        &mut self,
        image: &Image,
        subresource: Subresource,
        rows: Range<u32>,
        to: &Buffer<u8>,
    ) -> Result<()> {
        image.0.check_copied(true, false)?;
        let region = [self.copy_of_rows(image, subresource, rows, to)?];
        self.copy_regions_from_image(image, &region, to);
        Ok(())
    }

    /// Copies `regions`, which are in `image`, and for which `to` has room.
    fn copy_regions_from_image(
        &mut self,
        image: &Image,
        regions: &[vk::BufferImageCopy],
        to: &Buffer<u8>,
    ) {
        self.barrier();
        self.transition(image, image.0.shader_layout(), READ);
        // SAFETY: the regions are in the image, and the buffer has room for them.
        unsafe {
            let (from, to) = (image.0.handle, to.raw().handle);
            self.gpu.0.device.cmd_copy_image_to_buffer(self.commands.raw, from, READ, to, regions);
        }
        self.transition(image, READ, image.0.shader_layout());
        self.commands.keep(to.raw().clone());
    }

    /// Copies the first elements of `from` to `rows` of a subresource of `image`. If it holds depths, these are in 0..=1.
    ///
    /// # Errors
    /// As [`Recorder::download_image`].
    pub(crate) fn copy_to_image(
        &mut self,
        from: &Buffer<u8>,
        image: &Image,
        subresource: Subresource,
        rows: Range<u32>,
    ) -> Result<()> {
        image.0.check_copied(false, true)?;
        let region = [self.copy_of_rows(image, subresource, rows, from)?];
        self.barrier();
        self.transition(image, image.0.shader_layout(), WRITTEN);
        // SAFETY: the rows are in the image, and the buffer has all of them.
        unsafe {
            let (from, to) = (from.raw().handle, image.0.handle);
            self.gpu.0.device.cmd_copy_buffer_to_image(
                self.commands.raw,
                from,
                to,
                WRITTEN,
                &region,
            );
        }
        self.transition(image, WRITTEN, image.0.shader_layout());
        self.commands.keep(from.raw().clone());
        Ok(())
    }

    /// Refuses to copy from images that may have no content.
    fn check_content(&self, image: &Image) -> Result<()> {
        same_device(self, image)?;
        match image.usage() {
            ImageUse::Attachment | ImageUse::Storage => Ok(()),
            ImageUse::Sampled => Err(Error::Usage(format!(
                "image `{}` may have no content yet: it was made with `ImageUse::Sampled`, and only those for \
                 `ImageUse::Attachment` or `ImageUse::Storage` are copied",
                image.name()
            ))),
        }
    }

    /// The copy between `rows` of a subresource of `image` and the start of `buffer`.
    fn copy_of_rows(
        &self,
        image: &Image,
        subresource: Subresource,
        rows: Range<u32>,
        buffer: &Buffer<u8>,
    ) -> Result<vk::BufferImageCopy> {
        same_device(self, buffer)?;
        self.check_content(image)?;
        let raw = &image.0;
        raw.check_subresource(subresource)?;
        let extent = raw.extent.level(subresource.level);
        let texel = subresource.format(raw.format).texel_bytes();
        let bytes = rows.len() * extent.width as usize * texel;
        if rows.is_empty() || rows.end > extent.height || buffer.len() < bytes {
            return Err(Error::Usage(format!(
                "rows {rows:?} of image `{}` ({extent}) and {} bytes of buffer `{}` do not fit together",
                raw.name,
                buffer.len(),
                buffer.name()
            )));
        }
        Ok(raw.copy_of_rows(subresource, rows, buffer.offset()))
    }

    /// Fills a new image with zeros, and leaves it as shaders expect it.
    pub(super) fn clear_image(&mut self, image: &Image) {
        let raw = &image.0;
        self.transition(image, vk::ImageLayout::UNDEFINED, WRITTEN);
        let (device, commands, range) = (&self.gpu.0.device, self.commands.raw, [raw.range()]);
        // SAFETY: the image is in that layout and kept by the transition. The queue draws, if it is a depth image.
        unsafe {
            match raw.format.is_color() {
                false => {
                    let zeros = vk::ClearDepthStencilValue::default();
                    device.cmd_clear_depth_stencil_image(
                        commands, raw.handle, WRITTEN, &zeros, &range,
                    );
                }
                true => {
                    // The bits of zero are the same in floats and in integers.
                    let zeros = vk::ClearColorValue::default();
                    device.cmd_clear_color_image(commands, raw.handle, WRITTEN, &zeros, &range);
                }
            }
        }
        self.transition(image, WRITTEN, raw.shader_layout());
    }
}

/// Refuses depths that Vulkan lets no copy write into `image`.
fn check_depths(image: &Image, level: &[u8]) -> Result<()> {
    // Depths of fewer bits are numbers, which are in 0..=1 whatever their bits are.
    if image.format().without_stencil() != Format::D32Float {
        return Ok(());
    }
    let depths = level.chunks_exact(4).map(bytemuck::pod_read_unaligned::<f32>);
    match depths.into_iter().find(|depth| !(0.0..=1.0).contains(depth)) {
        Some(depth) => Err(Error::Usage(format!(
            "a depth of {depth} cannot be uploaded to image `{}`: depths are in 0..=1",
            image.name()
        ))),
        None => Ok(()),
    }
}
