//! The buffers of a frame, and the recording that fills them.

use super::{
    Renderer,
    attach::Attachments,
    binning,
    kernels::PlanKernels,
    ordered,
    prepared::{Prepared, Results},
    primitive, raster, shade,
    target::Target,
    vertex,
};
use crate::{
    abi::{Attribute, Batch, Piece, Triangle},
    error::Result,
    grid::{Capacities, Grid},
    pass::Pass,
    plan::{BatchPlan, Plan},
    vk::{Buffer, Copies, Gpu, Memory, Recorder, ResourceTable},
};

/// Buffers that every band and batch of a frame shares.
///
/// | buffer | element | written by | read by |
/// |---|---|---|---|
/// | `positions` | clip-space position of a vertex slot | vertex | primitive, shading |
/// | `window_positions` | window position and outcode of a vertex slot | vertex | primitive |
/// | `varyings` | word of a vertex slot | vertex | shading |
/// | `triangles` | triangle | primitive | binning, raster, shading |
/// | `primitive_cells` | the cell that lists a primitive, or that there is none or several | primitive | scatter |
/// | `cell_counts` | triangles of a cell | primitive | scan |
/// | `cell_ends` | end of a cell's list | scan, scatter | raster, ordered |
/// | `entries` | key in a cell's list | scatter, sort | raster, ordered |
/// | `bins`, `bin_args` | non-empty bin; dispatch over them | scan | raster, ordered |
/// | `visibility` | keys that the pixels of a quad show | raster, ordered | shade |
/// | `shade_bins`, `shade_args` | bin of a fragment kernel and what covers it; dispatch over them | raster | shade |
pub struct Buffers {
    pub attributes: Buffer<Attribute>,
    pub runs: Buffer<u32>,
    pub resource_slots: Buffer<u32>,
    pub positions: Buffer<[f32; 4]>,
    pub window_positions: Buffer<[u32; 4]>,
    pub varyings: Buffer<u32>,
    pub triangles: Buffer<Triangle>,
    pub primitive_cells: Buffer<u32>,
    pub cell_counts: Buffer<u32>,
    pub cell_ends: Buffer<u32>,
    pub entries: Buffer<u32>,
    pub bins: Buffer<u32>,
    pub bin_args: Buffer<u32>,
    pub visibility: Buffer<[u32; 4]>,
    pub shade_args: Buffer<[u32; 3]>,
    pub shade_args_start: Buffer<[u32; 3]>,
    pub shade_bins: Buffer<[u32; 2]>,
}

/// Everything that is known before recording.
pub struct Setup {
    gpu: Gpu,
    results: Results,
    pub tables: Vec<ResourceTable>,
    copies: Copies,
    buffers: Buffers,
    kernels: PlanKernels,
    pub bands: Vec<Grid>,
    capacities: Capacities,
}

/// Everything that a stage needs to record its dispatches.
pub struct Stage<'a> {
    pub buffers: &'a Buffers,
    pub target: &'a Target,
    pub pieces: &'a Buffer<Piece>,
    pub table: &'a ResourceTable,
    /// The width of the device's subgroups.
    pub width: u32,
    /// The push constants of the batch, less what single dispatches add.
    pub push: Batch,
}

