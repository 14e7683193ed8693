//! Checks that a `Pass` is valid, without any device.

use tilewright::{
    format::Format,
    pass::{Binding, BufferRange, Draw, IndexFormat, Pass, Pipeline, StepRate},
    shader::ResourceKind,
};

/// Asserts that every draw of `pass` reads only what is there, in the layout that its pipeline and
/// shaders expect.
pub fn check(pass: &Pass) {
    pass.validate().unwrap_or_else(|e| panic!("{e}"));
    for (i, draw) in pass.draws.iter().enumerate() {
        let pipeline = &pass.pipelines[draw.pipeline];
        check_vertices(pipeline, draw, i);
        check_bindings(pipeline, draw, i);
    }
}

fn inside(range: &BufferRange) -> &[u8] {
    range.host_bytes().unwrap()
}

/// Indices of a draw, widened.
fn indices(draw: &Draw) -> Option<Vec<u32>> {
    let indices = draw.indices.as_ref()?;
    assert_eq!(indices.range.offset % indices.format.bytes(), 0, "indices are aligned");
    let bytes = inside(&indices.range);
    let all: Vec<u32> = match indices.format {
        IndexFormat::U16 => {
            bytes.chunks_exact(2).map(|b| u16::from_le_bytes([b[0], b[1]]).into()).collect()
        }
        IndexFormat::U32 => {
            bytes.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
        }
        other => panic!("{other:?}"),
    };
    Some(all[draw.first as usize..(draw.first + draw.count) as usize].to_vec())
}

fn check_vertices(pipeline: &Pipeline, draw: &Draw, i: usize) {
    let indices = indices(draw);
    let vertices = match &indices {
        Some(list) => list.iter().max().map_or(0, |&m| m as usize + 1),
        None => draw.count as usize,
    };
    for attribute in &pipeline.vertex_attributes {
        let binding = &pipeline.vertex_bindings[attribute.binding as usize];
        let range = &draw.vertex_buffers[attribute.binding as usize];
        let elements = match binding.rate {
            StepRate::Vertex => vertices,
            StepRate::Instance | StepRate::Instances(_) => draw.instances as usize,
        };
        let last = elements.saturating_sub(1) * binding.stride as usize;
        let end = last + attribute.offset as usize + attribute.format.bytes();
        let location = attribute.location;
        assert!(
            elements == 0 || end <= inside(range).len(),
            "draw {i} reads {end} bytes of {} for location {location}",
            range.bytes
        );
        let alignment = attribute.format.alignment();
        assert_eq!((range.offset + attribute.offset as usize) % alignment, 0);
        assert_eq!(binding.stride as usize % alignment, 0);
    }
    for input in &pipeline.vertex.reflection().inputs {
        let location = input.location;
        let fed = pipeline.vertex_attributes.iter().any(|a| a.location == location);
        assert!(fed, "draw {i} has nothing for location {location}");
    }
}

fn check_bindings(pipeline: &Pipeline, draw: &Draw, i: usize) {
    for shader in [&pipeline.vertex, &pipeline.fragment] {
        let reflection = shader.reflection();
        assert!(reflection.push_constant_bytes as usize <= draw.push_constants.len());
        assert!(draw.push_constants.len() <= 128, "more than every device has");
        for resource in &reflection.resources {
            let set = &draw.sets[resource.set as usize];
            let entry = set.entries.iter().find(|e| e.binding == resource.binding);
            let entry = entry.unwrap_or_else(|| panic!("draw {i} lacks {resource:?}"));
            assert_eq!(entry.resources.len(), resource.count as usize);
            for bound in &entry.resources {
                match (bound, resource.kind) {
                    (Binding::Uniform(range), ResourceKind::Uniform) => {
                        assert_eq!(range.offset % 256, 0);
                        inside(range);
                    }
                    (Binding::Sampled(texture, _), ResourceKind::Sampled) => {
                        let extent = texture.extent();
                        assert_ne!(texture.format(), Format::D32Float);
                        for (n, level) in texture.levels().unwrap().iter().enumerate() {
                            let width = (extent.width >> n).max(1) as usize;
                            let height = (extent.height >> n).max(1) as usize;
                            assert_eq!(level.len(), width * height * 4);
                        }
                    }
                    (bound, kind) => panic!("draw {i} binds {bound:?} where {kind:?} is declared"),
                }
            }
        }
    }
}
