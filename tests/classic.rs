//! Does the classic executor draw what Vulkan says, on every driver, without a validation message?

use crate::common::{gpu, on_each_gpu};
use std::sync::Arc;
use tilewright::{
    classic::Renderer,
    format::{Format, Numeric, Packing, VertexFormat},
    image::Extent,
    pass::{
        Binding, BindingEntry, BindingSet, BufferRange, BufferSource, Draw, Executor, IndexFormat,
        Indices, Pass, Pipeline, StepRate, VertexAttribute, VertexBinding,
    },
    shader::{Shader, Stage},
    state::{Blend, Cull, DepthState, FrontFace, Rect, Topology, Viewport},
    target::{ColorTarget, DepthTarget},
    texture::{Sampler, Texture, Wrap},
    vk::Gpu,
};

fn shader(stage: Stage, label: &str, body: &str) -> Arc<Shader> {
    let source = format!("#version 450\n{body}");
    Arc::new(Shader::from_glsl(stage, label, &source).unwrap_or_else(|e| panic!("{e}")))
}

fn buffer<T: bytemuck::Pod>(label: &str, content: &[T]) -> Arc<BufferSource> {
    Arc::new(BufferSource::new(label, bytemuck::cast_slice(content).to_vec()))
}

/// Position in xy(z), colour from a location or constants: enough for most cases here.
const FLAT_VERT: &str = "layout(location = 0) in vec3 position;
layout(location = 1) in vec4 color;
layout(location = 0) out vec4 out_color;
void main() { gl_Position = vec4(position, 1); out_color = color; }";
const FLAT_FRAG: &str = "layout(location = 0) in vec4 color;
layout(location = 0) out vec4 out_color;
void main() { out_color = color; }";

fn pipeline(vertex: &str, fragment: &str) -> Pipeline {
    Pipeline::new(
        "test",
        shader(Stage::Vertex, "test.vert", vertex),
        shader(Stage::Fragment, "test.frag", fragment),
    )
    .depth(DepthState::OFF)
}

/// Positions as three floats in binding 0, colours as four bytes in binding 1.
fn flat_pipeline() -> Pipeline {
    let rate = StepRate::Vertex;
    let unorm = VertexFormat::from(Format::Rgba8Unorm);
    pipeline(FLAT_VERT, FLAT_FRAG)
        .vertex_bindings([VertexBinding { stride: 12, rate }, VertexBinding { stride: 4, rate }])
        .vertex_attributes([
            VertexAttribute { location: 0, binding: 0, format: VertexFormat::F32X3, offset: 0 },
            VertexAttribute { location: 1, binding: 1, format: unorm, offset: 0 },
        ])
}

fn pass(extent: Extent, pipelines: Vec<Pipeline>, draws: Vec<Draw>) -> Pass {
    Pass::new("test", extent)
        .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0, 0.0, 0.0, 1.0])])
        .pipelines(pipelines.into_iter().map(Arc::new))
        .draws(draws)
}

/// A draw of triangles with one colour per vertex.
fn flat_draw(positions: &[[f32; 3]], colors: &[[u8; 4]]) -> Draw {
    let ranges = [buffer("positions", positions), buffer("colors", colors)];
    Draw::new(0, positions.len() as u32)
        .vertex_buffers(ranges.iter().map(BufferRange::whole).collect::<Vec<_>>())
}

/// Two triangles over the whole target at depth `z`, all of one colour.
fn full_screen(z: f32, color: [u8; 4]) -> Draw {
    let (a, b, c, d) = ([-1.0, -1.0, z], [1.0, -1.0, z], [-1.0, 1.0, z], [1.0, 1.0, z]);
    flat_draw(&[a, b, c, b, d, c], &[color; 6])
}

fn render(gpu: &Gpu, pass: &Pass) -> tilewright::pass::Frame {
    Renderer::new(gpu).unwrap().render(pass).unwrap_or_else(|e| panic!("{e}"))
}

const RED: [u8; 4] = [255, 0, 0, 255];
const GREEN: [u8; 4] = [0, 255, 0, 255];
const BLUE: [u8; 4] = [0, 0, 255, 255];
const BLACK: [u8; 4] = [0, 0, 0, 255];

