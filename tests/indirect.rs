//! Do draw commands that lie in a buffer draw what the same draws do, however many the device finds there?

use crate::{
    common::{gpu, kernel_spirv, on_each_gpu, random::Random},
    twin,
};
use std::sync::Arc;
use tilewright::{
    Error, classic, compare, compute,
    format::{Format, VertexFormat},
    grid::Capacities,
    image::Extent,
    pass::{
        BufferRange, BufferSource, Draw, Executor, Frame, IndexFormat, IndexedIndirectCommand,
        Indices, Indirect, IndirectCommand, Pass, Pipeline, StepRate, VertexAttribute,
        VertexBinding,
    },
    reference,
    shader::{Shader, Stage},
    state::Topology,
    target::{ColorTarget, DepthTarget, LoadOp},
    vk::{self, Gpu, Image, ImageInfo, ImageUse, Kernel, KernelInfo, Memory, Recorder},
};

/// `content` in memory that only the device reaches, behind some bytes of something else.
fn device_range<T: bytemuck::Pod>(gpu: &Gpu, name: &str, content: &[T]) -> BufferRange {
    let bytes: Vec<u8> = [&[0x5a; 256][..], bytemuck::cast_slice(content)].concat();
    let buffer = vk::Buffer::<u8>::new(gpu, name, bytes.len(), Memory::Device).unwrap();
    let mut recorder = Recorder::new(gpu, "upload").unwrap();
    recorder.upload(&buffer, &bytes).unwrap();
    recorder.submit().unwrap();
    let buffer = Arc::new(BufferSource::on_device(&buffer));
    BufferRange { buffer, offset: 256, bytes: bytes.len() - 256 }
}

fn same(a: &Frame, b: &Frame) -> bool {
    let bytes = |frame: &Frame| frame.depth.as_ref().map(|depth| depth.bytes.clone());
    a.colors == b.colors && bytes(a) == bytes(b)
}

/// `pass` with each draw as a command among others that draw nothing, with some more behind their number, and with bytes
/// of something else between two.
pub fn as_commands(gpu: &Gpu, random: &mut Random, pass: &Pass) -> Pass {
    let mut indirect = pass.clone();
    for draw in &mut indirect.draws {
        let primitives = pass.pipelines[draw.pipeline].topology.primitives(draw.count);
        let all = primitives * draw.instances;
        let apart = 4 * random.below(4) as u32;
        let (before, behind) = (random.below(3), random.below(3));
        let nothing = [0, 0, 0, 0, 0];
        let mut commands = vec![nothing; before];
        let first = draw.first;
        commands.push(match draw.indices {
            Some(_) => {
                let base = draw.base_vertex as u32;
                [draw.count, draw.instances, first, base, draw.first_instance]
            }
            None => [draw.count, draw.instances, first, draw.first_instance, 0],
        });
        commands.extend(vec![nothing; random.below(2)]);
        let count = commands.len() as u32;
        // Behind their number: what is there does not matter.
        commands.extend(vec![[3, 7, 1, 0, 9]; behind]);
        let words = if draw.indices.is_some() { 5 } else { 4 };
        let stride = 4 * words as u32 + apart;
        let mut bytes: Vec<u8> = Vec::new();
        for command in &commands {
            bytes.extend_from_slice(bytemuck::cast_slice(&command[..words]));
            bytes.extend(std::iter::repeat_n(0x77, apart as usize));
        }
        let counted = behind > 0 || random.below(2) == 0;
        draw.indirect = Some(
            Indirect::in_range(
                device_range(gpu, "commands", &bytes),
                stride,
                all + random.below(3) as u32 * 100,
            )
            .draws(commands.len() as u32)
            .count(counted.then(|| device_range(gpu, "count", &[count]))),
        );
        // They are ignored.
        (draw.count, draw.first, draw.instances, draw.base_vertex) = (1, 77, 9, 5);
        draw.first_instance = 3;
    }
    indirect
}

