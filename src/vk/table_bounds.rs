//! Keeps a kernel's indices of the resource table inside the table.
//!
//! An index beyond the table would have the device read memory that is no descriptor, whoever computed it: the kernel of a
//! user in safe code, or nobody at all, since some drivers (SwiftShader is one) also read the descriptors of lanes
//! that are switched off, where the index is whatever the registers hold. So each index becomes the least of itself and
//! the number of the last slot. All slots hold valid descriptors, see [`super::table`].

use super::{edit::Edit, table_sizes::TableSizes};
use crate::load_spirv::load;
use rspirv::{
    dr::{Instruction, Operand},
    spirv::{Decoration, GlslStd450Op, Op, StorageClass, Word},
};
use std::collections::{HashMap, HashSet};

/// The module with its indices kept inside a table of these sizes.
///
/// # Errors
/// The reason, if the words are no module, or if it declares more slots than the table has.
pub(super) fn keep(words: &[u32], sizes: TableSizes) -> Result<Vec<u32>, String> {
    let module = load(words).map_err(|e| format!("is no SPIR-V module: {e}"))?;
    let mut bounds = Bounds { edit: Edit::new(module), std450: None };
    let arrays = bounds.arrays(sizes)?;
    bounds.rewrite(&arrays);
    Ok(bounds.edit.assemble())
}

/// The module with its indices of arrays, vectors and matrices kept inside of these, where they are a workgroup's or an
/// invocation's own. Devices check the bounds of buffers alone.
///
/// # Errors
/// The reason, if the words are no module.
pub(super) fn keep_arrays(words: &[u32]) -> Result<Vec<u32>, String> {
    let module = load(words).map_err(|e| format!("is no SPIR-V module: {e}"))?;
    let mut bounds = Bounds { edit: Edit::new(module), std450: None };
    bounds.keep_arrays();
    Ok(bounds.edit.assemble())
}

struct Bounds {
    edit: Edit,
    /// The set of extended instructions that has `UMin`.
    std450: Option<Word>,
}

impl Bounds {
    /// The arrays of the table, and the parameters of functions that stand for them, with the number of the last slot.
    fn arrays(&self, sizes: TableSizes) -> Result<HashMap<Word, u32>, String> {
        let edit = &self.edit;
        let sets = edit.decorations(Decoration::DescriptorSet);
        let bindings = edit.decorations(Decoration::Binding);
        let mut arrays = HashMap::new();
        for variable in &edit.module.types_global_values {
            let (Op::Variable, Some(id)) = (variable.class.opcode, variable.result_id) else {
                continue;
            };
            let array = variable.result_type.map_or(0, |ty| edit.operand(ty, 1));
            let is_array = edit.is(array, Op::TypeArray) || edit.is(array, Op::TypeRuntimeArray);
            let (Some(1), Some(&binding), true) = (sets.get(&id), bindings.get(&id), is_array)
            else {
                continue;
            };
            let slots = sizes.by_binding().get(binding as usize).copied().unwrap_or(1);
            let length = edit.operand(array, 1);
            if length != 0 && edit.number(length).is_none() {
                return Err(format!(
                    "declares an array in binding {binding} of the resource table whose length is no constant, or one that \
                     is specialized"
                ));
            }
            let declared = edit.number(length).unwrap_or(slots);
            if declared > slots {
                return Err(format!(
                    "declares {declared} elements of binding {binding} of the resource table, which has {slots} on this device"
                ));
            }
            arrays.insert(id, declared.saturating_sub(1));
        }
        // A function may call another with what it was called with.
        while self.pass_on(&mut arrays) {}
        // Whatever else made a pointer of one would reach the table past the limit.
        let kept = |i: &Instruction, at: usize| match i.class.opcode {
            Op::AccessChain | Op::InBoundsAccessChain => at == 0 && i.operands.len() > 1,
            op => op == Op::FunctionCall,
        };
        for i in edit.instructions() {
            let mut operands = i.operands.iter().enumerate();
            let is_array =
                |operand: &Operand| operand.id_ref_any().is_some_and(|id| arrays.contains_key(&id));
            if operands.any(|(at, operand)| is_array(operand) && !kept(i, at)) {
                return Err(format!(
                    "uses an array of the resource table by {:?}: only its elements can be used",
                    i.class.opcode
                ));
            }
        }
        Ok(arrays)
    }

