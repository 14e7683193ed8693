//! Is anything too much? Passes that bind more than a resource table holds, and buffers longer than one binding
//! reaches, give the same picture as small ones.

use crate::common::{self, on_each_gpu, open_with, random::Random};
use std::sync::Arc;
use tilewright::{
    Error, compute,
    format::VertexFormat,
    image::Extent,
    pass::{
        BufferRange, BufferSource, Draw, IndexFormat, Indices, Pass, Pipeline, StepRate,
        VertexAttribute, VertexBinding,
    },
    reference,
    shader::{Shader, Stage},
    vk::{GpuOptions, TableSizes},
};

const VERTEX: &str = "#version 450
layout(location = 0) in vec3 position;
layout(push_constant) uniform Push { vec4 color; vec2 offset; };
void main() { gl_Position = vec4(position.xy * 0.2 + offset, position.z, 1); }";

const FRAGMENT: &str = "#version 450
layout(push_constant) uniform Push { vec4 color; vec2 offset; };
layout(location = 0) out vec4 target;
void main() { target = color; }";

fn pass(label: &str) -> Pass {
    let shader = |stage, name: &str, source| {
        Arc::new(Shader::from_glsl(stage, name, source).expect("a valid shader"))
    };
    let pipeline = Pipeline::new(
        "large",
        shader(Stage::Vertex, "large.vert", VERTEX),
        shader(Stage::Fragment, "large.frag", FRAGMENT),
    )
    .vertex_bindings([VertexBinding { stride: 12, rate: StepRate::Vertex }])
    .vertex_attributes([VertexAttribute {
        location: 0,
        binding: 0,
        format: VertexFormat::F32X3,
        offset: 0,
    }]);
    Pass::new(label, Extent::new(150, 90)).pipelines([pipeline])
}

fn buffer(label: &str, bytes: Vec<u8>) -> Arc<BufferSource> {
    Arc::new(BufferSource::new(label, bytes))
}

fn push_constants(random: &mut Random) -> Vec<u8> {
    let mut words = [0f32; 6].map(|_| random.unit());
    words[4] = 2.0 * words[4] - 1.0;
    words[5] = 2.0 * words[5] - 1.0;
    bytemuck::cast_slice(&words).to_vec()
}

fn vertices(random: &mut Random, count: usize) -> Vec<f32> {
    (0..3 * count).map(|i| if i % 3 == 2 { random.unit() } else { random.signed() }).collect()
}

#[test]
fn a_pass_may_bind_more_than_a_table_holds() {
    let mut random = Random::new(1);
    let mut pass = pass("many blocks");
    for n in 0..100 {
        let mesh = vertices(&mut random, 9);
        let bytes = bytemuck::cast_slice(&mesh).to_vec();
        let mut draw = Draw::new(0, 9);
        // Some meshes are shared with the draw before, which may be of another table.
        let shared = pass.draws.last().filter(|_| n % 3 == 0);
        draw.vertex_buffers = match shared {
            Some(before) => before.vertex_buffers.clone(),
            None => vec![BufferRange::whole(&buffer("mesh", bytes))],
        };
        draw.push_constants = push_constants(&mut random);
        pass.draws.push(draw);
    }
    let expected = {
        let gpu = common::gpu();
        compute::Renderer::new(&gpu).and_then(|mut r| r.render(&pass)).expect("it is drawn")
    };
    let small = |buffers| {
        let table = TableSizes { buffers, ..TableSizes::default() };
        let device = Some(common::device_under_test().index.to_string());
        open_with(GpuOptions::default().device(device).table(table))
    };
    for buffers in [2, 3, 17, 101] {
        let gpu = small(buffers);
        let mut renderer = compute::Renderer::new(&gpu).expect("kernels are made");
        let frame = renderer.render(&pass).expect("it is drawn");
        assert!(
            frame.colors[0] == expected.colors[0],
            "colours depend on a table of {buffers} buffers"
        );
        assert!(frame.depth == expected.depth, "depths depend on a table of {buffers} buffers");
        let (traced, trace) = renderer.trace(&pass).expect("it is drawn");
        assert!(traced.colors[0] == expected.colors[0], "traced with a table of {buffers} buffers");
        let found = reference::first_difference(&pass, &trace);
        assert_eq!(found, None, "traced with a table of {buffers} buffers");
        let tables = renderer.cached().tables;
        assert!(tables >= 130 / buffers as usize, "{tables} tables of {buffers} buffers");
    }
    // All resources of one draw have to be in one table.
    let gpu = small(1);
    let refused = compute::Renderer::new(&gpu).and_then(|mut r| r.render(&pass)).err();
    let Some(Error::Full(said)) = refused else { panic!("{refused:?}") };
    assert!(said.contains("1 buffers, all taken"), "{said}");
}

#[test]
fn vertices_and_indices_may_be_far_into_a_buffer() {
    // One byte more is another slot of the table; elements lie on both sides.
    const WINDOW: usize = 1 << tilewright::abi::WINDOW_LOG2;
    on_each_gpu("long buffers", |gpu| {
        let mut random = Random::new(2);
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        let mut pass = pass("long buffers");
        const USED: usize = 240;
        let mesh = vertices(&mut random, USED);
        let indices: Vec<u16> = (0..USED).map(|_| random.below(USED) as u16).collect();
        // `bytes`, half of them beyond the first window, and the element where they begin. An element
        // of 12 bytes crosses the border.
        let far = |label: &str, bytes: &[u8], element: usize| {
            let first = (WINDOW - bytes.len() / 2) / element;
            let mut long = vec![0u8; first * element];
            long.extend_from_slice(bytes);
            assert!(long.len() > WINDOW);
            (buffer(label, long), first as u32)
        };
        let mut frame = |vertices: (Arc<BufferSource>, u32), indices: (Arc<BufferSource>, u32)| {
            let mut random = Random::new(3);
            let mut indexed = Draw::new(0, USED as u32);
            indexed.vertex_buffers = vec![BufferRange::whole(&vertices.0)];
            indexed.push_constants = push_constants(&mut random);
            let mut plain = indexed.clone().first(vertices.1);
            plain.push_constants = push_constants(&mut random);
            indexed.indices = Some(Indices::new(BufferRange::whole(&indices.0), IndexFormat::U16));
            indexed.first = indices.1;
            indexed.base_vertex = vertices.1 as i32;
            pass.draws = vec![indexed, plain];
            renderer.render(&pass).expect("it is drawn")
        };
        let (mesh, indices) = (bytemuck::cast_slice(&mesh), bytemuck::cast_slice(&indices));
        let near =
            frame((buffer("mesh", mesh.to_vec()), 0), (buffer("indices", indices.to_vec()), 0));
        let far = frame(far("mesh", mesh, 12), far("indices", indices, 2));
        assert!(far.depth == near.depth, "depths depend on where vertices are");
        assert!(far.colors[0] == near.colors[0], "colours depend on where vertices are");
        let drawn = near.colors[0].bytes.chunks_exact(4).filter(|texel| texel[3] != 0).count();
        assert!(drawn > 500, "only {drawn} pixels are drawn");
    });
}
