//! Storage blocks of a kernel by address instead of by descriptor.
//!
//! A kernel declares its blocks as any shader does. Some drivers access memory by address faster than storage
//! blocks. For these drivers, this module rewrites the blocks of set 0 that are only loaded, stored and
//! changed by atomics: a uniform block holds their addresses, and an access chain that began at a variable
//! begins at a pointer. The engine's own view of the resource table is an array of read-only blocks of words;
//! it becomes an array of addresses in the same way. A block whose length the kernel asks for stays as it is,
//! and so does the users' shaders' view of the table.
//!
//! Lavapipe is such a driver. It reads a storage block lane by lane, and each lane has its own descriptor,
//! check of bounds and branches. For eight lanes these are about 90 instructions in 24 basic blocks, which
//! make kernels slow to run and slow to compile. It reads memory by address with one gather, also two words
//! at once (`pairs.rs`).

mod pairs;

use super::edit::Edit;
use crate::load_spirv::load;
pub(super) use pairs::BLOCK_BYTES;
use pairs::{Layout, Place, aligned};
use rspirv::{
    dr::{self, Instruction, Operand},
    spirv::{AddressingModel, Capability, Decoration, Op, StorageClass, Word},
};
use std::collections::{HashMap, HashSet};

/// A kernel whose blocks were replaced by addresses.
pub(super) struct Addressed {
    /// The new module.
    pub spirv: Vec<u32>,
    /// Binding number, in set 0, of the uniform block of addresses.
    pub binding: u32,
    /// Binding numbers of the blocks that are replaced, in the order of their addresses.
    pub blocks: Vec<u32>,
    /// Whether the address of a table of addresses comes last: one for each buffer of the resource table.
    pub table: bool,
    /// Whether the module still has the resource table.
    pub uses_table: bool,
}

/// A variable that is replaced.
struct Block {
    variable: Word,
    /// The struct, for the table that of an element.
    ty: Word,
    /// `None` for the table.
    binding: Option<u32>,
    /// Pointer to `ty` by address.
    pointer: Word,
    /// Number in the block of addresses.
    member: Word,
    /// The table only: the types of a pointer to all its addresses and of a pointer to one of them.
    table: Option<(Word, Word)>,
}

/// Bytes of an address.
const ADDRESS_BYTES: u32 = 8;

/// Replaces all blocks of a kernel that can be replaced; returns `None` if there are none. `has_int64` says
/// whether the device has 64-bit integers.
pub(super) fn lower(
    words: &[u32],
    has_int64: bool,
) -> std::result::Result<Option<Addressed>, String> {
    let module = load(words).map_err(|e| format!("is no SPIR-V module: {e}"))?;
    let mut rewriter = Rewriter::new(module, has_int64);
    let mut blocks = rewriter.blocks();
    if blocks.is_empty() {
        return Ok(None);
    }
    let bindings = rewriter.edit.decorations(Decoration::Binding);
    let binding = bindings.values().max().map_or(0, |most| most + 1);
    let addresses = rewriter.declare(&mut blocks, binding);
    rewriter.rewrite(&blocks, addresses);
    rewriter.remove(&blocks);
    let sets = rewriter.edit.decorations(Decoration::DescriptorSet);
    Ok(Some(Addressed {
        spirv: rewriter.edit.assemble(),
        binding,
        blocks: blocks.iter().filter_map(|block| block.binding).collect(),
        table: blocks.iter().any(|block| block.binding.is_none()),
        uses_table: sets.values().any(|&set| set == 1),
    }))
}

/// Rewrites one module.
struct Rewriter {
    edit: Edit,
    has_int64: bool,
    /// By the number of pairs: the type of a pointer to pairs of words, and the type of the pairs.
    pair_types: HashMap<u32, (Word, Word)>,
}

impl Rewriter {
    fn new(module: dr::Module, has_int64: bool) -> Self {
        Self { edit: Edit::new(module), has_int64, pair_types: HashMap::new() }
    }

    /// The structs of which no member is written.
    fn read_only(&self) -> HashSet<Word> {
        let mut members: HashMap<Word, usize> = HashMap::new();
        for i in &self.edit.module.annotations {
            if let (Op::MemberDecorate, [Operand::IdRef(id), _, Operand::Decoration(d)]) =
                (i.class.opcode, i.operands.as_slice())
                && *d == Decoration::NonWritable
            {
                *members.entry(*id).or_default() += 1;
            }
        }
        let whole = |id: &Word, count: &usize| {
            self.edit.globals.get(id).is_some_and(|ty| ty.operands.len() == *count)
        };
        members.into_iter().filter(|(id, count)| whole(id, count)).map(|(id, _)| id).collect()
    }

