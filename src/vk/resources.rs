//! Host data on the device: each buffer and texture of a [`crate::pass::Pass`] is uploaded once and
//! recognised by the identity of its `Arc`.
//!
//! Kernels and pipelines are recognised by their content, which is small. Buffers and textures are not:
//! comparing the content of a texture costs about as much as uploading it. The cache holds a `Weak` to each
//! resource that it knows. So the address of the `Arc` cannot be used again while the cache knows the upload,
//! and host memory is freed when its owner drops it. The upload itself is freed at the next pass
//! ([`Resources::trim`]).

use super::{
    buffer::{Buffer, Memory},
    gpu::Gpu,
    image::{Image, ImageInfo, ImageUse},
    owner::same_device,
    recorder::Recorder,
    recording::Recording,
    sampler::Sampler,
};
use crate::{
    error::{Error, Result},
    pass::{self, BufferRange},
    texture::{self, Texture},
};
use std::{
    collections::HashMap,
    sync::{Arc, Weak},
};

/// The host memory that copies may read at a time: a scene's textures are not kept twice over.
const PENDING_BYTES: usize = 64 << 20;

/// Uploaded buffers and textures.
pub struct Resources {
    gpu: Gpu,
    /// By address.
    buffers: HashMap<usize, (Weak<pass::BufferSource>, Buffer<u8>)>,
    textures: HashMap<usize, (Weak<Texture>, Image)>,
    /// Copies of ranges that are shorter than the block they are read as, with zeros behind.
    padded: HashMap<Padded, (Weak<pass::BufferSource>, Buffer<u8>)>,
    /// Copies that [`Resources::flush`] has to run, and the bytes that wait in host memory for them.
    pending: Option<Recorder>,
    pending_bytes: usize,
    /// Copies that were started, with the bytes of host memory that they read. What runs later on the device finds them done.
    started: Vec<(Recording, usize)>,
}

/// What an executor keeps for the passes to come.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Cached {
    /// Kernels of users' shaders, or pipelines of the device's own.
    pub pipelines: usize,
    /// Those that were ever compiled. It stays where it is while all that passes need is there.
    pub pipelines_made: u64,
    /// Uploaded buffers.
    pub buffers: usize,
    /// Uploaded textures.
    pub textures: usize,
    /// Resource tables, those of passes that are prepared included.
    pub tables: usize,
}

/// A buffer's address, which the weak reference keeps from being used again; offset and bytes of the range;
/// bytes of the block.
type Padded = (usize, usize, usize, usize);

