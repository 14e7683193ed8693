//! glslang as this project sets it up.
//!
//! The one home of its options, for users' shaders (`compile`), the engine's kernels (the build
//! script takes this file in) and those of the tests (which do so too): what a kernel of a test
//! shows then holds for the engine's.

use glslang::{
    Compiler, CompilerOptions, ShaderInput, ShaderMessage, ShaderSource, ShaderStage,
    SourceLanguage, SpirvVersion, Target, VulkanVersion, error::GlslangError,
    include::IncludeHandler,
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

/// The SPIR-V of `source`, which is taken as it stands; `includes` finds the files that it names.
pub fn to_spirv<'a>(
    compiler: &Compiler,
    stage: ShaderStage,
    source: &'a ShaderSource,
    includes: Option<&'a mut (dyn IncludeHandler + 'a)>,
) -> Result<Vec<u32>, GlslangError> {
    let defines = None::<&[(&str, Option<&str>)]>;
    let input = ShaderInput::new(source, stage, &OPTIONS, defines, includes)?;
    compiler.create_shader(input)?.compile()
}
