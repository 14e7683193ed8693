//! Is an attribute interpolated right? A value that is equal at all corners stays equal, bit for bit; any other
//! value is as near to the truth as single precision allows; and the size of the scene does not matter.

use crate::{
    common::{gpu, on_each_gpu, random::Random},
    parity::differences,
};
use glam::DVec3;
use std::sync::Arc;
use tilewright::{
    compute,
    format::{Format, Numeric, Packing, VertexFormat},
    image::Extent,
    pass::{
        BufferRange, BufferSource, Draw, Frame, Pass, Pipeline, StepRate, VertexAttribute,
        VertexBinding,
    },
    scene::{LoadOptions, PassOptions, Scene},
    shader::{Shader, Stage},
    state::{Blend, BlendEquation, BlendFactor, BlendOp},
    target::{ColorTarget, DepthTarget},
};

/// One vertex: clip-space position, an attribute as bits, and one that differs from corner to corner.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Vertex {
    position: [f32; 4],
    constant: [u32; 4],
    other: [f32; 2],
}

/// Hands the constant on in every way that there is.
const VERTEX: &str = "#version 450
layout(location = 0) in vec4 position;
layout(location = 1) in uvec4 constant;
layout(location = 2) in vec2 other;
layout(location = 0) out vec4 out_smooth;
layout(location = 1) noperspective out vec4 out_linear;
layout(location = 2) centroid out vec4 out_centroid;
layout(location = 3) noperspective centroid out vec3 out_linear_centroid;
layout(location = 4) out mat2x3 out_matrix;
layout(location = 6) noperspective out float out_array[4];
layout(location = 10) out vec4 out_mixed;
layout(location = 11) out vec2 out_low;
layout(location = 11, component = 2) out vec2 out_high;
layout(location = 12) flat out uvec4 out_bits;
layout(location = 13) flat out vec4 out_flat;
layout(location = 14) flat out ivec2 out_signed;
layout(location = 15) out Block { vec2 smooth_member; flat uint flat_member; };
void main() {
    gl_Position = position;
    vec4 v = uintBitsToFloat(constant);
    out_smooth = v;
    out_linear = v;
    out_centroid = v;
    out_linear_centroid = v.xyz;
    out_matrix = mat2x3(v.xyz, v.yzw);
    out_array = float[](v.x, v.y, v.z, v.w);
    out_mixed = vec4(v.x, other.x, v.z, other.y);
    out_low = v.xy;
    out_high = v.zw;
    out_bits = constant;
    out_flat = v;
    out_signed = ivec2(constant.xw);
    smooth_member = v.yz;
    flat_member = constant.z;
}";

/// Red has a bit for each way in which the constant did not arrive, green is for derivatives that are not 0. In three
/// parts: SwiftShader compiles one of all of them for minutes.
const FRAGMENTS: [&str; 3] = [
    "layout(location = 0) in vec4 in_smooth;
layout(location = 1) noperspective in vec4 in_linear;
layout(location = 2) centroid in vec4 in_centroid;
layout(location = 3) noperspective centroid in vec3 in_linear_centroid;
void check() {
    if (differs(in_smooth) || differs(interpolateAtCentroid(in_smooth))) wrong |= 1u;
    if (differs(in_linear)) wrong |= 2u;
    if (differs(in_centroid) || floatBitsToUint(in_linear_centroid) != bits.xyz) wrong |= 4u;
    // Infinity less itself is no number.
    bool finite = !any(isinf(in_smooth));
    moves = finite && (fwidth(in_smooth) != vec4(0) || fwidth(in_linear) != vec4(0));
}",
    "layout(location = 4) in mat2x3 in_matrix;
layout(location = 6) noperspective in float in_array[4];
void check() {
    if (differs(vec4(in_matrix[0], in_matrix[1].z))) wrong |= 1u;
    if (differs(vec4(in_matrix[0].x, in_matrix[1]))) wrong |= 2u;
    if (differs(vec4(in_array[0], in_array[1], in_array[2], in_array[3]))) wrong |= 4u;
}",
    "layout(location = 10) in vec4 in_mixed;
layout(location = 11) in vec2 in_low;
layout(location = 11, component = 2) in vec2 in_high;
layout(location = 13) flat in vec4 in_flat;
layout(location = 14) flat in ivec2 in_signed;
layout(location = 15) in Block { vec2 smooth_member; flat uint flat_member; };
void check() {
    if (floatBitsToUint(in_mixed.xz) != bits.xz || isnan(in_mixed.y)) wrong |= 1u;
    if (differs(vec4(in_low, in_high))) wrong |= 2u;
    if (floatBitsToUint(smooth_member) != bits.yz || flat_member != bits.z) wrong |= 4u;
    if (differs(in_flat) || in_signed != ivec2(bits.xw)) wrong |= 8u;
}",
];

