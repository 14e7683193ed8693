//! glTF 2.0.
//!
//! Only the JSON is parsed by a crate; the documents that its sibling builds on it assume what its
//! validator checked and panic where the validator is silent. Here every index, range and count is
//! checked where it is used, and the fault is named with the object that has it.
//!
//! Animation happens here, once: skins and morph targets are applied to the vertices while they
//! are loaded, so shaders and passes know nothing of them.

mod container;
mod data;
mod materials;
mod mend;
mod meshes;
mod pose;

use super::{
    Scene,
    build::{Builder, Node, Outcome},
    camera::{Camera, Projection},
    place::mirrors,
};
use data::{Checks, Data, get};
use glam::{DMat4, DQuat, DVec3};
use gltf_json::{self as json, camera::Type, validation::Checked};
use materials::Materials;
use meshes::Deform;
use pose::Pose;
use std::{collections::HashMap, path::Path};

/// Loads the glTF in `bytes`, which come from `path`.
pub(super) fn load(path: &Path, name: &str, bytes: &[u8], time: Option<f64>) -> Outcome<Scene> {
    let mut builder = Builder::default();
    let container = container::Container::parse(bytes, |w| builder.warn(w))?;
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut data = Data::new(&container.root, folder, container.binary, &mut builder.files);
    let materials = materials::add(&data, folder, &mut builder)?;
    let pose = Pose::new(&data, &container.locals, time)?;
    let hierarchy = Hierarchy::new(&container.root)?;
    let worlds = hierarchy.worlds(&pose);
    let mut loader = Loader {
        data: &mut data,
        materials,
        builder: &mut builder,
        pose,
        worlds,
        numbers: HashMap::new(),
        shared: HashMap::new(),
    };
    for &node in &hierarchy.order {
        loader.node(node, &hierarchy).map_err(|e| format!("node {node}: {e}"))?;
    }
    audit(&data, &mut builder);
    builder.finish(name)
}

/// Warns of faults in parts of the file that the scene does not need.
fn audit(data: &Data, builder: &mut Builder) {
    let faults = (0..data.root.accessors.len()).filter_map(|i| data.accessor(i).err());
    for fault in faults.take(20).collect::<Vec<_>>() {
        builder.warn(format!("not drawn, but wrong: {fault}"));
    }
    if builder.parts.is_empty() {
        builder.warn("the scene has nothing that can be drawn");
    }
}

/// The nodes that the scene shows.
struct Hierarchy {
    /// Parents before children, each subtree contiguous.
    order: Vec<usize>,
    /// By node of the file.
    parents: Vec<Option<usize>>,
}

impl Hierarchy {
    fn new(root: &json::Root) -> Checks<Self> {
        let count = root.nodes.len();
        let mut parents = vec![None; count];
        let children = |node: usize| root.nodes[node].children.as_deref().unwrap_or_default();
        for node in 0..count {
            for child in children(node) {
                get(&root.nodes, child.value(), "node")?;
                if parents[child.value()].replace(node).is_some() {
                    return Err(format!("node {} has two parents", child.value()));
                }
            }
        }
        let roots: Vec<usize> = match (root.scene, &root.scenes[..]) {
            (Some(scene), scenes) => {
                get(scenes, scene.value(), "scene")?.nodes.iter().map(|n| n.value()).collect()
            }
            (None, [first, ..]) => first.nodes.iter().map(|n| n.value()).collect(),
            (None, []) => (0..count).filter(|&n| parents[n].is_none()).collect(),
        };
        let (mut order, mut seen) = (Vec::with_capacity(count), vec![false; count]);
        let mut stack = roots;
        stack.reverse();
        while let Some(node) = stack.pop() {
            get(&root.nodes, node, "node")?;
            if std::mem::replace(&mut seen[node], true) {
                return Err(format!("node {node} occurs twice in the hierarchy"));
            }
            order.push(node);
            stack.extend(children(node).iter().rev().map(|c| c.value()));
        }
        Ok(Self { order, parents })
    }

    /// The matrices of all nodes to the world, those outside the scene too: joints may be there.
    fn worlds(&self, pose: &Pose) -> Vec<DMat4> {
        let mut worlds: Vec<Option<DMat4>> = vec![None; self.parents.len()];
        for node in 0..self.parents.len() {
            // Up to the first ancestor that is known, then down again. A ring of nodes, which no
            // scene shows, ends where it began.
            let (mut path, mut at) = (Vec::new(), Some(node));
            while let Some(n) = at.filter(|&n| worlds[n].is_none() && path.len() <= worlds.len()) {
                path.push(n);
                at = self.parents[n];
            }
            let mut world = at.and_then(|n| worlds[n]).unwrap_or(DMat4::IDENTITY);
            for n in path.into_iter().rev() {
                world *= pose.locals[n];
                worlds[n] = Some(world);
            }
        }
        worlds.into_iter().map(Option::unwrap_or_default).collect()
    }
}

struct Loader<'a, 'd> {
    data: &'a mut Data<'d>,
    materials: Materials,
    builder: &'a mut Builder,
    pose: Pose,
    /// By node of the file.
    worlds: Vec<DMat4>,
    /// Nodes of the builder by nodes of the file.
    numbers: HashMap<usize, usize>,
    /// Parts of meshes that look the same wherever they are.
    shared: HashMap<usize, Vec<usize>>,
}

