//! Every feature, spliced into the least kernels and checked by `spirv-val`.

use super::*;
use crate::prebuilt;
use crate::shader::{compile::tests::kernel, testing::any_shader};
use rspirv::dr;
use std::{
    io::Write,
    path::Path,
    process::{Command, Stdio},
    sync::LazyLock,
};

/// The kernels of a stage: the engine's, and the least one there can be.
fn hosts(stage: Stage) -> &'static [Vec<u32>] {
    static VERTEX: LazyLock<Vec<Vec<u32>>> = LazyLock::new(|| {
        let least = kernel(include_str!("../../../tests/fixtures/vertex.comp"));
        vec![prebuilt::VERTEX.to_vec(), least]
    });
    static FRAGMENT: LazyLock<Vec<Vec<u32>>> = LazyLock::new(|| {
        let least = kernel(include_str!("../../../tests/fixtures/fragment.comp"));
        vec![prebuilt::SHADE.to_vec(), prebuilt::ORDERED.to_vec(), least]
    });
    match stage {
        Stage::Vertex => &VERTEX,
        Stage::Fragment => &FRAGMENT,
    }
}

/// Splices into each kernel of the stage and checks the results.
fn try_all(shader: &Shader, derivatives: Derivatives) -> Result<()> {
    let both = [Blocks::InPlace, Blocks::Prefetched];
    for (host, blocks) in hosts(shader.stage).iter().flat_map(|host| both.map(|b| (host, b))) {
        let options = SpliceOptions { derivatives, blocks, specialization: &[] };
        let words = splice(host, shader, &options)?.spirv;
        if let Err(text) = verify::verify(&words) {
            panic!("{} with {derivatives:?}: {text}", shader.label);
        }
        if let Some(text) = complaint(&words) {
            panic!("{} with {derivatives:?}: {text}", shader.label);
        }
    }
    Ok(())
}

/// The module as an optimizer leaves it: values instead of variables.
fn optimized(shader: &Shader) -> Shader {
    let bytes: Vec<u8> = shader.spirv.iter().flat_map(|w| w.to_le_bytes()).collect();
    let arguments = ["-O", "--target-env=vulkan1.3", "--scalar-block-layout", "-", "-o", "-"];
    let (ok, output) = run("spirv-opt", &arguments, &bytes);
    assert!(ok, "{}: {}", shader.label, String::from_utf8_lossy(&output));
    let words: Vec<u32> =
        output.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    Shader::reflected(shader.stage, &format!("optimized {}", shader.label), &words).unwrap()
}

/// Runs one of the SPIR-V tools.
fn run(tool: &str, arguments: &[&str], input: &[u8]) -> (bool, Vec<u8>) {
    let mut child = Command::new(tool)
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap_or_else(|e| panic!("{tool}: {e}; scripts/setup installs it (Debian: spirv-tools)"));
    let mut stdin = child.stdin.take().unwrap();
    std::thread::scope(|scope| {
        scope.spawn(move || stdin.write_all(input).unwrap());
        let output = child.wait_with_output().unwrap();
        (output.status.success(), [output.stdout, output.stderr].concat())
    })
}

/// What `spirv-val` has against a module.
pub fn complaint(words: &[u32]) -> Option<String> {
    // The validator of Debian 12 knows the extension by its older name only.
    let mut module = module::parse(words).unwrap();
    if module.extensions.iter().any(|i| format!("{i:?}").contains("compute_shader_derivatives")) {
        let name = Operand::LiteralString("SPV_NV_compute_shader_derivatives".into());
        module.extensions.push(dr::Instruction::new(Op::Extension, None, None, vec![name]));
    }
    let bytes: Vec<u8> = module.assemble().iter().flat_map(|w| w.to_le_bytes()).collect();
    let arguments = ["--target-env", "vulkan1.3", "--scalar-block-layout", "-"];
    let (ok, output) = run("spirv-val", &arguments, &bytes);
    (!ok).then(|| String::from_utf8_lossy(&output).into_owned())
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
        let shader = any_shader(stage, &name, &source).unwrap();
        for shader in [optimized(&shader), shader] {
            for tier in [Derivatives::Native, Derivatives::Quad] {
                let refused =
                    source.starts_with("// refused without native") && tier == Derivatives::Quad;
                match try_all(&shader, tier) {
                    Ok(()) => assert!(!refused, "{name} with {tier:?}"),
                    Err(e) => assert!(refused, "{tier:?}: {e}"),
                }
            }
        }
    }
}

#[test]
fn what_is_out_of_reach_is_refused_by_name() {
    for (stage, name, source) in shaders("refused") {
        let first = source.lines().next().unwrap();
        let wanted = first.strip_prefix("// refused: ").expect("the first line says why");
        let result = any_shader(stage, &name, &source)
            .and_then(|shader| try_all(&shader, Derivatives::Native));
        let text = result.expect_err(&name).to_string();
        assert!(text.contains(wanted) && text.contains(&name), "{name}: {text}");
    }
}

#[test]
fn no_module_makes_the_splicer_panic() {
    // A generator of our own, so that the same modules are tried everywhere.
    let mut state = 0x9e37_79b9_7f4a_7c15u64;
    let mut random = move |below: usize| {
        state =
            state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        ((state >> 33) as usize) % below
    };
    let rounds = std::env::var("FUZZ_ROUNDS").ok().and_then(|n| n.parse().ok()).unwrap_or(60);
    let (mut read, mut taken) = (0, 0);
    for (stage, name, source) in shaders("") {
        let shader = any_shader(stage, &name, &source).unwrap();
        for round in 0..rounds {
            let mut words = shader.spirv.clone();
            for _ in 0..1 + round % 3 {
                let at = 5 + random(words.len() - 5);
                words[at] = match random(4) {
                    0 => words[5 + random(words.len() - 5)],
                    1 => words[at].wrapping_add(1),
                    2 => words[at] ^ (1 << random(32)),
                    _ => random(300) as u32,
                };
            }
            let Ok(broken) = Shader::reflected(stage, &name, &words) else { continue };
            read += 1;
            let derivatives = [Derivatives::Native, Derivatives::Quad][round % 2];
            let blocks = [Blocks::Prefetched, Blocks::InPlace][round / 2 % 2];
            let options = SpliceOptions { derivatives, blocks, specialization: &[] };
            if let Ok(spliced) = splice(&hosts(stage)[0], &broken, &options) {
                let _ = verify::verify(&spliced.spirv);
                taken += 1;
            }
        }
    }
    assert!(read > rounds && taken > rounds, "{read} modules read, {taken} spliced");
}
