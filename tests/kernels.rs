//! Is this GLSL function right? A probe kernel runs one function of `glsl/lib` over many inputs, on
//! every driver, and Rust code computes the right result.

mod color;

use crate::common::{kernel_spirv, on_each_gpu, random::Random};
use bytemuck::Pod;
use rspirv::binary::Assemble;
use std::{fs, path::Path};
use tilewright::{
    abi,
    grid::pixel_number,
    vk::{Buffer, Gpu, Kernel, KernelInfo, Memory, Recorder},
};

#[allow(dead_code)]
#[path = "../glsl/tool/constants.rs"]
mod constants;
#[allow(dead_code)]
#[path = "../src/shader/engine.rs"]
mod engine;

/// The colours of targets of any format.
const ANY_COLOR: [&str; 3] = ["lib/small_float.glsl", "lib/color.glsl", "lib/any_color.glsl"];

/// Runs `body`, which turns `v`, four words of input, into `r`, four words of output, over `inputs`, one
/// for each lane of subgroups that are workgroups.
fn probe<I: Pod, O: Pod>(gpu: &Gpu, includes: &[&str], body: &str, inputs: &[I]) -> Vec<O> {
    probe_as_if(gpu.limits().subgroup_size, gpu, includes, body, inputs)
}

/// [`probe`], for functions without subgroup operations, as if subgroups were `width` wide.
fn probe_as_if<I: Pod, O: Pod>(
    width: u32,
    gpu: &Gpu,
    includes: &[&str],
    body: &str,
    inputs: &[I],
) -> Vec<O> {
    let lanes = gpu.limits().subgroup_size;
    assert_eq!((size_of::<I>(), size_of::<O>()), (16, 16), "a probe moves four words");
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("glsl");
    let any = includes.contains(&ANY_COLOR[2]).then_some("#define ANY_FORMAT\n");
    let mut source = format!(
        "#version 460
#extension GL_EXT_control_flow_attributes : require
{}{}const uint SUBGROUP_WIDTH = {width}u;
const bool GREATER = false;
const bool ADJUSTED = true;
const uint DEPTH_BITS = 0u;\n",
        constants::defines(),
        any.unwrap_or_default()
    );
    for include in includes {
        let text = fs::read_to_string(folder.join(include)).expect("a file of glsl/");
        // Everything a step needs is named by the test, in order.
        source.extend(text.lines().filter(|l| !l.starts_with("#include")).flat_map(|l| [l, "\n"]));
    }
    source += &format!(
        "layout(local_size_x = {lanes}) in;
layout(std430, binding = 0) readonly buffer Inputs {{ uvec4 inputs[]; }};
layout(std430, binding = 1) writeonly buffer Outputs {{ uvec4 outputs[]; }};
void main() {{
    uint i = gl_GlobalInvocationID.x;
    if (i >= {}u) return;
    uvec4 v = inputs[i], r = uvec4(0u);
    {body}
    outputs[i] = r;
}}",
        inputs.len()
    );
    let mut module = rspirv::dr::load_words(kernel_spirv(&source)).expect("a module");
    engine::forbid_contraction(&mut module);
    let spirv = module.assemble();
    let subgroup_size = Some(lanes);
    let name = "probe";
    let info = KernelInfo::new(name, &spirv).full_subgroups(true).subgroup_size(subgroup_size);
    let kernel = Kernel::new(gpu, &info).expect("a kernel");
    let input = Buffer::with_content(gpu, "inputs", inputs).expect("memory");
    let output = Buffer::<O>::new(gpu, "outputs", inputs.len(), Memory::Device).expect("memory");
    let mut recorder = Recorder::new(gpu, "probe").expect("a recorder");
    let groups = [(inputs.len() as u32).div_ceil(lanes), 1, 1];
    recorder
        .kernel(&kernel)
        .bind("Inputs", &input)
        .bind("Outputs", &output)
        .dispatch(groups)
        .expect("a dispatch");
    let output = recorder.download(&output).expect("memory");
    recorder.submit().expect("it runs");
    output.read().expect("it was written")
}

