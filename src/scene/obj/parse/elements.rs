//! Faces, polylines and points: the statements that draw something.

use super::{Group, NONE, Parser, Smoothing, number_words, shown};
use crate::state::Topology;

/// What the vertices of a statement become.
#[derive(Clone, Copy)]
pub(super) struct Element {
    /// As messages call it.
    name: &'static str,
    pub topology: Topology,
    /// It has so many vertices at least.
    least: usize,
}

pub(super) const FACE: Element =
    Element { name: "face", topology: Topology::TriangleList, least: 3 };
pub(super) const LINE: Element = Element { name: "line", topology: Topology::LineList, least: 2 };
pub(super) const POINT: Element =
    Element { name: "point", topology: Topology::PointList, least: 1 };

impl Parser {
    /// The number of the group for elements of `topology`.
    fn group(&mut self, topology: Topology) -> usize {
        if let Some((known, index)) = self.group
            && known == topology
        {
            return index;
        }
        let material = self.material;
        // Only faces are smoothed.
        let smoothing =
            if topology == FACE.topology { self.smoothing } else { Smoothing::default() };
        let groups = &mut self.obj.groups;
        let key = (self.object, material, smoothing, topology);
        let index = *self.groups.entry(key).or_insert_with(|| {
            groups.push(Group { topology, material, smoothing, ..Group::default() });
            groups.len() - 1
        });
        self.group = Some((topology, index));
        index
    }

    /// Adds the element that `rest` has the vertices of.
    pub(super) fn element(&mut self, element: Element, rest: &[u8]) -> Result<(), String> {
        let name = element.name;
        let index = self.group(element.topology);
        let obj = &mut self.obj;
        let counts = [obj.positions.len(), obj.uvs.len(), obj.normals.len()].map(|n| n as i64);
        let group = &mut obj.groups[index];
        let before = group.corners.len();
        for word in number_words(rest) {
            let mut corner = [NONE; 3];
            let texts = word.split(|&b| b == b'/');
            for (i, (slot, text)) in corner.iter_mut().zip(texts).enumerate() {
                if text.is_empty() {
                    continue;
                }
                let number = integer(text)
                    .ok_or_else(|| format!("`{}` is no vertex of a {name}", shown(word)))?;
                let found = if number > 0 { number - 1 } else { counts[i] + number };
                if number == 0 || found < 0 {
                    // Files that name texture coordinates or normals that they lack are common.
                    self.dangling += usize::from(i > 0);
                    if i == 0 {
                        return Err(format!(
                            "a {name} refers to vertex {number}, but there are {} so far",
                            counts[i]
                        ));
                    }
                    continue;
                }
                if found >= counts[i] {
                    self.late |= i > 0;
                    if i == 0 && self.latest.is_none_or(|(latest, ..)| latest < number) {
                        self.latest = Some((number, self.number, name));
                    }
                }
                *slot = found.min(i64::from(NONE - 1)) as u32;
            }
            if corner[0] == NONE {
                return Err(format!("`{}` has no vertex", shown(word)));
            }
            group.corners.push(corner);
        }
        let arity = group.corners.len() - before;
        if arity < element.least {
            group.corners.truncate(before);
            self.skipped += 1;
        } else {
            group.arities.push(arity as u32);
        }
        Ok(())
    }

    /// Some files have their elements before their vertices, so that numbers can be checked only at the
    /// end.
    pub(super) fn resolve_later(&mut self) -> Result<(), String> {
        let obj = &mut self.obj;
        let count = obj.positions.len();
        if let Some((number, line, name)) = self.latest
            && number > count as i64
        {
            return Err(format!(
                "line {line}: a {name} refers to vertex {number}, but there are {count}"
            ));
        }
        if self.late {
            let counts = [count, obj.uvs.len(), obj.normals.len()];
            for corner in obj.groups.iter_mut().flat_map(|group| &mut group.corners) {
                for (slot, count) in corner.iter_mut().zip(counts) {
                    if *slot != NONE && *slot as usize >= count {
                        *slot = NONE;
                        self.dangling += 1;
                    }
                }
            }
        }
        // A file whose elements have too few vertices has groups without any.
        obj.groups.retain(|group| !group.arities.is_empty());
        Ok(())
    }
}

/// A whole number. Some exporters write it as `4.0`.
fn integer(text: &[u8]) -> Option<i64> {
    let text = std::str::from_utf8(text).ok()?;
    let whole = |v: &f64| v.fract() == 0.0 && v.abs() < 1e15;
    text.parse().ok().or_else(|| text.parse().ok().filter(whole).map(|v| v as i64))
}
