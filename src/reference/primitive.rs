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
    // Not finite, or so far out that a difference of two might not be.
    let usable = |c: &f32| c.abs() < 2f32.powi(126);
    if !corners.iter().flatten().all(usable) {
        return vec![None];
    }
    let hidden = (0..PLANES).any(|p| corners.iter().all(|&c| distance(p, c) < 0.0));
    if hidden {
        return vec![None];
    }
    let polygon = clip(&corners);
    if polygon.len() < 3 || polygon.iter().any(|c| flush(c.position[3]) <= 0.0) {
        return vec![None];
    }
    let window: Vec<_> = polygon.iter().map(|corner| to_window(piece, corner)).collect();
    window[1..]
        .windows(2)
        .map(|pair| {
            let piece_number = input.piece_first + at as u32;
            set_up(input, piece, piece_number, slots, [window[0], pair[0], pair[1]])
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
fn clip(triangle: &[Vec4; 3]) -> Vec<Corner> {
    let mut polygon: Vec<_> =
        triangle.iter().map(|&position| Corner { position, made: false }).collect();
    for plane in 0..PLANES {
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
fn to_window(piece: &Piece, corner: &Corner) -> [f32; 3] {
    let [x, y, z, w] = corner.position;
    let inverse = flush(1.0 / w);
    let ndc = [x * inverse, y * inverse, z * inverse];
    let scale = [piece.scale[0], piece.scale[1], piece.depth_scale];
    let offset = [piece.offset[0], piece.offset[1], piece.depth_offset];
    let mut window: [f32; 3] = std::array::from_fn(|i| match corner.made {
        true => ndc[i] * scale[i] + offset[i],
        false => multiply_add(ndc[i], scale[i], offset[i]),
    });
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

    let [dzdx, dzdy, z] = depth_plane(window);
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
    let settled = |p: f32| if p.abs() < 2f32.powi(-64) { 0.0 } else { p };
    if usable { plane.map(settled) } else { [0.0, 0.0, settled(a[2])] }
}
