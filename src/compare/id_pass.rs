//! The id pass: the same geometry, where each pixel tells the primitive that won it.
//!
//! Every draw keeps its vertex shader, its buffers and its state, and gets a fragment shader that
//! writes a 32-bit id, unique over draws, instances and primitives, into the four bytes of an RGBA8
//! target. What follows from that:
//!
//! * Draws are opaque: nothing is blended, and a draw that was blended writes depth like the rest,
//!   so that its triangles compete for pixels too. `discard` and `gl_FragDepth` are gone with the
//!   user's fragment shader: the id pass asks about geometry.
//! * `gl_PrimitiveID` restarts with each instance and a fragment shader cannot see the instance, so
//!   an instanced draw becomes one draw per instance.
//! * The first id of a draw reaches the shader as a push constant, after those of the vertex shader. A
//!   uniform block was the alternative: it would take a descriptor set for each draw, of which drivers
//!   do not have a hundred thousand. Where a device takes 128 bytes of push constants and no more, the
//!   vertex shader may have 124; most take 256.

use crate::{
    error::{Error, Result},
    format::Format,
    pass::{Draw, Pass, Pipeline, instance_alone, pipeline_alone},
    prebuilt,
    samples::Samples,
    shader::{Shader, Stage},
    target::{ColorTarget, DepthTarget, StencilTarget, StoreOp},
};
use rspirv::spirv::{Decoration, Op};
use std::{collections::HashMap, sync::Arc};

/// Most draws of an id pass. Each is a few hundred bytes.
const MAX_DRAWS: u64 = 1 << 22;

/// An id pass, and what its ids mean.
#[derive(Clone, Debug)]
pub struct IdPass {
    /// The pass to execute; its colour target holds the ids.
    pub pass: Pass,
    /// One per draw of `pass`, with ascending ids.
    pub ranges: Vec<IdRange>,
}

/// The ids of one draw of an id pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IdRange {
    /// Id of primitive 0.
    pub first_id: u32,
    /// How many ids follow from there.
    pub primitives: u32,
    /// Index of the draw in the original pass.
    pub draw: usize,
    /// Which of that draw's instances, from 0.
    pub instance: u32,
}

impl IdPass {
    /// The range and the number of the primitive that `id` stands for.
    pub fn primitive(&self, id: u32) -> Option<(IdRange, u32)> {
        let after = self.ranges.partition_point(|range| range.first_id <= id);
        let range = self.ranges[after.checked_sub(1)?];
        let primitive = id - range.first_id;
        (primitive < range.primitives).then_some((range, primitive))
    }
}

/// Makes the id pass of `pass`.
///
/// # Errors
/// As [`Pass::snapshot`], if depth or stencil values are loaded from an image. [`Error::Usage`] for a draw of a pipeline that does not exist or of instances that have no number;
/// [`Error::Capacity`] if the pass has more primitives than there are ids; [`Error::Full`] if it has
/// more instances than draws are made for.
pub fn id_pass(pass: &Pass) -> Result<IdPass> {
    let pass = &*pass.with_commands_read()?;
    let ranges = ranges(pass)?;
    let draws = ranges.iter().map(|range| id_draw(pass, range)).collect::<Result<_>>()?;
    let mut shaders = HashMap::new();
    let mut pipelines = Vec::with_capacity(pass.pipelines.len());
    // Each instance is a draw of its own.
    for pipeline in pass.pipelines.iter().map(pipeline_alone) {
        let offset = id_offset(&pipeline)?;
        let shader = match shaders.get(&offset) {
            Some(shader) => Arc::clone(shader),
            None => shaders.entry(offset).or_insert(Arc::new(id_shader(offset)?)).clone(),
        };
        pipelines.push(Arc::new(id_pipeline(&pipeline, shader)));
    }
    let mut depth = pass.depth.as_ref().map(DepthTarget::snapshot).transpose()?;
    if let Some(depth) = &mut depth {
        depth.store = StoreOp::Store;
    }
    let stencil = pass.stencil.as_ref().map(StencilTarget::snapshot).transpose()?;
    let pass = Pass {
        label: format!("{} (ids)", pass.label),
        extent: pass.extent,
        colors: vec![ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])],
        depth,
        stencil,
        samples: Samples::One,
        pipelines,
        draws,
    };
    Ok(IdPass { pass, ranges })
}

