//! Makes kernels on one device, also with users' shaders spliced in.

use super::{kernels::ColorFormats, sources::Sources, vertex};
use crate::{
    abi,
    error::Result,
    format::{Format, Packing},
    plan::KernelKey,
    samples::Samples,
    shader::{
        Variant,
        splice::{Blocks, Derivatives, SpliceOptions, splice},
    },
    state::{Compare, ResolveMode},
    vk::{DeviceKind, Gpu, Kernel, KernelInfo},
};
use std::{
    sync::Arc,
    sync::atomic::{AtomicUsize, Ordering},
};

/// A kernel that is made when the first pass needs it.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub enum KernelRequest {
    /// Raster with a depth comparison, and with a stencil test or not.
    Raster(Compare, bool, Fragments),
    /// Between the samples of a target of this format and one texel for each pixel.
    Resolve(Format, Samples, ResolveMode),
    /// Between the rows of a target and texels that are others in its image.
    Narrow,
    /// Clipping and setup of primitives whose vertices have distances from planes of the user.
    ClipByDistances,
    /// Vertex shading.
    Vertex(Arc<KernelKey>),
    /// Shading of opaque work into colour targets of these formats.
    Shade(Arc<KernelKey>, ColorFormats, Fragments),
    /// Ordered work into colour targets of these formats, with a depth mode, and with a stencil test or not.
    Ordered(Arc<KernelKey>, ColorFormats, Fragments, (u32, bool)),
}

/// What kernels are specialized for that make fragments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Fragments {
    /// Whether depths may be adjusted ([`abi::SPEC_ADJUSTED`]).
    adjusted: bool,
    /// [`abi::SPEC_DEPTH_BITS`].
    depth_bits: u32,
    samples: Samples,
}

impl Fragments {
    /// Those for pixels of so many samples, and for a depth target of `format`, if there is one.
    pub fn new(adjusted: bool, format: Option<Format>, samples: Samples) -> Self {
        Self { adjusted, depth_bits: format.map_or(0, Format::depth_bits), samples }
    }

    fn constants(&self) -> [(&'static str, u32); 7] {
        let [first, second, third, fourth] = self.samples.packed();
        [
            ("ADJUSTED", self.adjusted.into()),
            ("DEPTH_BITS", self.depth_bits),
            ("SAMPLES", self.samples.count()),
            ("POSITIONS_0", first),
            ("POSITIONS_1", second),
            ("POSITIONS_2", third),
            ("POSITIONS_3", fourth),
        ]
    }
}

/// What kernels are made with.
pub struct Maker {
    pub gpu: Gpu,
    sources: Sources,
    /// The subgroup width that kernels are made for.
    width: u32,
}

impl Maker {
    pub fn new(gpu: &Gpu, sources: Sources) -> Self {
        Self { gpu: gpu.clone(), sources, width: gpu.limits().subgroup_size }
    }

    /// Whether all stages are the engine's.
    pub fn is_trusted(&self) -> bool {
        self.sources.are_trusted()
    }

    /// The kernels without users' shaders that every pass has: clear, commands, primitive, and the three of binning.
    ///
    /// # Errors
    /// As [`Maker::make`].
    pub fn plain(&self) -> Result<[Kernel; 6]> {
        let plain = |name, file| KernelInfo::new(name, self.sources.words(file));
        let constants = [("SUBGROUP_WIDTH", self.width)];
        let wide = |name, file| self.wide(name, self.sources.words(file), &constants);
        let infos = [
            plain("clear", "clear.comp"),
            wide("commands", "commands.comp"),
            plain("primitive", "primitive.comp"),
            wide("binning_scan", "binning_scan.comp"),
            plain("binning_scatter", "binning_scatter.comp"),
            wide("binning_sort", "binning_sort.comp"),
        ];
        let made = in_parallel(&infos, |info| self.kernel(info));
        let made = made.into_iter().collect::<Result<Vec<_>>>()?;
        Ok(made.try_into().expect("as many kernels as infos"))
    }

    /// The kernels of `wanted`, those that were `found` before included.
    pub fn make_all(
        &self,
        wanted: &[KernelRequest],
        found: &[Option<Kernel>],
    ) -> Vec<Result<Kernel>> {
        let all: Vec<_> = wanted.iter().zip(found).collect();
        in_parallel(&all, |(wanted, found)| match found {
            Some(found) => Ok((*found).clone()),
            None => self.make(wanted),
        })
    }

