//! Primitive: clips, culls and sets up every primitive of a batch.
//!
//! Reads: primitives, clip-space positions, the draws' viewports, scissors and culling. Writes: the triangles of each
//! primitive. Contract: that of `glsl/primitive.comp`, whose twin this is.

use super::{Input, assembly::Assembled, shape, window::Window};
use crate::{
    abi,
    grid::Grid,
    pass::Pipeline,
    samples::Samples,
    shader::Distances,
    state::{Cull, FrontFace, PrimitiveKind},
    trace::{Parts, Positions, Shaded, Triangle},
};
use std::ops::Range;

/// A position in clip space.
pub(super) type Vec4 = [f32; 4];
/// A position in the window: pixels and depth.
pub(super) type WindowPosition = [f32; 3];

/// All primitives of the batch.
pub fn run(input: &Input) -> Vec<Parts> {
    (0..input.primitives.len()).map(|number| parts(input, number)).collect()
}

/// The clip-space positions of the three vertices, as the vertex shader left them.
pub fn corners(positions: &Positions, assembled: &Assembled) -> [Vec4; 3] {
    vertices(positions, assembled).map(|vertex| vertex.position)
}

/// What the vertex shader gave the three vertices.
fn vertices(positions: &Positions, assembled: &Assembled) -> [Shaded; 3] {
    let missing = Shaded { position: [f32::NAN; 4], distances: [0.0; _] };
    assembled.vertices.map(|vertex| positions.of(vertex).copied().unwrap_or(missing))
}

fn parts(input: &Input, number: usize) -> Parts {
    let assembled = &input.primitives[number];
    let corners = vertices(input.positions, assembled).map(|vertex| Shaded {
        position: vertex.position.map(flush),
        distances: vertex.distances.map(flush),
    });
    let pipeline = input.pipeline(number);
    // Not finite, or so far out that a difference of two might not be.
    let usable = |c: &f32| c.abs() < 2f32.powi(126);
    let are_usable = corners.iter().flat_map(|corner| &corner.position).all(usable);
    // Numbers that are none are outside.
    let outside =
        |n: usize| corners.map(|corner| corner.distances[n].is_nan() || corner.distances[n] < 0.0);
    let Distances { clip: clips, cull: culls } = pipeline.vertex.reflection.distances;
    let most = abi::MAX_DISTANCES as usize;
    let mut clips = 0..clips as usize;
    let mut all = clips.clone().chain(most - culls as usize..most);
    let hidden = all.any(|n| outside(n) == [true; 3]);
    let cuts_by_no_number = clips.any(|n| {
        outside(n).contains(&true) && !corners.iter().all(|corner| usable(&corner.distances[n]))
    });
    if !are_usable || hidden || cuts_by_no_number {
        return vec![None];
    }
    if pipeline.topology.kind() != PrimitiveKind::Triangle {
        // Points of a trace have the size 1: it holds positions alone.
        let shape = shape::of((pipeline, assembled), &corners, 1.0, input.pass.samples);
        let Some(shape) = shape else { return vec![None] };
        let halves = [[0, 1, 2], [0, 2, 3]].map(|half| half.map(|n: usize| shape.corners[n]));
        let samples = (input.grid, input.pass.samples);
        return halves
            .map(|half| set_up(samples, pipeline, assembled, half, Plane::Known(shape.plane)))
            .into();
    }
    let planes = || (0..planes(pipeline)).chain(user_planes(pipeline));
    let hidden = planes().any(|p| corners.iter().all(|c| distance(p, c) < 0.0));
    if hidden {
        return vec![None];
    }
    let polygon = clip(&corners, planes());
    if polygon.len() < 3 || polygon.iter().any(|c| flush(c.at.position[3]) <= 0.0) {
        return vec![None];
    }
    let corners: Vec<_> =
        polygon.iter().map(|c| to_window(&assembled.window, c.at.position, c.made)).collect();
    let triangles = corners[1..].windows(2).map(|pair| {
        let corners = [corners[0], pair[0], pair[1]];
        let samples = input.pass.samples;
        let snapped = corners.map(|[x, y, _]| [snap(samples, x), snap(samples, y)]);
        let plane = Plane::Through(corners);
        set_up((input.grid, samples), pipeline, assembled, snapped, plane)
    });
    triangles.collect()
}

/// Denormals are zero, because devices may flush them.
pub(super) fn flush(a: f32) -> f32 {
    if a.is_subnormal() || a == 0.0 { 0.0 } else { a }
}

/// How many planes the primitives of a pipeline are clipped by: the four sides, then near and far.
pub(super) fn planes(pipeline: &Pipeline) -> usize {
    let near_and_far = pipeline.depth_clip.unwrap_or(!pipeline.depth_clamp);
    if near_and_far { 6 } else { 4 }
}

/// The numbers of the planes that the clip distances of a pipeline are from. They come after those of the view volume.
pub(super) fn user_planes(pipeline: &Pipeline) -> Range<usize> {
    6..6 + pipeline.vertex.reflection.distances.clip as usize
}

