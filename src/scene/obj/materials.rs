//! Converts MTL materials to metallic-roughness materials, with their textures.

use super::{
    super::{
        build::Builder,
        files,
        material::{AlphaMode, Map, Material, TextureUse},
        texture::{ColorSpace, decode, decode_rgba, has_alpha, height_to_normal, with_mips},
    },
    mtl::{Channel, Library, Mtl, MtlMap},
    parse::Obj,
    text::{readings, shown, split_names},
};
use crate::{
    image::{Extent, srgb_to_linear},
    texture::{Sampler, Texture, Wrap},
};
use glam::{Vec2, Vec3, Vec4};
use std::{
    collections::HashMap,
    path::{Path, PathBuf},
    sync::Arc,
};

/// A name of a file has at most this many words with single blanks between them.
const WORDS_OF_A_NAME: usize = 8;

/// Adds the materials of the file at `path`, in the order of [`Obj::materials`], and one for elements
/// without.
pub(super) fn add(obj: &Obj, path: &Path, builder: &mut Builder) {
    let folder = path.parent().unwrap_or(Path::new(""));
    let library = libraries(obj, path, folder, builder);
    let mut pictures = Pictures {
        folder,
        builder,
        by_name: HashMap::new(),
        read: Vec::new(),
        made: HashMap::new(),
    };
    for name in &obj.materials {
        let material = match library.get(name) {
            Some(mtl) => pictures.material(name, mtl),
            // What exporters write where there is no material.
            None if name.eq_ignore_ascii_case(b"none") => bare(obj),
            None => {
                let name = shown(name);
                pictures.builder.warn(format!(
                    "the material `{name}` is not defined; what uses it is drawn without one"
                ));
                bare(obj)
            }
        };
        pictures.builder.materials.push(material);
    }
    builder.materials.push(bare(obj));
}

/// All materials of all libraries that the file names, each library read once.
fn libraries(obj: &Obj, path: &Path, folder: &Path, builder: &mut Builder) -> Library {
    let mut library = Library::default();
    // Whether there is such a file.
    let mut add = |found: Option<PathBuf>, builder: &mut Builder| {
        let Some(found) = found else { return false };
        // The same file may have several names.
        let file = std::fs::canonicalize(&found).unwrap_or_else(|_| found.clone());
        if library.files.insert(file) {
            let file = found.file_name().unwrap_or_default().to_string_lossy();
            match files::read(&found, &mut builder.files) {
                Ok(bytes) => library.add(&bytes, &file).into_iter().for_each(|w| builder.warn(w)),
                Err(fault) => builder.warn(format!("the material library {fault}")),
            }
        }
        true
    };
    let find = |name: &Vec<u8>| files::find_by_name(folder, name);
    for text in &obj.libraries {
        // One name with blanks in it, or several names.
        if add(readings(text).iter().find_map(find), builder) {
            continue;
        }
        let words = split_names(text);
        let mut at = 0;
        while at < words.len() {
            let most = (words.len() - at).min(WORDS_OF_A_NAME);
            let joined = |n: usize| words[at..at + n].join(&b' ');
            let found = (1..=most).rev().find_map(|n| Some((n, find(&joined(n))?)));
            if found.is_none() {
                let name = shown(&words[at]);
                builder.warn(format!("the material library `{name}` cannot be read"));
            }
            let (n, found) = found.map_or((1, None), |(n, found)| (n, Some(found)));
            add(found, builder);
            at += n;
        }
    }
    // Renamed files still have the old name inside.
    let beside = path.with_extension("mtl");
    let is_wanted = library.files.is_empty() && !obj.materials.is_empty();
    if is_wanted
        && let Some(found) =
            beside.file_name().and_then(|name| files::find(folder, name.as_encoded_bytes()))
    {
        builder.warn(format!(
            "no material library that the file names can be read; `{}` beside it is read instead",
            found.file_name().unwrap_or_default().display()
        ));
        if let Ok(bytes) = files::read(&found, &mut builder.files) {
            library.add(&bytes, &found.file_name().unwrap_or_default().to_string_lossy());
        }
    }
    library
}

