//! Executes a pass on the CPU. The result defines the right coverage, depth and primitive ids.
//!
//! The reference plans for itself: it takes the [`Pass`] and finds the primitives, their vertices, viewports and
//! state by the simplest code that could be right. It takes two things from the trace of a device: the clip-space
//! positions that the user's vertex shader wrote, and where each batch ends, which is the device's to choose. It
//! computes everything else: 64-bit integers for edges, IEEE floats rounded after every operation. It knows the
//! stages' contracts, and nothing of compute's plan or of the kernels.

pub mod assembly;
pub mod binning;
pub mod primitive;
pub mod raster;
mod shape;
pub mod window;

use crate::{
    format::Format,
    grid::Grid,
    pass::{Pass, Pipeline},
    target::LoadOp,
    trace::{BatchTrace, Positions, Trace},
};
use assembly::Assembled;

/// One batch, as the reference needs it.
#[derive(Clone, Copy)]
pub struct Input<'a> {
    /// The pass.
    pub pass: &'a Pass,
    /// The band.
    pub grid: &'a Grid,
    /// The batch's primitives.
    pub primitives: &'a [Assembled],
    /// Positions of all vertices of the pass.
    pub positions: &'a Positions,
}

impl Input<'_> {
    /// The pipeline of the batch's primitive number `number`.
    fn pipeline(&self, number: usize) -> &Pipeline {
        let draw = self.primitives[number].primitive.draw as usize;
        &self.pass.pipelines[self.pass.draws[draw].pipeline]
    }
}

/// The clip-space corners of the primitives of `pass`, which is valid and a snapshot. A vertex that `positions` lacks has coordinates that are no
/// numbers.
pub(crate) fn corners(pass: &Pass, positions: &Positions) -> impl Iterator<Item = [[f32; 4]; 3]> {
    assembly::run(pass).map(|assembled| primitive::corners(positions, &assembled))
}

/// The first difference between `trace`, which a device left of `pass`, and what every stage should have written;
/// as a sentence that names the primitive. Visibility and depth take every fragment for drawn, as if no shader
/// discarded any or wrote a depth of its own, and as if no alpha left out samples. A pass that contradicts itself differs from every trace.
///
/// Takes the resources of a device as they are now. So they should be as they were when the trace was made.
pub fn first_difference(pass: &Pass, trace: &Trace) -> Option<String> {
    let pass = match pass.validate().and_then(|()| pass.snapshot()) {
        Ok(pass) => pass,
        Err(error) => return Some(error.to_string()),
    };
    if let Some(vertex) = trace.positions.contradiction() {
        return Some(format!("vertex: {vertex} has several positions"));
    }
    let bands: Vec<Grid> = Grid::bands(pass.extent, pass.row_bytes(), pass.samples).collect();
    if bands.len() != trace.bands.len() {
        return Some(format!("{} bands against {}", trace.bands.len(), bands.len()));
    }
    bands.iter().zip(&trace.bands).find_map(|(grid, batches)| {
        let found = difference_in_band(&pass, grid, &trace.positions, batches)?;
        Some(format!("band at row {}, {found}", grid.origin_y))
    })
}

fn difference_in_band(
    pass: &Pass,
    grid: &Grid,
    positions: &Positions,
    batches: &[BatchTrace],
) -> Option<String> {
    let mut all = assembly::run(pass);
    let mut held = Held { depth: depth_before(pass, grid), stencil: stencil_before(pass, grid) };
    for (number, given) in batches.iter().enumerate() {
        let primitives: Vec<_> = all.by_ref().take(given.primitives.len()).collect();
        let expected = batch(Input { pass, grid, primitives: &primitives, positions }, held);
        let found = match given.primitives == expected.primitives {
            true => missing(&primitives, positions),
            // Other primitives have other vertices.
            false => None,
        };
        if let Some(found) = found.or_else(|| given.first_difference(&expected)) {
            return Some(format!("batch {number}: {found}"));
        }
        held = Held { depth: expected.depth, stencil: expected.stencil };
    }
    all.next().map(|left| format!("assembly: no batch has {}", left.primitive))
}

/// The depth of the samples of the band's pixels before the first batch.
fn depth_before(pass: &Pass, grid: &Grid) -> Vec<f32> {
    let (pixels, samples) = (grid.extent.pixels(), pass.samples.count() as usize);
    let of_pixels = match pass.depth.as_ref().map(|depth| &depth.load) {
        Some(LoadOp::Clear(depth)) => vec![kept(pass, *depth); pixels],
        Some(LoadOp::Picture(picture)) => {
            let first = grid.origin_y as usize * grid.extent.width as usize;
            picture.depths()[first..first + pixels].to_vec()
        }
        Some(LoadOp::Load) => unreachable!("a snapshot loads from no image"),
        None => vec![1.0; pixels],
    };
    of_pixels.into_iter().flat_map(|depth| std::iter::repeat_n(depth, samples)).collect()
}

/// The stencil values in the same way; none without a target for them.
fn stencil_before(pass: &Pass, grid: &Grid) -> Vec<u32> {
    let (pixels, samples) = (grid.extent.pixels(), pass.samples.count() as usize);
    let of_pixels: Vec<u8> = match pass.stencil.as_ref().map(|stencil| &stencil.load) {
        Some(LoadOp::Clear(value)) => vec![*value; pixels],
        Some(LoadOp::Picture(picture)) => {
            let first = grid.origin_y as usize * grid.extent.width as usize;
            picture.bytes[first..first + pixels].to_vec()
        }
        Some(LoadOp::Load) => unreachable!("a snapshot loads from no image"),
        None => Vec::new(),
    };
    of_pixels.into_iter().flat_map(|value| std::iter::repeat_n(value.into(), samples)).collect()
}

/// What the depth target of `pass` keeps of a depth: the nearest one that its format holds.
fn kept(pass: &Pass, depth: f32) -> f32 {
    let most = match pass.depth.as_ref().map(|target| target.format) {
        Some(Format::D16Unorm) => 65535.0,
        Some(Format::X8D24Unorm) => 16_777_215.0,
        _ => return depth,
    };
    (f64::from((depth * most).round_ties_even()) / f64::from(most)) as f32
}

/// Says which vertex of `primitives` was not shaded.
fn missing(primitives: &[Assembled], positions: &Positions) -> Option<String> {
    primitives.iter().find_map(|Assembled { primitive, vertices, .. }| {
        let vertex = vertices.iter().find(|vertex| positions.of(**vertex).is_none())?;
        Some(format!("vertex: {primitive} has a vertex that was not shaded: {vertex}"))
    })
}

/// What the targets of depth and stencil hold: the samples of the band's pixels row by row.
pub struct Held {
    /// Depths.
    pub depth: Vec<f32>,
    /// Stencil values; none without a target for them.
    pub stencil: Vec<u32>,
}

/// What every stage should have written of a batch that begins with `held`.
fn batch(input: Input, mut held: Held) -> BatchTrace {
    let triangles = primitive::run(&input);
    let cells = binning::run(input.grid, input.pass.samples, &triangles);
    let visibility = raster::run(&input, &triangles, &mut held);
    let primitives = input.primitives.iter().map(|assembled| assembled.primitive).collect();
    let Held { depth, stencil } = held;
    BatchTrace { grid: *input.grid, primitives, triangles, cells, visibility, depth, stencil }
}
