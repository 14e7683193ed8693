//! Instructions that only fragment shaders have, each in the terms of a kernel.
//!
//! `helperInvocationEXT()` reads the kernel's flag. With one sample per pixel, `interpolateAtCentroid`
//! and `interpolateAtSample` are the input itself. An input attachment is read as an image at the
//! fragment's place.

use super::{
    hooks::Hooks,
    linker::{Code, Linker, id},
};
use crate::shader::module::Outcome;
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{GlslStd450Op, ImageOperands, Op, Word},
};
use std::collections::HashSet;

/// Lowers `functions`. `attachments` are image types that were input attachments.
pub(super) fn lower(
    linker: &mut Linker,
    hooks: &Hooks,
    functions: &mut [Function],
    attachments: &HashSet<Word>,
) -> Outcome<()> {
    for block in functions.iter_mut().flat_map(|f| &mut f.blocks) {
        let mut code = Code::new(linker);
        for mut instruction in std::mem::take(&mut block.instructions) {
            let first = instruction.operands.first().and_then(Operand::id_ref_any);
            match (instruction.class.opcode, first) {
                (Op::IsHelperInvocationEXT, _) => {
                    let helper = hooks.helper(code.linker)?;
                    let (ty, result) = (instruction.result_type, instruction.result_id);
                    instruction = Instruction::new(Op::Load, ty, result, vec![id(helper)]);
                }
                (Op::ExtInst, _) => interpolate(&mut instruction)?,
                (Op::ImageRead, Some(image))
                    if attachments.contains(&code.linker.type_of(image)?) =>
                {
                    read_attachment(&mut code, hooks, &mut instruction)?;
                }
                _ => {}
            }
            code.instructions.push(instruction);
        }
        block.instructions = code.instructions;
    }
    Ok(())
}

/// `interpolateAt…` of an input. The only extended instruction set is `GLSL.std.450`.
fn interpolate(instruction: &mut Instruction) -> Outcome<()> {
    let Some(Operand::LiteralExtInstInteger(op)) = instruction.operands.get(1) else {
        return Ok(());
    };
    if *op == GlslStd450Op::InterpolateAtOffset as u32 {
        return Err("interpolateAtOffset".into());
    }
    let here =
        [GlslStd450Op::InterpolateAtCentroid as u32, GlslStd450Op::InterpolateAtSample as u32];
    if here.contains(op) {
        let input = instruction.operands[2].clone();
        let (ty, result) = (instruction.result_type, instruction.result_id);
        *instruction = Instruction::new(Op::Load, ty, result, vec![input]);
    }
    Ok(())
}

/// `subpassLoad`: a fetch at `gl_FragCoord` plus the (always zero) offset.
fn read_attachment(code: &mut Code, hooks: &Hooks, instruction: &mut Instruction) -> Outcome<()> {
    let (place, place_ty) = hooks
        .variable(code.linker, "tw_FragCoord")
        .ok_or("the kernel has no variable tw_FragCoord")?;
    let (float, int) = (code.linker.float(), code.linker.int());
    let pixel_ty = code.linker.vector(int, 2);
    let place = code.load(place_ty, place);
    let place = code.swizzle(float, place, 0, 2);
    let pixel = code.emit(Op::ConvertFToS, pixel_ty, vec![id(place)]);
    let offset = instruction.operands[1].clone();
    let pixel = code.emit(Op::IAdd, pixel_ty, vec![id(pixel), offset]);
    let mut operands = vec![instruction.operands[0].clone(), id(pixel)];
    // The one sample of a multisampled attachment, or level 0; how to extend integers stays.
    let extend = ImageOperands::SIGN_EXTEND | ImageOperands::ZERO_EXTEND;
    let given = match instruction.operands.get(2) {
        Some(Operand::ImageOperands(given)) => *given,
        _ => ImageOperands::NONE,
    };
    if !(extend | ImageOperands::SAMPLE).contains(given) {
        return Err(format!("subpassLoad with the operands {given:?}"));
    }
    if given.contains(ImageOperands::SAMPLE) {
        operands.extend_from_slice(&instruction.operands[2..]);
    } else {
        let zero = code.linker.null(int);
        operands.extend([Operand::ImageOperands(given | ImageOperands::LOD), id(zero)]);
    }
    let (ty, result) = (instruction.result_type, instruction.result_id);
    *instruction = Instruction::new(Op::ImageFetch, ty, result, operands);
    Ok(())
}