/// The material of elements that have none: grey, or white where vertices have colours.
fn bare(obj: &Obj) -> Material {
    let base = if obj.colors.is_empty() { 0.6 } else { 1.0 };
    Material {
        base_color: Vec4::new(base, base, base, 1.0),
        metallic: 0.0,
        roughness: 0.7,
        double_sided: true,
        ..Material::default()
    }
}

/// A picture file in memory.
#[derive(Clone)]
struct Picture {
    name: String,
    bytes: Arc<Vec<u8>>,
    has_alpha: bool,
}

/// The numbers of the pictures that a texture is made of.
#[derive(Clone, Debug, PartialEq, Eq, Hash)]
enum Recipe {
    Color(usize),
    /// The colour, white without one, with the alpha from a value of another picture.
    Masked(Option<usize>, usize, Option<Channel>),
    /// Normals, or heights with this bump factor (its bits).
    Bump(usize, u32),
    Normal(usize),
    /// Roughness and metallic, each from a value of a picture.
    Surface([Option<(usize, Option<Channel>)>; 2]),
}

/// The pictures of the file, each read once, and the textures, each made once.
struct Pictures<'a> {
    folder: &'a Path,
    builder: &'a mut Builder,
    /// Numbers of `read`; `None` has been looked for.
    by_name: HashMap<Vec<u8>, Option<usize>>,
    read: Vec<Picture>,
    made: HashMap<Recipe, usize>,
}

