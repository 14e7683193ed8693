//! Where the values of a block lie, by the decorations of its types.

use super::{
    interface,
    module::{Index, Outcome, ids},
};
use rspirv::spirv::{Decoration, Op, Word};
use std::collections::HashMap;

/// A value in a block: where it begins and how its parts follow.
#[derive(Clone, Copy)]
struct At {
    byte: u32,
    ty: Word,
    /// A matrix or an array of matrices: bytes between columns, or between rows if it is row-major.
    matrix: Option<(u32, bool)>,
    /// Bytes between the components of a vector, where its matrix decides them.
    step: Option<u32>,
}

/// Sizes by type and by what a value's surroundings say of it.
type Sizes = HashMap<(Word, Option<(u32, bool)>, Option<u32>), u32>;

impl At {
    fn begin(block: Word) -> Self {
        Self { byte: 0, ty: block, matrix: None, step: None }
    }

    /// Part `n` of this value, which is no scalar.
    fn part(self, index: &Index, n: u32) -> Outcome<At> {
        let next = |ty: Word, stride: u32| {
            let byte = stride.checked_mul(n).and_then(|bytes| self.byte.checked_add(bytes));
            let byte = byte.ok_or("a block of more than 2^32 bytes")?;
            Ok(At { byte, ty, ..self })
        };
        match index.op(self.ty)? {
            Op::TypeStruct => {
                let of = |decoration| index.member_literal(self.ty, n, decoration);
                let offset = of(Decoration::Offset).ok_or("a block without offsets")?;
                let row_major = index.member_has(self.ty, n, Decoration::RowMajor);
                let byte =
                    self.byte.checked_add(offset).ok_or("a block of more than 2^32 bytes")?;
                let ty = index.id_operand(self.ty, n as usize)?;
                let matrix = of(Decoration::MatrixStride).map(|stride| (stride, row_major));
                Ok(At { byte, ty, matrix, step: None })
            }
            Op::TypeArray | Op::TypeRuntimeArray => {
                let stride = index.literal(self.ty, Decoration::ArrayStride);
                next(index.id_operand(self.ty, 0)?, stride.ok_or("an array without stride")?)
            }
            Op::TypeMatrix => {
                let column = index.id_operand(self.ty, 0)?;
                let component = bytes_of_scalar(index, index.id_operand(column, 0)?)?;
                let (stride, row_major) = self.matrix.ok_or("a matrix without stride")?;
                let (between, step) =
                    if row_major { (component, Some(stride)) } else { (stride, None) };
                Ok(At { step, matrix: None, ..next(column, between)? })
            }
            Op::TypeVector => {
                let component = index.id_operand(self.ty, 0)?;
                let step = self.step.map_or_else(|| bytes_of_scalar(index, component), Ok)?;
                Ok(At { step: None, ..next(component, step)? })
            }
            other => Err(format!("a block member of Op{other:?}")),
        }
    }

    /// How many parts this value has, one if only run time knows; nothing if it is a scalar.
    fn parts(self, index: &Index) -> Outcome<Option<u32>> {
        Ok(Some(match index.op(self.ty)? {
            Op::TypeStruct => ids(index.def(self.ty)?).count() as u32,
            Op::TypeArray => interface::length(index, index.id_operand(self.ty, 1)?, &[])?,
            Op::TypeRuntimeArray => 1,
            Op::TypeMatrix | Op::TypeVector => index.number(self.ty, 1)?,
            _ => return Ok(None),
        }))
    }

    /// The byte after this value. `sizes` holds what is known: a type may be part of a block any number of
    /// times.
    fn end(self, index: &Index, sizes: &mut Sizes) -> Outcome<u32> {
        let key = (self.ty, self.matrix, self.step);
        let size = match sizes.get(&key) {
            Some(&size) => size,
            None => {
                let size = At { byte: 0, ..self }.size(index, sizes)?;
                sizes.insert(key, size);
                size
            }
        };
        self.byte.checked_add(size).ok_or_else(|| "a block of more than 2^32 bytes".into())
    }

