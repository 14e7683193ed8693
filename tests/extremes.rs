//! Do all executors take the largest numbers that a draw can have, and refuse the same ones?

use crate::{
    common::{gpu, random::Random},
    twin::difference,
};
use std::sync::Arc;
use tilewright::{
    Error, classic, compare, compute,
    format::{Format, VertexFormat},
    grid::Capacities,
    image::Extent,
    pass::{
        BindingEntry, BindingSet, BufferRange, BufferSource, Draw, Executor, IndexFormat,
        IndexRanges, Indices, Pass, Pipeline, StepRate, VertexAttribute, VertexBinding,
    },
    plan::{Plan, Slots},
    shader::{Shader, Stage},
    state::{DepthState, Topology},
};

/// Draws of more primitives than this are planned and checked, not drawn.
const DRAWN: u64 = 2000;
/// Draws for which the id pass is made.
const INSTANCES: u32 = 2000;

/// Slots of a table that nobody fills.
struct NoSlots;

impl Slots for NoSlots {
    fn buffer(&mut self, _: &Arc<BufferSource>) -> tilewright::Result<u32> {
        Ok(0)
    }
    fn bindings(
        &mut self,
        _: &Arc<BindingSet>,
        _: &BindingEntry,
        _: u32,
    ) -> tilewright::Result<u32> {
        Ok(0)
    }
    fn push_constants(&mut self, _: &[u8]) -> tilewright::Result<u32> {
        Ok(0)
    }
    fn is_full(&self) -> bool {
        false
    }
    fn next_table(&mut self) -> tilewright::Result<()> {
        Ok(())
    }
    fn table(&self) -> usize {
        0
    }
    fn is_shared(&self) -> bool {
        false
    }
}

fn shaders() -> [Arc<Shader>; 2] {
    let vertex = "#version 450
layout(location = 0) in vec4 nudge;
layout(location = 1) in uint shade;
layout(location = 0) flat out uint value;
void main() {
    uint corner = uint(gl_VertexIndex) % 3u, instance = uint(gl_InstanceIndex) % 5u;
    gl_Position = vec4(corner == 1u ? 1.0 : -1.0, corner == 2u ? 1.0 : -1.0, float(instance) / 8.0, 1.0) + nudge;
    value = shade + uint(gl_VertexIndex) * 7u + uint(gl_InstanceIndex) * 31u;
}";
    let fragment = "#version 450
layout(location = 0) flat in uint value;
layout(location = 0) out vec4 color;
void main() { color = vec4(value & 255u, (value >> 8) & 255u, gl_PrimitiveID & 255, 255) / 255.0; }";
    [(Stage::Vertex, "extreme.vert", vertex), (Stage::Fragment, "extreme.frag", fragment)]
        .map(|(stage, label, source)| Arc::new(Shader::from_glsl(stage, label, source).unwrap()))
}

/// A number near 0, the largest of its kind, or a power of two.
fn extreme(random: &mut Random) -> u32 {
    let near = random.below(5) as u32;
    match random.below(5) {
        0 => u32::MAX - near,
        1 => (i32::MAX as u32 - 2).wrapping_add(near),
        2 => (1 << random.below(32)) + near % 2,
        3 => random.bits() as u32,
        _ => near,
    }
}

/// One that is mostly such that a draw can be good.
fn modest(random: &mut Random) -> u32 {
    if random.below(4) == 0 { extreme(random) } else { random.below(10) as u32 }
}

fn range(random: &mut Random, buffer: &Arc<BufferSource>) -> BufferRange {
    let whole = BufferRange::whole(buffer);
    match random.below(40) {
        0 => BufferRange { offset: usize::MAX - random.below(9), ..whole },
        1 => BufferRange { bytes: usize::MAX - random.below(9), ..whole },
        2 => BufferRange { bytes: random.below(64), ..whole },
        3 => BufferRange { offset: whole.bytes, bytes: 0, ..whole },
        4 => BufferRange { offset: 16, bytes: whole.bytes - 16, ..whole },
        _ => whole,
    }
}

