//! Executes a pass batch by batch and reads every intermediate back.

use super::{Renderer, frame::Setup};
use crate::{
    abi::{self, Triangle},
    error::Result,
    grid::{Grid, pixel_number},
    pass::{Buffer, Frame},
    plan::{Method, Plan},
    trace::{BatchTrace, Parts, Trace},
    vk::Recorder,
};
use std::{collections::HashMap, sync::Arc};

impl Setup {
    pub(super) fn trace(
        self,
        renderer: &mut Renderer,
        plan: &Plan,
        buffers: Vec<HashMap<u32, Arc<Buffer>>>,
    ) -> Result<(Frame, Trace)> {
        let mut trace = Trace { buffers, ..Trace::default() };
        for (band, target) in self.bands.iter().zip(self.targets()) {
            let pieces = self.pieces(band, plan)?;
            let (gpu, buffers) = self.parts();
            let mut recorder = Recorder::new(gpu, "clear")?;
            self.clear(renderer, &mut recorder, target)?;
            recorder.submit()?;
            for (number, batch) in plan.batches.iter().enumerate() {
                let mut recorder = Recorder::new(gpu, "traced batch")?;
                let depth_before = recorder.download(&target.depth)?;
                recorder.fill(&buffers.visibility, 0)?;
                self.batch(
                    renderer,
                    &mut recorder,
                    (band, target),
                    &pieces,
                    (number, batch),
                    (true, true),
                )?;
                let positions = recorder.download(&buffers.positions)?;
                let triangles = recorder.download(&buffers.triangles)?;
                let ends = recorder.download(&buffers.cell_ends)?;
                let entries = recorder.download(&buffers.entries)?;
                let visibility = recorder.download(&buffers.visibility)?;
                let shade_args = recorder.download(&buffers.shade_args)?;
                let shade_bins = recorder.download(&buffers.shade_bins)?;
                let depth = recorder.download(&target.depth)?;
                recorder.submit()?;
                let mut visibility = visibility.read()?;
                if let Method::Opaque(_) = batch.method {
                    let args = shade_args.read()?;
                    let args = &args[..batch.fragment_kernels.len()];
                    show_covered(&mut visibility, band, args, &shade_bins.read()?);
                }
                let first = batch.piece_first as usize;
                let last = first + batch.piece_count as usize;
                trace.batches.push(BatchTrace {
                    grid: *band,
                    table: batch.table,
                    pieces: self.pieces_of(band, plan)[first..last].to_vec(),
                    piece_first: batch.piece_first,
                    primitives: batch.primitives,
                    positions: positions.read()?[..batch.vertices as usize].to_vec(),
                    triangles: parts(&triangles.read()?, batch.primitives, self.extra_first()),
                    cells: lists(&ends.read()?[..band.cells as usize], &entries.read()?),
                    visibility: rows(band, visibility.as_flattened()),
                    depth_before: depth_before.read()?,
                    depth: depth.read()?,
                });
            }
        }
        let frame = self.read()?;
        renderer.tables.put_back(self.tables);
        Ok((frame, trace))
    }
}

/// The triangles of each primitive, from where the primitive stage puts them.
fn parts(triangles: &[Triangle], primitives: u32, extra_first: u32) -> Vec<Parts> {
    let extra_mask = abi::MAX_CLIPPED;
    (0..primitives)
        .map(|primitive| {
            let first = triangles[primitive as usize];
            let extra = (first.flags >> abi::TRIANGLE_EXTRA_SHIFT) & extra_mask;
            let at = (extra_first + primitive * (abi::MAX_CLIPPED - 1)) as usize;
            let more = &triangles[at..at + extra as usize];
            let plain = |t: &Triangle| {
                let flags = t.flags & ((1 << abi::TRIANGLE_EXTRA_SHIFT) - 1);
                (flags & abi::TRIANGLE_VALID != 0).then_some(Triangle { flags, ..*t })
            };
            std::iter::once(&first).chain(more).map(plain).collect()
        })
        .collect()
}

/// Fills the visibility of bins that one triangle covers: kernels leave such a triangle only in the lists of bins
/// for shading.
fn show_covered(
    visibility: &mut [[u32; 4]],
    band: &Grid,
    shade_args: &[[u32; 3]],
    shade_bins: &[[u32; 2]],
) {
    let quads = (abi::BIN_PIXELS / 4) as usize;
    for (list, [bins, ..]) in shade_bins.chunks(band.bins() as usize).zip(shade_args) {
        for &[bin, key] in list[..*bins as usize].iter().filter(|[_, key]| *key != 0) {
            let number = ((bin >> 16) * band.bins_x + (bin & 0xffff)) as usize;
            visibility[number * quads..][..quads].fill([key; 4]);
        }
    }
}

/// The list of each cell, sorted.
fn lists(ends: &[u32], entries: &[u32]) -> Vec<Vec<u32>> {
    let mut start = 0;
    let list = |&end: &u32| {
        let mut list = entries[start..end as usize].to_vec();
        list.sort_unstable();
        start = end as usize;
        list
    };
    ends.iter().map(list).collect()
}

/// From bins to rows.
fn rows<T: Copy>(band: &Grid, bins: &[T]) -> Vec<T> {
    let mut rows = Vec::with_capacity(band.extent.pixels());
    for y in 0..band.extent.height {
        for x in 0..band.extent.width {
            let bin = band.cell(0, x, y);
            rows.push(bins[(bin * abi::BIN_PIXELS + pixel_number(x, y)) as usize]);
        }
    }
    rows
}
