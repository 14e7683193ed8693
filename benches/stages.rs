//! Micro-benchmarks: one stage of one small pass each, by the device's own clock.
//!
//! `cargo bench` measures all stages, `cargo bench -- raster` one of them; `cargo test` runs each once. The names
//! of the stages are read from a frame's timings, not listed here. `tilewright bench` measures whole frames and
//! compares them with the device's own pipeline.
//!
//! Under `cargo test` this file is its own test program and does not use criterion: criterion takes one filter
//! where the test harness takes several, and it refuses options that it does not know.

use criterion::Criterion;
use std::time::Duration;
use tilewright::{
    bench::{self, Axis},
    compute::{Prepared, Renderer},
    image::Extent,
    vk::{Gpu, GpuOptions},
};

/// A name, a scene of the benchmark, and settings that keep it small.
type Small = (&'static str, &'static str, &'static [(Axis, &'static str)]);

const PASSES: [Small; 4] = [
    ("tiny", "sheet", &[(Axis::Area, "1")]),
    ("large", "sheet", &[(Axis::Area, "full"), (Axis::Depth, "8")]),
    ("many", "objects", &[(Axis::Count, "60000")]),
    ("blended", "sheet", &[(Axis::Area, "64"), (Axis::Depth, "4"), (Axis::Blend, "yes")]),
];

const EXTENT: Extent = Extent::new(256, 256);

fn main() {
    let typed = |option: &str| std::env::args().any(|argument| argument == option);
    if typed("--bench") {
        let mut criterion = Criterion::default().configure_from_args();
        each(|name, prepared, stages| measure(&mut criterion, name, prepared, stages));
        criterion.final_summary();
    } else if !typed("--list") {
        let mut passed = 0;
        each(|name, _, stages| {
            assert!(stages.len() > 3, "{name}: {stages:?}");
            passed += 1;
        });
        println!("test result: ok. {passed} passed; 0 failed; 0 ignored");
    }
}

/// Prepares each pass, draws it once, which compiles, and hands it on with the names of its stages.
fn each(mut use_it: impl FnMut(&str, &mut Prepared, &[String])) {
    let gpu = Gpu::open(&GpuOptions::default())
        .unwrap_or_else(|e| panic!("{e}; scripts/setup installs a driver"));
    let mut renderer = Renderer::new(&gpu).unwrap_or_else(|e| panic!("{e}"));
    renderer.time_stages(true);
    for (name, scene, settings) in PASSES {
        let mut recipe = bench::find(scene).expect("a named scene").recipe;
        for (axis, value) in settings {
            recipe.set(*axis, value).unwrap_or_else(|e| panic!("{e}"));
        }
        let pass = bench::pass(name, &recipe, EXTENT).unwrap_or_else(|e| panic!("{e}"));
        let mut prepared = renderer.prepare(&pass).unwrap_or_else(|e| panic!("{e}"));
        let mut stages: Vec<String> = Vec::new();
        for (label, _) in times(&mut prepared) {
            if !stages.contains(&label) {
                stages.push(label);
            }
        }
        use_it(name, &mut prepared, &stages);
    }
}

fn measure(criterion: &mut Criterion, name: &str, prepared: &mut Prepared, stages: &[String]) {
    let mut group = criterion.benchmark_group(name);
    group.sample_size(20).measurement_time(Duration::from_secs(2));
    group.warm_up_time(Duration::from_millis(200));
    for stage in stages {
        group.bench_function(stage, |bencher| {
            bencher.iter_custom(|frames| {
                let of_stage = |(label, ns): (String, u64)| if label == *stage { ns } else { 0 };
                let frame = |_| times(prepared).into_iter().map(of_stage).sum::<u64>();
                Duration::from_nanos((0..frames).map(frame).sum())
            });
        });
    }
}

/// The stages of one frame without the names of shaders, each with its nanoseconds.
fn times(prepared: &mut Prepared) -> Vec<(String, u64)> {
    let timings = prepared.execute().unwrap_or_else(|e| panic!("{e}"));
    let name = |label: &str| label.split(' ').next().unwrap_or(label).to_string();
    // A clock too coarse to see a stage must not stop criterion, which wants time to pass.
    timings.stages.iter().map(|(label, ns)| (name(label), (*ns).max(1))).collect()
}
