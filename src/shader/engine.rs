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

/// What a kernel is compiled for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// How many colour targets there may be.
    pub colors: u32,
    /// Whether targets or vertex attributes may have any format, or one of the common ones.
    pub any_format: bool,
    /// Whether vertices may have distances from planes of the user.
    pub distances: bool,
}

impl Variant {
    /// What kernels are compiled for that do not ask.
    pub const PLAIN: Self = Self { colors: 1, any_format: false, distances: false };

    /// Those that the kernel `text`, without its macros, tells apart, with up to `most` targets.
    #[allow(dead_code)] // for the tool
    pub fn all(text: &str, most: u32) -> Vec<Self> {
        let counts = if text.contains("EACH_COLOR") { vec![1, most] } else { vec![1] };
        let formats = if text.contains("ANY_FORMAT") { vec![false, true] } else { vec![false] };
        let of = |colors| {
            formats.iter().map(move |&any_format| Self { colors, any_format, ..Self::PLAIN })
        };
        let with_distances = Self { distances: true, ..Self::PLAIN };
        let with_distances = text.contains("CLIP_BY_DISTANCES").then_some(with_distances);
        counts.into_iter().flat_map(of).chain(with_distances).collect()
    }

    /// The macros that a kernel is compiled with.
    pub fn macros(self) -> String {
        let any = if self.any_format { "#define ANY_FORMAT\n" } else { "" };
        let distances = if self.distances { "#define CLIP_BY_DISTANCES\n" } else { "" };
        format!("#define COLORS {}\n{any}{distances}", self.colors)
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
