//! The buffers of a frame, and the recording that fills them.

use super::{
    Renderer, binning, clear, kernels::color_format, ordered, primitive, raster, resolve, shade,
    vertex,
};
use crate::{
    abi::{self, Attribute, Batch, Clear, Piece, Triangle},
    error::Result,
    format::Format,
    grid::{Capacities, Grid},
    image::{Extent, Image},
    pass::{Frame, Pass},
    plan::{BatchPlan, Method, Plan},
    vk::{Buffer, Gpu, Kernel, Memory, Recorder, Recording, ResourceTable, Timings},
};

/// Buffers that every band and batch of a frame shares.
///
/// | buffer | element | written by | read by |
/// |---|---|---|---|
/// | `positions` | clip-space position of a vertex slot | vertex | primitive, shading |
/// | `varyings` | word of a vertex slot | vertex | shading |
/// | `triangles` | triangle | primitive | binning, raster, shading |
/// | `cell_counts` | triangles of a cell | primitive | scan |
/// | `cell_ends` | end of a cell's list | scan, scatter | raster, ordered |
/// | `entries` | key in a cell's list | scatter, sort | raster, ordered |
/// | `bins`, `bin_args` | non-empty bin; dispatch over them | scan | raster, ordered |
/// | `visibility` | key a pixel shows | raster, ordered | shade |
/// | `shade_bins`, `shade_args` | bin of a fragment kernel; dispatch over them | raster | shade |
/// | `depth`, `color` | pixel, bin by bin | raster, ordered; shade, ordered | resolve |
/// | `depth_rows`, `color_rows` | pixel of the band, row by row | resolve | the host |
pub struct Buffers {
    pub attributes: Buffer<Attribute>,
    pub runs: Buffer<u32>,
    pub resource_slots: Buffer<u32>,
    pub positions: Buffer<[f32; 4]>,
    pub varyings: Buffer<u32>,
    pub triangles: Buffer<Triangle>,
    pub cell_counts: Buffer<u32>,
    pub cell_ends: Buffer<u32>,
    pub entries: Buffer<u32>,
    pub bins: Buffer<u32>,
    pub bin_args: Buffer<u32>,
    pub visibility: Buffer<u32>,
    pub shade_args: Buffer<[u32; 3]>,
    pub shade_args_start: Buffer<[u32; 3]>,
    pub shade_bins: Buffer<u32>,
    pub depth: Buffer<f32>,
    pub color: Buffer<u32>,
    pub depth_rows: Buffer<u32>,
    pub color_rows: Buffer<u32>,
}

/// The kernels a plan needs, by the plan's own numbers.
struct PlanKernels {
    vertex: Vec<Kernel>,
    /// For each batch the kernel of each of its fragment kernels.
    fragment: Vec<Vec<Kernel>>,
    raster: Vec<Option<Kernel>>,
    clear: Kernel,
    resolve: Kernel,
}

/// Everything that is known before recording.
pub struct Setup {
    gpu: Gpu,
    extent: Extent,
    format: Format,
    clear: Clear,
    has_depth: bool,
    table: ResourceTable,
    buffers: Buffers,
    kernels: PlanKernels,
    pub bands: Vec<Grid>,
    capacities: Capacities,
}

/// What a stage's recorder gets to see.
pub struct Stage<'a> {
    pub buffers: &'a Buffers,
    pub pieces: &'a Buffer<Piece>,
    pub table: &'a ResourceTable,
    /// The push constants of the batch, less what single dispatches add.
    pub push: Batch,
}

/// A pass that was recorded and can run.
///
/// Each band is a submission of its own, so that the time-out bounds what one submission may take
/// whatever the size of the target.
pub struct Prepared {
    recordings: Vec<Recording>,
    extent: Extent,
    format: Format,
    color: Vec<Buffer<u32>>,
    depth: Option<Vec<Buffer<u32>>>,
}

impl Prepared {
    /// Runs the pass on the device and waits.
    ///
    /// # Errors
    /// [`crate::Error::Lost`] if the device does not answer in time.
    pub fn execute(&mut self) -> Result<Timings> {
        let mut all = Timings::default();
        for recording in &mut self.recordings {
            let band = recording.run()?;
            all.total_ns += band.total_ns;
            all.stages.extend(band.stages);
        }
        Ok(all)
    }

    /// The targets after the last [`Prepared::execute`].
    ///
    /// # Errors
    /// None once the pass has run.
    pub fn read(&self) -> Result<Frame> {
        let image = |bands: &[Buffer<u32>], format| {
            let mut bytes = Vec::with_capacity(self.extent.pixels() * Format::texel_bytes(format));
            for band in bands {
                bytes.extend_from_slice(bytemuck::cast_slice(&band.read()?));
            }
            Ok(Image { extent: self.extent, format, bytes })
        };
        let depth = self.depth.as_ref().map(|bands| image(bands, Format::D32Float)).transpose()?;
        Ok(Frame { color: image(&self.color, self.format)?, depth })
    }
}

