//! How a shader samples its images: which of them and which samplers it compares with, and which samplers it uses in a way
//! that needs normalized coordinates.

use super::{
    module::{Index, ids},
    usage::Usage,
};
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{ImageOperands, Op, Word},
};
use std::collections::{HashMap, HashSet};

/// How a variable is sampled.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Sampling {
    /// With a comparison.
    pub compares: bool,
    /// With implicit level of detail, a comparison, projection or an offset. Vulkan allows none of these with coordinates
    /// that are not normalized.
    pub needs_normalized: bool,
    /// For integers, which no sampler filters.
    pub integers: bool,
}

/// How the variables are sampled, by id. Those that are not sampled are missing.
pub(super) fn sampling(index: &Index, usage: &Usage) -> HashMap<Word, Sampling> {
    let origins = Origins::new(usage);
    let mut found: HashMap<Word, Sampling> = HashMap::new();
    for instruction in usage.instructions() {
        let Some(of_one) = of(instruction) else { continue };
        for variable in origins.of(ids(instruction).next().unwrap_or(0)) {
            let known = found.entry(variable).or_default();
            known.compares |= of_one.compares;
            known.needs_normalized |= of_one.needs_normalized;
            known.integers |= returns_integers(index, instruction);
        }
    }
    found
}

/// Whether what an instruction reads is a vector of integers.
fn returns_integers(index: &Index, instruction: &Instruction) -> bool {
    let component = |ty| index.id_operand(ty, 0).and_then(|component| index.op(component));
    let component = instruction.result_type.map(component);
    matches!(component, Some(Ok(Op::TypeInt)))
}

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
    let needs_normalized = implicit || compares || projects || offsets;
    Some(Sampling { compares, needs_normalized, integers: false })
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

    /// The variables of the module that `value` comes from. Each value on the way is looked at once, however many calls lead
    /// there.
    fn of(&self, value: Word) -> Vec<Word> {
        let (mut variables, mut open, mut seen) = (Vec::new(), vec![value], HashSet::new());
        while let Some(value) = open.pop() {
            if !seen.insert(value) {
                continue;
            }
            if let Some((function, number)) = self.parameters.get(&value) {
                let calls = self.calls.get(function).into_iter().flatten();
                open.extend(calls.filter_map(|call| ids(call).nth(1 + number)));
                continue;
            }
            let Some(instruction) = self.defined.get(&value) else {
                variables.push(value);
                continue;
            };
            let through = match instruction.class.opcode {
                Op::SampledImage => 2,
                Op::Load
                | Op::AccessChain
                | Op::InBoundsAccessChain
                | Op::CopyObject
                | Op::Image => 1,
                _ => 0,
            };
            open.extend(ids(instruction).take(through));
        }
        variables
    }
}

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests {
    use crate::shader::{Shader, Stage};

    /// A comparison is found through any number of functions, and calls that double at each of them take no longer.
    #[test]
    fn a_sampler_is_followed_through_functions() {
        let first = "float f0(sampler2DShadow s) { return texture(s, vec3(0.5)); }".to_string();
        let next = |n: u32| {
            format!("float f{n}(sampler2DShadow s) {{ return f{0}(s) + f{0}(s); }}", n - 1)
        };
        let functions: Vec<String> = std::iter::once(first).chain((1..=70).map(next)).collect();
        let source = format!(
            "#version 450
            layout(binding = 0) uniform sampler2DShadow compared;
            layout(binding = 1) uniform sampler2D plain;
            layout(location = 0) out vec4 color;
            {}
            void main() {{ color = vec4(f70(compared)) + textureLod(plain, vec2(0.5), 0); }}",
            functions.join("\n")
        );
        let shader = Shader::from_glsl(Stage::Fragment, "deep", &source).unwrap();
        let found = shader.reflection.resources.iter().map(|r| (r.compares, r.needs_normalized));
        assert_eq!(found.collect::<Vec<_>>(), [(true, true), (false, false)]);
    }
}
