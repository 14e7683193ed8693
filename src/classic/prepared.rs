//! A pass that is ready to run: targets, recorded draws, and the copy that reads them back.

use super::{bindings::Bindings, layout::STAGES, pipeline::Compiled};
use crate::{
    error::{Error, Result},
    format::Format,
    image::{self, Extent},
    pass::{Draw, Frame, IndexFormat, Pass},
    state::{Rect, Viewport},
    vk::{Buffer, Copies, Gpu, Image, ImageInfo, ImageUse, Memory, Recorder, Recording, Resources},
};
use ash::vk;
use std::sync::Arc;

/// A pass that is ready to run, as often as wanted.
pub struct Prepared {
    draws: Recording,
    color: Target,
    depth: Option<Target>,
    extent: Extent,
    /// Whether the targets have content, and the layout that copies expect.
    executed: bool,
}

/// A target and where the host reads it.
struct Target {
    image: Image,
    host: Buffer<u8>,
    /// Fills `host`. Not part of the draws, so that their time does not include it.
    copy: Recording,
}

impl Prepared {
    pub(super) fn new(
        gpu: &Gpu,
        resources: &mut Resources,
        pass: &Pass,
        compiled: &[Arc<Compiled>],
    ) -> Result<Self> {
        let color = Target::new(gpu, pass.extent, pass.color.format, "colour target")?;
        let depth = match pass.depth {
            Some(_) => Some(Target::new(gpu, pass.extent, Format::D32Float, "depth target")?),
            None => None,
        };
        let draws = recorded(gpu, resources, pass, compiled, &color, depth.as_ref())?;
        Ok(Self { draws, color, depth, extent: pass.extent, executed: false })
    }

    /// Replaces the draws by those of `pass`, whose targets are those that are here.
    #[cfg(feature = "scene")] // for `bench`
    pub(super) fn record(
        &mut self,
        gpu: &Gpu,
        resources: &mut Resources,
        pass: &Pass,
        compiled: &[Arc<Compiled>],
    ) -> Result<()> {
        self.draws = recorded(gpu, resources, pass, compiled, &self.color, self.depth.as_ref())?;
        Ok(())
    }

    /// Clears and draws everything; returns the device's time for it in nanoseconds (0 if it has no
    /// timestamps).
    ///
    /// # Errors
    /// [`crate::Error::Lost`] if the device was lost or did not answer in time.
    pub fn execute(&mut self) -> Result<u64> {
        let timings = self.draws.run()?;
        self.executed = true;
        Ok(timings.total_ns)
    }

    /// The targets after the last [`Prepared::execute`].
    ///
    /// # Errors
    /// As [`Prepared::execute`], and [`Error::Usage`] if nothing was executed yet.
    pub fn read(&mut self) -> Result<Frame> {
        self.check_executed()?;
        let depth = self.depth.as_mut().map(|depth| depth.read(self.extent)).transpose()?;
        Ok(Frame { color: self.read_color()?, depth })
    }

    /// The colour target alone, as [`Prepared::read`] returns it: half the work, if depth is not needed.
    ///
    /// # Errors
    /// As [`Prepared::read`].
    pub fn read_color(&mut self) -> Result<image::Image> {
        self.check_executed()?;
        self.color.read(self.extent)
    }

    fn check_executed(&self) -> Result<()> {
        match self.executed {
            true => Ok(()),
            false => Err(Error::Usage(
                "the targets of a prepared pass have no content yet: execute it first".into(),
            )),
        }
    }
}

impl Target {
    fn new(gpu: &Gpu, extent: Extent, format: Format, name: &str) -> Result<Self> {
        let usage = ImageUse::Attachment;
        let image = Image::new(gpu, &ImageInfo { name, extent, format, levels: 1, usage })?;
        let bytes = extent.pixels() * format.texel_bytes();
        let label = format!("copy of the {name}");
        let host = Buffer::new(gpu, &label, bytes, Memory::Readback)?;
        let mut recorder = Recorder::new(gpu, &label)?;
        let region = [image.0.copy_of_level(0, 0)];
        // SAFETY: the draws leave the image in this layout; the buffer has its size.
        unsafe {
            gpu.0.device.cmd_copy_image_to_buffer(
                recorder.commands.raw,
                image.0.handle,
                vk::ImageLayout::TRANSFER_SRC_OPTIMAL,
                host.raw().handle,
                &region,
            );
        }
        recorder.commands.keep(image.0.clone());
        recorder.commands.keep(host.raw().clone());
        let copy = recorder.finish()?;
        Ok(Self { image, host, copy })
    }

