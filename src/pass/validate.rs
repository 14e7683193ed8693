//! Checks whether a pass is valid. All executors share this check, so that they refuse the same input with the
//! same words and never read outside a buffer.

mod pipeline;
mod sampling;
mod targets;

pub(crate) use pipeline::{check_outputs, check_samples};
pub(crate) use targets::check_color_targets;

use super::{Binding, BindingSet, BufferRange, Draw, IndexRanges, Pass, Pipeline};
use crate::{
    error::{Error, Result},
    kept::ByIdentity,
    shader::{Resource, ResourceKind},
    state::{DepthBias, Rect, Viewport},
    texture::Texture,
    vk,
};
use std::{collections::HashSet, sync::Arc};

/// Largest side of a target; every device with Vulkan 1.3 on a desktop has it.
const TARGET_SIDE_PX: u32 = 16384;
/// Largest distance of a viewport's edge from the origin that Vulkan promises for that side.
const VIEWPORT_BOUND_PX: f32 = 32768.0;
/// Largest stride and attribute offset that Vulkan promises.
const STRIDE_BYTES: u32 = 2048;
/// Largest width of a line.
pub(crate) const LINE_WIDTH_PX: f32 = 1024.0;
/// Alignment of a block in its buffer: the largest that Vulkan lets a device ask for.
const BLOCK_ALIGNMENT: usize = 256;

/// A fault, without saying where.
pub(crate) type Fault = std::result::Result<(), String>;

impl Pass {
    /// Checks that the pass is valid: extents, ranges inside their buffers, alignments, a binding of the
    /// right kind for every resource of every shader, every vertex that is read inside its buffer.
    ///
    /// Executors call it; there is no need to.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the draw or pipeline, the resource and the fault.
    pub fn validate(&self) -> Result<()> {
        self.check(&mut Known::default())
    }

    /// As [`Pass::validate`], with what an executor remembers.
    pub(crate) fn check(&self, known: &mut Known) -> Result<()> {
        let named = |what: String, fault: String| Error::Usage(format!("{what}: {fault}"));
        self.check_targets().map_err(|fault| named(format!("pass `{}`", self.label), fault))?;
        known.begin();
        for pipeline in &self.pipelines {
            let found = known.resources(pipeline);
            found
                .and_then(|()| check_samples(pipeline, self.samples))
                .and_then(|()| {
                    pipeline::check_outputs(pipeline, self.colors.iter().map(|c| c.format))
                })
                .map_err(|fault| named(format!("pipeline `{}`", pipeline.label), fault))?;
        }
        for (n, draw) in self.draws.iter().enumerate() {
            let Some(pipeline) = self.pipelines.get(draw.pipeline) else {
                return Err(Error::Usage(format!(
                    "draw {n}: it uses pipeline {}; the pass has {}",
                    draw.pipeline,
                    self.pipelines.len()
                )));
            };
            let resources = known.of_pass[draw.pipeline].clone();
            check_draw(draw, pipeline, &resources, &mut Verified { pass: self, known }).map_err(
                |fault| named(format!("draw {n} (pipeline `{}`)", pipeline.label), fault),
            )?;
        }
        Ok(())
    }
}

/// What an executor remembers of the passes that it has checked, and of the one that it checks.
#[derive(Default)]
pub(crate) struct Known {
    /// Ranges of indices.
    pub ranges: IndexRanges,
    /// The pipelines that were found valid, with what has to be bound to them.
    pipelines: ByIdentity<Pipeline, Arc<[Resource]>>,
    /// What has to be bound to the pipelines of the pass.
    of_pass: Vec<Arc<[Resource]>>,
    /// The sets and textures of the pass that were found valid, so that thousands of draws that share them are
    /// checked quickly. A key holds everything that its verdict depends on: pipeline, number of the set, address of
    /// the set. An address stands for its content: the pass does not change while it is checked.
    sets: HashSet<(usize, u32, usize)>,
    textures: HashSet<usize>,
}

impl Known {
    fn begin(&mut self) {
        self.of_pass.clear();
        self.sets.clear();
        self.textures.clear();
    }

    /// Checks the next pipeline of the pass.
    fn resources(&mut self, pipeline: &Arc<Pipeline>) -> Fault {
        let check = || pipeline::check(pipeline).map(Arc::from);
        let resources = self.pipelines.get(pipeline, check)?.clone();
        self.of_pass.push(resources);
        Ok(())
    }
}

/// The pass that is checked, and what is known.
struct Verified<'r> {
    pass: &'r Pass,
    known: &'r mut Known,
}

