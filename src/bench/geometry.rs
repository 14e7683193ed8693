//! The geometry of generated scenes: meshes, their places, and the camera.

use super::recipe::{Order, Recipe, Shape};
use crate::{image::Extent, random::Random, scene::Camera};
use glam::{DVec3, Mat4, Quat, Vec2, Vec3};
use std::f32::consts::{PI, TAU};

/// What `surface.vert` reads.
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Vertex {
    pub position: Vec3,
    pub normal: Vec3,
    pub uv: Vec2,
}

/// Triangles.
#[derive(Debug, Default)]
pub struct Mesh {
    pub vertices: Vec<Vertex>,
    pub indices: Vec<u32>,
}

/// How an object's pixels combine with the pixels behind them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// They hide it; the object is closed, so that back faces are culled.
    Solid,
    /// They hide it, seen from either side.
    Open,
    /// They tint it.
    Glass,
    /// They hide it where the texture says so.
    Leaf,
}

/// A mesh in its place.
#[derive(Debug)]
pub struct Object {
    pub mesh: usize,
    pub model: Mat4,
    pub tint: [f32; 3],
    pub kind: Kind,
}

/// A generated scene before it is a pass.
#[derive(Debug)]
pub struct Model {
    pub meshes: Vec<Mesh>,
    pub objects: Vec<Object>,
    pub view_projection: Mat4,
    pub eye: Vec3,
}

/// A soft colour.
fn tint(random: &mut Random) -> [f32; 3] {
    let hue = random.unit() * TAU;
    [0.0, 2.1, 4.2].map(|shift| 0.65 + 0.3 * (hue + shift).cos())
}

/// The geometry of `recipe` for a picture of `extent`.
pub fn model(recipe: &Recipe, extent: Extent) -> Model {
    let count = recipe.count.unwrap_or(0);
    let mut model = match recipe.shape {
        Shape::Sheet => sheet(recipe, extent),
        Shape::Hall => hall(recipe, extent),
        Shape::Knot => knot(count, extent),
        Shape::Ball => ball(count, extent),
        Shape::Crowd => crowd(recipe, extent),
        Shape::Slivers => slivers(recipe, extent),
        Shape::Leaves => leaves(recipe, extent),
    };
    // Leaves come sorted, since blending needs it.
    if recipe.shape != Shape::Leaves {
        let vp = model.view_projection;
        let depth = |object: &Object| vp.project_point3(object.model.w_axis.truncate()).z;
        match recipe.order {
            Order::Near => model.objects.sort_by(|a, b| depth(a).total_cmp(&depth(b))),
            Order::Far => model.objects.sort_by(|a, b| depth(b).total_cmp(&depth(a))),
            Order::Random => shuffle(recipe.random(7), &mut model.objects),
        }
    }
    if recipe.blend {
        model.objects.iter_mut().for_each(|object| object.kind = Kind::Glass);
    }
    model
}

fn shuffle<T>(mut random: Random, items: &mut [T]) {
    for last in (1..items.len()).rev() {
        let other = (random.unit() * (last + 1) as f32) as usize;
        items.swap(last, other.min(last));
    }
}

/// A grid of `columns` x `rows` cells, each vertex given by its parameters in 0..=1.
fn grid(columns: u32, rows: u32, mut at: impl FnMut(f32, f32) -> Vertex) -> Mesh {
    let mut mesh = Mesh::default();
    mesh.vertices.reserve((columns as usize + 1) * (rows as usize + 1));
    for j in 0..=rows {
        for i in 0..=columns {
            mesh.vertices.push(at(i as f32 / columns as f32, j as f32 / rows as f32));
        }
    }
    mesh.indices.reserve(columns as usize * rows as usize * 6);
    for j in 0..rows {
        for i in 0..columns {
            let a = j * (columns + 1) + i;
            let b = a + columns + 1;
            mesh.indices.extend([a, a + 1, b + 1, a, b + 1, b]);
        }
    }
    mesh
}

/// Clip space as it is: geometry there has its size in pixels.
fn upright(meshes: Vec<Mesh>, objects: Vec<Object>) -> Model {
    Model { meshes, objects, view_projection: Mat4::IDENTITY, eye: Vec3::new(0.0, 0.0, -2.0) }
}

