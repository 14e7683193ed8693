//! Two passes of one frame: the first draws what the light sees into a depth image, the second samples that image to
//! find what lies in shadow.
//!
//! `cargo run --release --example shadow --features glsl` writes `shadow.png`.

use glam::Vec3;
use glam::camera::rh::{
    proj::vulkan::{orthographic, perspective},
    view::look_at_mat4,
};
use std::{error::Error, fs::File};
use tilewright::image::png;
use tilewright::state::{Compare, DepthBias};
use tilewright::{
    Binding, BindingSet, ColorTarget, DepthTarget, Draw, Extent, Format, Gpu, GpuOptions, Image,
    ImageInfo, ImageUse, LoadOp, Pass, Picture, Pipeline, Renderer, Sampler, Shader, Stage,
    Texture,
};

/// Boxes on a floor, each an instance of 36 vertices. The shader makes them, so that there are no buffers.
const BOXES: &str = "
const vec4 boxes[5] = vec4[]( // middle, and half the side; the last one is the floor
    vec4(-1.1, 0.5, 0.2, 0.5), vec4(0.3, 0.3, -0.6, 0.3), vec4(0.9, 0.7, 0.5, 0.4),
    vec4(0.2, 0.2, 0.9, 0.2), vec4(0.0, -2.4, 0.0, 2.4));
vec3 normal() {
    int side = gl_VertexIndex / 6;
    vec3 axis = vec3(side % 3 == 0, side % 3 == 1, side % 3 == 2);
    return side < 3 ? axis : -axis;
}
vec3 corner() {
    vec3 n = normal();
    vec2 square[6] = vec2[](vec2(-1, -1), vec2(1, -1), vec2(1, 1), vec2(-1, -1), vec2(1, 1), vec2(-1, 1));
    vec2 at = square[gl_VertexIndex % 6];
    vec4 b = boxes[gl_InstanceIndex];
    return b.xyz + b.w * (n + n.yzx * at.x + n.zxy * at.y);
}
";

const LIGHT_VERTEX: &str = "
layout(push_constant) uniform Push { mat4 light_of_world; };
void main() { gl_Position = light_of_world * vec4(corner(), 1.0); }";

/// A pass without a colour target needs no output.
const LIGHT_FRAGMENT: &str = "#version 450
void main() {}";

const VERTEX: &str = "
layout(push_constant) uniform Push { mat4 clip_of_world; mat4 light_of_world; };
layout(location = 0) out vec3 facing;
layout(location = 1) out vec4 in_light;
void main() {
    gl_Position = clip_of_world * vec4(corner(), 1.0);
    in_light = light_of_world * vec4(corner(), 1.0);
    facing = normal();
}";

const FRAGMENT: &str = "#version 450
layout(set = 0, binding = 0) uniform sampler2DShadow shadow_map;
layout(location = 0) in vec3 facing;
layout(location = 1) in vec4 in_light;
layout(location = 0) out vec4 color;
void main() {
    vec2 at = in_light.xy * 0.5 + 0.5;
    float slope = dot(facing, normalize(vec3(2.0, 4.0, 1.5)));
    float lit = 0.0;
    for (int y = -1; y <= 1; y++) {
        for (int x = -1; x <= 1; x++) {
            vec2 step = vec2(x, y) / textureSize(shadow_map, 0);
            lit += textureLod(shadow_map, vec3(at + step, in_light.z), 0) / 9.0;
        }
    }
    vec3 base = mix(vec3(0.75, 0.45, 0.3), vec3(0.6, 0.62, 0.65), facing.y);
    color = vec4(base * (0.15 + 0.85 * lit * max(slope, 0.0)), 1.0);
}";

/// Draws one frame of `extent`.
pub fn draw(gpu: &Gpu, extent: Extent) -> tilewright::Result<Picture> {
    let image = |name, extent, format| {
        Image::new(gpu, &ImageInfo::new(name, extent, format, ImageUse::Attachment))
    };
    let shadow_map = image("shadow map", Extent::new(1024, 1024), Format::D32Float)?;
    let picture = image("picture", extent, Format::Rgba8Srgb)?;
    let from_light = look_at_mat4(Vec3::new(2.0, 4.0, 1.5), Vec3::ZERO, Vec3::Y);
    let light = orthographic(-3.6, 3.6, -3.6, 3.6, 0.1, 10.0) * from_light;
    let from_eye = look_at_mat4(Vec3::new(-1.5, 2.2, 4.2), Vec3::new(0.0, 0.2, 0.0), Vec3::Y);
    let aspect = extent.width as f32 / extent.height as f32;
    let eye = perspective(0.7, aspect, 0.1, 20.0) * from_eye;
    let pipeline = |label: &str, vertex: &str, fragment: &str| -> tilewright::Result<_> {
        let vertex = format!("#version 450\n{BOXES}{vertex}");
        let vertex = Shader::from_glsl(Stage::Vertex, label, &vertex)?;
        Ok(Pipeline::new(label, vertex, Shader::from_glsl(Stage::Fragment, label, fragment)?))
    };
    let boxes = Draw::new(0, 36).instances(5);

    let first = Pass::new("what the light sees", shadow_map.extent())
        .colors([])
        .depth(DepthTarget::on_device(&shadow_map, LoadOp::Clear(1.0)))
        .pipelines([pipeline("light", LIGHT_VERTEX, LIGHT_FRAGMENT)?])
        // The map keeps one depth for a texel. A surface that the light sees at an angle would shadow itself: the bias moves it back
        // by the depth that it changes from texel to texel.
        .draws([boxes.clone().push(&light.to_cols_array()).depth_bias(DepthBias::new(4.0, 3.0))]);

    let sampler = Sampler::nearest().compare(Some(Compare::LessOrEqual));
    let shadow = Binding::sampled(Texture::on_device(&shadow_map), sampler);
    let second = Pass::new("what the eye sees", extent)
        .colors([ColorTarget::on_device(&picture, LoadOp::clear([0.3, 0.4, 0.5, 1.0]))])
        .depth(DepthTarget::transient(1.0))
        .pipelines([pipeline("eye", VERTEX, FRAGMENT)?])
        .draws([boxes
            .sets([BindingSet::new([(0, shadow)])])
            .push(&[eye, light].map(|m| m.to_cols_array()))]);

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
    png::write_png(&picture, &[], File::create("shadow.png")?)?;
    Ok(())
}
