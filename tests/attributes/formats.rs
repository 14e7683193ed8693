//! Do vertex shaders see what the bits of an attribute mean, in every format and with every divisor?

use super::buffer;
use crate::common::{gpu, on_each_gpu, random::Random};
use std::sync::Arc;
use tilewright::{
    Error, classic, compare, compute,
    format::{Format, Numeric, Packing, VertexFormat},
    image::Extent,
    pass::{
        Draw, Executor, Indirect, IndirectCommand, Pass, Pipeline, StepRate, VertexAttribute,
        VertexBinding,
    },
    shader::{Shader, Stage},
    state::Topology,
    target::{ColorTarget, DepthTarget},
    vk::Gpu,
};

/// Pixels of a row of the target, one for each instance.
const WIDTH: u32 = 64;

/// The formats that vertices can have.
fn formats() -> Vec<VertexFormat> {
    use Numeric::*;
    let mut all = Vec::new();
    for count in 1..=4 {
        for numeric in [Unorm, Snorm, Uscaled, Sscaled, Uint, Sint] {
            all.push(VertexFormat::new(numeric, Packing::Bits8, count));
            all.push(VertexFormat::new(numeric, Packing::Bits16, count));
        }
        all.push(VertexFormat::new(Float, Packing::Bits16, count));
        all.extend([Uint, Sint, Float].map(|n| VertexFormat::new(n, Packing::Bits32, count)));
    }
    for numeric in [Unorm, Snorm, Uscaled, Sscaled, Uint, Sint] {
        let packings = [Packing::Bgra8, Packing::Rgb10a2, Packing::Bgr10a2];
        all.extend(packings.map(|packing| VertexFormat::new(numeric, packing, 4)));
    }
    all.extend(
        [Format::Rg11b10Ufloat, Format::R5g6b5Unorm, Format::A1r5g5b5Unorm].map(VertexFormat::from),
    );
    all
}

/// First bit and number of bits of each component; bits are counted from the first byte's lowest.
fn layout(format: VertexFormat) -> Vec<(u32, u32)> {
    let each = |bits: u32| (0..u32::from(format.count)).map(|n| (n * bits, bits)).collect();
    match format.packing {
        Packing::Bits8 => each(8),
        Packing::Bits16 => each(16),
        Packing::Bits32 => each(32),
        Packing::Bgra8 => vec![(16, 8), (8, 8), (0, 8), (24, 8)],
        Packing::Rgb10a2 => vec![(0, 10), (10, 10), (20, 10), (30, 2)],
        Packing::Bgr10a2 => vec![(20, 10), (10, 10), (0, 10), (30, 2)],
        Packing::Rg11b10 => vec![(0, 11), (11, 11), (22, 10)],
        Packing::R5g6b5 => vec![(11, 5), (5, 6), (0, 5)],
        Packing::A1r5g5b5 => vec![(10, 5), (5, 5), (0, 5), (15, 1)],
        _ => unreachable!(),
    }
}

/// What a component of so many bits stands for, of floats and of what shaders see as floats.
fn value(numeric: Numeric, number: u32, bits: u32) -> f64 {
    let most = 2f64.powi(bits as i32) - 1.0;
    let sign = 1 << (bits - 1);
    let signed = f64::from(number) - if number & sign != 0 { most + 1.0 } else { 0.0 };
    match numeric {
        Numeric::Unorm => f64::from(number) / most,
        Numeric::Snorm => (signed / (2f64.powi(bits as i32 - 1) - 1.0)).max(-1.0),
        Numeric::Uscaled => f64::from(number),
        Numeric::Sscaled => signed,
        Numeric::Float => {
            let (mantissa, sign) = match bits {
                16 => (10, if number >> 15 == 1 { -1.0 } else { 1.0 }),
                bits => (bits as i32 - 5, 1.0),
            };
            let below = f64::from(number & ((1 << mantissa) - 1)) / 2f64.powi(mantissa);
            sign * match number >> mantissa & 31 {
                0 => below * 2f64.powi(-14),
                31 if below == 0.0 => f64::INFINITY,
                31 => f64::NAN,
                exponent => (1.0 + below) * 2f64.powi(exponent as i32 - 15),
            }
        }
        _ => unreachable!(),
    }
}

