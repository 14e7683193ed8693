//! Applies specialization constants to a module before the driver gets it.
//!
//! Vulkan leaves that to drivers. Lavapipe and drivers of GPUs do it at once, and SwiftShader does it late: it inlines all functions of a kernel and compiles all branches
//! of all formats and modes, although constants say which ones are taken. Between a fifth and two thirds of the time that
//! kernels took to compile there was for the others. So this pass does what a constant decides, and no more: constants that
//! are specialized become plain ones, operations on constants become constants, and branches that are never taken go, with
//! the functions that nothing calls any more. All else is left to the driver.
//!
//! The pass knows booleans and integers of 32 bits ([`value`]) and the selections of structured control flow ([`flow`]).
//! Whatever it does not know stays as it is. If it meets something that it cannot keep valid, it has no result, and the
//! module goes to the driver as it was.

mod dominance;
mod flow;
#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests;
mod value;

use super::edit::Edit;
use crate::load_spirv::load;
use rspirv::{
    dr::{self, Function, Instruction, Operand},
    spirv::{Decoration, Op, Word},
};
use std::collections::{HashMap, HashSet};
use value::{Value, decided, evaluate};

/// The module with its specialization constants at these values, by `constant_id`, or at their defaults. No values are left to
/// pass to the driver. `None` if the module is better left alone.
pub(super) fn specialize(words: &[u32], values: &HashMap<u32, u32>) -> Option<Vec<u32>> {
    let module = load(words).ok()?;
    if module.annotations.iter().any(|i| i.class.opcode == Op::DecorationGroup) {
        return None;
    }
    let mut fold = Fold::new(module);
    fold.freeze(values)?;
    let mut functions = std::mem::take(&mut fold.edit.module.functions);
    functions.iter_mut().try_for_each(|function| fold.function(function))?;
    fold.edit.module.functions = functions;
    fold.remove_uncalled();
    fold.remove_leftovers();
    Some(fold.edit.assemble())
}

/// How often the branches of one function are looked at. One that is left over is the driver's to fold.
const ROUNDS: usize = 32;

/// The scalar types that the pass computes with.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Bool,
    Int,
}

struct Fold {
    edit: Edit,
    kinds: HashMap<Word, Kind>,
    /// The constants that are known, also those that instructions turned out to be.
    values: HashMap<Word, Value>,
    /// The parts of composite constants.
    composites: HashMap<Word, Vec<Word>>,
    /// The declarations that are left to the driver to specialize.
    specialized: HashSet<Word>,
    /// The constants that stand for a value of a type.
    constants: HashMap<(Word, Value), Word>,
    /// The undefined value of each type.
    undefined: HashMap<Word, Word>,
    /// What stands in the place of an instruction that is gone.
    instead: HashMap<Word, Word>,
}

impl Fold {
    fn new(module: dr::Module) -> Self {
        let edit = Edit::new(module);
        let kind = |(id, ty): (&Word, &Instruction)| match (ty.class.opcode, ty.operands.first()) {
            (Op::TypeBool, _) => Some((*id, Kind::Bool)),
            (Op::TypeInt, Some(Operand::LiteralBit32(32))) => Some((*id, Kind::Int)),
            _ => None,
        };
        Self {
            kinds: edit.globals.iter().filter_map(kind).collect(),
            edit,
            values: HashMap::new(),
            composites: HashMap::new(),
            specialized: HashSet::new(),
            constants: HashMap::new(),
            undefined: HashMap::new(),
            instead: HashMap::new(),
        }
    }

