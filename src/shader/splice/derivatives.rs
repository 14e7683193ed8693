//! Derivatives, and sampling with implicit level of detail.
//!
//! Two tiers. *Native*: the device has `VK_KHR_compute_shader_derivatives`; lanes 4m to 4m+3 are a
//! quad, the instructions stay as they are and the kernel declares the mode. *Quad*: the kernel's
//! functions `tw_ddx` and `tw_ddy` take differences by subgroup quad operations, and sampling passes
//! them as explicit gradients: a bias multiplies them by its power of two, projection divides first.
//! The difference to implicit sampling is how a device rounds the level of detail.
//!
//! The vertex stage has no derivatives: there, implicit means level 0, as Vulkan says.

use super::{
    Derivatives,
    hooks::Hooks,
    linker::{Code, Linker, id},
};
use crate::shader::{Stage, module::Outcome};
use rspirv::{
    dr::{Function, Instruction, Operand},
    spirv::{Capability, Dim, ExecutionMode, GlslStd450Op, ImageOperands, Op, Word},
};

/// Lowers the instructions that take derivatives.
pub(super) fn lower(
    linker: &mut Linker,
    hooks: &Hooks,
    stage: Stage,
    tier: Derivatives,
    functions: &mut [Function],
) -> Outcome<()> {
    let mut native = false;
    for block in functions.iter_mut().flat_map(|f| &mut f.blocks) {
        let mut code = Code::new(linker);
        for instruction in std::mem::take(&mut block.instructions) {
            let (plain, sample) = (is_derivative(&instruction), is_implicit(&instruction));
            let query = instruction.class.opcode == Op::ImageQueryLod;
            if stage == Stage::Fragment && tier == Derivatives::Native {
                native |= plain || sample || query;
                code.instructions.push(instruction);
            } else if plain {
                derivative(&mut code, hooks, &instruction)?;
            } else if sample {
                Sample::new(&mut code, &instruction)?.lower(&mut code, hooks, stage)?;
            } else if query {
                return Err("textureQueryLod on a device without compute-shader derivatives".into());
            } else {
                code.instructions.push(instruction);
            }
        }
        block.instructions = code.instructions;
    }
    if native {
        declare_quads(linker, hooks.entry);
    }
    Ok(())
}

/// Declares that four lanes in a row are a quad.
fn declare_quads(linker: &mut Linker, entry: Word) {
    linker.capability(Capability::ComputeDerivativeGroupLinearKHR);
    linker.extension("SPV_KHR_compute_shader_derivatives");
    let mode = Operand::ExecutionMode(ExecutionMode::DerivativeGroupLinearKHR);
    let modes = &mut linker.module.execution_modes;
    if !modes.iter().any(|i| i.operands.get(1) == Some(&mode)) {
        modes.push(Instruction::new(Op::ExecutionMode, None, None, vec![id(entry), mode]));
    }
}

fn is_derivative(instruction: &Instruction) -> bool {
    direction(instruction.class.opcode).is_some()
}

/// Which differences a derivative takes: x, y or both (`fwidth`).
fn direction(op: Op) -> Option<&'static [&'static str]> {
    match op {
        Op::DPdx | Op::DPdxFine | Op::DPdxCoarse => Some(&["tw_ddx"]),
        Op::DPdy | Op::DPdyFine | Op::DPdyCoarse => Some(&["tw_ddy"]),
        Op::Fwidth | Op::FwidthFine | Op::FwidthCoarse => Some(&["tw_ddx", "tw_ddy"]),
        _ => None,
    }
}

