//! Draws a triangle with the shader pair `hello.vert` and `hello.frag` beside this file.
//!
//! `cargo run --release --example hello --features glsl` writes `hello.png`.

use std::{error::Error, fs::File};
use tilewright::image::png;
use tilewright::{Draw, Extent, Frame, Gpu, GpuOptions, Pass, Pipeline, Renderer, Shader, Stage};

pub fn draw() -> tilewright::Result<Frame> {
    let vertex = Shader::from_glsl(Stage::Vertex, "hello.vert", include_str!("hello.vert"))?;
    let fragment = Shader::from_glsl(Stage::Fragment, "hello.frag", include_str!("hello.frag"))?;

    let pass = Pass::new("hello", Extent::new(640, 480))
        .pipelines([Pipeline::new("hello", vertex, fragment)])
        .draws([Draw::new(0, 3)]);

    let gpu = Gpu::open(&GpuOptions::default())?;
    Renderer::new(&gpu)?.render(&pass)
}

fn main() -> Result<(), Box<dyn Error>> {
    png::write_png(&draw()?.colors[0], &[], File::create("hello.png")?)?;
    Ok(())
}
