//! The default scene: a teapot and three balls on a checkered floor under a morning sky.
//!
//! Nothing in it is special to the renderer: the sky is a painted dome, the floor fades into it by
//! vertex alpha, and the shadow is a texture that is computed when the scene is made.

use super::super::{
    build::Builder,
    camera::Camera,
    light::Light,
    material::{AlphaMode, Map, Material, TextureUse},
    mesh::Mesh,
    texture::{ColorSpace, with_mips},
};
use super::{add, checkerboard, plastic, shapes, teapot};
use crate::{
    image::Extent,
    texture::{Sampler, Texture, Wrap},
};
use glam::{Mat4, Vec2, Vec3};
use std::f32::consts::TAU;

/// Radius of the dome, of the floor, and of the part of the floor that does not fade.
const SKY: f32 = 60.0;
const FLOOR: f32 = 44.0;
const NEAR_FLOOR: f32 = 11.0;

/// Half the side of the square that the shadow is computed for, and its texels.
const SHADOW_HALF: f32 = 9.0;
const SHADOW_TEXELS: usize = 512;

pub(super) fn build(builder: &mut Builder, _seed: u64) -> Result<(), String> {
    let light = Light {
        key_direction: Vec3::new(-0.62, 0.60, 0.50).normalize(),
        key_color: Vec3::new(1.0, 0.87, 0.70) * 1.5,
        sky: Vec3::new(0.36, 0.50, 0.74),
        horizon: Vec3::new(0.82, 0.78, 0.74),
        ground: Vec3::new(0.24, 0.21, 0.18),
        background: Vec3::new(0.7, 0.72, 0.76),
    };
    builder.light = light;
    let (eye, target) = (Vec3::new(1.9, 3.35, 10.4), Vec3::new(0.28, 1.12, 0.0));
    let mut camera = Camera::look_at(eye, target, Vec3::Y, 0.5);
    camera.projection = super::super::Projection::Perspective { yfov: 0.5, near: 1.0, far: None };
    builder.cameras.push(camera);

    let mut glaze = plastic([0.012, 0.20, 0.215], 0.16);
    glaze.double_sided = true;
    let mut copper = plastic([0.93, 0.52, 0.36], 0.22);
    copper.metallic = 1.0;
    let ball = shapes::sphere(64, 32);
    let placed = |x: f32, z: f32, r: f32| {
        Mat4::from_translation(Vec3::new(x, r, z)) * Mat4::from_scale(Vec3::splat(r))
    };
    let things = [
        (teapot::teapot(20), glaze, Mat4::from_rotation_y(0.42)),
        (ball.clone(), copper, placed(-3.1, 1.7, 0.62)),
        (ball.clone(), plastic([0.83, 0.78, 0.68], 0.45), placed(2.9, 2.1, 0.42)),
        (ball, plastic([0.58, 0.055, 0.035], 0.3), placed(-1.75, 2.75, 0.34)),
    ];
    let shadow = Shadow::new(things.iter().map(|(mesh, _, at)| (mesh, *at)), light.key_direction);
    floor(builder)?;
    sky(builder, light.key_direction)?;
    shadow.add(builder)?;
    for (mesh, material, at) in &things {
        add(builder, mesh, material.clone(), *at)?;
    }
    Ok(())
}

/// A round floor: a disc, and a ring around it that fades out.
fn floor(builder: &mut Builder) -> Result<(), String> {
    let texture = builder.texture(|| Ok(checkerboard(8, 64, [[214, 202, 184], [112, 100, 92]])));
    let mut material = plastic([1.0; 3], 0.55);
    material.maps[Map::BaseColor as usize] = Some(TextureUse::new(texture));
    let ring = |inner: f32, outer: f32, steps: u32| {
        shapes::grid(steps, 96, |u, v| {
            let (s, c) = if v == 1.0 { (0.0, 1.0) } else { (v * TAU).sin_cos() };
            let p = Vec3::new(c, 0.0, -s) * (inner + (outer - inner) * u);
            // A square of the board is 0.9 wide; turned a little, so that no edge is level.
            let turned = Vec2::from_angle(0.3).rotate(Vec2::new(p.x, p.z));
            (p, Vec3::Y, turned / (8.0 * 0.9))
        })
    };
    add(builder, &ring(0.0, NEAR_FLOOR, 4), material.clone(), Mat4::IDENTITY)?;
    let mut fading = ring(NEAR_FLOOR, FLOOR, 24);
    shapes::paint(&mut fading, |p| {
        let t = ((p.length() - NEAR_FLOOR) / (FLOOR - NEAR_FLOOR)).clamp(0.0, 1.0);
        Vec3::ONE.extend((1.0 - t) * (1.0 - t) * (1.0 + 2.0 * t))
    });
    material.alpha = AlphaMode::Blend;
    add(builder, &fading, material, Mat4::IDENTITY)
}