const CASES: usize = 20_000;

/// A normal float of any exponent that quotients stay normal with, or one of the awkward ones.
fn float(random: &mut Random) -> f32 {
    let special =
        [1.0, 0.5, 3.0, 1.0 / 3.0, 0.1, 1.0 + f32::EPSILON, 2.0 - f32::EPSILON, 16_777_215.0];
    let value = match random.below(4) {
        0 => special[random.below(special.len())],
        1 => (1 + random.below(1 << 12)) as f32,
        _ => {
            let bits =
                (127 - 50 + random.below(100) as u32) << 23 | random.bits() as u32 & 0x7f_ffff;
            f32::from_bits(bits)
        }
    };
    if random.below(2) == 0 { value } else { -value }
}

#[test]
fn division_is_correctly_rounded() {
    on_each_gpu("exact division", |gpu| {
        let mut random = Random::new(1);
        let inputs: Vec<[f32; 4]> =
            (0..CASES).map(|_| [float(&mut random), float(&mut random), 0.0, 0.0]).collect();
        let body =
            "r.x = floatBitsToUint(exact_divide(uintBitsToFloat(v.x), uintBitsToFloat(v.y)));";
        let outputs: Vec<[f32; 4]> = probe(gpu, &["lib/exact.glsl"], body, &inputs);
        for ([a, b, ..], [q, ..]) in inputs.iter().zip(&outputs) {
            assert_eq!(q.to_bits(), (a / b).to_bits(), "{a:e} / {b:e} is {:e}, not {q:e}", a / b);
        }
    });
}

#[test]
fn a_product_and_a_sum_round_once() {
    on_each_gpu("multiply and add", |gpu| {
        let mut random = Random::new(2);
        // What the viewport transform meets: device coordinates, half sizes, offsets.
        let inputs: Vec<[f32; 4]> = (0..CASES)
            .map(|_| {
                [
                    random.signed() * 2.0,
                    (1 + random.below(16384)) as f32 / 2.0,
                    random.below(16384) as f32 / 2.0,
                    0.0,
                ]
            })
            .collect();
        let body =
            "vec4 f = uintBitsToFloat(v); r.x = floatBitsToUint(multiply_add(f.x, f.y, f.z));";
        let outputs: Vec<[f32; 4]> = probe(gpu, &["lib/exact.glsl"], body, &inputs);
        let mut twice = 0;
        for ([a, b, c, _], [r, ..]) in inputs.iter().zip(&outputs) {
            let fused = a.mul_add(*b, *c);
            let error = (i64::from(r.to_bits()) - i64::from(fused.to_bits())).abs();
            assert!(error <= 1, "{a} * {b} + {c} is {fused}, not {r}");
            twice += usize::from(error == 1);
        }
        assert!(twice <= CASES / 1000, "{twice} of {CASES} are not the fused result");
    });
}

#[test]
fn rounding_to_integers_takes_ties_to_even() {
    on_each_gpu("rounding", |gpu| {
        let mut random = Random::new(3);
        let inputs: Vec<[f32; 4]> = (0..CASES)
            .map(|i| {
                let half = random.signed() * 4096.0;
                [
                    if i % 2 == 0 { half.round() + 0.5 } else { random.signed() * 8_388_608.0 },
                    0.0,
                    0.0,
                    0.0,
                ]
            })
            .collect();
        let body = "r.x = uint(round_even(uintBitsToFloat(v.x)));";
        let outputs: Vec<[i32; 4]> = probe(gpu, &["lib/exact.glsl"], body, &inputs);
        for ([a, ..], [r, ..]) in inputs.iter().zip(&outputs) {
            assert_eq!(*r, a.round_ties_even() as i32, "{a}");
        }
    });
}

