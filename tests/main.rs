//! The test suite: one binary, one module for each question it answers.

mod adopt;
mod assembly;
mod attributes;
mod bench;
mod blocks;
mod classic;
mod cli;
mod colors;
mod common;
mod compile;
mod depth_bias;
mod depth_clamp;
mod depth_formats;
mod devices;
mod distances;
mod examples;
mod extremes;
mod formats;
mod frames;
mod golden;
mod images;
mod indirect;
mod interpolation;
mod kept;
mod kernels;
mod known_issues;
mod large;
mod lines;
mod live;
mod mutation;
mod parity;
mod pass;
mod property;
mod readme;
mod regression;
mod replaced;
mod resource_arrays;
mod samplers;
mod samples;
mod scene;
mod second_source;
mod setup;
mod specialized;
mod splice;
mod stencil;
mod storage_images;
mod tables;
mod targets;
mod textures;
mod tidy;
mod twin;
mod vk;

use std::io::Write as _;

/// Says that a case cannot run on this machine, and what it would take. Written past the harness's
/// capture, so that a passing run shows it and `./check` can list what was left out.
#[allow(dead_code)]
pub fn did_not_run(case: &str, needs: &str) {
    // A closed stderr is no reason to fail a test.
    let _ = writeln!(std::io::stderr(), "did not run: {case}: {needs}");
}
