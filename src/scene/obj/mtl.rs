//! MTL libraries: the materials of OBJ files.

use super::text::{
    Statements, decode, number, number_words, readings, shown, split_word, trim, unquoted,
    without_comment,
};
use std::{
    collections::{HashMap, HashSet},
    path::PathBuf,
};

/// A texture statement with the options that change the picture.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct MtlMap {
    /// Possible names of the file, the likeliest first.
    pub names: Vec<Vec<u8>>,
    pub clamp: bool,
    /// `-bm`
    pub bump: f32,
    /// `-o` and `-s`, u and v.
    pub offset: [f32; 2],
    pub scale: [f32; 2],
    /// `-imfchan`: the channel that a map of single values is read from.
    pub channel: Option<Channel>,
}

/// A value of a texel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Channel {
    Red,
    Green,
    Blue,
    /// `m`: alpha.
    Matte,
    Luminance,
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
    /// The statement that makes it invisible, and where that stands.
    pub invisible: Option<String>,
    /// `Pr` and `Pm` of the common extension.
    pub roughness: Option<f32>,
    pub metallic: Option<f32>,
    pub diffuse_map: Option<MtlMap>,
    pub opacity_map: Option<MtlMap>,
    pub emissive_map: Option<MtlMap>,
    pub roughness_map: Option<MtlMap>,
    pub metallic_map: Option<MtlMap>,
    /// Heights, or normals that are called heights.
    pub bump_map: Option<MtlMap>,
    /// `norm`: certainly normals.
    pub normal_map: Option<MtlMap>,
}

/// The materials of all libraries of a file. If several have one name, the first counts, as libraries
/// are searched in the order in which the file names them.
#[derive(Default)]
pub(super) struct Library {
    /// The files that were read.
    pub files: HashSet<PathBuf>,
    materials: Vec<Mtl>,
    numbers: HashMap<Vec<u8>, usize>,
    /// By names without comments and quotes.
    plain: HashMap<Vec<u8>, usize>,
}

impl Library {
    /// The material called `name`. A name may contain `#`; only if there is no such name, that begins a
    /// comment.
    pub fn get(&self, name: &[u8]) -> Option<&Mtl> {
        let number = self.numbers.get(name).or_else(|| {
            let name = plain(name);
            self.numbers.get(name).or_else(|| self.plain.get(name))
        });
        number.map(|&number| &self.materials[number])
    }

    /// Adds the library in `bytes`, the file `file`, and returns what is wrong with it. It passes over
    /// statements that it does not know, as MTL files demand.
    pub fn add(&mut self, bytes: &[u8], file: &str) -> Vec<String> {
        let text = decode(bytes);
        let before = self.materials.len();
        // Statements before the first name, and definitions that do not count, are dropped.
        let mut nowhere = Mtl::default();
        let mut current = None;
        let (mut warnings, mut twice) = (Vec::new(), None);
        for (line, statement) in Statements::new(&text, is_keyword) {
            let (keyword, rest) = split_word(&statement);
            let keyword = keyword.to_ascii_lowercase();
            if keyword != b"newmtl" {
                let mtl = match current {
                    Some(number) => &mut self.materials[number],
                    None => &mut nowhere,
                };
                mtl.set(&keyword, rest, line, file);
                continue;
            }
            current = None;
            match self.numbers.get(rest) {
                Some(&number) if number >= before => {
                    twice.get_or_insert_with(|| (line, shown(rest)));
                }
                Some(_) => {}
                None => {
                    current = Some(self.materials.len());
                    self.numbers.insert(rest.to_vec(), self.materials.len());
                    self.plain.entry(plain(rest).to_vec()).or_insert(self.materials.len());
                    self.materials.push(Mtl::default());
                }
            }
        }
        if let Some((line, name)) = twice {
            warnings.push(format!(
                "{file}, line {line}: the material `{name}` is defined again; its first definition counts"
            ));
        }
        if before == self.materials.len() && self.materials.is_empty() {
            warnings.push(format!("the material library `{file}` defines no material"));
        }
        warnings
    }
}

fn plain(name: &[u8]) -> &[u8] {
    match name.first() {
        Some(b'"') => unquoted(name),
        _ => without_comment(name),
    }
}

fn is_keyword(word: &[u8]) -> bool {
    let lower = word.to_ascii_lowercase();
    let known: [&[u8]; 22] = [
        b"newmtl",
        b"ka",
        b"kd",
        b"ks",
        b"ke",
        b"kt",
        b"km",
        b"ns",
        b"ni",
        b"d",
        b"tr",
        b"tf",
        b"illum",
        b"sharpness",
        b"bump",
        b"disp",
        b"decal",
        b"norm",
        b"refl",
        b"pr",
        b"pm",
        b"ps",
    ];
    known.contains(&&lower[..]) || lower.starts_with(b"map_")
}