fn seen(meshes: Vec<Mesh>, objects: Vec<Object>, camera: &Camera, extent: Extent) -> Model {
    let view_projection = camera.view_projection(extent).as_mat4();
    Model { meshes, objects, view_projection, eye: camera.eye().as_vec3() }
}

/// A camera at `eye` that looks at `target`.
fn look_at(eye: Vec3, target: Vec3, yfov: f64) -> Camera {
    Camera::look_at(eye.as_dvec3(), target.as_dvec3(), DVec3::Y, yfov)
}

/// Layers from depth 0.1 to 0.9. Inner vertices are off their places by up to a fifth of a cell, so
/// that no two triangles lie alike on the pixels.
fn sheet(recipe: &Recipe, extent: Extent) -> Model {
    let layers = recipe.layers(extent);
    let aspect = extent.width as f32 / extent.height as f32;
    let (mut meshes, mut objects) = (Vec::new(), Vec::new());
    for layer in 0..layers.depth {
        let mut random = recipe.random(u64::from(layer) + 1);
        let cell = [1.0 / layers.columns as f32, 1.0 / layers.rows as f32];
        let mesh = grid(layers.columns, layers.rows, |u, v| {
            let mut inside = |t: f32, cell: f32| {
                let border = t == 0.0 || t == 1.0;
                let shift = random.signed() * 0.2 * cell;
                if border { t } else { t + shift }
            };
            let (u, v) = (inside(u, cell[0]), inside(v, cell[1]));
            let [across, down] = layers.covered;
            let position = Vec3::new((u * 2.0 - 1.0) * across, (v * 2.0 - 1.0) * down, 0.0);
            let bent = Vec3::new((u * 9.0).sin() * 0.3, (v * 7.0).sin() * 0.3, -1.0);
            Vertex { position, normal: bent, uv: Vec2::new(u * 4.0 * aspect, v * 4.0) }
        });
        meshes.push(mesh);
        let z = 0.1 + 0.8 * layer as f32 / layers.depth as f32;
        let model = Mat4::from_translation(Vec3::new(0.0, 0.0, z));
        objects.push(Object {
            mesh: layer as usize,
            model,
            tint: tint(&mut random),
            kind: Kind::Open,
        });
    }
    upright(meshes, objects)
}

fn cuboid() -> Mesh {
    let mut mesh = Mesh::default();
    for axis in 0..3 {
        for sign in [1.0, -1.0] {
            let first = mesh.vertices.len() as u32;
            for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
                let place = |n: f32, a: f32, b: f32| {
                    let mut p = [n, a, b];
                    p.rotate_right(axis);
                    Vec3::from_array(p)
                };
                mesh.vertices.push(Vertex {
                    position: place(sign, (u * 2.0 - 1.0) * sign, v * 2.0 - 1.0),
                    normal: place(sign, 0.0, 0.0),
                    uv: Vec2::new(u, v) * 3.0,
                });
            }
            mesh.indices.extend([0, 1, 2, 0, 2, 3].map(|i| first + i));
        }
    }
    mesh
}

/// 18 cuboids around the viewer: floor, ceiling, walls and twelve pillars.
fn hall(recipe: &Recipe, extent: Extent) -> Model {
    let mut objects = Vec::new();
    let mut random = recipe.random(3);
    let mut add = |center: Vec3, half: Vec3| {
        let model = Mat4::from_translation(center) * Mat4::from_scale(half);
        objects.push(Object { mesh: 0, model, tint: tint(&mut random), kind: Kind::Solid });
    };
    for (center, half) in [
        (Vec3::new(0.0, -1.0, 0.0), Vec3::new(5.0, 0.1, 8.0)),
        (Vec3::new(0.0, 3.0, 0.0), Vec3::new(5.0, 0.1, 8.0)),
        (Vec3::new(-5.0, 1.0, 0.0), Vec3::new(0.1, 2.0, 8.0)),
        (Vec3::new(5.0, 1.0, 0.0), Vec3::new(0.1, 2.0, 8.0)),
        (Vec3::new(0.0, 1.0, -8.0), Vec3::new(5.0, 2.0, 0.1)),
        (Vec3::new(0.0, 1.0, 8.0), Vec3::new(5.0, 2.0, 0.1)),
    ] {
        add(center, half);
    }
    for row in 0..6 {
        for side in [-1.0, 1.0] {
            add(Vec3::new(side * 2.5, 1.0, row as f32 * 2.4 - 6.5), Vec3::new(0.35, 2.0, 0.35));
        }
    }
    let camera = look_at(Vec3::new(0.8, 0.9, 6.5), Vec3::new(-0.2, 0.6, 0.0), 1.1);
    seen(vec![cuboid()], objects, &camera, extent)
}

