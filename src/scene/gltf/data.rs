//! Buffers and accessors, read with every bound checked before a byte is touched or allocated.

use super::super::{
    anchor::Anchor,
    bounds::Bounds,
    build::Stream,
    mesh::is_usable,
    store::{Slice, Store},
    uri,
};
use crate::{
    format::{Numeric, Packing, VertexFormat},
    pass::IndexFormat,
};
use glam::{DMat4, Mat4, Vec2, Vec3, Vec4};
use gltf_json::{
    Root, accessor,
    accessor::{ComponentType, Type},
    validation::Checked,
};
use std::{borrow::Cow, collections::HashMap, path::Path, path::PathBuf};

/// Results whose error is a sentence about the file.
pub(super) type Checks<T> = Result<T, String>;

/// Elements of an accessor that no buffer backs (all zero, or sparse) are limited to this.
const MAX_UNBACKED: usize = 1 << 22;

/// The document with its buffers.
pub(super) struct Data<'a> {
    pub root: &'a Root,
    buffers: Vec<Checks<Cow<'a, [u8]>>>,
    /// The parts of the buffers that are in the scene's store already.
    views: HashMap<usize, Slice>,
    indices: HashMap<usize, (Slice, IndexFormat, u32)>,
    placed: HashMap<usize, Placed>,
    /// Whether all vectors of an accessor point somewhere.
    directed: HashMap<usize, bool>,
}

/// The positions of an accessor.
#[derive(Clone, Copy)]
pub(super) struct Placed {
    pub bounds: Bounds,
    pub anchor: Anchor,
    /// Where they lie around the anchor, unless that is the default one.
    pub stream: Option<Stream>,
}

/// An accessor whose elements all lie inside their buffer.
pub(super) struct Accessor<'d> {
    /// From the first element on; `None` is all zeros.
    bytes: Option<&'d [u8]>,
    /// The buffer view and the first byte in it.
    view: Option<(usize, usize)>,
    stride: usize,
    pub count: usize,
    component: ComponentType,
    pub components: usize,
    normalized: bool,
    sparse: Option<Sparse<'d>>,
}

/// Replaced elements.
struct Sparse<'d> {
    indices: Vec<usize>,
    values: &'d [u8],
}

/// An object that may not exist.
pub(super) fn get<'r, T>(list: &'r [T], index: usize, what: &str) -> Checks<&'r T> {
    list.get(index).ok_or_else(|| {
        format!("{what} {index} is referred to, but the file has {} of them", list.len())
    })
}

/// Compression of buffer views, under its two names.
const MESHOPT: [&str; 2] = ["EXT_meshopt_compression", "KHR_meshopt_compression"];

/// The message for data that only a decoder could read.
pub(super) fn compressed(extension: &str) -> String {
    format!(
        "it is compressed by {extension}, which cannot be read, and has no uncompressed copy; export \
         the file without compression, or decompress it (`gltf-transform copy` does)"
    )
}

