//! Is an invalid pass refused, with words that name the draw, the resource and the fault?

use std::sync::Arc;
use tilewright::{
    Error,
    format::{Format, Numeric, VertexFormat},
    image::Extent,
    pass::{
        Binding, BindingEntry, BindingSet, BufferRange, BufferSource, Draw, IndexFormat, Indices,
        Pass, Pipeline, StepRate, VertexAttribute, VertexBinding,
    },
    shader::{Shader, Stage},
    state::{Rect, Viewport},
    target::DepthTarget,
    texture::{Sampler, Texture},
};

fn shader(stage: Stage, label: &str, body: &str) -> Arc<Shader> {
    let source = format!("#version 450\n{body}");
    Arc::new(Shader::from_glsl(stage, label, &source).unwrap_or_else(|e| panic!("{e}")))
}

fn zeros(label: &str, bytes: usize) -> Arc<BufferSource> {
    Arc::new(BufferSource::new(label, vec![0; bytes]))
}

/// A texture that a case spoils.
struct Stones {
    extent: Extent,
    format: Format,
    levels: Vec<Vec<u8>>,
}

impl Stones {
    fn texture(self) -> Texture {
        Texture::new("stones", self.extent, self.format, self.levels)
    }
}

/// The parts of a pass that makes sense, each of which a case spoils.
struct Parts {
    pass: Pass,
    pipeline: Pipeline,
    draw: Draw,
    entries: Vec<BindingEntry>,
    texture: Stones,
}

impl Parts {
    fn new() -> Self {
        let vertex = shader(
            Stage::Vertex,
            "test.vert",
            "layout(location = 0) in vec3 position;
layout(location = 3) in uvec2 ids;
layout(location = 0) out vec2 uv;
layout(location = 1) flat out uint id;
void main() { gl_Position = vec4(position, 1); uv = position.xy; id = ids.x; }",
        );
        let fragment = shader(
            Stage::Fragment,
            "test.frag",
            "layout(location = 0) in vec2 uv;
layout(location = 1) flat in uint id;
layout(set = 0, binding = 2) uniform sampler2D images[2];
layout(set = 1, binding = 0) uniform Block { vec4 factor[4]; };
layout(push_constant) uniform Push { vec2 offset; };
layout(location = 0) out vec4 color;
void main() { color = texture(images[id & 1u], uv + offset) * factor[3]; }",
        );
        let attribute =
            |location, format, offset| VertexAttribute { location, binding: 0, format, offset };
        let ids = VertexFormat::from(Format::Rg16Uint);
        let pipeline = Pipeline::new("brick", vertex, fragment)
            .vertex_bindings([VertexBinding { stride: 16, rate: StepRate::Vertex }])
            .vertex_attributes([attribute(0, VertexFormat::F32X3, 0), attribute(3, ids, 12)]);
        let bytes = [0u16, 1, 2, 9].iter().flat_map(|i| i.to_ne_bytes()).collect();
        let indices = Arc::new(BufferSource::new("indices", bytes));
        let draw = Draw::new(0, 3)
            .push_constants(vec![0; 8])
            .vertex_buffers([BufferRange::whole(&zeros("vertices", 48))])
            .indices(Indices::new(BufferRange::whole(&indices), IndexFormat::U16));
        let entries = vec![BindingEntry {
            binding: 0,
            resources: vec![Binding::Uniform(BufferRange {
                buffer: zeros("factors", 512),
                offset: 256,
                bytes: 64,
            })],
        }];
        let texture = Stones {
            extent: Extent::new(4, 2),
            format: Format::Rgba8Unorm,
            levels: vec![vec![0; 32], vec![0; 8], vec![0; 4]],
        };
        Self { pass: Pass::new("test", Extent::new(8, 8)), pipeline, draw, entries, texture }
    }

    fn assemble(self) -> Pass {
        let mut pass = self.pass;
        pass.pipelines.push(Arc::new(self.pipeline));
        let sampled = Binding::Sampled(Arc::new(self.texture.texture()), Sampler::default());
        let images = BindingEntry { binding: 2, resources: vec![sampled.clone(), sampled] };
        let mut draw = self.draw;
        draw.sets = vec![
            Arc::new(BindingSet { entries: vec![images] }),
            Arc::new(BindingSet { entries: self.entries }),
        ];
        pass.draws.push(draw);
        pass
    }
}