    /// What can be replaced: in set 0 any block, of the table the first array of blocks of words, which
    /// is the kernel's own.
    fn blocks(&self) -> Vec<Block> {
        let sets = self.edit.decorations(Decoration::DescriptorSet);
        let bindings = self.edit.decorations(Decoration::Binding);
        let read_only = self.read_only();
        let mut found: Vec<Block> = Vec::new();
        for variable in &self.edit.module.types_global_values {
            let (Op::Variable, Some(id), Some(Operand::StorageClass(StorageClass::StorageBuffer))) =
                (variable.class.opcode, variable.result_id, variable.operands.first())
            else {
                continue;
            };
            let pointee = variable.result_type.map_or(0, |ty| self.edit.operand(ty, 1));
            let (ty, binding) = match (sets.get(&id), bindings.get(&id)) {
                (Some(0), Some(&binding)) => (pointee, Some(binding)),
                (Some(1), _) if self.edit.is(pointee, Op::TypeRuntimeArray) => {
                    (self.edit.operand(pointee, 0), None)
                }
                _ => continue,
            };
            let again = binding.is_none()
                && (!self.is_words(ty)
                    || !read_only.contains(&ty)
                    || found.iter().any(|block| block.binding.is_none()));
            // Numbers of less than 32 bits would need capabilities that the module may not have.
            let narrow = self.scalar_bytes(ty).0 < 4;
            if !again && !narrow && self.only_memory(id) {
                found.push(Block { variable: id, ty, binding, pointer: 0, member: 0, table: None });
            }
        }
        // The table comes last.
        found.sort_by_key(|block| (block.binding.is_none(), block.binding));
        found
    }

    /// Whether a struct is nothing but a run-time array of unsigned words.
    fn is_words(&self, ty: Word) -> bool {
        let array = self.edit.operand(ty, 0);
        let one = self.edit.globals.get(&ty).is_some_and(|i| i.operands.len() == 1);
        one && self.edit.is(array, Op::TypeRuntimeArray)
            && self.edit.operand(array, 0) == self.edit.uint
    }

    /// Whether nothing but loads, stores and atomics is done with what chains from `variable` point to.
    fn only_memory(&self, variable: Word) -> bool {
        let mut pointers = HashSet::from([variable]);
        for i in self.edit.instructions() {
            let Some(at) = i
                .operands
                .iter()
                .position(|o| matches!(o, Operand::IdRef(id) if pointers.contains(id)))
            else {
                continue;
            };
            let whole = is(&i.operands[0], variable);
            match (i.class.opcode, i.result_id) {
                (Op::AccessChain | Op::InBoundsAccessChain, Some(result)) if at == 0 => {
                    pointers.insert(result);
                }
                (Op::Load, _) if i.operands.len() == 1 && !whole => {}
                (Op::Store, _) if i.operands.len() == 2 && at == 0 && !whole => {}
                (op, _) if at == 0 && !whole && format!("{op:?}").starts_with("Atomic") => {}
                _ => return false,
            }
        }
        true
    }

