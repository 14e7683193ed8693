//! Deferred lighting: a first pass stores what each pixel shows, and a second pass lights it. The first pass has two colour
//! targets, the colour and the normal with the distance. The second samples both, and many lights cost no more vertices.
//!
//! `cargo run --release --example gbuffer --features glsl` writes `gbuffer.png`.

use glam::camera::rh::{proj::vulkan::perspective, view::look_at_mat4};
use glam::{Mat4, Vec3};
use std::{error::Error, fs::File};
use tilewright::image::png;
use tilewright::{
    Binding, BindingSet, ColorTarget, DepthTarget, Draw, Extent, Format, Gpu, GpuOptions, Image,
    ImageInfo, ImageUse, LoadOp, Pass, Picture, Pipeline, Renderer, Sampler, Shader, Stage,
    Texture,
};

/// Tori, each an instance; the shader makes them, so that there are no buffers.
const VERTEX: &str = "#version 450
layout(push_constant) uniform Push { mat4 clip_of_world; vec4 eye; };
layout(location = 0) out vec3 at;
layout(location = 1) out vec3 normal;
layout(location = 2) flat out int number;
const int AROUND = 48, ACROSS = 24;
void main() {
    int cell = gl_VertexIndex / 6;
    ivec2 corner = ivec2[](ivec2(0), ivec2(1, 0), ivec2(1), ivec2(0), ivec2(1), ivec2(0, 1))[gl_VertexIndex % 6];
    vec2 angle = 6.2831853 * vec2(cell % AROUND + corner.x, cell / AROUND + corner.y) / vec2(AROUND, ACROSS);
    vec3 ring = vec3(cos(angle.x), 0.0, sin(angle.x));
    normal = ring * cos(angle.y) + vec3(0.0, sin(angle.y), 0.0);
    at = ring * 0.62 + normal * 0.26;
    float turn = 0.9 * gl_InstanceIndex;
    mat3 tilt = mat3(1, 0, 0, 0, cos(turn), sin(turn), 0, -sin(turn), cos(turn));
    vec3 place = vec3(gl_InstanceIndex % 3 - 1, 0.0, gl_InstanceIndex / 3 - 1) * 2.0;
    at = tilt * at + place;
    normal = tilt * normal;
    number = gl_InstanceIndex;
    gl_Position = clip_of_world * vec4(at, 1.0);
}";

const SURFACE: &str = "#version 450
layout(push_constant) uniform Push { mat4 clip_of_world; vec4 eye; };
layout(location = 0) in vec3 at;
layout(location = 1) in vec3 normal;
layout(location = 2) flat in int number;
layout(location = 0) out vec4 color;
layout(location = 1) out vec4 stored;
void main() {
    color = vec4(0.55 + 0.4 * cos(vec3(0.0, 2.1, 4.2) + number * 0.8), 1.0);
    stored = vec4(normalize(normal), distance(at, eye.xyz));
}";

const WHOLE: &str = "#version 450
layout(push_constant) uniform Push { mat4 world_of_clip; vec4 eye; };
layout(location = 0) out vec3 ray;
void main() {
    vec2 corner = vec2(4 * (gl_VertexIndex & 1) - 1, 4 * (gl_VertexIndex >> 1) - 1);
    gl_Position = vec4(corner, 0.0, 1.0);
    vec4 far = world_of_clip * vec4(corner, 1.0, 1.0);
    ray = far.xyz / far.w - eye.xyz;
}";

