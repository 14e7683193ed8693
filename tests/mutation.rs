//! Does a damaged module crash anything? Words of valid modules are changed at random. Modules that the validator
//! still accepts are drawn: the result is an error or a picture, and the process lives.
//!
//! `MUTATIONS=20000 MUTATION_SEED=1` asks for more of them, from another seed.

use crate::common::{open_with, random::Random};
use std::sync::Arc;
use tilewright::{
    classic, compute,
    image::Extent,
    pass::{Draw, Executor, Pass, Pipeline},
    shader::{Shader, Stage},
    vk::GpuOptions,
};

const VERTEX: &str = "#version 450
layout(location = 0) out vec4 color;
layout(constant_id = 3) const int scale = 2;
void main() {
    vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * float(scale);
    color = vec4(corner, 0.25, 1.0);
    for (int i = 0; i < 3; i++) color.z += sin(corner.x * float(i));
    gl_Position = vec4(corner * 2.0 - 1.0, 0.5, 1.0);
}";

const FRAGMENT: &str = "#version 450
layout(location = 0) in vec4 color;
layout(location = 0) out vec4 result;
vec3 turn(vec3 v, int n) { return n > 1 ? v.zxy : v.yxz; }
void main() {
    if (color.x > 0.75) discard;
    float table[4] = float[](0.0, 0.25, 0.5, 1.0);
    result = vec4(turn(color.rgb, int(gl_FragCoord.x) & 3), table[int(gl_FragCoord.y) & 3]);
    result.x += fwidth(color.y);
}";

fn number(variable: &str, default: u64) -> u64 {
    std::env::var(variable).ok().and_then(|text| text.parse().ok()).unwrap_or(default)
}

#[test]
fn damaged_modules_are_errors_or_pictures() {
    let (count, seed) = (number("MUTATIONS", 200), number("MUTATION_SEED", 1));
    println!("{count} mutations from seed {seed}");
    // The layer would stop modules that the validator accepts; this test is about the driver.
    let gpu = open_with(GpuOptions::default());
    let modules = [(Stage::Vertex, VERTEX), (Stage::Fragment, FRAGMENT)]
        .map(|(stage, source)| Shader::from_glsl(stage, "whole", source).expect("a valid shader"));
    let mut compute = compute::Renderer::new(&gpu).expect("a renderer");
    let mut classic = classic::Renderer::new(&gpu).expect("a renderer");
    let mut random = Random::new(seed);
    let (mut valid, mut drawn) = (0, 0);
    for round in 0..count {
        let which = random.below(2);
        let mut words = modules[which].spirv().to_vec();
        let at = 5 + random.below(words.len() - 5);
        words[at] = match random.below(4) {
            0 => words[5 + random.below(words.len() - 5)],
            1 => words[at].wrapping_add(1),
            2 => words[at] ^ (1 << random.below(32)),
            _ => random.below(300) as u32,
        };
        let Ok(damaged) = Shader::from_spirv(modules[which].stage(), "damaged", &words) else {
            continue;
        };
        valid += 1;
        let mut pair = modules.clone().map(Arc::new);
        pair[which] = Arc::new(damaged);
        let [vertex, fragment] = pair;
        let mut pass = Pass::new("damaged", Extent::new(8, 8));
        pass.pipelines.push(Arc::new(Pipeline::new("damaged", vertex, fragment)));
        pass.draws.push(Draw::new(0, 3));
        let (compute, classic) = (compute.render(&pass), classic.render(&pass));
        drawn += u64::from(compute.is_ok()) + u64::from(classic.is_ok());
        if round % 1000 == 0 {
            println!("{round}: word {at}");
        }
    }
    gpu.expect_messages();
    println!("{valid} valid, {drawn} pictures of them");
    assert!(
        valid * 20 > count && drawn > valid,
        "the mutations reach the drivers: {valid}, {drawn}"
    );
}
