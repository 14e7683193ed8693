//! What do shaders read beyond the range that is bound to a block, and what do they change by writing to one?

use crate::common::{gpu, on_each_gpu};
use std::sync::Arc;
use tilewright::{
    classic, compute,
    format::{Format, VertexFormat},
    image::Extent,
    pass::{
        Binding, BindingEntry, BindingSet, BufferRange, BufferSource, Draw, Executor, Frame,
        IndexFormat, Indices, Pass, Pipeline, StepRate, VertexAttribute, VertexBinding,
    },
    shader::{Shader, Stage},
    state::{DepthState, Rect},
    vk::Gpu,
};

const VERTEX: &str = "#version 450
layout(binding = 1) uniform Corners { vec4 first; vec4 nudge; };
void main() {
    vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 4.0 - 1.0;
    gl_Position = vec4(corner, 0, 1) + first + nudge;
}";

/// Draws a triangle over the whole target by both executors. `Block` of `fragment` is bound to the last
/// `bytes` bytes of a buffer, all of which are ones.
fn draw(gpu: &Gpu, fragment: &str, bytes: usize, bind: fn(BufferRange) -> Binding) -> [Frame; 2] {
    let source = format!("#version 450\nlayout(location = 0) out vec4 color;\n{fragment}");
    let pass = pass(shader(Stage::Fragment, "short.frag", &source), &[], bytes, bind);
    let by_compute = compute::Renderer::new(gpu).unwrap().render(&pass).unwrap();
    [by_compute, classic::Renderer::new(gpu).unwrap().render(&pass).unwrap()]
}

fn shader(stage: Stage, label: &str, source: &str) -> Shader {
    Shader::from_glsl(stage, label, source).unwrap_or_else(|e| panic!("{e}"))
}

/// A pass that draws what [`draw`] draws, with these specialization constants.
fn pass(
    fragment: Shader,
    specialization: &[(u32, u32)],
    bytes: usize,
    bind: fn(BufferRange) -> Binding,
) -> Pass {
    let ones: Vec<u8> = [1.0f32; 96].iter().flat_map(|one| one.to_ne_bytes()).collect();
    let ones = Arc::new(BufferSource::new("ones", ones[..256 + bytes].to_vec()));
    let zeros = Arc::new(BufferSource::new("zeros", vec![0; 16]));
    let range = BufferRange { buffer: ones, offset: 256, bytes };
    let entry = |binding, resource| BindingEntry { binding, resources: vec![resource] };
    let corners = Binding::Uniform(BufferRange::whole(&zeros));
    let set = BindingSet { entries: vec![entry(0, bind(range)), entry(1, corners)] };
    let mut pass = Pass::new("short", Extent::new(8, 8));
    pass.colors[0].format = Format::Rgba8Unorm;
    pass.pipelines.push(Arc::new(
        Pipeline::new(
            "short",
            Arc::new(shader(Stage::Vertex, "short.vert", VERTEX)),
            Arc::new(fragment),
        )
        .depth(DepthState::OFF)
        .specialization(specialization.to_vec()),
    ));
    pass.draws.push(Draw::new(0, 3).sets([Arc::new(set)]));
    pass
}

#[test]
fn a_block_is_as_long_as_a_specialization_constant_makes_it() {
    let source = "#version 450
        layout(constant_id = 3) const int N = 1;
        layout(binding = 0) uniform Block { vec4 list[N]; };
        layout(location = 0) out vec4 color;
        void main() { color = list[N - 1]; }";
    let fragment = shader(Stage::Fragment, "long.frag", source);
    let pass = pass(fragment, &[(3, 8)], 128, Binding::Uniform);
    let gpu = gpu();
    let by_compute = compute::Renderer::new(&gpu).unwrap().render(&pass).unwrap();
    let by_classic = classic::Renderer::new(&gpu).unwrap().render(&pass).unwrap();
    for frame in [by_compute, by_classic] {
        assert_eq!(frame.colors[0].texel(3, 3), [255; 4]);
    }
}

