//! The user's declarations and functions, brought over into the kernel.
//!
//! Every id gets a new one. Declarations that belong to a graphics pipeline become declarations that a
//! compute kernel may have: inputs and outputs become private variables, uniform and push-constant blocks
//! become storage buffers, resources become elements of the table (see [`super::resources`]), and built-ins
//! become the kernel's own variables. Only declarations and functions that the entry point reaches are
//! imported.

use super::{
    SpliceOptions,
    builtins::{self, Source},
    hooks::Hooks,
    limits::{self, Fate},
    linker::{Linker, has_one_declaration},
    resources::{self, Element},
};
use crate::shader::{
    ResourceKind, Shader,
    interface::{self, Variable},
    module::{Index, Outcome, ids},
    resource,
    usage::Usage,
};
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{AddressingModel, BuiltIn, Decoration, Dim, MemoryModel, Op, StorageClass, Word},
};
use std::collections::{HashMap, HashSet};

/// An `in` or `out` variable of the user's that became a private one.
pub(super) struct Port {
    /// The private variable.
    pub variable: Word,
    /// Its type.
    pub ty: Word,
    /// `out`.
    pub output: bool,
    /// Its content.
    pub kind: PortKind,
}

impl Port {
    /// The leaves of a user's variable.
    pub fn leaves(&self) -> &[interface::Leaf] {
        if let PortKind::Leaves(leaves) = &self.kind { leaves } else { &[] }
    }
}

/// The content of a [`Port`].
pub(super) enum PortKind {
    /// A built-in that the glue code copies.
    BuiltIn(BuiltIn, Source),
    /// Members of a block of built-ins that are used: index, type and built-in.
    Block(Vec<(u32, Word, BuiltIn, Source)>),
    /// A user's variable: its leaves, with types of the kernel.
    Leaves(Vec<interface::Leaf>),
}

/// The result of the import.
pub(super) struct Imported {
    /// The user's functions.
    pub functions: Vec<Function>,
    /// The user's entry point among them.
    pub entry: Word,
    /// Interface variables, in the order of declaration.
    pub ports: Vec<Port>,
    /// Private variables with the values that each call begins with.
    pub initial: Vec<(Word, Word)>,
    /// Variables of the table.
    pub elements: Vec<(Word, Element)>,
    /// Image types that were input attachments.
    pub attachments: HashSet<Word>,
}

struct Importer<'a, 'm> {
    linker: &'a mut Linker,
    hooks: &'a Hooks,
    shader: &'a Shader,
    options: &'a SpliceOptions<'a>,
    index: &'a Index<'m>,
    usage: &'a Usage<'m>,
    /// New ids by old, 0 where there is none yet.
    map: Vec<Word>,
    /// Old ids that were not merged into the kernel's, so that decorations come along.
    own: Vec<bool>,
    /// Number and kind of each resource; the push-constant block has no kind.
    bound: HashMap<Word, (u32, Option<ResourceKind>)>,
    imported: Imported,
}

/// Brings the user's module over.
pub(super) fn import(
    linker: &mut Linker,
    hooks: &Hooks,
    shader: &Shader,
    options: &SpliceOptions,
    index: &Index,
    usage: &Usage,
) -> Outcome<Imported> {
    let size = index.bound() as usize;
    let imported = Imported {
        functions: Vec::new(),
        entry: 0,
        ports: Vec::new(),
        initial: Vec::new(),
        elements: Vec::new(),
        attachments: HashSet::new(),
    };
    let (map, own, bound) = (vec![0; size], vec![false; size], resource::bound(index, usage)?);
    let kind = |n: u32| bound.resources.get(n as usize).map(|r| r.kind);
    let bound = bound.variables.iter().map(|&(v, n)| (v, (n, kind(n)))).collect();
    let mut importer =
        Importer { linker, hooks, shader, options, index, usage, map, own, bound, imported };
    importer.preamble()?;
    importer.globals()?;
    importer.functions()?;
    importer.annotations()?;
    importer.names();
    importer.imported.entry = importer.id(usage.entry);
    Ok(importer.imported)
}

impl Importer<'_, '_> {
    /// The new id of an old one.
    fn id(&mut self, old: Word) -> Word {
        if self.map[old as usize] == 0 {
            self.map[old as usize] = self.linker.id();
            self.own[old as usize] = true;
        }
        self.map[old as usize]
    }

