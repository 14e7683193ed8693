//! The default scene: a teapot and three balls on a checkered floor under a morning sky.
//!
//! Nothing in it is special to the renderer, and nothing in it blends: the sky is a painted dome; the
//! floor turns into haze because its own colour fades by vertex colours while a map of the haze
//! shines; the shadow is computed when the scene is made and is in the vertex colours too.

use super::super::{
    build::Builder,
    camera::{Camera, Projection},
    light::Light,
    material::{Map, Material, TextureUse},
    mesh::Mesh,
    texture::{ColorSpace, with_mips},
};
use super::{add, checkerboard, plastic, shapes, teapot};
use crate::{
    image::{Extent, linear_to_srgb},
    texture::{Sampler, Texture, Wrap},
};
use glam::{DVec3, Mat4, Vec2, Vec3};

/// Radius of the dome.
const SKY: f32 = 60.0;
/// Half the side of the floor, where it starts to turn into haze, and its quads along a side.
const FLOOR: f32 = 44.0;
const CLEAR: f32 = 9.0;
const FLOOR_QUADS: u32 = 180;
/// The colour of the horizon; below the shoulder of the tone curve, so that lit and unlit surfaces agree.
const HAZE: Vec3 = Vec3::new(0.73, 0.66, 0.58);

/// Half the side of the square that the shadow is computed for, and its texels.
const SHADOW_HALF: f32 = 9.0;
const SHADOW_TEXELS: usize = 512;

pub(super) fn build(builder: &mut Builder, _seed: u64) -> Result<(), String> {
    let light = Light {
        key_direction: Vec3::new(-0.62, 0.60, 0.50).normalize(),
        key_color: Vec3::new(1.0, 0.86, 0.68) * 1.7,
        sky: Vec3::new(0.30, 0.38, 0.52),
        horizon: Vec3::new(0.86, 0.79, 0.70),
        ground: Vec3::new(0.20, 0.165, 0.135),
        background: Vec3::new(0.7, 0.72, 0.76),
    };
    builder.light = light;
    let (eye, target) = (DVec3::new(1.7, 4.4, 12.6), DVec3::new(0.22, 1.22, 0.0));
    let mut camera = Camera::look_at(eye, target, DVec3::Y, 0.5);
    camera.projection = Projection::Perspective { yfov: 0.5, near: 1.0, far: None };
    builder.cameras.push(camera);

    let mut glaze = plastic([0.008, 0.155, 0.175], 0.14);
    glaze.double_sided = true;
    let mut gold = plastic([1.0, 0.66, 0.24], 0.2);
    gold.metallic = 1.0;
    let ball = shapes::sphere(64, 32);
    let placed = |x: f32, z: f32, r: f32| {
        Mat4::from_translation(Vec3::new(x, r, z)) * Mat4::from_scale(Vec3::splat(r))
    };
    let things = [
        (teapot::teapot(20), glaze, Mat4::from_rotation_y(0.42)),
        (ball.clone(), gold, placed(-3.1, 1.7, 0.62)),
        (ball.clone(), plastic([0.83, 0.78, 0.68], 0.45), placed(2.9, 2.1, 0.42)),
        (ball, plastic([0.58, 0.055, 0.035], 0.3), placed(-1.75, 2.75, 0.34)),
    ];
    let shadow = Shadow::new(things.iter().map(|(mesh, _, at)| (mesh, *at)), light.key_direction);
    floor(builder, &shadow.darkness())?;
    sky(builder, light.key_direction)?;
    for (mesh, material, at) in &things {
        add(builder, mesh, material.clone(), *at)?;
    }
    Ok(())
}

/// How much of the floor is haze at this distance.
fn haze(distance: f32) -> f32 {
    let t = ((distance - CLEAR) / (FLOOR - CLEAR)).clamp(0.0, 1.0);
    t * (2.0 - t)
}

