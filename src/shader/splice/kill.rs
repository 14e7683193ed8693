//! `discard`: the invocation becomes a helper and leaves the innermost loop or selection.
//!
//! In a graphics pipeline a killed invocation ends, but on every device the other invocations of its quad
//! still take derivatives with it: `if (alpha < cut) discard; texture(…)` is everyday code. If a lane of a
//! kernel returned instead, its neighbours would take derivatives with garbage. So `OpKill` and
//! `OpTerminateInvocation` are lowered like `demote`: the helper flag is set, and the lane continues behind
//! the construct around it. If that is a loop, the lane leaves the loop for good, since the `discard` may have
//! been the loop's only exit.
//!
//! The new edge may bypass the definition of a value that is used after the construct. Such a value is then
//! passed through a variable ([`super::repair`]); its content does not matter for the helper.
//!
//! (Rejected: returning at once, for the garbage; refusing modules that need repair, since every
//! optimizer makes them.)

use super::{
    flow::Flow,
    linker::{Linker, id},
    repair,
};
use crate::shader::module::Outcome;
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{Op, Word},
};
use std::collections::{HashMap, HashSet};

/// Lowers every `discard`. `helper` is the kernel's flag.
pub(super) fn lower(linker: &mut Linker, functions: &mut [Function], helper: Word) -> Outcome<()> {
    refuse_endless_callers(functions)?;
    for function in functions.iter_mut().filter(|f| kills(f)) {
        lower_function(linker, function, helper)?;
    }
    for block in functions.iter_mut().flat_map(|f| &mut f.blocks) {
        for instruction in &mut block.instructions {
            if instruction.class.opcode == Op::DemoteToHelperInvocation {
                *instruction = set_helper(linker, helper);
            }
        }
    }
    Ok(())
}

fn is_kill(instruction: &Instruction) -> bool {
    matches!(instruction.class.opcode, Op::Kill | Op::TerminateInvocation)
}

fn kills(function: &Function) -> bool {
    function.all_inst_iter().any(is_kill)
}

fn set_helper(linker: &mut Linker, helper: Word) -> Instruction {
    let yes = linker.bool_constant(true);
    Instruction::new(Op::Store, None, None, vec![id(helper), id(yes)])
}

/// A loop that ends only by a `discard` in a function it calls would not end any more.
fn refuse_endless_callers(functions: &[Function]) -> Outcome<()> {
    let mut killers: HashSet<Word> =
        functions.iter().filter(|f| kills(f)).filter_map(|f| f.def_id()).collect();
    let calls = |i: &Instruction, killers: &HashSet<Word>| {
        i.class.opcode == Op::FunctionCall
            && i.operands[0].id_ref_any().is_some_and(|f| killers.contains(&f))
    };
    loop {
        let more: Vec<Word> = (functions.iter())
            .filter(|f| f.all_inst_iter().any(|i| calls(i, &killers)))
            .filter_map(|f| f.def_id())
            .filter(|id| !killers.contains(id))
            .collect();
        if more.is_empty() {
            break;
        }
        killers.extend(more);
    }
    if killers.is_empty() {
        return Ok(());
    }
    for function in functions {
        let flow = Flow::new(function);
        for (n, block) in function.blocks.iter().enumerate() {
            if !block.instructions.iter().any(|i| calls(i, &killers)) {
                continue;
            }
            let endless =
                |c: &super::flow::Construct| c.proceed.is_some() && !flow.has_predecessor(c.merge);
            if flow.innermost(n, endless).is_some() {
                return Err("a loop that ends only by `discard` in a function it calls".into());
            }
        }
    }
    Ok(())
}

fn lower_function(linker: &mut Linker, function: &mut Function, helper: Word) -> Outcome<()> {
    let flow = Flow::new(function);
    let result = function.def.as_ref().and_then(|def| def.result_type);
    let result = result.ok_or("not a SPIR-V module: a function without type")?;
    let mut arrivals: HashMap<usize, Vec<Word>> = HashMap::new();
    for n in 0..function.blocks.len() {
        if !function.blocks[n].instructions.last().is_some_and(is_kill) {
            continue;
        }
        let target = if flow.is_reached(n) { landing(&flow, n)? } else { None };
        function.blocks[n].instructions.pop();
        let flag = set_helper(linker, helper);
        function.blocks[n].instructions.push(flag);
        let last = match target {
            Some(target) => {
                let from = function.blocks[n].label_id();
                arrivals.entry(target).or_default().extend(from);
                let label = function.blocks[target].label_id().unwrap_or(0);
                vec![Instruction::new(Op::Branch, None, None, vec![id(label)])]
            }
            None => leave(linker, result),
        };
        function.blocks[n].instructions.extend(last);
    }
    for (target, from) in arrivals {
        arrive(linker, function, target, &from)?;
    }
    // A block that was unreachable may be reachable now.
    for block in &mut function.blocks {
        let unreachable = |i: &Instruction| i.class.opcode == Op::Unreachable;
        if block.instructions.last().is_some_and(unreachable) {
            block.instructions.pop();
            block.instructions.extend(leave(linker, result));
        }
    }
    repair::dominance(linker, function)
}

/// Where the lane goes on: behind the innermost loop, else behind the innermost selection; `None` if
/// the block ends the function anyway.
fn landing(flow: &Flow, block: usize) -> Outcome<Option<usize>> {
    if let Some(around) = flow.innermost(block, |c| c.proceed.is_some()) {
        let proceeds = around.proceed.is_some_and(|p| flow.dominates(p, block));
        if proceeds && around.proceed != Some(around.header) {
            return Err("`discard` in the step of a loop".into());
        }
        return Ok(Some(around.merge));
    }
    Ok(flow.innermost(block, |_| true).map(|around| around.merge))
}

/// The end of a function: its result, if it has one, is zero.
fn leave(linker: &mut Linker, result: Word) -> Vec<Instruction> {
    if linker.op(result) == Some(Op::TypeVoid) {
        return vec![Instruction::new(Op::Return, None, None, vec![])];
    }
    let zero = linker.null(result);
    vec![Instruction::new(Op::ReturnValue, None, None, vec![id(zero)])]
}

/// Gives the phis of `target` values for lanes that come from the blocks `from`.
fn arrive(
    linker: &mut Linker,
    function: &mut Function,
    target: usize,
    from: &[Word],
) -> Outcome<()> {
    for phi in &mut function.blocks[target].instructions {
        let (Op::Phi, Some(ty)) = (phi.class.opcode, phi.result_type) else { continue };
        if repair::is_unstorable(linker, ty) {
            return Err("`discard` beside a choice between pointers".into());
        }
        let zero = linker.null(ty);
        phi.operands.extend(from.iter().flat_map(|&label| [id(zero), Operand::IdRef(label)]));
    }
    Ok(())
}
