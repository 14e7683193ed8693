//! Users' shaders: GLSL or SPIR-V in, reflection and spliced kernels out.
//!
//! A [`Shader`] is an ordinary Vulkan vertex or fragment shader, the very module that the device's
//! own graphics pipeline takes. `splice` turns its entry point into a function of one of the
//! engine's kernels.

mod block;
#[cfg(feature = "glsl-bundled")]
mod bundled;
mod compile;
pub mod conform;
mod engine;
mod file;
#[cfg(test)]
mod hostile;
mod include;
mod interface;
mod module;
mod reach;
mod reflect;
mod resource;
mod sampling;
mod scalar;
pub mod splice;
mod storage_format;
mod stored;
#[cfg(all(feature = "glsl", not(feature = "glsl-bundled")))]
mod system;
mod usage;
mod validate;
mod varying;

/// What tests of kernels elsewhere need of those here.
#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
pub(crate) mod testing {
    pub use super::{compile::tests::kernel, splice::tests::complaint};

    /// A shader of any kind, also one that no pass can draw with.
    pub fn any_shader(
        stage: super::Stage,
        label: &str,
        source: &str,
    ) -> crate::Result<super::Shader> {
        let words =
            super::compile::compile(stage, label, source, &super::include::Finder::default())?;
        super::Shader::reflected(stage, label, &words)
    }
}

use crate::{Error, Result, abi, format::Format, image::Shape, load_spirv::load};
pub(crate) use engine::Variant;
pub use file::FileOptions;
pub(crate) use resource::ResourceArray;
use rspirv::binary::Assemble as _;
pub use scalar::Scalar;
use std::fmt;
use std::hash::{DefaultHasher, Hash, Hasher};
use std::path::Path;
pub use stored::keep_compiled;
pub use varying::{Auxiliary, Distances, Interpolation, Varying};

/// Which stage a shader is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum Stage {
    /// Vertex shader.
    Vertex,
    /// Fragment shader.
    Fragment,
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Vertex => "vertex",
            Self::Fragment => "fragment",
        })
    }
}

/// A vertex or fragment shader: valid SPIR-V with entry point `main`, and what reflection found in it.
///
/// It cannot be changed, because drivers rely on valid modules. It binds only what a pass can provide:
/// textures, samplers, storage images, blocks, triangles. Whether all of its code is within reach is found
/// out when a pipeline is compiled ([`crate::Renderer::compile`]) or drawn with. Two shaders
/// are equal if they are the same stage of the same module, whatever their labels are.
#[derive(Clone, Debug)]
pub struct Shader {
    pub(crate) label: String,
    pub(crate) stage: Stage,
    pub(crate) spirv: Vec<u32>,
    pub(crate) reflection: Reflection,
    /// Why no pass can draw with it; `None` if one can. A shader with a reason can only be spliced.
    pub(crate) refusal: Option<String>,
    pub(crate) details: Details,
    /// Of the words. Equal hashes do not make shaders equal: the words are compared.
    pub(crate) hash: u64,
}

/// What executors have to know beside the [`Reflection`].
#[derive(Clone, Debug, Default)]
pub(crate) struct Details {
    /// `constant_id`s of the module whose constants are not 32 bits wide: a pipeline sets 32 bits.
    pub wide_constants: Vec<u32>,
    /// Resources that are declared as arrays, by number.
    pub arrays: Vec<ResourceArray>,
    /// `constant_id`s and defaults of the specialization constants that are lengths of these arrays.
    pub array_lengths: Vec<(u32, u32)>,
    /// Storage blocks that the shader may write, by number.
    pub written: Vec<u32>,
}

impl PartialEq for Shader {
    fn eq(&self, other: &Self) -> bool {
        self.hash == other.hash && self.stage == other.stage && self.spirv == other.spirv
    }
}

impl Eq for Shader {}

impl Hash for Shader {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.hash.hash(state);
    }
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

impl fmt::Display for ResourceKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            Self::Uniform => "a uniform block",
            Self::Storage => "a storage block",
            Self::Sampled => "an image with its sampler",
            Self::Texture => "an image without a sampler",
            Self::Sampler => "a sampler",
            Self::StorageImage => "a storage image",
        })
    }
}

