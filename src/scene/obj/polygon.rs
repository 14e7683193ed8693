//! Polygons to triangles.
//!
//! It cuts ears (Meisters 1975) and keeps every corner: neighbouring polygons share all corners of an edge, and
//! a polygon that left some out would not meet its neighbour. Existing libraries drop corners on straight
//! edges.
//!
//! A hole is joined to the outline by a bridge: two edges along each other, whose corners the outline
//! has twice. Corners at the same place therefore do not block an ear.

use glam::{DVec2, DVec3};

/// Steps that all polygons of a file may take together, a few seconds; then the rest are fans.
pub(super) const STEPS: u64 = 1 << 31;

/// Cuts the polygon with these corners into triangles of corner numbers, of the same winding.
/// `steps` counts down to fans only.
pub(super) fn triangulate(corners: &[DVec3], steps: &mut u64, out: &mut Vec<[usize; 3]>) {
    let n = corners.len();
    let fan = |out: &mut Vec<[usize; 3]>| out.extend((2..n).map(|i| [0, i - 1, i]));
    if n <= 3 {
        return fan(out);
    }
    let points = flat(corners);
    // A fan around the first corner is right if all its triangles face the same way.
    if (2..n).all(|i| area(&points, [0, i - 1, i]) > 0.0) {
        return fan(out);
    }
    Outline::new(&points).cut(steps, out);
}

/// The polygon as seen along the largest component of its normal, so that it runs counter-clockwise.
fn flat(corners: &[DVec3]) -> Vec<DVec2> {
    let n = corners.len();
    // Around the first corner and of about unit size: neither distance nor scale costs digits.
    let reach = corners.iter().map(|&p| (p - corners[0]).abs().max_element()).fold(0.0, f64::max);
    let unit = if reach.is_normal() { reach.log2().floor().exp2().recip() } else { 1.0 };
    let near: Vec<DVec3> = corners.iter().map(|&p| (p - corners[0]) * unit).collect();
    // Newell's normal is right for concave and slightly bent polygons.
    let normal: DVec3 = (0..n).map(|i| near[i].cross(near[(i + 1) % n])).sum();
    let size = normal.abs();
    let flat = |p: &DVec3| match () {
        _ if size.z >= size.x && size.z >= size.y => DVec2::new(p.x, p.y * normal.z.signum()),
        _ if size.y >= size.x => DVec2::new(p.z, p.x * normal.y.signum()),
        _ => DVec2::new(p.y, p.z * normal.x.signum()),
    };
    near.iter().map(flat).collect()
}

/// Twice the area, positive for corners that run counter-clockwise.
fn area(points: &[DVec2], [a, b, c]: [usize; 3]) -> f64 {
    (points[b] - points[a]).perp_dot(points[c] - points[a])
}

/// The rest of a polygon while its ears are cut.
struct Outline<'a> {
    points: &'a [DVec2],
    next: Vec<usize>,
    previous: Vec<usize>,
    /// Corners that can lie in an ear, by x: those that are not convex. Convex corners inside of an ear
    /// bring one that is not with them.
    blocking: Vec<usize>,
    is_left: Vec<bool>,
}

/// Twice an area that counts as none: what roundings make of it, in a polygon with a size of 1 to 2.
const NOTHING: f64 = 1e-14;

/// Twice the area of a corner that can be cut wherever it lies, for want of an ear.
const SLIVER: f64 = 1e-9;

impl<'a> Outline<'a> {
    fn new(points: &'a [DVec2]) -> Self {
        let n = points.len();
        let next: Vec<usize> = (0..n).map(|i| (i + 1) % n).collect();
        let previous: Vec<usize> = (0..n).map(|i| (i + n - 1) % n).collect();
        let convex = |i: usize| area(points, [previous[i], i, next[i]]) > 0.0;
        let mut blocking: Vec<usize> = (0..n).filter(|&i| !convex(i)).collect();
        blocking.sort_by(|&a, &b| points[a].x.total_cmp(&points[b].x));
        Self { points, blocking, is_left: vec![true; n], next, previous }
    }

    fn triangle(&self, corner: usize) -> [usize; 3] {
        [self.previous[corner], corner, self.next[corner]]
    }

    /// Cuts ears until a triangle is left.
    fn cut(&mut self, steps: &mut u64, out: &mut Vec<[usize; 3]>) {
        let (mut left, mut at) = (self.points.len(), 0);
        for corner in 0..self.points.len() {
            left -= usize::from(self.merge(corner));
            at = self.next[corner];
        }
        while left > 3 {
            let Some(ear) = self.find(at, left, steps) else { return self.fan(at, out) };
            out.push(self.triangle(ear));
            let next = self.next[ear];
            self.remove(ear);
            left -= 1 + usize::from(self.merge(next));
            // Every other corner: triangles around one corner would be thin.
            at = self.next[self.next[ear]];
        }
        if left == 3 {
            out.push(self.triangle(at));
        }
    }

