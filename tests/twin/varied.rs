//! Passes that begin with what their targets hold, that draw what the device counts, and that follow one another.

use crate::{common::random::Random, indirect, targets};
use std::sync::Arc;
use tilewright::{
    image::Picture,
    pass::Pass,
    target::LoadOp,
    vk::Gpu,
    {Format, Renderer},
};

/// What happens to a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Variation {
    /// Nothing.
    Plain,
    /// The targets begin with pictures.
    Loaded,
    /// The draws are commands in buffers of the device.
    Counted,
    /// The targets are images, which an earlier pass drew to, and the draws are commands.
    Second,
}

impl Variation {
    pub const ALL: [Self; 4] = [Self::Plain, Self::Loaded, Self::Counted, Self::Second];

    /// `pass`, changed in this way, and the same with all that it needs in host memory. An earlier pass is drawn by
    /// `renderer`.
    pub fn apply(self, renderer: &mut Renderer, seed: u64, pass: Pass) -> (Pass, Pass) {
        let gpu = renderer.gpu().clone();
        let mut random = Random::new(seed ^ 0x5eed);
        let pass = match self {
            Self::Plain => pass,
            Self::Loaded => loaded(&mut random, pass),
            Self::Counted => indirect::as_commands(&gpu, &mut random, &pass),
            Self::Second => second(&gpu, &mut random, renderer, pass),
        };
        let snapshot = pass.snapshot().expect("it is read").into_owned();
        (pass, snapshot)
    }
}

/// Any texels, and depths of which many are equal to others and to those of meshes.
fn loaded(random: &mut Random, mut pass: Pass) -> Pass {
    let mut picture = |format: Format, texel: &mut dyn FnMut(&mut Random) -> [u8; 4]| {
        let bytes = (0..pass.extent.pixels()).flat_map(|_| texel(random)).collect();
        Arc::new(Picture { extent: pass.extent, format, bytes })
    };
    let texels = picture(Format::Rgba8Unorm, &mut |random| (random.bits() as u32).to_ne_bytes());
    pass.colors[0].load = LoadOp::Picture(texels);
    let mut depth = |random: &mut Random| match random.below(4) {
        0 => random.unit().to_ne_bytes(),
        _ => ([0.0f32, 0.25, 0.5, 1.0][random.below(4)]).to_ne_bytes(),
    };
    let depths = picture(Format::D32Float, &mut depth);
    let target = pass.depth.as_mut().expect("it has depth");
    (target.load, target.format) = (LoadOp::Picture(depths), Format::D32Float);
    pass
}

fn second(gpu: &Gpu, random: &mut Random, renderer: &mut Renderer, pass: Pass) -> Pass {
    let images = (
        targets::target(gpu, "color", pass.extent, Format::Rgba8Unorm),
        targets::target(gpu, "depth", pass.extent, Format::D32Float),
    );
    let mut pass = pass;
    pass.depth.as_mut().expect("it has depth").format = Format::D32Float;
    let at = random.below(pass.draws.len() + 1);
    let loads = (LoadOp::Load, LoadOp::Load);
    let parts = targets::split(&pass, at, Some(&images), loads);
    let [first, second] = parts.map(|part| indirect::as_commands(gpu, random, &part));
    renderer.prepare(&first).expect("a pass").execute().expect("it is drawn");
    second
}
