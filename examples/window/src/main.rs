//! A window whose picture tilewright draws, frame by frame: into an image of its own, in a command buffer of this program,
//! which then copies the picture to the image that the window shows.
//!
//! `cargo run --release -p tilewright-window` shows a triangle that turns. With `-- 60` it ends after 60 frames.

mod screen;

use screen::Screen;
use std::error::Error;
use tilewright::{
    ColorTarget, Draw, Extent, Format, Gpu, GpuOptions, Image, ImageInfo, ImageUse, LoadOp, Pass,
    Pipeline, Renderer, Shader, Stage,
};
use winit::{
    application::ApplicationHandler,
    dpi::LogicalSize,
    event::WindowEvent,
    event_loop::{ActiveEventLoop, EventLoop},
    window::{Window, WindowId},
};

const VERTEX: &str = "#version 450
layout(push_constant) uniform Push { float angle; float aspect; };
layout(location = 0) out vec3 color;
void main() {
    float at = angle + gl_VertexIndex * 2.0943951;
    gl_Position = vec4(vec2(sin(at) / aspect, -cos(at)) * 0.8, 0.5, 1.0);
    color = vec3(gl_VertexIndex == 0, gl_VertexIndex == 1, gl_VertexIndex == 2);
}";

const FRAGMENT: &str = "#version 450
layout(location = 0) in vec3 color;
layout(location = 0) out vec4 result;
void main() { result = vec4(color, 1.0); }";

/// What is drawn. The fields are dropped in this order: all that was made from a device goes before the device.
struct View {
    renderer: Renderer,
    pass: Pass,
    target: Image,
    gpu: Gpu,
    screen: Screen,
    window: Window,
}

impl View {
    fn new(window: Window) -> Result<Self, Box<dyn Error>> {
        let (screen, gpu) = Screen::new(&window, &GpuOptions::default())?;
        let vertex = Shader::from_glsl(Stage::Vertex, "turn.vert", VERTEX)?;
        let fragment = Shader::from_glsl(Stage::Fragment, "turn.frag", FRAGMENT)?;
        let target = target(&gpu, screen.extent())?;
        let pass =
            Pass::new("turn", screen.extent()).pipelines([Pipeline::new("turn", vertex, fragment)]);
        Ok(Self { renderer: Renderer::new(&gpu)?, pass, target, gpu, screen, window })
    }

    /// Draws and shows frame number `frame`.
    fn draw(&mut self, frame: u32) -> Result<(), Box<dyn Error>> {
        let size = self.window.inner_size();
        if size.width == 0 || size.height == 0 {
            return Ok(());
        }
        if !self.screen.fits(Extent::new(size.width, size.height)) {
            self.screen.resize(Extent::new(size.width, size.height))?;
            self.target = target(&self.gpu, self.screen.extent())?;
        }
        let extent = self.screen.extent();
        let aspect = extent.width as f32 / extent.height as f32;
        let clear = LoadOp::clear([0.02, 0.02, 0.05, 1.0]);
        self.pass.extent = extent;
        self.pass.colors = vec![ColorTarget::on_device(&self.target, clear)];
        self.pass.draws = vec![Draw::new(0, 3).push(&[frame as f32 * 0.02, aspect])];
        let Self { renderer, pass, gpu, target, .. } = self;
        self.screen
            .show(gpu, target, |commands| renderer.record(commands, |frame| frame.encode(pass)))
    }
}

fn target(gpu: &Gpu, extent: Extent) -> tilewright::Result<Image> {
    Image::new(gpu, &ImageInfo::new("picture", extent, Format::Rgba8Srgb, ImageUse::Attachment))
}

/// The program: frames until the window is closed or there are enough.
struct Program {
    frames: u32,
    shown: u32,
    view: Option<View>,
    fault: Option<Box<dyn Error>>,
}

impl Program {
    fn end_if_failed(&mut self, events: &ActiveEventLoop, outcome: Result<(), Box<dyn Error>>) {
        if let Err(fault) = outcome {
            self.fault = Some(fault);
            events.exit();
        }
    }
}

impl ApplicationHandler for Program {
    fn resumed(&mut self, events: &ActiveEventLoop) {
        let attributes = Window::default_attributes()
            .with_title("tilewright")
            .with_inner_size(LogicalSize::new(640, 480));
        let made = events.create_window(attributes).map_err(Into::into).and_then(View::new);
        let made = made.map(|view| self.view = Some(view));
        self.end_if_failed(events, made);
    }

    fn window_event(&mut self, events: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        match event {
            WindowEvent::CloseRequested => events.exit(),
            WindowEvent::RedrawRequested => {
                let Some(view) = &mut self.view else { return };
                let drawn = view.draw(self.shown);
                view.window.request_redraw();
                self.end_if_failed(events, drawn);
                self.shown += 1;
                if self.shown >= self.frames {
                    events.exit();
                }
            }
            _ => {}
        }
    }

    fn exiting(&mut self, _: &ActiveEventLoop) {
        self.view = None;
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let frames = std::env::args().nth(1).map_or(Ok(u32::MAX), |frames| frames.parse())?;
    let mut program = Program { frames, shown: 0, view: None, fault: None };
    EventLoop::new()?.run_app(&mut program)?;
    program.fault.map_or(Ok(()), Err)
}
