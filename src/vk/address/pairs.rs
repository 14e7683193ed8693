//! Which loads and stores of a kernel take their words two at a time, and how.
//!
//! A vector of two or four words is loaded and stored as one or two 64-bit integers wherever it provably
//! lies at a multiple of 8 bytes. A CPU driver reads memory lane by lane, and eight bytes cost it as much
//! as four do.
//!
//! The proof follows the chain from its block: a block begins at a multiple of [`BLOCK_BYTES`], and each
//! step to a member or an element adds a known offset or a multiple of a known stride. The largest
//! power of two that divides all of them divides the address.

use super::{ADDRESS_BYTES, Rewriter};
use rspirv::{
    dr::{Instruction, Operand},
    spirv::{Capability, Decoration, MemoryAccess, Op, StorageClass, Word},
};
use std::collections::HashMap;

/// Where a chain points.
#[derive(Clone, Copy)]
pub(super) struct Place {
    /// The type there.
    pub ty: Word,
    /// A power of two that divides the address.
    pub multiple: u32,
}

/// Bytes of a pair of words, which is also how it is aligned.
const PAIR_BYTES: u32 = 8;

/// Addresses of blocks are multiples of this, which recording sees to.
pub(in crate::vk) const BLOCK_BYTES: u64 = PAIR_BYTES as u64;

/// Buffers of the resource table may begin at any word.
const TABLE_BUFFER_BYTES: u32 = 4;

/// The layout that a module gives its types.
pub(super) struct Layout {
    /// Bytes from the start of a struct to a member.
    offsets: HashMap<(Word, u32), u32>,
    /// Bytes from one element of an array to the next.
    strides: HashMap<Word, u32>,
}

impl Layout {
    pub fn new(rewriter: &Rewriter) -> Self {
        let member = |i: &Instruction| match i.operands.as_slice() {
            &[
                Operand::IdRef(ty),
                Operand::LiteralBit32(member),
                Operand::Decoration(Decoration::Offset),
                Operand::LiteralBit32(bytes),
            ] => Some(((ty, member), bytes)),
            _ => None,
        };
        Self {
            offsets: rewriter.edit.module.annotations.iter().filter_map(member).collect(),
            strides: rewriter.edit.decorations(Decoration::ArrayStride),
        }
    }
}

impl Rewriter {
    /// The start of a block of type `ty`, or of a buffer of the resource table.
    pub(super) fn block_start(ty: Word, of_table: bool) -> Place {
        Place { ty, multiple: if of_table { TABLE_BUFFER_BYTES } else { PAIR_BYTES } }
    }

    /// Where `indices` lead from `place`.
    pub(super) fn place(&self, layout: &Layout, mut place: Place, indices: &[Operand]) -> Place {
        for index in indices.iter().filter_map(Operand::id_ref_any) {
            let ty = self.edit.globals.get(&place.ty).map(|ty| ty.class.opcode);
            let number = self.edit.number(index);
            let (bytes, next) = match (ty, number) {
                (Some(Op::TypeStruct), Some(n)) => (
                    layout.offsets.get(&(place.ty, n)).copied(),
                    self.edit.operand(place.ty, n as usize),
                ),
                // An element that is known lies at an offset, any other at some multiple of the stride.
                (Some(Op::TypeArray | Op::TypeRuntimeArray), n) => {
                    let stride = layout.strides.get(&place.ty);
                    let bytes = stride.map(|&stride| stride.wrapping_mul(n.unwrap_or(1)));
                    (bytes, self.edit.operand(place.ty, 0))
                }
                (Some(Op::TypeVector), n) => {
                    let part = self.edit.operand(place.ty, 0);
                    (Some(self.scalar_bytes(part).0.wrapping_mul(n.unwrap_or(1))), part)
                }
                // A matrix may be stored by rows or by columns.
                _ => (None, self.edit.operand(place.ty, 0)),
            };
            let divides =
                |bytes: u32| if bytes == 0 { u32::MAX } else { bytes & bytes.wrapping_neg() };
            place = Place { ty: next, multiple: place.multiple.min(divides(bytes.unwrap_or(1))) };
        }
        place
    }