    fn renamed(&mut self, instruction: &Instruction) -> Instruction {
        let mut new = instruction.clone();
        new.result_type = instruction.result_type.map(|ty| self.id(ty));
        for operand in &mut new.operands {
            if let Some(word) = operand.id_ref_any_mut() {
                *word = self.id(*word);
            }
        }
        new
    }

    /// Capabilities, extensions, instruction sets, memory model and execution modes.
    fn preamble(&mut self) -> Outcome<()> {
        let module = self.index.module;
        for instruction in &module.capabilities {
            let Some(Operand::Capability(capability)) = instruction.operands.first() else {
                continue;
            };
            match limits::capability(*capability) {
                Fate::Keep => self.linker.capability(*capability),
                Fate::Replace(other) => self.linker.capability(other),
                Fate::Drop => {}
                Fate::Refuse => return Err(format!("the capability {capability:?}")),
            }
        }
        for instruction in &module.extensions {
            let Some(Operand::LiteralString(name)) = instruction.operands.first() else { continue };
            match limits::extension(name) {
                Some(true) => self.linker.extension(name),
                Some(false) => {}
                None => return Err(format!("the extension {name}")),
            }
        }
        for instruction in &module.ext_inst_imports {
            match (instruction.result_id, instruction.operands.first()) {
                (Some(old), Some(Operand::LiteralString(name))) if name == "GLSL.std.450" => {
                    self.map[old as usize] = self.linker.glsl_std();
                }
                _ => return Err("an instruction set other than GLSL.std.450".into()),
            }
        }
        if let Some([addressing, memory]) =
            module.memory_model.as_ref().map(|i| i.operands.as_slice())
        {
            if *memory != Operand::MemoryModel(MemoryModel::GLSL450) {
                return Err("a memory model other than GLSL450".into());
            }
            match addressing {
                Operand::AddressingModel(AddressingModel::Logical) => {}
                Operand::AddressingModel(AddressingModel::PhysicalStorageBuffer64) => {
                    if let Some(own) = &mut self.linker.module.memory_model {
                        own.operands[0] = addressing.clone();
                    }
                }
                _ => return Err("an addressing model of another API than Vulkan".into()),
            }
        }
        for instruction in &module.execution_modes {
            if let [Operand::IdRef(entry), Operand::ExecutionMode(mode), ..] =
                instruction.operands.as_slice()
                && *entry == self.usage.entry
                && !limits::execution_mode(*mode)
            {
                return Err(format!("the execution mode {mode:?}"));
            }
        }
        Ok(())
    }

    fn globals(&mut self) -> Outcome<()> {
        let mut announced = HashSet::new();
        for instruction in &self.index.module.types_global_values {
            let op = instruction.class.opcode;
            let Some(old) = instruction.result_id else {
                if ids(instruction).all(|pointer| self.usage.uses(pointer)) {
                    announced.extend(ids(instruction));
                    let new = self.renamed(instruction);
                    self.linker.declare_as(new);
                }
                continue;
            };
            if !self.usage.uses(old) {
                continue;
            }
            if op == Op::Variable {
                self.variable(instruction, old)?;
                continue;
            }
            let mut new = self.renamed(instruction);
            for operand in &mut new.operands {
                if let Operand::StorageClass(class) = operand {
                    *class = limits::storage_class(*class)?;
                }
            }
            if op == Op::TypeImage
                && new.operands.get(1) == Some(&Operand::Dim(Dim::DimSubpassData))
            {
                new.operands[1] = Operand::Dim(Dim::Dim2D);
                new.operands[5] = Operand::LiteralBit32(1);
                let ty = self.linker.declare(op, None, new.operands);
                self.map[old as usize] = ty;
                self.imported.attachments.insert(ty);
                continue;
            }
            let decorated = !self.index.annotations(old).is_empty();
            if has_one_declaration(op) && !decorated && !announced.contains(&old) {
                self.map[old as usize] = self.linker.declare(op, new.result_type, new.operands);
            } else {
                new.result_id = Some(self.id(old));
                self.linker.declare_as(new);
            }
        }
        Ok(())
    }