    /// Follows arrays into the functions that are called with them: false if there is nothing new.
    fn pass_on(&self, arrays: &mut HashMap<Word, u32>) -> bool {
        let functions = &self.edit.module.functions;
        let mut found = false;
        for call in self.edit.instructions().filter(|i| i.class.opcode == Op::FunctionCall) {
            let mut ids = call.operands.iter().filter_map(Operand::id_ref_any);
            let called = ids.next();
            let called =
                functions.iter().find(|f| f.def.as_ref().and_then(|def| def.result_id) == called);
            let parameters = called.map_or(&[][..], |f| &f.parameters);
            for (argument, parameter) in ids.zip(parameters.iter().filter_map(|p| p.result_id)) {
                let Some(&last) = arrays.get(&argument) else { continue };
                if arrays.get(&parameter).is_none_or(|known| last < *known) {
                    arrays.insert(parameter, last);
                    found = true;
                }
            }
        }
        found
    }

    fn rewrite(&mut self, arrays: &HashMap<Word, u32>) {
        let types: HashMap<Word, Word> = (self.edit.module.all_inst_iter())
            .filter_map(|i| Some((i.result_id?, i.result_type?)))
            .collect();
        let non_uniform = (self.edit.module.annotations.iter())
            .filter(|i| i.operands.get(1) == Some(&Operand::Decoration(Decoration::NonUniform)))
            .filter_map(|i| i.operands[0].id_ref_any());
        let non_uniform: HashSet<Word> = non_uniform.collect();
        let mut functions = std::mem::take(&mut self.edit.module.functions);
        for block in functions.iter_mut().flat_map(|f| &mut f.blocks) {
            let mut code = Vec::with_capacity(block.instructions.len());
            for mut i in std::mem::take(&mut block.instructions) {
                if let (
                    Op::AccessChain | Op::InBoundsAccessChain,
                    &[Operand::IdRef(base), Operand::IdRef(index), ..],
                ) = (i.class.opcode, i.operands.as_slice())
                    && let Some(&last) = arrays.get(&base)
                    && self.edit.number(index).is_none_or(|known| known > last)
                {
                    let ty = types.get(&index).copied().unwrap_or(self.edit.uint);
                    let inside = self.inside(index, ty, last, &mut code);
                    if non_uniform.contains(&index) {
                        let target = vec![Operand::IdRef(inside)];
                        self.edit.decorate(Op::Decorate, target, Decoration::NonUniform, &[]);
                    }
                    i.operands[1] = Operand::IdRef(inside);
                }
                code.push(i);
            }
            block.instructions = code;
        }
        self.edit.module.functions = functions;
    }

    fn keep_arrays(&mut self) {
        let types: HashMap<Word, Word> = (self.edit.module.all_inst_iter())
            .filter_map(|i| Some((i.result_id?, i.result_type?)))
            .collect();
        let mut functions = std::mem::take(&mut self.edit.module.functions);
        for block in functions.iter_mut().flat_map(|f| &mut f.blocks) {
            let mut code = Vec::with_capacity(block.instructions.len());
            for mut i in std::mem::take(&mut block.instructions) {
                if matches!(i.class.opcode, Op::AccessChain | Op::InBoundsAccessChain) {
                    self.keep_chain(&mut i, &types, &mut code);
                }
                code.push(i);
            }
            block.instructions = code;
        }
        self.edit.module.functions = functions;
    }

