//! Triangles, lines and points that are still being worked on. Loaders and built-in shapes produce them.
//!
//! A [`Mesh`] becomes a [`Part`](super::build::Part) later. Missing normals and tangents are made here, so that
//! shaders never have to guess.

use super::{anchor::Anchor, bounds::Bounds, hash::BitMap};
use crate::state::Topology;
use bevy_mikktspace::{Geometry, TangentSpace, generate_tangents};
use glam::{DVec3, Vec2, Vec3, Vec4};

/// Vertices and indices in one canonical form.
#[derive(Clone, Debug, Default)]
pub(super) struct Mesh {
    pub topology: Topology,
    /// Where the positions lie in the mesh's space.
    pub anchor: Anchor,
    pub positions: Vec<Vec3>,
    /// As many as positions, or empty.
    pub normals: Vec<Vec3>,
    /// As many as positions, or empty; w is the handedness of the bitangent.
    pub tangents: Vec<Vec4>,
    /// Two sets, each as many as positions, or empty.
    pub uvs: [Vec<Vec2>; 2],
    /// As many as positions, or empty; linear.
    pub colors: Vec<Vec4>,
    /// `None` draws the vertices in order.
    pub indices: Option<Vec<u32>>,
}

/// How [`Mesh::complete_normals`] makes normals.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Normals {
    /// Each triangle has its own.
    Flat,
    /// Faces at one position that are within `crease` (the cosine of an angle) of each other are smoothed:
    /// round things look round and edges stay.
    Smooth { crease: f32 },
}

impl Normals {
    /// All faces within a little over a right angle are smoothed. Two layers that lie on each other and face
    /// opposite ways, such as a leaf's, are not: their sum is no normal. Right angles are the most common ones;
    /// on which side of the limit one of them lies must not depend on how it rounds.
    pub const SMOOTH: Self = Self::Smooth { crease: -0.01 };
}

impl Mesh {
    /// In the mesh's space.
    pub fn bounds(&self) -> Bounds {
        Bounds::of(self.positions.iter().map(|&p| self.anchor.place(p)))
    }

    /// Takes `positions`, which are in the mesh's space, around an anchor that suits them.
    pub fn set_positions(&mut self, positions: &[DVec3]) {
        self.anchor = Anchor::of(&Bounds::of(positions.iter().copied()));
        self.positions = positions.iter().map(|&p| self.anchor.store(p)).collect();
    }

    /// Stores the positions around an anchor that suits them. Normals and tangents are made after
    /// this: in single precision they get lost for very small and very large meshes.
    pub fn settle(&mut self) {
        let anchor = Anchor::of(&self.bounds());
        if anchor != self.anchor {
            for p in &mut self.positions {
                *p = anchor.store(self.anchor.place(*p));
            }
            self.anchor = anchor;
        }
    }

    /// The corners of all triangles as vertex numbers (of points and lines, triangles without area), in the winding that the topology gives.
    /// Indices must be in range.
    pub fn triangles(&self) -> Vec<[u32; 3]> {
        let count = self.indices.as_ref().map_or(self.positions.len(), Vec::len);
        let at = |i: usize| self.indices.as_ref().map_or(i as u32, |indices| indices[i]);
        (0..self.topology.primitives(count as u32) as usize)
            .map(|i| match self.topology {
                Topology::TriangleList => [at(3 * i), at(3 * i + 1), at(3 * i + 2)],
                // Every other triangle of a strip has its first two vertices swapped.
                Topology::TriangleStrip => [at(i), at(i + 1 + i % 2), at(i + 2 - i % 2)],
                Topology::TriangleFan => [at(i + 1), at(i + 2), at(0)],
                Topology::TriangleListWithAdjacency => [at(6 * i), at(6 * i + 2), at(6 * i + 4)],
                Topology::TriangleStripWithAdjacency => {
                    [2 * i, 2 * (i + 1 + i % 2), 2 * (i + 2 - i % 2)].map(at)
                }
                Topology::PointList | Topology::LineList | Topology::LineStrip => [at(i); 3],
                Topology::LineListWithAdjacency | Topology::LineStripWithAdjacency => [at(i); 3],
            })
            .collect()
    }

