//! The module under construction: a kernel to which types, constants, variables and functions are
//! added.
//!
//! SPIR-V allows each plain type to be declared once, so declarations go through [`Linker::declare`],
//! which returns an existing declaration if there is one. Structs, decorated arrays, variables and
//! specialization constants have an identity of their own and are never merged.

use crate::shader::module::Outcome;
use rspirv::{
    dr::{Instruction, Module, Operand},
    spirv::{Capability, Decoration, Op, StorageClass, Word},
};
use std::collections::{HashMap, HashSet};

/// An operand that is an id.
pub(super) fn id(word: Word) -> Operand {
    Operand::IdRef(word)
}

/// An operand that is a number.
pub(super) fn literal(value: u32) -> Operand {
    Operand::LiteralBit32(value)
}

/// The kernel with everything that is added to it.
pub(super) struct Linker {
    /// The module so far.
    pub module: Module,
    next: Word,
    declared: HashMap<(Op, Option<Word>, Vec<Operand>), Word>,
    /// Position in `module.types_global_values` by id.
    globals: HashMap<Word, usize>,
    /// Result type by id, 0 where there is none.
    types: Vec<Word>,
}

impl Linker {
    /// Starts from a kernel.
    pub fn new(kernel: Module) -> Self {
        let largest = kernel.all_inst_iter().filter_map(|i| i.result_id).max().unwrap_or(0);
        let mut linker = Self {
            module: kernel,
            next: largest + 1,
            declared: HashMap::new(),
            globals: HashMap::new(),
            types: vec![0; largest as usize + 1],
        };
        for instruction in linker.module.all_inst_iter() {
            if let (Some(result), Some(ty)) = (instruction.result_id, instruction.result_type) {
                linker.types[result as usize] = ty;
            }
        }
        let decorated: HashSet<Word> = (linker.module.annotations.iter())
            .filter_map(|i| i.operands.first().and_then(Operand::id_ref_any))
            .collect();
        for (position, i) in linker.module.types_global_values.iter().enumerate() {
            let Some(result) = i.result_id else { continue };
            linker.globals.insert(result, position);
            if has_one_declaration(i.class.opcode) && !decorated.contains(&result) {
                let key = (i.class.opcode, i.result_type, i.operands.clone());
                linker.declared.insert(key, result);
            }
        }
        linker
    }

    /// One more than the largest id in use.
    pub fn bound(&self) -> Word {
        self.next
    }

    /// A new id without a type: a label, a type, a function.
    pub fn id(&mut self) -> Word {
        self.next += 1;
        self.types.push(0);
        self.next - 1
    }

    /// A new id for a value of type `ty`.
    pub fn value(&mut self, ty: Word) -> Word {
        let result = self.id();
        self.set_type(result, ty);
        result
    }

    /// Notes the type of a value.
    pub fn set_type(&mut self, value: Word, ty: Word) {
        self.types[value as usize] = ty;
    }

    /// The type of a value.
    pub fn type_of(&self, value: Word) -> Outcome<Word> {
        match self.types.get(value as usize) {
            Some(&ty) if ty != 0 => Ok(ty),
            _ => Err(format!("not a SPIR-V module: id {value} has no type")),
        }
    }

    /// The declaration of a type, constant or module-level variable.
    pub fn global(&self, result: Word) -> Outcome<&Instruction> {
        let position = self.globals.get(&result);
        position
            .map(|&p| &self.module.types_global_values[p])
            .ok_or_else(|| format!("not a SPIR-V module: id {result} is no declaration"))
    }

    /// The operation that declares a type, constant or module-level variable.
    pub fn op(&self, result: Word) -> Option<Op> {
        self.global(result).ok().map(|i| i.class.opcode)
    }

    /// Storage class and pointee of a pointer type.
    pub fn pointee(&self, pointer: Word) -> Option<(StorageClass, Word)> {
        match self.global(pointer).ok()?.operands.as_slice() {
            [Operand::StorageClass(class), Operand::IdRef(pointee)] => Some((*class, *pointee)),
            _ => None,
        }
    }

    /// Component type and count of a scalar (itself and 1) or vector.
    pub fn components(&self, ty: Word) -> (Word, u32) {
        match self.global(ty).map(|i| (i.class.opcode, i.operands.as_slice())) {
            Ok((Op::TypeVector, [Operand::IdRef(scalar), Operand::LiteralBit32(count)])) => {
                (*scalar, *count)
            }
            _ => (ty, 1),
        }
    }

