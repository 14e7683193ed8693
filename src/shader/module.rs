//! SPIR-V modules as data: reads them and looks things up in them.
//!
//! Words become `rspirv`'s data representation. Instructions that do not affect the result are dropped while
//! reading: source text, line numbers, and the `NonSemantic` instruction sets (debug information,
//! `debugPrintfEXT`), whose definition allows dropping them.
//!
//! A module comes from anywhere, so nothing here trusts it: an id that is not defined is a refusal,
//! not a panic. Refusals inside `shader` are sentences without the shader's name, which the public
//! functions add.

use crate::load_spirv::load;
use rspirv::{
    dr::{self, Instruction, Operand},
    spirv::{self, Capability, Decoration, Op, Word},
};
use std::collections::{HashMap, HashSet};

/// A result, or a refusal without the shader's name.
pub(super) type Outcome<T> = Result<T, String>;

/// The largest id that SPIR-V's universal limits promise to be accepted.
const MAX_ID: Word = 0x3f_ffff;
/// Types and constants inside each other. SPIR-V's universal limits promise 255 for structs.
const MAX_DEPTH: u32 = 1000;

/// Reads a module.
pub(super) fn parse(words: &[u32]) -> Outcome<dr::Module> {
    let words = without_debug_information(words)?;
    let mut module = load(&words).map_err(|e| format!("not a SPIR-V module: {e}"))?;
    for instruction in module.all_inst_iter() {
        let ids = instruction.operands.iter().filter_map(Operand::id_ref_any);
        let own = instruction.result_id.into_iter().chain(instruction.result_type);
        if let Some(id) = ids.chain(own).find(|&id| id == 0 || id > MAX_ID) {
            return Err(format!("not a SPIR-V module: id {id} is out of range"));
        }
    }
    check_order(&module)?;
    check_depth(&module)?;
    let defined: HashSet<Word> = module.all_inst_iter().filter_map(|i| i.result_id).collect();
    module.debug_names.retain(|i| ids(i).all(|id| defined.contains(&id)));
    for instruction in module.all_inst_iter() {
        let missing = ids(instruction).chain(instruction.result_type);
        if let Some(id) = missing.into_iter().find(|id| !defined.contains(id)) {
            return Err(format!("not a SPIR-V module: id {id} is not defined"));
        }
    }
    Ok(module)
}

/// Checks that ids are defined once and that declarations follow the ones that they refer to (except for pointers
/// announced by `OpTypeForwardPointer`), so that walks through types end.
fn check_order(module: &dr::Module) -> Outcome<()> {
    let mut defined = HashSet::new();
    for instruction in module.ext_inst_imports.iter().chain(&module.types_global_values) {
        if instruction.class.opcode == Op::TypeForwardPointer {
            defined.extend(ids(instruction).map(|id| (id, true)));
            continue;
        }
        let mentioned = ids(instruction).chain(instruction.result_type);
        for id in mentioned {
            if !defined.contains(&(id, false)) && !defined.contains(&(id, true)) {
                return Err(format!("not a SPIR-V module: id {id} is used before its definition"));
            }
        }
        if let Some(id) = instruction.result_id
            && !defined.insert((id, false))
        {
            return Err(format!("not a SPIR-V module: id {id} is defined twice"));
        }
        let is_vector = matches!(instruction.class.opcode, Op::TypeVector | Op::TypeMatrix);
        if is_vector && !(2..=4).contains(&number(instruction, 1)?) {
            return Err("vectors or matrices of other than 2 to 4 components".into());
        }
    }
    for instruction in module.functions.iter().flat_map(|f| f.all_inst_iter()) {
        if let Some(id) = instruction.result_id
            && !defined.insert((id, false))
        {
            return Err(format!("not a SPIR-V module: id {id} is defined twice"));
        }
    }
    Ok(())
}

/// Checks that declarations are not nested so deep that a walk through them fills the stack.
fn check_depth(module: &dr::Module) -> Outcome<()> {
    let mut depths: HashMap<Word, u32> = HashMap::new();
    for instruction in &module.types_global_values {
        let inner = ids(instruction).chain(instruction.result_type);
        let depth = inner.filter_map(|id| depths.get(&id)).max().map_or(0, |depth| depth + 1);
        if depth > MAX_DEPTH {
            return Err(format!("declarations nested more than {MAX_DEPTH} deep"));
        }
        depths.extend(instruction.result_id.map(|id| (id, depth)));
    }
    Ok(())
}