fn knot(count: u32, extent: Extent) -> Model {
    let curve = |t: f32| {
        let (a, b) = (t * TAU * 2.0, t * TAU * 3.0);
        let r = 2.0 + b.cos();
        Vec3::new(r * a.cos(), r * a.sin(), b.sin()) * 0.5
    };
    // A tube some thirty times as long as it is around.
    let around = ((count as f32 / 60.0).sqrt() as u32).max(3);
    let along = (count / 2 / around).max(3);
    let mesh = grid(around, along, |u, v| {
        let here = curve(v);
        let tangent = (curve(v + 1e-3) - curve(v - 1e-3)).normalize();
        let a = v * TAU * 2.0;
        // Away from the torus's own center line: a frame that never flips.
        let side = (here - Vec3::new(a.cos(), a.sin(), 0.0)).cross(tangent).normalize();
        let out = tangent.cross(side);
        let (s, c) = (u * TAU).sin_cos();
        let normal = out * c - side * s;
        Vertex { position: here + normal * 0.28, normal, uv: Vec2::new(v * 24.0, u * 2.0) }
    });
    let object =
        Object { mesh: 0, model: Mat4::IDENTITY, tint: [0.9, 0.7, 0.5], kind: Kind::Solid };
    let camera = look_at(Vec3::new(0.0, 0.3, 4.6), Vec3::ZERO, 0.8);
    seen(vec![mesh], vec![object], &camera, extent)
}

/// A ball of about `count` triangles with a relief of `ripple`.
fn rippled(count: u32, ripple: f32) -> Mesh {
    let rows = ((count as f32 / 4.0).sqrt() as u32).max(3);
    let columns = (count / 2 / rows).max(3);
    let radius = |u: f32, v: f32| 1.0 + ripple * ((u * TAU * 12.0).sin() * (v * PI * 12.0).sin());
    let place = |u: f32, v: f32| {
        let ((s, c), (sin, cos)) = ((u * TAU).sin_cos(), (v * PI).sin_cos());
        Vec3::new(c * sin, -cos, -s * sin) * radius(u, v)
    };
    grid(columns, rows, |u, v| {
        let position = place(u, v);
        // At the poles one of the differences is nothing.
        let (du, dv) = (1e-3, 1e-3);
        let across = place(u + du, v) - place(u - du, v);
        let along = place(u, v + dv) - place(u, v - dv);
        let normal = across.cross(along).try_normalize().unwrap_or(position.normalize());
        Vertex { position, normal, uv: Vec2::new(u * 8.0, v * 4.0) }
    })
}

/// A ball, one mesh whatever its size.
fn ball(count: u32, extent: Extent) -> Model {
    let object =
        Object { mesh: 0, model: Mat4::IDENTITY, tint: [0.6, 0.8, 0.9], kind: Kind::Solid };
    let camera = look_at(Vec3::new(0.0, 0.8, 2.9), Vec3::ZERO, 0.8);
    seen(vec![rippled(count, 0.04)], vec![object], &camera, extent)
}

/// As many balls as draws, all of the recipe's triangles together, in the view and partly behind one another.
fn crowd(recipe: &Recipe, extent: Extent) -> Model {
    let (count, draws) = (recipe.count.unwrap_or(0), recipe.draws);
    let camera = look_at(Vec3::new(0.0, 0.0, 10.0), Vec3::ZERO, 0.8);
    let mut random = recipe.random(11);
    // Whatever their number, they cover the screen about three times.
    let radius = 10.0 / (draws as f32).sqrt();
    let aspect = extent.width as f32 / extent.height as f32;
    let object = |_| {
        let distance = 5.0 + 9.0 * random.unit();
        let half = distance * 0.4f32.tan() - radius;
        let (x, y) = (random.signed() * half * aspect, random.signed() * half);
        let at = Vec3::new(x, y, 10.0 - distance);
        let turn =
            Quat::from_rotation_y(random.unit() * TAU) * Quat::from_rotation_x(random.unit());
        let model = Mat4::from_scale_rotation_translation(Vec3::splat(radius), turn, at);
        Object { mesh: 0, model, tint: tint(&mut random), kind: Kind::Solid }
    };
    let objects = (0..draws).map(object).collect();
    seen(vec![rippled(count / draws, 0.0)], objects, &camera, extent)
}