/// Ids for each instance of each draw, from 1 up.
fn ranges(pass: &Pass) -> Result<Vec<IdRange>> {
    let mut ranges = Vec::new();
    let mut next = 1u64;
    for (index, draw) in pass.draws.iter().enumerate() {
        let pipeline = pass.pipelines.get(draw.pipeline).ok_or_else(|| {
            Error::Usage(format!(
                "draw {index} uses pipeline {} of {}",
                draw.pipeline,
                pass.pipelines.len()
            ))
        })?;
        let primitives = pipeline.topology.primitives(draw.count);
        if primitives == 0 {
            continue;
        }
        let after = next + u64::from(primitives) * u64::from(draw.instances);
        if after > u64::from(u32::MAX) {
            return Err(Error::Capacity {
                what: "the id of each primitive of the pass".into(),
                wanted: (64 - after.leading_zeros()).div_ceil(8).into(),
                limit_of: "an RGBA8 target".into(),
                limit: 4,
                advice: "compare fewer draws at a time".into(),
            });
        }
        let draws = ranges.len() as u64 + u64::from(draw.instances);
        if draws > MAX_DRAWS {
            return Err(Error::Full(format!(
                "the id pass has a draw for each instance, {draws} up to draw {index}; the limit is \
                 {MAX_DRAWS}: compare fewer instances at a time"
            )));
        }
        for instance in 0..draw.instances {
            let first_id = (next + u64::from(instance) * u64::from(primitives)) as u32;
            ranges.push(IdRange { first_id, primitives, draw: index, instance });
        }
        next = after;
    }
    Ok(ranges)
}

/// Where the first id lies among the push constants.
fn id_offset(pipeline: &Pipeline) -> Result<usize> {
    let bytes = pipeline.vertex.reflection.push_constant_bytes;
    bytes.checked_next_multiple_of(4).map(|offset| offset as usize).ok_or_else(|| {
        Error::Usage(format!(
            "pipeline `{}` has {bytes} bytes of push constants, which leave no room for an id",
            pipeline.label
        ))
    })
}

fn id_shader(offset: usize) -> Result<Shader> {
    Shader::own(Stage::Fragment, "compare/id.frag", &id_module(offset as u32))
}

/// The id shader with its push constant at `offset`. SPIR-V takes a number there, no specialization
/// constant.
fn id_module(offset: u32) -> Vec<u32> {
    let mut words = prebuilt::ID.to_vec();
    let mut at = 5; // behind the header
    while at < words.len() {
        let (length, op) = (words[at] >> 16, words[at] & 0xffff);
        // Target, member, decoration, value.
        let operands = &mut words[at + 1..at + length as usize];
        if op == Op::MemberDecorate as u32 && operands[2] == Decoration::Offset as u32 {
            operands[3] = offset;
        }
        at += length as usize;
    }
    words
}

fn id_pipeline(pipeline: &Pipeline, id_shader: Arc<Shader>) -> Pipeline {
    let mut depth = pipeline.depth;
    if pipeline.colors.iter().any(|state| state.blend.is_some()) || pipeline.logic_op.is_some() {
        depth.write = true;
    }
    Pipeline {
        label: format!("{} (ids)", pipeline.label),
        fragment: id_shader,
        depth,
        colors: Vec::new(),
        logic_op: None,
        sample_mask: u32::MAX,
        alpha_to_coverage: false,
        alpha_to_one: false,
        ..pipeline.clone()
    }
}