/// The distance of a corner from a plane of the view volume or of the user, negative outside.
pub(super) fn distance(plane: usize, corner: &Shaded) -> f32 {
    let [x, y, z, w] = corner.position;
    let of_view = [w - x, w + x, w - y, w + y, z, w - z];
    of_view.get(plane).copied().unwrap_or_else(|| corner.distances[plane - of_view.len()])
}

/// The corner at `t` on the way from one to another.
pub(super) fn between(t: f32, from: &Shaded, to: &Shaded) -> Shaded {
    let mix = |from: f32, to: f32| from + (to - from) * t;
    Shaded {
        position: std::array::from_fn(|i| mix(from.position[i], to.position[i])),
        distances: std::array::from_fn(|i| mix(from.distances[i], to.distances[i])),
    }
}

/// A corner of a clipped polygon.
#[derive(Clone, Copy)]
struct Corner {
    at: Shaded,
    /// Whether clipping made it.
    made: bool,
}

/// Sutherland and Hodgman: the polygon that the planes leave of a triangle.
fn clip(triangle: &[Shaded; 3], planes: impl Iterator<Item = usize>) -> Vec<Corner> {
    let mut polygon: Vec<_> = triangle.iter().map(|&at| Corner { at, made: false }).collect();
    for plane in planes {
        if triangle.iter().all(|c| distance(plane, c) >= 0.0) {
            continue;
        }
        let mut kept = Vec::new();
        for (i, &a) in polygon.iter().enumerate() {
            let b = polygon[(i + 1) % polygon.len()];
            let (da, db) = (distance(plane, &a.at), distance(plane, &b.at));
            if da >= 0.0 {
                kept.push(a);
            }
            if da < 0.0 && db >= 0.0 {
                kept.push(crossing(&a.at, da, &b.at, db));
            } else if da >= 0.0 && db < 0.0 {
                kept.push(crossing(&b.at, db, &a.at, da));
            }
        }
        polygon = kept;
        if polygon.is_empty() {
            break;
        }
    }
    polygon
}

fn crossing(outside: &Shaded, dout: f32, inside: &Shaded, din: f32) -> Corner {
    let t = flush(dout / (dout - din));
    Corner { at: between(t, outside, inside), made: true }
}

/// The window position of a vertex, or of a corner that clipping `made`.
pub(super) fn to_window(window: &Window, [x, y, z, w]: Vec4, made: bool) -> WindowPosition {
    let inverse = flush(1.0 / w);
    // Without clipping, a depth may be anything. Far beyond 1 it makes no difference.
    let ndc = [x * inverse, y * inverse, (z * inverse).clamp(-(2f32.powi(40)), 2f32.powi(40))];
    let Window { scale, offset, .. } = window;
    let mut position: [f32; 3] = std::array::from_fn(|i| match made {
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

/// A window coordinate in 1/256 pixel from the centre of pixel (0, 0).
fn snap(samples: Samples, c: f32) -> i32 {
    let scale = (1 << abi::SUBPIXEL_BITS) as f32;
    // As devices round: several samples are not in the centres of pixels.
    match samples {
        Samples::One => ((c - 0.5) * scale).round_ties_even() as i32,
        _ => (c * scale).round_ties_even() as i32 - 128,
    }
}

/// Where the depths of a triangle lie.
enum Plane {
    /// Of a half of a point or of a line.
    Known([f32; 3]),
    /// Through these corners.
    Through([WindowPosition; 3]),
}

fn set_up(
    (grid, samples): (&Grid, Samples),
    pipeline: &Pipeline,
    assembled: &Assembled,
    snapped: [[i32; 2]; 3],
    plane: Plane,
) -> Option<Triangle> {
    let mut x = snapped.map(|p| p[0]);
    let mut y = snapped.map(|p| p[1]);
    let at = |i: usize| (i64::from(x[i]), i64::from(y[i]));
    let (a, b, c) = (at(0), at(1), at(2));
    let area = (b.0 - a.0) * (c.1 - a.1) - (c.0 - a.0) * (b.1 - a.1);
    let is_half = matches!(plane, Plane::Known(_));
    let front = is_half || (area > 0) == (pipeline.front_face == FrontFace::Clockwise);
    let culled = if front { Cull::Front } else { Cull::Back };
    let hidden = if is_half { area < 0 } else { pipeline.cull == culled };
    if area == 0 || hidden {
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

    let start = if samples == Samples::One { 0.5 } else { 0.0 };
    let ([dzdx, dzdy, z], largest) = match plane {
        Plane::Known(plane) => (plane, 0.0),
        Plane::Through(corners) => {
            let depths = corners.iter().map(|corner| corner[2].abs());
            (depth_plane(corners, start), depths.fold(0.0, f32::max))
        }
    };
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
        provoking: assembled.provoking,
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
    match flush(area) != 0.0 {
        true => usable_plane(plane, a[2]),
        false => usable_plane([0.0, 0.0, a[2]], a[2]),
    }
}

/// A plane, or that of the depth `z` if its numbers are too large.
pub(super) fn usable_plane(plane: [f32; 3], z: f32) -> [f32; 3] {
    let usable = plane.iter().all(|p| p.abs() < 2f32.powi(64));
    let settled = |p: f32| if p.abs() < 2f32.powi(-64) { 0.0 } else { p };
    if usable { plane.map(settled) } else { [0.0, 0.0, settled(z)] }
}
