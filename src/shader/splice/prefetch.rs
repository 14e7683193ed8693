//! Reads parts of uniform blocks once for many calls.
//!
//! A block in the engine's table is found through an index that the draw decides. CPU drivers fetch
//! each word of it lane by lane, six nanoseconds for eight lanes on lavapipe, and a common material
//! reads eighty for every fragment. Kernels run the user's code many times for one draw; so what it
//! reads at places that are known in advance is brought into private variables when the kernel binds
//! a draw (`tw_user_bind`), and its code reads those.
//!
//! Only scalars, vectors and matrices of 32-bit numbers that are read as a whole are brought; what is indexed at run
//! time stays where it is.

use super::{
    linker::{Code, Linker, id, literal},
    resources::Element,
};
use crate::shader::module::{Outcome, ids};
use rspirv::{
    dr::{Block, Function, Instruction, Operand},
    spirv::{Op, StorageClass, Word},
};
use std::collections::{HashMap, HashSet};

/// Words that are brought, at most: private variables are registers, or memory of a lane.
const MAX_WORDS: u32 = 384;

/// A variable and the constant indices of a part of it.
type Place = (Word, Vec<Word>);

/// Makes the user's functions read private variables, and returns a body that fills them, in which
/// the table's variables are used as the user would.
pub(super) fn prefetch(
    linker: &mut Linker,
    functions: &mut [Function],
    elements: &[(Word, Element)],
) -> Outcome<Function> {
    let blocks: HashSet<Word> = (elements.iter())
        .filter(|(_, element)| element.is_read_only() && !element.is_array())
        .map(|(variable, _)| *variable)
        .collect();
    let chains = chains(linker, functions, &blocks);

    let mut code = Code::new(linker);
    let mut words = 0;
    let mut parts: HashMap<Place, Word> = HashMap::new();
    let mut instead: HashMap<Word, Word> = HashMap::new();
    for (result, place, ty) in chains {
        let part = match parts.get(&place) {
            Some(&part) => part,
            None if words + words_of(code.linker, ty) > MAX_WORDS => continue,
            None => {
                words += words_of(code.linker, ty);
                let part = code.linker.private(ty);
                let pointer = code.linker.pointer(StorageClass::StorageBuffer, ty);
                let operands = [place.0].iter().chain(&place.1).map(|&word| id(word)).collect();
                let pointer = code.emit(Op::AccessChain, pointer, operands);
                let value = code.load(ty, pointer);
                code.store(part, value);
                parts.insert(place, part);
                part
            }
        };
        instead.insert(result, part);
    }
    let instructions = code.instructions;
    for block in functions.iter_mut().flat_map(|f| &mut f.blocks) {
        block.instructions.retain(|i| i.result_id.is_none_or(|id| !instead.contains_key(&id)));
        for load in block.instructions.iter_mut().filter(|i| i.class.opcode == Op::Load) {
            let from = ids(load).next();
            if let Some(&part) = from.and_then(|from| instead.get(&from)) {
                load.operands = vec![id(part)];
            }
        }
    }
    let stays = |i: &Instruction| ids(i).next().is_none_or(|target| !instead.contains_key(&target));
    linker.module.debug_names.retain(stays);
    linker.module.annotations.retain(stays);
    let mut body = Function::new();
    body.blocks.push(Block { label: None, instructions });
    Ok(body)
}

/// Access chains that go by constants to a value in one of `blocks`, and from which nothing is done
/// but loading: each with its place and the type of the value.
fn chains(
    linker: &Linker,
    functions: &[Function],
    blocks: &HashSet<Word>,
) -> Vec<(Word, Place, Word)> {
    let instructions = || functions.iter().flat_map(|f| &f.blocks).flat_map(|b| &b.instructions);
    let mut found = Vec::new();
    for i in instructions() {
        let chain = matches!(i.class.opcode, Op::AccessChain | Op::InBoundsAccessChain);
        let (true, Some(result), Some(pointer)) = (chain, i.result_id, i.result_type) else {
            continue;
        };
        let mut operands = ids(i);
        let Some(variable) = operands.next().filter(|v| blocks.contains(v)) else { continue };
        let indices: Vec<Word> = operands.collect();
        let constant = indices.iter().all(|&index| linker.op(index) == Some(Op::Constant));
        let Some((_, ty)) = linker.pointee(pointer).filter(|_| constant) else { continue };
        if is_plain(linker, ty) {
            found.push((result, (variable, indices), ty));
        }
    }
    let mut other_uses = HashSet::new();
    for i in instructions() {
        let skipped = usize::from(i.class.opcode == Op::Load);
        other_uses.extend(i.operands.iter().filter_map(Operand::id_ref_any).skip(skipped));
    }
    found.retain(|(result, ..)| !other_uses.contains(result));
    found
}

/// Whether a type is a scalar, vector or matrix of 32-bit numbers. Narrower ones live in blocks only.
fn is_plain(linker: &Linker, ty: Word) -> bool {
    let declaration = linker.global(ty).map(|i| (i.class.opcode, i.operands.first()));
    match declaration {
        Ok((Op::TypeFloat | Op::TypeInt, Some(width))) => *width == literal(32),
        Ok((Op::TypeVector | Op::TypeMatrix, Some(&Operand::IdRef(part)))) => {
            is_plain(linker, part)
        }
        _ => false,
    }
}

/// Words of such a type.
fn words_of(linker: &Linker, ty: Word) -> u32 {
    match linker.global(ty).map(|i| (i.class.opcode, i.operands.as_slice())) {
        Ok((Op::TypeVector | Op::TypeMatrix, [Operand::IdRef(part), count])) => {
            let count = if let Operand::LiteralBit32(count) = count { *count } else { 4 };
            count * words_of(linker, *part)
        }
        _ => 1,
    }
}