/// Whether `found` is what a shader should see of `bytes`, to the bit but for what is normalized: that may be an epsilon off,
/// and is exact where it is 0, 1 or -1.
fn is_right(format: VertexFormat, bytes: &[u8], found: [u32; 4]) -> bool {
    let all = bytes.iter().rev().fold(0u128, |all, byte| all << 8 | u128::from(*byte));
    let layout = layout(format);
    (0..4).all(|n| {
        let Some(&(first, bits)) = layout.get(n) else {
            let is_integer = matches!(format.numeric, Numeric::Uint | Numeric::Sint);
            let one = if is_integer { 1 } else { 1f32.to_bits() };
            return found[n] == if n == 3 { one } else { 0 };
        };
        let number = (all >> first & ((1 << bits) - 1)) as u32;
        match format.numeric {
            _ if bits == 32 => found[n] == number,
            Numeric::Uint => found[n] == number,
            Numeric::Sint => found[n] as i32 == (number << (32 - bits)) as i32 >> (32 - bits),
            numeric => {
                let (expected, found) = (value(numeric, number, bits), f32::from_bits(found[n]));
                let room = match numeric {
                    Numeric::Unorm | Numeric::Snorm if expected.abs() != 1.0 => {
                        expected.abs() * f64::from(f32::EPSILON)
                    }
                    _ => 0.0,
                };
                let near = (f64::from(found) - expected).abs() <= room;
                near || f64::from(found) == expected || found.is_nan() && expected.is_nan()
            }
        }
    })
}

/// Draws a pixel for each instance from `first` on, whose colour is the bits that the shader sees of an attribute: of the first
/// attribute in the first instance, of the second in the second, and so on. Each attribute has a buffer of its own.
fn pass(attributes: &[(VertexFormat, Vec<u8>)], instances: u32, first: u32) -> Pass {
    let (mut inputs, mut choice) = (String::new(), String::new());
    for (n, (format, _)) in attributes.iter().enumerate() {
        let (kind, bits) = match format.numeric {
            Numeric::Uint => ("uvec4", "VALUE"),
            Numeric::Sint => ("ivec4", "uvec4(VALUE)"),
            _ => ("vec4", "floatBitsToUint(VALUE)"),
        };
        inputs += &format!("layout(location = {n}) in {kind} value{n};\n");
        let bits = bits.replace("VALUE", &format!("value{n}"));
        choice += &format!("if (number % {} == {n}) bits = {bits};\n", attributes.len());
    }
    let rows = instances.div_ceil(WIDTH);
    let vertex = format!(
        "#version 450
        {inputs}
        layout(location = 0) flat out uvec4 bits;
        void main() {{
            int number = gl_InstanceIndex - {first};
            vec2 pixel = vec2(number % {WIDTH}, number / {WIDTH});
            // The first triangle covers the pixel's centre.
            vec2 corner = 1.2 * vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1);
            gl_Position = vec4((pixel + corner) / vec2({WIDTH}, {rows}) * 2.0 - 1.0, 0.5, 1.0);
            bits = uvec4(0u);
            {choice}
        }}"
    );
    let fragment = "#version 450
        layout(location = 0) flat in uvec4 bits;
        layout(location = 0) out uvec4 color;
        void main() { color = bits; }";
    let shader = |stage, text: &str| Arc::new(Shader::from_glsl(stage, "bits", text).unwrap());
    let numbered = || (0..).zip(attributes);
    let pipeline =
        Pipeline::new("bits", shader(Stage::Vertex, &vertex), shader(Stage::Fragment, fragment))
            .topology(Topology::TriangleStrip)
            .vertex_bindings(
                numbered()
                    .map(|(_, (f, _))| VertexBinding::per_instance(f.bytes() as u32))
                    .collect::<Vec<_>>(),
            )
            .vertex_attributes(
                numbered()
                    .map(|(n, (format, _))| VertexAttribute::new(n, n, *format, 0))
                    .collect::<Vec<_>>(),
            );
    let mut draw = Draw::new(0, 4);
    draw.instances = instances;
    draw.first_instance = first;
    draw.vertex_buffers = attributes.iter().map(|(_, bytes)| buffer("values", bytes)).collect();
    Pass::new("bits", Extent::new(WIDTH, rows))
        .colors([ColorTarget::cleared(Format::Rgba32Uint, [0u32; 4])])
        .depth(DepthTarget::cleared(1.0))
        .pipelines([Arc::new(pipeline)])
        .draws([draw])
}

