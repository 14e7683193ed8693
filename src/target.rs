//! Render targets of a pass.

use crate::format::Format;

/// A colour target and its clear colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ColorTarget {
    /// [`Format::Rgba8Unorm`], [`Format::Rgba8Srgb`] or [`Format::Rgba16Float`].
    pub format: Format,
    /// Clear colour, linear RGBA.
    pub clear: [f32; 4],
}

/// A depth target ([`Format::D32Float`]) and its clear depth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DepthTarget {
    /// Clear depth in 0..=1.
    pub clear: f32,
}
