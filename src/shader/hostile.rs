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
    assemble(&text)
}

/// A fragment shader that reads the input `%in`, which has the type `%top` that `types` declare, and writes
/// `%c`.
fn with_input(decorations: &str, types: &str) -> String {
    format!(
        "OpCapability Shader
        OpMemoryModel Logical GLSL450
        OpEntryPoint Fragment %main \"main\" %c %in
        OpExecutionMode %main OriginUpperLeft
        OpDecorate %c Location 0
        OpDecorate %in Location 0
        {decorations}
        %void = OpTypeVoid
        %function = OpTypeFunction %void
        %float = OpTypeFloat 32
        %uint = OpTypeInt 32 0
        %one = OpConstant %float 1
        %many = OpConstant %uint 256
        %empty = OpTypeStruct
        {types}
        %pointer = OpTypePointer Input %top
        %in = OpVariable %pointer Input
        %out = OpTypePointer Output %float
        %c = OpVariable %out Output
        %main = OpFunction %void None %function
        %label = OpLabel
        %value = OpLoad %top %in
        OpStore %c %one
        OpReturn
        OpFunctionEnd"
    )
}

fn assemble(text: &str) -> Vec<u32> {
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

#[test]
fn inputs_without_end_that_hold_nothing_are_passed_over() {
    // 256 to the power of 40 elements, and 2 to the power of 60 members.
    let (mut arrays, mut structs) = (String::new(), String::new());
    for level in 1..=40 {
        let inner = if level == 1 { "empty".into() } else { format!("a{}", level - 1) };
        writeln!(arrays, "%a{level} = OpTypeArray %{inner} %many").unwrap();
    }
    for level in 1..=60 {
        let inner = if level == 1 { "empty".into() } else { format!("s{}", level - 1) };
        writeln!(structs, "%s{level} = OpTypeStruct %{inner} %{inner}").unwrap();
    }
    let far = "OpMemberDecorate %top 0 Location 4294967295
        OpMemberDecorate %top 2 Location 7";
    for (types, hollow) in [(arrays, "%a40"), (structs, "%s60")] {
        let top = format!("{types} %top = OpTypeStruct {hollow} %float {hollow} %float");
        let inputs = reflected(&assemble(&with_input("", &top))).unwrap().reflection.inputs;
        assert_eq!(inputs.iter().map(|input| input.location).collect::<Vec<_>>(), [0, 1]);
        // The place of what holds nothing is nobody's.
        let inputs = reflected(&assemble(&with_input(far, &top))).unwrap().reflection.inputs;
        assert_eq!(inputs.iter().map(|input| input.location).collect::<Vec<_>>(), [0, 1]);
    }
}

/// `modf` and `frexp` store a part of their result through a pointer.
#[test]
fn an_extended_instruction_may_write_a_block() {
    let declared = "%block = OpTypeStruct %float
        %zero = OpConstant %uint 0
        %to_block = OpTypePointer StorageBuffer %block
        %to_float = OpTypePointer StorageBuffer %float
        %b = OpVariable %to_block StorageBuffer
        %top = OpTypeStruct %float";
    let decorations = "OpDecorate %block Block
        OpMemberDecorate %block 0 Offset 0
        OpDecorate %b DescriptorSet 0
        OpDecorate %b Binding 0";
    let text = with_input(decorations, declared)
        .replace("OpMemoryModel", "%set = OpExtInstImport \"GLSL.std.450\"\nOpMemoryModel")
        .replace(
            "OpStore %c",
            "%part = OpAccessChain %to_float %b %zero
            %whole = OpExtInst %float %set Modf %one %part
            OpStore %c",
        );
    let shader = reflected(&assemble(&text)).unwrap();
    assert!(shader.reflection.has_side_effects);
    assert_eq!(shader.details.written, [0]);
}

#[test]
fn an_array_of_no_elements_is_refused() {
    let types = "%none = OpConstant %uint 0
        %top = OpTypeArray %float %none";
    let text = reflected(&assemble(&with_input("", types))).unwrap_err().to_string();
    assert!(text.contains("an array of no elements"), "{text}");
}

/// Distances lie in places of their own, which two declarations would share.
#[test]
fn distances_are_declared_once_and_interpolated_as_they_are() {
    let types = "%four = OpConstant %uint 4
        %top = OpTypeArray %float %four";
    let distances = |decorations: &str| {
        let text = with_input(decorations, types)
            .replace("OpMemoryModel", "OpCapability ClipDistance\nOpMemoryModel");
        text.replace("OpDecorate %in Location 0", "OpDecorate %in BuiltIn ClipDistance")
    };
    let shader = reflected(&assemble(&distances(""))).unwrap();
    assert_eq!((shader.reflection.distances.clip, shader.reflection.inputs.len()), (4, 0));
    for decoration in ["Flat", "NoPerspective", "Centroid"] {
        let words = assemble(&distances(&format!("OpDecorate %in {decoration}")));
        let text = reflected(&words).unwrap_err().to_string();
        assert!(text.contains("with an interpolation of its own"), "{text}");
    }
    let twice = distances("OpDecorate %more BuiltIn ClipDistance")
        .replace("%c %in\n", "%c %in %more\n")
        .replace("%out =", "%more = OpVariable %pointer Input\n%out =")
        .replace("OpStore %c", "%again = OpLoad %top %more\nOpStore %c");
    let text = reflected(&assemble(&twice)).unwrap_err().to_string();
    assert!(text.contains("ClipDistance is declared twice"), "{text}");
}
