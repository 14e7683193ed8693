//! GLSL to SPIR-V by the system's libshaderc. The kernels of the tests are compiled by this file too.

use shaderc::{
    CompileOptions, Compiler, EnvVersion, Error, ResolvedInclude, ShaderKind, SpirvVersion,
    TargetEnv,
};

/// Finds a file to include: its name as it is written, the including file, the depth. Gives its path and
/// its text.
pub type Find<'a> = dyn Fn(&str, &str, usize) -> Option<(String, String)> + 'a;

/// The SPIR-V of `source`, which is taken as it stands and not optimised: the driver does that. `stage`
/// is a file's ending: `vert`, `frag` or `comp`.
///
/// # Errors
/// The compiler's log, in which the source is called `0`.
pub fn compile(stage: &str, source: &str, find: &Find) -> Result<Vec<u32>, String> {
    let kind = match stage {
        "vert" => ShaderKind::Vertex,
        "frag" => ShaderKind::Fragment,
        _ => ShaderKind::Compute,
    };
    let compiler = Compiler::new().map_err(|e| e.to_string())?;
    let mut options = CompileOptions::new().map_err(|e| e.to_string())?;
    // For Vulkan 1.3 the compiler emits SPIR-V 1.6, where the workgroup size is given by ids and other
    // instructions stand that `rspirv` does not read.
    options.set_target_env(TargetEnv::Vulkan, EnvVersion::Vulkan1_2 as u32);
    options.set_target_spirv(SpirvVersion::V1_5);
    options.set_include_callback(move |name, _, includer, depth| {
        let found = find(name, includer, depth).filter(|(path, _)| !path.is_empty());
        let (resolved_name, content) = found.ok_or_else(|| format!("{name}: not found"))?;
        Ok(ResolvedInclude { resolved_name, content })
    });
    let compiled = compiler.compile_into_spirv(source, kind, "0", "main", Some(&options));
    compiled.map(|module| module.as_binary().to_vec()).map_err(|error| match error {
        Error::CompilationError(_, log) => log,
        other => other.to_string(),
    })
}
