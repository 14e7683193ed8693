//! Does an index beyond an array of resources stay in the array?

use crate::common::{gpu, on_each_gpu};
use std::sync::Arc;
use tilewright::{
    compute,
    format::Format,
    image::Extent,
    pass::{Binding, BindingEntry, BindingSet, BufferRange, BufferSource, Draw, Pass, Pipeline},
    shader::{Shader, Stage},
    state::{DepthState, Rect},
    target::DepthTarget,
    texture::{Sampler, Texture, Wrap},
};

const RED: [u8; 4] = [255, 0, 0, 255];
const GREEN: [u8; 4] = [0, 255, 0, 255];
const BLUE: [u8; 4] = [0, 0, 255, 255];

/// Two that an array of two has, and others.
const INDICES: [i32; 9] = [0, 1, 2, 3, -1, i32::MIN, i32::MAX, 1 << 20, 1 << 16];

fn shader(stage: Stage, body: &str) -> Arc<Shader> {
    let source = format!(
        "#version 460
         #extension GL_EXT_nonuniform_qualifier : require
         #extension GL_EXT_samplerless_texture_functions : require
         layout(push_constant) uniform Push {{ int n; }};
         {body}"
    );
    Arc::new(Shader::from_glsl(stage, "array", &source).unwrap_or_else(|e| panic!("{e}")))
}

fn texture(texels: &[[u8; 4]]) -> Arc<Texture> {
    let extent = Extent::new(texels.len() as u32, 1);
    Arc::new(Texture::new("texels", extent, Format::Rgba8Unorm, vec![texels.concat()]))
}

fn block(color: [u8; 4]) -> BufferRange {
    let bytes = color.iter().flat_map(|c| (f32::from(*c) / 255.0).to_ne_bytes()).collect();
    BufferRange::whole(&Arc::new(BufferSource::new("color", bytes)))
}

fn sampled(color: [u8; 4]) -> Binding {
    Binding::Sampled(texture(&[color]), SAMPLER)
}

const SAMPLER: Sampler = Sampler::nearest().wrap_u(Wrap::Repeat).wrap_v(Wrap::Repeat);

/// A sampler that finds this colour at 1.45 of the row: at texel 1.8, 2.2 or 3.
fn sampler(color: [u8; 4]) -> Binding {
    let wrap_u = match color {
        BLUE => Wrap::ClampToEdge,
        GREEN => Wrap::MirroredRepeat,
        _ => Wrap::Repeat,
    };
    Binding::Sampler(SAMPLER.wrap_u(wrap_u))
}

/// Draws with a [`set`] for each of [`INDICES`]: the colours that the elements `list[n]` give.
fn colors(
    renderer: &mut compute::Renderer,
    vertex: &str,
    fragment: &str,
    bind: fn([u8; 4]) -> Binding,
    elements: &[[u8; 4]],
) -> Vec<[u8; 4]> {
    let mut pass = pass(vertex, fragment);
    let set = set(bind, elements);
    let mut render = |n: i32| {
        pass.draws = vec![draw(&set, n)];
        renderer.render(&pass).unwrap().colors[0].texel(3, 3).try_into().unwrap()
    };
    INDICES.into_iter().map(&mut render).collect()
}

/// A pass without draws.
fn pass(vertex: &str, fragment: &str) -> Pass {
    let corner = "vec4(vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1) * 4.0 - 1.0, 0, 1)";
    let vertex = vertex.replace("CORNER", corner);
    let mut pass = Pass::new("arrays", Extent::new(8, 8));
    pass.colors[0].format = Format::Rgba8Unorm;
    pass.pipelines.push(Arc::new(
        Pipeline::new("array", shader(Stage::Vertex, &vertex), shader(Stage::Fragment, fragment))
            .depth(DepthState::OFF),
    ));
    pass
}

