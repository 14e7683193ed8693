//! Resources: blocks, images and samplers that a shader binds.
//!
//! One `(set, binding)` is one resource. Several variables may share it, and each may declare it in its own
//! way. If an image and a sampler share it, they are the two halves of a combined image sampler; HLSL
//! compilers make such a pair of a texture with its sampler.

use super::{
    Dimension, ImageShape, Resource, ResourceKind, Scalar, block, interface,
    module::{Index, Outcome},
    sampling::{Sampling, sampling},
    storage_format::storage_format,
    usage::Usage,
};
use rspirv::{
    dr::Operand,
    spirv::{Decoration, Dim, Op, StorageClass, Word},
};

/// The resources of a shader.
#[derive(Default)]
pub(super) struct Bound {
    /// By set and binding, each place once: the order in which kernels number them.
    pub resources: Vec<Resource>,
    /// Variables with their number; the push-constant block's is the one after the last resource.
    pub variables: Vec<(Word, u32)>,
    /// The push-constant block's variable.
    pub push_constants: Option<Word>,
    /// The resources that are declared as arrays, by number.
    pub arrays: Vec<ResourceArray>,
    /// `constant_id`s and defaults of the specialization constants that are lengths of such arrays.
    pub lengths: Vec<(u32, u32)>,
}

/// A resource that some variable declares as an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct ResourceArray {
    /// Its number.
    pub number: u32,
    /// Elements of the longest variable of known length, at least 1.
    pub least: u32,
}

/// The resource that a variable declares.
struct Declared {
    variable: Word,
    resource: Resource,
    is_array: bool,
}

/// The resources that the entry point uses.
pub(super) fn bound(index: &Index, usage: &Usage) -> Outcome<Bound> {
    let mut found: Vec<Declared> = Vec::new();
    let mut bound = Bound::default();
    let sampling = sampling(index, usage);
    for variable in usage.variables(index) {
        let (Some(id), Some(pointer)) = (variable.result_id, variable.result_type) else {
            continue;
        };
        let (class, ty) = index.pointer(pointer)?;
        match class {
            StorageClass::PushConstant if bound.push_constants.is_some() => {
                return Err("two push-constant blocks".into());
            }
            StorageClass::PushConstant => bound.push_constants = Some(id),
            StorageClass::UniformConstant | StorageClass::Uniform | StorageClass::StorageBuffer => {
                let mut declared = resource(index, id, class, ty, &mut bound.lengths)?;
                let Sampling { compares, needs_normalized, integers } =
                    sampling.get(&id).copied().unwrap_or_default();
                declared.resource = Resource {
                    compares,
                    needs_normalized,
                    samples_integers: integers,
                    ..declared.resource
                };
                found.push(declared);
            }
            _ => {}
        }
    }
    found.sort_by_key(|found| (found.resource.set, found.resource.binding));
    for Declared { variable, resource, is_array } in found {
        match bound.resources.last_mut() {
            Some(last) if (last.set, last.binding) == (resource.set, resource.binding) => {
                merge(last, &resource)?;
            }
            _ => bound.resources.push(resource),
        }
        let number = bound.resources.len() as u32 - 1;
        bound.variables.push((variable, number));
        if is_array {
            let least = resource.count.max(1);
            match bound.arrays.last_mut() {
                Some(known) if known.number == number => known.least = known.least.max(least),
                _ => bound.arrays.push(ResourceArray { number, least }),
            }
        }
    }
    let last = bound.resources.len() as u32;
    bound.variables.extend(bound.push_constants.map(|variable| (variable, last)));
    Ok(bound)
}

/// Joins what another variable says of the same place.
fn merge(known: &mut Resource, other: &Resource) -> Outcome<()> {
    use ResourceKind::{Sampled, Sampler, Texture};
    if known.kind != other.kind {
        let halves = |r: &Resource| matches!(r.kind, Sampled | Sampler | Texture);
        if !halves(known) || !halves(other) {
            let (set, binding) = (known.set, known.binding);
            return Err(format!(
                "set {set} binding {binding} is declared as two kinds of resource"
            ));
        }
        known.kind = Sampled;
    }
    let open = known.count == 0 || other.count == 0;
    known.count = if open { 0 } else { known.count.max(other.count) };
    known.bytes = known.bytes.max(other.bytes);
    known.compares |= other.compares;
    known.needs_normalized |= other.needs_normalized;
    known.samples_integers |= other.samples_integers;
    known.image = match (known.image, other.image) {
        (Some(a), Some(b)) => Some(a.merged(b).ok_or_else(|| {
            let (set, binding) = (known.set, known.binding);
            format!("set {set} binding {binding} is declared as images of two kinds: one is {a}, one is {b}")
        })?),
        (a, b) => a.or(b),
    };
    Ok(())
}

