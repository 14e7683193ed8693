//! The types of numbers that shaders read from images and write to targets.

use crate::format::{Format, Numeric};
use std::fmt;

/// The type of a texel or of a component, as a shader sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Scalar {
    /// A 32-bit float.
    Float,
    /// A signed 32-bit integer.
    Int,
    /// An unsigned 32-bit integer.
    Uint,
}

impl Scalar {
    /// What shaders read from images of `format`, and write to targets of it.
    pub const fn of(format: Format) -> Self {
        Self::of_numeric(format.numeric())
    }

    /// What shaders read of such channels.
    pub(crate) const fn of_numeric(numeric: Numeric) -> Self {
        match numeric {
            Numeric::Uint | Numeric::Stencil => Self::Uint,
            Numeric::Sint => Self::Int,
            Numeric::Unorm
            | Numeric::Srgb
            | Numeric::Snorm
            | Numeric::Uscaled
            | Numeric::Sscaled
            | Numeric::Float
            | Numeric::Depth => Self::Float,
        }
    }
}

/// As GLSL calls it.
impl fmt::Display for Scalar {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Float => "float",
            Self::Int => "int",
            Self::Uint => "uint",
        })
    }
}