impl Mtl {
    fn set(&mut self, keyword: &[u8], rest: &[u8], line: usize, file: &str) {
        match keyword {
            b"kd" => self.diffuse = color(rest),
            b"ks" => self.specular = color(rest),
            b"ke" => self.emissive = color(rest),
            b"ns" => self.shininess = value(rest),
            b"d" | b"tr" => self.set_opacity(keyword, rest, line, file),
            b"pr" => self.roughness = value(rest),
            b"pm" => self.metallic = value(rest),
            b"map_kd" => self.diffuse_map = map(rest),
            b"map_d" | b"map_tr" | b"map_opacity" => self.opacity_map = map(rest),
            b"map_ke" => self.emissive_map = map(rest),
            b"map_pr" => self.roughness_map = map(rest),
            b"map_pm" => self.metallic_map = map(rest),
            b"map_bump" | b"bump" => self.bump_map = map(rest),
            b"norm" | b"map_kn" | b"map_norm" => self.normal_map = map(rest),
            _ => {}
        }
    }

    /// `d` is the opacity, `Tr` the rest; `d` counts if there are both.
    fn set_opacity(&mut self, keyword: &[u8], rest: &[u8], line: usize, file: &str) {
        let Some(number) = value(rest.strip_prefix(b"-halo").unwrap_or(rest)) else { return };
        let (opacity, name) = match keyword {
            b"d" => (number, "d"),
            _ if self.opacity.is_some() => return,
            _ => (1.0 - number, "Tr"),
        };
        self.opacity = Some(opacity);
        self.invisible =
            (opacity <= 0.0).then(|| format!("`{name} {number}` in {file}, line {line}"));
    }
}

fn value(text: &[u8]) -> Option<f32> {
    let word = number_words(text).next()?;
    number(word).map(|v| v as f32).filter(|v| v.is_finite())
}

/// Three numbers, or one for all.
fn color(text: &[u8]) -> Option<[f32; 3]> {
    let mut color = [0.0; 3];
    let words = number_words(text).map_while(number);
    let count = color.iter_mut().zip(words).map(|(slot, v)| *slot = v as f32).count();
    match count {
        _ if color.iter().any(|v| !v.is_finite()) => None,
        0 => None,
        1 => Some([color[0]; 3]),
        _ => Some(color),
    }
}

/// Options, then a file name, which may contain blanks; some programs write the options after it.
fn map(text: &[u8]) -> Option<MtlMap> {
    let mut map = MtlMap {
        names: Vec::new(),
        clamp: false,
        bump: 1.0,
        offset: [0.0; 2],
        scale: [1.0; 2],
        channel: None,
    };
    let mut rest = trim(text);
    while let Some(after) = map.option(rest) {
        rest = after;
    }
    let dashes = (1..rest.len()).filter(|&i| rest[i - 1..].starts_with(b" -"));
    // Copied for every dash, and therefore without names, which may be as long as the file.
    let nameless = map.clone();
    let is_option = |&i: &usize| nameless.clone().option(&rest[i..]).is_some();
    let end = dashes.into_iter().find(is_option);
    map.names = readings(rest);
    if let Some(end) = end {
        let mut options = &rest[end..];
        while let Some(after) = map.option(options) {
            options = after;
        }
        map.names.extend(readings(trim(&rest[..end])));
    }
    map.names.retain(|name| !name.is_empty());
    (!map.names.is_empty()).then_some(map)
}