    /// Removes a corner that is at the place of the one before it, where there is no angle.
    fn merge(&mut self, corner: usize) -> bool {
        let is_same = self.points[self.previous[corner]] == self.points[corner];
        if is_same {
            self.remove(corner);
        }
        is_same
    }

    fn remove(&mut self, corner: usize) {
        let [previous, _, next] = self.triangle(corner);
        (self.next[previous], self.previous[next]) = (next, previous);
        self.is_left[corner] = false;
    }

    /// The next ear to cut, of `left` corners from `first` on; `None` if the steps do not suffice.
    fn find(&self, first: usize, left: usize, steps: &mut u64) -> Option<usize> {
        let corners = || std::iter::successors(Some(first), |&i| Some(self.next[i])).take(left);
        // Where outlines touch, something may lie on the edge of every ear.
        for with_edge in [true, false] {
            for corner in corners() {
                let is_ear = self.is_ear(corner, with_edge, steps);
                if *steps == 0 {
                    return None;
                }
                if is_ear {
                    return Some(corner);
                }
            }
        }
        // Only outlines that cross themselves come here, if only by a rounding.
        let size = |&i: &usize| area(self.points, self.triangle(i));
        let flattest = corners().min_by(|a, b| size(a).abs().total_cmp(&size(b).abs()));
        let sliver = flattest.filter(|i| size(i).abs() < SLIVER);
        Some(sliver.or_else(|| corners().find(|i| size(i) > 0.0)).unwrap_or(first))
    }

    /// The rest as a fan.
    fn fan(&self, first: usize, out: &mut Vec<[usize; 3]>) {
        let mut at = self.next[first];
        while self.next[at] != first {
            out.push([first, at, self.next[at]]);
            at = self.next[at];
        }
    }

