//! Restores SPIR-V's rule that definitions dominate their uses after edges were added.
//!
//! If a value no longer dominates all its uses, it is stored in a function variable where it is defined and
//! loaded where it is used. Pointers, images and samplers cannot be stored; they are computed again from
//! their operands, which has no side effects.

use super::{
    flow::{self, Flow},
    linker::{Linker, id},
};
use crate::shader::module::Outcome;
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{Op, StorageClass, Word},
};
use std::collections::HashMap;

/// A use that its definition does not dominate.
struct Broken {
    value: Word,
    /// Block and position where the value must be at hand.
    block: usize,
    position: usize,
    /// Block, position and operand that use it.
    user: (usize, usize, usize),
}

/// Whether values of this type cannot be stored in a variable.
pub(super) fn is_unstorable(linker: &Linker, ty: Word) -> bool {
    matches!(
        linker.op(ty),
        Some(Op::TypePointer | Op::TypeImage | Op::TypeSampler | Op::TypeSampledImage)
    )
}

/// Repairs `function`.
pub(super) fn dominance(linker: &mut Linker, function: &mut Function) -> Outcome<()> {
    let mut variables: HashMap<Word, Word> = HashMap::new();
    // Computing a pointer again may use values that need repair themselves. Each round handles one
    // use; a round without one ends.
    loop {
        let flow = Flow::new(function);
        let Some(broken) = find(function, &flow) else { break };
        let ty = linker.type_of(broken.value)?;
        let replacement = linker.value(ty);
        let instruction = if is_unstorable(linker, ty) {
            let mut again = definition(function, broken.value)
                .ok_or("`discard` beside a pointer of unknown origin")?
                .clone();
            let pure = matches!(
                again.class.opcode,
                Op::AccessChain | Op::InBoundsAccessChain | Op::SampledImage | Op::Image
            ) || (again.class.opcode == Op::Load
                && linker.op(ty) != Some(Op::TypePointer));
            if !pure {
                return Err("`discard` beside a pointer that cannot be computed again".into());
            }
            again.result_id = Some(replacement);
            again
        } else {
            let variable = match variables.get(&broken.value) {
                Some(&variable) => variable,
                None => spill(linker, function, broken.value, ty)?,
            };
            // Storing the value moved the instructions behind it.
            if variables.insert(broken.value, variable).is_none() {
                continue;
            }
            Instruction::new(Op::Load, Some(ty), Some(replacement), vec![id(variable)])
        };
        let (block, position, operand) = broken.user;
        function.blocks[block].instructions[position].operands[operand] = id(replacement);
        function.blocks[broken.block].instructions.insert(broken.position, instruction);
    }
    Ok(())
}

fn definition(function: &Function, value: Word) -> Option<&Instruction> {
    function.all_inst_iter().find(|i| i.result_id == Some(value))
}

fn find(function: &Function, flow: &Flow) -> Option<Broken> {
    let mut homes: HashMap<Word, (usize, usize)> = HashMap::new();
    for (n, block) in function.blocks.iter().enumerate() {
        for (position, instruction) in block.instructions.iter().enumerate() {
            if let Some(result) = instruction.result_id {
                homes.insert(result, (n, position));
            }
        }
    }
    for (n, block) in function.blocks.iter().enumerate() {
        if !flow.is_reached(n) {
            continue;
        }
        for (position, instruction) in block.instructions.iter().enumerate() {
            let phi = instruction.class.opcode == Op::Phi;
            for (operand, word) in instruction.operands.iter().enumerate() {
                let Some(value) = word.id_ref_any() else { continue };
                let Some(&(home, _)) = homes.get(&value) else { continue };
                // A phi uses its operand at the end of the block that it comes from.
                let (at, before) = if phi {
                    let label = instruction.operands.get(operand + 1).and_then(Operand::id_ref_any);
                    let Some(from) = label.and_then(|label| flow.number(label)) else { continue };
                    if !flow.is_reached(from) {
                        continue;
                    }
                    (from, flow::end(&function.blocks[from]))
                } else {
                    let merges = flow::end(block);
                    (n, position.min(merges))
                };
                if !flow.dominates(home, at) {
                    let user = (n, position, operand);
                    return Some(Broken { value, block: at, position: before, user });
                }
            }
        }
    }
    None
}

/// Stores `value` in a new function variable right after its definition.
fn spill(linker: &mut Linker, function: &mut Function, value: Word, ty: Word) -> Outcome<Word> {
    let class = StorageClass::Function;
    let pointer = linker.pointer(class, ty);
    let variable = linker.value(pointer);
    for block in &mut function.blocks {
        let at = block.instructions.iter().position(|i| i.result_id == Some(value));
        let Some(at) = at else { continue };
        let at = (at + 1).max(flow::first_free(block));
        let store = Instruction::new(Op::Store, None, None, vec![id(variable), id(value)]);
        block.instructions.insert(at, store);
    }
    let operands = vec![Operand::StorageClass(class)];
    let declaration = Instruction::new(Op::Variable, Some(pointer), Some(variable), operands);
    let entry =
        function.blocks.first_mut().ok_or("not a SPIR-V module: a function without body")?;
    entry.instructions.insert(0, declaration);
    Ok(variable)
}
