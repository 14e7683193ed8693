//! The control flow of one function whose conditions are constants.
//!
//! Structure stays valid by two rules. A selection keeps its merge instruction, and the arm that is never taken becomes an
//! empty one, until it is certain that no construct inside of it breaks out of it: then the header branches straight to its
//! arm. And a block that a merge instruction names is kept as long as that instruction is. Loops keep their headers, and the
//! branches that leave them stay as they are.

use super::value::Value;
use rspirv::{
    dr::{Block, Instruction, Operand},
    spirv::{Op, Word},
};
use std::collections::{HashMap, HashSet};

/// The label of a block.
pub fn label(block: &Block) -> Word {
    block.label.as_ref().and_then(|label| label.result_id).unwrap_or(0)
}

/// The labels that a block branches to.
pub fn successors(block: &Block) -> Vec<Word> {
    let Some(last) = block.instructions.last() else { return Vec::new() };
    let ids = last.operands.iter().filter_map(Operand::id_ref_any);
    match last.class.opcode {
        Op::Branch => ids.collect(),
        Op::BranchConditional | Op::Switch => ids.skip(1).collect(),
        _ => Vec::new(),
    }
}

/// The merge instruction of a header.
fn merge(block: &Block) -> Option<&Instruction> {
    let at = block.instructions.len().checked_sub(2)?;
    let is_merge = |i: &&Instruction| matches!(i.class.opcode, Op::SelectionMerge | Op::LoopMerge);
    Some(&block.instructions[at]).filter(is_merge)
}

/// The labels that a merge instruction names: the merge block first, then the continue target of a loop.
fn merges(block: &Block) -> impl Iterator<Item = Word> {
    merge(block).into_iter().flat_map(|i| i.operands.iter().filter_map(Operand::id_ref_any))
}

/// A selection whose condition is known.
struct Selection {
    merge: Word,
    /// The label that it goes to.
    live: Word,
}

/// The selection that `block` is the header of, if its condition is constant.
fn selection(block: &Block, values: &HashMap<Word, Value>) -> Option<Selection> {
    let merge = merge(block).filter(|i| i.class.opcode == Op::SelectionMerge)?;
    let merge = merge.operands.first()?.id_ref_any()?;
    let last = block.instructions.last()?;
    let condition = values.get(&last.operands.first()?.id_ref_any()?)?;
    let live = match (last.class.opcode, condition) {
        (Op::BranchConditional, Value::Bool(true)) => &last.operands[1],
        (Op::BranchConditional, Value::Bool(false)) => &last.operands[2],
        (Op::Switch, Value::Int(value)) => {
            let mut cases = last.operands[2..].chunks_exact(2);
            let taken = cases.find(|case| case[0] == Operand::LiteralBit32(*value));
            taken.map_or(&last.operands[1], |case| &case[1])
        }
        _ => return None,
    };
    Some(Selection { merge, live: live.id_ref_any()? })
}

/// Empties the arms that are never taken. Whether there was any.
pub fn cut_arms(blocks: &mut [Block], values: &HashMap<Word, Value>) -> bool {
    let mut changed = false;
    for block in blocks {
        let Some(Selection { merge, live }) = selection(block, values) else { continue };
        if live == merge {
            go_straight(block, live);
            changed = true;
            continue;
        }
        let Some(last) = block.instructions.last_mut() else { continue };
        let before = last.operands.clone();
        if last.class.opcode == Op::Switch {
            last.operands.truncate(2);
            last.operands[1] = Operand::IdRef(live);
        } else {
            for target in &mut last.operands[1..3] {
                if *target != Operand::IdRef(live) {
                    *target = Operand::IdRef(merge);
                }
            }
        }
        changed |= before != last.operands;
    }
    changed
}

/// Makes of a header a block that goes to `target` alone.
fn go_straight(block: &mut Block, target: Word) {
    block.instructions.truncate(block.instructions.len() - 2);
    block.instructions.push(Instruction::new(Op::Branch, None, None, vec![Operand::IdRef(target)]));
}

