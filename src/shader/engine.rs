//! What is done to every kernel of the engine after compiling, by the tool that makes `glsl/spirv/` and by the library
//! alike: float arithmetic rounds after every operation, and specialization constants get numbers of their own.

use rspirv::{
    dr::{Instruction, Module, Operand},
    spirv::{Decoration, Op},
};

/// Decorates all float arithmetic with `NoContraction`, so that a multiply and an add round twice on
/// every device, as they do on the CPU.
pub fn forbid_contraction(module: &mut Module) {
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

/// The macro that a kernel is compiled with if it writes up to so many colour targets.
pub fn colors(count: u32) -> String {
    format!("#define COLORS {count}\n")
}

/// Adds `first` to the `constant_id` of each specialization constant, which has room for it.
pub fn number_constants(module: &mut Module, first: u32) {
    for decoration in &mut module.annotations {
        if let [_, Operand::Decoration(Decoration::SpecId), Operand::LiteralBit32(id)] =
            decoration.operands.as_mut_slice()
        {
            *id = id.saturating_add(first);
        }
    }
}
