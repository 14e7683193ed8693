//! Polylines (`l`) and points (`p`) of OBJ files, by the pictures they give.

use super::{LIBRARY, PIXELS, Painter, Picture, RED, SQUARE, near, png};
use crate::scene::loaded::{Case, pass};
use glam::DVec3;
use tilewright::state::Topology;

/// What `Kd 1 0 0` and `Kd 0 1 0` are without light.
const UNLIT_RED: [u8; 3] = [255, 0, 0];
const UNLIT_GREEN: [u8; 3] = [0, 255, 0];
/// Pixels of a side of the square.
const SIDE: usize = 206;

/// The picture of the square's vertices with these statements and the library of the cases.
fn draw(painter: &mut Painter, statements: &str) -> Picture {
    let obj = format!("mtllib m.mtl\n{SQUARE}{statements}");
    painter.draw(&[("a.obj", obj.as_bytes()), ("m.mtl", LIBRARY)])
}

/// Pixels of exactly this colour.
fn count(picture: &Picture, color: [u8; 3]) -> usize {
    picture.pixels.iter().filter(|p| **p == color).count()
}

#[test]
fn lines_and_points_have_the_colour_of_their_material() {
    let mut painter = Painter::new();
    for (statements, pixels) in [
        ("usemtl red\nl 1 2", SIDE),
        ("usemtl red\nl 1 2 3", 2 * SIDE),
        ("usemtl red\nl 1 2 3 4 1", 4 * SIDE),
        ("usemtl red\nl -4 -3\nl 3 4", 2 * SIDE),
        ("usemtl red\nL 1/1 2/2", SIDE),
        ("usemtl red\nl 1 \\\n2", SIDE),
        ("usemtl red\np 1 2 3 4", 4),
        ("usemtl red\np -1\ns 1\np 1 # the first\n", 2),
    ] {
        let picture = draw(&mut painter, statements);
        let found = count(&picture, UNLIT_RED);
        assert_eq!(found, picture.covered(), "{statements}: other colours");
        // Neighbours share the pixel at a corner, or leave one out.
        let slack = if pixels > 4 { 4 } else { 0 };
        assert!(found.abs_diff(pixels) <= slack, "{statements}: {found} pixels, not {pixels}");
    }
    let both = draw(&mut painter, "usemtl red\nl 1 2\nusemtl green\nl 3 4\n");
    let found = [UNLIT_RED, UNLIT_GREEN].map(|color| count(&both, color));
    assert!(found.iter().all(|n| n.abs_diff(SIDE) <= 2), "{found:?}");
}

/// What is not lit beside what is: the material of a line is none of a face's.
#[test]
fn faces_keep_their_light_beside_lines_and_points() {
    let mut painter = Painter::new();
    let grey = painter.plain("");
    let face = "f 1//1 2//1 3//1 4//1\n";
    for (statements, color) in [
        (format!("usemtl red\nl 1 2\np 3\n{face}"), RED),
        (format!("usemtl red\nl 1 2\nusemtl\n{face}"), grey),
        (format!("l 1 2\nusemtl red\n{face}"), RED),
    ] {
        let picture = draw(&mut painter, &statements);
        assert!(near(picture.middle(), color), "{statements}: {:?}", picture.middle());
        assert!(picture.covered().abs_diff(PIXELS) <= 2 * SIDE, "{statements}");
    }
}

#[test]
fn points_with_normals_are_lit() {
    let picture = draw(&mut Painter::new(), "usemtl red\np 1//1 2//1\np 3//1\n");
    assert_eq!((picture.covered(), picture.like(RED)), (3, 3));
    assert_eq!(count(&picture, UNLIT_RED), 0);
}