impl Setup {
    pub fn new(
        renderer: &mut Renderer,
        pass: &Pass,
        plan: &Plan,
        table: ResourceTable,
    ) -> Result<Setup> {
        let gpu = &renderer.gpu;
        let bands: Vec<Grid> = Grid::bands(pass.extent).collect();
        // The first band is the largest.
        let band = bands[0];
        let capacities = plan.capacities();
        let format = color_format(pass.color.format);
        let words = pass.color.format.texel_bytes() / 4;
        let pixels = band.padded_pixels();
        let fragment_kernels =
            plan.batches.iter().map(|b| b.fragment_kernels.len()).max().unwrap_or(1);
        let lanes = renderer.kernels.shade_lanes();
        let shade_groups = abi::BIN_PIXELS / lanes;
        let device = Memory::Device;
        let words_of = |name: &str, len: usize| Buffer::<u32>::new(gpu, name, len.max(1), device);
        let start = vec![[0, shade_groups, 1]; fragment_kernels];
        let buffers = Buffers {
            attributes: upload(gpu, "attributes", &plan.attributes)?,
            runs: upload(gpu, "runs", &plan.runs)?,
            resource_slots: upload(gpu, "resource slots", &plan.resource_slots)?,
            positions: Buffer::new(gpu, "positions", capacities.vertices as usize, device)?,
            varyings: words_of("varyings", capacities.varying_words as usize)?,
            triangles: Buffer::new(gpu, "triangles", capacities.triangles() as usize, device)?,
            cell_counts: words_of("cell counts", band.cells as usize)?,
            cell_ends: words_of("cell ends", band.cells as usize)?,
            entries: words_of("entries", capacities.entries() as usize)?,
            bins: words_of("bins", band.bins() as usize)?,
            bin_args: words_of("bin arguments", 3)?,
            visibility: words_of("visibility", pixels)?,
            shade_args: Buffer::new(gpu, "shade arguments", fragment_kernels, device)?,
            shade_args_start: Buffer::upload(gpu, "first shade arguments", &start)?,
            shade_bins: words_of("shade bins", fragment_kernels * band.bins() as usize)?,
            depth: Buffer::new(gpu, "depth", pixels, device)?,
            color: words_of("color", pixels * words)?,
            depth_rows: words_of("depth rows", band.extent.pixels())?,
            color_rows: words_of("color rows", band.extent.pixels() * words)?,
        };
        let kernels = &mut renderer.kernels;
        let vertex = plan.vertex_kernels.iter().map(|key| kernels.vertex(key));
        let vertex = vertex.collect::<Result<_>>()?;
        let (mut fragment, mut raster) = (Vec::new(), Vec::new());
        for batch in &plan.batches {
            raster.push(match batch.method {
                Method::Opaque(compare) => Some(kernels.raster(compare)?),
                Method::Ordered { .. } => None,
            });
            let keys = batch.fragment_kernels.iter().map(|&k| &plan.fragment_kernels[k]);
            let made = keys.map(|key| match batch.method {
                Method::Opaque(_) => kernels.shade(key, format),
                Method::Ordered { depth, .. } => kernels.ordered(key, format, depth),
            });
            fragment.push(made.collect::<Result<_>>()?);
        }
        Ok(Setup {
            gpu: gpu.clone(),
            extent: pass.extent,
            format: pass.color.format,
            clear: Clear {
                color: pass.color.clear,
                depth: pass.depth.map_or(1.0, |d| d.clear),
                pixels: 0,
            },
            has_depth: pass.depth.is_some(),
            table,
            buffers,
            kernels: PlanKernels {
                vertex,
                fragment,
                raster,
                clear: kernels.clear(format)?,
                resolve: kernels.resolve(format)?,
            },
            bands,
            capacities,
        })
    }

    /// Records the whole pass.
    pub fn record(self, renderer: &Renderer, plan: &Plan) -> Result<Prepared> {
        let (mut recordings, mut color, mut depth) = (Vec::new(), Vec::new(), Vec::new());
        for (n, band) in self.bands.iter().enumerate() {
            let mut recorder = Recorder::new(&self.gpu, "compute pass")?;
            if renderer.timed {
                recorder.time_stages();
            }
            let pieces = self.pieces(band, plan)?;
            self.clear(&mut recorder, band)?;
            for (b, batch) in plan.batches.iter().enumerate() {
                // A single batch leaves its vertices in place for all bands.
                let vertices = n == 0 || plan.batches.len() > 1;
                self.batch(renderer, &mut recorder, band, &pieces, (b, batch), vertices)?;
            }
            let (c, d) = self.resolve(&mut recorder, band, &pieces)?;
            color.push(c);
            depth.push(d);
            recordings.push(recorder.finish()?);
        }
        Ok(Prepared {
            recordings,
            extent: self.extent,
            format: self.format,
            color,
            depth: self.has_depth.then_some(depth),
        })
    }

