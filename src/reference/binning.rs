//! Binning: which triangles each cell lists.
//!
//! Reads: triangles. Writes: each cell's keys in API order.
//! Contract: a triangle is listed at the finest level at which it touches at most
//! [`abi::MAX_CELLS`] cells, in each of those; twin of the `glsl/binning_*.comp` kernels.

use crate::{
    abi,
    grid::{CELL_LOG2, Grid},
    samples::Samples,
    trace::{Parts, Triangle, key},
};

/// The keys that each cell lists, ascending.
pub fn run(grid: &Grid, samples: Samples, primitives: &[Parts]) -> Vec<Vec<u32>> {
    let mut cells = vec![Vec::new(); grid.cells as usize];
    for (number, parts) in primitives.iter().enumerate() {
        for (part, triangle) in parts.iter().enumerate() {
            let Some(triangle) = triangle else { continue };
            let level = level(grid, samples, triangle);
            for (column, row) in touched(grid, samples, triangle, level) {
                let cell = grid.cell_first[level] + row * grid.cell_columns[level] + column;
                cells[cell as usize].push(key(number, part));
            }
        }
    }
    cells
}

/// The level at which a triangle is listed.
pub fn level(grid: &Grid, samples: Samples, triangle: &Triangle) -> usize {
    let coarsest = CELL_LOG2.len() - 1;
    (0..coarsest)
        .find(|&level| {
            let boxed = under_box(triangle, level).count() as u32;
            boxed <= abi::MAX_CELLS
                || (boxed <= abi::MAX_CELLS_TESTED
                    && touched(grid, samples, triangle, level).count() as u32 <= abi::MAX_CELLS)
        })
        .unwrap_or(coarsest)
}

/// Columns and rows of the cells under the triangle's bounds.
fn under_box(triangle: &Triangle, level: usize) -> impl Iterator<Item = (u32, u32)> + use<> {
    let log2 = CELL_LOG2[level];
    let cells = |axis: usize| triangle.first[axis] >> log2..=triangle.last[axis] >> log2;
    let (columns, rows) = (cells(0), cells(1));
    rows.flat_map(move |row| columns.clone().map(move |column| (column, row)))
}

/// Those of them that no edge has wholly outside; a single one is taken untested.
fn touched(
    grid: &Grid,
    samples: Samples,
    triangle: &Triangle,
    level: usize,
) -> impl Iterator<Item = (u32, u32)> + use<> {
    let reach = i64::from(samples.reach());
    let alone = under_box(triangle, level).nth(1).is_none();
    let size = 1i64 << CELL_LOG2[level];
    let origin_y = i64::from(grid.origin_y);
    let triangle = *triangle;
    under_box(&triangle, level).filter(move |&(column, row)| {
        alone
            || (0..3).all(|edge| {
                let x = i64::from(column) * size;
                let y = i64::from(row) * size + origin_y;
                // The corner of the cell that is farthest inside. A cell begins so much before its first centre as samples are
                // away from centres, and is as long as its pixels are.
                let (dx, dy) = edge_step(&triangle, edge);
                let x = if dx > 0 { x + size } else { x };
                let y = if dy > 0 { y + size } else { y };
                edge_at(&triangle, edge, [256 * x - reach, 256 * y - reach]) >= 0
            })
    })
}

/// Change of an edge function per pixel to the right and down.
fn edge_step(triangle: &Triangle, edge: usize) -> (i64, i64) {
    let next = (edge + 1) % 3;
    (
        i64::from(triangle.y[edge]) - i64::from(triangle.y[next]),
        i64::from(triangle.x[next]) - i64::from(triangle.x[edge]),
    )
}

/// An edge function at a place in 1/256 pixel from the centre of pixel (0, 0): inside if not negative, top-left rule
/// included.
pub fn edge_at(triangle: &Triangle, edge: usize, [x, y]: [i64; 2]) -> i64 {
    let (ax, ay) = (i64::from(triangle.x[edge]), i64::from(triangle.y[edge]));
    let (dx, dy) = edge_step(triangle, edge);
    let value = dx * (x - ax) + dy * (y - ay);
    // Left edges go up (dx > 0), top edges go right (dx == 0, dy > 0); they own their points.
    let owns = dx > 0 || (dx == 0 && dy > 0);
    if owns { value } else { value - 1 }
}
