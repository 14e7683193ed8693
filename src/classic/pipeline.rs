//! `VkPipeline` from a [`Pipeline`] and the formats of the pass.

use super::{
    blend::{blend_state, logic_op},
    layout::Layout,
    primitives::{line_state, line_width, of_primitives, primitive_topology, provoking_state},
    stencil::stencil_state,
    target::depth_stencil_format,
};
use crate::{
    error::{Error, Result},
    format::{Format, VertexFormat},
    pass::{Pass, Pipeline, StepRate, VertexAttribute},
    samples::Samples,
    shader::{Resource, Shader, Varying},
    state::{Cull, FrontFace},
    vk::{Gpu, compare_op, missing_feature, vertex_format, vk_format},
};
use ash::vk;
use std::{
    hash::{Hash, Hasher},
    sync::Arc,
};

/// The properties of the pass that a compiled pipeline depends on, beside its [`Pipeline`].
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
pub(super) struct Variant {
    colors: Vec<Format>,
    /// The format of the image of depths and stencil values, and which of them there are.
    depth_stencil: Option<Format>,
    depth: bool,
    stencil: bool,
    samples: Samples,
    /// The resources, with run-time arrays as long as the longest that the pass binds.
    resources: Vec<Resource>,
}

impl Variant {
    /// The variants that `pass` needs of its pipelines, in their order. The pass was validated.
    pub fn all(gpu: &Gpu, pass: &Pass) -> Result<Vec<Self>> {
        let depth_stencil = depth_stencil_format(gpu, pass)?;
        let variant = |pipeline: &Arc<Pipeline>| {
            let resources = pipeline.resources()?;
            let colors = pass.colors.iter().map(|color| color.format).collect();
            Ok(Self {
                colors,
                depth_stencil,
                depth: pass.depth.is_some(),
                stencil: pass.stencil.is_some(),
                samples: pass.samples,
                resources,
            })
        };
        let mut all: Vec<Self> = pass.pipelines.iter().map(variant).collect::<Result<_>>()?;
        // The run-time arrays of each pipeline, with the length that is bound to them.
        let mut open: Vec<Vec<(usize, u32)>> = all.iter().map(|v| v.run_time_arrays()).collect();
        for draw in &pass.draws {
            for (n, length) in &mut open[draw.pipeline] {
                let Resource { set, binding, .. } = all[draw.pipeline].resources[*n];
                let bound = draw.sets.get(set as usize);
                let entry = bound.and_then(|s| s.entries.iter().find(|e| e.binding == binding));
                *length = entry.map_or(0, |e| e.resources.len() as u32).max(*length);
            }
        }
        for (variant, arrays) in all.iter_mut().zip(open) {
            for (n, length) in arrays {
                variant.resources[n].count = length;
            }
        }
        Ok(all)
    }

    /// The numbers of the resources that are run-time arrays, with the least length of one.
    fn run_time_arrays(&self) -> Vec<(usize, u32)> {
        let resources = self.resources.iter().enumerate();
        resources.filter(|(_, r)| r.count == 0).map(|(n, _)| (n, 1)).collect()
    }
}

/// The content that a compiled pipeline is made of. Equal content makes equal keys, whatever its labels are and
/// even if it is made twice.
pub(super) struct Key(pub Arc<Pipeline>, pub Variant);

impl Key {
    fn content(&self) -> impl Eq + Hash + '_ {
        let Pipeline {
            label: _,
            vertex,
            fragment,
            specialization,
            vertex_bindings,
            vertex_attributes,
            topology,
            provoking_vertex,
            line_width,
            line_mode,
            cull,
            front_face,
            depth,
            stencil,
            depth_clamp,
            depth_clip,
            colors,
            logic_op,
            sample_mask,
            alpha_to_coverage,
            alpha_to_one,
            sample_shading,
        } = &*self.0;
        let state = (
            (topology, provoking_vertex, line_width.to_bits(), line_mode),
            cull,
            front_face,
            (depth, stencil),
            (depth_clamp, depth_clip),
            colors,
            logic_op,
        );
        let vertices = (vertex_bindings, vertex_attributes);
        let samples = (sample_mask, alpha_to_coverage, alpha_to_one, sample_shading);
        (vertex, fragment, specialization, vertices, (state, samples), &self.1)
    }
}

