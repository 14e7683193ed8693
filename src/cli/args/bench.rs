//! `tilewright bench` as it is typed.

use super::{DeviceArgs, ViewArgs, parse_finite, parse_size};
use crate::image::Extent;
use clap::{Args, Subcommand};
use std::{ffi::OsString, path::PathBuf};

/// The text below the options of `bench --help`.
pub const AFTER_HELP: &str = "\
Without scenes, all named ones are drawn. Each row is one scene at one size: the
pictures are compared, then both executors draw in turns. RATIO is classic time
/ compute time, so that more than 1 means that compute is faster. A verdict is
  INVALID    if the pictures differ: the times mean nothing
  BUSY       if the machine was busy or its speed changed: a line below the row
             gives the reason
  FASTER     if the whole 95 % interval of the ratio is above 1 and the ratio is
             above 1.02
  SLOWER     if the whole interval is below 1 and the ratio is below 1/1.02
  SAME       if the whole interval is between 1/1.02 and 1.02
  AMBIGUOUS  otherwise
The row `everything changes` below a scene's row is a frame for which both
executors get new uniform buffers, descriptor sets and push constants: compute
prepares and executes, classic uploads and records its commands anew.
Options for the camera are for files and built-in scenes.

Rows are written as they are measured. A run that is interrupted keeps them:
`bench show` reads its JSON, also if the end of the file is missing.

Examples:
  tilewright bench
  tilewright bench large small-1m scene.glb builtin:still-life --size 1920x1080 --size 512x512
  tilewright bench --axis area=0.25,1,16,full --axis depth=1,8 --json > area.json
  tilewright bench foliage scene.glb --axis samples=1,4
  tilewright bench large foliage --axis stencil=none,test,write,order
  tilewright bench small-1m --axis lines=no,1,8,bresenham-1,bresenham-8
  tilewright bench --report report.html --budget 600
  tilewright bench large --rounds 100 --warm-up 10 --seed 7
  tilewright bench show results.json --report report.html
  tilewright bench compare before.json after.json
  tilewright bench --list";

#[derive(Debug, Args)]
pub struct BenchArgs {
    #[command(subcommand)]
    pub verb: Option<BenchVerb>,
    /// Named scenes (--list), .gltf, .glb and .obj files, `builtin:NAME` [default: all named scenes
    /// except `sheet`; with --axis, only `sheet`]
    #[arg(value_name = "SCENE")]
    pub scenes: Vec<OsString>,
    /// Pixels across and down; can be given several times [default: 1920x1080]
    #[arg(long, value_name = "WxH", value_parser = parse_size, allow_hyphen_values = true)]
    pub size: Vec<Extent>,
    /// Vary generated scenes along an axis (--list); several axes give every combination of their values.
    /// `samples` varies files and built-in scenes too
    #[arg(long, value_name = "NAME=A,B,C")]
    pub axis: Vec<String>,
    /// About how many seconds the whole run may take; rows that do not fit are left out and listed
    #[arg(long, value_name = "SECONDS", value_parser = parse_budget)]
    pub budget: Option<f32>,
    /// Rounds of a row, in each of which both executors draw a frame [default: 6 to 200, until the
    /// ratio is known within 1 %, or 3 seconds have passed]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub rounds: Option<u32>,
    /// Frames that each executor draws before the first round
    #[arg(long, value_name = "N", default_value_t = 2, value_parser = clap::value_parser!(u32).range(0..=100_000))]
    pub warm_up: u32,
    /// Seed of the generated scenes' random numbers
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u64,
    /// List scenes and axes
    #[arg(long, conflicts_with_all = ["scenes", "size", "axis", "budget", "rounds"])]
    pub list: bool,
    /// Measure warm frames alone: leave out `everything changes`, and the first frames and the memory,
    /// which take processes of their own
    #[arg(long)]
    pub warm_only: bool,
    /// Print JSON instead of a table
    #[arg(long, conflicts_with = "csv")]
    pub json: bool,
    /// Print comma-separated values instead of a table
    #[arg(long)]
    pub csv: bool,
    /// Write a page with tables, bars and curves, anew after each row; without scenes, the crossover is
    /// measured too
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
    #[command(flatten)]
    pub view: ViewArgs,
    #[command(flatten)]
    pub device: DeviceArgs,
}

#[derive(Debug, Subcommand)]
pub enum BenchVerb {
    /// Compare two results of --json
    #[command(after_help = "\
A change is the later ratio / the earlier ratio: more than 1 means that compute
became faster, measured against classic. Rows that hold the very same samples
are SAME. Results of schema versions 1 and 2 can be compared.

Example:
  tilewright bench compare before.json after.json")]
    Compare(BenchCompareArgs),
    /// Show results of --json again, as a table, as CSV or as a page
    #[command(after_help = "\
Results whose end is missing are shown as far as they go: a run that was killed
leaves such a file.

Examples:
  tilewright bench show results.json
  tilewright bench show results.json --report report.html")]
    Show(BenchShowArgs),
}

#[derive(Debug, Args)]
pub struct BenchCompareArgs {
    /// The earlier results
    #[arg(value_name = "A.json")]
    pub before: PathBuf,
    /// The later results
    #[arg(value_name = "B.json")]
    pub after: PathBuf,
    /// Print JSON instead of a table
    #[arg(long)]
    pub json: bool,
}

#[derive(Debug, Args)]
pub struct BenchShowArgs {
    /// The results
    #[arg(value_name = "RESULTS.json")]
    pub results: PathBuf,
    /// Print comma-separated values instead of a table
    #[arg(long)]
    pub csv: bool,
    /// Write a page with tables, bars and curves
    #[arg(long, value_name = "FILE.html")]
    pub report: Option<PathBuf>,
}

fn parse_budget(text: &str) -> Result<f32, String> {
    parse_finite(text)
        .map(|seconds| seconds as f32)
        .filter(|&seconds| seconds > 0.0 && seconds.is_finite())
        .ok_or_else(|| "expected seconds, more than 0, like 60".into())
}