impl MtlMap {
    /// Takes one option from the front of `text` and returns what follows; `None` if there is none.
    fn option<'a>(&mut self, text: &'a [u8]) -> Option<&'a [u8]> {
        let (option, mut rest) = split_word(text);
        let name = option.strip_prefix(b"-")?.to_ascii_lowercase();
        // How many words may follow, and how many of them at least.
        let (least, most) = match &name[..] {
            b"o" | b"s" | b"t" => (1, 3),
            b"mm" => (2, 2),
            b"bm" | b"boost" | b"texres" | b"clamp" | b"blendu" | b"blendv" | b"cc"
            | b"imfchan" | b"type" | b"halo" => (1, 1),
            _ => return None,
        };
        let numeric =
            !matches!(&name[..], b"clamp" | b"blendu" | b"blendv" | b"cc" | b"imfchan" | b"type");
        let mut values = [None; 3];
        for (i, slot) in values.iter_mut().enumerate().take(most) {
            let (word, after) = split_word(rest);
            let is_taken = match numeric {
                true => number(word).is_some(),
                false => !word.is_empty(),
            };
            if !is_taken {
                if i < least && !numeric {
                    return None;
                }
                break;
            }
            *slot = Some(word);
            rest = after;
        }
        let number = |i: usize| values[i].and_then(value);
        let set = |target: &mut [f32; 2]| {
            for (i, slot) in target.iter_mut().enumerate() {
                *slot = number(i).unwrap_or(*slot);
            }
        };
        match &name[..] {
            b"o" => set(&mut self.offset),
            b"s" => set(&mut self.scale),
            b"bm" => self.bump = number(0).unwrap_or(self.bump),
            b"clamp" => self.clamp = values[0].is_some_and(|word| word.eq_ignore_ascii_case(b"on")),
            b"imfchan" => {
                self.channel = match values[0].unwrap_or_default() {
                    b"r" => Some(Channel::Red),
                    b"g" => Some(Channel::Green),
                    b"b" => Some(Channel::Blue),
                    b"m" => Some(Channel::Matte),
                    b"l" => Some(Channel::Luminance),
                    _ => self.channel,
                }
            }
            _ => {}
        }
        Some(rest)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn name(map: &MtlMap) -> String {
        String::from_utf8(map.names.last().unwrap().clone()).unwrap()
    }

    fn read(text: &[u8]) -> (Library, Vec<String>) {
        let mut library = Library::default();
        let warnings = library.add(text, "x.mtl");
        (library, warnings)
    }

    #[test]
    fn options_come_before_a_name_with_spaces() {
        let m = map(b"-s 2 3 1 -clamp on -bm 0.5 -mm 0 1 -imfchan r my  wood.png").unwrap();
        assert_eq!((m.scale, m.clamp, m.bump), ([2.0, 3.0], true, 0.5));
        assert_eq!((name(&m).as_str(), m.channel), ("my  wood.png", Some(Channel::Red)));
        let m = map(b"-o 0.25 -t 1 1 7.png").unwrap();
        assert_eq!((m.offset, name(&m).as_str()), ([0.25, 0.0], "7.png"));
        assert_eq!(map(b"-clamp on"), None);
        assert_eq!(map(b""), None);
    }

    #[test]
    fn options_after_the_name_and_names_like_options() {
        let m = map(b"-imfchan l my bump.png -bm 1.5 -clamp on # c").unwrap();
        assert_eq!((m.bump, m.clamp, m.channel), (1.5, true, Some(Channel::Luminance)));
        assert_eq!(name(&m), "my bump.png");
        let m = map(b"a -bcd 1.png").unwrap();
        assert_eq!(m.names, [&b"a -bcd 1.png"[..]]);
        assert_eq!(name(&map(b"-wood.png").unwrap()), "-wood.png");
        assert_eq!(name(&map(b"-bm wood.png").unwrap()), "wood.png", "the number is missing");
    }

    #[test]
    fn a_line_of_dashes_is_one_name() {
        // With a copy of the name for each dash, this would be a terabyte of copies.
        let line = b"- ".repeat(1 << 19);
        let m = map(&line).unwrap();
        assert_eq!((m.names.len(), m.names[0].len()), (1, line.len() - 1));
    }

    #[test]
    fn values_that_are_none_are_unsaid() {
        let (library, warnings) =
            read(b"Kd 1 1 1\nnewmtl a b\n\tKd 0.5\nd x\nTr 0.25\nNs nan\nkd\nMAP_Kd t.png");
        let m = library.get(b"a b").unwrap();
        assert_eq!((m.diffuse, m.opacity, m.shininess), (None, Some(0.75), None));
        assert!(m.diffuse_map.is_some() && m.invisible.is_none() && warnings.is_empty());
    }

    #[test]
    fn opacity_counts_before_transparency() {
        for (text, opacity, invisible) in [
            ("d 0.5\nTr 1", 0.5, None),
            ("Tr 1\nd 1", 1.0, None),
            ("Tr 1", 0.0, Some("`Tr 1` in x.mtl, line 2")),
            ("Ns 1\nd -halo 0 # x", 0.0, Some("`d 0` in x.mtl, line 3")),
        ] {
            let (library, _) = read(format!("newmtl a\n{text}").as_bytes());
            let m = library.get(b"a").unwrap();
            assert_eq!((m.opacity, m.invisible.as_deref()), (Some(opacity), invisible), "{text}");
        }
    }

    #[test]
    fn the_first_definition_counts_and_names_are_bytes() {
        let (mut library, warnings) = read(
            b"newmtl x\nKd 1\nnewmtl x\nKd 0.5\nnewmtl gr\xfcn\nnewmtl a #1 # c\nnewmtl \"q\"",
        );
        assert_eq!(warnings.len(), 1, "{warnings:?}");
        assert!(warnings[0].contains("line 3") && warnings[0].contains("`x`"), "{warnings:?}");
        assert!(library.add(b"newmtl x\nKd 0\nnewmtl y", "y.mtl").is_empty());
        assert_eq!(library.get(b"x # comment").unwrap().diffuse, Some([1.0; 3]));
        assert!(library.get(b"gr\xfcn").is_some() && library.get(b"gr\xe4n").is_none());
        assert!(library.get("grün".as_bytes()).is_none());
        for name in [&b"a #1 # c"[..], b"a", b"a # other", b"\"q\"", b"q"] {
            assert!(library.get(name).is_some(), "{}", shown(name));
        }
        assert_eq!(read(b"Kd 1 \\\n0 0").1.len(), 1, "a library without materials is said");
    }

    #[test]
    fn lines_continue_and_end_as_in_obj() {
        let (library, _) = read(b"newmtl a\rKd 1 \\\r0 0\r# \\\rPr 0.5\rmap_Kd t.png \\\rNs 3\r");
        let m = library.get(b"a").unwrap();
        assert_eq!((m.diffuse, m.roughness), (Some([1.0, 0.0, 0.0]), Some(0.5)));
        assert_eq!(m.shininess, Some(3.0));
    }
}
