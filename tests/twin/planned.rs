//! Would the twin notice a fault of compute's plan? A plan that misreads a field of a pass draws another pass. So the
//! device draws a pass with one field changed, and the reference takes the pass as it should be.

use super::{misplaced, pixels, shaders};
use crate::common::on_each_gpu;
use std::sync::Arc;
use tilewright::{
    compute,
    format::VertexFormat,
    grid::Capacities,
    image::Extent,
    pass::{
        BufferRange, BufferSource, Draw, IndexFormat, Indices, Pass, Pipeline, StepRate,
        VertexAttribute, VertexBinding,
    },
    reference,
    state::{Compare, Cull, DepthState, FrontFace, Rect, Topology, Viewport},
    target::DepthTarget,
    trace::{Positions, Shaded, Trace},
};

/// Three draws that overlap. The one in the middle uses every field of a draw.
fn pass() -> Pass {
    let (vertex, fragment) = shaders();
    let pipeline = |topology| {
        Arc::new(
            Pipeline::new("planned", vertex.clone(), fragment.clone())
                .vertex_bindings([VertexBinding { stride: 16, rate: StepRate::Vertex }])
                .vertex_attributes([VertexAttribute {
                    location: 0,
                    binding: 0,
                    format: VertexFormat::F32X4,
                    offset: 0,
                }])
                .topology(topology),
        )
    };
    let buffer = |label: &str, bytes| Arc::new(BufferSource::new(label, bytes));
    // Vertices of a zigzag, each in a place of its own. Two more than are bound follow.
    let zigzag = |z: f32| {
        let corner = |i: u8| {
            let x = f32::from(i) / 6.0 - 0.9;
            [x, if i.is_multiple_of(2) { -0.8 + x / 9.0 } else { 0.8 - x / 7.0 }, z + x / 9.0, 1.0]
        };
        let corners: Vec<[f32; 4]> = (0..12).map(corner).collect();
        let buffer = buffer("vertices", bytemuck::cast_slice(&corners).to_vec());
        BufferRange { buffer, offset: 0, bytes: 16 * 10 }
    };
    let draw = |pipeline, count, z| Draw::new(pipeline, count).vertex_buffers([zigzag(z)]).first(1);
    let mut middle = draw(1, 6, 0.4);
    let indices: [u32; 10] = [1, 2, 0, 3, 4, 1, 5, 2, 6, 7];
    let indices = buffer("indices", bytemuck::cast_slice(&indices).to_vec());
    middle.indices = Some(Indices::new(
        BufferRange { buffer: indices, offset: 4, bytes: 4 * 8 },
        IndexFormat::U32,
    ));
    middle.base_vertex = 1;
    middle.instances = 2;
    middle.first_instance = 3;
    middle.viewport = Some(Viewport {
        x: 2.0,
        y: 3.0,
        width: 88.0,
        height: 60.0,
        min_depth: 0.1,
        max_depth: 0.9,
    });
    middle.scissor = Some(Rect { x: 20, y: 15, width: 25, height: 30 });
    let topologies = [Topology::TriangleList, Topology::TriangleStrip, Topology::TriangleFan];
    Pass::new("planned", Extent::new(100, 70))
        .depth(DepthTarget::cleared(1.0))
        .pipelines(topologies.map(pipeline).to_vec())
        .draws([draw(0, 9, 0.45), middle, draw(2, 8, 0.5)])
}

