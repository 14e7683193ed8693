//! From the polygons, polylines and points of a file to meshes in single precision.

use super::{
    super::{
        anchor::Anchor,
        bounds::Bounds,
        hash::BitMap,
        mesh::{Mesh, Normals},
    },
    parse::{Corner, Group, NONE, Obj, Smoothing},
    polygon,
};
use crate::state::PrimitiveKind;
use glam::{DVec3, Vec2};

/// Faces within this angle (its cosine, 50 degrees) are smoothed where a file leaves it open.
const CREASE: f32 = 0.64;

/// A file keeps the origin of its coordinates as long as half of its groups lie within this many times
/// the size of what that half fills: single precision then moves a corner by at most 1/250,000 of it.
const NEAR: f64 = 64.0;

/// A mesh shares the file's origin as long as its coordinates are not larger than this many times its
/// size. Meshes that touch should share it: rounded alike, they meet exactly.
const SHARED: f64 = 4096.0;

/// The anchor of each group.
///
/// [`Anchor::of`] would give every group the one that suits it best. But surfaces continue from group to
/// group, and their edges meet exactly only if both are rounded alike: groups share an anchor as long as
/// that suits them.
pub(super) fn anchors(obj: &Obj) -> Vec<Anchor> {
    let bounds =
        |group: &Group| Bounds::of(group.corners.iter().map(|c| obj.positions[c[0] as usize]));
    let all: Vec<Bounds> = obj.groups.iter().map(bounds).collect();
    let unit = Anchor::of(&all.iter().fold(Bounds::EMPTY, |whole, one| whole.union(*one))).unit;
    let origin = origin(&all);
    let anchor = |bounds: &Bounds| {
        let is_far = !bounds.is_empty() && reach(bounds, origin) > SHARED * bounds.radius();
        Anchor { origin: if is_far { bounds.center() } else { origin }, unit }
    };
    all.iter().map(anchor).collect()
}

/// How far `bounds` reach from `origin`.
fn reach(bounds: &Bounds, origin: DVec3) -> f64 {
    (bounds.min - origin).abs().max((bounds.max - origin).abs()).max_element()
}

/// The origin for a whole file: that of its coordinates, or where most of it is. Medians find that, since
/// a group that was left at the origin, far from all others, does not move them.
fn origin(all: &[Bounds]) -> DVec3 {
    let placed = || all.iter().filter(|bounds| !bounds.is_empty());
    let along = |axis: usize| median(placed().map(|bounds| bounds.center()[axis]));
    let middle = DVec3::new(along(0), along(1), along(2));
    let size = median(placed().map(|bounds| reach(bounds, middle)));
    match middle.abs().max_element() > NEAR * size {
        true => middle,
        false => DVec3::ZERO,
    }
}

/// The value that as many are below as above; 0 of none.
fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    let half = values.len() / 2;
    match values.is_empty() {
        true => 0.0,
        false => *values.select_nth_unstable_by(half, f64::total_cmp).1,
    }
}

/// A group around `anchor`. Triangles have normals; lines and points have them if the file has one for each vertex.
pub(super) fn mesh(obj: &Obj, group: &Group, anchor: Anchor, steps: &mut u64) -> Mesh {
    let has_uvs = group.corners.iter().any(|c| c[1] != NONE);
    let has_normals = group.corners.iter().any(|c| c[2] != NONE);
    let mut mesh = Mesh { topology: group.topology, anchor, ..Mesh::default() };
    let mut numbers: BitMap<Corner, u32> =
        BitMap::with_capacity_and_hasher(group.corners.len() / 2, Default::default());
    let mut indices = Vec::with_capacity(group.corners.len());
    let mut add = |corner: Corner, mesh: &mut Mesh| {
        *numbers.entry(corner).or_insert_with(|| {
            mesh.positions.push(anchor.store(obj.positions[corner[0] as usize]));
            if has_uvs {
                // A corner without texture coordinates beside others that have some.
                mesh.uvs[0].push(obj.uvs.get(corner[1] as usize).copied().unwrap_or(Vec2::ZERO));
            }
            if has_normals {
                mesh.normals.push(obj.normals.get(corner[2] as usize).copied().unwrap_or_default());
            }
            if let Some(color) = obj.colors.get(corner[0] as usize) {
                mesh.colors.push(color.extend(1.0));
            }
            mesh.positions.len() as u32 - 1
        })
    };
    let kind = group.topology.kind();
    let (mut at, mut points, mut triangles) = (0, Vec::new(), Vec::new());
    for &arity in &group.arities {
        let corners = &group.corners[at..at + arity as usize];
        at += arity as usize;
        match kind {
            PrimitiveKind::Point => indices.extend(corners.iter().map(|&c| add(c, &mut mesh))),
            PrimitiveKind::Line => {
                indices.extend(corners.windows(2).flatten().map(|&c| add(c, &mut mesh)));
            }
            PrimitiveKind::Triangle => {
                points.clear();
                points.extend(corners.iter().map(|c| obj.positions[c[0] as usize]));
                triangles.clear();
                polygon::triangulate(&points, steps, &mut triangles);
                let cut = triangles.as_flattened();
                indices.extend(cut.iter().map(|&corner| add(corners[corner], &mut mesh)));
            }
        }
    }
    mesh.indices = Some(indices);
    if kind != PrimitiveKind::Triangle {
        if !mesh.has_usable_normals() {
            mesh.normals.clear();
        }
        return mesh;
    }
    let how = match group.smoothing {
        Smoothing::Off => Normals::Flat,
        Smoothing::Unsaid => Normals::Smooth { crease: CREASE },
        Smoothing::Group(_) => Normals::SMOOTH,
    };
    mesh.complete_normals(how, false);
    mesh
}

