//! Do buffers that live on a device serve a pass as those of the host do, whoever writes them?

use crate::{
    common::{gpu, kernel_spirv, on_each_gpu, random::Random, swiftshader},
    twin,
};
use std::{collections::HashMap, sync::Arc};
use tilewright::{
    Error, classic, compute,
    format::VertexFormat,
    grid::Capacities,
    image::Extent,
    pass::{
        Binding, BindingEntry, BindingSet, BufferRange, BufferSource, Draw, Executor, Frame,
        IndexFormat, Indices, Pass, Pipeline, StepRate, VertexAttribute, VertexBinding,
    },
    reference,
    shader::{Shader, Stage},
    vk::{self, Gpu, Kernel, KernelInfo, Memory, Recorder},
};

/// `content` in memory that only the device reaches.
fn device_buffer<T: bytemuck::Pod>(gpu: &Gpu, name: &str, content: &[T]) -> vk::Buffer<T> {
    let buffer = vk::Buffer::new(gpu, name, content.len(), Memory::Device).unwrap();
    let mut recorder = Recorder::new(gpu, "upload").unwrap();
    recorder.upload(&buffer, content).unwrap();
    recorder.submit().unwrap();
    buffer
}

/// `pass` with all its vertices and indices on the device; draws share buffers as before.
fn moved(gpu: &Gpu, pass: &Pass) -> Pass {
    let mut known: HashMap<*const BufferSource, Arc<BufferSource>> = HashMap::new();
    let mut pass = pass.clone();
    for draw in &mut pass.draws {
        let indices = draw.indices.iter_mut().map(|indices| &mut indices.range);
        for range in draw.vertex_buffers.iter_mut().chain(indices) {
            let there = known.entry(Arc::as_ptr(&range.buffer)).or_insert_with(|| {
                let bytes = range.buffer.host_bytes().unwrap();
                // A slice of a larger buffer: what lies before it is not part of the pass.
                let all = [&[0x5a; 256][..], bytes].concat();
                let there = device_buffer(gpu, range.buffer.label(), &all);
                Arc::new(BufferSource::on_device(&there.slice(256..all.len()).unwrap()))
            });
            range.buffer = there.clone();
        }
    }
    pass
}

/// The smallest and the largest of the indices that `draw` reads.
fn extent(draw: &Draw) -> std::ops::RangeInclusive<u32> {
    let indices = draw.indices.as_ref().unwrap();
    let bytes = indices.range.host_bytes().unwrap();
    let all: Vec<u32> = match indices.format {
        IndexFormat::U16 => {
            bytemuck::pod_collect_to_vec::<u8, u16>(bytes).into_iter().map(u32::from).collect()
        }
        IndexFormat::U32 => bytemuck::pod_collect_to_vec(bytes),
        other => panic!("{other:?}"),
    };
    let read = &all[draw.first as usize..][..draw.count as usize];
    *read.iter().min().unwrap()..=*read.iter().max().unwrap()
}

fn same(a: &Frame, b: &Frame) -> bool {
    a.colors[0] == b.colors[0]
        && a.depth.as_ref().map(|d| &d.bytes) == b.depth.as_ref().map(|d| &d.bytes)
}

/// Nobody on the host knows the indices: each corner gets a vertex of its own, or the caller declares the range. The
/// picture is the same to the byte, and so is every intermediate that has a twin.
#[test]
fn buffers_of_a_device_draw_as_those_of_the_host() {
    on_each_gpu("buffers of a device draw as those of the host", |gpu| {
        let shaders = twin::shaders();
        let mut compute = compute::Renderer::new(gpu).unwrap();
        // SwiftShader's own raster stage does not end for some of these meshes, also if they lie on the host.
        let ends = gpu.has_graphics() && !gpu.info().name.contains("SwiftShader");
        let mut classic = ends.then(|| classic::Renderer::new(gpu).unwrap());
        for seed in 5000..5016 {
            let primitives = 1 << (5 + seed % 6);
            compute.set_batch_limit(Capacities {
                primitives,
                vertices: 3 * primitives,
                varying_words: 1 << 16,
            });
            let host = twin::random_pass(seed, &shaders);
            let expected = compute.render(&host).unwrap();
            let mut there = moved(gpu, &host);
            for way in ["unknown", "declared"] {
                if way == "declared" {
                    for (draw, known) in there.draws.iter_mut().zip(&host.draws) {
                        if let Some(indices) = &mut draw.indices {
                            indices.vertices = Some(extent(known));
                        }
                    }
                }
                let what = format!("{}, seed {seed}, {way} indices", gpu.info());
                let (frame, trace) = compute.trace(&there).unwrap();
                assert!(same(&frame, &expected), "{what}: traced");
                if let Some(found) = reference::first_difference(&there, &trace) {
                    panic!("{what}: {found}");
                }
                assert!(same(&compute.render(&there).unwrap(), &expected), "{what}: rendered");
                if let Some(classic) = &mut classic {
                    let expected = classic.render(&host).unwrap();
                    assert!(same(&classic.render(&there).unwrap(), &expected), "{what}: classic");
                }
            }
            assert_eq!(there.snapshot().unwrap().draws.len(), host.draws.len());
        }
    });
}