#[test]
fn wide_integers_are_64_bit_integers() {
    on_each_gpu("wide integers", |gpu| {
        let mut random = Random::new(4);
        let inputs: Vec<[i32; 4]> = (0..CASES)
            .map(|_| std::array::from_fn(|_| (random.bits() as i32) >> random.below(31)))
            .collect();
        let body = "Wide w = wide_offset(wide_subtract(wide_product(int(v.x), int(v.y)),
            wide_product(int(v.z), int(v.w))), int(v.x) & 3);
            r = uvec4(uint(w.hi), w.lo, uint(wide_sign(w)), uint(wide_shift_saturate(w, 8u)));";
        let outputs: Vec<[u32; 4]> = probe(gpu, &["lib/wide.glsl"], body, &inputs);
        for (v, r) in inputs.iter().zip(&outputs) {
            let [a, b, c, d] = v.map(i64::from);
            let expected = (a * b).wrapping_sub(c * d).wrapping_add(a & 3);
            assert_eq!((u64::from(r[0]) << 32 | u64::from(r[1])) as i64, expected, "{v:?}");
            assert_eq!(i64::from(r[2] as i32), expected.signum(), "{v:?}");
            let limit = 1 << 30;
            assert_eq!(i64::from(r[3] as i32), (expected >> 8).clamp(-limit, limit), "{v:?}");
        }
    });
}

#[test]
fn lanes_know_of_each_other() {
    on_each_gpu("lanes", |gpu| {
        let width = gpu.limits().subgroup_size as usize;
        let mut random = Random::new(8);
        let inputs: Vec<[u32; 4]> = (0..64 * 64)
            .map(|_| [random.below(4).min(1) as u32, random.signed().to_bits(), 0, 0])
            .collect();
        let body = "float number = uintBitsToFloat(v.y);
            uvec4 lanes = lanes_where(v.x == 0u);
            r.x = has_lanes(lanes) ? first_lane(lanes) : 99u;
            lanes = without_first_lane(lanes);
            r.y = has_lane(lanes, gl_SubgroupInvocationID) ? 1u : 0u;
            r.z = floatBitsToUint(lanes_min(number));
            r.w = floatBitsToUint(lanes_max(number));";
        let outputs: Vec<[u32; 4]> = probe(gpu, &["lib/lanes.glsl"], body, &inputs);
        for (inputs, outputs) in inputs.chunks(width).zip(outputs.chunks(width)) {
            let first = inputs.iter().position(|v| v[0] == 0);
            let numbers = || inputs.iter().map(|v| f32::from_bits(v[1]));
            let least = numbers().fold(f32::INFINITY, f32::min).to_bits();
            let most = numbers().fold(f32::NEG_INFINITY, f32::max).to_bits();
            for (lane, (input, output)) in inputs.iter().zip(outputs).enumerate() {
                let left = u32::from(input[0] == 0 && Some(lane) != first);
                let expected = [first.unwrap_or(99) as u32, left, least, most];
                assert_eq!(*output, expected, "lane {lane} of {inputs:?}");
            }
        }
    });
}