    /// The target as it is now.
    fn read(&mut self, extent: Extent) -> Result<image::Image> {
        self.copy.run()?;
        Ok(image::Image { extent, format: self.image.format(), bytes: self.host.read()? })
    }

    fn attachment_layout(&self) -> vk::ImageLayout {
        match self.image.format() {
            Format::D32Float => vk::ImageLayout::DEPTH_ATTACHMENT_OPTIMAL,
            Format::Rgba8Unorm | Format::Rgba8Srgb | Format::Rgba16Float => {
                vk::ImageLayout::COLOR_ATTACHMENT_OPTIMAL
            }
        }
    }

    /// How the attachment starts and ends.
    fn attachment(&self, clear: vk::ClearValue) -> vk::RenderingAttachmentInfo<'static> {
        vk::RenderingAttachmentInfo::default()
            .image_view(self.image.0.view)
            .image_layout(self.attachment_layout())
            .load_op(vk::AttachmentLoadOp::CLEAR)
            .store_op(vk::AttachmentStoreOp::STORE)
            .clear_value(clear)
    }
}

/// The draws of `pass`, recorded; their uploads are done.
fn recorded(
    gpu: &Gpu,
    resources: &mut Resources,
    pass: &Pass,
    compiled: &[Arc<Compiled>],
    color: &Target,
    depth: Option<&Target>,
) -> Result<Recording> {
    let mut recorder = Recorder::new(gpu, &pass.label)?;
    record_draws(gpu, resources, &mut recorder, pass, compiled, color, depth)?;
    resources.flush()?;
    recorder.finish()
}

fn record_draws(
    gpu: &Gpu,
    resources: &mut Resources,
    recorder: &mut Recorder,
    pass: &Pass,
    compiled: &[Arc<Compiled>],
    color: &Target,
    depth: Option<&Target>,
) -> Result<()> {
    let copies = Copies::new(gpu, resources, pass)?;
    copies.record(recorder)?;
    let mut bindings = Bindings::new(copies);
    recorder.commands.barrier();
    for target in std::iter::once(color).chain(depth) {
        recorder.transition(&target.image, vk::ImageLayout::UNDEFINED, target.attachment_layout());
    }
    let color_clear = vk::ClearColorValue { float32: pass.color.clear };
    let color_info = [color.attachment(vk::ClearValue { color: color_clear })];
    let clear_depth = pass.depth.map_or(1.0, |d| d.clear);
    let depth_info = depth.map(|target| {
        let depth_stencil = vk::ClearDepthStencilValue { depth: clear_depth, stencil: 0 };
        target.attachment(vk::ClearValue { depth_stencil })
    });
    let Extent { width, height } = pass.extent;
    let mut rendering = vk::RenderingInfo::default()
        .render_area(vk::Rect2D { extent: vk::Extent2D { width, height }, ..Default::default() })
        .layer_count(1)
        .color_attachments(&color_info);
    if let Some(info) = &depth_info {
        rendering = rendering.depth_attachment(info);
    }
    let cmd = recorder.commands.raw;
    // SAFETY: the attachments are in the layouts that `rendering` names.
    unsafe { gpu.0.device.cmd_begin_rendering(cmd, &rendering) };
    for compiled in compiled {
        recorder.commands.keep(compiled.clone());
    }
    let mut bound = None;
    for draw in &pass.draws {
        // A draw without primitives draws nothing, but some drivers walk through all its vertices.
        let topology = pass.pipelines[draw.pipeline].topology;
        if topology.primitives(draw.count) == 0 || draw.instances == 0 {
            continue;
        }
        let compiled = &compiled[draw.pipeline];
        let sets = bindings.sets(gpu, resources, &mut recorder.commands, draw, compiled)?;
        if bound != Some(draw.pipeline) {
            bound = Some(draw.pipeline);
            // SAFETY: the pipeline was made for these attachment formats.
            let point = vk::PipelineBindPoint::GRAPHICS;
            unsafe { gpu.0.device.cmd_bind_pipeline(cmd, point, compiled.raw) };
        }
        record_draw(gpu, resources, recorder, draw, compiled, &sets, pass.extent)?;
    }
    // SAFETY: rendering was begun.
    unsafe { gpu.0.device.cmd_end_rendering(cmd) };
    for target in std::iter::once(color).chain(depth) {
        let from = target.attachment_layout();
        recorder.transition(&target.image, from, vk::ImageLayout::TRANSFER_SRC_OPTIMAL);
    }
    Ok(())
}

