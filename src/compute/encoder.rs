//! Frames that are recorded anew each time, and run while the host records the next one.

use super::{
    Renderer,
    frame::{Setup, Workspace},
    slots::Tables,
};
use crate::{
    error::{Error, Result},
    pass::Pass,
    target::StoreOp,
    vk::{
        Arena, Buffer, CallerCommands, Dispatch, Gpu, Image, Kernel, Recorder, Recording,
        Submission,
    },
};
use bytemuck::Pod;
use std::{
    marker::PhantomData,
    sync::{Arc, Mutex, PoisonError, Weak},
};

/// Frames in flight, unless [`Renderer::set_frames_in_flight`] says otherwise: the device runs one while the host records
/// the other.
pub(super) const FRAMES_IN_FLIGHT: usize = 2;

/// The memory of one frame, used again when the frame has ended.
pub(super) struct Slot {
    /// The last frame; `None` before the first.
    recording: Option<Recording>,
    arena: Arena,
    tables: Tables,
}

impl Slot {
    fn new(gpu: &Gpu) -> Self {
        Self { recording: None, arena: Arena::new(gpu), tables: Tables::default() }
    }

    /// Waits for its frame, and takes back all that the frame used. The next one is recorded into a command buffer of the
    /// caller, if there is one.
    fn restart(&mut self, gpu: &Gpu, borrowed: Option<&CallerCommands>) -> Result<Recorder> {
        let recorder = match (self.recording.take(), borrowed) {
            (Some(before), borrowed) => Recorder::instead_of(before, "frame", borrowed)?,
            (None, Some(commands)) => Recorder::borrowing(gpu, "frame", commands)?,
            (None, None) => Recorder::new(gpu, "frame")?,
        };
        // The tables hold slices of the arena.
        self.tables.begin_frame(recorder.commands.unfinished())?;
        self.arena.reset();
        Ok(recorder)
    }
}

/// A frame that is being recorded: passes, and kernels and copies between them, in the order in which they run.
///
/// Each command finds what the commands before it wrote, those of earlier frames included. The frame runs after
/// [`Encoder::submit`]. If the encoder is dropped instead, nothing runs. An encoder that [`Renderer::record`] lends records
/// into a command buffer of the caller, who submits it.
///
/// A frame is one submission: all of it has the time that [`crate::vk::GpuOptions::timeout`] allows.
///
/// [`Renderer::begin`] waits for an earlier frame if too many are in flight. What a pass needs for the first time takes
/// longer: kernels and resource tables are made, and textures of the host, and its buffers where the device has memory of
/// its own, are uploaded by a submission of their own. Nobody waits for its end, unless more than 64 MiB are on their way.
/// Nothing else waits or is submitted. (A submission waits while another thread is in [`Buffer::read`] or
/// [`Buffer::write`].) What a frame used stays until its memory is used by another frame.
pub struct Encoder<'r> {
    renderer: &'r mut Renderer,
    /// `None` once it was given back.
    parts: Option<(Slot, Recorder)>,
    /// Whether a pass was recorded in part.
    broken: bool,
    /// Whether the commands are the caller's.
    borrowed: bool,
    /// Makes encoders of two lifetimes two types: who is lent one ([`Renderer::record`]) cannot put another in its place.
    invariant: PhantomData<fn(&'r ()) -> &'r ()>,
}

/// Commands of a frame in a command buffer of the caller, see [`Renderer::record`]: holds all that they use. Drop it when
/// the device is done with the command buffer, and the renderer uses the memory again. To drop it earlier, also by ignoring
/// it, breaks the promise that was made to [`CallerCommands::new`]: the device then uses memory that is gone. With several
/// frames in flight, keep it beside the fence of its frame.
#[must_use = "what the commands use goes with it: keep it until the device is done with them"]
pub struct Recorded {
    /// `None` once it was given back.
    slot: Option<Slot>,
    home: Weak<Mutex<Vec<Slot>>>,
}

impl Drop for Recorded {
    fn drop(&mut self) {
        if let (Some(slot), Some(home)) = (self.slot.take(), self.home.upgrade()) {
            home.lock().unwrap_or_else(PoisonError::into_inner).push(slot);
        }
    }
}