    /// Keeps the indices of one access chain.
    fn keep_chain(
        &mut self,
        chain: &mut Instruction,
        types: &HashMap<Word, Word>,
        code: &mut Vec<Instruction>,
    ) {
        use StorageClass::{Function, Private, Workgroup};
        let base = chain.operands.first().and_then(Operand::id_ref_any);
        let Some(pointer) = base.and_then(|base| types.get(&base)) else { return };
        let class = self.edit.globals.get(pointer).and_then(|i| i.operands.first().cloned());
        let Some(Operand::StorageClass(Workgroup | Private | Function)) = class else { return };
        let mut whole = self.edit.operand(*pointer, 1);
        for at in 1..chain.operands.len() {
            let Some(index) = chain.operands[at].id_ref_any() else { return };
            let Some(ty) = self.edit.globals.get(&whole) else { return };
            let (op, length) = (ty.class.opcode, ty.operands.get(1).cloned());
            let known = self.edit.number(index);
            if op == Op::TypeStruct {
                whole = self.edit.operand(whole, known.unwrap_or(0) as usize);
                continue;
            }
            let last = match length {
                Some(Operand::LiteralBit32(count)) => self.edit.constant(count.saturating_sub(1)),
                Some(Operand::IdRef(length)) => match self.edit.number(length) {
                    Some(count) => self.edit.constant(count.saturating_sub(1)),
                    None => self.one_less(length),
                },
                _ => return,
            };
            let least = self.edit.number(last);
            if known.is_none() || known > least {
                let ty = types.get(&index).copied().unwrap_or(self.edit.uint);
                let inside = self.at_most(index, ty, last, code);
                chain.operands[at] = Operand::IdRef(inside);
            }
            whole = self.edit.operand(whole, 0);
        }
    }

    /// A constant that specialization changes, less 1, as an unsigned integer of 32 bits.
    fn one_less(&mut self, length: Word) -> Word {
        let (uint, one) = (self.edit.uint, self.edit.constant(1));
        let op = Operand::LiteralSpecConstantOpInteger(Op::ISub);
        let operands = vec![op, Operand::IdRef(length), Operand::IdRef(one)];
        self.edit.global(Op::SpecConstantOp, Some(uint), operands)
    }

    /// The least of `index`, an integer of any type that counts as unsigned, and `last`.
    fn inside(&mut self, index: Word, ty: Word, last: u32, code: &mut Vec<Instruction>) -> Word {
        let last = self.edit.constant(last);
        self.at_most(index, ty, last, code)
    }

    /// As [`Bounds::inside`]; `last` is a constant.
    fn at_most(&mut self, index: Word, ty: Word, last: Word, code: &mut Vec<Instruction>) -> Word {
        let uint = self.edit.uint;
        let mut emit = |edit: &mut Edit, op, ty, operands| {
            let id = edit.id();
            code.push(Instruction::new(op, Some(ty), Some(id), operands));
            id
        };
        let least = |index, last, std450| {
            let min = Operand::LiteralExtInstInteger(GlslStd450Op::UMin as u32);
            vec![Operand::IdRef(std450), min, Operand::IdRef(index), Operand::IdRef(last)]
        };
        let std450 = self.std450();
        let bits = self.edit.globals.get(&ty).and_then(|ty| ty.operands.first().cloned());
        if bits == Some(Operand::LiteralBit32(64)) {
            let limit = match self.edit.number(last) {
                Some(last) => {
                    let limit = vec![Operand::LiteralBit64(last.into())];
                    self.edit.global(Op::Constant, Some(ty), limit)
                }
                None => emit(&mut self.edit, Op::SConvert, ty, vec![Operand::IdRef(last)]),
            };
            let index = emit(&mut self.edit, Op::ExtInst, ty, least(index, limit, std450));
            return emit(&mut self.edit, Op::UConvert, uint, vec![Operand::IdRef(index)]);
        }
        let index = match bits == Some(Operand::LiteralBit32(32)) {
            true if ty == uint => index,
            true => emit(&mut self.edit, Op::Bitcast, uint, vec![Operand::IdRef(index)]),
            false => emit(&mut self.edit, Op::UConvert, uint, vec![Operand::IdRef(index)]),
        };
        emit(&mut self.edit, Op::ExtInst, uint, least(index, last, std450))
    }

