//! Mends errors of exporters whose meaning is clear, before the typed parser sees them: it refuses a whole file
//! for one such member.

use super::{super::uri::short, container::DRAWN};
use serde_json::{Map, Number, Value};

type Object = Map<String, Value>;

/// Members that are text wherever they occur.
const TEXTS: [&str; 9] = [
    "name",
    "version",
    "minVersion",
    "generator",
    "copyright",
    "uri",
    "mimeType",
    "alphaMode",
    "interpolation",
];

/// Members that are true or false.
const FLAGS: [&str; 2] = ["doubleSided", "normalized"];

/// Members that may be left out and that some exporters set to -1 instead.
const OPTIONAL: [&str; 10] = [
    "bufferView",
    "camera",
    "indices",
    "inverseBindMatrices",
    "material",
    "mesh",
    "sampler",
    "scene",
    "skeleton",
    "skin",
];

/// Mends `document`; each change that may change the picture is warned of.
pub(super) fn mend(document: &mut Value, warn: &mut dyn FnMut(String)) {
    walk(document, warn);
    each(document, "scenes", |scene, _| {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    });
    // Lights of files are not drawn, so their faults are none of ours.
    each(document, "nodes", |node, _| no_lights(node));
    document.as_object_mut().map(no_lights);
    samplers_and_materials(document, warn);
    each(document, "meshes", |mesh, m| {
        for (p, primitive) in objects(mesh.get_mut("primitives")).enumerate() {
            let of = || format!("mesh {m}, primitive {p}");
            let modes = &[0, 1, 2, 3, 4, 5, 6];
            known_number(primitive, "mode", modes, "triangles are drawn", of, warn);
        }
    });
    each(document, "animations", |animation, a| {
        for (s, sampler) in objects(animation.get_mut("samplers")).enumerate() {
            let of = || format!("animation {a}, sampler {s}");
            let all = &["LINEAR", "STEP", "CUBICSPLINE"];
            known_word(sampler, "interpolation", all, "LINEAR is taken", of, warn);
        }
        let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) else {
            return;
        };
        let mut channel = 0..;
        channels.retain_mut(|c| {
            let number = channel.next().unwrap_or(0);
            let Some(target) = c.get_mut("target").and_then(Value::as_object_mut) else {
                return true;
            };
            let of = || format!("animation {a}, channel {number}");
            let all = &["translation", "rotation", "scale", "weights", "pointer"];
            known_word(target, "path", all, "the channel is left out", of, warn);
            // Channels without a node are for extensions, which are to be passed over.
            target.contains_key("node") && target.get("path").is_some_and(|p| p != "pointer")
        });
    });
}

fn no_lights(object: &mut Object) {
    if let Some(extensions) = object.get_mut("extensions").and_then(Value::as_object_mut) {
        extensions.remove("KHR_lights_punctual");
    }
}

fn samplers_and_materials(document: &mut Value, warn: &mut dyn FnMut(String)) {
    each(document, "samplers", |sampler, s| {
        let mut known = |member, values, taken| {
            known_number(sampler, member, values, taken, || format!("sampler {s}"), warn);
        };
        known("magFilter", &[9728, 9729], "linear filtering is taken");
        let all = &[9728, 9729, 9984, 9985, 9986, 9987];
        known("minFilter", all, "linear filtering with mip levels is taken");
        known("wrapS", &[33071, 33648, 10497], "the texture repeats");
        known("wrapT", &[33071, 33648, 10497], "the texture repeats");
    });
    each(document, "materials", |material, m| {
        let all = &["OPAQUE", "MASK", "BLEND"];
        let of = || format!("material {m}");
        known_word(material, "alphaMode", all, "OPAQUE is taken", of, warn);
    });
    // Only a hint for graphics interfaces.
    each(document, "bufferViews", |view, _| {
        view.remove("target");
    });
}

/// Types of members, anywhere in the document.
fn walk(value: &mut Value, warn: &mut dyn FnMut(String)) {
    match value {
        Value::Object(members) => {
            // Applications keep anything in extras, of any type; null counts as missing.
            members.remove("extras");
            members.retain(|_, member| !member.is_null());
            members.retain(|name, member| {
                let unset = member.as_i64() == Some(-1) && OPTIONAL.contains(&name.as_str());
                if unset {
                    warn(format!("`{name}` is -1 and is left out"));
                }
                !unset
            });
            for (name, member) in members.iter_mut() {
                retype(name, member, warn);
                match member {
                    Value::Object(all) if name == "extensions" => extensions(all, warn),
                    member => walk(member, warn),
                }
            }
        }
        Value::Array(elements) => elements.iter_mut().for_each(|element| walk(element, warn)),
        // JSON knows no integers: 4.0 is 4.
        Value::Number(number) if number.is_f64() => {
            let float = number.as_f64().unwrap_or(f64::NAN);
            if float.fract() == 0.0 && float.abs() < 9_007_199_254_740_992.0 {
                *number = Number::from(float as i64);
            }
        }
        _ => {}
    }
}

/// What is not drawn changes no picture, so its faults are not worth a word.
fn extensions(all: &mut Object, warn: &mut dyn FnMut(String)) {
    all.retain(|_, extension| !extension.is_null());
    for (name, extension) in all {
        match DRAWN.contains(&name.as_str()) {
            true => walk(extension, warn),
            false => walk(extension, &mut |_| {}),
        }
    }
}

