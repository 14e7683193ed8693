//! A stage of the user's own: the engine's GLSL with another rule for the depth that a target keeps of triangles. The left half of the
//! picture is drawn with 32 bits of depth, the right half with 8: far away, the road and the meadow under it flicker.
//!
//! `cargo run --release --example coarse_depth --features glsl` writes `coarse_depth.png`.

use glam::Vec3;
use glam::camera::rh::{proj::vulkan::perspective, view::look_at_mat4};
use std::{error::Error, fs::File};
use tilewright::image::png;
use tilewright::{
    ColorTarget, DepthTarget, Draw, Extent, Format, Gpu, GpuOptions, Pass, Picture, Pipeline,
    Renderer, Shader, Stage, compute,
};

/// A meadow, a road 5 cm above it, marks 2 cm above the road, and posts: rectangles, each an instance.
const VERTEX: &str = "#version 450
layout(push_constant) uniform Push { mat4 clip_of_world; };
layout(location = 0) out vec3 paint;
void main() {
    vec2 corner[6] = vec2[](vec2(0, 0), vec2(1, 0), vec2(1, 1), vec2(0, 0), vec2(1, 1), vec2(0, 1));
    vec2 at = corner[gl_VertexIndex] - vec2(0.5, 0.0);
    int i = gl_InstanceIndex;
    vec3 place = vec3(at.x * 200.0, 0.0, 10.0 - at.y * 150.0);
    paint = vec3(0.1, 0.3, 0.08);
    if (i == 1) {
        place = vec3(at.x * 7.0, 0.05, place.z);
        paint = vec3(0.12);
    } else if (i >= 2 && i < 32) {
        place = vec3(at.x * 0.4, 0.07, 4.0 - 5.0 * float(i - 2) - 2.5 * at.y);
        paint = vec3(0.9);
    } else if (i >= 32) {
        float side = i % 2 == 0 ? 1.0 : -1.0;
        place = vec3(side * 4.5 + at.x * 0.25, 1.3 * at.y, 2.0 - 5.0 * float((i - 32) / 2));
        paint = vec3(0.8, at.y > 0.7 ? 0.1 : 0.8, at.y > 0.7 ? 0.1 : 0.8);
    }
    gl_Position = clip_of_world * vec4(place, 1.0);
}";

const FRAGMENT: &str = "#version 450
layout(location = 0) in vec3 paint;
layout(location = 0) out vec4 color;
void main() { color = vec4(paint, 1.0); }";

/// The engine's rule for the depth that a target keeps, and one that keeps 8 bits of it. The engine takes the rule in every
/// place where it computes a depth or bounds of it, so that whatever it skips as hidden is hidden under this rule too.
const RULE: &str = "return d > 0.0 ? (d < 1.0 ? d : 1.0) : 0.0;";
const COARSE_RULE: &str = "return floor(clamp(d, 0.0, 1.0) * 255.0 + 0.5) * (1.0 / 255.0);";

/// A renderer whose depth targets keep 8 bits.
pub fn coarse(gpu: &Gpu) -> tilewright::Result<Renderer> {
    let file = "lib/depth.glsl";
    let (_, engine) = compute::GLSL.iter().find(|(name, _)| *name == file).expect("it is there");
    let depth = engine.replace(RULE, COARSE_RULE);
    assert_ne!(depth, *engine, "the rule is there");
    Renderer::with_glsl(gpu, &[(file, &depth)])
}

/// The road, drawn by `renderer`: colour and depth.
pub fn draw(renderer: &mut Renderer, extent: Extent) -> tilewright::Result<(Picture, Picture)> {
    let view = look_at_mat4(Vec3::new(0.9, 1.7, 6.0), Vec3::new(0.9, 0.9, 0.0), Vec3::Y);
    let aspect = extent.width as f32 / extent.height as f32;
    let clip_of_world = perspective(0.9, aspect, 0.5, 160.0) * view;
    let vertex = Shader::from_glsl(Stage::Vertex, "road.vert", VERTEX)?;
    let fragment = Shader::from_glsl(Stage::Fragment, "road.frag", FRAGMENT)?;
    let pass = Pass::new("road", extent)
        .colors([ColorTarget::cleared(Format::Rgba8Srgb, [0.4, 0.6, 0.9, 1.0])])
        .depth(DepthTarget::cleared(1.0))
        .pipelines([Pipeline::new("road", vertex, fragment)])
        .draws([Draw::new(0, 6).instances(92).push(&clip_of_world.to_cols_array())]);
    let frame = renderer.render(&pass)?;
    let [color] = frame.colors.try_into().expect("the pass has one colour target");
    Ok((color, frame.depth.expect("it is stored")))
}

fn main() -> Result<(), Box<dyn Error>> {
    let gpu = Gpu::open(&GpuOptions::default())?;
    let extent = Extent::new(800, 500);
    let (mut picture, _) = draw(&mut Renderer::new(&gpu)?, extent)?;
    let (coarse, _) = draw(&mut coarse(&gpu)?, extent)?;
    let row = picture.bytes.len() / extent.height as usize;
    for (fine, coarse) in picture.bytes.chunks_mut(row).zip(coarse.bytes.chunks(row)) {
        fine[row / 2..].copy_from_slice(&coarse[row / 2..]);
    }
    png::write_png(&picture, &[], File::create("coarse_depth.png")?)?;
    Ok(())
}