    /// Makes plain constants of those that are specialized. `None` if one of `values` is of a type that is not known here.
    fn freeze(&mut self, values: &HashMap<u32, u32>) -> Option<()> {
        let numbers = self.edit.decorations(Decoration::SpecId);
        let given = |id: &Word| numbers.get(id).and_then(|number| values.get(number)).copied();
        let mut globals = std::mem::take(&mut self.edit.module.types_global_values);
        for i in &mut globals {
            let (Some(id), Some(ty)) = (i.result_id, i.result_type) else { continue };
            let plain = match (i.class.opcode, &i.operands[..]) {
                (op @ (Op::SpecConstantTrue | Op::SpecConstantFalse), _) => {
                    let value = given(&id).map_or(op == Op::SpecConstantTrue, |bits| bits != 0);
                    Some(constant(ty, id, Value::Bool(value)))
                }
                (Op::SpecConstant, [Operand::LiteralBit32(default)]) if self.is_word(ty) => {
                    Some(constant(ty, id, Value::Int(given(&id).unwrap_or(*default))))
                }
                (Op::SpecConstant, _) if given(&id).is_some() => return None,
                (Op::SpecConstantOp, _) => match self.result(i) {
                    Some(value) => Some(constant(ty, id, value)),
                    None => {
                        self.chosen(i).map(|chosen| Instruction { result_id: Some(id), ..chosen })
                    }
                },
                (Op::SpecConstantComposite, parts) => {
                    let mut parts = parts.iter().filter_map(Operand::id_ref_any);
                    let is_plain = parts.all(|part| !self.specialized.contains(&part));
                    let composite = Op::ConstantComposite;
                    is_plain.then(|| {
                        Instruction::new(composite, Some(ty), Some(id), i.operands.clone())
                    })
                }
                _ => None,
            };
            *i = plain.unwrap_or_else(|| i.clone());
            self.note(id, ty, i);
        }
        self.edit.module.types_global_values = globals;
        let Self { edit, specialized, .. } = self;
        edit.module.annotations.retain(|i| {
            let is_number = i.operands.get(1) == Some(&Operand::Decoration(Decoration::SpecId));
            !is_number || target(i).is_some_and(|id| specialized.contains(&id))
        });
        Some(())
    }

    /// Remembers the constant that a declaration is, if it is one.
    fn note(&mut self, id: Word, ty: Word, declaration: &Instruction) {
        let kind = self.kinds.get(&ty);
        let value = match (declaration.class.opcode, kind, declaration.operands.first()) {
            (Op::ConstantTrue, ..) => Value::Bool(true),
            (Op::ConstantFalse, ..) | (Op::ConstantNull, Some(Kind::Bool), _) => Value::Bool(false),
            (Op::ConstantNull, Some(Kind::Int), _) => Value::Int(0),
            (Op::Constant, Some(Kind::Int), Some(Operand::LiteralBit32(bits))) => Value::Int(*bits),
            (op, ..) => {
                let parts = declaration.operands.iter().filter_map(Operand::id_ref_any);
                if matches!(op, Op::ConstantComposite | Op::SpecConstantComposite) {
                    self.composites.insert(id, parts.collect());
                }
                if !matches!(op, Op::Constant | Op::ConstantComposite | Op::ConstantNull) {
                    self.specialized.insert(id);
                }
                return;
            }
        };
        self.values.insert(id, value);
        self.constants.entry((ty, value)).or_insert(id);
    }

    /// The constant of any type that a declaration chooses.
    fn chosen(&self, i: &Instruction) -> Option<Instruction> {
        let [Operand::LiteralSpecConstantOpInteger(Op::Select), condition, operands @ ..] =
            &i.operands[..]
        else {
            return None;
        };
        let Some(Value::Bool(first)) = self.values.get(&condition.id_ref_any()?) else {
            return None;
        };
        let chosen = operands.get(1 - usize::from(*first))?.id_ref_any()?;
        let chosen = self.edit.globals.get(&chosen)?;
        matches!(chosen.class.opcode, Op::Constant | Op::ConstantComposite).then(|| chosen.clone())
    }

    /// Whether a type is a number of 32 bits.
    fn is_word(&self, ty: Word) -> bool {
        let is_number = self.edit.is(ty, Op::TypeInt) || self.edit.is(ty, Op::TypeFloat);
        let bits = self.edit.globals.get(&ty).and_then(|ty| ty.operands.first());
        is_number && bits == Some(&Operand::LiteralBit32(32))
    }

