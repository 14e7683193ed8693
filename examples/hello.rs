//! Draws a triangle with the shader pair `hello.vert` and `hello.frag` beside this file.
//!
//! `cargo run --release --example hello --features glsl` writes `hello.png`.

use std::{error::Error, fs::File, sync::Arc};
use tilewright::compute::Renderer;
use tilewright::image::{Extent, png};
use tilewright::pass::{Draw, Executor, Frame, Pass, Pipeline};
use tilewright::shader::{Shader, Stage};
use tilewright::vk::{Gpu, GpuOptions};

pub fn draw() -> tilewright::Result<Frame> {
    let vertex = Shader::from_glsl(Stage::Vertex, "hello.vert", include_str!("hello.vert"))?;
    let fragment = Shader::from_glsl(Stage::Fragment, "hello.frag", include_str!("hello.frag"))?;

    let mut pass = Pass::new("hello", Extent::new(640, 480));
    pass.pipelines.push(Arc::new(Pipeline::new("hello", Arc::new(vertex), Arc::new(fragment))));
    pass.draws.push(Draw::new(0, 3));

    let gpu = Gpu::open(&GpuOptions::default())?;
    Renderer::new(&gpu)?.render(&pass)
}

fn main() -> Result<(), Box<dyn Error>> {
    png::write_png(&draw()?.colors[0], &[], File::create("hello.png")?)?;
    Ok(())
}
