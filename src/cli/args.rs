//! The command line as clap parses it, and the help that it shows.
//!
//! This layer parses the values one by one; the message for a bad value says what is expected. The second
//! layer ([`super::plan`]) decides what the values mean together.

mod bench;

use crate::{image::Extent, samples::Samples, scene::Scene, vk::GpuOptions};
pub use bench::{BenchArgs, BenchCompareArgs, BenchShowArgs, BenchVerb};
use clap::{Args, Parser, Subcommand, ValueEnum};
use std::{ffi::OsString, path::PathBuf, time::Duration};

/// The whole command line.
#[derive(Debug, Parser)]
#[command(
    name = "tilewright",
    version,
    about = "The GPU's graphics pipeline, rebuilt as Vulkan compute kernels",
    after_help = AFTER_HELP
)]
pub struct Typed {
    #[command(subcommand)]
    pub verb: Verb,
    /// Show no progress and no notes; warnings and errors stay
    #[arg(short, long, global = true, display_order = 900)]
    pub quiet: bool,
}

const AFTER_HELP: &str = "\
Exit codes:
  0  done
  1  the pictures differ, or a shader is refused
  2  the command line is not valid
  3  no suitable device
  4  a file cannot be read or written, or standard output is closed
  5  the device was lost or did not answer in time
  6  something does not fit into memory or into a limit

Environment:
  TILEWRIGHT_DEVICE        the device, if --device does not name one
  TILEWRIGHT_TIMEOUT       the time-out in seconds, if --timeout does not give it
  TILEWRIGHT_CACHE=off     keep no compiled shaders and pipelines on disk
  TILEWRIGHT_LOG           level of messages: off, error, warn (the default), info, debug or trace
  TILEWRIGHT_VALIDATION=1  load the Vulkan validation layer and report its findings

Example:
  tilewright render builtin:teapot -o teapot.png";

/// The verbs.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Draw a scene into a PNG file
    #[command(after_help = "\
Examples:
  tilewright render scene.glb -o out.png
  tilewright render builtin:teapot --size 640x480 --background 00000000 -o - > teapot.png
  tilewright render scene.glb --no-metadata -o plain.png
  tilewright render room.obj --eye=-10,3,0 --target 0,4,0 --fov 60 --stats room.json -o room.png")]
    Render(RenderArgs),
    /// Draw a scene with compute kernels and with the device's own pipeline, and compare
    #[command(after_help = "\
Prints how many pixels there are, how many are covered by one of the two only
(coverage_differing), show a different triangle (winner_differing) or a colour that
is off by more than 1 of 255 (colour_over_1), and the largest differences of
colour and depth. The limits are narrower for a scene of which no triangle
crosses the border of the picture.

Examples:
  tilewright parity scene.glb
  tilewright parity builtin:teapot --size 800x600 --json --diff differences.png")]
    Parity(ParityArgs),
    /// Time compute kernels against the device's own pipeline
    #[command(
        args_conflicts_with_subcommands = true,
        disable_help_subcommand = true,
        after_help = bench::AFTER_HELP
    )]
    Bench(BenchArgs),
    /// Check which shaders can be spliced into the kernels
    #[command(
        disable_help_subcommand = true,
        after_help = "\
Example:
  tilewright conform shaders my/shaders --json"
    )]
    Conform(ConformArgs),
    /// List the Vulkan devices and whether they can be used
    #[command(after_help = "\
Example:
  tilewright devices
  TILEWRIGHT_DEVICE=llvmpipe tilewright render builtin:teapot -o teapot.png")]
    Devices(JsonArgs),
    /// Report the state of Vulkan on this machine, and how to fix its faults
    #[command(after_help = "\
Example:
  tilewright doctor")]
    Doctor(JsonArgs),
    /// Print the completions for a shell
    #[command(after_help = "\
Examples:
  tilewright completions bash > ~/.local/share/bash-completion/completions/tilewright
  tilewright completions zsh > \"${fpath[1]}/_tilewright\"
  tilewright completions fish > ~/.config/fish/completions/tilewright.fish")]
    Completions(CompletionsArgs),
    /// Print a page of the manual
    #[command(after_help = "\
The page is in the format of man(1). Without a verb it is the page of the tool.

Examples:
  tilewright man | man -l -
  tilewright man bench > tilewright-bench.1")]
    Man(ManArgs),
}