    fn variable(&mut self, instruction: &Instruction, old: Word) -> Outcome<()> {
        let old_pointer = self.index.type_of(old)?;
        let (class, old_ty) = self.index.pointer(old_pointer)?;
        match class {
            StorageClass::Input | StorageClass::Output => {
                self.port(instruction, old, class == StorageClass::Output, old_ty)?;
            }
            StorageClass::Private => {
                let ty = self.id(old_ty);
                self.map[old as usize] = self.linker.private(ty);
                self.own[old as usize] = true;
            }
            StorageClass::UniformConstant
            | StorageClass::Uniform
            | StorageClass::StorageBuffer
            | StorageClass::PushConstant => {
                let (number, kind) = self.bound[&old];
                let at = (number, self.shader.last_element(number), kind);
                let element = resources::element(self.index, class, old_ty, at)?;
                let element = element.map_ids(|word| self.id(word));
                let new = element.declare(self.linker);
                self.map[old as usize] = new;
                self.own[old as usize] = true;
                self.imported.elements.push((new, element));
                return Ok(());
            }
            other => return Err(format!("variables of the storage class {other:?}")),
        }
        if let Some(value) = instruction.operands.get(1).and_then(Operand::id_ref_any) {
            let (variable, value) = (self.id(old), self.id(value));
            self.imported.initial.push((variable, value));
        }
        Ok(())
    }

    /// An interface variable becomes a private one, or the kernel's variable for a built-in.
    fn port(
        &mut self,
        instruction: &Instruction,
        old: Word,
        output: bool,
        old_ty: Word,
    ) -> Outcome<()> {
        let ty = self.id(old_ty);
        let mut distances = Vec::new();
        let kind = match interface::variable(self.index, instruction, self.options.specialization)?
        {
            Variable::BuiltIn(built_in) => {
                let source = self.source(output, built_in)?;
                if let Source::Kernel(name) = source
                    && let Some((variable, kernel_ty)) = self.hooks.variable(self.linker, name)
                    && kernel_ty == ty
                {
                    self.map[old as usize] = variable;
                    return Ok(());
                }
                PortKind::BuiltIn(built_in, source)
            }
            Variable::BuiltInBlock(members) if output => {
                distances = interface::distances_of_block(
                    (self.index, self.usage),
                    (old, old_ty),
                    &members,
                    self.options.specialization,
                )?;
                let mut used = Vec::new();
                for (n, &built_in) in members.iter().enumerate() {
                    let n = n as u32;
                    let is_distance = interface::is_distance(built_in);
                    if !is_distance && self.usage.uses_member(self.index, old, n) {
                        let member = self.index.id_operand(old_ty, n as usize)?;
                        let source = self.source(output, built_in)?;
                        used.push((n, self.id(member), built_in, source));
                    }
                }
                PortKind::Block(used)
            }
            Variable::BuiltInBlock(_) => return Err("an input block of built-ins".into()),
            Variable::Leaves(leaves) | Variable::Distances(_, leaves) => {
                PortKind::Leaves(self.leaves(leaves))
            }
        };
        let variable = self.linker.private(ty);
        self.map[old as usize] = variable;
        self.own[old as usize] = true;
        // What a shader leaves unwritten may be anything in Vulkan. Here it is 0; of lone built-ins it is what the kernel has.
        if output && !matches!(kind, PortKind::BuiltIn(..)) {
            let null = self.linker.null(ty);
            self.imported.initial.push((variable, null));
        }
        self.imported.ports.push(Port { variable, ty, output, kind });
        for (_, leaves) in distances {
            let kind = PortKind::Leaves(self.leaves(leaves));
            self.imported.ports.push(Port { variable, ty, output, kind });
        }
        Ok(())
    }

    /// With the kernel's types.
    fn leaves(&mut self, mut leaves: Vec<interface::Leaf>) -> Vec<interface::Leaf> {
        for leaf in &mut leaves {
            leaf.ty = self.id(leaf.ty);
        }
        leaves
    }

    /// Where a built-in comes from, which this kernel must have.
    fn source(&self, output: bool, built_in: BuiltIn) -> Outcome<Source> {
        let source = builtins::source(self.shader.stage, output, built_in)?;
        match source.variable().map(|name| self.hooks.variable(self.linker, name)) {
            Some(None) => Err(builtins::refusal(output, built_in)),
            Some(Some(_)) | None => Ok(source),
        }
    }

    fn functions(&mut self) -> Outcome<()> {
        for function in &self.usage.functions {
            let mut new = (*function).clone();
            for instruction in new.all_inst_iter_mut() {
                let old = instruction.result_id;
                *instruction = self.renamed(instruction);
                if let Some(old) = old {
                    let result = self.id(old);
                    instruction.result_id = Some(result);
                    self.linker.set_type(result, instruction.result_type.unwrap_or(0));
                }
                for operand in &mut instruction.operands {
                    if let Operand::StorageClass(class) = operand {
                        *class = limits::storage_class(*class)?;
                    }
                }
            }
            self.imported.functions.push(new);
        }
        Ok(())
    }