fn pass(seed: u64, shaders: &[Arc<Shader>; 2]) -> Pass {
    let random = &mut Random::new(seed);
    let stride = |random: &mut Random, often: u32| match random.below(16) {
        0 => extreme(random),
        1 => 2048,
        2 | 3 => often,
        _ => 0,
    };
    let rate = [StepRate::Vertex, StepRate::Instance];
    let attribute =
        |location, format, offset| VertexAttribute { location, binding: location, format, offset };
    let word = VertexFormat::from(Format::R32Uint);
    let offset = if random.below(20) == 0 { extreme(random) } else { 4 * random.below(3) as u32 };
    let pipeline = Pipeline::new("extreme", shaders[0].clone(), shaders[1].clone())
        .vertex_bindings([
            VertexBinding { stride: stride(random, 16), rate: rate[random.below(2)] },
            VertexBinding { stride: stride(random, 4), rate: rate[random.below(2)] },
        ])
        .vertex_attributes([attribute(0, VertexFormat::F32X4, 0), attribute(1, word, offset)])
        .topology(
            [Topology::TriangleList, Topology::TriangleStrip, Topology::TriangleFan]
                [random.below(3)],
        )
        .depth(DepthState::OFF);
    let buffer = |label: &str, bytes: Vec<u8>| Arc::new(BufferSource::new(label, bytes));
    let nudges = buffer("nudges", vec![0; 4096]);
    let shades = buffer("shades", (0..4096u32).map(|i| (i * 37) as u8).collect());
    let mut draw = Draw::new(0, modest(random))
        .vertex_buffers([range(random, &nudges), range(random, &shades)])
        .first(extreme(random))
        .base_vertex([1, i32::MAX, i32::MIN, -3, 0, 0, 0, 0, 0, 0][random.below(10)])
        .first_instance([0, 1, u32::MAX - 9, extreme(random)][random.below(4)])
        .instances(modest(random));
    if random.below(2) == 0 {
        let wide = random.below(2) == 0;
        let top = if wide { u32::MAX } else { u16::MAX.into() };
        let values: Vec<u32> = (0..16)
            .map(|_| if random.below(3) == 0 { extreme(random).min(top) } else { 3 })
            .collect();
        let bytes = match wide {
            true => bytemuck::cast_slice(&values).to_vec(),
            false => values.iter().flat_map(|&v| (v as u16).to_le_bytes()).collect(),
        };
        let format = if wide { IndexFormat::U32 } else { IndexFormat::U16 };
        draw.first = modest(random);
        draw.indices = Some(Indices::new(range(random, &buffer("indices", bytes)), format));
    }
    let mut pass = Pass::new(&format!("seed {seed}"), Extent::new(16, 16));
    pass.colors[0].format = Format::Rgba8Unorm;
    pass.pipelines.push(Arc::new(pipeline));
    pass.draws.push(draw);
    pass
}

#[test]
fn executors_agree_on_the_largest_numbers() {
    let gpu = gpu();
    let shaders = shaders();
    let mut by_compute = compute::Renderer::new(&gpu).unwrap();
    let mut by_classic = classic::Renderer::new(&gpu).unwrap();
    let (mut drawn, mut refused, mut planned, mut seen) = (0, 0, 0, 0);
    for seed in 0..1500 {
        let pass = pass(seed, &shaders);
        println!("seed {seed}: {:?}", pass.draws[0]);
        let draw = &pass.draws[0];
        let of_one = pass.pipelines[0].topology.primitives(draw.count);
        let primitives = u64::from(of_one) * u64::from(draw.instances);
        if let Err(verdict) = pass.validate() {
            assert!(matches!(verdict, Error::Usage(_)), "seed {seed}: {verdict}");
            let said = |error: Option<Error>| error.map(|error| error.to_string());
            let verdict = Some(verdict.to_string());
            assert_eq!(said(by_compute.prepare(&pass).err()), verdict, "seed {seed}");
            assert_eq!(said(by_classic.prepare(&pass).err()), verdict, "seed {seed}");
            refused += 1;
        } else if primitives > DRAWN {
            let mut ranges = IndexRanges::default();
            Plan::new(&pass, Capacities::MOST, &mut ranges, &mut NoSlots).unwrap();
            planned += 1;
        } else {
            let compute = by_compute.render(&pass).unwrap();
            let classic = by_classic.render(&pass).unwrap();
            assert!(compute.colors[0] == classic.colors[0], "seed {seed}: the pictures differ");
            let found = difference(&mut by_compute, &pass, &mut seen);
            assert_eq!(found, None, "seed {seed}");
            drawn += usize::from(primitives > 0);
        }
        // Whatever the verdict, an id pass is made or refused.
        if draw.instances <= INSTANCES || of_one == 0 {
            let _ = compare::id_pass(&pass);
        }
    }
    assert!(drawn > 100 && refused > 100 && planned > 10, "{drawn}, {refused}, {planned}");
    assert!(seen > 1000, "{seen} pixels");
}