fn id_draw(pass: &Pass, range: &IdRange) -> Result<Draw> {
    let draw = &pass.draws[range.draw];
    let mut push_constants = draw.push_constants.clone();
    push_constants.resize(id_offset(&pass.pipelines[draw.pipeline])?, 0);
    push_constants.extend_from_slice(&range.first_id.to_ne_bytes());
    draw.first_instance.checked_add(range.instance).ok_or_else(|| {
        Error::Usage(format!(
            "draw {} has {} instances from {} on; they are numbered with 32 bits",
            range.draw, draw.instances, draw.first_instance
        ))
    })?;
    let draw = instance_alone(&pass.pipelines[draw.pipeline], draw, range.instance);
    Ok(Draw { push_constants, ..draw })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        image::Extent,
        shader::{Details, Reflection},
        state::{Blend, DepthState, Topology},
        target::LoadOp,
    };

    fn pipeline(topology: Topology, blend: Option<Blend>) -> Pipeline {
        let shader = |stage| Shader {
            label: String::new(),
            stage,
            spirv: Vec::new(),
            reflection: Reflection { push_constant_bytes: 8, ..Reflection::default() },
            hash: 0,
            refusal: None,
            details: Details::default(),
        };
        Pipeline::new("p", shader(Stage::Vertex), shader(Stage::Fragment))
            .topology(topology)
            .depth(DepthState { write: false, ..DepthState::LESS })
            .blend(blend)
    }

    fn pass(pipelines: Vec<Pipeline>, draws: Vec<Draw>) -> Pass {
        Pass {
            label: "test".into(),
            extent: Extent::new(8, 8),
            colors: vec![ColorTarget::cleared(Format::Rgba8Srgb, [1.0; 4])],
            depth: None,
            stencil: None,
            samples: Samples::One,
            pipelines: pipelines.into_iter().map(Arc::new).collect(),
            draws,
        }
    }

    #[test]
    fn ids_are_unique_over_draws_instances_and_primitives() {
        let pass = pass(
            vec![pipeline(Topology::TriangleList, None), pipeline(Topology::TriangleStrip, None)],
            vec![
                Draw { instances: 3, first_instance: 5, ..Draw::new(0, 7) }, // 2 triangles each
                Draw::new(0, 2),                                             // none
                Draw::new(1, 5),                                             // 3 triangles
            ],
        );
        let ids = id_pass(&pass).unwrap();
        let starts: Vec<_> =
            ids.ranges.iter().map(|r| (r.first_id, r.primitives, r.draw, r.instance)).collect();
        assert_eq!(starts, [(1, 2, 0, 0), (3, 2, 0, 1), (5, 2, 0, 2), (7, 3, 2, 0)]);
        let instances: Vec<_> =
            ids.pass.draws.iter().map(|draw| (draw.first_instance, draw.instances)).collect();
        assert_eq!(instances, [(5, 1), (6, 1), (7, 1), (0, 1)]);

        assert_eq!(ids.primitive(0), None);
        assert_eq!(ids.primitive(4), Some((ids.ranges[1], 1)));
        assert_eq!(ids.primitive(9), Some((ids.ranges[3], 2)));
        assert_eq!(ids.primitive(10), None);
    }

    #[test]
    fn each_draw_pushes_its_first_id_after_what_its_vertex_shader_reads() {
        let mut draw = Draw::new(0, 3);
        draw.push_constants = vec![7; 32];
        let pipelines = vec![pipeline(Topology::TriangleList, None)];
        let ids = id_pass(&pass(pipelines, vec![draw.clone(), draw])).unwrap();
        assert_eq!(ids.pass.pipelines[0].fragment.reflection.push_constant_bytes, 12);
        let second = &ids.pass.draws[1];
        assert_eq!(second.push_constants, [[7; 8].as_slice(), &2u32.to_ne_bytes()].concat());
    }

    #[test]
    fn blended_draws_become_opaque_and_write_depth() {
        let pass = pass(
            vec![
                pipeline(Topology::TriangleList, Some(Blend::ALPHA)),
                pipeline(Topology::TriangleList, None),
            ],
            vec![Draw::new(0, 3), Draw::new(1, 3)],
        );
        let ids = id_pass(&pass).unwrap().pass;
        assert_eq!(ids.colors[0].format, Format::Rgba8Unorm);
        assert_eq!(ids.colors[0].load, LoadOp::clear([0.0; 4]));
        assert!(ids.pipelines[0].colors.is_empty() && ids.pipelines[0].depth.write);
        assert!(!ids.pipelines[1].depth.write, "what was opaque keeps its depth state");
    }

    #[test]
    fn more_primitives_than_ids_is_a_capacity_error() {
        let pass = pass(
            vec![pipeline(Topology::TriangleList, None)],
            vec![Draw { instances: 3, ..Draw::new(0, u32::MAX) }],
        );
        assert_eq!(
            id_pass(&pass).unwrap_err().to_string(),
            "the id of each primitive of the pass needs 5 bytes, \
             the limit of an RGBA8 target is 4: compare fewer draws at a time"
        );
    }

    #[test]
    fn what_has_no_number_is_refused() {
        let pipelines = || vec![pipeline(Topology::TriangleList, None)];
        let draw = Draw { instances: 3, first_instance: u32::MAX - 1, ..Draw::new(0, 3) };
        let error = id_pass(&pass(pipelines(), vec![draw])).unwrap_err();
        assert!(error.to_string().contains("3 instances from 4294967294"), "{error}");
        let draw = Draw { instances: 1 << 23, ..Draw::new(0, 3) };
        let error = id_pass(&pass(pipelines(), vec![draw])).unwrap_err();
        assert!(matches!(error, Error::Full(_)), "{error}");
        let mut pipelines = pipelines();
        let mut vertex = (*pipelines[0].vertex).clone();
        vertex.reflection.push_constant_bytes = u32::MAX;
        pipelines[0].vertex = Arc::new(vertex);
        let error = id_pass(&pass(pipelines, vec![Draw::new(0, 3)])).unwrap_err();
        assert!(error.to_string().contains("no room for an id"), "{error}");
    }

    #[test]
    fn a_draw_without_its_pipeline_is_refused() {
        let pass = pass(Vec::new(), vec![Draw::new(0, 3)]);
        assert!(matches!(id_pass(&pass), Err(Error::Usage(_))));
    }
}
