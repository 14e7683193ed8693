//! Raster and z-test: which triangle each pixel shows, and its depth.
//!
//! Reads: triangles, pieces, the depth before the batch. Writes: visibility and depth, row by row.
//! Contract: draws the triangles in API order, one after the other, as the API describes it; twin
//! of `glsl/raster.comp`, and of `glsl/ordered.comp` where shaders neither discard nor write depth.

use super::{Input, binning::edge_at, key, primitive::multiply_add};
use crate::{abi::Triangle, grid::Grid, state::Compare, trace::Parts};

/// Draws all of the batch; `depth` has the pixels of the band row by row. Returns the key of the
/// triangle that wrote each pixel last, 0 where none did.
pub fn run(input: &Input, primitives: &[Parts], depth: &mut [f32]) -> Vec<u32> {
    let mut visibility = vec![0; input.grid.extent.pixels()];
    for (number, parts) in primitives.iter().enumerate() {
        for (part, triangle) in parts.iter().enumerate() {
            let Some(triangle) = triangle else { continue };
            draw(input, triangle, key(number, part), depth, &mut visibility);
        }
    }
    visibility
}

fn draw(input: &Input, t: &Triangle, key: u32, depth: &mut [f32], visibility: &mut [u32]) {
    let piece = &input.pieces[(t.piece - input.piece_first) as usize];
    for y in t.bounds_min >> 16..=t.bounds_max >> 16 {
        for x in t.bounds_min & 0xffff..=t.bounds_max & 0xffff {
            if !covers(input.grid, t, x, y) {
                continue;
            }
            let at = (y * input.grid.extent.width + x) as usize;
            let z = depth_at(input.grid, t, x, y);
            if piece.depth_test != 0 && !compare(piece.depth_compare, z, depth[at]) {
                continue;
            }
            visibility[at] = key;
            if piece.depth_write != 0 {
                depth[at] = z;
            }
        }
    }
}

/// Whether the triangle covers the centre of the band's pixel (x, y).
pub fn covers(grid: &Grid, t: &Triangle, x: u32, y: u32) -> bool {
    let (x, y) = (i64::from(x), i64::from(y + grid.origin_y));
    (0..3).all(|edge| edge_at(t, edge, x, y) >= 0)
}

fn depth_at(grid: &Grid, t: &Triangle, x: u32, y: u32) -> f32 {
    let (x, y) = (x as f32, (y + grid.origin_y) as f32);
    let z = multiply_add(t.dzdy, y, multiply_add(t.dzdx, x, t.z));
    if z > 0.0 { z.min(1.0) } else { 0.0 }
}

fn compare(operation: u32, new: f32, old: f32) -> bool {
    match operation {
        o if o == Compare::Never as u32 => false,
        o if o == Compare::Less as u32 => new < old,
        o if o == Compare::Equal as u32 => new == old,
        o if o == Compare::LessOrEqual as u32 => new <= old,
        o if o == Compare::Greater as u32 => new > old,
        o if o == Compare::NotEqual as u32 => new != old,
        o if o == Compare::GreaterOrEqual as u32 => new >= old,
        _ => true,
    }
}