    /// Makes one kernel.
    ///
    /// # Errors
    /// [`crate::Error::Shader`] if a shader is out of reach, [`crate::Error::Device`] if the driver
    /// refuses a kernel.
    pub fn make(&self, wanted: &KernelRequest) -> Result<Kernel> {
        let width = self.width;
        let (stage, words, key, constants) = match wanted {
            KernelRequest::Raster(compare, stencil, fragments) => {
                // Shared memory has no advantage on a CPU, and the driver does not access it by
                // address. On other devices it has room for a few samples of each pixel.
                let in_place = self.gpu.reads_by_address() || fragments.samples > MOST_HELD_SAMPLES;
                let held = abi::BIN_PIXELS * fragments.samples.count();
                let mut constants = vec![
                    ("SUBGROUP_WIDTH", width),
                    ("COMPARE", *compare as u32),
                    ("STENCIL", (*stencil).into()),
                    ("HELD", if in_place { 1 } else { held }),
                ];
                constants.extend(fragments.constants());
                let words = self.sources.words("raster.comp");
                return self.kernel(&self.wide("raster", words, &constants));
            }
            KernelRequest::Resolve(format, samples, mode) => {
                let format_number = if format.is_depth() { abi::NO_FORMAT } else { *format as u32 };
                let constants = [
                    ("FORMAT", format_number),
                    ("MODE", *mode as u32),
                    ("SAMPLES", samples.count()),
                ];
                let any_format = format.is_color() && !COMMON.contains(format);
                let variant = Variant { any_format, ..Variant::PLAIN };
                let words = self.sources.variant("resolve.comp", variant);
                let info = KernelInfo::new("resolve", words);
                return self.kernel(&KernelInfo { constants: &constants, ..info });
            }
            KernelRequest::Narrow => {
                let words = self.sources.words("narrow.comp");
                return self.kernel(&KernelInfo::new("narrow", words));
            }
            KernelRequest::ClipByDistances => {
                let variant = Variant { distances: true, ..Variant::PLAIN };
                let words = self.sources.variant("primitive.comp", variant);
                return self.kernel(&KernelInfo::new("primitive with distances", words));
            }
            KernelRequest::Vertex(key) => {
                // `lib/attribute.glsl` knows no others without ANY_FORMAT.
                let is_common = |(_, format): &(u32, u32)| {
                    let packing = format & ((1 << abi::ATTRIBUTE_COUNT_SHIFT) - 1);
                    packing >> abi::ATTRIBUTE_PACKING_SHIFT == Packing::Bits32 as u32
                };
                let any_format = !key.attributes.iter().all(is_common);
                let words =
                    self.sources.variant("vertex.comp", Variant { any_format, ..Variant::PLAIN });
                ("vertex", words, key, vec![("LANES", vertex::lanes(width))])
            }
            KernelRequest::Shade(key, formats, fragments) => {
                let constants = self.shading(key, *formats, fragments);
                ("shade", self.sources.variant("shade.comp", targets(*formats)), key, constants)
            }
            KernelRequest::Ordered(key, formats, fragments, (depth, stencil)) => {
                let mut constants = self.shading(key, *formats, fragments);
                constants.extend([
                    ("DEPTH", *depth),
                    ("STENCIL", (*stencil).into()),
                    ("BY_ALPHA", key.by_alpha.into()),
                ]);
                ("ordered", self.sources.variant("ordered.comp", targets(*formats)), key, constants)
            }
        };
        let native = self.gpu.has_compute_derivatives();
        let options = SpliceOptions {
            derivatives: if native { Derivatives::Native } else { Derivatives::Quad },
            blocks: if self.gpu.info().kind == DeviceKind::Cpu {
                Blocks::Prefetched
            } else {
                Blocks::InPlace
            },
            specialization: &key.specialization,
        };
        let spliced = splice(words, &key.shader, &options)?;
        let attributes = key.attributes.iter();
        let attributes =
            attributes.map(|&(location, f)| (abi::SPEC_FIRST + abi::SPEC_ATTRIBUTE + location, f));
        let read = (abi::SPEC_FIRST + abi::SPEC_READ, key.read);
        let own = key.specialization.iter().copied();
        let constant_ids: Vec<_> = own.chain(attributes).chain([read]).collect();
        let name = format!("{stage} {}", key.shader.label);
        let info = self.wide(&name, &spliced.spirv, &constants);
        self.kernel(&KernelInfo { constant_ids: &constant_ids, ..info })
    }

