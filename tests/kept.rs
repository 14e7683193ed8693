//! Do executors keep a bounded number of objects from pass to pass, and make nothing twice? Each pass here makes
//! its shaders, textures and buffers anew, as a program does that builds each frame from scratch.

use crate::common::on_each_gpu;
use std::sync::Arc;
use tilewright::{
    classic, compute,
    format::{Format, VertexFormat},
    image::Extent,
    pass::{
        Binding, BindingEntry, BindingSet, BufferRange, BufferSource, Draw, Executor, Pass,
        Pipeline, StepRate, VertexAttribute, VertexBinding,
    },
    shader::{Shader, Stage},
    state::{Cull, DepthState},
    texture::{Sampler, Texture},
    vk::{Cached, Gpu},
};

const VERTEX: &str = "#version 450
layout(location = 0) in vec2 position;
void main() { gl_Position = vec4(position, 0.5, 1); }";

const FRAGMENT: &str = "#version 450
layout(set = 0, binding = 0) uniform sampler2D images[4];
layout(location = 0) out vec4 target;
void main() { target = texture(images[1], vec2(0.5)) * FACTOR; }";

fn shader(stage: Stage, label: &str, source: &str) -> Shader {
    Shader::from_glsl(stage, label, source).unwrap_or_else(|e| panic!("{e}"))
}

/// The two shaders; `factor` is written into the second.
fn shaders(factor: u32) -> (Shader, Shader) {
    let fragment = FRAGMENT.replace("FACTOR", &format!("{factor}.0 / 255.0"));
    (
        shader(Stage::Vertex, "kept.vert", VERTEX),
        shader(Stage::Fragment, &format!("kept {factor}.frag"), &fragment),
    )
}

/// A pass in which everything is new but its content.
fn pass(shaders: &(Shader, Shader), draws: usize) -> Pass {
    let corners: [[f32; 2]; 3] = [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]];
    let mesh = Arc::new(BufferSource::new("mesh", bytemuck::cast_slice(&corners).to_vec()));
    let levels = vec![vec![255; 4]];
    let white = Texture::new("white", Extent::new(1, 1), Format::Rgba8Unorm, levels);
    let white = Arc::new(white);
    let images = vec![Binding::Sampled(white, Sampler::default()); 4];
    let set =
        Arc::new(BindingSet { entries: vec![BindingEntry { binding: 0, resources: images }] });
    let pipeline = Pipeline::new("kept", Arc::new(shaders.0.clone()), Arc::new(shaders.1.clone()))
        .vertex_bindings([VertexBinding { stride: 8, rate: StepRate::Vertex }])
        .vertex_attributes([VertexAttribute {
            location: 0,
            binding: 0,
            format: VertexFormat::F32X2,
            offset: 0,
        }]);
    let draw = Draw::new(0, 3).sets([set]).vertex_buffers([BufferRange::whole(&mesh)]);
    let mut pass = Pass::new("kept", Extent::new(4, 4));
    pass.colors[0].format = Format::Rgba8Unorm;
    pass.pipelines = vec![Arc::new(pipeline)];
    pass.draws = vec![draw; draws];
    pass
}

/// An executor, and how to count the objects that it keeps.
type Kind<E> = (E, fn(&E) -> Cached);

fn compute(gpu: &Gpu) -> Kind<compute::Renderer> {
    (compute::Renderer::new(gpu).expect("kernels are made"), compute::Renderer::cached)
}

fn classic(gpu: &Gpu) -> Kind<classic::Renderer> {
    (classic::Renderer::new(gpu).expect("it draws"), classic::Renderer::cached)
}

/// Renders `pass` and asserts that all of it has one colour.
fn draw(executor: &mut impl Executor, pass: &Pass, grey: u8) {
    let frame = executor.render(pass).expect("it is drawn");
    let color = frame.into_color().expect("a colour target");
    assert!(color.bytes.iter().all(|&channel| channel == grey), "{:?}", &color.bytes[..4]);
}

fn wrapped_anew<E: Executor>((mut executor, cached): Kind<E>) {
    let shaders = shaders(200);
    draw(&mut executor, &pass(&shaders, 1), 200);
    let first = cached(&executor);
    assert!(first.pipelines > 0 && first.buffers == 1 && first.textures == 1, "{first:?}");
    for _ in 0..20 {
        draw(&mut executor, &pass(&shaders, 1), 200);
        assert_eq!(cached(&executor), first);
    }
}

#[test]
fn content_that_is_wrapped_anew_is_known() {
    on_each_gpu("content that is wrapped anew", |gpu| {
        wrapped_anew(compute(gpu));
        wrapped_anew(classic(gpu));
    });
}

#[test]
fn shaders_that_are_always_new_do_not_add_up() {
    let gpu = crate::common::gpu();
    let ((mut compute, _), (mut classic, _)) = (compute(&gpu), classic(&gpu));
    for factor in 0..80 {
        let pass = pass(&shaders(factor), 1);
        compute.prepare(&pass).expect("kernels are made");
        classic.prepare(&pass).expect("pipelines are made");
        // The vertex shader is the same in all of them.
        let kept = (compute.cached().pipelines, classic.cached().pipelines);
        assert!(kept.0 <= 66 && kept.1 <= 65, "{kept:?} after {factor} passes");
    }
    // Dropped objects are made again.
    draw(&mut compute, &pass(&shaders(0), 1), 0);
    draw(&mut classic, &pass(&shaders(0), 1), 0);
}

#[test]
fn a_pipeline_that_differs_in_anything_is_another_one() {
    let gpu = crate::common::gpu();
    let (mut executor, cached) = classic(&gpu);
    let shaders = shaders(100);
    let states: [fn(&mut Pipeline); 4] = [
        |_| {},
        |p| p.cull = Cull::Front,
        |p| p.depth = DepthState::OFF,
        |p| p.label = "another name".into(),
    ];
    for (state, expected) in states.iter().zip([1, 2, 3, 3]) {
        let mut pass = pass(&shaders, 1);
        let mut pipeline = (*pass.pipelines[0]).clone();
        state(&mut pipeline);
        pass.pipelines = vec![Arc::new(pipeline)];
        executor.render(&pass).expect("it is drawn");
        assert_eq!(cached(&executor).pipelines, expected);
    }
}

#[test]
fn draws_that_share_an_array_of_textures_share_its_slots() {
    let gpu = crate::common::gpu();
    let (mut executor, cached) = compute(&gpu);
    // Each of them with slots of its own would fill several tables.
    draw(&mut executor, &pass(&shaders(50), 3000), 50);
    assert_eq!(cached(&executor).tables, 1);
}

#[test]
fn a_table_is_used_again_only_when_no_prepared_pass_has_it() {
    on_each_gpu("tables of prepared passes", |gpu| {
        let (mut renderer, cached) = compute(gpu);
        let grey = |prepared: &mut compute::Prepared, grey: u8| {
            prepared.execute().expect("it runs");
            let color = prepared.read_color().expect("it is there");
            assert!(color.bytes.iter().all(|&c| c == grey), "{:?}", &color.bytes[..4]);
        };
        let mut first = renderer.prepare(&pass(&shaders(10), 1)).expect("a valid pass");
        let mut second = renderer.prepare(&pass(&shaders(20), 1)).expect("a valid pass");
        assert_eq!(cached(&renderer).tables, 2);
        grey(&mut second, 20);
        grey(&mut first, 10);
        drop(first);
        let mut third = renderer.prepare(&pass(&shaders(30), 1)).expect("a valid pass");
        assert_eq!(cached(&renderer).tables, 2);
        grey(&mut second, 20);
        grey(&mut third, 30);
    });
}
