//! Functions that take an array of resources, made for the very array they are given.
//!
//! No pointer can stand for a draw's array of resources: the array is a range of the engine's longer table. So a
//! call that passes such an array goes to a copy of the function in which the parameter is the variable itself.
//! A copy may pass the array on in calls of its own, so this is repeated until no call passes one.

use super::linker::{Linker, id};
use crate::shader::module::{Outcome, ids};
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{Op, Word},
};
use std::collections::{HashMap, HashSet};

/// More copies than any program has; calls that go round in circles would need ever more.
const MAX_COPIES: usize = 1000;

/// Makes the copies. `arrays` are the table's variables that are arrays of resources.
pub(super) fn specialize(
    linker: &mut Linker,
    functions: &mut Vec<Function>,
    arrays: &HashSet<Word>,
) -> Outcome<()> {
    // The copy by the original and, for each argument, the array that it is.
    let mut copies: HashMap<(Word, Vec<Option<Word>>), Word> = HashMap::new();
    let mut next = 0;
    while next < functions.len() {
        let mut body = std::mem::take(&mut functions[next].blocks);
        for call in body.iter_mut().flat_map(|b| &mut b.instructions) {
            if call.class.opcode != Op::FunctionCall {
                continue;
            }
            let given: Vec<Option<Word>> =
                ids(call).skip(1).map(|argument| arrays.get(&argument).copied()).collect();
            let (true, Some(&Operand::IdRef(callee))) =
                (given.iter().any(Option::is_some), call.operands.first())
            else {
                continue;
            };
            let copy = match copies.get(&(callee, given.clone())) {
                Some(&copy) => copy,
                None => {
                    if copies.len() >= MAX_COPIES {
                        return Err("arrays of resources passed through too many functions".into());
                    }
                    let original = functions.iter().find(|f| f.def_id() == Some(callee));
                    let original = original.ok_or("a function that calls itself")?;
                    let copy = duplicate(linker, original, &given)?;
                    let result = copy.def_id().unwrap_or(0);
                    functions.push(copy);
                    copies.insert((callee, given.clone()), result);
                    result
                }
            };
            let mut kept = given.iter().map(Option::is_none);
            call.operands[0] = id(copy);
            let (function, arguments) = call.operands.split_at(1);
            let arguments = arguments.iter().filter(|_| kept.next().unwrap_or(true));
            call.operands = function.iter().chain(arguments).cloned().collect();
        }
        functions[next].blocks = body;
        next += 1;
    }
    // The originals point to arrays that the table does not have.
    let originals: HashSet<Word> = copies.keys().map(|(original, _)| *original).collect();
    functions.retain(|f| f.def_id().is_none_or(|id| !originals.contains(&id)));
    Ok(())
}

/// A copy of `original` with ids of its own, in which the parameters that `given` names are these
/// variables.
fn duplicate(
    linker: &mut Linker,
    original: &Function,
    given: &[Option<Word>],
) -> Outcome<Function> {
    if original.blocks.is_empty() {
        return Err("a function that calls itself".into());
    }
    let mut copy = original.clone();
    let (mut variables, mut results) = (HashMap::new(), HashMap::new());
    let parameters = std::mem::take(&mut copy.parameters);
    for (parameter, given) in parameters.into_iter().zip(given) {
        match (given, parameter.result_id) {
            (Some(variable), Some(own)) => _ = variables.insert(own, *variable),
            _ => copy.parameters.push(parameter),
        }
    }
    for instruction in copy.all_inst_iter() {
        if let Some(old) = instruction.result_id {
            let new = linker.id();
            linker.set_type(new, instruction.result_type.unwrap_or(0));
            results.insert(old, new);
        }
    }
    for instruction in copy.all_inst_iter_mut() {
        if let Some(result) = &mut instruction.result_id {
            *result = results[result];
        }
        for operand in &mut instruction.operands {
            if let Some(word) = operand.id_ref_any_mut() {
                let new = variables.get(word).or(results.get(word));
                *word = new.copied().unwrap_or(*word);
            }
        }
    }
    let signature: Vec<Operand> = (copy.def.iter().filter_map(|def| def.result_type))
        .chain(copy.parameters.iter().filter_map(|p| p.result_type))
        .map(id)
        .collect();
    let signature = linker.declare(Op::TypeFunction, None, signature);
    if let Some(def) = &mut copy.def {
        def.operands[1] = id(signature);
    }
    duplicate_annotations(linker, &results);
    Ok(copy)
}

/// Decorations of the original's values hold for the copy's.
fn duplicate_annotations(linker: &mut Linker, results: &HashMap<Word, Word>) {
    let more: Vec<Instruction> = (linker.module.annotations.iter())
        .filter_map(|i| {
            let target = i.operands.first().and_then(Operand::id_ref_any)?;
            let mut new = i.clone();
            new.operands[0] = id(*results.get(&target)?);
            Some(new)
        })
        .collect();
    linker.module.annotations.extend(more);
}