/// Dimensionality of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Dimension {
    /// `sampler1D` and relatives.
    D1,
    /// `sampler2D` and relatives.
    D2,
    /// `sampler3D` and relatives.
    D3,
    /// `samplerCube` and relatives.
    Cube,
    /// Buffers as images, input attachments and what else there is.
    Other,
}

impl ImageShape {
    /// Whether it is an image of this shape.
    pub fn is(&self, shape: Shape) -> bool {
        let (dimension, arrayed) = match shape {
            Shape::D1 => (Dimension::D1, false),
            Shape::D1Array(_) => (Dimension::D1, true),
            Shape::D2 => (Dimension::D2, false),
            Shape::D2Array(_) => (Dimension::D2, true),
            Shape::D3(_) => (Dimension::D3, false),
            Shape::Cube => (Dimension::Cube, false),
            Shape::CubeArray(_) => (Dimension::Cube, true),
        };
        (self.dimension, self.arrayed) == (dimension, arrayed)
    }

    /// What two declarations at one place say together. `None` if no image is both.
    pub(crate) fn merged(self, other: Self) -> Option<Self> {
        let kind = |image: Self| (image.dimension, image.arrayed, image.texel);
        let formats_differ = self.format.zip(other.format).is_some_and(|(a, b)| a != b);
        let is_one = kind(self) == kind(other) && !formats_differ;
        is_one.then_some(Self { format: self.format.or(other.format), ..self })
    }
}

impl fmt::Display for ImageShape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let dimension = match self.dimension {
            Dimension::D1 => "one-dimensional",
            Dimension::D2 => "two-dimensional",
            Dimension::D3 => "three-dimensional",
            Dimension::Cube => "a cube",
            Dimension::Other => "of another kind",
        };
        let layers = if self.arrayed { ", with layers" } else { "" };
        write!(f, "{dimension}{layers}, of {}", self.texel)?;
        self.format.map_or(Ok(()), |format| write!(f, " ({format:?})"))
    }
}

/// The kind of an image that a shader declares.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ImageShape {
    /// Dimensionality.
    pub dimension: Dimension,
    /// `sampler2DArray` and relatives.
    pub arrayed: bool,
    /// `sampler2DMS` and relatives.
    pub multisampled: bool,
    /// `sampler2DShadow` and relatives. SPIR-V may leave it open; then this is `false`.
    pub shadow: bool,
    /// The type that a read returns.
    pub texel: Scalar,
    /// Storage images: the format that the shader declares, if it declares one.
    pub format: Option<Format>,
}

/// One resource of a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Resource {
    /// `layout(set = …)`.
    pub set: u32,
    /// `layout(binding = …)`.
    pub binding: u32,
    /// Its kind.
    pub kind: ResourceKind,
    /// Elements of the array (of all its dimensions), 1 if it is none, 0 if it is a run-time array.
    pub count: u32,
    /// Blocks: the bytes that a binding must have at least; 0 otherwise.
    pub bytes: u32,
    /// Images: the kind that the shader declares.
    pub image: Option<ImageShape>,
    /// Images and samplers: whether the shader samples with a comparison (`sampler2DShadow` and relatives).
    pub compares: bool,
    /// Images and samplers: whether the shader samples in a way for which coordinates have to be normalized: with implicit
    /// level of detail, a comparison, projection or an offset.
    pub needs_normalized: bool,
    /// Images and samplers: whether the shader samples integers, which are not filtered and have no border.
    pub samples_integers: bool,
}

/// The resources, inputs and outputs of a shader.
#[derive(Clone, Debug, Default)]
pub struct Reflection {
    /// Resources the entry point uses, each set and binding once, sorted.
    pub resources: Vec<Resource>,
    /// Bytes of the push-constant block, 0 if there is none.
    pub push_constant_bytes: u32,
    /// Inputs that are used (vertex: attributes), sorted by location and component. Arrays, matrices
    /// and structs appear as one entry per location.
    pub inputs: Vec<Varying>,
    /// Outputs that are used, in the same way.
    pub outputs: Vec<Varying>,
    /// `constant_id`s.
    pub specialization: Vec<u32>,
    /// Fragment: `discard`, `demote` or `terminateInvocation` is reachable.
    pub discards: bool,
    /// Vertex: may write `gl_PointSize`.
    pub writes_point_size: bool,
    /// Fragment: reads `gl_PointCoord`.
    pub reads_point_coord: bool,
    /// Fragment: writes `gl_FragDepth`.
    pub writes_depth: bool,
    /// Fragment: writes `gl_FragStencilRefARB`.
    pub writes_stencil: bool,
    /// Fragment: takes derivatives, explicitly or by sampling with implicit level of detail.
    pub takes_derivatives: bool,
    /// Writes memory or uses atomics.
    pub has_side_effects: bool,
    /// Fragment: `layout(early_fragment_tests)`.
    pub early_fragment_tests: bool,
    /// Fragment: it runs for each sample of a pixel, since it reads `gl_SampleID` or `gl_SamplePosition` or has an input that
    /// is a `sample`.
    pub per_sample: bool,
    /// Fragment: reads which samples are covered (`gl_SampleMaskIn`).
    pub reads_coverage: bool,
    /// Distances from planes that it writes; fragment: reads.
    pub distances: Distances,
    /// Fragment: interpolates inputs at places of its own (`interpolateAtSample` and relatives).
    pub interpolates: bool,
}

