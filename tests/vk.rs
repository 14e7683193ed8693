//! Does the device layer do what it promises, on every driver, without a validation message?

use crate::common::{gpu, kernel_spirv, on_each_gpu, open_with};
use std::{
    sync::atomic::{AtomicBool, Ordering},
    time::{Duration, Instant},
};
use tilewright::{
    Error,
    format::Format,
    image::Extent,
    vk::{
        Buffer, Gpu, GpuOptions, Image, ImageInfo, ImageUse, Kernel, KernelInfo, Memory, Recorder,
        ResourceTable, TableSizes, doctor,
    },
};

const SCALE: &str = "#version 460
#extension GL_EXT_scalar_block_layout : require
layout(local_size_x_id = 7) in;
layout(constant_id = 3) const uint ADDEND = 1;
struct Pair { uint a; uint b; uint c; };
layout(scalar, binding = 2) readonly buffer From { Pair from[]; };
layout(scalar, binding = 5) writeonly buffer To { uint to_[]; } to;
layout(push_constant, scalar) uniform Push { uint factor; uvec2 count; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < count.y) to.to_[i] = (from[i].a + from[i].b + from[i].c) * factor + ADDEND;
}";

#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct Push {
    factor: u32,
    count: [u32; 2],
}

fn scale(gpu: &Gpu, constants: &[(&str, u32)]) -> Kernel {
    let spirv = kernel_spirv(SCALE);
    let info = KernelInfo::new("scale", &spirv).constants(constants).constant_ids(&[(7, 64)]);
    Kernel::new(gpu, &info).unwrap()
}

#[test]
fn a_kernel_finds_its_buffers_by_name() {
    on_each_gpu("a kernel finds its buffers by name", |gpu| {
        let n = 1000usize;
        let kernel = scale(gpu, &[("ADDEND", 9)]);
        assert_eq!(kernel.workgroup(), [64, 1, 1]);
        assert_eq!(kernel.push_constant_bytes(), 12);
        assert_eq!(kernel.buffers().collect::<Vec<_>>(), ["From", "to"]);
        let from: Vec<[u32; 3]> = (0..n as u32).map(|i| [i, 2 * i, 5]).collect();
        let input = Buffer::<[u32; 3]>::new(gpu, "input", n, Memory::Device).unwrap();
        let output = Buffer::<u32>::new(gpu, "output", n, Memory::Device).unwrap();
        let mut recorder = Recorder::new(gpu, "test").unwrap();
        recorder.time_stages();
        recorder.upload(&input, &from).unwrap();
        recorder
            .kernel(&kernel)
            .bind("From", &input)
            .bind("to", &output)
            .push(&Push { factor: 3, count: [0, n as u32] })
            .dispatch([(n as u32).div_ceil(64), 1, 1])
            .unwrap();
        let result = recorder.download(&output).unwrap();
        let mut recording = recorder.finish().unwrap();
        for _ in 0..2 {
            let timings = recording.run().unwrap();
            let labels: Vec<_> = timings.stages.iter().map(|(label, _)| label.as_str()).collect();
            assert_eq!(labels, ["scale"]);
            assert!(timings.stages[0].1 <= timings.total_ns, "{timings:?}");
            let expected: Vec<u32> = (0..n as u32).map(|i| (3 * i + 5) * 3 + 9).collect();
            assert_eq!(result.read().unwrap(), expected);
        }
    });
}

