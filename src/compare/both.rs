//! One pass by both executors of a device, compared.

use super::{Difference, Drawn, IdPass, Limits, clipping::any_crosses, compare, id_pass};
use crate::{
    classic, compute,
    error::Result,
    format::{Format, Numeric},
    image::Extent,
    pass::{Draw, Executor, Frame, Pass},
    reference,
    target::{ColorTarget, DepthTarget},
};

/// Two drawings of a pass and of its id pass, and by how much they differ.
pub struct Both {
    /// What ids mean.
    pub ids: IdPass,
    /// Colours and ids by kernels.
    pub compute: (Frame, Frame),
    /// Colours and ids by the device's own pipeline.
    pub classic: (Frame, Frame),
    /// The figures.
    pub difference: Difference,
    /// How large they may be.
    pub limits: Limits,
    /// Whether triangles cross the border of the picture; `None` if it was not checked, because the
    /// difference is within the narrower limits.
    pub crosses: Option<bool>,
}

impl Both {
    /// Draws `pass` by both and compares. `step` hears how many of [`Both::STEPS`] are done.
    ///
    /// It compares the colours that shading and blending give, not a driver's rounding to 8 bits: lavapipe
    /// encodes sRGB by an approximation that is off by up to 2 of 255, and blends 8-bit targets in 8 bits.
    /// So the target has 16-bit floats, and both drawings are encoded in the same exact way.
    ///
    /// Classic begins: what the device itself cannot draw is refused before kernels draw it.
    ///
    /// # Errors
    /// Those of the executors and of [`id_pass`].
    pub fn draw(
        compute: &mut compute::Renderer,
        classic: &mut classic::Renderer,
        pass: &Pass,
        mut step: impl FnMut(u64),
    ) -> Result<Self> {
        let mut pass = pass.snapshot()?.into_owned();
        for color in &mut pass.colors {
            // A picture to begin with has its own format.
            let is_color = matches!(color.format.numeric(), Numeric::Unorm | Numeric::Srgb);
            if is_color && color.load.clear_value().is_some() {
                color.format = Format::Rgba16Float;
            }
        }
        let ids = id_pass(&pass)?;
        let mut drawing = 0;
        let mut done = |frame: Result<Frame>| {
            drawing += 1;
            step(drawing);
            frame
        };
        let by_classic = (done(classic.render(&pass))?, done(classic.render(&ids.pass))?);
        let by_compute = (done(compute.render(&pass))?, done(compute.render(&ids.pass))?);
        let difference = compare(drawn(&by_compute), drawn(&by_classic))?;
        let mut limits = Limits::new(difference.pixels, false);
        let mut crosses = None;
        if !limits.allow(&difference) {
            let crossing = crosses_border(compute, &ids.pass)?;
            limits = Limits::new(difference.pixels, crossing);
            crosses = Some(crossing);
        }
        Ok(Self { ids, compute: by_compute, classic: by_classic, difference, limits, crosses })
    }

    /// How often `step` of [`Both::draw`] is called.
    pub const STEPS: u64 = 4;

    /// Whether the pictures count as the same.
    pub fn same(&self) -> bool {
        self.limits.allow(&self.difference)
    }
}

/// A drawing as the comparison takes it.
fn drawn((frame, ids): &(Frame, Frame)) -> Drawn<'_> {
    Drawn { frame, ids }
}

/// Whether a triangle of `pass` crosses the border, by the clip-space positions that the vertex
/// stage leaves in a trace. They do not depend on the size of the picture, so one pixel is traced.
fn crosses_border(compute: &mut compute::Renderer, pass: &Pass) -> Result<bool> {
    let whole = |draw: &Draw| Draw { viewport: None, scissor: None, ..draw.clone() };
    let draws = pass.draws.iter().map(whole).collect();
    // Targets to begin with have the size of the picture, and change no vertex.
    let colors = vec![ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])];
    let depth = pass.depth.as_ref().map(|_| DepthTarget::cleared(1.0));
    let pass = Pass { extent: Extent::new(1, 1), colors, depth, draws, ..pass.clone() };
    let (_, trace) = compute.trace(&pass)?;
    let pass = pass.snapshot()?;
    Ok(any_crosses(reference::corners(&pass, &trace.positions)))
}
