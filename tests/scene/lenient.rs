//! Files that exporters write although glTF does not allow them. They are drawn, with a warning where it matters;
//! parts that cannot be drawn are named.

use super::loaded::{Case, pass, positions, triangle, uri};
use glam::Vec3;
use tilewright::{
    Error,
    format::Format,
    pass::{Binding, Pass},
    scene::Scene,
    texture::{Filter, Sampler},
};

fn load(text: &str) -> Result<Scene, Error> {
    Case::new(&[("a.gltf", text.as_bytes())]).try_load("a.gltf", None)
}

#[track_caller]
fn drawn(text: &str) -> Scene {
    let scene = load(text).unwrap_or_else(|e| panic!("{e}"));
    assert_eq!(positions(&pass(&scene).draws[0])[1], Vec3::X);
    scene
}

/// The triangle with a texture that has `sampler`.
fn textured(sampler: &str) -> String {
    let mut png = Vec::new();
    let extent = tilewright::image::Extent::new(1, 1);
    let image = tilewright::image::Picture::zeroed(extent, Format::Rgba8Unorm);
    tilewright::image::png::write_png(&image, &[], &mut png).unwrap();
    let more = format!(
        r#""images":[{{"uri":"{}"}}],"samplers":[{sampler}],"textures":[{{"source":0,"sampler":0}}],
        "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],"accessors""#,
        uri(&png)
    );
    triangle("", r#","material":0"#).replace(r#""accessors""#, &more)
}

fn sampler(pass: &Pass) -> Sampler {
    let found = pass.draws[0].sets[1].entries.iter().find_map(|e| match &e.resources[0] {
        Binding::Sampled(_, sampler) => Some(*sampler),
        _ => None,
    });
    found.expect("the base colour")
}

#[test]
fn unknown_filters_are_the_default_ones() {
    for odd in ["9987", "0", "-7", "1e30", "\"LINEAR\"", "[]"] {
        let scene = drawn(&textured(&format!(
            r#"{{"magFilter":{odd},"minFilter":9728,"wrapS":{odd},"wrapT":10497}}"#
        )));
        let expected = Sampler::default().min(Filter::Nearest).mip(None);
        assert_eq!(sampler(&pass(&scene)), expected, "{odd}");
        assert_eq!(scene.warnings().len(), 2, "{:?}", scene.warnings());
    }
}

#[test]
fn types_that_are_clear_are_taken() {
    for (from, to, warnings) in [
        (r#""version":"2.0""#, r#""version":2.0"#, 1),
        (r#""version":"2.0""#, r#""version":2"#, 1),
        (r#""version":"2.0""#, r#""version":"2.0","generator":3"#, 1),
        (r#""count":3"#, r#""count":3.0"#, 0),
        (r#""componentType":5126"#, r#""componentType":5126.0"#, 0),
        (r#""mesh":0"#, r#""mesh":0.0,"name":null,"skin":-1"#, 1),
        (r#""mesh":0"#, r#""mesh":0,"name":7,"extras":[null]"#, 1),
        (r#""POSITION":0}"#, r#""POSITION":0},"mode":42"#, 1),
        (r#""bufferView":0"#, r#""bufferView":0,"normalized":0"#, 1),
    ] {
        let text = triangle("", "");
        assert!(text.contains(from));
        let scene = drawn(&text.replacen(from, to, 1));
        assert_eq!(scene.warnings().len(), warnings, "{to}: {:?}", scene.warnings());
    }
}

/// Why a document is refused.
#[track_caller]
fn refusal(text: &str) -> String {
    match load(text) {
        Err(Error::Input { reason, .. }) => reason,
        Err(other) => panic!("{other}"),
        Ok(_) => panic!("it must be refused"),
    }
}

#[test]
fn compressed_geometry_is_refused_by_the_name_of_its_primitive() {
    let draco = r#","extensions":{"KHR_draco_mesh_compression":{"bufferView":0,"attributes":{"POSITION":0}}}"#;
    let used = r#"{"extensionsUsed":["KHR_draco_mesh_compression"],"asset""#;
    let text = triangle("", draco).replacen(r#"{"asset""#, used, 1);
    // With a copy that anybody can read, that is drawn.
    assert!(drawn(&text).warnings().is_empty());
    let alone = text.replacen(r#""bufferView":0,"componentType""#, r#""componentType""#, 1);
    let required = alone.replacen("extensionsUsed", "extensionsRequired", 1);
    for text in [&alone, &required] {
        let reason = refusal(text);
        assert!(
            reason.contains("mesh 0, primitive 0") && reason.contains("KHR_draco_mesh_compression"),
            "{reason}"
        );
    }
    for name in ["EXT_meshopt_compression", "KHR_meshopt_compression"] {
        let view = format!(r#"36,"extensions":{{"{name}":{{"buffer":0}}}}}}]"#);
        let text = triangle("", "").replacen("36}]", &view, 1);
        drawn(&text);
        let start = text.find(r#","uri""#).unwrap();
        let alone = format!("{}}}]}}", &text[..start]);
        let reason = refusal(&alone);
        assert!(reason.contains("mesh 0, primitive 0") && reason.contains(name), "{reason}");
    }
}

#[test]
fn textures_of_other_formats_are_named_and_needed_only_if_they_are_required() {
    for name in ["KHR_texture_basisu", "EXT_texture_webp"] {
        let text = textured("{}").replacen(
            r#"{"source":0,"#,
            &format!(r#"{{"extensions":{{"{name}":{{"source":0}}}},"#),
            1,
        );
        let scene = drawn(&text);
        assert!(scene.warnings()[0].contains(name), "{:?}", scene.warnings());
        let required = format!(r#"{{"extensionsRequired":["{name}"],"asset""#);
        let reason = refusal(&text.replacen(r#"{"asset""#, &required, 1));
        assert!(reason.contains("texture 0") && reason.contains(name), "{reason}");
        // A PNG beside it is drawn, required or not.
        let both = textured("{}").replacen(
            r#"{"source":0,"#,
            &format!(r#"{{"source":0,"extensions":{{"{name}":{{"source":0}}}},"#),
            1,
        );
        assert!(drawn(&both.replacen(r#"{"asset""#, &required, 1)).warnings().is_empty());
    }
}

#[test]
fn uris_of_all_forms_are_read() {
    let text = triangle("", "");
    let start = text.find("data:").unwrap();
    let end = start + text[start..].find('"').unwrap();
    let bytes: Vec<u8> =
        [0f32, 0., 0., 1., 0., 0., 0., 1., 0.].iter().flat_map(|v| v.to_le_bytes()).collect();
    for name in ["b%20in.bin?v=3", "b%20in.bin#part", "b in.bin"] {
        let text = format!("{}{name}{}", &text[..start], &text[end..]);
        let case = Case::new(&[("a.gltf", text.as_bytes()), ("b in.bin", &bytes)]);
        assert_eq!(positions(&pass(&case.load("a.gltf")).draws[0])[1], Vec3::X, "{name}");
    }
    let long = format!("{}{}{}", &text[..start], "x".repeat(100_000), &text[end..]);
    assert!(refusal(&long).len() < 300);
    let wrong = format!("{}DATA:;BASE64,{}*{}", &text[..start], "A".repeat(9999), &text[end..]);
    assert!(refusal(&wrong).len() < 300, "{}", refusal(&wrong));
}

#[test]
fn specular_and_glossiness_reach_the_shader() {
    let material = r#""materials":[{"extensions":{"KHR_materials_pbrSpecularGlossiness":{
        "diffuseFactor":[0.1,0.2,0.3,1],"specularFactor":[1,0.75,0.25],"glossinessFactor":0.5}}}],
        "extensionsRequired":["KHR_materials_pbrSpecularGlossiness"],"accessors""#;
    let text = triangle("", r#","material":0"#).replace(r#""accessors""#, material);
    let scene = drawn(&text);
    assert!(scene.warnings().is_empty(), "{:?}", scene.warnings());
    let pass = pass(&scene);
    let Binding::Uniform(block) = &pass.draws[0].sets[1].entries[0].resources[0] else {
        panic!("the material's block comes first");
    };
    let bytes = block.host_bytes().unwrap();
    let float = |at: usize| f32::from_le_bytes(bytes[at * 4..at * 4 + 4].try_into().unwrap());
    assert_eq!([0, 1, 2].map(float), [0.1, 0.2, 0.3]);
    assert_eq!([12, 13, 14, 15].map(float), [1.0, 0.75, 0.25, 0.5]);
}

#[test]
fn the_map_of_specular_and_glossiness_holds_colours() {
    let roughness = r#"{"pbrMetallicRoughness":{"metallicRoughnessTexture":{"index":0}}}"#;
    let specular = r#"{"extensions":{"KHR_materials_pbrSpecularGlossiness":{
        "specularGlossinessTexture":{"index":0}}}}"#;
    let base = r#"{"pbrMetallicRoughness":{"baseColorTexture":{"index":0}}}"#;
    for (material, format) in [(roughness, Format::Rgba8Unorm), (specular, Format::Rgba8Srgb)] {
        let pass = pass(&drawn(&textured("{}").replace(base, material)));
        let map = &pass.draws[0].sets[1].entries[2];
        let Binding::Sampled(texture, _) = &map.resources[0] else { panic!("{map:?}") };
        assert_eq!((map.binding, texture.format()), (2, format), "{material}");
    }
}