    fn annotations(&mut self) -> Outcome<()> {
        let ports = self.interface_types()?;
        for instruction in &self.index.module.annotations {
            let Some(target) = instruction.operands.first().and_then(Operand::id_ref_any) else {
                continue;
            };
            if !self.usage.uses(target) && self.map[target as usize] == 0 {
                continue;
            }
            let decoration = match instruction.class.opcode {
                Op::Decorate | Op::DecorateId | Op::DecorateString => instruction.operands.get(1),
                Op::MemberDecorate | Op::MemberDecorateString => instruction.operands.get(2),
                other => return Err(format!("Op{other:?}")),
            };
            let Some(Operand::Decoration(decoration)) = decoration else { continue };
            let keep = limits::decoration(*decoration)
                .ok_or_else(|| format!("the decoration {decoration:?}"))?;
            if *decoration == Decoration::BufferBlock {
                let target = self.id(target);
                self.linker.decorate(target, Decoration::Block, &[]);
            }
            // A struct loses only its decorations for the interface; members may have a precise type.
            let of_interface = ports.contains(&target)
                && (instruction.class.opcode == Op::Decorate || *decoration == Decoration::Offset);
            let spec_id = instruction.operands.get(2).filter(|_| *decoration == Decoration::SpecId);
            if let Some(Operand::LiteralBit32(crate::abi::SPEC_FIRST..)) = spec_id {
                return Err("specialization constants with a constant_id of 65536 or more".into());
            }
            if keep && self.own[target as usize] && !of_interface {
                let new = self.renamed(instruction);
                self.linker.module.annotations.push(new);
            }
        }
        self.invariance();
        Ok(())
    }

    /// Interface variables and the structs that they are made of.
    fn interface_types(&self) -> Outcome<HashSet<Word>> {
        let mut found = HashSet::new();
        for variable in self.usage.variables(self.index) {
            let (Some(id), Some(pointer)) = (variable.result_id, variable.result_type) else {
                continue;
            };
            let (class, ty) = self.index.pointer(pointer)?;
            if !matches!(class, StorageClass::Input | StorageClass::Output) {
                continue;
            }
            found.insert(id);
            let mut open = vec![ty];
            while let Some(ty) = open.pop() {
                match self.index.op(ty)? {
                    Op::TypeArray => open.push(self.index.id_operand(ty, 0)?),
                    Op::TypeStruct if found.insert(ty) => open.extend(ids(self.index.def(ty)?)),
                    _ => {}
                }
            }
        }
        Ok(found)
    }

    /// An `invariant` output promises the same bits from the same expression in every pipeline. A
    /// compute kernel has no such decoration; forbidding contraction leaves compilers no choice.
    fn invariance(&mut self) {
        let invariant = self.index.module.annotations.iter().any(|i| {
            i.operands.contains(&Operand::Decoration(Decoration::Invariant))
                && ids(i).next().is_some_and(|target| self.usage.uses(target))
        });
        if !invariant {
            return;
        }
        let arithmetic = |i: &&Instruction| {
            matches!(
                i.class.opcode,
                Op::FAdd
                    | Op::FSub
                    | Op::FMul
                    | Op::FDiv
                    | Op::FNegate
                    | Op::Dot
                    | Op::VectorTimesScalar
                    | Op::MatrixTimesScalar
                    | Op::VectorTimesMatrix
                    | Op::MatrixTimesVector
                    | Op::MatrixTimesMatrix
            )
        };
        let results: Vec<_> = (self.imported.functions.iter().flat_map(|f| f.all_inst_iter()))
            .filter(arithmetic)
            .filter_map(|i| i.result_id)
            .collect();
        for result in results {
            self.linker.decorate(result, Decoration::NoContraction, &[]);
        }
    }

    /// Names come along marked as the user's: hosts find the kernel's constants and buffers by name.
    fn names(&mut self) {
        for instruction in &self.index.module.debug_names {
            let Some(target) = instruction.operands.first().and_then(Operand::id_ref_any) else {
                continue;
            };
            if !self.own.get(target as usize).copied().unwrap_or(false) {
                continue;
            }
            let mut new = self.renamed(instruction);
            match new.operands.as_mut_slice() {
                [_, Operand::LiteralString(name)] if !name.is_empty() => {
                    *name = format!("user {name}")
                }
                _ => {}
            }
            self.linker.module.debug_names.push(new);
        }
    }
}