/// Asserts that the spoilt pass is refused with a message that holds all of `words`.
#[track_caller]
fn refused(words: &[&str], spoil: impl FnOnce(&mut Parts)) {
    let mut parts = Parts::new();
    spoil(&mut parts);
    let error = parts.assemble().validate().expect_err("a fault is refused");
    assert!(matches!(error, Error::Usage(_)), "{error}");
    let text = error.to_string();
    for word in words {
        assert!(text.contains(word), "`{word}` is not in: {text}");
    }
}

#[test]
fn what_makes_sense_is_taken() {
    Parts::new().assemble().validate().unwrap();
    let mut parts = Parts::new();
    parts.draw.indices = None;
    parts.draw.scissor = Some(Rect { x: 7, y: 0, width: 100, height: 0 });
    parts.pass.depth = Some(DepthTarget::cleared(0.0));
    parts.assemble().validate().unwrap();
    Pass::new("empty", Extent::new(16384, 1)).validate().unwrap();
}

#[test]
fn targets() {
    refused(&["test", "0x8"], |p| p.pass.extent.width = 0);
    refused(&["8x16385", "16384"], |p| p.pass.extent.height = 16385);
    refused(&["D32Float"], |p| p.pass.colors[0].format = Format::D32Float);
    refused(&["depth", "1.5"], |p| p.pass.depth = Some(DepthTarget::cleared(1.5)));
    refused(&["depth", "NaN"], |p| p.pass.depth = Some(DepthTarget::cleared(f32::NAN)));
}

#[test]
fn pipelines() {
    refused(&["brick", "`test.vert` is no fragment shader"], |p| {
        p.pipeline.fragment = p.pipeline.vertex.clone();
    });
    refused(&["brick", "attribute 3", "test.vert"], |p| {
        p.pipeline.vertex_attributes.truncate(1);
    });
    refused(&["attribute 3", " uint in `test.vert`", " float in memory (Unorm)"], |p| {
        p.pipeline.vertex_attributes[1].format.numeric = Numeric::Unorm;
    });
    refused(&["attribute 3", "binding 7"], |p| p.pipeline.vertex_attributes[1].binding = 7);
    refused(&["attribute 0", "twice"], |p| p.pipeline.vertex_attributes[1].location = 0);
    refused(&["attribute 0", "5 components"], |p| {
        p.pipeline.vertex_attributes[0].format.count = 5;
    });
    refused(&["attribute 0", "byte 2"], |p| p.pipeline.vertex_attributes[0].offset = 2);
    refused(&["attribute 0", "stride 18"], |p| p.pipeline.vertex_bindings[0].stride = 18);
    refused(&["4096"], |p| p.pipeline.vertex_bindings[0].stride = 4096);
    refused(&["test.frag", "location 1", "other.vert"], |p| {
        let body = "layout(location = 0) out vec2 uv;
void main() { gl_Position = vec4(0); uv = vec2(0); }";
        p.pipeline.vertex = shader(Stage::Vertex, "other.vert", body);
    });
    refused(&["location 1", " int in `other.vert`", " uint in `test.frag`"], |p| {
        let body = "layout(location = 0) out vec2 uv;
layout(location = 1) flat out int id;
void main() { gl_Position = vec4(0); uv = vec2(0); id = 1; }";
        p.pipeline.vertex = shader(Stage::Vertex, "other.vert", body);
    });
    refused(&["odd.frag", " uint to location 0", "shaders write float"], |p| {
        let body = "layout(location = 0) out uvec4 color;
void main() { color = uvec4(1); }";
        p.pipeline.fragment = shader(Stage::Fragment, "odd.frag", body);
    });
    refused(&["far.frag", "location 40", "32"], |p| {
        let (out, take) =
            ("layout(location = 40) out vec2 far;", "layout(location = 40) in vec2 far;");
        let vertex = format!("{out}\nvoid main() {{ gl_Position = vec4(0); far = vec2(0); }}");
        let fragment = format!(
            "{take}\nlayout(location = 0) out vec4 color;\nvoid main() {{ color = far.xyxy; }}"
        );
        p.pipeline.vertex = shader(Stage::Vertex, "far.vert", &vertex);
        p.pipeline.fragment = shader(Stage::Fragment, "far.frag", &fragment);
    });
    refused(&["set 1 binding 0", "a storage block in", "a uniform block in"], |p| {
        let body = "layout(set = 1, binding = 0) readonly buffer Block { vec2 uvs[]; };
layout(location = 0) out vec2 uv;
layout(location = 1) flat out uint id;
void main() { gl_Position = vec4(0); uv = uvs[gl_VertexIndex]; id = 1; }";
        p.pipeline.vertex = shader(Stage::Vertex, "other.vert", body);
    });
}

