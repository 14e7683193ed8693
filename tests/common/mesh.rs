//! A pipeline that draws coloured triangles from places in clip space.

use tilewright::{
    format::VertexFormat,
    pass::{BufferRange, Draw, Pipeline, VertexAttribute, VertexBinding},
    shader::{Shader, Stage},
};

/// The vertex shader of [`pipeline`].
pub const VERTEX: &str = "#version 450
    layout(location = 0) in vec4 corner;
    layout(location = 1) in vec4 tint;
    layout(location = 0) out vec4 color;
    void main() { gl_Position = corner; color = tint; }";

/// A fragment shader for [`pipeline`]: the colour of the corners.
pub const FRAGMENT: &str = "#version 450
    layout(location = 0) in vec4 color;
    layout(location = 0) out vec4 written;
    void main() { written = color; }";

/// A pipeline for [`draw`].
pub fn pipeline(fragment: &str) -> Pipeline {
    let shader =
        |stage, text| Shader::from_glsl(stage, "mesh", text).unwrap_or_else(|e| panic!("{e}"));
    Pipeline::new("mesh", shader(Stage::Vertex, VERTEX), shader(Stage::Fragment, fragment))
        .vertex_bindings([VertexBinding::per_vertex(32)])
        .vertex_attributes([
            VertexAttribute::new(0, 0, VertexFormat::F32X4, 0),
            VertexAttribute::new(1, 0, VertexFormat::F32X4, 16),
        ])
}

/// A vertex: its place in clip space and its colour.
pub type Corner = [[f32; 4]; 2];

/// A draw of all of `corners`.
pub fn draw(pipeline: usize, corners: &[Corner]) -> Draw {
    let range = BufferRange::host("corners", bytemuck::cast_slice(corners).to_vec());
    Draw::new(pipeline, corners.len() as u32).vertex_buffers([range])
}
