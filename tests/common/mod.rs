//! Helpers for tests on devices: they open a device with the validation layer on and fail on its messages, and they
//! compile a kernel from a few lines of GLSL.

pub mod allocations;
#[cfg(feature = "glsl-bundled")]
#[path = "../../src/shader/bundled.rs"]
mod compiler;
#[cfg(all(feature = "glsl", not(feature = "glsl-bundled")))]
#[path = "../../src/shader/system.rs"]
mod compiler;
pub mod mesh;
pub mod random;
pub mod vulkan;

use std::ops::Deref;
use tilewright::vk::{DeviceInfo, Gpu, GpuOptions, devices};

/// A device that fails the test if the validation layer said anything while it was open.
pub struct TestGpu(Gpu, bool);

impl Deref for TestGpu {
    type Target = Gpu;
    fn deref(&self) -> &Gpu {
        &self.0
    }
}

impl TestGpu {
    /// What the layer said, for a test that provokes it: it is then no failure.
    pub fn expect_messages(mut self) -> Vec<String> {
        self.1 = true;
        self.0.validation_messages()
    }
}

impl Drop for TestGpu {
    fn drop(&mut self) {
        let messages = self.0.validation_messages();
        if !self.1 && !std::thread::panicking() {
            assert!(messages.is_empty(), "validation: {}", messages.join("\n"));
        }
    }
}

/// The driver under test: lavapipe, or whichever one `VK_DRIVER_FILES` names first.
pub fn device_under_test() -> DeviceInfo {
    let found = devices().expect("a Vulkan driver; scripts/setup installs one");
    let first = found.iter().find(|d| !d.name.contains("SwiftShader")).or(found.first());
    first.expect("a Vulkan device; scripts/setup installs a driver").clone()
}

/// Opens the driver under test.
pub fn gpu() -> TestGpu {
    open(&device_under_test().index.to_string())
}

/// SwiftShader: another driver, subgroups of 4, no 64-bit integers. `None`, and a line that says so,
/// if it is not among the drivers.
pub fn swiftshader(case: &str) -> Option<TestGpu> {
    let found = devices().expect("a Vulkan driver; scripts/setup installs one");
    let Some(second) = found.iter().find(|d| d.name.contains("SwiftShader")) else {
        crate::did_not_run(
            case,
            "SwiftShader's json in VK_DRIVER_FILES, beside the first driver's",
        );
        return None;
    };
    Some(open(&second.index.to_string()))
}

/// Runs `case` on the driver under test, then on SwiftShader.
pub fn on_each_gpu(name: &str, case: impl Fn(&Gpu)) {
    case(&gpu());
    if let Some(second) = swiftshader(name) {
        case(&second);
    }
}

/// Opens a device with validation. Compiled GLSL is kept for the next run; pipelines are not.
pub fn open(device: &str) -> TestGpu {
    open_with(GpuOptions::default().device(device.to_string()))
}

/// As [`open`], with options of the test's own.
pub fn open_with(options: GpuOptions) -> TestGpu {
    let options = options.validation(true).cache(None);
    tilewright::shader::keep_compiled(tilewright::cache_folder());
    TestGpu(Gpu::open(&options).unwrap_or_else(|e| panic!("{e}")), false)
}

/// A compute shader as SPIR-V, as the engine's own kernels are compiled.
pub fn kernel_spirv(source: &str) -> Vec<u32> {
    compiler::compile("comp", source, &|_, _, _| None).unwrap_or_else(|log| panic!("{log}"))
}
