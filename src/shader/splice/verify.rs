//! Checks a spliced module, independently of how it was made.
//!
//! The rules are those that splicing could break: every id is defined, once, before it is used on
//! every way; phis name their predecessors; calls, loads and stores fit their types; the entry point
//! lists all variables; and nothing is left that a compute kernel may not have. The user's compiler and ours
//! already follow all other rules. The test suite runs `spirv-val` on the same modules; this check serves
//! machines without it.

use super::flow::Flow;
use crate::shader::module::{self, Index, Outcome, ids};
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{Capability, ExecutionModel, Op, StorageClass, Word},
};
use std::collections::{HashMap, HashSet};

/// Checks the words of a spliced module; the error names the fault.
pub(crate) fn verify(words: &[u32]) -> Outcome<()> {
    let module = module::parse(words)?;
    let index = Index::new(&module);
    if module.header.as_ref().is_none_or(|h| h.bound < index.bound()) {
        return Err("the bound is too small".into());
    }
    for instruction in module.all_inst_iter() {
        for id in ids(instruction).chain(instruction.result_type) {
            index.def(id)?;
        }
    }
    interface(&index)?;
    let quads = module
        .capabilities
        .iter()
        .any(|i| i.operands == [Operand::Capability(Capability::ComputeDerivativeGroupLinearKHR)]);
    for function in &module.functions {
        structure(function)?;
        dominance(function)?;
        for instruction in function.all_inst_iter() {
            if is_out_of_place(instruction.class.opcode, quads) {
                return Err(format!("Op{} in a kernel", instruction.class.opname));
            }
            types(&index, function, instruction)?;
        }
    }
    Ok(())
}

/// One compute entry point that lists every variable once; inputs are built-ins.
fn interface(index: &Index) -> Outcome<()> {
    let [entry] = index.module.entry_points.as_slice() else {
        return Err("not exactly one entry point".into());
    };
    if entry.operands.first() != Some(&Operand::ExecutionModel(ExecutionModel::GLCompute)) {
        return Err("an entry point that is no compute kernel".into());
    }
    let listed: Vec<Word> = entry.operands.iter().skip(3).filter_map(Operand::id_ref_any).collect();
    let set: HashSet<Word> = listed.iter().copied().collect();
    if set.len() != listed.len() {
        return Err("an entry point that lists a variable twice".into());
    }
    let globals = index.module.types_global_values.iter();
    for variable in globals.filter(|i| i.class.opcode == Op::Variable) {
        let Some(id) = variable.result_id else { continue };
        if !set.contains(&id) {
            return Err(format!("variable {id} is not listed by the entry point"));
        }
        let (class, _) = index.pointer(index.type_of(id)?)?;
        let misplaced = match class {
            StorageClass::Input => index.built_in(id, None).is_none(),
            StorageClass::Output => true,
            _ => false,
        };
        if misplaced {
            return Err(format!("variable {id} of the class {class:?} in a kernel"));
        }
    }
    Ok(())
}

/// Instructions that only graphics pipelines have.
fn is_out_of_place(op: Op, quads: bool) -> bool {
    match op {
        Op::Kill
        | Op::TerminateInvocation
        | Op::DemoteToHelperInvocation
        | Op::IsHelperInvocationEXT => true,
        Op::DPdx
        | Op::DPdy
        | Op::Fwidth
        | Op::DPdxFine
        | Op::DPdyFine
        | Op::FwidthFine
        | Op::DPdxCoarse
        | Op::DPdyCoarse
        | Op::FwidthCoarse
        | Op::ImageSampleImplicitLod
        | Op::ImageSampleDrefImplicitLod
        | Op::ImageSampleProjImplicitLod
        | Op::ImageSampleProjDrefImplicitLod
        | Op::ImageQueryLod => !quads,
        _ => false,
    }
}

fn is_terminator(instruction: &Instruction) -> bool {
    rspirv::grammar::reflect::is_block_terminator(instruction.class.opcode)
}