#[test]
fn bindings() {
    refused(&["draw 0", "pipeline 3"], |p| p.draw.pipeline = 3);
    refused(&["draw 0", "brick", "4 bytes of push", "8"], |p| p.draw.push_constants.truncate(4));
    refused(&["set 1 binding 0", "not bound"], |p| p.entries.clear());
    refused(&["set 1 binding 0", "not bound"], |p| p.entries[0].binding = 1);
    refused(&["set 1 binding 0", "a sampler is bound"], |p| {
        p.entries[0].resources = vec![Binding::Sampler(Sampler::default())];
    });
    let uniform = |offset, bytes| {
        move |p: &mut Parts| {
            let buffer = zeros("factors", 512);
            p.entries[0].resources = vec![Binding::Uniform(BufferRange { buffer, offset, bytes })];
        }
    };
    refused(&["factors", "no bytes"], uniform(0, 0));
    // A range that is shorter than the block is legal: tests/blocks.rs says what is read beyond it.
    let mut parts = Parts::new();
    uniform(0, 63)(&mut parts);
    parts.assemble().validate().unwrap();
    refused(&["factors", "byte 128", "256"], uniform(128, 64));
    refused(&["factors", "512"], uniform(256, 257));
    refused(&["factors", "512"], uniform(usize::MAX - 255, 256));
}

#[test]
fn textures() {
    refused(&["set 0 binding 2", "stones", "level 1", "8"], |p| {
        p.texture.levels[1].pop();
    });
    refused(&["stones", "4 levels", "3"], |p| p.texture.levels.push(vec![0; 4]));
    refused(&["stones", "0 levels"], |p| p.texture.levels.clear());
    refused(&["stones", "0x2"], |p| p.texture.extent.width = 0);
}

#[test]
fn vertices_and_indices() {
    refused(&["0 vertex buffers", "1"], |p| p.draw.vertex_buffers.clear());
    refused(&["vertices", "48"], |p| p.draw.vertex_buffers[0].bytes = 49);
    // The fourth index is 9, and there are three vertices.
    refused(&["vertex 9", "vertices", "48"], |p| p.draw.count = 4);
    refused(&["vertex 9"], |p| (p.draw.first, p.draw.count) = (3, 1));
    refused(&["5 indices", "4"], |p| p.draw.count = 5);
    refused(&["1 indices from 4294967295"], |p| (p.draw.first, p.draw.count) = (u32::MAX, 1));
    refused(&["vertex 3"], |p| p.draw.base_vertex = 1);
    refused(&["vertices -1 to 1"], |p| p.draw.base_vertex = -1);
    refused(&["indices of 2 bytes", "byte 1"], |p| {
        let range = &mut p.draw.indices.as_mut().unwrap().range;
        (range.offset, range.bytes) = (1, 6);
    });
    refused(&["vertex 3"], |p| (p.draw.indices, p.draw.count) = (None, 4));
    refused(&["vertex 4"], |p| {
        p.draw.indices = None;
        p.draw.first = 2;
    });
    refused(&["instance 3"], |p| {
        p.pipeline.vertex_bindings[0].rate = StepRate::Instance;
        (p.draw.first_instance, p.draw.instances) = (2, 2);
    });
    refused(&["byte 2", "multiple of 4"], |p| {
        p.draw.vertex_buffers =
            vec![BufferRange { buffer: zeros("vertices", 64), offset: 2, bytes: 48 }];
    });
    // Nothing is read where nothing is drawn.
    let mut parts = Parts::new();
    (parts.draw.instances, parts.draw.base_vertex) = (0, 1000);
    parts.assemble().validate().unwrap();
}

