//! OBJ and MTL files as people really write them, by the pictures they give. Each case came out wrong in
//! this or in another program.

mod elements;

use super::loaded::Case;
use crate::common::{TestGpu, gpu};
use glam::DVec3;
use tilewright::{
    compute::Renderer,
    image::{Extent, srgb_to_linear},
    scene::{LoadOptions, PassOptions, Scene},
};

/// Materials that the cases use.
const LIBRARY: &[u8] = b"newmtl red\nKd 1 0 0\nnewmtl green\nKd 0 1 0\n";
/// A square around the origin that faces the viewer.
const SQUARE: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\nvn 0 0 1\n";
/// The same with texture coordinates and its face.
const TEXTURED: &str = "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl x\nf 1/1/1 2/2/1 3/3/1 4/4/1\n";

const EXTENT: Extent = Extent::new(256, 256);
/// Pixels of the square in a picture from 3 units away.
const PIXELS: usize = 42_436;
const BACKGROUND: [u8; 3] = [0x40; 3];
/// What `Kd 1 0 0` is, lit from the front; the sides are a little brighter or darker.
const RED: [u8; 3] = [233, 31, 32];

/// The picture and the warnings.
struct Picture {
    pixels: Vec<[u8; 3]>,
    warnings: Vec<String>,
}

impl Picture {
    fn middle(&self) -> [u8; 3] {
        self.pixels[128 * 256 + 128]
    }

    /// Pixels that are not the background.
    fn covered(&self) -> usize {
        self.pixels.iter().filter(|p| **p != BACKGROUND).count()
    }

    fn like(&self, color: [u8; 3]) -> usize {
        self.pixels.iter().filter(|p| near(**p, color)).count()
    }
}

/// The same material, if perhaps under another angle.
fn near(a: [u8; 3], b: [u8; 3]) -> bool {
    within(a, b, 16)
}

fn within(a: [u8; 3], b: [u8; 3], steps: u8) -> bool {
    a.iter().zip(b).all(|(a, b)| a.abs_diff(b) <= steps)
}

/// Pixels that differ by more than what roundings of the shading make.
fn differing(a: &Picture, b: &Picture) -> usize {
    a.pixels.iter().zip(&b.pixels).filter(|(a, b)| !within(**a, **b, 3)).count()
}

struct Painter {
    renderer: Renderer,
    _gpu: TestGpu,
}

impl Painter {
    fn new() -> Self {
        let gpu = gpu();
        Self { renderer: Renderer::new(&gpu).unwrap(), _gpu: gpu }
    }

    /// The first of `files`, from `distance` away or, at 0, framed.
    fn draw_from(&mut self, distance: f64, files: &[(&str, &[u8])]) -> Picture {
        let case = Case::new(files);
        let scene = Scene::load(&case.path(files[0].0), &LoadOptions::default())
            .unwrap_or_else(|e| panic!("{e}"));
        let camera = match distance {
            0.0 => scene.default_camera(EXTENT),
            _ => scene.camera_at(DVec3::Z * distance, DVec3::ZERO, DVec3::Y, 45f64.to_radians()),
        };
        let grey = srgb_to_linear(f32::from(BACKGROUND[0]) / 255.0);
        let options =
            PassOptions { background: Some([grey, grey, grey, 1.0]), ..PassOptions::default() };
        let frame = self.renderer.render(&scene.pass(EXTENT, &camera, &options).unwrap()).unwrap();
        let pixels = frame.colors[0].bytes.chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect();
        Picture { pixels, warnings: scene.warnings().to_vec() }
    }

    fn draw(&mut self, files: &[(&str, &[u8])]) -> Picture {
        self.draw_from(3.0, files)
    }

    /// What the faces of a plain square look like with this library for their material `x`.
    fn plain(&mut self, mtl: &str) -> [u8; 3] {
        let obj = format!("mtllib x.mtl\n{SQUARE}usemtl x\nf 1//1 2//1 3//1 4//1\n");
        self.draw(&[("a.obj", obj.as_bytes()), ("x.mtl", mtl.as_bytes())]).middle()
    }
}

