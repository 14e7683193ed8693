//! What a shader binds, reads and writes, read from its SPIR-V.

use super::{
    Dimension, ImageShape, Reflection, Resource, ResourceKind, Scalar, Stage,
    interface::{self, Variable},
    module::{Index, Outcome, ids},
    usage::Usage,
};
use rspirv::{
    dr::{self, Instruction, Operand},
    spirv::{BuiltIn, Decoration, Dim, ExecutionMode, Op, StorageClass, Word},
};

/// Reflects the entry point `main` of `stage`.
pub(super) fn reflect(module: &dr::Module, stage: Stage) -> Outcome<Reflection> {
    let index = Index::new(module);
    let usage = Usage::new(&index, stage)?;
    let mut reflection = Reflection::default();
    for variable in usage.variables(&index) {
        let Some(pointer) = variable.result_type else { continue };
        let (class, _) = index.pointer(pointer)?;
        if interface::is_interface(class) {
            add_varyings(&index, variable, class, &mut reflection)?;
        }
    }
    for (variable, resource) in resources(&index, &usage)? {
        match resource {
            Some(resource) => reflection.resources.push(resource),
            None => {
                let (_, block) = index.pointer(index.type_of(variable)?)?;
                reflection.push_constant_bytes = bytes(&index, block)?;
            }
        }
    }
    reflection.inputs.sort_by_key(|v| (v.location, v.component));
    reflection.outputs.sort_by_key(|v| (v.location, v.component));
    reflection.specialization = specialization(&index, &usage);
    reflection.early_fragment_tests = module.execution_modes.iter().any(|i| {
        i.operands.first() == Some(&Operand::IdRef(usage.entry))
            && i.operands.get(1) == Some(&Operand::ExecutionMode(ExecutionMode::EarlyFragmentTests))
    });
    for instruction in usage.instructions() {
        let op = instruction.class.opcode;
        reflection.discards |= is_discard(op);
        reflection.has_side_effects |= has_side_effect(&index, instruction);
        reflection.takes_derivatives |= stage == Stage::Fragment && takes_derivative(op);
    }
    Ok(reflection)
}

fn add_varyings(
    index: &Index,
    variable: &Instruction,
    class: StorageClass,
    reflection: &mut Reflection,
) -> Outcome<()> {
    let written = class == StorageClass::Output;
    let list = if written { &mut reflection.outputs } else { &mut reflection.inputs };
    match interface::variable(index, variable, &[])? {
        Variable::Leaves(leaves) => list.extend(leaves.iter().map(|leaf| leaf.varying)),
        Variable::BuiltIn(BuiltIn::FragDepth) if written => reflection.writes_depth = true,
        // A mask of no samples discards the fragment.
        Variable::BuiltIn(BuiltIn::SampleMask) if written => reflection.discards = true,
        Variable::BuiltIn(_) | Variable::BuiltInBlock(_) => {}
    }
    Ok(())
}

/// Variables of resources that are used, in the order in which kernels number them: by set and
/// binding, then as declared; the push-constant block comes last and has no [`Resource`].
pub(super) fn resources(index: &Index, usage: &Usage) -> Outcome<Vec<(Word, Option<Resource>)>> {
    let mut found: Vec<(Word, Option<Resource>)> = Vec::new();
    for variable in usage.variables(index) {
        let (Some(id), Some(pointer)) = (variable.result_id, variable.result_type) else {
            continue;
        };
        let (class, ty) = index.pointer(pointer)?;
        match class {
            StorageClass::PushConstant => found.push((id, None)),
            StorageClass::UniformConstant | StorageClass::Uniform | StorageClass::StorageBuffer => {
                found.push((id, Some(resource(index, id, class, ty)?)));
            }
            _ => {}
        }
    }
    found.sort_by_key(|(_, r)| r.map_or((1, 0, 0), |r| (0, r.set, r.binding)));
    for pair in found.windows(2) {
        match (pair[0].1, pair[1].1) {
            (None, None) => return Err("two push-constant blocks".into()),
            // Several variables may share a binding, each seeing the resource in its own way.
            (Some(a), Some(b)) if (a.set, a.binding) == (b.set, b.binding) && a.kind != b.kind => {
                let (set, binding) = (a.set, a.binding);
                return Err(format!(
                    "set {set} binding {binding} is declared as two kinds of resource"
                ));
            }
            _ => {}
        }
    }
    Ok(found)
}