impl PartialEq for Key {
    fn eq(&self, other: &Self) -> bool {
        self.content() == other.content()
    }
}

impl Eq for Key {}

impl Hash for Key {
    fn hash<H: Hasher>(&self, state: &mut H) {
        self.content().hash(state);
    }
}

/// A compiled pipeline with its layout.
pub(super) struct Compiled {
    gpu: Gpu,
    pub raw: vk::Pipeline,
    pub layout: Layout,
    pub resources: Vec<Resource>,
    /// Vertex buffers that it reads; a draw may bring more.
    pub vertex_bindings: usize,
}

impl Compiled {
    pub fn new(gpu: &Gpu, pipeline: &Pipeline, variant: &Variant) -> Result<Self> {
        let (vertex, fragment) = (&pipeline.vertex, &pipeline.fragment);
        check_limits(gpu, pipeline, variant)?;
        let push =
            vertex.reflection.push_constant_bytes.max(fragment.reflection.push_constant_bytes);
        let layout = Layout::new(gpu, &pipeline.label, &variant.resources, push)?;
        let modules = Modules::new(gpu, [vertex, fragment])?;
        // From here on the pipeline is destroyed if anything fails.
        let mut compiled = Self {
            gpu: gpu.clone(),
            raw: vk::Pipeline::null(),
            layout,
            resources: variant.resources.clone(),
            vertex_bindings: pipeline.vertex_bindings.len(),
        };
        compiled.raw = create(gpu, pipeline, variant, &modules, compiled.layout.raw)?;
        gpu.0.set_name(compiled.raw, &pipeline.label);
        Ok(compiled)
    }
}

impl Drop for Compiled {
    fn drop(&mut self) {
        // SAFETY: recordings that use the pipeline hold it until they have ended.
        unsafe { self.gpu.0.device.destroy_pipeline(self.raw, None) };
    }
}

/// Checks the limits of the device's own pipeline for attributes, varyings and outputs. Vulkan guarantees less
/// than compute offers.
fn check_limits(gpu: &Gpu, pipeline: &Pipeline, variant: &Variant) -> Result<()> {
    let limits = gpu.0.draw_limits;
    let (vertex, fragment) = (&pipeline.vertex.reflection, &pipeline.fragment.reflection);
    let locations = |all: &[Varying]| all.iter().map(|v| v.location + 1).max().unwrap_or(0);
    for (used, most, what) in [
        (pipeline.vertex_bindings.len() as u32, limits.vertex_bindings, "vertex buffers"),
        (locations(&vertex.inputs), limits.vertex_attributes, "locations of vertex attributes"),
        (locations(&vertex.outputs), limits.vertex_outputs, "locations of vertex outputs"),
        (locations(&fragment.inputs), limits.fragment_inputs, "locations of fragment inputs"),
        (locations(&fragment.outputs), limits.fragment_outputs, "locations of fragment outputs"),
        (variant.colors.len() as u32, limits.colors, "colour targets"),
        (
            match pipeline.has_second_source(variant.colors.len()) && limits.second_sources > 0 {
                true => locations(&fragment.outputs),
                false => 0,
            },
            limits.second_sources,
            "locations of fragment outputs beside a second source",
        ),
    ] {
        if used > most {
            return Err(Error::Device(format!(
                "pipeline `{}` has {used} {what}, beyond the {most} of {}; the compute executor has \
                 no such limit",
                pipeline.label,
                gpu.info().name
            )));
        }
    }
    let states: Vec<_> = (0..variant.colors.len()).map(|n| pipeline.color_state(n)).collect();
    if !limits.independent_blend && states.windows(2).any(|pair| pair[0] != pair[1]) {
        return Err(Error::Device(format!(
            "pipeline `{}` blends its colour targets differently, which {} does not offer \
             (independentBlend); the compute executor does",
            pipeline.label,
            gpu.info().name
        )));
    }
    Ok(())
}

/// The shader modules of both stages, which a pipeline needs only while it is created.
struct Modules<'g> {
    gpu: &'g Gpu,
    raw: Vec<vk::ShaderModule>,
}

