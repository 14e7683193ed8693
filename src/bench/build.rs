//! From a recipe to a pass: shaders, materials, buffers, draws.

use super::{
    geometry::{Kind, Model, Object, Vertex, model},
    lines::{Lines, sides},
    recipe::Recipe,
};
use crate::{
    error::{Error, Result},
    format::{Format, VertexFormat},
    image::Extent,
    pass::{
        Binding, BindingEntry, BindingSet, BufferRange, BufferSource, Draw, IndexFormat, Indices,
        Pass, Pipeline, StepRate, VertexAttribute, VertexBinding,
    },
    prebuilt::bench as prebuilt,
    random::Random,
    shader::{Shader, Stage},
    state::{Blend, Cull, DepthState, Topology},
    target::{ColorTarget, DepthTarget, StencilTarget},
    texture::{Sampler, Texture},
};
use glam::{Mat4, Vec3, Vec4};
use std::{
    borrow::Cow,
    mem::offset_of,
    sync::{Arc, OnceLock},
};

/// Textures that the fragment shader declares.
const MAPS: u32 = 8;

/// A number of further varyings, the vertex shader, and the fragment shaders for one target and for several.
type Shaders = (u32, Arc<Shader>, [Arc<Shader>; 2]);

/// The shader pair of `recipe`, reflected once per process, so that executors know it again.
fn shaders(recipe: &Recipe) -> Result<(Arc<Shader>, Arc<Shader>)> {
    static MADE: OnceLock<Vec<Shaders>> = OnceLock::new();
    let made = match MADE.get() {
        Some(made) => made,
        None => {
            let of = |at: usize| {
                let (n, vertex) = prebuilt::VERTEX[at];
                let shader = |stage, label, words| {
                    Shader::own(stage, &format!("bench/{label} ({n})"), words).map(Arc::new)
                };
                let fragment = |label, (_, words)| shader(Stage::Fragment, label, words);
                Ok((
                    n,
                    shader(Stage::Vertex, "surface.vert", vertex)?,
                    [
                        fragment("surface.frag", prebuilt::FRAGMENT[at])?,
                        fragment("surface.frag, several targets", prebuilt::SEVERAL_FRAGMENT[at])?,
                    ],
                ))
            };
            let all = (0..prebuilt::VERTEX.len()).map(of).collect::<Result<_>>()?;
            MADE.get_or_init(|| all)
        }
    };
    let found = made.iter().find(|(n, ..)| *n == recipe.varyings);
    let (_, vertex, fragments) = found.ok_or_else(|| {
        Error::Usage(format!("there is no shader with {} further varyings", recipe.varyings))
    })?;
    let [one, several] = fragments;
    let fragment = if recipe.targets == 1 { one } else { several };
    Ok((vertex.clone(), fragment.clone()))
}

