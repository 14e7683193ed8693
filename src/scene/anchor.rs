//! Where single-precision positions lie in a space of double precision.
//!
//! Shaders read positions as single floats: 24 bits, which a mesh far from its origin or of a size
//! near the ends of the range would waste. Such a mesh is stored around an [`Anchor`] of its own. The
//! matrices that bring it to the screen are made in double precision and only then rounded, so the
//! distance costs nothing.

use super::bounds::Bounds;
use glam::{DMat4, DVec3, Vec3};

/// A position `p` that is stored stands for `origin + unit * p`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Anchor {
    pub origin: DVec3,
    /// A power of two, so that it rounds nothing.
    pub unit: f64,
}

impl Default for Anchor {
    fn default() -> Self {
        Self { origin: DVec3::ZERO, unit: 1.0 }
    }
}

/// A mesh may be this many of its radii away from the origin: it loses 6 of its 24 bits there.
const FAR: f64 = 64.0;

/// Radii between these need no unit: squares of squares of lengths a thousandth of them, which
/// normals are made of, are neither infinite nor lost.
const RADII: std::ops::RangeInclusive<f64> = 1.0 / 65536.0..=16_777_216.0;

impl Anchor {
    /// The anchor of a mesh within `bounds`; the default one if single precision needs none.
    ///
    /// The origin is a multiple of a power of two above the radius: positions that are single floats
    /// become differences that are, and neighbours mostly share an origin and so their roundings.
    pub fn of(bounds: &Bounds) -> Self {
        let (center, radius) = (bounds.center(), bounds.radius());
        if bounds.is_empty() || !bounds.is_placed() {
            return Self::default();
        }
        let reach = center.abs().max_element();
        let mut anchor = Self::default();
        if reach > FAR * radius {
            // A single point takes any power of two that does not swallow its digits.
            let step = power_of_two(if radius > 0.0 { radius } else { reach }) * 2.0;
            anchor.origin = (center / step).round() * step;
        }
        let size = if radius > 0.0 { radius } else { reach };
        if size > 0.0 && !RADII.contains(&size) {
            anchor.unit = power_of_two(size);
        }
        anchor
    }

    /// The stored position that stands for `position`.
    pub fn store(&self, position: DVec3) -> Vec3 {
        ((position - self.origin) / self.unit).as_vec3()
    }

    /// The position that `stored` stands for.
    pub fn place(&self, stored: Vec3) -> DVec3 {
        self.origin + stored.as_dvec3() * self.unit
    }

    /// The matrix from stored positions to the space.
    pub fn matrix(&self) -> DMat4 {
        DMat4::from_translation(self.origin) * DMat4::from_scale(DVec3::splat(self.unit))
    }
}

/// The largest power of two that is not above `value`, which is positive and finite.
pub(super) fn power_of_two(value: f64) -> f64 {
    // The exponent alone; numbers below the normal ones count as the smallest of them.
    f64::from_bits(value.max(f64::MIN_POSITIVE).to_bits() & 0x7ff0_0000_0000_0000)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cube(corner: f64, edge: f64) -> Bounds {
        Bounds { min: DVec3::splat(corner), max: DVec3::splat(corner + edge) }
    }

    #[test]
    fn ordinary_meshes_need_no_anchor() {
        for bounds in [cube(-1.0, 2.0), cube(30.0, 1.0), cube(0.0, 1e4), cube(0.0, 1e-3)] {
            assert_eq!(Anchor::of(&bounds), Anchor::default(), "{bounds:?}");
        }
        assert_eq!(Anchor::of(&Bounds::EMPTY), Anchor::default());
    }

    #[test]
    fn positions_far_away_and_of_any_scale_come_back() {
        for (corner, edge) in
            [(1e7, 10.0), (4649776.3, 0.1), (0.0, 1e-20), (0.0, 1e30), (1e30, 1e20), (1e12, 1e-3)]
        {
            let bounds = cube(corner, edge);
            let anchor = Anchor::of(&bounds);
            for i in 0..=7 {
                let p = DVec3::splat(corner + edge * f64::from(i) / 7.0);
                let stored = anchor.store(p);
                assert!(stored.abs().max_element() < 1e8, "{stored} of {bounds:?}");
                let (back, wrong) = (anchor.place(stored), 1e-6 * edge + 1e-15 * corner);
                assert!(back.abs_diff_eq(p, wrong), "{back} of {p}");
                assert!(anchor.matrix().transform_point3(stored.as_dvec3()).abs_diff_eq(p, wrong));
            }
        }
    }

    #[test]
    fn single_floats_stay_exact() {
        let bounds = cube(1e7, 40.0);
        let anchor = Anchor::of(&bounds);
        for i in 0..=40 {
            let p = DVec3::splat(f64::from(1e7f32 + i as f32));
            assert_eq!(anchor.place(anchor.store(p)), p);
        }
    }

    #[test]
    fn powers_of_two() {
        for (value, power) in [(1.0, 1.0), (1.9, 1.0), (0.3, 0.25), (1e30, 2f64.powi(99))] {
            assert_eq!(power_of_two(value), power);
        }
    }
}