fn derivative(code: &mut Code, hooks: &Hooks, instruction: &Instruction) -> Outcome<()> {
    let (Some(ty), Some(result), Some(&Operand::IdRef(value))) =
        (instruction.result_type, instruction.result_id, instruction.operands.first())
    else {
        return Err("a derivative of nothing".into());
    };
    match direction(instruction.class.opcode) {
        Some([hook]) => {
            let function = difference(code, hooks, hook, ty)?;
            let operands = vec![id(function), id(value)];
            code.instructions.push(Instruction::new(
                Op::FunctionCall,
                Some(ty),
                Some(result),
                operands,
            ));
        }
        Some([x, y]) => {
            let mut widths = Vec::new();
            for hook in [x, y] {
                let function = difference(code, hooks, hook, ty)?;
                let slope = code.call(ty, function, &[value]);
                widths.push(id(ext(code, GlslStd450Op::FAbs, ty, slope)));
            }
            code.instructions.push(Instruction::new(Op::FAdd, Some(ty), Some(result), widths));
        }
        _ => {}
    }
    Ok(())
}

/// The hook that takes differences of values of type `ty`.
fn difference(code: &mut Code, hooks: &Hooks, hook: &str, ty: Word) -> Outcome<Word> {
    let (scalar, count) = code.linker.components(ty);
    if scalar != code.linker.float() {
        return Err("derivatives of other values than 32-bit floats".into());
    }
    match count {
        1 => hooks.function(&format!("{hook}(f1;")),
        _ => hooks.function(&format!("{hook}(vf{count};")),
    }
}

fn ext(code: &mut Code, op: GlslStd450Op, ty: Word, value: Word) -> Word {
    let set = code.linker.glsl_std();
    let op = Operand::LiteralExtInstInteger(op as u32);
    code.emit(Op::ExtInst, ty, vec![id(set), op, id(value)])
}

fn is_implicit(instruction: &Instruction) -> bool {
    matches!(
        instruction.class.opcode,
        Op::ImageSampleImplicitLod
            | Op::ImageSampleDrefImplicitLod
            | Op::ImageSampleProjImplicitLod
            | Op::ImageSampleProjDrefImplicitLod
    )
}

/// A sampling instruction with implicit level of detail, taken apart.
struct Sample<'i> {
    instruction: &'i Instruction,
    image: Word,
    coordinate: Word,
    reference: Option<Word>,
    bias: Option<Word>,
    /// Operands that stay, with their mask.
    mask: ImageOperands,
    rest: Vec<Operand>,
    /// Components of the coordinate that have derivatives; an array's layer has none.
    dimensions: u32,
}

impl<'i> Sample<'i> {
    fn new(code: &mut Code, instruction: &'i Instruction) -> Outcome<Self> {
        let op = instruction.class.opcode;
        let dref =
            matches!(op, Op::ImageSampleDrefImplicitLod | Op::ImageSampleProjDrefImplicitLod);
        let mut operands = instruction.operands.iter();
        let mut next = || operands.next().and_then(Operand::id_ref_any);
        let (Some(image), Some(coordinate)) = (next(), next()) else {
            return Err("a sampling instruction without coordinate".into());
        };
        let reference = if dref { next() } else { None };
        let mut sample = Self {
            instruction,
            image,
            coordinate,
            reference,
            bias: None,
            mask: ImageOperands::NONE,
            rest: Vec::new(),
            dimensions: dimensions(code.linker, image)?,
        };
        if let Some(Operand::ImageOperands(mask)) = operands.next() {
            // Operands follow in the order of the mask's bits.
            let known = ImageOperands::BIAS
                | ImageOperands::CONST_OFFSET
                | ImageOperands::OFFSET
                | ImageOperands::MIN_LOD
                | ImageOperands::SIGN_EXTEND
                | ImageOperands::ZERO_EXTEND;
            if !known.contains(*mask) {
                return Err(format!("sampling with the operands {mask:?}"));
            }
            if mask.contains(ImageOperands::BIAS) {
                sample.bias = operands.next().and_then(Operand::id_ref_any);
            }
            sample.mask = *mask & !ImageOperands::BIAS;
            sample.rest = operands.cloned().collect();
        }
        if matches!(op, Op::ImageSampleProjImplicitLod | Op::ImageSampleProjDrefImplicitLod) {
            sample.project(code)?;
        }
        Ok(sample)
    }