/// The bits that the instances of `pass` see.
fn seen(executor: &mut impl Executor, pass: &Pass) -> Result<Vec<[u32; 4]>, Error> {
    let frame = executor.render(pass)?;
    Ok(frame.colors[0].bytes.chunks_exact(16).map(bytemuck::pod_read_unaligned).collect())
}

/// 64 elements: the least and the greatest numbers, what is not a number, and random ones.
fn elements(format: VertexFormat, seed: u64) -> Vec<u8> {
    let mut random = Random::new(seed);
    let size = format.bytes();
    let patterns: [[u8; 4]; 8] = [
        [0; 4],
        [0xff; 4],
        [0x00, 0x80, 0x00, 0x80],
        [0x01, 0x80, 0xff, 0x7f],
        [0xff, 0x7f, 0x01, 0x80],
        [0x00, 0x7c, 0x00, 0xfc],
        [0x01, 0x7c, 0xff, 0x03],
        [0x00, 0x04, 0x01, 0x00],
    ];
    let known = patterns.iter().flat_map(|pattern| pattern.repeat(4)[..size].to_vec());
    let others = (0..56 * size).map(|_| random.below(256) as u8);
    known.chain(others).collect()
}

/// Whether lavapipe reads `bytes` against the specification: the least number of a signed normalized format as less than -1,
/// and halves that are infinite or no numbers as finite ones.
fn is_wrong_in_lavapipe(format: VertexFormat, bytes: &[u8]) -> bool {
    let all = bytes.iter().rev().fold(0u128, |all, byte| all << 8 | u128::from(*byte));
    layout(format).iter().any(|(first, bits)| {
        let number = (all >> first & ((1 << bits) - 1)) as u32;
        match (format.numeric, bits) {
            (Numeric::Snorm, _) => number == 1 << (bits - 1),
            (Numeric::Float, 16) => number >> 10 & 31 == 31,
            _ => false,
        }
    })
}

/// By compute always; by the device's own pipeline where it reads the format. Eight formats at a time.
#[test]
fn shaders_see_what_every_vertex_format_means() {
    let all: Vec<_> = (7100..).zip(formats()).map(|(seed, f)| (f, elements(f, seed))).collect();
    on_each_gpu("shaders see what every vertex format means", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let check = |attributes: &[(VertexFormat, Vec<u8>)], found: &[[u32; 4]], known: bool| {
            let mut compared = 0;
            for (n, (format, bytes)) in attributes.iter().enumerate() {
                let found = found.iter().skip(n).step_by(attributes.len());
                for (bytes, found) in bytes.chunks_exact(format.bytes()).zip(found) {
                    if known && is_wrong_in_lavapipe(*format, bytes) {
                        continue;
                    }
                    compared += 1;
                    let floats = found.map(f32::from_bits);
                    let what = format!("{format:?}: {bytes:02x?} is {found:08x?}, {floats:?}");
                    assert!(is_right(*format, bytes, *found), "classic: {known}, {what}");
                }
            }
            compared
        };
        // Every instance reads an element of its own.
        let repeated = |attributes: &[(VertexFormat, Vec<u8>)]| {
            let times = attributes.len();
            let of = |(format, bytes): &(VertexFormat, Vec<u8>)| {
                let elements = bytes.chunks_exact(format.bytes());
                (*format, elements.flat_map(|element| element.repeat(times)).collect())
            };
            pass(&attributes.iter().map(of).collect::<Vec<_>>(), 64 * times as u32, 0)
        };
        for attributes in all.chunks(8) {
            let compared =
                check(attributes, &seen(&mut compute, &repeated(attributes)).unwrap(), false);
            assert_eq!(compared, 64 * attributes.len());
        }
        if !gpu.has_graphics() {
            return;
        }
        let mut classic = classic::Renderer::new(gpu).unwrap();
        let (mut compared, mut lacking) = (0, Vec::new());
        for attribute in &all {
            let attribute = std::slice::from_ref(attribute);
            match seen(&mut classic, &repeated(attribute)) {
                Ok(found) => compared += check(attribute, &found, true),
                Err(Error::Device(_)) => lacking.push(attribute[0].0),
                Err(error) => panic!("{error}"),
            }
        }
        assert!(compared > 2500, "{compared} compared; the device does not read {lacking:?}");
    });
}