    /// The constant that an instruction or a declaration gives.
    fn result(&self, i: &Instruction) -> Option<Value> {
        let (op, operands) = match (i.class.opcode, &i.operands[..]) {
            (Op::SpecConstantOp, [Operand::LiteralSpecConstantOpInteger(op), rest @ ..]) => {
                (*op, rest)
            }
            (op, operands) => (op, operands),
        };
        let kind = self.kinds.get(&i.result_type?)?;
        let value = |operand: &Operand| self.values.get(&operand.id_ref_any()?).copied();
        let found = match (op, operands) {
            (Op::CompositeExtract, [composite, Operand::LiteralBit32(at)]) => {
                let parts = self.composites.get(&composite.id_ref_any()?)?;
                self.values.get(parts.get(*at as usize)?).copied()?
            }
            (Op::Phi, _) => {
                let mut all = operands.chunks_exact(2).map(|pair| value(&pair[0]));
                let first = all.next()??;
                all.all(|other| other == Some(first)).then_some(first)?
            }
            _ => {
                let mut known = operands.iter().filter_map(value);
                let decided = known.find_map(|known| decided(op, known));
                let all = || operands.iter().map(value).collect::<Option<Vec<_>>>();
                decided.or_else(|| evaluate(op, &all()?))?
            }
        };
        match (kind, found) {
            (Kind::Bool, Value::Bool(_)) | (Kind::Int, Value::Int(_)) => Some(found),
            _ => None,
        }
    }

    /// The operand that an instruction hands on.
    fn handed_on(&self, i: &Instruction) -> Option<Word> {
        let known = |at: usize| self.values.get(&i.operands.get(at)?.id_ref_any()?);
        let at = match (i.class.opcode, i.operands.len(), known(0)) {
            (Op::Phi, 2, _) => 0,
            (Op::Select, _, Some(Value::Bool(first))) => 2 - usize::from(*first),
            _ => return None,
        };
        let mut id = i.operands.get(at)?.id_ref_any()?;
        while let Some(other) = self.instead.get(&id) {
            id = *other;
        }
        Some(id).filter(|id| Some(*id) != i.result_id)
    }

    /// Folds what is in one function.
    fn function(&mut self, function: &mut Function) -> Option<()> {
        for _ in 0..ROUNDS {
            let mut changed = self.instructions(function);
            changed |= flow::cut_arms(&mut function.blocks, &self.values);
            self.remove_unreachable(function)?;
            if flow::unwrap(&mut function.blocks, &self.values) {
                self.remove_unreachable(function)?;
                changed = true;
            }
            if !changed {
                break;
            }
        }
        // An arm that became empty is a new way past what the other one computes.
        dominance::is_kept(&function.blocks).then_some(())
    }

    /// Removes the instructions that are constants, or that hand on an operand. Whether there was any.
    fn instructions(&mut self, function: &mut Function) -> bool {
        let mut changed = false;
        for block in &mut function.blocks {
            block.instructions.retain(|i| {
                let gone = self.is_folded(i);
                changed |= gone;
                !gone
            });
        }
        let instead = &self.instead;
        replace(function, |id| {
            let mut id = id;
            while let Some(other) = instead.get(&id) {
                id = *other;
            }
            Some(id)
        });
        changed
    }

    /// Whether something stands in the place of an instruction from now on.
    fn is_folded(&mut self, i: &Instruction) -> bool {
        let (Some(id), Some(ty)) = (i.result_id, i.result_type) else { return false };
        let other = match self.result(i) {
            Some(value) => Some(self.constant(ty, value)),
            None => self.handed_on(i),
        };
        let Some(other) = other else { return false };
        self.instead.insert(id, other);
        if let Some(value) = self.values.get(&other) {
            self.values.insert(id, *value);
        }
        true
    }

    fn constant(&mut self, ty: Word, value: Value) -> Word {
        if let Some(known) = self.constants.get(&(ty, value)) {
            return *known;
        }
        let Instruction { class, operands, .. } = constant(ty, 0, value);
        let id = self.edit.global(class.opcode, Some(ty), operands);
        self.constants.insert((ty, value), id);
        self.values.insert(id, value);
        id
    }

    /// A value of a type for code that never runs. `None` if the type can have no such value.
    fn undefined(&mut self, ty: Word) -> Option<Word> {
        if !self.is_data(ty) {
            return None;
        }
        let edit = &mut self.edit;
        Some(
            *self
                .undefined
                .entry(ty)
                .or_insert_with(|| edit.global(Op::Undef, Some(ty), Vec::new())),
        )
    }

