//! The inputs and outputs of shaders, location by location.

use super::Scalar;

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
