//! How a shader samples its images: which of them and which samplers it compares with, and which samplers it uses in a way
//! that needs normalized coordinates.

use super::{module::ids, usage::Usage};
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{ImageOperands, Op, Word},
};
use std::collections::HashMap;

/// How a variable is sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sampling {
    /// With a comparison.
    pub compares: bool,
    /// With implicit level of detail, a comparison, projection or an offset. Vulkan allows none of these with coordinates
    /// that are not normalized.
    pub needs_normalized: bool,
}

/// How the variables are sampled, by id. Those that are not sampled are missing.
pub(super) fn sampling(usage: &Usage) -> HashMap<Word, Sampling> {
    let origins = Origins::new(usage);
    let mut found: HashMap<Word, Sampling> = HashMap::new();
    for instruction in usage.instructions() {
        let Some(of_one) = of(instruction) else { continue };
        let mut variables = Vec::new();
        origins.follow(ids(instruction).next().unwrap_or(0), &mut variables, DEPTH);
        for variable in variables {
            let known = found.entry(variable).or_default();
            known.compares |= of_one.compares;
            known.needs_normalized |= of_one.needs_normalized;
        }
    }
    found
}

/// Steps from a value back to its variable: calls within calls and arrays within arrays are no deeper in any shader that
/// drivers compile.
const DEPTH: u32 = 64;

/// How an instruction samples, if it does.
fn of(instruction: &Instruction) -> Option<Sampling> {
    let (implicit, compares, projects) = match instruction.class.opcode {
        Op::ImageSampleImplicitLod => (true, false, false),
        Op::ImageSampleExplicitLod => (false, false, false),
        Op::ImageSampleDrefImplicitLod => (true, true, false),
        Op::ImageSampleDrefExplicitLod => (false, true, false),
        Op::ImageSampleProjImplicitLod => (true, false, true),
        Op::ImageSampleProjExplicitLod => (false, false, true),
        Op::ImageSampleProjDrefImplicitLod => (true, true, true),
        Op::ImageSampleProjDrefExplicitLod => (false, true, true),
        Op::ImageGather => (true, false, false),
        Op::ImageDrefGather => (true, true, false),
        Op::ImageQueryLod => (true, false, false),
        _ => return None,
    };
    let offset = ImageOperands::CONST_OFFSET | ImageOperands::OFFSET | ImageOperands::CONST_OFFSETS;
    let offsets = instruction
        .operands
        .iter()
        .any(|operand| matches!(operand, Operand::ImageOperands(mask) if mask.intersects(offset)));
    Some(Sampling { compares, needs_normalized: implicit || compares || projects || offsets })
}

/// Where values come from.
struct Origins<'m> {
    /// Instructions by result.
    defined: HashMap<Word, &'m Instruction>,
    /// The function and the number of each parameter.
    parameters: HashMap<Word, (Word, usize)>,
    /// The calls of each function.
    calls: HashMap<Word, Vec<&'m Instruction>>,
}

impl<'m> Origins<'m> {
    fn new(usage: &Usage<'m>) -> Self {
        let defined = usage.instructions().filter_map(|i| Some((i.result_id?, i))).collect();
        let mut calls: HashMap<Word, Vec<_>> = HashMap::new();
        for call in usage.instructions().filter(|i| i.class.opcode == Op::FunctionCall) {
            calls.entry(ids(call).next().unwrap_or(0)).or_default().push(call);
        }
        let of_function = |function: &&'m Function| {
            let id = function.def_id().unwrap_or(0);
            let numbered = function.parameters.iter().enumerate();
            numbered.filter_map(move |(n, i)| Some((i.result_id?, (id, n)))).collect::<Vec<_>>()
        };
        let parameters = usage.functions.iter().flat_map(of_function).collect();
        Self { defined, parameters, calls }
    }

    /// Adds the variables of the module that `value` comes from.
    fn follow(&self, value: Word, variables: &mut Vec<Word>, depth: u32) {
        let Some(depth) = depth.checked_sub(1) else { return };
        if let Some((function, number)) = self.parameters.get(&value) {
            for call in self.calls.get(function).into_iter().flatten() {
                let given = ids(call).nth(1 + number);
                given.into_iter().for_each(|given| self.follow(given, variables, depth));
            }
            return;
        }
        let Some(instruction) = self.defined.get(&value) else {
            variables.push(value);
            return;
        };
        let through = match instruction.class.opcode {
            Op::SampledImage => 2,
            Op::Load | Op::AccessChain | Op::InBoundsAccessChain | Op::CopyObject | Op::Image => 1,
            _ => 0,
        };
        ids(instruction).take(through).for_each(|from| self.follow(from, variables, depth));
    }
}
