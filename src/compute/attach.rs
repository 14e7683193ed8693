//! The targets of a pass, and the recording of what a band's rows begin with and of what becomes of them at its end:
//! the load and store operations.
//!
//! At the beginning, samples are cleared, or rows are copied from the target's image or from a picture. At the end, rows are
//! copied to the image. Narrow texels go by a buffer of their own and a kernel on the way between an image and the rows. If
//! pixels have several samples, a kernel brings rows to samples and back; otherwise they are the same memory.

use super::{
    clear,
    kernels::Kernels,
    maker::KernelRequest,
    narrow, resolve,
    target::{Plane, Target},
};
use crate::{
    abi,
    error::{Error, Result},
    format::{Format, Numeric},
    grid::Grid,
    image::texel,
    pass::Pass,
    samples::Samples,
    state::ResolveMode,
    target::{ClearColor, ColorTarget, DepthTarget, LoadOp, StencilTarget, StoreOp},
    vk::{Arena, Buffer, Gpu, Image, Kernel, Recorder, Subresource},
};
use std::ops::Range;

/// The targets of a pass.
pub struct Attachments {
    /// By number. A list of fixed length takes no memory of its own.
    colors: [Option<Attachment<ClearColor>>; MAX_COLORS],
    pub depth: Option<Attachment<f32>>,
    pub stencil: Option<Attachment<u8>>,
    /// Samples of a pixel.
    pub samples: Samples,
    /// Bounds that hold for any depth, one for each bin of a band, if depth is loaded.
    any_bounds: Option<Buffer<[f32; 2]>>,
}

const MAX_COLORS: usize = abi::MAX_COLORS as usize;

/// One target of a pass.
pub struct Attachment<T> {
    begin: Begin<T>,
    pub format: Format,
    pub image: Option<Image>,
    /// Its level and its layer.
    pub subresource: Subresource,
    store: StoreOp,
    /// Brings narrow texels to the image, or takes them from there, if there are any.
    narrow: Option<Kernel>,
    /// Makes texels of samples, or samples of texels, if it is needed.
    resolve: Option<Kernel>,
}

/// What a target begins with.
enum Begin<T> {
    Value(T),
    Image(Image),
    /// All rows of the target, as kernels have them.
    Picture(Buffer<u8>),
}

/// What is done with a target, whatever its values are.
struct Use<'a> {
    format: Format,
    image: (&'a Option<Image>, Subresource),
    is_loaded: bool,
    store: StoreOp,
    samples: Samples,
    resolve: ResolveMode,
}

impl<'a> Use<'a> {
    fn of_color(color: &'a ColorTarget, samples: Samples) -> Self {
        Self {
            format: color.format,
            image: (&color.image, color.subresource()),
            is_loaded: color.load.clear_value().is_none(),
            store: color.store,
            samples,
            resolve: color.resolve(),
        }
    }

    fn of_depth(depth: &'a DepthTarget, samples: Samples) -> Self {
        Self {
            format: depth.format,
            image: (&depth.image, depth.subresource()),
            is_loaded: depth.load.clear_value().is_none(),
            store: depth.store,
            samples,
            resolve: depth.resolve,
        }
    }

    fn of_stencil(stencil: &'a StencilTarget, samples: Samples) -> Self {
        Self {
            format: Format::S8Uint,
            image: (&stencil.image, stencil.subresource()),
            is_loaded: stencil.load.clear_value().is_none(),
            store: stencil.store,
            samples,
            resolve: stencil.resolve,
        }
    }

    /// Whether its texels are others in its image than in the rows.
    fn is_narrow(&self) -> bool {
        self.image.0.is_some() && narrow::is_narrow(self.format)
    }

    fn narrow(&self) -> Option<KernelRequest> {
        self.is_narrow().then_some(KernelRequest::Narrow)
    }

    fn resolve(&self) -> Option<KernelRequest> {
        let has_texels = self.is_loaded || self.store == StoreOp::Store;
        (has_texels && self.samples != Samples::One).then_some(KernelRequest::Resolve(
            self.format,
            self.samples,
            self.resolve,
        ))
    }
}