#[test]
fn what_is_no_format_of_vertices_is_refused_by_name() {
    for (numeric, packing, count) in [
        (Numeric::Srgb, Packing::Bits8, 4),
        (Numeric::Depth, Packing::Bits32, 1),
        (Numeric::Unorm, Packing::Bits32, 1),
        (Numeric::Float, Packing::Bits8, 2),
        (Numeric::Unorm, Packing::Rgb10a2, 3),
        (Numeric::Unorm, Packing::Rg11b10, 3),
    ] {
        let format = VertexFormat::new(numeric, packing, count);
        let pass = pass(&[(format, vec![0; 64])], 1, 0);
        let Err(error) = pass.validate() else { panic!("{format:?}") };
        let (error, name) = (error.to_string(), format!("{format:?}"));
        assert!(error.contains(&name) && error.contains("no format of vertices"), "{error}");
    }
}

/// Several instances read one element, counted from the first instance of the draw.
#[test]
fn instances_share_elements_as_the_divisor_says() {
    let elements: Vec<u32> = (0..500).map(|n| 1000 + n).collect();
    let divided = |divisor, first| {
        let bytes = bytemuck::cast_slice(&elements).to_vec();
        let mut pass = pass(&[(Format::R32Uint.into(), bytes)], 200, first);
        let mut pipeline = (*pass.pipelines[0]).clone();
        pipeline.vertex_bindings[0].rate = StepRate::Instances(divisor);
        pass.pipelines = vec![Arc::new(pipeline)];
        pass
    };
    let error = divided(1 << 20, 0).validate().unwrap_err().to_string();
    assert!(error.contains("1048576") && error.contains("at most 1048575"), "{error}");
    on_each_gpu("instances share elements as the divisor says", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        let mut classic = gpu.has_graphics().then(|| classic::Renderer::new(gpu).unwrap());
        for (divisor, first) in [0, 1, 2, 3, 7, 64, 1000].into_iter().flat_map(|d| [(d, 0), (d, 5)])
        {
            let expected = (0..200u32).map(|instance| {
                [1000 + first + instance.checked_div(divisor).unwrap_or(0), 0, 0, 1]
            });
            let expected: Vec<_> = expected.collect();
            let mut pass = divided(divisor, first);
            // The range ends with the last element that an instance reads.
            let last = (first + 199u32.checked_div(divisor).unwrap_or(0)) as usize;
            pass.draws[0].vertex_buffers[0].bytes = 4 * last;
            assert!(pass.validate().is_err(), "divisor {divisor}, first {first}");
            pass.draws[0].vertex_buffers[0].bytes = 4 * (last + 1);
            let found = seen(&mut compute, &pass).unwrap();
            assert_eq!(found[..200], expected, "compute, divisor {divisor}, first {first}");
            if let Some(classic) = &mut classic {
                match seen(classic, &pass) {
                    Ok(found) => assert_eq!(found[..200], expected, "classic, {divisor}, {first}"),
                    Err(Error::Device(_)) if !is_lavapipe(gpu) => {}
                    Err(error) => panic!("{error}"),
                }
            }
        }
    });
}

