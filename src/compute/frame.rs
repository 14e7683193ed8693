//! The buffers of a frame, and the recording that fills them.

use super::{
    attach::Attachments,
    binning, commands,
    kernels::{Kernels, PlanKernels, color_formats},
    ordered, primitive, raster,
    scratch::Scratch,
    shade,
    target::Target,
    vertex,
};
use crate::{
    abi::{self, Attribute, Batch, Piece, Triangle},
    error::Result,
    grid::{self, Capacities, Grid},
    image::Extent,
    pass::Pass,
    plan::{BatchPlan, Method, Plan},
    vk::{Arena, Buffer, Copies, Dispatch, Gpu, Recorder, ResourceTable},
};
use std::ops::Range;

/// Buffers that every band and batch of a frame shares.
///
/// | buffer | element | written by | read by |
/// |---|---|---|---|
/// | `positions` | clip-space position of a vertex slot | vertex | primitive, shading |
/// | `window_positions` | window position and outcode of a vertex slot | vertex | primitive |
/// | `varyings` | word of a vertex slot | vertex | shading, primitive (distances) |
/// | `triangles` | triangle | primitive | binning, raster, shading |
/// | `primitive_cells` | the cell that lists a primitive, or that there is none or several | primitive | scatter |
/// | `cell_counts` | triangles of a cell | primitive | scan |
/// | `cell_ends` | end of a cell's list | scan, scatter | raster, ordered |
/// | `entries` | key in a cell's list | scatter, sort | raster, ordered |
/// | `bins`, `bin_args` | non-empty bin; dispatch over them | scan | raster, ordered |
/// | `visibility` | keys that the pixels of a quad show, sample by sample | raster, ordered | shade |
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
    /// If the device makes pieces.
    pub commands: Option<CommandBuffers>,
}

/// What the device makes of draw commands: written by commands, read by vertex, primitive and shading.
pub struct CommandBuffers {
    pub pieces: Buffer<Piece>,
    pub runs: Buffer<u32>,
    /// The arguments of the dispatches over vertex slots and over primitives.
    pub args: Buffer<u32>,
}

/// Everything that is known before recording.
pub struct Setup {
    gpu: Gpu,
    attachments: Attachments,
    copies: Copies,
    buffers: Buffers,
    kernels: PlanKernels,
    extent: Extent,
}

/// The memory that a pass is drawn with.
pub struct Workspace<'a> {
    /// What kernels write.
    pub scratch: &'a mut Scratch,
    /// What the host writes.
    pub arena: &'a mut Arena,
    /// A list, for the memory that it has.
    pub kernels: &'a mut PlanKernels,
}

/// Everything that a stage needs to record its dispatches.
pub struct Stage<'a> {
    pub buffers: &'a Buffers,
    pub target: &'a Target,
    pub pieces: &'a Buffer<Piece>,
    pub runs: &'a Buffer<u32>,
    /// The arguments of dispatches whose sizes only the device knows.
    pub args: Option<&'a Buffer<u32>>,
    pub table: &'a ResourceTable,
    /// The width of the device's subgroups.
    pub width: u32,
    /// The push constants of the batch, less what single dispatches add.
    pub push: Batch,
}

impl Stage<'_> {
    /// Ends `dispatch`, which is one over the vertex slots of the batch.
    pub fn over_vertices(&self, dispatch: Dispatch<'_>, groups: [u32; 3]) -> Result<()> {
        match self.args {
            Some(args) => dispatch.dispatch_indirect(args, 0),
            None => dispatch.dispatch(groups),
        }
    }

    /// Ends `dispatch`, which is one over the primitives of the batch.
    pub fn over_primitives(&self, dispatch: Dispatch<'_>) -> Result<()> {
        let lanes = abi::GROUP * abi::PRIMITIVE_ROUNDS;
        match self.args {
            Some(args) => dispatch.dispatch_indirect(args, 12),
            None => dispatch.dispatch(grid::groups(self.push.primitives, lanes)),
        }
    }
}

