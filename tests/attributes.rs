//! Do attributes and varyings reach the user's shaders, however they are laid out and whatever is fetched once for
//! many vertices?

mod formats;

use crate::common::on_each_gpu;
use std::sync::Arc;
use tilewright::{
    bench, classic, compute,
    format::{Format, VertexFormat},
    grid::Capacities,
    image::Extent,
    pass::{
        BufferRange, BufferSource, Draw, Executor, Frame, IndexFormat, Indices, Pass, Pipeline,
        StepRate, VertexAttribute, VertexBinding,
    },
    shader::{Shader, Stage},
    state::DepthState,
    target::{ColorTarget, DepthTarget},
};

/// Cells of the target, one for each instance, and pixels of a cell's edge.
const COLUMNS: u32 = 16;
const ROWS: u32 = 9;
const CELL: u32 = 4;

/// A cell for each instance. Varyings have gaps, an odd number of locations, and locations that nobody reads.
const VERTEX: &str = "#version 450
layout(location = 0) in vec2 corner;
layout(location = 1) in uvec2 place;
layout(location = 2) in vec2 paint;
layout(location = 3) in vec2 tint;
layout(location = 5) in uint shift;
layout(location = 7) in vec3 missing;
layout(location = 0) out vec4 unread;
layout(location = 1) flat out uint number;
layout(location = 3) out vec4 also_unread;
layout(location = 6) out vec2 shade;
layout(location = 9) out vec4 beyond;
void main() {
    vec2 at = (corner + vec2(place)) / vec2(CELLS) * 2.0 - 1.0;
    gl_Position = vec4(at, 0.0, 1.0);
    unread = vec4(corner, 3.0, 4.0);
    also_unread = vec4(5.0);
    beyond = vec4(6.0);
    number = uint(gl_InstanceIndex) + shift;
    shade = paint + tint + missing.xy;
}";

const FRAGMENT: &str = "#version 450
layout(location = 1) flat in uint number;
layout(location = 6) in vec2 shade;
layout(location = 0) out vec4 color;
void main() { color = vec4(float(number) / 255.0, shade, 1.0); }";

fn buffer<T: bytemuck::Pod>(label: &str, content: &[T]) -> BufferRange {
    let bytes = bytemuck::cast_slice(content).to_vec();
    BufferRange::whole(&Arc::new(BufferSource::new(label, bytes)))
}

fn pipeline() -> Pipeline {
    let cells = format!("CELLS {COLUMNS}, {ROWS}");
    let source =
        |text: &str| text.replacen("#version 450", &format!("#version 450\n#define {cells}"), 1);
    let shader = |stage, label: &str, text: &str| {
        Arc::new(Shader::from_glsl(stage, label, &source(text)).unwrap_or_else(|e| panic!("{e}")))
    };
    let attribute =
        |location, binding, format, offset| VertexAttribute { location, binding, format, offset };
    Pipeline::new(
        "cells",
        shader(Stage::Vertex, "cells.vert", VERTEX),
        shader(Stage::Fragment, "cells.frag", FRAGMENT),
    )
    .vertex_bindings([
        VertexBinding { stride: 12, rate: StepRate::Vertex },
        VertexBinding { stride: 7, rate: StepRate::Instance },
        VertexBinding { stride: 0, rate: StepRate::Vertex },
        VertexBinding { stride: 0, rate: StepRate::Instance },
    ])
    .vertex_attributes([
        attribute(0, 0, VertexFormat::F32X2, 4),
        attribute(1, 1, Format::Rg8Uint.into(), 1),
        attribute(2, 1, Format::Rg8Unorm.into(), 5),
        attribute(3, 2, VertexFormat::F32X2, 4),
        attribute(5, 3, Format::R32Uint.into(), 8),
        attribute(7, 2, VertexFormat::F32X2, 12),
    ])
    .depth(DepthState::OFF)
}

/// Red, green and blue of the cell of an instance.
fn expected(instance: u32) -> [u8; 3] {
    [instance as u8 + 3, (instance * 7 % 90) as u8 + 51, (instance * 5 % 60) as u8 + 102]
}

