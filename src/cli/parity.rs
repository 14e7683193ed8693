//! `tilewright parity`: the same pass by compute kernels and by the device's own pipeline.

use super::{
    args::ParityArgs,
    device,
    exit::Outcome,
    output::{write_json, write_stdout},
    picture,
    plan::ParityPlan,
    shot::Shot,
    talk,
};
use crate::{
    classic,
    compare::{self, Difference, Drawn, IdPass, Limits, clipping::any_crosses},
    compute,
    error::{Error, Result},
    format::Format,
    image::Extent,
    pass::{Draw, Executor, Pass},
    reference,
};
use serde_json::{Value, json};

/// Pixels that are named when the pictures differ too much.
const EXAMPLES: usize = 3;

/// Draws the scene and its id pass by both executors and prints the figures.
///
/// # Errors
/// Those of the scene and of the executors; [`Error::Device`] if the device has no pipeline of its
/// own to compare with, or one that cannot name its triangles.
pub fn run(args: &ParityArgs) -> Result<Outcome> {
    let plan = ParityPlan::new(args)?;
    let gpu = device::open(&args.device)?;
    let lacks = if !gpu.has_graphics() {
        Some("does not draw by itself, so there is nothing to compare with")
    } else if !gpu.has_primitive_ids() {
        Some(
            "draws without gl_PrimitiveID (its feature geometryShader), so nobody can tell which \
             triangle won a pixel",
        )
    } else {
        None
    };
    if let Some(lacks) = lacks {
        return Err(Error::Device(format!(
            "{} {lacks}; choose another device (`tilewright devices` lists them)",
            gpu.info().name
        )));
    }
    let mut shot = Shot::new(&plan.view)?;
    // What shaders computed and blending made of it is compared, not how a driver rounds it on its
    // way into 8 bits: lavapipe encodes sRGB by an approximation that is off by up to 2 of 255, and
    // blends 8-bit targets in 8 bits. Both drawings are encoded alike, by the definition.
    shot.pass.color.format = Format::Rgba16Float;
    let ids = compare::id_pass(&shot.pass)?;

    let drawing = talk::progress("drawing", 4);
    let mut compute = compute::Renderer::new(&gpu)?;
    let compute_frame = compute.render(&shot.pass)?;
    drawing.done(1);
    let compute_ids = compute.render(&ids.pass)?;
    let crosses = crosses_border(&mut compute, &ids.pass)?;
    drop(compute);
    drawing.done(2);
    let mut classic = classic::Renderer::new(&gpu)?;
    let classic_frame = classic.render(&shot.pass)?;
    drawing.done(3);
    let classic_ids = classic.render(&ids.pass)?;
    drop((classic, drawing));

    let by_compute = Drawn { frame: &compute_frame, ids: &compute_ids };
    let by_classic = Drawn { frame: &classic_frame, ids: &classic_ids };
    let difference = compare::compare(by_compute, by_classic)?;
    let limits = Limits::new(difference.pixels, crosses);
    let same = limits.allow(&difference);
    if !same {
        examples(&ids, by_compute, by_classic)?.iter().for_each(talk::line);
    }
    if let Some(output) = &plan.difference {
        let image = compare::difference_picture(by_compute, by_classic)?;
        output.write(&picture::encode(&image, gpu.info(), &plan.view.scene)?)?;
    }
    if plan.json {
        write_json(&figures(&difference))?;
    } else {
        write_stdout(table(&difference, &limits, crosses).as_bytes())?;
    }
    Ok(if same { Outcome::Done } else { Outcome::Differ })
}

/// Whether a triangle of `pass` crosses the border, by the clip-space positions that the vertex
/// stage leaves in a trace. They do not depend on the size of the picture, so one pixel is traced.
fn crosses_border(compute: &mut compute::Renderer, pass: &Pass) -> Result<bool> {
    let whole = |draw: &Draw| Draw { viewport: None, scissor: None, ..draw.clone() };
    let draws = pass.draws.iter().map(whole).collect();
    let (_, trace) = compute.trace(&Pass { extent: Extent::new(1, 1), draws, ..pass.clone() })?;
    let batches = 0..trace.batches.len();
    Ok(batches.into_iter().any(|batch| any_crosses(reference::corners(&trace, batch))))
}

/// The figures and nothing else: scripts rely on these keys.
fn figures(difference: &Difference) -> Value {
    json!({
        "pixels": difference.pixels,
        "coverage_differing": difference.coverage_differing,
        "winner_differing": difference.winner_differing,
        "colour_over_1": difference.colour_over_1,
        "colour_max": difference.colour_max,
        "depth_max": difference.depth_max,
    })
}

fn table(difference: &Difference, limits: &Limits, crosses: bool) -> String {
    let count = |name: &str, found: u64, limit: u64| {
        let verdict = if found <= limit { "" } else { "  over" };
        format!("{name:<20} {found:>10} {limit:>10}{verdict}\n")
    };
    let depth_over = if difference.depth_max <= limits.depth_max { "" } else { "  over" };
    let why = if crosses {
        "triangles cross the border of the picture"
    } else {
        "no triangle crosses the border of the picture"
    };
    [
        format!("{:<20} {:>10} {:>10}  ({why})\n", "", "found", "limit"),
        format!("{:<20} {:>10}\n", "pixels", difference.pixels),
        count("coverage_differing", difference.coverage_differing, limits.coverage_differing),
        count("winner_differing", difference.winner_differing, limits.winner_differing),
        count("colour_over_1", difference.colour_over_1, limits.colour_over_1),
        format!("{:<20} {:>10}\n", "colour_max", difference.colour_max),
        format!(
            "{:<20} {:>10.1e} {:>10.1e}{depth_over}\n",
            "depth_max", difference.depth_max, limits.depth_max
        ),
        format!(
            "the pictures are {}\n",
            if limits.allow(difference) { "the same" } else { "DIFFERENT" }
        ),
    ]
    .concat()
}

/// The first pixels of which coverage or winner differ, each with the two primitives.
fn examples(ids: &IdPass, compute: Drawn<'_>, classic: Drawn<'_>) -> Result<Vec<String>> {
    let Extent { width, .. } = compute.ids.color.extent;
    let name = |id: u32| match ids.primitive(id) {
        Some((range, primitive)) => {
            format!("triangle {primitive} of instance {} of draw {}", range.instance, range.draw)
        }
        None => "nothing".into(),
    };
    let pairs =
        compare::ids(&compute.ids.color)?.into_iter().zip(compare::ids(&classic.ids.color)?);
    let differing = pairs.enumerate().filter(|(_, (compute, classic))| compute != classic);
    let line = |(at, (compute, classic)): (usize, (u32, u32))| {
        let (x, y) = (at % width as usize, at / width as usize);
        format!("pixel {x},{y}: compute draws {}, classic {}", name(compute), name(classic))
    };
    Ok(differing.take(EXAMPLES).map(line).collect())
}