fn check_draw(
    draw: &Draw,
    pipeline: &Pipeline,
    resources: &[Resource],
    verified: &mut Verified<'_>,
) -> Fault {
    let push = pipeline
        .vertex
        .reflection
        .push_constant_bytes
        .max(pipeline.fragment.reflection.push_constant_bytes);
    if draw.push_constants.len() < push as usize {
        let bytes = draw.push_constants.len();
        return Err(format!("{bytes} bytes of push constants; the shaders read {push}"));
    }
    if let Some(DepthBias { constant, slope, clamp }) = draw.depth_bias
        && !(constant.is_finite() && slope.is_finite() && clamp.is_finite())
    {
        return Err(format!("a depth bias of {constant}, {slope}, {clamp} is no number"));
    }
    let [least, greatest] = draw.depth_bounds;
    if !(0.0 <= least && least <= greatest && greatest <= 1.0) {
        return Err(format!("depth bounds of {least} and {greatest}, which are no part of 0..=1"));
    }
    if let Some(viewport) = &draw.viewport {
        check_viewport(viewport)?;
    }
    if let Some(Rect { x, y, width, height }) = draw.scissor
        && [(x, width), (y, height)].iter().any(|(a, b)| a.saturating_add(*b) > i32::MAX as u32)
    {
        return Err(format!("the scissor {x},{y} {width}x{height} is too large"));
    }
    check_sets(draw, resources, verified)?;
    check_vertices(draw, pipeline, &mut verified.known.ranges)
}

fn check_viewport(v: &Viewport) -> Fault {
    let depths = 0.0..=1.0;
    let inside = |edge: f32| edge.abs() <= VIEWPORT_BOUND_PX;
    let sides = v.width > 0.0
        && v.height != 0.0
        && v.width <= TARGET_SIDE_PX as f32
        && v.height.abs() <= TARGET_SIDE_PX as f32;
    let edges = [v.x, v.y, v.x + v.width, v.y + v.height].into_iter().all(inside);
    if sides && edges && depths.contains(&v.min_depth) && depths.contains(&v.max_depth) {
        return Ok(());
    }
    let Viewport { x, y, width, height, min_depth, max_depth } = v;
    Err(format!(
        "the viewport {x},{y} {width}x{height} with depths {min_depth} to {max_depth} is empty, too \
         large, or has depths outside 0..=1"
    ))
}

/// Checks the sets of a draw against the resources of its pipeline, which are sorted by set.
fn check_sets(draw: &Draw, resources: &[Resource], verified: &mut Verified<'_>) -> Fault {
    for of_set in resources.chunk_by(|a, b| a.set == b.set) {
        let number = of_set[0].set;
        let set = draw.sets.get(number as usize);
        let key = (draw.pipeline, number, set.map_or(0, |set| Arc::as_ptr(set) as usize));
        if verified.known.sets.contains(&key) {
            continue;
        }
        for resource in of_set {
            check_resource(set, resource, verified)?;
        }
        verified.known.sets.insert(key);
    }
    Ok(())
}

fn check_resource(
    set: Option<&Arc<BindingSet>>,
    resource: &Resource,
    verified: &mut Verified<'_>,
) -> Fault {
    let place = format!("set {} binding {}", resource.set, resource.binding);
    let entry = set.and_then(|s| s.entries.iter().find(|e| e.binding == resource.binding));
    let Some(entry) = entry else {
        let bound: Vec<_> = set.iter().flat_map(|set| &set.entries).map(|e| e.binding).collect();
        let bound = match set {
            None => "the draw has no such set".to_string(),
            Some(_) => format!("bound in the set: {bound:?}"),
        };
        return Err(format!("{place} ({}) is not bound; {bound}", resource.kind));
    };
    let wanted = resource.count.max(1) as usize;
    if entry.resources.len() < wanted {
        let bound = entry.resources.len();
        return Err(format!("{place} has {wanted} elements; {bound} are bound"));
    }
    entry.resources.iter().try_for_each(|binding| {
        check_binding(binding, resource, verified).map_err(|fault| format!("{place}: {fault}"))
    })
}