#[derive(Debug, Args)]
pub struct RenderArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Where the PNG goes; `-` is standard output
    #[arg(short, long, value_name = "OUT.png")]
    pub output: PathBuf,
    /// Samples of a pixel: 1, 2, 4, 8 or 16. With several of them, edges are smooth
    ///
    /// Each pixel is the average of its samples. Fragment shaders still run once for a pixel and a triangle in it, so that
    /// more samples cost memory and some time, and little shading. `parity` draws with one sample, and so does `bench` without `--axis samples`. Example: tilewright render scene.glb -o scene.png --samples 8
    #[arg(long, value_name = "N", default_value = "4", value_parser = parse_samples)]
    pub samples: Samples,
    /// Draw with compute kernels or with the device's own graphics pipeline
    #[arg(long, value_enum, default_value_t = Backend::Compute)]
    pub backend: Backend,
    /// Write times, counts and the device as JSON
    #[arg(long, value_name = "FILE.json")]
    pub stats: Option<PathBuf>,
    #[command(flatten)]
    pub device: DeviceArgs,
}

#[derive(Debug, Args)]
pub struct ParityArgs {
    #[command(flatten)]
    pub scene: SceneArgs,
    /// Print one flat JSON object instead of a table
    #[arg(long)]
    pub json: bool,
    /// Write a picture of where the two differ: in coverage red, in the triangle yellow, in colour
    /// magenta, each pixel as a cross, over the scene in dark grey
    #[arg(long, value_name = "OUT.png")]
    pub diff: Option<PathBuf>,
    #[command(flatten)]
    pub device: DeviceArgs,
}

#[derive(Debug, Args)]
pub struct ConformArgs {
    #[command(subcommand)]
    pub subject: ConformSubject,
}

#[derive(Debug, Subcommand)]
pub enum ConformSubject {
    /// Compile, splice and validate every .vert and .frag under a folder
    #[command(after_help = "\
Prints how many were compiled to SPIR-V, spliced into the kernels with a valid
result, and created on the device, and why the others were refused. What a
shader writes to further colour targets goes nowhere: a pass has one. Kinds of
texture that a pass does not have yet (cube, array, shadow) are no refusal here.

Example:
  tilewright conform shaders my/shaders --json")]
    Shaders(ConformShadersArgs),
}

#[derive(Debug, Args)]
pub struct ConformShadersArgs {
    /// The folder; searched to any depth
    ///
    /// Shaders are GLSL (.vert .frag .vs .fs .vsh .fsh, `a.vert.glsl`, or .glsl with `#pragma
    /// shader_stage(vertex)`) and SPIR-V (.spv). GLSL asks for a build with the feature `glsl` or
    /// `glsl-bundled`. Example: tilewright conform shaders assets/shaders -I assets/include
    pub dir: PathBuf,
    /// Look for included files in this folder too; may be given several times
    #[arg(short = 'I', long = "include", value_name = "DIR")]
    pub include: Vec<PathBuf>,
    /// The stage of every shader, whatever its name says; also takes .glsl files that name no stage
    #[arg(long, value_enum)]
    pub stage: Option<StageArg>,
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
    #[command(flatten)]
    pub device: DeviceArgs,
}

/// A stage of `conform shaders`.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum StageArg {
    /// Vertex shaders
    Vertex,
    /// Fragment shaders
    Fragment,
}

#[derive(Debug, Args)]
pub struct CompletionsArgs {
    /// The shell
    pub shell: clap_complete::Shell,
}

#[derive(Debug, Args)]
pub struct ManArgs {
    /// The verb whose page is printed, and its own verb if it has one, like `bench compare`
    #[arg(value_name = "VERB", num_args = 0..=2)]
    pub verbs: Vec<String>,
}

#[derive(Debug, Args)]
pub struct JsonArgs {
    /// Print JSON instead of text
    #[arg(long)]
    pub json: bool,
}

fn scene_help() -> String {
    let names: Vec<_> = Scene::builtin_names().collect();
    format!("A .gltf, .glb or .obj file, or `builtin:NAME` of {}", names.join(", "))
}

