//! Cameras: where the picture is taken from, to Vulkan's clip space.
//!
//! World space is glTF's: right-handed, y up; a camera looks along its -z. Clip space is Vulkan's:
//! y down, depth 0 at the near plane and 1 at the far plane. The flip of y is part of the
//! projection (viewports stay positive), so a triangle that is counter-clockwise to the eye is
//! counter-clockwise on the screen.
//!
//! Everything is in double precision, and every limit is a share of the scene's size: the same scene
//! at another scale, or far from the origin, gives the same picture.

use super::bounds::Bounds;
use crate::image::Extent;
use glam::{DMat4, DVec3, DVec4};

/// How view space becomes clip space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// With perspective.
    Perspective {
        /// Vertical angle of view in radians.
        yfov: f64,
        /// Distance of the near plane, > 0.
        near: f64,
        /// Distance of the far plane; `None` is at infinity.
        far: Option<f64>,
    },
    /// Parallel.
    Orthographic {
        /// Half the height of the view in world units.
        ymag: f64,
        /// Distance of the near plane.
        near: f64,
        /// Distance of the far plane.
        far: f64,
    },
}

impl std::fmt::Display for Projection {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Perspective { yfov, near, far } => {
                write!(f, "an angle of view of {yfov} rad, planes at {near} and ")?;
                match far {
                    Some(far) => write!(f, "{far}"),
                    None => write!(f, "infinity"),
                }
            }
            Self::Orthographic { ymag, near, far } => {
                write!(f, "a view of half height {ymag}, planes at {near} and {far}")
            }
        }
    }
}

/// A camera.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Its name in the file, or empty.
    pub name: String,
    /// World to view space: a rotation and a translation.
    pub view: DMat4,
    /// View to clip space.
    pub projection: Projection,
}

impl Camera {
    /// A perspective camera at `eye` that looks at `target`; `yfov` is in radians.
    ///
    /// The near plane is at a thousandth of the distance between the two and the far plane at
    /// infinity; [`Camera::fit_depth`] chooses them for a scene. An `up` along the view direction
    /// and a `target` at the `eye` are replaced by something that works.
    pub fn look_at(eye: DVec3, target: DVec3, up: DVec3, yfov: f64) -> Self {
        let forward = (target - eye).try_normalize().unwrap_or(DVec3::NEG_Z);
        let right =
            forward.cross(up).try_normalize().unwrap_or_else(|| forward.any_orthonormal_vector());
        let up = right.cross(forward);
        let world = DMat4::from_cols(
            right.extend(0.0),
            up.extend(0.0),
            (-forward).extend(0.0),
            eye.extend(1.0),
        );
        let distance = (target - eye).length();
        let near = if distance > 0.0 { distance * 1e-3 } else { 1e-3 };
        Self {
            name: String::new(),
            view: rigid_inverse(&world),
            projection: Projection::Perspective { yfov, near, far: None },
        }
    }

    /// A camera placed by a node: scale and shear of `world` are ignored, as glTF demands.
    pub fn from_world(name: String, world: &DMat4, projection: Projection) -> Self {
        let back = world.z_axis.truncate().try_normalize().unwrap_or(DVec3::Z);
        let up = world.y_axis.truncate();
        let right = up.cross(back).try_normalize().unwrap_or_else(|| back.any_orthonormal_vector());
        let rigid = DMat4::from_cols(
            right.extend(0.0),
            back.cross(right).extend(0.0),
            back.extend(0.0),
            world.w_axis.truncate().extend(1.0),
        );
        Self { name, view: rigid_inverse(&rigid), projection }
    }

