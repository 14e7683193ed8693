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
//! * The first id of a draw reaches the shader through a uniform block. Push constants were the
//!   alternative: they need no buffer, but 128 bytes are all that every device has, and a vertex
//!   shader may use all of them. The block sits in the first descriptor set that the vertex shader
//!   leaves free, or, since devices may have no more than four sets, beside its bindings in the
//!   last one.

use crate::{
    error::{Error, Result},
    format::Format,
    pass::{Binding, BindingEntry, BindingSet, Buffer, BufferRange, Draw, Pass, Pipeline},
    shader::{Shader, Stage},
    target::ColorTarget,
};
use std::{collections::HashMap, sync::Arc};

const ID_SHADER: &str = include_str!("../../glsl/compare/id.frag");

/// Descriptor sets that every Vulkan device has.
const SETS: u32 = 4;

/// Bytes from one draw's block to the next: the largest alignment Vulkan lets a device ask for.
const BLOCK_STRIDE: usize = 256;

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

/// A free place for the id block.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Place {
    set: u32,
    binding: u32,
}

/// Makes the id pass of `pass`.
///
/// # Errors
/// [`Error::Usage`] for a draw of a pipeline that does not exist; [`Error::Capacity`] if the pass
/// has more primitives than there are ids; [`Error::Shader`] if the id shader does not compile.
pub fn id_pass(pass: &Pass) -> Result<IdPass> {
    let places: Vec<Place> = pass.pipelines.iter().map(|pipeline| free_place(pipeline)).collect();
    let ranges = ranges(pass)?;
    let blocks = Arc::new(first_id_blocks(&ranges));
    let mut draws = Vec::with_capacity(ranges.len());
    for (i, range) in ranges.iter().enumerate() {
        let draw = &pass.draws[range.draw];
        let block =
            BufferRange { buffer: blocks.clone(), offset: i * BLOCK_STRIDE, bytes: BLOCK_STRIDE };
        draws.push(id_draw(pass, draw, range.instance, places[draw.pipeline], block));
    }
    let mut shaders = HashMap::new();
    let mut pipelines = Vec::with_capacity(pass.pipelines.len());
    for (pipeline, place) in pass.pipelines.iter().zip(places) {
        let shader = match shaders.get(&place) {
            Some(shader) => Arc::clone(shader),
            None => shaders.entry(place).or_insert(Arc::new(id_shader(place)?)).clone(),
        };
        pipelines.push(Arc::new(id_pipeline(pipeline, shader)));
    }
    let pass = Pass {
        label: format!("{} (ids)", pass.label),
        extent: pass.extent,
        color: ColorTarget { format: Format::Rgba8Unorm, clear: [0.0; 4] },
        depth: pass.depth,
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
        for instance in 0..draw.instances {
            let first_id = (next + u64::from(instance) * u64::from(primitives)) as u32;
            ranges.push(IdRange { first_id, primitives, draw: index, instance });
        }
        next = after;
    }
    Ok(ranges)
}

fn first_id_blocks(ranges: &[IdRange]) -> Buffer {
    let mut bytes = vec![0; ranges.len() * BLOCK_STRIDE];
    for (block, range) in bytes.chunks_exact_mut(BLOCK_STRIDE).zip(ranges) {
        block[..4].copy_from_slice(&range.first_id.to_ne_bytes());
    }
    Buffer { label: "first ids".into(), bytes }
}

fn free_place(pipeline: &Pipeline) -> Place {
    let used = &pipeline.vertex.reflection.resources;
    match (0..SETS).find(|&set| used.iter().all(|resource| resource.set != set)) {
        Some(set) => Place { set, binding: 0 },
        None => {
            let set = SETS - 1;
            let bindings = used.iter().filter(|resource| resource.set == set);
            let binding = bindings.map(|resource| resource.binding + 1).max().unwrap_or(0);
            Place { set, binding }
        }
    }
}

fn id_shader(place: Place) -> Result<Shader> {
    let source = ID_SHADER
        .replace("ID_SET,", &format!("{},", place.set))
        .replace("ID_BINDING,", &format!("{},", place.binding));
    Shader::from_glsl(Stage::Fragment, "compare/id.frag", &source)
}

fn id_pipeline(pipeline: &Pipeline, id_shader: Arc<Shader>) -> Pipeline {
    let mut depth = pipeline.depth;
    if pipeline.blend.is_some() {
        depth.write = true;
    }
    Pipeline {
        label: format!("{} (ids)", pipeline.label),
        fragment: id_shader,
        depth,
        blend: None,
        ..pipeline.clone()
    }
}