#[test]
fn what_is_bound_wrongly_is_refused_with_the_names() {
    let gpu = gpu();
    let kernel = scale(&gpu, &[]);
    let input = Buffer::<[u32; 3]>::new(&gpu, "input", 4, Memory::Device).unwrap();
    let output = Buffer::<u32>::new(&gpu, "output", 4, Memory::Device).unwrap();
    let push = Push { factor: 1, count: [0, 4] };
    let mut recorder = Recorder::new(&gpu, "faults").unwrap();
    let mut fault = |describe: &mut dyn FnMut(&mut Recorder) -> tilewright::Result<()>| {
        describe(&mut recorder).unwrap_err().to_string()
    };
    let text =
        fault(&mut |r| r.kernel(&kernel).bind("From", &input).push(&push).dispatch([1, 1, 1]));
    assert!(text.contains("scale") && text.contains("`to`"), "{text}");
    let text = fault(&mut |r| r.kernel(&kernel).bind("form", &input).dispatch([1, 1, 1]));
    assert!(text.contains("`form`") && text.contains("From"), "{text}");
    let text = fault(&mut |r| r.kernel(&kernel).bind("From", &output).dispatch([1, 1, 1]));
    assert!(text.contains("12-byte") && text.contains("4-byte"), "{text}");
    let text = fault(&mut |r| {
        r.kernel(&kernel).bind("From", &input).bind("to", &output).push(&1u32).dispatch([1, 1, 1])
    });
    assert!(text.contains("12 bytes of push constants"), "{text}");
    let text = fault(&mut |r| {
        let bound = r.kernel(&kernel).bind("From", &input).bind("to", &output).push(&push);
        bound.dispatch_indirect(&output, 8)
    });
    assert!(text.contains("byte 8"), "{text}");
}

const ADD: &str = "#version 460
layout(local_size_x = 64) in;
layout(binding = 0) buffer Cells { uint cells[]; };
void main() { cells[gl_GlobalInvocationID.x] = cells[gl_GlobalInvocationID.x] * 3 + 1; }";

fn add(gpu: &Gpu) -> (Kernel, Buffer<u32>) {
    let spirv = kernel_spirv(ADD);
    let info = KernelInfo::new("add", &spirv);
    let cells = Buffer::new(gpu, "cells", 64, Memory::Device).unwrap();
    (Kernel::new(gpu, &info).unwrap(), cells)
}

#[test]
fn a_dispatch_sees_what_the_one_before_it_wrote() {
    on_each_gpu("a dispatch sees what the one before it wrote", |gpu| {
        let (kernel, cells) = add(gpu);
        let mut recorder = Recorder::new(gpu, "twice").unwrap();
        recorder.fill(&cells, 1).unwrap();
        for _ in 0..2 {
            recorder.kernel(&kernel).bind("Cells", &cells).dispatch([1, 1, 1]).unwrap();
        }
        let read = recorder.download(&cells).unwrap();
        recorder.submit().unwrap();
        assert_eq!(read.read().unwrap(), [13; 64]);
    });
}

/// Proves that a silent validation layer means something: a hazard that the drivers of this suite
/// happen to survive is reported.
#[test]
fn a_missing_barrier_is_reported_by_the_validation_layer() {
    let device = Some(gpu().info().index.to_string());
    let gpu = open_with(GpuOptions::default().device(device).by_address(false));
    let (kernel, cells) = add(&gpu);
    let mut recorder = Recorder::new(&gpu, "dependent commands in a group").unwrap();
    let group = |recorder: &mut Recorder| {
        recorder.kernel(&kernel).bind("Cells", &cells).dispatch([1, 1, 1])?;
        recorder.download(&cells)
    };
    recorder.group(group).unwrap();
    recorder.submit().unwrap();
    let messages = gpu.expect_messages();
    assert!(messages.iter().any(|m| m.contains("SYNC-HAZARD")), "{messages:?}");
}

/// Kernels that reach blocks by address read two words at a time: a block that begins between two pairs
/// would be read at an address that Vulkan does not allow.
#[test]
fn a_block_by_address_begins_at_a_pair_of_words() {
    on_each_gpu("a block by address begins at a pair of words", |gpu| {
        let (kernel, _) = add(gpu);
        let offset = gpu.limits().storage_offset_bytes.max(8) as usize / 4;
        let cells = Buffer::<u32>::new(gpu, "cells", offset + 64, Memory::Device).unwrap();
        let dispatch = |first: usize| {
            let cells = cells.slice(first..first + 64).unwrap();
            let mut recorder = Recorder::new(gpu, "shifted").unwrap();
            recorder.kernel(&kernel).bind("Cells", &cells).dispatch([1, 1, 1])
        };
        dispatch(offset).unwrap();
        if gpu.reads_by_address() || gpu.limits().storage_offset_bytes > 4 {
            let error = dispatch(1).unwrap_err();
            assert!(matches!(error, Error::Usage(_)), "{error}");
            assert!(error.to_string().contains("`cells`"), "{error}");
        }
    });
}