    /// Bytes of the smallest and the largest scalar of a type. Values lie at multiples of the latter:
    /// layouts may be scalar.
    pub(super) fn scalar_bytes(&self, ty: Word) -> (u32, u32) {
        let Some(i) = self.edit.globals.get(&ty) else { return (0, 1) };
        let parts = match (i.class.opcode, i.operands.first()) {
            (Op::TypeInt | Op::TypeFloat, Some(&Operand::LiteralBit32(bits))) => {
                return (bits / 8, bits / 8);
            }
            (Op::TypePointer, _) => return (ADDRESS_BYTES, ADDRESS_BYTES),
            (Op::TypeStruct, _) => &i.operands[..],
            _ => &i.operands[..1],
        };
        let parts =
            parts.iter().filter_map(Operand::id_ref_any).map(|part| self.scalar_bytes(part));
        parts.fold((ADDRESS_BYTES, 1), |all, part| (all.0.min(part.0), all.1.max(part.1)))
    }

    /// The pairs of a vector of two or four words.
    fn pairs_of(&self, ty: Word) -> Option<u32> {
        let i = self.edit.globals.get(&ty).filter(|i| i.class.opcode == Op::TypeVector)?;
        match i.operands.as_slice() {
            &[Operand::IdRef(part), Operand::LiteralBit32(n)] => {
                let words = self.scalar_bytes(part) == (4, 4);
                (words && n.is_multiple_of(2)).then_some(n / 2)
            }
            _ => None,
        }
    }

    /// The load or store `i`, which accesses `place`, by pairs: false if it is none that can be, and stays.
    pub(super) fn by_pairs(
        &mut self,
        i: &Instruction,
        place: Place,
        code: &mut Vec<Instruction>,
    ) -> bool {
        let Some(pairs) =
            self.pairs_of(place.ty).filter(|_| self.has_int64 && place.multiple >= PAIR_BYTES)
        else {
            return false;
        };
        let (pointer, ty) = self.pair_types(pairs);
        let cast = self.edit.id();
        let place = i.operands[0].clone();
        code.push(Instruction::new(Op::Bitcast, Some(pointer), Some(cast), vec![place]));
        let [access, bytes] = aligned(PAIR_BYTES);
        let value = self.edit.id();
        if i.class.opcode == Op::Load {
            let operands = vec![Operand::IdRef(cast), access, bytes];
            code.push(Instruction::new(Op::Load, Some(ty), Some(value), operands));
            let operands = vec![Operand::IdRef(value)];
            code.push(Instruction::new(Op::Bitcast, i.result_type, i.result_id, operands));
        } else {
            let operands = vec![i.operands[1].clone()];
            code.push(Instruction::new(Op::Bitcast, Some(ty), Some(value), operands));
            let operands = vec![Operand::IdRef(cast), Operand::IdRef(value), access, bytes];
            code.push(Instruction::new(Op::Store, None, None, operands));
        }
        true
    }

    /// The types of a pointer to one or two 64-bit integers by address, and of these, declared once.
    fn pair_types(&mut self, pairs: u32) -> (Word, Word) {
        if let Some(&known) = self.pair_types.get(&pairs) {
            return known;
        }
        let ty = if pairs == 1 {
            self.int64()
        } else {
            let part = self.pair_types(1).1;
            self.edit
                .declared(Op::TypeVector, vec![Operand::IdRef(part), Operand::LiteralBit32(pairs)])
        };
        let types = (self.edit.pointer(StorageClass::PhysicalStorageBuffer, ty), ty);
        self.pair_types.insert(pairs, types);
        types
    }

    /// The type of a 64-bit unsigned integer, with the capability for it.
    fn int64(&mut self) -> Word {
        let capability = Operand::Capability(Capability::Int64);
        let has = self.edit.module.capabilities.iter().any(|i| i.operands[0] == capability);
        if !has {
            let declaration = Instruction::new(Op::Capability, None, None, vec![capability]);
            self.edit.module.capabilities.push(declaration);
        }
        self.edit.declared(Op::TypeInt, vec![Operand::LiteralBit32(64), Operand::LiteralBit32(0)])
    }
}