/// A whole shader around one of the parts.
fn checking(part: &str) -> Arc<Shader> {
    let source = format!(
        "#version 450
layout(location = 12) flat in uvec4 bits;
layout(location = 0) out vec4 color;
uint wrong = 0u;
bool moves = false;
bool differs(vec4 v) {{ return floatBitsToUint(v) != bits; }}
{part}
void main() {{
    check();
    color = vec4(wrong, moves ? 255 : 0, 255, 255) / 255;
}}"
    );
    shader(Stage::Fragment, &source)
}

fn shader(stage: Stage, source: &str) -> Arc<Shader> {
    Arc::new(Shader::from_glsl(stage, "interpolation", source).unwrap_or_else(|e| panic!("{e}")))
}

fn pass_of(vertices: &[Vertex], vertex: &Arc<Shader>, fragment: &Arc<Shader>) -> Pass {
    let attribute = |location, numeric, count, offset| VertexAttribute {
        location,
        binding: 0,
        format: VertexFormat::new(numeric, Packing::Bits32, count),
        offset,
    };
    let mut pipeline = Pipeline::new("interpolation", vertex.clone(), fragment.clone());
    pipeline.vertex_bindings =
        vec![VertexBinding { stride: size_of::<Vertex>() as u32, rate: StepRate::Vertex }];
    pipeline.vertex_attributes = vec![
        attribute(0, Numeric::Float, 4, 0),
        attribute(1, Numeric::Uint, 4, 16),
        attribute(2, Numeric::Float, 2, 32),
    ];
    let bytes = bytemuck::cast_slice(vertices).to_vec();
    let mut draw = Draw::new(0, vertices.len() as u32);
    draw.vertex_buffers = vec![BufferRange::whole(&Arc::new(BufferSource::new("vertices", bytes)))];
    Pass::new("interpolation", Extent::new(96, 64))
        .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
        .depth(DepthTarget::cleared(1.0))
        .pipelines([pipeline])
        .draws([draw])
}