#[test]
fn half_of_the_target_is_covered_by_one_triangle() {
    on_each_gpu("half of the target is covered by one triangle", |gpu| {
        let draw = flat_draw(&[[-1.0, -1.0, 0.0], [1.0, -1.0, 0.0], [-1.0, 1.0, 0.0]], &[RED; 3]);
        let frame = render(gpu, &pass(Extent::new(17, 13), vec![flat_pipeline()], vec![draw]));
        assert_eq!(frame.colors[0].texel(0, 0), RED);
        assert_eq!(frame.colors[0].texel(16, 12), BLACK);
        let red = frame.colors[0].bytes.chunks(4).filter(|p| *p == RED).count();
        assert!((100..=118).contains(&red), "{red} of 221 pixels");
        assert!(frame.depth.is_none());
    });
}

#[test]
fn targets_are_read_only_after_they_were_drawn() {
    on_each_gpu("targets are read only after they were drawn", |gpu| {
        let pass = pass(Extent::new(4, 4), vec![flat_pipeline()], vec![full_screen(0.5, BLUE)]);
        let mut prepared = Renderer::new(gpu).unwrap().prepare(&pass).unwrap();
        for error in [prepared.read().unwrap_err(), prepared.read_color().unwrap_err()] {
            assert!(error.to_string().contains("execute it first"), "{error}");
        }
        prepared.execute().unwrap();
        assert_eq!(prepared.read_color().unwrap().texel(3, 3), BLUE);
    });
}

#[test]
fn nearer_wins_and_depth_is_read_back() {
    on_each_gpu("nearer wins and depth is read back", |gpu| {
        let mut near = full_screen(0.25, GREEN);
        near.scissor = Some(Rect { x: 0, y: 0, width: 4, height: 8 });
        let far = full_screen(0.75, RED);
        let pipeline = flat_pipeline().depth(DepthState::LESS);
        let mut pass = pass(Extent::new(8, 8), vec![pipeline], vec![near, far]);
        pass.depth = Some(DepthTarget::cleared(1.0));
        let frame = render(gpu, &pass);
        assert_eq!(frame.colors[0].texel(3, 7), GREEN);
        assert_eq!(frame.colors[0].texel(4, 0), RED);
        let depths = frame.depth.unwrap().depths();
        assert_eq!((depths[0], depths[7]), (0.25, 0.75));
    });
}

#[test]
fn faces_are_culled_by_their_winding_on_the_screen() {
    on_each_gpu("faces are culled by their winding on the screen", |gpu| {
        // Clockwise as seen on the screen, whose y points down.
        let draw = flat_draw(&[[-1.0, -1.0, 0.0], [3.0, -1.0, 0.0], [-1.0, 3.0, 0.0]], &[RED; 3]);
        for (cull, front_face, drawn) in [
            (Cull::Back, FrontFace::Clockwise, true),
            (Cull::Back, FrontFace::CounterClockwise, false),
            (Cull::Front, FrontFace::Clockwise, false),
            (Cull::None, FrontFace::Clockwise, true),
        ] {
            let pipeline = flat_pipeline().cull(cull).front_face(front_face);
            let frame = render(gpu, &pass(Extent::new(4, 4), vec![pipeline], vec![draw.clone()]));
            let expected = if drawn { RED } else { BLACK };
            assert_eq!(frame.colors[0].texel(2, 2), expected, "{cull:?} {front_face:?}");
        }
    });
}

#[test]
fn alpha_is_blended_in_order() {
    on_each_gpu("alpha is blended in order", |gpu| {
        let pipeline = flat_pipeline().blend(Blend::ALPHA);
        let draws = vec![full_screen(0.5, [255, 0, 0, 128]), full_screen(0.5, [0, 255, 0, 128])];
        let frame = render(gpu, &pass(Extent::new(2, 2), vec![pipeline], draws));
        // 128/255 of red on black, then 128/255 of green on that.
        for (value, expected) in frame.colors[0].texel(1, 1).iter().zip([64i32, 128, 0, 255]) {
            assert!((i32::from(*value) - expected).abs() <= 1, "{:?}", frame.colors[0].texel(1, 1));
        }
    });
}

