//! SPIR-V into `rspirv`'s data representation, with the instructions that `rspirv` 0.13 cannot read.
//!
//! `rspirv` reads exactly one literal of an operation inside an `OpSpecConstantOp`, although `VectorShuffle`,
//! `CompositeExtract` and `CompositeInsert` have any number of literals. This module reads such instructions
//! itself.

use rspirv::{
    dr::{self, Instruction, Module, Operand},
    spirv::Op,
};

/// The operations whose operands end in any number of literals, with the number of ids before these.
const WITH_LITERALS: [(Op, usize); 3] =
    [(Op::VectorShuffle, 2), (Op::CompositeExtract, 1), (Op::CompositeInsert, 2)];

/// Reads a module.
///
/// # Errors
/// The reason, if the words are no module.
pub fn load(words: &[u32]) -> Result<Module, String> {
    let (plain, read) = without_unreadable(words);
    let mut module = dr::load_words(&plain).map_err(|e| e.to_string())?;
    for instruction in read {
        let id = instruction.result_id;
        let place = module.types_global_values.iter_mut().find(|i| i.result_id == id);
        *place.ok_or("an OpSpecConstantOp stands inside a function")? = instruction;
    }
    Ok(module)
}

/// The module with a null constant in the place of each instruction that `rspirv` cannot read, and these.
fn without_unreadable(words: &[u32]) -> (Vec<u32>, Vec<Instruction>) {
    let header = words.len().min(5);
    let (mut plain, mut read) = (words[..header].to_vec(), Vec::new());
    let mut at = header;
    while at < words.len() {
        let length = ((words[at] >> 16) as usize).clamp(1, words.len() - at);
        let instruction = &words[at..at + length];
        match spec_constant_op(instruction) {
            Some(found) => {
                plain.push(3 << 16 | Op::ConstantNull as u32);
                plain.extend_from_slice(&instruction[1..3]);
                read.push(found);
            }
            None => plain.extend_from_slice(instruction),
        }
        at += length;
    }
    (plain, read)
}

/// The instruction, if it is one that `rspirv` cannot read.
fn spec_constant_op(words: &[u32]) -> Option<Instruction> {
    let [first, ty, id, op, operands @ ..] = words else { return None };
    let is_op = first & 0xffff == Op::SpecConstantOp as u32;
    let (op, ids) = *WITH_LITERALS.iter().find(|(known, _)| is_op && *known as u32 == *op)?;
    let (ids, literals) = operands.split_at_checked(ids)?;
    let operands = std::iter::once(Operand::LiteralSpecConstantOpInteger(op))
        .chain(ids.iter().map(|&id| Operand::IdRef(id)))
        .chain(literals.iter().map(|&literal| Operand::LiteralBit32(literal)))
        .collect();
    Some(Instruction::new(Op::SpecConstantOp, Some(*ty), Some(*id), operands))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rspirv::binary::Assemble as _;

    #[test]
    fn operations_with_any_number_of_literals_survive() {
        // A header, int, ivec4, one operation of each kind with 0 to 4 literals.
        for (op, ids) in WITH_LITERALS {
            for literals in 0..5u32 {
                let mut words = vec![0x0723_0203, 0x0001_0500, 0, 9, 0];
                words.extend([4 << 16 | 21, 1, 32, 1, 4 << 16 | 23, 2, 1, 4]);
                words.extend([3 << 16 | 46, 2, 3]);
                let length = 4 + ids as u32 + literals;
                words.extend([length << 16 | 52, 2, 4, op as u32]);
                words.extend(std::iter::repeat_n(3, ids).chain(0..literals));
                let module = load(&words).unwrap_or_else(|e| panic!("{op:?} {literals}: {e}"));
                assert_eq!(module.assemble()[5..], words[5..], "{op:?} {literals}");
            }
        }
    }
}
