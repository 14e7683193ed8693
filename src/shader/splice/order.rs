//! Puts declarations in an order in which each follows the ones that it refers to.
//!
//! The splicer declares types and constants when it first needs them, but SPIR-V requires definitions
//! before uses. A struct may refer to a pointer before its declaration if `OpTypeForwardPointer` announces the
//! pointer.

use crate::shader::module::ids;
use rspirv::{
    dr::Instruction,
    spirv::{Op, Word},
};
use std::collections::{HashMap, HashSet};

/// Sorts `declarations`. Declarations that are in order keep their order.
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
        // Each entry is visited twice: first to visit its dependencies, then to be placed after them.
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
