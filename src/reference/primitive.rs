//! Primitive: clips, culls and sets up every primitive of a batch.
//!
//! Reads: primitives, clip-space positions, the draws' viewports, scissors and culling. Writes: the triangles of each
//! primitive. Contract: that of `glsl/primitive.comp`, whose twin this is.

use super::{Input, assembly::Assembled, window::Window};
use crate::{
    abi,
    grid::Grid,
    pass::Pipeline,
    samples::Samples,
    state::{Cull, FrontFace},
    trace::{Parts, Positions, Triangle},
};

type Vec4 = [f32; 4];

/// All primitives of the batch.
pub fn run(input: &Input) -> Vec<Parts> {
    (0..input.primitives.len()).map(|number| parts(input, number)).collect()
}

/// The clip-space positions of the three vertices, as the vertex shader left them.
pub fn corners(positions: &Positions, assembled: &Assembled) -> [Vec4; 3] {
    assembled.vertices.map(|vertex| positions.of(vertex).unwrap_or([f32::NAN; 4]))
}

fn parts(input: &Input, number: usize) -> Parts {
    let assembled = &input.primitives[number];
    let corners = corners(input.positions, assembled).map(|corner| corner.map(flush));
    // Not finite, or so far out that a difference of two might not be.
    let usable = |c: &f32| c.abs() < 2f32.powi(126);
    if !corners.iter().flatten().all(usable) {
        return vec![None];
    }
    let planes = planes(input.pipeline(number));
    let hidden = (0..planes).any(|p| corners.iter().all(|&c| distance(p, c) < 0.0));
    if hidden {
        return vec![None];
    }
    let polygon = clip(&corners, planes);
    if polygon.len() < 3 || polygon.iter().any(|c| flush(c.position[3]) <= 0.0) {
        return vec![None];
    }
    let corners: Vec<_> = polygon.iter().map(|c| to_window(&assembled.window, c)).collect();
    let triangles = corners[1..].windows(2).map(|pair| {
        let corners = [corners[0], pair[0], pair[1]];
        set_up((input.grid, input.pass.samples), input.pipeline(number), assembled, corners)
    });
    triangles.collect()
}

/// Denormals are zero, because devices may flush them.
fn flush(a: f32) -> f32 {
    if a.is_subnormal() || a == 0.0 { 0.0 } else { a }
}

/// How many planes the primitives of a pipeline are clipped by: the four sides, then near and far.
fn planes(pipeline: &Pipeline) -> usize {
    let near_and_far = pipeline.depth_clip.unwrap_or(!pipeline.depth_clamp);
    if near_and_far { 6 } else { 4 }
}

fn distance(plane: usize, [x, y, z, w]: Vec4) -> f32 {
    [w - x, w + x, w - y, w + y, z, w - z][plane]
}

/// A corner of a clipped polygon.
#[derive(Clone, Copy)]
struct Corner {
    position: Vec4,
    /// Whether clipping made it.
    made: bool,
}

/// Sutherland and Hodgman: the polygon that the planes leave of a triangle.
fn clip(triangle: &[Vec4; 3], planes: usize) -> Vec<Corner> {
    let mut polygon: Vec<_> =
        triangle.iter().map(|&position| Corner { position, made: false }).collect();
    for plane in 0..planes {
        if triangle.iter().all(|&c| distance(plane, c) >= 0.0) {
            continue;
        }
        let mut kept = Vec::new();
        for (i, &a) in polygon.iter().enumerate() {
            let b = polygon[(i + 1) % polygon.len()];
            let (da, db) = (distance(plane, a.position), distance(plane, b.position));
            if da >= 0.0 {
                kept.push(a);
            }
            if da < 0.0 && db >= 0.0 {
                kept.push(crossing(a.position, da, b.position, db));
            } else if da >= 0.0 && db < 0.0 {
                kept.push(crossing(b.position, db, a.position, da));
            }
        }
        polygon = kept;
        if polygon.is_empty() {
            break;
        }
    }
    polygon
}

fn crossing(outside: Vec4, dout: f32, inside: Vec4, din: f32) -> Corner {
    let t = flush(dout / (dout - din));
    let position = std::array::from_fn(|i| outside[i] + (inside[i] - outside[i]) * t);
    Corner { position, made: true }
}

/// Window position in pixels and depth.
fn to_window(window: &Window, corner: &Corner) -> [f32; 3] {
    let [x, y, z, w] = corner.position;
    let inverse = flush(1.0 / w);
    // Without clipping, a depth may be anything. Far beyond 1 it makes no difference.
    let ndc = [x * inverse, y * inverse, (z * inverse).clamp(-(2f32.powi(40)), 2f32.powi(40))];
    let Window { scale, offset, .. } = window;
    let mut position: [f32; 3] = std::array::from_fn(|i| match corner.made {
        true => ndc[i] * scale[i] + offset[i],
        false => multiply_add(ndc[i], scale[i], offset[i]),
    });
    let far_out = (1 << abi::GUARD_LOG2) as f32;
    for c in &mut position[..2] {
        *c = c.clamp(-far_out, far_out);
    }
    position
}

