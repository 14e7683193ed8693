//! Copies of the buffers that the shaders of a pass write.

use super::{
    buffer::{Buffer, Memory},
    gpu::Gpu,
    recorder::Recorder,
    resources::Resources,
};
use crate::{
    error::Result,
    pass::{self, Pass},
};
use std::{collections::HashMap, sync::Arc};

/// A copy for each buffer that a pass writes (see [`Pass::written_buffers`]). Whoever executes all draws of the pass
/// fills the copies anew, so that the first draw finds what the host gave.
#[derive(Default)]
pub struct Copies {
    /// The upload and its copy, by address: the pass holds the buffers while it is planned.
    all: HashMap<*const pass::BufferSource, [Buffer<u8>; 2]>,
}

impl Copies {
    /// The copies that `pass` needs, which is valid.
    ///
    /// # Errors
    /// [`crate::Error::Capacity`] without memory for one.
    pub fn new(gpu: &Gpu, resources: &mut Resources, pass: &Pass) -> Result<Self> {
        let mut all = HashMap::new();
        for buffer in pass.written_buffers() {
            let original = resources.buffer(&buffer)?;
            let copy = Buffer::new(gpu, buffer.label(), original.len(), Memory::Device)?;
            all.insert(Arc::as_ptr(&buffer), [original, copy]);
        }
        Ok(Self { all })
    }

    /// Whether the pass writes no buffer.
    pub fn is_empty(&self) -> bool {
        self.all.is_empty()
    }

    /// Records how the copies get their content: before everything that uses them.
    ///
    /// # Errors
    /// As [`Recorder::copy`].
    pub fn record(&self, recorder: &mut Recorder) -> Result<()> {
        self.all.values().try_for_each(|[original, copy]| recorder.copy(original, copy))
    }

    /// The bytes of `buffer` for a storage block: the copy if there is one, else the upload.
    ///
    /// # Errors
    /// As [`Resources::buffer`].
    pub fn storage(
        &self,
        resources: &mut Resources,
        buffer: &Arc<pass::BufferSource>,
    ) -> Result<Buffer<u8>> {
        match self.all.get(&Arc::as_ptr(buffer)) {
            Some([_, copy]) => Ok(copy.clone()),
            None => resources.buffer(buffer),
        }
    }
}