/// Whether a triangle has any pixel is asked of patches of every width, with edges as far out as they get.
#[test]
fn patches_are_left_out_where_an_edge_has_them_outside() {
    on_each_gpu("patches", |gpu| {
        let mut random = Random::new(9);
        // Three edges, each with 16 bits of its value at the first pixel and 8 of each step; a box; and
        // how far these are shifted to the left.
        let inputs: Vec<[u32; 4]> = (0..CASES)
            .map(|_| {
                let far = random.below(2);
                let mut edge = || {
                    let most = if far == 0 { 1200 } else { 32768 };
                    let at = (random.below(2 * most) as i32 - most as i32) as u32 & 0xffff;
                    let mut step = || (random.below(255) as i32 - 127) as u32 & 0xff;
                    at | step() << 16 | step() << 24
                };
                let edges = [edge(), edge(), edge()];
                let (x, y) = (random.below(16), random.below(8));
                let last = [x + random.below(16 - x), y + random.below(8 - y)];
                let corners = x | y << 4 | last[0] << 8 | last[1] << 12 | far << 16;
                [edges[0], edges[1], edges[2], corners as u32]
            })
            .collect();
        let body = "int far = int(v.w >> 16) & 1;
            ivec3 at = (ivec3(v.xyz << 16) >> 16) << (15 * far);
            ivec3 dx = (ivec3(v.xyz << 8) >> 24) << (17 * far), dy = (ivec3(v.xyz) >> 24) << (17 * far);
            ivec4 corners = ivec4(v.w, v.w >> 4, v.w >> 8, v.w >> 12) & 15;
            if (corners.x > BLOCK_LAST.x) corners.xz -= 8;
            r.x = patches_touched(at, dx, dy, corners.xy, corners.zw);
            r.yzw = uvec3(1u << PATCH_X_LOG2, 1u << PATCH_Y_LOG2, COLUMNS);";
        for lanes in [4, 8, 16, 32, 64, 128] {
            let steps = [
                "lib/exact.glsl",
                "lib/depth_format.glsl",
                "lib/samples.glsl",
                "lib/depth.glsl",
                "lib/patch.glsl",
                "lib/block.glsl",
            ];
            let outputs: Vec<[u32; 4]> = probe_as_if(lanes, gpu, &steps, body, &inputs);
            for (input, [patches, width, height, columns]) in inputs.iter().zip(outputs) {
                assert_eq!(width * height, lanes);
                let corner = |n: u32| i64::from(input[3] >> (4 * n) & 15);
                let moved = if corner(0) > i64::from(columns * width) - 1 { 8 } else { 0 };
                let (left, right) = (corner(0) - moved, corner(2) - moved);
                let far = input[3] >> 16 & 1;
                let mut expected = 0;
                for patch in 0..lanes.max(64) / lanes {
                    let x = i64::from(patch % columns * width);
                    let y = i64::from(patch / columns * height);
                    let (end_x, end_y) = (x + i64::from(width), y + i64::from(height));
                    let boxed = left < end_x && right >= x && corner(1) < end_y && corner(3) >= y;
                    let inside = input[..3].iter().all(|&edge| {
                        let signed = |shift: u32, bits: u32, scale: u32| {
                            i64::from((edge << shift) as i32 >> (32 - bits)) << (scale * far)
                        };
                        let (at, dx, dy) = (signed(16, 16, 15), signed(8, 8, 17), signed(0, 8, 17));
                        (x..end_x).any(|x| (y..end_y).any(|y| at + dx * x + dy * y >= 0))
                    });
                    expected |= u32::from(boxed && inside) << patch;
                }
                assert_eq!(patches, expected, "{lanes} lanes, {input:x?}");
            }
        }
    });
}

/// Where a fragment is said to leave the target alone, blending it would.
#[test]
fn every_pixel_of_a_bin_has_one_place() {
    on_each_gpu("pixel order", |gpu| {
        let inputs: Vec<[u32; 4]> = (0..abi::BIN_PIXELS).map(|i| [i, 0, 0, 0]).collect();
        let body = "uvec2 p = tile_pixel(v.x); r = uvec4(p, tile_index(p), 0u);";
        let outputs: Vec<[u32; 4]> = probe(gpu, &["lib/tile.glsl"], body, &inputs);
        let mut seen = [false; abi::BIN_PIXELS as usize];
        for (i, [x, y, back, _]) in outputs.into_iter().enumerate() {
            assert_eq!(back as usize, i, "tile_index undoes tile_pixel");
            assert_eq!(pixel_number(x, y), back, "the host's order is the kernels'");
            assert!(!std::mem::replace(&mut seen[(y * 16 + x) as usize], true), "({x}, {y}) twice");
            let (quad_x, quad_y) = (outputs_of(i & !3).0, outputs_of(i & !3).1);
            assert_eq!((x & !1, y & !1), (quad_x, quad_y), "lanes 4m to 4m+3 are a quad");
        }
    });
}

