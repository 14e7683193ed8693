//! What an entry point reaches: functions, and the module-level ids they mention.
//!
//! Compilers leave declarations behind that nothing uses, and a module may have several entry
//! points. Only code that the entry point reaches counts: for reflection, for refusals and for splicing.

use super::{
    Stage,
    module::{Index, Outcome, id_operand, ids},
};
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{ExecutionModel, Op, Word},
};

/// The functions and variables that the entry point of a stage reaches.
pub(super) struct Usage<'m> {
    /// The entry point's function.
    pub entry: Word,
    /// Reached functions, the entry point's among them, in the module's order.
    pub functions: Vec<&'m Function>,
    /// By id: mentioned by a reached function, or by what such a mention needs.
    used: Vec<bool>,
}

impl<'m> Usage<'m> {
    /// Follows calls from the entry point `main` of `stage`.
    pub fn new(index: &Index<'m>, stage: Stage) -> Outcome<Self> {
        let model = match stage {
            Stage::Vertex => ExecutionModel::Vertex,
            Stage::Fragment => ExecutionModel::Fragment,
        };
        let named_main = |i: &&Instruction| {
            i.operands.first() == Some(&Operand::ExecutionModel(model))
                && matches!(i.operands.get(2), Some(Operand::LiteralString(name)) if name == "main")
        };
        let entry_point = index.module.entry_points.iter().find(named_main);
        let entry_point =
            entry_point.ok_or_else(|| format!("no entry point `main` for the {stage} stage"))?;
        let entry = id_operand(entry_point, 1)?;
        let mut usage =
            Self { entry, functions: Vec::new(), used: vec![false; index.bound() as usize] };
        let mut open = vec![entry];
        while let Some(id) = open.pop() {
            let Some(seen) = usage.used.get_mut(id as usize) else { continue };
            if std::mem::replace(seen, true) {
                continue;
            }
            let def = index.def(id)?;
            open.extend(ids(def).chain(def.result_type));
            if def.class.opcode == Op::Function {
                let body = index.module.functions.iter().find(|f| f.def_id() == Some(id));
                for instruction in body.iter().flat_map(|f| f.all_inst_iter()) {
                    open.extend(ids(instruction).chain(instruction.result_type));
                }
            }
        }
        let reached = |f: &&Function| f.def_id().is_some_and(|id| usage.used[id as usize]);
        usage.functions = index.module.functions.iter().filter(reached).collect();
        Ok(usage)
    }

    /// Whether the entry point reaches `id`.
    pub fn uses(&self, id: Word) -> bool {
        self.used.get(id as usize).copied().unwrap_or(false)
    }

    /// All instructions of reached functions.
    pub fn instructions(&self) -> impl Iterator<Item = &'m Instruction> + '_ {
        self.functions.iter().flat_map(|f| f.all_inst_iter())
    }

    /// Reached module-level variables.
    pub fn variables<'a>(
        &'a self,
        index: &Index<'m>,
    ) -> impl Iterator<Item = &'m Instruction> + 'a {
        let globals = index.module.types_global_values.iter();
        globals.filter(|i| {
            i.class.opcode == Op::Variable && i.result_id.is_some_and(|id| self.uses(id))
        })
    }

    /// Whether a member of the block `variable` is selected, or the whole of it is used.
    pub fn uses_member(&self, index: &Index, variable: Word, member: u32) -> bool {
        self.instructions().filter(|i| ids(i).any(|id| id == variable)).any(|i| {
            match i.class.opcode {
                Op::AccessChain | Op::InBoundsAccessChain => i
                    .operands
                    .get(1)
                    .and_then(Operand::id_ref_any)
                    .is_none_or(|n| index.constant(n).map_or(true, |n| n == member)),
                _ => true,
            }
        })
    }
}
