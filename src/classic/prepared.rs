//! A pass that is ready to run: targets, recorded draws, and the copy that reads them back.

use super::{bindings::Bindings, layout::STAGES, pipeline::Compiled, target::Targets};
use crate::{
    error::{Error, Result},
    image::{self, Extent},
    pass::{Draw, Frame, IndexFormat, Indirect, Pass},
    state::{DepthBias, Rect, Viewport},
    vk::{Aspect, Copies, Gpu, Recorder, Recording, Resources},
};
use ash::vk;
use std::sync::Arc;

/// A pass that is ready to run, as often as wanted.
pub struct Prepared {
    draws: Recording,
    targets: Targets,
    /// Whether the targets have content.
    executed: bool,
}

impl Prepared {
    pub(super) fn new(
        gpu: &Gpu,
        resources: &mut Resources,
        pass: &Pass,
        compiled: &[Arc<Compiled>],
    ) -> Result<Self> {
        let targets = Targets::new(gpu, pass)?;
        let draws = recorded(gpu, resources, pass, compiled, &targets)?;
        Ok(Self { draws, targets, executed: false })
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
        self.draws = recorded(gpu, resources, pass, compiled, &self.targets)?;
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

    /// The targets after the last [`Prepared::execute`]. Of a target that is an image, what the image holds now.
    ///
    /// # Errors
    /// As [`Prepared::execute`], and [`Error::Usage`] if nothing was executed yet.
    pub fn read(&mut self) -> Result<Frame> {
        self.check_executed()?;
        let colors = self
            .targets
            .colors
            .iter_mut()
            .filter_map(|target| target.read(Aspect::Main).transpose());
        let colors = colors.collect::<Result<_>>()?;
        let mut of = |aspect| match &mut self.targets.depth_stencil {
            Some(target) => target.read(aspect),
            None => Ok(None),
        };
        Ok(Frame { colors, depth: of(Aspect::Main)?, stencil: of(Aspect::Stencil)? })
    }

    /// The first colour target that is stored, as [`Prepared::read`] returns it: half the work, if depth is not needed.
    ///
    /// # Errors
    /// As [`Prepared::read`], and [`Error::Usage`] if the pass stores no colour.
    pub fn read_color(&mut self) -> Result<image::Picture> {
        self.check_executed()?;
        let mut colors = self.targets.colors.iter_mut();
        let color = colors.find(|target| target.is_stored());
        let color = color.map(|target| target.read(Aspect::Main)).transpose()?;
        color.flatten().ok_or_else(|| Error::Usage("the pass stores no colour target".into()))
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

/// The draws of `pass`, recorded; their uploads are done.
fn recorded(
    gpu: &Gpu,
    resources: &mut Resources,
    pass: &Pass,
    compiled: &[Arc<Compiled>],
    targets: &Targets,
) -> Result<Recording> {
    let mut recorder = Recorder::new(gpu, &pass.label)?;
    record_draws(gpu, resources, &mut recorder, pass, compiled, targets)?;
    resources.flush()?;
    resources.settle()?;
    recorder.finish()
}

fn record_draws(
    gpu: &Gpu,
    resources: &mut Resources,
    recorder: &mut Recorder,
    pass: &Pass,
    compiled: &[Arc<Compiled>],
    targets: &Targets,
) -> Result<()> {
    let copies = Copies::new(gpu, resources, pass)?;
    copies.record(recorder)?;
    let mut bindings = Bindings::new(copies);
    recorder.commands.barrier();
    for target in targets.iter() {
        target.begin(recorder)?;
    }
    let color: Vec<_> =
        targets.colors.iter().filter_map(|target| target.attachment(Aspect::Main)).collect();
    let of = |aspect| targets.depth_stencil.as_ref().and_then(|target| target.attachment(aspect));
    let (depth, stencil) = (of(Aspect::Main), of(Aspect::Stencil));
    let Extent { width, height } = targets.extent;
    let mut rendering = vk::RenderingInfo::default()
        .render_area(vk::Rect2D { extent: vk::Extent2D { width, height }, ..Default::default() })
        .layer_count(1)
        .color_attachments(&color);
    if let Some(depth) = &depth {
        rendering = rendering.depth_attachment(depth);
    }
    if let Some(stencil) = &stencil {
        rendering = rendering.stencil_attachment(stencil);
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
        let nothing = match &draw.indirect {
            Some(indirect) => indirect.draws == 0,
            None => topology.primitives(draw.count) == 0 || draw.instances == 0,
        };
        if nothing {
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
    for target in targets.iter() {
        target.end(recorder);
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
    if let Some(bias) = draw.depth_bias
        && bias.clamp != 0.0
        && !gpu.0.draw_limits.clamps_depth_bias
    {
        return Err(Error::Device(format!(
            "a depth bias is clamped, which {} does not offer (depthBiasClamp); the compute executor does",
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
        device.cmd_set_blend_constants(cmd, &draw.blend_constants);
        let [least, greatest] = draw.depth_bounds;
        device.cmd_set_depth_bounds(cmd, least, greatest);
        let [front, back] = draw.stencil_reference.map(u32::from);
        device.cmd_set_stencil_reference(cmd, vk::StencilFaceFlags::FRONT, front);
        device.cmd_set_stencil_reference(cmd, vk::StencilFaceFlags::BACK, back);
        device.cmd_set_depth_bias_enable(cmd, draw.depth_bias.is_some());
        if let Some(DepthBias { constant, slope, clamp }) = draw.depth_bias {
            device.cmd_set_depth_bias(cmd, constant, clamp, slope);
        }
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
        if let Some((buffer, indices)) = &indices {
            let format = match indices.format {
                IndexFormat::U16 => vk::IndexType::UINT16,
                IndexFormat::U32 => vk::IndexType::UINT32,
            };
            let offset = buffer.offset() + indices.range.offset as u64;
            device.cmd_bind_index_buffer(cmd, buffer.raw().handle, offset, format);
        }
        let (first, n, at) = (draw.first, draw.instances, draw.first_instance);
        match (&draw.indirect, &indices) {
            (Some(indirect), _) => record_commands(gpu, resources, recorder, draw, indirect)?,
            (None, Some(_)) => {
                device.cmd_draw_indexed(cmd, draw.count, n, first, draw.base_vertex, at);
            }
            (None, None) => device.cmd_draw(cmd, draw.count, n, first, at),
        }
    }
    if let Some((buffer, _)) = indices {
        recorder.commands.keep(buffer.raw().clone());
    }
    Ok(())
}

/// Records the commands of an indirect draw, whose state is bound.
fn record_commands(
    gpu: &Gpu,
    resources: &mut Resources,
    recorder: &mut Recorder,
    draw: &Draw,
    indirect: &Indirect,
) -> Result<()> {
    let limits = gpu.0.draw_limits;
    if indirect.draws > limits.commands || (indirect.count.is_some() && !limits.counts_commands) {
        return Err(Error::Device(format!(
            "{} draws {} commands of a buffer at most{}, and {} are wanted; the compute executor has no such limit",
            gpu.info().name,
            limits.commands,
            if limits.counts_commands { "" } else { ", and reads no number of them" },
            indirect.draws
        )));
    }
    let commands = resources.buffer(&indirect.commands.buffer)?;
    let (from, at) = (commands.raw().handle, commands.offset() + indirect.commands.offset as u64);
    let indexed = draw.indices.is_some();
    let stride = indirect.stride.max(Indirect::command_bytes(indexed) as u32);
    let (device, cmd, most) = (&gpu.0.device, recorder.commands.raw, indirect.draws);
    let count = match &indirect.count {
        Some(range) => Some((resources.buffer(&range.buffer)?, range.offset as u64)),
        None => None,
    };
    // SAFETY: the pass was validated: all commands and their number are inside their buffers. All that is bound is
    // kept by the recording.
    unsafe {
        match (&count, indexed) {
            (Some((buffer, offset)), indexed) => {
                let (count, offset) = (buffer.raw().handle, buffer.offset() + offset);
                if indexed {
                    device.cmd_draw_indexed_indirect_count(
                        cmd, from, at, count, offset, most, stride,
                    );
                } else {
                    device.cmd_draw_indirect_count(cmd, from, at, count, offset, most, stride);
                }
            }
            (None, true) => device.cmd_draw_indexed_indirect(cmd, from, at, most, stride),
            (None, false) => device.cmd_draw_indirect(cmd, from, at, most, stride),
        }
    }
    recorder.commands.keep(commands.raw().clone());
    if let Some((buffer, _)) = count {
        recorder.commands.keep(buffer.raw().clone());
    }
    Ok(())
}
