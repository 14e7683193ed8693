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

/// The colour targets that a kernel is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Colors {
    /// How many there may be.
    pub most: u32,
    /// Whether they may have any format, or one of the common ones.
    pub any_format: bool,
}

impl Colors {
    /// What kernels are compiled for that do not ask.
    #[allow(dead_code)] // for the library
    pub const ONE: Self = Self { most: 1, any_format: false };

    /// All of them, with up to `most` targets.
    #[allow(dead_code)] // for the tool
    pub fn all(most: u32) -> [Self; 4] {
        [(1, false), (most, false), (1, true), (most, true)]
            .map(|(most, any_format)| Self { most, any_format })
    }

    /// The macros that a kernel is compiled with.
    pub fn macros(self) -> String {
        let any = if self.any_format { "#define ANY_FORMAT\n" } else { "" };
        format!("#define COLORS {}\n{any}", self.most)
    }
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
