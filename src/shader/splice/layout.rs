//! Where the values of a block lie, by the decorations of its types.

use super::linker::Linker;
use rspirv::{
    dr::Operand,
    spirv::{Decoration, Op, Word},
};
use std::collections::HashMap;

/// Decorations of block types, and of their members.
pub(super) struct Layouts {
    found: HashMap<(Word, Option<u32>, Decoration), u32>,
}

/// A value in a block: where it begins and how its parts follow.
#[derive(Clone, Copy)]
struct At {
    byte: u32,
    ty: Word,
    /// Of a matrix, or an array of them: bytes between columns, or rows if it is row-major.
    matrix: Option<(u32, bool)>,
    /// Bytes between the components of a vector.
    step: u32,
}

impl Layouts {
    pub fn new(linker: &Linker) -> Self {
        let mut found = HashMap::new();
        for i in &linker.module.annotations {
            let (target, member, rest) = match (i.class.opcode, i.operands.as_slice()) {
                (Op::Decorate, [Operand::IdRef(target), rest @ ..]) => (*target, None, rest),
                (
                    Op::MemberDecorate,
                    [Operand::IdRef(target), Operand::LiteralBit32(member), rest @ ..],
                ) => (*target, Some(*member), rest),
                _ => continue,
            };
            let value = match rest {
                [Operand::Decoration(d), Operand::LiteralBit32(value)] => (*d, *value),
                [Operand::Decoration(d)] => (*d, 1),
                _ => continue,
            };
            found.insert((target, member, value.0), value.1);
        }
        Self { found }
    }

    fn of(&self, ty: Word, member: Option<u32>, decoration: Decoration) -> Option<u32> {
        self.found.get(&(ty, member, decoration)).copied()
    }

    /// The word of each scalar of the part of a block of type `block` that constant `indices` select, in
    /// the order of a composite of them; none if that cannot be told.
    pub fn words(&self, linker: &Linker, block: Word, indices: &[Word]) -> Option<Vec<u32>> {
        let mut at = At { byte: 0, ty: block, matrix: None, step: 4 };
        for &index in indices {
            let index = match linker.global(index).ok()?.operands.as_slice() {
                [Operand::LiteralBit32(index)] => *index,
                _ => return None,
            };
            at = self.part(linker, at, index)?;
        }
        let mut words = Vec::new();
        self.scalars(linker, at, &mut words)?;
        Some(words)
    }

    fn part(&self, linker: &Linker, at: At, index: u32) -> Option<At> {
        let ty = linker.global(at.ty).ok()?;
        let operand = |n: usize| ty.operands.get(n).and_then(Operand::id_ref_any);
        match ty.class.opcode {
            Op::TypeStruct => {
                let of = |decoration| self.of(at.ty, Some(index), decoration);
                let stride = of(Decoration::MatrixStride);
                let row_major = of(Decoration::RowMajor).is_some();
                Some(At {
                    byte: at.byte + of(Decoration::Offset)?,
                    ty: operand(index as usize)?,
                    matrix: stride.map(|stride| (stride, row_major)),
                    step: 4,
                })
            }
            Op::TypeArray => {
                let stride = self.of(at.ty, None, Decoration::ArrayStride)?;
                let byte = at.byte.checked_add(stride.checked_mul(index)?)?;
                Some(At { byte, ty: operand(0)?, ..at })
            }
            Op::TypeMatrix => {
                let (stride, row_major) = at.matrix?;
                let (column, step) = if row_major { (4, stride) } else { (stride, 4) };
                Some(At { byte: at.byte + column * index, ty: operand(0)?, matrix: None, step })
            }
            Op::TypeVector => Some(At { byte: at.byte + at.step * index, ty: operand(0)?, ..at }),
            _ => None,
        }
    }

    fn scalars(&self, linker: &Linker, at: At, words: &mut Vec<u32>) -> Option<()> {
        let ty = linker.global(at.ty).ok()?;
        match (ty.class.opcode, ty.operands.get(1)) {
            (Op::TypeVector | Op::TypeMatrix, Some(&Operand::LiteralBit32(count))) => {
                (0..count).try_for_each(|n| self.scalars(linker, self.part(linker, at, n)?, words))
            }
            _ if at.byte.is_multiple_of(4) => {
                words.push(at.byte / 4);
                Some(())
            }
            _ => None,
        }
    }
}
