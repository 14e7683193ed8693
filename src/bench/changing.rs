//! Frames in which everything changes that usually changes in an application: the camera, the objects, the
//! materials.
//!
//! A warm frame runs commands that were recorded once. An animated application pays more: its uniform data is
//! new in each frame, and its commands are recorded anew. Here, each frame's pass holds new buffers behind all
//! descriptors, new descriptor sets and new push constants; vertices, indices, textures, pipelines and
//! shaders stay. Making the pass is not timed, since that is the application's own work. Then
//!
//! * compute encodes the pass as a frame, validation included, submits it and waits;
//! * classic uploads the new buffers, writes its descriptor sets, records its command buffer, submits it and waits.
//!   Its pipelines stay, and nothing is validated: a program that calls Vulkan itself would pay for neither.
//!
//! Both draw to one image of the device, and need depths and stencil values no longer than the frame.

use super::run::{Executors, Frame, Rounds, Settings, rounds};
use crate::{
    error::Result,
    pass::{Binding, BindingSet, BufferRange, BufferSource, Pass},
    target::StoreOp,
    vk::{Gpu, Image, ImageInfo, ImageUse},
};
use std::{collections::HashMap, sync::Arc};

/// `pass` with new buffers, descriptor sets and push constants. The picture stays the same.
pub fn renewed(pass: &Pass) -> Pass {
    let mut buffers = HashMap::new();
    let mut sets: HashMap<*const BindingSet, Arc<BindingSet>> = HashMap::new();
    let mut new = pass.clone();
    for set in new.draws.iter_mut().flat_map(|draw| &mut draw.sets) {
        let known = sets.entry(Arc::as_ptr(set));
        *set = known.or_insert_with(|| Arc::new(renewed_set(set, &mut buffers))).clone();
    }
    new
}

/// `pass`, which draws to images and keeps neither depths nor stencil values.
fn on_images(gpu: &Gpu, pass: &Pass) -> Result<Pass> {
    let mut pass = pass.clone();
    let (extent, usage) = (pass.extent, ImageUse::Attachment);
    for color in &mut pass.colors {
        let info = ImageInfo::new("colour target", extent, color.format, usage);
        color.image = Some(Image::new(gpu, &info)?);
    }
    if let Some(depth) = &mut pass.depth {
        depth.store = StoreOp::Discard;
    }
    if let Some(stencil) = &mut pass.stencil {
        stencil.store = StoreOp::Discard;
    }
    Ok(pass)
}

type Buffers = HashMap<*const BufferSource, Arc<BufferSource>>;

fn renewed_set(set: &BindingSet, buffers: &mut Buffers) -> BindingSet {
    let mut set = set.clone();
    for binding in set.entries.iter_mut().flat_map(|entry| &mut entry.resources) {
        if let Binding::Uniform(BufferRange { buffer, .. })
        | Binding::Storage(BufferRange { buffer, .. }) = binding
        {
            let known = buffers.entry(Arc::as_ptr(buffer));
            *buffer = known.or_insert_with(|| Arc::new(BufferSource::clone(buffer))).clone();
        }
    }
    set
}

/// Times frames of `pass` in which everything changes.
///
/// # Errors
/// Those of the executors.
pub fn rounds_of(
    executors: &mut Executors,
    pass: &Pass,
    settings: &Settings,
    progress: &mut dyn FnMut(f64),
) -> Result<Rounds> {
    let Executors { compute, classic } = executors;
    let pass = &on_images(compute.gpu(), pass)?;
    let mut by_classic = classic.prepare(pass)?;
    rounds(
        settings,
        &mut || {
            let next = renewed(pass);
            Frame::of(|| {
                let mut frame = compute.begin()?;
                frame.encode(&next)?;
                frame.submit()?.wait()?;
                Ok(0)
            })
        },
        &mut || {
            let next = renewed(pass);
            Frame::of(|| {
                classic.record_again(&mut by_classic, &next)?;
                by_classic.execute()
            })
        },
        progress,
    )
}

#[cfg(test)]
mod tests {
    use super::super::{build, scenes};
    use super::*;
    use crate::image::Extent;

    #[test]
    fn what_descriptors_read_is_new_and_shared_as_before() {
        let recipe = scenes::find("draws").unwrap().recipe;
        let recipe = super::super::Recipe { count: Some(4000), draws: 40, ..recipe };
        let pass = build::pass("draws", &recipe, Extent::new(64, 64)).unwrap();
        let new = renewed(&pass);
        new.validate().unwrap();
        let frame =
            |pass: &Pass, draw: usize| match &pass.draws[draw].sets[0].entries[0].resources[..] {
                [Binding::Uniform(range)] => range.buffer.clone(),
                other => panic!("{other:?}"),
            };
        for draw in 0..pass.draws.len() {
            let (old, now) = (frame(&pass, draw), frame(&new, draw));
            assert!(!Arc::ptr_eq(&old, &now) && old.host_bytes() == now.host_bytes());
            assert!(Arc::ptr_eq(&now, &frame(&new, 0)), "one buffer stays one buffer");
            let [old, now] = [&pass, &new].map(|pass| &pass.draws[draw]);
            assert!(!Arc::ptr_eq(&old.sets[1], &now.sets[1]));
            assert!(Arc::ptr_eq(&old.vertex_buffers[0].buffer, &now.vertex_buffers[0].buffer));
        }
    }
}