fn component_bytes(component: ComponentType) -> usize {
    match component {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

impl<'a> Data<'a> {
    /// Reads all buffers; one that cannot be read is an error when something needs it. Adds to `files` what it reads.
    pub fn new(
        root: &'a Root,
        folder: &Path,
        binary: Option<&'a [u8]>,
        files: &mut Vec<PathBuf>,
    ) -> Self {
        let read = |(i, buffer): (usize, &'a gltf_json::Buffer)| {
            let bytes: Cow<[u8]> = match (&buffer.uri, binary) {
                (Some(uri), _) => Cow::Owned(uri::read(uri, folder, files)?),
                (None, Some(binary)) if i == 0 => Cow::Borrowed(binary),
                (None, _) => return Err(format!("buffer {i} has neither a URI nor a GLB chunk")),
            };
            if (bytes.len() as u64) < buffer.byte_length.0 {
                return Err(format!(
                    "buffer {i} says it has {} bytes, but there are {}",
                    buffer.byte_length.0,
                    bytes.len()
                ));
            }
            Ok(bytes)
        };
        let buffers = root.buffers.iter().enumerate().map(read).collect();
        Self {
            root,
            buffers,
            views: HashMap::new(),
            indices: HashMap::new(),
            placed: HashMap::new(),
            directed: HashMap::new(),
        }
    }

    /// The bytes of a buffer view.
    pub fn view(&self, index: usize) -> Checks<&[u8]> {
        let view = get(&self.root.buffer_views, index, "buffer view")?;
        let number = view.buffer.value();
        let buffer = get(&self.buffers, number, "buffer")?.as_ref().map_err(|fault| {
            let extensions = view.extensions.as_ref().map(|e| &e.others);
            match MESHOPT.into_iter().find(|name| extensions.is_some_and(|e| e.contains_key(*name)))
            {
                Some(name) => compressed(name),
                None => fault.clone(),
            }
        })?;
        let start = view.byte_offset.map_or(0, |o| o.0);
        let end = start.checked_add(view.byte_length.0).filter(|&e| e <= buffer.len() as u64);
        let Some(end) = end else {
            return Err(format!(
                "buffer view {index} (offset {start}, {} bytes) reaches beyond buffer {number} of \
                 {} bytes",
                view.byte_length.0,
                buffer.len()
            ));
        };
        Ok(&buffer[start as usize..end as usize])
    }

    /// `count` elements of `bytes` each, `stride` apart from `offset` of a view.
    fn elements(
        &self,
        what: &str,
        view: usize,
        offset: u64,
        count: u64,
        stride: usize,
        bytes: usize,
    ) -> Checks<&[u8]> {
        let all = self.view(view)?;
        let needed = count
            .saturating_sub(1)
            .checked_mul(stride as u64)
            .and_then(|n| n.checked_add(if count == 0 { 0 } else { bytes as u64 }))
            .and_then(|n| n.checked_add(offset));
        match needed {
            Some(needed) if needed <= all.len() as u64 => Ok(&all[offset as usize..]),
            _ => Err(format!(
                "{what} ({count} elements, {stride} bytes apart, from byte {offset}) reaches \
                 beyond buffer view {view} of {} bytes",
                all.len()
            )),
        }
    }

    /// Checks accessor `index` and gives access to it.
    pub fn accessor(&self, index: usize) -> Checks<Accessor<'_>> {
        let a = get(&self.root.accessors, index, "accessor")?;
        let (Checked::Valid(component), Checked::Valid(kind)) = (&a.component_type, &a.type_)
        else {
            return Err(format!("accessor {index} has an unknown type or component type"));
        };
        let (component, components) = (component.0, kind_components(*kind));
        let size = component_bytes(component) * components;
        if matches!(kind, Type::Mat2 | Type::Mat3 | Type::Mat4) && component != ComponentType::F32 {
            return Err(format!("accessor {index} is a matrix of integers, which nothing can use"));
        }
        let what = format!("accessor {index}");
        let (bytes, view, stride) = match a.buffer_view {
            Some(view) => {
                let described = get(&self.root.buffer_views, view.value(), "buffer view")?;
                let stride = described.byte_stride.map_or(size, |s| s.0);
                if stride < size || stride > 4096 {
                    return Err(format!(
                        "{what} has elements of {size} bytes, {stride} bytes apart"
                    ));
                }
                let offset = a.byte_offset.map_or(0, |o| o.0);
                let bytes = self.elements(&what, view.value(), offset, a.count.0, stride, size)?;
                (Some(bytes), Some((view.value(), offset as usize)), stride)
            }
            None if a.count.0 > MAX_UNBACKED as u64 => {
                return Err(format!(
                    "{what} has {} elements without a buffer, the limit is {MAX_UNBACKED}",
                    a.count.0
                ));
            }
            None => (None, None, size),
        };
        let sparse =
            a.sparse.as_ref().map(|s| self.sparse(&what, s, a.count.0, size)).transpose()?;
        Ok(Accessor {
            bytes,
            view,
            stride,
            count: a.count.0 as usize,
            component,
            components,
            normalized: a.normalized,
            sparse,
        })
    }

    fn sparse(
        &self,
        what: &str,
        sparse: &accessor::sparse::Sparse,
        count: u64,
        size: usize,
    ) -> Checks<Sparse<'_>> {
        let Checked::Valid(kind) = &sparse.indices.component_type else {
            return Err(format!("{what} has sparse indices of an unknown type"));
        };
        let width = component_bytes(kind.0);
        let replaced = sparse.count.0;
        let (indices, values) = (&sparse.indices, &sparse.values);
        let named = format!("the sparse indices of {what}");
        let view = indices.buffer_view.value();
        let bytes = self.elements(&named, view, indices.byte_offset.0, replaced, width, width)?;
        let list: Vec<usize> = bytes
            .chunks_exact(width)
            .take(replaced as usize)
            .map(|b| integer(b, kind.0) as usize)
            .collect();
        if let Some(bad) = list.iter().find(|&&i| i as u64 >= count) {
            return Err(format!("{named} contain {bad}, but there are {count} elements"));
        }
        let named = format!("the sparse values of {what}");
        let view = values.buffer_view.value();
        let values = self.elements(&named, view, values.byte_offset.0, replaced, size, size)?;
        Ok(Sparse { indices: list, values })
    }

    /// The accessor as a vertex attribute of the scene's buffers without conversion, if its layout
    /// is one that every device reads.
    pub fn stream(&mut self, index: usize, store: &mut Store) -> Checks<Option<Stream>> {
        let accessor = self.accessor(index)?;
        let (numeric, packing) = match (accessor.component, accessor.normalized) {
            (ComponentType::F32, _) => (Numeric::Float, Packing::Bits32),
            // Three small components are optional in Vulkan; integers that are not normalized
            // would reach the shader as integers.
            _ if accessor.components == 3 => return Ok(None),
            (ComponentType::U8, true) => (Numeric::Unorm, Packing::Bits8),
            (ComponentType::I8, true) => (Numeric::Snorm, Packing::Bits8),
            (ComponentType::U16, true) => (Numeric::Unorm, Packing::Bits16),
            (ComponentType::I16, true) => (Numeric::Snorm, Packing::Bits16),
            _ => return Ok(None),
        };
        let (Some((view, offset)), None) = (accessor.view, &accessor.sparse) else {
            return Ok(None);
        };
        let format = VertexFormat::new(numeric, packing, accessor.components as u8);
        let (stride, count) = (accessor.stride, accessor.count);
        let aligned = (offset | stride).is_multiple_of(format.alignment());
        if !aligned || accessor.components > 4 {
            return Ok(None);
        }
        let bytes = count.saturating_sub(1) * stride + format.bytes();
        let slice = self.stored(view, store)?.part(offset, bytes);
        Ok(Some(Stream { slice, format, stride: stride as u32 }))
    }

    /// The accessor as positions around an anchor that suits them, read and copied once however many
    /// primitives share them.
    pub fn placed(&mut self, index: usize, store: &mut Store) -> Checks<Placed> {
        if let Some(&placed) = self.placed.get(&index) {
            return Ok(placed);
        }
        let positions = self.accessor(index)?.vec3("POSITION")?;
        let bounds = Bounds::of(positions.iter().map(|p| p.as_dvec3()));
        let mut placed = Placed { bounds, anchor: Anchor::of(&bounds), stream: None };
        if placed.anchor != Anchor::default() {
            let around = |p: &Vec3| placed.anchor.store(p.as_dvec3());
            let around: Vec<Vec3> = positions.iter().map(around).collect();
            let slice = store.push(bytemuck::cast_slice(&around))?;
            let format = VertexFormat::F32X3;
            placed.stream = Some(Stream { slice, format, stride: format.bytes() as u32 });
        }
        self.placed.insert(index, placed);
        Ok(placed)
    }

    /// Whether all normals of the accessor point somewhere; read once.
    pub fn is_directed(&mut self, index: usize) -> Checks<bool> {
        if let Some(&directed) = self.directed.get(&index) {
            return Ok(directed);
        }
        let directed = self.accessor(index)?.vec3("NORMAL")?.iter().all(is_usable);
        self.directed.insert(index, directed);
        Ok(directed)
    }

    /// A buffer view in the scene's buffers, copied once.
    fn stored(&mut self, view: usize, store: &mut Store) -> Checks<Slice> {
        if let Some(&slice) = self.views.get(&view) {
            return Ok(slice);
        }
        let slice = store.push(self.view(view)?)?;
        self.views.insert(view, slice);
        Ok(slice)
    }

    /// The accessor as indices in the scene's buffers, with their number; all are below `vertices`.
    pub fn index_buffer(
        &mut self,
        index: usize,
        vertices: usize,
        store: &mut Store,
    ) -> Checks<(Slice, IndexFormat, u32)> {
        let below = |highest: u32| match (highest as usize) < vertices {
            true => Ok(()),
            false => Err(too_high(index, highest, vertices)),
        };
        if let Some(&(slice, format, highest)) = self.indices.get(&index) {
            below(highest)?;
            return Ok((slice, format, (slice.bytes / format.bytes()) as u32));
        }
        let list = self.indices(index)?;
        let highest = list.iter().copied().max().unwrap_or(0);
        if !list.is_empty() {
            below(highest)?;
        }
        let (slice, format) = if highest <= u32::from(u16::MAX) {
            let short: Vec<u16> = list.iter().map(|&i| i as u16).collect();
            (store.push(bytemuck::cast_slice(&short))?, IndexFormat::U16)
        } else {
            (store.push(bytemuck::cast_slice(&list))?, IndexFormat::U32)
        };
        self.indices.insert(index, (slice, format, highest));
        Ok((slice, format, list.len() as u32))
    }

    fn indices(&self, index: usize) -> Checks<Vec<u32>> {
        let accessor = self.accessor(index)?;
        accessor.expect(&[1], "an index accessor")?;
        accessor.integers(index)
    }

    /// The accessor as indices that are all below `vertices`.
    pub fn index_list(&self, index: usize, vertices: usize) -> Checks<Vec<u32>> {
        let list = self.indices(index)?;
        match list.iter().find(|&&i| i as usize >= vertices) {
            Some(&bad) => Err(too_high(index, bad, vertices)),
            None => Ok(list),
        }
    }
}