    /// The declaration with these operands: the one that is there, or a new one.
    pub fn declare(&mut self, op: Op, ty: Option<Word>, operands: Vec<Operand>) -> Word {
        let key = (op, ty, operands);
        if let Some(&found) = self.declared.get(&key) {
            return found;
        }
        let result = self.id();
        let (op, ty, operands) = key.clone();
        self.declare_as(Instruction::new(op, ty, Some(result), operands));
        self.declared.insert(key, result);
        result
    }

    /// A declaration of its own.
    pub fn declare_new(&mut self, op: Op, ty: Option<Word>, operands: Vec<Operand>) -> Word {
        let result = self.id();
        self.declare_as(Instruction::new(op, ty, Some(result), operands));
        result
    }

    /// Appends a declaration whose id is settled.
    pub fn declare_as(&mut self, instruction: Instruction) {
        if let Some(result) = instruction.result_id {
            self.set_type(result, instruction.result_type.unwrap_or(0));
            self.globals.insert(result, self.module.types_global_values.len());
        }
        self.module.types_global_values.push(instruction);
    }

    /// Adds a decoration.
    pub fn decorate(&mut self, target: Word, decoration: Decoration, operands: &[u32]) {
        let mut all = vec![id(target), Operand::Decoration(decoration)];
        all.extend(operands.iter().map(|&n| literal(n)));
        self.module.annotations.push(Instruction::new(Op::Decorate, None, None, all));
    }

    /// Gives an id a name, for those who read the result.
    pub fn name(&mut self, target: Word, name: String) {
        let operands = vec![id(target), Operand::LiteralString(name)];
        self.module.debug_names.push(Instruction::new(Op::Name, None, None, operands));
    }

    /// Declares a capability.
    pub fn capability(&mut self, capability: Capability) {
        let operands = vec![Operand::Capability(capability)];
        if !self.module.capabilities.iter().any(|i| i.operands == operands) {
            let instruction = Instruction::new(Op::Capability, None, None, operands);
            self.module.capabilities.push(instruction);
        }
    }

    /// Declares an extension.
    pub fn extension(&mut self, name: &str) {
        let operands = vec![Operand::LiteralString(name.into())];
        if !self.module.extensions.iter().any(|i| i.operands == operands) {
            let instruction = Instruction::new(Op::Extension, None, None, operands);
            self.module.extensions.push(instruction);
        }
    }

    /// The extended instruction set `GLSL.std.450`.
    pub fn glsl_std(&mut self) -> Word {
        let operands = vec![Operand::LiteralString("GLSL.std.450".into())];
        let mut imports = self.module.ext_inst_imports.iter();
        if let Some(found) = imports.find(|i| i.operands == operands).and_then(|i| i.result_id) {
            return found;
        }
        let result = self.id();
        let import = Instruction::new(Op::ExtInstImport, None, Some(result), operands);
        self.module.ext_inst_imports.push(import);
        result
    }

    /// `void`
    pub fn void(&mut self) -> Word {
        self.declare(Op::TypeVoid, None, vec![])
    }

    /// `bool`
    pub fn bool(&mut self) -> Word {
        self.declare(Op::TypeBool, None, vec![])
    }

    /// `float`
    pub fn float(&mut self) -> Word {
        self.declare(Op::TypeFloat, None, vec![literal(32)])
    }

    /// `uint`
    pub fn uint(&mut self) -> Word {
        self.declare(Op::TypeInt, None, vec![literal(32), literal(0)])
    }

    /// `int`
    pub fn int(&mut self) -> Word {
        self.declare(Op::TypeInt, None, vec![literal(32), literal(1)])
    }

    /// A vector, or the scalar itself.
    pub fn vector(&mut self, scalar: Word, count: u32) -> Word {
        match count {
            1 => scalar,
            _ => self.declare(Op::TypeVector, None, vec![id(scalar), literal(count)]),
        }
    }

    /// A pointer type.
    pub fn pointer(&mut self, class: StorageClass, pointee: Word) -> Word {
        self.declare(Op::TypePointer, None, vec![Operand::StorageClass(class), id(pointee)])
    }

    /// A constant of type `uint`.
    pub fn uint_constant(&mut self, value: u32) -> Word {
        let ty = self.uint();
        self.declare(Op::Constant, Some(ty), vec![literal(value)])
    }

