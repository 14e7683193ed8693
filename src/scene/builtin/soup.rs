//! Random triangles: what no one would model, and what a rasterizer must still draw right.

use super::super::mesh::Mesh;
use glam::{Vec3, Vec4};

/// Numbers that look random and are the same everywhere (SplitMix64).
pub(super) struct Random(pub u64);

impl Random {
    /// Uniform in 0..1.
    pub fn unit(&mut self) -> f32 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 40) as f32 / (1u64 << 24) as f32
    }

    /// Uniform in the cube from -1 to 1.
    pub fn cube(&mut self) -> Vec3 {
        Vec3::new(self.unit(), self.unit(), self.unit()) * 2.0 - 1.0
    }
}

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

    #[test]
    fn a_seed_means_the_same_triangles_everywhere() {
        let mut random = Random(1);
        // SplitMix64's published sequence for this state, its top 24 bits.
        assert_eq!(random.unit(), (0x910a_2dec_8902_5cc1u64 >> 40) as f32 / 16_777_216.0);
        assert_eq!(soup(7, 100).positions, soup(7, 100).positions);
        assert_ne!(soup(7, 100).positions, soup(8, 100).positions);
        let b = soup(3, 5000).bounds();
        assert!(b.min.cmpge(-Vec3::ONE).all() && b.max.cmple(Vec3::ONE).all());
    }
}