/// The resource that a variable declares.
pub(super) fn resource(
    index: &Index,
    id: Word,
    class: StorageClass,
    ty: Word,
) -> Outcome<Resource> {
    let at = |decoration, what| {
        index.literal(id, decoration).ok_or_else(|| format!("a resource without a {what}"))
    };
    let set = at(Decoration::DescriptorSet, "descriptor set")?;
    let binding = at(Decoration::Binding, "binding")?;
    let (mut element, mut count) = (ty, 1u32);
    loop {
        let length = match index.op(element)? {
            Op::TypeArray => interface::length(index, index.id_operand(element, 1)?, &[])?,
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
    let bytes = if op == Op::TypeStruct { bytes(index, element)? } else { 0 };
    let image = match op {
        Op::TypeSampledImage => Some(shape(index, index.id_operand(element, 0)?)?),
        Op::TypeImage => Some(shape(index, element)?),
        _ => None,
    };
    Ok(Resource { set, binding, kind, count, bytes, image })
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
    })
}

/// Bytes of a block: where the member that reaches furthest ends. A run-time array counts as one
/// element.
pub(super) fn bytes(index: &Index, ty: Word) -> Outcome<u32> {
    let mut end = 0u32;
    for (n, member) in ids(index.def(ty)?).enumerate() {
        let at = |decoration| index.member_literal(ty, n as u32, decoration);
        let offset = at(Decoration::Offset).ok_or("a block without offsets")?;
        let stride = at(Decoration::MatrixStride).unwrap_or(0);
        let row_major = index.member_has(ty, n as u32, Decoration::RowMajor);
        let size = size(index, member, stride, row_major)?;
        end = end.max(offset.checked_add(size).ok_or("a block of more than 2^32 bytes")?);
    }
    Ok(end)
}

/// Bytes of a value inside a block.
fn size(index: &Index, ty: Word, matrix_stride: u32, row_major: bool) -> Outcome<u32> {
    let too_large = || "a block of more than 2^32 bytes".to_string();
    let times = |count: u32, stride: u32| count.checked_mul(stride).ok_or_else(too_large);
    match index.op(ty)? {
        Op::TypeInt | Op::TypeFloat => Ok(index.number(ty, 0)? / 8),
        Op::TypePointer => Ok(8),
        Op::TypeVector => {
            let component = index.id_operand(ty, 0)?;
            times(index.number(ty, 1)?, size(index, component, 0, false)?)
        }
        Op::TypeMatrix => {
            let column = index.id_operand(ty, 0)?;
            let (columns, rows) = (index.number(ty, 1)?, index.number(column, 1)?);
            let component = size(index, index.id_operand(column, 0)?, 0, false)?;
            let (lines, length) = if row_major { (rows, columns) } else { (columns, rows) };
            let before = times(lines.saturating_sub(1), matrix_stride)?;
            before.checked_add(times(length, component)?).ok_or_else(too_large)
        }
        Op::TypeArray | Op::TypeRuntimeArray => {
            let element = index.id_operand(ty, 0)?;
            let count = match index.op(ty)? {
                Op::TypeArray => interface::length(index, index.id_operand(ty, 1)?, &[])?,
                _ => 1,
            };
            let stride =
                index.literal(ty, Decoration::ArrayStride).ok_or("an array without stride")?;
            let last = size(index, element, matrix_stride, row_major)?;
            let before = times(count.saturating_sub(1), stride)?;
            before.checked_add(last).ok_or_else(too_large)
        }
        Op::TypeStruct => bytes(index, ty),
        other => Err(format!("a block member of Op{other:?}")),
    }
}

