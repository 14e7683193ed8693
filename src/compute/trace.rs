//! Executes a pass batch by batch and reads every intermediate back.

use super::{
    frame::{Setup, Workspace},
    kernels::Kernels,
    prepared::{Prepared, Results},
    slots::Tables,
};
use crate::{
    abi::{self, Piece},
    error::Result,
    grid::{Grid, pixel_number},
    pass::{BufferSource, Frame, Pass},
    plan::{BatchPlan, Method, Plan},
    state::Topology,
    trace::{BatchTrace, Parts, Positions, Primitive, Shaded, Trace, Triangle, Vertex},
    vk::Recorder,
};
use std::{borrow::Cow, collections::HashMap, sync::Arc};

impl Setup {
    /// `tables` has for each resource table its index and vertex buffers, by the first of their slots.
    pub(super) fn trace(
        self,
        kernels: &Kernels,
        workspace: Workspace<'_>,
        (pass, plan): (&Pass, &Plan),
        tables: &Tables,
    ) -> Result<(Frame, Trace)> {
        let (mut shaded, mut bands, mut targets) = (Vec::new(), Vec::new(), Vec::new());
        let buffers = tables.buffers.iter().flatten();
        let contents: Vec<_> = buffers.map(contents).collect::<Result<_>>()?;
        let (gpu, buffers) = self.parts();
        let gpu = &gpu.clone();
        let samples = pass.samples.count() as usize;
        for band in &self.bands().collect::<Vec<_>>() {
            let target = self.target(workspace.scratch, band)?;
            let mut batches = Vec::new();
            let pieces = self.pieces(workspace.arena, band, plan)?;
            let mut recorder = Recorder::new(gpu, "beginning of a band")?;
            self.begin(kernels, &mut recorder, (band, &target))?;
            recorder.submit()?;
            for (number, batch) in plan.batches.iter().enumerate() {
                let mut recorder = Recorder::new(gpu, "traced batch")?;
                recorder.fill(&buffers.visibility, 0)?;
                let from = (&pieces, &tables.tables[batch.table]);
                let how = (true, true);
                self.batch(kernels, &mut recorder, (band, &target), from, (number, batch), how)?;
                let positions = recorder.download(&buffers.positions)?;
                let varyings = recorder.download(&buffers.varyings)?;
                let triangles = recorder.download(&buffers.triangles)?;
                let ends = recorder.download(&buffers.cell_ends)?;
                let entries = recorder.download(&buffers.entries)?;
                let visibility = recorder.download(&buffers.visibility)?;
                let shade_args = recorder.download(&buffers.shade_args)?;
                let shade_bins = recorder.download(&buffers.shade_bins)?;
                let depth = recorder.download(&target.depth)?;
                let stencil = match &pass.stencil {
                    Some(_) => Some(recorder.download(&target.stencil)?),
                    None => None,
                };
                recorder.submit()?;
                let mut visibility = visibility.read()?;
                if let Method::Opaque { .. } = batch.method {
                    let args = shade_args.read()?;
                    let args = &args[..batch.fragment_kernels.len()];
                    show_covered(&mut visibility, (band, samples), args, &shade_bins.read()?);
                }
                let names = Names { plan, batch, buffers: &contents[batch.table] };
                shaded.extend(names.shaded(&positions.read()?, &varyings.read()?));
                batches.push(BatchTrace {
                    grid: *band,
                    primitives: names.primitives(),
                    triangles: names.triangles(&triangles.read()?),
                    cells: lists(&ends.read()?[..band.cells as usize], &entries.read()?),
                    visibility: rows((band, samples), &visibility),
                    depth: depth.read()?,
                    stencil: stencil.map_or(Ok(Vec::new()), |values| values.read())?,
                });
            }
            let mut recorder = Recorder::new(gpu, "end of a band")?;
            self.end(&mut recorder, (band, &target))?;
            recorder.submit()?;
            targets.push(target);
            bands.push(batches);
        }
        let (attachments, _) = self.into_parts();
        let results = Results { extent: pass.extent, attachments, targets };
        let frame = Prepared::new(gpu, Vec::new(), results)?.read()?;
        Ok((frame, Trace { positions: Positions::new(shaded), bands }))
    }
}

