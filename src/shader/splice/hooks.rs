//! The kernel's side of the seam: functions and variables whose names begin with `tw_`.
//!
//! A kernel is ordinary GLSL. It calls the functions whose names begin with `tw_user_`: stubs whose bodies the
//! splicer replaces. It also defines the hooks that the new bodies need. glslang names functions with their
//! parameter types (`tw_ddx(vf2;`), takes `const in` parameters by value, and drops functions that nothing
//! calls; so a kernel's stubs call every hook once.
//!
//! | hook | stage | meaning |
//! |---|---|---|
//! | `void tw_user_bind()` | both | the stub that the kernel calls when another draw begins |
//! | `void tw_user_bind_inputs()` | fragment | the stub that the kernel calls when another triangle begins |
//! | `void tw_user_bind_instance()` | vertex | the stub that the kernel calls when another instance begins |
//! | `void tw_user_main()` | both | the stub that runs the shader |
//! | `uint tw_resource(const in uint i)` | both | number `i` of the draw's list: the table indices of the shader's resources, that of its push-constant block, the last elements of its arrays |
//! | `uvec4 tw_block_words(const in uint slot, const in uint word, const in uint last)` | both | four words, none after `last`, of the buffer in a slot of the table |
//! | `void tw_output(const in uint location, const in uint component, const in uint count, const in uvec4 value)` | both | takes an output's bits |
//! | `void tw_bind_attribute(const in uint location)` | vertex | prepares an attribute that will be read |
//! | `void tw_bind_instance_attribute(const in uint location)` | vertex | the same, for another instance |
//! | `vec4 tw_attribute_float(const in uint location)` | vertex | an attribute as floats |
//! | `uvec4 tw_attribute_uint(const in uint location)` | vertex | an integer attribute's bits |
//! | `void tw_bind_inputs(const in uint location)` | fragment | fetches the inputs at `location`, which is even, and at the location after it; one or both will be read |
//! | `vec4 tw_input_smooth(const in uint location)` | fragment | interpolated with perspective |
//! | `vec4 tw_input_noperspective(const in uint location)` | fragment | interpolated on the screen |
//! | `vec4 tw_input_smooth_centroid(const in uint location)`, `vec4 tw_input_noperspective_centroid(const in uint location)` | fragment | the same at a place that the triangle covers |
//! | `uvec4 tw_input_flat(const in uint location)` | fragment | the provoking vertex's bits |
//! | `T tw_ddx(const in T)`, `T tw_ddy(const in T)` | fragment | differences within the quad, for `float` to `vec4` |
//! | `bool tw_HelperInvocation` | fragment | set by the kernel before the call, and by `discard` |
//! | `uint tw_SampleMaskIn`, `uint tw_SampleMask` | fragment | a bit for each sample: those that the triangle covers, set by the kernel; those that the shader keeps |
//! | `tw_Position` and other built-ins | both | see [`super::builtins`] |

use super::linker::Linker;
use crate::shader::module::Outcome;
use rspirv::{
    dr::{Instruction, Module, Operand},
    spirv::{Op, Word},
};
use std::collections::{BTreeMap, HashMap};

/// The kernel's hooks by name.
pub(super) struct Hooks {
    functions: HashMap<String, Word>,
    variables: HashMap<String, Word>,
    /// The kernel's entry point.
    pub entry: Word,
}

impl Hooks {
    /// Finds the hooks of a kernel.
    pub fn new(kernel: &Module) -> Outcome<Self> {
        let (mut functions, mut variables) = (HashMap::new(), HashMap::new());
        for name in kernel.debug_names.iter().filter(|i| i.class.opcode == Op::Name) {
            if let [Operand::IdRef(target), Operand::LiteralString(text)] = name.operands.as_slice()
                && text.starts_with("tw_")
            {
                let list = if text.contains('(') { &mut functions } else { &mut variables };
                list.insert(text.clone(), *target);
            }
        }
        let entry = match kernel.entry_points.as_slice() {
            [only] => only.operands.get(1).and_then(Operand::id_ref_any),
            _ => None,
        };
        let entry = entry.ok_or("the kernel has not exactly one entry point")?;
        Ok(Self { functions, variables, entry })
    }

    /// The hooks with their types, as text. Equal texts are equal types.
    pub fn types(&self, kernel: &Module) -> BTreeMap<String, String> {
        let globals: HashMap<Word, &Instruction> =
            kernel.types_global_values.iter().filter_map(|i| Some((i.result_id?, i))).collect();
        let functions: HashMap<Word, Word> = (kernel.functions.iter())
            .filter_map(|f| {
                let def = f.def.as_ref()?;
                let ty = def.operands.get(1).and_then(Operand::id_ref_any)?;
                Some((def.result_id?, ty))
            })
            .collect();
        let variable = |id: &Word| {
            globals.get(id).filter(|i| i.class.opcode == Op::Variable).and_then(|i| i.result_type)
        };
        let all = self.functions.iter().map(|(name, id)| (name, functions.get(id).copied()));
        let variables = self.variables.iter().map(|(name, id)| (name, variable(id)));
        all.chain(variables)
            .filter_map(|(name, ty)| Some((name.clone(), type_text(&globals, ty?, 0))))
            .collect()
    }

    /// A function by its name and glslang's codes of its parameters.
    pub fn function(&self, name: &str) -> Outcome<Word> {
        let found = self.functions.get(name).copied();
        found.ok_or_else(|| format!("the kernel has no function {name}"))
    }

    /// A variable and the type of its value.
    pub fn variable(&self, linker: &Linker, name: &str) -> Option<(Word, Word)> {
        let &variable = self.variables.get(name)?;
        let (_, ty) = linker.pointee(linker.type_of(variable).ok()?)?;
        Some((variable, ty))
    }

    /// `tw_HelperInvocation`.
    pub fn helper(&self, linker: &Linker) -> Outcome<Word> {
        let found = self.variable(linker, "tw_HelperInvocation");
        Ok(found.ok_or("the kernel has no variable tw_HelperInvocation")?.0)
    }
}

/// A declaration with those that it is made of. No hook has a type that is nested deeper.
fn type_text(globals: &HashMap<Word, &Instruction>, id: Word, depth: usize) -> String {
    let Some(declared) = globals.get(&id).filter(|_| depth < 8) else { return String::new() };
    let operand = |operand: &Operand| match operand.id_ref_any() {
        Some(id) => type_text(globals, id, depth + 1),
        None => format!("{operand:?}"),
    };
    let operands: Vec<String> = declared.operands.iter().map(operand).collect();
    format!("{:?}({})", declared.class.opcode, operands.join(", "))
}
