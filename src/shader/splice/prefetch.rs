//! Reads parts of uniform blocks once for many calls.
//!
//! A block in the engine's table is found through an index that the draw decides. CPU drivers fetch
//! each word of it lane by lane, through a descriptor that may differ from lane to lane, and a common
//! material reads eighty words for every fragment. Kernels run the user's code many times for one draw. So
//! values at places that are known in advance are copied to private variables when the kernel binds a draw
//! (`tw_user_bind`), and the user's code reads these. The kernel's hook fetches four words at a time: the
//! lanes of a quad belong to one draw, and each of them fetches one word.
//!
//! Only scalars, vectors and matrices of 32-bit numbers that are read as a whole are copied; values that are
//! indexed at run time are read from the block.

use super::{
    hooks::Hooks,
    linker::{Code, Linker, id, literal},
    resources::{Element, Span},
};
use crate::shader::{
    block,
    module::{Index, Outcome, ids},
};
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{Op, Word},
};
use std::collections::{BTreeMap, HashMap, HashSet};

/// The most words that are copied: private variables are registers, or memory of a lane.
const MAX_WORDS: usize = 384;
/// Words that the kernel's hook fetches at once.
const AT_ONCE: u32 = 4;

/// A variable and the constant indices of a part of it.
type Place = (Word, Vec<Word>);

/// A part of a block and the private variable that stands for it.
struct Part {
    variable: Word,
    ty: Word,
    words: Vec<u32>,
    stand_in: Word,
}

/// Makes the user's functions read private variables, and returns the code that fills these. `spans` say where
/// each of `elements` is in the table.
pub(super) fn prefetch(
    linker: &mut Linker,
    hooks: &Hooks,
    functions: &mut [Function],
    elements: &[(Word, Element)],
    spans: &[Span],
) -> Outcome<Vec<Instruction>> {
    let blocks: HashMap<Word, (Word, Word)> = (elements.iter().zip(spans))
        .filter(|((_, element), _)| element.is_read_only() && !element.is_array())
        .map(|((variable, element), span)| (*variable, (element.ty(), span.first)))
        .collect();
    let mut words_left = MAX_WORDS;
    let mut parts: Vec<Part> = Vec::new();
    let mut known: HashMap<Place, Word> = HashMap::new();
    let mut instead: HashMap<Word, Word> = HashMap::new();
    let chains = chains(linker, functions, &blocks);
    let index = Index::new(&linker.module);
    // The hook looks at no bounds: what an index beyond an array selects stays in the block, where devices do.
    let bytes: HashMap<Word, u32> = (blocks.iter())
        .filter_map(|(variable, (ty, _))| Some((*variable, block::bytes(&index, *ty).ok()?)))
        .collect();
    let words: Vec<_> = (chains.iter())
        .map(|(_, (variable, indices), _)| {
            let words = block::words(&index, blocks[variable].0, indices).ok()?;
            let inside = bytes.get(variable)? / 4;
            words.iter().all(|&word| word < inside).then_some(words)
        })
        .collect();
    for ((result, place, ty), words) in chains.into_iter().zip(words) {
        if let Some(&stand_in) = known.get(&place) {
            instead.insert(result, stand_in);
            continue;
        }
        let variable = place.0;
        let Some(words) = words.filter(|words| words.len() <= words_left) else { continue };
        words_left -= words.len();
        let stand_in = linker.private(ty);
        known.insert(place, stand_in);
        instead.insert(result, stand_in);
        parts.push(Part { variable, ty, words, stand_in });
    }
    replace(linker, functions, &instead);

    let mut code = Code::new(linker);
    for (variable, (_, index)) in elements.iter().filter_map(|(v, _)| Some((v, blocks.get(v)?))) {
        let parts: Vec<&Part> = parts.iter().filter(|part| part.variable == *variable).collect();
        fill(&mut code, hooks, *index, &parts)?;
    }
    Ok(code.instructions)
}

/// Fills the parts of one block, whose table index `index` holds.
fn fill(code: &mut Code, hooks: &Hooks, index: Word, parts: &[&Part]) -> Outcome<()> {
    let Some(&last) = parts.iter().flat_map(|part| &part.words).max() else { return Ok(()) };
    let uint = code.linker.uint();
    let four = code.linker.vector(uint, AT_ONCE);
    let hook = hooks.function("tw_block_words(u1;u1;u1;")?;
    let slot = code.load(uint, index);
    let last = code.linker.uint_constant(last);
    let mut brought: BTreeMap<u32, Word> = BTreeMap::new();
    for &word in parts.iter().flat_map(|part| &part.words) {
        brought.insert(word / AT_ONCE, 0);
    }
    for (&group, words) in &mut brought {
        let first = code.linker.uint_constant(group * AT_ONCE);
        *words = code.call(four, hook, &[slot, first, last]);
    }
    for part in parts {
        let scalars: Vec<Word> = (part.words.iter())
            .map(|word| code.swizzle(uint, brought[&(word / AT_ONCE)], word % AT_ONCE, 1))
            .collect();
        let (value, _) = compose(code, part.ty, &scalars)?;
        code.store(part.stand_in, value);
    }
    Ok(())
}

/// A value of type `ty` of the first of `scalars`, and the others.
fn compose<'s>(code: &mut Code, ty: Word, scalars: &'s [Word]) -> Outcome<(Word, &'s [Word])> {
    let declaration = code.linker.global(ty)?;
    match (declaration.class.opcode, declaration.operands.as_slice()) {
        (
            Op::TypeVector | Op::TypeMatrix,
            &[Operand::IdRef(part), Operand::LiteralBit32(count)],
        ) => {
            let (mut values, mut rest) = (Vec::new(), scalars);
            for _ in 0..count {
                let (value, after) = compose(code, part, rest)?;
                values.push(id(value));
                rest = after;
            }
            Ok((code.emit(Op::CompositeConstruct, ty, values), rest))
        }
        _ => match scalars {
            [first, rest @ ..] => Ok((code.bitcast(ty, *first)?, rest)),
            [] => Err("a block whose words are not all known".into()),
        },
    }
}

/// Makes loads from the chains load from the variables that stand in for them.
fn replace(linker: &mut Linker, functions: &mut [Function], instead: &HashMap<Word, Word>) {
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
}

/// Access chains that go by constants to a value in one of `blocks`, and from which nothing is done
/// but loading: each with its place and the type of the value.
fn chains(
    linker: &Linker,
    functions: &[Function],
    blocks: &HashMap<Word, (Word, Word)>,
) -> Vec<(Word, Place, Word)> {
    let instructions = || functions.iter().flat_map(|f| &f.blocks).flat_map(|b| &b.instructions);
    let mut found = Vec::new();
    for i in instructions() {
        let chain = matches!(i.class.opcode, Op::AccessChain | Op::InBoundsAccessChain);
        let (true, Some(result), Some(pointer)) = (chain, i.result_id, i.result_type) else {
            continue;
        };
        let mut operands = ids(i);
        let Some(variable) = operands.next().filter(|v| blocks.contains_key(v)) else { continue };
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