/// Copies a module without the instructions that only describe where it came from. `rspirv` cannot
/// read extended instructions outside functions, which is where debug information puts them.
fn without_debug_information(words: &[u32]) -> Outcome<Vec<u32>> {
    if words.len() < 5 || words[0] != spirv::MAGIC_NUMBER {
        return Err("not a SPIR-V module: the magic number is missing".into());
    }
    let mut kept = words[..5].to_vec();
    let mut non_semantic = Vec::new();
    let mut at = 5;
    while at < words.len() {
        let length = (words[at] >> 16) as usize;
        let Some(instruction) = words.get(at..at + length).filter(|_| length > 0) else {
            return Err(format!("not a SPIR-V module: it breaks off at word {at}"));
        };
        at += length;
        let drop = match Op::from_u32(words[at - length] & 0xffff) {
            Some(
                Op::Source
                | Op::SourceContinued
                | Op::SourceExtension
                | Op::String
                | Op::Line
                | Op::NoLine
                | Op::ModuleProcessed,
            ) => true,
            Some(Op::ExtInstImport) if text(&instruction[2..]).starts_with("NonSemantic.") => {
                non_semantic.push(instruction[1]);
                true
            }
            Some(Op::Capability)
                if instruction.get(1) == Some(&(Capability::UntypedPointersKHR as u32)) =>
            {
                return Err("untyped pointers (SPV_KHR_untyped_pointers)".into());
            }
            Some(Op::Extension) => text(&instruction[1..]) == "SPV_KHR_non_semantic_info",
            Some(Op::ExtInst) => instruction.get(3).is_some_and(|set| non_semantic.contains(set)),
            // OpExtInstWithForwardRefsKHR exists for debug information only.
            None if words[at - length] & 0xffff == 4433 => true,
            _ => false,
        };
        if !drop {
            kept.extend_from_slice(instruction);
        }
    }
    Ok(kept)
}

/// A literal string, as far as it is one.
fn text(words: &[u32]) -> String {
    let bytes = words.iter().flat_map(|w| w.to_le_bytes()).take_while(|&b| b != 0);
    bytes.map(char::from).collect()
}

/// A module with its definitions and decorations by id.
pub(super) struct Index<'m> {
    /// The module.
    pub module: &'m dr::Module,
    defs: Vec<Option<&'m Instruction>>,
    /// `OpDecorate` and `OpMemberDecorate` by target.
    decorations: Vec<Vec<&'m Instruction>>,
}

impl<'m> Index<'m> {
    /// Indexes `module`.
    pub fn new(module: &'m dr::Module) -> Self {
        let bound = module.all_inst_iter().filter_map(|i| i.result_id).max().unwrap_or(0) + 1;
        let mut defs = vec![None; bound as usize];
        for instruction in module.all_inst_iter() {
            if let Some(id) = instruction.result_id {
                defs[id as usize] = Some(instruction);
            }
        }
        let mut decorations = vec![Vec::new(); bound as usize];
        for instruction in &module.annotations {
            let target = instruction.operands.first().and_then(Operand::id_ref_any);
            if let Some(list) = target.and_then(|id| decorations.get_mut(id as usize)) {
                list.push(instruction);
            }
        }
        Self { module, defs, decorations }
    }

    /// One more than the largest id.
    pub fn bound(&self) -> Word {
        self.defs.len() as Word
    }