/// A fused multiply-add but for double rounding in rare ties: product and sum with their rounding errors added back.
pub(super) fn multiply_add(a: f32, b: f32, c: f32) -> f32 {
    let product = a * b;
    // Exact in 64 bits: 24 + 24 bits of factors.
    let product_error = (f64::from(a) * f64::from(b) - f64::from(product)) as f32;
    let sum = product + c;
    let part = sum - product;
    let sum_error = (product - (sum - part)) + (c - part);
    sum + (sum_error + product_error)
}

fn set_up(
    (grid, samples): (&Grid, Samples),
    pipeline: &Pipeline,
    assembled: &Assembled,
    corners: [[f32; 3]; 3],
) -> Option<Triangle> {
    let scale = (1 << abi::SUBPIXEL_BITS) as f32;
    // As devices round: several samples are not in the centres of pixels.
    let snap = |c: f32| match samples {
        Samples::One => ((c - 0.5) * scale).round_ties_even() as i32,
        _ => (c * scale).round_ties_even() as i32 - 128,
    };
    let mut x = corners.map(|p| snap(p[0]));
    let mut y = corners.map(|p| snap(p[1]));
    let at = |i: usize| (i64::from(x[i]), i64::from(y[i]));
    let (a, b, c) = (at(0), at(1), at(2));
    let area = (b.0 - a.0) * (c.1 - a.1) - (c.0 - a.0) * (b.1 - a.1);
    let front = (area > 0) == (pipeline.front_face == FrontFace::Clockwise);
    let culled = if front { Cull::Front } else { Cull::Back };
    if area == 0 || pipeline.cull == culled {
        return None;
    }
    if area < 0 {
        x.swap(1, 2);
        y.swap(1, 2);
    }
    let pixels = |[a, b, c]: [i32; 3], [low, high]: [i32; 2]| {
        let first = (a.min(b).min(c) - samples.reach() + 255).div_euclid(256).max(low);
        let last = (a.max(b).max(c) + samples.reach() - 1).div_euclid(256).min(high);
        (first <= last).then_some((first, last))
    };
    let Window { columns, rows: [top, bottom], cut, .. } = assembled.window;
    let origin_y = grid.origin_y as i32;
    let rows = [top.max(origin_y), bottom.min(origin_y + grid.extent.height as i32 - 1)];
    let (first_x, last_x) = pixels(x, columns)?;
    let (first_y, last_y) = pixels(y, rows)?;

    let [dzdx, dzdy, z] = depth_plane(corners, if samples == Samples::One { 0.5 } else { 0.0 });
    let largest = corners.iter().map(|corner| corner[2].abs()).fold(0.0, f32::max);
    let adjusted = assembled.bias.is_some() || pipeline.depth_clamp || planes(pipeline) == 4;
    let mut triangle = Triangle {
        x,
        y,
        first: [first_x as u32, (first_y - origin_y) as u32],
        last: [last_x as u32, (last_y - origin_y) as u32],
        z,
        dzdx,
        dzdy,
        vertices: assembled.vertices,
        front,
        cut,
        level: 0,
        exponent: adjusted.then_some(largest.to_bits() >> 23),
    };
    triangle.level = super::binning::level(grid, samples, &triangle) as u32;
    Some(triangle)
}

/// Change of depth per pixel to the right and down, and the depth at the place (`start`, `start`) of pixel (0, 0).
fn depth_plane([a, b, c]: [[f32; 3]; 3], start: f32) -> [f32; 3] {
    let ab: [f32; 3] = std::array::from_fn(|i| a[i] - b[i]);
    let ca: [f32; 3] = std::array::from_fn(|i| c[i] - a[i]);
    let area = ab[0] * ca[1] - ab[1] * ca[0];
    let inverse = flush(1.0 / area);
    let (cas, abs) = ([ca[0] * inverse, ca[1] * inverse], [ab[0] * inverse, ab[1] * inverse]);
    let [dx, dy] = [ab[2] * cas[1] - ca[2] * abs[1], ca[2] * abs[0] - ab[2] * cas[0]];
    let plane = [dx, dy, a[2] - (dx * (a[0] - start) + dy * (a[1] - start))];
    let usable = flush(area) != 0.0 && plane.iter().all(|p| p.abs() < 2f32.powi(64));
    let settled = |p: f32| if p.abs() < 2f32.powi(-64) { 0.0 } else { p };
    if usable { plane.map(settled) } else { [0.0, 0.0, settled(a[2])] }
}
