//! The Utah teapot: Martin Newell's 32 bicubic Bézier patches of 1975, from their control points.
//!
//! 24 of the patches are quarters of six surfaces of revolution, so their control points are kept as radius,
//! length of the Bézier handle along the circle, and height. The teapot's handle and its spout are each two
//! patches and their mirror images. Everything is in Newell's space (z up) until the end.

use super::super::mesh::Mesh;
use glam::{Vec2, Vec3};

/// A bicubic patch: rows of control points.
type Patch = [[Vec3; 4]; 4];

/// Radius, handle, height; from the axis or the top outwards and down.
type Profile = [[f32; 3]; 4];

const KNOB: Profile = [[0.0, 0.0, 3.15], [0.8, 0.45, 3.15], [0.0, 0.0, 2.85], [0.2, 0.112, 2.7]];
const LID: Profile = [[0.2, 0.112, 2.7], [0.4, 0.224, 2.55], [1.3, 0.728, 2.55], [1.3, 0.728, 2.4]];
const RIM: Profile =
    [[1.4, 0.784, 2.4], [1.3375, 0.749, 2.53125], [1.4375, 0.805, 2.53125], [1.5, 0.84, 2.4]];
const SHOULDER: Profile =
    [[1.5, 0.84, 2.4], [1.75, 0.98, 1.875], [2.0, 1.12, 1.35], [2.0, 1.12, 0.9]];
const BELLY: Profile = [[2.0, 1.12, 0.9], [2.0, 1.12, 0.45], [1.5, 0.84, 0.225], [1.5, 0.84, 0.15]];
const BOTTOM: Profile =
    [[1.5, 0.84, 0.15], [1.5, 0.84, 0.075], [1.425, 0.798, 0.0], [0.0, 0.0, 0.0]];

/// Half a tube: per ring the four control points of one side, as x and z with the distance from
/// the plane of symmetry in the middle two.
struct HalfTube {
    /// Inner x and z, outer x and z, y of the middle points.
    rings: [[f32; 5]; 4],
}

const HANDLE: [HalfTube; 2] = [
    HalfTube {
        rings: [
            [-1.6, 2.025, -1.5, 2.25, 0.3],
            [-2.3, 2.025, -2.5, 2.25, 0.3],
            [-2.7, 2.025, -3.0, 2.25, 0.3],
            [-2.7, 1.8, -3.0, 1.8, 0.3],
        ],
    },
    HalfTube {
        rings: [
            [-2.7, 1.8, -3.0, 1.8, 0.3],
            [-2.7, 1.575, -3.0, 1.35, 0.3],
            [-2.5, 1.125, -2.65, 0.9375, 0.3],
            [-2.0, 0.9, -1.9, 0.6, 0.3],
        ],
    },
];

const SPOUT: [HalfTube; 2] = [
    HalfTube {
        rings: [
            [1.7, 1.425, 1.7, 0.6, 0.66],
            [2.6, 1.425, 3.1, 0.825, 0.66],
            [2.3, 2.1, 2.4, 2.025, 0.25],
            [2.7, 2.4, 3.3, 2.4, 0.25],
        ],
    },
    HalfTube {
        rings: [
            [2.7, 2.4, 3.3, 2.4, 0.25],
            [2.8, 2.475, 3.525, 2.49375, 0.25],
            [2.9, 2.475, 3.45, 2.5125, 0.15],
            [2.8, 2.4, 3.2, 2.4, 0.15],
        ],
    },
];

/// All 32 patches; the cross product of their two directions points outwards.
fn patches() -> Vec<Patch> {
    let mut patches = Vec::new();
    for profile in [KNOB, LID, RIM, SHOULDER, BELLY, BOTTOM] {
        for quarter in 0..4 {
            // Exact quarter turns, so that the seams meet bit for bit.
            let (c, s) = [(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)][quarter];
            patches.push(profile.map(|[r, h, z]| {
                [[r, 0.0], [r, h], [h, r], [0.0, r]]
                    .map(|[x, y]| Vec3::new(c * x - s * y, s * x + c * y, z))
            }));
        }
    }
    for (tubes, outwards) in [(HANDLE, true), (SPOUT, false)] {
        for HalfTube { rings } in tubes {
            for side in [1.0, -1.0] {
                let mut patch: Patch = rings.map(|[xi, zi, xo, zo, y]| {
                    [
                        Vec3::new(xi, 0.0, zi),
                        Vec3::new(xi, y * side, zi),
                        Vec3::new(xo, y * side, zo),
                        Vec3::new(xo, 0.0, zo),
                    ]
                });
                // The handle is walked from its inside and the spout from its top; mirror images
                // turn the other way round.
                if outwards == (side > 0.0) {
                    patch.iter_mut().for_each(|ring| ring.reverse());
                }
                patches.push(patch);
            }
        }
    }
    patches
}