    /// Whether the corner is convex and nothing lies inside of its triangle or, `with_edge`, on its edge.
    /// Each corner that is looked at takes a step; without steps the answer means nothing.
    fn is_ear(&self, corner: usize, with_edge: bool, steps: &mut u64) -> bool {
        let points = self.points;
        let [a, b, c] = self.triangle(corner);
        *steps = steps.saturating_sub(1);
        if area(points, [a, b, c]) <= NOTHING {
            return false;
        }
        let [pa, pb, pc] = [a, b, c].map(|i| points[i]);
        let (low, high) = (pa.x.min(pb.x).min(pc.x), pa.x.max(pb.x).max(pc.x));
        let first = self.blocking.partition_point(|&i| points[i].x < low);
        let near = self.blocking[first..].iter().take_while(|&&i| points[i].x <= high);
        let least = if with_edge { -NOTHING } else { NOTHING };
        !near.into_iter().any(|&i| {
            *steps = steps.saturating_sub(1);
            let p = points[i];
            let blocks = || {
                self.is_left[i]
                    && p != pa
                    && p != pb
                    && p != pc
                    && area(points, [a, b, i]) > least
                    && area(points, [b, c, i]) > least
                    && area(points, [c, a, i]) > least
            };
            *steps == 0 || blocks()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, EulerRot};
    use proptest::prelude::*;

    fn triangles(corners: &[DVec3]) -> Vec<[usize; 3]> {
        let mut out = Vec::new();
        triangulate(corners, &mut STEPS.clone(), &mut out);
        out
    }

    /// The sum of the areas as vectors, of their lengths, and the number of triangles. Triangles that
    /// overlap or face the other way make the sums differ.
    fn areas(corners: &[DVec3]) -> (DVec3, f64, usize) {
        let out = triangles(corners);
        let cross = |t: &[usize; 3]| {
            (corners[t[1]] - corners[t[0]]).cross(corners[t[2]] - corners[t[0]]) * 0.5
        };
        (out.iter().map(cross).sum(), out.iter().map(|t| cross(t).length()).sum(), out.len())
    }

    /// Of the outline itself.
    fn area_of(corners: &[DVec2]) -> f64 {
        let n = corners.len();
        (0..n).map(|i| corners[i].perp_dot(corners[(i + 1) % n])).sum::<f64>() * 0.5
    }

    /// In all planes, windings, and from each corner on; at any scale and far away.
    fn covered_once(shape: &[DVec2]) {
        let want = area_of(shape).abs();
        for axis in 0..3 {
            for first in 0..shape.len() {
                for (scale, offset) in [(1.0, 0.5), (-1.0, 0.5), (1e-20, 0.0), (1e30, 0.0)] {
                    let mut corners: Vec<DVec3> = shape
                        .iter()
                        .map(|p| {
                            let mut p = [p.x, p.y * f64::signum(scale), 0.0];
                            p.rotate_right(axis);
                            DVec3::from_array(p) * f64::abs(scale) + offset
                        })
                        .collect();
                    corners.rotate_left(first);
                    let (sum, total, count) = areas(&corners);
                    let alone =
                        (0..shape.len()).filter(|&i| shape[i] != shape[(i + 1) % shape.len()]);
                    assert!(count == alone.count() - 2, "{count} triangles of {shape:?}");
                    let want = want * scale * scale;
                    let near = |v: f64| (v - want).abs() <= want * 1e-9;
                    assert!(
                        near(total) && near(sum.length()),
                        "{shape:?} from {first} on, axis {axis}, scale {scale}: {total}, {sum}, not {want}"
                    );
                }
            }
        }
    }

    fn outline(points: &[(f64, f64)]) -> Vec<DVec2> {
        points.iter().map(|&(x, y)| DVec2::new(x, y)).collect()
    }

    #[test]
    fn concave_polygons_are_covered_once() {
        // An arrow head, an L, a comb, and a square with corners on its edges.
        for shape in [
            &[(0., 0.), (2., 1.), (0., 2.), (1., 1.)][..],
            &[(0., 0.), (3., 0.), (3., 1.), (1., 1.), (1., 3.), (0., 3.)],
            &[(0., 0.), (5., 0.), (5., 4.), (4., 1.), (3., 4.), (2., 1.), (1., 4.)],
            &[(0., 0.), (1., 0.), (2., 0.), (2., 1.), (2., 2.), (1., 2.), (0., 2.), (0., 1.)],
        ] {
            covered_once(&outline(shape));
        }
    }

    #[test]
    fn holes_with_bridges_stay_open() {
        // The bridge as an edge between corners; one that ends on an edge; a hole that touches the
        // outline; two holes on one corner, that touch edges; a hole in line with the outline's corners.
        for (shape, area) in [
            (
                &[
                    (-2., -2.),
                    (2., -2.),
                    (2., 2.),
                    (-2., 2.),
                    (-2., -2.),
                    (-1., -1.),
                    (-1., 1.),
                    (1., 1.),
                    (1., -1.),
                    (-1., -1.),
                ][..],
                12.0,
            ),
            (
                &[
                    (-2., -2.),
                    (0., -2.),
                    (0., -1.),
                    (-1., 0.),
                    (0., 1.),
                    (1., 0.),
                    (0., -1.),
                    (0., -2.),
                    (2., -2.),
                    (2., 2.),
                    (-2., 2.),
                ],
                14.0,
            ),
            (&[(0., 0.), (4., 0.), (4., 4.), (0., 4.), (0., 0.), (1., 2.), (2., 1.)], 14.5),
            (
                &[
                    (0., 0.),
                    (3., 1.),
                    (4., 0.),
                    (4., 1.),
                    (3., 1.),
                    (0., 0.),
                    (1., 3.),
                    (1., 4.),
                    (0., 4.),
                    (1., 3.),
                    (0., 0.),
                    (0., 9.),
                    (9., 9.),
                    (9., 0.),
                ],
                80.0,
            ),
            (
                &[
                    (0., 0.),
                    (1., 1.),
                    (1., 2.),
                    (2., 2.),
                    (2., 1.),
                    (1., 1.),
                    (0., 0.),
                    (3., 0.),
                    (3., 3.),
                    (0., 3.),
                ],
                8.0,
            ),
        ] {
            let shape = outline(shape);
            assert!((area_of(&shape).abs() - area).abs() < 1e-12, "{}", area_of(&shape));
            covered_once(&shape);
        }
    }

    /// A star around the origin: simple, and as jagged as the radii.
    fn star(radii: &[f64]) -> Vec<DVec2> {
        let angle = |i: usize| i as f64 / radii.len() as f64 * std::f64::consts::TAU;
        let at = |(i, r): (usize, &f64)| DVec2::from_angle(angle(i)) * *r;
        radii.iter().enumerate().map(at).collect()
    }

    /// `outer` with `hole` in it, joined by the bridge between the corners numbered `from` and `to`.
    fn bridged(outer: &[DVec2], from: usize, hole: &[DVec2], to: usize) -> Vec<DVec2> {
        let mut all = outer.to_vec();
        all.rotate_left(from);
        all.push(all[0]);
        let around = hole.iter().rev().cycle().skip(hole.len() - 1 - to).take(hole.len() + 1);
        all.extend(around);
        all
    }

    proptest! {
        #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

        #[test]
        fn random_stars_are_covered_once(radii in prop::collection::vec(0.05..1.0f64, 4..24)) {
            covered_once(&star(&radii));
        }

        /// The hole's corners lie on the same rays as the outline's, so a bridge along a ray crosses
        /// nothing.
        #[test]
        fn random_rings_are_covered_once(
            radii in prop::collection::vec((1.0..3.0f64, 0.1..0.9f64), 4..16),
            corner in 0..16usize,
        ) {
            let (outer, inner): (Vec<f64>, Vec<f64>) = radii.into_iter().unzip();
            let corner = corner % outer.len();
            let ring = bridged(&star(&outer), corner, &star(&inner), corner);
            covered_once(&ring);
            // In any plane and far away, where every corner is rounded.
            let turn = DQuat::from_euler(EulerRot::XYZ, outer[0], outer[1], inner[2]);
            let far = DVec3::new(500_000.3, -4_649_776.1, 100.7);
            let corners: Vec<DVec3> = ring.iter().map(|p| turn * p.extend(0.0) + far).collect();
            let (_, total, _) = areas(&corners);
            prop_assert!((total / area_of(&ring).abs() - 1.0).abs() < 1e-6, "{total}");
        }

        /// Cells of a grid that were grown from one cell: straight edges and corners at one place are
        /// everywhere. Each row is an interval that meets the one below.
        #[test]
        fn random_stairs_are_covered_once(
            rows in prop::collection::vec((0..4i32, 0..4i32), 1..9),
        ) {
            let (mut right, mut left) = (Vec::new(), Vec::new());
            for (y, (l, r)) in rows.into_iter().enumerate() {
                let (l, r) = (f64::from(-l - 1), f64::from(r + 1));
                right.extend([DVec2::new(r, y as f64), DVec2::new(r, y as f64 + 1.0)]);
                left.extend([DVec2::new(l, y as f64), DVec2::new(l, y as f64 + 1.0)]);
            }
            right.extend(left.into_iter().rev());
            covered_once(&right);
        }

        #[test]
        fn any_corners_end(points in prop::collection::vec((-3..3i32, -3..3i32, -1..1i32), 0..20)) {
            let at = |&(x, y, z): &(i32, i32, i32)| DVec3::new(x.into(), y.into(), z.into());
            let corners: Vec<DVec3> = points.iter().map(at).collect();
            prop_assert!(triangles(&corners).len() <= corners.len().saturating_sub(2));
        }
    }

    #[test]
    fn degenerate_polygons_end() {
        let line: Vec<DVec3> = (0..9).map(|i| DVec3::splat(i as f64)).collect();
        assert_eq!(areas(&line).2, 7);
        assert_eq!(areas(&[DVec3::NAN; 6]).2, 4);
        assert_eq!(areas(&[DVec3::INFINITY; 6]).2, 4);
        assert_eq!(areas(&[DVec3::ZERO; 2]).2, 0);
        let radius = |i: usize| if i.is_multiple_of(2) { 2.0 } else { 0.5 };
        let star: Vec<DVec3> =
            star(&(0..10).map(radius).collect::<Vec<_>>()).iter().map(|p| p.extend(0.0)).collect();
        let (mut out, mut steps) = (Vec::new(), 1);
        triangulate(&star, &mut steps, &mut out);
        assert_eq!((out.len(), steps), (8, 0), "without steps the rest is a fan");
    }

    #[test]
    fn the_steps_end_the_search_for_one_ear_too() {
        // Two zigzags into each other: any ear may be blocked by half of the corners.
        let count = 1000;
        let zigzag = |x: f64, i: usize| [(x, 3.0 * i as f64), (x + 1000.0, 3.0 * i as f64 + 1.5)];
        let down = (0..count).rev().flat_map(|i| zigzag(0.0, i).into_iter().rev());
        let up = (0..count).flat_map(|i| zigzag(900.0, i));
        let corners: Vec<DVec3> = down.chain(up).map(|(x, y)| DVec3::new(x, y, 0.0)).collect();
        let (mut out, mut steps) = (Vec::new(), 1000);
        triangulate(&corners, &mut steps, &mut out);
        assert_eq!((out.len(), steps), (corners.len() - 2, 0));
        let hub = out[0][0];
        assert!(out.iter().all(|t| t[0] == hub), "a fan from the first corner on");
    }

    #[test]
    fn large_polygons_are_cut_right_too() {
        // A jagged coast of 20,000 corners.
        let radius = |i: usize| 100.0 + (i * 7919 % 101) as f64 * 0.3;
        let coast = star(&(0..20_000).map(radius).collect::<Vec<_>>());
        let corners: Vec<DVec3> = coast.iter().map(|p| p.extend(0.0)).collect();
        let (mut out, mut steps) = (Vec::new(), STEPS);
        triangulate(&corners, &mut steps, &mut out);
        let total: f64 = out.iter().map(|t| area(&coast, *t).abs() * 0.5).sum();
        assert!((total / area_of(&coast) - 1.0).abs() < 1e-9, "{total}");
        println!("{} steps", STEPS - steps);
        assert!(steps > STEPS / 2, "{} steps", STEPS - steps);
    }
}
