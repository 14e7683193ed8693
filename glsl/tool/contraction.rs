//! Float arithmetic that rounds after every operation, for the build and for the tests of single steps.

use rspirv::{
    dr::{Instruction, Module, Operand},
    spirv::{Decoration, Op},
};

/// Decorates all float arithmetic with `NoContraction`, so that a multiply and an add round twice on
/// every device, as they do on the CPU.
pub fn forbid(module: &mut Module) {
    let exact: Vec<Instruction> = module
        .all_inst_iter()
        .filter(|i| {
            matches!(
                i.class.opcode,
                Op::FAdd
                    | Op::FSub
                    | Op::FMul
                    | Op::FDiv
                    | Op::FNegate
                    | Op::Dot
                    | Op::VectorTimesScalar
            )
        })
        .filter_map(|i| i.result_id)
        .map(|id| {
            Instruction::new(
                Op::Decorate,
                None,
                None,
                vec![Operand::IdRef(id), Operand::Decoration(Decoration::NoContraction)],
            )
        })
        .filter(|decoration| !module.annotations.contains(decoration))
        .collect();
    module.annotations.extend(exact);
}