/// The SPIR-V of a compute kernel in GLSL.
///
/// # Errors
/// As [`Shader::from_glsl`].
pub(crate) fn compile_kernel(label: &str, source: &str) -> Result<Vec<u32>> {
    compile::kernel(label, source)
}

/// The SPIR-V of one of the engine's kernels: `text` of the file `label`, with the lines of `defines` after that of the version,
/// and with files that `read` finds in its includes. Float arithmetic rounds after every operation, as in all of them.
///
/// # Errors
/// As [`Shader::from_glsl`].
pub(crate) fn compile_stage(
    label: &str,
    text: &str,
    defines: &str,
    read: &dyn Fn(&str) -> Option<String>,
) -> Result<Vec<u32>> {
    let words = compile::stage(label, text, defines, read)?;
    let mut module = load(&words).map_err(|reason| Error::shader(label, reason))?;
    engine::forbid_contraction(&mut module);
    engine::number_constants(&mut module, abi::SPEC_FIRST);
    Ok(module.assemble())
}

/// Refuses a text that no compiler takes, naming the line.
///
/// # Errors
/// [`Error::Shader`].
pub(crate) fn check_text(label: &str, text: &str) -> Result<()> {
    compile::plain_ascii(text).map(drop).map_err(|reason| Error::shader(label, reason))
}

/// Whether `words` are a valid module, by the validator.
///
/// # Errors
/// As [`Shader::from_spirv`].
pub(crate) fn validate_kernel(label: &str, words: &[u32]) -> Result<()> {
    validate::validate(words).map_err(|reason| Error::shader(label, reason))
}

impl Shader {
    /// Compiles Vulkan GLSL (`source`) with entry point `main`.
    ///
    /// # Errors
    /// [`Error::Shader`] with the compiler's messages, which name lines of `source`; as
    /// [`Shader::from_spirv`]; or because the crate was built without a GLSL compiler (features `glsl` and
    /// `glsl-bundled`).
    pub fn from_glsl(stage: Stage, label: &str, source: &str) -> Result<Shader> {
        let words = compile::compile(stage, label, source, &include::Finder::default())?;
        Self::own(stage, label, &words)
    }

    /// Takes the file at `path`: SPIR-V (`.spv`) or Vulkan GLSL, which may include files that lie beside it.
    /// Names such as `a.vert`, `a.vs`, `a.frag.glsl` and `a.vert.spv` tell the stage. The label is `path`
    /// without `root`, if it lies under it.
    ///
    /// # Errors
    /// [`Error::Input`] if the file cannot be read or its stage is not known; [`Error::Shader`] as
    /// [`Shader::from_glsl`] and [`Shader::from_spirv`].
    pub fn from_file(root: &Path, path: &Path) -> Result<Shader> {
        Self::from_file_with(root, path, &FileOptions::default())
    }

    /// As [`Shader::from_file`], with properties that the file does not state: its stage, folders of included files.
    ///
    /// # Errors
    /// As [`Shader::from_file`].
    pub fn from_file_with(root: &Path, path: &Path, options: &FileOptions) -> Result<Shader> {
        Self::load(root, path, options)?.drawable()
    }

    /// As [`Shader::from_file_with`], also for shaders that no pass can draw with.
    pub(crate) fn load(root: &Path, path: &Path, options: &FileOptions) -> Result<Shader> {
        file::load(root, path, options)
    }