/// The corners of a cell are `apart` vertices from each other; with many, each corner is a vertex slot.
fn pass(apart: usize, depth: DepthState) -> Pass {
    let mut vertices = vec![[0.0f32; 3]; 3 * apart + 2];
    for (n, corner) in [[0.0f32, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].into_iter().enumerate() {
        vertices[n * apart + 1][1..].copy_from_slice(&corner);
    }
    let indices: Vec<u16> = [0, 1, 2, 2, 1, 3].into_iter().map(|n| (n * apart) as u16).collect();
    // The first instances are skipped.
    let count = COLUMNS * ROWS;
    let skipped = [[9u8; 7]; 3];
    let instances = (0..count).map(|n| {
        let [_, green, blue] = expected(n + 3);
        [9, (n % COLUMNS) as u8, (n / COLUMNS) as u8, 9, 9, green - 51, blue - 102]
    });
    let instances: Vec<[u8; 7]> = skipped.into_iter().chain(instances).collect();
    let mut draw = Draw::new(0, 6);
    draw.vertex_buffers = vec![
        buffer("vertices", &vertices),
        buffer("instances", instances.as_flattened()),
        buffer("constants", &[9.0f32, 0.1, 0.2, 0.1, 0.2, 9.0]),
        buffer("shifts", &[9u32, 9, 3, 9]),
    ];
    draw.indices = Some(Indices::new(buffer("indices", &indices), IndexFormat::U16));
    draw.base_vertex = 1;
    draw.instances = count;
    draw.first_instance = 3;
    Pass::new("cells", Extent::new(COLUMNS * CELL, ROWS * CELL))
        .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
        .depth(DepthTarget::cleared(1.0))
        .pipelines([Arc::new(pipeline().depth(depth))])
        .draws([draw])
}

fn check(frame: &Frame, what: &str) {
    for instance in 0..COLUMNS * ROWS {
        let cell = [instance % COLUMNS, instance / COLUMNS].map(|c| c * CELL);
        for pixel in 0..CELL * CELL {
            let (x, y) = (cell[0] + pixel % CELL, cell[1] + pixel / CELL);
            let found = frame.colors[0].texel(x, y);
            let expected = expected(instance + 3);
            let near = found.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 1);
            assert!(near && found[3] == 255, "{what}, {x}, {y}: {found:?}, not {expected:?}");
        }
    }
}

type Both = (compute::Renderer, Option<classic::Renderer>);

fn both((compute, classic): &mut Both, apart: usize, depth: DepthState, primitives: u32) {
    let pass = pass(apart, depth);
    compute.set_batch_limit(Capacities { primitives, ..Capacities::DEFAULT });
    let what = format!("corners {apart} apart, batches of {primitives}, {depth:?}");
    check(&compute.render(&pass).unwrap(), &format!("compute, {what}"));
    if let Some(classic) = classic {
        check(&classic.render(&pass).unwrap(), &what);
    }
}

/// Attributes that are the same for all vertices of an instance are fetched once for each instance. Batches end
/// within instances.
#[test]
fn attributes_per_instance_and_constant_ones_reach_every_vertex() {
    on_each_gpu("attributes per instance and constant ones reach every vertex", |gpu| {
        let classic = gpu.has_graphics().then(|| classic::Renderer::new(gpu).unwrap());
        let executors = &mut (compute::Renderer::new(gpu).unwrap(), classic);
        for apart in [1, 50] {
            for primitives in [5, 64, Capacities::DEFAULT.primitives] {
                both(executors, apart, DepthState::OFF, primitives);
                both(executors, apart, DepthState::LESS, primitives);
            }
        }
    });
}

#[test]
fn what_no_fragment_shader_reads_is_not_stored() {
    let counts = bench::Counts::new(&pass(1, DepthState::LESS)).unwrap();
    // Locations up to the last that is read, for four vertices of each instance.
    assert_eq!(counts.varying_words, u64::from(4 * (6 + 1) * 4 * COLUMNS * ROWS));
}

/// A caller that only shows a picture needs no depth.
#[test]
fn the_colour_alone_is_that_of_the_frame() {
    on_each_gpu("the colour alone is that of the frame", |gpu| {
        let pass = pass(1, DepthState::LESS);
        let mut prepared = compute::Renderer::new(gpu).unwrap().prepare(&pass).unwrap();
        prepared.execute().unwrap();
        let frame = prepared.read().unwrap();
        assert_eq!(prepared.read_color().unwrap(), frame.colors[0]);
        check(&frame, "read");
        let mut prepared = classic::Renderer::new(gpu).unwrap().prepare(&pass).unwrap();
        prepared.execute().unwrap();
        let color = prepared.read_color().unwrap();
        assert_eq!(color, prepared.read().unwrap().colors[0]);
    });
}