#[test]
fn indices_instances_viewports_and_strips_are_drawn() {
    on_each_gpu("indices, instances, viewports and strips are drawn", |gpu| {
        // One quad a column of 4 pixels wide, moved right by the instance.
        let vertex = "layout(location = 0) in vec2 corner;
layout(location = 1) in float column;
layout(location = 2) in uvec3 paint;
layout(location = 0) flat out uvec3 out_paint;
void main() {
    gl_Position = vec4((corner.x + column) * 0.5 - 1.0, corner.y * 2.0 - 1.0, 0, 1);
    out_paint = paint * uint(gl_InstanceIndex > 0);
}";
        let fragment = "layout(location = 0) flat in uvec3 paint;
layout(location = 0) out vec4 color;
void main() { color = vec4(paint, 1); }";
        let small = |numeric, count| VertexFormat::new(numeric, Packing::Bits8, count);
        let attribute = |location, binding, format, offset| VertexAttribute {
            location,
            binding,
            format,
            offset,
        };
        let pipeline = pipeline(vertex, fragment)
            .topology(Topology::TriangleStrip)
            .vertex_bindings([
                VertexBinding { stride: 8, rate: StepRate::Vertex },
                VertexBinding { stride: 7, rate: StepRate::Instance },
            ])
            .vertex_attributes([
                attribute(0, 0, VertexFormat::F32X2, 0),
                attribute(1, 1, small(Numeric::Unorm, 1), 0),
                attribute(2, 1, small(Numeric::Uint, 3), 4),
            ]);
        // Column 0 or 1 of the left half, from normalized bytes; the first instance is skipped.
        let instances: [[u8; 7]; 3] = [[9; 7], [0, 9, 9, 9, 1, 0, 0], [255, 9, 9, 9, 0, 0, 1]];
        let corners = [[9.0f32, 9.0], [0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]];
        let indices = [7u16, 0, 1, 2, 3];
        let draw = Draw::new(0, 4)
            .vertex_buffers([
                BufferRange::whole(&buffer("corners", &corners)),
                BufferRange::whole(&buffer("instances", &instances)),
            ])
            .indices(Some(Indices::new(
                BufferRange::whole(&buffer("indices", &indices)),
                IndexFormat::U16,
            )))
            .first(1)
            .base_vertex(1)
            .instances(2)
            .first_instance(1)
            .viewport(Viewport {
                x: 8.0,
                y: 0.0,
                width: 16.0,
                height: 4.0,
                min_depth: 0.0,
                max_depth: 1.0,
            });
        let frame = render(gpu, &pass(Extent::new(24, 4), vec![pipeline], vec![draw]));
        let row: Vec<_> =
            (0..24).step_by(4).map(|x| frame.colors[0].texel(x, 2).to_vec()).collect();
        assert_eq!(row, [BLACK, BLACK, RED, BLUE, BLACK, BLACK]);
    });
}