    /// What defines `id`.
    pub fn def(&self, id: Word) -> Outcome<&'m Instruction> {
        let found = self.defs.get(id as usize).copied().flatten();
        found.ok_or_else(|| format!("not a SPIR-V module: id {id} is not defined"))
    }

    /// The operation that defines `id`.
    pub fn op(&self, id: Word) -> Outcome<Op> {
        Ok(self.def(id)?.class.opcode)
    }

    /// Operand `n` of the definition of `id`, which is an id.
    pub fn id_operand(&self, id: Word, n: usize) -> Outcome<Word> {
        id_operand(self.def(id)?, n)
    }

    /// Operand `n` of the definition of `id`, which is a number.
    pub fn number(&self, id: Word, n: usize) -> Outcome<u32> {
        number(self.def(id)?, n)
    }

    /// The type of `id`.
    pub fn type_of(&self, id: Word) -> Outcome<Word> {
        let def = self.def(id)?;
        def.result_type.ok_or_else(|| format!("not a SPIR-V module: id {id} has no type"))
    }

    /// Storage class and pointee of a pointer type.
    pub fn pointer(&self, ty: Word) -> Outcome<(spirv::StorageClass, Word)> {
        let def = self.def(ty)?;
        match (def.class.opcode, def.operands.as_slice()) {
            (Op::TypePointer, [Operand::StorageClass(class), Operand::IdRef(pointee)]) => {
                Ok((*class, *pointee))
            }
            _ => Err(format!("not a SPIR-V module: type {ty} is no pointer")),
        }
    }

    /// Decorations and member decorations of `id`.
    pub fn annotations(&self, id: Word) -> &[&'m Instruction] {
        self.decorations.get(id as usize).map_or(&[], Vec::as_slice)
    }

    /// The decoration `wanted` of `id`, or of its member.
    fn decoration(
        &self,
        id: Word,
        member: Option<u32>,
        wanted: Decoration,
    ) -> Option<&'m [Operand]> {
        self.annotations(id).iter().find_map(|i| {
            let rest = match (i.class.opcode, member) {
                (Op::Decorate | Op::DecorateId, None) => &i.operands[1..],
                (Op::MemberDecorate, Some(member))
                    if i.operands.get(1) == Some(&Operand::LiteralBit32(member)) =>
                {
                    &i.operands[2..]
                }
                _ => return None,
            };
            (rest.first() == Some(&Operand::Decoration(wanted))).then(|| &rest[1..])
        })
    }

    /// Whether `id` has the decoration.
    pub fn has(&self, id: Word, wanted: Decoration) -> bool {
        self.decoration(id, None, wanted).is_some()
    }

    /// Whether a member has the decoration.
    pub fn member_has(&self, id: Word, member: u32, wanted: Decoration) -> bool {
        self.decoration(id, Some(member), wanted).is_some()
    }

    /// The number that the decoration carries.
    pub fn literal(&self, id: Word, wanted: Decoration) -> Option<u32> {
        self.decoration(id, None, wanted).and_then(literal)
    }

    /// The number that the decoration of a member carries.
    pub fn member_literal(&self, id: Word, member: u32, wanted: Decoration) -> Option<u32> {
        self.decoration(id, Some(member), wanted).and_then(literal)
    }

    /// The built-in that a variable (`member` is `None`) or a member of a block is.
    pub fn built_in(&self, id: Word, member: Option<u32>) -> Option<spirv::BuiltIn> {
        match self.decoration(id, member, Decoration::BuiltIn)?.first()? {
            Operand::BuiltIn(built_in) => Some(*built_in),
            _ => None,
        }
    }

    /// The value of an integer constant; of a specialization constant, its default.
    pub fn constant(&self, id: Word) -> Outcome<u32> {
        let def = self.def(id)?;
        match (def.class.opcode, def.operands.first()) {
            (Op::Constant | Op::SpecConstant, Some(Operand::LiteralBit32(value))) => Ok(*value),
            (Op::ConstantNull, _) => Ok(0),
            (Op::SpecConstantOp, _) => {
                Err("a length that is computed from specialization constants".into())
            }
            _ => Err(format!("not a SPIR-V module: id {id} is no integer constant")),
        }
    }
}

fn literal(operands: &[Operand]) -> Option<u32> {
    match operands.first()? {
        Operand::LiteralBit32(value) => Some(*value),
        _ => None,
    }
}

/// Operand `n`, which is an id.
pub(super) fn id_operand(instruction: &Instruction, n: usize) -> Outcome<Word> {
    let found = instruction.operands.get(n).and_then(Operand::id_ref_any);
    found.ok_or_else(|| malformed(instruction))
}

/// Operand `n`, which is a number.
pub(super) fn number(instruction: &Instruction, n: usize) -> Outcome<u32> {
    match instruction.operands.get(n) {
        Some(Operand::LiteralBit32(value)) => Ok(*value),
        _ => Err(malformed(instruction)),
    }
}

/// The ids that an instruction refers to, its type not among them.
pub(super) fn ids(instruction: &Instruction) -> impl Iterator<Item = Word> + '_ {
    instruction.operands.iter().filter_map(Operand::id_ref_any)
}

fn malformed(instruction: &Instruction) -> String {
    format!("not a SPIR-V module: malformed Op{}", instruction.class.opname)
}
