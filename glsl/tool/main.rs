//! Compiles the GLSL that the library contains (kernels, the scenes' shaders, the benchmark's, the id
//! shader) to the files of `glsl/spirv/`, which the library includes. `cargo spirv` runs it.
//!
//! Every machine makes the same files: the compiler is bundled as source, in one version. The test below
//! proves that the files in the repository are those.

use engine::Variant;
use rspirv::{binary::Assemble, dr::Module};
use std::{
    cell::RefCell,
    collections::{BTreeMap, BTreeSet, HashSet},
    fs, io,
    path::{Path, PathBuf},
    process::ExitCode,
};

#[path = "../../src/shader/bundled.rs"]
mod bundled;
mod constants;
#[path = "../../src/shader/engine.rs"]
mod engine;
mod layout;
#[path = "../source.rs"]
mod source;

/// The files that are neither kernels nor compiled once: name of the result, file, stage, macros.
const VARIANTS: &[(&str, &str, &str, &str)] = &[
    ("material.vert", "scene/material.vert", "vert", ""),
    ("material.frag", "scene/material.frag", "frag", ""),
    ("material-mask.frag", "scene/material.frag", "frag", "#define ALPHA_MASK\n"),
    ("surface-0.vert", "bench/surface.vert", "vert", "#define VARYINGS 0\n"),
    ("surface-4.vert", "bench/surface.vert", "vert", "#define VARYINGS 4\n"),
    ("surface-8.vert", "bench/surface.vert", "vert", "#define VARYINGS 8\n"),
    ("surface-12.vert", "bench/surface.vert", "vert", "#define VARYINGS 12\n"),
    ("surface-0.frag", "bench/surface.frag", "frag", "#define VARYINGS 0\n"),
    ("surface-4.frag", "bench/surface.frag", "frag", "#define VARYINGS 4\n"),
    ("surface-8.frag", "bench/surface.frag", "frag", "#define VARYINGS 8\n"),
    ("surface-12.frag", "bench/surface.frag", "frag", "#define VARYINGS 12\n"),
    (
        "surface-0-several.frag",
        "bench/surface.frag",
        "frag",
        "#define VARYINGS 0\n#define SEVERAL_TARGETS\n",
    ),
    (
        "surface-4-several.frag",
        "bench/surface.frag",
        "frag",
        "#define VARYINGS 4\n#define SEVERAL_TARGETS\n",
    ),
    (
        "surface-8-several.frag",
        "bench/surface.frag",
        "frag",
        "#define VARYINGS 8\n#define SEVERAL_TARGETS\n",
    ),
    (
        "surface-12-several.frag",
        "bench/surface.frag",
        "frag",
        "#define VARYINGS 12\n#define SEVERAL_TARGETS\n",
    ),
    ("copy.comp", "bench/copy.comp", "comp", ""),
    ("atomic.comp", "bench/atomic.comp", "comp", ""),
    ("id.frag", "compare/id.frag", "frag", ""),
];

fn main() -> ExitCode {
    let glsl = glsl();
    let written = outputs(&glsl).and_then(|files| {
        write(&glsl.join("spirv"), &files).map_err(|e| format!("{}: {e}", glsl.display()))
    });
    match written {
        Ok(changed) if changed.is_empty() => eprintln!("glsl/spirv/ is up to date"),
        Ok(changed) => eprintln!("glsl/spirv/: made {}", changed.join(", ")),
        Err(reason) => {
            eprintln!("{reason}");
            return ExitCode::FAILURE;
        }
    }
    ExitCode::SUCCESS
}

fn glsl() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}

/// Names and contents of the files of `glsl/spirv/`.
fn outputs(glsl: &Path) -> Result<BTreeMap<String, Vec<u8>>, String> {
    let defines = constants::defines();
    let mut files = BTreeMap::new();
    let mut sources = BTreeMap::new();
    let used = RefCell::new(BTreeSet::new());
    let plain = source::reader(glsl);
    let read = |name: &str| {
        used.borrow_mut().insert(name.to_string());
        plain(name)
    };
    for name in kernels(glsl)? {
        let text = source::expand(&read, &name)?;
        if name == "abi.comp" {
            let module = load(&name, &compile(&name, &text, "comp", &defines)?)?;
            let structs = layout::assertions(&module, &text);
            let all = format!(
                "//! The constants and layouts that the kernels were compiled with. Made by `cargo spirv`.\n\nuse crate::{{abi, format, state, stencil}};\n\n{}{structs}",
                constants::assertions()
            );
            files.insert("layout.rs".into(), all.into_bytes());
        } else {
            for variant in Variant::all(&text, constants::abi::MAX_COLORS) {
                let all = format!("{defines}{}", variant.macros());
                let mut module = load(&name, &compile(&name, &text, "comp", &all)?)?;
                engine::forbid_contraction(&mut module);
                engine::number_constants(&mut module, constants::abi::SPEC_FIRST);
                forget_local_names(&mut module);
                files.insert(format!("{}.spv", file_of(&name, variant)), bytes(&module.assemble()));
            }
        }
        sources.insert(name, text);
    }
    // It is no kernel, see there.
    used.borrow_mut().remove("abi.comp");
    files.insert("files.rs".into(), list_of_files(&used.take()).into_bytes());
    files.insert("defines.glsl".into(), defines.into_bytes());
    for (name, file, stage, defines) in VARIANTS {
        let text = source::expand(&read, file)?;
        // As users' shaders: nothing is done to the module.
        files.insert(format!("{name}.spv"), bytes(&compile(file, &text, stage, defines)?));
        sources.insert((*file).into(), text);
    }
    let list: String = sources.iter().map(|(name, text)| source::entry(name, text)).collect();
    files.insert(source::LIST.into(), list.into_bytes());
    Ok(files)
}