/// The same pass in the ways of drawing that run a fragment shader: opaque and in order.
fn opaque_and_ordered(pass: &Pass) -> [(&'static str, Pass); 2] {
    let replace = BlendEquation { src: BlendFactor::One, dst: BlendFactor::Zero, op: BlendOp::Add };
    let blend = Some(Blend { color: replace, alpha: replace });
    let pipeline = Arc::new((*pass.pipelines[0]).clone().blend(blend));
    [("opaque", pass.clone()), ("ordered", pass.clone().pipelines([pipeline]))]
}

/// A triangle of one kind of trouble, whose corners are up to `farther` times as far from the eye as each other.
fn triangle(random: &mut Random, farther: f32) -> [[f32; 4]; 3] {
    let size = [0.05, 0.3, 1.0, 3.0][random.below(4)];
    let center = [random.signed(), random.signed(), random.unit()];
    let mut corners: [[f32; 4]; 3] = std::array::from_fn(|_| {
        let w = farther.powf(random.signed() / 2.0);
        let [x, y, z] = center.map(|c| (c + random.signed() * size) * w);
        [x, y, z.clamp(0.0, w), w]
    });
    match random.below(8) {
        // Through the near plane, and behind the eye.
        0 => corners[random.below(3)][2] = -random.unit(),
        1 => corners[random.below(3)][3] *= -1.0,
        // Far outside.
        2 => corners[random.below(3)][random.below(2)] = random.signed() * 1e6,
        3 => corners[random.below(3)] = [1e30, -1e30, 0.5, 1e-3],
        // A sliver.
        4 => {
            let t = random.unit();
            corners[2] =
                std::array::from_fn(|i| corners[0][i] + (corners[1][i] - corners[0][i]) * t);
            corners[2][0] += corners[2][3] * 0.02;
        }
        // Without perspective.
        5 => corners.iter_mut().for_each(|c| *c = [c[0] / c[3], c[1] / c[3], c[2] / c[3], 1.0]),
        _ => {}
    }
    corners
}

/// A float that arithmetic may keep as it is: devices may flush denormals and rewrite NaNs.
fn constant(random: &mut Random) -> f32 {
    let special = [
        0.0,
        -0.0,
        1.0,
        0.5,
        0.1,
        -1.0 / 3.0,
        f32::MAX,
        f32::MIN,
        f32::MIN_POSITIVE,
        f32::INFINITY,
        f32::NEG_INFINITY,
        16_777_217.0,
        499_999.97,
    ];
    if random.below(2) == 0 {
        return special[random.below(special.len())];
    }
    loop {
        let value = f32::from_bits(random.bits() as u32);
        if value.is_normal() {
            return value;
        }
    }
}

#[test]
fn what_is_equal_at_all_corners_stays_equal() {
    let vertex = shader(Stage::Vertex, VERTEX);
    let fragments = FRAGMENTS.map(checking);
    on_each_gpu("constants", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        let mut shaded = 0;
        for seed in 0..9 {
            let mut random = Random::new(seed);
            let vertices: Vec<Vertex> = (0..60)
                .flat_map(|_| {
                    let farther = [1.0, 10.0, 1e6, 1e12][random.below(4)];
                    let scale = 10f32.powi([0, 0, -25, 25][random.below(4)]);
                    let corners = triangle(&mut random, farther);
                    // What reaches far anyway would leave the range of floats.
                    let far = corners.iter().flatten().any(|c| c.abs() > 1e10);
                    let scale = if far { 1.0 } else { scale };
                    let constant = std::array::from_fn(|_| constant(&mut random).to_bits());
                    corners.map(|corner| Vertex {
                        position: corner.map(|c| c * scale),
                        constant,
                        other: [random.signed(), random.signed()],
                    })
                })
                .collect();
            let fragment = &fragments[seed as usize % fragments.len()];
            for (way, pass) in opaque_and_ordered(&pass_of(&vertices, &vertex, fragment)) {
                let frame = renderer.render(&pass).expect("it is drawn");
                for (at, texel) in frame.colors[0].bytes.chunks(4).enumerate() {
                    let [wrong, moving, drawn, _] = texel.try_into().expect("four bytes");
                    shaded += usize::from(drawn);
                    let (x, y) = (at % 96, at / 96);
                    assert_eq!(
                        (wrong, moving),
                        (0, 0),
                        "seed {seed}, {way}, pixel ({x}, {y}) of {}",
                        gpu.info().name
                    );
                }
            }
        }
        assert!(shaded > 9 * 1000 * 255, "the triangles cover {} pixels", shaded / 255);
    });
}

/// One attribute's bits as a colour, smooth in the left half of the target and without perspective in the right.
const BITS_VERTEX: &str = "#version 450
layout(location = 0) in vec4 position;
layout(location = 2) in vec2 other;
layout(location = 0) out float out_smooth;
layout(location = 1) noperspective out float out_linear;
void main() { gl_Position = position; out_smooth = out_linear = other.x; }";
const BITS_FRAGMENT: &str = "#version 450
layout(location = 0) in float in_smooth;
layout(location = 1) noperspective in float in_linear;
layout(location = 0) out vec4 color;
void main() {
    color = unpackUnorm4x8(floatBitsToUint(gl_FragCoord.x < 48 ? in_smooth : in_linear));
}";

/// The barycentric weights at a pixel's centre, with and without perspective, in double precision.
fn weights(corners: &[[f32; 4]; 3], x: usize, y: usize) -> [[f64; 3]; 2] {
    let ndc = [(x as f64 + 0.5) / 48.0 - 1.0, (y as f64 + 0.5) / 32.0 - 1.0];
    let [a, b, c] = corners.map(|c| {
        let [x, y, _, w] = c.map(f64::from);
        [x - ndc[0] * w, y - ndc[1] * w]
    });
    let cross = |a: [f64; 2], b: [f64; 2]| a[0] * b[1] - a[1] * b[0];
    let normal = |w: [f64; 3]| w.map(|part| part / w.iter().sum::<f64>());
    let smooth = normal([cross(b, c), cross(c, a), cross(a, b)]);
    [smooth, normal(std::array::from_fn(|i| smooth[i] * f64::from(corners[i][3])))]
}