#[test]
fn every_kind_of_resource_reaches_the_shaders() {
    on_each_gpu("every kind of resource reaches the shaders", |gpu| {
        let vertex = "layout(set = 2, binding = 3) uniform Corners { vec4 corner[3]; };
void main() { gl_Position = corner[gl_VertexIndex]; }";
        let fragment = "layout(constant_id = 5) const float FACTOR = 0.0;
layout(set = 0, binding = 1) uniform sampler2D images[2];
layout(set = 0, binding = 4) uniform texture2D plain;
layout(set = 0, binding = 5) uniform sampler nearest;
layout(set = 2, binding = 0) readonly buffer Table { float scale[]; };
layout(push_constant) uniform Push { vec4 offset; float alpha; };
layout(location = 0) out vec4 color;
void main() {
    float a = textureLod(images[0], vec2(0.5), 0).r;
    float b = textureLod(images[1], vec2(0.5), 1).g;
    float c = textureLod(sampler2D(plain, nearest), vec2(0.9, 0.1), 0).b;
    color = vec4(vec3(a, b, c) * scale[3] * FACTOR + offset.rgb, alpha);
}";
        let texture = |label: &str, levels: Vec<Vec<u8>>| {
            let extent = Extent::new(2, 2);
            Arc::new(Texture::new(label, extent, Format::Rgba8Unorm, levels))
        };
        let white = texture("white", vec![vec![255; 16]]);
        let levels = texture("levels", vec![vec![0; 16], vec![255; 4]]);
        let mut quarter = vec![0; 16];
        quarter[4..8].fill(255);
        let quarter = texture("quarter", vec![quarter]);
        let linear = Sampler::default();
        let nearest = Sampler::nearest().wrap_v(Wrap::MirroredRepeat);
        let mut words = vec![0.0f32; 64];
        words.extend([0.0, 0.0, 0.0, 2.0]);
        let corners = [[-1.0f32, -1.0, 0.0, 1.0], [3.0, -1.0, 0.0, 1.0], [-1.0, 3.0, 0.0, 1.0]];
        let entry = |binding, resources| BindingEntry { binding, resources };
        let table = buffer("table", &words);
        let draw = Draw::new(0, 3)
            .sets([
                Arc::new(BindingSet {
                    entries: vec![
                        entry(5, vec![Binding::Sampler(nearest)]),
                        entry(4, vec![Binding::Texture(quarter)]),
                        entry(
                            1,
                            vec![
                                Binding::Sampled(white, nearest),
                                Binding::Sampled(levels, linear),
                            ],
                        ),
                    ],
                }),
                Arc::new(BindingSet::default()),
                Arc::new(BindingSet {
                    entries: vec![
                        entry(
                            0,
                            vec![Binding::Storage(BufferRange {
                                buffer: table,
                                offset: 256,
                                bytes: 16,
                            })],
                        ),
                        entry(
                            3,
                            vec![Binding::Uniform(BufferRange::whole(&buffer(
                                "corners", &corners,
                            )))],
                        ),
                    ],
                }),
            ])
            .push_constants(bytemuck::cast_slice(&[0.0f32, 0.0, -0.5, 9.0, 0.6]).to_vec());
        let pipeline = pipeline(vertex, fragment).specialization([(5, 0.5f32.to_bits()), (99, 0)]);
        let frame = render(gpu, &pass(Extent::new(4, 4), vec![pipeline], vec![draw]));
        let texel = frame.colors[0].texel(2, 1);
        for (value, expected) in texel.iter().zip([255i32, 255, 128, 153]) {
            assert!((i32::from(*value) - expected).abs() <= 1, "{texel:?}");
        }
    });
}

#[test]
fn arrays_are_as_long_as_what_is_bound() {
    on_each_gpu("arrays are as long as what is bound", |gpu| {
        let vertex = "layout(push_constant) uniform Push { uint column; };
layout(location = 0) flat out uint out_column;
void main() {
    vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1);
    gl_Position = vec4((float(column) + corner.x) / 2.0 - 1.0, corner.y * 2.0 - 1.0, 0, 1);
    out_column = column;
}";
        let fragment = "#extension GL_EXT_nonuniform_qualifier : require
layout(binding = 7) uniform sampler2D images[];
layout(location = 0) flat in uint column;
layout(location = 0) out vec4 color;
void main() {
    if (gl_FragCoord.y > 2.0) discard;
    color = textureLod(images[nonuniformEXT(column)], vec2(0.5), 0);
}";
        let images: Vec<_> = [RED, GREEN, BLUE]
            .map(|color| {
                let (one, format) = (Extent::new(1, 1), Format::Rgba8Srgb);
                let texture = Texture::new("one", one, format, vec![color.to_vec()]);
                Binding::Sampled(Arc::new(texture), Sampler::default())
            })
            .into();
        // Draws of one pipeline may bind arrays of different length.
        let draws = [(0, 1), (1, 2), (2, 3)].map(|(column, bound)| {
            Draw::new(0, 4)
                .sets([Arc::new(BindingSet {
                    entries: vec![BindingEntry { binding: 7, resources: images[..bound].to_vec() }],
                })])
                .push_constants(u32::to_ne_bytes(column).to_vec())
        });
        let pipeline = pipeline(vertex, fragment).topology(Topology::TriangleStrip);
        let frame = render(gpu, &pass(Extent::new(8, 4), vec![pipeline], draws.to_vec()));
        let row = |y| [0, 2, 4, 6].map(|x| frame.colors[0].texel(x, y).to_vec());
        assert_eq!(row(1), [RED, GREEN, BLUE, BLACK]);
        assert_eq!(row(2), [BLACK; 4]);
    });
}

