//! Makes a [`Scene`] of the parts, nodes and materials that loaders and built-in shapes describe.

use super::{
    Scene,
    anchor::Anchor,
    bounds::Bounds,
    camera::Camera,
    light::Light,
    material::{AlphaMode, Material, binding_sets},
    mesh::Mesh,
    place::{CullNode, Placer},
    shading::{self, Shaders},
    store::{Slice, Store},
    texture::{ColorSpace, with_mips},
};
use crate::{
    format::VertexFormat,
    image::Extent,
    pass::{IndexFormat, Pipeline, StepRate, VertexAttribute, VertexBinding},
    state::{Blend, ColorState, Cull, DepthState, FrontFace, LineMode, ProvokingVertex, Topology},
    texture::Texture,
};
use glam::DMat4;
use std::{
    collections::HashMap,
    path::PathBuf,
    sync::{
        Arc, Mutex,
        atomic::{AtomicU64, Ordering},
    },
};

/// A vertex attribute in the scene's buffers.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stream {
    pub slice: Slice,
    pub format: VertexFormat,
    pub stride: u32,
}

/// Attributes of the vertex shader by location; those of the instance follow.
pub(super) const POSITION: usize = 0;
pub(super) const NORMAL: usize = 1;
pub(super) const TANGENT: usize = 2;
/// The second set is at the location after this.
pub(super) const UV: usize = 3;
pub(super) const COLOR: usize = 5;
const STREAMS: usize = 6;
/// Rows of an affine matrix, three locations.
const INSTANCE_ROWS: usize = 3;

/// One drawable: a glTF primitive; the faces, lines or points of one material of an OBJ group.
#[derive(Clone, Debug)]
pub(super) struct Part {
    pub topology: Topology,
    /// By location; `None` reads a constant.
    pub streams: [Option<Stream>; STREAMS],
    pub indices: Option<(Slice, IndexFormat)>,
    /// Vertices, or indices if there are some.
    pub count: u32,
    /// Number of the material.
    pub material: usize,
    /// Where the stored positions lie in the part's own space.
    pub anchor: Anchor,
    /// In the part's own space.
    pub bounds: Bounds,
}

/// A node of the hierarchy, as loaders describe it.
#[derive(Clone, Debug, Default)]
pub(super) struct Node {
    /// Number of the parent, which comes before its children.
    pub parent: Option<usize>,
    /// To the parent's space.
    pub local: DMat4,
    /// Numbers of parts.
    pub parts: Vec<usize>,
    /// Matrices to the node's space; `None` draws once.
    pub instances: Option<Vec<DMat4>>,
    /// Its parts lie in the world already: joints have placed them.
    pub in_world: bool,
}

/// A file with thousands of faults is told of the first.
const MAX_WARNINGS: usize = 50;

/// Textures together may have this many bytes; small files can ask for any amount.
const MAX_TEXTURE_BYTES: u64 = 8 << 30;

/// Makes a texture when its turn comes; several run at once.
type TextureJob = Box<dyn FnOnce() -> std::result::Result<Texture, String> + Send>;

/// Collects a scene.
#[derive(Default)]
pub(super) struct Builder {
    pub store: Store,
    pub parts: Vec<Part>,
    /// Parents before children, and each subtree contiguous.
    pub nodes: Vec<Node>,
    pub materials: Vec<Material>,
    pub cameras: Vec<Camera>,
    pub light: Light,
    pub warnings: Vec<String>,
    /// The files that were read.
    pub files: Vec<PathBuf>,
    textures: Vec<TextureJob>,
    /// Materials without light, by those that they were made of.
    unlit: HashMap<usize, usize>,
}

impl Builder {
    /// Adds a texture that is decoded later and returns its number.
    pub fn texture(
        &mut self,
        job: impl FnOnce() -> std::result::Result<Texture, String> + Send + 'static,
    ) -> usize {
        self.textures.push(Box::new(job));
        self.textures.len() - 1
    }

    /// Notes something that was left out or replaced, once.
    pub fn warn(&mut self, text: impl Into<String>) {
        let text = text.into();
        match self.warnings.len() {
            ..MAX_WARNINGS if !self.warnings.contains(&text) => self.warnings.push(text),
            MAX_WARNINGS => self.warnings.push("there is more that is left out".into()),
            _ => {}
        }
    }

    /// The number of a material that is as `material` but for light, which it takes no account of.
    pub fn unlit(&mut self, material: usize) -> usize {
        if self.materials[material].unlit {
            return material;
        }
        *self.unlit.entry(material).or_insert_with(|| {
            self.materials.push(Material { unlit: true, ..self.materials[material].clone() });
            self.materials.len() - 1
        })
    }