/// Values at the corners, by what makes them hard.
fn attribute(kind: usize, corners: &[[f32; 4]; 3], random: &mut Random) -> [f32; 3] {
    std::array::from_fn(|i| match kind {
        // A texture's coordinate.
        0 => random.below(2) as f32,
        // Small steps far from 0.
        1 => 1e6 + random.unit(),
        // The distance along a floor, which grows with that from the eye.
        2 => corners[i][3] * (1.0 + random.unit()),
        _ => random.signed(),
    })
}

/// The largest error in units in the last place of the largest corner. A model of the arithmetic on the CPU has 0.3 for
/// values that lie close together far from 0, where a weighted sum has 2.1, and up to 110 for the others: corners that
/// are up to 1000 times as far from the eye as each other have weights with as large an error.
#[test]
fn attributes_are_as_exact_as_single_precision_lets_them_be() {
    let (vertex, fragment) =
        (shader(Stage::Vertex, BITS_VERTEX), shader(Stage::Fragment, BITS_FRAGMENT));
    on_each_gpu("errors", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        for (kind, allowed) in [400.0, 1.0, 400.0, 400.0].into_iter().enumerate() {
            for seed in 0..6 {
                let mut random = Random::new(1000 * kind as u64 + seed);
                let corners = wide_triangle(&mut random);
                let values = attribute(kind, &corners, &mut random);
                let vertices: [Vertex; 3] = std::array::from_fn(|i| Vertex {
                    position: corners[i],
                    constant: [0; 4],
                    other: [values[i], 0.0],
                });
                let frame = renderer.render(&pass_of(&vertices, &vertex, &fragment));
                let frame = frame.expect("it is drawn");
                let largest = values.map(f32::abs).into_iter().fold(f32::MIN_POSITIVE, f32::max);
                let unit = f64::from(largest) * f64::from(f32::EPSILON);
                for (at, texel) in frame.colors[0].bytes.chunks(4).enumerate() {
                    let (x, y) = (at % 96, at / 96);
                    let weights = weights(&corners, x, y)[usize::from(x >= 48)];
                    // Pixels at the border may not be drawn.
                    if weights.iter().any(|&weight| weight < 1e-4) {
                        continue;
                    }
                    let truth: f64 =
                        weights.iter().zip(values).map(|(w, a)| w * f64::from(a)).sum();
                    let found = f32::from_le_bytes(texel.try_into().expect("four bytes"));
                    let error = (f64::from(found) - truth).abs() / unit;
                    assert!(
                        error <= allowed,
                        "kind {kind}, seed {seed}, pixel ({x}, {y}) of {}: {found}, not {truth}: {error} units",
                        gpu.info().name
                    );
                }
            }
        }
    });
}

/// Inside the view, with corners that single precision can tell apart.
fn wide_triangle(random: &mut Random) -> [[f32; 4]; 3] {
    loop {
        let corners: [[f32; 4]; 3] = std::array::from_fn(|_| {
            let w = 1000f32.powf(random.unit());
            [random.signed() * 0.99 * w, random.signed() * 0.99 * w, 0.5 * w, w]
        });
        let [a, b, c] = corners.map(|[x, y, _, w]| [x / w, y / w]);
        let area = (b[0] - a[0]) * (c[1] - a[1]) - (c[0] - a[0]) * (b[1] - a[1]);
        if area.abs() > 0.1 {
            return corners;
        }
    }
}