impl Setup {
    /// Makes what is missing of kernels and memory for `pass`, which was planned as `plan`.
    pub fn new(
        gpu: &Gpu,
        kernels: &mut Kernels,
        workspace: &mut Workspace<'_>,
        (pass, plan): (&Pass, &Plan),
        copies: Copies,
    ) -> Result<Setup> {
        // The first band is the largest.
        let mut bands = Grid::bands(pass.extent, pass.row_bytes(), pass.samples);
        let band = bands.next().expect("a target has a band");
        let capacities = plan.capacities();
        let attachments = Attachments::new(gpu, workspace.arena, (pass, &band), kernels)?;
        let fragment_kernels =
            plan.batches.iter().map(|b| b.fragment_kernels.len()).max().unwrap_or(1);
        let vertices = capacities.vertices as usize;
        let samples = pass.samples.count() as usize;
        let varying_words = capacities.varying_words + Capacities::VARYING_OVERHANG;
        let Workspace { scratch, arena, kernels: found } = workspace;
        let buffers = Buffers {
            attributes: arena.push(&plan.attributes)?,
            runs: arena.push(&plan.runs)?,
            resource_slots: arena.push(&plan.resource_slots)?,
            shade_args_start: arena.push(&[[0, 1, 1]; MAX_KERNELS][..fragment_kernels])?,
            positions: scratch.get(gpu, "positions", vertices)?,
            window_positions: scratch.get(gpu, "window positions", vertices)?,
            varyings: scratch.get(gpu, "varyings", varying_words.next_multiple_of(4) as usize)?,
            triangles: scratch.get(gpu, "triangles", capacities.triangles() as usize)?,
            primitive_cells: scratch.get(gpu, "primitive cells", capacities.primitives as usize)?,
            cell_counts: scratch.get(gpu, "cell counts", band.cells as usize)?,
            cell_ends: scratch.get(gpu, "cell ends", band.cells as usize)?,
            entries: scratch.get(gpu, "entries", capacities.entries() as usize)?,
            bins: scratch.get(gpu, "bins", band.bins() as usize)?,
            bin_args: scratch.get(gpu, "bin arguments", 3)?,
            visibility: scratch.get(gpu, "visibility", samples * band.padded_pixels() / 4)?,
            shade_args: scratch.get(gpu, "shade arguments", fragment_kernels)?,
            shade_bins: scratch.get(gpu, "shade bins", fragment_kernels * band.bins() as usize)?,
            commands: match plan.most_commands() {
                Some(most) => Some(CommandBuffers {
                    pieces: scratch.get(gpu, "pieces of commands", most as usize + 1)?,
                    runs: scratch.get(gpu, "runs of commands", most as usize + 1)?,
                    args: scratch.get(gpu, "arguments of commands", 6)?,
                }),
                None => None,
            },
        };
        let mut kernels_of_plan = std::mem::take(*found);
        kernels.of_plan(
            plan,
            (
                color_formats(pass.colors.iter().map(|c| c.format))?,
                pass.depth.as_ref().map(|d| d.format),
                pass.samples,
            ),
            &mut kernels_of_plan,
        )?;
        let (gpu, kernels, extent) = (gpu.clone(), kernels_of_plan, pass.extent);
        Ok(Setup { gpu, attachments, copies, buffers, kernels, extent })
    }

    /// The bands of the targets.
    pub fn bands(&self) -> impl Iterator<Item = Grid> + use<> {
        Grid::bands(self.extent, self.attachments.row_bytes(), self.attachments.samples)
    }

    /// Memory for the rows of `band`.
    pub fn target(&self, scratch: &mut Scratch, band: &Grid) -> Result<Target> {
        Target::new(&self.gpu, scratch, band, &self.attachments)
    }

    /// Records all of band number `number` of `plan`.
    pub fn record(
        &self,
        recorder: &mut Recorder,
        arena: &mut Arena,
        kernels: &Kernels,
        (plan, tables): (&Plan, &[ResourceTable]),
        (number, band, target): (usize, &Grid, &Target),
    ) -> Result<()> {
        let pieces = self.pieces(arena, band, plan)?;
        self.begin(kernels, recorder, (band, target))?;
        // A single batch leaves its vertices in place for all bands. If shaders write buffers, vertex shaders
        // may be among those that do.
        let in_place = number > 0 && plan.batches.len() == 1 && self.copies.is_empty();
        for (b, batch) in plan.batches.iter().enumerate() {
            let (table, how) = (&tables[batch.table], (!in_place, false));
            self.batch(kernels, recorder, (band, target), (&pieces, table), (b, batch), how)?;
        }
        self.end(recorder, (band, target))
    }

    /// What is known of the targets, and a list whose memory can be used again.
    pub fn into_parts(self) -> (Attachments, PlanKernels) {
        (self.attachments, self.kernels)
    }

