//! MTL libraries: the materials of OBJ files.

use super::parse::floats;
use std::collections::HashMap;

/// A texture statement with the options that change the picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MtlMap {
    pub name: String,
    pub clamp: bool,
    /// `-bm`
    pub bump: f32,
    /// `-o` and `-s`, u and v.
    pub offset: [f32; 2],
    pub scale: [f32; 2],
}

/// A material as the file has it; `None` is unsaid.
#[derive(Clone, Debug, Default)]
pub(super) struct Mtl {
    pub diffuse: Option<[f32; 3]>,
    pub specular: Option<[f32; 3]>,
    pub emissive: Option<[f32; 3]>,
    /// `Ns`
    pub shininess: Option<f32>,
    /// `d`, or what `Tr` leaves.
    pub opacity: Option<f32>,
    /// `Pr` and `Pm` of the common extension.
    pub roughness: Option<f32>,
    pub metallic: Option<f32>,
    pub diffuse_map: Option<MtlMap>,
    pub opacity_map: Option<MtlMap>,
    pub emissive_map: Option<MtlMap>,
    /// Heights, or normals that are called heights.
    pub bump_map: Option<MtlMap>,
    /// `norm`: certainly normals.
    pub normal_map: Option<MtlMap>,
}

/// Reads a library. What it does not know it passes over, as MTL files demand.
pub(super) fn parse(text: &str, out: &mut HashMap<String, Mtl>) {
    let mut current: Option<&mut Mtl> = None;
    for line in text.lines() {
        let line = line.trim();
        let (keyword, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        if keyword == "newmtl" {
            let made = out.entry(rest.to_owned()).or_default();
            *made = Mtl::default();
            current = Some(made);
            continue;
        }
        let Some(mtl) = current.as_deref_mut() else { continue };
        match keyword.to_ascii_lowercase().as_str() {
            "kd" => mtl.diffuse = color(rest),
            "ks" => mtl.specular = color(rest),
            "ke" => mtl.emissive = color(rest),
            "ns" => mtl.shininess = number(rest),
            "d" => mtl.opacity = number(rest.trim_start_matches("-halo").trim()),
            "tr" => {
                let opacity = number(rest).map(|t| 1.0 - t);
                mtl.opacity = mtl.opacity.or(opacity);
            }
            "pr" => mtl.roughness = number(rest),
            "pm" => mtl.metallic = number(rest),
            "map_kd" => mtl.diffuse_map = map(rest),
            "map_d" => mtl.opacity_map = map(rest),
            "map_ke" => mtl.emissive_map = map(rest),
            "map_bump" | "bump" => mtl.bump_map = map(rest),
            "norm" | "map_kn" => mtl.normal_map = map(rest),
            _ => {}
        }
    }
}

fn number(text: &str) -> Option<f32> {
    let mut value = [0.0];
    (floats(text, &mut value) == 1 && value[0].is_finite()).then_some(value[0])
}

/// Three numbers, or one for all.
fn color(text: &str) -> Option<[f32; 3]> {
    let mut value = [0.0; 3];
    match floats(text, &mut value) {
        _ if value.iter().any(|v| !v.is_finite()) => None,
        0 => None,
        1 => Some([value[0]; 3]),
        _ => Some(value),
    }
}

/// Options first, then a file name that may contain spaces.
fn map(text: &str) -> Option<MtlMap> {
    let mut map =
        MtlMap { name: String::new(), clamp: false, bump: 1.0, offset: [0.0; 2], scale: [1.0; 2] };
    let mut rest = text.trim();
    while let Some(option) = rest.strip_prefix('-') {
        let (name, mut after) = option.split_once(char::is_whitespace).unwrap_or((option, ""));
        after = after.trim_start();
        let mut take = || {
            let (word, left) = after.split_once(char::is_whitespace).unwrap_or((after, ""));
            after = left.trim_start();
            word
        };
        match name {
            "clamp" => map.clamp = take() == "on",
            "bm" => map.bump = number(take()).unwrap_or(1.0),
            "mm" => drop((take(), take())),
            "o" | "s" | "t" => {
                // One to three numbers.
                let mut values = [None; 3];
                for value in &mut values {
                    let word = after.split_whitespace().next().unwrap_or("");
                    *value = word.parse::<f32>().ok().filter(|v| v.is_finite());
                    if value.is_none() {
                        break;
                    }
                    after = after[word.len()..].trim_start();
                }
                let target = match name {
                    "o" => &mut map.offset,
                    "s" => &mut map.scale,
                    _ => {
                        rest = after;
                        continue;
                    }
                };
                for (slot, value) in target.iter_mut().zip(values) {
                    *slot = value.unwrap_or(*slot);
                }
            }
            _ => drop(take()),
        }
        rest = after;
    }
    map.name = rest.trim_matches('"').to_owned();
    (!map.name.is_empty()).then_some(map)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_come_before_a_name_with_spaces() {
        let m = map("-s 2 3 1 -clamp on -bm 0.5 -mm 0 1 -imfchan r my  wood.png").unwrap();
        assert_eq!((m.scale, m.clamp, m.bump), ([2.0, 3.0], true, 0.5));
        assert_eq!(m.name, "my  wood.png");
        let m = map("-o 0.25 -t 1 1 7.png").unwrap();
        assert_eq!((m.offset, m.name.as_str()), ([0.25, 0.0], "7.png"));
        assert_eq!(map("-clamp on"), None);
        assert_eq!(map(""), None);
    }

    #[test]
    fn values_that_are_none_are_unsaid() {
        let mut out = HashMap::new();
        parse("Kd 1 1 1\nnewmtl a b\n\tKd 0.5\nd x\nTr 0.25\nNs nan\nkd\nmap_Kd t.png", &mut out);
        let m = &out["a b"];
        assert_eq!((m.diffuse, m.opacity, m.shininess), (None, Some(0.75), None));
        assert!(m.diffuse_map.is_some());
    }
}