/// Records `recipe` for a picture of `extent`.
///
/// # Errors
/// [`Error::Usage`] if the recipe contradicts itself.
pub fn pass(name: &str, recipe: &Recipe, extent: Extent) -> Result<Pass> {
    recipe.check().map_err(|reason| Error::Usage(format!("{name}: {reason}")))?;
    let model = model(recipe, extent);
    let buffer = |label: &str, bytes: &[u8]| Arc::new(BufferSource::new(label, bytes.to_vec()));
    let topology = match recipe.lines {
        None => Topology::TriangleList,
        Some(_) => Topology::LineList,
    };
    // Indices of a primitive.
    let corners = topology.elements(1);
    let meshes: Vec<_> = model
        .meshes
        .iter()
        .map(|mesh| {
            let indices: Cow<[u32]> = match recipe.lines {
                None => (&mesh.indices).into(),
                Some(_) => sides(&mesh.indices).into(),
            };
            (
                buffer("vertices", bytemuck::cast_slice(&mesh.vertices)),
                buffer("indices", bytemuck::cast_slice(&indices)),
            )
        })
        .collect();
    let frame = frame_set(&model);
    let mut pipelines = Pipelines { recipe, shaders: shaders(recipe)?, made: Vec::new() };
    let leaf = model.objects.iter().any(|object| object.kind == Kind::Leaf);
    let materials = materials(recipe, leaf);
    let mut draws: Vec<Draw> = Vec::new();
    let pieces = (recipe.draws as usize).div_ceil(model.objects.len().max(1)) as u32;
    for object in &model.objects {
        let (vertices, indices) = &meshes[object.mesh];
        let primitives = (indices.len() / 4) as u32 / corners;
        for piece in 0..pieces.min(primitives) {
            let cut = |n: u32| {
                (u64::from(primitives) * u64::from(n) / u64::from(pieces.min(primitives))) as u32
            };
            let number = draws.len() as u32;
            let material = match object.kind {
                Kind::Leaf => materials.len() - 1,
                _ => (number % recipe.materials) as usize,
            };
            draws.push(Draw {
                sets: vec![frame.clone(), materials[material].clone()],
                push_constants: push_constants(object),
                vertex_buffers: vec![BufferRange::whole(vertices)],
                indices: Some(Indices::new(BufferRange::whole(indices), IndexFormat::U32)),
                first: cut(piece) * corners,
                stencil_reference: [number as u8; 2],
                ..Draw::new(
                    pipelines.of(object.kind, number),
                    (cut(piece + 1) - cut(piece)) * corners,
                )
            });
        }
    }
    let target = ColorTarget::cleared(Format::Rgba8Srgb, [0.05, 0.06, 0.08, 1.0]);
    Ok(Pass {
        label: name.into(),
        extent,
        colors: vec![target; recipe.targets as usize],
        depth: Some(DepthTarget::cleared(1.0)),
        stencil: recipe.stencil.state().map(|_| StencilTarget::cleared(0)),
        samples: recipe.samples,
        pipelines: pipelines.made.into_iter().map(|(_, pipeline)| pipeline).collect(),
        draws,
    })
}

/// The properties in which pipelines differ.
type Key = (Kind, u32);

struct Pipelines<'a> {
    recipe: &'a Recipe,
    shaders: (Arc<Shader>, Arc<Shader>),
    made: Vec<(Key, Arc<Pipeline>)>,
}

impl Pipelines<'_> {
    /// The number of the pipeline for draw `number` of an object of `kind`.
    fn of(&mut self, kind: Kind, number: u32) -> usize {
        let key = (kind, number % self.recipe.pipelines);
        if let Some(found) = self.made.iter().position(|(known, _)| *known == key) {
            return found;
        }
        self.made.push((key, Arc::new(self.make(key))));
        self.made.len() - 1
    }

    fn make(&self, (kind, number): Key) -> Pipeline {
        let recipe = self.recipe;
        let blended = matches!(kind, Kind::Glass | Kind::Leaf);
        let pipeline = Pipeline::new("surface", self.shaders.0.clone(), self.shaders.1.clone())
            .blend(blended.then_some(Blend::ALPHA));
        let pipeline = match recipe.lines {
            None => pipeline,
            Some(Lines { width, mode }) => {
                pipeline.topology(Topology::LineList).line_width(width).line_mode(mode)
            }
        };
        let attribute = |location, format, offset| VertexAttribute {
            location,
            binding: 0,
            format,
            offset: offset as u32,
        };
        Pipeline {
            specialization: vec![
                (0, recipe.vertex_cost),
                (1, recipe.fragment_cost),
                (2, recipe.textures),
                (3, number * 4),
                (4, recipe.targets),
            ],
            vertex_bindings: vec![VertexBinding {
                stride: size_of::<Vertex>() as u32,
                rate: StepRate::Vertex,
            }],
            vertex_attributes: vec![
                attribute(0, VertexFormat::F32X3, offset_of!(Vertex, position)),
                attribute(1, VertexFormat::F32X3, offset_of!(Vertex, normal)),
                attribute(2, VertexFormat::F32X2, offset_of!(Vertex, uv)),
            ],
            cull: if kind == Kind::Solid { Cull::Back } else { Cull::None },
            depth: DepthState { write: !blended, ..DepthState::LESS },
            stencil: recipe.stencil.state(),
            ..pipeline
        }
    }
}