impl Resources {
    /// An empty cache.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            gpu: gpu.clone(),
            buffers: HashMap::new(),
            textures: HashMap::new(),
            padded: HashMap::new(),
            pending: None,
            pending_bytes: 0,
            started: Vec::new(),
        }
    }

    /// The upload of `buffer`, or its own memory if it lives on the device.
    ///
    /// # Errors
    /// [`crate::Error::Capacity`] without memory for it; [`crate::Error::Usage`] if it lives on another device.
    pub fn buffer(&mut self, buffer: &Arc<pass::BufferSource>) -> Result<Buffer<u8>> {
        let content = match (buffer.device_memory(), buffer.host_bytes()) {
            (Some(memory), _) => {
                same_device(&self.gpu, memory)?;
                return Ok(memory.clone());
            }
            (None, content) => content.unwrap_or_default(),
        };
        let address = Arc::as_ptr(buffer) as usize;
        if let Some((_, uploaded)) = self.buffers.get(&address) {
            return Ok(uploaded.clone());
        }
        let uploaded = self.upload(buffer.label(), content)?;
        self.buffers.insert(address, (Arc::downgrade(buffer), uploaded.clone()));
        Ok(uploaded)
    }

    /// The upload of `range` for a shader that reads it as a uniform block of `block` bytes. Kernels read such
    /// blocks without checking bounds, so a shorter range is copied to a buffer that zeros fill up.
    ///
    /// # Errors
    /// As [`Resources::buffer`], and [`crate::Error::Usage`] if the range is outside its buffer.
    pub fn block(&mut self, range: &BufferRange, block: usize) -> Result<Buffer<u8>> {
        let BufferRange { buffer, offset, bytes } = range;
        let whole = *offset..offset.saturating_add(*bytes);
        if *bytes >= block {
            return self.buffer(buffer)?.slice(whole);
        }
        let key = (Arc::as_ptr(buffer) as usize, *offset, *bytes, block);
        if let Some((_, uploaded)) = self.padded.get(&key) {
            return Ok(uploaded.clone());
        }
        let mut content = buffer.content()?.get(whole).unwrap_or_default().to_vec();
        content.resize(block, 0);
        let uploaded = self.upload(&format!("{} and zeros", buffer.label()), &content)?;
        self.padded.insert(key, (Arc::downgrade(buffer), uploaded.clone()));
        Ok(uploaded)
    }

    fn upload(&mut self, label: &str, content: &[u8]) -> Result<Buffer<u8>> {
        if self.gpu.0.unified_memory {
            // The host's memory is the device's: a copy would only cost memory and time.
            return Buffer::with_content(&self.gpu, label, content);
        }
        let uploaded = Buffer::new(&self.gpu, label, content.len(), Memory::Device)?;
        self.pending()?.upload(&uploaded, content)?;
        self.pending_bytes += content.len();
        self.flush_above(PENDING_BYTES)?;
        Ok(uploaded)
    }

    /// The upload of `texture`, or its image if it lives on the device.
    ///
    /// # Errors
    /// [`crate::Error::Capacity`] without memory for it, [`crate::Error::Usage`] if its levels are
    /// not those of its size or if it lives on another device.
    pub fn texture(&mut self, texture: &Arc<Texture>) -> Result<Image> {
        if let Some(image) = texture.image() {
            same_device(&self.gpu, image)?;
            return Ok(image.clone());
        }
        let address = Arc::as_ptr(texture) as usize;
        if let Some((_, uploaded)) = self.textures.get(&address) {
            return Ok(uploaded.clone());
        }
        let levels = texture.levels().unwrap_or_default();
        let uploaded = Image::new(
            &self.gpu,
            &ImageInfo::new(texture.label(), texture.extent(), texture.format(), ImageUse::Sampled)
                .shape(texture.shape())
                .levels(levels.len() as u32),
        )?;
        self.pending()?.upload_image(&uploaded, levels)?;
        self.pending_bytes += levels.iter().map(Vec::len).sum::<usize>();
        self.flush_above(PENDING_BYTES)?;
        self.textures.insert(address, (Arc::downgrade(texture), uploaded.clone()));
        Ok(uploaded)
    }

    /// The upload of `texture`, and the sampler for `state` that samples it.
    ///
    /// # Errors
    /// As [`Resources::texture`] and [`Sampler::new`]; [`Error::Device`] if the device does not filter the format linearly and
    /// the sampler asks for it.
    pub fn sampled(
        &mut self,
        texture: &Arc<Texture>,
        state: &texture::Sampler,
    ) -> Result<(Image, Sampler)> {
        let format = texture.format();
        if state.is_linear() && !self.gpu.0.filters(format) {
            return Err(Error::Device(format!(
                "texture `{}` is sampled with a linear filter, and {} filters no {format:?}: use the nearest texel",
                texture.label(),
                self.gpu.name()
            )));
        }
        Ok((self.texture(texture)?, self.sampler(state)?))
    }

    /// The sampler for `state`.
    ///
    /// # Errors
    /// As [`Sampler::new`].
    pub fn sampler(&mut self, state: &texture::Sampler) -> Result<Sampler> {
        Sampler::new(&self.gpu, state)
    }

    /// Starts the copies that are pending, and does not wait for their end. Nothing that was asked for may be used before.
    ///
    /// # Errors
    /// As [`Recording::start`].
    pub fn flush(&mut self) -> Result<()> {
        let bytes = std::mem::take(&mut self.pending_bytes);
        let Some(recorder) = self.pending.take() else { return Ok(()) };
        let started = recorder.finish().and_then(|mut copies| copies.start().map(|_| copies));
        match started {
            Ok(copies) => self.started.push((copies, bytes)),
            Err(error) => {
                // Nobody knows which copies arrive.
                self.buffers.clear();
                self.textures.clear();
                self.padded.clear();
                return Err(error);
            }
        }
        self.started.retain(|(copies, _)| copies.is_running());
        if self.started.iter().map(|(_, bytes)| bytes).sum::<usize>() > PENDING_BYTES {
            self.settle()?;
        }
        Ok(())
    }

    /// Waits for the copies that were started, whose memory is free then.
    ///
    /// # Errors
    /// As [`Recording::wait`].
    pub fn settle(&mut self) -> Result<()> {
        self.started.drain(..).try_for_each(|(mut copies, _)| copies.wait().map(drop))
    }

    fn flush_above(&mut self, bytes: usize) -> Result<()> {
        if self.pending_bytes > bytes { self.flush() } else { Ok(()) }
    }

    /// Forgets the uploads of resources that have no owner any more.
    pub fn trim(&mut self) {
        self.started.retain(|(copies, _)| copies.is_running());
        self.buffers.retain(|_, (holder, _)| holder.strong_count() > 0);
        self.textures.retain(|_, (holder, _)| holder.strong_count() > 0);
        self.padded.retain(|_, (holder, _)| holder.strong_count() > 0);
    }

    /// The uploads that are kept.
    pub fn cached(&self) -> Cached {
        let (buffers, textures) = (self.buffers.len(), self.textures.len());
        Cached { buffers, textures, ..Cached::default() }
    }

    fn pending(&mut self) -> Result<&mut Recorder> {
        let recorder = match self.pending.take() {
            Some(recorder) => recorder,
            None => Recorder::new(&self.gpu, "uploads")?,
        };
        Ok(self.pending.insert(recorder))
    }
}