fn check_binding(binding: &Binding, resource: &Resource, verified: &mut Verified<'_>) -> Fault {
    let (kind, block, texture) = match binding {
        Binding::Uniform(range) => (ResourceKind::Uniform, Some(range), None),
        Binding::Storage(range) => (ResourceKind::Storage, Some(range), None),
        Binding::Sampled(texture, _) => (ResourceKind::Sampled, None, Some(texture)),
        Binding::Texture(texture) => (ResourceKind::Texture, None, Some(texture)),
        Binding::Sampler(_) => (ResourceKind::Sampler, None, None),
        Binding::StorageImage(texture) => (ResourceKind::StorageImage, None, Some(texture)),
    };
    if kind != resource.kind {
        return Err(format!("it is {} in the shader; {kind} is bound", resource.kind));
    }
    if let Some(range) = block {
        check_range(range)?;
        let label = range.buffer.label();
        if range.offset % BLOCK_ALIGNMENT != 0 {
            let offset = range.offset;
            return Err(format!(
                "the block starts at byte {offset} of buffer `{label}`, no multiple of \
                 {BLOCK_ALIGNMENT}"
            ));
        }
        if range.bytes == 0 {
            return Err(format!("no bytes of buffer `{label}`; a block is bound to one at least"));
        }
        // `compute` puts zeros behind a shorter range of the host.
        let (device, wanted) = (range.buffer.device_memory().is_some(), resource.bytes as usize);
        if kind == ResourceKind::Uniform && device && range.bytes < wanted {
            let bytes = range.bytes;
            return Err(format!(
                "{bytes} bytes of buffer `{label}`, which lives on a device; the block has {wanted}"
            ));
        }
    }
    sampling::check_sampling(binding, resource)?;
    match texture {
        Some(texture) if verified.known.textures.insert(Arc::as_ptr(texture) as usize) => {
            check_texture(texture, verified.pass)
                .map_err(|fault| format!("texture `{}` {fault}", texture.label()))
        }
        _ => Ok(()),
    }
}

fn check_texture(texture: &Texture, pass: &Pass) -> Fault {
    if let Some(image) = texture.image() {
        if image.usage() == vk::ImageUse::Sampled {
            return Err("is an image for kernels: passes take those that are made with `ImageUse::Attachment` or \
                        `ImageUse::Storage`"
                .into());
        }
        let colors = pass.colors.iter().filter_map(|color| color.image.as_ref());
        let depth = pass.depth.iter().filter_map(|depth| depth.image.as_ref());
        let stencil = pass.stencil.iter().filter_map(|stencil| stencil.image.as_ref());
        if colors.chain(depth).chain(stencil).any(|target| target.is(image)) {
            return Err("is a target of the pass that binds it: draw to another image".into());
        }
        return Ok(());
    }
    let (extent, shape) = (texture.extent(), texture.shape());
    let sides = 1..=TARGET_SIDE_PX;
    if !sides.contains(&extent.width) || !sides.contains(&extent.height) {
        return Err(format!("is {extent} texels; each side is 1 to {TARGET_SIDE_PX}"));
    }
    shape.check(extent)?;
    let (levels, most) = (texture.levels().unwrap_or_default(), shape.most_levels(extent));
    if !(1..=most as usize).contains(&levels.len()) {
        return Err(format!("has {} levels, not 1 to {most}", levels.len()));
    }
    for (n, level) in (0..).zip(levels) {
        let pictures = shape.pictures(n) as usize;
        let bytes = extent.level(n).pixels() * pictures * texture.format().texel_bytes();
        if level.len() != bytes {
            return Err(format!("has {} bytes in level {n}, not {bytes}", level.len()));
        }
    }
    Ok(())
}

fn check_range(range: &BufferRange) -> Fault {
    let BufferRange { buffer, offset, bytes } = range;
    let start = buffer.device_memory().map_or(0, |memory| memory.offset());
    if !start.is_multiple_of(BLOCK_ALIGNMENT as u64) {
        return Err(format!(
            "buffer `{}` begins at byte {start} of its memory, no multiple of {BLOCK_ALIGNMENT}",
            buffer.label()
        ));
    }
    if offset.checked_add(*bytes).is_none_or(|end| end > buffer.len()) {
        let (label, all) = (buffer.label(), buffer.len());
        return Err(format!("{bytes} bytes from {offset} on of buffer `{label}`, which has {all}"));
    }
    Ok(())
}