    /// Declares pointers and the block of addresses, whose variable is returned.
    fn declare(&mut self, blocks: &mut [Block], binding: u32) -> Word {
        self.edit.module.capabilities.push(Instruction::new(
            Op::Capability,
            None,
            None,
            vec![Operand::Capability(Capability::PhysicalStorageBufferAddresses)],
        ));
        if let Some(model) = &mut self.edit.module.memory_model {
            model.operands[0] = Operand::AddressingModel(AddressingModel::PhysicalStorageBuffer64);
        }
        let mut members = Vec::new();
        for (n, block) in blocks.iter_mut().enumerate() {
            block.member = self.edit.constant(n as u32);
            block.pointer = self.edit.pointer(StorageClass::PhysicalStorageBuffer, block.ty);
            let mut member = block.pointer;
            if block.binding.is_none() {
                let array = self.edit.global(
                    Op::TypeRuntimeArray,
                    None,
                    vec![Operand::IdRef(block.pointer)],
                );
                self.edit.decorate(
                    Op::Decorate,
                    vec![Operand::IdRef(array)],
                    Decoration::ArrayStride,
                    &[ADDRESS_BYTES],
                );
                let table = self.edit.global(Op::TypeStruct, None, vec![Operand::IdRef(array)]);
                self.edit.decorate(
                    Op::Decorate,
                    vec![Operand::IdRef(table)],
                    Decoration::Block,
                    &[],
                );
                let first = || vec![Operand::IdRef(table), Operand::LiteralBit32(0)];
                self.edit.decorate(Op::MemberDecorate, first(), Decoration::Offset, &[0]);
                self.edit.decorate(Op::MemberDecorate, first(), Decoration::NonWritable, &[]);
                member = self.edit.pointer(StorageClass::PhysicalStorageBuffer, table);
                let one = self.edit.pointer(StorageClass::PhysicalStorageBuffer, block.pointer);
                block.table = Some((member, one));
            }
            members.push(Operand::IdRef(member));
        }
        let count = members.len() as u32;
        let ty = self.edit.global(Op::TypeStruct, None, members);
        self.edit.decorate(Op::Decorate, vec![Operand::IdRef(ty)], Decoration::Block, &[]);
        for n in 0..count {
            let member = vec![Operand::IdRef(ty), Operand::LiteralBit32(n)];
            self.edit.decorate(
                Op::MemberDecorate,
                member,
                Decoration::Offset,
                &[n * ADDRESS_BYTES],
            );
        }
        let pointer = self.edit.pointer(StorageClass::Uniform, ty);
        let class = vec![Operand::StorageClass(StorageClass::Uniform)];
        let variable = self.edit.global(Op::Variable, Some(pointer), class);
        for (decoration, value) in [(Decoration::DescriptorSet, 0), (Decoration::Binding, binding)]
        {
            self.edit.decorate(Op::Decorate, vec![Operand::IdRef(variable)], decoration, &[value]);
        }
        for entry in &mut self.edit.module.entry_points {
            entry.operands.push(Operand::IdRef(variable));
        }
        variable
    }

    /// Makes chains begin at addresses, and loads say how they are aligned.
    fn rewrite(&mut self, blocks: &[Block], addresses: Word) {
        let blocks: HashMap<Word, &Block> = blocks.iter().map(|b| (b.variable, b)).collect();
        // Pointer types by their pointees, and the types that chains result in.
        let mut pointers: HashMap<Word, Word> = HashMap::new();
        let mut uniform: HashMap<Word, Word> = HashMap::new();
        let mut chains: HashMap<Word, Place> = HashMap::new();
        let layout = Layout::new(self);
        let mut functions = std::mem::take(&mut self.edit.module.functions);
        for block in functions.iter_mut().flat_map(|f| &mut f.blocks) {
            let mut code = Vec::with_capacity(block.instructions.len());
            for mut i in std::mem::take(&mut block.instructions) {
                let base = match i.operands.first() {
                    Some(&Operand::IdRef(base)) => base,
                    _ => 0,
                };
                let is_chain = matches!(i.class.opcode, Op::AccessChain | Op::InBoundsAccessChain);
                if is_chain && (blocks.contains_key(&base) || chains.contains_key(&base)) {
                    let pointee = i.result_type.map_or(0, |ty| self.edit.operand(ty, 1));
                    let class = StorageClass::PhysicalStorageBuffer;
                    let pointer = *pointers
                        .entry(pointee)
                        .or_insert_with(|| self.edit.pointer(class, pointee));
                    i.result_type = Some(pointer);
                    let start = if let Some(block) = blocks.get(&base) {
                        let slot = block.table.map(|_| i.operands.remove(1));
                        let address = self.address(block, addresses, slot, &mut uniform, &mut code);
                        i.operands[0] = Operand::IdRef(address);
                        Rewriter::block_start(block.ty, block.table.is_some())
                    } else {
                        chains[&base]
                    };
                    let place = self.place(&layout, start, &i.operands[1..]);
                    chains.extend(i.result_id.map(|id| (id, place)));
                } else if let (Op::Load | Op::Store, Some(&place)) =
                    (i.class.opcode, chains.get(&base))
                {
                    if self.by_pairs(&i, place, &mut code) {
                        continue;
                    }
                    i.operands.extend(aligned(self.scalar_bytes(place.ty).1));
                }
                code.push(i);
            }
            block.instructions = code;
        }
        self.edit.module.functions = functions;
        // An address is an address, whatever lanes hold.
        self.edit.module.annotations.retain(|i| match i.operands.as_slice() {
            [Operand::IdRef(id), Operand::Decoration(Decoration::NonUniform)] => {
                !chains.contains_key(id)
            }
            _ => true,
        });
    }

