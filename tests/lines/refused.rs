//! What no pass may ask for, and what the device's own pipeline does not do.

use super::*;

fn of(pipeline: Pipeline) -> Pass {
    let corners = lines(&mut Random::new(18_000), 3, false);
    pass("refused").pipelines([pipeline]).draws([draw(0, &corners)])
}

#[test]
fn widths_that_no_line_has_are_refused() {
    for topology in [Topology::LineList, Topology::LineStrip] {
        let of = |width| of(pipeline(FLAT).topology(topology).line_width(width));
        for width in [0.0, -0.0, -1.0, f32::NAN, f32::INFINITY, 5000.0, 1024.5] {
            let fault = of(width).validate().unwrap_err();
            let is_it = matches!(&fault, Error::Usage(text) if text.contains("pixels wide"));
            assert!(is_it, "{width}: {fault}");
        }
        for width in [0.25, 1.0, 1024.0] {
            of(width).validate().unwrap();
        }
    }
    // Where there are no lines, it says nothing.
    for topology in [Topology::PointList, Topology::TriangleList] {
        of(pipeline(FLAT).topology(topology).line_width(0.0)).validate().unwrap();
    }
}

#[test]
fn point_coordinates_are_for_points() {
    for topology in [
        Topology::TriangleList,
        Topology::TriangleStrip,
        Topology::TriangleFan,
        Topology::LineList,
        Topology::LineStrip,
    ] {
        let fault = of(pipeline(POINT_COORD).topology(topology)).validate().unwrap_err();
        let is_it = matches!(&fault, Error::Usage(text) if text.contains("gl_PointCoord"));
        assert!(is_it, "{topology:?}: {fault}");
    }
    of(pipeline(POINT_COORD).topology(Topology::PointList)).validate().unwrap();
}

/// What Vulkan or lavapipe lacks, and compute draws.
#[test]
fn the_device_refuses_some_lines() {
    let gpu = gpu();
    let [mut ours, mut theirs] = executors(&gpu);
    let line = pipeline(FLAT).topology(Topology::LineList);
    let bresenham = line.clone().line_mode(LineMode::Bresenham);
    for (pipeline, text) in [
        (line.clone().line_width(300.0), "lines of this width"),
        (bresenham.clone().alpha_to_one(true), "Bresenham lines beside"),
        (bresenham.clone().alpha_to_coverage(true), "Bresenham lines beside"),
        (bresenham.clone().sample_shading(true), "Bresenham lines beside"),
    ] {
        let pass = of(pipeline).samples(Samples::Four);
        let fault = theirs.render(&pass).unwrap_err();
        assert!(matches!(&fault, Error::Device(found) if found.contains(text)), "{text}: {fault}");
        ours.render(&pass).unwrap();
    }
}
