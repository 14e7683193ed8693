//! Compiled GLSL on disk (see [`crate::cache`]), so that most runs do not start the compiler at all:
//! its first call in a process takes 0.2 seconds, later ones 1 to 6 milliseconds; reading a result
//! takes 0.1 to 0.4.
//!
//! A file holds the result and everything that the result depends on. The latter is compared in full,
//! so two sources can never be taken for each other. Sources that include others are compiled every
//! time: the text of the included files is not part of the key.

use super::{Stage, include};
use crate::cache;
use std::{
    path::{Path, PathBuf},
    sync::{OnceLock, PoisonError, RwLock},
};

static FOLDER: RwLock<Option<PathBuf>> = RwLock::new(None);

/// From now on, this process keeps what it compiles from GLSL in `folder`, such as [`crate::cache_folder`], and takes from
/// there what an earlier run compiled. With `None` it keeps nothing, which is how a process begins.
pub fn keep_compiled(folder: impl Into<Option<PathBuf>>) {
    *FOLDER.write().unwrap_or_else(PoisonError::into_inner) = folder.into();
}

/// Where results are kept.
pub(super) fn folder() -> Option<PathBuf> {
    FOLDER.read().unwrap_or_else(PoisonError::into_inner).clone()
}

/// A source and where its result is kept.
pub(super) struct Entry {
    file: PathBuf,
    key: Vec<u8>,
}

impl Entry {
    /// The entry for a source, if results are kept and this one may be.
    pub fn new(folder: Option<&Path>, stage: Stage, source: &str) -> Option<Self> {
        if include::is_in(source) {
            return None;
        }
        let key =
            [maker().as_bytes(), format!("{stage:?}\n").as_bytes(), source.as_bytes()].concat();
        let name = format!("shader-{:016x}.bin", cache::checksum([key.as_slice()]));
        Some(Self { file: folder?.join(name), key })
    }

    /// The module that was kept.
    pub fn read(&self) -> Option<Vec<u32>> {
        let content = cache::read(&self.file)?;
        let (length, rest) = content.split_first_chunk::<4>()?;
        let (key, words) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        let words = words.chunks_exact(4).map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]));
        (key == self.key).then(|| words.collect())
    }

    /// Keeps a module.
    pub fn write(&self, words: &[u32]) {
        let mut content = (self.key.len() as u32).to_le_bytes().to_vec();
        content.extend_from_slice(&self.key);
        content.extend(words.iter().flat_map(|w| w.to_le_bytes()));
        cache::write(&self.file, &content);
    }
}

/// What made the module: this version, the compiler, and its settings.
fn maker() -> &'static str {
    static MAKER: OnceLock<String> = OnceLock::new();
    MAKER.get_or_init(|| {
        let settings = cache::checksum([
            include_bytes!("bundled.rs").as_slice(),
            include_bytes!("system.rs").as_slice(),
            include_bytes!("compile.rs").as_slice(),
            include_bytes!("include.rs").as_slice(),
            include_bytes!("validate.rs").as_slice(),
        ]);
        let compiler = if cfg!(feature = "glsl-bundled") { "bundled" } else { env!("LIBSHADERC") };
        format!("tilewright {} {settings:016x} {compiler}\n", env!("CARGO_PKG_VERSION"))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_module_is_kept_for_its_source_alone() {
        let folder = tempfile::tempdir().unwrap();
        let entry = |stage, source| Entry::new(Some(folder.path()), stage, source).unwrap();
        let first = entry(Stage::Vertex, "void main() {}");
        assert_eq!(first.read(), None);
        first.write(&[1, 2, 3]);
        assert_eq!(entry(Stage::Vertex, "void main() {}").read().as_deref(), Some(&[1, 2, 3][..]));
        assert_eq!(entry(Stage::Fragment, "void main() {}").read(), None);
        assert_eq!(entry(Stage::Vertex, "void main() { }").read(), None);
        // Another source whose name is the same by accident.
        let other = Entry { file: first.file.clone(), key: b"other".to_vec() };
        assert_eq!(other.read(), None);
        assert!(Entry::new(None, Stage::Vertex, "").is_none());
        for including in [
            "#include \"a\"",
            " # include \"a\"",
            "#\t/* */ include <a>",
            "#\\\ninc\\\r\nlude \"a\"",
        ] {
            let entry = Entry::new(Some(folder.path()), Stage::Vertex, including);
            assert!(entry.is_none(), "{including}");
        }
        entry(Stage::Vertex, "#define a // it may include more");
    }
    /// What stands behind `use super::` in `file`: names of modules begin in lower case.
    fn drawn_on(file: &str) -> Vec<String> {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("src/shader").join(file);
        let text = std::fs::read_to_string(path).unwrap();
        let uses = text.split("use super::").skip(1).filter_map(|rest| rest.split(';').next());
        let names = uses.flat_map(|uses| uses.split(['{', '}', ',']).map(str::trim));
        let modules = names.filter_map(|name| name.split([':', ' ']).next());
        let is_module = |name: &&str| name.starts_with(|c: char| c.is_ascii_lowercase());
        modules.filter(is_module).map(str::to_string).collect()
    }

    #[test]
    fn every_file_that_makes_a_module_is_part_of_its_maker() {
        let all = [drawn_on("compile.rs"), vec!["compile".to_string()]].concat();
        assert!(all.contains(&"include".to_string()), "{all:?}");
        // A result, which has no code, and this file, which makes nothing.
        let other = ["self", "module", "stored"];
        for name in all.iter().filter(|name| !other.contains(&name.as_str())) {
            let text = include_str!("stored.rs");
            let file = format!("include_bytes!(\"{name}.rs\")");
            assert!(text.contains(&file), "{name}.rs is left out");
        }
    }
}