    /// Fills colour and depth of the band with the clear values.
    pub fn clear(&self, recorder: &mut Recorder, band: &Grid) -> Result<()> {
        let clear = Clear { pixels: band.padded_pixels() as u32, ..self.clear };
        clear::record(recorder, &self.buffers, &self.kernels.clear, &clear)
    }

    /// The pieces as the band sees them: their rectangles cut to its rows.
    pub fn pieces(&self, band: &Grid, plan: &Plan) -> Result<Buffer<Piece>> {
        upload(&self.gpu, "pieces", &self.pieces_of(band, plan))
    }

    /// See [`Setup::pieces`].
    pub fn pieces_of(&self, band: &Grid, plan: &Plan) -> Vec<Piece> {
        let (first, last) = (band.origin_y as i32, (band.origin_y + band.extent.height) as i32 - 1);
        let mut pieces = plan.pieces.clone();
        for piece in &mut pieces {
            piece.rect_min[1] = piece.rect_min[1].max(first);
            piece.rect_max[1] = piece.rect_max[1].min(last);
        }
        pieces
    }

    /// Records all stages of one batch.
    pub fn batch(
        &self,
        renderer: &Renderer,
        recorder: &mut Recorder,
        band: &Grid,
        pieces: &Buffer<Piece>,
        (number, batch): (usize, &BatchPlan),
        vertices: bool,
    ) -> Result<()> {
        let stage = Stage {
            buffers: &self.buffers,
            pieces,
            table: &self.table,
            push: self.push(band, batch),
        };
        if vertices {
            vertex::record(recorder, &stage, &self.kernels.vertex, batch)?;
        }
        primitive::record(recorder, &stage, &renderer.kernels.primitive)?;
        binning::record(recorder, &stage, &renderer.kernels)?;
        let fragment = &self.kernels.fragment[number];
        match &self.kernels.raster[number] {
            Some(kernel) => {
                raster::record(recorder, &stage, kernel)?;
                shade::record(recorder, &stage, fragment)
            }
            None => {
                binning::record_sort(recorder, &stage, &renderer.kernels.sort)?;
                ordered::record(recorder, &stage, &fragment[0])
            }
        }
    }

    fn push(&self, band: &Grid, batch: &BatchPlan) -> Batch {
        Batch {
            primitives: batch.primitives,
            extra_first: self.extra_first(),
            piece_first: batch.piece_first,
            piece_count: batch.piece_count,
            fragment_kernels: batch.fragment_kernels.len() as u32,
            ..band_push(band)
        }
    }

    /// Where the triangles that clipping adds begin.
    pub fn extra_first(&self) -> u32 {
        self.capacities.primitives
    }

    /// Records the way from bins to rows, and on to the host.
    pub fn resolve(
        &self,
        recorder: &mut Recorder,
        band: &Grid,
        pieces: &Buffer<Piece>,
    ) -> Result<(Buffer<u32>, Buffer<u32>)> {
        let stage =
            Stage { buffers: &self.buffers, pieces, table: &self.table, push: band_push(band) };
        resolve::record(recorder, &stage, &self.kernels.resolve)?;
        let pixels = band.extent.pixels();
        let words = self.format.texel_bytes() / 4;
        let color = self.buffers.color_rows.slice(0..pixels * words)?;
        let depth = self.buffers.depth_rows.slice(0..pixels)?;
        recorder.group(|r| Ok((r.download(&color)?, r.download(&depth)?)))
    }

    /// The device and the buffers.
    pub fn parts(&self) -> (&Gpu, &Buffers) {
        (&self.gpu, &self.buffers)
    }

    /// Assembles the frame of bands that were run one by one.
    pub fn frame(&self, color: Vec<u8>, depth: Vec<u8>) -> Frame {
        let image = |bytes, format| Image { extent: self.extent, format, bytes };
        Frame {
            color: image(color, self.format),
            depth: self.has_depth.then(|| image(depth, Format::D32Float)),
        }
    }
}

/// What the push constants say of a band.
fn band_push(band: &Grid) -> Batch {
    Batch {
        width: band.extent.width,
        height: band.extent.height,
        origin_y: band.origin_y,
        bins_x: band.bins_x,
        bins: band.bins(),
        cell_first: band.cell_first,
        cell_columns: band.cell_columns,
        cells: band.cells,
        ..Batch::default()
    }
}

/// An upload that is never empty: a binding has at least one element.
fn upload<T: bytemuck::Pod>(gpu: &Gpu, name: &str, content: &[T]) -> Result<Buffer<T>> {
    match content {
        [] => Buffer::upload(gpu, name, &[T::zeroed()]),
        content => Buffer::upload(gpu, name, content),
    }
}
