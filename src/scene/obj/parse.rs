//! The statements of an OBJ file.
//!
//! No crate reads them, because the existing crates drop texture coordinates or normals that only some corners
//! have, cut concave polygons into fans and cannot name the line of a fault.

mod elements;

use super::{
    colors,
    text::{Statements, number, number_words, shown, split_word},
};
use crate::state::Topology;
use elements::{FACE, LINE, POINT};
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// A corner without a texture coordinate or normal has this in its place.
pub(super) const NONE: u32 = u32::MAX;

/// A corner of a polygon, a vertex of a polyline or a point: numbers of position, texture coordinate and normal.
pub(super) type Corner = [u32; 3];

/// Whether and with which others the faces of a group are smoothed when they have no normals.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub(super) enum Smoothing {
    /// The file does not say: by angle.
    #[default]
    Unsaid,
    /// `s off`
    Off,
    /// `s n`
    Group(u32),
}

/// Polygons, polylines or points that become one mesh.
#[derive(Debug, Default)]
pub(super) struct Group {
    /// What they become.
    pub topology: Topology,
    /// Number in [`Obj::materials`], [`NONE`] without.
    pub material: u32,
    pub smoothing: Smoothing,
    pub corners: Vec<Corner>,
    /// Corners of each statement: at least 3 of a polygon, 2 of a polyline and 1 of points.
    pub arities: Vec<u32>,
}

/// A parsed file.
#[derive(Debug, Default)]
pub(super) struct Obj {
    pub positions: Vec<DVec3>,
    /// Linear, as many as positions, or empty.
    pub colors: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    /// Of length 1, or zero where the file has no usable one.
    pub normals: Vec<Vec3>,
    pub groups: Vec<Group>,
    /// Names after `usemtl`.
    pub materials: Vec<Vec<u8>>,
    /// The texts after `mtllib`, each once.
    pub libraries: Vec<Vec<u8>>,
    pub warnings: Vec<String>,
}

/// Statements that change no picture, and such as are only counted.
const WITHOUT_EFFECT: [&[u8]; 24] = [
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"shadow_obj",
    b"trace_obj",
    b"mg",
    b"maplib",
    b"usemap",
    b"vp",
    b"vw",
    b"deg",
    b"bmat",
    b"step",
    b"cstype",
    b"ctech",
    b"stech",
    b"parm",
    b"trim",
    b"hole",
    b"scrv",
    b"sp",
    b"end",
    b"con",
];

fn is_keyword(word: &[u8]) -> bool {
    let drawn: [&[u8]; 16] = [
        b"v", b"vt", b"vn", b"f", b"fo", b"p", b"l", b"o", b"g", b"s", b"usemtl", b"mtllib",
        b"curv", b"curv2", b"surf", b"call",
    ];
    drawn.contains(&word) || WITHOUT_EFFECT.contains(&word)
}

/// Whether `text` begins like an OBJ: with statements of its own, a vertex among them.
pub(super) fn looks_like_obj(text: &[u8]) -> bool {
    let head = &text[..text.len().min(1 << 16)];
    let statements = Statements::new(head, is_keyword).map(|(_, line)| line);
    let mut own = statements.take_while(|line| is_keyword(split_word(line).0));
    own.any(|line| {
        let (keyword, rest) = split_word(&line);
        keyword == b"v" && number_words(rest).filter_map(number).count() >= 3
    })
}

/// Parses `text`; a fault names its line.
pub(super) fn parse(text: &[u8]) -> Result<Obj, String> {
    let mut parser = Parser { material: NONE, ..Parser::default() };
    for (number, line) in Statements::new(text, is_keyword) {
        parser.number = number;
        parser.statement(&line).map_err(|e| format!("line {number}: {e}"))?;
    }
    if parser.known == 0
        && let Some((number, line)) = parser.unknown
    {
        return Err(format!("line {number}, `{line}`, is no statement of OBJ, nor is any other"));
    }
    parser.resolve_later()?;
    let mut obj = parser.obj;
    obj.colors = colors::linear(&parser.colors, text, obj.positions.len());
    let mut warn = |count: usize, what: &str| {
        if count > 0 {
            obj.warnings.push(format!("{count} {what}"));
        }
    };
    warn(
        parser.skipped,
        "faces of fewer than 3 vertices, lines of fewer than 2 or points without any are not drawn",
    );
    warn(parser.dangling, "texture coordinates or normals do not exist and are left out");
    if parser.curves {
        obj.warnings.push("curves and free-form surfaces are not drawn".into());
    }
    if let Some((number, line)) = parser.unknown {
        obj.warnings.push(format!(
            "line {number}, `{line}`, is no statement of OBJ; it and others like it are left out"
        ));
    }
    Ok(obj)
}

