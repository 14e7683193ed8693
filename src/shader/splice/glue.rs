//! Writes the bodies of the stubs. `tw_user_bind` does the work that a draw needs once; `tw_user_bind_instance`
//! and `tw_user_bind_inputs` do the work that an instance and a triangle need once. `tw_user_main` calls the
//! user's entry point, with the work before and after it.
//!
//! The bind stubs fetch the table indices of the draw's resources, the prefetched words of uniform blocks, and
//! the vertex attributes or the triangle's varyings that the shader reads. `tw_user_main` first sets the user's
//! variables to their initial values (a kernel may call the stub many times), then the built-ins, then the
//! inputs, location by location through the kernel's hooks. Then it calls the user's code and hands on the
//! outputs, as bits. Compilers drop the inputs that the user's code does not read.

use super::{
    builtins::Source,
    hooks::Hooks,
    import::{Imported, Port, PortKind},
    linker::{Code, Linker, id, literal},
    resources::Span,
};
use crate::abi;
use crate::shader::{
    Auxiliary, Interpolation, Scalar, Stage, Varying, interface::Leaf, module::Outcome,
};
use rspirv::{
    dr::{Block, Instruction, Operand},
    spirv::{BuiltIn, Decoration, Op, StorageClass, Word},
};
use std::collections::{BTreeSet, HashMap, HashSet};

/// Replaces the stubs' bodies. `spans` are the private variables for `tw_resource(i)`, in the order of the
/// table's variables; `prefetched` fills the private variables that stand for uniforms.
pub(super) fn write(
    linker: &mut Linker,
    hooks: &Hooks,
    stage: Stage,
    imported: &Imported,
    spans: &[Span],
    prefetched: Vec<Instruction>,
) -> Outcome<()> {
    let mut glue = Glue { code: Code::new(linker), hooks, stage };
    glue.resources(imported, spans)?;
    glue.code.instructions.extend(prefetched);
    if stage == Stage::Vertex {
        glue.bind_each(imported, "tw_bind_attribute(u1;", 1, abi::MAX_ATTRIBUTES)?;
    }
    glue.code.effect(Op::Return, vec![]);
    let body = glue.code.instructions;
    replace_stub(linker, hooks.function("tw_user_bind(")?, body)?;

    let mut glue = Glue { code: Code::new(linker), hooks, stage };
    let stub = match stage {
        Stage::Vertex => {
            let hook = "tw_bind_instance_attribute(u1;";
            glue.bind_each(imported, hook, 1, abi::MAX_ATTRIBUTES)?;
            "tw_user_bind_instance("
        }
        Stage::Fragment => {
            glue.bind_each(imported, "tw_bind_inputs(u1;", 2, abi::MAX_VARYINGS)?;
            "tw_user_bind_inputs("
        }
    };
    glue.code.effect(Op::Return, vec![]);
    let body = glue.code.instructions;
    replace_stub(linker, hooks.function(stub)?, body)?;

    let mut glue = Glue { code: Code::new(linker), hooks, stage };
    for &(variable, value) in &imported.initial {
        glue.code.store(variable, value);
    }
    for port in imported.ports.iter().filter(|p| !p.output) {
        glue.input(port)?;
    }
    let void = glue.code.linker.void();
    glue.code.call(void, imported.entry, &[]);
    let outputs = || imported.ports.iter().filter(|p| p.output);
    let mut at_location: HashMap<u32, u32> = HashMap::new();
    for leaf in outputs().flat_map(Port::leaves) {
        *at_location.entry(place_of(leaf.varying)).or_default() += 1;
    }
    for port in outputs() {
        glue.output(port, &at_location)?;
    }
    glue.code.effect(Op::Return, vec![]);
    let body = glue.code.instructions;
    replace_stub(linker, hooks.function("tw_user_main(")?, body)
}

struct Glue<'a> {
    code: Code<'a>,
    hooks: &'a Hooks,
    stage: Stage,
}

