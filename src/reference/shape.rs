//! Points and lines: the parallelogram that each is in the window.
//!
//! Contract: that of `glsl/shapes.glsl`, whose twin this is. Vulkan's chapters "Points" and "Line Segments" give the shapes, and
//! leave the ends of lines and the places where lines are cut to devices. These are those of Mesa's software rasterizer.

use super::{
    assembly::Assembled,
    primitive::{
        WindowPosition, between, distance, flush, planes, to_window, usable_plane, user_planes,
    },
};
use crate::{
    abi,
    pass::Pipeline,
    samples::Samples,
    state::{LineMode, PrimitiveKind},
    trace::Shaded,
};

/// Beyond this no corner of a shape is drawn.
const FAR_OUT: f32 = (1 << abi::GUARD_LOG2) as f32 - 1024.0;

/// A parallelogram and the plane of its depths.
pub struct Shape {
    /// In 1/256 pixel from the centre of pixel (0, 0), clockwise.
    pub corners: [[i32; 2]; 4],
    /// Change of depth per pixel to the right and down, and the depth where planes start.
    pub plane: [f32; 3],
}

/// The shape of a primitive with these corners in clip space, if there is one. `size` is that of a point.
pub fn of(
    (pipeline, assembled): (&Pipeline, &Assembled),
    corners: &[Shaded; 3],
    size: f32,
    samples: Samples,
) -> Option<Shape> {
    let [a, b, _] = corners;
    let clips = planes(pipeline) == 6;
    let beyond = |p: &Shaded, plane| distance(plane, p) < 0.0;
    // The last two planes are near and far.
    let cuts = |p: &Shaded| clips && (beyond(p, 4) || beyond(p, 5));
    let window = &assembled.window;
    if pipeline.topology.kind() == PrimitiveKind::Point {
        if a.position[3] <= 0.0 || cuts(a) {
            return None;
        }
        let place = to_window(window, a.position, false);
        // No target reaches so far, and not-a-number is nowhere.
        let is_near = place[..2].iter().all(|c| c.abs() < FAR_OUT);
        return is_near.then(|| point(place, size, samples));
    }
    let behind = |p: &Shaded| p.position[3] <= 0.0;
    let both = |plane| beyond(a, plane) && beyond(b, plane);
    if (behind(a) && behind(b)) || (clips && (both(4) || both(5))) {
        return None;
    }
    let sides: Vec<usize> = (0..4).filter(|&plane| beyond(a, plane) || beyond(b, plane)).collect();
    let mut cut: Vec<usize> = match clips {
        true => (4..6).filter(|&plane| beyond(a, plane) || beyond(b, plane)).collect(),
        false => Vec::new(),
    };
    if cut.is_empty() && (behind(a) || behind(b)) {
        cut.extend(&sides);
    }
    cut.extend(user_planes(pipeline).filter(|&plane| beyond(a, plane) || beyond(b, plane)));
    let mut ends = Some([a, b].map(|end| to_window(window, end.position, false)));
    for _ in 0..2 {
        if !cut.is_empty() {
            let cut = cut_line([a, b], &cut)?;
            // An end at the eye has no place.
            let has_places = cut.iter().all(|p| flush(p.position[3]) > 0.0);
            let [p, q] = cut.map(|end| end.position);
            // An end counts as made also if it is merely beyond a side.
            let made = |end| (0..6).chain(user_planes(pipeline)).any(|plane| beyond(end, plane));
            let places = || [to_window(window, p, made(a)), to_window(window, q, made(b))];
            ends = has_places.then(places);
        }
        let is_near = |end: &WindowPosition| end[..2].iter().all(|c| c.abs() < FAR_OUT);
        if ends.is_some_and(|ends| ends.iter().all(is_near)) {
            break;
        }
        cut.extend(&sides);
        cut.sort_unstable();
        cut.dedup();
    }
    line(ends?, (pipeline.line_width, pipeline.line_mode), samples)
}

/// The ends that the planes `cut` leave of a line.
fn cut_line([a, b]: [&Shaded; 2], cut: &[usize]) -> Option<[Shaded; 2]> {
    let (mut ta, mut tb) = (0.0f32, 0.0f32);
    for &plane in cut {
        let (da, db) = (distance(plane, a), distance(plane, b));
        if da < 0.0 && db < 0.0 {
            return None;
        }
        if da < 0.0 {
            ta = ta.max(flush(da / (da - db)));
        }
        if db < 0.0 {
            tb = tb.max(flush(db / (db - da)));
        }
    }
    if ta + tb >= 1.0 {
        return None;
    }
    Some([between(ta, a, b), between(tb, b, a)])
}

/// To 1/256 pixel, halves to even.
fn snap(pixels: f32) -> i32 {
    (pixels * 256.0).round_ties_even() as i32
}

/// A place, from the centre of pixel (0, 0).
fn place(samples: Samples, at: f32) -> i32 {
    match samples {
        Samples::One => snap(at - 0.5),
        _ => snap(at) - 128,
    }
}

fn point([x, y, z]: WindowPosition, size: f32, samples: Samples) -> Shape {
    let side = if size > 1.0 { snap(size.min(256.0)) } else { 256 };
    let (left, top) = (place(samples, x) - side / 2, place(samples, y) - side / 2);
    let (right, bottom) = (left + side, top + side);
    let corners = [[left, top], [right, top], [right, bottom], [left, bottom]];
    Shape { corners, plane: [0.0, 0.0, z] }
}

