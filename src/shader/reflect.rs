//! Finds the resources, inputs and outputs of a shader in its SPIR-V.

use super::{
    Details, Reflection, ResourceKind, Stage, block,
    interface::{self, Variable},
    module::{Index, Outcome, ids},
    reach,
    resource::{self, Bound},
    usage::Usage,
};
use rspirv::{
    dr::{self, Instruction, Operand},
    spirv::{BuiltIn, Decoration, ExecutionMode, GlslStd450Op, Op, StorageClass, Word},
};
use std::collections::HashSet;

/// Reflects the entry point `main` of `stage`; says also why no pass can draw with it, if so.
pub(super) fn reflect(
    module: &dr::Module,
    stage: Stage,
) -> Outcome<(Reflection, Details, Option<String>)> {
    let index = Index::new(module);
    let usage = Usage::new(&index, stage)?;
    let mut reflection = Reflection::default();
    for variable in usage.variables(&index) {
        let Some(pointer) = variable.result_type else { continue };
        let (class, _) = index.pointer(pointer)?;
        if interface::is_interface(class) {
            add_varyings((&index, &usage), variable, class, &mut reflection)?;
        }
    }
    let bound = resource::bound(&index, &usage)?;
    if let Some(variable) = bound.push_constants {
        let (_, ty) = index.pointer(index.type_of(variable)?)?;
        reflection.push_constant_bytes = block::bytes(&index, ty)?;
    }
    let written = written(&index, &usage, &bound);
    reflection.resources = bound.resources;
    let details = Details {
        wide_constants: wide_constants(&index),
        arrays: bound.arrays,
        array_lengths: bound.lengths,
        written,
    };
    reflection.inputs.sort_by_key(|v| (v.location, v.component));
    reflection.outputs.sort_by_key(|v| (v.location, v.component));
    reflection.specialization = specialization(&index, &usage);
    reflection.early_fragment_tests = module.execution_modes.iter().any(|i| {
        i.operands.first() == Some(&Operand::IdRef(usage.entry))
            && i.operands.get(1) == Some(&Operand::ExecutionMode(ExecutionMode::EarlyFragmentTests))
    });
    reflection.per_sample = stage == Stage::Fragment && runs_per_sample(&index, &usage);
    for instruction in usage.instructions() {
        let op = instruction.class.opcode;
        reflection.discards |= is_discard(op);
        reflection.has_side_effects |=
            has_side_effect(instruction, |pointer| class_of(&index, pointer));
        reflection.takes_derivatives |= stage == Stage::Fragment && takes_derivative(op);
        reflection.interpolates |= stage == Stage::Fragment && interpolates(instruction);
        reflection.writes_point_size |= reaches_point_size(&index, instruction);
    }
    let refusal = reach::refusal(&index, &usage)?;
    let refusal = refusal.or_else(|| reflection.distances.refusal());
    Ok((reflection, details, refusal))
}

/// Whether a fragment shader runs for each sample: the interface of its entry point has an input that is a `sample`,
/// `gl_SampleID` or `gl_SamplePosition`. Whether the shader uses it makes no difference to Vulkan.
fn runs_per_sample(index: &Index, usage: &Usage) -> bool {
    let entries = index.module.entry_points.iter();
    let of_entry = entries.filter(|i| i.operands.get(1) == Some(&Operand::IdRef(usage.entry)));
    let interface = of_entry.flat_map(|i| i.operands.iter().skip(3));
    interface.filter_map(Operand::id_ref_any).any(|id| {
        let pointer = index.def(id).ok().and_then(|variable| variable.result_type);
        let Some(Ok((StorageClass::Input, ty))) = pointer.map(|ty| index.pointer(ty)) else {
            return false;
        };
        let built_in = index.built_in(id, None);
        index.has(id, Decoration::Sample)
            || matches!(built_in, Some(BuiltIn::SampleId | BuiltIn::SamplePosition))
            || has_sample(index, ty, 0)
    })
}

/// Whether a member of a block of this type, or of an array of them, is a `sample`.
fn has_sample(index: &Index, ty: Word, depth: u32) -> bool {
    let Ok(declaration) = index.def(ty) else { return false };
    let inner = |ty| depth < 16 && has_sample(index, ty, depth + 1);
    match declaration.class.opcode {
        Op::TypeArray => ids(declaration).next().is_some_and(inner),
        Op::TypeStruct => ids(declaration).enumerate().any(|(member, ty)| {
            index.member_has(declaration.result_id.unwrap_or(0), member as u32, Decoration::Sample)
                || inner(ty)
        }),
        _ => false,
    }
}

