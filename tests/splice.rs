//! Does a spliced shader compute the right values? Shaders run in the smallest possible kernels, on
//! every driver, with both kinds of derivatives, as compiled and as an optimizer leaves them.

mod resources;

use crate::common::{gpu, kernel_spirv, on_each_gpu};
use std::{
    io::Write,
    process::{Command, Stdio},
};
use tilewright::{
    format::Format,
    image::Extent,
    shader::{
        Shader, Stage,
        splice::{Blocks, Derivatives, SpliceOptions, splice},
    },
    texture,
    vk::{
        Buffer, Gpu, Image, ImageInfo, ImageUse, Kernel, KernelInfo, Memory, Recorder,
        ResourceTable, Sampler,
    },
};

const PIXELS: usize = 128;
const UNTOUCHED: u32 = 0xdead_beef;

/// The places of the fragments, and their inputs.
struct Scene<'g> {
    gpu: &'g Gpu,
    table: ResourceTable,
    /// Table indices in the order of the shader's resources.
    slots: Vec<u32>,
    /// `a + b x + c y` for each component of each location.
    planes: Vec<[f32; 4]>,
    covered: u32,
    calls: u32,
    specialization: Vec<(u32, u32)>,
}

/// What fragments wrote.
struct Shaded {
    colors: Vec<u32>,
    depths: Vec<f32>,
}

impl Shaded {
    fn bits(&self, pixel: usize, location: usize) -> [u32; 4] {
        let at = (pixel * 8 + location) * 4;
        self.colors[at..at + 4].try_into().unwrap()
    }

    fn color(&self, pixel: usize) -> [f32; 4] {
        self.bits(pixel, 0).map(f32::from_bits)
    }
}

/// The centre of a pixel: quads stand in a row.
fn center(pixel: usize) -> (f32, f32) {
    let (quad, lane) = (pixel / 4, pixel % 4);
    ((quad * 2 + lane % 2) as f32 + 0.5, (lane / 2) as f32 + 0.5)
}

impl<'g> Scene<'g> {
    /// All pixels covered; location 0 is the pixel's centre, location 1 is (1, 2, 3, 4).
    fn new(gpu: &'g Gpu) -> Self {
        let constant = |n: usize| [n as f32, 0.0, 0.0, 0.0];
        let mut planes = vec![[0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0]];
        planes.extend([constant(0), constant(1)]);
        planes.extend((1..61).map(constant));
        Self {
            gpu,
            table: ResourceTable::new(gpu).unwrap(),
            slots: Vec::new(),
            planes,
            covered: PIXELS as u32,
            calls: 1,
            specialization: Vec::new(),
        }
    }

    fn bind(&mut self, buffer: &Buffer<u32>) {
        self.slots.push(self.table.insert_buffer(buffer).unwrap());
    }

    /// Runs `body` as it is and optimized, with every kind of derivatives the device has.
    fn shade(&self, body: &str, mut check: impl FnMut(&Shaded)) {
        let source = format!("#version 460\n{body}");
        let shader = Shader::from_glsl(Stage::Fragment, "test.frag", &source).unwrap();
        let native = self.gpu.has_compute_derivatives();
        for shader in [optimized(&shader), shader] {
            let tiers = [Some(Derivatives::Quad), native.then_some(Derivatives::Native)];
            for tier in tiers.into_iter().flatten() {
                check(&self.shade_once(&shader, tier));
            }
        }
    }

    fn shade_once(&self, shader: &Shader, derivatives: Derivatives) -> Shaded {
        let gpu = self.gpu;
        let host = kernel_spirv(include_str!("fixtures/fragment.comp"));
        let kernel = kernel(gpu, &host, shader, derivatives, &self.specialization);
        let mut draw = vec![self.covered, self.calls];
        // The stub's mention of the first resource is gone; the list must not be empty all the same.
        draw.extend(self.slots.iter().chain(&[0]));
        let draw = Buffer::with_content(gpu, "draw", &draw).unwrap();
        let planes = Buffer::with_content(gpu, "planes", &self.planes).unwrap();
        let colors = Buffer::<u32>::new(gpu, "colors", PIXELS * 32, Memory::Device).unwrap();
        let depths = Buffer::<f32>::new(gpu, "depths", PIXELS, Memory::Device).unwrap();
        let mut recorder = Recorder::new(gpu, "shade").unwrap();
        recorder.fill(&colors, UNTOUCHED).unwrap();
        let dispatch = recorder.kernel(&kernel).bind("draw", &draw).bind("planes", &planes);
        let dispatch = dispatch.bind("colors", &colors).bind("depths", &depths);
        let dispatch = if kernel.uses_table() { dispatch.table(&self.table) } else { dispatch };
        dispatch.dispatch([PIXELS as u32 / 64, 1, 1]).unwrap();
        let (colors, depths) =
            (recorder.download(&colors).unwrap(), recorder.download(&depths).unwrap());
        recorder.submit().unwrap();
        Shaded { colors: colors.read().unwrap(), depths: depths.read().unwrap() }
    }
}