const REPEAT: &str = "#version 460
layout(local_size_x = 64) in;
layout(binding = 0) volatile readonly buffer Given { uint given[]; };
layout(binding = 1) buffer Seen { uint seen[]; };
void main() {
    for (uint i = gl_LocalInvocationID.x; i < seen.length(); i += 64u) seen[i] = given[i & 1023u];
}";

/// Host and device take turns: clones on other threads do not touch memory that one of them is using.
#[test]
fn a_run_sees_all_of_what_another_thread_writes_or_nothing_of_it() {
    let gpu = gpu();
    let spirv = kernel_spirv(REPEAT);
    let info = KernelInfo::new("repeat", &spirv);
    let kernel = Kernel::new(&gpu, &info).unwrap();
    let given = Buffer::with_content(&gpu, "given", &[0u32; 1024]).unwrap();
    let seen = Buffer::<u32>::new(&gpu, "seen", 1 << 18, Memory::Readback).unwrap();
    let mut recorder = Recorder::new(&gpu, "repeat").unwrap();
    let dispatch = recorder.kernel(&kernel).bind("Given", &given).bind("Seen", &seen);
    dispatch.dispatch([1, 1, 1]).unwrap();
    let mut recording = recorder.finish().unwrap();
    recording.run().unwrap();
    let done = AtomicBool::new(false);
    let uniform = |values: &[u32]| values.iter().all(|v| *v == values[0]);
    std::thread::scope(|scope| {
        scope.spawn(|| {
            let clone = given.clone();
            for n in (1u32..).take_while(|_| !done.load(Ordering::Relaxed)) {
                clone.write(0, &[n; 1024]).unwrap();
            }
        });
        scope.spawn(|| {
            let clone = seen.clone();
            while !done.load(Ordering::Relaxed) {
                assert!(uniform(&clone.read().unwrap()), "a read met a run");
            }
        });
        // Whatever happens, the threads end.
        let runs: Vec<bool> = (0..60)
            .map(|_| recording.run().is_ok() && seen.read().is_ok_and(|values| uniform(&values)))
            .collect();
        done.store(true, Ordering::Relaxed);
        assert!(runs.iter().all(|good| *good), "a write met a run: {runs:?}");
    });
}

/// Safe code cannot reach memory that it did not bind, whatever its kernels index.
#[test]
fn a_kernel_that_indexes_beyond_its_buffers_reaches_nothing_else() {
    let source = "#version 460
layout(local_size_x = 64) in;
layout(binding = 0) buffer Cells { uint cells[]; };
layout(binding = 1) uniform Far { uint far; };
void main() {
    uint i = gl_GlobalInvocationID.x;
    cells[far + i * 65537u] = 7u;
    cells[i & 3u] = cells[far * 3u + i] == 9u ? 1u : 2u;
}";
    on_each_gpu("a kernel that indexes beyond its buffers reaches nothing else", |gpu| {
        let spirv = kernel_spirv(source);
        let info = KernelInfo::new("far", &spirv);
        let kernel = Kernel::new(gpu, &info).unwrap();
        let cells = Buffer::<u32>::new(gpu, "cells", 4, Memory::Device).unwrap();
        let far = Buffer::with_content(gpu, "far", &[1u32 << 26, 0, 0, 0]).unwrap();
        let mut recorder = Recorder::new(gpu, "far").unwrap();
        recorder.fill(&cells, 0).unwrap();
        let dispatch = recorder.kernel(&kernel).bind("Cells", &cells).bind("Far", &far);
        dispatch.dispatch([64, 1, 1]).unwrap();
        let read = recorder.download(&cells).unwrap();
        recorder.submit().unwrap();
        assert!(read.read().unwrap().iter().all(|cell| [1, 2, 7].contains(cell)));
    });
    let by_address = kernel_spirv(
        "#version 460
#extension GL_EXT_buffer_reference : require
layout(local_size_x = 1) in;
layout(buffer_reference) buffer Word { uint word; };
layout(push_constant) uniform Push { Word at; };
void main() { at.word = 1u; }",
    );
    let info = KernelInfo::new("wild", &by_address);
    let error = Kernel::new(&gpu(), &info).unwrap_err();
    assert!(matches!(error, Error::Usage(_)), "{error}");
    assert!(error.to_string().contains("`wild` reaches memory by address"), "{error}");
}