#[derive(Default)]
struct Parser {
    obj: Obj,
    /// Line of the statement.
    number: usize,
    /// As the file has them; vertices before the first that has one are white.
    colors: Vec<[f32; 3]>,
    /// Counts `o` and `g` statements.
    object: u32,
    material: u32,
    smoothing: Smoothing,
    groups: HashMap<(u32, u32, Smoothing, Topology), usize>,
    /// Number of the group that the last element is in, until a statement changes that.
    group: Option<(Topology, usize)>,
    materials: HashMap<Vec<u8>, u32>,
    libraries: HashMap<Vec<u8>, ()>,
    /// Largest vertex number that was not yet there when an element referred to it, the statement's line, and
    /// the element's name.
    latest: Option<(i64, usize, &'static str)>,
    /// Whether the same was so for a texture coordinate or a normal.
    late: bool,
    skipped: usize,
    /// Corners whose texture coordinate or normal does not exist.
    dangling: usize,
    curves: bool,
    known: usize,
    /// The first statement that is none of OBJ, and its line.
    unknown: Option<(usize, String)>,
}

impl Parser {
    fn statement(&mut self, line: &[u8]) -> Result<(), String> {
        let (keyword, rest) = split_word(line);
        self.known += 1;
        match keyword {
            b"v" => self.vertex(rest)?,
            b"vt" => {
                let [u, v, _] = three(rest).map(|v| if v.is_finite() { v } else { 0.0 });
                // OBJ measures v upwards, textures here are measured downwards.
                self.obj.uvs.push(Vec2::new(u as f32, (1.0 - v) as f32));
            }
            b"vn" => {
                let normal = DVec3::from_array(three(rest)).normalize_or_zero();
                self.obj.normals.push(normal.as_vec3());
            }
            b"f" | b"fo" => self.element(FACE, rest)?,
            b"l" => self.element(LINE, rest)?,
            b"p" => self.element(POINT, rest)?,
            b"curv" | b"curv2" | b"surf" => self.curves = true,
            b"o" | b"g" => {
                self.object += 1;
                self.group = None;
            }
            b"s" => {
                self.smoothing = match number_words(rest).next() {
                    Some(b"off" | b"0") => Smoothing::Off,
                    word => {
                        let word = word.and_then(|word| std::str::from_utf8(word).ok());
                        let number = word.and_then(|word| word.parse().ok());
                        number.map_or(Smoothing::Unsaid, Smoothing::Group)
                    }
                };
                self.group = None;
            }
            b"usemtl" => {
                self.material = self.material(rest);
                self.group = None;
            }
            b"mtllib" => {
                if self.libraries.insert(rest.to_vec(), ()).is_none() {
                    self.obj.libraries.push(rest.to_vec());
                }
            }
            _ if WITHOUT_EFFECT.contains(&keyword) => {}
            _ => {
                self.known -= 1;
                let lower = keyword.to_ascii_lowercase();
                if lower != keyword && is_keyword(&lower) {
                    return self.statement(&[&lower, &b" "[..], rest].concat());
                }
                self.unknown.get_or_insert_with(|| (self.number, shown(line)));
            }
        }
        Ok(())
    }