    /// A constant of type `float`.
    pub fn float_constant(&mut self, value: f32) -> Word {
        let ty = self.float();
        self.declare(Op::Constant, Some(ty), vec![literal(value.to_bits())])
    }

    /// `true` or `false`.
    pub fn bool_constant(&mut self, value: bool) -> Word {
        let ty = self.bool();
        let op = if value { Op::ConstantTrue } else { Op::ConstantFalse };
        self.declare(op, Some(ty), vec![])
    }

    /// The zero of a type.
    pub fn null(&mut self, ty: Word) -> Word {
        self.declare(Op::ConstantNull, Some(ty), vec![])
    }

    /// A private variable without initial value.
    pub fn private(&mut self, pointee: Word) -> Word {
        let class = StorageClass::Private;
        let pointer = self.pointer(class, pointee);
        self.declare_new(Op::Variable, Some(pointer), vec![Operand::StorageClass(class)])
    }
}

/// Whether SPIR-V requires or allows that declarations of this operation with equal operands are merged.
pub(super) fn has_one_declaration(op: Op) -> bool {
    !matches!(
        op,
        Op::TypeStruct
            | Op::TypeForwardPointer
            | Op::Variable
            | Op::Undef
            | Op::SpecConstant
            | Op::SpecConstantTrue
            | Op::SpecConstantFalse
            | Op::SpecConstantOp
            | Op::SpecConstantComposite
    )
}

/// Instructions written one after the other.
pub(super) struct Code<'l> {
    /// Where ids and declarations come from.
    pub linker: &'l mut Linker,
    /// The instructions so far.
    pub instructions: Vec<Instruction>,
}

impl<'l> Code<'l> {
    /// Starts empty.
    pub fn new(linker: &'l mut Linker) -> Self {
        Self { linker, instructions: Vec::new() }
    }

    /// Appends an instruction with a new result of type `ty`.
    pub fn emit(&mut self, op: Op, ty: Word, operands: Vec<Operand>) -> Word {
        let result = self.linker.value(ty);
        self.instructions.push(Instruction::new(op, Some(ty), Some(result), operands));
        result
    }

    /// Appends an instruction without result.
    pub fn effect(&mut self, op: Op, operands: Vec<Operand>) {
        self.instructions.push(Instruction::new(op, None, None, operands));
    }

    /// Loads a value of type `ty`.
    pub fn load(&mut self, ty: Word, pointer: Word) -> Word {
        self.emit(Op::Load, ty, vec![id(pointer)])
    }

    /// Stores a value.
    pub fn store(&mut self, pointer: Word, value: Word) {
        self.effect(Op::Store, vec![id(pointer), id(value)]);
    }

    /// Calls a function.
    pub fn call(&mut self, ty: Word, function: Word, arguments: &[Word]) -> Word {
        let operands = [function].iter().chain(arguments).map(|&a| id(a)).collect();
        self.emit(Op::FunctionCall, ty, operands)
    }

    /// A pointer to a part of a variable: `path` of literal indices, or the variable if it is empty.
    pub fn part(&mut self, variable: Word, class: StorageClass, ty: Word, path: &[u32]) -> Word {
        if path.is_empty() {
            return variable;
        }
        let pointer = self.linker.pointer(class, ty);
        let mut operands = vec![id(variable)];
        for &n in path {
            operands.push(id(self.linker.uint_constant(n)));
        }
        self.emit(Op::AccessChain, pointer, operands)
    }

    /// The value as type `ty` of the same width.
    pub fn bitcast(&mut self, ty: Word, value: Word) -> Outcome<Word> {
        if self.linker.type_of(value)? == ty {
            return Ok(value);
        }
        Ok(self.emit(Op::Bitcast, ty, vec![id(value)]))
    }

    /// `count` components of a vector from `first`.
    pub fn swizzle(&mut self, scalar: Word, vector: Word, first: u32, count: u32) -> Word {
        if count == 1 {
            return self.emit(Op::CompositeExtract, scalar, vec![id(vector), literal(first)]);
        }
        let ty = self.linker.vector(scalar, count);
        let mut operands = vec![id(vector), id(vector)];
        operands.extend((first..first + count).map(literal));
        self.emit(Op::VectorShuffle, ty, operands)
    }
}
