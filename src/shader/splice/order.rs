//! Puts declarations in an order in which each follows what it mentions.
//!
//! Types and constants are declared when they are first needed, while SPIR-V wants definitions
//! before uses. A pointer that `OpTypeForwardPointer` announces may be mentioned by structs before it
//! is declared.

use crate::shader::module::ids;
use rspirv::{
    dr::Instruction,
    spirv::{Op, Word},
};
use std::collections::{HashMap, HashSet};

/// Sorts `declarations`; what is in order stays as it is.
pub(super) fn sort(declarations: Vec<Instruction>) -> Vec<Instruction> {
    let positions: HashMap<Word, usize> = (declarations.iter().enumerate())
        .filter_map(|(n, i)| i.result_id.map(|id| (id, n)))
        .collect();
    let is_announcement = |i: &Instruction| i.class.opcode == Op::TypeForwardPointer;
    let announced: HashSet<Word> =
        declarations.iter().filter(|i| is_announcement(i)).flat_map(ids).collect();
    let needs = |instruction: &Instruction| -> Vec<usize> {
        if is_announcement(instruction) {
            return Vec::new();
        }
        let is_struct = instruction.class.opcode == Op::TypeStruct;
        ids(instruction)
            .chain(instruction.result_type)
            .filter(|id| !(is_struct && announced.contains(id)))
            .filter_map(|id| positions.get(&id).copied())
            .collect()
    };
    let mut order = Vec::with_capacity(declarations.len());
    let mut seen = vec![false; declarations.len()];
    // Announcements come first, since the structs that rely on them do not name them.
    let first = (0..declarations.len()).filter(|&n| is_announcement(&declarations[n]));
    let rest = (0..declarations.len()).filter(|&n| !is_announcement(&declarations[n]));
    for root in first.chain(rest) {
        // Entries are visited twice: to open what they need, then to be placed after it.
        let mut open = vec![(root, false)];
        while let Some((n, ready)) = open.pop() {
            if ready {
                order.push(n);
            } else if !std::mem::replace(&mut seen[n], true) {
                open.push((n, true));
                open.extend(needs(&declarations[n]).into_iter().rev().map(|m| (m, false)));
            }
        }
    }
    let mut slots: Vec<Option<Instruction>> = declarations.into_iter().map(Some).collect();
    order.into_iter().filter_map(|n| slots[n].take()).collect()
}
