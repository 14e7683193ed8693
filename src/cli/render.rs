//! `tilewright render`: a scene into a PNG file.

use super::{
    args::{Backend, RenderArgs},
    device,
    exit::Outcome,
    messages, picture,
    plan::RenderPlan,
    scene_view::SceneView,
};
use crate::{
    bench, classic, compute,
    error::Result,
    image::{Extent, Picture},
    target::ClearColor,
    vk::{Gpu, Timings},
};
use serde_json::{Value, json};
use std::time::{Duration, Instant};

/// Draws the scene.
///
/// # Errors
/// Those of the scene, of the executor and of the output.
pub fn run(args: &RenderArgs) -> Result<Outcome> {
    let plan = RenderPlan::new(args)?;
    let mut clock = Clock::start();
    let gpu = device::open(&args.device)?;
    clock.lap("open_device");
    let scene_view = SceneView::new(&plan.view)?;
    for output in [Some(&plan.picture), plan.stats.as_ref()].into_iter().flatten() {
        scene_view.keep_from(output)?;
    }
    clock.lap("read_scene");
    let (color, depth, timings) = {
        let _working = messages::working_on("drawing");
        draw(&gpu, plan.backend, &scene_view, &mut clock)?
    };
    clock.lap("read_back");
    let clear = scene_view.pass.colors[0].load.clear_value();
    if !scene_view.pass.draws.is_empty() && is_blank(&color, depth.as_ref(), clear) {
        messages::line("warning: nothing of the scene is visible: the picture is all background");
    }
    let image = scene_view.picture(color)?;
    let origin = plan.metadata.then_some((gpu.info(), &plan.view.scene));
    plan.picture.write(&picture::encode(&image, origin)?)?;
    clock.lap("write_picture");

    if let Some(output) = &plan.stats {
        let stats = json!({
            "schema_version": 1,
            "tilewright": env!("CARGO_PKG_VERSION"),
            "device": device::block(gpu.info()),
            "scene": plan.view.scene.to_string(),
            "backend": plan.backend.name(),
            "extent": [plan.view.extent.width, plan.view.extent.height],
            "samples": plan.view.samples.count(),
            "triangles": scene_view.triangles(),
            "draws": scene_view.pass.draws.len(),
            "scene_triangles": scene_view.scene.triangles(),
            "warnings": scene_view.scene.warnings(),
            "times_ms": clock.json(),
            "device_ms": ns_to_ms(timings.total_ns),
            "stages": stages(&timings),
            "memory": { "host_peak_bytes": bench::peak_bytes() },
        });
        output.write(format!("{stats:#}\n").as_bytes())?;
    }
    Ok(Outcome::Done)
}

/// Draws the view of the scene. The clock separates the work that is done once from the cost of each frame.
fn draw(
    gpu: &Gpu,
    backend: Backend,
    scene_view: &SceneView,
    clock: &mut Clock,
) -> Result<(Picture, Option<Picture>, Timings)> {
    match backend {
        Backend::Compute => {
            let mut renderer = compute::Renderer::new(gpu)?;
            renderer.time_stages(true);
            let mut prepared = renderer.prepare(&scene_view.pass)?;
            clock.lap("prepare");
            let timings = prepared.execute()?;
            clock.lap("draw");
            let color = prepared.read_color()?;
            let depth = if is_one_color(&color) { prepared.read()?.depth } else { None };
            Ok((color, depth, timings))
        }
        Backend::Classic => {
            let mut prepared = classic::Renderer::new(gpu)?.prepare(&scene_view.pass)?;
            clock.lap("prepare");
            let total_ns = prepared.execute()?;
            clock.lap("draw");
            let color = prepared.read_color()?;
            let depth = if is_one_color(&color) { prepared.read()?.depth } else { None };
            Ok((color, depth, Timings { total_ns, stages: Vec::new() }))
        }
    }
}

/// Whether all pixels have one colour.
fn is_one_color(color: &Picture) -> bool {
    let size = (color.bytes.len() / color.extent.pixels().max(1)).max(1);
    color.bytes.chunks(size).all(|pixel| *pixel == color.bytes[..size])
}

/// Whether every pixel is as the clear left it: of the colour `clear`, and with no depth in front of the far
/// plane. Blended surfaces leave no depth, so depth alone does not tell.
fn is_blank(color: &Picture, depth: Option<&Picture>, clear: Option<ClearColor>) -> bool {
    let far = 1f32.to_ne_bytes();
    is_one_color(color)
        && is_first_texel(color, clear)
        && depth.is_none_or(|depth| depth.bytes.chunks(4).all(|pixel| pixel == far))
}

/// Whether the picture's first pixel shows the colour `clear`.
fn is_first_texel(color: &Picture, clear: Option<ClearColor>) -> bool {
    let clear = Picture::filled(Extent::new(1, 1), color.format, clear.unwrap_or([0.0; 4].into()));
    let (Ok(shown), Ok(clear)) = (color.display_rgba8(), clear.display_rgba8()) else {
        return true;
    };
    // Drivers may round to the neighbour.
    shown.iter().zip(clear.iter()).all(|(shown, clear)| shown.abs_diff(*clear) <= 1)
}

/// Device time of each stage, in the order of first appearance, summed over batches.
fn stages(timings: &Timings) -> Value {
    let mut stages: Vec<(&str, u64, u64)> = Vec::new();
    for (label, ns) in &timings.stages {
        match stages.iter_mut().find(|(name, ..)| name == label) {
            Some((_, total, count)) => (*total, *count) = (*total + ns, *count + 1),
            None => stages.push((label, *ns, 1)),
        }
    }
    let stage =
        |(name, ns, count)| json!({ "stage": name, "dispatches": count, "ms": ns_to_ms(ns) });
    stages.into_iter().map(stage).collect()
}

fn ns_to_ms(ns: u64) -> f64 {
    milliseconds(Duration::from_nanos(ns))
}

/// Wall-clock times of the steps of a run.
struct Clock {
    last: Instant,
    laps: Vec<(&'static str, Duration)>,
}

impl Clock {
    fn start() -> Self {
        Self { last: Instant::now(), laps: Vec::new() }
    }

    /// Ends the step called `name`.
    fn lap(&mut self, name: &'static str) {
        let now = Instant::now();
        self.laps.push((name, now - self.last));
        self.last = now;
    }

    fn json(&self) -> Value {
        let laps = self.laps.iter();
        laps.map(|(name, time)| (name.to_string(), json!(milliseconds(*time)))).collect()
    }
}

/// Three decimals: microseconds are as far as any of these can be trusted.
fn milliseconds(time: Duration) -> f64 {
    (time.as_secs_f64() * 1e6).round() / 1e3
}