/// The name of a field, and what misreading it makes of the pass.
type Fault = (&'static str, Box<dyn Fn(&mut Pass)>);

fn fault(name: &'static str, change: impl Fn(&mut Pass) + 'static) -> Fault {
    (name, Box::new(change))
}

fn of_draw(name: &'static str, change: impl Fn(&mut Draw) + 'static) -> Fault {
    fault(name, move |pass| change(&mut pass.draws[1]))
}

fn of_pipeline(name: &'static str, change: impl Fn(&mut Pipeline) + 'static) -> Fault {
    fault(name, move |pass| change(Arc::make_mut(&mut pass.pipelines[1])))
}

/// The ways of misreading the draw in the middle.
fn faults() -> Vec<Fault> {
    let viewport = |name, change: fn(&mut Viewport)| {
        of_draw(name, move |draw| change(draw.viewport.as_mut().unwrap()))
    };
    let scissor = |name, change: fn(&mut Rect)| {
        of_draw(name, move |draw| change(draw.scissor.as_mut().unwrap()))
    };
    let indices = |name, change: fn(&mut Indices)| {
        of_draw(name, move |draw| change(draw.indices.as_mut().unwrap()))
    };
    vec![
        of_draw("first element", |draw| draw.first += 1),
        of_draw("fewer elements", |draw| draw.count -= 1),
        of_draw("more elements", |draw| draw.count += 1),
        of_draw("base vertex", |draw| draw.base_vertex += 1),
        of_draw("no base vertex", |draw| draw.base_vertex = 0),
        of_draw("first instance", |draw| draw.first_instance = 0),
        of_draw("fewer instances", |draw| draw.instances -= 1),
        of_draw("more instances", |draw| draw.instances += 1),
        of_draw("no indices", |draw| draw.indices = None),
        of_draw("no viewport", |draw| draw.viewport = None),
        of_draw("no scissor", |draw| draw.scissor = None),
        of_draw("vertex buffer", |draw| draw.vertex_buffers[0].offset += 16),
        indices("offset of indices", |indices| indices.range.offset += 4),
        indices("width of indices", |indices| indices.format = IndexFormat::U16),
        viewport("viewport's x", |viewport| viewport.x += 0.125),
        viewport("viewport's y", |viewport| viewport.y += 0.125),
        viewport("viewport's width", |viewport| viewport.width -= 0.5),
        viewport("viewport upside down", |viewport| {
            viewport.y += viewport.height;
            viewport.height = -viewport.height;
        }),
        viewport("viewport's least depth", |viewport| viewport.min_depth = 0.0),
        viewport("viewport's largest depth", |viewport| viewport.max_depth = 1.0),
        scissor("scissor's x", |scissor| scissor.x -= 1),
        scissor("scissor's y", |scissor| scissor.y += 1),
        scissor("scissor's width", |scissor| scissor.width -= 1),
        scissor("scissor's height", |scissor| scissor.height -= 1),
        of_pipeline("topology", |pipeline| pipeline.topology = Topology::TriangleFan),
        of_pipeline("culling", |pipeline| pipeline.cull = Cull::Back),
        of_pipeline("front face", |pipeline| pipeline.front_face = FrontFace::Clockwise),
        of_pipeline("depth test", |pipeline| pipeline.depth = DepthState::OFF),
        of_pipeline("depth write", |pipeline| pipeline.depth.write = false),
        of_pipeline("depth comparison", |pipeline| pipeline.depth.compare = Compare::Greater),
        fault("pipeline", |pass| pass.draws[1].pipeline = 0),
        fault("draw left out", |pass| drop(pass.draws.remove(1))),
        fault("draw before it twice", |pass| pass.draws.insert(1, pass.draws[0].clone())),
        fault("draws out of order", |pass| pass.draws.swap(1, 2)),
    ]
}

/// What the twin says if the device draws `drawn` in place of `pass`.
fn found(renderer: &mut compute::Renderer, pass: &Pass, drawn: &Pass) -> Option<String> {
    let (_, trace) = renderer.trace(drawn).expect("it is drawn");
    assert!(pixels(&trace) > 1000, "only {} pixels are drawn", pixels(&trace));
    reference::first_difference(pass, &trace)
        .or_else(|| misplaced(pass, &trace).map(|vertex| format!("misplaced: {vertex}")))
}

#[test]
fn a_plan_that_misreads_a_field_is_noticed() {
    on_each_gpu("misread fields", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        let pass = pass();
        let small = Capacities { primitives: 2, vertices: 8, varying_words: 64 };
        for limit in [Capacities::DEFAULT, small] {
            renderer.set_batch_limit(limit);
            assert_eq!(found(&mut renderer, &pass, &pass), None);
            for (name, change) in faults() {
                let mut drawn = pass.clone();
                change(&mut drawn);
                let said = found(&mut renderer, &pass, &drawn);
                println!("{name}: {said:?}");
                let said = said.unwrap_or_else(|| panic!("{name}: nothing is noticed"));
                assert!(said.contains("draw 1, instance "), "{name}: {said}");
            }
            let mut drawn = pass.clone();
            drawn.depth = Some(DepthTarget::cleared(0.75));
            let said = found(&mut renderer, &pass, &drawn).expect("the clear value is noticed");
            assert!(said.contains("depth of pixel (0, 0)"), "{said}");
        }
    });
}