/// The kernel that resolves several samples of a target of `format`, unless the target asks for another way.
pub fn resolve(format: Format, samples: Samples) -> Option<KernelRequest> {
    match format.numeric() {
        Numeric::Depth => {
            let depth = DepthTarget::cleared(1.0).format(format);
            Use::of_depth(&depth, samples).resolve()
        }
        Numeric::Stencil => Use::of_stencil(&StencilTarget::cleared(0), samples).resolve(),
        _ => Use::of_color(&ColorTarget::cleared(format, [0.0; 4]), samples).resolve(),
    }
}

/// The kernels that the targets of `pass` need.
pub fn wanted(pass: &Pass) -> impl Iterator<Item = KernelRequest> {
    let colors = pass.colors.iter().map(|color| Use::of_color(color, pass.samples));
    let depth = pass.depth.iter().map(|depth| Use::of_depth(depth, pass.samples));
    let stencil = pass.stencil.iter().map(|stencil| Use::of_stencil(stencil, pass.samples));
    colors.chain(depth).chain(stencil).flat_map(|one| [one.narrow(), one.resolve()]).flatten()
}

impl Attachments {
    /// Those of `pass`, which is valid, with bands up to the size of `band`.
    pub fn new(
        gpu: &Gpu,
        arena: &mut Arena,
        (pass, band): (&Pass, &Grid),
        kernels: &mut Kernels,
    ) -> Result<Self> {
        let mut colors = [const { None }; MAX_COLORS];
        for (attachment, color) in colors.iter_mut().zip(&pass.colors) {
            let of = Use::of_color(color, pass.samples);
            *attachment = Some(Attachment::new(gpu, kernels, &of, &color.load)?);
        }
        let depth = pass.depth.as_ref();
        let depth = depth.map(|depth| {
            let load = match &depth.load {
                LoadOp::Clear(value) => LoadOp::Clear(texel::kept_depth(depth.format, *value)),
                load => load.clone(),
            };
            Attachment::new(gpu, kernels, &Use::of_depth(depth, pass.samples), &load)
        });
        let depth = depth.transpose()?;
        let stencil = pass.stencil.as_ref().map(|stencil| {
            let of = Use::of_stencil(stencil, pass.samples);
            Attachment::new(gpu, kernels, &of, &stencil.load)
        });
        let stencil = stencil.transpose()?;
        let loaded = depth.as_ref().filter(|depth| depth.is_loaded());
        let any_bounds = loaded.map(|_| arena.push(&vec![[0.0, 1.0]; band.bins() as usize]));
        let (samples, any_bounds) = (pass.samples, any_bounds.transpose()?);
        Ok(Self { colors, depth, stencil, samples, any_bounds })
    }

    /// The colour targets, in their order.
    pub fn colors(&self) -> impl Iterator<Item = &Attachment<ClearColor>> {
        self.colors.iter().flatten()
    }

    /// The colour targets with the bytes of a band's rows that each of them has. Of its samples, it has as many times more.
    pub fn planes(
        &self,
        band: &Grid,
    ) -> impl Iterator<Item = (&Attachment<ClearColor>, Range<usize>)> {
        let (plane, pixels) = (band.plane_pixels(), band.extent.pixels());
        self.colors().scan(0, move |next, color| {
            let (first, texel) = (*next, color.format.row_bytes());
            *next += plane * texel;
            Some((color, first..first + pixels * texel))
        })
    }

    /// Bytes of a sample of all colour targets.
    pub fn row_bytes(&self) -> usize {
        self.colors().map(|color| color.format.row_bytes()).sum()
    }

