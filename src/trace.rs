//! Every intermediate of a frame, from a device or from the reference, made to be compared.
//!
//! Both sides name things by the numbers of the pass: draw, instance, primitive, vertex. Pieces and vertex slots are
//! compute's own numbers and do not occur here, so that a fault of compute's plan cannot hide in them.

use crate::{abi, grid::Grid};
use std::fmt;

/// A primitive of a pass.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Primitive {
    /// Index of its draw in [`crate::pass::Pass::draws`].
    pub draw: u32,
    /// Its `gl_InstanceIndex`.
    pub instance: u32,
    /// Its number among the primitives of the instance.
    pub primitive: u32,
}

impl fmt::Display for Primitive {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { draw, instance, primitive } = self;
        write!(f, "draw {draw}, instance {instance}, primitive {primitive}")
    }
}

/// A vertex of a pass. Primitives may share it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Vertex {
    /// Index of its draw in [`crate::pass::Pass::draws`].
    pub draw: u32,
    /// Its `gl_InstanceIndex`.
    pub instance: u32,
    /// Its `gl_VertexIndex`.
    pub vertex: u32,
}

impl fmt::Display for Vertex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { draw, instance, vertex } = self;
        write!(f, "draw {draw}, instance {instance}, vertex {vertex}")
    }
}

/// A triangle after setup.
#[derive(Clone, Copy, Debug)]
pub struct Triangle {
    /// Corners in 1/256 pixel from the centre of pixel (0, 0) of the target, clockwise on the screen.
    pub x: [i32; 3],
    /// See `x`.
    pub y: [i32; 3],
    /// Column and row of the first pixel of the band that may be covered.
    pub first: [u32; 2],
    /// Column and row of the last one.
    pub last: [u32; 2],
    /// Depth at the centre of the target's pixel (0, 0), or at its upper left corner if pixels have several samples.
    pub z: f32,
    /// Change of depth per pixel to the right.
    pub dzdx: f32,
    /// Change of depth per pixel down.
    pub dzdy: f32,
    /// The primitive's three vertices; the first again for those that points and lines do not have.
    pub vertices: [Vertex; 3],
    /// Which of them gives the flat inputs.
    pub provoking: u32,
    /// Whether it faces the viewer.
    pub front: bool,
    /// Whether the viewport or the scissor of its draw excludes pixels of the target.
    pub cut: bool,
    /// The level of the cells that list it.
    pub level: u32,
    /// The exponent of the largest depth of its corners, as its bits are; `None` if depths are not adjusted.
    pub exponent: Option<u32>,
}

impl Triangle {
    /// Whether both are the same; floats are compared bit by bit.
    pub fn is_same(&self, other: &Triangle) -> bool {
        let plane = |t: &Triangle| [t.z, t.dzdx, t.dzdy].map(f32::to_bits);
        let place = |t: &Triangle| (t.x, t.y, t.first, t.last);
        let rest = |t: &Triangle| (t.vertices, t.provoking, t.front, t.cut, t.level, t.exponent);
        plane(self) == plane(other) && place(self) == place(other) && rest(self) == rest(other)
    }
}

/// The triangles of one primitive: the parts that clipping made of it, `None` for a part that draws
/// nothing. A primitive that draws nothing at all has a single `None`.
pub type Parts = Vec<Option<Triangle>>;

/// The key of part `part` of the batch's primitive number `primitive`.
pub fn key(primitive: usize, part: usize) -> u32 {
    ((primitive as u32 + 1) << abi::KEY_LOG2) | part as u32
}

/// What a vertex shader gave a vertex, as it left it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shaded {
    /// The position in clip space.
    pub position: [f32; 4],
    /// Distances from planes of the user, 0 where it has none: clip distances from the first place on, cull distances from
    /// the last place back.
    pub distances: [f32; abi::MAX_DISTANCES as usize],
}

impl Shaded {
    fn bits(&self) -> impl Iterator<Item = u32> + use<> {
        self.position.into_iter().chain(self.distances).map(f32::to_bits)
    }
}

/// What shaders gave the vertices of a pass.
#[derive(Clone, Debug, Default)]
pub struct Positions(Vec<(Vertex, Shaded)>);

impl Positions {
    /// Takes vertices in any order. A vertex may come several times, where it was shaded several times.
    pub fn new(mut all: Vec<(Vertex, Shaded)>) -> Self {
        all.sort_by_key(|(vertex, _)| *vertex);
        all.dedup_by(|(a, of_a), (b, of_b)| a == b && of_a.bits().eq(of_b.bits()));
        Self(all)
    }

    /// What `vertex` got, if it was shaded.
    pub fn of(&self, vertex: Vertex) -> Option<&Shaded> {
        let at = self.0.partition_point(|(known, _)| *known < vertex);
        self.0.get(at).filter(|(known, _)| *known == vertex).map(|(_, shaded)| shaded)
    }

    /// All of them.
    pub fn iter(&self) -> impl Iterator<Item = (Vertex, Shaded)> {
        self.0.iter().copied()
    }

    /// A vertex that was shaded several times, with different results.
    pub fn contradiction(&self) -> Option<Vertex> {
        self.0.windows(2).find(|pair| pair[0].0 == pair[1].0).map(|pair| pair[0].0)
    }
}