impl Setup {
    pub fn new(
        renderer: &mut Renderer,
        pass: &Pass,
        plan: &Plan,
        tables: Vec<ResourceTable>,
        copies: Copies,
    ) -> Result<Setup> {
        let gpu = &renderer.gpu;
        let bands: Vec<Grid> = Grid::bands(pass.extent).collect();
        // The first band is the largest.
        let band = bands[0];
        let capacities = plan.capacities();
        let attachments = Attachments::new(gpu, pass, &band)?;
        let pixels = band.padded_pixels();
        let fragment_kernels =
            plan.batches.iter().map(|b| b.fragment_kernels.len()).max().unwrap_or(1);
        let device = Memory::Device;
        let varying_words = capacities.varying_words + Capacities::VARYING_OVERHANG;
        let words_of = |name: &str, len: usize| Buffer::<u32>::new(gpu, name, len.max(1), device);
        let start = vec![[0, 1, 1]; fragment_kernels];
        let buffers = Buffers {
            attributes: upload(gpu, "attributes", &plan.attributes)?,
            runs: upload(gpu, "runs", &plan.runs)?,
            resource_slots: upload(gpu, "resource slots", &plan.resource_slots)?,
            positions: Buffer::new(gpu, "positions", capacities.vertices as usize, device)?,
            window_positions: Buffer::new(
                gpu,
                "window positions",
                capacities.vertices as usize,
                device,
            )?,
            varyings: words_of("varyings", varying_words.next_multiple_of(4) as usize)?,
            triangles: Buffer::new(gpu, "triangles", capacities.triangles() as usize, device)?,
            primitive_cells: words_of("primitive cells", capacities.primitives as usize)?,
            cell_counts: words_of("cell counts", band.cells as usize)?,
            cell_ends: words_of("cell ends", band.cells as usize)?,
            entries: words_of("entries", capacities.entries() as usize)?,
            bins: words_of("bins", band.bins() as usize)?,
            bin_args: words_of("bin arguments", 3)?,
            visibility: Buffer::new(gpu, "visibility", (pixels / 4).max(1), device)?,
            shade_args: Buffer::new(gpu, "shade arguments", fragment_kernels, device)?,
            shade_args_start: Buffer::upload(gpu, "first shade arguments", &start)?,
            shade_bins: Buffer::new(
                gpu,
                "shade bins",
                fragment_kernels * band.bins() as usize,
                device,
            )?,
        };
        let targets = bands.iter().map(|band| Target::new(gpu, band, &attachments));
        let targets = targets.collect::<Result<_>>()?;
        let kernels = renderer.kernels.of_plan(plan, attachments.color_format()?)?;
        Ok(Setup {
            gpu: gpu.clone(),
            results: Results { extent: pass.extent, attachments, targets },
            tables,
            copies,
            buffers,
            kernels,
            bands,
            capacities,
        })
    }

    /// Records the whole pass.
    pub fn record(self, renderer: &mut Renderer, plan: &Plan) -> Result<Prepared> {
        let mut recordings = Vec::new();
        for (n, (band, target)) in self.bands.iter().zip(self.targets()).enumerate() {
            let mut recorder = Recorder::new(&self.gpu, "compute pass")?;
            if renderer.timed {
                recorder.time_stages();
            }
            let pieces = self.pieces(band, plan)?;
            self.begin(renderer, &mut recorder, (band, target))?;
            // A single batch leaves its vertices in place for all bands. If shaders write buffers, vertex shaders
            // may be among those that do.
            let in_place = n > 0 && plan.batches.len() == 1 && self.copies.is_empty();
            for (b, batch) in plan.batches.iter().enumerate() {
                let how = (!in_place, false);
                self.batch(renderer, &mut recorder, (band, target), &pieces, (b, batch), how)?;
            }
            self.end(&mut recorder, (band, target))?;
            recordings.push(recorder.finish()?);
        }
        renderer.tables.put_back(self.tables);
        Prepared::new(&self.gpu, recordings, self.results)
    }

    /// Begins a band: brings its rows to what the targets begin with, and the buffers that shaders write to what
    /// the host gave. Every band executes all draws, and the first of them must not find what another band wrote.
    pub fn begin(
        &self,
        renderer: &Renderer,
        recorder: &mut Recorder,
        band: (&Grid, &Target),
    ) -> Result<()> {
        self.copies.record(recorder)?;
        self.results.attachments.begin(recorder, &renderer.kernels.clear, band)
    }

    /// Ends a band: brings its rows to where the targets are kept.
    pub fn end(&self, recorder: &mut Recorder, band: (&Grid, &Target)) -> Result<()> {
        self.results.attachments.end(recorder, band)
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

    /// Records all stages of one batch. The vertex stage is left out if its results are in place already; a
    /// traced batch writes complete visibility.
    pub fn batch(
        &self,
        renderer: &Renderer,
        recorder: &mut Recorder,
        (band, target): (&Grid, &Target),
        pieces: &Buffer<Piece>,
        (number, batch): (usize, &BatchPlan),
        (vertices, traced): (bool, bool),
    ) -> Result<()> {
        let stage = Stage {
            buffers: &self.buffers,
            target,
            pieces,
            table: &self.tables[batch.table],
            width: self.gpu.limits().subgroup_size,
            push: Batch {
                traced: traced.into(),
                followed: (Some(number) < self.kernels.last_opaque).into(),
                ..self.push(band, batch)
            },
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
                match &self.results.attachments.color {
                    Some(_) => shade::record(recorder, &stage, fragment),
                    // Shaders of opaque work write colour and nothing else.
                    None => Ok(()),
                }
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

    /// The device and the buffers.
    pub fn parts(&self) -> (&Gpu, &Buffers) {
        (&self.gpu, &self.buffers)
    }

    /// Where the results are, once all bands have run.
    pub fn results(&self) -> &Results {
        &self.results
    }

    /// The target of each band.
    pub fn targets(&self) -> &[Target] {
        &self.results.targets
    }
}

/// The push constants of a band.
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
