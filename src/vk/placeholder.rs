//! The contents of free slots of resource tables: a texel, a small buffer of zeros, a sampler. All tables of a
//! device that exist at the same time share them.

use super::{
    buffer::Buffer,
    gpu::Gpu,
    image::{Image, ImageInfo, ImageUse},
    recorder::Recorder,
    sampler::Sampler,
};
use crate::{error::Result, format::Format, image::Extent, texture};
use std::sync::{Arc, PoisonError};

/// A valid resource of each kind.
pub(super) struct Placeholders {
    pub buffer: Buffer<u32>,
    pub sampled: Image,
    pub storage: Image,
    pub sampler: Sampler,
}

impl Placeholders {
    /// Those of `gpu`.
    pub fn of(gpu: &Gpu) -> Result<Arc<Self>> {
        // The lock is held until they are filled: nobody gets to use them earlier.
        let mut known = gpu.0.placeholders.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(found) = known.upgrade() {
            return Ok(found);
        }
        let made = Arc::new(Self::new(gpu)?);
        *known = Arc::downgrade(&made);
        Ok(made)
    }

    fn new(gpu: &Gpu) -> Result<Self> {
        let one = |name, usage| {
            let extent = Extent::new(1, 1);
            let info = ImageInfo::new(name, extent, Format::Rgba8Unorm, usage);
            Image::new(gpu, &info)
        };
        let sampled = one("unused texture slot", ImageUse::Sampled)?;
        let storage = one("unused storage image slot", ImageUse::Storage)?;
        let buffer = Buffer::with_content(gpu, "unused buffer slot", &[0; 64])?;
        let sampler = Sampler::new(gpu, &texture::Sampler::default())?;
        let mut recorder = Recorder::new(gpu, "unused table slots")?;
        recorder.upload_image(&sampled, &[&[0; 4]])?;
        recorder.upload_image(&storage, &[&[0; 4]])?;
        recorder.submit()?;
        Ok(Self { buffer, sampled, storage, sampler })
    }
}
