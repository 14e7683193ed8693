//! Resources become elements of the engine's table.
//!
//! All resources of all draws live in descriptor set 1, one run-time array per kind. The user's
//! variable keeps its place in the code and becomes a variable of such an array; each use selects
//! the element of the current draw, `table[tw_resource(i) + index]`, where `index` is the user's own
//! index into an array of resources, flattened, and never beyond the last element that the draw binds: what
//! follows in the table is another resource. The call is made when the kernel binds a draw. Several variables
//! may share a binding of the table, each with its own type.
//!
//! Lanes of one subgroup may belong to different draws, so every access is marked as non-uniform (see
//! [`super::nonuniform`]).

use super::linker::{Code, Linker, id};
use crate::shader::{
    ResourceKind,
    module::{Index, Outcome},
};
use rspirv::{
    dr::{Block, Function, Instruction, Operand},
    spirv::{Capability, Decoration, Dim, GlslStd450Op, Op, StorageClass, Word},
};
use std::collections::HashMap;

/// The descriptor set of the table.
pub(super) const SET: u32 = 1;

/// A variable of the table.
pub(super) struct Element {
    /// Its place in the shader's list of resources; the push-constant block comes last.
    pub number: u32,
    /// Place of its last element's number in the draw's list, if it is an array.
    pub last: Option<u32>,
    /// Binding in the table's set.
    binding: u32,
    class: StorageClass,
    /// Type of one resource.
    ty: Word,
    /// Lengths of the user's arrays, outermost first; the outermost may be unknown.
    lengths: Vec<Option<Word>>,
    /// Blocks that were uniform or push-constant blocks.
    read_only: bool,
}

/// The table variable that replaces the user's variable, with the user's ids. `kind` is the kind of its resource,
/// `None` for the push-constant block.
pub(super) fn element(
    index: &Index,
    class: StorageClass,
    ty: Word,
    (number, last, kind): (u32, Option<u32>, Option<ResourceKind>),
) -> Outcome<Element> {
    let (mut lengths, mut element) = (Vec::new(), ty);
    loop {
        match index.op(element)? {
            Op::TypeArray => lengths.push(Some(index.id_operand(element, 1)?)),
            Op::TypeRuntimeArray => lengths.push(None),
            _ => break,
        }
        element = index.id_operand(element, 0)?;
    }
    let image = match index.op(element)? {
        Op::TypeSampledImage => Some(index.id_operand(element, 0)?),
        Op::TypeImage => Some(element),
        _ => None,
    };
    if let Some(image) = image
        && index.def(image)?.operands.get(1) == Some(&Operand::Dim(Dim::DimBuffer))
    {
        return Err("buffers as images (samplerBuffer, imageBuffer)".into());
    }
    let binding = match kind {
        Some(ResourceKind::Sampled) => 0,
        Some(ResourceKind::Texture) => 1,
        Some(ResourceKind::Sampler) => 2,
        Some(ResourceKind::StorageImage) => 3,
        Some(ResourceKind::Uniform | ResourceKind::Storage) | None => 4,
    };
    let class = if binding == 4 { StorageClass::StorageBuffer } else { class };
    let read_only = matches!(kind, Some(ResourceKind::Uniform) | None);
    // Another variable at the same place may be the array.
    let last = last.filter(|_| !lengths.is_empty());
    Ok(Element { number, last, binding, class, ty: element, lengths, read_only })
}

impl Element {
    /// The same with ids of the kernel.
    pub fn map_ids(mut self, mut new: impl FnMut(Word) -> Word) -> Self {
        self.ty = new(self.ty);
        for length in self.lengths.iter_mut().flatten() {
            *length = new(*length);
        }
        self
    }

    /// Declares the variable.
    pub fn declare(&self, linker: &mut Linker) -> Word {
        let table = linker.declare(Op::TypeRuntimeArray, None, vec![id(self.ty)]);
        let pointer = linker.pointer(self.class, table);
        let class = vec![Operand::StorageClass(self.class)];
        let variable = linker.declare_new(Op::Variable, Some(pointer), class);
        linker.decorate(variable, Decoration::DescriptorSet, &[SET]);
        linker.decorate(variable, Decoration::Binding, &[self.binding]);
        if self.read_only {
            linker.decorate(variable, Decoration::NonWritable, &[]);
        }
        variable
    }
}

/// The private variables that hold the place of a draw's resource in the table.
#[derive(Clone, Copy)]
pub(super) struct Span {
    /// The slot of its first element.
    pub first: Word,
    /// The number of its last element, if it is an array.
    pub last: Option<Word>,
}