    /// A camera that sees all of `bounds` from `direction` (from the middle towards the eye).
    pub fn framing(bounds: &Bounds, direction: DVec3, yfov: f64, extent: Extent) -> Self {
        let (center, radius) = match bounds.is_empty() {
            true => (DVec3::ZERO, 1.0),
            false => (bounds.center(), size(bounds)),
        };
        let direction = direction.try_normalize().unwrap_or(DVec3::Z);
        let turned = Self::look_at(direction, DVec3::ZERO, DVec3::Y, yfov);
        // The distance at which every corner is within the view, found per corner: a sphere around
        // the box would leave flat and long scenes small in the picture.
        let aspect = extent.width as f64 / extent.height as f64;
        let tan_y = (yfov * 0.5).tan();
        let tan_x = tan_y * aspect;
        let distance = bounds
            .corners()
            .into_iter()
            .filter(|_| !bounds.is_empty())
            .map(|corner| {
                let p = turned.view.transform_vector3(corner - center);
                p.z + (p.x.abs() / tan_x).max(p.y.abs() / tan_y)
            })
            .fold(radius, f64::max);
        let eye = center + direction * distance * 1.06;
        let mut camera = Self::look_at(eye, center, DVec3::Y, yfov);
        camera.fit_depth(bounds);
        camera
    }

    /// Places near and far plane around `bounds`, as tight as precision and an eye inside the
    /// bounds allow.
    pub fn fit_depth(&mut self, bounds: &Bounds) {
        if bounds.is_empty() {
            return;
        }
        let depths = bounds.corners().map(|c| -self.view.transform_point3(c).z);
        let nearest = depths.into_iter().fold(f64::INFINITY, f64::min);
        let farthest = depths.into_iter().fold(f64::NEG_INFINITY, f64::max);
        let size = size(bounds);
        match &mut self.projection {
            Projection::Perspective { near, far, .. } => {
                *near = (nearest * 0.99).max(size * 5e-3);
                *far = Some((farthest * 1.01).max(*near * 2.0));
            }
            Projection::Orthographic { near, far, .. } => {
                *near = nearest - size * 0.01;
                *far = farthest + size * 0.01;
            }
        }
    }

    /// Where the eye is.
    pub fn eye(&self) -> DVec3 {
        rigid_inverse(&self.view).w_axis.truncate()
    }

    /// The direction from the scene towards the viewer (the camera's +z in the world).
    pub fn backward(&self) -> DVec3 {
        self.view.row(2).truncate()
    }

    /// World space to clip space for a target of `extent`, whose aspect the picture takes.
    pub fn view_projection(&self, extent: Extent) -> DMat4 {
        self.projection.matrix(extent.width as f64 / extent.height as f64) * self.view
    }
}

impl Projection {
    /// View space to clip space; `aspect` is width / height.
    pub fn matrix(&self, aspect: f64) -> DMat4 {
        match *self {
            Projection::Perspective { yfov, near, far } => {
                let y = 1.0 / (yfov * 0.5).tan();
                // depth = (a * z + b) / -z is 0 at z = -near and 1 at z = -far.
                let (a, b) = match far {
                    Some(far) => (far / (near - far), near * far / (near - far)),
                    None => (-1.0, -near),
                };
                DMat4::from_cols(
                    DVec4::new(y / aspect, 0.0, 0.0, 0.0),
                    DVec4::new(0.0, -y, 0.0, 0.0),
                    DVec4::new(0.0, 0.0, a, -1.0),
                    DVec4::new(0.0, 0.0, b, 0.0),
                )
            }
            Projection::Orthographic { ymag, near, far } => {
                let depth = 1.0 / (near - far);
                DMat4::from_cols(
                    DVec4::new(1.0 / (ymag * aspect), 0.0, 0.0, 0.0),
                    DVec4::new(0.0, -1.0 / ymag, 0.0, 0.0),
                    DVec4::new(0.0, 0.0, depth, 0.0),
                    DVec4::new(0.0, 0.0, near * depth, 1.0),
                )
            }
        }
    }
}

/// The radius of `bounds`, or for a single point something that is not lost beside its distance from
/// the origin.
fn size(bounds: &Bounds) -> f64 {
    match bounds.radius() {
        0.0 => 1.0 + 1e-6 * bounds.center().length(),
        radius => radius,
    }
}

