//! Does folding keep modules valid, and what they compute?

use super::*;
use crate::{
    abi, prebuilt,
    shader::testing::{complaint, kernel},
    vk::{address, table_bounds, table_sizes::TableSizes},
};

/// The module, specialized. It is valid.
fn folded(words: &[u32], values: &[(u32, u32)]) -> dr::Module {
    let words = specialize(words, &values.iter().copied().collect()).expect("it can be folded");
    assert_eq!(complaint(&words), None, "{values:?}");
    load(&words).unwrap()
}

/// A kernel with the constants `A` to `C` by number, 7, 8 and 9 if nothing else is given, and `D`, which is true.
fn source(functions: &str, body: &str) -> Vec<u32> {
    kernel(&format!(
        "#version 460
         layout(local_size_x_id = 0) in;
         layout(constant_id = 1) const uint A = 7;
         layout(constant_id = 2) const int B = 8;
         layout(constant_id = 3) const uint C = 9;
         layout(constant_id = 4) const bool D = true;
         layout(set = 0, binding = 0) buffer Numbers {{ uint numbers[]; }};
         {functions}
         void main() {{ uint x = numbers[gl_GlobalInvocationID.x]; {body} }}"
    ))
}

fn count(module: &dr::Module, op: Op) -> usize {
    module.all_inst_iter().filter(|i| i.class.opcode == op).count()
}

/// The constants that are stored, in the order of the code.
fn stored(module: &dr::Module) -> Vec<u32> {
    let edit = Edit::new(module.clone());
    let stores = edit.instructions().filter(|i| i.class.opcode == Op::Store);
    stores.filter_map(|i| edit.number(i.operands[1].id_ref_any()?)).collect()
}

/// What is stored where `body` is specialized, and how many branches are left.
fn left(functions: &str, body: &str, values: &[(u32, u32)]) -> (Vec<u32>, usize) {
    let module = folded(&source(functions, body), values);
    let branches = count(&module, Op::BranchConditional) + count(&module, Op::Switch);
    (stored(&module), branches)
}

#[test]
fn constants_become_plain() {
    let words = source("", "numbers[0] = A; numbers[1] = A * C - 1u; numbers[2] = D ? C : x;");
    let module = folded(&words, &[(0, 32), (1, 5), (99, 1)]);
    assert_eq!(stored(&module), [5, 44, 9]);
    for op in
        [Op::SpecConstant, Op::SpecConstantTrue, Op::SpecConstantOp, Op::SpecConstantComposite]
    {
        assert_eq!(count(&module, op), 0, "{op:?}");
    }
    let numbers = Edit::new(module).decorations(Decoration::SpecId);
    assert!(numbers.is_empty());
    let module = folded(&words, &[(4, 0), (3, u32::MAX)]);
    assert_eq!(
        stored(&module),
        [7, 7u32.wrapping_mul(u32::MAX) - 1],
        "the last one is no constant"
    );
}

#[test]
fn workgroups_keep_their_size() {
    use crate::vk::reflect::reflect;
    let words = source("shared uint rows[A];", "rows[x % A] = x; barrier(); numbers[1] = rows[0];");
    let values = HashMap::from([(0, 64), (1, 20)]);
    let before = reflect(&words, &values).unwrap();
    let after = reflect(&specialize(&words, &values).unwrap(), &HashMap::new()).unwrap();
    assert_eq!((before.workgroup, before.shared_bytes), ([64, 1, 1], 80));
    assert_eq!((after.workgroup, after.shared_bytes), ([64, 1, 1], 80));
    assert!(after.constants.is_empty());
}

#[test]
fn arms_that_are_never_taken_go() {
    let body = "if (A == 1u) numbers[0] = 1u; else numbers[0] = 2u;
        if (D && x > 1u) numbers[1] = 3u;
        if (!D) { for (uint i = 0u; i < x; i++) numbers[i] = 4u; }";
    assert_eq!(left("", body, &[(1, 1)]), (vec![1, 3], 1));
    assert_eq!(left("", body, &[(1, 2), (4, 0)]), (vec![2, 0, 4], 1), "the test of the loop");
}

#[test]
fn short_circuits_keep_their_values() {
    let body = "bool b = (D && numbers[3] == 2u) || (A == 2u && numbers[4] == 3u);
        numbers[0] = b ? 1u : x;";
    for values in [[(4, 0), (1, 2)], [(4, 1), (1, 2)], [(4, 0), (1, 1)], [(4, 1), (1, 1)]] {
        folded(&source("", body), &values);
    }
}

