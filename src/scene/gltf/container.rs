//! The two forms of a glTF file: JSON, and GLB with JSON and one buffer in it.

use super::{super::uri::short, data::Checks, materials::OTHER_IMAGES, mend::mend, pose::Local};
use gltf_json::Root;
use serde_json::Value;

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
pub(super) const DRAWN: [&str; 6] = [
    "KHR_materials_pbrSpecularGlossiness",
    "KHR_materials_unlit",
    "KHR_texture_transform",
    "KHR_materials_emissive_strength",
    "EXT_mesh_gpu_instancing",
    "KHR_mesh_quantization",
];

/// Extensions for compressed geometry. An uncompressed copy may stand beside it, so each place that
/// has some says whether it can be drawn; so does each texture of [`OTHER_IMAGES`].
const COMPRESSED: [&str; 3] =
    ["KHR_draco_mesh_compression", "EXT_meshopt_compression", "KHR_meshopt_compression"];

/// Extensions that change the look but no geometry: ignored with a warning even if required.
fn only_changes_the_look(extension: &str) -> bool {
    extension.starts_with("KHR_materials_") || extension == "KHR_lights_punctual"
}

impl<'a> Container<'a> {
    /// Takes `bytes` apart and checks version and extensions.
    pub fn parse(bytes: &'a [u8], mut warn: impl FnMut(String)) -> Checks<Self> {
        let (json, binary) = match bytes.starts_with(GLB_MAGIC) {
            true => split_glb(bytes, &mut warn)?,
            false => (bytes, None),
        };
        let json = json.strip_prefix(b"\xef\xbb\xbf").unwrap_or(json).trim_ascii_start();
        if bytes.is_empty() {
            return Err("the file is empty".into());
        }
        if !json.starts_with(b"{") {
            return Err("the content is neither GLB nor a JSON object".into());
        }
        let (root, locals) = read(json, &mut warn)?;
        let wanted = root.asset.min_version.as_ref().unwrap_or(&root.asset.version);
        let later = |minimum: &str| !matches!(minimum, "2" | "2.0");
        if !(wanted == "2" || wanted.starts_with("2."))
            || root.asset.min_version.as_deref().is_some_and(later)
        {
            return Err(format!(
                "it says that it is glTF `{}`; only 2.0 can be read",
                short(wanted)
            ));
        }
        let known = [&DRAWN[..], &COMPRESSED, &OTHER_IMAGES].concat();
        let unknown = |list: &[String]| -> Vec<String> {
            list.iter().filter(|name| !known.contains(&name.as_str())).cloned().collect()
        };
        for extension in unknown(&root.extensions_required) {
            if !only_changes_the_look(&extension) {
                return Err(format!(
                    "it requires the extension {}, which is not supported; \
                     export the file without it",
                    short(&extension)
                ));
            }
        }
        for extension in unknown(&root.extensions_used) {
            warn(format!("the extension {} is ignored", short(&extension)));
        }
        Ok(Self { root, locals, binary })
    }
}

/// The typed document, and the transforms of its nodes.
fn read(json: &[u8], warn: &mut dyn FnMut(String)) -> Checks<(Root, Vec<Local>)> {
    let fault = |e: String| format!("the JSON is not glTF 2.0: {}", shortened(&e));
    let mut stream = serde_json::Deserializer::from_slice(json).into_iter::<Value>();
    let mut document = match stream.next() {
        Some(Ok(document)) => document,
        Some(Err(e)) => return Err(fault(e.to_string())),
        None => return Err(fault("it is empty".into())),
    };
    // Writers pad with zeros, and some leave the old end behind when a file gets shorter.
    let rest = &json[stream.byte_offset()..];
    if rest.iter().any(|b| *b != 0 && !b.is_ascii_whitespace()) {
        warn(format!("{} bytes after the JSON are ignored", rest.len()));
    }
    let locals = document.get("nodes").and_then(Value::as_array).into_iter().flatten();
    let locals: Vec<Local> = locals.map(Local::of).collect();
    mend(&mut document, warn);
    if is_gltf_1(&document) {
        return Err(GLTF_1.into());
    }
    serde_json::from_value(document).map(|root| (root, locals)).map_err(|e| {
        // The document does not know its lines; the text does, if it has no other fault before.
        let (said, with_line) = (e.to_string(), Root::from_slice(json).err());
        let with_line = with_line.map(|e| e.to_string()).filter(|line| line.starts_with(&said));
        fault(with_line.unwrap_or(said))
    })
}

/// A parser's sentence without the middle, if it repeats a long text of the file: its end has the line.
fn shortened(said: &str) -> String {
    let count = said.chars().count();
    if count <= 300 {
        return said.to_owned();
    }
    let (head, tail): (String, String) =
        (said.chars().take(200).collect(), said.chars().skip(count - 60).collect());
    format!("{head}…{tail}")
}