/// No compiler of GLSL takes such an index, but an optimizer may make one of a loop. Element 3 becomes
/// element 16000000. On the driver under test alone, as below.
#[test]
fn a_constant_index_beyond_a_uniform_block_reads_no_other_memory() {
    let source = "#version 450
        layout(binding = 0) uniform Block { vec4 list[4]; };
        layout(location = 0) out vec4 color;
        void main() { color = list[3]; }";
    let mut words = shader(Stage::Fragment, "far.frag", source).spirv().to_vec();
    // `OpConstant %int %id 3`: four words, operation 43. The array's length is 4.
    let constant = words.windows(4).position(|w| w[0] == 4 << 16 | 43 && w[3] == 3);
    words[constant.expect("the index") + 3] = 16_000_000;
    let fragment = Shader::from_spirv(Stage::Fragment, "far.frag", &words).unwrap();
    let pass = pass(fragment, &[], 64, Binding::Uniform);
    let frame = compute::Renderer::new(&gpu()).unwrap().render(&pass).unwrap();
    let texel = frame.colors[0].texel(3, 3);
    let possible: [[u8; 4]; 3] = [[0; 4], [0, 0, 0, 255], [255; 4]];
    assert!(possible.iter().any(|p| texel == p), "{texel:?}");
}

#[test]
fn zeros_follow_a_short_uniform_block() {
    on_each_gpu("zeros follow a short uniform block", |gpu| {
        let fragment =
            "layout(binding = 0) uniform Block { vec4 first; vec4 second; vec4 list[3]; };
            void main() {
                int n = int(gl_FragCoord.x) % 3;
                color = vec4(first.x, second.y, second.z, 1.0) + list[n] + list[2];
            }";
        for (bytes, expected) in [(16, [255, 0, 0, 255]), (24, [255, 255, 0, 255])] {
            for frame in draw(gpu, fragment, bytes, Binding::Uniform) {
                for x in 0..8 {
                    assert_eq!(frame.colors[0].texel(x, 5), expected, "{bytes} bytes, pixel {x}");
                }
            }
        }
    });
}

#[test]
fn a_short_storage_block_has_the_elements_that_there_is_room_for() {
    let fragment = "layout(binding = 0) readonly buffer Block { uint count; vec4 items[]; };
        void main() {
            color = vec4(items.length() == 0 ? 1.0 : 0.0, items.length() == 2 ? 1.0 : 0.0, 0.0, 1.0);
            for (int i = 0; i < items.length(); i++) color.b += items[i].z;
        }";
    for (bytes, expected) in [(16, [255, 0, 0, 255]), (48, [0, 255, 255, 255])] {
        for frame in draw(&gpu(), fragment, bytes, Binding::Storage) {
            assert_eq!(frame.colors[0].texel(3, 3), expected, "{bytes} bytes");
        }
    }
}

/// The first word of the block decides how far: no compiler knows.
///
/// Storage on the driver under test alone: SwiftShader checks no bounds where lanes may choose the block, as
/// in kernels they may, and crashes.
#[test]
fn what_is_indexed_beyond_a_block_is_never_other_memory() {
    let far = "layout(binding = 0) buffer Block { vec4 first; vec4 items[]; };
        void main() {
            int step = int(first.x) << 20;
            for (int i = 1; i < 8; i++) items[i * step] = vec4(7.0);
            color = vec4(first.xy, 0.0, 1.0) + items[step + int(gl_FragCoord.x)] * 0.0;
        }";
    let uniform = "layout(binding = 0) uniform Block { vec4 first; vec4 items[64]; };
        void main() { color = vec4(first.xy, items[int(first.x) << 5].x, 1.0); }";
    for frame in draw(&gpu(), far, 32, Binding::Storage) {
        assert_eq!(frame.colors[0].texel(3, 3)[..2], [255, 255]);
    }
    on_each_gpu("what is indexed beyond a block is never other memory", |gpu| {
        for frame in draw(gpu, uniform, 32, Binding::Uniform) {
            assert_eq!(frame.colors[0].texel(3, 3), [255, 255, 0, 255]);
        }
    });
}