#[test]
fn lines_have_the_colours_of_textures_and_of_vertices() {
    // Blue at the left, green at the right.
    let texels = [0, 0, 255, 0, 255, 0].repeat(2);
    let map = png(png::ColorType::Rgb, &texels, None);
    let obj = format!("mtllib x.mtl\n{SQUARE}vt 0.2 0.5\nvt 0.8 0.5\nusemtl x\nl 1/1 2/2\n");
    let files: [(&str, &[u8]); 3] =
        [("a.obj", obj.as_bytes()), ("x.mtl", b"newmtl x\nmap_Kd x.png\n"), ("x.png", &map)];
    let mut painter = Painter::new();
    let picture = painter.draw(&files);
    let mostly = |channel: usize| picture.pixels.iter().filter(|p| p[channel] > 200).count();
    assert!(mostly(2) > SIDE / 4 && mostly(1) > SIDE / 4, "{} {}", mostly(2), mostly(1));
    let obj = "v -1 0 0 0 1 0\nv 1 0 0 0 1 0\nl 1 2\n";
    let picture = painter.draw(&[("a.obj", obj.as_bytes())]);
    assert_eq!(count(&picture, UNLIT_GREEN), picture.covered());
    assert!(picture.covered().abs_diff(SIDE) <= 2, "{}", picture.covered());
}

/// They are framed like faces, alone and beside others, wherever they lie.
#[test]
fn a_file_of_lines_or_points_alone_is_framed() {
    let mut painter = Painter::new();
    for (obj, min, max) in [
        ("v 10 10 0\nv 14 10 0\nv 14 12 3\nl 1 2 3\n", [10., 10., 0.], [14., 12., 3.]),
        ("v 5e5 4e6 100\nv 500001 4e6 102\nl 1 2\n", [5e5, 4e6, 100.], [500_001., 4e6, 102.]),
        ("v 1 2 3\np 1\n", [1., 2., 3.], [1., 2., 3.]),
        (
            "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 9 0 0\nv 0 -7 0\nf 1 2 3\nl 1 4\np 5\n",
            [0., -7., 0.],
            [9., 1., 0.],
        ),
    ] {
        let case = Case::new(&[("a.obj", obj.as_bytes())]);
        let scene = case.load("a.obj");
        assert_eq!(scene.warnings(), [] as [String; 0], "{obj}");
        let bounds = scene.bounds();
        let off = (bounds.min - DVec3::from(min)).abs().max((bounds.max - DVec3::from(max)).abs());
        assert!(off.max_element() < 1e-4, "{obj}: {bounds:?}");
        let picture = painter.draw_from(0.0, &[("a.obj", obj.as_bytes())]);
        let covered = picture.covered();
        match obj.contains('l') {
            true => assert!(covered > 50, "{obj}: {covered} pixels"),
            false => assert_eq!(covered, 1, "{obj}"),
        }
    }
}

#[test]
fn each_kind_of_elements_is_a_draw() {
    let obj = format!("{SQUARE}l 1 2 3\np 1 2\nf 1 2 3 4\nl 3 4\np 3\n");
    let scene = Case::new(&[("a.obj", obj.as_bytes())]).load("a.obj");
    let pass = pass(&scene);
    let mut draws: Vec<_> =
        pass.draws.iter().map(|d| (pass.pipelines[d.pipeline].topology, d.count)).collect();
    draws.sort_by_key(|(topology, _)| *topology as u32);
    let kinds = [(Topology::TriangleList, 6), (Topology::PointList, 3), (Topology::LineList, 6)];
    assert_eq!((draws, scene.triangles()), (kinds.to_vec(), 2));
}

#[test]
fn what_is_too_short_is_left_out_and_what_is_not_there_is_a_fault() {
    let text = format!("{SQUARE}l 1\np\nf 1 2\n");
    let scene = Case::new(&[("a.obj", text.as_bytes())]).load("a.obj");
    let warnings = scene.warnings();
    assert!(warnings[0].starts_with("3 faces of fewer than 3 vertices, lines"), "{warnings:?}");
    assert!(warnings[1].contains("no faces, lines or points"), "{warnings:?}");
    for (statement, said) in [
        ("l 1 0", "line 6: a line refers to vertex 0"),
        ("l 1 5", "line 6: a line refers to vertex 5, but there are 4"),
        ("l 1 -5", "line 6: a line refers to vertex -5"),
        ("p 9", "line 6: a point refers to vertex 9, but there are 4"),
        ("p x", "line 6: `x` is no vertex of a point"),
    ] {
        let text = format!("{SQUARE}{statement}\n");
        let fault = Case::new(&[("a.obj", text.as_bytes())]).try_load("a.obj", None).unwrap_err();
        assert!(fault.to_string().contains(said), "{fault}");
    }
}