/// The resource that a variable declares. Notes the specialization constants that are lengths.
fn resource(
    index: &Index,
    id: Word,
    class: StorageClass,
    ty: Word,
    lengths: &mut Vec<(u32, u32)>,
) -> Outcome<Declared> {
    let at = |decoration, what| {
        index.literal(id, decoration).ok_or_else(|| format!("a resource without a {what}"))
    };
    let set = at(Decoration::DescriptorSet, "descriptor set")?;
    let binding = at(Decoration::Binding, "binding")?;
    let (mut element, mut count) = (ty, 1u32);
    loop {
        let length = match index.op(element)? {
            Op::TypeArray => {
                let constant = index.id_operand(element, 1)?;
                let length = interface::length(index, constant, &[])?;
                lengths.extend(index.literal(constant, Decoration::SpecId).map(|id| (id, length)));
                length
            }
            Op::TypeRuntimeArray => 0,
            _ => break,
        };
        count = count.checked_mul(length).ok_or("an array of more than 2^32 resources")?;
        element = index.id_operand(element, 0)?;
    }
    let op = index.op(element)?;
    let kind = match (class, op) {
        (StorageClass::UniformConstant, Op::TypeSampledImage) => ResourceKind::Sampled,
        (StorageClass::UniformConstant, Op::TypeSampler) => ResourceKind::Sampler,
        // Operand 5 of OpTypeImage: 1 goes with a sampler, 2 is read and written.
        (StorageClass::UniformConstant, Op::TypeImage) => match index.number(element, 5)? {
            2 if index.def(element)?.operands[1] != Operand::Dim(Dim::DimSubpassData) => {
                ResourceKind::StorageImage
            }
            _ => ResourceKind::Texture,
        },
        (StorageClass::Uniform, Op::TypeStruct) if !index.has(element, Decoration::BufferBlock) => {
            ResourceKind::Uniform
        }
        (StorageClass::Uniform | StorageClass::StorageBuffer, Op::TypeStruct) => {
            ResourceKind::Storage
        }
        (_, op) => return Err(format!("a resource of Op{op:?}")),
    };
    let bytes = if op == Op::TypeStruct { block::bytes(index, element)? } else { 0 };
    let image = match op {
        Op::TypeSampledImage => Some(shape(index, index.id_operand(element, 0)?)?),
        Op::TypeImage => Some(shape(index, element)?),
        _ => None,
    };
    let resource = Resource {
        set,
        binding,
        kind,
        count,
        bytes,
        image,
        compares: false,
        needs_normalized: false,
        samples_integers: false,
    };
    Ok(Declared { variable: id, resource, is_array: element != ty })
}

fn shape(index: &Index, image: Word) -> Outcome<ImageShape> {
    let texel = index.id_operand(image, 0)?;
    let texel = match index.op(texel)? {
        Op::TypeInt if index.number(texel, 1)? == 1 => Scalar::Int,
        Op::TypeInt => Scalar::Uint,
        _ => Scalar::Float,
    };
    let dimension = match index.def(image)?.operands.get(1) {
        Some(Operand::Dim(Dim::Dim1D)) => Dimension::D1,
        Some(Operand::Dim(Dim::Dim2D)) => Dimension::D2,
        Some(Operand::Dim(Dim::Dim3D)) => Dimension::D3,
        Some(Operand::Dim(Dim::DimCube)) => Dimension::Cube,
        _ => Dimension::Other,
    };
    Ok(ImageShape {
        dimension,
        shadow: index.number(image, 2)? == 1,
        arrayed: index.number(image, 3)? == 1,
        multisampled: index.number(image, 4)? == 1,
        texel,
        format: match index.def(image)?.operands.get(6) {
            Some(Operand::ImageFormat(declared)) => storage_format(*declared),
            _ => None,
        },
    })
}