/// A square of one colour: the text of the OBJ beside the library of the cases, and the colour.
#[test]
fn squares_of_one_colour() {
    let face = "f 1//1 2//1 3//1 4//1\n";
    let whole = format!("mtllib m.mtl\n{SQUARE}usemtl red\n{face}");
    let utf16 = |little: bool, mark: &[u8]| -> Vec<u8> {
        let bytes = |unit: u16| if little { unit.to_le_bytes() } else { unit.to_be_bytes() };
        mark.iter().copied().chain(whole.encode_utf16().flat_map(bytes)).collect()
    };
    let with = |from: &str, to: &str| {
        assert!(whole.contains(from));
        whole.replace(from, to).into_bytes()
    };
    let mut painter = Painter::new();
    let grey = painter.plain("");
    let cases: Vec<(&str, Vec<u8>, [u8; 3])> = vec![
        ("plain", whole.clone().into(), RED),
        ("CR LF", with("\n", "\r\n"), RED),
        ("CR", with("\n", "\r"), RED),
        ("LF CR", with("\n", "\n\r"), RED),
        ("tabs and blanks", with(" ", " \t ").into_iter().chain(*b"  \t").collect(), RED),
        ("a byte order mark", [b"\xef\xbb\xbf", whole.as_bytes()].concat(), RED),
        ("one before a vertex", with("v 1 1 0", "\u{feff}v 1 1 0"), RED),
        ("UTF-16", utf16(true, b"\xff\xfe"), RED),
        ("UTF-16, big endian", utf16(false, b"\xfe\xff"), RED),
        ("UTF-16 without a mark", utf16(true, b""), RED),
        ("zeros at the end", with("4//1\n", "4//1\n\0\0\0\0\0\0\0\0\0\0"), RED),
        ("a comment after a face", with("4//1", "4//1 # front"), RED),
        ("one without a blank", with("4//1", "4//1# front"), RED),
        ("a comment after names", with("red", "red # paint \\"), RED),
        ("a comment after the library", with("m.mtl", "m.mtl # lib"), RED),
        ("a comment that ends in a backslash", with("f 1", "# part\\solid\\\nf 1"), RED),
        ("a group that does", with("f 1", "g part\\solid\\\nf 1"), RED),
        ("a face on three lines", with("2//1 3", "\\\n 2//1  \\  \n3"), RED),
        ("a library in quotes", with("m.mtl", "\"m.mtl\""), RED),
        ("the case of another system", with("m.mtl", "M.MTL"), RED),
        ("a path of another system", with("m.mtl", "C:\\art\\My Models\\m.mtl"), RED),
        ("several libraries", with("m.mtl", "none.mtl m.mtl"), RED),
        ("blanks in a library", with("m.mtl", "sp ace.mtl"), RED),
        ("blanks in one of several", with("m.mtl", "none.mtl sp ace.mtl"), RED),
        ("escaped blanks", with("m.mtl", "sp\\ ace.mtl"), RED),
        ("capital keywords", with("f 1", "F 1").to_ascii_uppercase(), grey),
        ("relative numbers", with(face, "f -4//-1 -3//-1 -2//-1 -1//-1\n"), RED),
        ("numbers of all kinds", with(face, "f 1 2//1 3/7/1 -1//\n"), RED),
        ("faces before vertices", format!("mtllib m.mtl\nusemtl red\n{face}{SQUARE}").into(), RED),
        ("smoothing and groups", with("f 1", "s off\ng a b c\no\ng\nf 1"), RED),
        ("curves", with("f 1", "vp 0 1\ncstype bezier\ndeg 1\ncurv 0 1 1 2\nend\nf 1"), RED),
        ("a normal without a length", with("vn 0 0 1", "vn 0 0 0"), RED),
        ("a normal of any length", with("vn 0 0 1", "vn 0 0 1e-30"), RED),
        ("a normal that is none", with("vn 0 0 1", "vn -1.#IND 0 1"), RED),
        ("no material", with("usemtl red", "usemtl red\nusemtl"), grey),
        ("a weight", with("v 1 1 0", "v 2 2 0 2"), RED),
        ("decimal commas", with("v 1 1 0", "v 1,0 1,0 0,0"), RED),
        ("a word for no material", with("usemtl red", "usemtl (null)"), grey),
    ];
    for (name, obj, color) in cases {
        let files: [(&str, &[u8]); 3] =
            [("a.obj", &obj), ("m.mtl", LIBRARY), ("sp ace.mtl", LIBRARY)];
        let picture = painter.draw(&files);
        let found = (picture.covered(), picture.middle());
        let right = found.0 == PIXELS && near(found.1, color);
        assert!(right, "{name}: {found:?}, not {PIXELS} like {color:?}; {:?}", picture.warnings);
    }
}