    fn std450(&mut self) -> Word {
        let name = Operand::LiteralString("GLSL.std.450".into());
        let edit = &mut self.edit;
        *self.std450.get_or_insert_with(|| {
            let imports = &edit.module.ext_inst_imports;
            let known = imports.iter().find(|i| i.operands[0] == name).and_then(|i| i.result_id);
            known.unwrap_or_else(|| {
                let id = edit.id();
                let import = Instruction::new(Op::ExtInstImport, None, Some(id), vec![name]);
                edit.module.ext_inst_imports.push(import);
                id
            })
        })
    }
}

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests {
    use super::*;
    use crate::{
        prebuilt,
        shader::testing::{complaint, kernel},
    };
    use rspirv::spirv::Capability;

    const SIZES: TableSizes =
        TableSizes { sampled: 20, textures: 10, samplers: 8, storage_images: 4, buffers: 30 };

    /// The limits of the indices, in the order of the code.
    fn limits(words: &[u32]) -> Vec<u32> {
        let edit = Edit::new(load(words).unwrap());
        let is_min = |i: &&Instruction| {
            i.class.opcode == Op::ExtInst
                && i.operands[1] == Operand::LiteralExtInstInteger(GlslStd450Op::UMin as u32)
        };
        let limit = |i: &Instruction| edit.number(i.operands[3].id_ref_any()?);
        edit.instructions().filter(is_min).filter_map(limit).collect()
    }

    fn kept(declarations: &str, body: &str) -> Result<Vec<u32>, String> {
        let words = kernel(&format!(
            "#version 460
             #extension GL_EXT_nonuniform_qualifier : require
             #extension GL_EXT_samplerless_texture_functions : require
             layout(local_size_x = 64) in;
             layout(set = 0, binding = 0) buffer Sink {{ vec4 sink[]; }};
             {declarations}
             void main() {{ uint i = gl_GlobalInvocationID.x; {body} }}"
        ));
        let kept = keep(&words, SIZES)?;
        assert_eq!(complaint(&kept), None, "{declarations} {body}");
        Ok(limits(&kept))
    }

    #[test]
    fn every_index_of_the_table_is_kept_inside() {
        let declared = "layout(set = 1, binding = 0) uniform sampler2D sampled[];
            layout(set = 1, binding = 0) uniform texture2D without_sampler[];
            layout(set = 1, binding = 1) uniform texture2D textures[];
            layout(set = 1, binding = 2) uniform sampler samplers[3];
            layout(set = 1, binding = 3, rgba8) uniform image2D images[];
            layout(set = 1, binding = 4) buffer Words { vec4 words[]; } buffers[];
            layout(set = 1, binding = 1) uniform texture2D alone;";
        let body = "sink[i] = textureLod(sampled[nonuniformEXT(i)], vec2(0), 0)
                + texelFetch(without_sampler[i], ivec2(0), 0)
                + textureLod(sampler2D(textures[int(i)], samplers[i]), vec2(0), 0)
                + imageLoad(images[i], ivec2(0)) + buffers[i].words[1000] + buffers[i].words.length()
                + texelFetch(alone, ivec2(0), 0);";
        assert_eq!(kept(declared, body), Ok(vec![19, 19, 9, 2, 3, 29, 29]));
    }

    #[test]
    fn arrays_are_followed_into_functions() {
        let declared = "layout(set = 1, binding = 1) uniform texture2D textures[6];
            vec4 inner(texture2D those[6], uint i) { return texelFetch(those[i], ivec2(0), 0); }
            vec4 outer(texture2D those[6], uint i) { return inner(those, i + 1u); }";
        assert_eq!(kept(declared, "sink[i] = outer(textures, i);"), Ok(vec![5]));
    }

    #[test]
    fn constants_inside_stay_and_arrays_beyond_the_table_are_refused() {
        let declared = "layout(set = 1, binding = 4) buffer Words { vec4 words[]; } buffers[];
            layout(constant_id = 0) const uint SPECIAL = 1u;";
        assert_eq!(kept(declared, "sink[i] = buffers[29].words[i];"), Ok(vec![]));
        assert_eq!(kept(declared, "sink[i] = buffers[SPECIAL].words[i];"), Ok(vec![29]));
        // The compiler takes the greatest constant for the length of such an array.
        let error = kept(declared, "sink[i] = buffers[30].words[i];").unwrap_err();
        assert!(error.contains("31 elements of binding 4") && error.contains("has 30"), "{error}");
        let sized = "layout(set = 1, binding = 3, rgba8) uniform image2D images[5];";
        assert!(kept(sized, "sink[i] = imageLoad(images[i], ivec2(0));").is_err());
    }

    /// What the compiler of GLSL does not write: `change` gets the instructions before the first chain of the table, and the
    /// chain itself.
    fn changed(
        change: impl FnOnce(&mut Edit, &mut Vec<Instruction>, &mut Instruction),
    ) -> Result<Vec<u32>, String> {
        let words = kernel(
            "#version 460
             #extension GL_EXT_nonuniform_qualifier : require
             layout(local_size_x = 64) in;
             layout(set = 0, binding = 0) buffer Sink { vec4 sink[]; };
             layout(set = 1, binding = 4) buffer Words { vec4 words[]; } buffers[];
             void main() { uint i = gl_GlobalInvocationID.x; sink[0] = buffers[i].words[0]; }",
        );
        let mut edit = Edit::new(load(&words).unwrap());
        let table = edit
            .decorations(Decoration::DescriptorSet)
            .into_iter()
            .find(|(_, set)| *set == 1)
            .unwrap()
            .0;
        let mut functions = std::mem::take(&mut edit.module.functions);
        let block = functions.iter_mut().flat_map(|f| &mut f.blocks).next().unwrap();
        let is_chain = |i: &Instruction| i.operands.first() == Some(&Operand::IdRef(table));
        let at = block.instructions.iter().position(is_chain).unwrap();
        let mut rest = block.instructions.split_off(at);
        change(&mut edit, &mut block.instructions, &mut rest[0]);
        block.instructions.append(&mut rest);
        edit.module.functions = functions;
        let words = edit.assemble();
        assert_eq!(complaint(&words), None);
        let kept = keep(&words, SIZES)?;
        assert_eq!(complaint(&kept), None);
        Ok(kept)
    }

    #[test]
    fn a_pointer_to_the_table_goes_nowhere_else() {
        for op in [Op::CopyObject, Op::AccessChain] {
            let error = changed(|edit, before, chain| {
                let (table, copy) = (chain.operands[0].clone(), edit.id());
                let variable = edit
                    .module
                    .types_global_values
                    .iter()
                    .find(|i| i.result_id == table.id_ref_any());
                let ty = variable.and_then(|i| i.result_type);
                before.push(Instruction::new(op, ty, Some(copy), vec![table]));
                chain.operands[0] = Operand::IdRef(copy);
            });
            let error = error.unwrap_err();
            assert!(error.contains(&format!("{op:?}")), "{error}");
        }
    }

    #[test]
    fn indices_of_other_widths_are_kept_inside_before_they_are_converted() {
        for (bits, capability) in [(64, Capability::Int64), (16, Capability::Int16)] {
            let kept = changed(|edit, before, chain| {
                let capability = vec![Operand::Capability(capability)];
                edit.module.capabilities.push(Instruction::new(
                    Op::Capability,
                    None,
                    None,
                    capability,
                ));
                let operands = vec![Operand::LiteralBit32(bits), Operand::LiteralBit32(0)];
                let (ty, index) = (edit.declared(Op::TypeInt, operands), edit.id());
                let narrow = vec![chain.operands[1].clone()];
                before.push(Instruction::new(Op::UConvert, Some(ty), Some(index), narrow));
                chain.operands[1] = Operand::IdRef(index);
            });
            let edit = Edit::new(load(&kept.unwrap()).unwrap());
            let min = edit.instructions().find(|i| i.class.opcode == Op::ExtInst).unwrap();
            let limit = edit.globals[&min.operands[3].id_ref_any().unwrap()].operands[0].clone();
            let wide =
                if bits == 64 { Operand::LiteralBit64(29) } else { Operand::LiteralBit32(29) };
            assert_eq!(limit, wide);
        }
    }

    #[test]
    fn the_kernels_of_the_engine_stay_valid() {
        for (_, _, words) in prebuilt::KERNELS {
            assert_eq!(complaint(&keep(words, SIZES).unwrap()), None);
        }
    }

    #[test]
    fn arrays_of_lengths_that_are_specialized_stay_valid() {
        let words = kernel(
            "#version 460
             layout(local_size_x = 16) in;
             layout(constant_id = 3) const uint LENGTH = 16u;
             layout(std430, binding = 0) buffer Numbers { uint numbers[]; };
             shared uint s[LENGTH];
             shared mat4 m[3];
             void main() {
                 uint i = numbers[0];
                 s[i] = s[int(i)] + s[2u * i];
                 m[i][i][int(i)] = 1.0;
                 barrier();
                 numbers[1] = s[2] + uint(m[1][2].x);
             }",
        );
        assert_eq!(complaint(&keep_arrays(&words).unwrap()), None);
    }

    #[test]
    fn the_kernels_of_the_engine_stay_valid_with_bounds() {
        for (_, _, words) in prebuilt::KERNELS {
            assert_eq!(complaint(&keep_arrays(words).unwrap()), None);
        }
    }
}