    /// Adds `mesh` and returns the number of its part.
    pub fn mesh(&mut self, mesh: &Mesh, material: usize) -> std::result::Result<usize, String> {
        let mut streams = [None; STREAMS];
        let mut put = |at: usize, bytes: &[u8], format: VertexFormat| {
            if !bytes.is_empty() {
                let stride = format.bytes() as u32;
                streams[at] = Some(Stream { slice: self.store.push(bytes)?, format, stride });
            }
            Ok::<_, String>(())
        };
        put(POSITION, bytemuck::cast_slice(&mesh.positions), VertexFormat::F32X3)?;
        put(NORMAL, bytemuck::cast_slice(&mesh.normals), VertexFormat::F32X3)?;
        put(TANGENT, bytemuck::cast_slice(&mesh.tangents), VertexFormat::F32X4)?;
        put(UV, bytemuck::cast_slice(&mesh.uvs[0]), VertexFormat::F32X2)?;
        put(UV + 1, bytemuck::cast_slice(&mesh.uvs[1]), VertexFormat::F32X2)?;
        put(COLOR, bytemuck::cast_slice(&mesh.colors), VertexFormat::F32X4)?;
        let indices = match &mesh.indices {
            Some(list) if mesh.positions.len() <= 1 << 16 => {
                let short: Vec<u16> = list.iter().map(|&i| i as u16).collect();
                Some((self.store.push(bytemuck::cast_slice(&short))?, IndexFormat::U16))
            }
            Some(list) => Some((self.store.push(bytemuck::cast_slice(list))?, IndexFormat::U32)),
            None => None,
        };
        let count = mesh.indices.as_ref().map_or(mesh.positions.len(), Vec::len) as u32;
        let (topology, anchor, bounds) = (mesh.topology, mesh.anchor, mesh.bounds());
        self.parts.push(Part { topology, streams, indices, count, material, anchor, bounds });
        Ok(self.parts.len() - 1)
    }

    /// Adds `mesh` as a node of its own without a parent.
    pub fn mesh_node(
        &mut self,
        mesh: &Mesh,
        material: usize,
        local: DMat4,
    ) -> std::result::Result<(), String> {
        let parts = vec![self.mesh(mesh, material)?];
        self.nodes.push(Node { local, parts, ..Node::default() });
        Ok(())
    }

    /// Finishes the scene.
    pub fn finish(mut self, name: &str) -> std::result::Result<Scene, Fault> {
        if self.materials.is_empty() {
            self.materials.push(Material::default());
        }
        let shaders = shading::shaders()?;
        let mut pipelines =
            Pipelines { shaders: &shaders, made: Vec::new(), by_key: HashMap::new() };
        let constants = self.store.push(bytemuck::cast_slice(&CONSTANTS)).map_err(Fault::Input)?;
        let placer = Placer {
            nodes: &self.nodes,
            parts: &self.parts,
            materials: &self.materials,
            store: &mut self.store,
            pipelines: &mut pipelines,
        };
        let (nodes, items) = placer.place().map_err(Fault::Input)?;
        let textures = self.decode_textures();
        let white =
            Arc::new(with_mips("white", Extent::new(1, 1), vec![255; 4], ColorSpace::Linear));
        let sets = binding_sets(name, &self.materials, &textures, &white);
        let blended = self.materials.iter().map(|m| m.alpha == AlphaMode::Blend).collect();
        let bounds = nodes.iter().fold(Bounds::EMPTY, |b, n: &CullNode| b.union(n.bounds));
        if bounds.is_empty() && !items.is_empty() {
            self.warn("nothing of the scene has a place: its coordinates are no finite numbers");
        }
        Ok(Scene {
            name: name.into(),
            warnings: self.warnings,
            files: self.files,
            cameras: self.cameras,
            bounds,
            light: self.light,
            pipelines: pipelines.made,
            chunks: self.store.finish(name),
            constants,
            parts: self.parts,
            nodes,
            items,
            sets,
            blended,
        })
    }

    /// Decodes all textures on as many threads as the machine has; one that fails becomes white
    /// and a warning.
    fn decode_textures(&mut self) -> Vec<Arc<Texture>> {
        let count = self.textures.len();
        let jobs: Vec<_> =
            std::mem::take(&mut self.textures).into_iter().enumerate().rev().collect();
        let jobs = Mutex::new(jobs);
        let done = Mutex::new(Vec::with_capacity(count));
        let threads = std::thread::available_parallelism().map_or(1, |n| n.get()).min(count);
        let used = AtomicU64::new(0);
        let work = || {
            loop {
                let Some((i, job)) = jobs.lock().ok().and_then(|mut jobs| jobs.pop()) else {
                    return;
                };
                let texture = match used.load(Ordering::Relaxed) {
                    ..MAX_TEXTURE_BYTES => job(),
                    _ => Err(format!("the textures exceed {} GiB", MAX_TEXTURE_BYTES >> 30)),
                };
                let bytes = |t: &Texture| {
                    t.levels().unwrap_or_default().iter().map(|l| l.len() as u64).sum()
                };
                used.fetch_add(texture.as_ref().map_or(0, bytes), Ordering::Relaxed);
                if let Ok(mut done) = done.lock() {
                    done.push((i, texture));
                }
            }
        };
        std::thread::scope(|scope| {
            for _ in 1..threads {
                scope.spawn(work);
            }
            work();
        });
        let mut done = done.into_inner().unwrap_or_default();
        done.sort_by_key(|(i, _)| *i);
        done.into_iter()
            .map(|(_, texture)| {
                Arc::new(texture.unwrap_or_else(|fault| {
                    self.warn(format!("{fault}; white is drawn instead"));
                    with_mips("missing", Extent::new(1, 1), vec![255; 4], ColorSpace::Srgb)
                }))
            })
            .collect()
    }
}