/// One host buffer holds the indices, a uniform block, the positions and the words that a fragment shader sets to
/// zero: all of them.
fn overwritten() -> Pass {
    let vertex = "#version 450
        layout(location = 0) in vec2 position;
        void main() { gl_Position = vec4(position, 0, 1); }";
    let fragment = "#version 450
        layout(binding = 0) buffer Words { uint words[]; };
        layout(binding = 1) uniform Block { vec4 tint; };
        layout(location = 0) out vec4 color;
        void zero(int at) { atomicAnd(words[at], 0u); }
        void main() {
            color = tint;
            words[int(gl_FragCoord.x)] = 0u;
            for (int i = 0; i < 3; i++) zero(i + 64 * (int(gl_FragCoord.y) % 3));
        }";
    let mut words = [0u32; 192];
    words[..3].copy_from_slice(&[2, 1, 0]);
    words[64..68].copy_from_slice(&[0.0f32, 1.0, 0.0, 1.0].map(f32::to_bits));
    words[128..134].copy_from_slice(&[-1.0f32, -1.0, -1.0, 3.0, 3.0, -1.0].map(f32::to_bits));
    let bytes = words.iter().flat_map(|word| word.to_ne_bytes()).collect();
    let buffer = Arc::new(BufferSource::new("everything", bytes));
    let range = |offset, bytes| BufferRange { buffer: buffer.clone(), offset, bytes };
    let entry = |binding, resource| BindingEntry { binding, resources: vec![resource] };
    let whole = BufferRange::whole(&buffer);
    let entries =
        vec![entry(0, Binding::Storage(whole)), entry(1, Binding::Uniform(range(256, 16)))];
    let mut pass = Pass::new("overwritten", Extent::new(8, 8));
    pass.colors[0].format = Format::Rgba8Unorm;
    pass.pipelines.push(Arc::new(
        Pipeline::new(
            "overwritten",
            Arc::new(shader(Stage::Vertex, "overwritten.vert", vertex)),
            Arc::new(shader(Stage::Fragment, "overwritten.frag", fragment)),
        )
        .depth(DepthState::OFF)
        .vertex_bindings([VertexBinding { stride: 8, rate: StepRate::Vertex }])
        .vertex_attributes([VertexAttribute {
            location: 0,
            binding: 0,
            format: VertexFormat::F32X2,
            offset: 0,
        }]),
    ));
    pass.draws.push(
        Draw::new(0, 3)
            .sets([Arc::new(BindingSet { entries })])
            .vertex_buffers([range(512, 24)])
            .indices(Indices::new(range(0, 12), IndexFormat::U32)),
    );
    // The second draw finds the indices of the first.
    pass.draws.push(pass.draws[0].clone());
    pass
}

#[test]
fn what_shaders_write_stays_in_the_pass() {
    on_each_gpu("what shaders write stays in the pass", |gpu| {
        let pass = overwritten();
        let mut by_compute = compute::Renderer::new(gpu).unwrap();
        let mut by_classic = classic::Renderer::new(gpu).unwrap();
        let mut frames = Vec::new();
        for _ in 0..2 {
            frames.push(by_compute.render(&pass).unwrap());
            frames.push(by_classic.render(&pass).unwrap());
        }
        let mut prepared = by_compute.prepare(&pass).unwrap();
        for _ in 0..2 {
            prepared.execute().unwrap();
            frames.push(prepared.read().unwrap());
        }
        frames.push(by_compute.trace(&pass).unwrap().0);
        for (n, frame) in frames.iter().enumerate() {
            for (x, y) in [(0, 0), (3, 3), (7, 7)] {
                assert_eq!(
                    frame.colors[0].texel(x, y),
                    [0, 255, 0, 255],
                    "frame {n}, pixel {x},{y}"
                );
            }
        }
    });
}

/// A shader counts its executions. Each execution of the pass begins with what the host gave.
#[test]
fn each_execution_finds_what_the_host_gave() {
    on_each_gpu("each execution finds what the host gave", |gpu| {
        let source = "#version 450
            layout(binding = 0) buffer Block { uint bits; };
            layout(location = 0) out vec4 color;
            void main() {
                uint more = atomicAdd(bits, 1u) - floatBitsToUint(1.0);
                color = vec4(float(more + 7u) / 255.0);
            }";
        let fragment = shader(Stage::Fragment, "count.frag", source);
        let mut pass = pass(fragment, &[], 16, Binding::Storage);
        pass.extent = Extent::new(1, 1);
        // The second draw counts on.
        pass.draws.push(pass.draws[0].clone());
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let mut prepared = renderer.prepare(&pass).unwrap();
        for _ in 0..3 {
            prepared.execute().unwrap();
            assert_eq!(prepared.read().unwrap().colors[0].texel(0, 0), [8; 4]);
        }
        for _ in 0..2 {
            assert_eq!(renderer.trace(&pass).unwrap().0.colors[0].texel(0, 0), [8; 4]);
            assert_eq!(renderer.render(&pass).unwrap().colors[0].texel(0, 0), [8; 4]);
        }
    });
}

/// Targets that `compute` draws in two bands.
const TWO_BANDS: [Extent; 2] = [Extent::new(16384, 520), Extent::new(4100, 2080)];

