//! Blending and logic operations, as Vulkan names them.

use crate::state::{BlendEquation, BlendFactor, BlendOp, ColorState, LogicOp};
use ash::vk;

pub(super) fn blend_state(of: ColorState) -> vk::PipelineColorBlendAttachmentState {
    type C = vk::ColorComponentFlags;
    let channels = [C::R, C::G, C::B, C::A].into_iter().zip(of.write);
    let written =
        channels.filter(|(_, on)| *on).fold(C::empty(), |all, (channel, _)| all | channel);
    let state = vk::PipelineColorBlendAttachmentState::default().color_write_mask(written);
    let Some(blend) = of.blend else { return state };
    let parts = |e: BlendEquation| (blend_factor(e.src), blend_factor(e.dst), blend_op(e.op));
    let (src_color, dst_color, color) = parts(blend.color);
    let (src_alpha, dst_alpha, alpha) = parts(blend.alpha);
    state
        .blend_enable(true)
        .src_color_blend_factor(src_color)
        .dst_color_blend_factor(dst_color)
        .color_blend_op(color)
        .src_alpha_blend_factor(src_alpha)
        .dst_alpha_blend_factor(dst_alpha)
        .alpha_blend_op(alpha)
}

fn blend_factor(factor: BlendFactor) -> vk::BlendFactor {
    match factor {
        BlendFactor::Zero => vk::BlendFactor::ZERO,
        BlendFactor::One => vk::BlendFactor::ONE,
        BlendFactor::SrcColor => vk::BlendFactor::SRC_COLOR,
        BlendFactor::OneMinusSrcColor => vk::BlendFactor::ONE_MINUS_SRC_COLOR,
        BlendFactor::DstColor => vk::BlendFactor::DST_COLOR,
        BlendFactor::OneMinusDstColor => vk::BlendFactor::ONE_MINUS_DST_COLOR,
        BlendFactor::SrcAlpha => vk::BlendFactor::SRC_ALPHA,
        BlendFactor::OneMinusSrcAlpha => vk::BlendFactor::ONE_MINUS_SRC_ALPHA,
        BlendFactor::DstAlpha => vk::BlendFactor::DST_ALPHA,
        BlendFactor::OneMinusDstAlpha => vk::BlendFactor::ONE_MINUS_DST_ALPHA,
        BlendFactor::ConstantColor => vk::BlendFactor::CONSTANT_COLOR,
        BlendFactor::OneMinusConstantColor => vk::BlendFactor::ONE_MINUS_CONSTANT_COLOR,
        BlendFactor::ConstantAlpha => vk::BlendFactor::CONSTANT_ALPHA,
        BlendFactor::OneMinusConstantAlpha => vk::BlendFactor::ONE_MINUS_CONSTANT_ALPHA,
        BlendFactor::SrcAlphaSaturate => vk::BlendFactor::SRC_ALPHA_SATURATE,
        BlendFactor::Src1Color => vk::BlendFactor::SRC1_COLOR,
        BlendFactor::OneMinusSrc1Color => vk::BlendFactor::ONE_MINUS_SRC1_COLOR,
        BlendFactor::Src1Alpha => vk::BlendFactor::SRC1_ALPHA,
        BlendFactor::OneMinusSrc1Alpha => vk::BlendFactor::ONE_MINUS_SRC1_ALPHA,
    }
}

pub(super) fn logic_op(op: LogicOp) -> vk::LogicOp {
    match op {
        LogicOp::Clear => vk::LogicOp::CLEAR,
        LogicOp::Nor => vk::LogicOp::NOR,
        LogicOp::AndInverted => vk::LogicOp::AND_INVERTED,
        LogicOp::CopyInverted => vk::LogicOp::COPY_INVERTED,
        LogicOp::AndReverse => vk::LogicOp::AND_REVERSE,
        LogicOp::Invert => vk::LogicOp::INVERT,
        LogicOp::Xor => vk::LogicOp::XOR,
        LogicOp::Nand => vk::LogicOp::NAND,
        LogicOp::And => vk::LogicOp::AND,
        LogicOp::Equivalent => vk::LogicOp::EQUIVALENT,
        LogicOp::NoOp => vk::LogicOp::NO_OP,
        LogicOp::OrInverted => vk::LogicOp::OR_INVERTED,
        LogicOp::Copy => vk::LogicOp::COPY,
        LogicOp::OrReverse => vk::LogicOp::OR_REVERSE,
        LogicOp::Or => vk::LogicOp::OR,
        LogicOp::Set => vk::LogicOp::SET,
    }
}

fn blend_op(op: BlendOp) -> vk::BlendOp {
    match op {
        BlendOp::Add => vk::BlendOp::ADD,
        BlendOp::Subtract => vk::BlendOp::SUBTRACT,
        BlendOp::ReverseSubtract => vk::BlendOp::REVERSE_SUBTRACT,
        BlendOp::Min => vk::BlendOp::MIN,
        BlendOp::Max => vk::BlendOp::MAX,
    }
}