    /// The bytes of this value, which begins at byte 0.
    fn size(self, index: &Index, sizes: &mut Sizes) -> Outcome<u32> {
        let Some(count) = self.parts(index)? else { return bytes_of_scalar(index, self.ty) };
        // If the parts are equal, the last one ends last; this holds for row-major columns too.
        let first = match index.op(self.ty)? {
            Op::TypeStruct => 0,
            _ => count.saturating_sub(1),
        };
        (first..count).try_fold(0, |end, n| Ok(end.max(self.part(index, n)?.end(index, sizes)?)))
    }

    fn scalars(self, index: &Index, words: &mut Vec<u32>) -> Outcome<()> {
        match self.parts(index)? {
            Some(count) => (0..count).try_for_each(|n| self.part(index, n)?.scalars(index, words)),
            None if self.byte.is_multiple_of(4) => {
                words.push(self.byte / 4);
                Ok(())
            }
            None => Err("a value between words".into()),
        }
    }
}

fn bytes_of_scalar(index: &Index, ty: Word) -> Outcome<u32> {
    match index.op(ty)? {
        Op::TypeInt | Op::TypeFloat => Ok(index.number(ty, 0)? / 8),
        Op::TypePointer => Ok(8),
        other => Err(format!("a block member of Op{other:?}")),
    }
}

/// Bytes of a block: where the member that reaches furthest ends. A run-time array counts as one
/// element.
pub(super) fn bytes(index: &Index, block: Word) -> Outcome<u32> {
    At::begin(block).end(index, &mut Sizes::new())
}

/// The word of each scalar of the part of a block of type `block` that constant `indices` select, in
/// the order of a composite of them.
pub(super) fn words(index: &Index, block: Word, indices: &[Word]) -> Outcome<Vec<u32>> {
    let mut at = At::begin(block);
    for &n in indices {
        at = at.part(index, index.constant(n)?)?;
    }
    let mut words = Vec::new();
    at.scalars(index, &mut words)?;
    Ok(words)
}

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests {
    use super::*;
    use crate::shader::{Shader, Stage, module};

    #[test]
    fn words_follow_offsets_strides_and_rows() {
        let shader = Shader::from_glsl(
            Stage::Fragment,
            "test.frag",
            "#version 460
             struct Light { vec3 at; float range; };
             layout(binding = 0) uniform Block {
                 float first;
                 layout(row_major) mat2x3 rows;
                 mat3x2 columns[2];
                 Light lights[2];
             } block;
             layout(location = 0) out vec4 color;
             void main() {
                 mat3x2 m = block.columns[1];
                 color = vec4(block.rows[1] + block.lights[1].at, block.lights[1].range);
                 color.xy += m[0] + m[1] * block.first;
             }",
        );
        let module = module::parse(&shader.unwrap().spirv).unwrap();
        let index = Index::new(&module);
        let chains = module.all_inst_iter().filter(|i| i.class.opcode == Op::AccessChain);
        let mut found = Vec::new();
        for chain in chains {
            let operands: Vec<Word> = ids(chain).collect();
            let (_, block) = index.pointer(index.type_of(operands[0]).unwrap()).unwrap();
            if index.op(block) != Ok(Op::TypeStruct) {
                continue;
            }
            assert_eq!(bytes(&index, block), Ok(192));
            found.push(words(&index, block, &operands[1..]).unwrap());
        }
        found.sort();
        // Of std140: rows at byte 16, 16 apart; columns at 64, 48 apart; lights at 160, 16 apart.
        let expected: [&[u32]; 5] =
            [&[0], &[5, 9, 13], &[28, 29, 32, 33, 36, 37], &[44, 45, 46], &[47]];
        assert_eq!(found, expected);
    }
}