#[test]
fn commands_draw_as_the_draws_that_they_describe() {
    on_each_gpu("commands draw as the draws that they describe", |gpu| {
        let shaders = twin::shaders();
        let mut compute = compute::Renderer::new(gpu).unwrap();
        // SwiftShader's own raster stage does not end for some of these meshes.
        let ends = gpu.has_graphics() && !gpu.info().name.contains("SwiftShader");
        let mut classic = ends.then(|| classic::Renderer::new(gpu).unwrap());
        for seed in 9000..9024 {
            let mut random = Random::new(seed);
            let primitives = 1 << (4 + seed % 7);
            compute.set_batch_limit(Capacities {
                primitives,
                vertices: 4 * primitives,
                varying_words: 1 << 14,
            });
            let mut direct = twin::random_pass(seed, &shaders);
            for draw in &mut direct.draws {
                draw.instances = 1 + random.below(3) as u32;
            }
            let indirect = as_commands(gpu, &mut random, &direct);
            let what = format!("{}, seed {seed}", gpu.info());
            let expected = compute.render(&direct).unwrap();
            assert!(same(&compute.render(&indirect).unwrap(), &expected), "{what}: rendered");
            let (frame, trace) = compute.trace(&indirect).unwrap();
            assert!(same(&frame, &expected), "{what}: traced");
            if let Some(found) = reference::first_difference(&indirect, &trace) {
                panic!("{what}: {found}");
            }
            let snapshot = indirect.snapshot().unwrap();
            assert!(same(&compute.render(&snapshot).unwrap(), &expected), "{what}: snapshot");
            if let Some(classic) = &mut classic {
                let expected = classic.render(&direct).unwrap();
                assert!(same(&classic.render(&indirect).unwrap(), &expected), "{what}: classic");
            }
        }
    });
}

const SHOW: &str = "#version 450
layout(location = 0) in vec2 position;
layout(location = 0) flat out uint shade;
void main() {
    gl_Position = vec4(position, 0.25 + 0.5 * fract(gl_VertexIndex * 0.37), 1);
    shade = uint(gl_VertexIndex / 3 * 7919 + gl_InstanceIndex * 131);
}";

const SHADE: &str = "#version 450
layout(location = 0) flat in uint shade;
layout(location = 0) out vec4 color;
void main() { color = vec4(shade & 255u, shade >> 8 & 255u, shade >> 16 & 255u, 255) / 255.0; }";

/// Small triangles of an indexed mesh, `triangles` of them.
fn mesh(triangles: u32) -> Pass {
    let shader = |stage, source| Arc::new(Shader::from_glsl(stage, "indirect", source).unwrap());
    let mut pipeline =
        Pipeline::new("mesh", shader(Stage::Vertex, SHOW), shader(Stage::Fragment, SHADE));
    pipeline.vertex_bindings = vec![VertexBinding { stride: 8, rate: StepRate::Vertex }];
    pipeline.vertex_attributes =
        vec![VertexAttribute { location: 0, binding: 0, format: VertexFormat::F32X2, offset: 0 }];
    pipeline.topology = Topology::TriangleList;
    let mut random = Random::new(u64::from(triangles));
    let corners: Vec<[f32; 2]> = (0..triangles)
        .flat_map(|_| {
            let at = [random.signed() * 0.95, random.signed() * 0.95];
            [[0.0, 0.0], [0.04, 0.0], [0.0, 0.04]].map(|[x, y]| [at[0] + x, at[1] + y])
        })
        .collect();
    let indices: Vec<u32> = (0..3 * triangles).rev().collect();
    let range = |name: &str, bytes: &[u8]| {
        BufferRange::whole(&Arc::new(BufferSource::new(name, bytes.to_vec())))
    };
    let mut draw = Draw::new(0, 3 * triangles);
    draw.vertex_buffers = vec![range("corners", bytemuck::cast_slice(&corners))];
    let indices = range("indices", bytemuck::cast_slice(&indices));
    draw.indices = Some(Indices::new(indices, IndexFormat::U32));
    let mut pass = Pass::new("mesh", Extent::new(200, 160));
    pass.colors = vec![ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])];
    pass.depth = Some(DepthTarget::cleared(1.0));
    pass.pipelines = vec![Arc::new(pipeline)];
    pass.draws = vec![draw];
    pass
}

