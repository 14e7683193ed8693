//! Refuses shaders that declare something which no pass can provide.
//!
//! A pass binds blocks, textures, and samplers. Nothing in it has an address. A shader that asks for more is a valid module, and could be
//! spliced; but the things that it asks for would be undefined, and drivers crash on some of them.
//!
//! Everything else behaves as in Vulkan. Outputs at locations without a target vanish. A vertex shader's
//! `gl_PointSize` has no effect on lines and triangles.

use super::{
    module::{Index, Outcome},
    storage_format::storage_format,
    usage::Usage,
};
use rspirv::{
    dr::{Instruction, Operand},
    spirv::{Decoration, Dim, ImageFormat, Op, StorageClass, Word},
};

/// Why no pass can draw with the shader; `None` if one can.
pub(super) fn refusal(index: &Index, usage: &Usage) -> Outcome<Option<String>> {
    for variable in usage.variables(index) {
        let (Some(id), Some(pointer)) = (variable.result_id, variable.result_type) else {
            continue;
        };
        let (class, ty) = index.pointer(pointer)?;
        let refusal = match class {
            StorageClass::UniformConstant => resource(index, id, ty)?,
            _ => None,
        };
        if refusal.is_some() {
            return Ok(refusal);
        }
    }
    for pointer in usage.instructions().filter(|i| i.class.opcode == Op::ImageTexelPointer) {
        let Some(ty) = pointer.result_type else { continue };
        if index.op(index.pointer(ty)?.1)? == Op::TypeFloat {
            return Ok(Some("it changes floats of a storage image atomically; images of a pass have that for integers alone".into()));
        }
    }
    let by_address = |i: &Instruction| {
        i.class.opcode == Op::TypePointer
            && i.operands.first()
                == Some(&Operand::StorageClass(StorageClass::PhysicalStorageBuffer))
            && i.result_id.is_some_and(|id| usage.uses(id))
    };
    Ok(index.module.types_global_values.iter().any(by_address).then(|| {
        "it reaches memory by address (buffer_reference); nothing that a pass binds has an address".into()
    }))
}

/// The sentence that refuses an image which no texture of a pass can be.
fn resource(index: &Index, id: Word, ty: Word) -> Outcome<Option<String>> {
    let mut element = ty;
    while matches!(index.op(element)?, Op::TypeArray | Op::TypeRuntimeArray) {
        element = index.id_operand(element, 0)?;
    }
    let (image, with_sampler) = match index.op(element)? {
        Op::TypeSampledImage => (index.id_operand(element, 0)?, true),
        Op::TypeImage => (element, false),
        _ => return Ok(None),
    };
    let texel = index.id_operand(image, 0)?;
    let dimension = index.def(image)?.operands.get(1);
    let known = matches!(
        dimension,
        Some(Operand::Dim(Dim::Dim1D | Dim::Dim2D | Dim::Dim3D | Dim::DimCube))
    );
    // Operand 4 of OpTypeImage: 1 has several samples a texel. Operand 5: 2 is read and written without a sampler. Operand
    // 6: the format of such an image.
    let single = index.number(image, 4)? == 0;
    let name = glsl_type(index, image, with_sampler)?;
    let is_32_bit = index.number(texel, 0)? == 32;
    if known && single && is_32_bit {
        return Ok(match index.def(image)?.operands.get(6) {
            Some(Operand::ImageFormat(format))
                if *format != ImageFormat::Unknown && storage_format(*format).is_none() =>
            {
                let place = place(index, id);
                Some(format!("{place} is a {name} of {format:?}; no image has this format"))
            }
            _ => None,
        });
    }
    let possible = "the textures of a pass have texels of 32-bit floats or integers and one sample a texel: sampler2D, \
                    utexture2D and their relatives of other dimensions";
    Ok(Some(format!("{} is a {name}; {possible}", place(index, id))))
}

/// The variable's name and place.
fn place(index: &Index, id: Word) -> String {
    let named = index.module.debug_names.iter().find_map(|i| match i.operands.as_slice() {
        [Operand::IdRef(target), Operand::LiteralString(name)]
            if i.class.opcode == Op::Name && *target == id && !name.is_empty() =>
        {
            Some(format!("`{name}`"))
        }
        _ => None,
    });
    let at = |decoration| index.literal(id, decoration).unwrap_or(0);
    let (set, binding) = (at(Decoration::DescriptorSet), at(Decoration::Binding));
    format!("{} (set {set}, binding {binding})", named.unwrap_or_else(|| "a resource".into()))
}