    /// Takes a SPIR-V module whose entry point for `stage` is called `main`.
    ///
    /// The module is validated first, by the program `spirv-val` of SPIRV-Tools: drivers crash on modules
    /// that are not valid.
    ///
    /// # Errors
    /// [`Error::Shader`] if the words are no module or have no such entry point, or if the shader asks for
    /// what no pass can give it; if they are not valid for Vulkan 1.3, with the validator's sentence; or if
    /// there is no `spirv-val` in `PATH`.
    pub fn from_spirv(stage: Stage, label: &str, words: &[u32]) -> Result<Shader> {
        Self::validated(stage, label, words)?.drawable()
    }

    /// As [`Shader::from_spirv`], for a module that is known to be valid: no validator is asked.
    ///
    /// # Safety
    /// The module is valid for Vulkan 1.3 as `spirv-val --target-env vulkan1.3 --scalar-block-layout`
    /// would say.
    ///
    /// # Errors
    /// As [`Shader::from_spirv`], but for validity.
    pub unsafe fn from_spirv_unchecked(stage: Stage, label: &str, words: &[u32]) -> Result<Shader> {
        Self::own(stage, label, words)
    }

    /// Takes a module that is known to be valid: one of the crate's own, or one that was validated.
    pub(crate) fn own(stage: Stage, label: &str, words: &[u32]) -> Result<Shader> {
        Self::reflected(stage, label, words)?.drawable()
    }

    /// As [`Shader::from_spirv`], also for shaders that no pass can draw with.
    pub(crate) fn validated(stage: Stage, label: &str, words: &[u32]) -> Result<Shader> {
        // Reflection follows types and calls, so it takes for granted that these end.
        validate::validate(words).map_err(|reason| Error::shader(label, reason))?;
        Self::reflected(stage, label, words)
    }

    /// As [`Shader::own`], also for shaders that no pass can draw with.
    pub(crate) fn reflected(stage: Stage, label: &str, words: &[u32]) -> Result<Shader> {
        let module = module::parse(words).map_err(|reason| Error::shader(label, reason))?;
        let (reflection, details, refusal) =
            reflect::reflect(&module, stage).map_err(|reason| Error::shader(label, reason))?;
        let mut hasher = DefaultHasher::new();
        words.hash(&mut hasher);
        let (label, hash) = (label.into(), hasher.finish());
        let spirv = words.to_vec();
        Ok(Shader { label, stage, spirv, reflection, refusal, details, hash })
    }

    /// The shader, if a pass can draw with it.
    fn drawable(self) -> Result<Shader> {
        match self.refusal {
            Some(reason) => Err(Error::shader(self.label, reason)),
            None => Ok(self),
        }
    }

    /// For messages: usually the file name.
    pub fn label(&self) -> &str {
        &self.label
    }

    /// The stage.
    pub fn stage(&self) -> Stage {
        self.stage
    }

    /// The module, unchanged, as the device's graphics pipeline takes it.
    pub fn spirv(&self) -> &[u32] {
        &self.spirv
    }

    /// In the list of numbers that a kernel gets for a draw, the one of the last element of resource `number`,
    /// if that is an array. The slots of the resources come first, then that of the push-constant block, then
    /// the last elements of all arrays.
    pub(crate) fn last_element(&self, number: u32) -> Option<u32> {
        let Reflection { resources, push_constant_bytes, .. } = &self.reflection;
        let slots = resources.len() as u32 + u32::from(*push_constant_bytes > 0);
        let array = self.details.arrays.iter().position(|array| array.number == number)?;
        Some(slots + array as u32)
    }

    /// Its resources, inputs and outputs.
    pub fn reflection(&self) -> &Reflection {
        &self.reflection
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shaders_are_equal_by_their_words_and_by_nothing_else() {
        let shader = |label: &str, words: &[u32], hash| Shader {
            label: label.into(),
            stage: Stage::Vertex,
            spirv: words.to_vec(),
            reflection: Reflection::default(),
            refusal: None,
            details: Details::default(),
            hash,
        };
        let one = shader("one", &[1, 2, 3], 7);
        assert_eq!(one, shader("another name", &[1, 2, 3], 7));
        // Hashes that collide are not enough.
        assert_ne!(one, shader("one", &[1, 2, 4], 7));
        assert_ne!(one, Shader { stage: Stage::Fragment, ..one.clone() });
    }
}