#[test]
fn colours_of_vertices() {
    let square = |color: &str| {
        let corner = |at: &str| format!("v {at} 0 {color}\n");
        ["-1 -1", "1 -1", "1 1", "-1 1"].map(corner).concat() + "f 1 2 3 4\n"
    };
    let mut painter = Painter::new();
    // Faces without a material are white then.
    let red = painter.draw(&[("a.obj", square("1 0 0").as_bytes())]);
    assert!(near(red.middle(), RED), "{:?}", red.middle());
    for color in ["1 0 0 1", "1.0 0.0 0.0 0.5", "255 0 0", "255 0 0 255", "65535 0 0", "1 1 0 0 1"]
    {
        let picture = painter.draw(&[("a.obj", square(color).as_bytes())]);
        assert_eq!(picture.covered(), PIXELS, "{color}");
        assert_eq!(picture.middle(), red.middle(), "{color}");
    }
}

#[test]
fn a_comment_that_ends_in_a_backslash_swallows_nothing() {
    let obj = format!(
        "mtllib m.mtl\n{SQUARE}usemtl red\n# part\\solid\\\nf 1//1 2//1 3//1 4//1\n\
         usemtl green\nv 2 2 0\nf -1 2 3\n"
    );
    let mut painter = Painter::new();
    let picture = painter.draw(&[("a.obj", obj.as_bytes()), ("m.mtl", LIBRARY)]);
    assert_eq!(picture.like(RED), PIXELS);
    let green = picture.like(painter.plain("newmtl x\nKd 0 1 0\n"));
    assert!(green > 500, "{green} green pixels");
}

/// A picture with these texels in rows of two, as PNG.
fn png(color: png::ColorType, texels: &[u8], palette: Option<(&[u8], &[u8])>) -> Vec<u8> {
    let mut bytes = Vec::new();
    let height = texels.len() / color.samples() / 2;
    let mut encoder = png::Encoder::new(&mut bytes, 2, height as u32);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    if let Some((colors, alpha)) = palette {
        encoder.set_palette(colors);
        encoder.set_trns(alpha);
    }
    encoder.write_header().unwrap().write_image_data(texels).unwrap();
    bytes
}