    /// Most bytes of a pixel of a target that the kernel `narrow` brings to an image or takes from one.
    pub fn narrow_bytes(&self) -> Option<usize> {
        let bytes = |narrow: &Option<Kernel>, format: Format| {
            narrow.is_some().then(|| format.texel_bytes())
        };
        let colors = self.colors().filter_map(|color| bytes(&color.narrow, color.format));
        let depth = self.depth.iter().filter_map(|depth| bytes(&depth.narrow, depth.format));
        let stencil = self.stencil.iter().filter_map(|of| bytes(&of.narrow, of.format));
        colors.chain(depth).chain(stencil).max()
    }

    /// Records what the rows of `target` begin with, which are those of `band`. `clear` is that kernel.
    pub fn begin(
        &self,
        recorder: &mut Recorder,
        clear: &Kernel,
        (band, target): (&Grid, &Target),
    ) -> Result<()> {
        let begin = |recorder: &mut Recorder, color: &Attachment<_>, rows: Range<usize>| {
            let plane = target.color_plane(rows);
            match &color.begin {
                Begin::Value(value) => clear::color(recorder, clear, &plane, color.format, *value),
                _ => color.load(recorder, band, &plane),
            }
        };
        // All of them have one buffer, which kernels bind as a whole: only one goes at the same time as depth, if a single
        // command brings its rows to what they begin with.
        for (n, (color, rows)) in self.planes(band).enumerate() {
            if n > 0 || color.goes_alone() {
                begin(recorder, color, rows)?;
            }
        }
        let loaded = self.depth.as_ref().filter(|depth| depth.is_loaded());
        if let Some(depth) = loaded.filter(|depth| depth.goes_alone()) {
            depth.load(recorder, band, &target.depth_plane()?)?;
        }
        if let Some(stencil) = self.stencil.as_ref().filter(|stencil| stencil.goes_alone()) {
            stencil.load(recorder, band, &target.stencil_plane())?;
        }
        recorder.group(|recorder| {
            match self.stencil.as_ref().map(|stencil| (stencil, &stencil.begin)) {
                Some((_, Begin::Value(value))) => clear::stencil(recorder, target, *value)?,
                Some((stencil, _)) if !stencil.goes_alone() => {
                    stencil.load(recorder, band, &target.stencil_plane())?;
                }
                _ => {}
            }
            let first = self.planes(band).next();
            if let Some((color, rows)) = first.filter(|(color, _)| !color.goes_alone()) {
                begin(recorder, color, rows)?;
            }
            match (&self.depth, &self.any_bounds) {
                (Some(depth), Some(bounds)) => {
                    if !depth.goes_alone() {
                        depth.load(recorder, band, &target.depth_plane()?)?;
                    }
                    let bins = target.bin_bounds.len();
                    recorder.copy(&bounds.slice(0..bins)?, &target.bin_bounds)
                }
                (depth, _) => {
                    let value = match depth.as_ref().map(|depth| &depth.begin) {
                        Some(Begin::Value(value)) => *value,
                        _ => 1.0,
                    };
                    clear::depth(recorder, target, value)
                }
            }
        })
    }

    /// Records what becomes of the rows of `target`, which are those of `band` and complete.
    pub fn end(&self, recorder: &mut Recorder, (band, target): (&Grid, &Target)) -> Result<()> {
        for (color, rows) in self.planes(band) {
            color.end(recorder, band, &target.color_plane(rows))?;
        }
        if let Some(depth) = &self.depth {
            depth.end(recorder, band, &target.depth_plane()?)?;
        }
        match &self.stencil {
            Some(stencil) => stencil.end(recorder, band, &target.stencil_plane()),
            None => Ok(()),
        }
    }
}