/// Has headers branch straight to the only arm that they have, where nothing inside of it breaks out of it. Whether one did.
pub fn unwrap(blocks: &mut [Block], values: &HashMap<Word, Value>) -> bool {
    let before = predecessors(blocks);
    let by_label = by_label(blocks);
    let is_wrapped = |(at, block): (usize, &Block)| {
        let Selection { merge, live } = selection(block, values)?;
        let end = end_of_arm(&by_label, live, merge);
        let mut others = before.get(&merge).into_iter().flatten();
        let is_end = |from: &Word| *from == label(block) || end == Some(*from);
        others.all(is_end).then_some((at, live))
    };
    let wrapped: Vec<_> = blocks.iter().enumerate().filter_map(is_wrapped).collect();
    wrapped.iter().for_each(|(at, live)| go_straight(&mut blocks[*at], *live));
    !wrapped.is_empty()
}

fn by_label(blocks: &[Block]) -> HashMap<Word, &Block> {
    blocks.iter().map(|block| (label(block), block)).collect()
}

/// The block outside of any inner construct from which the arm that begins at `first` gets to `merge`.
fn end_of_arm(by_label: &HashMap<Word, &Block>, first: Word, merge: Word) -> Option<Word> {
    let mut at = first;
    for _ in by_label {
        let block = by_label.get(&at)?;
        // An inner construct is passed over: it ends at its own merge block.
        let inner = merges(block).next();
        let next = match (inner, &successors(block)[..]) {
            (Some(inner), _) => inner,
            (None, [next]) => *next,
            _ => return None,
        };
        if next == merge {
            return inner.is_none().then_some(at);
        }
        at = next;
    }
    None
}

/// The blocks before each block.
fn predecessors(blocks: &[Block]) -> HashMap<Word, Vec<Word>> {
    let mut found = HashMap::<_, Vec<_>>::new();
    for block in blocks {
        for next in successors(block) {
            let before = found.entry(next).or_default();
            if !before.contains(&label(block)) {
                before.push(label(block));
            }
        }
    }
    found
}

/// Removes the blocks that nothing leads to and no merge instruction names. The others are put in an order in which
/// each one comes after those that all ways to it go through: with fewer ways, that may be another order than before.
pub fn remove_unreachable(blocks: &mut Vec<Block>) {
    let by_label = by_label(blocks);
    let (mut reached, mut finished) = (HashSet::new(), Vec::new());
    let mut open: Vec<(Word, bool)> =
        blocks.first().map(|block| (label(block), false)).into_iter().collect();
    while let Some((next, is_finished)) = open.pop() {
        if is_finished {
            finished.push(next);
        } else if let Some(block) = by_label.get(&next).filter(|_| reached.insert(next)) {
            open.push((next, true));
            // The last one is gone through first, and comes last.
            let merges: Vec<Word> = merges(block).collect();
            let all = successors(block).into_iter().chain(merges.into_iter().rev());
            open.extend(all.map(|label| (label, false)));
        }
    }
    let places: HashMap<Word, usize> = finished.into_iter().rev().zip(0..).collect();
    blocks.retain(|block| places.contains_key(&label(block)));
    blocks.sort_by_key(|block| places.get(&label(block)).copied());
}

/// Gives the `OpPhi`s of a function one value for each block that is before theirs. `undefined` makes a value of a type for
/// a branch that is never taken; `None` if it cannot.
pub fn repair_phis(
    blocks: &mut [Block],
    mut undefined: impl FnMut(Word) -> Option<Word>,
) -> Option<()> {
    let before = predecessors(blocks);
    for block in blocks {
        let before = before.get(&label(block)).map_or(&[][..], Vec::as_slice);
        for phi in block.instructions.iter_mut().filter(|i| i.class.opcode == Op::Phi) {
            let known = |from: &Word| {
                phi.operands.chunks_exact(2).find(|pair| pair[1] == Operand::IdRef(*from))
            };
            let mut operands = Vec::new();
            for from in before {
                let value = match known(from) {
                    Some(pair) => pair[0].clone(),
                    None => Operand::IdRef(undefined(phi.result_type?)?),
                };
                operands.extend([value, Operand::IdRef(*from)]);
            }
            match operands.is_empty() {
                true => {
                    *phi = Instruction::new(Op::Undef, phi.result_type, phi.result_id, operands)
                }
                false => phi.operands = operands,
            }
        }
    }
    Some(())
}