    /// The constants of a kernel that runs a fragment shader.
    fn shading(
        &self,
        key: &KernelKey,
        formats: ColorFormats,
        fragments: &Fragments,
    ) -> Vec<(&'static str, u32)> {
        let [formats, more] = halves(formats);
        let per_sample = key.per_sample && fragments.samples != Samples::One;
        let mut constants = vec![
            ("SUBGROUP_WIDTH", self.width),
            ("FORMATS", formats),
            ("MORE_FORMATS", more),
            ("PER_SAMPLE", per_sample.into()),
            ("PRIMITIVES", key.primitives as u32),
        ];
        constants.extend(fragments.constants());
        constants
    }

    /// A kernel that is made for full subgroups of one width.
    fn wide<'a>(
        &self,
        name: &'a str,
        spirv: &'a [u32],
        constants: &'a [(&'a str, u32)],
    ) -> KernelInfo<'a> {
        let subgroup_size = Some(self.width);
        KernelInfo {
            constants,
            full_subgroups: true,
            subgroup_size,
            ..KernelInfo::new(name, spirv)
        }
    }

    /// If one stage is the user's, all kernels are made as users' kernels are: one of the engine trusts what another one wrote.
    fn kernel(&self, info: &KernelInfo<'_>) -> Result<Kernel> {
        match self.sources.are_trusted() {
            true => Kernel::trusted(&self.gpu, info),
            false => Kernel::own(&self.gpu, info),
        }
    }
}

/// What a kernel for these targets is compiled for.
fn targets(formats: ColorFormats) -> Variant {
    let formats = formats.to_le_bytes().map(u32::from);
    let there = || formats.iter().filter(|format| **format != abi::NO_FORMAT);
    let is_common = |format: &u32| COMMON.iter().any(|common| *common as u32 == *format);
    let colors = if there().count() > 1 { abi::MAX_COLORS } else { 1 };
    Variant { colors, any_format: !there().all(is_common), ..Variant::PLAIN }
}

/// The formats that `lib/color.glsl` knows without `lib/any_color.glsl`.
const COMMON: [Format; 5] = [
    Format::Rgba8Unorm,
    Format::Rgba8Srgb,
    Format::Bgra8Unorm,
    Format::Bgra8Srgb,
    Format::Rgba16Float,
];

/// The most samples of a pixel whose depths and keys raster keeps in shared memory: 8 KiB of the 16 that every device has.
const MOST_HELD_SAMPLES: Samples = Samples::Four;

/// As two specialization constants.
fn halves(formats: ColorFormats) -> [u32; 2] {
    [formats as u32, (formats >> 32) as u32]
}

/// Stack of a thread that makes kernels: drivers and the splicer expect that of a main thread.
pub const STACK_BYTES: usize = 8 << 20;

/// `make` of each of `inputs`, on as many threads as the machine has cores.
pub fn in_parallel<I: Sync, O: Send>(
    inputs: &[I],
    make: impl Fn(&I) -> Result<O> + Sync,
) -> Vec<Result<O>> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(inputs.len());
    let next = AtomicUsize::new(0);
    let work = || {
        let taken = std::iter::from_fn(|| Some(next.fetch_add(1, Ordering::Relaxed)));
        let taken = taken.map_while(|n| Some((n, inputs.get(n)?)));
        taken.map(|(n, input)| (n, make(input))).collect::<Vec<_>>()
    };
    let mut made: Vec<(usize, Result<O>)> = std::thread::scope(|scope| {
        // Where the system refuses a thread, the others do its work.
        let thread = || std::thread::Builder::new().stack_size(STACK_BYTES);
        let spawned: Vec<_> =
            (1..threads).filter_map(|_| thread().spawn_scoped(scope, work).ok()).collect();
        let mut all = work();
        for thread in spawned {
            all.extend(thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        }
        all
    });
    made.sort_by_key(|(n, _)| *n);
    made.into_iter().map(|(_, one)| one).collect()
}
