//! Are handles of two devices kept apart, with words that name both?

use crate::common::{TestGpu, gpu, kernel_spirv};
use tilewright::{
    Error, Result,
    format::Format,
    image::Extent,
    texture,
    vk::{
        Buffer, Gpu, Image, ImageInfo, ImageUse, Kernel, KernelInfo, Memory, Recorder,
        ResourceTable, Sampler,
    },
};

const COPY: &str = "#version 460
#extension GL_EXT_nonuniform_qualifier : require
layout(local_size_x = 1) in;
layout(binding = 0) buffer Cells { uint cells[]; };
layout(set = 1, binding = 4) readonly buffer Words { uint words[]; } table[];
void main() { cells[0] = table[0].words[0]; }";

/// One handle of each kind.
struct Handles {
    gpu: TestGpu,
    kernel: Kernel,
    cells: Buffer<u32>,
    image: Image,
    storage: Image,
    sampler: Sampler,
    table: ResourceTable,
}

impl Handles {
    fn new() -> Self {
        let gpu = gpu();
        let spirv = kernel_spirv(COPY);
        let info = KernelInfo::new("copy", &spirv);
        let image = |name, usage| {
            let (extent, format) = (Extent::new(1, 1), Format::Rgba8Unorm);
            Image::new(&gpu, &ImageInfo::new(name, extent, format, usage)).unwrap()
        };
        Self {
            kernel: Kernel::new(&gpu, &info).unwrap(),
            cells: Buffer::new(&gpu, "cells", 4, Memory::Device).unwrap(),
            image: image("stones", ImageUse::Sampled),
            storage: image("counts", ImageUse::Storage),
            sampler: Sampler::new(&gpu, &texture::Sampler::default()).unwrap(),
            table: ResourceTable::new(&gpu).unwrap(),
            gpu,
        }
    }

    fn recorder(&self) -> Recorder {
        Recorder::new(&self.gpu, "mixture").unwrap()
    }
}

/// Asserts that what both sides make of their handles works if they are of one device, and is refused if
/// not, with a message that has all of `words`.
#[track_caller]
fn mixed(words: &[&str], make: impl Fn(&mut Handles, &mut Handles) -> Result<()>) {
    let (mut one, mut other) = (Handles::new(), Handles::new());
    let error = make(&mut one, &mut other).expect_err("handles of two devices are refused");
    assert!(matches!(error, Error::Usage(_)), "{error}");
    let text = error.to_string();
    let name = format!("({})", one.gpu.info().name);
    assert_eq!(text.matches(&name).count(), 2, "both devices are named: {text}");
    let number = |part: &str| part.split(' ').next().map(String::from);
    let numbers: Vec<_> = text.split(" belongs to device ").skip(1).map(number).collect();
    assert!(numbers.len() == 2 && numbers[0] != numbers[1], "devices are told apart: {text}");
    for word in words {
        assert!(text.contains(word), "`{word}` is not in: {text}");
    }
}

#[test]
fn a_recorder_takes_handles_of_its_own_device_alone() {
    mixed(&["`mixture`", "kernel `copy`"], |one, other| {
        let mut recorder = one.recorder();
        let dispatch = recorder.kernel(&other.kernel).bind("Cells", &one.cells);
        dispatch.table(&one.table).dispatch([1, 1, 1])
    });
    mixed(&["`mixture`", "buffer `cells`"], |one, other| {
        let mut recorder = one.recorder();
        let dispatch = recorder.kernel(&one.kernel).bind("Cells", &other.cells);
        dispatch.table(&one.table).dispatch([1, 1, 1])
    });
    mixed(&["`mixture`", "a resource table"], |one, other| {
        let mut recorder = one.recorder();
        let dispatch = recorder.kernel(&one.kernel).bind("Cells", &one.cells);
        dispatch.table(&other.table).dispatch([1, 1, 1])
    });
    mixed(&["`mixture`", "buffer `cells`"], |one, other| {
        let mut recorder = one.recorder();
        let dispatch = recorder.kernel(&one.kernel).bind("Cells", &one.cells);
        dispatch.table(&one.table).dispatch_indirect(&other.cells, 0)
    });
    mixed(&["`cells`"], |one, other| one.recorder().fill(&other.cells, 0));
    mixed(&["`cells`"], |one, other| one.recorder().copy(&other.cells, &one.cells));
    mixed(&["`cells`"], |one, other| one.recorder().copy(&one.cells, &other.cells));
    mixed(&["`cells`"], |one, other| one.recorder().upload(&other.cells, &[1, 2, 3, 4]));
    mixed(&["`cells`"], |one, other| one.recorder().download(&other.cells).map(|_| ()));
    mixed(&["image `stones`"], |one, other| one.recorder().upload_image(&other.image, &[[0; 4]]));
}

#[test]
fn a_table_takes_handles_of_its_own_device_alone() {
    let table = "a resource table";
    mixed(&[table, "`cells`"], |one, other| one.table.insert_buffer(&other.cells).map(|_| ()));
    mixed(&[table, "`stones`"], |one, other| one.table.insert_texture(&other.image).map(|_| ()));
    mixed(&[table, "a sampler"], |one, other| one.table.insert_sampler(&other.sampler).map(|_| ()));
    mixed(&[table, "`counts`"], |one, other| {
        one.table.insert_storage_image(&other.storage).map(|_| ())
    });
    mixed(&[table, "`stones`"], |one, other| {
        one.table.insert_sampled(&other.image, &one.sampler).map(|_| ())
    });
    mixed(&[table, "a sampler"], |one, other| {
        one.table.insert_sampled(&one.image, &other.sampler).map(|_| ())
    });
}

#[test]
fn clones_of_a_device_are_one_device() {
    let mut one = Handles::new();
    let clone: Gpu = (*one.gpu).clone();
    let buffer = Buffer::with_content(&clone, "words", &[7u32; 4]).unwrap();
    one.table.insert_buffer(&buffer).unwrap();
    let mut recorder = Recorder::new(&clone, "clone").unwrap();
    let dispatch = recorder.kernel(&one.kernel).bind("Cells", &one.cells);
    dispatch.table(&one.table).dispatch([1, 1, 1]).unwrap();
    let read = recorder.download(&one.cells).unwrap();
    recorder.submit().unwrap();
    assert_eq!(read.read().unwrap()[0], 7);
}