impl Pictures<'_> {
    /// Metallic-roughness from what MTL says: colours were chosen on a screen, so they are sRGB;
    /// the shininess of Blinn and Phong has the same lobe as a roughness of GGX.
    fn material(&mut self, name: &[u8], mtl: &Mtl) -> Material {
        let linear = |c: [f32; 3]| Vec3::from_array(c.map(|v| srgb_to_linear(v.clamp(0.0, 1.0))));
        let mut diffuse = mtl.diffuse.map_or(Vec3::ONE, linear);
        if mtl.diffuse_map.is_some() && diffuse == Vec3::ZERO {
            // Some exporters leave black beside a texture.
            diffuse = Vec3::ONE;
        }
        let shiny = mtl.specular.unwrap_or_default().into_iter().fold(0.0, f32::max);
        let roughness = match mtl.shininess {
            Some(ns) if shiny > 0.0 => (2.0 / (ns.max(0.0) + 2.0)).powf(0.25),
            _ => 0.9,
        };
        let opacity = mtl.opacity.unwrap_or(1.0).clamp(0.0, 1.0);
        if let Some(statement) = &mtl.invisible {
            self.builder.warn(format!(
                "the material `{}` is invisible: {statement}, makes it fully transparent; some \
                 exporters write that where they mean opaque: remove the line, or write `d 1`",
                shown(name)
            ));
        }
        let mut material = Material {
            base_color: diffuse.extend(opacity),
            emissive: mtl.emissive.map_or(Vec3::ZERO, linear),
            metallic: mtl.metallic.unwrap_or(0.0),
            roughness: mtl.roughness.unwrap_or(roughness),
            alpha: if opacity < 1.0 { AlphaMode::Blend } else { AlphaMode::Opaque },
            double_sided: true,
            ..Material::default()
        };
        self.base_color(mtl, &mut material);
        if let Some((map, picture)) = self.of(&mtl.emissive_map) {
            material.maps[Map::Emissive as usize] = Some(self.texture(map, Recipe::Color(picture)));
            if material.emissive == Vec3::ZERO {
                material.emissive = Vec3::ONE;
            }
        }
        self.surface(mtl, &mut material);
        let normals = match self.of(&mtl.normal_map) {
            Some((map, picture)) => Some((map, Recipe::Normal(picture))),
            None => self
                .of(&mtl.bump_map)
                .map(|(map, picture)| (map, Recipe::Bump(picture, map.bump.to_bits()))),
        };
        material.maps[Map::Normal as usize] =
            normals.map(|(map, recipe)| self.texture(map, recipe));
        material
    }

    /// The colour map with the mask in its alpha. Either may be missing, and then counts for nothing.
    fn base_color(&mut self, mtl: &Mtl, material: &mut Material) {
        let (color, mask) = (self.of(&mtl.diffuse_map), self.of(&mtl.opacity_map));
        let (map, recipe, has_alpha) = match (color, mask) {
            (Some((map, color)), Some((mask_map, mask))) => {
                (map, Recipe::Masked(Some(color), mask, mask_map.channel), true)
            }
            (None, Some((map, mask))) => (map, Recipe::Masked(None, mask, map.channel), true),
            (Some((map, color)), None) => (map, Recipe::Color(color), self.read[color].has_alpha),
            (None, None) => return,
        };
        material.maps[Map::BaseColor as usize] = Some(self.texture(map, recipe));
        if has_alpha && material.alpha == AlphaMode::Opaque {
            material.alpha = AlphaMode::Mask;
        }
    }

    fn surface(&mut self, mtl: &Mtl, material: &mut Material) {
        let maps = [&mtl.roughness_map, &mtl.metallic_map].map(|map| self.of(map));
        let Some((map, _)) = maps[0].or(maps[1]) else { return };
        let recipe =
            Recipe::Surface(maps.map(|used| used.map(|(map, picture)| (picture, map.channel))));
        material.maps[Map::MetallicRoughness as usize] = Some(self.texture(map, recipe));
        // A map is multiplied by the number, which many files then leave out or leave at 0.
        for (used, value, said) in [
            (maps[0], &mut material.roughness, mtl.roughness),
            (maps[1], &mut material.metallic, mtl.metallic),
        ] {
            if used.is_some() {
                *value = said.filter(|v| *v > 0.0).unwrap_or(1.0);
            }
        }
    }

    /// The map and the number of its picture; `None` if there is no map or no such file.
    fn of<'m>(&mut self, map: &'m Option<MtlMap>) -> Option<(&'m MtlMap, usize)> {
        let map = map.as_ref()?;
        let name = map.names.last()?;
        if let Some(&known) = self.by_name.get(&map.names[0]) {
            return known.map(|number| (map, number));
        }
        let found = map.names.iter().find_map(|name| files::find_by_name(self.folder, name));
        let bytes = found.and_then(|path| files::read(&path, &mut self.builder.files).ok());
        let number = bytes.map(|bytes| {
            let (name, has_alpha) = (shown(name), has_alpha(&bytes));
            self.read.push(Picture { name, bytes: Arc::new(bytes), has_alpha });
            self.read.len() - 1
        });
        if number.is_none() {
            let name = shown(name);
            self.builder.warn(format!("the texture `{name}` cannot be read and is left out"));
        }
        self.by_name.insert(map.names[0].clone(), number);
        number.map(|number| (map, number))
    }

    /// The texture of `recipe`, placed as `map` says.
    fn texture(&mut self, map: &MtlMap, recipe: Recipe) -> TextureUse {
        let number = match self.made.get(&recipe) {
            Some(&number) => number,
            None => {
                let ingredients = Ingredients::new(&recipe, &self.read);
                let number = self.builder.texture(move || ingredients.make());
                self.made.insert(recipe, number);
                number
            }
        };
        let wrap = if map.clamp { Wrap::ClampToEdge } else { Wrap::Repeat };
        let sampler = Sampler { wrap_u: wrap, wrap_v: wrap, ..Sampler::default() };
        // MTL scales and moves coordinates that run upwards.
        let ([ou, ov], [su, sv]) = (map.offset, map.scale);
        let offset = Vec2::new(ou, 1.0 - sv - ov);
        let used = TextureUse { sampler, ..TextureUse::new(number) };
        used.with_transform(offset, 0.0, Vec2::new(su, sv))
    }
}

