//! Checks whether a pipeline is valid: its shaders, their interface, and the vertex attributes.

use super::{Fault, LINE_WIDTH_PX, STRIDE_BYTES};
use crate::{
    abi,
    error::{Error, Result},
    format::Format,
    pass::Pipeline,
    samples::Samples,
    shader::{Resource, Scalar, Shader, Stage, Varying},
    state::PrimitiveKind,
};
use std::collections::HashSet;

impl Pipeline {
    /// Checks that the pipeline is valid: shaders that fit each other, attributes that the vertex shader reads, state that
    /// Vulkan allows.
    ///
    /// Executors call it; there is no need to.
    ///
    /// # Errors
    /// [`Error::Usage`] naming the pipeline and the fault.
    pub fn validate(&self) -> Result<()> {
        let fault = |fault| Error::Usage(format!("pipeline `{}`: {fault}", self.label));
        check(self).map(drop).map_err(fault)
    }

    /// The resources of both stages by (set, binding), each once, sorted. An array that both declare
    /// has the larger of the two lengths, a block the larger of the two sizes.
    ///
    /// # Errors
    /// [`Error::Usage`] if the stages declare one of them as different kinds.
    pub fn resources(&self) -> Result<Vec<Resource>> {
        merged(&self.vertex, &self.fragment)
            .map_err(|fault| Error::Usage(format!("pipeline `{}`: {fault}", self.label)))
    }
}

fn merged(vertex: &Shader, fragment: &Shader) -> std::result::Result<Vec<Resource>, String> {
    let mut all: Vec<Resource> = Vec::new();
    for resource in vertex.reflection.resources.iter().chain(&fragment.reflection.resources) {
        let same = |r: &&mut Resource| (r.set, r.binding) == (resource.set, resource.binding);
        match all.iter_mut().find(same) {
            None => all.push(*resource),
            Some(other) if other.kind != resource.kind => {
                return Err(format!(
                    "set {} binding {} is {} in `{}` and {} in `{}`",
                    other.set,
                    other.binding,
                    other.kind,
                    vertex.label,
                    resource.kind,
                    fragment.label
                ));
            }
            Some(other) => {
                other.image = match (other.image, resource.image) {
                    (Some(a), Some(b)) => Some(a.merged(b).ok_or_else(|| {
                        format!(
                            "the image at set {} binding {} is {a} in `{}` and {b} in `{}`",
                            other.set, other.binding, vertex.label, fragment.label
                        )
                    })?),
                    (a, b) => a.or(b),
                };
                other.compares |= resource.compares;
                other.needs_normalized |= resource.needs_normalized;
                other.samples_integers |= resource.samples_integers;
                // 0 stands for a run-time array, which is as long as its binding.
                let open = other.count == 0 || resource.count == 0;
                other.count = if open { 0 } else { other.count.max(resource.count) };
                other.bytes = other.bytes.max(resource.bytes);
            }
        }
    }
    all.sort_by_key(|r| (r.set, r.binding));
    Ok(all)
}

/// Checks a pipeline; returns what has to be bound to it, sorted: its resources (see [`Pipeline::resources`]).
/// A run-time array occurs a second time if another variable at its place needs several elements.
pub(super) fn check(pipeline: &Pipeline) -> std::result::Result<Vec<Resource>, String> {
    for (shader, stage) in
        [(&pipeline.vertex, Stage::Vertex), (&pipeline.fragment, Stage::Fragment)]
    {
        if shader.stage != stage {
            return Err(format!("shader `{}` is no {stage} shader", shader.label));
        }
        if let Some(reason) = &shader.refusal {
            return Err(format!("shader `{}`: {reason}", shader.label));
        }
    }
    for binding in &pipeline.vertex_bindings {
        if binding.stride > STRIDE_BYTES {
            return Err(format!("a stride of {} bytes; at most {STRIDE_BYTES}", binding.stride));
        }
        let divisor = binding.rate.divisor().unwrap_or(0);
        if divisor > abi::MAX_DIVISOR {
            return Err(format!("a divisor of {divisor} instances; at most {}", abi::MAX_DIVISOR));
        }
    }
    check_primitives(pipeline)?;
    check_specialization(pipeline)?;
    check_attributes(pipeline)?;
    check_varyings(pipeline)?;
    check_alpha(pipeline)?;
    let mut all = merged(&pipeline.vertex, &pipeline.fragment)?;
    // Of two variables at one place, one may be a run-time array and the other as long as it says.
    let is_open = |r: &Resource, all: &[Resource]| {
        all.iter().any(|a| (a.set, a.binding) == (r.set, r.binding) && a.count == 0)
    };
    for shader in [&pipeline.vertex, &pipeline.fragment] {
        let arrays = shader.details.arrays.iter();
        let least = arrays.map(|array| Resource {
            count: array.least,
            ..shader.reflection.resources[array.number as usize]
        });
        let known: Vec<Resource> = least.filter(|r| r.count > 1 && is_open(r, &all)).collect();
        all.extend(known);
    }
    all.sort_by_key(|r| (r.set, r.binding));
    Ok(all)
}