/// Names what a batch holds by the numbers of the pass. It reads the plan as the kernels do, so that a fault of the
/// plan gives wrong names.
struct Names<'a> {
    plan: &'a Plan,
    batch: &'a BatchPlan,
    /// The content of index buffers by the first of their slots.
    buffers: &'a HashMap<u32, Cow<'a, [u8]>>,
}

impl Names<'_> {
    /// The batch's primitives.
    fn primitives(&self) -> Vec<Primitive> {
        let mut all = Vec::with_capacity(self.batch.primitives as usize);
        let end = self.batch.piece_first + self.batch.piece_count;
        for number in self.batch.piece_first..end {
            let piece = &self.plan.pieces[number as usize];
            let next = (number + 1 < end).then(|| &self.plan.pieces[number as usize + 1]);
            let last = next.map_or(self.batch.primitives, |next| next.first_primitive);
            all.extend((piece.first_primitive..last).map(|primitive| {
                let in_draw = piece.first_in_draw + (primitive - piece.first_primitive);
                Primitive {
                    draw: self.plan.piece_draws[number as usize],
                    instance: piece.first_instance + in_draw / piece.primitives_per_instance,
                    primitive: in_draw % piece.primitives_per_instance,
                }
            }));
        }
        all
    }

    /// The vertices that the batch shades, with what they got: `positions` and `varyings` are those of all slots.
    fn shaded(&self, positions: &[[f32; 4]], varyings: &[u32]) -> Vec<(Vertex, Shaded)> {
        let mut all = Vec::with_capacity(self.batch.vertices as usize);
        for work in &self.batch.vertex_work {
            let first = work.run_first as usize;
            for &number in &self.plan.runs[first..first + work.run_count as usize] {
                let piece = &self.plan.pieces[number as usize];
                let slots = piece.vertex_base..piece.vertex_base + piece.vertex_slots;
                all.extend(slots.map(|slot| {
                    let distances = distances(piece, slot, varyings);
                    let shaded = Shaded { position: positions[slot as usize], distances };
                    (self.vertex(number, slot), shaded)
                }));
            }
        }
        all
    }

    /// The triangles of each primitive, from where the primitive stage puts them.
    fn triangles(&self, triangles: &[abi::Triangle]) -> Vec<Parts> {
        let extra_mask = (1 << abi::TRIANGLE_EXTRA_BITS) - 1;
        let primitives = self.batch.primitives;
        let parts = |primitive: u32| {
            let first = &triangles[primitive as usize];
            let extra = (first.flags >> abi::TRIANGLE_EXTRA_SHIFT) & extra_mask;
            let part = |part| self.triangle(&triangles[(part * primitives + primitive) as usize]);
            (0..=extra).map(part).collect()
        };
        (0..primitives).map(parts).collect()
    }

    /// `None` for a triangle that draws nothing.
    fn triangle(&self, t: &abi::Triangle) -> Option<Triangle> {
        // The bits above hold how many parts the primitive has.
        let flags = t.flags & ((1 << abi::TRIANGLE_EXTRA_SHIFT) - 1);
        let has = |flag: u32| flags & flag != 0;
        has(abi::TRIANGLE_VALID).then(|| Triangle {
            x: t.x,
            y: t.y,
            first: [t.bounds_min & 0xffff, t.bounds_min >> 16],
            last: [t.bounds_max & 0xffff, t.bounds_max >> 16],
            z: t.z,
            dzdx: t.dzdx,
            dzdy: t.dzdy,
            vertices: t.vertices.map(|slot| self.vertex(t.piece, slot)),
            front: has(abi::TRIANGLE_FRONT),
            cut: has(abi::TRIANGLE_CUT),
            level: flags >> abi::TRIANGLE_LEVEL_SHIFT,
            provoking: (t.flags >> abi::TRIANGLE_PROVOKING_SHIFT) & 3,
            exponent: has(abi::TRIANGLE_ADJUSTED)
                .then_some(t.flags >> abi::TRIANGLE_EXPONENT_SHIFT),
        })
    }

    /// The vertex that `glsl/vertex.comp` shades in `slot` of the piece number `number`.
    fn vertex(&self, number: u32, slot: u32) -> Vertex {
        let piece = &self.plan.pieces[number as usize];
        let local = slot - piece.vertex_base;
        let (instance, vertex) = if piece.vertex_mode == abi::VERTEX_RANGED {
            let instance = piece.instance_min + local / piece.vertices_per_instance;
            (instance, piece.vertex_min + local % piece.vertices_per_instance)
        } else {
            let topology = Topology::ALL.iter().copied().find(|t| *t as u32 == piece.topology);
            let topology = topology.expect("the planner took it from a pipeline");
            let corners = topology.kind() as u32;
            let primitive = piece.first_in_draw + local / corners;
            let elements = elements(topology, primitive % piece.primitives_per_instance);
            let vertex = self.index(piece, elements[(local % corners) as usize]);
            (primitive / piece.primitives_per_instance, vertex)
        };
        Vertex {
            draw: self.plan.piece_draws[number as usize],
            instance: piece.first_instance + instance,
            vertex: vertex.wrapping_add_signed(piece.base_vertex),
        }
    }

    /// The index of an element of a draw; beyond the end of the buffer it is 0, as on a device.
    fn index(&self, piece: &Piece, element: u32) -> u32 {
        let element = piece.first_element + element;
        if piece.index_slot == abi::NONE {
            return element;
        }
        let bytes = piece.index_bytes as usize;
        let at = element as usize * bytes;
        let value = self.buffers[&piece.index_slot].get(at..at + bytes).unwrap_or_default();
        value.iter().rev().fold(0, |all, &byte| all << 8 | u32::from(byte))
    }
}