#[test]
fn materials_and_their_pictures() {
    let obj = |library: &str| format!("mtllib {library}\n{SQUARE}{TEXTURED}").into_bytes();
    let plain = obj("x.mtl");
    let blue = png(png::ColorType::Rgb, &[0, 0, 255].repeat(4), None);
    let translucent = png(png::ColorType::Grayscale, &[180; 4], None);
    // The upper half is there.
    let half = png(png::ColorType::Grayscale, &[255, 255, 0, 0], None);
    let indexed =
        png(png::ColorType::Indexed, &[0, 0, 1, 1], Some((&[0, 0, 255, 255, 0, 0], &[255, 0])));
    let rgba = png(
        png::ColorType::Rgba,
        &[[0, 0, 255, 255].repeat(2), [255, 0, 0, 0].repeat(2)].concat(),
        None,
    );
    let mut painter = Painter::new();
    let [blue_pixels, green] =
        ["0 0 1", "0 1 0"].map(|kd| painter.plain(&format!("newmtl x\nKd {kd}\n")));
    for (name, mtl, color, pixels, warnings) in [
        ("a continued line", "newmtl x\nKd 1 \\\n0 0\n", RED, PIXELS, &[][..]),
        ("a map and a comment", "newmtl x\nmap_Kd blue.png # wood\n", blue_pixels, PIXELS, &[]),
        ("a map in the wrong case", "NEWMTL x\nMAP_KD Blue.PNG\n", blue_pixels, PIXELS, &[]),
        ("options after the map", "newmtl x\nmap_Kd blue.png -s 2 2\n", blue_pixels, PIXELS, &[]),
        ("quotes", "newmtl x\nmap_Kd \"blue.png\"\n", blue_pixels, PIXELS, &[]),
        ("blanks", "newmtl x\nmap_Kd -clamp on sp ace #1.png\n", blue_pixels, PIXELS, &[]),
        (
            "a path of another machine",
            "newmtl x\nmap_Kd D:\\work\\My Textures\\blue.png\n",
            blue_pixels,
            PIXELS,
            &[],
        ),
        (
            "a mask that is missing",
            "newmtl x\nmap_Kd blue.png\nmap_d nothere.png\n",
            blue_pixels,
            PIXELS,
            &["nothere.png"],
        ),
        (
            "a colour that is missing",
            "newmtl x\nKd 1 0 0\nmap_Kd nothere.png\nmap_d half.png\n",
            RED,
            PIXELS / 2,
            &["nothere.png"],
        ),
        ("a mask alone", "newmtl x\nKd 1 0 0\nmap_d translucent.png\n", RED, PIXELS, &[]),
        ("a mask of half", "newmtl x\nKd 1 0 0\nmap_d half.png\n", RED, PIXELS / 2, &[]),
        ("a palette with alpha", "newmtl x\nmap_Kd indexed.png\n", blue_pixels, PIXELS / 2, &[]),
        ("alpha", "newmtl x\nmap_Kd rgba.png\n", blue_pixels, PIXELS / 2, &[]),
        (
            "a mask in a channel",
            "newmtl x\nKd 1 0 0\nmap_d -imfchan m rgba.png\n",
            RED,
            PIXELS / 2,
            &[],
        ),
        ("d before Tr", "newmtl x\nKd 1 0 0\nd 1\nTr 1\n", RED, PIXELS, &[]),
        (
            "Tr alone",
            "newmtl x\nKd 1 0 0\nTr 1\n",
            BACKGROUND,
            0,
            &["`x`", "`Tr 1` in x.mtl, line 3"],
        ),
        ("d of nothing", "newmtl x\nd 0\n", BACKGROUND, 0, &["`x`", "`d 0` in x.mtl, line 2"]),
        ("two definitions", "newmtl x\nKd 1 0 0\nnewmtl x\nKd 0 1 0\n", RED, PIXELS, &["line 3"]),
        ("no names", "newmtl\nnewmtl x\nKd 1 0 0\nmap_Kd\nmap_d -clamp on\n", RED, PIXELS, &[]),
    ] {
        let files: [(&str, &[u8]); 8] = [
            ("a.obj", &plain),
            ("x.mtl", mtl.as_bytes()),
            ("blue.png", &blue),
            ("sp ace #1.png", &blue),
            ("translucent.png", &translucent),
            ("half.png", &half),
            ("indexed.png", &indexed),
            ("rgba.png", &rgba),
        ];
        let picture = painter.draw(&files);
        // The middle of the upper half.
        let found = (picture.covered(), picture.pixels[76 * 256 + 128]);
        let said = warnings.iter().all(|w| picture.warnings.iter().any(|all| all.contains(w)));
        let quiet = warnings.is_empty() == picture.warnings.is_empty();
        assert!(
            found.0.abs_diff(pixels) <= 206 && near(found.1, color) && said && quiet,
            "{name}: {found:?}, not {pixels} like {color:?}; {:?}",
            picture.warnings
        );
    }
    for (library, color) in
        [("a.mtl b.mtl", RED), ("b.mtl a.mtl", green), ("a.mtl\nmtllib b.mtl", RED)]
    {
        let files: [(&str, &[u8]); 3] = [
            ("a.obj", &obj(library)),
            ("a.mtl", b"newmtl x\nKd 1 0 0\n"),
            ("b.mtl", b"newmtl x\nKd 0 1 0\n"),
        ];
        let picture = painter.draw(&files);
        assert!(near(picture.middle(), color) && picture.warnings.is_empty(), "{library}");
    }
    // Renamed with its library, which the file does not know.
    let picture = painter.draw(&[("a.obj", &plain), ("a.mtl", b"newmtl x\nKd 1 0 0\n")]);
    assert!(near(picture.middle(), RED), "{:?}", picture.middle());
    assert!(
        picture.warnings.iter().any(|w| w.contains("`a.mtl` beside it")),
        "{:?}",
        picture.warnings
    );
}

