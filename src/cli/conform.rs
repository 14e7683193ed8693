//! `tilewright conform shaders`: checks which shaders of a folder can be drawn with.

use super::{
    args::{ConformShadersArgs, StageArg},
    device,
    exit::Outcome,
    messages,
    output::{write_json, write_stdout},
};
use crate::{
    compute,
    error::Result,
    shader::{
        FileOptions, Stage,
        conform::{Conformance, conform},
        splice::Derivatives,
    },
    vk::DeviceInfo,
};
use serde_json::{Value, json};
use std::{fmt::Write, sync::Arc};

/// Takes every shader as far as it gets. If any shader of the folder is refused, the exit code is 1, so that
/// a script notices.
///
/// # Errors
/// [`Error::Input`](crate::Error::Input) for a folder that cannot be read or has no shaders.
pub fn shaders(args: &ConformShadersArgs) -> Result<Outcome> {
    let gpu = device::open(&args.device)?;
    let derivatives =
        if gpu.has_compute_derivatives() { Derivatives::Native } else { Derivatives::Quad };
    let mut renderer = compute::Renderer::new(&gpu)?;
    let stage = args.stage.map(|stage| match stage {
        StageArg::Vertex => Stage::Vertex,
        StageArg::Fragment => Stage::Fragment,
    });
    let options = FileOptions { stage, include: args.include.clone() };
    let bar = messages::progress("shaders", 0);
    let found = conform(
        &args.dir,
        &options,
        derivatives,
        &mut |shader| renderer.make_kernels(&Arc::new(shader.clone())),
        &mut |done, files| {
            bar.out_of(files as u64);
            bar.done(done as u64);
        },
    )?;
    drop(bar);
    if found.files == 0 {
        return Err(crate::Error::input(
            &args.dir,
            "there is no shader in it: files end in .vert, .frag, .vs, .fs, .spv or .glsl (with `#pragma \
             shader_stage(vertex)` or with --stage)",
        ));
    }
    if args.json {
        write_json(&json_of(&found, gpu.info()))?;
    } else {
        write_stdout(text_of(&found).as_bytes())?;
    }
    Ok(if found.refusals.is_empty() { Outcome::Done } else { Outcome::Differ })
}

fn json_of(found: &Conformance, device: &DeviceInfo) -> Value {
    let refusals = found.refusals.iter().map(|refusal| {
        json!({
            "file": refusal.file.to_string_lossy(),
            "step": refusal.step.name(),
            "reason": refusal.reason,
        })
    });
    json!({
        "schema_version": 1,
        "device": device::block(device),
        "files": found.files,
        "compiled": found.compiled,
        "spliced": found.spliced,
        "created": found.created,
        "refusals": refusals.collect::<Vec<_>>(),
    })
}

fn text_of(found: &Conformance) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    for (name, count) in [
        ("files", found.files),
        ("compiled", found.compiled),
        ("spliced", found.spliced),
        ("created", found.created),
    ] {
        let _ = writeln!(text, "{name:<9}{count:>6}");
    }
    for refusal in &found.refusals {
        let reason = refusal.reason.trim_end().replace('\n', "\n    ");
        let _ = writeln!(text, "{}: {}: {reason}", refusal.file.display(), refusal.step.name());
    }
    text
}
