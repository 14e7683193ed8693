//! GLSL to SPIR-V by the bundled compiler: glslang as the crate of that name brings it along.
//!
//! The tool that makes `glsl/spirv/` and the kernels of the tests include this file too, so that they are
//! compiled in one way.

use glslang::{
    Compiler, CompilerOptions, ShaderInput, ShaderMessage, ShaderSource, ShaderStage,
    SourceLanguage, SpirvVersion, Target, VulkanVersion,
    error::GlslangError,
    include::{IncludeHandler, IncludeResult, IncludeType},
};

const OPTIONS: CompilerOptions = CompilerOptions {
    source_language: SourceLanguage::GLSL,
    // For Vulkan 1.3 glslang emits SPIR-V 1.6, where the workgroup size is given by ids and other
    // instructions stand that `rspirv` does not read.
    target: Target::Vulkan {
        version: VulkanVersion::Vulkan1_2,
        spirv_version: SpirvVersion::SPIRV1_5,
    },
    version_profile: None,
    messages: ShaderMessage::SPV_RULES.union(ShaderMessage::VULKAN_RULES),
};

/// Finds a file to include: its name as it is written, the including file, the depth. Gives its path and
/// its text.
pub type Find<'a> = dyn Fn(&str, &str, usize) -> Option<(String, String)> + 'a;

struct Handler<'a>(&'a Find<'a>);

impl IncludeHandler for Handler<'_> {
    fn include(
        &mut self,
        _: IncludeType,
        name: &str,
        includer: &str,
        depth: usize,
    ) -> Option<IncludeResult> {
        (self.0)(name, includer, depth).map(|(name, data)| IncludeResult { name, data })
    }
}

/// The SPIR-V of `source`, which is taken as it stands. `stage` is a file's ending: `vert`, `frag` or
/// `comp`.
///
/// # Errors
/// The compiler's log, in which the source is called `0`.
pub fn compile(stage: &str, source: &str, find: &Find) -> Result<Vec<u32>, String> {
    let stage = match stage {
        "vert" => ShaderStage::Vertex,
        "frag" => ShaderStage::Fragment,
        _ => ShaderStage::Compute,
    };
    let compiler = Compiler::acquire().ok_or("the GLSL compiler does not start")?;
    let (source, mut handler) = (ShaderSource::from(source), Handler(find));
    let defines = None::<&[(&str, Option<&str>)]>;
    ShaderInput::new(&source, stage, &OPTIONS, defines, Some(&mut handler))
        .and_then(|input| compiler.create_shader(input)?.compile())
        .map_err(log)
}

fn log(error: GlslangError) -> String {
    match error {
        GlslangError::PreprocessError(log)
        | GlslangError::ParseError(log)
        | GlslangError::MapIoError(log)
        | GlslangError::LinkError(log) => log.log,
        GlslangError::InvalidProfile(_, version, _)
        | GlslangError::VersionUnsupported(version, _) => {
            format!("`#version {version}` is no version of GLSL that Vulkan takes")
        }
        other => other.to_string(),
    }
}
