//! Primitive: assembles, clips, culls and sets up every primitive of a batch.
//!
//! Reads: pieces, indices, clip-space positions. Writes: the triangles of each primitive.
//! Contract: that of `glsl/primitive.comp`, whose twin this is.

use super::Input;
use crate::{
    abi::{self, Piece, Triangle},
    state::{Cull, FrontFace, Topology},
    trace::Parts,
};

type Vec4 = [f32; 4];

/// All primitives of the batch.
pub fn run(input: &Input) -> Vec<Parts> {
    (0..input.primitives).map(|primitive| primitive_parts(input, primitive)).collect()
}

/// The clip-space positions of the three vertices of `primitive`, as the vertex shader left them.
pub fn corners(input: &Input, primitive: u32) -> [Vec4; 3] {
    let at = input.pieces.partition_point(|piece| piece.first_primitive <= primitive) - 1;
    let piece = &input.pieces[at];
    let slots = vertex_slots(input, piece, primitive - piece.first_primitive);
    slots.map(|slot| input.positions[slot as usize])
}

fn primitive_parts(input: &Input, primitive: u32) -> Parts {
    let at = input.pieces.partition_point(|piece| piece.first_primitive <= primitive) - 1;
    let piece = &input.pieces[at];
    let slots = vertex_slots(input, piece, primitive - piece.first_primitive);
    let corners = slots.map(|slot| input.positions[slot as usize].map(flush));
    if corners.iter().flatten().any(|c| !c.is_finite()) {
        return vec![None];
    }
    let hidden = (0..PLANES).any(|p| corners.iter().all(|&c| distance(p, c, [1.0; 2]) < 0.0));
    if hidden {
        return vec![None];
    }
    let polygon = clip(&corners, piece.guard);
    if polygon.len() < 3 || polygon.iter().any(|c| flush(c[3]) <= 0.0) {
        return vec![None];
    }
    let clipped = polygon.as_slice() != corners;
    let window: Vec<_> = polygon.iter().map(|&corner| to_window(piece, corner)).collect();
    window[1..]
        .windows(2)
        .map(|pair| {
            let piece_number = input.piece_first + at as u32;
            let corners_of_part = [window[0], pair[0], pair[1]];
            let plane = match clipped {
                true => depth_plane_clipped(&corners, piece),
                false => depth_plane(corners_of_part),
            };
            set_up(input, piece, piece_number, slots, corners_of_part, plane)
        })
        .collect()
}

fn vertex_slots(input: &Input, piece: &Piece, in_piece: u32) -> [u32; 3] {
    if piece.vertex_mode == abi::VERTEX_PER_CORNER {
        return [0, 1, 2].map(|c| piece.vertex_base + 3 * in_piece + c);
    }
    let in_draw = piece.first_in_draw + in_piece;
    let instance = in_draw / piece.primitives_per_instance;
    let k = in_draw % piece.primitives_per_instance;
    let elements = if piece.topology == Topology::TriangleList as u32 {
        [3 * k, 3 * k + 1, 3 * k + 2]
    } else if piece.topology == Topology::TriangleStrip as u32 {
        [k, k + 1 + k % 2, k + 2 - k % 2]
    } else {
        [k + 1, k + 2, 0]
    };
    elements.map(|element| {
        let element = piece.first_element + element;
        let vertex = match piece.index_slot {
            abi::NONE => element,
            _ => (input.index)(piece, element),
        };
        piece.vertex_base
            + (instance - piece.instance_min) * piece.vertices_per_instance
            + (vertex - piece.vertex_min)
    })
}

/// Denormals are zero, because devices may flush them.
fn flush(a: f32) -> f32 {
    if a.is_subnormal() || a == 0.0 { 0.0 } else { a }
}

const PLANES: usize = 6;

fn distance(plane: usize, [x, y, z, w]: Vec4, guard: [f32; 2]) -> f32 {
    match plane {
        0 => guard[0] * w + x,
        1 => guard[0] * w - x,
        2 => guard[1] * w + y,
        3 => guard[1] * w - y,
        4 => z,
        _ => w - z,
    }
}

/// Sutherland and Hodgman: the polygon that the planes leave of a triangle.
fn clip(triangle: &[Vec4; 3], guard: [f32; 2]) -> Vec<Vec4> {
    let mut polygon = triangle.to_vec();
    for plane in 0..PLANES {
        if triangle.iter().all(|&c| distance(plane, c, guard) >= 0.0) {
            continue;
        }
        let mut kept = Vec::new();
        for i in 0..polygon.len() {
            let a = polygon[(i + polygon.len() - 1) % polygon.len()];
            let b = polygon[i];
            let (da, db) = (distance(plane, a, guard), distance(plane, b, guard));
            if da < 0.0 && db >= 0.0 {
                kept.push(crossing(plane, b, db, a, da));
            } else if da >= 0.0 && db < 0.0 {
                kept.push(crossing(plane, a, da, b, db));
            }
            if db >= 0.0 {
                kept.push(b);
            }
        }
        polygon = kept;
        if polygon.is_empty() {
            break;
        }
    }
    polygon
}

fn crossing(plane: usize, inside: Vec4, din: f32, outside: Vec4, dout: f32) -> Vec4 {
    let t = flush(din / (din - dout));
    let mut p = std::array::from_fn(|i| inside[i] + (outside[i] - inside[i]) * t);
    match plane {
        4 => p[2] = 0.0,
        5 => p[2] = p[3],
        _ => {}
    }
    p
}

