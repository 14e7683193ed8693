//! A field of ten thousand stones that the device culls: a kernel lists those that the eye can see, each as a draw command
//! with as many triangles as its distance deserves, and one indirect draw draws the list. The host knows neither which
//! stones are drawn nor how many.
//!
//! `cargo run --release --example culling --features glsl` writes `culling.png`.

use glam::Vec3;
use glam::camera::rh::{proj::vulkan::perspective, view::look_at_mat4};
use std::{error::Error, fs::File};
use tilewright::image::png;
use tilewright::pass::IndirectCommand;
use tilewright::state::{Cull, Topology};
use tilewright::{
    Binding, BindingSet, Buffer, BufferRange, ColorTarget, DepthTarget, Draw, Extent, Format, Gpu,
    GpuOptions, Image, ImageInfo, ImageUse, Indirect, Kernel, LoadOp, Memory, Pass, Picture,
    Pipeline, Renderer, Shader, Stage,
};

/// Stones along each side of the field.
const SIDE: u32 = 100;
const STONES: u32 = SIDE * SIDE;
/// The most triangles that a frame may draw.
const TRIANGLES: u32 = 1_000_000;

/// A stone is a ball in the middle of its square. `culls` is 0 to draw all of them.
const LIST: &str = "#version 460
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { mat4 clip_of_world; vec4 eye; uint stones, culls; };
struct Command { uint count, instances, first, first_instance; };
layout(binding = 0) readonly buffer Stones { vec4 stone[]; }; // middle, radius
layout(binding = 1) writeonly buffer Commands { Command commands[]; };
layout(binding = 2) buffer Count { uint count; };
// Whether all of the ball is behind a plane.
bool outside(vec4 plane, vec4 ball) { return dot(plane, vec4(ball.xyz, 1)) < -ball.w * length(plane.xyz); }
void main() {
    uint n = gl_GlobalInvocationID.x;
    if (n >= stones) return;
    vec4 ball = stone[n];
    mat4 rows = transpose(clip_of_world);
    bool hidden = outside(rows[3] + rows[0], ball) || outside(rows[3] - rows[0], ball) ||
        outside(rows[3] + rows[1], ball) || outside(rows[3] - rows[1], ball) || outside(rows[2], ball);
    if (hidden && culls != 0u) return;
    uint rings = clamp(uint(300.0 * ball.w / distance(ball.xyz, eye.xyz)), 3u, 24u);
    // The fragment of a pixel is the nearest one, so that the order of the list does not show.
    commands[atomicAdd(count, 1u)] = Command(rings * rings * 6u, 1u, rings << 16, n);
}";

/// The first vertex is a multiple of 2^16 that tells the number of rings.
const VERTEX: &str = "#version 460
layout(push_constant) uniform Push { mat4 clip_of_world; vec4 eye; };
layout(set = 0, binding = 0) readonly buffer Stones { vec4 stone[]; };
layout(location = 0) out vec3 normal;
layout(location = 1) flat out vec3 base;
void main() {
    uint rings = uint(gl_VertexIndex) >> 16, corner = uint(gl_VertexIndex) & 0xffffu;
    uint quad = corner / 6u;
    uvec2 corners[6] = uvec2[](uvec2(0, 0), uvec2(1, 1), uvec2(0, 1), uvec2(0, 0), uvec2(1, 0), uvec2(1, 1));
    vec2 turn = vec2(uvec2(quad % rings, quad / rings) + corners[corner % 6u]) / rings * vec2(6.283185, 3.141593);
    normal = vec3(cos(turn.x) * sin(turn.y), cos(turn.y), sin(turn.x) * sin(turn.y));
    vec4 ball = stone[gl_InstanceIndex];
    gl_Position = clip_of_world * vec4(ball.xyz + ball.w * normal * vec3(1.0, 0.7, 1.0), 1.0);
    float shade = fract(sin(float(gl_InstanceIndex)) * 43758.5);
    base = mix(vec3(0.42, 0.38, 0.33), vec3(0.62, 0.6, 0.58), shade);
}";

const FRAGMENT: &str = "#version 460
layout(push_constant) uniform Push { mat4 clip_of_world; vec4 eye; };
layout(location = 0) in vec3 normal;
layout(location = 1) flat in vec3 base;
layout(location = 0) out vec4 color;
void main() {
    float light = 0.35 + 0.65 * max(dot(normalize(normal), normalize(vec3(-2, 4, -1))), 0.0);
    float haze = 1.0 - exp(-0.00035 / (gl_FragCoord.w * gl_FragCoord.w));
    color = vec4(mix(base * light, vec3(0.6, 0.72, 0.85), haze), 1.0);
}";