/// `Frame` of both shaders, in std140.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Frame {
    view_projection: Mat4,
    eye: Vec4,
    light: Vec4,
}

fn frame_set(model: &Model) -> Arc<BindingSet> {
    let frame = Frame {
        view_projection: model.view_projection,
        eye: model.eye.extend(1.0),
        light: model.eye.normalize().lerp(Vec3::new(0.5, 0.8, 0.2), 0.5).normalize().extend(0.0),
    };
    let bytes = bytemuck::bytes_of(&frame).to_vec();
    let buffer = Arc::new(BufferSource::new("frame", bytes));
    let resources = vec![Binding::Uniform(BufferRange::whole(&buffer))];
    Arc::new(BindingSet { entries: vec![BindingEntry { binding: 0, resources }] })
}

/// `Draw` of both shaders.
fn push_constants(object: &Object) -> Vec<u8> {
    let alpha = if object.kind == Kind::Glass { 0.4 } else { 1.0 };
    let [r, g, b] = object.tint;
    let tint = [r, g, b, alpha];
    [bytemuck::bytes_of(&object.model), bytemuck::bytes_of(&tint)].concat()
}

/// The materials, and behind them that of leaves if there are any.
fn materials(recipe: &Recipe, leaf: bool) -> Vec<Arc<BindingSet>> {
    // All of a scene's textures together stay small enough for any device.
    let side = if recipe.materials > 16 { 128 } else { 256 };
    let set = |number: u32| {
        let leaf = number == recipe.materials;
        let maps: Vec<_> = (0..recipe.textures.max(1))
            .map(|map| {
                let map_number = number * MAPS + map;
                let random = recipe.random(u64::from(map_number) + 100);
                Arc::new(texture(side, map_number, random, leaf && map == 0))
            })
            .collect();
        let entry = |binding: u32| {
            let map = maps[(binding as usize).min(maps.len() - 1)].clone();
            BindingEntry { binding, resources: vec![Binding::Sampled(map, Sampler::default())] }
        };
        Arc::new(BindingSet { entries: (0..MAPS).map(entry).collect() })
    };
    (0..recipe.materials + u32::from(leaf)).map(set).collect()
}

/// Tiles with grain and joints, or a leaf; with all its levels.
fn texture(side: u32, number: u32, mut random: Random, leaf: bool) -> Texture {
    let tiles = 2 + (random.unit() * 6.0) as u32;
    let texel = |i: u32| {
        let (x, y) = (i % side, i / side);
        let grain = (random.unit() * 40.0) as u8;
        if leaf {
            let [u, v] = [x, y].map(|t| (t as f32 + 0.5) / side as f32 * 2.0 - 1.0);
            let edge = (1.0 - u * u) * 0.6 - v.abs();
            let alpha = (edge * 8.0).clamp(0.0, 1.0);
            return [200, 215 + grain, 200, (alpha * 255.0) as u8];
        }
        let tile = side / tiles;
        let joint = x % tile < 3 || y % tile < 3;
        let shade = if joint { 110 } else { 200 + 15 * (((x / tile) + (y / tile)) % 2) as u8 };
        [shade + grain, shade + grain, shade + grain / 2, 255]
    };
    let mut levels: Vec<Vec<u8>> = vec![(0..side * side).flat_map(texel).collect()];
    let mut size = side as usize;
    while size > 1 {
        let above = levels.last().cloned().unwrap_or_default();
        let at = |x: usize, y: usize, c: usize| u32::from(above[(y * size + x) * 4 + c]);
        let half = size / 2;
        let level = (0..half * half * 4).map(|i| {
            let (x, y, c) = (i / 4 % half * 2, i / 4 / half * 2, i % 4);
            let sum = at(x, y, c) + at(x + 1, y, c) + at(x, y + 1, c) + at(x + 1, y + 1, c);
            (sum / 4) as u8
        });
        let level = level.collect();
        levels.push(level);
        size = half;
    }
    let extent = Extent::new(side, side);
    Texture::new(format!("map {number}"), extent, Format::Rgba8Srgb, levels)
}

