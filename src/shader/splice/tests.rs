//! Every feature, spliced into the least kernels and checked by `spirv-val`.

use super::*;
use crate::shader::compile::tests::kernel;
use rspirv::dr;
use std::{path::Path, sync::LazyLock};

static VERTEX: LazyLock<Vec<u32>> =
    LazyLock::new(|| kernel(include_str!("../../../tests/fixtures/vertex.comp")));
static FRAGMENT: LazyLock<Vec<u32>> =
    LazyLock::new(|| kernel(include_str!("../../../tests/fixtures/fragment.comp")));

fn spliced(shader: &Shader, derivatives: Derivatives) -> Result<Vec<u32>> {
    let kernel = match shader.stage {
        Stage::Vertex => &VERTEX,
        Stage::Fragment => &FRAGMENT,
    };
    Ok(splice(kernel, shader, &SpliceOptions { derivatives, specialization: &[] })?.spirv)
}

/// What `spirv-val` has against a module.
fn complaint(words: &[u32]) -> Option<String> {
    use std::{
        io::Write,
        process::{Command, Stdio},
    };
    // The validator of Debian 12 knows the extension by its older name only.
    let mut module = module::parse(words).unwrap();
    if module.extensions.iter().any(|i| format!("{i:?}").contains("compute_shader_derivatives")) {
        let name = Operand::LiteralString("SPV_NV_compute_shader_derivatives".into());
        module.extensions.push(dr::Instruction::new(Op::Extension, None, None, vec![name]));
    }
    let bytes: Vec<u8> = module.assemble().iter().flat_map(|w| w.to_le_bytes()).collect();
    let mut child = Command::new("spirv-val")
        .args(["--target-env", "vulkan1.3", "--scalar-block-layout", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("the tests need spirv-val (Debian: spirv-tools); scripts/setup installs it");
    child.stdin.take().unwrap().write_all(&bytes).unwrap();
    let output = child.wait_with_output().unwrap();
    let text = [output.stdout, output.stderr].concat();
    (!output.status.success()).then(|| String::from_utf8_lossy(&text).into_owned())
}

/// Shaders of a folder under `tests/shaders`, with their first line.
fn shaders(folder: &str) -> Vec<(Stage, String, String)> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/shaders").join(folder);
    let mut found = Vec::new();
    for entry in std::fs::read_dir(path).unwrap() {
        let path = entry.unwrap().path();
        let stage = match path.extension().and_then(|e| e.to_str()) {
            Some("vert") => Stage::Vertex,
            Some("frag") => Stage::Fragment,
            _ => continue,
        };
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        found.push((stage, name, std::fs::read_to_string(&path).unwrap()));
    }
    found.sort_by(|a, b| a.1.cmp(&b.1));
    assert!(found.len() > 10);
    found
}

#[test]
fn features_splice_and_validate() {
    for (stage, name, source) in shaders("") {
        let shader = Shader::from_glsl(stage, &name, &source).unwrap();
        for tier in [Derivatives::Native, Derivatives::Quad] {
            let refused =
                source.starts_with("// refused without native") && tier == Derivatives::Quad;
            match spliced(&shader, tier) {
                Ok(words) => {
                    assert!(!refused, "{name} with {tier:?}");
                    if let Some(text) = complaint(&words) {
                        panic!("{name} with {tier:?}: {text}");
                    }
                }
                Err(e) => assert!(refused, "{tier:?}: {e}"),
            }
        }
    }
}

#[test]
fn what_is_out_of_reach_is_refused_by_name() {
    for (stage, name, source) in shaders("refused") {
        let first = source.lines().next().unwrap();
        let wanted = first.strip_prefix("// refused: ").expect("the first line says why");
        let result = Shader::from_glsl(stage, &name, &source)
            .and_then(|shader| spliced(&shader, Derivatives::Native));
        let text = result.expect_err(&name).to_string();
        assert!(text.contains(wanted) && text.contains(&name), "{name}: {text}");
    }
}
