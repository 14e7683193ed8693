//! Polygons to triangles.

use glam::{Vec2, Vec3};

/// Polygons with more corners are cut as fans: finding ears can cost the cube of the corners.
const MAX_EARS: usize = 1024;

/// Steps that all polygons of a file may take together, a few seconds; then the rest are fans.
pub(super) const STEPS: u64 = 1 << 31;

/// Cuts the polygon with these corners into triangles of corner numbers, of the same winding:
/// a fan where it is convex, ears where it is not. `steps` counts down to fans only.
pub(super) fn triangulate(corners: &[Vec3], steps: &mut u64, out: &mut Vec<[usize; 3]>) {
    let n = corners.len();
    let fan = |out: &mut Vec<[usize; 3]>| out.extend((2..n).map(|i| [0, i - 1, i]));
    if n <= 3 || n > MAX_EARS {
        return fan(out);
    }
    // Newell's normal is right for concave and slightly bent polygons; the polygon is cut as seen
    // along its largest component.
    let normal: Vec3 = (0..n).map(|i| corners[i].cross(corners[(i + 1) % n])).sum();
    let size = normal.abs();
    let flat = |p: Vec3| match () {
        _ if size.z >= size.x && size.z >= size.y => Vec2::new(p.x, p.y * normal.z.signum()),
        _ if size.y >= size.x => Vec2::new(p.z, p.x * normal.y.signum()),
        _ => Vec2::new(p.y, p.z * normal.x.signum()),
    };
    let points: Vec<Vec2> = corners.iter().map(|&p| flat(p)).collect();
    let area =
        |a: usize, b: usize, c: usize| (points[b] - points[a]).perp_dot(points[c] - points[a]);
    if (0..n).all(|i| area(i, (i + 1) % n, (i + 2) % n) >= 0.0) {
        return fan(out);
    }
    let mut left: Vec<usize> = (0..n).collect();
    while left.len() > 3 {
        let m = left.len();
        if *steps == 0 {
            out.extend((2..m).map(|i| [left[0], left[i - 1], left[i]]));
            return;
        }
        let is_ear = |i: usize| {
            let (a, b, c) = (left[(i + m - 1) % m], left[i], left[(i + 1) % m]);
            let inside = |&p: &usize| {
                ![a, b, c].contains(&p)
                    && area(a, b, p) >= 0.0
                    && area(b, c, p) >= 0.0
                    && area(c, a, p) >= 0.0
            };
            area(a, b, c) > 0.0 && !left.iter().any(inside)
        };
        // Crossing outlines may have no ear; then any corner is as good.
        let i = (0..m).find(|&i| is_ear(i)).unwrap_or(0);
        *steps = steps.saturating_sub((i as u64 + 1) * m as u64);
        out.push([left[(i + m - 1) % m], left[i], left[(i + 1) % m]]);
        left.remove(i);
    }
    out.push([left[0], left[1], left[2]]);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn areas(corners: &[Vec3]) -> (Vec3, f32, usize) {
        let mut out = Vec::new();
        triangulate(corners, &mut STEPS.clone(), &mut out);
        let cross = |t: &[usize; 3]| {
            (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]) * 0.5
        };
        let sum = out.iter().map(cross).sum();
        (sum, out.iter().map(|t| cross(t).length()).sum(), out.len())
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        // An arrow head, an L and a comb, in all three planes and both windings.
        let shapes: [&[(f32, f32)]; 3] = [
            &[(0., 0.), (2., 1.), (0., 2.), (1., 1.)],
            &[(0., 0.), (3., 0.), (3., 1.), (1., 1.), (1., 3.), (0., 3.)],
            &[(0., 0.), (5., 0.), (5., 4.), (4., 1.), (3., 4.), (2., 1.), (1., 4.)],
        ];
        for shape in shapes {
            for axis in 0..3 {
                for reversed in [false, true] {
                    let mut corners: Vec<Vec3> = shape
                        .iter()
                        .map(|&(x, y)| {
                            let mut p = [x, y, 0.5];
                            p.rotate_right(axis);
                            Vec3::from_array(p)
                        })
                        .collect();
                    if reversed {
                        corners.reverse();
                    }
                    let (sum, total, count) = areas(&corners);
                    assert_eq!(count, shape.len() - 2);
                    // Triangles that overlap or face the other way make the sums differ.
                    assert!((sum.length() - total).abs() < 1e-5, "{shape:?} {axis} {reversed}");
                }
            }
        }
    }

    #[test]
    fn degenerate_polygons_end() {
        let line: Vec<Vec3> = (0..9).map(|i| Vec3::splat(i as f32)).collect();
        assert_eq!(areas(&line).2, 7);
        assert_eq!(areas(&[Vec3::NAN; 6]).2, 4);
        assert_eq!(areas(&[Vec3::ZERO; 2]).2, 0);
        let star = |i: usize| {
            let (s, c) = (i as f32 / 5.0 * std::f32::consts::PI).sin_cos();
            Vec3::new(c, s, 0.0) * if i.is_multiple_of(2) { 2.0 } else { 0.5 }
        };
        let star: Vec<Vec3> = (0..10).map(star).collect();
        let (mut out, mut steps) = (Vec::new(), 1);
        triangulate(&star, &mut steps, &mut out);
        assert_eq!((out.len(), steps), (8, 0), "without steps the rest is a fan");
    }
}