    /// Makes a line strip end where it begins.
    pub fn close(&mut self) {
        let all = 0..self.positions.len() as u32;
        let indices = self.indices.get_or_insert_with(|| all.collect());
        if let Some(&first) = indices.first() {
            indices.push(first);
        }
    }

    /// Turns the mesh into a triangle list in which no two triangles share a vertex.
    pub fn unshare(&mut self) {
        let order: Vec<u32> = self.triangles().into_iter().flatten().collect();
        self.reorder(&order);
        self.indices = None;
        self.topology = Topology::TriangleList;
    }

    /// Vertex `i` becomes the old vertex `order[i]`.
    fn reorder(&mut self, order: &[u32]) {
        fn pick<T: Copy>(values: &mut Vec<T>, order: &[u32]) {
            if !values.is_empty() {
                *values = order.iter().map(|&i| values[i as usize]).collect();
            }
        }
        pick(&mut self.positions, order);
        pick(&mut self.normals, order);
        pick(&mut self.tangents, order);
        self.uvs.iter_mut().for_each(|uv| pick(uv, order));
        pick(&mut self.colors, order);
    }

    /// Gives the corners that have no usable normal one that is made from the faces. If all have one, nothing
    /// changes. In a `flipped` mesh the front of a triangle is the other side.
    pub fn complete_normals(&mut self, how: Normals, flipped: bool) {
        if self.has_usable_normals() {
            return;
        }
        if !self.normals.iter().any(is_usable) {
            // Tangents belong to the normals.
            self.tangents.clear();
            self.normals = vec![Vec3::ZERO; self.positions.len()];
        }
        let made = match how {
            Normals::Flat => self.flat_normals(),
            Normals::Smooth { crease } => self.smooth_normals(crease),
        };
        let side = if flipped { -1.0 } else { 1.0 };
        self.unshare();
        for (normal, made) in self.normals.iter_mut().zip(made) {
            if !is_usable(normal) {
                *normal = made * side;
            }
        }
        if let Normals::Smooth { .. } = how {
            self.share();
        }
    }

    /// The normal of its triangle for each corner.
    ///
    /// Corners are copied, three per triangle. Derivatives in the fragment shader would save that,
    /// but they lose their digits on slivers and small triangles, where two executors then differ.
    fn flat_normals(&self) -> Vec<Vec3> {
        self.faces().iter().flat_map(|face| [unit(*face).unwrap_or(Vec3::Y); 3]).collect()
    }

    /// For each corner the mean normal of the faces around its position that are within `crease` of its own.
    fn smooth_normals(&self, crease: f32) -> Vec<Vec3> {
        let triangles = self.triangles();
        let places = self.places();
        let faces = self.faces();
        let units: Vec<Vec3> = faces.iter().map(|f| unit(*f).unwrap_or_default()).collect();
        // The corners at each place, one list after the other.
        let mut ends = vec![0; places.iter().map(|&p| p as usize + 1).max().unwrap_or(0) + 1];
        for corner in triangles.as_flattened() {
            ends[places[*corner as usize] as usize + 1] += 1;
        }
        for i in 1..ends.len() {
            ends[i] += ends[i - 1];
        }
        let mut next = ends.clone();
        let mut around = vec![0u32; triangles.len() * 3];
        for (i, corner) in triangles.as_flattened().iter().enumerate() {
            let slot = &mut next[places[*corner as usize] as usize];
            around[*slot] = i as u32;
            *slot += 1;
        }
        // Faces count by their angle at the corner, so that it does not matter which triangles a polygon
        // was cut into (Thürmer and Wüthrich 1998).
        let angles = self.angles();
        let part = |corner: usize| units[corner / 3].as_dvec3() * angles[corner];
        let normal = |(own, corner): (usize, &u32)| {
            let place = places[*corner as usize] as usize;
            let here = &around[ends[place]..ends[place + 1]];
            // A place with hundreds of faces is a fan's hub; a share of them is near enough, and
            // no file can ask for the square of its faces.
            let step = here.len().div_ceil(64).max(1);
            let near = |&i: &usize| i == own || units[i / 3].dot(units[own / 3]) >= crease;
            let sampled = here.iter().step_by(step).map(|&i| i as usize);
            // The sum goes round in one order for all corners, so that equal faces give equal bits.
            let sum: DVec3 = sampled.filter(near).map(part).sum();
            unit(sum).or(unit(part(own))).unwrap_or(Vec3::Y)
        };
        triangles.as_flattened().iter().enumerate().map(normal).collect()
    }