#[cfg(test)]
mod tests {
    use super::super::parse::parse;
    use super::*;
    use glam::Vec3;

    /// A cube of this edge, its least corner at `corner`, as an object of its own; `from` vertices come
    /// before it.
    fn cube(edge: f64, corner: DVec3, from: usize) -> String {
        let vertex = |i: usize| {
            let at = DVec3::new((i >> 2 & 1) as f64, (i >> 1 & 1) as f64, (i & 1) as f64);
            let p = corner + at * edge;
            format!("v {:e} {:e} {:e}\n", p.x, p.y, p.z)
        };
        let faces =
            [[1, 2, 4, 3], [5, 7, 8, 6], [1, 5, 6, 2], [3, 4, 8, 7], [1, 3, 7, 5], [2, 6, 8, 4]];
        let face = |f: [usize; 4]| {
            let [a, b, c, d] = f.map(|i| i + from);
            format!("f {a} {b} {c} {d}\n")
        };
        let vertices: String = (0..8).map(vertex).collect();
        format!("o\n{vertices}{}", faces.map(face).concat())
    }

    fn made(text: &str) -> Vec<Mesh> {
        let obj = parse(text.as_bytes()).unwrap();
        let mut steps = polygon::STEPS;
        let anchors = anchors(&obj).into_iter();
        let made =
            obj.groups.iter().zip(anchors).map(|(g, anchor)| mesh(&obj, g, anchor, &mut steps));
        made.collect()
    }

    /// Largest distance of a vertex from where the file has it, as a share of the edge.
    fn error(mesh: &Mesh, edge: f64, corner: DVec3) -> f64 {
        let off = |p: &Vec3| {
            let at = (mesh.anchor.place(*p) - corner) / edge;
            (at - at.round()).abs().max_element()
        };
        mesh.positions.iter().map(off).fold(0.0, f64::max)
    }

    #[test]
    fn corners_stay_in_place_wherever_and_however_large() {
        for (edge, corner) in [
            (1.0, DVec3::ZERO),
            (1.0, DVec3::new(0.3, -7.0, 12.0)),
            (0.1, DVec3::new(500_000.0, 4_649_776.0, 100.0)),
            (1.0, DVec3::new(-2487002.881739342, -4684683.676570751, 3529638.9835389843)),
            (10.0, DVec3::splat(1e7)),
            (1e-20, DVec3::ZERO),
            (1e-20, DVec3::splat(3e-18)),
            (1e30, DVec3::ZERO),
            (1e60, DVec3::splat(1e62)),
            (1e-70, DVec3::ZERO),
        ] {
            let made = made(&cube(edge, corner, 0));
            let error = error(&made[0], edge, corner);
            assert!(error < 1e-5, "edge {edge} at {corner}: {error}");
            for normal in &made[0].normals {
                assert!((normal.abs().max_element() - 1.0).abs() < 1e-6, "edge {edge}: {normal}");
            }
        }
    }

    #[test]
    fn a_file_near_the_origin_keeps_its_coordinates() {
        for text in [cube(1.0, DVec3::ZERO, 0), cube(3e-4, DVec3::splat(0.005), 0)] {
            assert_eq!(made(&text)[0].anchor, Anchor::default());
        }
    }