/// Checks what concerns points and lines.
fn check_primitives(pipeline: &Pipeline) -> Fault {
    let (kind, fragment) = (pipeline.topology.kind(), &pipeline.fragment);
    if fragment.reflection.reads_point_coord && kind != PrimitiveKind::Point {
        return Err(format!(
            "`{}` reads gl_PointCoord, which Vulkan defines for points alone; the topology is {:?}",
            fragment.label, pipeline.topology
        ));
    }
    let widths = f32::MIN_POSITIVE..=LINE_WIDTH_PX;
    match kind == PrimitiveKind::Line && !widths.contains(&pipeline.line_width) {
        true => Err(format!(
            "lines are {} pixels wide; they can have more than 0 and up to {LINE_WIDTH_PX}",
            pipeline.line_width
        )),
        false => Ok(()),
    }
}

/// Checks that there is an alpha where it says which samples are covered.
fn check_alpha(pipeline: &Pipeline) -> Fault {
    let mut outputs = pipeline.fragment.reflection.outputs.iter();
    let is_alpha = |output: &Varying| {
        (output.location, output.index, output.scalar) == (0, 0, Scalar::Float)
            && output.component + output.count == 4
    };
    match pipeline.alpha_to_coverage && !outputs.any(is_alpha) {
        true => Err(format!(
            "the alpha of location 0 says which samples are covered, and shader `{}` writes none",
            pipeline.fragment.label
        )),
        false => Ok(()),
    }
}

/// Checks that the pipeline can draw to pixels of so many samples.
pub(crate) fn check_samples(pipeline: &Pipeline, samples: Samples) -> Fault {
    let fragment = &pipeline.fragment;
    match samples != Samples::One && fragment.reflection.interpolates {
        true => Err(format!(
            "shader `{}` interpolates at places of its own (interpolateAtSample, interpolateAtCentroid), which is not there \
             yet for several samples: use `sample` or `centroid` inputs",
            fragment.label
        )),
        false => Ok(()),
    }
}

/// Checks that the fragment shader writes the kind of value that each of the colour targets holds, and that the target can
/// be blended as wanted. Outputs at other locations vanish, as in Vulkan.
pub(crate) fn check_outputs(
    pipeline: &Pipeline,
    targets: impl ExactSizeIterator<Item = Format>,
) -> Fault {
    let fragment = &pipeline.fragment;
    let has_second = pipeline.has_second_source(targets.len());
    if has_second {
        if targets.len() > 1 {
            return Err(format!(
                "it blends with a second source, which only a single colour target can; there are {}",
                targets.len()
            ));
        }
        if !fragment.reflection.outputs.iter().any(|output| output.index == 1) {
            return Err(format!(
                "it blends with a second source, and `{}` writes none (`layout(location = 0, index = 1)`)",
                fragment.label
            ));
        }
    }
    for (n, format) in targets.enumerate() {
        let holds = Scalar::of(format);
        let mut outputs = fragment.reflection.outputs.iter();
        let counts = |o: &Varying| o.location as usize == n && (o.index == 0 || has_second);
        if let Some(output) = outputs.find(|o| counts(o) && o.scalar != holds) {
            return Err(format!(
                "`{}` writes {} to location {n}; the colour target is {format:?}, for which shaders write {holds}",
                fragment.label, output.scalar
            ));
        }
        if format.is_integer() && pipeline.color_state(n).blend.is_some() {
            return Err(format!(
                "it blends in colour target {n}, which is {format:?}; integers are not blended: give the target a \
                 `ColorState` of its own (`Pipeline::colors`)"
            ));
        }
    }
    Ok(())
}

