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
        /// Three of six vertices each: the first, the third and the fifth. The others are for geometry shaders, and are ignored.
        TriangleListWithAdjacency = 3,
        /// Each second vertex makes a strip. The others are ignored.
        TriangleStripWithAdjacency = 4,
        /// A point for each vertex: a square around it. The vertex shader writes its side in pixels to `gl_PointSize`; it is brought
        /// into 1..=256, and is 1 if the shader writes none. A point is clipped by its centre at the near and the far plane, and cut
        /// at the sides of the viewport. If pixels have several samples, the fragment shader runs twice in pixels on a diagonal of the
        /// square, for the samples on either side.
        PointList = 5,
        /// A line for each two vertices. Sides of the viewport cut it and give it no other ends; the near and the far plane do. If
        /// pixels have several samples, the fragment shader may run twice in a pixel, as for points.
        LineList = 6,
        /// Each vertex after the first makes a line with the one before it.
        LineStrip = 7,
        /// The second and the third of four vertices each. The others are ignored.
        LineListWithAdjacency = 8,
        /// All vertices but the first and the last make a strip.
        LineStripWithAdjacency = 9,
    }
}

// Kernels tell triangles from lines and points by their order.
const _: () = {
    let mut at = 0;
    while at < Topology::ALL.len() {
        let (topology, points) = (Topology::ALL[at], Topology::PointList as u32);
        match topology.kind() {
            PrimitiveKind::Triangle => assert!((topology as u32) < points),
            PrimitiveKind::Point => assert!(topology as u32 == points),
            PrimitiveKind::Line => assert!(topology as u32 > points),
        }
        at += 1;
    }
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
            Topology::LineListWithAdjacency => vertices / 4,
            Topology::LineStripWithAdjacency => vertices.saturating_sub(3),
            Topology::TriangleListWithAdjacency => vertices / 6,
            Topology::TriangleStripWithAdjacency => vertices.saturating_sub(4) / 2,
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
            Topology::LineListWithAdjacency => 4 * primitives,
            Topology::LineStripWithAdjacency => primitives + 3,
            Topology::TriangleListWithAdjacency => 6 * primitives,
            Topology::TriangleStripWithAdjacency => 2 * primitives + 4,
        }
    }

    /// What its primitives are.
    pub const fn kind(self) -> PrimitiveKind {
        match self {
            Topology::PointList => PrimitiveKind::Point,
            Topology::LineList
            | Topology::LineStrip
            | Topology::LineListWithAdjacency
            | Topology::LineStripWithAdjacency => PrimitiveKind::Line,
            Topology::TriangleList
            | Topology::TriangleStrip
            | Topology::TriangleFan
            | Topology::TriangleListWithAdjacency
            | Topology::TriangleStripWithAdjacency => PrimitiveKind::Triangle,
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

/// Which vertex of a primitive gives the inputs that are `flat`, as `VkProvokingVertexModeEXT`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub enum ProvokingVertex {
    /// The first: of the `n`th triangle of a strip the vertex `n`, of a fan `n + 1`.
    #[default]
    First,
    /// The last: of the `n`th triangle of a strip or of a fan the vertex `n + 2`.
    Last,
}
