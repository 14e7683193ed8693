//! Processes that measure one executor alone: the code that starts them, and the code that they run.

use super::{
    super::{
        args::{Backend, BenchArgs, Vec3, ViewArgs},
        exit::Outcome,
        messages,
        output::write_json,
    },
    cases::Case,
    interrupt,
};
use crate::{
    bench::{self, Alone},
    error::Result,
    pass::Pass,
    vk::{DeviceInfo, Gpu},
};
use serde_json::Value;
use std::process::Command;

/// The environment variable that makes a run of the tool such a process; its value names the executor. It is
/// no option, because users have no need of it.
const VARIABLE: &str = "TILEWRIGHT_BENCH_ALONE";

/// The executor that this process measures; `None` in an ordinary run of the tool.
pub fn executor() -> Option<Backend> {
    let wanted = std::env::var(VARIABLE).ok()?;
    [Backend::Compute, Backend::Classic].into_iter().find(|backend| backend.name() == wanted)
}

/// Draws `pass` with the caches as they are, and prints its times and its memory.
///
/// # Errors
/// Those of the executor.
pub fn measure(gpu: &Gpu, backend: Backend, pass: &Pass) -> Result<Outcome> {
    let found = match backend {
        Backend::Compute => Alone::compute(gpu, pass)?,
        Backend::Classic => Alone::classic(gpu, pass)?,
    };
    write_json(&found.json()).map(|()| Outcome::Done)
}

/// Measures `case` in processes of their own and adds their figures to the row. If a process fails, a warning
/// says so and its figures are left out; the rest of the row is still valid.
pub fn add_to(row: &mut Value, case: &Case, args: &BenchArgs, device: &DeviceInfo) {
    for backend in [Backend::Compute, Backend::Classic] {
        match twice(case, args, device, backend) {
            Ok([first, second]) => bench::add_alone(row, backend.name(), &first, &second),
            Err(reason) => messages::line(format_args!(
                "warning: {}: no first frame and no memory of {}: {reason}",
                case.label.name(),
                backend.name()
            )),
        }
    }
}

fn twice(
    case: &Case,
    args: &BenchArgs,
    device: &DeviceInfo,
    backend: Backend,
) -> std::result::Result<[Alone; 2], String> {
    let text = |e: std::io::Error| e.to_string();
    let program = std::env::current_exe().map_err(text)?;
    let caches = interrupt::Folder::new().map_err(text)?;
    let once = || {
        let mut command = Command::new(&program);
        command
            .env(VARIABLE, backend.name())
            .arg("bench")
            .arg(case.typed())
            .args(["--size", &case.label.extent.to_string(), "--device", &device.uuid])
            .args(["--seed", &args.seed.to_string()])
            .args(view_options(&args.view));
        for (axis, value) in &case.label.settings {
            command.arg("--axis").arg(format!("{}={value}", axis.name()));
        }
        let command = bench::in_empty_caches(&mut command, caches.path());
        let output = interrupt::output(command).map_err(text)?;
        let said = String::from_utf8_lossy(&output.stderr);
        let found = serde_json::from_slice(&output.stdout).ok();
        found
            .filter(|_| output.status.success())
            .and_then(|value| Alone::from_json(&value))
            .ok_or_else(|| said.lines().last().unwrap_or("it ended without a word").to_string())
    };
    Ok([once()?, once()?])
}

/// The options of `view` as arguments of a command line.
fn view_options(view: &ViewArgs) -> Vec<String> {
    let vector = |Vec3(v): Vec3| format!("{},{},{}", v[0], v[1], v[2]);
    let color = |[r, g, b, a]: [u8; 4]| format!("{r:02x}{g:02x}{b:02x}{a:02x}");
    [
        ("camera", view.camera.clone()),
        ("eye", view.eye.map(vector)),
        ("target", view.target.map(vector)),
        ("up", view.up.map(vector)),
        ("fov", view.fov.map(|fov| fov.to_string())),
        ("background", view.background.map(color)),
        ("time", view.time.map(|time| time.to_string())),
    ]
    .into_iter()
    .filter_map(|(name, value)| Some(format!("--{name}={}", value?)))
    .collect()
}

#[cfg(test)]
mod tests {
    use super::super::super::args::{Typed, Verb};
    use super::*;
    use clap::Parser;

    #[test]
    fn what_was_typed_is_typed_again() {
        let view = |line: &[String]| {
            let line =
                ["tilewright", "bench", "a.glb"].map(String::from).into_iter().chain(line.to_vec());
            let Verb::Bench(args) = Typed::try_parse_from(line).unwrap().verb else {
                unreachable!()
            };
            args.view
        };
        for line in [
            &["--camera=-my camera", "--fov=33.5", "--time=1.25", "--background=33669980"][..],
            &["--eye=-1,2.5,3e-3", "--target=0,-0.125,1", "--up=0,0,-1"],
            &[],
        ] {
            let line: Vec<String> = line.iter().map(|word| word.to_string()).collect();
            let once = view(&line);
            assert_eq!(format!("{:?}", view(&view_options(&once))), format!("{once:?}"));
        }
    }
}