/// What GLSL calls an image, with its sampler or without.
fn glsl_type(index: &Index, image: Word, with_sampler: bool) -> Outcome<String> {
    let texel = index.id_operand(image, 0)?;
    let prefix = match index.op(texel)? {
        Op::TypeInt if index.number(texel, 1)? == 1 => "i",
        Op::TypeInt => "u",
        _ => "",
    };
    let is = |operand| index.number(image, operand).map(|value| value == 1);
    let dimension = match index.def(image)?.operands.get(1) {
        Some(Operand::Dim(Dim::Dim1D)) => "1D",
        Some(Operand::Dim(Dim::Dim2D)) => "2D",
        Some(Operand::Dim(Dim::Dim3D)) => "3D",
        Some(Operand::Dim(Dim::DimCube)) => "Cube",
        Some(Operand::Dim(Dim::DimRect)) => "2DRect",
        Some(Operand::Dim(Dim::DimBuffer)) => "Buffer",
        Some(Operand::Dim(Dim::DimSubpassData)) => {
            let samples = if is(4)? { "MS" } else { "" };
            return Ok(format!("{prefix}subpassInput{samples}"));
        }
        _ => "image of an unknown kind",
    };
    // Operand 5 of OpTypeImage: 2 is read and written without a sampler.
    let kind = match (with_sampler, index.number(image, 5)?) {
        (true, _) => "sampler",
        (false, 2) => "image",
        (false, _) => "texture",
    };
    let samples = if is(4)? { "MS" } else { "" };
    let layers = if is(3)? { "Array" } else { "" };
    let shadow = if with_sampler && is(2)? { "Shadow" } else { "" };
    Ok(format!("{prefix}{kind}{dimension}{samples}{layers}{shadow}"))
}

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests {
    use crate::shader::{Shader, Stage};

    /// The sentence for a fragment shader that declares and uses something.
    fn reason(declaration: &str, use_of: &str) -> Option<String> {
        let source = format!(
            "#version 460
             #extension GL_EXT_samplerless_texture_functions : require
             #extension GL_EXT_buffer_reference : require
             #extension GL_EXT_nonuniform_qualifier : require
             {declaration}
             layout(location = 0) out vec4 color;
             void main() {{ color = vec4({use_of}); }}"
        );
        Shader::from_glsl(Stage::Fragment, "odd.frag", &source).err().map(|e| e.to_string())
    }

    #[test]
    fn each_kind_of_image_is_refused_by_its_name() {
        let at = "layout(set = 1, binding = 7)";
        for (ty, use_of) in [
            ("sampler2DMS", "texelFetch(odd, ivec2(0), 0)"),
            ("sampler2DMSArray", "texelFetch(odd, ivec3(0), 0)"),
            ("isampler2DMS", "texelFetch(odd, ivec2(0), 0)"),
            ("samplerBuffer", "texelFetch(odd, 0)"),
            ("usamplerBuffer", "texelFetch(odd, 0)"),
        ] {
            let text = reason(&format!("{at} uniform {ty} odd;"), use_of).expect(ty);
            let sentence =
                format!("shader `odd.frag`: `odd` (set 1, binding 7) is a {ty}; the textures");
            assert!(text.starts_with(&sentence), "{text}");
            assert!(text.contains("sampler2D, utexture2D and their"), "{text}");
        }
        let text = reason(&format!("{at} uniform isamplerBuffer odd[];"), "texelFetch(odd[3], 1)");
        assert!(text.unwrap().contains("`odd` (set 1, binding 7) is a isamplerBuffer"));
        let image = "layout(set = 0, binding = 2, r32f) uniform imageBuffer odd;";
        let text = reason(image, "imageLoad(odd, 0)").unwrap();
        assert!(text.contains("`odd` (set 0, binding 2) is a"), "{text}");
        for image in ["rgba8) uniform image2D odd", "r32ui) uniform uimage2D odd"] {
            let image = format!("layout(set = 0, binding = 2, {image};");
            assert_eq!(reason(&image, "imageLoad(odd, ivec2(0))"), None);
        }
        let input = "layout(input_attachment_index = 0, binding = 3) uniform subpassInput odd;";
        let text = reason(input, "subpassLoad(odd)").unwrap();
        assert!(text.contains("is a subpassInput"), "{text}");
    }

    #[test]
    fn each_kind_of_texture_is_accepted() {
        for (ty, use_of) in [
            ("sampler1D", "texture(odd, 0.5)"),
            ("sampler3D", "texture(odd, vec3(0.5))"),
            ("samplerCube", "texture(odd, vec3(0.5))"),
            ("sampler1DArray", "texture(odd, vec2(0.5))"),
            ("sampler2DArray", "texture(odd, vec3(0.5))"),
            ("samplerCubeArray", "texture(odd, vec4(0.5))"),
            ("sampler2DShadow", "texture(odd, vec3(0.5))"),
            ("samplerCubeShadow", "texture(odd, vec4(0.5))"),
            ("sampler2DArrayShadow", "texture(odd, vec4(0.5))"),
            ("texture3D", "texelFetch(odd, ivec3(0), 0)"),
            ("isampler2D", "texture(odd, vec2(0.5))"),
            ("usampler3D", "texture(odd, vec3(0.5))"),
            ("isamplerCubeArray", "texture(odd, vec4(0.5))"),
            ("utexture2D", "texelFetch(odd, ivec2(0), 0)"),
            ("texture2DArray", "texelFetch(odd, ivec3(0), 0)"),
        ] {
            assert_eq!(reason(&format!("layout(binding = 7) uniform {ty} odd;"), use_of), None);
        }
    }

    #[test]
    fn what_triangles_and_bindings_do_not_have_is_refused() {
        let pointer = "layout(buffer_reference) readonly buffer Word { float word; };
            layout(push_constant) uniform Push { Word at; };";
        let text = reason(pointer, "at.word").unwrap();
        assert!(text.contains("by address (buffer_reference)"), "{text}");
    }

    #[test]
    fn what_is_declared_and_not_used_is_no_reason() {
        assert_eq!(reason("layout(binding = 0) uniform isampler2DMS odd;", "1"), None);
        let plain = "layout(binding = 0) uniform sampler2D a;
            layout(binding = 1) uniform texture2D b;
            layout(binding = 2) uniform sampler c;";
        let use_of =
            "texture(a, vec2(0)) + texture(sampler2D(b, c), vec2(0)) + texelFetch(b, ivec2(0), 0)";
        assert_eq!(reason(plain, use_of), None);
    }
}