/// Two names are one if their bytes are: `ü` of Latin-1 is neither that of UTF-8 nor `ä`.
#[test]
fn names_are_bytes() {
    let obj = |name: &[u8]| {
        [b"mtllib m.mtl\n", SQUARE.as_bytes(), b"usemtl ", name, b"\nf 1//1 2//1 3//1 4//1\n"]
            .concat()
    };
    let library = b"newmtl gr\xfcn\nKd 0 1 0\nnewmtl gr\xe4n\nKd 1 0 0\n";
    let mut painter = Painter::new();
    let green = painter.plain("newmtl x\nKd 0 1 0\n");
    for (name, color) in
        [(&b"gr\xfcn"[..], Some(green)), (b"gr\xe4n", Some(RED)), ("grün".as_bytes(), None)]
    {
        let picture = painter.draw(&[("a.obj", &obj(name)), ("m.mtl", library)]);
        match color {
            Some(color) => assert!(near(picture.middle(), color), "{:?}", picture.middle()),
            None => assert!(picture.warnings[0].contains("`grün` is not defined")),
        }
    }
}

#[test]
fn a_hole_with_a_bridge_stays_open() {
    let obj = "v -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\nv -1 -1 0\nv -1 1 0\nv 1 1 0\nv 1 -1 0\n\
               f 1 2 3 4 1 5 6 7 8 5\n";
    let picture = Painter::new().draw_from(8.0, &[("a.obj", obj.as_bytes())]);
    assert_eq!(picture.middle(), BACKGROUND);
    // 256 pixels are 16 tan(22.5 degrees) units.
    let pixel = 16.0 * 22.5f64.to_radians().tan() / 256.0;
    let area = picture.covered() as f64 * pixel * pixel;
    assert!((area - 12.0).abs() < 0.2, "{area}");
}

/// A bent leaf of two layers that face opposite ways looks as its upper layer alone does.
#[test]
fn a_leaf_of_two_layers_has_no_streaks() {
    let vertices = "v -1 -1 0\nv 0 -1 0.3\nv 0 1 0.3\nv -1 1 0\nv 1 -1 0\nv 1 1 0\n";
    let upper = "f 1 2 3 4\nf 2 5 6 3\n";
    let one = format!("{vertices}s 1\n{upper}");
    let own = format!("{vertices}{vertices}s 1\n{upper}f 10 9 8 7\nf 9 12 11 8\n");
    let shared = format!("{vertices}s 1\n{upper}f 4 3 2 1\nf 3 6 5 2\n");
    let mut painter = Painter::new();
    let alone = painter.draw(&[("a.obj", one.as_bytes())]);
    for two in [own, shared] {
        let both = painter.draw(&[("a.obj", two.as_bytes())]);
        assert_eq!(differing(&alone, &both), 0);
    }
}

/// The faces of a cube with its least corner at `corner`.
fn cube(edge: f64, corner: [f64; 3]) -> String {
    let vertex = |i: usize| {
        let [x, y, z] = [2, 1, 0].map(|bit| if i >> bit & 1 == 1 { edge } else { 0.0 });
        let [a, b, c] = corner;
        format!("v {:?} {:?} {:?}\n", a + x, b + y, c + z)
    };
    let faces = "f 1 2 4 3\nf 5 7 8 6\nf 1 5 6 2\nf 3 4 8 7\nf 1 3 7 5\nf 2 6 8 4\n";
    (0..8).map(vertex).collect::<String>() + faces
}

#[test]
fn a_cube_looks_the_same_at_every_scale_and_wherever_it_lies() {
    let mut painter = Painter::new();
    let near = painter.draw_from(0.0, &[("a.obj", cube(1.0, [0.0; 3]).as_bytes())]);
    assert!(near.covered() > 15_000);
    for (edge, corner) in [
        (1e-7, [0.0; 3]),
        (1e-20, [0.0; 3]),
        (1e10, [0.0; 3]),
        (1e30, [0.0; 3]),
        (1e-60, [0.0; 3]),
        (1e60, [0.0; 3]),
        (1.0, [-2487002.881739342, -4684683.676570751, 3529638.9835389843]),
        (10.0, [1e7; 3]),
        (1e-20, [3e-18, 0.0, -3e-18]),
        (1e30, [-4e33, 4e33, 0.0]),
    ] {
        let there = painter.draw_from(0.0, &[("a.obj", cube(edge, corner).as_bytes())]);
        let differing = differing(&near, &there);
        // Single pixels on edges, which rounding decides.
        assert!(differing <= 24, "edge {edge} at {corner:?}: {differing} pixels differ");
    }
}