/// Needles from point to point on the screen, a pixel wide at one end.
fn slivers(recipe: &Recipe, extent: Extent) -> Model {
    let mut random = recipe.random(5);
    let mut mesh = Mesh::default();
    let scale = Vec2::new(2.0 / extent.width as f32, 2.0 / extent.height as f32);
    let half = Vec2::ONE / scale - 2.0;
    for needle in 0..recipe.count.unwrap_or(0) {
        let length = 0.2 + 0.3 * random.unit();
        let turn = random.unit() * TAU;
        let along = Vec2::new(turn.cos(), turn.sin()) * length * extent.height as f32;
        let across = Vec2::new(-turn.sin(), turn.cos());
        let from = Vec2::new(random.signed(), random.signed()) * half;
        let to = (from + along).clamp(-half, half);
        let z = random.unit();
        for (at, lift) in [(from, 0.0), (from + across, 0.02), (to, 0.05)] {
            let position = (at * scale).extend(0.1 + 0.75 * z + lift);
            let normal = Vec3::new(across.x * 0.5, across.y * 0.5, -1.0);
            mesh.vertices.push(Vertex { position, normal, uv: Vec2::new(z * 4.0, lift * 20.0) });
        }
        mesh.indices.extend([0, 1, 2].map(|corner| needle * 3 + corner));
    }
    let object =
        Object { mesh: 0, model: Mat4::IDENTITY, tint: [0.9, 0.85, 0.6], kind: Kind::Open };
    upright(vec![mesh], vec![object])
}

/// A lawn, and bushes whose leaves are sorted from back to front.
fn leaves(recipe: &Recipe, extent: Extent) -> Model {
    let mut random = recipe.random(9);
    let lawn = grid(16, 16, |u, v| Vertex {
        position: Vec3::new((u * 2.0 - 1.0) * 12.0, -1.0, (1.0 - v * 2.0) * 12.0),
        normal: Vec3::Y,
        uv: Vec2::new(u, v) * 24.0,
    });
    let eye = Vec3::new(0.0, 2.0, 6.6);
    let bush = |b: u32| Vec3::new((b % 5) as f32 * 2.2 - 4.4, -0.1, (b / 5) as f32 * -2.2 + 3.0);
    let mut centers: Vec<(Vec3, Vec3, Vec3)> = (0..recipe.count.unwrap_or(0) / 2)
        .map(|leaf| {
            let direction = Vec3::new(random.signed(), random.signed(), random.signed());
            let out = direction.normalize_or(Vec3::Y);
            let at = bush(leaf % 15) + out * (0.5 + 0.5 * random.unit());
            let side = out.any_orthonormal_vector();
            let side = Quat::from_axis_angle(out, random.unit() * TAU) * side;
            (at, side, out)
        })
        .collect();
    centers.sort_by(|a, b| b.0.distance_squared(eye).total_cmp(&a.0.distance_squared(eye)));
    let mut foliage = Mesh::default();
    for (at, side, out) in centers {
        let up = out.cross(side);
        let first = foliage.vertices.len() as u32;
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let position = at + (side * (u - 0.5) + up * (v - 0.5)) * 0.22;
            foliage.vertices.push(Vertex { position, normal: out, uv: Vec2::new(u, v) });
        }
        foliage.indices.extend([0, 1, 2, 0, 2, 3].map(|corner| first + corner));
    }
    let (model, green) = (Mat4::IDENTITY, [0.5, 0.75, 0.35]);
    let objects = vec![
        Object { mesh: 0, model, tint: [0.55, 0.5, 0.4], kind: Kind::Open },
        Object { mesh: 1, model, tint: green, kind: Kind::Leaf },
    ];
    let camera = look_at(eye, Vec3::new(0.0, -0.4, 0.0), 0.8);
    seen(vec![lawn, foliage], objects, &camera, extent)
}