/// Window position in pixels and depth.
fn to_window(piece: &Piece, [x, y, z, w]: Vec4) -> [f32; 3] {
    let inverse = flush(1.0 / w);
    let ndc = [x * inverse, y * inverse, z * inverse];
    let mut window: [f32; 3] =
        std::array::from_fn(|i| multiply_add(ndc[i], piece.scale[i], piece.offset[i]));
    let far_out = (1 << abi::GUARD_LOG2) as f32;
    for c in &mut window[..2] {
        *c = c.clamp(-far_out, far_out);
    }
    window
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
    input: &Input,
    piece: &Piece,
    piece_number: u32,
    slots: [u32; 3],
    window: [[f32; 3]; 3],
    [dzdx, dzdy, z]: [f32; 3],
) -> Option<Triangle> {
    let scale = (1 << abi::SUBPIXEL_BITS) as f32;
    let snap = |c: f32| ((c - 0.5) * scale).round_ties_even() as i32;
    let mut x = window.map(|p| snap(p[0]));
    let mut y = window.map(|p| snap(p[1]));
    let at = |i: usize| (i64::from(x[i]), i64::from(y[i]));
    let (a, b, c) = (at(0), at(1), at(2));
    let area = (b.0 - a.0) * (c.1 - a.1) - (c.0 - a.0) * (b.1 - a.1);
    let front = (area > 0) == (piece.front_face == FrontFace::Clockwise as u32);
    let culled = if front { Cull::Front } else { Cull::Back };
    if area == 0 || piece.cull == culled as u32 {
        return None;
    }
    if area < 0 {
        x.swap(1, 2);
        y.swap(1, 2);
    }
    let pixels = |c: [i32; 3], low: i32, high: i32| {
        let [a, b, c] = c;
        let first = (a.min(b).min(c) + 255).div_euclid(256).max(low);
        let last = (a.max(b).max(c) - 1).div_euclid(256).min(high);
        (first <= last).then_some((first, last))
    };
    let (first_x, last_x) = pixels(x, piece.rect_min[0], piece.rect_max[0])?;
    let (first_y, last_y) = pixels(y, piece.rect_min[1], piece.rect_max[1])?;
    let origin_y = input.grid.origin_y as i32;

    let mut triangle = Triangle {
        x,
        y,
        z,
        dzdx,
        dzdy,
        bounds_min: first_x as u32 | ((first_y - origin_y) as u32) << 16,
        bounds_max: last_x as u32 | ((last_y - origin_y) as u32) << 16,
        piece: piece_number,
        vertices: slots,
        flags: abi::TRIANGLE_VALID,
    };
    if front {
        triangle.flags |= abi::TRIANGLE_FRONT;
    }
    if piece.cut != 0 {
        triangle.flags |= abi::TRIANGLE_CUT;
    }
    triangle.flags |=
        (super::binning::level(input.grid, &triangle) as u32) << abi::TRIANGLE_LEVEL_SHIFT;
    Some(triangle)
}

/// Change of depth per pixel to the right and down, and the depth at the centre of the pixel (0, 0).
fn depth_plane([a, b, c]: [[f32; 3]; 3]) -> [f32; 3] {
    let ab: [f32; 3] = std::array::from_fn(|i| a[i] - b[i]);
    let ca: [f32; 3] = std::array::from_fn(|i| c[i] - a[i]);
    let area = ab[0] * ca[1] - ab[1] * ca[0];
    let inverse = flush(1.0 / area);
    let (cas, abs) = ([ca[0] * inverse, ca[1] * inverse], [ab[0] * inverse, ab[1] * inverse]);
    let [dx, dy] = [ab[2] * cas[1] - ca[2] * abs[1], ca[2] * abs[0] - ab[2] * cas[0]];
    let plane = [dx, dy, a[2] - (dx * (a[0] - 0.5) + dy * (a[1] - 0.5))];
    let usable = flush(area) != 0.0 && plane.iter().all(|p| p.abs() < 2f32.powi(64));
    if usable { plane.map(settled) } else { [0.0, 0.0, settled(a[2])] }
}

/// The same for a clipped primitive: the plane through its clip-space vertices as they came, by
/// Cramer's rule for `w - z` over device coordinates.
fn depth_plane_clipped([a, b, c]: &[Vec4; 3], piece: &Piece) -> [f32; 3] {
    // Cofactors of the rows (x, y, w).
    let minors = |[px, py, _, pw]: Vec4, [qx, qy, _, qw]: Vec4| {
        [py * qw - qy * pw, qx * pw - px * qw, px * qy - qx * py]
    };
    let (bc, ca, ab) = (minors(*b, *c), minors(*c, *a), minors(*a, *b));
    let volume = a[0] * bc[0] + a[1] * bc[1] + a[3] * bc[2];
    let inverse = flush(1.0 / volume);
    let [pa, pb, pc] = [a, b, c].map(|v| (v[3] - v[2]) * inverse);
    let p: [f32; 3] = std::array::from_fn(|i| bc[i] * pa + ca[i] * pb + ab[i] * pc);
    let (scale, offset) = (piece.scale, piece.offset);
    let gradient = [flush(p[0] / scale[0]), flush(p[1] / scale[1])];
    let z = 1.0 - (p[2] + gradient[0] * (0.5 - offset[0]) + gradient[1] * (0.5 - offset[1]));
    let plane = [-gradient[0] * scale[2], -gradient[1] * scale[2], offset[2] + z * scale[2]];
    let usable = flush(volume) != 0.0 && plane.iter().all(|p| p.abs() < 2f32.powi(64));
    if usable { plane.map(settled) } else { [0.0, 0.0, offset[2]] }
}

/// What is too small to change any depth is zero.
fn settled(p: f32) -> f32 {
    if p.abs() < 2f32.powi(-64) { 0.0 } else { p }
}
