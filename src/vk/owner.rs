//! Which device a handle belongs to.
//!
//! Vulkan does not check whether handles that are used together belong to one device, and drivers crash if they
//! do not. So every function that uses two handles together calls [`same_device`] first.

use super::{
    buffer::Buffer,
    gpu::{Gpu, Shared},
    image::Image,
    kernel::Kernel,
    recorder::Recorder,
    sampler::Sampler,
    table::ResourceTable,
};
use crate::error::{Error, Result};
use bytemuck::Pod;

/// A handle that belongs to a device.
pub(super) trait Owned {
    /// The device.
    fn owner(&self) -> &Shared;
    /// A description for messages.
    fn title(&self) -> String;
}

/// Refuses handles of two devices.
pub(super) fn same_device(a: &dyn Owned, b: &dyn Owned) -> Result<()> {
    if std::ptr::eq(a.owner(), b.owner()) {
        return Ok(());
    }
    let device = |of: &dyn Owned| {
        let Shared { info, opened, .. } = of.owner();
        format!("device {opened} of this program ({})", info.name)
    };
    Err(Error::Usage(format!(
        "{} belongs to {}, and {} belongs to {}: make both from one `Gpu` or its clones",
        a.title(),
        device(a),
        b.title(),
        device(b)
    )))
}

impl Owned for Gpu {
    fn owner(&self) -> &Shared {
        &self.0
    }
    fn title(&self) -> String {
        "an executor".into()
    }
}

impl<T: Pod> Owned for Buffer<T> {
    fn owner(&self) -> &Shared {
        &self.raw().gpu
    }
    fn title(&self) -> String {
        format!("buffer `{}`", self.raw().name)
    }
}

impl Owned for Image {
    fn owner(&self) -> &Shared {
        &self.0.gpu
    }
    fn title(&self) -> String {
        format!("image `{}`", self.0.name)
    }
}

impl Owned for Sampler {
    fn owner(&self) -> &Shared {
        &self.gpu.0
    }
    fn title(&self) -> String {
        "a sampler".into()
    }
}

impl Owned for Kernel {
    fn owner(&self) -> &Shared {
        &self.0.gpu
    }
    fn title(&self) -> String {
        format!("kernel `{}`", self.0.name)
    }
}

impl Owned for ResourceTable {
    fn owner(&self) -> &Shared {
        &self.raw().gpu.0
    }
    fn title(&self) -> String {
        "a resource table".into()
    }
}

impl Owned for Recorder {
    fn owner(&self) -> &Shared {
        &self.gpu.0
    }
    fn title(&self) -> String {
        format!("recorder `{}`", self.commands.label)
    }
}