/// A device may find anything in its indices. Nothing outside the buffers is reached, also if the caller declares a
/// range that is not true.
#[test]
fn wild_indices_reach_nothing_else() {
    on_each_gpu("wild indices reach nothing else", |gpu| {
        let shaders = twin::shaders();
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let ends = gpu.has_graphics() && !gpu.info().name.contains("SwiftShader");
        let mut classic = ends.then(|| classic::Renderer::new(gpu).unwrap());
        for seed in 6000..6012 {
            let mut random = Random::new(seed);
            let host = twin::random_pass(seed, &shaders);
            let mut pass = moved(gpu, &host);
            for draw in &mut pass.draws {
                let wild: Vec<u32> = (0..300)
                    .map(|_| match random.below(3) {
                        0 => random.bits() as u32,
                        1 => u32::MAX - random.below(4) as u32,
                        _ => random.below(70) as u32,
                    })
                    .collect();
                let range = BufferRange::on_device(&device_buffer(gpu, "wild", &wild));
                let format = [IndexFormat::U16, IndexFormat::U32][random.below(2)];
                draw.indices = Some(Indices::new(range, format));
                (draw.first, draw.count) = (random.below(3) as u32, 3 + random.below(250) as u32);
                draw.base_vertex = [0, 5, -70, i32::MAX, i32::MIN][random.below(5)];
            }
            compute.render(&pass).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
            if let Some(classic) = &mut classic {
                classic.render(&pass).unwrap_or_else(|e| panic!("seed {seed}, classic: {e}"));
            }
            for draw in &mut pass.draws {
                draw.base_vertex = 0;
                let bound = draw.vertex_buffers[0].bytes as u32 / 16;
                let first = random.below(bound as usize) as u32;
                let indices = draw.indices.as_mut().unwrap();
                indices.vertices =
                    Some(first..=first + random.below((bound - first) as usize) as u32);
            }
            compute.render(&pass).unwrap_or_else(|e| panic!("seed {seed}, declared: {e}"));
        }
    });
}

const QUADS: &str = "#version 460
layout(local_size_x = 1) in;
layout(std430, binding = 0) writeonly buffer Vertices { vec2 vertices[]; };
layout(std430, binding = 1) writeonly buffer Indices { uint indices[]; };
layout(push_constant) uniform Push { uint column; };
void main() {
    for (uint i = 0u; i < 4u; i++) {
        vec2 corner = vec2(column + (i & 1u), i >> 1) / vec2(8.0, 1.0);
        vertices[7u * i] = corner * 2.0 - 1.0;
    }
    for (uint i = 0u; i < 6u; i++) indices[i] = 7u * (i < 3u ? i : i - 2u);
}";

const PLAIN: &str = "#version 450
layout(location = 0) in vec2 corner;
void main() { gl_Position = vec4(corner, 0.5, 1.0); }";

const WHITE: &str = "#version 450
layout(location = 0) out vec4 color;
void main() { color = vec4(1.0); }";

fn shader(stage: Stage, label: &str, source: &str) -> Arc<Shader> {
    Arc::new(Shader::from_glsl(stage, label, source).unwrap())
}

fn plain_pipeline(fragment: &str) -> Arc<Pipeline> {
    let vertex = shader(Stage::Vertex, "plain.vert", PLAIN);
    Arc::new(
        Pipeline::new("plain", vertex, shader(Stage::Fragment, "plain.frag", fragment))
            .vertex_bindings([VertexBinding { stride: 8, rate: StepRate::Vertex }])
            .vertex_attributes([VertexAttribute {
                location: 0,
                binding: 0,
                format: VertexFormat::F32X2,
                offset: 0,
            }]),
    )
}

/// A kernel of the user writes vertices and indices; a pass that was prepared once draws what it finds each time.
#[test]
fn a_prepared_pass_draws_what_a_kernel_wrote() {
    on_each_gpu("a prepared pass draws what a kernel wrote", |gpu| {
        let spirv = kernel_spirv(QUADS);
        let kernel = Kernel::new(gpu, &KernelInfo::new("quads", &spirv)).unwrap();
        let vertices = vk::Buffer::<[f32; 2]>::new(gpu, "vertices", 22, Memory::Device).unwrap();
        let indices = vk::Buffer::<u32>::new(gpu, "indices", 6, Memory::Device).unwrap();
        let mut pass = Pass::new("quads", Extent::new(8, 4));
        pass.pipelines.push(plain_pipeline(WHITE));
        pass.draws.push(
            Draw::new(0, 6)
                .vertex_buffers([BufferRange::on_device(&vertices)])
                .indices(Indices::new(BufferRange::on_device(&indices), IndexFormat::U32)),
        );
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let mut compute = compute.prepare(&pass).unwrap();
        let mut classic = classic::Renderer::new(gpu).unwrap();
        let mut classic = gpu.has_graphics().then(|| classic.prepare(&pass).unwrap());
        for column in [5u32, 0, 7, 2] {
            let mut recorder = Recorder::new(gpu, "quads").unwrap();
            let dispatch =
                recorder.kernel(&kernel).bind("Vertices", &vertices).bind("Indices", &indices);
            dispatch.push(&column).dispatch([1, 1, 1]).unwrap();
            recorder.submit().unwrap();
            compute.execute().unwrap();
            let mut frames = vec![compute.read().unwrap()];
            if let Some(classic) = &mut classic {
                classic.execute().unwrap();
                frames.push(classic.read().unwrap());
            }
            for frame in frames {
                for (x, y) in (0..8).flat_map(|x| (0..4).map(move |y| (x, y))) {
                    let expected = if x == column { [255; 4] } else { [0; 4] };
                    assert_eq!(
                        frame.colors[0].texel(x, y),
                        expected,
                        "column {column}, ({x}, {y})"
                    );
                }
            }
        }
    });
}