/// Blocks end where they should and go to blocks of the same function.
fn structure(function: &Function) -> Outcome<()> {
    let labels: HashSet<Word> = function.blocks.iter().filter_map(|b| b.label_id()).collect();
    for block in &function.blocks {
        let Some((last, rest)) = block.instructions.split_last() else {
            return Err("an empty block".into());
        };
        if !is_terminator(last) || rest.iter().any(is_terminator) {
            return Err("a block that does not end where it should".into());
        }
        let merges = |i: &Instruction| matches!(i.class.opcode, Op::LoopMerge | Op::SelectionMerge);
        if rest.iter().rev().skip(1).any(merges) {
            return Err("a merge instruction that is not next to last".into());
        }
        let first = rest.iter().position(|i| i.class.opcode != Op::Phi).unwrap_or(rest.len());
        if rest[first..].iter().any(|i| i.class.opcode == Op::Phi) {
            return Err("a phi after other instructions".into());
        }
        let targets = match last.class.opcode {
            Op::Branch => &last.operands[..],
            Op::BranchConditional => &last.operands[1..],
            Op::Switch => &last.operands[1..],
            _ => &[],
        };
        if targets.iter().filter_map(Operand::id_ref_any).any(|to| !labels.contains(&to)) {
            return Err("a branch out of its function".into());
        }
    }
    Ok(())
}

/// Definitions dominate uses, and phis name each predecessor once.
fn dominance(function: &Function) -> Outcome<()> {
    let flow = Flow::new(function);
    let mut homes: HashMap<Word, (usize, usize)> = HashMap::new();
    for (n, block) in function.blocks.iter().enumerate() {
        for (position, instruction) in block.instructions.iter().enumerate() {
            homes.extend(instruction.result_id.map(|result| (result, (n, position))));
        }
    }
    for (n, block) in function.blocks.iter().enumerate().filter(|(n, _)| flow.is_reached(*n)) {
        for (position, instruction) in block.instructions.iter().enumerate() {
            if instruction.class.opcode == Op::Phi {
                phi(function, &flow, n, instruction, &homes)?;
                continue;
            }
            for id in ids(instruction) {
                let Some(&(home, at)) = homes.get(&id) else { continue };
                let before = if home == n { at < position } else { flow.dominates(home, n) };
                if !before {
                    return Err(format!("id {id} is used where it may not be defined"));
                }
            }
        }
    }
    Ok(())
}

fn phi(
    function: &Function,
    flow: &Flow,
    block: usize,
    phi: &Instruction,
    homes: &HashMap<Word, (usize, usize)>,
) -> Outcome<()> {
    let mut named = HashSet::new();
    for pair in phi.operands.chunks(2) {
        let [value, label] = pair else { return Err("an incomplete phi".into()) };
        let (Some(value), Some(from)) =
            (value.id_ref_any(), label.id_ref_any().and_then(|label| flow.number(label)))
        else {
            return Err("a phi from no block".into());
        };
        if !named.insert(from) || !flow.goes(from, block) {
            let result = phi.result_id.unwrap_or_default();
            return Err(format!("the phi {result} names a wrong predecessor"));
        }
        if let Some(&(home, _)) = homes.get(&value)
            && flow.is_reached(from)
            && !flow.dominates(home, from)
        {
            return Err(format!("id {value} is used by a phi where it may not be defined"));
        }
    }
    let missing = (0..function.blocks.len()).find(|n| flow.goes(*n, block) && !named.contains(n));
    match missing {
        Some(_) => Err("a phi that leaves out a predecessor".into()),
        None => Ok(()),
    }
}

/// Loads, stores, calls and returns fit their types.
fn types(index: &Index, function: &Function, instruction: &Instruction) -> Outcome<()> {
    let operand = |n: usize| module::id_operand(instruction, n);
    let wrong = || {
        let (op, result) = (instruction.class.opname, instruction.result_id.unwrap_or_default());
        Err(format!("types that do not fit in Op{op} (result {result})"))
    };
    match instruction.class.opcode {
        Op::Load => {
            let (_, pointee) = index.pointer(index.type_of(operand(0)?)?)?;
            if Some(pointee) != instruction.result_type {
                return wrong();
            }
        }
        Op::Store => {
            let (_, pointee) = index.pointer(index.type_of(operand(0)?)?)?;
            if pointee != index.type_of(operand(1)?)? {
                return wrong();
            }
        }
        Op::FunctionCall => {
            let signature = index.id_operand(operand(0)?, 1)?;
            let wanted: Vec<Word> = ids(index.def(signature)?).collect();
            let given: Vec<Word> =
                ids(instruction).skip(1).map(|id| index.type_of(id)).collect::<Outcome<_>>()?;
            if wanted.first().copied() != instruction.result_type || wanted[1..] != given {
                return wrong();
            }
        }
        Op::ReturnValue => {
            let result = function.def.as_ref().and_then(|def| def.result_type);
            if Some(index.type_of(operand(0)?)?) != result {
                return wrong();
            }
        }
        Op::Phi => {
            for value in ids(instruction).step_by(2) {
                if Some(index.type_of(value)?) != instruction.result_type {
                    return wrong();
                }
            }
        }
        _ => {}
    }
    Ok(())
}
