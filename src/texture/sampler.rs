//! The state of samplers.

use crate::state::Compare;

/// How a sampler treats coordinates outside 0..=1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Wrap {
    /// Repeat.
    #[default]
    Repeat,
    /// Repeat, every other copy mirrored.
    MirroredRepeat,
    /// The edge texel.
    ClampToEdge,
    /// [`Sampler::border`].
    ClampToBorder,
    /// Mirrored once, then the edge texel. Devices without `samplerMirrorClampToEdge` do not have it.
    MirrorClampToEdge,
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

/// The colour beyond the edges of a texture, for [`Wrap::ClampToBorder`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Border {
    /// (0, 0, 0, 0).
    #[default]
    TransparentBlack,
    /// (0, 0, 0, 1).
    OpaqueBlack,
    /// (1, 1, 1, 1).
    OpaqueWhite,
}

/// A sampler: `VkSamplerCreateInfo`. Begin with [`Sampler::default`], which is trilinear and repeats, or with
/// [`Sampler::nearest`], and set what differs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub struct Sampler {
    /// Wrapping along u.
    pub wrap_u: Wrap,
    /// Wrapping along v.
    pub wrap_v: Wrap,
    /// Wrapping along w, of textures of three dimensions.
    pub wrap_w: Wrap,
    /// Magnification.
    pub mag: Filter,
    /// Minification.
    pub min: Filter,
    /// Between mip levels; `None` samples level 0 only.
    pub mip: Option<Filter>,
    /// Added to the level of detail.
    pub lod_bias: f32,
    /// The least level of detail.
    pub min_lod: f32,
    /// The greatest level of detail; [`Sampler::ALL_LEVELS`] allows all.
    pub max_lod: f32,
    /// Samples along the longer side of a pixel's footprint, at most; 1 is isotropic.
    pub anisotropy: f32,
    /// Compares a reference with the depth of texels ("reference, this comparison, depth") and returns how much of it holds:
    /// for `sampler2DShadow` and its relatives, whose textures hold depths.
    pub compare: Option<Compare>,
    /// The colour beyond the edges.
    pub border: Border,
    /// Coordinates count texels. Such samplers have many limits, see `unnormalizedCoordinates` in the Vulkan specification.
    pub unnormalized: bool,
}

impl Sampler {
    /// The greatest level of detail that leaves no mip level out.
    pub const ALL_LEVELS: f32 = 1000.0;

    const TRILINEAR: Self = Self {
        wrap_u: Wrap::Repeat,
        wrap_v: Wrap::Repeat,
        wrap_w: Wrap::Repeat,
        mag: Filter::Linear,
        min: Filter::Linear,
        mip: Some(Filter::Linear),
        lod_bias: 0.0,
        min_lod: 0.0,
        max_lod: Self::ALL_LEVELS,
        anisotropy: 1.0,
        compare: None,
        border: Border::TransparentBlack,
        unnormalized: false,
    };

    /// One texel of level 0, without a filter, and that at the edge beyond the edges.
    pub const fn nearest() -> Self {
        let (wrap, filter) = (Wrap::ClampToEdge, Filter::Nearest);
        Self {
            wrap_u: wrap,
            wrap_v: wrap,
            wrap_w: wrap,
            mag: filter,
            min: filter,
            mip: None,
            ..Self::TRILINEAR
        }
    }

    setters! {
        wrap_u: Wrap,
        wrap_v: Wrap,
        wrap_w: Wrap,
        mag: Filter,
        min: Filter,
        mip: Option<Filter>,
        lod_bias: f32,
        min_lod: f32,
        max_lod: f32,
        anisotropy: f32,
        compare: Option<Compare>,
        border: Border,
        unnormalized: bool,
    }

    /// The same wrapping along u, v and w.
    #[must_use]
    pub const fn wrap(self, wrap: Wrap) -> Self {
        self.wrap_u(wrap).wrap_v(wrap).wrap_w(wrap)
    }

    /// Whether it filters anything linearly.
    pub(crate) fn is_linear(&self) -> bool {
        [Some(self.mag), Some(self.min), self.mip].contains(&Some(Filter::Linear))
    }

    /// Whether it shows a border.
    pub(crate) fn has_border(&self) -> bool {
        [self.wrap_u, self.wrap_v, self.wrap_w].contains(&Wrap::ClampToBorder)
    }

    /// Why Vulkan has no such sampler, on any device.
    pub(crate) fn check(&self) -> Result<(), String> {
        let Self { lod_bias, min_lod, max_lod, anisotropy, .. } = *self;
        let all = [lod_bias, min_lod, max_lod, anisotropy];
        if !all.iter().all(|number| number.is_finite()) {
            return Err("its numbers are finite".into());
        }
        if min_lod > max_lod {
            return Err(format!("the least level of detail is {min_lod}, the greatest {max_lod}"));
        }
        if anisotropy < 1.0 {
            return Err(format!("an anisotropy of {anisotropy}; it is 1 at least"));
        }
        if self.unnormalized {
            let clamps = |wrap| matches!(wrap, Wrap::ClampToEdge | Wrap::ClampToBorder);
            let plain = self.mag == self.min
                && self.mip.is_none()
                && clamps(self.wrap_u)
                && clamps(self.wrap_v)
                && anisotropy == 1.0
                && self.compare.is_none();
            if !plain {
                return Err("with coordinates that are not normalized, `mag` and `min` are equal, `mip` is `None`, \
                            `wrap_u` and `wrap_v` clamp to the edge or the border, and there is neither anisotropy nor \
                            a comparison"
                    .into());
            }
        }
        Ok(())
    }
}

impl Default for Sampler {
    fn default() -> Self {
        Self::TRILINEAR
    }
}