/// A dome around everything, bright at the horizon and around the sun.
fn sky(builder: &mut Builder, sun: Vec3) -> Result<(), String> {
    let mut dome = shapes::sphere(96, 64);
    let toward = Vec3::new(sun.x, 0.1, -sun.z.abs()).normalize();
    shapes::paint(&mut dome, |d| {
        let zenith = Vec3::new(0.135, 0.30, 0.60);
        let middle = Vec3::new(0.40, 0.60, 0.82);
        let horizon = Vec3::new(0.86, 0.79, 0.70);
        let haze = Vec3::new(0.62, 0.57, 0.52);
        let up = d.y;
        let color = match up {
            ..0.0 => horizon.lerp(haze, (-up * 5.0).min(1.0)),
            _ => {
                let low = horizon.lerp(middle, 1.0 - (-up * 9.0).exp());
                low.lerp(zenith, (up * 1.25).min(1.0).powf(0.8))
            }
        };
        let glow = d.dot(toward).max(0.0);
        let glow = Vec3::new(1.0, 0.82, 0.58) * (glow.powi(6) * 0.30);
        (color + glow * (1.0 - color)).extend(1.0)
    });
    let material = Material { unlit: true, double_sided: true, ..Material::default() };
    add(builder, &dome, material, Mat4::from_scale(Vec3::splat(SKY)))
}

/// How much light each place of the floor lacks, as triangles that were projected on it.
struct Shadow {
    /// Along the key light, and straight down with the height above the floor.
    cast: Vec<[Vec2; 3]>,
    below: Vec<([Vec2; 3], f32)>,
}

impl Shadow {
    fn new<'a>(things: impl Iterator<Item = (&'a Mesh, Mat4)>, light: Vec3) -> Self {
        let mut shadow = Self { cast: Vec::new(), below: Vec::new() };
        for (mesh, at) in things {
            for corners in mesh.triangles() {
                let corners = corners.map(|i| at.transform_point3(mesh.positions[i as usize]));
                let cast = corners.map(|p| p - light * (p.y / light.y));
                shadow.cast.push(cast.map(texel));
                let height = corners.iter().map(|p| p.y).sum::<f32>() / 3.0;
                shadow.below.push((corners.map(texel), height));
            }
        }
        shadow
    }

    /// A sheet above the floor that darkens it.
    fn add(self, builder: &mut Builder) -> Result<(), String> {
        let texture = builder.texture(move || Ok(self.paint()));
        let clamp =
            Sampler { wrap_u: Wrap::ClampToEdge, wrap_v: Wrap::ClampToEdge, ..Sampler::default() };
        let used = TextureUse { sampler: clamp, ..TextureUse::new(texture) };
        let mut material = Material { unlit: true, alpha: AlphaMode::Blend, ..Material::default() };
        material.maps[Map::BaseColor as usize] = Some(used);
        let sheet = shapes::floor(SHADOW_HALF, 1, 1.0);
        add(builder, &sheet, material, Mat4::from_translation(Vec3::Y * 0.004))
    }

    fn paint(&self) -> Texture {
        let mut cast = vec![0.0; SHADOW_TEXELS * SHADOW_TEXELS];
        for triangle in &self.cast {
            fill(&mut cast, triangle, 1.0);
        }
        blur(&mut cast, 4);
        let mut below = vec![0.0; SHADOW_TEXELS * SHADOW_TEXELS];
        for (triangle, height) in &self.below {
            fill(&mut below, triangle, 1.0 / (1.0 + 1.6 * height));
        }
        blur(&mut below, 12);
        let texels = cast.iter().zip(&below).flat_map(|(cast, below)| {
            let light = (1.0 - 0.62 * cast) * (1.0 - 0.55 * below);
            // The colour of what is left in the shade is a little blue.
            [7, 9, 16, ((1.0 - light) * 255.0) as u8]
        });
        let extent = Extent::new(SHADOW_TEXELS as u32, SHADOW_TEXELS as u32);
        with_mips("shadow", extent, texels.collect(), ColorSpace::Srgb)
    }
}

/// Where a point above the floor lies in the shadow's texture.
fn texel(p: Vec3) -> Vec2 {
    (Vec2::new(p.x, p.z) / SHADOW_HALF * 0.5 + 0.5) * SHADOW_TEXELS as f32
}

/// Raises the texels inside a triangle of either winding to `value`.
fn fill(mask: &mut [f32], corners: &[Vec2; 3], value: f32) {
    let [a, b, c] = *corners;
    let area = (b - a).perp_dot(c - a);
    let (low, high) = (a.min(b).min(c), a.max(b).max(c));
    let clamped = |v: f32| v.clamp(0.0, SHADOW_TEXELS as f32) as usize;
    for y in clamped(low.y)..clamped(high.y + 1.0) {
        for x in clamped(low.x)..clamped(high.x + 1.0) {
            let p = Vec2::new(x as f32 + 0.5, y as f32 + 0.5);
            let inside = [(a, b), (b, c), (c, a)]
                .iter()
                .all(|(from, to)| (*to - *from).perp_dot(p - *from) * area >= 0.0);
            if inside {
                let texel = &mut mask[y * SHADOW_TEXELS + x];
                *texel = texel.max(value);
            }
        }
    }
}

/// Three box filters in both directions: nearly a Gaussian.
fn blur(mask: &mut [f32], radius: usize) {
    let n = SHADOW_TEXELS;
    let mut line = vec![0.0; n];
    for (along, across) in [(1, n), (n, 1)] {
        for start in (0..n).map(|i| i * across) {
            for _ in 0..3 {
                let width = 2 * radius + 1;
                let at = |i: usize| if i < n { mask[start + i * along] } else { 0.0 };
                let mut sum: f32 = (0..radius).map(at).sum();
                for (i, value) in line.iter_mut().enumerate() {
                    sum += at(i + radius);
                    if i > radius {
                        sum -= at(i - radius - 1);
                    }
                    *value = sum / width as f32;
                }
                for (i, value) in line.iter().enumerate() {
                    mask[start + i * along] = *value;
                }
            }
        }
    }
}
