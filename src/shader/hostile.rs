//! Modules that could fill the stack, take for ever or overflow a sum.

use super::{Shader, Stage};
use crate::Result;
use std::{
    fmt::Write as _,
    io::Write as _,
    process::{Command, Stdio},
};

/// A fragment shader that reads the block `%s{levels}` and writes `%c`, with further `decorations`.
fn assembled(levels: usize, members: usize, decorations: &str) -> Vec<u32> {
    let (mut offsets, mut types) = (String::new(), String::new());
    for level in 1..=levels {
        let inner = format!(" %s{}", level - 1).repeat(members);
        writeln!(types, "%s{level} = OpTypeStruct{inner}").unwrap();
        for member in 0..members {
            writeln!(offsets, "OpMemberDecorate %s{level} {member} Offset 0").unwrap();
        }
    }
    let text = format!(
        "OpCapability Shader
        OpMemoryModel Logical GLSL450
        OpEntryPoint Fragment %main \"main\" %c %block
        OpExecutionMode %main OriginUpperLeft
        OpDecorate %c Location 0
        {decorations}
        {offsets}
        OpMemberDecorate %s0 0 Offset 0
        OpDecorate %s{levels} Block
        OpDecorate %block DescriptorSet 0
        OpDecorate %block Binding 0
        %void = OpTypeVoid
        %function = OpTypeFunction %void
        %float = OpTypeFloat 32
        %one = OpConstant %float 1
        %s0 = OpTypeStruct %float
        {types}
        %pointer = OpTypePointer Uniform %s{levels}
        %block = OpVariable %pointer Uniform
        %out = OpTypePointer Output %float
        %c = OpVariable %out Output
        %main = OpFunction %void None %function
        %label = OpLabel
        %value = OpLoad %s{levels} %block
        OpStore %c %one
        OpReturn
        OpFunctionEnd"
    );
    let mut child = Command::new("spirv-as")
        .args(["--target-env", "vulkan1.3", "-", "-o", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the tests need spirv-as (Debian: spirv-tools)");
    child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success());
    let words = output.stdout.chunks_exact(4);
    words.map(|b| u32::from_ne_bytes(b.try_into().unwrap())).collect()
}

fn reflected(words: &[u32]) -> Result<Shader> {
    Shader::reflected(Stage::Fragment, "hostile.spv", words)
}

#[test]
fn types_nested_without_end_do_not_fill_the_stack() {
    let words = assembled(20_000, 1, "");
    let text = reflected(&words).unwrap_err().to_string();
    assert!(text.contains("nested more than 1000 deep"), "{text}");
    // The validator goes first, and has a limit of its own.
    let text = Shader::from_spirv(Stage::Fragment, "hostile.spv", &words).unwrap_err().to_string();
    assert!(text.contains("says spirv-val"), "{text}");
    assert_eq!(reflected(&assembled(200, 1, "")).unwrap().reflection.resources[0].bytes, 4);
}

#[test]
fn a_block_with_more_parts_than_can_be_counted_has_its_bytes_at_once() {
    let shader = reflected(&assembled(60, 2, "")).unwrap();
    assert_eq!(shader.reflection.resources[0].bytes, 4);
}

#[test]
fn a_component_may_be_any_number() {
    let words = assembled(1, 1, "OpDecorate %c Component 4294967295");
    let text = reflected(&words).unwrap_err().to_string();
    assert!(text.contains("four components"), "{text}");
}