#[test]
fn viewports_and_scissors() {
    let viewport = |x, width, height, max_depth| {
        move |p: &mut Parts| {
            p.draw.viewport =
                Some(Viewport { x, y: 0.0, width, height, min_depth: 0.0, max_depth });
        }
    };
    refused(&["viewport"], viewport(0.0, 0.0, 8.0, 1.0));
    refused(&["viewport"], viewport(0.0, 8.0, 0.0, 1.0));
    refused(&["viewport"], viewport(0.0, f32::NAN, 8.0, 1.0));
    refused(&["viewport"], viewport(0.0, 8.0, -20000.0, 1.0));
    refused(&["viewport"], viewport(40000.0, 8.0, 8.0, 1.0));
    refused(&["viewport"], viewport(0.0, 8.0, 8.0, 1.25));
    refused(&["scissor"], |p| {
        p.draw.scissor = Some(Rect { x: u32::MAX, y: 0, width: 1, height: 1 });
    });
}

/// A verdict that is remembered must not stand for another draw: each is spoilt behind one that is good.
#[test]
fn what_was_found_good_before_excuses_no_other_draw() {
    let refused = |words: &[&str], spoil: &dyn Fn(&mut Pass, &mut Draw)| {
        let mut pass = Parts::new().assemble();
        let mut draw = pass.draws[0].clone();
        spoil(&mut pass, &mut draw);
        pass.draws.push(draw);
        let text = pass.validate().expect_err("a fault is refused").to_string();
        for word in words.iter().chain(&["draw 1"]) {
            assert!(text.contains(word), "`{word}` is not in: {text}");
        }
    };
    refused(&["set 1 binding 0", "not bound"], &|_, draw| draw.sets.truncate(1));
    refused(&["set 0 binding 2 (an image with its sampler) is not bound"], &|_, draw| {
        draw.sets.clear();
    });
    refused(
        &["set 1 binding 0: it is a uniform block in the shader; a storage block is bound"],
        &|_, draw| {
            let mut set = (*draw.sets[1]).clone();
            let Binding::Uniform(range) = &set.entries[0].resources[0] else { panic!() };
            set.entries[0].resources[0] = Binding::Storage(range.clone());
            draw.sets[1] = Arc::new(set);
        },
    );
    refused(&["set 0 binding 2", "not bound"], &|_, draw| draw.sets.swap(0, 1));
    refused(&["set 0 binding 2", "not bound"], &|_, draw| draw.sets[0] = draw.sets[1].clone());
    refused(&["push"], &|_, draw| draw.push_constants.clear());
    refused(&["0 vertex buffers"], &|_, draw| draw.vertex_buffers.clear());
    refused(&["vertex 9"], &|_, draw| draw.count = 4);
    refused(&["set 3 binding 0", "not bound"], &|pass, draw| {
        let mut other = (*pass.pipelines[0]).clone();
        let body = "layout(location = 0) in vec2 uv;
layout(set = 3, binding = 0) uniform Block { vec4 factor; };
layout(location = 0) out vec4 color;
void main() { color = factor * uv.x; }";
        other.fragment = shader(Stage::Fragment, "other.frag", body);
        draw.pipeline = pass.pipelines.len();
        pass.pipelines.push(Arc::new(other));
    });
    // The same texture in a draw that is good does not excuse one whose set holds a bad one.
    refused(&["set 0 binding 2", "stones", "level 0"], &|_, draw| {
        let mut set = (*draw.sets[0]).clone();
        let Binding::Sampled(texture, sampler) = &set.entries[0].resources[0] else { panic!() };
        let levels = texture.levels().unwrap().to_vec();
        let bad = Texture::new("stones", texture.extent(), Format::Rgba16Float, levels);
        set.entries[0].resources[1] = Binding::Sampled(Arc::new(bad), *sampler);
        draw.sets[0] = Arc::new(set);
    });
}