    /// Whether each vertex has a normal that points somewhere.
    pub fn has_usable_normals(&self) -> bool {
        self.normals.len() == self.positions.len() && self.normals.iter().all(is_usable)
    }

    /// The cross products of two edges of each triangle, in double precision: those of very small and
    /// very large triangles have a direction too.
    fn faces(&self) -> Vec<DVec3> {
        let position = |i: u32| self.positions[i as usize].as_dvec3();
        let face =
            |[a, b, c]: [u32; 3]| (position(b) - position(a)).cross(position(c) - position(a));
        self.triangles().into_iter().map(face).collect()
    }

    /// The angle at each corner of the triangles.
    fn angles(&self) -> Vec<f64> {
        let position = |i: u32| self.positions[i as usize].as_dvec3();
        let angle = |triangle: [u32; 3], i: usize| {
            let [at, next, last] = [i, i + 1, i + 2].map(|i| position(triangle[i % 3]));
            let (a, b) = (next - at, last - at);
            a.cross(b).length().atan2(a.dot(b))
        };
        self.triangles().into_iter().flat_map(|t| [0, 1, 2].map(|i| angle(t, i))).collect()
    }

    /// For each vertex the number of its position; equal positions have one number.
    fn places(&self) -> Vec<u32> {
        let mut seen: BitMap<[u32; 3], u32> =
            BitMap::with_capacity_and_hasher(self.positions.len(), Default::default());
        let mut place = |p: &Vec3| {
            let next = seen.len() as u32;
            // The sum makes 0 of -0, which is the same place.
            *seen.entry(p.to_array().map(|v| (v + 0.0).to_bits())).or_insert(next)
        };
        self.positions.iter().map(&mut place).collect()
    }

    /// Makes tangents with the algorithm that normal maps are baked with (MikkTSpace), for the
    /// texture coordinates of `uv_set`; then shares equal vertices again.
    pub fn make_tangents(&mut self, uv_set: usize) {
        if self.normals.is_empty() || self.uvs[uv_set].is_empty() {
            return;
        }
        // MikkTSpace walks the faces around a vertex by recursion: a hub of a whole mesh would end the
        // process. No surface with a normal map has one.
        let mut faces_at = vec![0u32; self.positions.len()];
        let places = self.places();
        for corner in self.triangles().as_flattened() {
            faces_at[places[*corner as usize] as usize] += 1;
        }
        if faces_at.into_iter().max().unwrap_or(0) > MAX_FACES_AT_A_VERTEX {
            self.tangents = self.normals.iter().map(|n| any_tangent(*n)).collect();
            return;
        }
        self.unshare();
        let mut corners = Corners {
            tangents: vec![Vec4::new(1.0, 0.0, 0.0, 1.0); self.positions.len()],
            uvs: &self.uvs[uv_set],
            mesh: self,
        };
        // The only fault it reports is a mesh without good triangles, for which any tangent does.
        let _ = generate_tangents(&mut corners);
        self.tangents = corners.tangents;
        self.share();
    }

    /// Merges vertices that are equal in every bit; the mesh is an unshared triangle list.
    fn share(&mut self) {
        let mut seen: BitMap<[u32; 18], u32> =
            BitMap::with_capacity_and_hasher(self.positions.len() / 3, Default::default());
        let (mut order, mut indices) = (Vec::new(), Vec::with_capacity(self.positions.len()));
        for i in 0..self.positions.len() {
            let next = order.len() as u32;
            let index = *seen.entry(self.bits(i)).or_insert(next);
            if index == next {
                order.push(i as u32);
            }
            indices.push(index);
        }
        self.reorder(&order);
        self.indices = Some(indices);
    }