#[test]
fn copies_and_fills_keep_to_their_slices() {
    on_each_gpu("copies and fills keep to their slices", |gpu| {
        let bytes = Buffer::<u8>::new(gpu, "bytes", 64, Memory::Device).unwrap();
        let slice = |range| bytes.slice(range).unwrap();
        let mut recorder = Recorder::new(gpu, "slices").unwrap();
        let error = recorder.fill(&slice(0..5), 0).unwrap_err();
        assert!(error.to_string().contains("5 bytes of buffer `bytes`"), "{error}");
        recorder.fill(&bytes, 7).unwrap();
        let error = recorder.copy(&slice(0..16), &slice(8..24)).unwrap_err();
        assert!(error.to_string().contains("from byte 0 to byte 8"), "{error}");
        recorder.copy(&slice(0..16), &slice(16..32)).unwrap();
        recorder.submit().unwrap();
    });
}

#[test]
fn images_that_cannot_be_are_refused() {
    on_each_gpu("images that cannot be are refused", |gpu| {
        let make = |width, height, levels, usage| {
            let (extent, format) = (Extent::new(width, height), Format::Rgba8Unorm);
            Image::new(gpu, &ImageInfo::new("odd", extent, format, usage).levels(levels))
        };
        for (width, height, levels) in [(0, 4, 1), (4, 0, 1), (4, 4, 0), (4, 2, 4)] {
            let error = make(width, height, levels, ImageUse::Sampled).unwrap_err();
            assert!(matches!(error, Error::Usage(_)), "{error}");
        }
        let mut table = ResourceTable::new(gpu).unwrap();
        let storage = make(4, 2, 1, ImageUse::Storage).unwrap();
        table.insert_texture(&storage).unwrap();
        table.insert_storage_image(&storage).unwrap();
        let attachment = make(4, 2, 1, ImageUse::Attachment).unwrap();
        table.insert_texture(&attachment).unwrap();
        let error = table.insert_storage_image(&attachment).unwrap_err();
        assert!(error.to_string().contains("ImageUse::Attachment"), "{error}");
    });
}

const ENDLESS: &str = "#version 460
layout(local_size_x = 4) in;
layout(binding = 0) buffer Cells { uint cells[]; };
void main() {
    for (uint i = 0; i < cells[1]; i++) cells[0] = cells[0] * 1664525u + 1013904223u;
}";

