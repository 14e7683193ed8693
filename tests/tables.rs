//! The resource table: do kernels find in a slot what was put there?

use crate::common::{gpu, kernel_spirv, on_each_gpu};
use tilewright::{
    format::Format,
    image::Extent,
    texture,
    vk::{
        Buffer, Image, ImageInfo, ImageUse, Kernel, KernelInfo, Memory, Recorder, ResourceTable,
        Sampler,
    },
};

const TABLE: &str = "#version 460
#extension GL_EXT_nonuniform_qualifier : require
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x = 16) in;
layout(set = 1, binding = 0) uniform sampler2D table_sampled[];
layout(set = 1, binding = 1) uniform texture2D table_textures[];
layout(set = 1, binding = 2) uniform sampler table_samplers[];
layout(set = 1, binding = 4, scalar) readonly buffer Words { uint words[]; } table_buffers[];
struct Slots { uint sampled; uint texture_; uint sampler_; uint buffer_; };
layout(set = 0, binding = 0, scalar) readonly buffer S { Slots slots[]; };
layout(set = 0, binding = 1, scalar) writeonly buffer R { vec4 results[]; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    Slots s = slots[i];
    vec4 a = textureLod(table_sampled[nonuniformEXT(s.sampled)], vec2(0.5), 0.0);
    vec4 b = textureLod(sampler2D(table_textures[nonuniformEXT(s.texture_)], table_samplers[nonuniformEXT(s.sampler_)]),
                        vec2(0.5), 1.0);
    uint c = table_buffers[nonuniformEXT(s.buffer_)].words[1];
    results[i] = vec4(a.r, b.g, float(c), 1.0);
}";

#[test]
fn lanes_of_a_subgroup_read_different_slots_of_the_table() {
    on_each_gpu("lanes of a subgroup read different slots of the table", |gpu| {
        let lanes = 16usize;
        let spirv = kernel_spirv(TABLE);
        let info = KernelInfo::new("table", &spirv);
        let kernel = Kernel::new(gpu, &info).unwrap();
        assert!(kernel.uses_table());
        let mut table = ResourceTable::new(gpu).unwrap();
        let sampler = Sampler::new(gpu, &texture::Sampler::default()).unwrap();
        let mut recorder = Recorder::new(gpu, "uploads").unwrap();
        let mut slots = Vec::new();
        for i in 0..lanes {
            let name = format!("texture {i}");
            let info =
                ImageInfo::new(&name, Extent::new(2, 2), Format::Rgba8Unorm, ImageUse::Sampled)
                    .levels(2);
            let image = Image::new(gpu, &info).unwrap();
            let levels = [vec![i as u8 * 10; 16], vec![i as u8 * 10 + 5; 4]];
            recorder.upload_image(&image, &levels).unwrap();
            let buffer = Buffer::with_content(gpu, "words", &[0u32, i as u32 * 100]).unwrap();
            slots.push([
                table.insert_sampled(&image, &sampler).unwrap(),
                table.insert_texture(&image).unwrap(),
                table.insert_sampler(&sampler).unwrap(),
                table.insert_buffer(&buffer).unwrap(),
            ]);
        }
        recorder.submit().unwrap();
        assert_eq!(table.used(), [16, 16, 1, 0, 16]);
        slots.reverse();
        let slots = Buffer::with_content(gpu, "slots", &slots).unwrap();
        let results = Buffer::<[f32; 4]>::new(gpu, "results", lanes, Memory::Device).unwrap();
        let mut recorder = Recorder::new(gpu, "read").unwrap();
        let dispatch = recorder.kernel(&kernel).bind("S", &slots).bind("R", &results);
        dispatch.table(&table).dispatch([1, 1, 1]).unwrap();
        let read = recorder.download(&results).unwrap();
        recorder.submit().unwrap();
        for (lane, result) in read.read().unwrap().into_iter().enumerate() {
            let i = (lanes - 1 - lane) as f32;
            let expected = [i * 10.0 / 255.0, (i * 10.0 + 5.0) / 255.0, i * 100.0, 1.0];
            for (a, b) in result.iter().zip(expected) {
                assert!((a - b).abs() < 1e-3, "lane {lane}: {result:?}, not {expected:?}");
            }
        }
        table.clear().expect("it is written");
        assert_eq!(table.used(), [0; 5]);
    });
}

