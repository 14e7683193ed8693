//! glTF primitives as parts: straight from the file's buffers where they can be drawn as they are,
//! otherwise completed, morphed and skinned first.

use super::super::{
    build::{Builder, COLOR, NORMAL, POSITION, Part, TANGENT, UV},
    mesh::{Mesh, Normals, is_usable},
    place::direction_matrix,
};
use super::{
    data::{Checks, Data, Placed, compressed, get},
    materials::Materials,
};
use crate::state::{PrimitiveKind, Topology};
use glam::{DMat4, DVec3, Vec4};
use gltf_json::{
    mesh::{Mode, Primitive, Semantic},
    validation::Checked,
};

const DRACO: &str = "KHR_draco_mesh_compression";

/// The changes that a node makes to its mesh.
#[derive(Clone, Copy, Default)]
pub(super) struct Deform<'a> {
    /// Weights of the morph targets, empty for none.
    pub weights: &'a [f32],
    /// Matrices of the joints to the world, if the mesh is skinned.
    pub joints: Option<&'a [DMat4]>,
    /// Whether the node's front is on the other side.
    pub mirrored: bool,
}

/// Adds the parts of mesh `index`.
pub(super) fn add(
    data: &mut Data,
    materials: &Materials,
    builder: &mut Builder,
    index: usize,
    deform: Deform,
) -> Checks<Vec<usize>> {
    let mesh = get(&data.root.meshes, index, "mesh")?;
    let mut parts = Vec::new();
    for (i, primitive) in mesh.primitives.iter().enumerate() {
        let added = part(data, materials, builder, primitive, deform);
        match added.map_err(|e| format!("mesh {index}, primitive {i}: {e}"))? {
            Added::Part(part) => parts.push(part),
            Added::Nothing => {}
            Added::Skipped(why) => {
                builder.warn(format!("mesh {index}, primitive {i}: {why}; it is not drawn"));
            }
        }
    }
    Ok(parts)
}

enum Added {
    Part(usize),
    Nothing,
    Skipped(&'static str),
}

fn part(
    data: &mut Data,
    materials: &Materials,
    builder: &mut Builder,
    primitive: &Primitive,
    deform: Deform,
) -> Checks<Added> {
    let topology = match primitive.mode {
        Checked::Valid(Mode::Triangles) => Topology::TriangleList,
        Checked::Valid(Mode::TriangleStrip) => Topology::TriangleStrip,
        Checked::Valid(Mode::TriangleFan) => Topology::TriangleFan,
        Checked::Valid(Mode::Points) => Topology::PointList,
        Checked::Valid(Mode::Lines) => Topology::LineList,
        Checked::Valid(Mode::LineStrip | Mode::LineLoop) => Topology::LineStrip,
        Checked::Invalid => return Err("its mode is unknown".into()),
    };
    let (source, shaped) = (Source { primitive }, topology.kind() != PrimitiveKind::Triangle);
    let is_loop = matches!(primitive.mode, Checked::Valid(Mode::LineLoop));
    let Some(position) = source.find(Semantic::Positions) else {
        return Ok(Added::Skipped("it has no positions"));
    };
    let material = match primitive.material {
        Some(material) => {
            get(&data.root.materials, material.value(), "material")?;
            material.value()
        }
        None => materials.uv_sets.len() - 1,
    };
    let uv_sets = materials.uv_sets[material];
    source.check_compression(data)?;
    let vertices = data.accessor(position)?.count;
    source.check_counts(data, vertices)?;
    if vertices == 0 {
        return Ok(Added::Nothing);
    }
    // Points and lines have no winding that normals and tangents could be made of.
    let described = &builder.materials[material];
    let is_mapped = !described.unlit && described.normal_uv_set().is_some();
    let is_directed = source.find(Semantic::Normals).is_some()
        && (!is_mapped || source.find(Semantic::Tangents).is_some())
        && source.has_directions(data, true)?;
    let material = match shaped && !is_directed {
        true => builder.unlit(material),
        false => material,
    };
    let described = &builder.materials[material];
    let lit = !described.unlit;
    // Only tangents of a normal map are ever read, only lit surfaces need normals.
    let normal_map = described.normal_uv_set().filter(|_| lit);
    let tangents = normal_map.is_none() || source.find(Semantic::Tangents).is_some();
    let normals = !lit || source.find(Semantic::Normals).is_some();
    let morphed = deform.weights.iter().any(|&w| w != 0.0) && primitive.targets.is_some();
    if !is_loop
        && normals
        && tangents
        && source.has_directions(data, lit)?
        && !morphed
        && deform.joints.is_none()
        && let Some(part) = direct(data, builder, &source, topology, material, uv_sets)?
    {
        builder.parts.push(part);
        return Ok(Added::Part(builder.parts.len() - 1));
    }
    let mut mesh = source.read(data, topology, uv_sets, normal_map.is_some())?;
    if is_loop {
        mesh.close();
    }
    if morphed {
        source.morph(data, &mut mesh, deform.weights)?;
    }
    match deform.joints {
        Some(joints) => source.skin(data, &mut mesh, joints)?,
        None => mesh.settle(),
    }
    // Joints have moved a skin to the world already, and with it perhaps into a mirror: what is made
    // from its winding then points to the wrong side.
    let flipped = deform.joints.is_some() && deform.mirrored;
    if !shaped && (lit || source.find(Semantic::Normals).is_some()) {
        // Where a file has no normals, glTF demands flat ones.
        let how = match mesh.normals.iter().any(is_usable) {
            true => Normals::SMOOTH,
            false => Normals::Flat,
        };
        mesh.complete_normals(how, flipped);
    }
    if let Some(set) = normal_map.filter(|_| !shaped && mesh.tangents.is_empty()) {
        mesh.make_tangents(set);
        mesh.tangents.iter_mut().filter(|_| flipped).for_each(|t| t.w = -t.w);
    }
    Ok(Added::Part(builder.mesh(&mesh, material)?))
}

/// A part that reads the file's own bytes; `None` if some attribute needs conversion.
fn direct(
    data: &mut Data,
    builder: &mut Builder,
    source: &Source,
    topology: Topology,
    material: usize,
    uv_sets: [u32; 2],
) -> Checks<Option<Part>> {
    let semantics = [
        (POSITION, Semantic::Positions),
        (NORMAL, Semantic::Normals),
        (TANGENT, Semantic::Tangents),
        (UV, Semantic::TexCoords(uv_sets[0])),
        (UV + 1, Semantic::TexCoords(uv_sets[1])),
        (COLOR, Semantic::Colors(0)),
    ];
    let mut streams = [None; 6];
    for (location, semantic) in semantics {
        let Some(accessor) = source.find(semantic) else { continue };
        streams[location] = data.stream(accessor, &mut builder.store)?;
        if streams[location].is_none() {
            return Ok(None);
        }
    }
    let position = source.find(Semantic::Positions).unwrap_or(0);
    let Placed { bounds, anchor, stream } = data.placed(position, &mut builder.store)?;
    streams[POSITION] = stream.or(streams[POSITION]);
    let vertices = data.accessor(position)?.count;
    let indices = match source.primitive.indices {
        Some(i) => Some(data.index_buffer(i.value(), vertices, &mut builder.store)?),
        None => None,
    };
    let count = indices.map_or(vertices as u32, |(_, _, count)| count);
    let indices = indices.map(|(slice, format, _)| (slice, format));
    Ok(Some(Part { topology, streams, indices, count, material, anchor, bounds }))
}

/// The accessors of a primitive.
struct Source<'a> {
    primitive: &'a Primitive,
}