#[test]
fn a_device_that_does_not_answer_is_lost_and_nothing_hangs() {
    let options = GpuOptions::default()
        .device(gpu().info().index.to_string())
        .validation(true)
        .timeout(Duration::from_millis(20))
        .cache(None);
    let gpu = Gpu::open(&options).unwrap();
    let spirv = kernel_spirv(ENDLESS);
    let info = KernelInfo::new("endless", &spirv);
    let kernel = Kernel::new(&gpu, &info).unwrap();
    // About a second of work: long against the time-out, short for the suite.
    let work = [1u32, 20_000_000];
    let cells = Buffer::with_content(&gpu, "cells", &work).unwrap();
    let started = Instant::now();
    let mut recorder = Recorder::new(&gpu, "endless").unwrap();
    recorder.kernel(&kernel).bind("Cells", &cells).dispatch([1, 1, 1]).unwrap();
    let mut recording = recorder.finish().unwrap();
    let error = recording.run().unwrap_err();
    assert!(matches!(error, Error::Lost(_)));
    let text = error.to_string();
    assert!(text.contains("endless") && text.contains(&gpu.info().name), "{text}");
    assert!(matches!(recording.run().unwrap_err(), Error::Lost(_)));
    let next = Recorder::new(&gpu, "next").unwrap().submit().unwrap_err();
    assert!(matches!(next, Error::Lost(_)));
    drop((recording, kernel, cells));
    assert_eq!(gpu.validation_messages(), [""; 0]);
    drop(gpu);
    let given_up = started.elapsed();

    // Nobody waited for the end of the work: it takes longer than all of that did, whatever the machine's
    // speed is.
    let patient = self::gpu();
    let kernel = Kernel::new(&patient, &info).unwrap();
    let cells = Buffer::with_content(&patient, "cells", &work).unwrap();
    let started = Instant::now();
    let mut recorder = Recorder::new(&patient, "endless").unwrap();
    recorder.kernel(&kernel).bind("Cells", &cells).dispatch([1, 1, 1]).unwrap();
    recorder.submit().unwrap();
    assert!(given_up < started.elapsed(), "{given_up:?}");
}

#[test]
fn compiled_pipelines_are_kept_on_disk_and_a_broken_file_is_ignored() {
    on_each_gpu("compiled pipelines are kept on disk and a broken file is ignored", |gpu| {
        let folder = tempfile::tempdir().unwrap();
        let options = GpuOptions::default()
            .device(gpu.info().index.to_string())
            .validation(true)
            .cache(folder.path().join("new"));
        let run = || {
            let gpu = Gpu::open(&options).unwrap();
            add(&gpu);
            assert_eq!(gpu.validation_messages(), [""; 0]);
        };
        run();
        let files: Vec<_> = std::fs::read_dir(folder.path().join("new")).unwrap().collect();
        let [Ok(file)] = &files[..] else { panic!("{files:?}") };
        let whole = std::fs::read(file.path()).unwrap();
        for broken in [&b"nonsense"[..], &whole[..whole.len() / 2], &[]] {
            std::fs::write(file.path(), broken).unwrap();
            run();
            assert_eq!(std::fs::read(file.path()).unwrap().len(), whole.len());
        }
    });
}

#[test]
fn a_full_table_says_what_is_full() {
    let options = GpuOptions::default()
        .device(gpu().info().index.to_string())
        .validation(true)
        .cache(None)
        .table(TableSizes { buffers: 2, ..TableSizes::default() });
    let gpu = Gpu::open(&options).unwrap();
    let mut table = ResourceTable::new(&gpu).unwrap();
    let [a, b, c] = [1, 2, 3].map(|n| Buffer::with_content(&gpu, "words", &[n]).unwrap());
    for _ in 0..2 {
        assert_eq!(table.insert_buffer(&a).unwrap(), 0);
        assert_eq!(table.insert_buffer(&b).unwrap(), 1);
        assert_eq!(table.insert_buffer(&a).unwrap(), 0);
        let error = table.insert_buffer(&c).unwrap_err();
        assert!(matches!(error, Error::Full(_)), "{error}");
        assert!(error.to_string().contains("2 buffers"), "{error}");
        table.clear().expect("it is written");
    }
    assert_eq!(gpu.validation_messages(), [""; 0]);
}

#[test]
fn what_is_too_large_names_itself_and_the_limit() {
    let gpu = gpu();
    let error = Buffer::<u64>::new(&gpu, "everything", 1 << 50, Memory::Device).unwrap_err();
    let text = error.to_string();
    assert!(matches!(error, Error::Capacity { .. }));
    assert!(text.contains("everything") && text.contains(&gpu.info().name), "{text}");
}

#[test]
fn the_doctor_finds_this_machine_well() {
    let doctor = doctor();
    assert!(doctor.is_well(), "{doctor:#?}");
    assert!(!doctor.drivers.is_empty() && !doctor.devices.is_empty(), "{doctor:#?}");
}