impl<T: Copy> Attachment<T> {
    fn new(gpu: &Gpu, kernels: &mut Kernels, of: &Use<'_>, load: &LoadOp<T>) -> Result<Self> {
        let (format, (image, subresource), store) = (of.format, of.image, of.store);
        if let Some(image) = image {
            image.check_device(gpu)?;
            image.0.check_copied(matches!(load, LoadOp::Load), store == StoreOp::Store)?;
        }
        let begin = match (load, image) {
            (LoadOp::Clear(value), _) => Begin::Value(*value),
            (LoadOp::Picture(picture), _) => {
                let name = "picture to begin with";
                Begin::Picture(match narrow::is_narrow(format) {
                    true => {
                        let rows = narrow::widened(format, &picture.bytes)?;
                        Buffer::with_content(gpu, name, &rows)?.cast()?
                    }
                    false => Buffer::with_content(gpu, name, &picture.bytes)?,
                })
            }
            (LoadOp::Load, Some(image)) => Begin::Image(image.clone()),
            (LoadOp::Load, None) => {
                return Err(Error::Usage("a target without an image has nothing to load".into()));
            }
        };
        let mut kernel = |request: Option<KernelRequest>| {
            request.map(|request| kernels.one(&request)).transpose()
        };
        let (narrow, resolve) = (kernel(of.narrow())?, kernel(of.resolve())?);
        Ok(Self { begin, format, image: image.clone(), subresource, store, narrow, resolve })
    }

    /// Whether it takes several commands to begin with what it loads.
    fn goes_alone(&self) -> bool {
        self.is_loaded() && (self.narrow.is_some() || self.resolve.is_some())
    }

    fn is_loaded(&self) -> bool {
        !matches!(self.begin, Begin::Value(_))
    }

    /// Whether it has rows beside its samples.
    pub fn resolves(&self) -> bool {
        self.resolve.is_some()
    }

    /// Whether the host reads the rows.
    pub fn is_read(&self) -> bool {
        self.image.is_none() && self.is_stored()
    }

    /// Whether anything is kept.
    pub fn is_stored(&self) -> bool {
        self.store == StoreOp::Store
    }

    /// Brings `plane` to what it begins with, unless that is one value.
    fn load(&self, recorder: &mut Recorder, band: &Grid, plane: &Plane<'_>) -> Result<()> {
        let pixels = band.extent.pixels();
        match (&self.begin, &self.narrow) {
            (Begin::Value(_), _) => return Ok(()),
            (Begin::Image(image), Some(narrow)) => {
                let texels = plane.texels()?;
                recorder.copy_from_image(image, self.subresource, band.rows(), &texels.cast()?)?;
                let way = (narrow::Way::ToRows, pixels);
                narrow::record(recorder, narrow, plane.rows(), (self.format, texels), way)?;
            }
            (Begin::Image(image), None) => {
                let rows = plane.row_bytes()?;
                recorder.copy_from_image(image, self.subresource, band.rows(), &rows)?;
            }
            (Begin::Picture(picture), _) => {
                let Grid { origin_y, extent, .. } = *band;
                let first = origin_y as usize * extent.width as usize * self.format.row_bytes();
                let rows = plane.row_bytes()?;
                recorder.copy(&picture.slice(first..first + rows.len())?, &rows)?;
            }
        }
        match &self.resolve {
            Some(kernel) => {
                let way = (resolve::Way::ToSamples, pixels);
                resolve::record(recorder, kernel, plane.samples(), plane.rows(), way)
            }
            None => Ok(()),
        }
    }

    /// Brings `plane` to where it is kept: the rows for the host, or the image.
    fn end(&self, recorder: &mut Recorder, band: &Grid, plane: &Plane<'_>) -> Result<()> {
        if !self.is_stored() {
            return Ok(());
        }
        let pixels = band.extent.pixels();
        if let Some(kernel) = &self.resolve {
            let way = (resolve::Way::FromSamples, pixels);
            resolve::record(recorder, kernel, plane.samples(), plane.rows(), way)?;
        }
        let Some(image) = &self.image else { return Ok(()) };
        let from = match &self.narrow {
            Some(narrow) => {
                let (texels, way) = (plane.texels()?, (narrow::Way::FromRows, pixels));
                narrow::record(recorder, narrow, plane.rows(), (self.format, texels), way)?;
                texels.cast()?
            }
            None => plane.row_bytes()?,
        };
        recorder.copy_to_image(&from, image, self.subresource, band.rows())
    }
}