fn record_draw(
    gpu: &Gpu,
    resources: &mut Resources,
    recorder: &mut Recorder,
    draw: &Draw,
    compiled: &Compiled,
    sets: &[vk::DescriptorSet],
    extent: Extent,
) -> Result<()> {
    let Viewport { x, y, width, height, min_depth, max_depth } = draw.viewport_in(extent);
    let side = gpu.limits().target_side_px;
    if width.max(height.abs()) > side as f32 {
        return Err(Error::Full(format!(
            "a viewport of {width}x{height} is larger than {} allows: at most {side} pixels a side",
            gpu.info().name
        )));
    }
    let viewport = [vk::Viewport { x, y, width, height, min_depth, max_depth }];
    let Rect { x, y, width, height } = draw.scissor_in(extent);
    let scissor = [vk::Rect2D {
        offset: vk::Offset2D { x: x as i32, y: y as i32 },
        extent: vk::Extent2D { width, height },
    }];
    let (mut buffers, mut offsets, mut sizes) = (Vec::new(), Vec::new(), Vec::new());
    for range in &draw.vertex_buffers[..compiled.vertex_bindings] {
        let buffer = resources.buffer(&range.buffer)?;
        // The padding at a buffer's end is part of the range, for elements that are read wider than
        // they are.
        let bytes = if range.offset + range.bytes == range.buffer.len() {
            buffer.raw().size - buffer.offset() - range.offset as u64
        } else {
            range.bytes as u64
        };
        buffers.push(buffer.raw().handle);
        // An empty range may begin at the buffer's end, where Vulkan lets none begin.
        offsets.push(if range.bytes == 0 { 0 } else { buffer.offset() + range.offset as u64 });
        sizes.push(bytes);
        recorder.commands.keep(buffer.raw().clone());
    }
    let indices = match &draw.indices {
        Some(indices) => Some((resources.buffer(&indices.range.buffer)?, indices)),
        None => None,
    };
    let (device, cmd) = (&gpu.0.device, recorder.commands.raw);
    let layout = &compiled.layout;
    // SAFETY: the pass was validated: every range is inside its buffer and every resource of the
    // shaders is bound. All that is bound is kept by the recording.
    unsafe {
        device.cmd_set_viewport(cmd, 0, &viewport);
        device.cmd_set_scissor(cmd, 0, &scissor);
        if !sets.is_empty() {
            let point = vk::PipelineBindPoint::GRAPHICS;
            device.cmd_bind_descriptor_sets(cmd, point, layout.raw, 0, sets, &[]);
        }
        if layout.push_constant_bytes > 0 {
            let mut constants = draw.push_constants.clone();
            constants.resize(layout.push_constant_bytes as usize, 0);
            device.cmd_push_constants(cmd, layout.raw, STAGES, 0, &constants);
        }
        if !buffers.is_empty() {
            device.cmd_bind_vertex_buffers2(cmd, 0, &buffers, &offsets, Some(&sizes), None);
        }
        match &indices {
            Some((buffer, indices)) => {
                let format = match indices.format {
                    IndexFormat::U16 => vk::IndexType::UINT16,
                    IndexFormat::U32 => vk::IndexType::UINT32,
                };
                let offset = buffer.offset() + indices.range.offset as u64;
                device.cmd_bind_index_buffer(cmd, buffer.raw().handle, offset, format);
                let (first, base) = (draw.first, draw.base_vertex);
                let (n, at) = (draw.instances, draw.first_instance);
                device.cmd_draw_indexed(cmd, draw.count, n, first, base, at);
            }
            None => {
                let (n, at) = (draw.instances, draw.first_instance);
                device.cmd_draw(cmd, draw.count, n, draw.first, at);
            }
        }
    }
    if let Some((buffer, _)) = indices {
        recorder.commands.keep(buffer.raw().clone());
    }
    Ok(())
}