fn specialization(index: &Index, usage: &Usage) -> Vec<u32> {
    let constants = index.module.types_global_values.iter().filter_map(|i| i.result_id);
    let mut found: Vec<u32> = constants
        .filter(|&id| usage.uses(id))
        .filter_map(|id| index.literal(id, Decoration::SpecId))
        .collect();
    found.sort_unstable();
    found.dedup();
    found
}

fn is_discard(op: Op) -> bool {
    matches!(op, Op::Kill | Op::TerminateInvocation | Op::DemoteToHelperInvocation)
}

fn takes_derivative(op: Op) -> bool {
    matches!(
        op,
        Op::DPdx
            | Op::DPdy
            | Op::Fwidth
            | Op::DPdxFine
            | Op::DPdyFine
            | Op::FwidthFine
            | Op::DPdxCoarse
            | Op::DPdyCoarse
            | Op::FwidthCoarse
            | Op::ImageSampleImplicitLod
            | Op::ImageSampleDrefImplicitLod
            | Op::ImageSampleProjImplicitLod
            | Op::ImageSampleProjDrefImplicitLod
            | Op::ImageQueryLod
    )
}

/// Whether an instruction changes memory that others can see.
pub(super) fn has_side_effect(index: &Index, instruction: &Instruction) -> bool {
    let op = instruction.class.opcode;
    if op == Op::ImageWrite || (is_atomic(op) && op != Op::AtomicLoad) {
        return true;
    }
    if !matches!(op, Op::Store | Op::CopyMemory) {
        return false;
    }
    let class = ids(instruction)
        .next()
        .and_then(|pointer| index.type_of(pointer).ok())
        .and_then(|ty| index.pointer(ty).ok());
    matches!(
        class,
        Some((
            StorageClass::StorageBuffer
                | StorageClass::Uniform
                | StorageClass::PhysicalStorageBuffer,
            _
        ))
    )
}

/// Whether the operation is an atomic one.
pub(super) fn is_atomic(op: Op) -> bool {
    matches!(
        op,
        Op::AtomicLoad
            | Op::AtomicStore
            | Op::AtomicExchange
            | Op::AtomicCompareExchange
            | Op::AtomicIIncrement
            | Op::AtomicIDecrement
            | Op::AtomicIAdd
            | Op::AtomicISub
            | Op::AtomicSMin
            | Op::AtomicUMin
            | Op::AtomicSMax
            | Op::AtomicUMax
            | Op::AtomicAnd
            | Op::AtomicOr
            | Op::AtomicXor
            | Op::AtomicFAddEXT
            | Op::AtomicFMinEXT
            | Op::AtomicFMaxEXT
    )
}

#[cfg(all(test, feature = "glsl"))]
mod tests {
    use crate::shader::{Dimension, Interpolation, ResourceKind, Scalar, Shader, Stage};

    fn fragment(body: &str) -> Shader {
        Shader::from_glsl(Stage::Fragment, "test.frag", &format!("#version 460\n{body}")).unwrap()
    }

    #[test]
    fn resources_that_are_used_are_listed_in_order() {
        let shader = fragment(
            "layout(set = 1, binding = 3) uniform sampler2DArrayShadow shadow[4];
             layout(set = 0, binding = 2) uniform Block { mat3 m; float f[3]; } block;
             layout(set = 0, binding = 7) buffer Store { uint count; vec4 items[]; } store;
             layout(set = 0, binding = 9) uniform sampler2D unused;
             layout(set = 0, binding = 4) uniform itexture3D volume;
             layout(set = 0, binding = 5) uniform sampler nearest;
             layout(push_constant) uniform Push { vec4 tint; float cut; } push;
             layout(location = 0) out vec4 color;
             void main() {
                 float s = texture(shadow[2], vec4(0.5));
                 ivec4 v = texelFetch(isampler3D(volume, nearest), ivec3(0), 0);
                 color = vec4(block.f[1] + s) + v + store.items[0] + push.cut;
             }",
        );
        let found = &shader.reflection.resources;
        let places: Vec<_> = found.iter().map(|r| (r.set, r.binding, r.count, r.kind)).collect();
        use ResourceKind::*;
        assert_eq!(
            places,
            [
                (0, 2, 1, Uniform),
                (0, 4, 1, Texture),
                (0, 5, 1, Sampler),
                (0, 7, 1, Storage),
                (1, 3, 4, Sampled)
            ]
        );
        assert_eq!(found[0].bytes, 84, "five strides of 16 bytes and a last float");
        assert_eq!(found[3].bytes, 32, "a run-time array counts as one element");
        let volume = found[1].image.unwrap();
        assert_eq!((volume.dimension, volume.texel), (Dimension::D3, Scalar::Int));
        let shadow = found[4].image.unwrap();
        assert!(shadow.shadow && shadow.arrayed && !shadow.multisampled);
        assert_eq!(shader.reflection.push_constant_bytes, 20);
        assert!(!shader.reflection.has_side_effects, "the block is only read");
    }