/// The same picture, bit for bit, whatever power of two clip space is multiplied by.
#[test]
fn scenes_of_any_size_look_alike() {
    let (vertex, fragment) =
        (shader(Stage::Vertex, BITS_VERTEX), shader(Stage::Fragment, BITS_FRAGMENT));
    on_each_gpu("sizes", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        for seed in 0..4 {
            let mut drawn: Option<Vec<u8>> = None;
            for log2 in [0, -100, -60, 60, 100] {
                let mut random = Random::new(seed);
                let vertices: Vec<Vertex> = (0..8)
                    .flat_map(|_| {
                        let corners: [[f32; 4]; 3] = std::array::from_fn(|_| {
                            let w = 1.0 + 9.0 * random.unit();
                            let [x, y] = [random.signed(), random.signed()].map(|c| 1.5 * c * w);
                            [x, y, random.unit() * w, w]
                        });
                        corners.map(|corner| Vertex {
                            position: corner.map(|c| c * 2f32.powi(log2)),
                            constant: [0; 4],
                            other: [random.signed(), 0.0],
                        })
                    })
                    .collect();
                let frame = renderer.render(&pass_of(&vertices, &vertex, &fragment));
                let bytes = frame.expect("it is drawn").into_color().unwrap().bytes;
                let first = drawn.get_or_insert_with(|| bytes.clone());
                assert!(*first == bytes, "seed {seed}: 2^{log2} looks otherwise");
            }
        }
    });
}

/// A scene of a square of 2 by 2 in the plane z = 0, red, its alpha masked by `cutoff`.
fn masked(alpha: f32, cutoff: f32) -> Scene {
    let corners = [[-1f32, -1.0, 0.0], [1.0, -1.0, 0.0], [1.0, 1.0, 0.0], [-1.0, 1.0, 0.0]];
    let corners = corners.as_flattened().iter().flat_map(|c| c.to_le_bytes());
    let bytes = corners.chain([0u16, 1, 2, 0, 2, 3].iter().flat_map(|i| i.to_le_bytes()));
    let uri: String = bytes.map(|byte| format!("%{byte:02x}")).collect();
    let text = format!(
        r#"{{"asset": {{"version": "2.0"}}, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorFactor": [1, 0, 0, {alpha}]}},
            "alphaMode": "MASK", "alphaCutoff": {cutoff}, "doubleSided": true,
            "extensions": {{"KHR_materials_unlit": {{}}}}}}],
        "extensionsUsed": ["KHR_materials_unlit"],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0}}, "indices": 1, "material": 0}}]}}],
        "buffers": [{{"byteLength": 60, "uri": "data:application/octet-stream,{uri}"}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 48}},
            {{"buffer": 0, "byteOffset": 48, "byteLength": 12}}],
        "accessors": [{{"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
                "min": [-1, -1, 0], "max": [1, 1, 0]}},
            {{"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}}]}}"#
    );
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("masked.gltf");
    std::fs::write(&path, text).expect("it is written");
    Scene::load(&path, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// Alpha equal to the cutoff is kept: no holes, seen from the front or from the side, near or far.
#[test]
fn a_surface_as_opaque_as_its_cutoff_has_no_holes() {
    let extent = Extent::new(256, 256);
    let pass = |alpha, cutoff, eye| {
        let scene = masked(alpha, cutoff);
        let camera = scene.camera_at(eye, DVec3::ZERO, DVec3::Y, 45f64.to_radians());
        scene.pass(extent, &camera, &PassOptions::default()).expect("a valid pass")
    };
    let red =
        |frame: &Frame| frame.colors[0].bytes.chunks(4).filter(|p| p[0] > 200 && p[1] < 30).count();
    let front = DVec3::new(0.0, 0.0, 3.0);
    on_each_gpu("masks", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        // The third cuts the square off at the near plane and at the sides.
        for eye in [front, DVec3::new(2.0, 0.7, 0.9), DVec3::new(0.6, 0.1, 0.05)] {
            let kept = red(&renderer.render(&pass(1.0, 0.0, eye)).expect("it is drawn"));
            for alpha in [0.5, 1.0, 0.1, 1.0 / 3.0, 0.7] {
                let frame = renderer.render(&pass(alpha, alpha, eye)).expect("it is drawn");
                assert_eq!(red(&frame), kept, "from {eye}, alpha {alpha}, {}", gpu.info().name);
            }
            assert!(if eye == front { kept == 42_436 } else { kept > 5_000 }, "{kept} from {eye}");
        }
    });
    let gpu = gpu();
    for alpha in [0.5, 1.0] {
        let found = differences(&gpu, &pass(alpha, alpha, front));
        assert_eq!((found.coverage_differing, found.colour_over_1), (0, 0), "alpha {alpha}");
    }
}
