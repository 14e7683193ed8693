//! Built-in variables: which of the kernel's variables each one is.
//!
//! A pass has one view, one layer and one viewport. So a built-in that is the number of one of these becomes the
//! constant that the device's own pipeline would give. Every other built-in is a
//! variable of the kernel, named `tw_` and the GLSL name without `gl_`; if the kernel has no such variable,
//! the shader is refused.

use crate::shader::{Stage, module::Outcome};
use rspirv::spirv::BuiltIn;

/// Where a built-in's value comes from, or goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Source {
    /// A variable of the kernel.
    Kernel(&'static str),
    /// A variable of the kernel, as it is when the user's code begins.
    KernelAtStart(&'static str),
    /// The same in all components, always.
    Constant(u32),
    /// The mask of covered samples, as the kernel's variable of this name has it.
    Coverage(&'static str),
    /// The mask of samples to keep, which goes to the kernel's variable of this name.
    Keep(&'static str),
    /// The built-in of the same name in a compute shader.
    Compute,
}

impl Source {
    /// The kernel's variable that it comes from or goes to, if it is one.
    pub fn variable(self) -> Option<&'static str> {
        match self {
            Self::Kernel(name) | Self::KernelAtStart(name) => Some(name),
            Self::Coverage(name) | Self::Keep(name) => Some(name),
            Self::Constant(_) | Self::Compute => None,
        }
    }
}

/// Where `built_in` comes from, or goes if `output`.
pub(super) fn source(stage: Stage, output: bool, built_in: BuiltIn) -> Outcome<Source> {
    use BuiltIn as B;
    use Source::{Compute, Constant, Coverage, Keep, Kernel, KernelAtStart};
    Ok(match (stage, output, built_in) {
        (Stage::Vertex, false, B::VertexIndex) => Kernel("tw_VertexIndex"),
        (Stage::Vertex, false, B::InstanceIndex) => Kernel("tw_InstanceIndex"),
        (Stage::Vertex, false, B::BaseVertex) => Kernel("tw_BaseVertex"),
        (Stage::Vertex, false, B::BaseInstance) => Kernel("tw_BaseInstance"),
        (Stage::Vertex, false, B::DrawIndex) => Kernel("tw_DrawIndex"),
        (Stage::Vertex, true, B::Position) => Kernel("tw_Position"),
        (Stage::Vertex, true, B::PointSize) => Kernel("tw_PointSize"),
        (Stage::Vertex, true, B::Layer) => Kernel("tw_Layer"),
        (Stage::Vertex, true, B::ViewportIndex) => Kernel("tw_ViewportIndex"),
        (Stage::Fragment, false, B::FragCoord) => Kernel("tw_FragCoord"),
        (Stage::Fragment, false, B::FrontFacing) => Kernel("tw_FrontFacing"),
        (Stage::Fragment, false, B::PrimitiveId) => Kernel("tw_PrimitiveID"),
        (Stage::Fragment, false, B::BaryCoordKHR) => Kernel("tw_BaryCoord"),
        (Stage::Fragment, false, B::BaryCoordNoPerspKHR) => Kernel("tw_BaryCoordNoPersp"),
        (Stage::Fragment, false, B::HelperInvocation) => KernelAtStart("tw_HelperInvocation"),
        (Stage::Fragment, false, B::SampleMask) => Coverage("tw_SampleMaskIn"),
        (Stage::Fragment, false, B::SampleId) => Kernel("tw_SampleID"),
        (Stage::Fragment, false, B::SamplePosition) => Kernel("tw_SamplePosition"),
        (Stage::Fragment, false, B::PointCoord) => Kernel("tw_PointCoord"),
        (Stage::Fragment, false, B::ShadingRateKHR) => Constant(0),
        (Stage::Fragment, false, B::Layer | B::ViewportIndex) => Constant(0),
        (_, false, B::ViewIndex) => Constant(0),
        (Stage::Fragment, true, B::FragDepth) => Kernel("tw_FragDepth"),
        (Stage::Fragment, true, B::FragStencilRefEXT) => Kernel("tw_FragStencilRef"),
        (Stage::Fragment, true, B::SampleMask) => Keep("tw_SampleMask"),
        (_, false, B::SubgroupSize | B::SubgroupLocalInvocationId) => Compute,
        (_, false, B::SubgroupEqMask | B::SubgroupGeMask | B::SubgroupGtMask) => Compute,
        (_, false, B::SubgroupLeMask | B::SubgroupLtMask) => Compute,
        _ => return Err(refusal(output, built_in)),
    })
}

/// The sentence for a built-in that is out of reach.
pub(super) fn refusal(output: bool, built_in: BuiltIn) -> String {
    let what = if output { "writes" } else { "reads" };
    format!("it {what} the built-in {built_in:?}, which is out of reach")
}