/// Why a scene cannot be finished.
pub(super) enum Fault {
    /// The file asks for something impossible: a sentence.
    Input(String),
    /// A fault of the engine's own.
    Engine(crate::Error),
}

impl From<crate::Error> for Fault {
    fn from(error: crate::Error) -> Self {
        Fault::Engine(error)
    }
}

/// What attributes that a part does not have read, and the identity instance; every element lies
/// at `location * 16`.
#[rustfmt::skip]
const CONSTANTS: [[f32; 4]; STREAMS + INSTANCE_ROWS] = [
    [0.0; 4], [0.0, 1.0, 0.0, 0.0], [1.0, 0.0, 0.0, 1.0], [0.0; 4], [0.0; 4], [1.0; 4],
    [1.0, 0.0, 0.0, 0.0], [0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0],
];

/// Bytes of one instance.
pub(super) const INSTANCE_BYTES: usize = INSTANCE_ROWS * 16;

/// Pipelines of a scene, each made once.
pub(super) struct Pipelines<'a> {
    shaders: &'a Shaders,
    made: Vec<Arc<Pipeline>>,
    by_key: HashMap<Key, usize>,
}

/// What distinguishes pipelines.
#[derive(PartialEq, Eq, Hash)]
struct Key {
    layout: [Option<(VertexFormat, u32)>; STREAMS],
    topology: Topology,
    alpha: AlphaMode,
    double_sided: bool,
    mirrored: bool,
}

impl Pipelines<'_> {
    pub fn get(&mut self, part: &Part, material: &Material, mirrored: bool) -> usize {
        let key = Key {
            layout: part.streams.map(|s| s.map(|s| (s.format, s.stride))),
            topology: part.topology,
            alpha: material.alpha,
            double_sided: material.double_sided,
            mirrored,
        };
        if let Some(&index) = self.by_key.get(&key) {
            return index;
        }
        let pipeline = Arc::new(self.make(&key));
        self.made.push(pipeline);
        let index = self.made.len() - 1;
        self.by_key.insert(key, index);
        index
    }

    fn make(&self, key: &Key) -> Pipeline {
        let (mut bindings, mut attributes) = (Vec::new(), Vec::new());
        for (location, stream) in key.layout.iter().enumerate() {
            let (format, stride) = stream.unwrap_or((VertexFormat::F32X4, 0));
            let binding = location as u32;
            bindings.push(VertexBinding { stride, rate: StepRate::Vertex });
            attributes.push(VertexAttribute { location: binding, binding, format, offset: 0 });
        }
        bindings.push(VertexBinding { stride: INSTANCE_BYTES as u32, rate: StepRate::Instance });
        for row in 0..INSTANCE_ROWS {
            attributes.push(VertexAttribute {
                location: (STREAMS + row) as u32,
                binding: STREAMS as u32,
                format: VertexFormat::F32X4,
                offset: row as u32 * 16,
            });
        }
        let blended = key.alpha == AlphaMode::Blend;
        Pipeline {
            label: format!("{:?}{}", key.alpha, if key.mirrored { " mirrored" } else { "" }),
            vertex: self.shaders.vertex.clone(),
            fragment: match key.alpha {
                AlphaMode::Mask => self.shaders.mask.clone(),
                AlphaMode::Opaque | AlphaMode::Blend => self.shaders.opaque.clone(),
            },
            specialization: Vec::new(),
            provoking_vertex: ProvokingVertex::First,
            vertex_bindings: bindings,
            vertex_attributes: attributes,
            topology: key.topology,
            line_width: 1.0,
            line_mode: LineMode::default(),
            cull: if key.double_sided { Cull::None } else { Cull::Back },
            front_face: match key.mirrored {
                false => FrontFace::CounterClockwise,
                true => FrontFace::Clockwise,
            },
            depth: DepthState { write: !blended, ..DepthState::LESS },
            stencil: None,
            depth_clamp: false,
            depth_clip: None,
            colors: vec![ColorState::default().blend(blended.then_some(Blend::ALPHA))],
            logic_op: None,
            sample_mask: u32::MAX,
            alpha_to_coverage: false,
            alpha_to_one: false,
            sample_shading: false,
        }
    }
}

impl Fault {
    /// The error for a scene from `path`.
    pub fn into_error(self, path: &std::path::Path) -> crate::Error {
        match self {
            Fault::Input(reason) => crate::Error::input(path, reason),
            Fault::Engine(error) => error,
        }
    }
}

impl From<String> for Fault {
    fn from(reason: String) -> Self {
        Fault::Input(reason)
    }
}

/// The result of loaders.
pub(super) type Outcome<T> = std::result::Result<T, Fault>;