/// The floor: a grid that is dense where the shadow lies.
fn floor(builder: &mut Builder, darkness: &[f32]) -> Result<(), String> {
    let board = builder.texture(|| Ok(checkerboard(8, 64, [[205, 190, 168], [84, 76, 74]])));
    let mut material = plastic([1.0; 3], 0.8);
    let far = |map: fn(f32) -> [u8; 3], space| move || Ok(radial(map, space));
    let shine = |t: f32| (HAZE * haze(t)).to_array().map(|v| (linear_to_srgb(v) * 255.0) as u8);
    let rest = |t: f32| [((1.0 - haze(t)) * 255.0) as u8; 3];
    let shine = builder.texture(far(shine, ColorSpace::Srgb));
    let rest = builder.texture(far(rest, ColorSpace::Linear));
    let clamp =
        Sampler { wrap_u: Wrap::ClampToEdge, wrap_v: Wrap::ClampToEdge, ..Sampler::default() };
    let over_all = |texture| TextureUse { sampler: clamp, uv_set: 1, ..TextureUse::new(texture) };
    material.maps[Map::BaseColor as usize] = Some(TextureUse::new(board));
    material.maps[Map::Emissive as usize] = Some(over_all(shine));
    material.maps[Map::Occlusion as usize] = Some(over_all(rest));
    material.emissive = Vec3::ONE;
    let spread = |t: f32| {
        let t = t * 2.0 - 1.0;
        7.0 * t + (FLOOR - 7.0) * t.powi(9)
    };
    let mut mesh = shapes::grid(FLOOR_QUADS, FLOOR_QUADS, |u, v| {
        let p = Vec3::new(spread(u), 0.0, -spread(v));
        // A square of the board is 0.9 wide; turned a little, so that no edge is level.
        let turned = Vec2::from_angle(0.3).rotate(Vec2::new(p.x, p.z));
        (p, Vec3::Y, turned / (8.0 * 0.9))
    });
    mesh.uvs[1] = mesh.positions.iter().map(|p| Vec2::new(p.x, p.z) / FLOOR * 0.5 + 0.5).collect();
    shapes::paint(&mut mesh, |p| {
        // The light that is left in the shade is a little blue.
        let shade = Vec3::ONE.lerp(Vec3::new(0.02, 0.03, 0.05), sample(darkness, p));
        (shade * (1.0 - haze(p.length()))).extend(1.0)
    });
    add(builder, &mesh, material, Mat4::IDENTITY)
}

/// A texture over the whole floor whose colour depends on the distance from the middle.
fn radial(color: fn(f32) -> [u8; 3], space: ColorSpace) -> Texture {
    const TEXELS: u32 = 512;
    let texel = |i: u32| {
        let at = Vec2::new((i % TEXELS) as f32, (i / TEXELS) as f32) + 0.5;
        let distance = (at / TEXELS as f32 * 2.0 - 1.0).length() * FLOOR;
        let [r, g, b] = color(distance);
        [r, g, b, 255]
    };
    let texels = (0..TEXELS * TEXELS).flat_map(texel).collect();
    with_mips("haze", Extent::new(TEXELS, TEXELS), texels, space)
}

/// A dome around everything, bright at the horizon and around the sun.
fn sky(builder: &mut Builder, sun: Vec3) -> Result<(), String> {
    let mut dome = shapes::sphere(96, 64);
    let toward = Vec3::new(sun.x, 0.1, -sun.z.abs()).normalize();
    shapes::paint(&mut dome, |d| {
        let zenith = Vec3::new(0.135, 0.30, 0.60);
        let middle = Vec3::new(0.33, 0.54, 0.80);
        let up = d.y;
        let color = match up {
            ..0.0 => HAZE,
            _ => {
                let low = HAZE.lerp(middle, 1.0 - (-up * 14.0).exp());
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

    /// The share of light that is missing, by texel.
    fn darkness(&self) -> Vec<f32> {
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
        let missing =
            |(cast, below): (&f32, &f32)| 1.0 - (1.0 - 0.72 * cast) * (1.0 - 0.65 * below);
        cast.iter().zip(&below).map(missing).collect()
    }
}

/// The darkness at a point of the floor, between texels.
fn sample(darkness: &[f32], p: Vec3) -> f32 {
    let at = texel(p) - 0.5;
    let (low, part) = (at.floor(), at - at.floor());
    let value = |x: f32, y: f32| {
        let inside = 0.0..SHADOW_TEXELS as f32;
        let there = inside.contains(&x) && inside.contains(&y);
        if there { darkness[y as usize * SHADOW_TEXELS + x as usize] } else { 0.0 }
    };
    let row = |y: f32| value(low.x, y) * (1.0 - part.x) + value(low.x + 1.0, y) * part.x;
    row(low.y) * (1.0 - part.y) + row(low.y + 1.0) * part.y
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