/// Whether all vertices and indices that the draw reads are there.
fn check_vertices(draw: &Draw, pipeline: &Pipeline, ranges: &mut IndexRanges) -> Fault {
    if draw.vertex_buffers.len() < pipeline.vertex_bindings.len() {
        return Err(format!(
            "{} vertex buffers; the pipeline has {}",
            draw.vertex_buffers.len(),
            pipeline.vertex_bindings.len()
        ));
    }
    for range in &draw.vertex_buffers {
        check_range(range)?;
    }
    let vertices = match &draw.indices {
        Some(indices) => {
            check_range(&indices.range)?;
            let width = indices.format.bytes();
            if indices.range.offset % width != 0 {
                let offset = indices.range.offset;
                return Err(format!("indices of {width} bytes start at byte {offset}"));
            }
            if draw.indirect.is_some() {
                return check_commands(draw, pipeline);
            }
            let (first, count) = (draw.first as usize, draw.count as usize);
            let there = indices.range.bytes / width;
            if first.checked_add(count).is_none_or(|end| end > there) {
                return Err(format!("{count} indices from {first} on; there are {there}"));
            }
            let elements = u64::from(draw.first)..u64::from(draw.first) + u64::from(draw.count);
            let (base, read) = (i64::from(draw.base_vertex), !elements.is_empty());
            if let Some(range) = &indices.vertices
                && range.is_empty()
            {
                return Err(format!("its indices are declared as {range:?}, which are none"));
            }
            match read.then(|| ranges.of(indices, elements)) {
                None => None,
                Some(Some((low, high))) => Some((base + i64::from(low), base + i64::from(high))),
                // Nobody knows which vertices the draw reads; executors keep to the ranges that are bound.
                Some(None) => Some((0, 0)),
            }
        }
        None if draw.indirect.is_some() => return check_commands(draw, pipeline),
        None => draw
            .count
            .checked_sub(1)
            .map(|last| (i64::from(draw.first), i64::from(draw.first) + i64::from(last))),
    };
    let Some((first, last)) = vertices.filter(|_| draw.instances > 0) else { return Ok(()) };
    if first < 0 || last > i64::from(u32::MAX) {
        return Err(format!("it reads vertices {first} to {last}; they are numbered with 32 bits"));
    }
    let last_instance = i64::from(draw.first_instance) + i64::from(draw.instances) - 1;
    if last_instance > i64::from(u32::MAX) {
        let first = draw.first_instance;
        return Err(format!(
            "it draws instances {first} to {last_instance}; they are numbered with 32 bits"
        ));
    }
    let of_one = pipeline.topology.primitives(draw.count);
    if u64::from(of_one) * u64::from(draw.instances) > u64::from(u32::MAX) {
        return Err(format!(
            "{of_one} primitives in each of {} instances are more than {}",
            draw.instances,
            u32::MAX
        ));
    }
    check_attributes(draw, pipeline, last, [draw.first_instance.into(), last_instance])
}

/// Whether the commands of a draw are there, and one element of each attribute: nobody knows which are read.
fn check_commands(draw: &Draw, pipeline: &Pipeline) -> Fault {
    let Some(indirect) = &draw.indirect else { return Ok(()) };
    check_range(&indirect.commands)?;
    indirect.count.as_ref().map_or(Ok(()), check_range)?;
    indirect.check(draw.indices.is_some())?;
    check_attributes(draw, pipeline, 0, [0, 0])
}

/// Whether each attribute has its elements up to vertex `last`, and those of the instances from `first` to `last_instance`.
fn check_attributes(
    draw: &Draw,
    pipeline: &Pipeline,
    last: i64,
    [first, last_instance]: [i64; 2],
) -> Fault {
    for attribute in &pipeline.vertex_attributes {
        let n = attribute.binding as usize;
        let (binding, range) = (pipeline.vertex_bindings[n], &draw.vertex_buffers[n]);
        let (what, element) = match binding.rate.divisor().map(i64::from) {
            None => ("vertex", last),
            Some(1) => ("instance", last_instance),
            // Every instance reads the element of the first one.
            Some(0) => ("element", first),
            Some(n) => ("element", (last_instance - first) / n + first),
        };
        let size = attribute.format.bytes() as i64;
        let end = element * i64::from(binding.stride) + i64::from(attribute.offset) + size;
        if end > range.bytes as i64 {
            return Err(format!(
                "attribute {} of {what} {element} ends at byte {end} of binding {n} (buffer `{}`), \
                 which has {}",
                attribute.location,
                range.buffer.label(),
                range.bytes
            ));
        }
        let alignment = attribute.format.alignment();
        if range.offset % alignment != 0 {
            return Err(format!(
                "binding {n} starts at byte {} of buffer `{}`; attribute {} has to begin at a multiple of {alignment}",
                range.offset,
                range.buffer.label(),
                attribute.location,
            ));
        }
    }
    Ok(())
}
