//! The control flow of a function: which block follows which, which dominates which, and in which
//! loop or selection a block lies.

use rspirv::{
    dr::{Block, Function, Instruction, Operand},
    spirv::{Op, Word},
};
use std::collections::HashMap;

/// A structured construct: a header and where its flow meets again.
#[derive(Clone, Copy, Debug)]
pub(super) struct Construct {
    /// The block with the merge instruction.
    pub header: usize,
    /// Where the flow meets again.
    pub merge: usize,
    /// Where a loop's next iteration is prepared.
    pub proceed: Option<usize>,
}

/// Control flow by block number, in the order of `function.blocks`; 0 is the entry.
pub(super) struct Flow {
    numbers: HashMap<Word, usize>,
    successors: Vec<Vec<usize>>,
    /// Position in reverse postorder; `None` if the entry does not reach the block.
    rank: Vec<Option<usize>>,
    /// The immediate dominator; the entry's is itself.
    dominator: Vec<usize>,
    /// Loops and selections.
    pub constructs: Vec<Construct>,
}

impl Flow {
    /// Analyses `function`.
    pub fn new(function: &Function) -> Self {
        let blocks = &function.blocks;
        let numbers: HashMap<Word, usize> =
            blocks.iter().enumerate().filter_map(|(n, b)| Some((b.label_id()?, n))).collect();
        let number = |o: &Operand| o.id_ref_any().and_then(|id| numbers.get(&id).copied());
        let successors: Vec<Vec<usize>> = blocks
            .iter()
            .map(|b| targets(b.instructions.last()).iter().filter_map(number).collect())
            .collect();
        let mut constructs = Vec::new();
        for (header, instruction) in
            blocks.iter().enumerate().flat_map(|(n, b)| b.instructions.iter().map(move |i| (n, i)))
        {
            let proceed = match instruction.class.opcode {
                Op::LoopMerge => instruction.operands.get(1).and_then(number),
                Op::SelectionMerge => None,
                _ => continue,
            };
            if let Some(merge) = instruction.operands.first().and_then(number) {
                constructs.push(Construct { header, merge, proceed });
            }
        }
        let order = reverse_postorder(&successors);
        let mut rank = vec![None; blocks.len()];
        for (position, &n) in order.iter().enumerate() {
            rank[n] = Some(position);
        }
        let dominator = dominators(&successors, &order, &rank);
        Self { numbers, successors, rank, dominator, constructs }
    }

    /// The block with this label.
    pub fn number(&self, label: Word) -> Option<usize> {
        self.numbers.get(&label).copied()
    }

    /// Whether the entry reaches the block.
    pub fn is_reached(&self, block: usize) -> bool {
        self.rank[block].is_some()
    }

    /// Whether `from` may be followed by `to`.
    pub fn goes(&self, from: usize, to: usize) -> bool {
        self.successors[from].contains(&to)
    }

    /// Whether any reached block goes to `block`.
    pub fn has_predecessor(&self, block: usize) -> bool {
        (0..self.successors.len()).any(|n| self.is_reached(n) && self.goes(n, block))
    }

    /// Whether every way from the entry to `b` leads through `a`.
    pub fn dominates(&self, a: usize, b: usize) -> bool {
        if !self.is_reached(a) || !self.is_reached(b) {
            return false;
        }
        let mut at = b;
        while at != a {
            if at == self.dominator[at] {
                return false;
            }
            at = self.dominator[at];
        }
        true
    }

    /// The innermost construct around `block` among those that `wanted` accepts.
    pub fn innermost(
        &self,
        block: usize,
        wanted: impl Fn(&Construct) -> bool,
    ) -> Option<Construct> {
        let around = |c: &&Construct| {
            wanted(c) && self.dominates(c.header, block) && !self.dominates(c.merge, block)
        };
        self.constructs.iter().filter(around).max_by_key(|c| self.depth(c.header)).copied()
    }