/// Which scene, and how it is looked at.
#[derive(Debug, Args)]
pub struct SceneArgs {
    #[arg(value_name = "SCENE", help = scene_help())]
    pub scene: OsString,
    /// Pixels across and down, each 1 to 16384
    #[arg(long, value_name = "WxH", default_value = "1920x1080", value_parser = parse_size, allow_hyphen_values = true)]
    pub size: Extent,
    /// Write PNG files that do not say which tool, device and scene they come from
    #[arg(long)]
    pub no_metadata: bool,
    #[command(flatten)]
    pub view: ViewArgs,
}

/// How a scene is looked at.
#[derive(Debug, Args)]
pub struct ViewArgs {
    /// A camera of the file, by name or number [default: the first; without one, frame the scene]
    #[arg(long, value_name = "NAME|INDEX", conflicts_with_all = ["eye", "target", "up"])]
    pub camera: Option<String>,
    /// Where to look from, with --target
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vec3, requires = "target", allow_hyphen_values = true)]
    pub eye: Option<Vec3>,
    /// What to look at, with --eye
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vec3, requires = "eye", allow_hyphen_values = true)]
    pub target: Option<Vec3>,
    /// Which way is up, with --eye and --target [default: 0,1,0]
    #[arg(long, value_name = "X,Y,Z", value_parser = parse_vec3, requires = "eye", allow_hyphen_values = true)]
    pub up: Option<Vec3>,
    /// Vertical field of view [default: the camera's, or 45]
    #[arg(long, value_name = "DEGREES", value_parser = parse_fov, allow_hyphen_values = true)]
    pub fov: Option<f64>,
    /// Colour behind everything, as sRGB [default: the scene's]
    #[arg(long, value_name = "RRGGBB[AA]", value_parser = parse_background)]
    pub background: Option<[u8; 4]>,
    /// Time at which animations are evaluated [default: the rest pose]
    #[arg(long, value_name = "SECONDS", value_parser = parse_time, allow_hyphen_values = true)]
    pub time: Option<f64>,
}

/// Which device to use. There is no fall-back: if the requested device cannot be used, the run ends with code 3.
#[derive(Debug, Args)]
#[command(next_help_heading = "Device")]
pub struct DeviceArgs {
    /// Index, UUID or name pattern, as `tilewright devices` lists them
    #[arg(long, value_name = "DEVICE", env = "TILEWRIGHT_DEVICE", hide_env_values = true)]
    pub device: Option<String>,
    /// Refuse to run on anything but a GPU
    #[arg(long, conflicts_with = "require_cpu")]
    pub require_gpu: bool,
    /// Refuse to run on anything but a driver for the host's processor
    #[arg(long)]
    pub require_cpu: bool,
    /// Seconds that one piece of work on the device may take before it counts as lost
    #[arg(long, value_name = "SECONDS", env = "TILEWRIGHT_TIMEOUT", hide_env_values = true,
          default_value_t = Seconds(GpuOptions::TIMEOUT), value_parser = parse_timeout)]
    pub timeout: Seconds,
}

/// A time as it is typed: in seconds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seconds(pub Duration);

impl std::fmt::Display for Seconds {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}", self.0.as_secs_f64())
    }
}

/// What draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum Backend {
    /// Compute kernels
    Compute,
    /// The device's own graphics pipeline
    Classic,
}

impl Backend {
    /// As it is typed.
    pub const fn name(self) -> &'static str {
        match self {
            Backend::Compute => "compute",
            Backend::Classic => "classic",
        }
    }
}

/// Three numbers. A type of its own, because clap reads a `[f64; 3]` as three values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vec3(pub [f64; 3]);

/// Pixels in each direction that a [`Pass`](crate::pass::Pass) can have.
const MAX_SIDE_PX: u32 = 16384;

pub fn parse_size(text: &str) -> Result<Extent, String> {
    let side = |text: &str| text.parse().ok().filter(|side| (1..=MAX_SIDE_PX).contains(side));
    text.split_once(['x', 'X'])
        .and_then(|(width, height)| Some(Extent::new(side(width)?, side(height)?)))
        .ok_or_else(|| format!("expected WxH, each 1 to {MAX_SIDE_PX}, like 1920x1080"))
}

fn parse_samples(text: &str) -> Result<Samples, String> {
    let samples = text.parse().ok().and_then(Samples::from_count);
    samples.ok_or_else(|| "expected 1, 2, 4, 8 or 16".into())
}