/// The inverse of a rotation and translation, exact where a general inverse would round.
fn rigid_inverse(m: &DMat4) -> DMat4 {
    let rotation = glam::DMat3::from_mat4(*m).transpose();
    let translation = -(rotation * m.w_axis.truncate());
    DMat4::from_cols(
        rotation.x_axis.extend(0.0),
        rotation.y_axis.extend(0.0),
        rotation.z_axis.extend(0.0),
        translation.extend(1.0),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const SQUARE: Extent = Extent::new(64, 64);

    fn project(camera: &Camera, extent: Extent, p: DVec3) -> DVec3 {
        camera.view_projection(extent).project_point3(p)
    }

    #[test]
    fn up_is_up_and_depth_runs_from_near_to_far() {
        let mut camera = Camera::look_at(DVec3::new(0.0, 0.0, 5.0), DVec3::ZERO, DVec3::Y, 1.0);
        camera.projection = Projection::Perspective { yfov: 1.0, near: 1.0, far: Some(9.0) };
        assert!(project(&camera, SQUARE, DVec3::Y).y < 0.0, "clip-space y points down");
        assert!(project(&camera, SQUARE, DVec3::X).x > 0.0);
        assert!(project(&camera, SQUARE, DVec3::new(0.0, 0.0, 4.0)).z.abs() < 1e-6);
        assert!((project(&camera, SQUARE, DVec3::new(0.0, 0.0, -4.0)).z - 1.0).abs() < 1e-6);
        camera.projection = Projection::Perspective { yfov: 1.0, near: 1.0, far: None };
        let z = project(&camera, SQUARE, DVec3::new(0.0, 0.0, -1e6)).z;
        assert!(z < 1.0 && z > 0.999);
        camera.projection = Projection::Orthographic { ymag: 2.0, near: 1.0, far: 9.0 };
        let p = project(&camera, Extent::new(128, 64), DVec3::new(4.0, 2.0, 4.0));
        assert!(p.abs_diff_eq(DVec3::new(1.0, -1.0, 0.0), 1e-6), "{p}");
    }

    #[test]
    fn framing_shows_everything_and_not_much_more() {
        for (max, extent) in [
            (DVec3::ONE, SQUARE),
            (DVec3::new(10.0, 0.1, 3.0), Extent::new(1920, 1080)),
            (DVec3::new(0.0, 9.0, 0.0), Extent::new(100, 700)),
        ] {
            let bounds = Bounds { min: -DVec3::ONE, max };
            let camera = Camera::framing(&bounds, DVec3::new(1.0, 0.6, 2.0), 0.7, extent);
            let mut reach = 0.0f64;
            for corner in bounds.corners() {
                let p = project(&camera, extent, corner);
                assert!((0.0..=1.0).contains(&p.z), "{p}");
                reach = reach.max(p.x.abs()).max(p.y.abs());
            }
            assert!((0.75..=1.0).contains(&reach), "{reach} for {extent}");
        }
    }

    #[test]
    fn a_node_places_a_camera_without_its_scale() {
        let rigid = DMat4::from_rotation_translation(
            glam::DQuat::from_rotation_y(0.4),
            DVec3::new(1.0, 2.0, 3.0),
        );
        let p = Projection::Perspective { yfov: 1.0, near: 0.1, far: None };
        let plain = Camera::from_world(String::new(), &rigid, p);
        let scaled = Camera::from_world(
            String::new(),
            &(rigid * DMat4::from_scale(DVec3::new(3.0, 0.5, 7.0))),
            p,
        );
        assert!(plain.view.abs_diff_eq(scaled.view, 1e-5));
        assert!(plain.view.abs_diff_eq(rigid.inverse(), 1e-5));
    }

    #[test]
    fn degenerate_requests_still_give_a_camera() {
        for (target, up) in [(DVec3::ONE, DVec3::Y), (DVec3::new(1.0, 0.0, 1.0), DVec3::Y)] {
            let camera = Camera::look_at(DVec3::ONE, target, up, 1.0);
            assert!(camera.view.is_finite() && (camera.view.determinant() - 1.0).abs() < 1e-5);
        }
        let camera = Camera::framing(&Bounds::EMPTY, DVec3::ZERO, 1.0, SQUARE);
        assert!(camera.view_projection(SQUARE).is_finite());
    }
}