impl<'r> Encoder<'r> {
    pub(super) fn new(renderer: &'r mut Renderer) -> Result<Self> {
        renderer.next_frame()?;
        // Dropping a frame waits for its end.
        let surplus = renderer.frames.len().saturating_sub(renderer.frames_in_flight);
        renderer.frames.drain(..surplus);
        let free = renderer.frames.iter().position(|slot| {
            slot.recording.as_ref().is_none_or(|recording| !recording.is_running())
        });
        let mut slot = match free {
            Some(free) => renderer.frames.remove(free),
            None if renderer.frames.len() < renderer.frames_in_flight => Slot::new(&renderer.gpu),
            // The oldest: they are in the order of their submissions.
            None => renderer.frames.remove(0),
        };
        let recorder = slot.restart(&renderer.gpu, None)?;
        Ok(Self::of(renderer, (slot, recorder), false))
    }

    fn of(renderer: &'r mut Renderer, parts: (Slot, Recorder), borrowed: bool) -> Self {
        let (parts, invariant) = (Some(parts), PhantomData);
        Self { renderer, parts, broken: false, borrowed, invariant }
    }

    /// Records into a command buffer of the caller.
    pub(super) fn borrowing(
        renderer: &'r mut Renderer,
        commands: &CallerCommands,
    ) -> Result<Encoder<'r>> {
        renderer.next_frame()?;
        let free = renderer.returned.lock().unwrap_or_else(PoisonError::into_inner).pop();
        let mut slot = free.unwrap_or_else(|| Slot::new(&renderer.gpu));
        let recorder = slot.restart(&renderer.gpu, Some(commands))?;
        Ok(Self::of(renderer, (slot, recorder), true))
    }

    /// Ends the commands in a command buffer of the caller.
    pub(super) fn finish(mut self) -> Result<Recorded> {
        if self.broken {
            return Err(broken());
        }
        let (mut slot, recorder) = self.parts.take().expect("it was not submitted");
        slot.recording = Some(recorder.finish()?);
        Ok(Recorded { slot: Some(slot), home: Arc::downgrade(&self.renderer.returned) })
    }

    /// Records `pass`. What its shaders write to buffers of the device, all that follows finds.
    ///
    /// # Errors
    /// As [`Renderer::prepare`], and [`Error::Usage`] if the pass stores a target that has no image. The frame then goes on
    /// without the pass. Only if memory runs out while commands are recorded, a part of the pass is in the frame, which
    /// cannot be submitted any more.
    pub fn encode(&mut self, pass: &Pass) -> Result<()> {
        if self.broken {
            return Err(broken());
        }
        let colors = pass.colors.iter().map(|color| ("colour", &color.image, color.store));
        let depth = pass.depth.iter().map(|depth| ("depth", &depth.image, depth.store));
        let stencil = pass.stencil.iter().map(|stencil| ("stencil", &stencil.image, stencil.store));
        let homeless = |(_, image, store): &(&str, &Option<Image>, StoreOp)| {
            image.is_none() && *store == StoreOp::Store
        };
        if let Some((kind, ..)) = colors.chain(depth).chain(stencil).find(homeless) {
            return Err(Error::Usage(format!(
                "pass `{}`: a frame stores targets in images, and the {kind} target has none: give it an image of the \
                 device, or do not keep it (`StoreOp::Discard`)",
                pass.label
            )));
        }
        let Some((Slot { arena, tables, .. }, recorder)) = &mut self.parts else { return Ok(()) };
        let renderer = &mut *self.renderer;
        let (plan, copies) = renderer.plan(pass, arena, tables)?;
        let Renderer { gpu, kernels, scratch, plan_kernels, .. } = renderer;
        let mut workspace = Workspace { scratch, arena, kernels: plan_kernels };
        let setup = Setup::new(gpu, kernels, &mut workspace, (pass, &plan), copies)?;
        // All bands take the rows of the first one, which is the largest, in turns.
        for band in setup.bands().take(1) {
            setup.target(workspace.scratch, &band)?;
        }
        self.broken = true;
        for (number, band) in setup.bands().enumerate() {
            let target = setup.target(workspace.scratch, &band)?;
            let (planned, band) = ((&plan, &tables.tables[..]), (number, &band, &target));
            setup.record(recorder, workspace.arena, kernels, planned, band)?;
        }
        (_, *plan_kernels) = setup.into_parts();
        renderer.planner.recycle(plan);
        self.broken = false;
        Ok(())
    }

    /// Memory that holds `content`, aligned for every use: uniform blocks, vertices, indices, what kernels read. It is meant
    /// for this frame. Later frames may use it as well, as long as you hold it; the larger block that it is a part of
    /// stays for so long.
    ///
    /// # Errors
    /// [`Error::Capacity`] without memory for it.
    pub fn transient<T: Pod>(&mut self, content: &[T]) -> Result<Buffer<T>> {
        self.parts().0.arena.push(content)
    }

    /// Copies `content` to the start of `buffer`.
    ///
    /// # Errors
    /// As [`Encoder::transient`] and [`Recorder::copy`].
    pub fn upload<T: Pod>(&mut self, buffer: &Buffer<T>, content: &[T]) -> Result<()> {
        if content.is_empty() {
            return Ok(());
        }
        let (slot, recorder) = self.parts();
        let staged = slot.arena.push(content)?;
        recorder.copy(&staged, buffer)
    }

    /// Replaces levels of `image`, as [`Recorder::upload_image`] does.
    ///
    /// # Errors
    /// As [`Recorder::upload_image`].
    pub fn upload_image<L: AsRef<[u8]>>(&mut self, image: &Image, levels: &[L]) -> Result<()> {
        self.parts().1.upload_image(image, levels)
    }

    /// Makes all mip levels of `image` of its level 0, as [`Recorder::make_levels`] does.
    ///
    /// # Errors
    /// As [`Recorder::make_levels`].
    pub fn make_levels(&mut self, image: &Image) -> Result<()> {
        self.parts().1.make_levels(image)
    }

    /// Starts a dispatch of `kernel`.
    pub fn kernel(&mut self, kernel: &Kernel) -> Dispatch<'_> {
        self.parts().1.kernel(kernel)
    }

    /// Copies all of `from` to the start of `to`.
    ///
    /// # Errors
    /// As [`Recorder::copy`].
    pub fn copy<T: Pod>(&mut self, from: &Buffer<T>, to: &Buffer<T>) -> Result<()> {
        self.parts().1.copy(from, to)
    }

    /// Fills all of `buffer` with `word`.
    ///
    /// # Errors
    /// As [`Recorder::fill`].
    pub fn fill<T: Pod>(&mut self, buffer: &Buffer<T>, word: u32) -> Result<()> {
        self.parts().1.fill(buffer, word)
    }

    /// Starts the frame, and does not wait for its end.
    ///
    /// # Errors
    /// [`Error::Lost`] if the device was lost; [`Error::Usage`] if a pass was recorded in part, which the error of
    /// [`Encoder::encode`] told.
    pub fn submit(mut self) -> Result<Submission> {
        if self.broken {
            return Err(broken());
        }
        let Some((mut slot, recorder)) = self.parts.take() else {
            return Err(Error::Usage("the frame was submitted before".into()));
        };
        let started = recorder.finish().and_then(|mut recording| {
            let started = recording.start();
            slot.recording = Some(recording);
            started
        });
        self.renderer.frames.push(slot);
        started
    }

    fn parts(&mut self) -> &mut (Slot, Recorder) {
        self.parts.as_mut().expect("they are there until the frame is submitted, which consumes it")
    }
}

fn broken() -> Error {
    let fault = "a pass of the frame was recorded in part, since memory ran out: drop the frame";
    Error::Usage(fault.into())
}

impl Drop for Encoder<'_> {
    fn drop(&mut self) {
        if let Some((slot, recorder)) = self.parts.take() {
            drop(recorder);
            match self.borrowed {
                true => {
                    let home = &self.renderer.returned;
                    home.lock().unwrap_or_else(PoisonError::into_inner).push(slot);
                }
                false => self.renderer.frames.push(slot),
            }
        }
    }
}
