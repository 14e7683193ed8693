//! A SPIR-V module that is being changed: new ids, declarations and decorations.

use rspirv::{
    binary::Assemble,
    dr::{self, Instruction, Operand},
    spirv::{Decoration, Op, StorageClass, Word},
};
use std::collections::HashMap;

pub(super) struct Edit {
    pub module: dr::Module,
    /// Types, constants and variables by id.
    pub globals: HashMap<Word, Instruction>,
    /// The type of an unsigned integer of 32 bits.
    pub uint: Word,
    next: Word,
    constants: HashMap<u32, Word>,
}

impl Edit {
    pub fn new(module: dr::Module) -> Self {
        let globals: HashMap<Word, Instruction> = (module.types_global_values.iter())
            .filter_map(|i| Some((i.result_id?, i.clone())))
            .collect();
        let next = module.all_inst_iter().filter_map(|i| i.result_id).max().unwrap_or(0) + 1;
        let mut edit = Self { module, globals, uint: 0, next, constants: HashMap::new() };
        let operands = vec![Operand::LiteralBit32(32), Operand::LiteralBit32(0)];
        edit.uint = edit.declared(Op::TypeInt, operands);
        edit
    }

    /// The words of the module as it is now.
    pub fn assemble(mut self) -> Vec<u32> {
        if let Some(header) = &mut self.module.header {
            header.bound = self.next;
        }
        self.module.assemble()
    }

    pub fn id(&mut self) -> Word {
        self.next += 1;
        self.next - 1
    }

    /// Declares a type, a constant or a variable.
    pub fn global(&mut self, op: Op, ty: Option<Word>, operands: Vec<Operand>) -> Word {
        let id = self.id();
        let instruction = Instruction::new(op, ty, Some(id), operands);
        self.globals.insert(id, instruction.clone());
        self.module.types_global_values.push(instruction);
        id
    }

    /// A type that is not an aggregate, which a module may declare only once.
    pub fn declared(&mut self, op: Op, operands: Vec<Operand>) -> Word {
        let same = |i: &&Instruction| i.class.opcode == op && i.operands == operands;
        match self.globals.values().find(same).and_then(|i| i.result_id) {
            Some(id) => id,
            None => self.global(op, None, operands),
        }
    }

    pub fn pointer(&mut self, class: StorageClass, pointee: Word) -> Word {
        let operands = vec![Operand::StorageClass(class), Operand::IdRef(pointee)];
        self.global(Op::TypePointer, None, operands)
    }

    /// An unsigned integer.
    pub fn constant(&mut self, value: u32) -> Word {
        match self.constants.get(&value) {
            Some(&known) => known,
            None => {
                let ty = Some(self.uint);
                let id = self.global(Op::Constant, ty, vec![Operand::LiteralBit32(value)]);
                self.constants.insert(value, id);
                id
            }
        }
    }

    pub fn decorate(
        &mut self,
        op: Op,
        mut target: Vec<Operand>,
        decoration: Decoration,
        value: &[u32],
    ) {
        target.push(Operand::Decoration(decoration));
        target.extend(value.iter().map(|&v| Operand::LiteralBit32(v)));
        self.module.annotations.push(Instruction::new(op, None, None, target));
    }

    /// The ids that have a decoration, with its number.
    pub fn decorations(&self, wanted: Decoration) -> HashMap<Word, u32> {
        let of = |i: &Instruction| match (i.class.opcode, i.operands.as_slice()) {
            (
                Op::Decorate,
                &[Operand::IdRef(id), Operand::Decoration(d), Operand::LiteralBit32(value)],
            ) if d == wanted => Some((id, value)),
            _ => None,
        };
        self.module.annotations.iter().filter_map(of).collect()
    }

    /// Operand `n` of a declaration, 0 if it is no id.
    pub fn operand(&self, id: Word, n: usize) -> Word {
        match self.globals.get(&id).and_then(|i| i.operands.get(n)) {
            Some(&Operand::IdRef(id)) => id,
            _ => 0,
        }
    }

    /// The value of a constant of 32 bits that no specialization changes.
    pub fn number(&self, id: Word) -> Option<u32> {
        let i = self.globals.get(&id).filter(|i| i.class.opcode == Op::Constant)?;
        match i.operands.as_slice() {
            &[Operand::LiteralBit32(value)] => Some(value),
            _ => None,
        }
    }

    pub fn is(&self, id: Word, op: Op) -> bool {
        self.globals.get(&id).is_some_and(|i| i.class.opcode == op)
    }

    pub fn instructions(&self) -> impl Iterator<Item = &Instruction> {
        let blocks = self.module.functions.iter().flat_map(|f| &f.blocks);
        blocks.flat_map(|block| &block.instructions)
    }
}
