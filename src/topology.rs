//! How vertices become primitives, and what lines cover, in Vulkan's terms.

shared_enum! {
    /// How vertices become primitives.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    #[non_exhaustive]
    pub enum Topology {
        /// Three vertices each.
        #[default]
        TriangleList = 0,
        /// Each vertex after the second makes a triangle with the two before it.
        TriangleStrip = 1,
        /// Each vertex after the second makes a triangle with the one before it and the first.
        TriangleFan = 2,
        /// A point for each vertex: a square around it. The vertex shader writes its side in pixels to `gl_PointSize`; it is brought
        /// into 1..=256, and is 1 if the shader writes none. A point is clipped by its centre at the near and the far plane, and cut
        /// at the sides of the viewport. If pixels have several samples, the fragment shader runs twice in pixels on a diagonal of the
        /// square, for the samples on either side.
        PointList = 3,
        /// A line for each two vertices. Sides of the viewport cut it and give it no other ends; the near and the far plane do. If
        /// pixels have several samples, the fragment shader may run twice in a pixel, as for points.
        LineList = 4,
        /// Each vertex after the first makes a line with the one before it.
        LineStrip = 5,
    }
}

// Kernels tell triangles from lines and points by their order.
const _: () = {
    assert!((Topology::TriangleFan as u32) < Topology::PointList as u32);
    assert!((Topology::PointList as u32) < Topology::LineList as u32);
    assert!((Topology::LineList as u32) < Topology::LineStrip as u32);
};

impl Topology {
    /// Primitives assembled from `vertices` vertices.
    pub const fn primitives(self, vertices: u32) -> u32 {
        match self {
            Topology::PointList => vertices,
            Topology::LineList => vertices / 2,
            Topology::LineStrip => vertices.saturating_sub(1),
            Topology::TriangleList => vertices / 3,
            Topology::TriangleStrip | Topology::TriangleFan => vertices.saturating_sub(2),
        }
    }

    /// Vertices that so many `primitives`, not none, are assembled from.
    pub(crate) const fn elements(self, primitives: u32) -> u32 {
        match self {
            Topology::PointList => primitives,
            Topology::LineList => 2 * primitives,
            Topology::LineStrip => primitives + 1,
            Topology::TriangleList => 3 * primitives,
            Topology::TriangleStrip | Topology::TriangleFan => primitives + 2,
        }
    }

    /// What its primitives are.
    pub const fn kind(self) -> PrimitiveKind {
        match self {
            Topology::PointList => PrimitiveKind::Point,
            Topology::LineList | Topology::LineStrip => PrimitiveKind::Line,
            Topology::TriangleList | Topology::TriangleStrip | Topology::TriangleFan => {
                PrimitiveKind::Triangle
            }
        }
    }
}

shared_enum! {
    /// A kind of primitives: the number of its vertices.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
    pub enum PrimitiveKind {
        /// A square around a vertex.
        Point = 1,
        /// A line between two vertices.
        Line = 2,
        /// A triangle.
        Triangle = 3,
    }
}

shared_enum! {
    /// What a line covers, as `VkLineRasterizationMode`.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
    #[non_exhaustive]
    pub enum LineMode {
        /// A rectangle between its ends, as wide as [`crate::Pipeline::line_width`] says. Vulkan's default on devices with
        /// `strictLines`.
        #[default]
        Rectangular = 0,
        /// A rather flat line covers one pixel in each column, a rather steep one a pixel in each row, by the diamond-exit rule. A
        /// line of width n, rounded to a whole number, covers n of them, one below or beside the other.
        Bresenham = 1,
    }
}