/// The operands of a load or a store that say how it is aligned.
pub(super) fn aligned(bytes: u32) -> [Operand; 2] {
    [Operand::MemoryAccess(MemoryAccess::ALIGNED), Operand::LiteralBit32(bytes)]
}

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests {
    use super::super::{Addressed, lower};
    use crate::{
        prebuilt,
        shader::testing::{complaint, kernel},
    };
    use rspirv::{
        dr::{self, Operand},
        spirv::{Capability, Op},
    };

    /// Loads and stores that are aligned to 8 bytes, and all others by address.
    fn accesses(addressed: &Addressed) -> (usize, usize) {
        let module = dr::load_words(&addressed.spirv).unwrap();
        let mut found = (0, 0);
        for i in module.all_inst_iter() {
            let wide = match (i.class.opcode, i.operands.as_slice()) {
                (Op::Load, [_, _, Operand::LiteralBit32(bytes)]) => *bytes == 8,
                (Op::Store, [_, _, _, Operand::LiteralBit32(bytes)]) => *bytes == 8,
                _ => continue,
            };
            if wide { found.0 += 1 } else { found.1 += 1 }
        }
        found
    }

    fn has_int64(addressed: &Addressed) -> bool {
        let module = dr::load_words(&addressed.spirv).unwrap();
        module.capabilities.iter().any(|i| i.operands[0] == Operand::Capability(Capability::Int64))
    }

    /// The kernel whose `main` has `body` and whose first block holds `members`.
    fn lowered(block: &str, body: &str) -> Addressed {
        let words = kernel(&format!(
            "#version 460
             #extension GL_EXT_scalar_block_layout : require
             layout(local_size_x = 64) in;
             layout(constant_id = 3) const uint SPECIAL = 2u;
             struct Three {{ uvec2 a; uint b; }};
             struct Odd {{ uint numbers[41]; }};
             struct Even {{ uvec4 first; vec2 second; uvec2 third; }};
             struct Late {{ uint before; uvec4 words; uvec2 more; uint after; }};
             layout(binding = 0, scalar) buffer Block {{ {block} }};
             layout(binding = 1, scalar) buffer Sink {{ uint sink[]; }};
             void main() {{ uint i = gl_GlobalInvocationID.x; {body} }}"
        ));
        let addressed = lower(&words, true).unwrap().unwrap();
        assert_eq!(complaint(&addressed.spirv), None, "{block} {body}");
        let plain = lower(&words, false).unwrap().unwrap();
        assert_eq!(complaint(&plain.spirv), None, "{block} {body}");
        assert_eq!(accesses(&plain).0, 0, "without 64-bit integers all stays as it is");
        assert!(!has_int64(&plain));
        addressed
    }

    #[test]
    fn vectors_at_multiples_of_eight_bytes_are_taken_by_pairs() {
        for (block, body, wide) in [
            ("uvec4 v[];", "sink[i] = v[i].x + v[i].w; v[i] = uvec4(i);", 1),
            ("uvec4 v[];", "uvec4 w = v[i]; sink[i] = w.x + w.w;", 1),
            ("vec2 v[];", "v[i] = v[i + 1u] * 2.0;", 2),
            ("ivec4 v[];", "v[i] = v[i + 1u] * 2;", 2),
            ("uvec4 v[][3];", "v[i][1] = v[i + 1u][SPECIAL];", 2),
            ("Even v[];", "v[i].first = v[i + 1u].first; v[i].second *= 2.0; v[i].third += 1u;", 6),
            // 44 bytes before it, and 4: a member that lies right makes up for neither.
            ("Late v[];", "v[i].words += 1u; v[i].more += 1u;", 0),
            ("uint before; uvec4 v[];", "v[i] += 1u;", 0),
            ("uvec2 before; uvec4 v[];", "v[i] += 1u;", 2),
            // 164 bytes an element.
            ("Odd before; uvec4 v[];", "v[i] += 1u;", 0),
            ("uvec3 v[];", "v[i] += 1u;", 0),
            ("uvec4 v[];", "v[i].y += 1u;", 0),
            ("uint v[];", "v[i] += 1u;", 0),
            // A known element lies where it lies, and one that is computed anywhere.
            ("Three v[];", "v[2].a += 1u;", 2),
            ("Three v[];", "v[1].a += 1u;", 0),
            ("Three v[];", "v[i].a += 1u;", 0),
        ] {
            let addressed = lowered(block, body);
            assert_eq!(accesses(&addressed).0, wide, "{block} {body}");
            assert_eq!(has_int64(&addressed), wide > 0, "{block} {body}");
        }
    }

    #[test]
    fn kernels_take_vectors_by_pairs_where_that_is_proven() {
        let mut wide = 0;
        for (_, _, words) in prebuilt::KERNELS {
            let Some(addressed) = lower(words, true).unwrap() else { continue };
            assert_eq!(complaint(&addressed.spirv), None);
            wide += accesses(&addressed).0;
        }
        assert!(wide > 20, "{wide}");
    }
}