    /// Divides coordinate and reference by the coordinate's last component.
    fn project(&mut self, code: &mut Code) -> Outcome<()> {
        let (float, ty) = (code.linker.float(), code.linker.type_of(self.coordinate)?);
        let (_, count) = code.linker.components(ty);
        let divisor = code.swizzle(float, self.coordinate, count - 1, 1);
        let place = code.swizzle(float, self.coordinate, 0, self.dimensions);
        let ty = code.linker.vector(float, self.dimensions);
        let divisors = match self.dimensions {
            1 => divisor,
            n => code.emit(Op::CompositeConstruct, ty, vec![id(divisor); n as usize]),
        };
        self.coordinate = code.emit(Op::FDiv, ty, vec![id(place), id(divisors)]);
        if let Some(reference) = self.reference {
            let operands = vec![id(reference), id(divisor)];
            self.reference = Some(code.emit(Op::FDiv, float, operands));
        }
        Ok(())
    }

    fn lower(mut self, code: &mut Code, hooks: &Hooks, stage: Stage) -> Outcome<()> {
        let mut operands = vec![id(self.image), id(self.coordinate)];
        operands.extend(self.reference.map(id));
        if stage == Stage::Fragment {
            let gradients = self.gradients(code, hooks)?;
            operands.push(Operand::ImageOperands(self.mask | ImageOperands::GRAD));
            operands.extend(gradients.map(id));
        } else {
            // A smallest level is no operand of a given level.
            if self.mask.contains(ImageOperands::MIN_LOD) {
                return Err("a smallest level of detail in a vertex shader".into());
            }
            let zero = code.linker.float_constant(0.0);
            operands.push(Operand::ImageOperands(self.mask | ImageOperands::LOD));
            operands.push(id(self.bias.take().unwrap_or(zero)));
        }
        operands.append(&mut self.rest);
        let op = match self.reference {
            Some(_) => Op::ImageSampleDrefExplicitLod,
            None => Op::ImageSampleExplicitLod,
        };
        let (ty, result) = (self.instruction.result_type, self.instruction.result_id);
        code.instructions.push(Instruction::new(op, ty, result, operands));
        Ok(())
    }

    fn gradients(&self, code: &mut Code, hooks: &Hooks) -> Outcome<[Word; 2]> {
        let float = code.linker.float();
        let (_, count) = code.linker.components(code.linker.type_of(self.coordinate)?);
        let place = match count == self.dimensions {
            true => self.coordinate,
            false => code.swizzle(float, self.coordinate, 0, self.dimensions),
        };
        let ty = code.linker.type_of(place)?;
        let scale = self.bias.map(|bias| ext(code, GlslStd450Op::Exp2, float, bias));
        let mut gradients = [0; 2];
        for (gradient, hook) in gradients.iter_mut().zip(["tw_ddx", "tw_ddy"]) {
            let function = difference(code, hooks, hook, ty)?;
            *gradient = code.call(ty, function, &[place]);
            if let Some(scale) = scale {
                let op = if self.dimensions == 1 { Op::FMul } else { Op::VectorTimesScalar };
                *gradient = code.emit(op, ty, vec![id(*gradient), id(scale)]);
            }
        }
        Ok(gradients)
    }
}

/// Components of a coordinate into an image, without its layer.
fn dimensions(linker: &Linker, sampled_image: Word) -> Outcome<u32> {
    let ty = linker.type_of(sampled_image)?;
    let image = linker.global(ty)?.operands.first().and_then(Operand::id_ref_any);
    let dim = image.and_then(|image| linker.global(image).ok()?.operands.get(1).cloned());
    match dim {
        Some(Operand::Dim(Dim::Dim1D)) => Ok(1),
        Some(Operand::Dim(Dim::Dim2D)) => Ok(2),
        Some(Operand::Dim(Dim::Dim3D | Dim::DimCube)) => Ok(3),
        _ => Err("sampling of images other than 1D, 2D, 3D and cubes".into()),
    }
}