fn parse_vec3(text: &str) -> Result<Vec3, String> {
    let numbers: Option<Vec<f64>> = text.split(',').map(parse_finite).collect();
    numbers
        .and_then(|numbers| numbers.try_into().ok())
        .map(Vec3)
        .ok_or_else(|| "expected three numbers X,Y,Z, like 0,1.5,-4".into())
}

fn parse_fov(text: &str) -> Result<f64, String> {
    parse_finite(text)
        .filter(|&degrees| degrees > 0.0 && degrees < 180.0)
        .ok_or_else(|| "expected degrees between 0 and 180, like 60".into())
}

fn parse_time(text: &str) -> Result<f64, String> {
    parse_finite(text)
        .filter(|&seconds| seconds >= 0.0)
        .ok_or_else(|| "expected seconds, 0 or more, like 1.5".into())
}

fn parse_timeout(text: &str) -> Result<Seconds, String> {
    if text.is_empty() {
        // An empty variable is one that is not set.
        return Ok(Seconds(GpuOptions::TIMEOUT));
    }
    let seconds = text.trim().parse().ok().and_then(|s| Duration::try_from_secs_f64(s).ok());
    seconds
        .filter(|time| !time.is_zero())
        .map(Seconds)
        .ok_or_else(|| "expected seconds, more than 0, like 600".into())
}

fn parse_finite(text: &str) -> Option<f64> {
    text.trim().parse().ok().filter(|number: &f64| number.is_finite())
}

fn parse_background(text: &str) -> Result<[u8; 4], String> {
    let digits = text.strip_prefix('#').unwrap_or(text);
    let value =
        digits.bytes().all(|b| b.is_ascii_hexdigit()).then(|| u32::from_str_radix(digits, 16));
    match (digits.len(), value) {
        (6, Some(Ok(rgb))) => Ok((rgb << 8 | 0xff).to_be_bytes()),
        (8, Some(Ok(rgba))) => Ok(rgba.to_be_bytes()),
        _ => Err("expected six or eight hexadecimal digits, like 336699 or 33669980".into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_command_line_is_consistent_and_every_verb_has_an_example() {
        let mut command = Typed::command();
        command.build();
        command.clone().debug_assert();
        for verb in command.get_subcommands().filter(|verb| verb.get_name() != "help") {
            let help = verb.get_after_help().map(ToString::to_string).unwrap_or_default();
            assert!(
                help.contains(&format!("tilewright {}", verb.get_name())),
                "{}",
                verb.get_name()
            );
        }
    }

    #[test]
    fn sizes() {
        assert_eq!(parse_size("17x13"), Ok(Extent::new(17, 13)));
        assert_eq!(parse_size("16384X1"), Ok(Extent::new(16384, 1)));
        for wrong in ["", "x", "0x1", "1x0", "16385x1", "-1x1", "1920", "1x1x1", "1.5x1"] {
            assert!(parse_size(wrong).is_err(), "{wrong}");
        }
    }

    #[test]
    fn vectors_and_numbers() {
        assert_eq!(parse_vec3("-10, 3,0.5"), Ok(Vec3([-10.0, 3.0, 0.5])));
        for wrong in ["", "1,2", "1,2,3,4", "1,2,nan", "inf,0,0", "a,b,c"] {
            assert!(parse_vec3(wrong).is_err(), "{wrong}");
        }
        assert_eq!(parse_fov("60"), Ok(60.0));
        assert!(parse_fov("0").is_err() && parse_fov("180").is_err());
        assert_eq!(parse_timeout(""), Ok(Seconds(GpuOptions::TIMEOUT)));
        assert_eq!(parse_timeout("0.5"), Ok(Seconds(Duration::from_millis(500))));
        for wrong in ["0", "-1", "nan", "inf", "1e300", "1m"] {
            assert!(parse_timeout(wrong).is_err(), "{wrong}");
        }
        assert!(parse_time("0").is_ok() && parse_time("-1").is_err() && parse_time("inf").is_err());
    }

    #[test]
    fn backgrounds() {
        assert_eq!(parse_background("336699"), Ok([0x33, 0x66, 0x99, 0xff]));
        assert_eq!(parse_background("#33669980"), Ok([0x33, 0x66, 0x99, 0x80]));
        for wrong in ["", "369", "33669", "xx6699", "+36699", "3366998"] {
            assert!(parse_background(wrong).is_err(), "{wrong}");
        }
    }
}