/// glTF 1.0 had dictionaries where 2.0 has lists.
fn is_gltf_1(document: &Value) -> bool {
    let version = document.get("asset").and_then(|a| a.get("version")).and_then(Value::as_str);
    let lists = ["accessors", "buffers", "bufferViews", "materials", "meshes", "nodes", "scenes"];
    let dictionaries = lists.iter().any(|name| document.get(name).is_some_and(Value::is_object));
    match version {
        Some(version) => version == "1" || version.starts_with("1."),
        None => dictionaries,
    }
}

const GLTF_1: &str = "it is glTF 1.0; 2.0 is needed: export it anew, or convert it (`gltf-pipeline` \
                      does)";

/// JSON and buffer of a GLB.
fn split_glb<'a>(
    bytes: &'a [u8],
    warn: &mut dyn FnMut(String),
) -> Checks<(&'a [u8], Option<&'a [u8]>)> {
    let word = |at: usize| {
        let bytes = bytes.get(at..at + 4)?;
        Some(u32::from_le_bytes([bytes[0], bytes[1], bytes[2], bytes[3]]))
    };
    let (Some(version), Some(length)) = (word(4), word(8)) else {
        return Err("it ends inside the GLB header".into());
    };
    if version == 1 {
        return Err(GLTF_1.into());
    }
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
        match kind {
            CHUNK_JSON if json.is_none() => json = Some(chunk),
            CHUNK_BIN if binary.is_none() => {
                if json.is_none() {
                    warn("the buffer of the GLB comes before its JSON".into());
                }
                binary = Some(chunk);
            }
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
        let mut warnings = Vec::new();
        let turned = glb(&[(b"ODD\0", b"?"), (b"BIN\0", b"abcd"), (b"JSON", MINIMAL)]);
        let container = Container::parse(&turned, |w| warnings.push(w)).unwrap();
        assert_eq!((container.binary, warnings.len()), (Some(&b"abcd"[..]), 1));
    }

    #[test]
    fn what_gltf_allows_is_mended() {
        let odd = br#"{"asset":{"version":"2.0"},"scenes":[{}],"animations":[{"samplers":[],
            "channels":[{"sampler":0,"target":{"path":"pointer"}}]}],
            "extensions":{"KHR_lights_punctual":{}}}"#;
        let root = Container::parse(odd, drop).unwrap().root;
        assert!(root.scenes[0].nodes.is_empty() && root.animations[0].channels.is_empty());
        // The text has its line where it has no fault before that is mended.
        let wrong = br#"{"asset":{"version":"2.0"},"meshes":[{}]}"#;
        assert!(fault(wrong).contains("primitives` at line 1"), "{}", fault(wrong));
        let wrong = br#"{"asset":{"version":2.0},"scenes":[{}],"meshes":[{}]}"#;
        assert!(fault(wrong).contains("primitives"), "{}", fault(wrong));
        let long = format!(r#"{{"asset":{{"version":"2.0"}},"scene":"{}"}}"#, "x".repeat(9999));
        let said = fault(long.as_bytes());
        assert!(said.len() < 400 && said.contains("line 1 column"), "{said}");
    }

    #[test]
    fn what_follows_the_json_is_no_part_of_it() {
        for (padding, count) in [(&b"\0\0\0"[..], 0), (b" \n\0 ", 0), (b"}]", 1), (b"\0\x01", 1)] {
            let json = [MINIMAL, padding].concat();
            for bytes in [glb(&[(b"JSON", &json), (b"BIN\0", b"abcd")]), json] {
                let mut warnings = Vec::new();
                Container::parse(&bytes, |w| warnings.push(w)).unwrap();
                assert_eq!(warnings.len(), count, "{padding:?}: {warnings:?}");
            }
        }
        assert!(fault(br#"{"asset":{"version":"2.0"}"#).contains("EOF"));
    }

    #[test]
    fn gltf_1_is_said_to_be_one() {
        for old in [
            &br#"{"asset":{"version":"1.0"},"meshes":{"a":{}}}"#[..],
            br#"{"asset":{"version":1},"nodes":{}}"#,
            br#"{"accessors":{"a":{}},"scene":"default"}"#,
            b"glTF\x01\0\0\0\x14\0\0\0\0\0\0\0\0\0\0\0",
        ] {
            assert!(fault(old).contains("glTF 1.0; 2.0 is needed"), "{}", fault(old));
        }
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
        assert!(fault(br#"{"asset":{"version":"3.0"}}"#).contains("glTF `3.0`"));
        let required = br#"{"asset":{"version":"2.0"},"extensionsRequired":["EXT_other"]}"#;
        assert!(fault(required).contains("EXT_other"));
        let mut warnings = Vec::new();
        let used = br#"{"asset":{"version":"2.0"},"extensionsUsed":["EXT_other"]}"#;
        Container::parse(used, |w| warnings.push(w)).unwrap();
        assert!(warnings[0].contains("EXT_other"));
    }
}