/// A set of red resources before and after `elements` of an array.
fn set(bind: fn([u8; 4]) -> Binding, elements: &[[u8; 4]]) -> Arc<BindingSet> {
    let entry = |binding, resources| BindingEntry { binding, resources };
    let entries = vec![
        entry(0, vec![bind(RED); 3]),
        entry(1, elements.iter().map(|color| bind(*color)).collect()),
        entry(2, vec![bind(RED); 3]),
        // A row of colours for the samplers.
        entry(3, vec![Binding::Texture(texture(&[BLUE, RED, GREEN, BLUE]))]),
        entry(4, vec![Binding::Sampler(SAMPLER)]),
    ];
    Arc::new(BindingSet { entries })
}

/// A draw over the whole target that selects element `n`.
fn draw(set: &Arc<BindingSet>, n: i32) -> Draw {
    let push_constants = n.to_ne_bytes().to_vec();
    Draw::new(0, 3).sets([set.clone()]).push_constants(push_constants)
}

/// The colours that arrays of `length` elements have to show: that of the element, the last one beyond.
fn expected(elements: &[[u8; 4]]) -> Vec<[u8; 4]> {
    let last = elements.len() as u32 - 1;
    INDICES.into_iter().map(|n| elements[(n as u32).min(last) as usize]).collect()
}

const PLAIN: &str = "void main() { gl_Position = CORNER; }";

/// A kind of resource: how variables of it are declared, the colour of the one called `NAME`, and how such a
/// colour is bound.
type Kind<'a> = (&'a str, &'a str, fn([u8; 4]) -> Binding);

const KINDS: [Kind; 5] = [
    ("uniform sampler2D", "texture(NAME, vec2(0.5))", sampled),
    ("uniform texture2D", "texelFetch(NAME, ivec2(0), 0)", |color| {
        Binding::Texture(texture(&[color]))
    }),
    ("uniform sampler", "texture(sampler2D(row, NAME), vec2(1.45, 0.5))", sampler),
    ("uniform", "NAME.color", |color| Binding::Uniform(block(color))),
    ("readonly buffer", "NAME.color", |color| Binding::Storage(block(color))),
];

/// The declarations of a kind, with `list` of these dimensions, and the sum of its element `index` and nothing.
fn parts((kind, value, _): Kind, list: &str, index: &str) -> [String; 2] {
    let declare = |binding: u32, name: &str, array: &str| {
        let block = if matches!(kind, "uniform" | "readonly buffer") {
            format!("Block{binding} {{ vec4 color; }}")
        } else {
            String::new()
        };
        format!("layout(binding = {binding}) {kind} {block} {name}{array};\n")
    };
    let mut declared = declare(0, "a", "[3]") + &declare(1, "list", list) + &declare(2, "z", "[3]");
    if value.contains("row") {
        declared += "layout(binding = 3) uniform texture2D row;\n";
    }
    let of = |name: &str| value.replace("NAME", name);
    let element = of(&format!("list{index}"));
    [declared, format!("{element} + 0.0 * ({} + {})", of("a[2]"), of("z[0]"))]
}

#[test]
fn an_index_beyond_an_array_selects_its_last_element() {
    on_each_gpu("an index beyond an array selects its last element", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for kind in KINDS {
            for list in ["[2]", "[]"] {
                let [declared, value] = parts(kind, list, "[nonuniformEXT(n)]");
                let fragment = format!(
                    "{declared} layout(location = 0) out vec4 color;
                     void main() {{ color = {value}; }}"
                );
                let found = colors(&mut renderer, PLAIN, &fragment, kind.2, &[GREEN, BLUE]);
                assert_eq!(found, expected(&[GREEN, BLUE]), "{} list{list}", kind.0);
            }
        }
    });
}

#[test]
fn an_array_of_one_element_has_no_other() {
    on_each_gpu("an array of one element has no other", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for (kind, list) in [(KINDS[1], "[1]"), (KINDS[4], "[]")] {
            let [declared, value] = parts(kind, list, "[n]");
            let fragment = format!(
                "{declared} layout(location = 0) out vec4 color;
                 void main() {{ color = {value}; }}"
            );
            let found = colors(&mut renderer, PLAIN, &fragment, kind.2, &[BLUE]);
            assert_eq!(found, expected(&[BLUE]), "{} list{list}", kind.0);
        }
    });
}