    /// `x y z`, with a weight or a colour, or both; a colour may have an alpha.
    fn vertex(&mut self, rest: &[u8]) -> Result<(), String> {
        let mut v = [0.0; 8];
        let mut n = 0;
        for word in number_words(rest).take(v.len()) {
            let Some(value) = number(word) else {
                if n < 3 {
                    return Err(format!("`{}` is no number", shown(word)));
                }
                break;
            };
            v[n] = value;
            n += 1;
        }
        if n < 3 {
            return Err(format!("a vertex has {n} numbers, 3 are needed"));
        }
        let (weight, color) = match n {
            4 => (v[3], None),
            // Seven have an alpha rather than a weight: only points of curves have weights.
            6 | 7 => (1.0, Some([v[3], v[4], v[5]])),
            8 => (v[3], Some([v[4], v[5], v[6]])),
            _ => (1.0, None),
        };
        let obj = &mut self.obj;
        if let Some(color) = color {
            self.colors.resize(obj.positions.len(), [f32::NAN; 3]);
            self.colors.push(color.map(|v| v as f32));
        }
        let weight = if weight == 0.0 { 1.0 } else { weight };
        obj.positions.push(DVec3::new(v[0], v[1], v[2]) / weight);
        Ok(())
    }

    /// The number of the material that elements have after `usemtl name`.
    fn material(&mut self, name: &[u8]) -> u32 {
        // Without a name, or with one of those that exporters write instead, there is none.
        if matches!(name, b"" | b"(null)") {
            return NONE;
        }
        if let Some(&number) = self.materials.get(name) {
            return number;
        }
        let number = self.obj.materials.len() as u32;
        self.obj.materials.push(name.to_vec());
        self.materials.insert(name.to_vec(), number);
        number
    }
}

/// Up to three numbers; those that are missing are 0.
fn three(text: &[u8]) -> [f64; 3] {
    let mut values = [0.0; 3];
    let words = number_words(text).map_while(number);
    values.iter_mut().zip(words).for_each(|(slot, value)| *slot = value);
    values
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Obj {
        parse(text.as_bytes()).unwrap_or_else(|e| panic!("{text:?}: {e}"))
    }

    #[test]
    fn relative_and_partial_corners() {
        let obj = read("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt .5 .25\nf -3/1 2 3//\n");
        assert_eq!(obj.groups[0].corners, [[0, 0, NONE], [1, NONE, NONE], [2, NONE, NONE]]);
        assert_eq!(obj.uvs, [Vec2::new(0.5, 0.75)]);
    }

    #[test]
    fn faces_may_come_before_their_vertices() {
        let obj = read("f 1/1/1 2/2/1 3/9/1\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvn 0 0 1");
        assert_eq!(obj.groups[0].corners, [[0, 0, 0], [1, 1, 0], [2, NONE, 0]]);
        assert_eq!(obj.warnings.len(), 1, "{:?}", obj.warnings);
    }

    #[test]
    fn faults_name_their_line() {
        for (text, want) in [
            ("v 0 0 0\nf 1 1 2\n", "line 2: a face refers to vertex 2, but there are 1"),
            ("v 0 0 0\nf 1 1 9999999999\nf 1 1 3", "line 2: a face refers to vertex 9999999999"),
            ("v 0 0 0\n\nf 0 1 1", "line 3: a face refers to vertex 0"),
            ("v 1 2\n", "line 1: a vertex has 2 numbers"),
            ("v 1 2 x\n", "line 1: `x` is no number"),
            ("v 0 0 0\rf 1 x 1", "line 2: `x` is no vertex of a face"),
            ("v 0 0 0\nl 0 1", "line 2: a line refers to vertex 0, but there are 1 so far"),
            ("v 0 0 0\nl 1 -2", "line 2: a line refers to vertex -2, but there are 1 so far"),
            ("l 1 2\nv 0 0 0", "line 1: a line refers to vertex 2, but there are 1"),
            ("v 0 0 0\np 1 2", "line 2: a point refers to vertex 2, but there are 1"),
            ("v 0 0 0\np 1 0", "line 2: a point refers to vertex 0"),
            ("v 0 0 0\np 1 x", "line 2: `x` is no vertex of a point"),
            ("v 0 0 0\nl 1 /1", "line 2: `/1` has no vertex"),
            ("v 0 0 0\nf \\\n1 1 \\\n-2", "line 4: a face refers to vertex -2"),
            ("\nHello\nv", "line 3: a vertex has 0 numbers"),
            ("\nHello\nworld", "line 2, `Hello`, is no statement"),
        ] {
            let fault = parse(text.as_bytes()).expect_err(text);
            assert!(fault.starts_with(want), "{text:?} gives {fault:?}");
        }
    }

    #[test]
    fn groups_split_by_object_material_and_smoothing() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nusemtl a\nf 1 2 3\nf 1 2 3\ns off\nf 1 2 3\n\
                    g other\nf 1 2 3\nf 1 2\ns 3\nusemtl b c\nf 3 2 1\nusemtl\nf 1 2 3\n";
        let obj = read(text);
        let sizes: Vec<_> = obj.groups.iter().map(|g| g.arities.len()).collect();
        assert_eq!(sizes, [1, 2, 1, 1, 1, 1]);
        assert_eq!(obj.materials, [&b"a"[..], b"b c"]);
        assert_eq!(obj.groups[4].smoothing, Smoothing::Group(3));
        assert_eq!(obj.groups[5].material, NONE, "`usemtl` without a name ends the material");
        assert_eq!(obj.warnings.len(), 1);
    }

