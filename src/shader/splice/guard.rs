//! Helpers change no memory: stores, atomics and image writes run under "is no helper".
//!
//! A block with such an instruction is cut in two around it, and the instruction gets a block of its
//! own. A result that only that block computes is zero for helpers. The header of a loop must begin
//! with its phis and end with its merge instruction, so its other instructions move to a block behind
//! it first.
//!
//! `modf` and `frexp` return one part of their result and may store the other part. Derivatives may need the
//! returned part of helpers too, so the store becomes an instruction of its own.

use super::{
    flow,
    linker::{Code, Linker, id, literal},
};
use crate::shader::reflect;
use rspirv::{
    dr::{Block, Function, Instruction, Operand},
    spirv::{GlslStd450Op, Op, SelectionControl, StorageClass, Word},
};
use std::collections::HashMap;

/// Guards every side effect in `functions` by the kernel's flag `helper`.
pub(super) fn lower(linker: &mut Linker, functions: &mut [Function], helper: Word) {
    for function in functions {
        Guard { linker, helper, blocks: Vec::new(), tails: HashMap::new(), fresh: Vec::new() }
            .function(function);
    }
}

struct Guard<'l> {
    linker: &'l mut Linker,
    helper: Word,
    blocks: Vec<Block>,
    /// Label of a block's last piece by the label of the block.
    tails: HashMap<Word, Word>,
    /// Phis made here.
    fresh: Vec<Word>,
}

impl Guard<'_> {
    fn function(mut self, function: &mut Function) {
        for mut block in std::mem::take(&mut function.blocks) {
            if block.instructions.iter().any(|i| self.has_effect(i)) {
                let instructions = std::mem::take(&mut block.instructions).into_iter();
                block.instructions = instructions.flat_map(|i| self.separated(i)).collect();
                self.block(block);
            } else {
                self.blocks.push(block);
            }
        }
        function.blocks = self.blocks;
        flow::rename_predecessors(function, &self.tails, &self.fresh);
    }

    fn has_effect(&self, instruction: &Instruction) -> bool {
        reflect::has_side_effect(instruction, |pointer| Some(self.pointee(pointer)?.0))
    }

    /// The storage class and the type that a pointer points to.
    fn pointee(&self, pointer: Word) -> Option<(StorageClass, Word)> {
        self.linker.pointee(self.linker.type_of(pointer).ok()?)
    }

    /// The instruction; instead of `modf` or `frexp` that stores a part, one that returns both parts, and the store.
    fn separated(&mut self, instruction: Instruction) -> Vec<Instruction> {
        const MODF: u32 = GlslStd450Op::Modf as u32;
        const FREXP: u32 = GlslStd450Op::Frexp as u32;
        if !self.has_effect(&instruction) {
            return vec![instruction];
        }
        let (
            Some(ty),
            &[
                Operand::IdRef(set),
                Operand::LiteralExtInstInteger(op @ (MODF | FREXP)),
                Operand::IdRef(value),
                Operand::IdRef(pointer),
            ],
        ) = (instruction.result_type, instruction.operands.as_slice())
        else {
            return vec![instruction];
        };
        let Some((_, stored)) = self.pointee(pointer) else { return vec![instruction] };
        let op = if op == MODF { GlslStd450Op::ModfStruct } else { GlslStd450Op::FrexpStruct };
        let op = Operand::LiteralExtInstInteger(op as u32);
        let both = self.linker.declare(Op::TypeStruct, None, vec![id(ty), id(stored)]);
        let mut code = Code::new(self.linker);
        let parts = code.emit(Op::ExtInst, both, vec![id(set), op, id(value)]);
        let part = code.emit(Op::CompositeExtract, stored, vec![id(parts), literal(1)]);
        code.store(pointer, part);
        let (result, first) = (instruction.result_id, vec![id(parts), literal(0)]);
        code.instructions.push(Instruction::new(Op::CompositeExtract, Some(ty), result, first));
        code.instructions
    }

    fn block(&mut self, mut block: Block) {
        let original = block.label_id();
        let mut instructions = std::mem::take(&mut block.instructions);
        let mut current = block;
        let mut whole_loop = None;
        let is_loop = |i: &Instruction| i.class.opcode == Op::LoopMerge;
        if let Some(merge) = instructions.iter().position(is_loop) {
            let merge = instructions.remove(merge);
            let phis = instructions.iter().take_while(|i| i.class.opcode == Op::Phi).count();
            let rest = instructions.split_off(phis);
            let body = self.linker.id();
            let is_all = merge.operands.get(1).and_then(Operand::id_ref_any) == original;
            whole_loop = is_all.then_some((self.blocks.len(), instructions.len()));
            current.instructions = instructions;
            current.instructions.push(merge);
            self.finish(&mut current, branch(body), body);
            instructions = rest;
        }
        for instruction in instructions {
            if self.has_effect(&instruction) {
                self.guarded(&mut current, instruction);
            } else {
                current.instructions.push(instruction);
            }
        }
        // A loop of one block was its own step. Now the step is a block that only jumps back, since it
        // must not be where the guard's selection ends.
        if let Some((header, merge)) = whole_loop {
            let step = self.linker.id();
            let back = current.instructions.pop();
            self.finish(&mut current, branch(step), step);
            current.instructions.extend(back);
            self.blocks[header].instructions[merge].operands[1] = id(step);
        }
        if let (Some(original), Some(tail)) = (original, current.label_id())
            && original != tail
        {
            self.tails.insert(original, tail);
        }
        self.blocks.push(current);
    }

    /// Ends `current` with `last` and begins the next piece under `label`.
    fn finish(&mut self, current: &mut Block, last: Instruction, label: Word) {
        current.instructions.push(last);
        let next = Block { label: Some(label_of(label)), instructions: Vec::new() };
        self.blocks.push(std::mem::replace(current, next));
    }

    fn guarded(&mut self, current: &mut Block, mut instruction: Instruction) {
        let bool = self.linker.bool();
        let (before, inside, after) = (current.label_id(), self.linker.id(), self.linker.id());
        let helps = self.linker.value(bool);
        let load = Instruction::new(Op::Load, Some(bool), Some(helps), vec![id(self.helper)]);
        let control = Operand::SelectionControl(SelectionControl::NONE);
        let merge = Instruction::new(Op::SelectionMerge, None, None, vec![id(after), control]);
        current.instructions.extend([load, merge]);
        let targets = vec![id(helps), id(after), id(inside)];
        let choice = Instruction::new(Op::BranchConditional, None, None, targets);
        self.finish(current, choice, inside);
        let result = instruction.result_type.zip(instruction.result_id);
        let computed = result.map(|(ty, _)| self.linker.value(ty));
        instruction.result_id = computed;
        current.instructions.push(instruction);
        self.finish(current, branch(after), after);
        if let (Some((ty, result)), Some(computed), Some(before)) = (result, computed, before) {
            let zero = self.linker.null(ty);
            let operands = vec![id(computed), id(inside), id(zero), id(before)];
            current.instructions.push(Instruction::new(Op::Phi, Some(ty), Some(result), operands));
            self.fresh.push(result);
        }
    }
}

fn branch(label: Word) -> Instruction {
    Instruction::new(Op::Branch, None, None, vec![id(label)])
}

fn label_of(label: Word) -> Instruction {
    Instruction::new(Op::Label, None, Some(label), vec![])
}