const COUNT: &str = "#version 450
layout(std430, binding = 0) buffer Counts { uint counts[]; };
layout(location = 0) out vec4 color;
void main() { atomicAdd(counts[uint(gl_FragCoord.x)], 1u); color = vec4(1.0); }";

const READ: &str = "#version 450
layout(std430, binding = 0) readonly buffer Counts { uint counts[]; };
layout(location = 0) out vec4 color;
void main() { color = vec4(float(counts[uint(gl_FragCoord.x)]) / 255.0); }";

/// What a shader writes into a buffer of the device stays there: the next pass finds it, and so does the host.
#[test]
fn what_shaders_write_stays_on_the_device() {
    on_each_gpu("what shaders write stays on the device", |gpu| {
        let corners = [[-1.0f32, -1.0], [1.0, -1.0], [-1.0, 1.0]];
        let corners = BufferRange::whole(&Arc::new(BufferSource::new(
            "corners",
            bytemuck::cast_slice(&corners).to_vec(),
        )));
        let pass = |counts: &vk::Buffer<u32>, fragment: &str| {
            let entries = vec![BindingEntry {
                binding: 0,
                resources: vec![Binding::Storage(BufferRange::on_device(counts))],
            }];
            let mut pass = Pass::new("counts", Extent::new(16, 16));
            pass.pipelines.push(plain_pipeline(fragment));
            pass.draws.push(
                Draw::new(0, 3)
                    .vertex_buffers([corners.clone()])
                    .sets([Arc::new(BindingSet { entries })]),
            );
            pass
        };
        let mut executors: Vec<(&str, Box<dyn Executor>)> =
            vec![("compute", Box::new(compute::Renderer::new(gpu).unwrap()))];
        if gpu.has_graphics() {
            executors.push(("classic", Box::new(classic::Renderer::new(gpu).unwrap())));
        }
        for (name, executor) in &mut executors {
            // A slice: what lies before it stays as it is.
            let all = device_buffer(gpu, "counts", &[3u32; 80]);
            let counts = all.slice(64..80).unwrap();
            for _ in 0..3 {
                executor.render(&pass(&counts, COUNT)).unwrap();
            }
            // A triangle of half the target: column x has 15 - x whole pixels below the edge, or one more on it.
            let found = counts.download().unwrap();
            let expected: Vec<u32> = (0..16).map(|x| 3 + 3 * (15 - x)).collect();
            assert_eq!(found, expected, "{name}");
            assert_eq!(all.slice(0..64).unwrap().download().unwrap(), [3; 64], "{name}");
            let shown = executor.render(&pass(&counts, READ)).unwrap();
            for x in 0..15 {
                let value = shown.colors[0].texel(x, 0);
                assert_eq!(u32::from(value[3]), expected[x as usize], "{name}, column {x}");
            }
        }
    });
}

#[test]
fn a_slice_that_is_not_aligned_is_refused() {
    let gpu = gpu();
    let slice = device_buffer(&gpu, "odd", &[0u8; 64]).slice(5..64).unwrap();
    let mut pass = Pass::new("odd", Extent::new(4, 4));
    pass.pipelines.push(plain_pipeline(WHITE));
    pass.draws.push(Draw::new(0, 3).vertex_buffers([BufferRange::on_device(&slice)]));
    let text = pass.validate().unwrap_err().to_string();
    assert!(text.contains("`odd` begins at byte 5"), "{text}");
}

#[test]
fn a_buffer_of_another_device_is_refused() {
    let gpu = gpu();
    let Some(other) = swiftshader("a buffer of another device is refused") else { return };
    let foreign = BufferRange::on_device(&device_buffer(&other, "foreign", &[0.0f32; 6]));
    let mut pass = Pass::new("mixed", Extent::new(4, 4));
    pass.pipelines.push(plain_pipeline(WHITE));
    pass.draws.push(Draw::new(0, 3).vertex_buffers([foreign]));
    let compute = compute::Renderer::new(&gpu).unwrap().render(&pass);
    let classic = classic::Renderer::new(&gpu).unwrap().render(&pass);
    for refused in [compute, classic] {
        let text = match refused {
            Err(Error::Usage(text)) => text,
            other => panic!("{other:?}"),
        };
        assert!(text.contains("foreign") && text.contains("SwiftShader"), "{text}");
    }
}
