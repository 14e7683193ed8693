//! Random triangles. Nobody would model such a mesh, but a rasterizer has to draw it right.

use super::super::mesh::Mesh;
use crate::random::Random;
use glam::{Vec3, Vec4};

/// `count` triangles in the cube from -1 to 1, from specks to a quarter of it, each vertex of its own
/// colour. One in sixteen shares an edge with the one before it.
pub(super) fn soup(seed: u64, count: u32) -> Mesh {
    let mut random = Random(seed);
    let mut mesh = Mesh::default();
    let mut last: [Vec3; 3] = [Vec3::ZERO; 3];
    for _ in 0..count {
        // Sizes are uniform in their logarithm: as many specks as large ones.
        let size = 0.004 * 125f32.powf(random.unit());
        let center = random.cube() * (1.0 - size);
        let mut corners = [0; 3].map(|_| center + random.cube() * size);
        if random.unit() < 1.0 / 16.0 {
            corners[0] = last[1];
            corners[1] = last[0];
        }
        last = corners;
        for corner in corners {
            mesh.positions.push(corner.clamp(-Vec3::ONE, Vec3::ONE));
            mesh.colors.push(Vec4::new(random.unit(), random.unit(), random.unit(), 1.0));
        }
    }
    mesh
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;

    #[test]
    fn a_seed_means_the_same_triangles_everywhere() {
        let mut random = Random(1);
        // SplitMix64's published sequence for this state, its top 24 bits.
        assert_eq!(random.unit(), (0x910a_2dec_8902_5cc1u64 >> 40) as f32 / 16_777_216.0);
        assert_eq!(soup(7, 100).positions, soup(7, 100).positions);
        assert_ne!(soup(7, 100).positions, soup(8, 100).positions);
        let b = soup(3, 5000).bounds();
        assert!(b.min.cmpge(-DVec3::ONE).all() && b.max.cmple(DVec3::ONE).all());
    }
}
