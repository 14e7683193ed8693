//! Do vertices become the primitives of Vulkan's tables, and do the right ones provoke them?

use crate::common::{gpu, on_each_gpu, random::Random};
use tilewright::{
    Buffer, Frame, classic, compute,
    format::{Format, VertexFormat},
    image::Extent,
    pass::{
        BufferRange, Draw, Executor, IndexFormat, Indices, Indirect, IndirectCommand, Pass,
        Pipeline, VertexAttribute, VertexBinding,
    },
    shader::{Shader, Stage},
    state::{Cull, DepthState, PrimitiveKind, ProvokingVertex, Topology},
    target::ColorTarget,
};

const SIDE: u32 = 64;

/// Places are pixels of a square target. The colour is the number of the vertex, from 1.
const VERTEX: &str = "#version 450
    layout(location = 0) in vec2 place;
    layout(location = 0) flat out uint number;
    layout(location = 1) out float shade;
    void main() {
        gl_Position = vec4(place / 32.0 - 1.0, 0.5, 1.0);
        gl_PointSize = 5.0;
        number = gl_VertexIndex + 1;
        shade = float(gl_VertexIndex);
    }";

const FRAGMENT: &str = "#version 450
    layout(location = 0) flat in uint number;
    layout(location = 0) out vec4 written;
    void main() { written = vec4(number, gl_PrimitiveID + 1, gl_FrontFacing, 1.0); }";

fn pipeline(topology: Topology, provoking: ProvokingVertex) -> Pipeline {
    let shader = |stage, text| Shader::from_glsl(stage, "assembly", text).unwrap();
    Pipeline::new("assembly", shader(Stage::Vertex, VERTEX), shader(Stage::Fragment, FRAGMENT))
        .vertex_bindings([VertexBinding::per_vertex(8)])
        .vertex_attributes([VertexAttribute::new(0, 0, VertexFormat::F32X2, 0)])
        .topology(topology)
        .provoking_vertex(provoking)
        .cull(Cull::None)
        .depth(DepthState::OFF)
}

fn draw(places: &[[f32; 2]]) -> Draw {
    let range = BufferRange::host("places", bytemuck::cast_slice(places).to_vec());
    Draw::new(0, places.len() as u32).vertex_buffers([range])
}

fn pass(pipeline: Pipeline, draws: impl IntoIterator<Item = Draw>) -> Pass {
    Pass::new("assembly", Extent::new(SIDE, SIDE))
        .colors([ColorTarget::cleared(Format::Rgba32Float, [0.0; 4])])
        .pipelines([pipeline])
        .draws(draws.into_iter().collect::<Vec<_>>())
}

/// The vertices of primitive `i`, and those that provoke it: first and last. From Vulkan 1.3, chapter 21.1, and from
/// VK_EXT_provoking_vertex.
fn tables(topology: Topology, i: u32) -> (Vec<u32>, [u32; 2]) {
    match topology {
        Topology::PointList => (vec![i], [i, i]),
        Topology::LineList => (vec![2 * i, 2 * i + 1], [2 * i, 2 * i + 1]),
        Topology::LineStrip => (vec![i, i + 1], [i, i + 1]),
        Topology::TriangleList => (vec![3 * i, 3 * i + 1, 3 * i + 2], [3 * i, 3 * i + 2]),
        Topology::TriangleStrip => (vec![i, i + 1, i + 2], [i, i + 2]),
        Topology::TriangleFan => (vec![i + 1, i + 2, 0], [i + 1, i + 2]),
        Topology::LineListWithAdjacency => (vec![4 * i + 1, 4 * i + 2], [4 * i + 1, 4 * i + 2]),
        Topology::LineStripWithAdjacency => (vec![i + 1, i + 2], [i + 1, i + 2]),
        Topology::TriangleListWithAdjacency => {
            (vec![6 * i, 6 * i + 2, 6 * i + 4], [6 * i, 6 * i + 4])
        }
        Topology::TriangleStripWithAdjacency => {
            (vec![2 * i, 2 * i + 2, 2 * i + 4], [2 * i, 2 * i + 4])
        }
        other => panic!("{other:?} is not in the tables"),
    }
}

/// A place for each vertex, so that no two primitives meet in the middle of either.
fn place(topology: Topology, n: u32) -> [f32; 2] {
    let has_pairs = matches!(
        topology,
        Topology::TriangleListWithAdjacency | Topology::TriangleStripWithAdjacency
    );
    let zigzag = if has_pairs { n / 2 } else { n };
    let pixels = match (topology, topology.kind()) {
        (Topology::TriangleFan, _) if n == 0 => [32, 60],
        (Topology::TriangleFan, _) => [5 * n, 10],
        (_, PrimitiveKind::Triangle) => [5 * zigzag, if zigzag % 2 == 0 { 40 } else { 10 }],
        _ => [5 * n, 20],
    };
    pixels.map(|pixels| pixels as f32 + 0.5)
}