fn kernel(
    gpu: &Gpu,
    host: &[u32],
    shader: &Shader,
    derivatives: Derivatives,
    specialization: &[(u32, u32)],
) -> Kernel {
    // Each way once: CPU devices have both derivatives of their own and blocks that are prefetched.
    let blocks = match derivatives {
        Derivatives::Native => Blocks::Prefetched,
        Derivatives::Quad => Blocks::InPlace,
    };
    let options = SpliceOptions { derivatives, blocks, specialization };
    let spliced = splice(host, shader, &options).unwrap_or_else(|e| panic!("{e}"));
    let width = gpu.limits().subgroup_size;
    let info = KernelInfo::new("spliced", &spliced.spirv)
        .constant_ids(specialization)
        .full_subgroups(true)
        .subgroup_size(Some(width));
    // SAFETY: the splicer's modules are valid; a test asks a validator that knows the extension for derivatives, which
    // that of a distribution may not.
    unsafe { Kernel::new_unchecked(gpu, &info) }.unwrap_or_else(|e| panic!("{e}"))
}

/// The module as an optimizer leaves it: values instead of variables.
fn optimized(shader: &Shader) -> Shader {
    let mut child = Command::new("spirv-opt")
        .args(["-O", "--target-env=vulkan1.3", "-", "-o", "-"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the tests need spirv-opt (Debian: spirv-tools); scripts/setup installs it");
    let bytes: Vec<u8> = shader.spirv().iter().flat_map(|w| w.to_le_bytes()).collect();
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(&bytes).unwrap());
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    let bytes = output.stdout.chunks_exact(4);
    let words: Vec<u32> = bytes.map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect();
    Shader::from_spirv(shader.stage(), "optimized.frag", &words).unwrap()
}

fn words(gpu: &Gpu, content: &[u32]) -> Buffer<u32> {
    Buffer::with_content(gpu, "words", content).unwrap()
}

#[test]
fn a_discarded_pixel_still_serves_its_quad() {
    on_each_gpu("a discarded pixel still serves its quad", |gpu| {
        let scene = Scene::new(gpu);
        // Every other column goes, in a function, in a switch, or in a loop; the squares' differences
        // need all four pixels of each quad.
        let ways = [
            "if (odd) discard;",
            "leave(odd);",
            "switch (int(p.x) & 1) { case 1: discard; default: break; }",
            "for (int i = 0; i < 4; i++) { if (odd && i == 2) discard; }",
            "for (;;) { if (odd) discard; else break; }",
            "while (true) { leave(odd); if (p.x > -1.0) break; }",
            "vec2 q = p; if (odd) { q += 1.0; discard; } else { q -= 1.0; } p = q + 1.0;",
            "if (p.x > 0.0) { if (odd) discard; if (p.y > 1.0) { p.y += 0.0; } }",
            "p.x = odd ? nothing() : p.x; if (odd) p.x = center.x;",
        ];
        for way in ways {
            let body = format!(
                "layout(location = 0) in vec2 center;
                 layout(location = 0) out vec4 color;
                 void leave(bool now) {{ if (now) discard; }}
                 float nothing() {{ discard; return 1.0; }}
                 void main() {{
                     vec2 p = center;
                     bool odd = (int(p.x) & 1) == 1;
                     float before = p.x + p.y;
                     {way}
                     p = center;
                     color = vec4(dFdx(p.x * p.x), dFdy(p.y * p.y), before, 1.0);
                 }}"
            );
            scene.shade(&body, |shaded| {
                for pixel in 0..PIXELS {
                    let (x, y) = center(pixel);
                    let left = (x - 0.5) % 2.0 == 0.0;
                    assert_eq!(shaded.depths[pixel], if left { 0.5 } else { -1.0 }, "{way}");
                    let expected = [2.0 * x + 1.0, 2.0, x + y, 1.0];
                    let bits = if left { expected.map(f32::to_bits) } else { [UNTOUCHED; 4] };
                    assert_eq!(shaded.bits(pixel, 0), bits, "pixel {pixel} of {way}");
                }
            });
        }
    });
}

#[test]
fn a_loop_that_only_a_discard_ends_does_end() {
    on_each_gpu("a loop that only a discard ends does end", |gpu| {
        let body = "layout(location = 0) in vec2 p;
            layout(location = 0) out vec4 color;
            void main() {
                float y = p.x;
                for (;;) { y += 1.0; if (y > 40.0) discard; color = vec4(y); }
            }";
        Scene::new(gpu).shade(body, |shaded| assert!(shaded.depths.iter().all(|&d| d == -1.0)));
    });
}

/// The words of a buffer, which are zeros from now on.
fn taken(gpu: &Gpu, buffer: &Buffer<u32>) -> Vec<u32> {
    let mut recorder = Recorder::new(gpu, "reset").unwrap();
    let read = recorder.download(buffer).unwrap();
    recorder.fill(buffer, 0).unwrap();
    recorder.submit().unwrap();
    read.read().unwrap()
}

#[test]
fn helpers_change_no_memory() {
    on_each_gpu("helpers change no memory", |gpu| {
        let mut scene = Scene::new(gpu);
        scene.covered = 37;
        let counts = Buffer::<u32>::new(gpu, "counts", 8, Memory::Device).unwrap();
        scene.bind(&counts);
        taken(gpu, &counts);
        let body = "layout(set = 0, binding = 0) buffer Counts { uint n[8]; } counts;
            layout(location = 0) in vec2 p;
            layout(location = 0) out uvec4 color;
            void main() {
                atomicAdd(counts.n[0], 1u);
                uint sum = 0u;
                for (int i = 0; i < 3; i++) { sum += atomicAdd(counts.n[1], 1u) < 1000u ? 1u : 0u; }
                do { atomicAdd(counts.n[2], 1u); sum += 10u; } while (sum < 20u);
                if (p.x < 4.0) discard;
                atomicAdd(counts.n[3], 1u);
                if (gl_HelperInvocation) counts.n[4] = 1u;
                if (p.y < 1.0) counts.n[5] = 9u; else atomicMax(counts.n[6], uint(p.x));
                color = uvec4(sum);
            }";
        scene.shade(body, |shaded| {
            // 37 pixels run; of the first 8, two quads of four columns, none gets past the discard.
            assert_eq!(taken(gpu, &counts), [37, 111, 74, 29, 0, 9, 17, 0]);
            for pixel in 0..PIXELS {
                let expected = if (8..37).contains(&pixel) { 23 } else { UNTOUCHED };
                assert_eq!(shaded.bits(pixel, 0), [expected; 4], "pixel {pixel}");
            }
        });
    });
}

/// The stores are parts of these instructions. Compilers make them only if they are named.
#[test]
fn helpers_take_numbers_apart_and_store_no_part() {
    on_each_gpu("helpers take numbers apart and store no part", |gpu| {
        let mut scene = Scene::new(gpu);
        scene.covered = 37;
        let parts = Buffer::<u32>::new(gpu, "parts", 2 * PIXELS, Memory::Device).unwrap();
        scene.bind(&parts);
        taken(gpu, &parts);
        let body = "#extension GL_EXT_spirv_intrinsics : require
            spirv_instruction(set = \"GLSL.std.450\", id = 35)
            float modf_to(float x, spirv_by_reference float whole);
            spirv_instruction(set = \"GLSL.std.450\", id = 51)
            float frexp_to(float x, spirv_by_reference int exponent);
            layout(set = 0, binding = 0) buffer Parts { float wholes[128]; int exponents[128]; };
            layout(location = 0) in vec2 p;
            layout(location = 0) out vec4 color;
            void main() {
                int column = int(p.x);
                int pixel = column / 2 * 4 + column % 2 + int(p.y) * 2;
                float x = 1.0 + p.x * 0.125;
                float fraction = modf_to(x, wholes[pixel]);
                float significand = frexp_to(x, exponents[pixel]);
                color = vec4(dFdx(fraction), dFdx(significand), fraction, significand);
            }";
        scene.shade(body, |shaded| {
            let parts = taken(gpu, &parts);
            for pixel in 0..PIXELS {
                let found = ([parts[pixel], parts[PIXELS + pixel]], shaded.bits(pixel, 0));
                let x = 1.0 + center(pixel).0 * 0.125;
                let exponent = (x as u32).ilog2() + 1;
                let scale = (1 << exponent) as f32;
                // The last quad has one pixel and three helpers: their numbers make its differences.
                let color = [0.125, 0.125 / scale, x.fract(), x / scale].map(f32::to_bits);
                let covered = ([x.floor().to_bits(), exponent], color);
                let expected = if pixel < 37 { covered } else { ([0; 2], [UNTOUCHED; 4]) };
                assert_eq!(found, expected, "pixel {pixel}");
            }
        });
    });
}

#[test]
fn inputs_and_outputs_keep_their_places() {
    on_each_gpu("inputs and outputs keep their places", |gpu| {
        let mut scene = Scene::new(gpu);
        scene.specialization = vec![(3, 3), (4, 5)];
        let body = "struct Pair { vec2 a; float b; };
            layout(constant_id = 3) const uint N = 3u;
            layout(constant_id = 4) const int SCALE = 1;
            layout(location = 1) in Block { vec3 v; layout(location = 3) flat ivec2 i; } block;
            layout(location = 2, component = 1) in vec2 yz;
            layout(location = 2, component = 3) in float w;
            layout(location = 13) noperspective in vec2 screen;
            layout(location = 4) in mat2 m;
            layout(location = 6) in Pair pairs[2];
            layout(location = 10) in float list[N];
            layout(location = 0) out vec4 color;
            layout(location = 1, component = 2) out ivec2 id;
            layout(location = 2) out float parts[2];
            layout(location = 4) out uvec3 last;
            void main() {
                color = vec4(block.v.z, yz.y, w, m[1][1] + screen.y);
                id = block.i;
                parts[0] = pairs[1].a.y + pairs[0].b;
                parts[1] = list[2];
                last = uvec3(1, 2, SCALE);
            }";
        scene.shade(body, |shaded| {
            let plane = |location: usize, component: usize| (location * 4 + component - 3) as f32;
            for pixel in [0, 1, 66, 127] {
                let last = plane(5, 1) + plane(13, 1);
                let expected = [plane(1, 2), plane(2, 2), plane(2, 3), last];
                assert_eq!(shaded.color(pixel), expected);
                let id = [plane(3, 0), plane(3, 1)].map(f32::to_bits);
                assert_eq!(shaded.bits(pixel, 1), [UNTOUCHED, UNTOUCHED, id[0], id[1]]);
                let parts = [plane(8, 1) + plane(7, 0), plane(12, 0)].map(f32::to_bits);
                assert_eq!([shaded.bits(pixel, 2)[0], shaded.bits(pixel, 3)[0]], parts);
                assert_eq!(shaded.bits(pixel, 4), [1, 2, 5, UNTOUCHED]);
            }
        });
    });
}

#[test]
fn a_specialized_array_of_inputs_is_refused() {
    let source = "#version 460
        layout(constant_id = 3) const uint N = 3u;
        layout(location = 0) in float list[N];
        layout(location = 0) out vec4 color;
        void main() { color = vec4(list[2]); }";
    let shader = Shader::from_glsl(Stage::Fragment, "list.frag", source).unwrap();
    let host = kernel_spirv(include_str!("fixtures/fragment.comp"));
    let with = |specialization| {
        splice(
            &host,
            &shader,
            &SpliceOptions {
                derivatives: Derivatives::Quad,
                blocks: Blocks::InPlace,
                specialization,
            },
        )
    };
    assert!(with(&[(3, 3), (9, 9)]).is_ok());
    let text = with(&[(3, 4)]).unwrap_err().to_string();
    assert!(text.contains("list.frag") && text.contains("from 3 to 4"), "{text}");
}

#[test]
fn built_ins_are_the_kernels() {
    on_each_gpu("built-ins are the kernel's", |gpu| {
        let mut scene = Scene::new(gpu);
        (scene.covered, scene.calls) = (100, 3);
        let body = "#extension GL_EXT_demote_to_helper_invocation : require
            layout(location = 0) out vec4 color;
            float counter = 1.0;
            void main() {
                counter += 1.0;
                color = vec4(gl_FragCoord.xy, gl_PrimitiveID + gl_SampleID, counter);
                color.z += gl_FrontFacing ? 0.25 : 0.0;
                gl_FragDepth = gl_FragCoord.z + 0.25;
                gl_SampleMask[0] = int(gl_FragCoord.x) % 4 == 3 ? 6 : gl_SampleMaskIn[0];
                bool before = gl_HelperInvocation;
                if (gl_FragCoord.x < 8.0) demote;
                if (helperInvocationEXT() && !before) gl_FragDepth = 0.0;
            }";
        scene.shade(body, |shaded| {
            for pixel in 0..PIXELS {
                let (x, y) = center(pixel);
                let there = pixel < 100 && x >= 8.0 && (x as u32) % 4 != 3;
                assert_eq!(shaded.depths[pixel], if there { 0.75 } else { -1.0 }, "pixel {pixel}");
                if there {
                    assert_eq!(shaded.color(pixel), [x, y, 7.25, 2.0], "pixel {pixel}");
                }
            }
        });
    });
}

#[test]
fn vertices_get_attributes_and_give_varyings() {
    on_each_gpu("vertices get attributes and give varyings", |gpu| {
        const VERTICES: usize = 70;
        let source = "#version 460
            layout(location = 0) in vec3 p;
            layout(location = 1) in uvec4 j;
            layout(location = 2) in mat2 m;
            layout(location = 5, component = 2) in ivec2 zw;
            layout(push_constant) uniform Push { mat4 shift; } push;
            layout(location = 0) out Block { vec2 uv; layout(location = 3) flat uvec4 j; } block;
            layout(location = 1) out vec2 columns[2];
            layout(location = 4, component = 1) flat out ivec2 pair;
            void main() {
                gl_Position = push.shift * vec4(p, 1.0);
                block.uv = p.yx;
                block.j = j + uvec4(gl_VertexIndex, gl_InstanceIndex, 0, 0);
                for (int i = 0; i < 2; i++) columns[i] = m[i];
                pair = zw;
            }";
        let shader = Shader::from_glsl(Stage::Vertex, "test.vert", source).unwrap();
        let host = kernel_spirv(include_str!("fixtures/vertex.comp"));
        let attribute = |vertex: usize, location: usize, component: usize| -> u32 {
            let n = (vertex * 64 + location * 4 + component) as u32;
            if matches!(location, 1 | 5) { n } else { (n as f32).to_bits() }
        };
        let attributes: Vec<u32> =
            (0..VERTICES * 64).map(|n| attribute(n / 64, n / 4 % 16, n % 4)).collect();
        let mut shift = [0.0f32; 16];
        (shift[0], shift[5], shift[10], shift[12], shift[15]) = (1.0, 2.0, 1.0, 10.0, 3.0);
        let mut table = ResourceTable::new(gpu).unwrap();
        let slots = [attributes, shift.map(f32::to_bits).to_vec()]
            .map(|content| table.insert_buffer(&words(gpu, &content)).unwrap());
        for shader in [optimized(&shader), shader] {
            let kernel = kernel(gpu, &host, &shader, Derivatives::Quad, &[]);
            let draw = words(gpu, &[VERTICES as u32, slots[0], slots[1]]);
            let clip = Buffer::<[f32; 4]>::new(gpu, "clip", VERTICES, Memory::Device).unwrap();
            let varyings =
                Buffer::<u32>::new(gpu, "varyings", VERTICES * 64, Memory::Device).unwrap();
            let mut recorder = Recorder::new(gpu, "vertices").unwrap();
            recorder.fill(&varyings, UNTOUCHED).unwrap();
            let dispatch = recorder.kernel(&kernel).bind("draw", &draw).bind("clip", &clip);
            let dispatch = dispatch.bind("varyings", &varyings).table(&table);
            dispatch.dispatch([VERTICES.div_ceil(64) as u32, 1, 1]).unwrap();
            let (clip, varyings) =
                (recorder.download(&clip).unwrap(), recorder.download(&varyings).unwrap());
            recorder.submit().unwrap();
            let (clip, varyings) = (clip.read().unwrap(), varyings.read().unwrap());
            for (vertex, clip) in clip.iter().enumerate() {
                let a = |location, component| attribute(vertex, location, component);
                let [x, y, z] = [0, 1, 2].map(|c| f32::from_bits(a(0, c)));
                assert_eq!(*clip, [x + 10.0, 2.0 * y, z, 3.0]);
                let at = |location: usize| {
                    let at = vertex * 64 + location * 4;
                    &varyings[at..at + 4]
                };
                // One store takes a varying that has its location to itself, the rest of it as 0.
                assert_eq!(at(0), [a(0, 1), a(0, 0), 0, 0]);
                assert_eq!(at(1), [a(2, 0), a(2, 1), 0, 0]);
                assert_eq!(at(2), [a(3, 0), a(3, 1), 0, 0]);
                assert_eq!(at(3), [a(1, 0) + vertex as u32, a(1, 1), a(1, 2), a(1, 3)]);
                assert_eq!(at(4), [UNTOUCHED, a(5, 2), a(5, 3), UNTOUCHED]);
            }
        }
    });
}
