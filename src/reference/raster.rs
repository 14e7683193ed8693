//! Raster and the tests of depth and stencil: which triangle each sample shows, its depth, and its stencil value.
//!
//! Reads: triangles, the state of the draws, the targets before the batch. Writes: visibility, depth and stencil values, row by
//! row, the samples of a pixel one after the other.
//! Contract: draws the triangles in API order, one after the other, as the API describes it; twin
//! of `glsl/raster.comp`, and of `glsl/ordered.comp` where shaders neither discard nor write depth.

use super::{Held, Input, assembly::Assembled, binning::edge_at, kept, primitive::multiply_add};
use crate::{
    format::Format,
    grid::Grid,
    pass::Pass,
    samples::Samples,
    state::{Compare, DepthBias, DepthState},
    stencil::{StencilFace, StencilOp, StencilState},
    trace::{Parts, Triangle, key},
};

/// Draws all of the batch. Returns the key of the triangle that wrote each sample last, 0 where none did.
pub fn run(input: &Input, primitives: &[Parts], held: &mut Held) -> Vec<u32> {
    let samples = input.pass.samples.count() as usize;
    let mut visibility = vec![0; samples * input.grid.extent.pixels()];
    for (number, parts) in primitives.iter().enumerate() {
        let state = match &input.pass.depth {
            Some(_) => input.pipeline(number).depth,
            None => DepthState::OFF,
        };
        let stencil = input.pass.stencil.as_ref().and(input.pipeline(number).stencil);
        for (part, triangle) in parts.iter().enumerate() {
            let Some(triangle) = triangle else { continue };
            let key = key(number, part);
            let of_draw = (input.pipeline(number).sample_mask, &input.primitives[number]);
            let tests = (state, stencil);
            draw((input.pass, input.grid), of_draw, tests, (triangle, key), held, &mut visibility);
        }
    }
    visibility
}

fn draw(
    (pass, grid): (&Pass, &Grid),
    (sample_mask, assembled): (u32, &Assembled),
    (state, stencil): (DepthState, Option<StencilState>),
    (t, key): (&Triangle, u32),
    held: &mut Held,
    visibility: &mut [u32],
) {
    let Held { depth, stencil: values } = held;
    let Assembled { bias, depth_bounds: [least, greatest], depth_limits, .. } = *assembled;
    let [front, back] = assembled.stencil_reference;
    let face = stencil.map(|test| if t.front { (test.front, front) } else { (test.back, back) });
    let bias = bias.map(|bias| bias_of(pass, bias, t));
    for y in t.first[1]..=t.last[1] {
        for x in t.first[0]..=t.last[0] {
            for (s, &position) in pass.samples.positions().iter().enumerate() {
                let place = place(grid, [x, y], position);
                if sample_mask >> s & 1 == 0 || !covers(t, place) {
                    continue;
                }
                let pixel = (y * grid.extent.width + x) as usize;
                let at = pixel * pass.samples.count() as usize + s;
                let z = kept(pass, depth_at((t, bias, depth_limits), (pass.samples, place)));
                if state.bounds && !(least..=greatest).contains(&depth[at]) {
                    continue;
                }
                let passes_depth = !state.test || passes(state.compare, z, depth[at]);
                if let Some((face, reference)) = face {
                    let (value, passed) = stencil_test(face, reference, values[at], passes_depth);
                    values[at] = value;
                    if !passed {
                        continue;
                    }
                }
                if !passes_depth {
                    continue;
                }
                visibility[at] = key;
                if state.test && state.write {
                    depth[at] = z;
                }
            }
        }
    }
}

/// A place of the target in 1/16 pixel from the centre of pixel (0, 0): that of a sample of the band's pixel, which is at
/// `position` in it.
fn place(grid: &Grid, [x, y]: [u32; 2], position: [u8; 2]) -> [i64; 2] {
    let along = |pixel: u32, position: u8| 16 * i64::from(pixel) + i64::from(position) - 8;
    [along(x, position[0]), along(y + grid.origin_y, position[1])]
}

fn covers(t: &Triangle, place: [i64; 2]) -> bool {
    (0..3).all(|edge| edge_at(t, edge, place.map(|along| 16 * along)) >= 0)
}

fn depth_at(
    (t, bias, [least, greatest]): (&Triangle, Option<f32>, [f32; 2]),
    (samples, place): (Samples, [i64; 2]),
) -> f32 {
    // The plane starts in the corner of a pixel, if pixels have several samples.
    let start = if samples == Samples::One { 0 } else { 8 };
    let [x, y] = place.map(|along| (along + start) as f32 / 16.0);
    let z = multiply_add(t.dzdy, y, multiply_add(t.dzdx, x, t.z));
    let z = bias.map_or(z, |bias| z + bias);
    if z > least { z.min(greatest) } else { least }
}

/// What is added to all depths of a triangle: as the specification says it, less what no depth shows.
fn bias_of(pass: &Pass, bias: DepthBias, t: &Triangle) -> f32 {
    let DepthBias { constant, slope, clamp } = bias;
    let step = match pass.depth.as_ref().map(|target| target.format) {
        Some(Format::D16Unorm) => 1.0 / 65535.0,
        Some(Format::X8D24Unorm) => 1.0 / 16_777_215.0,
        // The weight of the last place of the largest depth, if it is a normal number.
        _ => f32::from_bits((t.exponent.unwrap_or(0).max(24) - 23) << 23),
    };
    let most = 2f32.powi(60);
    let limited = |a: f32| a.clamp(-most, most);
    let sum = limited(step * constant) + limited(t.dzdx.abs().max(t.dzdy.abs()) * slope);
    let sum = if clamp > 0.0 { sum.min(clamp) } else { sum };
    let sum = if clamp < 0.0 { sum.max(clamp) } else { sum };
    limited(sum)
}

/// The stencil value after a fragment, and whether the stencil test lets it pass.
fn stencil_test(face: StencilFace, reference: u8, held: u32, passes_depth: bool) -> (u32, bool) {
    let held = held as u8;
    let mask = face.compare_mask;
    let passed = passes(face.compare, f32::from(reference & mask), f32::from(held & mask));
    let operation = match (passed, passes_depth) {
        (false, _) => face.fail,
        (true, false) => face.depth_fail,
        (true, true) => face.pass,
    };
    let value = match operation {
        StencilOp::Keep => held,
        StencilOp::Zero => 0,
        StencilOp::Replace => reference,
        StencilOp::IncrementAndClamp => held.saturating_add(1),
        StencilOp::DecrementAndClamp => held.saturating_sub(1),
        StencilOp::Invert => !held,
        StencilOp::IncrementAndWrap => held.wrapping_add(1),
        StencilOp::DecrementAndWrap => held.wrapping_sub(1),
    };
    let written = face.write_mask;
    (u32::from(held & !written | value & written), passed)
}

fn passes(compare: Compare, new: f32, old: f32) -> bool {
    match compare {
        Compare::Never => false,
        Compare::Less => new < old,
        Compare::Equal => new == old,
        Compare::LessOrEqual => new <= old,
        Compare::Greater => new > old,
        Compare::NotEqual => new != old,
        Compare::GreaterOrEqual => new >= old,
        Compare::Always => true,
    }
}