impl Glue<'_> {
    fn resources(&mut self, imported: &Imported, spans: &[Span]) -> Outcome<()> {
        for ((_, element), span) in imported.elements.iter().zip(spans) {
            let last = element.last.zip(span.last);
            for (number, variable) in [(element.number, span.first)].into_iter().chain(last) {
                let hook = self.hooks.function("tw_resource(u1;")?;
                let number = self.code.linker.uint_constant(number);
                let uint = self.code.linker.uint();
                let value = self.code.call(uint, hook, &[number]);
                self.code.store(variable, value);
            }
        }
        Ok(())
    }

    /// Calls `hook` for the input locations below `limit`, with the first of each `group` of locations that
    /// has one.
    fn bind_each(
        &mut self,
        imported: &Imported,
        hook: &str,
        group: u32,
        limit: u32,
    ) -> Outcome<()> {
        let inputs = imported.ports.iter().filter(|p| !p.output);
        let locations: BTreeSet<u32> =
            inputs.flat_map(Port::leaves).map(|leaf| leaf.varying.location).collect();
        let of_user = locations.iter().rfind(|&&location| location < abi::DISTANCE_LOCATION);
        if let Some(beyond) = of_user.filter(|&&location| location >= limit) {
            return Err(format!("it reads location {beyond} of {limit}"));
        }
        let groups: BTreeSet<u32> = locations.iter().map(|location| location / group).collect();
        for location in groups.into_iter().map(|number| number * group) {
            let hook = self.hooks.function(hook)?;
            let location = self.code.linker.uint_constant(location);
            let void = self.code.linker.void();
            self.code.call(void, hook, &[location]);
        }
        Ok(())
    }

    fn input(&mut self, port: &Port) -> Outcome<()> {
        match &port.kind {
            PortKind::Leaves(leaves) => {
                leaves.iter().try_for_each(|leaf| self.input_leaf(port.variable, leaf))
            }
            PortKind::BuiltIn(built_in, source) => {
                let value = self.built_in_value(port.ty, *built_in, *source)?;
                self.code.store(port.variable, value);
                Ok(())
            }
            PortKind::Block(_) => Err("an input block of built-ins".into()),
        }
    }

    fn built_in_value(&mut self, ty: Word, built_in: BuiltIn, source: Source) -> Outcome<Word> {
        match source {
            Source::Kernel(name) | Source::KernelAtStart(name) => {
                let (variable, kernel_ty) = self.kernel_variable(name)?;
                let value = self.code.load(kernel_ty, variable);
                self.as_type(ty, value, built_in)
            }
            Source::Constant(0) => Ok(self.code.linker.null(ty)),
            Source::Constant(bits) => {
                let (scalar, count) = self.code.linker.components(ty);
                let one = self.code.linker.declare(Op::Constant, Some(scalar), vec![literal(bits)]);
                let all = vec![id(one); count as usize];
                Ok(self.code.linker.declare(Op::ConstantComposite, Some(ty), all))
            }
            Source::Coverage(name) => {
                let (variable, kernel_ty) = self.kernel_variable(name)?;
                let element = self.element(ty)?;
                let mask = self.code.load(kernel_ty, variable);
                let mask = self.code.bitcast(element, mask)?;
                Ok(self.code.emit(Op::CompositeConstruct, ty, vec![id(mask)]))
            }
            Source::Compute => {
                let (variable, kernel_ty) = self.compute_built_in(ty, built_in);
                let value = self.code.load(kernel_ty, variable);
                self.as_type(ty, value, built_in)
            }
            Source::Keep(_) => Err(format!("it reads {built_in:?}")),
        }
    }

    /// The element type of `gl_SampleMaskIn`, of which up to 32 samples of a pixel need one element.
    fn element(&self, ty: Word) -> Outcome<Word> {
        match self.code.linker.global(ty)?.operands.as_slice() {
            [Operand::IdRef(element), Operand::IdRef(length)]
                if self.code.linker.global(*length)?.operands == [literal(1)] =>
            {
                Ok(*element)
            }
            _ => Err("a sample mask of more than 32 samples".into()),
        }
    }

    fn kernel_variable(&self, name: &str) -> Outcome<(Word, Word)> {
        let found = self.hooks.variable(self.code.linker, name);
        found.ok_or_else(|| format!("the kernel has no variable {name}"))
    }

    /// Languages differ in the sign of integers.
    fn as_type(&mut self, ty: Word, value: Word, built_in: BuiltIn) -> Outcome<Word> {
        let linker = &self.code.linker;
        let from = linker.type_of(value)?;
        let (a, b) = (linker.components(from), linker.components(ty));
        let integers = linker.op(a.0) == Some(Op::TypeInt) && linker.op(b.0) == Some(Op::TypeInt);
        if from != ty && !(integers && a.1 == b.1) {
            return Err(format!("the built-in {built_in:?} with an unusual type"));
        }
        self.code.bitcast(ty, value)
    }

    /// A built-in that compute shaders have too: the kernel's own variable of it, or a new one.
    fn compute_built_in(&mut self, ty: Word, built_in: BuiltIn) -> (Word, Word) {
        let linker = &mut self.code.linker;
        let wanted = [Operand::Decoration(Decoration::BuiltIn), Operand::BuiltIn(built_in)];
        let annotations = linker.module.annotations.iter();
        let found = annotations
            .filter(|i| i.class.opcode == Op::Decorate && i.operands[1..] == wanted)
            .filter_map(|i| i.operands[0].id_ref_any())
            .find_map(|v| linker.pointee(linker.type_of(v).ok()?).map(|(_, ty)| (v, ty)));
        if let Some(found) = found {
            return found;
        }
        let pointer = linker.pointer(StorageClass::Input, ty);
        let class = vec![Operand::StorageClass(StorageClass::Input)];
        let variable = linker.declare_new(Op::Variable, Some(pointer), class);
        let operands = [id(variable)].into_iter().chain(wanted).collect();
        linker.module.annotations.push(Instruction::new(Op::Decorate, None, None, operands));
        (variable, ty)
    }

    fn input_leaf(&mut self, variable: Word, leaf: &Leaf) -> Outcome<()> {
        let v = leaf.varying;
        let is_centroid = v.auxiliary == Some(Auxiliary::Centroid);
        let hook = match (self.stage, v.scalar, v.interpolation) {
            (Stage::Vertex, Scalar::Float, _) => "tw_attribute_float(u1;",
            (Stage::Vertex, ..) => "tw_attribute_uint(u1;",
            (Stage::Fragment, _, Interpolation::Flat) => "tw_input_flat(u1;",
            (Stage::Fragment, _, Interpolation::NoPerspective) if is_centroid => {
                "tw_input_noperspective_centroid(u1;"
            }
            (Stage::Fragment, _, Interpolation::NoPerspective) => "tw_input_noperspective(u1;",
            (Stage::Fragment, ..) if is_centroid => "tw_input_smooth_centroid(u1;",
            (Stage::Fragment, ..) => "tw_input_smooth(u1;",
        };
        let hook = self.hooks.function(hook)?;
        let code = &mut self.code;
        let float = v.scalar == Scalar::Float
            && (self.stage == Stage::Vertex || v.interpolation != Interpolation::Flat);
        let scalar = if float { code.linker.float() } else { code.linker.uint() };
        let all = code.linker.vector(scalar, 4);
        let location = code.linker.uint_constant(v.location);
        let value = code.call(all, hook, &[location]);
        let value = code.swizzle(scalar, value, v.component, v.count);
        let value = code.bitcast(leaf.ty, value)?;
        let place = code.part(variable, StorageClass::Private, leaf.ty, &leaf.path);
        code.store(place, value);
        Ok(())
    }

    /// `at_location` counts the outputs that share a location.
    fn output(&mut self, port: &Port, at_location: &HashMap<u32, u32>) -> Outcome<()> {
        match &port.kind {
            PortKind::Leaves(leaves) => leaves.iter().try_for_each(|leaf| {
                let alone = at_location.get(&place_of(leaf.varying)) == Some(&1);
                self.output_leaf(port.variable, leaf, alone)
            }),
            PortKind::BuiltIn(built_in, source) => {
                self.built_in_output(port.variable, port.ty, *built_in, *source)
            }
            PortKind::Block(members) => {
                members.iter().try_for_each(|&(n, ty, built_in, source)| {
                    let member = self.code.part(port.variable, StorageClass::Private, ty, &[n]);
                    self.built_in_output(member, ty, built_in, source)
                })
            }
        }
    }

    fn built_in_output(
        &mut self,
        pointer: Word,
        ty: Word,
        built_in: BuiltIn,
        source: Source,
    ) -> Outcome<()> {
        match source {
            Source::Kernel(name) => {
                let (variable, kernel_ty) = self.kernel_variable(name)?;
                let value = self.code.load(ty, pointer);
                let value = self.as_type(kernel_ty, value, built_in)?;
                self.code.store(variable, value);
                Ok(())
            }
            Source::Keep(name) => self.keep_samples(pointer, ty, name),
            _ => Err(format!("it writes {built_in:?}")),
        }
    }

    /// The kernel drops the samples that the mask leaves out.
    fn keep_samples(&mut self, pointer: Word, ty: Word, name: &str) -> Outcome<()> {
        let element = self.element(ty)?;
        let (variable, kernel_ty) = self.kernel_variable(name)?;
        let code = &mut self.code;
        let place = code.part(pointer, StorageClass::Private, element, &[0]);
        let mask = code.load(element, place);
        let mask = code.bitcast(kernel_ty, mask)?;
        code.store(variable, mask);
        Ok(())
    }

    /// A varying that is `alone` at its location is handed on with all four components: one store.
    fn output_leaf(&mut self, variable: Word, leaf: &Leaf, alone: bool) -> Outcome<()> {
        let hook = self.hooks.function("tw_output(u1;u1;u1;vu4;")?;
        let v = leaf.varying;
        let whole = alone && v.component == 0 && self.stage == Stage::Vertex;
        let code = &mut self.code;
        let place = code.part(variable, StorageClass::Private, leaf.ty, &leaf.path);
        let value = code.load(leaf.ty, place);
        let uint = code.linker.uint();
        let (some, all) = (code.linker.vector(uint, v.count), code.linker.vector(uint, 4));
        let mut bits = code.bitcast(some, value)?;
        if v.count < 4 {
            let zero = code.linker.uint_constant(0);
            let mut parts = vec![id(bits)];
            parts.resize(1 + 4 - v.count as usize, id(zero));
            bits = code.emit(Op::CompositeConstruct, all, parts);
        }
        let void = code.linker.void();
        let count = if whole { 4 } else { v.count };
        let [location, component, count] =
            [place_of(v), v.component, count].map(|n| code.linker.uint_constant(n));
        code.call(void, hook, &[location, component, count, bits]);
        Ok(())
    }
}

/// What the kernel calls the location of an output: a second source comes after all colour targets.
fn place_of(output: Varying) -> u32 {
    if output.index == 0 { output.location } else { abi::SECOND_SOURCE }
}

/// Gives the stub a new body and drops names and decorations of the old one.
fn replace_stub(linker: &mut Linker, stub: Word, body: Vec<Instruction>) -> Outcome<()> {
    let label = Instruction::new(Op::Label, None, Some(linker.id()), vec![]);
    let functions = &mut linker.module.functions;
    let stub = functions.iter_mut().find(|f| f.def_id() == Some(stub));
    let stub = stub.ok_or("the kernel's stub is no function")?;
    let gone: HashSet<Word> = (stub.blocks.iter())
        .flat_map(|b| b.label.iter().chain(&b.instructions))
        .filter_map(|i| i.result_id)
        .collect();
    stub.blocks = vec![Block { label: Some(label), instructions: body }];
    let stays = |i: &Instruction| {
        i.operands.first().and_then(Operand::id_ref_any).is_none_or(|id| !gone.contains(&id))
    };
    linker.module.debug_names.retain(stays);
    linker.module.annotations.retain(stays);
    Ok(())
}