#[cfg(test)]
mod tests {
    use super::super::scenes;
    use super::*;

    #[test]
    fn every_scene_is_a_valid_pass_of_about_its_count() {
        for scene in scenes::named() {
            let mut recipe = scene.recipe;
            recipe.count = recipe.count.map(|count| count.min(20_000));
            recipe.draws = recipe.draws.min(100);
            let pass = pass(scene.name, &recipe, Extent::new(320, 200)).unwrap();
            pass.validate().unwrap_or_else(|e| panic!("{}: {e}", scene.name));
            let triangles: u32 = pass.draws.iter().map(|draw| draw.count / 3).sum();
            if let Some(count) = recipe.count {
                let off = f64::from(triangles) / f64::from(count);
                assert!((0.85..1.15).contains(&off), "{}: {triangles} of {count}", scene.name);
            }
        }
    }

    #[test]
    fn a_shader_writes_the_targets_of_its_pass_whatever_its_varyings() {
        for varyings in [0, 4, 8, 12] {
            for (targets, outputs) in [(1, 1), (2, 8), (8, 8)] {
                let sheet = scenes::find(scenes::SHEET).unwrap().recipe;
                let recipe = Recipe { varyings, targets, ..sheet };
                let pass = pass("sheet", &recipe, Extent::new(16, 16)).unwrap();
                pass.validate().unwrap();
                let fragment = &pass.pipelines[0].fragment;
                assert_eq!(
                    (pass.colors.len(), fragment.reflection.outputs.len()),
                    (targets as usize, outputs)
                );
                let varying = |n: u32| fragment.reflection.inputs.iter().any(|i| i.location == n);
                assert_eq!([2, 2 + varyings, 3 + varyings].map(varying), [true, true, false]);
            }
        }
    }

    #[test]
    fn a_ball_is_one_draw_whatever_its_size() {
        let recipe = Recipe { count: Some(5_000_000), ..scenes::find("small-1m").unwrap().recipe };
        let pass = pass("ball", &recipe, Extent::new(64, 64)).unwrap();
        assert_eq!(pass.draws.len(), 1);
        let triangles = pass.draws[0].count / 3;
        assert!(triangles.abs_diff(5_000_000) < 20_000, "{triangles}");
    }

    #[test]
    fn another_seed_is_another_scene_of_the_same_kind() {
        for scene in scenes::named().into_iter().filter(|scene| scene.name != "small-4m") {
            let mut recipe = scene.recipe;
            recipe.count = recipe.count.map(|count| count.min(2000));
            let extent = Extent::new(64, 48);
            let made = |seed| pass(scene.name, &Recipe { seed, ..recipe.clone() }, extent).unwrap();
            let (one, other) = (made(0), made(1));
            assert_eq!(one.draws.len(), other.draws.len(), "{}", scene.name);
            let texels = |pass: &Pass| match &pass.draws[0].sets[1].entries[0].resources[..] {
                [Binding::Sampled(texture, _)] => texture.levels().unwrap()[0].clone(),
                other => panic!("{other:?}"),
            };
            assert_eq!(texels(&one), texels(&made(0)), "{}", scene.name);
            assert_ne!(texels(&one), texels(&other), "{}", scene.name);
        }
    }

    #[test]
    fn draws_share_the_triangles_out_without_loss() {
        let recipe = Recipe {
            draws: 7,
            pipelines: 3,
            count: Some(1000),
            ..Recipe::new(super::super::recipe::Shape::Sheet, None)
        };
        let pass = pass("sheet", &recipe, Extent::new(100, 100)).unwrap();
        assert_eq!((pass.draws.len(), pass.pipelines.len()), (7, 3));
        let mut next = 0;
        for draw in &pass.draws {
            assert_eq!(draw.first, next);
            next += draw.count;
        }
        let indices = pass.draws[0].indices.as_ref().unwrap().range.bytes / 4;
        assert_eq!(next as usize, indices);
    }
}