/// The distances of the vertex in `slot` of `piece`, which come after its varyings.
fn distances(piece: &Piece, slot: u32, varyings: &[u32]) -> [f32; abi::MAX_DISTANCES as usize] {
    let count = abi::MAX_DISTANCES;
    let clips = piece.distances & ((1 << abi::CULL_DISTANCES_SHIFT) - 1);
    let culls = piece.distances >> abi::CULL_DISTANCES_SHIFT;
    let end = piece.varying_base + (slot - piece.vertex_base + 1) * piece.varying_stride;
    std::array::from_fn(|n| match n as u32 {
        n if n < clips || n >= count - culls => {
            f32::from_bits(varyings[(end - count + n) as usize])
        }
        _ => 0.0,
    })
}

/// The content of each of `buffers`.
fn contents(buffers: &HashMap<u32, Arc<BufferSource>>) -> Result<HashMap<u32, Cow<'_, [u8]>>> {
    buffers.iter().map(|(&slot, buffer)| Ok((slot, buffer.content()?))).collect()
}

/// The elements of primitive `k` of an instance, as `glsl/lib/assembly.glsl` has them.
fn elements(topology: Topology, k: u32) -> [u32; 3] {
    match topology {
        Topology::TriangleList => [3 * k, 3 * k + 1, 3 * k + 2],
        Topology::TriangleStrip => [k, k + 1 + k % 2, k + 2 - k % 2],
        Topology::TriangleFan => [k + 1, k + 2, 0],
        Topology::PointList => [k; 3],
        Topology::LineList => [2 * k, 2 * k + 1, 2 * k],
        Topology::LineStrip => [k, k + 1, k],
        Topology::TriangleListWithAdjacency => [6 * k, 6 * k + 2, 6 * k + 4],
        Topology::TriangleStripWithAdjacency => {
            elements(Topology::TriangleStrip, k).map(|element| 2 * element)
        }
        Topology::LineListWithAdjacency => [4 * k + 1, 4 * k + 2, 4 * k + 1],
        Topology::LineStripWithAdjacency => [k + 1, k + 2, k + 1],
    }
}

/// Fills the visibility of bins that one triangle covers: kernels leave such a triangle only in the lists of bins
/// for shading.
fn show_covered(
    visibility: &mut [[u32; 4]],
    (band, samples): (&Grid, usize),
    shade_args: &[[u32; 3]],
    shade_bins: &[[u32; 2]],
) {
    let quads = samples * (abi::BIN_PIXELS / 4) as usize;
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

/// From the quads of bins to the samples of pixels in rows.
fn rows<T: Copy>((band, samples): (&Grid, usize), quads: &[[T; 4]]) -> Vec<T> {
    let mut rows = Vec::with_capacity(samples * band.extent.pixels());
    for y in 0..band.extent.height {
        for x in 0..band.extent.width {
            let pixel = (band.cell(0, x, y) * abi::BIN_PIXELS + pixel_number(x, y)) as usize;
            let first = pixel / 4 * samples;
            rows.extend(quads[first..first + samples].iter().map(|quad| quad[pixel % 4]));
        }
    }
    rows
}