fn id_draw(pass: &Pass, draw: &Draw, instance: u32, place: Place, block: BufferRange) -> Draw {
    let mut sets = draw.sets.clone();
    let slot = place.set as usize;
    sets.resize_with(sets.len().max(slot + 1), Arc::default);
    let id_entry =
        BindingEntry { binding: place.binding, resources: vec![Binding::Uniform(block)] };
    let vertex = &pass.pipelines[draw.pipeline].vertex.reflection;
    let kept = sets[slot].entries.iter().filter(|entry| {
        let slot = (place.set, entry.binding);
        vertex.resources.iter().any(|resource| (resource.set, resource.binding) == slot)
    });
    sets[slot] = Arc::new(BindingSet { entries: kept.cloned().chain([id_entry]).collect() });

    let mut push_constants = draw.push_constants.clone();
    push_constants.truncate(vertex.push_constant_bytes as usize);
    Draw {
        sets,
        push_constants,
        instances: 1,
        first_instance: draw.first_instance + instance,
        ..draw.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        image::Extent,
        shader::{Reflection, Resource, ResourceKind},
        state::{Blend, Cull, DepthState, FrontFace, Topology},
    };

    fn pipeline(bindings: &[(u32, u32)], topology: Topology, blend: Option<Blend>) -> Pipeline {
        let resource = |&(set, binding): &(u32, u32)| Resource {
            set,
            binding,
            kind: ResourceKind::Uniform,
            count: 1,
            bytes: 16,
            image: None,
        };
        let shader = |stage| Shader {
            label: String::new(),
            stage,
            spirv: Vec::new(),
            reflection: Reflection {
                resources: bindings.iter().map(resource).collect(),
                push_constant_bytes: 8,
                ..Reflection::default()
            },
        };
        Pipeline {
            label: "p".into(),
            vertex: Arc::new(shader(Stage::Vertex)),
            fragment: Arc::new(shader(Stage::Fragment)),
            specialization: Vec::new(),
            vertex_bindings: Vec::new(),
            vertex_attributes: Vec::new(),
            topology,
            cull: Cull::None,
            front_face: FrontFace::CounterClockwise,
            depth: DepthState { write: false, ..DepthState::LESS },
            blend,
        }
    }

    fn pass(pipelines: Vec<Pipeline>, draws: Vec<Draw>) -> Pass {
        Pass {
            label: "test".into(),
            extent: Extent::new(8, 8),
            color: ColorTarget { format: Format::Rgba8Srgb, clear: [1.0; 4] },
            depth: None,
            pipelines: pipelines.into_iter().map(Arc::new).collect(),
            draws,
        }
    }

    #[test]
    fn ids_are_unique_over_draws_instances_and_primitives() {
        let pass = pass(
            vec![
                pipeline(&[], Topology::TriangleList, None),
                pipeline(&[], Topology::TriangleStrip, None),
            ],
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
    fn each_draw_reads_its_first_id_beside_what_its_vertex_shader_reads() {
        let own = Arc::new(Buffer { label: "own".into(), bytes: vec![0; 64] });
        let entry = |binding| BindingEntry {
            binding,
            resources: vec![Binding::Uniform(BufferRange::whole(&own))],
        };
        let set = Arc::new(BindingSet { entries: vec![entry(0), entry(4)] });
        // All four sets are taken, and the last one's bindings 0 and 1.
        let taken = [(0, 0), (1, 0), (2, 0), (3, 0), (3, 1)];
        for (bindings, free, kept) in
            [(&taken[..], (3, 2), vec![0]), (&taken[..2], (2, 0), vec![]), (&[], (0, 0), vec![])]
        {
            let mut draw = Draw::new(0, 3);
            draw.sets = vec![set.clone(); 4];
            draw.push_constants = vec![0; 32];
            let pass = pass(
                vec![pipeline(bindings, Topology::TriangleList, None)],
                vec![draw.clone(), draw],
            );
            let ids = id_pass(&pass).unwrap();
            let resource = ids.pass.pipelines[0].fragment.reflection.resources[0];
            assert_eq!((resource.set, resource.binding), free);
            let second = &ids.pass.draws[1];
            assert_eq!(
                second.push_constants.len(),
                8,
                "what only the fragment shader read is gone"
            );
            let entries = &second.sets[free.0 as usize].entries;
            let bindings: Vec<_> = entries.iter().map(|entry| entry.binding).collect();
            assert_eq!(bindings, [kept, vec![free.1]].concat());
            let Binding::Uniform(block) = &entries.last().unwrap().resources[0] else {
                panic!("the id block is a uniform block");
            };
            assert_eq!(block.offset % 256, 0);
            assert_eq!(block.buffer.bytes[block.offset..block.offset + 4], 2u32.to_ne_bytes());
        }
    }

    #[test]
    fn blended_draws_become_opaque_and_write_depth() {
        let pass = pass(
            vec![
                pipeline(&[], Topology::TriangleList, Some(Blend::ALPHA)),
                pipeline(&[], Topology::TriangleList, None),
            ],
            vec![Draw::new(0, 3), Draw::new(1, 3)],
        );
        let ids = id_pass(&pass).unwrap().pass;
        assert_eq!(ids.color, ColorTarget { format: Format::Rgba8Unorm, clear: [0.0; 4] });
        assert!(ids.pipelines[0].blend.is_none() && ids.pipelines[0].depth.write);
        assert!(!ids.pipelines[1].depth.write, "what was opaque keeps its depth state");
    }

    #[test]
    fn more_primitives_than_ids_is_a_capacity_error() {
        let pass = pass(
            vec![pipeline(&[], Topology::TriangleList, None)],
            vec![Draw { instances: 3, ..Draw::new(0, u32::MAX) }],
        );
        assert_eq!(
            id_pass(&pass).unwrap_err().to_string(),
            "the id of each primitive of the pass needs 5 bytes, \
             the limit of an RGBA8 target is 4: compare fewer draws at a time"
        );
    }

    #[test]
    fn a_draw_without_its_pipeline_is_refused() {
        let pass = pass(Vec::new(), vec![Draw::new(0, 3)]);
        assert!(matches!(id_pass(&pass), Err(Error::Usage(_))));
    }
}
