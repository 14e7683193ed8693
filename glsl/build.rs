//! What has to be right before the crate compiles: `glsl/spirv/` is up to date (`stale`), and for the feature
//! `glsl` there is a libshaderc that links (`shaderc`). It also tells which commit is built (`commit`).

use std::process::ExitCode;

mod commit;
mod shaderc;
mod source;
mod stale;

fn main() -> ExitCode {
    println!("cargo:rerun-if-changed=glsl");
    commit::tell();
    let glsl = std::env::var_os("CARGO_FEATURE_GLSL").is_some();
    let found = if glsl { shaderc::find() } else { Ok("none".into()) };
    match stale::check().and(found) {
        Ok(libshaderc) => {
            println!("cargo:rustc-env=LIBSHADERC={libshaderc}");
            ExitCode::SUCCESS
        }
        Err(reason) => {
            eprintln!("{reason}");
            ExitCode::FAILURE
        }
    }
}