    fn depth(&self, block: usize) -> usize {
        let (mut at, mut depth) = (block, 0);
        while at != self.dominator[at] {
            at = self.dominator[at];
            depth += 1;
        }
        depth
    }
}

/// Labels that a terminator may go to.
fn targets(terminator: Option<&Instruction>) -> &[Operand] {
    let Some(terminator) = terminator else { return &[] };
    match terminator.class.opcode {
        Op::Branch => &terminator.operands,
        Op::BranchConditional => &terminator.operands[1..3],
        Op::Switch => &terminator.operands[1..],
        _ => &[],
    }
}

fn reverse_postorder(successors: &[Vec<usize>]) -> Vec<usize> {
    let mut order = Vec::with_capacity(successors.len());
    let mut seen = vec![false; successors.len()];
    let mut open = vec![(0, false)];
    while let Some((n, done)) = open.pop() {
        if done {
            order.push(n);
        } else if n < seen.len() && !std::mem::replace(&mut seen[n], true) {
            open.push((n, true));
            open.extend(successors[n].iter().rev().map(|&m| (m, false)));
        }
    }
    order.reverse();
    order
}

/// Immediate dominators, after Cooper, Harvey and Kennedy, "A Simple, Fast Dominance Algorithm".
fn dominators(successors: &[Vec<usize>], order: &[usize], rank: &[Option<usize>]) -> Vec<usize> {
    let mut predecessors = vec![Vec::new(); successors.len()];
    for &n in order {
        for &to in &successors[n] {
            predecessors[to].push(n);
        }
    }
    let mut dominator: Vec<Option<usize>> = vec![None; successors.len()];
    if let Some(&entry) = order.first() {
        dominator[entry] = Some(entry);
    }
    let meet = |dominator: &[Option<usize>], mut a: usize, mut b: usize| {
        while a != b {
            let (low, high) = if rank[a] > rank[b] { (&mut a, b) } else { (&mut b, a) };
            match dominator[*low] {
                Some(up) => *low = up,
                None => return high,
            }
        }
        a
    };
    let mut changed = true;
    while std::mem::take(&mut changed) {
        for &n in order.iter().skip(1) {
            let known = predecessors[n].iter().copied().filter(|&p| dominator[p].is_some());
            let new = known.reduce(|a, b| meet(&dominator, a, b));
            if new != dominator[n] {
                dominator[n] = new;
                changed = true;
            }
        }
    }
    dominator.iter().enumerate().map(|(n, d)| d.unwrap_or(n)).collect()
}

/// The position in a block where code may be inserted: after phis and function variables.
pub(super) fn first_free(block: &Block) -> usize {
    let fixed = |i: &Instruction| matches!(i.class.opcode, Op::Phi | Op::Variable);
    block.instructions.iter().take_while(|i| fixed(i)).count()
}

/// The position before a block's terminator and its merge instruction.
pub(super) fn end(block: &Block) -> usize {
    let list = &block.instructions;
    let merges = |i: &Instruction| matches!(i.class.opcode, Op::LoopMerge | Op::SelectionMerge);
    let tail = list.len().saturating_sub(1);
    if tail > 0 && merges(&list[tail - 1]) { tail - 1 } else { tail }
}

/// Names the new predecessor in the phis of a function in which blocks were split: `tails` maps the
/// label of a block to the label of the block that now ends it. `fresh` are phis that are right.
pub(super) fn rename_predecessors(
    function: &mut Function,
    tails: &HashMap<Word, Word>,
    fresh: &[Word],
) {
    let phis = function.blocks.iter_mut().flat_map(|b| &mut b.instructions);
    for phi in phis.filter(|i| i.class.opcode == Op::Phi) {
        if phi.result_id.is_some_and(|id| fresh.contains(&id)) {
            continue;
        }
        for operand in phi.operands.iter_mut().skip(1).step_by(2) {
            if let Operand::IdRef(label) = operand
                && let Some(&tail) = tails.get(label)
            {
                *label = tail;
            }
        }
    }
}
