//! What follows from a pipeline alone: its kernels, and how it is drawn.

use super::{KernelKey, Method};
use crate::{
    abi,
    pass::{Pass, Pipeline, StepRate, VertexAttribute, VertexBinding},
    samples::Samples,
    shader::{Reflection, Shader, Varying},
    state::{Compare, Cull, LogicOp, PrimitiveKind},
    stencil::StencilState,
};
use std::sync::Arc;

/// What the planner derives from a pipeline alone.
#[derive(Clone)]
pub(super) struct Facts {
    pub vertex: Arc<KernelKey>,
    pub fragment: Arc<KernelKey>,
    pub varying_stride: u32,
}

impl Facts {
    pub fn new(pipeline: &Pipeline) -> Self {
        // Pipelines that differ in a constant of one stage share the kernel of the other.
        let own = |ids: &[u32]| {
            let all = pipeline.specialization.iter();
            all.filter(|(id, _)| ids.contains(id)).copied().collect()
        };
        let key = |shader: &Arc<Shader>, attributes, read, of_fragments| {
            let (per_sample, by_alpha, primitives) = of_fragments;
            Arc::new(KernelKey {
                shader: shader.clone(),
                specialization: own(&shader.reflection.specialization),
                attributes,
                read,
                per_sample,
                by_alpha,
                primitives,
            })
        };
        let by_alpha = pipeline.alpha_to_coverage || pipeline.alpha_to_one;
        let of_fragments = (pipeline.runs_per_sample(), by_alpha, pipeline.topology.kind());
        let inputs = &pipeline.fragment.reflection.inputs;
        let locations = inputs.iter().map(|v| v.location + 1).max();
        let has_distances = !pipeline.vertex.reflection.distances.is_empty();
        let of_distances = if has_distances { abi::DISTANCE_LOCATIONS } else { 0 };
        Self {
            vertex: key(
                &pipeline.vertex,
                attributes(pipeline),
                read_outputs(pipeline),
                (false, false, PrimitiveKind::Triangle),
            ),
            fragment: key(&pipeline.fragment, Vec::new(), 0, of_fragments),
            varying_stride: 4 * (locations.unwrap_or(0) + of_distances),
        }
    }
}

/// The stencil tests of opaque work.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Stencil {
    /// None.
    Off,
    /// No fragment changes the target.
    Compares,
    /// All fragments that pass change these bits of the target.
    Writes(u8),
}

/// What the method of a pipeline depends on in the targets of a pass.
#[derive(Clone, Copy)]
pub(crate) struct TargetKinds {
    /// Colour targets.
    pub colors: usize,
    pub depth: bool,
    pub stencil: bool,
    pub samples: Samples,
}

impl TargetKinds {
    pub fn of(pass: &Pass) -> Self {
        Self {
            colors: pass.colors.len(),
            depth: pass.depth.is_some(),
            stencil: pass.stencil.is_some(),
            samples: pass.samples,
        }
    }
}

/// The kernels of one pipeline.
pub(crate) struct PipelineKernels {
    pub vertex: Arc<KernelKey>,
    pub fragment: Arc<KernelKey>,
    /// Its kernel has the number 0.
    pub method: Method,
}

impl PipelineKernels {
    /// Those of `pipeline` in passes that have such targets.
    pub fn of(pipeline: &Pipeline, targets: TargetKinds) -> Self {
        let Facts { vertex, fragment, .. } = Facts::new(pipeline);
        Self { vertex, fragment, method: method(pipeline, targets, 0) }
    }
}

/// The attributes of a pipeline, ordered by location.
fn attributes(pipeline: &Pipeline) -> Vec<(u32, u32)> {
    let format = |attribute: &VertexAttribute| {
        let format = attribute.format;
        let VertexBinding { stride, rate } = pipeline.vertex_bindings[attribute.binding as usize];
        // One element for all vertices is also one for all vertices of an instance.
        let flag = |on, flag| if on { flag } else { 0 };
        let per_instance = rate != StepRate::Vertex || stride == 0;
        let bits = format.numeric as u32
            | (format.packing as u32) << abi::ATTRIBUTE_PACKING_SHIFT
            | u32::from(format.count) << abi::ATTRIBUTE_COUNT_SHIFT
            | flag(per_instance, abi::ATTRIBUTE_PER_INSTANCE)
            | flag(matches!(rate, StepRate::Instances(_)), abi::ATTRIBUTE_DIVIDED);
        (attribute.location, bits)
    };
    let read = |a: &&VertexAttribute| {
        pipeline.vertex.reflection.inputs.iter().any(|input| input.location == a.location)
    };
    let mut all: Vec<_> = pipeline.vertex_attributes.iter().filter(read).map(format).collect();
    all.sort_unstable();
    all
}

/// The locations that the vertex shader of a pipeline writes and its fragment shader reads, a bit each.
fn read_outputs(pipeline: &Pipeline) -> u32 {
    let locations = |varyings: &[Varying]| {
        let of = |v: &Varying| 1u32.checked_shl(v.location).unwrap_or(0);
        varyings.iter().fold(0, |all, varying| all | of(varying))
    };
    let [vertex, fragment] = [&pipeline.vertex, &pipeline.fragment].map(|s| &s.reflection);
    locations(&vertex.outputs) & locations(&fragment.inputs)
}

