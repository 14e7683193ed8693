//! The light of a scene: one key light, and a sky and a ground that light everything else.

use glam::Vec3;

/// One key light and an ambient of three colours. All colours are linear.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Light {
    /// From the scene towards the key light.
    pub key_direction: Vec3,
    /// The light that a white surface facing the key light reflects of it.
    pub key_color: Vec3,
    /// Light from above.
    pub sky: Vec3,
    /// Light from the horizon; seen in reflections.
    pub horizon: Vec3,
    /// Light from below.
    pub ground: Vec3,
    /// Where nothing is drawn.
    pub background: Vec3,
}

impl Default for Light {
    /// Daylight: a warm key light from the upper front right, a bluish sky, a brownish ground.
    fn default() -> Self {
        Self {
            key_direction: Vec3::new(0.45, 0.75, 0.5).normalize(),
            key_color: Vec3::new(1.0, 0.96, 0.89),
            sky: Vec3::new(0.42, 0.48, 0.57),
            horizon: Vec3::new(0.74, 0.74, 0.74),
            ground: Vec3::new(0.22, 0.20, 0.18),
            background: Vec3::new(0.115, 0.125, 0.145),
        }
    }
}
