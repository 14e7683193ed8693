//! Marks accesses to the table as non-uniform.
//!
//! Lanes of one subgroup may belong to different draws, so a table index may differ between them.
//! Then Vulkan requires a decoration on the operand that names the resource: the pointer of a load, store or
//! atomic, the image or sampler of an image instruction, and the values that these are made from. The
//! decoration follows values from the table's variables through chains, loads, combinations and function
//! parameters.

use super::{linker::Linker, resources::Element};
use rspirv::{
    dr::{Function, Operand},
    spirv::{Capability, Decoration, Op, StorageClass, Word},
};
use std::collections::HashSet;

/// Decorates everything that is derived from the table.
pub(super) fn mark(linker: &mut Linker, functions: &[Function], elements: &[(Word, Element)]) {
    let table: HashSet<Word> = elements.iter().map(|(variable, _)| *variable).collect();
    let mut marked = HashSet::new();
    let mut order = Vec::new();
    for function in functions {
        for parameter in &function.parameters {
            if let (Some(result), Some(ty)) = (parameter.result_id, parameter.result_type)
                && is_resource(linker, ty)
            {
                marked.insert(result);
            }
        }
        for instruction in function.blocks.iter().flat_map(|b| &b.instructions) {
            let (Some(result), Some(ty)) = (instruction.result_id, instruction.result_type) else {
                continue;
            };
            let derives = match instruction.class.opcode {
                Op::AccessChain
                | Op::InBoundsAccessChain
                | Op::CopyObject
                | Op::SampledImage
                | Op::Image
                | Op::ImageTexelPointer => true,
                Op::Load => is_resource(linker, ty),
                _ => false,
            };
            let from = |operand: &Operand| {
                operand.id_ref_any().is_some_and(|id| table.contains(&id) || marked.contains(&id))
            };
            if derives && instruction.operands.iter().any(from) {
                marked.insert(result);
                order.push(result);
            }
        }
    }
    let already: HashSet<Word> = (linker.module.annotations.iter())
        .filter(|i| i.operands.get(1) == Some(&Operand::Decoration(Decoration::NonUniform)))
        .filter_map(|i| i.operands.first()?.id_ref_any())
        .collect();
    for result in order.into_iter().filter(|result| !already.contains(result)) {
        linker.decorate(result, Decoration::NonUniform, &[]);
    }
    if elements.is_empty() {
        return;
    }
    linker.capability(Capability::ShaderNonUniform);
    linker.capability(Capability::RuntimeDescriptorArray);
    for (_, element) in elements {
        linker.capability(element.indexing());
    }
}

/// Whether a value of this type is a resource, or a pointer to one that is no block.
fn is_resource(linker: &Linker, ty: Word) -> bool {
    match linker.op(ty) {
        Some(Op::TypeImage | Op::TypeSampler | Op::TypeSampledImage) => true,
        Some(Op::TypePointer) => {
            matches!(linker.pointee(ty), Some((StorageClass::UniformConstant, _)))
        }
        _ => false,
    }
}