    /// Whether a type consists of numbers and booleans.
    fn is_data(&self, ty: Word) -> bool {
        let Some(declaration) = self.edit.globals.get(&ty) else { return false };
        let mut inner = declaration.operands.iter().filter_map(Operand::id_ref_any);
        match declaration.class.opcode {
            Op::TypeBool | Op::TypeInt | Op::TypeFloat | Op::TypeVector | Op::TypeMatrix => true,
            Op::TypeArray => inner.next().is_some_and(|element| self.is_data(element)),
            Op::TypeStruct => inner.all(|member| self.is_data(member)),
            _ => false,
        }
    }

    /// Removes the blocks of a function that are never reached. What is left never runs where it uses something of them.
    fn remove_unreachable(&mut self, function: &mut Function) -> Option<()> {
        let blocks = function.blocks.len();
        let types: HashMap<Word, Option<Word>> = results(function).collect();
        flow::remove_unreachable(&mut function.blocks);
        flow::repair_phis(&mut function.blocks, |ty| self.undefined(ty))?;
        if function.blocks.len() == blocks {
            return Some(());
        }
        let left: HashSet<Word> = results(function).map(|(id, _)| id).collect();
        replace(function, |id| match types.get(&id) {
            Some(ty) if !left.contains(&id) => self.undefined((*ty)?),
            _ => Some(id),
        })
    }

    /// Removes the functions that the entry points do not call.
    fn remove_uncalled(&mut self) {
        let module = &mut self.edit.module;
        let id = |function: &Function| function.def.as_ref().and_then(|def| def.result_id);
        let functions: HashMap<Word, &Function> = module
            .functions
            .iter()
            .filter_map(|function| Some((id(function)?, function)))
            .collect();
        let entries = module.entry_points.iter();
        let mut open: Vec<Word> =
            entries.filter_map(|i| i.operands.get(1).and_then(Operand::id_ref_any)).collect();
        let mut called = HashSet::new();
        while let Some(next) = open.pop() {
            let function = functions.get(&next).filter(|_| called.insert(next));
            let code = function.into_iter().flat_map(|f| f.all_inst_iter());
            open.extend(code.filter(|i| i.class.opcode == Op::FunctionCall).filter_map(target));
        }
        module.functions.retain(|function| id(function).is_some_and(|id| called.contains(&id)));
    }

    /// Removes names and decorations of what is gone.
    fn remove_leftovers(&mut self) {
        let module = &mut self.edit.module;
        let left: HashSet<Word> = module.all_inst_iter().filter_map(|i| i.result_id).collect();
        let is_left = |i: &Instruction| target(i).is_none_or(|id| left.contains(&id));
        module.debug_names.retain(is_left);
        module.annotations.retain(is_left);
    }
}

/// The declaration of a constant.
fn constant(ty: Word, id: Word, value: Value) -> Instruction {
    let (op, operands) = match value {
        Value::Bool(true) => (Op::ConstantTrue, Vec::new()),
        Value::Bool(false) => (Op::ConstantFalse, Vec::new()),
        Value::Int(bits) => (Op::Constant, vec![Operand::LiteralBit32(bits)]),
    };
    Instruction::new(op, Some(ty), Some(id), operands)
}

/// The id that an instruction begins with: what a name or a decoration is for, what a call calls.
fn target(i: &Instruction) -> Option<Word> {
    i.operands.first().and_then(Operand::id_ref_any)
}

/// The ids that a function's blocks define, with their types.
fn results(function: &Function) -> impl Iterator<Item = (Word, Option<Word>)> {
    let of_block = |block: &dr::Block| {
        let all = block.label.iter().chain(&block.instructions);
        all.filter_map(|i| Some((i.result_id?, i.result_type))).collect::<Vec<_>>()
    };
    function.blocks.iter().flat_map(of_block)
}

/// Puts other ids in the place of those that a function's instructions use. `None` if there is none for one of them.
fn replace(function: &mut Function, mut other: impl FnMut(Word) -> Option<Word>) -> Option<()> {
    for i in function.blocks.iter_mut().flat_map(|block| &mut block.instructions) {
        for id in i.operands.iter_mut().filter_map(Operand::id_ref_any_mut) {
            *id = other(*id)?;
        }
    }
    Some(())
}