/// Every intermediate of a frame.
#[derive(Clone, Debug, Default)]
pub struct Trace {
    /// Positions of all vertices that were shaded.
    pub positions: Positions,
    /// For each band, from top to bottom, its batches in the order of execution.
    pub bands: Vec<Vec<BatchTrace>>,
}

/// The intermediates of one batch in one band.
#[derive(Clone, Debug)]
pub struct BatchTrace {
    /// The band.
    pub grid: Grid,
    /// Its primitives.
    pub primitives: Vec<Primitive>,
    /// The triangles of each primitive.
    pub triangles: Vec<Parts>,
    /// The keys that each cell lists, ascending.
    pub cells: Vec<Vec<u32>>,
    /// The key each sample of the band's pixels got from the batch, row by row, the samples of a pixel one after the other; 0 is
    /// none.
    pub visibility: Vec<u32>,
    /// Depth of each sample after the batch, in the same order.
    pub depth: Vec<f32>,
    /// Stencil values in the same way; none without a stencil target.
    pub stencil: Vec<u32>,
}

impl BatchTrace {
    /// The first difference between this and `other`, stage by stage, as a sentence that names the primitive;
    /// floats are compared bit by bit.
    pub fn first_difference(&self, other: &BatchTrace) -> Option<String> {
        if self.grid != other.grid {
            return Some(format!("band: {:?} against {:?}", self.grid, other.grid));
        }
        let name = |key: &u32| self.name(*key);
        let primitive = |at: usize| self.name(key(at, 0));
        let samples = (self.depth.len() / self.grid.extent.pixels()).max(1);
        let pixel = |at: usize| {
            let (width, pixel) = (self.grid.extent.width as usize, at / samples);
            let place = format!("pixel ({}, {}) of the band", pixel % width, pixel / width);
            match samples {
                1 => place,
                _ => format!("sample {} of {place}", at % samples),
            }
        };
        let assembly = difference(
            |at| format!("assembly: primitive number {at} of the batch"),
            (&self.primitives, &other.primitives),
            Primitive::eq,
            Primitive::to_string,
        );
        assembly
            .or_else(|| {
                difference(
                    |at| format!("primitive: triangles of {}", primitive(at)),
                    (&self.triangles, &other.triangles),
                    same_parts,
                    |parts| format!("{parts:?}"),
                )
            })
            .or_else(|| self.difference_of_cells(other))
            .or_else(|| {
                difference(
                    |at| format!("raster: {} shows", pixel(at)),
                    (&self.visibility, &other.visibility),
                    u32::eq,
                    name,
                )
            })
            .or_else(|| {
                let shown = |at| self.visibility.get(at).map_or("nothing".into(), name);
                difference(
                    |at| format!("raster: depth of {}, {}", pixel(at), shown(at)),
                    (&self.depth, &other.depth),
                    |a, b| a.to_bits() == b.to_bits(),
                    |depth| format!("{depth:?}"),
                )
            })
            .or_else(|| {
                let shown = |at| self.visibility.get(at).map_or("nothing".into(), name);
                difference(
                    |at| format!("raster: stencil value of {}, {}", pixel(at), shown(at)),
                    (&self.stencil, &other.stencil),
                    u32::eq,
                    u32::to_string,
                )
            })
    }

    fn difference_of_cells(&self, other: &BatchTrace) -> Option<String> {
        let cells = self.cells.len().max(other.cells.len());
        let of = |batch: &BatchTrace, cell| batch.cells.get(cell).cloned().unwrap_or_default();
        (0..cells).find_map(|cell| {
            difference(
                |at| format!("binning: entry {at} of cell {cell}"),
                (&of(self, cell), &of(other, cell)),
                u32::eq,
                |key| self.name(*key),
            )
        })
    }

    /// The name of the primitive that has a key, and the part if clipping may have made several.
    fn name(&self, key: u32) -> String {
        let Some(number) = (key >> abi::KEY_LOG2).checked_sub(1) else { return "nothing".into() };
        let part = key & ((1 << abi::KEY_LOG2) - 1);
        match self.primitives.get(number as usize) {
            Some(primitive) if part == 0 => primitive.to_string(),
            Some(primitive) => format!("{primitive}, part {part}"),
            None => format!("key {key}, which no primitive has"),
        }
    }
}

fn same_parts(a: &Parts, b: &Parts) -> bool {
    let same = |(a, b): (&Option<Triangle>, &Option<Triangle>)| match (a, b) {
        (Some(a), Some(b)) => a.is_same(b),
        (a, b) => a.is_none() && b.is_none(),
    };
    a.len() == b.len() && a.iter().zip(b).all(same)
}

/// The first element that two lists do not both have, `what` being its name.
fn difference<T>(
    what: impl Fn(usize) -> String,
    (ours, theirs): (&[T], &[T]),
    same: impl Fn(&T, &T) -> bool,
    show: impl Fn(&T) -> String,
) -> Option<String> {
    let all = ours.len().max(theirs.len());
    let differs = |at: &usize| match (ours.get(*at), theirs.get(*at)) {
        (Some(a), Some(b)) => !same(a, b),
        _ => true,
    };
    let at = (0..all).find(differs)?;
    let count = (at..all).filter(differs).count();
    let shown = |list: &[T]| list.get(at).map_or("none".into(), &show);
    let (what, ours, theirs) = (what(at), shown(ours), shown(theirs));
    Some(format!("{what}: {ours} against {theirs} ({count} of {all} differ)"))
}
