//! Assembly: the primitives of a pass in API order, each with its vertices.
//!
//! Reads: draws, pipelines, indices.
//! Contract: Vulkan's, chapters "Drawing Commands" and "Primitive Topologies". A draw whose viewport and scissor
//! leave no pixel has no primitives: nothing of it can be seen, so that no executor has to process it.

use super::window::Window;
use crate::{
    pass::{Draw, IndexFormat, Pass, Pipeline},
    state::{DepthBias, PrimitiveKind, ProvokingVertex, Topology},
    trace::{Primitive, Vertex},
};

/// A primitive with what assembly knows of it.
#[derive(Clone, Copy, Debug)]
pub struct Assembled {
    /// Its name.
    pub primitive: Primitive,
    /// Its vertices.
    pub vertices: [Vertex; 3],
    /// Which of them gives the flat inputs.
    pub provoking: u32,
    /// The viewport and the scissor of its draw.
    pub window: Window,
    /// What is added to its depths.
    pub bias: Option<DepthBias>,
    /// Of the draw.
    pub depth_bounds: [f32; 2],
    /// What stencil tests compare with, of front faces and of back faces.
    pub stencil_reference: [u8; 2],
    /// Least and greatest depth of a fragment.
    pub depth_limits: [f32; 2],
}

/// All primitives of `pass`, which is valid and a snapshot.
pub fn run(pass: &Pass) -> impl Iterator<Item = Assembled> {
    pass.draws.iter().enumerate().flat_map(move |(number, draw)| {
        let window = Window::of(pass, draw);
        window.into_iter().flat_map(move |window| of_draw(pass, number as u32, draw, window))
    })
}

fn of_draw(
    pass: &Pass,
    number: u32,
    draw: &Draw,
    window: Window,
) -> impl Iterator<Item = Assembled> {
    let pipeline = &pass.pipelines[draw.pipeline];
    let topology = pipeline.topology;
    let depth_limits = match pipeline.depth_clamp {
        true => draw.viewport_in(pass.extent).depths(),
        false => [0.0, 1.0],
    };
    let per_instance = topology.primitives(draw.count);
    (0..per_instance * draw.instances).map(move |n| {
        let (instance, primitive) = (draw.first_instance + n / per_instance, n % per_instance);
        let vertices = elements(topology, primitive).map(|element| Vertex {
            draw: number,
            instance,
            vertex: vertex_index(draw, element),
        });
        let provoking = provoking(pipeline, primitive);
        let primitive = Primitive { draw: number, instance, primitive };
        Assembled {
            provoking,
            primitive,
            vertices,
            window,
            bias: draw.depth_bias.filter(|_| topology.kind() == PrimitiveKind::Triangle),
            depth_bounds: draw.depth_bounds,
            stencil_reference: draw.stencil_reference,
            depth_limits,
        }
    })
}

/// The elements of a draw that its primitive number `i` consists of.
fn elements(topology: Topology, i: u32) -> [u32; 3] {
    match topology {
        Topology::TriangleList => [3 * i, 3 * i + 1, 3 * i + 2],
        Topology::TriangleStrip => [i, i + (1 + i % 2), i + (2 - i % 2)],
        Topology::TriangleFan => [i + 1, i + 2, 0],
        Topology::PointList => [i; 3],
        Topology::LineList => [2 * i, 2 * i + 1, 2 * i],
        Topology::LineStrip => [i, i + 1, i],
        Topology::TriangleListWithAdjacency => [6 * i, 6 * i + 2, 6 * i + 4],
        Topology::TriangleStripWithAdjacency => match i % 2 {
            0 => [2 * i, 2 * i + 2, 2 * i + 4],
            _ => [2 * i, 2 * i + 4, 2 * i + 2],
        },
        Topology::LineListWithAdjacency => [4 * i + 1, 4 * i + 2, 4 * i + 1],
        Topology::LineStripWithAdjacency => [i + 1, i + 2, i + 1],
    }
}

/// Which of the three elements of primitive number `i` gives its flat inputs: the one that comes first in the draw, or the one
/// that comes last. The hub of a fan is neither.
fn provoking(pipeline: &Pipeline, i: u32) -> u32 {
    let elements = elements(pipeline.topology, i);
    let is_fan = pipeline.topology == Topology::TriangleFan;
    let numbered = elements.into_iter().zip(0..).take(if is_fan { 2 } else { 3 });
    let found = match pipeline.provoking_vertex {
        ProvokingVertex::First => numbered.min_by_key(|(element, n)| (*element, *n)),
        ProvokingVertex::Last => numbered.max_by_key(|(element, n)| (*element, 3 - *n)),
    };
    found.expect("it has elements").1
}

/// `gl_VertexIndex` of an element of a draw.
fn vertex_index(draw: &Draw, element: u32) -> u32 {
    let element = draw.first + element;
    let Some(indices) = &draw.indices else { return element };
    let bytes = indices.range.host_bytes().expect("a snapshot lies on the host");
    let index = match indices.format {
        IndexFormat::U16 => u32::from(u16::from_ne_bytes(bytes.as_chunks().0[element as usize])),
        IndexFormat::U32 => u32::from_ne_bytes(bytes.as_chunks().0[element as usize]),
    };
    index.wrapping_add_signed(draw.base_vertex)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pass::{BufferRange, BufferSource, Indices};
    use std::sync::Arc;

    fn draw(first: u32, base_vertex: i32, indices: Option<Indices>) -> Draw {
        Draw { first, base_vertex, indices, ..Draw::new(0, 3) }
    }

    #[test]
    fn every_other_triangle_of_a_strip_swaps_two_vertices() {
        let strip = [0, 1, 2].map(|i| elements(Topology::TriangleStrip, i));
        assert_eq!(strip, [[0, 1, 2], [1, 3, 2], [2, 3, 4]]);
        let fan = [0, 1].map(|i| elements(Topology::TriangleFan, i));
        assert_eq!(fan, [[1, 2, 0], [2, 3, 0]]);
        let list = [0, 1].map(|i| elements(Topology::TriangleList, i));
        assert_eq!(list, [[0, 1, 2], [3, 4, 5]]);
        let strip = [0, 1].map(|i| elements(Topology::TriangleStripWithAdjacency, i));
        assert_eq!(strip, [[0, 2, 4], [2, 6, 4]]);
    }

    #[test]
    fn the_base_vertex_is_added_to_indices_only() {
        assert_eq!(vertex_index(&draw(7, 100, None), 2), 9);
        let bytes: Vec<u8> = [1u32, 2, 3, 40, 50, 60].map(u32::to_ne_bytes).concat();
        let buffer = Arc::new(BufferSource::new("indices", bytes));
        let range = BufferRange { buffer, offset: 8, bytes: 16 };
        let wide = Indices::new(range.clone(), IndexFormat::U32);
        assert_eq!(vertex_index(&draw(1, -5, Some(wide)), 2), 55);
        let narrow = Indices::new(range, IndexFormat::U16);
        let element = if cfg!(target_endian = "little") { 0 } else { 1 };
        assert_eq!(vertex_index(&draw(2, 0, Some(narrow)), element), 40);
    }
}