impl Source<'_> {
    fn find(&self, semantic: Semantic) -> Option<usize> {
        self.primitive.attributes.get(&Checked::Valid(semantic)).map(|i| i.value())
    }

    /// Refuses compressed geometry beside which there is no other.
    fn check_compression(&self, data: &Data) -> Checks<()> {
        let extensions = self.primitive.extensions.as_ref().map(|e| &e.others);
        if !extensions.is_some_and(|e| e.contains_key(DRACO)) {
            return Ok(());
        }
        let attributes = self.primitive.attributes.values().copied();
        for accessor in attributes.chain(self.primitive.indices) {
            let described = get(&data.root.accessors, accessor.value(), "accessor")?;
            if described.buffer_view.is_none() && described.sparse.is_none() {
                return Err(compressed(DRACO));
            }
        }
        Ok(())
    }

    /// Whether all normals have a direction, or the material needs none.
    fn has_directions(&self, data: &mut Data, lit: bool) -> Checks<bool> {
        let normals = self.find(Semantic::Normals).filter(|_| lit);
        normals.map_or(Ok(true), |normals| data.is_directed(normals))
    }

    /// Every attribute must have as many elements as there are positions.
    fn check_counts(&self, data: &Data, vertices: usize) -> Checks<()> {
        for (semantic, accessor) in &self.primitive.attributes {
            let Checked::Valid(semantic) = semantic else { continue };
            let count = data.accessor(accessor.value())?.count;
            if count != vertices {
                return Err(format!(
                    "{} has {count} elements, but there are {vertices} vertices",
                    semantic.to_string()
                ));
            }
        }
        Ok(())
    }

    /// Everything in canonical form.
    fn read(
        &self,
        data: &Data,
        topology: Topology,
        uv_sets: [u32; 2],
        with_tangents: bool,
    ) -> Checks<Mesh> {
        fn values<T: Default>(
            source: &Source,
            semantic: Semantic,
            read: impl FnOnce(usize) -> Checks<T>,
        ) -> Checks<T> {
            source.find(semantic).map_or(Ok(T::default()), read)
        }
        let uv = |set: u32| {
            values(self, Semantic::TexCoords(set), |i| data.accessor(i)?.vec2("TEXCOORD"))
        };
        let positions = values(self, Semantic::Positions, |i| data.accessor(i)?.vec3("POSITION"))?;
        let indices = match self.primitive.indices {
            Some(i) => Some(data.index_list(i.value(), positions.len())?),
            None => None,
        };
        Ok(Mesh {
            topology,
            normals: values(self, Semantic::Normals, |i| data.accessor(i)?.vec3("NORMAL"))?,
            tangents: match with_tangents {
                true => values(self, Semantic::Tangents, |i| data.accessor(i)?.vec4("TANGENT"))?,
                false => Vec::new(),
            },
            uvs: [uv(uv_sets[0])?, uv(uv_sets[1])?],
            colors: values(self, Semantic::Colors(0), |i| data.accessor(i)?.colors("COLOR_0"))?,
            positions,
            indices,
            ..Mesh::default()
        })
    }

    /// Adds the weighted displacements of the morph targets.
    fn morph(&self, data: &Data, mesh: &mut Mesh, weights: &[f32]) -> Checks<()> {
        let targets = self.primitive.targets.as_deref().unwrap_or_default();
        for (target, &weight) in targets.iter().zip(weights).filter(|(_, w)| **w != 0.0) {
            let displacements = |accessor: Option<gltf_json::Index<gltf_json::Accessor>>| {
                let Some(accessor) = accessor else { return Ok(Vec::new()) };
                let list = data.accessor(accessor.value())?.vec3("a morph target")?;
                match list.len() == mesh.positions.len() {
                    true => Ok(list),
                    false => Err(format!(
                        "a morph target has {} elements, but there are {} vertices",
                        list.len(),
                        mesh.positions.len()
                    )),
                }
            };
            let [positions, normals, tangents] =
                [target.positions, target.normals, target.tangents].map(displacements);
            for (p, d) in mesh.positions.iter_mut().zip(positions?) {
                *p += d * weight;
            }
            for (n, d) in mesh.normals.iter_mut().zip(normals?) {
                *n += d * weight;
            }
            for (t, d) in mesh.tangents.iter_mut().zip(tangents?) {
                *t += (d * weight).extend(0.0);
            }
        }
        Ok(())
    }

    /// Moves vertices to the world by the weighted matrices of their joints.
    fn skin(&self, data: &Data, mesh: &mut Mesh, joints: &[DMat4]) -> Checks<()> {
        let mut blended = vec![DMat4::ZERO; mesh.positions.len()];
        let mut total = vec![0.0; mesh.positions.len()];
        for set in 0.. {
            let (Some(j), Some(w)) =
                (self.find(Semantic::Joints(set)), self.find(Semantic::Weights(set)))
            else {
                break;
            };
            let (numbers, weights) = (data.accessor(j)?, data.accessor(w)?.vec4("WEIGHTS")?);
            if numbers.components != 4 {
                return Err("JOINTS must have four components".into());
            }
            let numbers = numbers.integers(j)?;
            for (i, (numbers, weights)) in numbers.chunks_exact(4).zip(weights).enumerate() {
                for (&number, weight) in numbers.iter().zip(weights.as_dvec4().to_array()) {
                    if weight == 0.0 {
                        continue;
                    }
                    let joint = get(joints, number as usize, "joint")?;
                    blended[i] += *joint * weight;
                    total[i] += weight;
                }
            }
        }
        let mut moved = Vec::with_capacity(mesh.positions.len());
        for (i, (matrix, total)) in blended.iter().zip(total).enumerate() {
            // Weights that do not sum to 1 are scaled; a vertex without weights stays in place.
            let matrix = if total > 0.0 { *matrix * (1.0 / total) } else { DMat4::IDENTITY };
            moved.push(matrix.transform_point3(mesh.anchor.place(mesh.positions[i])));
            let turn = direction_matrix(&matrix);
            let (x, y, z) = (turn.x_axis, turn.y_axis, turn.z_axis);
            // Cofactors turn normals; a mirror changes their sign, and the hand of tangents.
            let mirror = if turn.determinant() < 0.0 { -1.0 } else { 1.0 };
            if let Some(n) = mesh.normals.get_mut(i) {
                let old = n.as_dvec3() * mirror;
                let turned = y.cross(z) * old.x + z.cross(x) * old.y + x.cross(y) * old.z;
                *n = turned.normalize_or_zero().as_vec3();
            }
            if let Some(t) = mesh.tangents.get_mut(i) {
                let turned = (turn * t.truncate().as_dvec3()).normalize_or(DVec3::X).as_vec3();
                *t = Vec4::from((turned, t.w * mirror as f32));
            }
        }
        mesh.set_positions(&moved);
        Ok(())
    }
}