/// The Bernstein polynomials of degree 3 and their derivatives at `t`.
fn bernstein(t: f32) -> ([f32; 4], [f32; 4]) {
    let s = 1.0 - t;
    (
        [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t],
        [-3.0 * s * s, 3.0 * s * s - 6.0 * s * t, 6.0 * s * t - 3.0 * t * t, 3.0 * t * t],
    )
}

/// Position, and the derivatives along rows and across them.
fn evaluate(patch: &Patch, u: f32, v: f32) -> [Vec3; 3] {
    let ((bu, du), (bv, dv)) = (bernstein(u), bernstein(v));
    let sum = |rows: &[f32; 4], columns: &[f32; 4]| -> Vec3 {
        let row = |r: usize| -> Vec3 { (0..4).map(|c| patch[r][c] * columns[c]).sum() };
        (0..4).map(|r| row(r) * rows[r]).sum()
    };
    [sum(&bv, &bu), sum(&bv, &du), sum(&dv, &bu)]
}

/// The outward normal; where a patch runs into a point, that of the place beside it.
fn normal(patch: &Patch, u: f32, v: f32) -> Vec3 {
    let at = |u: f32, v: f32| {
        let [_, along, across] = evaluate(patch, u, v);
        across.cross(along)
    };
    let here = at(u, v);
    if here.length_squared() > 1e-8 {
        return here.normalize();
    }
    let inwards = |t: f32| t + (0.5 - t) * 2e-3;
    at(inwards(u), inwards(v)).normalize_or(Vec3::Z)
}

/// The teapot, 4.9 wide between handle and spout and standing on y = 0, with `steps` x `steps`
/// quads per patch.
pub(super) fn teapot(steps: u32) -> Mesh {
    let mut mesh = Mesh::default();
    let mut indices = Vec::new();
    let upright = |p: Vec3| Vec3::new(p.x, p.z, -p.y);
    for patch in patches() {
        let first = mesh.positions.len() as u32;
        for j in 0..=steps {
            for i in 0..=steps {
                let (u, v) = (i as f32 / steps as f32, j as f32 / steps as f32);
                mesh.positions.push(upright(evaluate(&patch, u, v)[0]));
                mesh.normals.push(upright(normal(&patch, u, v)));
                mesh.uvs[0].push(Vec2::new(u, v));
            }
        }
        let row = steps + 1;
        for j in 0..steps {
            for i in 0..steps {
                let a = first + j * row + i;
                indices.extend([a, a + row, a + row + 1, a, a + row + 1, a + 1]);
            }
        }
    }
    mesh.indices = Some(indices);
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_has_newells_patches_and_size() {
        assert_eq!(patches().len(), 32);
        let bounds = teapot(8).bounds();
        assert!(bounds.min.y.abs() < 1e-5 && (bounds.max.y - 3.15).abs() < 1e-5);
        assert!(bounds.min.x < -2.8 && bounds.max.x > 3.3 && bounds.max.z <= 2.0);
    }

    #[test]
    fn winding_and_normals_agree_and_point_outwards() {
        let mesh = teapot(6);
        for n in &mesh.normals {
            assert!((n.length() - 1.0).abs() < 1e-4);
        }
        for [a, b, c] in mesh.triangles() {
            let p = |i: u32| mesh.positions[i as usize];
            let face = (p(b) - p(a)).cross(p(c) - p(a));
            if face.length() > 1e-4 {
                let mean =
                    mesh.normals[a as usize] + mesh.normals[b as usize] + mesh.normals[c as usize];
                assert!(face.dot(mean) > 0.0, "a triangle at {} faces inwards", p(a));
            }
        }
        // By the divergence theorem the enclosed volume is positive if faces look outwards.
        let volume: f32 = mesh
            .triangles()
            .iter()
            .map(|t| {
                let [a, b, c] = t.map(|i| mesh.positions[i as usize]);
                a.dot(b.cross(c)) / 6.0
            })
            .sum();
        assert!(volume > 20.0, "{volume}");
    }

    #[test]
    fn quarters_meet_exactly() {
        let patches = patches();
        for quarters in patches[..24].chunks(4) {
            for q in 0..4 {
                let seam = |patch: &Patch, column: usize| patch.map(|row| row[column]);
                assert_eq!(seam(&quarters[q], 3), seam(&quarters[(q + 1) % 4], 0));
            }
        }
    }
}