/// The plain that the stones lie on.
const GROUND: &str = "#version 460
layout(push_constant) uniform Push { mat4 clip_of_world; vec4 eye; };
layout(location = 0) out vec3 normal;
layout(location = 1) flat out vec3 base;
void main() {
    vec2 corners[4] = vec2[](vec2(-1, -1), vec2(1, -1), vec2(-1, 1), vec2(1, 1));
    vec2 corner = corners[gl_VertexIndex] * 300.0;
    gl_Position = clip_of_world * vec4(corner.x, 0.0, corner.y, 1.0);
    normal = vec3(0, 1, 0);
    base = vec3(0.36, 0.4, 0.22);
}";

/// Draws one frame of `extent`; returns it with the number of stones that were drawn.
pub fn draw(gpu: &Gpu, extent: Extent, culls: bool) -> tilewright::Result<(Picture, u32)> {
    let info = ImageInfo::new("field", extent, Format::Rgba8Srgb, ImageUse::Attachment);
    let picture = Image::new(gpu, &info)?;
    let stones = Buffer::with_content(gpu, "stones", &field())?;
    let device = Memory::Device;
    let commands = Buffer::<IndirectCommand>::new(gpu, "commands", STONES as usize, device)?;
    let count = Buffer::<u32>::new(gpu, "count", 1, device)?;
    let list = Kernel::from_glsl(gpu, "list", LIST)?;

    let eye = Vec3::new(0.0, 2.6, 0.0);
    let view = look_at_mat4(eye, Vec3::new(9.0, 0.0, 14.0), Vec3::Y);
    let clip_of_world =
        perspective(0.9, extent.width as f32 / extent.height as f32, 0.1, 400.0) * view;
    let push = Push {
        clip_of_world: clip_of_world.to_cols_array(),
        eye: eye.extend(1.0).to_array(),
        stones: STONES,
        culls: culls.into(),
    };

    let pipeline = |label: &str, vertex: &str| -> tilewright::Result<Pipeline> {
        let vertex = Shader::from_glsl(Stage::Vertex, label, vertex)?;
        Ok(Pipeline::new(label, vertex, Shader::from_glsl(Stage::Fragment, label, FRAGMENT)?))
    };
    let listed = Indirect::new(&commands, TRIANGLES).count(BufferRange::on_device(&count));
    let pass = Pass::new("field", extent)
        .colors([ColorTarget::on_device(&picture, LoadOp::clear([0.6, 0.72, 0.85, 1.0]))])
        .depth(DepthTarget::transient(1.0))
        .pipelines([
            pipeline("stones", VERTEX)?.cull(Cull::Back),
            pipeline("ground", GROUND)?.topology(Topology::TriangleStrip),
        ])
        .draws([
            Draw::new(0, 0)
                .sets([BindingSet::new([(0, Binding::Storage(BufferRange::on_device(&stones)))])])
                .push(&push)
                .indirect(listed),
            Draw::new(1, 4).push(&push),
        ]);

    let mut renderer = Renderer::new(gpu)?;
    let mut frame = renderer.begin()?;
    frame.fill(&count, 0)?;
    frame
        .kernel(&list)
        .bind("Stones", &stones)
        .bind("Commands", &commands)
        .bind("Count", &count)
        .push(&push)
        .dispatch([STONES.div_ceil(64), 1, 1])?;
    frame.encode(&pass)?;
    frame.submit()?.wait()?;
    Ok((picture.download(0)?, count.download()?[0]))
}

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    clip_of_world: [f32; 16],
    eye: [f32; 4],
    stones: u32,
    culls: u32,
}

/// Middle and radius of each stone.
fn field() -> Vec<[f32; 4]> {
    let random = |n: u32, salt: u32| {
        let mixed = (n ^ salt.wrapping_mul(0x9e37_79b9)).wrapping_mul(0x85eb_ca6b);
        ((mixed ^ mixed >> 15).wrapping_mul(0xc2b2_ae35) >> 8) as f32 / 16_777_216.0
    };
    let stone = |n: u32| {
        let radius = 0.12 + 0.3 * random(n, 1) * random(n, 2);
        let at = |along: u32, salt| along as f32 - SIDE as f32 / 2.0 + random(n, salt);
        [at(n % SIDE, 3), 0.5 * radius, at(n / SIDE, 4), radius]
    };
    (0..STONES).map(stone).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let gpu = Gpu::open(&GpuOptions::default())?;
    let (picture, drawn) = draw(&gpu, Extent::new(800, 500), true)?;
    eprintln!("{drawn} of {STONES} stones are drawn");
    png::write_png(&picture, &[], File::create("culling.png")?)?;
    Ok(())
}
