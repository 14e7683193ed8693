//! Textures and samplers as plain data.

use crate::{format::Format, image::Extent};

/// A two-dimensional texture with its mip levels.
#[derive(Clone, Debug)]
pub struct Texture {
    /// For messages and debug labels.
    pub label: String,
    /// Size of level 0.
    pub extent: Extent,
    /// Layout of the texels; not [`Format::D32Float`].
    pub format: Format,
    /// Levels from the largest down; level `n` is `max(1, extent >> n)` texels, rows without padding.
    pub levels: Vec<Vec<u8>>,
}

/// How a sampler treats coordinates outside 0..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Wrap {
    /// Repeat.
    #[default]
    Repeat,
    /// Repeat, every other copy mirrored.
    MirroredRepeat,
    /// The edge texel.
    ClampToEdge,
}

/// Nearest or linear.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum Filter {
    /// The nearest texel or level.
    Nearest,
    /// A weighted mean of the neighbours.
    #[default]
    Linear,
}

/// A sampler.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampler {
    /// Wrapping along u.
    pub wrap_u: Wrap,
    /// Wrapping along v.
    pub wrap_v: Wrap,
    /// Magnification.
    pub mag: Filter,
    /// Minification.
    pub min: Filter,
    /// Between mip levels; `None` samples level 0 only.
    pub mip: Option<Filter>,
}

impl Default for Sampler {
    fn default() -> Self {
        Self {
            wrap_u: Wrap::Repeat,
            wrap_v: Wrap::Repeat,
            mag: Filter::Linear,
            min: Filter::Linear,
            mip: Some(Filter::Linear),
        }
    }
}