#[test]
fn what_shaders_write_is_gone_with_the_pass() {
    on_each_gpu("what shaders write is gone with the pass", |gpu| {
        let vertex = "void main() {
    gl_Position = vec4(gl_VertexIndex == 1 ? 3 : -1, gl_VertexIndex == 2 ? 3 : -1, 0, 1);
}";
        let fragment = "layout(set = 0, binding = 0) buffer Count { uint count; };
layout(location = 0) out vec4 color;
void main() { color = vec4(float(atomicAdd(count, 1u)) / 255.0); }";
        let entries = vec![BindingEntry {
            binding: 0,
            resources: vec![Binding::Storage(BufferRange::whole(&buffer("count", &[7u32])))],
        }];
        let set = Arc::new(BindingSet { entries });
        let draw = Draw::new(0, 3).sets([set]);
        let pass = pass(Extent::new(1, 1), vec![pipeline(vertex, fragment)], vec![draw]);
        let mut renderer = Renderer::new(gpu).unwrap();
        let mut prepared = renderer.prepare(&pass).unwrap();
        for _ in 0..3 {
            prepared.execute().unwrap();
            assert_eq!(prepared.read().unwrap().colors[0].texel(0, 0), [7; 4]);
            assert_eq!(prepared.read().unwrap().colors[0].texel(0, 0), [7; 4]);
        }
        assert_eq!(renderer.render(&pass).unwrap().colors[0].texel(0, 0), [7; 4]);
    });
}

#[test]
fn targets_of_every_format_are_cleared_and_drawn() {
    on_each_gpu("targets of every format are cleared and drawn", |gpu| {
        let clear = [0.5, 0.25, 1.0, 0.0];
        for (format, expected) in [
            (Format::Rgba8Unorm, vec![128u8, 64, 255, 0]),
            (Format::Rgba8Srgb, vec![188, 137, 255, 0]),
            (Format::Rgba16Float, vec![0, 0x38, 0, 0x34, 0, 0x3c, 0, 0]),
        ] {
            let mut pass = pass(Extent::new(3, 2), vec![], vec![]);
            pass.colors = vec![ColorTarget::cleared(format, clear)];
            let frame = render(gpu, &pass);
            let close = |(a, b): (&u8, &u8)| a.abs_diff(*b) <= 1;
            let texel = frame.colors[0].texel(2, 1);
            assert!(texel.iter().zip(&expected).all(close), "{format:?}: {texel:?}");
        }
    });
}

#[test]
fn what_a_device_lacks_is_named_and_not_tried() {
    let case = "what a device lacks is named and not tried";
    let Some(gpu) = crate::common::swiftshader(case) else { return };
    let fragment = "layout(location = 0) out vec4 color;
void main() { color = vec4(float(gl_PrimitiveID)); }";
    let vertex = "void main() { gl_Position = vec4(0, 0, 0, 1); }";
    let pass = pass(Extent::new(1, 1), vec![pipeline(vertex, fragment)], vec![Draw::new(0, 3)]);
    let text = Renderer::new(&gpu).unwrap().render(&pass).unwrap_err().to_string();
    assert!(text.contains("test.frag") && text.contains("geometryShader"), "{text}");
}

#[test]
fn what_does_not_fit_the_device_is_refused() {
    let case = "what does not fit the device is refused";
    let Some(gpu) = crate::common::swiftshader(case) else { return };
    let mut renderer = Renderer::new(&gpu).unwrap();
    let error = renderer.render(&pass(Extent::new(16384, 1), vec![], vec![])).unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, tilewright::Error::Full(_)), "{text}");
    assert!(text.contains("16384x1") && text.contains("8192"), "{text}");
}

#[test]
fn unusual_sizes_are_drawn_to_the_last_pixel() {
    let gpu = gpu();
    for extent in [Extent::new(1, 1), Extent::new(1921, 1079), Extent::new(16384, 16)] {
        let frame = render(&gpu, &pass(extent, vec![flat_pipeline()], vec![full_screen(0.5, RED)]));
        assert!(frame.colors[0].bytes.chunks(4).all(|p| p == RED), "{extent}");
    }
}

#[test]
fn a_pass_is_uploaded_once_and_forgotten_when_it_goes() {
    let gpu = gpu();
    let mut renderer = Renderer::new(&gpu).unwrap();
    // The same addresses are likely to come back for other content.
    for n in 0..20u8 {
        let color = [n * 10, 255 - n * 10, n, 255];
        let pass = pass(Extent::new(2, 2), vec![flat_pipeline()], vec![full_screen(0.5, color)]);
        for _ in 0..2 {
            assert_eq!(renderer.render(&pass).unwrap().colors[0].texel(1, 1), color);
        }
    }
}