impl Loader<'_, '_> {
    fn node(&mut self, index: usize, hierarchy: &Hierarchy) -> Checks<()> {
        let root = self.data.root;
        let node = &root.nodes[index];
        let mut made = Node {
            parent: hierarchy.parents[index].and_then(|p| self.numbers.get(&p).copied()),
            local: self.pose.locals[index],
            ..Node::default()
        };
        if made.parent.is_none() {
            // The root of a scene, even if the file has a parent for it.
            made.local = self.worlds[index];
        }
        if !self.worlds[index].is_finite() {
            return Err("its transform is not finite".into());
        }
        if let Some(camera) = node.camera {
            let described = get(&root.cameras, camera.value(), "camera")?;
            let name = node.name.clone().or_else(|| described.name.clone()).unwrap_or_default();
            match projection(described) {
                Some(p) => {
                    self.builder.cameras.push(Camera::from_world(name, &self.worlds[index], p));
                }
                None => self.builder.warn(format!(
                    "camera {} has a view that cannot be drawn and is left out",
                    camera.value()
                )),
            }
        }
        if let Some(mesh) = node.mesh {
            let skin = node.skin.map(|s| self.joints(s.value())).transpose()?;
            made.in_world = skin.is_some();
            made.parts = self.mesh(mesh.value(), index, skin.as_deref())?;
        }
        let others = node.extensions.as_ref().map(|e| &e.others);
        if let Some(extension) = others.and_then(|o| o.get("EXT_mesh_gpu_instancing")) {
            made.instances = Some(self.instances(extension)?);
        }
        self.numbers.insert(index, self.builder.nodes.len());
        self.builder.nodes.push(made);
        Ok(())
    }

    fn mesh(&mut self, mesh: usize, node: usize, joints: Option<&[DMat4]>) -> Checks<Vec<usize>> {
        let root = self.data.root;
        let described = get(&root.meshes, mesh, "mesh")?;
        let weights = self.pose.weights[node]
            .as_ref()
            .or(root.nodes[node].weights.as_ref())
            .or(described.weights.as_ref());
        let weights = weights.map_or(&[][..], Vec::as_slice);
        let mirrored = mirrors(&self.worlds[node]);
        let deform = Deform { weights, joints, mirrored };
        let deforms = joints.is_some() || weights.iter().any(|&w| w != 0.0);
        if !deforms && let Some(parts) = self.shared.get(&mesh) {
            return Ok(parts.clone());
        }
        let parts = meshes::add(self.data, &self.materials, self.builder, mesh, deform)?;
        if !deforms {
            self.shared.insert(mesh, parts.clone());
        }
        Ok(parts)
    }

    /// The matrices of a skin's joints from the mesh's bind space to the world.
    fn joints(&self, skin: usize) -> Checks<Vec<DMat4>> {
        let skin = get(&self.data.root.skins, skin, "skin")?;
        let inverses = match skin.inverse_bind_matrices {
            Some(accessor) => {
                self.data.accessor(accessor.value())?.mat4("the inverse bind matrices")?
            }
            None => vec![DMat4::IDENTITY; skin.joints.len()],
        };
        if inverses.len() < skin.joints.len() {
            return Err(format!(
                "a skin has {} joints, but {} inverse bind matrices",
                skin.joints.len(),
                inverses.len()
            ));
        }
        let matrix = |(joint, inverse): (&json::Index<json::Node>, DMat4)| {
            Ok(*get(&self.worlds, joint.value(), "node")? * inverse)
        };
        skin.joints.iter().zip(inverses).map(matrix).collect()
    }

    /// The matrices of `EXT_mesh_gpu_instancing`.
    fn instances(&self, extension: &serde_json::Value) -> Checks<Vec<DMat4>> {
        let accessor = |name: &str| {
            let index = extension.get("attributes").and_then(|a| a.get(name));
            let index = index.and_then(serde_json::Value::as_u64).map(|i| i as usize);
            index.map(|i| self.data.accessor(i)).transpose()
        };
        let (t, r, s) = (accessor("TRANSLATION")?, accessor("ROTATION")?, accessor("SCALE")?);
        let count = [&t, &r, &s].into_iter().flatten().map(|a| a.count).min().unwrap_or(0);
        let t = t.map(|a| a.vec3("TRANSLATION")).transpose()?;
        let r = r.map(|a| a.vec4("ROTATION")).transpose()?;
        let s = s.map(|a| a.vec3("SCALE")).transpose()?;
        let matrix = |i: usize| {
            DMat4::from_scale_rotation_translation(
                s.as_ref().map_or(DVec3::ONE, |s| s[i].as_dvec3()),
                r.as_ref()
                    .map_or(DQuat::IDENTITY, |r| DQuat::from_vec4(r[i].as_dvec4()).normalize()),
                t.as_ref().map_or(DVec3::ZERO, |t| t[i].as_dvec3()),
            )
        };
        Ok((0..count).map(matrix).filter(DMat4::is_finite).collect())
    }
}

/// The projection of a camera, `None` if it shows nothing.
fn projection(camera: &json::Camera) -> Option<Projection> {
    let positive = |v: f32| v.is_finite() && v > 0.0;
    match camera.type_ {
        Checked::Valid(Type::Perspective) => {
            let p = camera.perspective.as_ref()?;
            let far = p.zfar.filter(|&far| positive(far));
            let fits = positive(p.yfov)
                && p.yfov < std::f32::consts::PI
                && positive(p.znear)
                && far.is_none_or(|far| far > p.znear);
            let (yfov, near) = (p.yfov.into(), p.znear.into());
            fits.then_some(Projection::Perspective { yfov, near, far: far.map(f64::from) })
        }
        Checked::Valid(Type::Orthographic) => {
            let o = camera.orthographic.as_ref()?;
            let fits =
                o.ymag != 0.0 && o.ymag.is_finite() && o.zfar > o.znear && o.zfar.is_finite();
            let (ymag, near, far) = (o.ymag.abs().into(), o.znear.into(), o.zfar.into());
            fits.then_some(Projection::Orthographic { ymag, near, far })
        }
        Checked::Invalid => None,
    }
}
