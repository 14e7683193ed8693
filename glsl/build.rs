//! Checks before the crate compiles: `glsl/spirv/` has to be up to date (`stale`), and the feature `glsl` needs a
//! libshaderc that links (`shaderc`). The build script also records the commit that is built (`commit`).

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