fn too_high(accessor: usize, index: u32, vertices: usize) -> String {
    format!("accessor {accessor} has the index {index}, but there are {vertices} vertices")
}

impl Accessor<'_> {
    /// All elements as floats, `components` per element, normalized where the file says so.
    pub fn floats(&self) -> Vec<f32> {
        let (size, n) = (component_bytes(self.component), self.components);
        let read = |bytes: &[u8], out: &mut [f32]| {
            for (value, bytes) in out.iter_mut().zip(bytes.chunks_exact(size)) {
                *value = number(bytes, self.component, self.normalized);
            }
        };
        let mut out = vec![0.0; self.count * n];
        if let Some(bytes) = self.bytes {
            for (i, element) in out.chunks_exact_mut(n).enumerate() {
                read(&bytes[i * self.stride..][..size * n], element);
            }
        }
        if let Some(sparse) = &self.sparse {
            for (&i, bytes) in sparse.indices.iter().zip(sparse.values.chunks_exact(size * n)) {
                read(bytes, &mut out[i * n..][..n]);
            }
        }
        out
    }

    /// All elements as integers: indices or joints, `components` per element.
    pub fn integers(&self, index: usize) -> Checks<Vec<u32>> {
        if !matches!(self.component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32) {
            return Err(format!("accessor {index} must have unsigned integers"));
        }
        let (size, n) = (component_bytes(self.component), self.components);
        let mut out = vec![0; self.count * n];
        if let Some(bytes) = self.bytes {
            for (i, element) in out.chunks_exact_mut(n).enumerate() {
                let bytes = &bytes[i * self.stride..][..size * n];
                for (value, bytes) in element.iter_mut().zip(bytes.chunks_exact(size)) {
                    *value = integer(bytes, self.component);
                }
            }
        }
        if let Some(sparse) = &self.sparse {
            for (&i, bytes) in sparse.indices.iter().zip(sparse.values.chunks_exact(size * n)) {
                for (value, bytes) in out[i * n..][..n].iter_mut().zip(bytes.chunks_exact(size)) {
                    *value = integer(bytes, self.component);
                }
            }
        }
        Ok(out)
    }

    fn expect(&self, components: &[usize], what: &str) -> Checks<()> {
        match components.contains(&self.components) {
            true => Ok(()),
            false => Err(format!("{what} has elements of {} components", self.components)),
        }
    }

    /// All elements as two floats.
    pub fn vec2(&self, what: &str) -> Checks<Vec<Vec2>> {
        self.expect(&[2], what)?;
        Ok(self.floats().chunks_exact(2).map(Vec2::from_slice).collect())
    }

    /// All elements as three floats.
    pub fn vec3(&self, what: &str) -> Checks<Vec<Vec3>> {
        self.expect(&[3], what)?;
        Ok(self.floats().chunks_exact(3).map(Vec3::from_slice).collect())
    }

    /// All elements as four floats.
    pub fn vec4(&self, what: &str) -> Checks<Vec<Vec4>> {
        self.expect(&[4], what)?;
        Ok(self.floats().chunks_exact(4).map(Vec4::from_slice).collect())
    }

    /// All elements as colours; three components are opaque.
    pub fn colors(&self, what: &str) -> Checks<Vec<Vec4>> {
        self.expect(&[3, 4], what)?;
        let n = self.components;
        let color = |c: &[f32]| Vec4::new(c[0], c[1], c[2], c.get(3).copied().unwrap_or(1.0));
        Ok(self.floats().chunks_exact(n).map(color).collect())
    }

    /// All elements as matrices.
    pub fn mat4(&self, what: &str) -> Checks<Vec<DMat4>> {
        self.expect(&[16], what)?;
        let matrix = |m: &[f32]| Mat4::from_cols_slice(m).as_dmat4();
        Ok(self.floats().chunks_exact(16).map(matrix).collect())
    }
}