    #[test]
    fn lines_and_points_are_groups_of_their_own() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nl 1/1 2/7 -1\ns 1\np 1 2\nL 1 3\nf 1 2 3\np -1\n\
                    l 1\np\nusemtl a\nl 1 2\no b\nl 2 3\n";
        let obj = read(text);
        let groups: Vec<_> = obj.groups.iter().map(|g| (g.topology, &g.arities[..])).collect();
        let (line, point) = (LINE.topology, POINT.topology);
        let (one, lines) = ((line, &[2][..]), (line, &[3, 2][..]));
        let found = [lines, (point, &[2, 1][..]), (FACE.topology, &[3][..]), one, one];
        assert_eq!(groups, found);
        assert_eq!(obj.groups[0].corners[..3], [[0, 0, NONE], [1, NONE, NONE], [2, NONE, NONE]]);
        assert_eq!(obj.groups[1].corners.iter().map(|c| c[0]).collect::<Vec<_>>(), [0, 1, 2]);
        assert_eq!((obj.groups[3].material, obj.groups[4].material), (0, 0));
        assert!(obj.warnings[0].starts_with("2 faces of fewer than 3"), "{:?}", obj.warnings);
        assert!(obj.warnings[1].starts_with("1 texture coordinates"), "{:?}", obj.warnings);
    }

    #[test]
    fn weights_and_colours_after_positions() {
        let obj = read("v 2 4 6 2\nv 1 2 3 0 1 1\nv 0 0 0 1 0 0 0.5\nv 1 1 1 1 0 0 1 1\nv 0 0 0");
        assert_eq!(obj.positions[0], DVec3::new(1.0, 2.0, 3.0));
        assert_eq!(obj.colors, [Vec3::ONE, Vec3::new(0., 1., 1.), Vec3::X, Vec3::Z, Vec3::ONE]);
    }

    #[test]
    fn comments_capitals_and_what_is_passed_over() {
        let text = "V 0 0 0 # a\nv 1 0 0#b\nv 0 1 0\nvp 0 1\nvn 0 0 0\nvn 1.#IND 0 0 # c\nvn 0 0 9\n\
                    cstype bezier\ns 1 # d\nF 1//1 2//2 3//3 # e\\\nfrobnicate 1\nend\n";
        let obj = read(text);
        assert_eq!(obj.normals, [Vec3::ZERO, Vec3::ZERO, Vec3::Z]);
        assert_eq!(obj.groups[0].arities, [3]);
        assert_eq!(obj.groups[0].smoothing, Smoothing::Group(1));
        assert_eq!(obj.warnings.len(), 1, "{:?}", obj.warnings);
        assert!(obj.warnings[0].contains("line 11, `frobnicate 1`"), "{:?}", obj.warnings);
    }

    #[test]
    fn what_looks_like_an_obj() {
        assert!(looks_like_obj(b"# x\nmtllib a\r\ng\nv 1 2 3\n"));
        assert!(
            !looks_like_obj(b"v. hello")
                && !looks_like_obj(b"")
                && !looks_like_obj(b"g a\nx\nv 1 2 3")
        );
    }
}