    /// All of vertex `i`, comparable.
    fn bits(&self, i: usize) -> [u32; 18] {
        let mut bits = [0; 18];
        bits[0..3].copy_from_slice(&self.positions[i].to_array().map(f32::to_bits));
        if let Some(n) = self.normals.get(i) {
            bits[3..6].copy_from_slice(&n.to_array().map(f32::to_bits));
        }
        if let Some(t) = self.tangents.get(i) {
            bits[6..10].copy_from_slice(&t.to_array().map(f32::to_bits));
        }
        for (set, at) in [(0, 10), (1, 12)] {
            if let Some(uv) = self.uvs[set].get(i) {
                bits[at..at + 2].copy_from_slice(&uv.to_array().map(f32::to_bits));
            }
        }
        if let Some(c) = self.colors.get(i) {
            bits[14..18].copy_from_slice(&c.to_array().map(f32::to_bits));
        }
        bits
    }
}

/// Whether a normal points somewhere.
pub(super) fn is_usable(normal: &Vec3) -> bool {
    normal.length_squared().is_normal()
}

/// `v` with a length of 1; `None` if it has no direction.
fn unit(v: DVec3) -> Option<Vec3> {
    v.try_normalize().map(|v| v.as_vec3())
}

/// See [`Mesh::make_tangents`].
const MAX_FACES_AT_A_VERTEX: u32 = 2000;

/// Some tangent for a normal.
fn any_tangent(normal: Vec3) -> Vec4 {
    normal.try_normalize().map_or(Vec4::X, |n| n.any_orthonormal_vector().extend(1.0))
}

/// An unshared triangle list as MikkTSpace wants to see it.
struct Corners<'a> {
    mesh: &'a Mesh,
    uvs: &'a [Vec2],
    tangents: Vec<Vec4>,
}

