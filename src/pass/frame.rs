//! What executors make of passes.

use super::Pass;
use crate::image::Picture;

/// The targets of a [`Pass`] that are stored, as a device executor returns them.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Frame {
    /// The colour targets that are stored, in the order of the pass.
    pub colors: Vec<Picture>,
    /// The depth target, if it is stored.
    pub depth: Option<Picture>,
    /// The stencil target, if it is stored.
    pub stencil: Option<Picture>,
}

impl Frame {
    /// These pictures, and no stencil values.
    pub fn new(colors: Vec<Picture>, depth: Option<Picture>) -> Self {
        Self { colors, depth, stencil: None }
    }

    setters! {
        ;
        into
        stencil: Option<Picture>,
    }

    /// The first colour target that is stored, if there is one.
    pub fn into_color(self) -> Option<Picture> {
        self.colors.into_iter().next()
    }
}

/// Something that makes pictures of passes on a device.
pub trait Executor {
    /// Executes `pass` and returns its targets.
    ///
    /// # Errors
    /// [`crate::Error::Usage`] if the pass contradicts itself ([`Pass::validate`]),
    /// [`crate::Error::Capacity`] if it does not fit the device, [`crate::Error::Lost`] if the device
    /// did not answer.
    fn render(&mut self, pass: &Pass) -> crate::Result<Frame>;
}
