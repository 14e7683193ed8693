//! Simple meshes.

use super::super::mesh::Mesh;
use glam::{Vec2, Vec3, Vec4};
use std::f32::consts::{PI, TAU};

/// A grid of `columns` x `rows` quads; `at` gives position, normal and texture coordinates for
/// parameters in 0..=1, and its derivatives make a right-handed frame with the normal.
pub(super) fn grid(
    columns: u32,
    rows: u32,
    mut at: impl FnMut(f32, f32) -> (Vec3, Vec3, Vec2),
) -> Mesh {
    let mut mesh = Mesh::default();
    for j in 0..=rows {
        for i in 0..=columns {
            let (p, n, uv) = at(i as f32 / columns as f32, j as f32 / rows as f32);
            mesh.positions.push(p);
            mesh.normals.push(n);
            mesh.uvs[0].push(uv);
        }
    }
    let row = columns + 1;
    let quad = |k: u32| {
        let a = k / columns * row + k % columns;
        [a, a + 1, a + row + 1, a, a + row + 1, a + row]
    };
    mesh.indices = Some((0..columns * rows).flat_map(quad).collect());
    mesh
}

/// A horizontal square of side 2 `half` at y = 0, facing up, its texture repeated `repeat` times.
pub(super) fn floor(half: f32, quads: u32, repeat: f32) -> Mesh {
    grid(quads, quads, |u, v| {
        let p = Vec3::new((u * 2.0 - 1.0) * half, 0.0, (1.0 - v * 2.0) * half);
        (p, Vec3::Y, Vec2::new(u, 1.0 - v) * repeat)
    })
}

/// A sphere of radius 1.
pub(super) fn sphere(columns: u32, rows: u32) -> Mesh {
    grid(columns, rows, |u, v| {
        let ((s, c), (sin, cos)) = ((u * TAU).sin_cos(), (v * PI).sin_cos());
        // The last column and the poles are exact copies, so that nothing gapes.
        let (s, c) = if u == 1.0 { (0.0, 1.0) } else { (s, c) };
        let sin = if v == 0.0 || v == 1.0 { 0.0 } else { sin };
        let p = Vec3::new(c * sin, -cos, -s * sin);
        (p, p, Vec2::new(u, 1.0 - v))
    })
}

/// A cube of side 2 with a face's own normals and texture coordinates.
pub(super) fn cube() -> Mesh {
    let mut mesh = Mesh::default();
    let mut indices = Vec::new();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let first = mesh.positions.len() as u32;
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                let place = |n: f32, a: f32, b: f32| {
                    let mut p = [n, a, b];
                    p.rotate_right(axis);
                    Vec3::from_array(p)
                };
                mesh.positions.push(place(sign, (u * 2.0 - 1.0) * sign, v * 2.0 - 1.0));
                mesh.normals.push(place(sign, 0.0, 0.0));
                mesh.uvs[0].push(Vec2::new(u, 1.0 - v));
            }
            indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        }
    }
    mesh.indices = Some(indices);
    mesh
}

/// A tube of radius `thickness` along the (p, q) torus knot.
pub(super) fn torus_knot(p: f32, q: f32, thickness: f32, along: u32, around: u32) -> Mesh {
    let curve = |t: f32| {
        let (a, b) = (t * TAU * p, t * TAU * q);
        let r = 2.0 + b.cos();
        Vec3::new(r * a.cos(), b.sin(), r * a.sin()) * 0.5
    };
    grid(around, along, |u, v| {
        let v = if v == 1.0 { 0.0 } else { v };
        let here = curve(v);
        let tangent = (curve(v + 1e-3) - curve(v - 1e-3)).normalize();
        // Away from the torus's own center line: a frame that never flips.
        let a = v * TAU * p;
        let inner = Vec3::new(a.cos(), 0.0, a.sin());
        let side = (here - inner).cross(tangent).normalize();
        let out = tangent.cross(side);
        let (s, c) = if u == 1.0 { (0.0, 1.0) } else { (u * TAU).sin_cos() };
        let n = out * c - side * s;
        (here + n * thickness, n, Vec2::new(v * 24.0, u * 2.0))
    })
}

/// Colours every vertex.
pub(super) fn paint(mesh: &mut Mesh, color: impl Fn(Vec3) -> Vec4) {
    mesh.colors = mesh.positions.iter().map(|&p| color(p)).collect();
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn all_shapes_face_outwards() {
        let shapes = [
            ("floor", floor(2.0, 3, 1.0)),
            ("sphere", sphere(16, 9)),
            ("cube", cube()),
            ("knot", torus_knot(2.0, 3.0, 0.2, 200, 12)),
        ];
        for (name, mesh) in shapes {
            for [a, b, c] in mesh.triangles() {
                let [p, q, r] = [a, b, c].map(|i| mesh.positions[i as usize]);
                let face = (q - p).cross(r - p);
                let n = mesh.normals[a as usize] + mesh.normals[b as usize];
                assert!(face.length() < 1e-6 || face.dot(n) > 0.0, "{name} at {p}");
            }
        }
    }
}