#[test]
fn stairs_of_a_map_keep_their_steps() {
    let stairs = |x: f64, y: f64, z: f64| -> String {
        let step = |i: u32| {
            let (front, up) = (y + f64::from(i) * 0.1, z + f64::from(i) * 0.1);
            let corner = |dx: f64, dy: f64, dz: f64| {
                format!("v {:.3} {:.3} {:.3}\n", x + dx, front + dy, up + dz)
            };
            let corners = [
                (0., 0., 0.),
                (1., 0., 0.),
                (1., 0., 0.1),
                (0., 0., 0.1),
                (1., 0.1, 0.1),
                (0., 0.1, 0.1),
            ];
            let vertices: String = corners.iter().map(|&(x, y, z)| corner(x, y, z)).collect();
            format!("{vertices}f -6 -5 -4 -3\nf -3 -4 -2 -1\n")
        };
        (0..10).map(step).collect()
    };
    let mut painter = Painter::new();
    let near = painter.draw_from(0.0, &[("a.obj", stairs(0.0, 0.0, 0.0).as_bytes())]);
    let there =
        painter.draw_from(0.0, &[("a.obj", stairs(500_000.0, 4_649_776.0, 100.0).as_bytes())]);
    let differing = differing(&near, &there);
    assert!(differing <= 24 && near.covered() > 5000, "{differing} pixels differ");
}

#[test]
fn the_content_counts_and_not_the_name() {
    let gltf = super::loaded::triangle("", "");
    let obj = format!("# a\n{SQUARE}f 1 2 3\n");
    for (name, content) in [
        ("gltf.obj", gltf.as_bytes()),
        ("obj.gltf", obj.as_bytes()),
        ("obj.glb", obj.as_bytes()),
        ("obj.txt", obj.as_bytes()),
        ("obj", obj.as_bytes()),
    ] {
        let scene = Case::new(&[(name, content)]).try_load(name, None);
        assert_eq!(scene.unwrap_or_else(|e| panic!("{e}")).triangles(), 1, "{name}");
    }
    let mut stl = vec![b' '; 84 + 50];
    stl[80..84].copy_from_slice(&[1, 0, 0, 0]);
    for (content, said) in [
        (&b"ply\nformat ascii 1.0\n"[..], "PLY"),
        (b"solid x\n facet normal 0 0 1\n", "STL"),
        (&stl, "STL"),
        (b"Kaydara FBX Binary  \0", "FBX"),
        (b"PK\x03\x04\x14\0", "ZIP"),
        (b"\x1f\x8b\x08\0", "gzip"),
        (b"<?xml version=\"1.0\"?><COLLADA>", "XML"),
        (b"\n<!DOCTYPE html><title>Log in", "web page"),
        (b"version https://git-lfs.github.com/spec/v1\n", "git lfs pull"),
        (b"\x89PNG\r\n\x1a\n", "PNG"),
        (b"\x64\x86\x02\0", "COFF"),
        (b"newmtl red\nKd 1 0 0\n", "MTL"),
        (b"\xff\xfe\0\0v\0\0\0", "UTF-32"),
        (b"\x13\x37\x07\xff\xfe\n\x01\x02", "no statement of OBJ"),
        (b"Dear Sir,\nI have no scene.\n", "no statement of OBJ"),
    ] {
        for name in ["a.obj", "a.glb", "a.xyz"] {
            let fault = Case::new(&[(name, content)]).try_load(name, None).unwrap_err().to_string();
            let told = said != "no statement of OBJ";
            assert!(
                fault.contains(name) && (fault.contains(said) || !told && name != "a.obj"),
                "{fault}"
            );
        }
    }
}
