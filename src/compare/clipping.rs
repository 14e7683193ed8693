//! Whether triangles cross the border of the clip volume.
//!
//! The rule, by the clip-space positions a vertex shader wrote: a triangle is *outside* if all three
//! vertices are beyond one and the same plane of the volume, *inside* if none is beyond any, and
//! *crosses* otherwise. The volume is Vulkan's: `-w <= x <= w`, `-w <= y <= w`, `0 <= z <= w`. A
//! vertex with a coordinate that is not a number is beyond every plane: such a triangle draws
//! nothing anywhere.
//!
//! The rule is conservative in one way only: a triangle that crosses but is culled or hidden still
//! counts, so that a drawing may be granted the wider limits without needing them.

/// A clip-space position.
pub type Position = [f32; 4];

/// Where a triangle lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// No vertex is beyond any plane: nothing is clipped.
    Inside,
    /// Some vertex is beyond a plane, but no plane has all of them beyond it.
    Crosses,
    /// All vertices are beyond one plane: nothing is drawn.
    Outside,
}

/// Where the triangle of the three positions lies.
pub fn side(triangle: [Position; 3]) -> Side {
    let [a, b, c] = triangle.map(beyond);
    if a | b | c == 0 {
        Side::Inside
    } else if a & b & c != 0 {
        Side::Outside
    } else {
        Side::Crosses
    }
}

/// Whether any of `triangles` crosses the border.
pub fn any_crosses(triangles: impl IntoIterator<Item = [Position; 3]>) -> bool {
    triangles.into_iter().any(|triangle| side(triangle) == Side::Crosses)
}

/// One bit per plane that the position is beyond.
fn beyond([x, y, z, w]: Position) -> u8 {
    let inside = [x >= -w, x <= w, y >= -w, y <= w, z >= 0.0, z <= w];
    inside.iter().enumerate().fold(0, |bits, (plane, &inside)| bits | u8::from(!inside) << plane)
}

#[cfg(test)]
mod tests {
    use super::*;

    const IN: Position = [0.0, 0.0, 0.5, 1.0];

    #[test]
    fn the_border_itself_is_inside() {
        let corner = [1.0, -1.0, 0.0, 1.0];
        let far = [-2.0, 2.0, 2.0, 2.0];
        assert_eq!(side([IN, corner, far]), Side::Inside);
    }

    #[test]
    fn each_plane_is_crossed_by_one_vertex_beyond_it() {
        for beyond in [
            [-1.1, 0.0, 0.5, 1.0],
            [1.1, 0.0, 0.5, 1.0],
            [0.0, -1.1, 0.5, 1.0],
            [0.0, 1.1, 0.5, 1.0],
            [0.0, 0.0, -0.1, 1.0],
            [0.0, 0.0, 1.1, 1.0],
        ] {
            assert_eq!(side([IN, IN, beyond]), Side::Crosses, "{beyond:?}");
            assert_eq!(side([beyond; 3]), Side::Outside, "{beyond:?}");
        }
    }

    #[test]
    fn beyond_different_planes_is_crossing() {
        // The triangle's vertices are all outside, but it may cover the whole viewport.
        let triangle = [[-9.0, -9.0, 0.5, 1.0], [9.0, -9.0, 0.5, 1.0], [0.0, 9.0, 0.5, 1.0]];
        assert_eq!(side(triangle), Side::Crosses);
    }

    #[test]
    fn behind_the_eye_crosses() {
        assert_eq!(side([IN, IN, [0.0, 0.0, -0.5, -0.4]]), Side::Crosses);
    }

    #[test]
    fn no_number_is_beyond_everything() {
        assert_eq!(side([[f32::NAN; 4]; 3]), Side::Outside);
        assert!(!any_crosses([[IN, IN, IN], [[f32::NAN; 4]; 3]]));
        assert!(any_crosses([[IN, IN, IN], [IN, IN, [2.0, 0.0, 0.0, 1.0]]]));
    }
}
