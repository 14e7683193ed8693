//! Shaders from files: finds the stage and the language of a file.

use super::{Shader, Stage, compile, include};
use crate::{Error, Result};
use rspirv::spirv::{ExecutionModel, MAGIC_NUMBER, Op};
use std::path::{Path, PathBuf};

/// Properties of a shader that its file does not state.
#[derive(Clone, Debug, Default)]
pub struct FileOptions {
    /// The stage. Without it, a `#pragma shader_stage(…)` or the file's name says it, or the entry
    /// point of a SPIR-V module.
    pub stage: Option<Stage>,
    /// Folders in which to look for included files, after those of the including file and the shader.
    pub include: Vec<PathBuf>,
}

/// The language and the stage, as a file's name tells them.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Language {
    Glsl,
    SpirV,
    Hlsl,
}

/// Language and stage by the name: `a.vert`, `a.vs`, `a.vert.glsl`, `a.frag.spv`, `a.spv`. `None` for
/// files of other kinds and for other stages.
fn by_name(path: &Path) -> Option<(Language, Option<Stage>)> {
    let name = path.file_name()?.to_str()?.to_ascii_lowercase();
    let (stem, language) = match name.rsplit_once('.')? {
        (stem, "glsl") => (stem, Language::Glsl),
        (stem, "spv") => (stem, Language::SpirV),
        (stem, "hlsl") => (stem, Language::Hlsl),
        _ => (name.as_str(), Language::Glsl),
    };
    let ending = stem.rsplit_once('.').map_or("", |(_, ending)| ending);
    let stage = match ending {
        "vert" | "vs" | "vsh" => Some(Stage::Vertex),
        "frag" | "fs" | "fsh" => Some(Stage::Fragment),
        "comp" | "geom" | "tesc" | "tese" | "mesh" | "task" | "rgen" | "rint" | "rahit"
        | "rchit" | "rmiss" | "rcall" => return None,
        _ if stem == name => return None,
        _ => None,
    };
    Some((language, stage))
}

/// Whether the file is to be taken for a shader. A `.glsl` file whose name tells no stage is one that
/// others include, unless it says its stage itself.
pub(super) fn is_shader(path: &Path) -> bool {
    match by_name(path) {
        Some((Language::Glsl, None)) => {
            std::fs::read_to_string(path).is_ok_and(|text| by_pragma(&text).is_some())
        }
        found => found.is_some(),
    }
}

/// The stage that `#pragma shader_stage(vertex)` names.
fn by_pragma(source: &str) -> Option<Stage> {
    source.lines().find_map(|line| {
        let pragma = line.trim().strip_prefix('#')?.trim_start().strip_prefix("pragma")?;
        let stage = pragma.trim().strip_prefix("shader_stage")?.trim();
        match stage.strip_prefix('(')?.split(')').next()?.trim() {
            "vertex" => Some(Stage::Vertex),
            "fragment" => Some(Stage::Fragment),
            _ => None,
        }
    })
}

/// The stage of the first entry point `main`.
fn by_entry_point(words: &[u32]) -> Option<Stage> {
    let mut at = 5;
    while let Some(&first) = words.get(at) {
        if first & 0xffff == Op::EntryPoint as u32 {
            match words.get(at + 1) {
                Some(&model) if model == ExecutionModel::Vertex as u32 => {
                    return Some(Stage::Vertex);
                }
                Some(&model) if model == ExecutionModel::Fragment as u32 => {
                    return Some(Stage::Fragment);
                }
                _ => {}
            }
        }
        at += (first >> 16).max(1) as usize;
    }
    None
}

/// Reads the shader at `path`; its label is `path` without `root`.
pub(super) fn load(root: &Path, path: &Path, options: &FileOptions) -> Result<Shader> {
    let bytes = std::fs::read(path).map_err(|e| Error::input(path, e))?;
    let label = path.strip_prefix(root).unwrap_or(path).display().to_string();
    let named = by_name(path);
    let of_name = options.stage.or(named.and_then(|(_, stage)| stage));
    let no_stage = || {
        Error::input(
            path,
            "its stage is not known: name it .vert or .frag, write `#pragma shader_stage(vertex)` or \
             `(fragment)` into it, or give the stage",
        )
    };
    let magic = bytes.get(..4).is_some_and(|b| b == MAGIC_NUMBER.to_le_bytes());
    match named.map_or(Language::Glsl, |(language, _)| language) {
        Language::Hlsl => Err(Error::input(
            path,
            "HLSL is not compiled here: make SPIR-V of it (`dxc -spirv`) and hand that in",
        )),
        language if language == Language::SpirV || magic => {
            if bytes.len() % 4 != 0 {
                return Err(Error::shader(
                    &label,
                    "not a SPIR-V module: its size is no multiple of 4",
                ));
            }
            let words: Vec<u32> = bytes
                .chunks_exact(4)
                .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
                .collect();
            let stage = of_name.or_else(|| by_entry_point(&words)).ok_or_else(no_stage)?;
            Shader::validated(stage, &label, &words)
        }
        _ => {
            let source = String::from_utf8_lossy(&bytes);
            // A stage that the caller gives overrides a pragma, and a pragma overrides the name.
            let stage = options.stage.or_else(|| by_pragma(&source)).or(of_name);
            let stage = stage.ok_or_else(no_stage)?;
            let finder = include::Finder::new(path, &options.include);
            let source = include::allowed(&source);
            let words = compile::compile(stage, &label, &source, &finder)?;
            Shader::reflected(stage, &label, &words)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_stage_and_language() {
        let told = |name: &str| {
            by_name(Path::new(name)).map(|(language, stage)| (language == Language::SpirV, stage))
        };
        for name in ["a.vert", "a.vs", "a.VSH", "a.vert.glsl"] {
            assert_eq!(told(name), Some((false, Some(Stage::Vertex))), "{name}");
        }
        for name in ["a.frag", "a.fs", "a.fsh", "a.b.fs.glsl", "a.frag.hlsl"] {
            assert_eq!(told(name), Some((false, Some(Stage::Fragment))), "{name}");
        }
        assert_eq!(told("a.spv"), Some((true, None)));
        assert_eq!(told("a.frag.spv"), Some((true, Some(Stage::Fragment))));
        for name in ["a.comp", "a.comp.spv", "a.geom.glsl", "a.txt", "vert", "frag"] {
            assert_eq!(told(name), None, "{name}");
        }
    }

    #[test]
    fn a_pragma_tells_the_stage() {
        assert_eq!(
            by_pragma("#version 450\n # pragma shader_stage( vertex )\n"),
            Some(Stage::Vertex)
        );
        assert_eq!(by_pragma("#pragma shader_stage(fragment)"), Some(Stage::Fragment));
        assert_eq!(by_pragma("#pragma shader_stage(compute)\n// fragment"), None);
    }

    #[test]
    fn modules_are_taken_from_files() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("module.spv");
        let words = crate::prebuilt::ID;
        let bytes: Vec<u8> = words.iter().flat_map(|w| w.to_le_bytes()).collect();
        std::fs::write(&path, &bytes).unwrap();
        assert!(is_shader(&path));
        let shader = load(folder.path(), &path, &FileOptions::default()).unwrap();
        assert_eq!((shader.stage(), shader.spirv()), (Stage::Fragment, words));
        std::fs::write(&path, &bytes[..bytes.len() - 1]).unwrap();
        let fault = load(folder.path(), &path, &FileOptions::default()).unwrap_err().to_string();
        assert!(fault.contains("multiple of 4"), "{fault}");
    }
}