fn kind_components(kind: Type) -> usize {
    match kind {
        Type::Scalar => 1,
        Type::Vec2 => 2,
        Type::Vec3 => 3,
        Type::Vec4 | Type::Mat2 => 4,
        Type::Mat3 => 9,
        Type::Mat4 => 16,
    }
}

/// One component of `bytes`, which has its size.
fn number(b: &[u8], component: ComponentType, normalized: bool) -> f32 {
    let scale = |v: f32, max: f32| if normalized { (v / max).max(-1.0) } else { v };
    match component {
        ComponentType::I8 => scale(b[0] as i8 as f32, 127.0),
        ComponentType::U8 => scale(b[0] as f32, 255.0),
        ComponentType::I16 => scale(i16::from_le_bytes([b[0], b[1]]) as f32, 32767.0),
        ComponentType::U16 => scale(u16::from_le_bytes([b[0], b[1]]) as f32, 65535.0),
        ComponentType::U32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]) as f32,
        ComponentType::F32 => f32::from_le_bytes([b[0], b[1], b[2], b[3]]),
    }
}

/// One unsigned component of `bytes`, which has its size.
fn integer(b: &[u8], component: ComponentType) -> u32 {
    match component {
        ComponentType::U8 | ComponentType::I8 => b[0].into(),
        ComponentType::U16 | ComponentType::I16 => u16::from_le_bytes([b[0], b[1]]).into(),
        ComponentType::U32 | ComponentType::F32 => u32::from_le_bytes([b[0], b[1], b[2], b[3]]),
    }
}