/// Makes every use of a table variable a use of the draw's element. `spans` say where these are, in the
/// order of `elements`.
pub(super) fn lower(
    linker: &mut Linker,
    functions: &mut [Function],
    elements: &[(Word, Element)],
    spans: &[Span],
) -> Outcome<()> {
    let by_variable: HashMap<Word, (&Element, Span)> = (elements.iter().zip(spans))
        .map(|((variable, element), &span)| (*variable, (element, span)))
        .collect();
    for block in functions.iter_mut().flat_map(|f| &mut f.blocks) {
        lower_block(linker, block, &by_variable)?;
    }
    Ok(())
}

fn lower_block(
    linker: &mut Linker,
    block: &mut Block,
    elements: &HashMap<Word, (&Element, Span)>,
) -> Outcome<()> {
    let mut code = Code::new(linker);
    for mut instruction in std::mem::take(&mut block.instructions) {
        for at in 0..instruction.operands.len() {
            let Some(&Operand::IdRef(variable)) = instruction.operands.get(at) else { continue };
            let Some(&(element, span)) = elements.get(&variable) else { continue };
            let chain =
                matches!(instruction.class.opcode, Op::AccessChain | Op::InBoundsAccessChain);
            if chain && at == 0 {
                select(&mut code, &mut instruction, element, span)?;
            } else {
                let pointer = whole(&mut code, variable, element, span)?;
                instruction.operands[at] = id(pointer);
            }
        }
        code.instructions.push(instruction);
    }
    block.instructions = code.instructions;
    Ok(())
}

/// Turns the indices of an access chain that select a resource into one index of the table.
fn select(code: &mut Code, chain: &mut Instruction, element: &Element, span: Span) -> Outcome<()> {
    let depth = element.lengths.len();
    let Some(own) = chain.operands.get(1..1 + depth) else {
        return Err("a part of an array of arrays of resources as a value".into());
    };
    let own: Vec<Word> = own.iter().filter_map(Operand::id_ref_any).collect();
    let uint = code.linker.uint();
    let mut flat = None;
    for (n, &word) in own.iter().enumerate() {
        let word = as_uint(code, word)?;
        flat = Some(match (flat, element.lengths[n]) {
            (None, _) => word,
            (Some(outer), Some(length)) => {
                let length = as_uint(code, length)?;
                let rows = code.emit(Op::IMul, uint, vec![id(outer), id(length)]);
                code.emit(Op::IAdd, uint, vec![id(rows), id(word)])
            }
            (Some(_), None) => return Err("a run-time array inside an array of resources".into()),
        });
    }
    let mut slot = code.load(uint, span.first);
    if let Some((flat, last)) = flat.zip(span.last) {
        let last = code.load(uint, last);
        let set = code.linker.glsl_std();
        let least = Operand::LiteralExtInstInteger(GlslStd450Op::UMin as u32);
        let inside = code.emit(Op::ExtInst, uint, vec![id(set), least, id(flat), id(last)]);
        slot = code.emit(Op::IAdd, uint, vec![id(slot), id(inside)]);
    }
    chain.operands.splice(1..1 + depth, [id(slot)]);
    Ok(())
}

/// A pointer to the draw's element, for uses other than through an access chain.
fn whole(code: &mut Code, variable: Word, element: &Element, span: Span) -> Outcome<Word> {
    if !element.lengths.is_empty() {
        return Err("an array of resources as a value".into());
    }
    let uint = code.linker.uint();
    let slot = code.load(uint, span.first);
    let pointer = code.linker.pointer(element.class, element.ty);
    Ok(code.emit(Op::AccessChain, pointer, vec![id(variable), id(slot)]))
}

/// An index of any integer type as `uint`.
fn as_uint(code: &mut Code, value: Word) -> Outcome<Word> {
    let (uint, ty) = (code.linker.uint(), code.linker.type_of(value)?);
    let width = match code.linker.global(ty)?.operands.first() {
        Some(Operand::LiteralBit32(width)) => *width,
        _ => return Err("an index that is no integer".into()),
    };
    match width {
        32 => code.bitcast(uint, value),
        _ => Ok(code.emit(Op::UConvert, uint, vec![id(value)])),
    }
}

impl Element {
    /// Whether the user declared an array of resources.
    pub fn is_array(&self) -> bool {
        !self.lengths.is_empty()
    }

    /// The type of one resource.
    pub fn ty(&self) -> Word {
        self.ty
    }

    /// Whether the user's code can only read it.
    pub fn is_read_only(&self) -> bool {
        self.read_only
    }

    /// The capability that indexing this kind of resource non-uniformly needs.
    pub fn indexing(&self) -> Capability {
        match self.binding {
            3 => Capability::StorageImageArrayNonUniformIndexing,
            4 => Capability::StorageBufferArrayNonUniformIndexing,
            _ => Capability::SampledImageArrayNonUniformIndexing,
        }
    }
}