#[test]
fn switches_go_to_one_case() {
    let body = "switch (A) {
            case 1u: numbers[0] = 1u;
            case 2u: numbers[0] = 2u; break;
            case 3u: if (x > 5u) break; numbers[0] = 3u; break;
            default: numbers[0] = 4u;
        }
        numbers[1] = 9u;";
    assert_eq!(left("", body, &[(1, 1)]), (vec![1, 2, 9], 0));
    assert_eq!(left("", body, &[(1, 2)]), (vec![2, 9], 0));
    assert_eq!(left("", body, &[(1, 4)]), (vec![4, 9], 0));
    // The break inside a condition needs the switch that it leaves.
    assert_eq!(left("", body, &[(1, 3)]), (vec![3, 9], 2));
}

#[test]
fn loops_stay_valid() {
    let bodies = [
        "for (uint i = 0u; i < A; i++) { if (D) break; numbers[i] = 1u; } numbers[0] = 2u;",
        "for (uint i = 0u; i < x; i++) { if (D) continue; numbers[i] = 1u; }",
        "for (uint i = 0u; i < x; i++) { if (!D) { numbers[i] = 1u; break; } else return; }",
        "uint i = 0u; do { numbers[i] = A; i++; if (D) continue; i++; } while (A == 1u);",
        "uint i = 0u; do { numbers[i] = A; i++; } while (D && i < x);",
        "while (D) { if (A == 2u) { if (x > 3u) break; numbers[1] = 3u; } x++; if (x > 9u) return; }",
        "for (;;) { switch (A) { case 1u: continue; case 2u: if (x > 2u) break; x++;
             default: return; } x += 2u; if (x > 99u) break; }",
        "for (uint i = 0u; i < x; i++) { for (uint k = 0u; k < C; k++) { if (A == 1u) { if (k == x) break;
             if (D) continue; } numbers[k] = i; } if (!D) break; }",
    ];
    for body in bodies {
        for (a, d) in [(0, 0), (1, 0), (2, 0), (0, 1), (1, 1), (2, 1)] {
            folded(&source("", body), &[(1, a), (4, d)]);
        }
    }
}

#[test]
fn functions_return_from_any_arm() {
    let functions = "uint unused(uint a) { return a; }
        uint f(uint a) { if (A == 1u) return a; if (A == 2u) { if (a > 3u) return 5u; } else return 6u; return 7u; }
        uint g(uint a) { switch (A) { case 1u: return unused(a); case 2u: return f(a); } return 1u; }";
    for (a, left) in [(1, 3), (2, 3), (3, 2)] {
        let module = folded(&source(functions, "numbers[0] = g(x);"), &[(1, a)]);
        assert_eq!(module.functions.len(), left, "{a}");
    }
}

/// Values that one block has for another survive, those of blocks that are gone do not.
#[test]
fn what_arms_define_is_repaired() {
    let module = |condition: &str| {
        // if (condition) { return } else { v = load }; store v: the arm that is left out defines what the rest uses.
        let text = format!(
            "OpCapability Shader
             OpMemoryModel Logical GLSL450
             OpEntryPoint GLCompute %main \"main\"
             OpExecutionMode %main LocalSize 1 1 1
             OpDecorate %condition SpecId 0
             %void = OpTypeVoid
             %bool = OpTypeBool
             %uint = OpTypeInt 32 0
             %pointer = OpTypePointer Private %uint
             %global = OpVariable %pointer Private
             %condition = OpSpecConstant{condition} %bool
             %one = OpConstant %uint 1
             %function = OpTypeFunction %void
             %main = OpFunction %void None %function
             %start = OpLabel
             OpSelectionMerge %merge None
             OpBranchConditional %condition %gone %other
             %gone = OpLabel
             OpReturn
             %other = OpLabel
             %v = OpLoad %uint %global
             OpBranch %merge
             %merge = OpLabel
             %phi = OpPhi %uint %v %other
             %sum = OpIAdd %uint %v %phi
             OpStore %global %sum
             OpReturn
             OpFunctionEnd"
        );
        assembled(&text)
    };
    let kept = folded(&module("False"), &[]);
    assert_eq!((count(&kept, Op::IAdd), count(&kept, Op::BranchConditional)), (1, 0));
    let gone = folded(&module("True"), &[]);
    assert_eq!((count(&gone, Op::IAdd), count(&gone, Op::Load)), (0, 0));
}