    #[test]
    fn varyings_are_flattened_to_locations() {
        let shader = fragment(
            "layout(location = 0) in Block { vec3 n; layout(location = 4) flat ivec2 id[2]; } block;
             layout(location = 7, component = 1) noperspective in vec2 packed;
             layout(location = 8) in mat2 m;
             layout(location = 11) in vec4 unused;
             layout(location = 0) out vec4 color;
             layout(location = 1) out uvec2 mask;
             void main() {
                 color = vec4(block.n, packed.x) + block.id[1].x + m[1][0];
                 mask = uvec2(1);
             }",
        );
        let places: Vec<_> = shader
            .reflection
            .inputs
            .iter()
            .map(|v| (v.location, v.component, v.count, v.scalar, v.interpolation))
            .collect();
        use Interpolation::*;
        assert_eq!(
            places,
            [
                (0, 0, 3, Scalar::Float, Smooth),
                (4, 0, 2, Scalar::Int, Flat),
                (5, 0, 2, Scalar::Int, Flat),
                (7, 1, 2, Scalar::Float, NoPerspective),
                (8, 0, 2, Scalar::Float, Smooth),
                (9, 0, 2, Scalar::Float, Smooth),
            ]
        );
        let outputs: Vec<_> =
            shader.reflection.outputs.iter().map(|v| (v.location, v.count)).collect();
        assert_eq!(outputs, [(0, 4), (1, 2)]);
    }

    #[test]
    fn effects_are_found() {
        let shader = fragment(
            "layout(early_fragment_tests) in;
             layout(constant_id = 7) const int N = 3;
             layout(set = 0, binding = 0) buffer Store { uint count; } store;
             layout(location = 0) in float x;
             layout(location = 0) out vec4 color;
             void main() {
                 if (x < 0.5) discard;
                 store.count = 1u;
                 gl_FragDepth = 0.5;
                 color = vec4(dFdx(x) * N);
             }",
        );
        let r = &shader.reflection;
        assert!(r.discards && r.writes_depth && r.has_side_effects);
        assert!(r.early_fragment_tests && r.takes_derivatives);
        assert_eq!(r.specialization, [7]);
        let plain = fragment("layout(location = 0) out vec4 c; void main() { c = gl_FragCoord; }");
        let r = &plain.reflection;
        assert!(!r.discards && !r.writes_depth && !r.has_side_effects && !r.takes_derivatives);
    }

    #[test]
    fn what_is_no_module_is_refused() {
        let good = fragment("layout(location = 0) out vec4 c; void main() { c = vec4(1); }").spirv;
        let reason = |words: &[u32]| {
            Shader::from_spirv(Stage::Fragment, "bad.spv", words).unwrap_err().to_string()
        };
        assert!(reason(&[]).contains("magic number"));
        assert!(reason(&good[..good.len() - 3]).contains("bad.spv"));
        assert!(
            Shader::from_spirv(Stage::Vertex, "a", &good)
                .unwrap_err()
                .to_string()
                .contains("`main`")
        );
        // Any word may be anything: an error or a module, never a panic.
        for at in 0..good.len() {
            for value in [0, 1, 7, 0x0001_0000, 0xffff_ffff, good[at] ^ 1, good[at] + 1] {
                let mut words = good.clone();
                words[at] = value;
                let _ = Shader::from_spirv(Stage::Fragment, "fuzz", &words);
            }
        }
    }
}