    #[test]
    fn neighbours_share_their_origin_and_what_is_far_has_its_own() {
        let far = DVec3::new(500_000.0, 4_649_776.0, 100.0);
        let text = [
            cube(1.0, far, 0),
            cube(1.0, far + DVec3::X, 8),
            cube(0.2, far + DVec3::Y, 16),
            // Left over at the origin, as exporters do.
            cube(1.0, DVec3::ZERO, 24),
        ]
        .concat();
        let made = made(&text);
        assert!(made[..3].iter().all(|mesh| mesh.anchor == made[0].anchor));
        assert_ne!(made[3].anchor, made[0].anchor);
        assert!(error(&made[2], 0.2, far + DVec3::Y) < 1e-5);
        assert!(error(&made[3], 1.0, DVec3::ZERO) < 1e-5);
    }

    #[test]
    fn normals_that_are_missing_or_zero_are_made_and_others_kept() {
        let square = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvn 0 0 0\nvn 0.6 0 0.8\nvn nan 0 1\n";
        for (face, kept) in [
            ("f 1//1 2//1 3//1 4//1", 0),
            ("f 1//3 2//3 3//3 4//3", 0),
            ("f 1//2 2//1 3//3 4//2", 2),
            ("f 1//2 2 3 4//9", 1),
            ("f 1//2 2//2 3//2 4//2", 4),
        ] {
            let mesh = &made(&format!("{square}{face}"))[0];
            let count = |n: Vec3| mesh.normals.iter().filter(|m| m.abs_diff_eq(n, 1e-6)).count();
            let found = (count(Vec3::new(0.6, 0.0, 0.8)), count(Vec3::Z));
            assert_eq!(found, (kept, 4 - kept), "{face}: {:?}", mesh.normals);
        }
    }

    /// A bent strip along x, in two halves.
    fn leaf(first: usize, front: bool) -> String {
        let vertices = "v -1 -1 0\nv 0 -1 0.3\nv 0 1 0.3\nv -1 1 0\nv 1 -1 0\nv 1 1 0\n";
        let faces = match front {
            true => [[1, 2, 3, 4], [2, 5, 6, 3]],
            false => [[4, 3, 2, 1], [3, 6, 5, 2]],
        };
        let line = |f: [usize; 4]| format!("f {}\n", f.map(|i| (i + first).to_string()).join(" "));
        vertices.to_owned() + &faces.map(line).concat()
    }

    #[test]
    fn each_layer_of_a_leaf_is_smooth() {
        let single = [true, false].map(|front| made(&format!("s 1\n{}", leaf(0, front))).remove(0));
        // With vertices of its own for each layer, and with shared ones.
        let shared = leaf(0, false).split_inclusive('\n').skip(6).collect::<String>();
        for text in [leaf(0, true) + &leaf(6, false), leaf(0, true) + &shared] {
            let mesh = &made(&format!("s 1\n{text}"))[0];
            for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
                let layer = &single[usize::from(n.z < 0.0)];
                let want = layer.normals[layer.positions.iter().position(|q| q == p).unwrap()];
                assert!(n.abs_diff_eq(want, 1e-6), "{p}: {n}, not {want}");
            }
            assert_eq!(mesh.positions.len(), 12);
        }
    }

    #[test]
    fn a_cube_that_is_to_be_smooth_is_round_however_it_lies() {
        let text = format!("s 1\n{}", cube(2.0, DVec3::splat(-1.0), 0));
        for angle in [0.0, 0.1, 0.7, 2.0] {
            let mut obj = parse(text.as_bytes()).unwrap();
            let turn = glam::DQuat::from_euler(glam::EulerRot::XYZ, angle, angle * 1.7, -angle);
            obj.positions.iter_mut().for_each(|p| *p = turn * *p);
            let anchor = anchors(&obj)[0];
            let mesh = mesh(&obj, &obj.groups[0], anchor, &mut polygon::STEPS.clone());
            for (p, n) in mesh.positions.iter().zip(&mesh.normals) {
                assert!(n.dot(p.normalize()) > 0.9, "{p} {n}");
            }
        }
    }

    #[test]
    fn a_hub_of_many_faces_is_smooth_all_around() {
        let count = 500;
        let rim = |i: usize| {
            let (sin, cos) = (i as f64 / count as f64 * std::f64::consts::TAU).sin_cos();
            format!("v {cos} {sin} 0\n")
        };
        let face = |i: usize| format!("f 1 {} {}\n", i + 2, (i + 1) % count + 2);
        let text = "s 1\nv 0 0 0.2\n".to_owned()
            + &(0..count).map(rim).collect::<String>()
            + &(0..count).map(face).collect::<String>();
        let mesh = &made(&text)[0];
        for (p, n) in mesh.positions.iter().zip(&mesh.normals).filter(|(p, _)| p.z > 0.1) {
            assert!(n.z > 0.999, "{p} {n}");
        }
    }
}
