//! A pass whose resources live on a device, as plain data of the host.

use super::{Binding, BindingSet, BufferRange, BufferSource, Pass};
use crate::{error::Result, texture::Texture};
use std::{borrow::Cow, collections::HashMap, sync::Arc};

impl Pass {
    /// The same pass with all its resources on the host, as they are at this moment. The reference draws such passes,
    /// and so does any device. Commands of indirect draws are draws there. A pass that has neither, nor binds anything of
    /// a device, is returned as it is. Storage images stay on their device.
    ///
    /// # Errors
    /// As [`BufferSource::content`].
    pub fn snapshot(&self) -> Result<Cow<'_, Pass>> {
        if !self.uses_device() {
            return Ok(Cow::Borrowed(self));
        }
        let mut copied = Copied::default();
        let mut pass = self.with_commands_read()?.into_owned();
        for color in &mut pass.colors {
            *color = color.snapshot()?;
        }
        if let Some(depth) = &mut pass.depth {
            *depth = depth.snapshot()?;
        }
        if let Some(stencil) = &mut pass.stencil {
            *stencil = stencil.snapshot()?;
        }
        for draw in &mut pass.draws {
            let indices = draw.indices.iter_mut().map(|indices| &mut indices.range);
            draw.vertex_buffers.iter_mut().chain(indices).try_for_each(|r| copied.range(r))?;
            draw.sets.iter_mut().try_for_each(|set| copied.set(set))?;
        }
        Ok(Cow::Owned(pass))
    }

    fn uses_device(&self) -> bool {
        let is_there = |range: &BufferRange| range.buffer.device_memory().is_some();
        let binds_there = |binding: &Binding| match binding {
            Binding::Uniform(range) | Binding::Storage(range) => is_there(range),
            Binding::Sampled(texture, _) | Binding::Texture(texture) => texture.image().is_some(),
            Binding::Sampler(_) => false,
            Binding::StorageImage(_) => true,
        };
        let all = |set: &BindingSet| {
            set.entries.iter().flat_map(|entry| &entry.resources).any(binds_there)
        };
        self.colors.iter().any(|color| color.image.is_some())
            || self.depth.as_ref().is_some_and(|depth| depth.image.is_some())
            || self.stencil.as_ref().is_some_and(|stencil| stencil.image.is_some())
            || self.draws.iter().any(|draw| {
                draw.indirect.is_some()
                    || draw.vertex_buffers.iter().any(is_there)
                    || draw.indices.as_ref().is_some_and(|indices| is_there(&indices.range))
                    || draw.sets.iter().any(|set| all(set))
            })
    }
}

/// What was copied already, so that draws share it as before. The keys are addresses of what the pass holds.
#[derive(Default)]
struct Copied {
    buffers: HashMap<*const BufferSource, Arc<BufferSource>>,
    textures: HashMap<*const Texture, Arc<Texture>>,
    sets: HashMap<*const BindingSet, Arc<BindingSet>>,
}

impl Copied {
    fn range(&mut self, range: &mut BufferRange) -> Result<()> {
        let address = Arc::as_ptr(&range.buffer);
        if let Some(copy) = self.buffers.get(&address) {
            range.buffer = copy.clone();
        } else if range.buffer.device_memory().is_some() {
            let content = range.buffer.content()?.into_owned();
            let copy = Arc::new(BufferSource::new(range.buffer.label(), content));
            self.buffers.insert(address, copy.clone());
            range.buffer = copy;
        }
        Ok(())
    }

    fn texture(&mut self, texture: &mut Arc<Texture>) -> Result<()> {
        let address = Arc::as_ptr(texture);
        if let Some(copy) = self.textures.get(&address) {
            *texture = copy.clone();
        } else if let Some(image) = texture.image() {
            let levels = (0..image.levels()).map(|n| Ok(image.download(n)?.bytes));
            let levels = levels.collect::<Result<_>>()?;
            let (label, shape) = (texture.label(), texture.shape());
            let copy = Texture::of_shape(label, shape, texture.extent(), texture.format(), levels);
            let copy = Arc::new(copy);
            self.textures.insert(address, copy.clone());
            *texture = copy;
        }
        Ok(())
    }

    fn set(&mut self, set: &mut Arc<BindingSet>) -> Result<()> {
        let address = Arc::as_ptr(set);
        if let Some(copy) = self.sets.get(&address) {
            *set = copy.clone();
            return Ok(());
        }
        let mut copy = BindingSet::clone(set);
        for binding in copy.entries.iter_mut().flat_map(|entry| &mut entry.resources) {
            match binding {
                Binding::Uniform(range) | Binding::Storage(range) => self.range(range)?,
                Binding::Sampled(texture, _) | Binding::Texture(texture) => {
                    self.texture(texture)?
                }
                // Shaders write them, so there is no copy that stands for them.
                Binding::StorageImage(_) | Binding::Sampler(_) => {}
            }
        }
        let copy = Arc::new(copy);
        self.sets.insert(address, copy.clone());
        *set = copy;
        Ok(())
    }
}