impl<'g> Modules<'g> {
    fn new(gpu: &'g Gpu, shaders: [&Shader; 2]) -> Result<Self> {
        let mut modules = Self { gpu, raw: Vec::new() };
        for shader in shaders {
            if let Some(feature) = missing_feature(&gpu.0.lacking, &shader.spirv) {
                let device = &gpu.info().name;
                let reason = format!("it needs {feature}, which {device} does not offer");
                return Err(Error::shader(&shader.label, reason));
            }
            let info = vk::ShaderModuleCreateInfo::default().code(&shader.spirv);
            // SAFETY: `Shader` was parsed and reflected; the words are passed as they are.
            let module = unsafe { gpu.0.device.create_shader_module(&info, None) }
                .map_err(|e| Error::shader(&shader.label, format!("the driver refuses it: {e}")))?;
            modules.raw.push(module);
        }
        Ok(modules)
    }
}

impl Drop for Modules<'_> {
    fn drop(&mut self) {
        for module in self.raw.drain(..) {
            // SAFETY: no pipeline is being created from it any more.
            unsafe { self.gpu.0.device.destroy_shader_module(module, None) };
        }
    }
}

fn create(
    gpu: &Gpu,
    pipeline: &Pipeline,
    variant: &Variant,
    modules: &Modules<'_>,
    layout: vk::PipelineLayout,
) -> Result<vk::Pipeline> {
    let (entries, data) = specialization(&pipeline.specialization);
    let specialization = vk::SpecializationInfo::default().map_entries(&entries).data(&data);
    let stage = |flag, module| {
        vk::PipelineShaderStageCreateInfo::default()
            .stage(flag)
            .module(module)
            .name(c"main")
            .specialization_info(&specialization)
    };
    let stages = [
        stage(vk::ShaderStageFlags::VERTEX, modules.raw[0]),
        stage(vk::ShaderStageFlags::FRAGMENT, modules.raw[1]),
    ];

    let bindings: Vec<_> = pipeline
        .vertex_bindings
        .iter()
        .enumerate()
        .map(|(n, b)| {
            vk::VertexInputBindingDescription::default()
                .binding(n as u32)
                .stride(b.stride)
                .input_rate(match b.rate {
                    StepRate::Vertex => vk::VertexInputRate::VERTEX,
                    StepRate::Instance | StepRate::Instances(_) => vk::VertexInputRate::INSTANCE,
                })
        })
        .collect();
    let divisors: Vec<_> = pipeline
        .vertex_bindings
        .iter()
        .enumerate()
        .filter_map(|(n, b)| {
            let divisor = b.rate.divisor().filter(|divisor| *divisor != 1)?;
            Some(vk::VertexInputBindingDivisorDescriptionKHR { binding: n as u32, divisor })
        })
        .collect();
    // A device without the feature takes no divisor but 1, not even 0.
    let most = gpu.0.draw_limits.divisor;
    if let Some(one) = divisors.iter().find(|d| d.divisor > most || most == 1) {
        return Err(Error::Device(format!(
            "pipeline `{}`: {} itself draws with no divisor of {}; the compute executor does",
            pipeline.label,
            gpu.info().name,
            one.divisor
        )));
    }
    let mut divisors = vk::PipelineVertexInputDivisorStateCreateInfoKHR::default()
        .vertex_binding_divisors(&divisors);
    // Attributes that the shader does not read are legal to leave out, and some formats are not
    // there on every device.
    let read = |a: &&VertexAttribute| {
        pipeline.vertex.reflection.inputs.iter().any(|i| i.location == a.location)
    };
    let mut attributes = Vec::new();
    for attribute in pipeline.vertex_attributes.iter().filter(read) {
        attributes.push(
            vk::VertexInputAttributeDescription::default()
                .location(attribute.location)
                .binding(attribute.binding)
                .format(attribute_format(gpu, pipeline, attribute)?)
                .offset(attribute.offset),
        );
    }
    let vertex_input = vk::PipelineVertexInputStateCreateInfo::default()
        .vertex_binding_descriptions(&bindings)
        .vertex_attribute_descriptions(&attributes);
    let vertex_input = match divisors.vertex_binding_divisor_count {
        0 => vertex_input,
        _ => vertex_input.push_next(&mut divisors),
    };
    let assembly = vk::PipelineInputAssemblyStateCreateInfo::default()
        .topology(primitive_topology(pipeline.topology));
    let viewport =
        vk::PipelineViewportStateCreateInfo::default().viewport_count(1).scissor_count(1);
    let raster = vk::PipelineRasterizationStateCreateInfo::default()
        .polygon_mode(vk::PolygonMode::FILL)
        .cull_mode(match pipeline.cull {
            Cull::None => vk::CullModeFlags::NONE,
            Cull::Front => vk::CullModeFlags::FRONT,
            Cull::Back => vk::CullModeFlags::BACK,
        })
        .front_face(match pipeline.front_face {
            FrontFace::CounterClockwise => vk::FrontFace::COUNTER_CLOCKWISE,
            FrontFace::Clockwise => vk::FrontFace::CLOCKWISE,
        })
        .depth_clamp_enable(pipeline.depth_clamp)
        .line_width(line_width(pipeline));
    let mut clip = vk::PipelineRasterizationDepthClipStateCreateInfoEXT::default()
        .depth_clip_enable(pipeline.clips_depth());
    let raster = match pipeline.clips_depth() == pipeline.depth_clamp {
        true => raster.push_next(&mut clip),
        false => raster,
    };
    let limits = &gpu.0.draw_limits;
    let mut lines = line_state(pipeline, limits);
    let raster = match &mut lines {
        Some(lines) => raster.push_next(lines),
        None => raster,
    };
    let mut provoking = provoking_state(pipeline);
    let raster = match &mut provoking {
        Some(provoking) => raster.push_next(provoking),
        None => raster,
    };
    let sample_mask = [pipeline.sample_mask];
    let samples = vk::PipelineMultisampleStateCreateInfo::default()
        .rasterization_samples(vk::SampleCountFlags::from_raw(variant.samples.count()))
        .sample_mask(&sample_mask)
        .alpha_to_coverage_enable(pipeline.alpha_to_coverage)
        .alpha_to_one_enable(pipeline.alpha_to_one)
        .sample_shading_enable(pipeline.sample_shading)
        .min_sample_shading(1.0);
    let depth = vk::PipelineDepthStencilStateCreateInfo::default()
        .depth_test_enable(variant.depth && pipeline.depth.test)
        .depth_write_enable(variant.depth && pipeline.depth.test && pipeline.depth.write)
        .depth_compare_op(compare_op(pipeline.depth.compare))
        .depth_bounds_test_enable(variant.depth && pipeline.depth.bounds)
        .stencil_test_enable(variant.stencil && pipeline.stencil.is_some())
        .front(pipeline.stencil.map_or_else(Default::default, |test| stencil_state(test.front)))
        .back(pipeline.stencil.map_or_else(Default::default, |test| stencil_state(test.back)));
    for (n, &format) in variant.colors.iter().enumerate() {
        if pipeline.color_state(n).blend.is_some() && !gpu.0.blends_in(format) {
            return Err(Error::Device(format!(
                "pipeline `{}`, colour target {n}: {} itself blends in no target of {format:?}; the compute executor does",
                pipeline.label,
                gpu.info().name
            )));
        }
    }
    let has_second = pipeline.has_second_source(variant.colors.len());
    let clips_apart = pipeline.clips_depth() == pipeline.depth_clamp;
    let wanted = [
        (pipeline.logic_op.is_some(), limits.logic_ops, "logic operations (logicOp)"),
        (pipeline.depth.bounds, limits.depth_bounds, "depth bounds test (depthBounds)"),
        (has_second, limits.second_sources > 0, "second source (dualSrcBlend)"),
        (pipeline.depth_clamp, limits.clamps_depth, "depth clamp (depthClamp)"),
        (
            pipeline.fragment.reflection.writes_stencil,
            false,
            "export of stencil values, whose extension is not enabled",
        ),
        (pipeline.alpha_to_one, limits.alpha_to_one, "alpha to one (alphaToOne)"),
        (pipeline.sample_shading, limits.sample_shading, "shading of samples (sampleRateShading)"),
        (
            clips_apart,
            limits.clips_depth_apart,
            "switch of its own for depth clipping (depthClipEnable)",
        ),
    ];
    let mut wanted = wanted.into_iter().chain(of_primitives(pipeline, limits));
    if let Some((.., lacking)) = wanted.find(|(wanted, offered, _)| *wanted && !offered) {
        return Err(Error::Device(format!(
            "pipeline `{}`: {} itself has no {lacking}; the compute executor does",
            pipeline.label,
            gpu.info().name
        )));
    }
    let states = (0..variant.colors.len()).map(|target| blend_state(pipeline.color_state(target)));
    let blend_attachments: Vec<_> = states.collect();
    let blend = vk::PipelineColorBlendStateCreateInfo::default()
        .logic_op_enable(pipeline.logic_op.is_some())
        .logic_op(pipeline.logic_op.map_or(vk::LogicOp::COPY, logic_op))
        .attachments(&blend_attachments);
    let dynamic = vk::PipelineDynamicStateCreateInfo::default().dynamic_states(&[
        vk::DynamicState::VIEWPORT,
        vk::DynamicState::SCISSOR,
        vk::DynamicState::DEPTH_BIAS_ENABLE,
        vk::DynamicState::DEPTH_BIAS,
        vk::DynamicState::BLEND_CONSTANTS,
        vk::DynamicState::DEPTH_BOUNDS,
        vk::DynamicState::STENCIL_REFERENCE,
    ]);
    let color_formats: Vec<_> = variant.colors.iter().copied().map(vk_format).collect();
    let mut rendering =
        vk::PipelineRenderingCreateInfo::default().color_attachment_formats(&color_formats);
    let format = variant.depth_stencil.map_or(vk::Format::UNDEFINED, vk_format);
    if variant.depth {
        rendering = rendering.depth_attachment_format(format);
    }
    if variant.stencil {
        rendering = rendering.stencil_attachment_format(format);
    }
    let info = [vk::GraphicsPipelineCreateInfo::default()
        .stages(&stages)
        .vertex_input_state(&vertex_input)
        .input_assembly_state(&assembly)
        .viewport_state(&viewport)
        .rasterization_state(&raster)
        .multisample_state(&samples)
        .depth_stencil_state(&depth)
        .color_blend_state(&blend)
        .dynamic_state(&dynamic)
        .layout(layout)
        .push_next(&mut rendering)];
    // SAFETY: everything `info` points to lives through the call; the pass was validated.
    let created =
        unsafe { gpu.0.device.create_graphics_pipelines(gpu.0.pipeline_cache, &info, None) };
    let what = || format!("compiling pipeline `{}`", pipeline.label);
    Ok(created.map_err(|(_, e)| gpu.failure(&what(), e))?[0])
}