/// Whether each constant is set once, and takes the 32 bits that a pipeline has for it.
fn check_specialization(pipeline: &Pipeline) -> Fault {
    let mut named = HashSet::new();
    for &(id, value) in &pipeline.specialization {
        if !named.insert(id) {
            return Err(format!("specialization constant {id} is set twice"));
        }
        let shaders = [&pipeline.vertex, &pipeline.fragment];
        if let Some(shader) = shaders.iter().find(|s| s.details.wide_constants.contains(&id)) {
            return Err(format!(
                "specialization constant {id} of `{}` is not 32 bits wide; pipelines set 32 bits",
                shader.label
            ));
        }
        // Reflection knows no other length, and sets are laid out by it.
        for shader in shaders {
            let mut lengths = shader.details.array_lengths.iter();
            if let Some((_, length)) = lengths.find(|known| known.0 == id && known.1 != value) {
                return Err(format!(
                    "specialization constant {id} of `{}` is the length of an array of resources, which \
                     cannot change from {length} to {value}: compile the shader with that length",
                    shader.label
                ));
            }
        }
    }
    Ok(())
}

fn check_attributes(pipeline: &Pipeline) -> Fault {
    let mut locations = HashSet::new();
    for attribute in &pipeline.vertex_attributes {
        let (location, format) = (attribute.location, attribute.format);
        let place = format!("vertex attribute {location}");
        if !locations.insert(location) {
            return Err(format!("{place} is there twice"));
        }
        if location >= abi::MAX_ATTRIBUTES {
            return Err(format!("{place} is beyond the {} that there are", abi::MAX_ATTRIBUTES));
        }
        if !(1..=4).contains(&format.count) {
            return Err(format!("{place} has {} components", format.count));
        }
        let Some(binding) = pipeline.vertex_bindings.get(attribute.binding as usize) else {
            let bindings = pipeline.vertex_bindings.len();
            return Err(format!("{place} is in binding {} of {bindings}", attribute.binding));
        };
        if !format.exists() {
            return Err(format!("{place} is {format:?}, which is no format of vertices"));
        }
        let align = format.alignment() as u32;
        if attribute.offset >= STRIDE_BYTES {
            return Err(format!("{place} starts at byte {}", attribute.offset));
        }
        if attribute.offset % align != 0 || binding.stride % align != 0 {
            return Err(format!(
                "{place} is at byte {} with stride {}; both have to be multiples of {align}",
                attribute.offset, binding.stride
            ));
        }
    }
    for input in &pipeline.vertex.reflection.inputs {
        let same = pipeline.vertex_attributes.iter().find(|a| a.location == input.location);
        let Some(attribute) = same else {
            let shader = &pipeline.vertex.label;
            return Err(format!(
                "`{shader}` reads vertex attribute {0}, and `vertex_attributes` has none with location {0}",
                input.location
            ));
        };
        let numeric = attribute.format.numeric;
        if Scalar::of_numeric(numeric) != input.scalar {
            return Err(format!(
                "vertex attribute {} is {} in `{}` and {} in memory ({numeric:?})",
                input.location,
                input.scalar,
                pipeline.vertex.label,
                Scalar::of_numeric(numeric)
            ));
        }
    }
    Ok(())
}

/// Checks that the vertex shader writes every input of the fragment shader.
fn check_varyings(pipeline: &Pipeline) -> Fault {
    let (vertex, fragment) = (&pipeline.vertex, &pipeline.fragment);
    let (written, read) = (vertex.reflection.distances, fragment.reflection.distances);
    for (name, written, read) in
        [("gl_ClipDistance", written.clip, read.clip), ("gl_CullDistance", written.cull, read.cull)]
    {
        if read > written {
            return Err(format!(
                "`{}` reads {read} elements of {name}, of which `{}` writes {written}",
                fragment.label, vertex.label
            ));
        }
    }
    for input in &fragment.reflection.inputs {
        if input.location >= abi::MAX_VARYINGS {
            return Err(format!(
                "`{}` reads location {}; there are {}",
                fragment.label,
                input.location,
                abi::MAX_VARYINGS
            ));
        }
        let outputs = vertex.reflection.outputs.iter();
        let mut written = 0u32;
        for output in outputs.filter(|o| o.location == input.location) {
            let bits = ((1 << output.count) - 1) << output.component;
            let read = ((1 << input.count) - 1) << input.component;
            if bits & read != 0 && output.scalar != input.scalar {
                return Err(format!(
                    "location {} is {} in `{}` and {} in `{}`",
                    input.location, output.scalar, vertex.label, input.scalar, fragment.label
                ));
            }
            written |= bits;
        }
        let read = ((1u32 << input.count) - 1) << input.component;
        if read & !written != 0 {
            return Err(format!(
                "`{}` reads location {}, which `{}` does not write",
                fragment.label, input.location, vertex.label
            ));
        }
    }
    Ok(())
}