/// How a pipeline is drawn.
pub(super) fn method(pipeline: &Pipeline, targets: TargetKinds, kernel: usize) -> Method {
    let TargetKinds { colors, samples, .. } = targets;
    let fragment = &pipeline.fragment.reflection;
    let keyed = matches!(
        pipeline.depth.compare,
        Compare::Less | Compare::LessOrEqual | Compare::Greater | Compare::GreaterOrEqual
    );
    let tested = targets.depth && pipeline.depth.test && pipeline.depth.write && keyed;
    let overwrites = pipeline.logic_op.is_none_or(|op| op == LogicOp::Copy);
    // Opaque work knows of a pixel's samples which triangle they show, and not which ones a triangle covers.
    let tells_samples = pipeline.sample_mask & samples.mask() != samples.mask()
        || pipeline.alpha_to_coverage
        || (samples != Samples::One && fragment.reads_coverage);
    let unordered = tested && !pipeline.depth.bounds && !tells_samples && is_pure(fragment);
    let test = pipeline.stencil.filter(|_| targets.stencil);
    // Points and lines are front faces, which nothing culls.
    let cull = match pipeline.topology.kind() {
        PrimitiveKind::Triangle => pipeline.cull,
        PrimitiveKind::Point | PrimitiveKind::Line => Cull::Back,
    };
    let stencil = match test.map(|test| test.unordered(cull)) {
        None => Some(Stencil::Off),
        Some(None) => None,
        Some(Some(0)) => Some(Stencil::Compares),
        Some(Some(mask)) => Some(Stencil::Writes(mask)),
    };
    if let (true, Some(stencil)) = (unordered && overwrites && !pipeline.alpha_to_one, stencil) {
        let compare = pipeline.depth.compare;
        let states = || (0..colors).map(|target| pipeline.color_state(target));
        if states().all(|state| !state.writes()) {
            return Method::Opaque { compare, shades: false, stencil };
        }
        if states().all(|state| state.overwrites()) {
            return Method::Opaque { compare, shades: true, stencil };
        }
    }
    let writes_on_failure = |test: StencilState| {
        let mut faces = test.drawn(cull);
        faces.any(|face| face.writes_on_failure())
    };
    let depth = match depth_mode(fragment) {
        // Alpha takes samples away after the shader, and these keep their depth.
        abi::DEPTH_EARLY if pipeline.alpha_to_coverage && !fragment.early_fragment_tests => {
            abi::DEPTH_EARLY_TEST
        }
        depth => depth,
    };
    // Only a fragment that the shader keeps changes the target, also where it fails.
    let depth = match test.is_some_and(writes_on_failure) {
        true if depth == abi::DEPTH_EARLY_TEST => abi::DEPTH_LATE,
        _ => depth,
    };
    Method::Ordered { kernel, depth, stencil: test.is_some() }
}

/// Whether fragments of `pipeline` change nothing but depth and stencil values.
pub(super) fn is_colorless(pipeline: &Pipeline, colors: usize) -> bool {
    let mut states = (0..colors).map(|target| pipeline.color_state(target));
    is_pure(&pipeline.fragment.reflection) && states.all(|state| !state.writes())
}

/// Whether a fragment shader does nothing except return a colour.
fn is_pure(fragment: &Reflection) -> bool {
    let writes = fragment.writes_depth || fragment.writes_stencil || fragment.has_side_effects;
    !fragment.discards && !writes
}

/// When ordered work tests depth: one of `abi::DEPTH_*`.
pub(crate) fn depth_mode(fragment: &Reflection) -> u32 {
    if fragment.early_fragment_tests || is_pure(fragment) {
        abi::DEPTH_EARLY
    } else if fragment.writes_depth {
        abi::DEPTH_WRITTEN
    } else if fragment.has_side_effects || fragment.writes_stencil {
        abi::DEPTH_LATE
    } else {
        abi::DEPTH_EARLY_TEST
    }
}

#[cfg(all(test, feature = "glsl"))]
mod tests {
    use super::*;
    use crate::{
        shader::Stage,
        state::{DepthState, Topology},
        stencil::{StencilFace, StencilOp},
    };

    /// Which of these pipelines are opaque work, and what of it they do with stencil values.
    #[test]
    fn stencil_tests_decide_the_method() {
        let shader = |stage, text| Arc::new(Shader::from_glsl(stage, "plain", text).unwrap());
        let vertex = shader(Stage::Vertex, "#version 460\nvoid main() { gl_Position = vec4(0); }");
        let color = "#version 460\nlayout(location = 0) out vec4 c; void main() { c = vec4(1); }";
        let plain = Pipeline::new("plain", vertex, shader(Stage::Fragment, color));
        let plain = plain.depth(DepthState::LESS);
        let samples = Samples::One;
        let targets = TargetKinds { colors: 1, depth: true, stencil: true, samples };
        let of = |pipeline: &Pipeline| match method(pipeline, targets, 0) {
            Method::Opaque { stencil, .. } => Some(stencil),
            Method::Ordered { .. } => None,
        };
        let with = |face| plain.clone().stencil(StencilState::new(face));
        let face = StencilFace::new(Compare::Always);
        assert_eq!(of(&plain), Some(Stencil::Off));
        assert_eq!(of(&with(StencilFace::new(Compare::Equal))), Some(Stencil::Compares));
        let replace = with(face.pass(StencilOp::Replace).write_mask(12));
        assert_eq!(of(&replace), Some(Stencil::Writes(12)));
        assert_eq!(of(&with(face.pass(StencilOp::IncrementAndWrap))), None);
        assert_eq!(of(&with(face.depth_fail(StencilOp::Zero))), None);
        let none = TargetKinds { stencil: false, ..targets };
        let unused = method(&replace, none, 0);
        assert!(matches!(unused, Method::Opaque { stencil: Stencil::Off, .. }));
        // Only triangles have backs, and only their faces are culled.
        let counts = StencilState::new(face).front(face.pass(StencilOp::IncrementAndWrap));
        let culled = plain.clone().stencil(counts).cull(Cull::Front);
        assert_eq!(of(&culled), Some(Stencil::Compares));
        assert_eq!(of(&culled.topology(Topology::LineList)), None);
    }
}
