//! The inputs and outputs of shaders, location by location.

use super::Scalar;
use crate::abi;
use rspirv::spirv::BuiltIn;

/// How a fragment input is interpolated from the vertices of its triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Interpolation {
    /// Perspective-correct.
    Smooth,
    /// Linear on the screen.
    NoPerspective,
    /// The provoking vertex's, as it is.
    Flat,
}

/// Where among the samples of a pixel a fragment input is interpolated, if not in the centre.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Auxiliary {
    /// `centroid`: at a place that the triangle covers.
    Centroid,
    /// `sample`: at each sample. The shader runs once for each of them.
    Sample,
}

/// The part of an `in` or `out` variable at one location.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Varying {
    /// The location.
    pub location: u32,
    /// The first component, 0 to 3.
    pub component: u32,
    /// Components, 1 to 4.
    pub count: u32,
    /// Kind of the components.
    pub scalar: Scalar,
    /// Fragment inputs: the interpolation; [`Interpolation::Flat`] for integers everywhere.
    pub interpolation: Interpolation,
    /// Fragment inputs: where they are interpolated.
    pub auxiliary: Option<Auxiliary>,
    /// Fragment outputs: 1 for the second source of blending (`layout(index = 1)`), 0 for all others.
    pub index: u32,
}

/// How many distances from planes a vertex shader gives its vertices, or a fragment shader reads. A negative distance is
/// outside.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Distances {
    /// Elements of `gl_ClipDistance`. The part of a primitive where one of them is negative is not drawn.
    pub clip: u32,
    /// Elements of `gl_CullDistance`. A primitive is not drawn if one of them is negative at all its vertices.
    pub cull: u32,
}

impl Distances {
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        *self == Self::default()
    }

    /// Takes note of a declaration of one of the two.
    ///
    /// # Errors
    /// A sentence, if it is the second one.
    pub(super) fn add(&mut self, built_in: BuiltIn, count: usize) -> Result<(), String> {
        let known = if built_in == BuiltIn::ClipDistance { &mut self.clip } else { &mut self.cull };
        if *known > 0 {
            return Err(format!("the built-in {built_in:?} is declared twice"));
        }
        *known = count as u32;
        Ok(())
    }

    /// Why no kernel has room for so many; `None` if kernels have.
    pub(super) fn refusal(&self) -> Option<String> {
        let Self { clip, cull } = self;
        (clip + cull > abi::MAX_DISTANCES).then(|| {
            format!(
                "it has {clip} clip distances and {cull} cull distances; there are {} of both together",
                abi::MAX_DISTANCES
            )
        })
    }
}