fn line(
    [a, b]: [WindowPosition; 2],
    (width, mode): (f32, LineMode),
    samples: Samples,
) -> Option<Shape> {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    let squared = flush(dx * dx + dy * dy);
    if squared == 0.0 {
        return None;
    }
    let inverse = flush(1.0 / squared);
    let along = |major: f32, minor: f32| {
        let slope = flush(flush(minor) / major);
        major * (1.0 + slope * slope)
    };
    let ([way_x, way_y], corners) = match mode {
        LineMode::Rectangular => ([dx, dy], rectangle(a, b, width, samples)),
        LineMode::Bresenham => {
            let steep = dx.abs() < dy.abs();
            let way = if steep { [0.0, along(dy, dx)] } else { [along(dx, dy), 0.0] };
            (way, bresenham(a, b, width))
        }
    };
    let d = a[2] - b[2];
    let [gx, gy] = [d * way_x * inverse, d * way_y * inverse];
    let start = if samples == Samples::One { 0.5 } else { 0.0 };
    let z = a[2] - (gx * (a[0] - start) + gy * (a[1] - start));
    Some(Shape { corners, plane: usable_plane([gx, gy, z], a[2]) })
}

fn rectangle(a: WindowPosition, b: WindowPosition, width: f32, samples: Samples) -> [[i32; 2]; 4] {
    let (dx, dy) = (a[0] - b[0], a[1] - b[1]);
    let scale = flush(width * 0.5 / flush(dx * dx + dy * dy).sqrt());
    let (tx, ty) = (snap(-dy * scale), snap(dx * scale));
    let [a, b] = [a, b].map(|p| [place(samples, p[0]), place(samples, p[1])]);
    [[a[0] + tx, a[1] + ty], [b[0] + tx, b[1] + ty], [b[0] - tx, b[1] - ty], [a[0] - tx, a[1] - ty]]
}

/// An end of a line: its place along the line and across, each also from the centre of its pixel.
struct End {
    at: [f32; 2],
    offset: [f32; 2],
}

impl End {
    fn of(p: WindowPosition, steep: bool) -> Self {
        let at = if steep { [p[1], p[0]] } else { [p[0], p[1]] };
        Self { at, offset: at.map(|c| c - c.floor() - 0.5) }
    }

    fn is_in_diamond(&self) -> bool {
        self.offset[0].abs() + self.offset[1].abs() < 0.5
    }

    /// Where the line crosses the middle of the pixel's column (row), from its side.
    fn crossing(&self, slope: f32) -> f32 {
        self.at[1] - self.at[1].floor() + self.offset[0] * slope
    }

    /// Moved along the line, to 1/256 pixel.
    fn moved(&self, by: f32, slope: f32) -> [i32; 2] {
        [snap(self.at[0] + by - 0.5), snap(self.at[1] + by * slope - 0.5)]
    }
}

fn bresenham(a: WindowPosition, b: WindowPosition, width: f32) -> [[i32; 2]; 4] {
    let steep = (a[0] - b[0]).abs() < (a[1] - b[1]).abs();
    let (from, mut to) = (End::of(a, steep), End::of(b, steep));
    let [along, across] = [0, 1].map(|n| from.at[n] - to.at[n]);
    let slope = flush(flush(across) / along);
    if to.offset[1] == -0.5 && across < 0.0 {
        to.offset[1] = 0.5;
    }
    let negative = |a: f32| a < 0.0;
    // Whether the end is past the centre of its pixel, and whether the line turns away from the nearer corner. The two kinds of
    // lines treat zeros differently.
    let behind = |end: &End| match steep {
        true => negative(-end.offset[0]) == negative(along),
        false => negative(end.offset[0]) == negative(-along),
    };
    let aside = |end: &End| match steep {
        true => negative(end.offset[1]) != negative(-across),
        false => negative(-end.offset[1]) != negative(across),
    };
    let inside = |at: f32| at > 0.0 && at < 1.0;
    let starts =
        from.is_in_diamond() || (!behind(&from) && (aside(&from) || inside(from.crossing(slope))));
    let crosses = |at: f32| inside(at) || (steep && at == 0.0);
    let ends = !to.is_in_diamond() && behind(&to) && (!aside(&to) || crosses(to.crossing(slope)));
    let forward = along < 0.0;
    // The fill rule draws a pixel from its centre on, to the right.
    let drawn = |end: &End, first: bool| match first == forward {
        true => end.offset[0] <= 0.0,
        false => end.offset[0] > 0.0,
    };
    let side = if forward { -0.5 } else { 0.5 };
    let by = |end: &End, wanted: bool, first: bool| match drawn(end, first) == wanted {
        true => 0.0,
        false => -end.offset[0] + side,
    };
    let p = from.moved(by(&from, starts, true), slope);
    let q = to.moved(by(&to, ends, false), slope);
    let (low, high) = if forward { (p, q) } else { (q, p) };
    let half = width.max(1.0).round_ties_even() as i32 * 128;
    if steep {
        let corner = |end: [i32; 2], side: i32| [end[1] + side, end[0]];
        return [corner(low, half), corner(high, half), corner(high, -half), corner(low, -half)];
    }
    let corner = |end: [i32; 2], side: i32| [end[0], end[1] + side];
    [corner(low, -half), corner(high, -half), corner(high, half), corner(low, half)]
}
