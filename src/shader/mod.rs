//! Users' shaders: GLSL or SPIR-V in, reflection and spliced kernels out.
//!
//! A [`Shader`] is an ordinary Vulkan vertex or fragment shader, the very module that the device's
//! own graphics pipeline takes. `splice` turns its entry point into a function of one of the
//! engine's kernels.

use crate::error::Result;

/// Which stage a shader is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stage {
    /// Vertex shader.
    Vertex,
    /// Fragment shader.
    Fragment,
}

/// A vertex or fragment shader: SPIR-V with entry point `main`, and what reflection found in it.
#[derive(Clone, Debug)]
pub struct Shader {
    /// For messages: usually the file name.
    pub label: String,
    /// The stage.
    pub stage: Stage,
    /// The module, unchanged, as the device's graphics pipeline takes it.
    pub spirv: Vec<u32>,
    /// What it binds, reads and writes.
    pub reflection: Reflection,
}

/// What kind of resource a shader binds at one `(set, binding)`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum ResourceKind {
    /// A uniform block.
    Uniform,
    /// A storage block.
    Storage,
    /// An image with its sampler (`sampler2D` and its relatives).
    Sampled,
    /// An image without a sampler (`texture2D` and its relatives).
    Texture,
    /// A sampler.
    Sampler,
    /// A storage image.
    StorageImage,
}

/// One resource of a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Resource {
    /// `layout(set = …)`.
    pub set: u32,
    /// `layout(binding = …)`.
    pub binding: u32,
    /// What it is.
    pub kind: ResourceKind,
    /// Elements of the array, 1 if it is none.
    pub count: u32,
}

/// What a shader binds, reads and writes.
#[derive(Clone, Debug, Default)]
pub struct Reflection {
    /// Resources the entry point uses, sorted by set and binding.
    pub resources: Vec<Resource>,
    /// Bytes of the push-constant block, 0 if there is none.
    pub push_constant_bytes: u32,
    /// Input locations (vertex: attributes), as (location, whether it is a float).
    pub inputs: Vec<(u32, bool)>,
    /// Locations written, including all of an array, matrix or struct.
    pub outputs: Vec<u32>,
    /// `constant_id`s.
    pub specialization: Vec<u32>,
    /// Fragment: `discard`, `demote` or `terminateInvocation` is reachable.
    pub discards: bool,
    /// Fragment: writes `gl_FragDepth`.
    pub writes_depth: bool,
    /// Writes memory or uses atomics.
    pub has_side_effects: bool,
    /// Fragment: `layout(early_fragment_tests)`.
    pub early_fragment_tests: bool,
}

impl Shader {
    /// Compiles Vulkan GLSL (`source`) with entry point `main`.
    ///
    /// # Errors
    /// [`crate::Error::Shader`] with the compiler's messages, which name lines of `source`.
    #[cfg(feature = "glsl")]
    pub fn from_glsl(_stage: Stage, _label: &str, _source: &str) -> Result<Shader> {
        todo!()
    }

    /// Takes a SPIR-V module whose entry point for `stage` is called `main`.
    ///
    /// # Errors
    /// [`crate::Error::Shader`] if the words are no module or have no such entry point.
    pub fn from_spirv(_stage: Stage, _label: &str, _words: &[u32]) -> Result<Shader> {
        todo!()
    }
}
