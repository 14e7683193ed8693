//! Axis-aligned boxes and the view frustum, for culling and framing. They are in double precision: a scene may
//! be as small as a molecule, or as far from the origin as a map.

use glam::{DMat4, DVec3, DVec4};

/// An axis-aligned box. The empty box has `min > max`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Smallest corner.
    pub min: DVec3,
    /// Largest corner.
    pub max: DVec3,
}

impl Bounds {
    /// The box of nothing: the neutral element of [`Bounds::union`].
    pub const EMPTY: Self =
        Self { min: DVec3::splat(f64::INFINITY), max: DVec3::splat(f64::NEG_INFINITY) };

    /// The box of `points`; those without a [place](Bounds::is_placed) are left out.
    pub fn of(points: impl IntoIterator<Item = DVec3>) -> Self {
        points.into_iter().fold(Self::EMPTY, |b, p| if placed(p) { b.with(p) } else { b })
    }

    /// Whether both corners have a place: finite, and so far from overflow that distances are too.
    pub fn is_placed(&self) -> bool {
        placed(self.min) && placed(self.max)
    }

    /// Whether it contains no point.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The smallest box with `point` in it.
    pub fn with(self, point: DVec3) -> Self {
        Self { min: self.min.min(point), max: self.max.max(point) }
    }

    /// The smallest box with both in it.
    pub fn union(self, other: Self) -> Self {
        Self { min: self.min.min(other.min), max: self.max.max(other.max) }
    }

    /// The middle.
    pub fn center(&self) -> DVec3 {
        (self.min + self.max) * 0.5
    }

    /// Half the diagonal: the radius of the sphere around the box. 0 if empty.
    pub fn radius(&self) -> f64 {
        if self.is_empty() { 0.0 } else { (self.max - self.min).length() * 0.5 }
    }

    /// The eight corners.
    pub fn corners(&self) -> [DVec3; 8] {
        std::array::from_fn(|i| {
            DVec3::new(
                if i & 1 == 0 { self.min.x } else { self.max.x },
                if i & 2 == 0 { self.min.y } else { self.max.y },
                if i & 4 == 0 { self.min.z } else { self.max.z },
            )
        })
    }

    /// The box of the box after `transform`, which is affine.
    ///
    /// Center and half extent are transformed (the extent by the absolute matrix), which equals the
    /// box of the eight transformed corners at a third of the work.
    pub fn transformed(&self, transform: &DMat4) -> Self {
        if self.is_empty() {
            return Self::EMPTY;
        }
        let center = transform.transform_point3(self.center());
        let half = (self.max - self.min) * 0.5;
        let half = transform.x_axis.truncate().abs() * half.x
            + transform.y_axis.truncate().abs() * half.y
            + transform.z_axis.truncate().abs() * half.z;
        Self { min: center - half, max: center + half }
    }
}

/// Squares of coordinates below this are finite.
fn placed(p: DVec3) -> bool {
    p.abs().cmplt(DVec3::splat(1e150)).all()
}

/// Where a box lies in relation to a [`Frustum`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Containment {
    /// Certainly not visible.
    Outside,
    /// Perhaps partly visible.
    Crossing,
    /// Visible as a whole.
    Inside,
}

/// The visible part of space, as planes whose positive side is inside.
#[derive(Clone, Debug)]
pub struct Frustum {
    planes: [DVec4; 6],
}

impl Frustum {
    /// The frustum of a matrix to Vulkan's clip space (`-w <= x, y <= w`, `0 <= z <= w`).
    ///
    /// Each plane is a sum of rows of the matrix (Gribb and Hartmann 2001). The far plane of an
    /// infinite projection comes out as a plane that everything is inside of.
    pub fn new(view_projection: &DMat4) -> Self {
        let [x, y, z, w] = [0, 1, 2, 3].map(|i| view_projection.row(i));
        Self { planes: [w + x, w - x, w + y, w - y, z, w - z] }
    }

    /// Classifies `bounds`, conservatively: `Outside` is certain, `Crossing` may be outside.
    pub fn contains(&self, bounds: &Bounds) -> Containment {
        if bounds.is_empty() {
            return Containment::Outside;
        }
        let center = bounds.center();
        let half = (bounds.max - bounds.min) * 0.5;
        let mut result = Containment::Inside;
        for plane in &self.planes {
            let normal = plane.truncate();
            let distance = normal.dot(center) + plane.w;
            let reach = normal.abs().dot(half);
            // Shaders place vertices in single precision, and the sums here round in double precision:
            // a box that touches a plane from outside is kept.
            let slack = 1e-5 * (reach + distance.abs())
                + 1e-12 * (normal.abs().dot(center.abs()) + plane.w.abs());
            if distance + reach < -slack {
                return Containment::Outside;
            }
            if distance - reach < slack {
                result = Containment::Crossing;
            }
        }
        result
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{image::Extent, scene::Camera};

    #[test]
    fn transformed_box_is_the_box_of_the_transformed_corners() {
        let b = Bounds { min: DVec3::new(-1.0, 2.0, 3.0), max: DVec3::new(4.0, 5.0, 9.0) };
        let m = DMat4::from_scale_rotation_translation(
            DVec3::new(2.0, -3.0, 0.5),
            glam::DQuat::from_euler(glam::EulerRot::XYZ, 0.3, 1.1, -2.0),
            DVec3::new(5.0, 6.0, 7.0),
        );
        let want = Bounds::of(b.corners().map(|c| m.transform_point3(c)));
        let got = b.transformed(&m);
        assert!(got.min.abs_diff_eq(want.min, 1e-4) && got.max.abs_diff_eq(want.max, 1e-4));
    }

    #[test]
    fn empty_stays_empty() {
        assert!(Bounds::EMPTY.is_empty());
        assert!(Bounds::EMPTY.transformed(&DMat4::from_scale(DVec3::splat(2.0))).is_empty());
        assert!(Bounds::of([DVec3::NAN, DVec3::INFINITY]).is_empty());
    }

    #[test]
    fn frustum_never_rejects_what_projects_into_the_view() {
        let camera = Camera::look_at(DVec3::new(1.0, 2.0, 6.0), DVec3::ZERO, DVec3::Y, 0.9);
        let matrix = camera.view_projection(Extent::new(160, 90));
        let frustum = Frustum::new(&matrix);
        let (mut inside, mut outside) = (0, 0);
        for i in 0..4000u32 {
            // A low-discrepancy walk through a cube around the view.
            let f = |k: f64| ((i as f64 * k).fract() - 0.5) * 16.0;
            let min = DVec3::new(f(0.754_877_7), f(0.569_840_3), f(0.362_437_04));
            let b = Bounds { min, max: min + DVec3::splat(0.7) };
            let visible = |p: DVec3| {
                let c = matrix * p.extend(1.0);
                c.w > 0.0 && c.x.abs() <= c.w && c.y.abs() <= c.w && c.z >= 0.0 && c.z <= c.w
            };
            let all = b.corners().into_iter().all(visible);
            let any = b.corners().into_iter().any(visible);
            match frustum.contains(&b) {
                Containment::Inside => {
                    assert!(all, "{b:?} is called inside");
                    inside += 1;
                }
                Containment::Outside => {
                    assert!(!any, "{b:?} is called outside");
                    outside += 1;
                }
                Containment::Crossing => {}
            }
        }
        assert!(inside > 20 && outside > 1000, "the walk must meet both: {inside}, {outside}");
    }
}