/// No command, one, a hundred thousand, and more primitives than a batch holds: the device's own indirect draw and that of
/// `compute` show the same triangle in each pixel.
#[test]
fn any_number_of_commands_draws_as_on_the_device() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    let mut classic = classic::Renderer::new(&gpu).unwrap();
    // One triangle a command; many triangles in few commands.
    for (count, of_one) in [(0, 1), (1, 1), (100_000, 1), (300_000, 1), (7, 40_000)] {
        let triangles: u32 = (count * of_one).max(1);
        let mut pass = mesh(triangles);
        let commands: Vec<_> = (0..count.max(1))
            .map(|n| IndexedIndirectCommand {
                count: 3 * of_one,
                instances: 1,
                first: 3 * of_one * n,
                base_vertex: 0,
                first_instance: n % 5,
            })
            .collect();
        pass.draws[0].indirect = Some(
            Indirect::in_range(device_range(&gpu, "commands", &commands), 20, triangles)
                .draws(count.max(1))
                .count(device_range(&gpu, "count", &[count])),
        );
        let (a, b) = (compute.render(&pass).unwrap(), classic.render(&pass).unwrap());
        assert!(a.colors == b.colors, "{count} commands of {of_one} triangles");
        let drawn = a.colors[0].bytes.chunks(4).any(|texel| texel[3] != 0);
        assert_eq!(drawn, count > 0, "{count} commands of {of_one} triangles");
        if count < 10_000 {
            let both = compare::Both::draw(&mut compute, &mut classic, &pass, |_| {}).unwrap();
            assert!(both.same(), "{count} commands: {:?}", both.difference);
        }
    }
}

/// A kernel decides what is drawn: it writes vertices, commands and their number in the frame that draws them.
#[test]
fn a_kernel_writes_what_the_frame_draws() {
    on_each_gpu("a kernel writes what the frame draws", |gpu| {
        let spirv = kernel_spirv(
            "#version 460
layout(local_size_x = 32) in;
layout(push_constant) uniform Push { uint frame; };
struct Command { uint count, instances, first, first_instance; };
layout(binding = 0) writeonly buffer Corners { vec2 corners[]; };
layout(binding = 1) writeonly buffer Commands { Command commands[]; };
layout(binding = 2) buffer Count { uint count; };
void main() {
    uint column = gl_LocalInvocationIndex;
    for (uint corner = 0u; corner < 6u; corner++) {
        vec2 at = vec2(uvec2(0x1au, 0x34u) >> corner & 1u);
        corners[column * 6u + corner] = (vec2(column, 0) + at) / vec2(16, 1) - 1.0 + vec2(0, at.y);
    }
    // Every other column, or every third.
    if (column % (2u + frame % 2u) == 0u) commands[atomicAdd(count, 1u)] = Command(6u, 1u, column * 6u, 0u);
}",
        );
        let info = KernelInfo::new("decide", &spirv);
        let decide = Kernel::new(gpu, &info).unwrap();
        let corners = vk::Buffer::<[f32; 2]>::new(gpu, "corners", 192, Memory::Device).unwrap();
        let commands =
            vk::Buffer::<IndirectCommand>::new(gpu, "commands", 32, Memory::Device).unwrap();
        let count = vk::Buffer::<u32>::new(gpu, "count", 1, Memory::Device).unwrap();
        let (extent, usage) = (Extent::new(64, 4), ImageUse::Attachment);
        let format = Format::Rgba8Unorm;
        let image = Image::new(gpu, &ImageInfo::new("image", extent, format, usage)).unwrap();
        let mut pass = mesh(1);
        pass.extent = extent;
        pass.colors = vec![ColorTarget::on_device(&image, LoadOp::clear([0.0; 4]))];
        pass.depth = None;
        let mut draw = Draw::new(0, 0);
        draw.vertex_buffers = vec![BufferRange::on_device(&corners)];
        draw.indirect = Some(
            Indirect::in_range(BufferRange::on_device(&commands), 16, 64)
                .draws(32)
                .count(BufferRange::on_device(&count)),
        );
        pass.draws = vec![draw];
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for frame in 0..6u32 {
            let mut encoder = renderer.begin().unwrap();
            encoder.fill(&count, 0).unwrap();
            encoder
                .kernel(&decide)
                .bind("Corners", &corners)
                .bind("Commands", &commands)
                .bind("Count", &count)
                .push(&frame)
                .dispatch([1, 1, 1])
                .unwrap();
            encoder.encode(&pass).unwrap();
            encoder.submit().unwrap();
            let drawn = image.download(0).unwrap();
            for x in 0..extent.width {
                let wanted = (x / 2).is_multiple_of(2 + frame % 2);
                for y in 0..extent.height {
                    assert_eq!(drawn.texel(x, y)[3] == 255, wanted, "frame {frame}, pixel {x},{y}");
                }
            }
        }
    });
}

