//! The statements of an OBJ file.
//!
//! Read here and not by a crate: those at hand drop texture coordinates or normals that only some
//! corners have, cut concave polygons into fans and cannot say which line is at fault.

use glam::{Vec2, Vec3};
use std::collections::HashMap;

/// A corner without a texture coordinate or normal has this in its place.
pub(super) const NONE: u32 = u32::MAX;

/// A corner of a polygon: numbers of position, texture coordinate and normal.
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

/// Polygons that become one mesh.
#[derive(Debug, Default)]
pub(super) struct Group {
    /// Number in [`Obj::materials`], [`NONE`] without.
    pub material: u32,
    pub smoothing: Smoothing,
    pub corners: Vec<Corner>,
    /// Corners of each polygon, at least 3.
    pub arities: Vec<u32>,
}

/// A parsed file.
#[derive(Debug, Default)]
pub(super) struct Obj {
    pub positions: Vec<Vec3>,
    /// As many as positions, or empty.
    pub colors: Vec<Vec3>,
    pub uvs: Vec<Vec2>,
    pub normals: Vec<Vec3>,
    pub groups: Vec<Group>,
    /// Names after `usemtl`.
    pub materials: Vec<String>,
    /// Names after `mtllib`.
    pub libraries: Vec<String>,
    pub warnings: Vec<String>,
}

/// Parses `text`; a fault names its line.
pub(super) fn parse(text: &str) -> Result<Obj, String> {
    let mut parser = Parser { material: NONE, ..Parser::default() };
    for (number, line) in (Lines { text, number: 0 }) {
        parser.line(&line).map_err(|e| format!("line {number}: {e}"))?;
    }
    let mut obj = parser.obj;
    if !obj.colors.is_empty() {
        obj.colors.resize(obj.positions.len(), Vec3::ONE);
    }
    if parser.skipped > 0 {
        obj.warnings.push(format!(
            "{} points, lines or faces of fewer than 3 corners are not drawn",
            parser.skipped
        ));
    }
    if parser.dangling > 0 {
        obj.warnings.push(format!(
            "{} texture coordinates or normals of faces do not exist and are left out",
            parser.dangling
        ));
    }
    if parser.curves {
        obj.warnings.push("curves and free-form surfaces are not drawn".into());
    }
    Ok(obj)
}

/// Lines without comments, those that end in a backslash joined with the next.
struct Lines<'a> {
    text: &'a str,
    number: usize,
}

impl<'a> Iterator for Lines<'a> {
    type Item = (usize, std::borrow::Cow<'a, str>);

    fn next(&mut self) -> Option<Self::Item> {
        let mut take = || {
            let end = self.text.find('\n');
            let line = &self.text[..end.unwrap_or(self.text.len())];
            self.text = end.map_or("", |end| &self.text[end + 1..]);
            self.number += 1;
            line.trim()
        };
        let line = take();
        let Some(mut head) = line.strip_suffix('\\') else {
            let done = line.is_empty() && self.text.is_empty();
            return (!done).then_some((self.number, line.into()));
        };
        let mut joined = String::new();
        loop {
            joined.push_str(head);
            joined.push(' ');
            let next = take();
            match next.strip_suffix('\\') {
                Some(next) if !next.is_empty() => head = next,
                _ => {
                    joined.push_str(next);
                    return Some((self.number, joined.into()));
                }
            }
        }
    }
}

#[derive(Default)]
struct Parser {
    obj: Obj,
    /// Counts `o` and `g` statements.
    object: u32,
    material: u32,
    smoothing: Smoothing,
    groups: HashMap<(u32, u32, Smoothing), usize>,
    names: HashMap<String, u32>,
    skipped: usize,
    /// Corners whose texture coordinate or normal does not exist.
    dangling: usize,
    curves: bool,
}

impl Parser {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        let obj = &mut self.obj;
        match keyword {
            "v" => {
                let mut v = [0.0; 8];
                let n = floats(rest, &mut v);
                if n < 3 {
                    return Err(format!("a vertex has {n} numbers, 3 are needed"));
                }
                // A fourth number alone is a weight, six are a colour after the position.
                let weight = if n == 4 && v[3] != 0.0 { v[3] } else { 1.0 };
                if n >= 6 {
                    obj.colors.resize(obj.positions.len(), Vec3::ONE);
                    obj.colors.push(Vec3::new(v[n - 3], v[n - 2], v[n - 1]));
                }
                obj.positions.push(Vec3::new(v[0], v[1], v[2]) / weight);
            }
            "vt" => {
                let mut v = [0.0; 3];
                floats(rest, &mut v);
                // OBJ measures v upwards, textures here are measured downwards.
                obj.uvs.push(Vec2::new(v[0], 1.0 - v[1]));
            }
            "vn" => {
                let mut v = [0.0; 3];
                floats(rest, &mut v);
                obj.normals.push(Vec3::from_array(v));
            }
            "f" | "fo" => self.face(rest)?,
            "p" | "l" => self.skipped += 1,
            "curv" | "curv2" | "surf" => self.curves = true,
            "o" | "g" => self.object += 1,
            "s" => {
                self.smoothing = match rest {
                    "off" | "0" => Smoothing::Off,
                    number => number.parse().map_or(Smoothing::Unsaid, Smoothing::Group),
                }
            }
            "usemtl" => {
                let next = obj.materials.len() as u32;
                self.material = *self.names.entry(rest.to_owned()).or_insert(next);
                if self.material == next {
                    obj.materials.push(rest.to_owned());
                }
            }
            "mtllib" => obj.libraries.push(rest.to_owned()),
            _ => {}
        }
        Ok(())
    }