fn retype(name: &str, member: &mut Value, warn: &mut dyn FnMut(String)) {
    let said = match member {
        Value::Number(_) | Value::Bool(_) if TEXTS.contains(&name) => {
            let text = member.to_string();
            std::mem::replace(member, Value::String(text))
        }
        Value::Number(number) if FLAGS.contains(&name) => {
            let set = number.as_f64().is_some_and(|n| n != 0.0);
            std::mem::replace(member, Value::Bool(set))
        }
        // A name is never needed; whatever is there in its place is not one.
        Value::Array(_) | Value::Object(_) if name == "name" => {
            std::mem::replace(member, Value::String(String::new()))
        }
        _ => return,
    };
    let said = short(&said.to_string());
    warn(format!("`{name}` is {said}, which is of the wrong type; {member} is taken"));
}

/// Calls `mend` on each object of the list `name`, with its number.
fn each(document: &mut Value, name: &str, mut mend: impl FnMut(&mut Object, usize)) {
    for (number, object) in objects(document.get_mut(name)).enumerate() {
        mend(object, number);
    }
}

/// The objects of a list. (What else is in it, the typed parser refuses.)
fn objects(list: Option<&mut Value>) -> impl Iterator<Item = &mut Object> {
    list.and_then(Value::as_array_mut).into_iter().flatten().filter_map(Value::as_object_mut)
}

fn known_number(
    object: &mut Object,
    member: &str,
    known: &[u64],
    taken: &str,
    of: impl Fn() -> String,
    warn: &mut dyn FnMut(String),
) {
    let is_known = |value: &Value| value.as_u64().is_some_and(|n| known.contains(&n));
    keep(object, member, is_known, taken, of, warn);
}

fn known_word(
    object: &mut Object,
    member: &str,
    known: &[&str],
    taken: &str,
    of: impl Fn() -> String,
    warn: &mut dyn FnMut(String),
) {
    let is_known = |value: &Value| value.as_str().is_some_and(|word| known.contains(&word));
    keep(object, member, is_known, taken, of, warn);
}

/// Removes `member` if glTF does not know its value.
fn keep(
    object: &mut Object,
    member: &str,
    is_known: impl Fn(&Value) -> bool,
    taken: &str,
    of: impl Fn() -> String,
    warn: &mut dyn FnMut(String),
) {
    let Some(value) = object.get(member).filter(|value| !is_known(value)) else { return };
    let value = short(&value.to_string());
    warn(format!("{}: its {member} {value} is none that glTF knows; {taken}", of()));
    object.remove(member);
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn mended(mut document: Value) -> (Value, Vec<String>) {
        let mut warnings = Vec::new();
        mend(&mut document, &mut |w| warnings.push(w));
        (document, warnings)
    }

    #[test]
    fn types_that_are_clear_are_made_right() {
        let (document, warnings) = mended(json!({
            "asset": { "version": 2.0, "generator": 7, "extras": "mine" },
            "nodes": [{ "name": null, "mesh": -1 }, { "name": 3 }, { "name": {} }],
            "accessors": [{ "count": 4.0, "normalized": 1, "max": [0.5, -3.0] }],
        }));
        assert_eq!(document["asset"], json!({ "version": "2.0", "generator": "7" }));
        assert_eq!(document["nodes"], json!([{}, { "name": "3" }, { "name": "" }]));
        let accessor = json!([{ "count": 4, "normalized": true, "max": [0.5, -3] }]);
        assert_eq!(document["accessors"], accessor);
        assert_eq!(warnings.len(), 6, "{warnings:?}");
    }

    #[test]
    fn extensions_that_are_not_drawn_are_not_warned_of() {
        let faults = json!({ "sampler": -1, "deep": [{ "doubleSided": 1, "name": 3 }] });
        for (extension, count) in [("VENDOR_own", 0), ("KHR_texture_transform", 3)] {
            let extensions = json!({ extension: faults, "none": null });
            let (document, warnings) = mended(json!({
                "extensions": extensions,
                "textures": [{ "extensions": extensions }],
            }));
            assert_eq!(warnings.len(), 2 * count, "{warnings:?}");
            // Mended all the same: the typed parser reads some of them.
            let mended = json!({ "deep": [{ "doubleSided": true, "name": "3" }] });
            assert_eq!(document["extensions"], json!({ extension: mended }));
        }
    }

    #[test]
    fn unknown_values_give_way_to_the_default_with_a_warning() {
        let long = "X".repeat(5000);
        let (document, warnings) = mended(json!({
            "samplers": [{ "magFilter": 9987, "minFilter": 0, "wrapS": 10496, "wrapT": 33071 }],
            "materials": [{ "alphaMode": long }],
            "meshes": [{ "primitives": [{ "mode": 4 }, { "mode": 9 }] }],
            "bufferViews": [{ "target": 1 }],
            "animations": [{
                "samplers": [{ "interpolation": "CUBIC" }],
                "channels": [
                    { "target": { "node": 0, "path": "color" } },
                    { "target": { "path": "scale" } },
                    { "target": { "node": 0, "path": "scale" } },
                ],
            }],
        }));
        assert_eq!(document["samplers"], json!([{ "wrapT": 33071 }]));
        assert_eq!(document["materials"], json!([{}]));
        assert_eq!(document["meshes"], json!([{ "primitives": [{ "mode": 4 }, {}] }]));
        assert_eq!(document["animations"][0]["channels"].as_array().map(Vec::len), Some(1));
        assert_eq!(warnings.len(), 7, "{warnings:?}");
        assert!(warnings.iter().all(|w| w.len() < 200), "{warnings:?}");
    }
}