#[test]
fn a_specialization_constant_is_set_once_and_has_32_bits() {
    let refused = |specialization: &[(u32, u32)], words: &str| {
        let mut parts = Parts::new();
        let body = "layout(constant_id = 5) const double wide = 1.0;
layout(constant_id = 6) const bool narrow = true;
layout(location = 0) out vec4 color;
void main() { color = vec4(narrow ? float(wide) : 0.0); }";
        parts.pipeline.fragment = shader(Stage::Fragment, "wide.frag", body);
        parts.pipeline.specialization = specialization.to_vec();
        let text = parts.assemble().validate().expect_err("a fault is refused").to_string();
        assert!(text.contains(words), "`{words}` is not in: {text}");
    };
    refused(&[(6, 0), (7, 1), (6, 0)], "specialization constant 6 is set twice");
    refused(&[(6, 0), (5, 1)], "specialization constant 5 of `wide.frag` is not 32 bits wide");
}

#[test]
fn an_array_of_resources_has_one_length() {
    let head = "layout(location = 0) in vec2 uv;
layout(location = 1) flat in uint id;
layout(location = 0) out vec4 color;\n";
    let body = "layout(constant_id = 5) const uint N = 2;
layout(set = 0, binding = 2) uniform sampler2D images[N];
void main() { color = texture(images[id], uv); }";
    let fragment = shader(Stage::Fragment, "sized.frag", &format!("{head}{body}"));
    refused(&["specialization constant 5 of `sized.frag`", "change from 2 to 3"], |p| {
        p.pipeline.fragment = fragment.clone();
        p.pipeline.specialization = vec![(5, 3)];
    });
    let mut parts = Parts::new();
    (parts.pipeline.fragment, parts.pipeline.specialization) = (fragment.clone(), vec![(5, 2)]);
    parts.assemble().validate().unwrap();
    // Two are bound. The vertex shader leaves the length open, the fragment shader does not.
    refused(&["set 0 binding 2 has 3 elements; 2 are bound"], |p| {
        // Constant indices alone would give the array a length.
        let body = "#extension GL_EXT_nonuniform_qualifier : require
layout(set = 0, binding = 2) uniform sampler2D images[];
layout(location = 0) out vec2 uv;
layout(location = 1) flat out uint id;
void main() {
    gl_Position = textureLod(images[nonuniformEXT(gl_VertexIndex)], vec2(0), 0.0);
    uv = vec2(0);
    id = 1;
}";
        p.pipeline.vertex = shader(Stage::Vertex, "open.vert", body);
        assert_eq!(p.pipeline.vertex.reflection().resources[0].count, 0);
        let body = "layout(set = 0, binding = 2) uniform sampler2D images[3];
void main() { color = texture(images[id % 3], uv); }";
        let three = format!("{head}{body}");
        p.pipeline.fragment = shader(Stage::Fragment, "three.frag", &three);
    });
}

#[test]
fn vertices_instances_and_primitives_have_numbers_of_32_bits() {
    let taken = |first, count, first_instance, instances| {
        let mut parts = Parts::new();
        // Every vertex and instance reads the same bytes.
        parts.pipeline.vertex_bindings[0].stride = 0;
        parts.draw.indices = None;
        (parts.draw.first, parts.draw.count) = (first, count);
        (parts.draw.first_instance, parts.draw.instances) = (first_instance, instances);
        parts.assemble().validate().map_err(|e| e.to_string())
    };
    taken(u32::MAX - 2, 3, 0, 1).unwrap();
    taken(0, 3, u32::MAX, 1).unwrap();
    taken(0, u32::MAX, 0, 3).unwrap();
    // What draws nothing reads nothing.
    taken(u32::MAX, u32::MAX, u32::MAX, 0).unwrap();
    taken(u32::MAX, 0, u32::MAX, u32::MAX).unwrap();
    let refused = |found: Result<(), String>, word: &str| {
        let text = found.unwrap_err();
        assert!(text.contains(word), "`{word}` is not in: {text}");
    };
    refused(taken(u32::MAX - 1, 3, 0, 1), "vertices 4294967294 to 4294967296");
    refused(taken(0, 3, u32::MAX, 2), "instances 4294967295 to 4294967296");
    refused(taken(0, u32::MAX, 0, 4), "1431655765 primitives in each of 4 instances");
}
