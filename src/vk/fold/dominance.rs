//! Whether what a function uses was always computed before.

use super::flow::{label, successors};
use rspirv::{
    dr::{Block, Instruction, Operand},
    spirv::{Op, Word},
};
use std::collections::HashMap;

/// Whether each use of a value comes after its definition, whichever way the blocks are gone through. The blocks come in an
/// order in which each one is after those that all ways to it go through.
pub fn is_kept(blocks: &[Block]) -> bool {
    let numbers: HashMap<Word, usize> =
        blocks.iter().enumerate().map(|(number, block)| (label(block), number)).collect();
    let dominators = dominators(blocks, &numbers);
    let dominates = |first: usize, mut block: usize| {
        while block > first {
            // Nothing leads to the block: it never runs.
            let Some(next) = dominators[block] else { return true };
            block = next;
        }
        block == first
    };
    let mut defined = HashMap::new();
    for (number, block) in blocks.iter().enumerate() {
        defined.extend(block.instructions.iter().filter_map(|i| Some((i.result_id?, number))));
    }
    let is_before = |id: Word, number: usize| {
        defined.get(&id).is_none_or(|definition| dominates(*definition, number))
    };
    let uses = |number: usize, i: &Instruction| match i.class.opcode {
        Op::Phi => i.operands.chunks_exact(2).all(|pair| {
            let from = pair[1].id_ref_any().and_then(|from| numbers.get(&from));
            let value = pair[0].id_ref_any();
            value.zip(from).is_none_or(|(value, from)| is_before(value, *from))
        }),
        _ => i.operands.iter().filter_map(Operand::id_ref_any).all(|id| is_before(id, number)),
    };
    blocks.iter().enumerate().all(|(n, block)| block.instructions.iter().all(|i| uses(n, i)))
}

/// The nearest block that all ways to each block go through; `None` for the first block and for blocks that nothing leads to
/// (Cooper, Harvey and Kennedy, "A Simple, Fast Dominance Algorithm").
fn dominators(blocks: &[Block], numbers: &HashMap<Word, usize>) -> Vec<Option<usize>> {
    let mut before = vec![Vec::new(); blocks.len()];
    for (number, block) in blocks.iter().enumerate() {
        for next in successors(block).iter().filter_map(|label| numbers.get(label)) {
            before[*next].push(number);
        }
    }
    let mut found: Vec<Option<usize>> = vec![None; blocks.len()];
    let is_reached = |found: &[Option<usize>], block: usize| block == 0 || found[block].is_some();
    let mut changed = true;
    while changed {
        changed = false;
        for number in 1..blocks.len() {
            let mut reached = before[number].iter().copied().filter(|b| is_reached(&found, *b));
            let Some(first) = reached.next() else { continue };
            let common = reached.fold(first, |a, b| {
                let (mut a, mut b) = (a, b);
                while a != b {
                    let later = if a > b { &mut a } else { &mut b };
                    *later = found[*later].unwrap_or(0);
                }
                a
            });
            changed |= found[number] != Some(common);
            found[number] = Some(common);
        }
    }
    found
}