/// Commands are read on the device, and by the host for a trace; a draw that is cut ends within an instance.
#[test]
fn commands_share_elements_as_the_divisor_says() {
    let elements: Vec<u32> = (0..500).map(|n| 1000 + n).collect();
    on_each_gpu("commands share elements as the divisor says", |gpu| {
        let mut compute = compute::Renderer::new(gpu).unwrap();
        for (divisor, first) in [(3, 0), (0, 5), (2, 1), (1, 4)] {
            let bytes = bytemuck::cast_slice(&elements).to_vec();
            let mut pass = pass(&[(Format::R32Uint.into(), bytes)], 64, first);
            let mut pipeline = (*pass.pipelines[0]).clone();
            pipeline.vertex_bindings[0].rate = StepRate::Instances(divisor);
            pass.pipelines = vec![Arc::new(pipeline)];
            let command =
                IndirectCommand { count: 4, instances: 10, first: 0, first_instance: first };
            let commands = buffer("commands", &[command]);
            // Nine primitives: the fifth instance has one of its two. The numbers of the draw itself do not count.
            pass.draws[0].first_instance = 100_000;
            pass.draws[0].indirect = Some(Indirect::in_range(commands, 16, 9));
            let expected: Vec<_> = (0..5u32)
                .map(|n| [1000 + first + n.checked_div(divisor).unwrap_or(0), 0, 0, 1])
                .collect();
            assert_eq!(seen(&mut compute, &pass).unwrap()[..5], expected, "{divisor}, {first}");
            let (frame, _) = compute.trace(&pass).unwrap();
            let traced: Vec<[u32; 4]> = bytemuck::pod_collect_to_vec(&frame.colors[0].bytes);
            assert_eq!(traced[..5], expected, "trace, {divisor}, {first}");
        }
    });
}

/// Positions that several instances share: the pass that tells primitives apart draws where the pass itself draws.
#[test]
fn ids_are_drawn_where_the_divisor_puts_them() {
    let gpu = gpu();
    let mut compute = compute::Renderer::new(&gpu).unwrap();
    for divisor in [0, 2, 4] {
        let vertex = "#version 450
            layout(location = 0) in float column;
            void main() {
                vec2 corner = vec2(gl_VertexIndex & 1, gl_VertexIndex >> 1);
                gl_Position = vec4((vec2(column, 0.0) + corner) * vec2(0.25, 2.0) - 1.0, 0.5, 1.0);
            }";
        let fragment = "#version 450
            layout(location = 0) out vec4 color;
            void main() { color = vec4(1.0); }";
        let shader = |stage, text: &str| Shader::from_glsl(stage, "columns", text).unwrap();
        let pipeline = Pipeline::new(
            "columns",
            shader(Stage::Vertex, vertex),
            shader(Stage::Fragment, fragment),
        )
        .topology(Topology::TriangleStrip)
        .vertex_bindings([VertexBinding { stride: 4, rate: StepRate::Instances(divisor) }])
        .vertex_attributes([VertexAttribute::new(0, 0, VertexFormat::F32X1, 0)]);
        // As many elements as are read.
        let columns: Vec<f32> =
            (0..3.max(2 + 3u32.checked_div(divisor).unwrap_or(0))).map(|n| n as f32).collect();
        let mut draw = Draw::new(0, 4).vertex_buffers([buffer("columns", &columns)]);
        (draw.instances, draw.first_instance) = (4, 1);
        let pass = Pass::new("columns", Extent::new(64, 8))
            .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
            .pipelines([Arc::new(pipeline)])
            .draws([draw]);
        let drawn = compute.render(&pass).unwrap();
        let ids = compute.render(&compare::id_pass(&pass).unwrap().pass).unwrap();
        let covered = |frame: &tilewright::Frame| -> Vec<bool> {
            frame.colors[0].bytes.chunks_exact(4).map(|texel| texel != [0; 4]).collect()
        };
        assert_eq!(covered(&drawn), covered(&ids), "divisor {divisor}");
    }
}

fn is_lavapipe(gpu: &Gpu) -> bool {
    gpu.info().name.starts_with("llvmpipe")
}