    /// Begins a band: brings its rows to what the targets begin with, and the buffers that shaders write to what
    /// the host gave. Every band executes all draws, and the first of them must not find what another band wrote.
    pub fn begin(
        &self,
        kernels: &Kernels,
        recorder: &mut Recorder,
        band: (&Grid, &Target),
    ) -> Result<()> {
        self.copies.record(recorder)?;
        self.attachments.begin(recorder, &kernels.clear, band)
    }

    /// Ends a band: brings its rows to where the targets are kept.
    pub fn end(&self, recorder: &mut Recorder, band: (&Grid, &Target)) -> Result<()> {
        self.attachments.end(recorder, band)
    }

    /// The pieces as the band sees them: their rectangles cut to its rows.
    pub fn pieces(&self, arena: &mut Arena, band: &Grid, plan: &Plan) -> Result<Buffer<Piece>> {
        match band.extent == self.extent {
            true => arena.push(&plan.pieces),
            false => arena.push(&pieces_of(band, plan)),
        }
    }

    /// Records all stages of one batch. The vertex stage is left out if its results are in place already; a
    /// traced batch writes complete visibility.
    pub fn batch(
        &self,
        kernels: &Kernels,
        recorder: &mut Recorder,
        (band, target): (&Grid, &Target),
        (pieces, table): (&Buffer<Piece>, &ResourceTable),
        (number, batch): (usize, &BatchPlan),
        (vertices, traced): (bool, bool),
    ) -> Result<()> {
        let mut stage = Stage {
            buffers: &self.buffers,
            target,
            pieces,
            runs: &self.buffers.runs,
            args: None,
            table,
            width: self.gpu.limits().subgroup_size,
            push: Batch {
                traced: traced.into(),
                followed: (Some(number) < self.kernels.last_opaque).into(),
                ..self.push(band, batch)
            },
        };
        if let (Some(wanted), Some(made)) = (&batch.commands, &self.buffers.commands) {
            commands::record(recorder, &stage, &kernels.commands, (wanted, made))?;
            (stage.pieces, stage.runs, stage.args) = (&made.pieces, &made.runs, Some(&made.args));
            (stage.push.piece_first, stage.push.piece_count) = (0, wanted.draws + 1);
        }
        if vertices {
            vertex::record(recorder, &stage, &self.kernels.vertex, batch)?;
        }
        let by_distances = self.kernels.by_distances.as_ref().filter(|_| batch.distances);
        match by_distances {
            Some(kernel) => primitive::record_with_distances(recorder, &stage, kernel)?,
            None => primitive::record(recorder, &stage, &kernels.primitive)?,
        }
        binning::record(recorder, &stage, kernels)?;
        let fragment = self.kernels.fragment(number);
        match &self.kernels.raster[number] {
            Some(kernel) => {
                raster::record(recorder, &stage, kernel)?;
                match batch.method {
                    // Shaders of opaque work write colour and nothing else.
                    Method::Opaque { shades: false, .. } => Ok(()),
                    _ => shade::record(recorder, &stage, fragment),
                }
            }
            None => {
                binning::record_sort(recorder, &stage, &kernels.sort)?;
                ordered::record(recorder, &stage, &fragment[0])
            }
        }
    }

    fn push(&self, band: &Grid, batch: &BatchPlan) -> Batch {
        Batch {
            primitives: batch.primitives,
            piece_first: batch.piece_first,
            piece_count: batch.piece_count,
            fragment_kernels: batch.fragment_kernels.len() as u32,
            reach: self.attachments.samples.reach(),
            ..band_push(band)
        }
    }

    /// The device and the buffers.
    pub fn parts(&self) -> (&Gpu, &Buffers) {
        (&self.gpu, &self.buffers)
    }
}

/// Most fragment kernels of a batch.
const MAX_KERNELS: usize = abi::MAX_FRAGMENT_KERNELS as usize;

/// See [`Setup::pieces`].
fn pieces_of(band: &Grid, plan: &Plan) -> Vec<Piece> {
    let Range { start, end } = band.rows();
    let (first, last) = (start as i32, end as i32 - 1);
    let mut pieces = plan.pieces.clone();
    for piece in &mut pieces {
        piece.rect_min[1] = piece.rect_min[1].max(first);
        piece.rect_max[1] = piece.rect_max[1].min(last);
    }
    pieces
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
