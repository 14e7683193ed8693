//! A textured cube that turns through a thousand frames. Each frame is recorded anew while the device draws the one
//! before; what changes is the matrix, which is pushed.
//!
//! `cargo run --release --example turntable --features glsl` writes `turntable.png`, the last frame.

use glam::camera::rh::{proj::vulkan::perspective, view::look_at_mat4};
use glam::{Mat4, Vec3};
use std::{error::Error, fs::File};
use tilewright::image::png;
use tilewright::{
    Binding, BindingSet, BufferRange, ColorTarget, DepthTarget, Draw, Extent, Format, Gpu,
    GpuOptions, Image, ImageInfo, ImageUse, IndexFormat, Indices, LoadOp, Pass, Picture, Pipeline,
    Renderer, Sampler, Shader, Stage, Texture, VertexAttribute, VertexBinding, VertexFormat,
};

const VERTEX: &str = "#version 450
layout(push_constant) uniform Push { mat4 clip_of_model; };
layout(location = 0) in vec3 position;
layout(location = 1) in vec2 coordinates;
layout(location = 0) out vec2 uv;
void main() {
    gl_Position = clip_of_model * vec4(position, 1.0);
    uv = coordinates;
}";

const FRAGMENT: &str = "#version 450
layout(set = 0, binding = 0) uniform sampler2D tiles;
layout(location = 0) in vec2 uv;
layout(location = 0) out vec4 color;
void main() { color = texture(tiles, uv); }";

/// Draws `frames` frames of `extent` and returns the last one.
pub fn turn(gpu: &Gpu, extent: Extent, frames: u32) -> tilewright::Result<Picture> {
    // The target lives on the device: frames draw to it, and nothing comes to the host in between.
    let (format, usage) = (Format::Rgba8Srgb, ImageUse::Attachment);
    let target = Image::new(gpu, &ImageInfo::new("turntable", extent, format, usage))?;
    // So does the texture. The host has its largest level, and the device makes the others.
    let info = ImageInfo::new("tiles", Extent::new(128, 128), format, usage).all_levels();
    let texture = Image::new(gpu, &info)?;
    texture.upload(&[tiles()])?;

    let vertex = Shader::from_glsl(Stage::Vertex, "turntable.vert", VERTEX)?;
    let fragment = Shader::from_glsl(Stage::Fragment, "turntable.frag", FRAGMENT)?;
    let pipeline = Pipeline::new("cube", vertex, fragment)
        .vertex_bindings([VertexBinding::per_vertex(20)])
        .vertex_attributes([
            VertexAttribute::new(0, 0, VertexFormat::F32X3, 0),
            VertexAttribute::new(1, 0, VertexFormat::F32X2, 12),
        ]);

    let (vertices, indices) = cube();
    let draw = Draw::new(0, indices.len() as u32)
        .vertex_buffers([BufferRange::host("corners", bytemuck::cast_slice(&vertices))])
        .indices(Indices::new(
            BufferRange::host("indices", bytemuck::cast_slice(&indices)),
            IndexFormat::U16,
        ))
        .sets([BindingSet::new([(
            0,
            Binding::sampled(Texture::on_device(&texture), Sampler::default()),
        )])])
        .push(&[0.0f32; 16]);
    let mut pass = Pass::new("turntable", extent)
        .colors([ColorTarget::on_device(&target, LoadOp::clear([0.02, 0.02, 0.03, 1.0]))])
        .depth(DepthTarget::transient(1.0))
        .pipelines([pipeline])
        .draws([draw]);

    let aspect = extent.width as f32 / extent.height as f32;
    let projection = perspective(0.7, aspect, 0.1, 10.0);
    let view = look_at_mat4(Vec3::new(0.0, 1.3, 2.6), Vec3::ZERO, Vec3::Y);
    let mut renderer = Renderer::new(gpu)?;
    let mut first = renderer.begin()?;
    first.make_levels(&texture)?;
    first.submit()?;
    for n in 0..frames {
        let model = Mat4::from_rotation_y(n as f32 * 0.0123);
        let matrix = projection * view * model;
        pass.draws[0].push_constants.copy_from_slice(bytemuck::bytes_of(&matrix.to_cols_array()));
        let mut frame = renderer.begin()?;
        frame.encode(&pass)?;
        frame.submit()?;
    }
    target.download(0)
}

/// The corners of a cube of side 1, position and texture coordinates, four for each side; and the two triangles of
/// each side.
fn cube() -> (Vec<[f32; 5]>, Vec<u16>) {
    let (mut vertices, mut indices) = (Vec::new(), Vec::new());
    for (side, normal) in
        [Vec3::X, -Vec3::X, Vec3::Y, -Vec3::Y, Vec3::Z, -Vec3::Z].iter().enumerate()
    {
        let across = normal.any_orthonormal_vector();
        let along = normal.cross(across);
        for (u, v) in [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)] {
            let at = (*normal + across * (2.0 * u - 1.0) + along * (2.0 * v - 1.0)) / 2.0;
            vertices.push([at.x, at.y, at.z, u, v]);
        }
        indices.extend([0, 1, 2, 0, 2, 3].map(|corner| side as u16 * 4 + corner));
    }
    (vertices, indices)
}

/// Texels of eight by eight tiles of two colours, 128 x 128 in all.
fn tiles() -> Vec<u8> {
    let texel = |i: usize| match (i % 128 / 16 + i / 128 / 16).is_multiple_of(2) {
        true => [236, 220, 190, 255],
        false => [60, 100, 130, 255],
    };
    (0..128 * 128).flat_map(texel).collect()
}

fn main() -> Result<(), Box<dyn Error>> {
    let gpu = Gpu::open(&GpuOptions::default())?;
    let last = turn(&gpu, Extent::new(640, 480), 1000)?;
    png::write_png(&last, &[], File::create("turntable.png")?)?;
    Ok(())
}