    fn face(&mut self, rest: &str) -> Result<(), String> {
        let key = (self.object, self.material, self.smoothing);
        let obj = &mut self.obj;
        let groups = &mut obj.groups;
        let index = *self.groups.entry(key).or_insert_with(|| {
            let (material, smoothing) = (self.material, self.smoothing);
            groups.push(Group { material, smoothing, ..Group::default() });
            groups.len() - 1
        });
        let counts = [obj.positions.len(), obj.uvs.len(), obj.normals.len()];
        let group = &mut obj.groups[index];
        let before = group.corners.len();
        for word in rest.split_whitespace() {
            let mut corner = [NONE; 3];
            for (i, (slot, text)) in corner.iter_mut().zip(word.split('/')).enumerate() {
                if text.is_empty() {
                    continue;
                }
                let bad = || format!("`{word}` is no corner of a face");
                let number: i64 = text.parse().map_err(|_| bad())?;
                let found = match number {
                    1.. => number - 1,
                    _ => counts[i] as i64 + number,
                };
                let exists = number != 0 && found >= 0 && found < counts[i] as i64;
                if !exists && i == 0 {
                    return Err(format!(
                        "a face refers to vertex {number}, but there are {} so far",
                        counts[i]
                    ));
                }
                // Files that name texture coordinates or normals that they lack are common.
                self.dangling += usize::from(!exists);
                *slot = if exists { found as u32 } else { NONE };
            }
            if corner[0] == NONE {
                return Err(format!("`{word}` has no vertex"));
            }
            group.corners.push(corner);
        }
        let arity = group.corners.len() - before;
        if arity < 3 {
            group.corners.truncate(before);
            self.skipped += 1;
        } else {
            group.arities.push(arity as u32);
        }
        Ok(())
    }
}

/// Reads numbers into `out` until one is none; how many.
pub(super) fn floats(text: &str, out: &mut [f32]) -> usize {
    let words = text.split_whitespace().map_while(|word| word.parse::<f32>().ok());
    out.iter_mut().zip(words).map(|(slot, value)| *slot = value).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn relative_and_partial_corners() {
        let obj = parse("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt .5 .25\nf -3/1 2 3//\n").unwrap();
        assert_eq!(obj.groups[0].corners, [[0, 0, NONE], [1, NONE, NONE], [2, NONE, NONE]]);
        assert_eq!(obj.uvs, [Vec2::new(0.5, 0.75)]);
    }

    #[test]
    fn faults_name_their_line() {
        for (text, want) in [
            ("v 0 0 0\nf 1 1 2\n", "line 2: a face refers to vertex 2"),
            ("v 0 0 0\n\nf 0 1 1", "line 3: a face refers to vertex 0"),
            ("v 1 2\n", "line 1: a vertex has 2 numbers"),
            ("v 0 0 0\nf 1 x 1", "line 2: `x` is no corner"),
            ("v 0 0 0\nf \\\n1 1 \\\n-2", "line 4: a face refers to vertex -2"),
        ] {
            let fault = parse(text).expect_err(text);
            assert!(fault.starts_with(want), "{text:?} gives {fault:?}");
        }
    }

    #[test]
    fn groups_split_by_object_material_and_smoothing() {
        let text = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\nusemtl a\nf 1 2 3\nf 1 2 3\ns off\nf 1 2 3\n\
                    g other\nf 1 2 3\nf 1 2\ns 3\nusemtl b c\nf 3 2 1\n";
        let obj = parse(text).unwrap();
        let sizes: Vec<_> = obj.groups.iter().map(|g| g.arities.len()).collect();
        assert_eq!(sizes, [1, 2, 1, 1, 1]);
        assert_eq!(obj.materials, ["a", "b c"]);
        assert_eq!(obj.groups[4].smoothing, Smoothing::Group(3));
        assert_eq!(obj.warnings.len(), 1);
    }

    #[test]
    fn weights_and_colours_after_positions() {
        let obj = parse("v 2 4 6 2\nv 1 2 3 0.5 0.25 1\nv 0 0 0").unwrap();
        assert_eq!(obj.positions[0], Vec3::new(1.0, 2.0, 3.0));
        assert_eq!(obj.colors, [Vec3::ONE, Vec3::new(0.5, 0.25, 1.0), Vec3::ONE]);
    }
}