/// Asserts that all rows of a column have this colour.
#[track_caller]
fn assert_column(frame: &Frame, x: u32, color: [u8; 4]) {
    for y in 0..frame.colors[0].extent.height {
        assert_eq!(frame.colors[0].texel(x, y), color, "pixel {x},{y}");
    }
}

/// What a pass writes, a later draw of it reads, also through a block that its shader only reads.
#[test]
fn later_draws_read_what_earlier_ones_wrote() {
    let writer = "layout(binding = 0) buffer Block { vec4 value; };
        void main() { value = vec4(0.0, 1.0, 0.0, 1.0); color = vec4(1.0); }";
    let reader = "layout(binding = 0) readonly buffer Block { vec4 value; };
        void main() { color = value; }";
    on_each_gpu("later draws read what earlier ones wrote", |gpu| {
        let head = "#version 450\nlayout(location = 0) out vec4 color;\n";
        let [mut pass, second] = [writer, reader].map(|body| {
            let fragment = shader(Stage::Fragment, "block.frag", &format!("{head}{body}"));
            self::pass(fragment, &[], 16, Binding::Storage)
        });
        pass.pipelines.extend(second.pipelines);
        // One set for all draws, the first of which reads what the host wrote.
        let first = pass.draws[0].clone();
        pass.draws.insert(0, first.clone().pipeline(1));
        pass.draws.push(first.pipeline(1));
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for _ in 0..2 {
            assert_eq!(renderer.render(&pass).unwrap().colors[0].texel(3, 3), [0, 255, 0, 255]);
        }
        pass.draws.truncate(1);
        assert_eq!(renderer.render(&pass).unwrap().colors[0].texel(3, 3), [255; 4]);
    });
}

/// Every band executes all draws.
#[test]
fn each_band_finds_what_the_host_gave() {
    let writer = "layout(binding = 0) buffer Block { vec4 value; };
        void main() { value = vec4(0.0, 1.0, 0.0, 1.0); color = vec4(1.0, 0.0, 0.0, 1.0); }";
    let reader = "layout(binding = 0) readonly buffer Block { vec4 value; };
        void main() { color = value; }";
    let head = "#version 450\nlayout(location = 0) out vec4 color;\n";
    let [mut pass, second] = [writer, reader].map(|body| {
        let fragment = shader(Stage::Fragment, "band.frag", &format!("{head}{body}"));
        self::pass(fragment, &[], 16, Binding::Storage)
    });
    pass.pipelines.extend(second.pipelines);
    let all = pass.draws.remove(0);
    // Columns, so that there is little to draw.
    pass.draws.extend([(1, 0), (0, 8), (1, 16)].map(|(pipeline, x)| {
        all.clone().pipeline(pipeline).scissor(Rect { x, y: 0, width: 8, height: 4096 })
    }));
    let mut renderer = compute::Renderer::new(&gpu()).unwrap();
    for extent in TWO_BANDS {
        pass.extent = extent;
        let (traced, trace) = renderer.trace(&pass).unwrap();
        assert_eq!(trace.bands.len(), 2);
        for frame in [renderer.render(&pass).unwrap(), traced] {
            assert_column(&frame, 0, [255; 4]);
            assert_column(&frame, 8, [255, 0, 0, 255]);
            assert_column(&frame, 16, [0, 255, 0, 255]);
        }
    }
}

/// The vertices of a single batch stay in place for all bands, and what their shader writes does not.
#[test]
fn each_band_finds_what_its_vertices_wrote() {
    let vertex = "#version 450
        layout(binding = 0) buffer Block { vec4 value; };
        void main() {
            value = vec4(0.0, 1.0, 0.0, 1.0);
            gl_Position = vec4(vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 4.0 - 1.0, 0, 1);
        }";
    let fragment = "#version 450
        layout(binding = 0) readonly buffer Block { vec4 value; };
        layout(location = 0) out vec4 color;
        void main() { color = value; }";
    let fragment = shader(Stage::Fragment, "read.frag", fragment);
    let mut pass = pass(fragment, &[], 16, Binding::Storage);
    Arc::make_mut(&mut pass.pipelines[0]).vertex =
        Arc::new(shader(Stage::Vertex, "write.vert", vertex));
    pass.draws[0].scissor = Some(Rect { x: 0, y: 0, width: 8, height: 4096 });
    let mut renderer = compute::Renderer::new(&gpu()).unwrap();
    for extent in TWO_BANDS {
        pass.extent = extent;
        assert_column(&renderer.render(&pass).unwrap(), 0, [0, 255, 0, 255]);
    }
}