    /// Loads the address of a block, of the table's the one in `slot`.
    fn address(
        &mut self,
        block: &Block,
        addresses: Word,
        slot: Option<Operand>,
        uniform: &mut HashMap<Word, Word>,
        code: &mut Vec<Instruction>,
    ) -> Word {
        let mut emit = |rewriter: &mut Self, op, ty, operands| {
            let id = rewriter.edit.id();
            code.push(Instruction::new(op, Some(ty), Some(id), operands));
            id
        };
        let ty = block.table.map_or(block.pointer, |(table, _)| table);
        let pointer =
            *uniform.entry(ty).or_insert_with(|| self.edit.pointer(StorageClass::Uniform, ty));
        let operands = vec![Operand::IdRef(addresses), Operand::IdRef(block.member)];
        let member = emit(self, Op::AccessChain, pointer, operands);
        let address = emit(self, Op::Load, ty, vec![Operand::IdRef(member)]);
        let (Some((_, one)), Some(slot)) = (block.table, slot) else { return address };
        let first = self.edit.constant(0);
        let operands = vec![Operand::IdRef(address), Operand::IdRef(first), slot];
        let place = emit(self, Op::AccessChain, one, operands);
        let [align, bytes] = aligned(ADDRESS_BYTES);
        emit(self, Op::Load, block.pointer, vec![Operand::IdRef(place), align, bytes])
    }

    /// Removes the variables that were replaced.
    fn remove(&mut self, blocks: &[Block]) {
        let gone: HashSet<Word> = blocks.iter().map(|block| block.variable).collect();
        let stays = |i: &Instruction| match i.operands.first() {
            Some(Operand::IdRef(id)) => !gone.contains(id),
            _ => true,
        };
        self.edit.module.annotations.retain(stays);
        self.edit.module.debug_names.retain(stays);
        let declared = |i: &Instruction| i.result_id.is_none_or(|id| !gone.contains(&id));
        self.edit.module.types_global_values.retain(declared);
        for entry in &mut self.edit.module.entry_points {
            entry.operands.retain(|o| !matches!(o, Operand::IdRef(id) if gone.contains(id)));
        }
    }
}

fn is(operand: &Operand, id: Word) -> bool {
    *operand == Operand::IdRef(id)
}

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests {
    use super::*;
    use crate::{
        prebuilt,
        shader::testing::{complaint, kernel},
    };

    #[test]
    fn every_kernel_stays_valid() {
        for (_, _, words) in prebuilt::KERNELS {
            let Some(addressed) = lower(words, true).unwrap() else { continue };
            assert_eq!(complaint(&addressed.spirv), None);
            assert!(lower(&addressed.spirv, true).unwrap().is_none(), "nothing is left to replace");
        }
        let shade = lower(prebuilt::SHADE, true).unwrap().unwrap();
        assert!(shade.table && !shade.uses_table && shade.blocks.len() >= 5);
    }

    #[test]
    fn what_is_done_with_a_block_decides() {
        let words = kernel(
            "#version 460
             #extension GL_EXT_scalar_block_layout : require
             #extension GL_EXT_shader_explicit_arithmetic_types_int64 : require
             #extension GL_EXT_shader_16bit_storage : require
             #extension GL_EXT_nonuniform_qualifier : require
             layout(local_size_x = 64) in;
             struct Mixed { uint narrow; uint64_t wide; };
             layout(binding = 0) readonly buffer Read { uvec3 read[]; };
             layout(binding = 1, scalar) buffer Wide { Mixed mixed[]; };
             layout(binding = 2) buffer Written { uint written[]; };
             layout(binding = 3) readonly buffer Measured { uint measured[]; };
             layout(binding = 4) buffer Counted { uint counted[]; };
             layout(binding = 5) uniform Uniform { uint constant; };
             layout(binding = 6) readonly buffer Halves { uint16_t halves[]; };
             layout(set = 1, binding = 4) buffer Words { uint words[]; } table[];
             void main() {
                 uint i = gl_GlobalInvocationID.x;
                 written[i] += read[i].y + measured[measured.length() - 1] + constant;
                 mixed[i].wide += 1ul;
                 mixed[i].narrow = atomicAdd(counted[i], 1u) + uint(halves[i]);
                 table[nonuniformEXT(i)].words[0] = 1u;
             }",
        );
        let addressed = lower(&words, true).unwrap().unwrap();
        assert_eq!((addressed.binding, addressed.blocks), (7, vec![0, 1, 2, 4]));
        assert!(!addressed.table && addressed.uses_table, "a table that is written stays");
        assert_eq!(complaint(&addressed.spirv), None);
    }

    #[test]
    fn what_is_no_module_is_refused() {
        assert!(lower(&[1, 2, 3], true).is_err());
    }
}
