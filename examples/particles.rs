//! Particles that never leave the device: a kernel moves them, keeps those that are still in the air, and writes the
//! draw command; the pass draws what the command says. Each frame is one submission.
//!
//! `cargo run --release --example particles --features glsl` writes `particles.png`.

use std::{error::Error, fs::File};
use tilewright::image::png;
use tilewright::pass::IndirectCommand;
use tilewright::state::{Blend, Topology};
use tilewright::{
    Buffer, BufferRange, ColorTarget, Draw, Extent, Format, Gpu, GpuOptions, Image, ImageInfo,
    ImageUse, Indirect, Kernel, LoadOp, Memory, Pass, Picture, Pipeline, Renderer, Shader, Stage,
    VertexAttribute, VertexBinding, VertexFormat,
};

const PARTICLES: u32 = 20_000;

/// Each particle follows its own parabola, which depends on its number alone. Those below the ground are not listed.
const MOVE: &str = "#version 460
layout(local_size_x = 64) in;
layout(push_constant) uniform Push { uint particles; float time; };
layout(binding = 0) writeonly buffer Shown { vec4 shown[]; };
layout(binding = 1) buffer Command { uint count, instances, first, first_instance; };
float random(uint n, uint salt) {
    n = (n ^ salt * 0x9e3779b9u) * 0x85ebca6bu;
    n = (n ^ n >> 15) * 0xc2b2ae35u;
    return float(n >> 8) / 16777216.0;
}
void main() {
    uint n = gl_GlobalInvocationID.x;
    if (n >= particles) return;
    float age = fract(time / 3.0 + random(n, 1u)) * 3.0;
    float turn = random(n, 2u) * 6.2832, out_of_axis = sqrt(random(n, 3u)) * 0.3;
    vec2 speed = vec2(cos(turn) * out_of_axis, 1.35 + 0.25 * random(n, 4u));
    vec2 at = vec2(0.0, -0.9) + speed * age - vec2(0.0, 0.62 * age * age);
    if (at.y < -0.9) return;
    shown[atomicAdd(instances, 1u)] = vec4(at, age / 3.0, random(n, 5u));
}";

const VERTEX: &str = "#version 450
layout(location = 0) in vec4 particle;
layout(location = 0) out vec2 corner;
layout(location = 1) out vec3 tint;
void main() {
    vec2 corners[4] = vec2[](vec2(-1, -1), vec2(1, -1), vec2(-1, 1), vec2(1, 1));
    corner = corners[gl_VertexIndex];
    vec2 at = particle.xy + corner * (0.004 + 0.006 * particle.w);
    gl_Position = vec4(at.x, -at.y, 0.5, 1.0);
    tint = mix(vec3(0.45, 0.7, 1.0), vec3(0.1, 0.15, 0.6), particle.z);
}";

const FRAGMENT: &str = "#version 450
layout(location = 0) in vec2 corner;
layout(location = 1) in vec3 tint;
layout(location = 0) out vec4 color;
void main() { color = vec4(tint, 0.5 * max(1.0 - dot(corner, corner), 0.0)); }";

/// Draws `frames` frames of `extent`; returns the last one and the particles that it shows.
pub fn fountain(gpu: &Gpu, extent: Extent, frames: u32) -> tilewright::Result<(Picture, u32)> {
    let (format, usage) = (Format::Rgba8Srgb, ImageUse::Attachment);
    let info = ImageInfo::new("fountain", extent, format, usage);
    let picture = Image::new(gpu, &info)?;
    let shown = Buffer::<[f32; 4]>::new(gpu, "shown", PARTICLES as usize, Memory::Device)?;
    let command = Buffer::<IndirectCommand>::new(gpu, "command", 1, Memory::Device)?;
    let kernel = Kernel::from_glsl(gpu, "move", MOVE)?;

    let vertex = Shader::from_glsl(Stage::Vertex, "particles.vert", VERTEX)?;
    let fragment = Shader::from_glsl(Stage::Fragment, "particles.frag", FRAGMENT)?;
    let pipeline = Pipeline::new("particles", vertex, fragment)
        .topology(Topology::TriangleStrip)
        .blend(Blend::ALPHA)
        .vertex_bindings([VertexBinding::per_instance(16)])
        .vertex_attributes([VertexAttribute::new(0, 0, VertexFormat::F32X4, 0)]);
    let draw = Draw::new(0, 0)
        .vertex_buffers([BufferRange::on_device(&shown)])
        .indirect(Indirect::new(&command, 2 * PARTICLES));
    let pass = Pass::new("particles", extent)
        .colors([ColorTarget::on_device(&picture, LoadOp::clear([0.0, 0.0, 0.01, 1.0]))])
        .pipelines([pipeline])
        .draws([draw]);

    let mut renderer = Renderer::new(gpu)?;
    for n in 0..frames {
        let mut frame = renderer.begin()?;
        // A strip of four vertices, and no instance yet.
        frame.upload(&command, &[IndirectCommand { count: 4, ..IndirectCommand::default() }])?;
        frame
            .kernel(&kernel)
            .bind("Shown", &shown)
            .bind("Command", &command)
            .push(&[PARTICLES, (n as f32 / 60.0).to_bits()])
            .dispatch([PARTICLES.div_ceil(64), 1, 1])?;
        frame.encode(&pass)?;
        frame.submit()?;
    }
    Ok((picture.download(0)?, command.download()?[0].instances))
}

fn main() -> Result<(), Box<dyn Error>> {
    let gpu = Gpu::open(&GpuOptions::default())?;
    let (picture, _) = fountain(&gpu, Extent::new(640, 480), 240)?;
    png::write_png(&picture, &[], File::create("particles.png")?)?;
    Ok(())
}