/// A recipe with its pictures, on its way to another thread.
struct Ingredients {
    recipe: Recipe,
    /// In the order of the recipe.
    pictures: Vec<Picture>,
}

/// Rows of RGBA.
type Pixels = (Extent, Vec<u8>);

impl Ingredients {
    fn new(recipe: &Recipe, read: &[Picture]) -> Self {
        let numbers = match recipe {
            Recipe::Color(a) | Recipe::Normal(a) | Recipe::Bump(a, _) => vec![*a],
            Recipe::Masked(color, mask, _) => color.iter().chain([mask]).copied().collect(),
            Recipe::Surface(maps) => maps.iter().flatten().map(|(number, _)| *number).collect(),
        };
        let pictures = numbers.into_iter().map(|number| read[number].clone()).collect();
        Self { recipe: recipe.clone(), pictures }
    }

    /// Decodes the pictures and puts them together.
    fn make(&self) -> Result<Texture, String> {
        let fault = |picture: &Picture, e| format!("the texture `{}`: {e}", picture.name);
        let pixels = |i: usize| {
            let picture = &self.pictures[i];
            decode_rgba(&picture.bytes).map_err(|e| fault(picture, e))
        };
        let first = &self.pictures[0];
        let plain = |space| decode(&first.name, &first.bytes, space).map_err(|e| fault(first, e));
        match &self.recipe {
            Recipe::Color(_) => plain(ColorSpace::Srgb),
            Recipe::Normal(_) => plain(ColorSpace::Linear),
            Recipe::Masked(color, _, channel) => {
                let mask = pixels(self.pictures.len() - 1)?;
                let (extent, texels) = match color {
                    Some(_) => pixels(0)?,
                    None => (mask.0, vec![255; mask.1.len()]),
                };
                Ok(self.masked(extent, texels, &mask, *channel))
            }
            Recipe::Bump(_, bump) => {
                let (extent, texels) = pixels(0)?;
                let texels = match looks_like_normals(&texels) {
                    true => texels,
                    false => height_to_normal(extent, &texels, 2.0 * f32::from_bits(*bump)),
                };
                Ok(with_mips(&first.name, extent, texels, ColorSpace::Linear))
            }
            Recipe::Surface(maps) => {
                let all: Result<Vec<Pixels>, String> =
                    (0..self.pictures.len()).map(pixels).collect();
                let all = all?;
                let (width, height) = all.iter().fold((1, 1), |(w, h), (extent, _)| {
                    (w.max(extent.width), h.max(extent.height))
                });
                let extent = Extent::new(width, height);
                let mut texels = vec![255; extent.pixels() * 4];
                let used = maps.iter().enumerate().filter_map(|(i, map)| Some((i, (*map)?.1)));
                for ((slot, channel), source) in used.zip(&all) {
                    // Roughness is green, metallic blue.
                    let channel = channel.unwrap_or(Channel::Luminance);
                    for (i, texel) in texels.chunks_exact_mut(4).enumerate() {
                        texel[1 + slot] = value(nearest(source, extent, i), channel);
                    }
                }
                Ok(with_mips(&first.name, extent, texels, ColorSpace::Linear))
            }
        }
    }

    fn masked(
        &self,
        extent: Extent,
        mut texels: Vec<u8>,
        mask: &Pixels,
        channel: Option<Channel>,
    ) -> Texture {
        // A mask is bright where there is something. In a picture with alpha, the alpha is the mask: for
        // all of its texels, the opaque ones too.
        let has_alpha = || mask.1.chunks_exact(4).any(|texel| texel[3] < 255);
        let channel =
            channel.unwrap_or_else(|| if has_alpha() { Channel::Matte } else { Channel::Red });
        for (i, texel) in texels.chunks_exact_mut(4).enumerate() {
            texel[3] = value(nearest(mask, extent, i), channel);
        }
        with_mips(&self.pictures[0].name, extent, texels, ColorSpace::Srgb)
    }
}

