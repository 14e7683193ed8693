//! `tilewright parity`: the same pass by compute kernels and by the device's own pipeline.

use super::{
    args::ParityArgs,
    device,
    exit::Outcome,
    messages,
    output::{write_json, write_stdout},
    picture,
    plan::ParityPlan,
    scene_view::SceneView,
};
use crate::{
    classic,
    compare::{self, Both, Difference, Drawn, IdPass},
    compute,
    error::Result,
    image::Extent,
};
use serde_json::{Value, json};

/// Pixels that are named when the pictures differ too much.
const EXAMPLES: usize = 3;

/// Draws the scene and its id pass by both executors and prints the figures.
///
/// # Errors
/// Those of the scene and of the executors; [`crate::Error::Device`] if the device has no pipeline of its
/// own to compare with, or one that cannot name its triangles.
pub fn run(args: &ParityArgs) -> Result<Outcome> {
    let plan = ParityPlan::new(args)?;
    let gpu = device::open(&args.device)?;
    device::require_graphics(&gpu)?;
    let scene_view = SceneView::new(&plan.view)?;
    plan.difference.iter().try_for_each(|output| scene_view.keep_from(output))?;
    let drawing = messages::progress("drawing", Both::STEPS);
    let mut compute = compute::Renderer::new(&gpu)?;
    let mut classic = classic::Renderer::new(&gpu)?;
    let both = Both::draw(&mut compute, &mut classic, &scene_view.pass, |done| drawing.done(done))?;
    drop((compute, classic, drawing));

    let by_compute = Drawn { frame: &both.compute.0, ids: &both.compute.1 };
    let by_classic = Drawn { frame: &both.classic.0, ids: &both.classic.1 };
    let same = both.same();
    if !same {
        examples(&both.ids, by_compute, by_classic)?.iter().for_each(messages::line);
    }
    if let Some(output) = &plan.difference {
        let image = compare::difference_picture(by_compute, by_classic)?;
        let origin = plan.metadata.then_some((gpu.info(), &plan.view.scene));
        output.write(&picture::encode(&image, origin)?)?;
    }
    if plan.json {
        write_json(&figures(&both.difference))?;
    } else {
        write_stdout(table(&both).as_bytes())?;
    }
    Ok(if same { Outcome::Done } else { Outcome::Differ })
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

fn table(both: &Both) -> String {
    let Both { difference, limits, .. } = both;
    let count = |name: &str, found: u64, limit: u64| {
        let verdict = if found <= limit { "" } else { "  over" };
        format!("{name:<20} {found:>10} {limit:>10}{verdict}\n")
    };
    let depth_over = if difference.depth_max <= limits.depth_max { "" } else { "  over" };
    let why = match both.crosses {
        Some(true) => "triangles cross the border of the picture",
        Some(false) => "no triangle crosses the border of the picture",
        None => {
            "those for triangles within the picture; triangles that cross its border have wider ones"
        }
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
        format!("the pictures are {}\n", if both.same() { "the same" } else { "DIFFERENT" }),
    ]
    .concat()
}

/// The first pixels of which coverage or winner differ, each with the two primitives.
fn examples(ids: &IdPass, compute: Drawn<'_>, classic: Drawn<'_>) -> Result<Vec<String>> {
    let (by_compute, by_classic) = (compare::color(compute.ids)?, compare::color(classic.ids)?);
    let Extent { width, .. } = by_compute.extent;
    let name = |id: u32| match ids.primitive(id) {
        Some((range, primitive)) => {
            format!("triangle {primitive} of instance {} of draw {}", range.instance, range.draw)
        }
        None => "nothing".into(),
    };
    let pairs = compare::ids(by_compute)?.into_iter().zip(compare::ids(by_classic)?);
    let differing = pairs.enumerate().filter(|(_, (compute, classic))| compute != classic);
    let line = |(at, (compute, classic)): (usize, (u32, u32))| {
        let (x, y) = (at % width as usize, at / width as usize);
        format!("pixel {x},{y}: compute draws {}, classic {}", name(compute), name(classic))
    };
    Ok(differing.take(EXAMPLES).map(line).collect())
}
