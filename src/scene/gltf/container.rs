//! The two forms of a glTF file: JSON, and GLB with JSON and one buffer in it.

use super::{data::Checks, pose::Local};
use gltf_json::Root;
use serde_json::{Map, Value};

/// The parts of a file.
pub(super) struct Container<'a> {
    pub root: Root,
    /// The transforms of the nodes: the typed document has them in single precision only.
    pub locals: Vec<Local>,
    /// The buffer of a GLB.
    pub binary: Option<&'a [u8]>,
}

const GLB_MAGIC: &[u8; 4] = b"glTF";
const CHUNK_JSON: u32 = u32::from_le_bytes(*b"JSON");
const CHUNK_BIN: u32 = u32::from_le_bytes(*b"BIN\0");

/// Extensions that a file may require because they are drawn as they should be.
const DRAWN: [&str; 5] = [
    "KHR_materials_unlit",
    "KHR_texture_transform",
    "KHR_materials_emissive_strength",
    "EXT_mesh_gpu_instancing",
    "KHR_mesh_quantization",
];

/// Extensions that change the look but no geometry: ignored with a warning even if required.
fn only_changes_the_look(extension: &str) -> bool {
    extension.starts_with("KHR_materials_") || extension == "KHR_lights_punctual"
}

impl<'a> Container<'a> {
    /// Takes `bytes` apart and checks version and extensions.
    pub fn parse(bytes: &'a [u8], mut warn: impl FnMut(String)) -> Checks<Self> {
        let (json, binary) = match bytes.starts_with(GLB_MAGIC) {
            true => split_glb(bytes)?,
            false => (bytes, None),
        };
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json).trim_ascii_start();
        if bytes.is_empty() {
            return Err("the file is empty".into());
        }
        if !json.starts_with(b"{") {
            return Err("the content is neither GLB nor a JSON object".into());
        }
        let (root, locals) = read(json)?;
        let wanted = root.asset.min_version.as_ref().unwrap_or(&root.asset.version);
        if !wanted.starts_with("2.")
            || root.asset.min_version.as_deref().is_some_and(|v| v != "2.0")
        {
            return Err(format!("it says that it is glTF `{wanted}`; only 2.0 can be read"));
        }
        for extension in &root.extensions_required {
            if DRAWN.contains(&extension.as_str()) {
                continue;
            }
            if !only_changes_the_look(extension) {
                return Err(format!(
                    "it requires the extension {extension}, which is not supported; \
                     export the file without it"
                ));
            }
        }
        for extension in &root.extensions_used {
            if !DRAWN.contains(&extension.as_str()) {
                warn(format!("the extension {extension} is ignored"));
            }
        }
        Ok(Self { root, locals, binary })
    }
}

/// The typed document. What the parser refuses although glTF allows it is mended first: scenes
/// without nodes, extras that are no objects, and animation channels without a node, which are to be
/// passed over; so are lights, whose faults are none of ours.
fn read(json: &[u8]) -> Checks<(Root, Vec<Local>)> {
    let fault = |e| format!("the JSON is not glTF 2.0: {e}");
    let mut document: Value = serde_json::from_slice(json).map_err(fault)?;
    let nodes = document.get("nodes").and_then(Value::as_array);
    let locals: Vec<Local> = nodes.into_iter().flatten().map(Local::of).collect();
    let each = |list: Option<&mut Value>, mend: &dyn Fn(&mut Map<String, Value>)| {
        let objects = list.and_then(Value::as_array_mut).into_iter().flatten();
        objects.filter_map(Value::as_object_mut).for_each(mend);
    };
    each(document.get_mut("scenes"), &|scene| {
        scene.entry("nodes").or_insert_with(|| Value::Array(Vec::new()));
    });
    each(document.get_mut("animations"), &|animation| {
        if let Some(channels) = animation.get_mut("channels").and_then(Value::as_array_mut) {
            channels.retain(|c| c.get("target").is_none_or(|t| t.get("node").is_some()));
        }
    });
    let unlit = |object: &mut Map<String, Value>| {
        if let Some(extensions) = object.get_mut("extensions").and_then(Value::as_object_mut) {
            extensions.remove("KHR_lights_punctual");
        }
    };
    each(document.get_mut("nodes"), &unlit);
    document.as_object_mut().map(unlit);
    drop_extras(&mut document);
    match serde_json::from_value(document) {
        Ok(root) => Ok((root, locals)),
        // Read once more for the line of the fault, which the document does not know.
        Err(e) => Err(fault(Root::from_slice(json).err().unwrap_or(e))),
    }
}

/// Removes what applications keep for themselves: it may be of any type, and nothing here reads it.
fn drop_extras(value: &mut Value) {
    match value {
        Value::Object(members) => {
            members.remove("extras");
            members.values_mut().for_each(drop_extras);
        }
        Value::Array(elements) => elements.iter_mut().for_each(drop_extras),
        _ => {}
    }
}

