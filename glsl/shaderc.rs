//! Finds a libshaderc that links, for the feature `glsl`.
//!
//! The crate `shaderc-sys` links whichever `libshaderc.so` it finds. The one of Debian 12 lacks half its symbols.
//! If there is no library, the crate compiles one, which takes a quarter of an hour. So the library is tried
//! here first. If the shared one does not link, the static archives beside it stand in for it: a linker script
//! called `libshaderc.so`, in a folder that is searched before the system's, names them.

use std::{
    env, fs,
    path::{Path, PathBuf},
    process::{Command, Stdio},
};

/// The static archives of Debian 12, shaderc's own first. Archives that do not exist are left out: other
/// releases have fewer.
const ARCHIVES: &[&str] = &[
    "shaderc_combined",
    "glslang",
    "MachineIndependent",
    "GenericCodeGen",
    "OSDependent",
    "OGLCompiler",
    "HLSL",
    "SPIRV",
    "SPIRV-Tools-opt",
    "SPIRV-Tools",
];

const ADVICE: &str = "the feature `glsl` needs the system's libshaderc, and no program links with it here. \
    Install it (Debian, Ubuntu: sudo apt-get install libshaderc-dev) or name its folder in SHADERC_LIB_DIR; \
    or take the feature `glsl-bundled` instead, which compiles a GLSL compiler from C++ (some minutes)";

/// Identifies the library, by a text that changes when the library is replaced.
///
/// # Errors
/// The steps to take, if no library links.
pub fn find() -> Result<String, String> {
    for variable in ["SHADERC_LIB_DIR", "VULKAN_SDK"] {
        println!("cargo:rerun-if-env-changed={variable}");
        // A library that the user names is used as it is; shaderc-sys does the same.
        if let Ok(folder) = env::var(variable) {
            return Ok(folder);
        }
    }
    let of = |variable: &str| env::var(variable).unwrap_or_default();
    if of("CARGO_CFG_TARGET_OS") != "linux" || of("HOST") != of("TARGET") {
        return Ok("the platform's".into());
    }
    let out = PathBuf::from(of("OUT_DIR"));
    let system = PathBuf::from(format!("/usr/lib/{}-linux-gnu", of("CARGO_CFG_TARGET_ARCH")));
    let shared = system.join("libshaderc.so");
    if let Some(line) = watch(&shared) {
        println!("{line}");
    }
    if links(&out, None) {
        return Ok(format!("shared {}", age(&shared)));
    }
    let archives: Vec<PathBuf> = ARCHIVES
        .iter()
        .map(|name| system.join(format!("lib{name}.a")))
        .filter(|a| a.exists())
        .collect();
    let names: Vec<String> = archives.iter().map(|a| a.display().to_string()).collect();
    let script = format!("GROUP ( {} -lstdc++ -lm )\n", names.join(" "));
    let folder = out.join("shaderc");
    let written =
        fs::create_dir_all(&folder).and_then(|()| fs::write(folder.join("libshaderc.so"), script));
    if written.is_ok() && !archives.is_empty() && links(&out, Some(&folder)) {
        println!("cargo:rustc-link-search=native={}", folder.display());
        return Ok(format!("static {}", age(&archives[0])));
    }
    Err(ADVICE.into())
}

/// The line that has cargo watch `file`; none if the file is not there, since cargo would take it as changed
/// and build anew each time.
pub fn watch(file: &Path) -> Option<String> {
    file.exists().then(|| format!("cargo:rerun-if-changed={}", file.display()))
}

/// Whether a program that calls the library links, and runs.
fn links(out: &Path, folder: Option<&Path>) -> bool {
    let (source, program) = (out.join("try.c"), out.join("try"));
    let text = "void *shaderc_compiler_initialize(void);\n\
                int main(void) { return !shaderc_compiler_initialize(); }\n";
    if fs::write(&source, text).is_err() {
        return false;
    }
    let mut cc = Command::new(env::var_os("CC").unwrap_or("cc".into()));
    cc.arg(&source).arg("-o").arg(&program);
    if let Some(folder) = folder {
        cc.arg("-L").arg(folder);
    }
    let quiet = |command: &mut Command| {
        let status = command.stdout(Stdio::null()).stderr(Stdio::null()).status();
        status.is_ok_and(|status| status.success())
    };
    quiet(cc.arg("-lshaderc")) && quiet(&mut Command::new(&program))
}

/// Size and time of a file: another one has others.
fn age(file: &Path) -> String {
    let Ok(data) = fs::metadata(file) else { return "of unknown age".into() };
    let time = data.modified().ok().and_then(|t| t.duration_since(std::time::UNIX_EPOCH).ok());
    format!("{} {}", data.len(), time.map_or(0, |t| t.as_secs()))
}