impl Geometry for Corners<'_> {
    fn num_faces(&self) -> usize {
        self.mesh.positions.len() / 3
    }

    fn num_vertices_of_face(&self, _face: usize) -> usize {
        3
    }

    fn position(&self, face: usize, vert: usize) -> [f32; 3] {
        self.mesh.positions[face * 3 + vert].to_array()
    }

    fn normal(&self, face: usize, vert: usize) -> [f32; 3] {
        self.mesh.normals[face * 3 + vert].to_array()
    }

    fn tex_coord(&self, face: usize, vert: usize) -> [f32; 2] {
        self.uvs[face * 3 + vert].to_array()
    }

    fn set_tangent(&mut self, tangent: Option<TangentSpace>, face: usize, vert: usize) {
        if let Some(t) = tangent {
            let [x, y, z, w] = t.tangent_encoded();
            // MikkTSpace measures v upwards, glTF downwards.
            self.tangents[face * 3 + vert] = Vec4::new(x, y, z, -w);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn quad() -> Mesh {
        Mesh {
            positions: [(0., 0.), (1., 0.), (1., 1.), (0., 1.)]
                .map(|(x, y)| Vec3::new(x, y, 0.0))
                .to_vec(),
            uvs: [
                // v runs down, as in glTF.
                [(0., 1.), (1., 1.), (1., 0.), (0., 0.)].map(|(u, v)| Vec2::new(u, v)).to_vec(),
                Vec::new(),
            ],
            indices: Some(vec![0, 1, 2, 0, 2, 3]),
            ..Mesh::default()
        }
    }

    #[test]
    fn strips_and_fans_keep_their_winding() {
        let mut mesh = quad();
        mesh.topology = Topology::TriangleStrip;
        mesh.indices = Some(vec![0, 1, 3, 2]);
        assert_eq!(mesh.triangles(), [[0, 1, 3], [1, 2, 3]]);
        mesh.topology = Topology::TriangleFan;
        mesh.indices = None;
        assert_eq!(mesh.triangles(), [[1, 2, 0], [2, 3, 0]]);
        mesh.complete_normals(Normals::Flat, false);
        assert_eq!(mesh.normals, vec![Vec3::Z; 6]);
    }

    #[test]
    fn normals_without_a_direction_come_from_the_faces() {
        for flipped in [false, true] {
            let front = if flipped { Vec3::NEG_Z } else { Vec3::Z };
            let mut mesh = quad();
            mesh.normals = vec![Vec3::ZERO, Vec3::X, Vec3::NAN, Vec3::X];
            mesh.complete_normals(Normals::SMOOTH, flipped);
            assert_eq!(mesh.normals, [front, Vec3::X, front, Vec3::X]);
            mesh.normals = vec![Vec3::ZERO; 4];
            mesh.complete_normals(Normals::Flat, flipped);
            assert_eq!(mesh.normals, vec![front; 6]);
        }
    }

    #[test]
    fn small_and_large_meshes_get_normals_from_their_faces_too() {
        for size in [1e-20, 1e15] {
            let mut mesh = quad();
            mesh.positions.iter_mut().for_each(|p| *p *= size);
            mesh.normals = vec![Vec3::ZERO, Vec3::X, Vec3::NAN, Vec3::X];
            mesh.complete_normals(Normals::SMOOTH, false);
            assert_eq!(mesh.normals, [Vec3::Z, Vec3::X, Vec3::Z, Vec3::X]);
        }
    }

    #[test]
    fn tangents_point_along_u_and_bitangents_against_v() {
        let mut mesh = quad();
        mesh.normals = vec![Vec3::Z; 4];
        mesh.make_tangents(0);
        assert_eq!(mesh.positions.len(), 4, "equal corners are shared again");
        assert_eq!(mesh.triangles().len(), 2);
        for t in &mesh.tangents {
            // glTF: bitangent = cross(normal, tangent) * w points where v decreases (up).
            assert!(t.abs_diff_eq(Vec4::new(1.0, 0.0, 0.0, 1.0), 1e-6), "{t}");
        }
    }

    #[test]
    fn a_hub_of_many_faces_does_not_overflow_the_stack() {
        let count = 300_000;
        let rim = |i: u32| {
            let a = i as f32 / count as f32 * std::f32::consts::TAU;
            Vec3::new(a.cos(), a.sin(), 0.0)
        };
        let mut fan = Mesh {
            topology: Topology::TriangleFan,
            positions: std::iter::once(Vec3::ZERO).chain((0..=count).map(rim)).collect(),
            ..Mesh::default()
        };
        fan.normals = vec![Vec3::Z; fan.positions.len()];
        fan.uvs[0] = fan.positions.iter().map(|p| p.truncate()).collect();
        fan.make_tangents(0);
        assert_eq!(fan.tangents.len(), fan.positions.len());
    }

    #[test]
    fn smooth_normals_respect_creases() {
        // A right-angled fold of two quads, and a shallow one.
        let fold = |z: f32| Mesh {
            positions: [(-1., 0., 0.), (0., 0., 0.), (0., 1., 0.), (-1., 1., 0.)]
                .into_iter()
                .chain([(1., 0., z), (1., 1., z)])
                .map(|(x, y, z)| Vec3::new(x, y, z))
                .collect(),
            indices: Some(vec![0, 1, 2, 0, 2, 3, 1, 4, 5, 1, 5, 2]),
            ..Mesh::default()
        };
        let mut sharp = fold(-50.0);
        sharp.complete_normals(Normals::Smooth { crease: 0.7 }, false);
        assert!(sharp.normals[1].abs_diff_eq(Vec3::Z, 1e-3));
        let mut round = fold(-0.3);
        round.complete_normals(Normals::Smooth { crease: 0.7 }, false);
        assert!(round.normals[1].x > 0.05, "{}", round.normals[1]);
        // One face has the corners between them at 0, the other at -0.
        let mut signed = fold(-0.3);
        for (i, from) in [(6, 1), (7, 2)] {
            let p = signed.positions[from];
            signed.positions.push(Vec3::new(-p.x, p.y, -p.z));
            let second = &mut signed.indices.as_mut().unwrap()[6..];
            second.iter_mut().filter(|index| **index == from as u32).for_each(|index| *index = i);
        }
        signed.complete_normals(Normals::Smooth { crease: 0.7 }, false);
        assert!(signed.normals.iter().any(|n| *n == round.normals[1]), "{:?}", signed.normals);
        assert!(signed.normals.iter().all(|n| round.normals.contains(n)), "{:?}", signed.normals);
    }
}