/// JSON and buffer of a GLB.
fn split_glb(bytes: &[u8]) -> Checks<(&[u8], Option<&[u8]>)> {
    let word = |at: usize| {
        let bytes = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err("it ends inside the GLB header".into());
    };
    if version != 2 {
        return Err(format!("it is a GLB of version {version}; only version 2 can be read"));
    }
    if length as usize > bytes.len() {
        let have = bytes.len();
        return Err(format!("the GLB header says {length} bytes, but the file has {have}"));
    }
    let (mut at, mut json, mut binary) = (12, None, None);
    while at < length as usize {
        let (Some(size), Some(kind)) = (word(at), word(at + 4)) else {
            return Err("it ends inside the header of a GLB chunk".into());
        };
        let Some(chunk) = bytes.get(at + 8..).and_then(|rest| rest.get(..size as usize)) else {
            return Err(format!("a GLB chunk of {size} bytes reaches beyond the end of the file"));
        };
        match (kind, json) {
            (CHUNK_JSON, None) => json = Some(chunk),
            (CHUNK_BIN, Some(_)) if binary.is_none() => binary = Some(chunk),
            _ => {} // chunks of other kinds are for others
        }
        at += 8 + size as usize;
    }
    json.map(|json| (json, binary)).ok_or_else(|| "the GLB has no JSON chunk".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn glb(chunks: &[(&[u8; 4], &[u8])]) -> Vec<u8> {
        let mut body = Vec::new();
        for (kind, bytes) in chunks {
            body.extend((bytes.len() as u32).to_le_bytes());
            body.extend(*kind);
            body.extend(*bytes);
        }
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend((body.len() as u32 + 12).to_le_bytes());
        out.extend(body);
        out
    }

    const MINIMAL: &[u8] = br#"{"asset":{"version":"2.0"}}"#;

    fn fault(bytes: &[u8]) -> String {
        Container::parse(bytes, drop).err().expect("must be refused")
    }

    #[test]
    fn a_glb_is_its_chunks() {
        let bytes = glb(&[(b"JSON", MINIMAL), (b"ODD\0", b"?"), (b"BIN\0", b"abcd")]);
        let container = Container::parse(&bytes, drop).unwrap();
        assert_eq!(container.binary, Some(&b"abcd"[..]));
        for cut in 0..bytes.len() {
            assert!(Container::parse(&bytes[..cut], drop).is_err(), "cut at {cut}");
        }
        assert!(fault(&glb(&[(b"BIN\0", b"abcd")])).contains("no JSON chunk"));
    }

    #[test]
    fn what_gltf_allows_is_mended() {
        let odd = br#"{"asset":{"version":"2.0"},"scenes":[{}],"animations":[{"samplers":[],
            "channels":[{"sampler":0,"target":{"path":"pointer"}}]}],
            "extensions":{"KHR_lights_punctual":{}}}"#;
        let root = Container::parse(odd, drop).unwrap().root;
        assert!(root.scenes[0].nodes.is_empty() && root.animations[0].channels.is_empty());
        let wrong = br#"{"asset":{"version":"2.0"},"scenes":[{}],"meshes":[{}]}"#;
        assert!(fault(wrong).contains("line"), "the fault is that of the file as it stands");
    }

    #[test]
    fn what_is_no_gltf_at_all_is_said_in_a_word() {
        assert!(fault(b"").contains("empty"));
        for other in [&b"hello"[..], b"[1]", b"\x89PNG\r\n", b"\xef\xbb\xbf"] {
            assert!(fault(other).contains("neither GLB nor"), "{other:?}");
        }
    }

    #[test]
    fn extras_may_be_anything() {
        let kept = br#" {"asset":{"version":"2.0","extras":[1]},"extras":42,
            "nodes":[{"extras":"mine"},{"extras":{"own":true}}]}"#;
        assert_eq!(Container::parse(kept, |_| ()).unwrap().root.nodes.len(), 2);
    }

    #[test]
    fn versions_and_required_extensions() {
        assert!(fault(br#"{"asset":{"version":"1.0"}}"#).contains("glTF `1.0`"));
        let required = br#"{"asset":{"version":"2.0"},
            "extensionsRequired":["KHR_draco_mesh_compression"]}"#;
        assert!(fault(required).contains("KHR_draco_mesh_compression"));
        let mut warnings = Vec::new();
        let used = br#"{"asset":{"version":"2.0"},"extensionsUsed":["KHR_texture_basisu"]}"#;
        Container::parse(used, |w| warnings.push(w)).unwrap();
        assert!(warnings[0].contains("KHR_texture_basisu"));
    }
}
