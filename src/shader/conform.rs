//! How far a folder of shaders gets: compiled, spliced, made into kernels.
//!
//! Every shader (see [`Shader::from_file`]) is compiled, spliced into each of the engine's own kernels of its stage,
//! and the result is checked (see `splice/verify.rs`). The caller, who has the device, makes the kernels: it
//! passes a function that gets each shader whose splicing succeeded.

use super::{
    FileOptions, Shader, Stage, file,
    splice::{Blocks, Derivatives, SpliceOptions, splice, verify},
};
use crate::{Error, Result, prebuilt};
use std::path::{Path, PathBuf};

/// How far a shader got before it was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Step {
    /// The file does not compile, or is no shader that could be spliced.
    Compile,
    /// Splicing refuses it.
    Splice,
    /// The spliced module is not valid: a fault of the splicer.
    Check,
    /// The device refuses the kernel.
    Create,
}

impl Step {
    /// A word for reports.
    pub const fn name(self) -> &'static str {
        match self {
            Step::Compile => "compile",
            Step::Splice => "splice",
            Step::Check => "check",
            Step::Create => "create",
        }
    }
}

/// A shader that was refused.
#[derive(Clone, Debug)]
pub struct Refusal {
    /// The file, as seen from the folder.
    pub file: PathBuf,
    /// Where it got stuck.
    pub step: Step,
    /// Why.
    pub reason: String,
}

/// The result for a folder.
#[derive(Clone, Debug, Default)]
pub struct Conformance {
    /// Shaders found.
    pub files: usize,
    /// Shaders that compile.
    pub compiled: usize,
    /// Shaders that were spliced, with a valid result.
    pub spliced: usize,
    /// Shaders of which the device made kernels.
    pub created: usize,
    /// The others, in the order of their files.
    pub refusals: Vec<Refusal>,
}

/// Tries every shader under `folder`, to any depth.
///
/// `create` makes a shader's kernels; its errors count as refusals. `progress` hears how many files
/// are done and how many there are.
///
/// # Errors
/// [`Error::Input`] if the folder cannot be read.
pub fn conform(
    folder: &Path,
    options: &FileOptions,
    derivatives: Derivatives,
    create: &mut dyn FnMut(&Shader) -> Result<()>,
    progress: &mut dyn FnMut(usize, usize),
) -> Result<Conformance> {
    let mut files = Vec::new();
    find(folder, options.stage.is_some(), &mut files)?;
    files.sort();
    let mut result = Conformance { files: files.len(), ..Conformance::default() };
    for (done, path) in files.iter().enumerate() {
        progress(done, files.len());
        if let Err((step, reason)) =
            attempt(folder, path, options, derivatives, create, &mut result)
        {
            let file = path.strip_prefix(folder).unwrap_or(path).to_path_buf();
            result.refusals.push(Refusal { file, step, reason });
        }
    }
    progress(files.len(), files.len());
    Ok(result)
}

fn attempt(
    folder: &Path,
    path: &Path,
    options: &FileOptions,
    derivatives: Derivatives,
    create: &mut dyn FnMut(&Shader) -> Result<()>,
    result: &mut Conformance,
) -> std::result::Result<(), (Step, String)> {
    let shader = Shader::load(folder, path, options).map_err(|e| (Step::Compile, reason(e)))?;
    result.compiled += 1;
    let kernels: &[&[u32]] = match shader.stage {
        Stage::Vertex => &[prebuilt::VERTEX],
        Stage::Fragment => &[prebuilt::SHADE, prebuilt::ORDERED],
    };
    let both = [Blocks::InPlace, Blocks::Prefetched];
    for (kernel, blocks) in kernels.iter().flat_map(|kernel| both.map(|b| (kernel, b))) {
        let wanted = SpliceOptions { derivatives, blocks, specialization: &[] };
        let spliced = splice(kernel, &shader, &wanted).map_err(|e| (Step::Splice, reason(e)))?;
        verify::verify(&spliced.spirv).map_err(|e| (Step::Check, e))?;
    }
    result.spliced += 1;
    create(&shader).map_err(|e| (Step::Create, reason(e)))?;
    result.created += 1;
    Ok(())
}

/// The error without the file, which stands beside it.
fn reason(error: Error) -> String {
    match error {
        Error::Shader { reason, .. } | Error::Input { reason, .. } => reason,
        other => other.to_string(),
    }
}

/// Collects shaders; if the stage is given, those too whose names tell none. A link to a folder is not
/// followed, so the search ends.
fn find(folder: &Path, stage_given: bool, files: &mut Vec<PathBuf>) -> Result<()> {
    let entries = std::fs::read_dir(folder).map_err(|e| Error::input(folder, e))?;
    for entry in entries {
        let entry = entry.map_err(|e| Error::input(folder, e))?;
        let (path, kind) = (entry.path(), entry.file_type());
        let glsl = path.extension().is_some_and(|e| e.eq_ignore_ascii_case("glsl"));
        match kind {
            Ok(kind) if kind.is_dir() => find(&path, stage_given, files)?,
            Ok(_) if stage_given && glsl || file::is_shader(&path) => files.push(path),
            _ => {}
        }
    }
    Ok(())
}

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_counted_and_each_refusal_says_why() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/shaders");
        let (mut seen, mut created) = (Vec::new(), 0);
        let mut create = |shader: &Shader| {
            created += 1;
            match shader.label.as_str() {
                "view.frag" => Err(Error::Device("no".into())),
                _ => Ok(()),
            }
        };
        let options = FileOptions::default();
        let result =
            conform(&folder, &options, Derivatives::Native, &mut create, &mut |done, all| {
                seen.push((done, all));
            })
            .unwrap();
        assert_eq!(seen.len(), result.files + 1);
        assert_eq!(seen.last(), Some(&(result.files, result.files)));
        assert_eq!(result.created + result.refusals.len(), result.files);
        assert_eq!(result.created + 1, created, "{:?}", result.refusals);
        for refusal in &result.refusals {
            match refusal.file.to_str().unwrap() {
                "view.frag" => assert_eq!(refusal.step, Step::Create),
                file => assert!(file.starts_with("refused"), "{refusal:?}"),
            }
            assert!(!refusal.reason.is_empty());
        }
        let gone = conform(
            &folder.join("none"),
            &options,
            Derivatives::Quad,
            &mut |_| Ok(()),
            &mut |_, _| {},
        );
        assert!(gone.unwrap_err().to_string().contains("none"));
    }
}