/// Nothing that safe code computes reaches beyond the table, in either direction.
#[test]
fn indices_beyond_the_table_read_what_free_slots_show() {
    const READ: &str = "#version 460
#extension GL_EXT_nonuniform_qualifier : require
layout(local_size_x = 16) in;
layout(set = 1, binding = 0) uniform sampler2D table_sampled[];
layout(set = 1, binding = 1) uniform texture2D table_textures[];
layout(set = 1, binding = 2) uniform sampler table_samplers[];
layout(set = 1, binding = 3, rgba8) uniform image2D table_images[];
layout(set = 1, binding = 4) readonly buffer Words { uint words[]; } table_buffers[];
layout(set = 0, binding = 0) buffer R { vec4 results[]; };
layout(push_constant) uniform Push { int beyond; };
void main() {
    uint i = gl_LocalInvocationID.x;
    int at = nonuniformEXT(beyond + ((i & 1u) == 0u ? int(i) : -int(i)));
    vec4 sum = textureLod(table_sampled[at], vec2(0.5), 0.0) + imageLoad(table_images[at], ivec2(0));
    sum += textureLod(sampler2D(table_textures[at], table_samplers[at]), vec2(0.5), 0.0);
    // Half of the lanes are switched off.
    if (results[i].x == 1.0) sum += float(table_buffers[at].words[i]);
    results[i] = sum + 5.0;
}";
    on_each_gpu("indices beyond the table read what free slots show", |gpu| {
        let kernel = Kernel::from_glsl(gpu, "beyond", READ).unwrap();
        let table = ResourceTable::new(gpu).unwrap();
        for beyond in [40_000, 0x0400_0000, 0x2000_0001, i32::MAX - 20, i32::MIN + 20, -20] {
            let lanes: Vec<_> = (0..16).map(|lane| [(lane & 1) as f32; 4]).collect();
            let results = Buffer::with_content(gpu, "results", &lanes).unwrap();
            let mut recorder = Recorder::new(gpu, "read").unwrap();
            let dispatch = recorder.kernel(&kernel).bind("R", &results).table(&table);
            dispatch.push(&beyond).dispatch([1, 1, 1]).unwrap();
            let read = recorder.download(&results).unwrap();
            recorder.submit().unwrap();
            assert_eq!(read.read().unwrap(), [[5.0; 4]; 16], "{beyond}");
        }
    });
}

/// With variable pointers, a kernel could step from one descriptor to the next.
#[test]
fn kernels_that_compute_with_pointers_are_refused() {
    let mut spirv = kernel_spirv(TABLE);
    const VARIABLE_POINTERS_STORAGE_BUFFER: u32 = 4441;
    // An instruction of two words behind the header.
    spirv.splice(5..5, [2 << 16 | 17, VARIABLE_POINTERS_STORAGE_BUFFER]);
    let error = Kernel::new(&gpu(), &KernelInfo::new("pointers", &spirv)).unwrap_err();
    assert!(error.to_string().contains("VariablePointers"), "{error}");
}

/// A workgroup's memory and an invocation's own have bounds too, which no device checks.
#[test]
fn indices_beyond_arrays_reach_nothing_else() {
    on_each_gpu("indices beyond arrays reach nothing else", |gpu| {
        let source = "#version 460
layout(local_size_x = 16) in;
layout(constant_id = 3) const uint LENGTH = 16u;
layout(std430, binding = 0) buffer Numbers { uint numbers[]; };
struct Part { uint a[4]; vec4 b; };
shared uint s[LENGTH];
shared Part parts[2];
uint own[4];
void wild(inout uint list[4], uint at) { list[at] = 5u; }
void main() {
    uint far = numbers[0] * 1048583u + gl_LocalInvocationIndex * 16777259u;
    s[far] = 3u;
    parts[far].a[far] = 4u;
    parts[int(far) - 7].b[far] = 2.0;
    wild(parts[1].a, far);
    own[far] = 7u;
    uint local[8];
    for (uint i = 0u; i < 8u; i++) local[i] = i;
    local[far] = 9u;
    barrier();
    numbers[1u + gl_LocalInvocationIndex] = s[LENGTH - 1u] + own[3] + local[7] + uint(parts[1].b.w);
}";
        let kernel = Kernel::from_glsl(gpu, "wild", source).unwrap();
        let numbers = Buffer::with_content(gpu, "numbers", &[4_000_000_007u32; 17]).unwrap();
        let mut recorder = Recorder::new(gpu, "wild").unwrap();
        recorder.kernel(&kernel).bind("Numbers", &numbers).dispatch([1, 1, 1]).unwrap();
        let read = recorder.download(&numbers).unwrap();
        recorder.submit().unwrap();
        // The last element of each stands for all beyond it.
        assert_eq!(read.read().unwrap()[1..], [3 + 7 + 9 + 2; 16]);
    });
}

#[test]
fn more_shared_memory_than_there_is_is_refused() {
    let gpu = gpu();
    let source = "#version 460
layout(local_size_x = 16) in;
layout(std430, binding = 0) buffer Numbers { uint numbers[]; };
shared uvec4 many[268435457];
void main() { many[gl_LocalInvocationIndex] = uvec4(1u); barrier(); numbers[0] = many[3].x; }";
    let error = Kernel::from_glsl(&gpu, "many", source).unwrap_err();
    assert!(error.to_string().contains("shares 4294967312 bytes"), "{error}");
}