#[test]
fn an_index_beyond_an_array_selects_its_last_element_for_vertices() {
    on_each_gpu("an index beyond an array selects its last element for vertices", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for kind in KINDS {
            // Level 0: vertices have no derivatives.
            let value = kind.1.replace("texture(", "textureLod(").replace("0.5))", "0.5), 0.0)");
            let [declared, value] = parts((kind.0, &value, kind.2), "[2]", "[n]");
            let vertex = format!(
                "{declared} layout(location = 0) out vec4 shade;
                 void main() {{ gl_Position = CORNER; shade = {value}; }}"
            );
            let fragment = "layout(location = 0) in vec4 shade;
                layout(location = 0) out vec4 color;
                void main() { color = shade; }";
            let found = colors(&mut renderer, &vertex, fragment, kind.2, &[GREEN, BLUE]);
            assert_eq!(found, expected(&[GREEN, BLUE]), "{}", kind.0);
        }
    });
}

/// One kernel shades both draws, and lanes of one subgroup shade pixels of both.
#[test]
fn each_draw_has_the_length_that_it_binds() {
    on_each_gpu("each draw has the length that it binds", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        for kind in KINDS {
            let [declared, value] = parts(kind, "[]", "[nonuniformEXT(n)]");
            let fragment = format!(
                "{declared} layout(location = 0) out vec4 color;
                 void main() {{ color = {value}; }}"
            );
            let one = (set(kind.2, &[GREEN]), GREEN);
            let three = (set(kind.2, &[RED, RED, BLUE]), BLUE);
            let mut pass = pass(PLAIN, &fragment);
            pass.depth = Some(DepthTarget::cleared(1.0));
            for depth in [DepthState::OFF, DepthState::LESS] {
                Arc::make_mut(&mut pass.pipelines[0]).depth = depth;
                // Index 2 is beyond the shorter array alone.
                for (n, left, right) in
                    [(2, &one, &three), (2, &three, &one), (3, &one, &three), (-1, &three, &one)]
                {
                    let column = |x, width| Some(Rect { x, y: 0, width, height: 8 });
                    pass.draws = vec![
                        draw(&left.0, n).scissor(column(0, 3)),
                        draw(&right.0, n).scissor(column(3, 5)),
                    ];
                    let color = renderer.render(&pass).unwrap().into_color().unwrap();
                    let found = [color.texel(2, 3), color.texel(3, 3)];
                    assert_eq!(found, [left.1, right.1], "{}, element {n}", kind.0);
                }
            }
        }
    });
}

/// On the driver under test alone: SwiftShader's compiler crashes on the copies of functions that get arrays.
#[test]
fn a_function_that_gets_the_array_stays_in_it() {
    let mut renderer = compute::Renderer::new(&gpu()).unwrap();
    let [declared, value] = parts(KINDS[0], "[2]", "[n]");
    let fragment = format!(
        "{declared} layout(location = 0) out vec4 color;
         vec4 at(sampler2D list[2], int n) {{ return texture(list[n], vec2(0.5)); }}
         void main() {{ color = at(list, n) + 0.0 * ({value}); }}"
    );
    let found = colors(&mut renderer, PLAIN, &fragment, KINDS[0].2, &[GREEN, BLUE]);
    assert_eq!(found, expected(&[GREEN, BLUE]));
}

/// More may be bound than a shader declares: it sees what it declares.
#[test]
fn elements_that_are_bound_and_not_declared_are_not_seen() {
    on_each_gpu("elements that are bound and not declared are not seen", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).unwrap();
        let kind = KINDS[3];
        let [declared, value] = parts(kind, "[2]", "[n]");
        let fragment = format!(
            "{declared} layout(location = 0) out vec4 color;
             void main() {{ color = {value}; }}"
        );
        let found = colors(&mut renderer, PLAIN, &fragment, kind.2, &[GREEN, BLUE, RED, RED]);
        assert_eq!(found, expected(&[GREEN, BLUE]));
    });
}