fn add_varyings(
    (index, usage): (&Index, &Usage),
    variable: &Instruction,
    class: StorageClass,
    reflection: &mut Reflection,
) -> Outcome<()> {
    let written = class == StorageClass::Output;
    let list = if written { &mut reflection.outputs } else { &mut reflection.inputs };
    match interface::variable(index, variable, &[])? {
        Variable::Leaves(leaves) => list.extend(leaves.iter().map(|leaf| leaf.varying)),
        Variable::BuiltIn(BuiltIn::PointCoord) => reflection.reads_point_coord = true,
        Variable::BuiltIn(BuiltIn::FragDepth) if written => reflection.writes_depth = true,
        Variable::BuiltIn(BuiltIn::FragStencilRefEXT) if written => {
            reflection.writes_stencil = true;
        }
        // A mask of no samples discards the fragment.
        Variable::BuiltIn(BuiltIn::SampleMask) if written => reflection.discards = true,
        Variable::BuiltIn(BuiltIn::SampleMask) => reflection.reads_coverage = true,
        Variable::BuiltIn(_) => {}
        Variable::Distances(built_in, leaves) => {
            reflection.distances.add(built_in, leaves.len())?
        }
        Variable::BuiltInBlock(members) => {
            let (Some(id), Some(pointer)) = (variable.result_id, variable.result_type) else {
                return Ok(());
            };
            let block = (id, index.pointer(pointer)?.1);
            for (built_in, leaves) in
                interface::distances_of_block((index, usage), block, &members, &[])?
            {
                reflection.distances.add(built_in, leaves.len())?;
            }
        }
    }
    Ok(())
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

/// The `constant_id`s whose constants are not 32 bits wide, used or not: drivers look at all of them.
fn wide_constants(index: &Index) -> Vec<u32> {
    let is_wide = |i: &&Instruction| {
        let number = i.result_type.and_then(|ty| index.def(ty).ok());
        let number = number.filter(|ty| matches!(ty.class.opcode, Op::TypeInt | Op::TypeFloat));
        number.is_some_and(|ty| ty.operands.first() != Some(&Operand::LiteralBit32(32)))
    };
    let wide = index.module.types_global_values.iter().filter(is_wide).filter_map(|i| i.result_id);
    wide.filter_map(|id| index.literal(id, Decoration::SpecId)).collect()
}

fn is_discard(op: Op) -> bool {
    matches!(op, Op::Kill | Op::TerminateInvocation | Op::DemoteToHelperInvocation)
}

/// Whether an instruction is `interpolateAt…`. The only extended instruction set is `GLSL.std.450`.
fn interpolates(instruction: &Instruction) -> bool {
    use GlslStd450Op::{InterpolateAtCentroid, InterpolateAtOffset, InterpolateAtSample};
    let all = [InterpolateAtCentroid, InterpolateAtOffset, InterpolateAtSample].map(|op| op as u32);
    match (instruction.class.opcode, instruction.operands.get(1)) {
        (Op::ExtInst, Some(Operand::LiteralExtInstInteger(op))) => all.contains(op),
        _ => false,
    }
}

/// Whether an instruction stores to `gl_PointSize`, or points to it. Nobody reads it.
fn reaches_point_size(index: &Index, instruction: &Instruction) -> bool {
    let mut operands = ids(instruction);
    let Some(base) = operands.next() else { return false };
    match instruction.class.opcode {
        Op::Store => index.built_in(base, None) == Some(BuiltIn::PointSize),
        Op::AccessChain | Op::InBoundsAccessChain => {
            let block = index.type_of(base).and_then(|pointer| index.pointer(pointer));
            let member = operands.next().and_then(|id| index.constant(id).ok());
            block.is_ok_and(|(_, ty)| {
                member.is_some() && index.built_in(ty, member) == Some(BuiltIn::PointSize)
            })
        }
        _ => false,
    }
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

/// Whether an instruction changes memory that others can see. `class_of` finds the storage class that a pointer
/// points into.
pub(super) fn has_side_effect(
    instruction: &Instruction,
    class_of: impl Fn(Word) -> Option<StorageClass>,
) -> bool {
    match instruction.class.opcode {
        Op::ImageWrite => true,
        _ => written_pointer(instruction, class_of).is_some(),
    }
}

/// The pointer to memory that others can see, through which an instruction writes.
fn written_pointer(
    instruction: &Instruction,
    class_of: impl Fn(Word) -> Option<StorageClass>,
) -> Option<Word> {
    let is_shared = |pointer: &Word| {
        matches!(
            class_of(*pointer),
            Some(
                StorageClass::StorageBuffer
                    | StorageClass::Uniform
                    | StorageClass::PhysicalStorageBuffer
            )
        )
    };
    match instruction.class.opcode {
        Op::AtomicLoad => None,
        op if is_atomic(op) => ids(instruction).next(),
        Op::Store | Op::CopyMemory => ids(instruction).next().filter(is_shared),
        // `modf` and `frexp` write through their last operand.
        Op::ExtInst => ids(instruction).last().filter(is_shared),
        _ => None,
    }
}

/// The storage class that a pointer points into.
fn class_of(index: &Index, pointer: Word) -> Option<StorageClass> {
    let (class, _) = index.type_of(pointer).and_then(|ty| index.pointer(ty)).ok()?;
    Some(class)
}

/// The numbers of the storage blocks that the shader may write: those that its stores and atomic operations lead
/// to, and all if it is not plain where one leads.
fn written(index: &Index, usage: &Usage, bound: &Bound) -> Vec<u32> {
    let class_of = |pointer| class_of(index, pointer);
    let pointers = usage.instructions().filter_map(|i| written_pointer(i, class_of));
    let variables: Option<HashSet<Word>> = pointers.map(|p| variable_behind(index, p)).collect();
    let is_written = |(variable, _): &&(Word, u32)| {
        variables.as_ref().is_none_or(|variables| variables.contains(variable))
    };
    let numbers = bound.variables.iter().filter(is_written).map(|(_, number)| *number);
    let is_storage = |number: &u32| {
        bound.resources.get(*number as usize).is_some_and(|r| r.kind == ResourceKind::Storage)
    };
    let mut numbers: Vec<u32> = numbers.filter(is_storage).collect();
    numbers.dedup();
    numbers
}

/// The variable that a pointer leads to by access chains.
fn variable_behind(index: &Index, pointer: Word) -> Option<Word> {
    let mut at = pointer;
    // No walk passes an id twice.
    for _ in 0..index.bound() {
        let def = index.def(at).ok()?;
        match def.class.opcode {
            Op::Variable => return Some(at),
            Op::AccessChain | Op::InBoundsAccessChain | Op::CopyObject | Op::ImageTexelPointer => {
                at = ids(def).next()?;
            }
            _ => return None,
        }
    }
    None
}

/// Whether the operation is an atomic one.
fn is_atomic(op: Op) -> bool {
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

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests {
    use crate::shader::{
        Dimension, Interpolation, ResourceKind, Scalar, Shader, Stage, testing::any_shader,
    };

    fn fragment(body: &str) -> Shader {
        any_shader(Stage::Fragment, "test.frag", &format!("#version 460\n{body}")).unwrap()
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
    fn sizes_of_points_are_found() {
        let writes = |text: &str| {
            let text = format!("#version 460\nvoid main() {{ gl_Position = vec4(0.0); {text} }}");
            let shader = Shader::from_glsl(Stage::Vertex, "points", &text).unwrap();
            shader.reflection.writes_point_size
        };
        assert!(writes("gl_PointSize = 2.0;"));
        assert!(writes("if (gl_VertexIndex > 3) gl_PointSize = gl_Position.x;"));
        assert!(!writes(""));
    }

    #[test]
    fn blocks_that_may_be_written_are_known() {
        let shader = fragment(
            "layout(set = 0, binding = 0) buffer A { uint n; } a;
             layout(set = 0, binding = 1) buffer B { uint n; vec2 v; } b;
             layout(set = 0, binding = 2) readonly buffer C { uint n; } c[2];
             layout(set = 0, binding = 3) buffer D { uint n; } d[2];
             layout(set = 0, binding = 4) uniform E { uint n; } e;
             layout(set = 0, binding = 5) buffer F { uint list[]; } f;
             layout(location = 0) out uvec4 color;
             void main() {
                 color = uvec4(a.n + b.n, c[1].n, e.n, f.list[3]);
                 b.v.y = 1.0;
                 if (color.x > 3u) atomicAdd(d[1].n, 1u);
             }",
        );
        // B and D.
        assert_eq!(shader.details.written, [1, 3]);
    }

    #[test]
    fn what_is_no_module_is_refused() {
        let good = fragment("layout(location = 0) out vec4 c; void main() { c = vec4(1); }").spirv;
        let reason =
            |words: &[u32]| Shader::own(Stage::Fragment, "bad.spv", words).unwrap_err().to_string();
        assert!(reason(&[]).contains("magic number"));
        assert!(reason(&good[..good.len() - 3]).contains("bad.spv"));
        assert!(Shader::own(Stage::Vertex, "a", &good).unwrap_err().to_string().contains("`main`"));
        // Any word may be anything: an error or a module, never a panic.
        for at in 0..good.len() {
            for value in [0, 1, 7, 0x0001_0000, 0xffff_ffff, good[at] ^ 1, good[at] + 1] {
                let mut words = good.clone();
                words[at] = value;
                let _ = Shader::own(Stage::Fragment, "fuzz", &words);
            }
        }
    }
}
