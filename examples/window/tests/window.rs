//! Does the window show the picture, also after its size has changed? On an X server without a screen.

use std::{
    io::{BufRead, BufReader},
    process::{Child, Command, Stdio},
    time::{Duration, Instant},
};
use x11rb::{
    connection::Connection,
    protocol::xproto::{ConfigureWindowAux, ConnectionExt, ImageFormat, Window},
    rust_connection::RustConnection,
};

/// A server or a program that ends with the test.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// Starts a server on a display that is free. Tests on a busy machine wait long.
fn server() -> (Running, String) {
    let mut server = Command::new("Xvfb")
        .args(["-displayfd", "1", "-screen", "0", "1024x768x24", "-nolisten", "tcp"])
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .unwrap_or_else(|e| panic!("Xvfb does not start ({e}): `scripts/setup check` installs it"));
    let mut display = String::new();
    BufReader::new(server.stdout.take().unwrap()).read_line(&mut display).unwrap();
    (Running(server), format!(":{}", display.trim()))
}

fn program(display: &str, arguments: &[&str]) -> Command {
    let mut program = Command::new(env!("CARGO_BIN_EXE_tilewright-window"));
    program.args(arguments).env("DISPLAY", display).env_remove("WAYLAND_DISPLAY");
    // The driver under test alone: SwiftShader, the second one, crashes when it is asked what a surface can do.
    let drivers = std::env::var("VK_DRIVER_FILES").unwrap_or_default();
    if let Some(first) = drivers.split(':').next().filter(|first| !first.is_empty()) {
        program.env("VK_DRIVER_FILES", first);
    }
    // The layer prints what it finds to standard output.
    program.env("VK_INSTANCE_LAYERS", "VK_LAYER_KHRONOS_validation");
    program.env("VK_LAYER_ENABLES", "VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT");
    program
}

/// Red, green and blue of the pixels of `window`.
fn pixels(x: &RustConnection, window: Window, (width, height): (u16, u16)) -> Option<Vec<[u8; 3]>> {
    let image = x.get_image(ImageFormat::Z_PIXMAP, window, 0, 0, width, height, u32::MAX).ok()?;
    Some(image.reply().ok()?.data.chunks_exact(4).map(|b| [b[2], b[1], b[0]]).collect())
}

/// Waits until the window shows the triangle, whose area is known.
fn wait_for_picture(x: &RustConnection, program: &mut Running, size: (u16, u16)) {
    let root = x.setup().roots[0].root;
    let (width, height) = (f64::from(size.0), f64::from(size.1));
    // An equilateral triangle whose corners are 0.4 heights from the middle.
    let expected = 0.75 * 3f64.sqrt() * (0.4 * height).powi(2) / (width * height);
    let started = Instant::now();
    let mut seen = String::from("no window");
    while started.elapsed() < Duration::from_secs(120) {
        assert!(program.0.try_wait().unwrap().is_none(), "the program has ended");
        std::thread::sleep(Duration::from_millis(50));
        let Some(&window) = x.query_tree(root).unwrap().reply().unwrap().children.first() else {
            continue;
        };
        let Some(pixels) = pixels(x, window, size) else { continue };
        let count = |is: fn(&[u8; 3]) -> bool| pixels.iter().filter(|pixel| is(pixel)).count();
        let background = count(|p| *p == [39, 39, 63]);
        let covered = 1.0 - background as f64 / pixels.len() as f64;
        let mains = [
            count(|p| p[0] > 220 && p[1] < 140 && p[2] < 140),
            count(|p| p[1] > 220 && p[0] < 140 && p[2] < 140),
            count(|p| p[2] > 220 && p[0] < 140 && p[1] < 140),
        ];
        if (covered / expected - 1.0).abs() < 0.03 && mains.iter().all(|&count| count > 100) {
            return;
        }
        seen = format!(
            "{covered} of it covered, not {expected}; {mains:?} pixels of the corners' colours"
        );
    }
    panic!("the window does not show the triangle: {seen}");
}

#[test]
fn the_window_shows_the_picture_at_any_size() {
    let (_server, display) = server();
    let mut program = Running(program(&display, &[]).stdout(Stdio::null()).spawn().unwrap());
    let (x, _) = x11rb::connect(Some(&display)).unwrap();
    wait_for_picture(&x, &mut program, (640, 480));
    let root = x.setup().roots[0].root;
    for (width, height) in [(700, 300), (320, 320)] {
        let window = x.query_tree(root).unwrap().reply().unwrap().children[0];
        let size = ConfigureWindowAux::new().width(width).height(height);
        x.configure_window(window, &size).unwrap().check().unwrap();
        wait_for_picture(&x, &mut program, (width as u16, height as u16));
    }
}

#[test]
fn the_program_ends_after_its_frames_and_the_validation_layer_is_silent() {
    let (_server, display) = server();
    let output = program(&display, &["20"]).output().unwrap();
    let said =
        [output.stdout, output.stderr].map(|text| String::from_utf8_lossy(&text).into_owned());
    assert!(output.status.success() && said == ["", ""], "{}: {said:?}", output.status);
}