/// The name of a variant of the kernel of the file `name`.
fn file_of(name: &str, variant: Variant) -> String {
    let any = if variant.any_format { "any-" } else { "" };
    let distances = if variant.distances { "distances-" } else { "" };
    let colors = if variant.colors == 1 { String::new() } else { format!("{}-", variant.colors) };
    format!("{any}{colors}{distances}{name}")
}

/// A list of the files that kernels are made of, for the library.
fn list_of_files(names: &BTreeSet<String>) -> String {
    let all: String = names
        .iter()
        .map(|name| format!("    (\"{name}\", include_str!(\"../{name}\")),\n"))
        .collect();
    format!(
        "//! The GLSL of the kernels. Made by `cargo spirv`.\n\npub const FILES: &[(&str, &str)] = &[\n{all}];\n"
    )
}

/// The kernels: every `.comp` that lies in `glsl/` itself.
fn kernels(glsl: &Path) -> Result<Vec<String>, String> {
    let entries = fs::read_dir(glsl).map_err(|e| format!("{}: {e}", glsl.display()))?;
    let mut names: Vec<String> = entries
        .filter_map(|entry| entry.ok()?.file_name().into_string().ok())
        .filter(|name| name.ends_with(".comp"))
        .collect();
    names.sort();
    Ok(names)
}

/// SPIR-V of `text` with `defines` after its `#version` line.
fn compile(name: &str, text: &str, stage: &str, defines: &str) -> Result<Vec<u32>, String> {
    let version = text.find("#version ").ok_or(format!("{name}: no `#version` line"))?;
    let after = version + text[version..].find('\n').map_or(text.len() - version, |end| end + 1);
    let text = format!("{}{defines}{}", &text[..after], &text[after..]);
    bundled::compile(stage, &text, &|_, _, _| None).map_err(|error| {
        let numbered: String =
            text.lines().enumerate().map(|(n, l)| format!("{:4} {l}\n", n + 1)).collect();
        format!("{numbered}\n{name}: {error}")
    })
}

fn load(name: &str, words: &[u32]) -> Result<Module, String> {
    rspirv::dr::load_words(words).map_err(|e| format!("{name}: {e}"))
}

/// Drops the names of ids inside functions: nothing is looked up by them, and they are a tenth of a module.
fn forget_local_names(module: &mut Module) {
    let local: HashSet<u32> = module
        .functions
        .iter()
        .flat_map(|f| f.parameters.iter().chain(f.blocks.iter().flat_map(|b| &b.instructions)))
        .filter_map(|i| i.result_id)
        .collect();
    module.debug_names.retain(|i| !local.contains(&i.operands[0].unwrap_id_ref()));
}

fn bytes(words: &[u32]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

/// Makes `folder` hold `files` and nothing else; the names of those that changed.
fn write(folder: &Path, files: &BTreeMap<String, Vec<u8>>) -> io::Result<Vec<String>> {
    fs::create_dir_all(folder)?;
    let mut changed = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if !files.contains_key(&name) {
            fs::remove_file(entry.path())?;
            changed.push(format!("no more {name}"));
        }
    }
    for (name, content) in files {
        let path = folder.join(name);
        if fs::read(&path).is_ok_and(|old| old == *content) {
            continue;
        }
        fs::write(path, content)?;
        changed.push(name.clone());
    }
    Ok(changed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_in_an_included_file_shows_in_the_list() {
        let text = source::expand(&source::reader(&glsl()), "raster.comp").unwrap();
        let edge = fs::read_to_string(glsl().join("lib/edge.glsl")).unwrap();
        let line = edge.lines().rev().find(|line| line.len() > 20).unwrap();
        assert!(text.contains(line), "{line}");
        let changed = text.replace(line, "");
        assert_ne!(source::entry("raster.comp", &text), source::entry("raster.comp", &changed));
    }

    #[test]
    fn the_files_in_the_repository_are_what_their_glsl_gives() {
        let glsl = glsl();
        let wanted = outputs(&glsl).unwrap_or_else(|reason| panic!("{reason}"));
        let found: BTreeMap<String, Vec<u8>> = fs::read_dir(glsl.join("spirv"))
            .unwrap()
            .map(|entry| entry.unwrap())
            .map(|e| (e.file_name().into_string().unwrap(), fs::read(e.path()).unwrap()))
            .collect();
        let names: HashSet<&String> = wanted.keys().chain(found.keys()).collect();
        let mut differing: Vec<&String> =
            names.into_iter().filter(|name| wanted.get(*name) != found.get(*name)).collect();
        differing.sort();
        assert!(
            differing.is_empty(),
            "glsl/spirv/ is out of date: {differing:?}. Run `cargo spirv`."
        );
    }
}