fn specialization(constants: &[(u32, u32)]) -> (Vec<vk::SpecializationMapEntry>, Vec<u8>) {
    let entry = |(n, &(id, _)): (usize, &(u32, u32))| vk::SpecializationMapEntry {
        constant_id: id,
        offset: n as u32 * 4,
        size: 4,
    };
    let entries = constants.iter().enumerate().map(entry).collect();
    (entries, constants.iter().flat_map(|(_, value)| value.to_ne_bytes()).collect())
}

/// The format of an attribute. Three narrow components are read as four where the device lacks the
/// format and the shader takes no fourth one: buffers end with enough padding for the last element.
fn attribute_format(
    gpu: &Gpu,
    pipeline: &Pipeline,
    attribute: &VertexAttribute,
) -> Result<vk::Format> {
    let reads = |format: &vk::Format| gpu.0.reads_vertices_as(*format);
    if let Some(format) = vertex_format(attribute.format).filter(reads) {
        return Ok(format);
    }
    let inputs = pipeline.vertex.reflection.inputs.iter();
    let used = inputs.filter(|i| i.location == attribute.location).map(|i| i.component + i.count);
    let narrow = attribute.format.count == 3 && used.max() <= Some(3);
    let wider = vertex_format(VertexFormat { count: 4, ..attribute.format });
    if let Some(wider) = wider.filter(reads).filter(|_| narrow) {
        return Ok(wider);
    }
    Err(Error::Device(format!(
        "pipeline `{}`: {} reads no vertices of {:?}; the compute executor does",
        pipeline.label,
        gpu.info().name,
        attribute.format
    )))
}