/// In a loop: the arm that is left leaves the loop or goes on, and what it computes is used behind the selection. A way past
/// it would make the module invalid.
#[test]
fn a_way_past_what_is_used_is_not_made() {
    let words = assembled(
        "OpCapability Shader
         OpMemoryModel Logical GLSL450
         OpEntryPoint GLCompute %main \"main\"
         OpExecutionMode %main LocalSize 1 1 1
         OpDecorate %condition SpecId 0
         %void = OpTypeVoid
         %bool = OpTypeBool
         %uint = OpTypeInt 32 0
         %pointer = OpTypePointer Private %uint
         %global = OpVariable %pointer Private
         %condition = OpSpecConstantTrue %bool
         %one = OpConstant %uint 1
         %function = OpTypeFunction %void
         %main = OpFunction %void None %function
         %start = OpLabel
         OpBranch %loop
         %loop = OpLabel
         OpLoopMerge %end %next None
         OpBranch %header
         %header = OpLabel
         OpSelectionMerge %merge None
         OpBranchConditional %condition %arm %other
         %arm = OpLabel
         %v = OpLoad %uint %global
         %leaves = OpIEqual %bool %v %one
         OpBranchConditional %leaves %end %merge
         %other = OpLabel
         OpBranch %next
         %merge = OpLabel
         OpStore %global %v
         OpBranch %next
         %next = OpLabel
         OpBranch %loop
         %end = OpLabel
         OpReturn
         OpFunctionEnd",
    );
    let folded = specialize(&words, &HashMap::new());
    if let Some(folded) = &folded {
        crate::shader::validate_kernel("folded", folded).unwrap();
    }
    assert_eq!(folded, None);
}

/// The engine's kernels, as they are made, with the values of several formats, modes and widths.
#[test]
fn every_kernel_stays_valid() {
    const NONE: u32 = abi::NO_FORMAT * 0x0101_0101;
    let sizes =
        TableSizes { sampled: 20, textures: 10, samplers: 8, storage_images: 4, buffers: 30 };
    for (name, variant, words) in prebuilt::KERNELS {
        let addressed = address::lower(words, true).unwrap().map(|addressed| addressed.spirv);
        let words = table_bounds::keep(addressed.as_deref().unwrap_or(words), sizes).unwrap();
        for set in 0..6u32 {
            let width = [4, 8, 16, 32, 64, 128][set as usize];
            let formats =
                if variant.colors > 1 { set * 0x0302_0105 } else { (NONE << 8) | (set * 7) };
            let plain = [
                (abi::SPEC_WIDTH, width),
                (abi::SPEC_LANES, width),
                (abi::SPEC_COMPARE, set),
                (abi::SPEC_FORMATS, formats),
                (abi::SPEC_MORE_FORMATS, if set > 3 { 0x0102_0304 } else { NONE }),
                (abi::SPEC_DEPTH, set % 4),
                (abi::SPEC_HELD, [256, 1, 512, 1, 1024, 1][set as usize]),
                (abi::SPEC_PER_SAMPLE, (set >> 1) & 1),
                (abi::SPEC_RESOLVE_MODE, set % 4),
                (abi::SPEC_SAMPLES, [1, 16, 2, 8, 4, 4][set as usize]),
                (abi::SPEC_READ, set * 3),
                (abi::SPEC_ADJUSTED, (set >> 1) & 1),
                (abi::SPEC_DEPTH_BITS, [0, 16, 24][set as usize % 3]),
            ];
            let attributes = (0..32).map(|n| (abi::SPEC_ATTRIBUTE + n, (n + set) * 0x10_2031));
            let values: Vec<_> = plain.into_iter().chain(attributes).collect();
            let values: Vec<_> =
                values.iter().map(|(n, bits)| (abi::SPEC_FIRST + n, *bits)).collect();
            let module = folded(&words, &values);
            let left = module.types_global_values.iter().filter(|i| {
                let op = i.class.opname;
                op.starts_with("SpecConstant")
            });
            assert_eq!(left.collect::<Vec<_>>(), Vec::<&Instruction>::new(), "{name} {set}");
        }
    }
}

#[test]
fn what_cannot_be_folded_is_left_alone() {
    assert!(specialize(&[1, 2, 3], &HashMap::new()).is_none());
    let wide = kernel(
        "#version 460
         #extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
         layout(local_size_x = 1) in;
         layout(constant_id = 1) const uint64_t WIDE = 5;
         layout(set = 0, binding = 0) buffer Numbers { uint numbers[]; };
         void main() { numbers[0] = uint(WIDE) + (WIDE > 3ul ? 1 : 2); }",
    );
    assert!(specialize(&wide, &HashMap::from([(1, 2)])).is_none());
    assert_eq!(count(&folded(&wide, &[]), Op::SpecConstant), 1);
}

/// The words of SPIR-V's assembly language.
fn assembled(text: &str) -> Vec<u32> {
    use std::{io::Write as _, process::*};
    let arguments = ["--target-env", "vulkan1.1", "-o", "-", "-"];
    let mut child = Command::new("spirv-as")
        .args(arguments)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap_or_else(|e| {
            panic!("spirv-as: {e}; scripts/setup installs it (Debian: spirv-tools)")
        });
    child.stdin.take().unwrap().write_all(text.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success(), "{text}");
    output.stdout.chunks_exact(4).map(|word| u32::from_le_bytes(word.try_into().unwrap())).collect()
}