/// A device may find anything where the commands are. Nothing else than the pass's buffers is reached, no more is drawn
/// than the caller says, and the next frame is as it should be.
#[test]
fn wild_commands_reach_nothing_else() {
    on_each_gpu("wild commands reach nothing else", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        compute.set_batch_limit(Capacities {
            primitives: 64,
            vertices: 256,
            varying_words: 1 << 14,
        });
        let tame = mesh(50);
        let expected = compute.render(&tame).unwrap();
        for seed in 0..40 {
            let mut random = Random::new(seed);
            let mut pass = tame.clone();
            let words: Vec<u32> = (0..100)
                .map(|_| match random.below(4) {
                    0 => random.bits() as u32,
                    1 => u32::MAX - random.below(4) as u32,
                    2 => random.below(200) as u32,
                    _ => 1 + random.below(3) as u32,
                })
                .collect();
            if random.below(2) == 0 {
                pass.draws[0].indices = None;
            }
            pass.draws[0].indirect = Some(
                Indirect::in_range(device_range(gpu, "wild", &words), 20, 300)
                    .draws(20)
                    .count(device_range(gpu, "count", &[words[seed as usize]])),
            );
            compute.render(&pass).unwrap();
            assert!(same(&compute.render(&tame).unwrap(), &expected), "after seed {seed}");
        }
    });
}

#[test]
fn commands_that_are_not_there_are_refused() {
    let gpu = gpu();
    let commands = device_range(&gpu, "commands", &[0u32; 20]);
    let good = || Indirect::in_range(commands.clone(), 20, 10).draws(4);
    let refused = |words: &[&str], spoil: &dyn Fn(&mut Indirect)| {
        let mut pass = mesh(4);
        let mut indirect = good();
        spoil(&mut indirect);
        pass.draws[0].indirect = Some(indirect);
        match pass.validate() {
            Err(Error::Usage(text)) if words.iter().all(|word| text.contains(word)) => {}
            other => panic!("not refused with {words:?}: {other:?}"),
        }
    };
    let mut pass = mesh(4);
    pass.draws[0].indirect = Some(good());
    pass.validate().unwrap();
    refused(&["5 commands", "80 bytes"], &|i| i.draws = 5);
    refused(&["2 bytes apart", "20"], &|i| i.stride = 2);
    refused(&["16 bytes apart", "20"], &|i| i.stride = 16);
    refused(&["from byte 254"], &|i| i.commands.offset -= 2);
    refused(&["commands", "at most"], &|i| i.draws = (1 << 20) + 1);
    refused(&["primitives", "at most"], &|i| i.primitives = (1 << 24) + 1);
    refused(&["number of commands", "2 bytes"], &|i| {
        i.count = Some(BufferRange { bytes: 2, ..commands.clone() });
    });
    refused(&["which has"], &|i| i.commands.bytes += 4);
}