#[test]
fn primitives_are_those_of_the_tables() {
    on_each_gpu("primitives are those of the tables", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        for (number, topology) in Topology::ALL.iter().copied().enumerate() {
            for provoking in [ProvokingVertex::First, ProvokingVertex::Last] {
                let places: Vec<_> = (0..12).map(|n| place(topology, n)).collect();
                let pass = pass(pipeline(topology, provoking), [draw(&places)]);
                let frame = compute.render(&pass).unwrap();
                let picture: Vec<_> = frame.colors[0].values().collect();
                let count = topology.primitives(12);
                assert_eq!(count, [4, 10, 10, 2, 4, 12, 6, 11, 3, 9][number], "{topology:?}");
                for i in 0..count {
                    let (vertices, provoked) = tables(topology, i);
                    let sum = vertices
                        .iter()
                        .map(|&n| place(topology, n))
                        .fold([0.0; 2], |a, b| [a[0] + b[0], a[1] + b[1]]);
                    let [x, y] = sum.map(|sum| (sum / vertices.len() as f32) as usize);
                    let [found, primitive, ..] = picture[y * SIDE as usize + x];
                    let expected = provoked[(provoking == ProvokingVertex::Last) as usize] + 1;
                    assert_eq!(
                        [found, primitive],
                        [expected as f32, (i + 1) as f32],
                        "{}, {topology:?}, {provoking:?}, primitive {i}",
                        gpu.info()
                    );
                }
            }
        }
    });
}

/// With indices, instances, and primitives that hide each other.
#[test]
fn primitives_are_those_of_the_device() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    let mut drawn = 0;
    for seed in 17_500..17_560 {
        let mut random = Random::new(seed);
        let topology = Topology::ALL[random.below(Topology::ALL.len())];
        let provoking = [ProvokingVertex::First, ProvokingVertex::Last][random.below(2)];
        let places: Vec<[f32; 2]> =
            (0..40).map(|_| [(); 2].map(|()| random.unit() * 72.0 - 4.0)).collect();
        let mut direct = draw(&places).instances(2);
        if random.below(2) == 0 {
            let indices: Vec<u16> = (0..50).map(|_| random.below(40) as u16).collect();
            let range = BufferRange::host("indices", bytemuck::cast_slice(&indices).to_vec());
            direct = direct.indices(Indices::new(range, IndexFormat::U16));
            direct.count = 50 - random.below(7) as u32;
        } else {
            direct.count = 40 - random.below(7) as u32;
        }
        let pass = pass(pipeline(topology, provoking), [direct]);
        let frames: [Frame; 2] = [compute.render(&pass).unwrap(), classic.render(&pass).unwrap()];
        let what = format!("{topology:?}, {provoking:?}, seed {seed}");
        assert!(frames[0].colors == frames[1].colors, "{what}");
        drawn += frames[0].colors[0].values().filter(|value| value[3] > 0.0).count();
    }
    assert!(drawn > 60_000, "{drawn} pixels are drawn");
}

/// Commands that only the device knows, and draws that are cut into batches.
#[test]
fn primitives_are_the_same_however_they_are_drawn() {
    on_each_gpu("primitives are the same however they are drawn", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let mut random = Random::new(17_600);
        for topology in Topology::ALL.iter().copied() {
            let places: Vec<[f32; 2]> =
                (0..60).map(|_| [(); 2].map(|()| random.unit() * 64.0)).collect();
            let direct = draw(&places).instances(3);
            let commands =
                [IndirectCommand { count: 60, instances: 3, first: 0, first_instance: 0 }];
            let buffer = Buffer::with_content(gpu, "commands", &commands).unwrap();
            let indirect = direct.clone().indirect(Indirect::new(&buffer, 400));
            let pipeline = pipeline(topology, ProvokingVertex::Last);
            let whole = compute.render(&pass(pipeline.clone(), [direct.clone()])).unwrap();
            let of_commands = compute.render(&pass(pipeline.clone(), [indirect])).unwrap();
            assert!(whole.colors == of_commands.colors, "{}, {topology:?}", gpu.info());
            compute.set_batch_limit(tilewright::grid::Capacities {
                primitives: 5,
                ..tilewright::grid::Capacities::DEFAULT
            });
            let cut = compute.render(&pass(pipeline, [direct])).unwrap();
            compute.set_batch_limit(tilewright::grid::Capacities::DEFAULT);
            assert!(whole.colors == cut.colors, "{}, {topology:?} in batches", gpu.info());
        }
    });
}

#[test]
fn classic_takes_one_mode_of_provoking_vertices() {
    let gpu = gpu();
    let places: Vec<_> = (0..6).map(|n| place(Topology::TriangleList, n)).collect();
    let pipelines = [ProvokingVertex::First, ProvokingVertex::Last]
        .map(|provoking| pipeline(Topology::TriangleList, provoking));
    let mut second = draw(&places);
    second.pipeline = 1;
    let pass = pass(pipelines[0].clone(), [draw(&places), second]).pipelines(pipelines);
    let fault = classic::Renderer::new(&gpu).unwrap().render(&pass).unwrap_err().to_string();
    assert!(fault.contains("differ in their provoking vertices"), "{fault}");
    compute::Renderer::new(&gpu).unwrap().render(&pass).unwrap();
}