/// Each intermediate of a trace, changed a little, and what the comparison says.
#[test]
fn a_changed_intermediate_is_noticed() {
    let gpu = crate::common::gpu();
    let mut renderer = compute::Renderer::new(&gpu).expect("kernels are made");
    let pass = pass();
    let (_, right) = renderer.trace(&pass).expect("it is drawn");
    let notices = |change: &dyn Fn(&mut Trace), words: &str| {
        let mut trace = right.clone();
        change(&mut trace);
        let said = reference::first_difference(&pass, &trace).expect(words);
        assert!(said.contains(words), "`{words}` is missing: {said}");
    };
    // The first triangle of the draw in the middle is the fourth primitive.
    let (name, number) = ("draw 1, instance 3, primitive 0", 3);
    notices(
        &|trace| trace.bands[0][0].triangles[number][0].as_mut().unwrap().vertices.swap(0, 1),
        &format!("batch 0: primitive: triangles of {name}: "),
    );
    notices(
        &|trace| trace.bands[0][0].triangles[number][0].as_mut().unwrap().z += 1e-6,
        &format!("batch 0: primitive: triangles of {name}: "),
    );
    notices(
        &|trace| trace.bands[0][0].primitives.swap(number, number + 1),
        &format!(
            "assembly: primitive number {number} of the batch: draw 1, instance 3, primitive 1 against {name}"
        ),
    );
    let key = tilewright::trace::key(number, 0);
    notices(
        &|trace| {
            for cell in &mut trace.bands[0][0].cells {
                cell.retain(|&listed| listed != key);
            }
        },
        &format!(" against {name} "),
    );
    notices(
        &|trace| {
            let shown = trace.bands[0][0].visibility.iter_mut().find(|shown| **shown == key);
            *shown.expect("it is visible") = 0;
        },
        &format!("shows: nothing against {name} "),
    );
    notices(
        &|trace| {
            let batch = &mut trace.bands[0][0];
            let at = batch.visibility.iter().position(|&shown| shown == key).unwrap();
            batch.depth[at] += 1e-6;
        },
        &format!("of the band, {name}: "),
    );
    let lost = right.bands[0][0].triangles[number][0].unwrap().vertices[2];
    notices(
        &|trace| {
            let all = trace.positions.iter().filter(|(vertex, _)| *vertex != lost).collect();
            trace.positions = Positions::new(all);
        },
        &format!("{name} has a vertex that was not shaded: {lost}"),
    );
    notices(
        &|trace| {
            let again = [(lost, Shaded { position: [0.0; 4], distances: [0.0; 8] })];
            trace.positions = Positions::new(trace.positions.iter().chain(again).collect());
        },
        &format!("{lost} has several positions"),
    );
    notices(
        &|trace| trace.bands[0].clear(),
        "assembly: no batch has draw 0, instance 0, primitive 0",
    );
    notices(&|trace| trace.bands.clear(), "0 bands against 1");
}