const LIGHT: &str = "#version 450
layout(push_constant) uniform Push { mat4 world_of_clip; vec4 eye; };
layout(set = 0, binding = 0) uniform sampler2D colors;
layout(set = 0, binding = 1) uniform sampler2D normals;
layout(location = 0) in vec3 ray;
layout(location = 0) out vec4 color;
void main() {
    ivec2 pixel = ivec2(gl_FragCoord.xy);
    vec4 stored = texelFetch(normals, pixel, 0);
    vec3 base = texelFetch(colors, pixel, 0).rgb;
    if (stored.w == 0.0) {
        color = vec4(0.02, 0.03, 0.06, 1.0);
        return;
    }
    vec3 at = eye.xyz + normalize(ray) * stored.w;
    vec3 lit = base * 0.06;
    for (int n = 0; n < 32; n++) {
        float turn = n * 2.399963;
        vec3 light = vec3(cos(turn) * sqrt(n + 0.5) * 0.55, 0.9, sin(turn) * sqrt(n + 0.5) * 0.55);
        vec3 to = light - at;
        float nearness = max(1.0 - length(to) / 1.8, 0.0);
        vec3 tint = 0.6 + 0.4 * cos(vec3(0.0, 2.1, 4.2) + n);
        lit += base * tint * max(dot(stored.xyz, normalize(to)), 0.0) * nearness * nearness * 2.2;
    }
    color = vec4(lit, 1.0);
}";

/// Draws one frame of `extent`.
pub fn draw(gpu: &Gpu, extent: Extent) -> tilewright::Result<Picture> {
    let image =
        |name, format| Image::new(gpu, &ImageInfo::new(name, extent, format, ImageUse::Attachment));
    let (colors, normals) =
        (image("colors", Format::Rgba8Unorm)?, image("normals", Format::Rgba16Float)?);
    let picture = image("picture", Format::Rgba8Srgb)?;
    let eye = Vec3::new(2.2, 4.4, 5.2);
    let aspect = extent.width as f32 / extent.height as f32;
    let clip_of_world =
        perspective(0.75, aspect, 0.1, 20.0) * look_at_mat4(eye, Vec3::ZERO, Vec3::Y);
    // The last row of the push constants: where the eye is.
    let push = |matrix: Mat4| {
        [matrix.to_cols_array_2d().as_slice(), &[[eye.x, eye.y, eye.z, 1.0]]].concat()
    };
    let pipeline = |vertex: &str, fragment: &str| -> tilewright::Result<Pipeline> {
        let vertex = Shader::from_glsl(Stage::Vertex, "gbuffer", vertex)?;
        Ok(Pipeline::new(
            "gbuffer",
            vertex,
            Shader::from_glsl(Stage::Fragment, "gbuffer", fragment)?,
        ))
    };
    let surfaces = Draw::new(0, 48 * 24 * 6)
        .push_constants(bytemuck::cast_slice(&push(clip_of_world)))
        .instances(9);

    let first = Pass::new("surfaces", extent)
        .colors([
            ColorTarget::on_device(&colors, LoadOp::clear([0.0; 4])),
            ColorTarget::on_device(&normals, LoadOp::clear([0.0; 4])),
        ])
        .depth(DepthTarget::transient(1.0))
        .pipelines([pipeline(VERTEX, SURFACE)?])
        .draws([surfaces]);

    let sampled = |image| Binding::sampled(Texture::on_device(image), Sampler::nearest());
    let second = Pass::new("light", extent)
        .colors([ColorTarget::on_device(&picture, LoadOp::clear([0.0; 4]))])
        .pipelines([pipeline(WHOLE, LIGHT)?])
        .draws([Draw::new(0, 3)
            .sets([BindingSet::new([(0, sampled(&colors)), (1, sampled(&normals))])])
            .push_constants(bytemuck::cast_slice(&push(clip_of_world.inverse())))]);

    let mut renderer = Renderer::new(gpu)?;
    let mut frame = renderer.begin()?;
    frame.encode(&first)?;
    frame.encode(&second)?;
    frame.submit()?.wait()?;
    picture.download(0)
}

fn main() -> Result<(), Box<dyn Error>> {
    let gpu = Gpu::open(&GpuOptions::default())?;
    let picture = draw(&gpu, Extent::new(800, 500))?;
    png::write_png(&picture, &[], File::create("gbuffer.png")?)?;
    Ok(())
}