/// Where the first pixel of a quad has to be: quads in rows of four, quadrants in rows of two.
fn outputs_of(first: usize) -> (u32, u32) {
    let (quadrant, quad) = (first as u32 / 64, first as u32 % 64 / 4);
    (quadrant % 2 * 8 + quad % 4 * 2, quadrant / 2 * 8 + quad / 4 * 2)
}

#[test]
fn edges_are_exact_far_outside_the_screen() {
    on_each_gpu("edges", |gpu| {
        let mut random = Random::new(5);
        let inputs: Vec<[i32; 4]> = (0..CASES)
            .map(|_| std::array::from_fn(|_| ((random.bits() as i32) >> 8) >> random.below(20)))
            .collect();
        let body = "ivec2 a = ivec2(v.xy), b = ivec2(v.zw);
            r = uvec4(uint(edge_at(a, b, ivec2(0), 8u).x), uint(edge_at(a, b, ivec2(3840, 2560), 8u).x),
            uint(edge_bias(b.x - a.x, b.y - a.y)), uint(edge_at(a, b, ivec2(3840, 2560), 8u).y));";
        let outputs: Vec<[i32; 4]> =
            probe(gpu, &["lib/wide.glsl", "lib/samples.glsl", "lib/edge.glsl"], body, &inputs);
        for (v, r) in inputs.iter().zip(&outputs) {
            let [ax, ay, bx, by] = v.map(i64::from);
            let bias = if by < ay || (by == ay && bx > ax) { 0 } else { -1 };
            let at = |x: i64, y: i64| {
                let value = (bx - ax) * (y - ay) - (by - ay) * (x - ax) + bias;
                (value >> 8).clamp(-(1 << 30), 1 << 30)
            };
            assert_eq!(r[2] as i64, bias, "{v:?}");
            assert_eq!((r[0] as i64, r[1] as i64), (at(0, 0), at(3840, 2560)), "{v:?}");
            // What a sample of a pixel needs of the bits that are lost.
            let value = (bx - ax) * (2560 - ay) - (by - ay) * (3840 - ax) + bias;
            assert_eq!(i64::from(r[3]), (value >> 4) & 15, "{v:?}");
        }
    });
}

/// Set 1 is the resource table: a kernel that declares something else there would not fit its layout.
#[test]
fn blocks_of_a_kernel_belong_to_set_0() {
    on_each_gpu("blocks of a kernel belong to set 0", |gpu| {
        let of = |declaration: &str, used: &str| {
            let source = format!(
                "#version 460
                 layout(local_size_x = 1) in;
                 {declaration}
                 layout(set = 0, binding = 0) buffer Out {{ uint result; }};
                 void main() {{ result = {used}; }}"
            );
            Kernel::from_glsl(gpu, "odd", &source)
        };
        of(
            "layout(set = 1, binding = 4) buffer Words { uint words[]; } table[];",
            "table[0].words[0]",
        )
        .unwrap();
        for (declaration, used, words) in [
            ("layout(set = 1, binding = 0) buffer Mine { uint mine[]; };", "mine[0]", "set 0"),
            ("layout(set = 1, binding = 3) uniform Mine { uint mine; };", "mine", "set 0"),
            (
                "layout(set = 1, binding = 1) uniform sampler2D s[2];",
                "uint(texture(s[0], vec2(0)).x)",
                "set 0",
            ),
            (
                "layout(set = 0, binding = 1) buffer Mine { uint mine[]; } many[4];",
                "many[2].mine[0]",
                "binding 4 of the resource table",
            ),
            (
                "layout(set = 0, binding = 1) uniform sampler2D s;",
                "uint(texture(s, vec2(0)).x)",
                "resource table",
            ),
        ] {
            let error =
                of(declaration, used).err().unwrap_or_else(|| panic!("{declaration} is taken"));
            assert!(error.to_string().contains(words), "{declaration}: {error}");
        }
        let error = of("", "nothing").err().unwrap();
        assert!(error.to_string().contains("line 5"), "{error}");
    });
}