/// The texel of `pixels` where a picture of `extent` has texel `i`.
fn nearest((size, texels): &Pixels, extent: Extent, i: usize) -> &[u8] {
    let (width, height) = (extent.width as usize, extent.height as usize);
    let x = i % width * size.width as usize / width;
    let y = i / width * size.height as usize / height;
    &texels[(y * size.width as usize + x) * 4..][..4]
}

fn value(texel: &[u8], channel: Channel) -> u8 {
    match channel {
        Channel::Red => texel[0],
        Channel::Green => texel[1],
        Channel::Blue => texel[2],
        Channel::Matte => texel[3],
        // The weights of Rec. 709 in 1/256.
        Channel::Luminance => {
            let sum =
                54 * u32::from(texel[0]) + 183 * u32::from(texel[1]) + 19 * u32::from(texel[2]);
            (sum >> 8) as u8
        }
    }
}

/// Whether a "bump map" holds normals: many exporters write them under that name. Normals point
/// outwards on average, so the mean is near (128, 128, 255); heights are grey.
fn looks_like_normals(texels: &[u8]) -> bool {
    let count = (texels.len() / 4).max(1) as u64;
    let mean = |c: usize| texels.iter().skip(c).step_by(4).map(|&v| v as u64).sum::<u64>() / count;
    let near = 104..152;
    near.contains(&mean(0)) && near.contains(&mean(1)) && mean(2) > 200
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_library_is_read_once_whatever_it_is_called() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a b.mtl"), "newmtl x\n").unwrap();
        std::fs::write(folder.path().join("c.mtl"), "newmtl y\n").unwrap();
        let names = [
            "a b.mtl",
            "a b.mtl",
            "A B.MTL",
            "./a b.mtl",
            "\"a b.mtl\"",
            "c.mtl a b.mtl",
            "C:\\c.mtl",
        ];
        let text: String = names.iter().map(|name| format!("mtllib {name}\n")).collect();
        let obj = super::super::parse::parse(text.repeat(30).as_bytes()).unwrap();
        assert_eq!(obj.libraries.len(), names.len() - 1, "each text is kept once");
        let mut builder = Builder::default();
        let library = libraries(&obj, &folder.path().join("x.obj"), folder.path(), &mut builder);
        assert_eq!(library.files.len(), 2);
        assert!(library.get(b"x").is_some() && library.get(b"y").is_some());
        assert!(builder.warnings.is_empty(), "{:?}", builder.warnings);
    }

    #[test]
    fn one_value_of_a_picture_is_the_mask_everywhere() {
        let picture = Picture { name: String::new(), bytes: Arc::default(), has_alpha: true };
        let recipe = Recipe::Masked(Some(0), 0, None);
        let ingredients = Ingredients { recipe, pictures: vec![picture] };
        let extent = Extent::new(2, 1);
        // A leaf: green, opaque inside and transparent outside; and the same without its alpha.
        for (texels, want) in [
            ([0, 200, 0, 255, 9, 9, 9, 0], [255, 0]),
            ([0, 200, 0, 255, 9, 9, 9, 254], [255, 254]),
            ([0, 200, 0, 255, 9, 9, 9, 255], [0, 9]),
        ] {
            let mask = (extent, texels.to_vec());
            let made = ingredients.masked(extent, texels.to_vec(), &mask, None);
            let alpha: Vec<u8> =
                made.levels().unwrap()[0].iter().skip(3).step_by(4).copied().collect();
            assert_eq!(alpha, want);
        }
    }

    #[test]
    fn masks_are_read_from_the_value_that_is_asked_for() {
        let texel = [10, 100, 200, 128];
        for (channel, want) in [
            (Channel::Red, 10),
            (Channel::Green, 100),
            (Channel::Blue, 200),
            (Channel::Matte, 128),
            (Channel::Luminance, 88),
        ] {
            assert_eq!(value(&texel, channel), want, "{channel:?}");
        }
        assert_eq!(value(&[255; 4], Channel::Luminance), 255);
    }
}
