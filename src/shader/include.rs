//! `#include` of GLSL files, for shaders that come from files.

use std::{
    borrow::Cow,
    path::{Path, PathBuf},
};

/// Whether an `#include` is somewhere in the source, as preprocessors read it: blanks, comments and the end of
/// a line that goes on may stand behind the `#`.
pub(super) fn is_in(source: &str) -> bool {
    let joined = source.replace("\\\r\n", "").replace("\\\n", "").replace("\\\r", "");
    joined.split('#').skip(1).any(|mut directive| {
        loop {
            directive = directive.trim_start_matches([' ', '\t', '\x0b', '\x0c']);
            match directive.strip_prefix("/*").and_then(|comment| comment.split_once("*/")) {
                Some((_, after)) => directive = after,
                None => return directive.starts_with("include"),
            }
        }
    })
}

/// The source with the extension on that `#include` belongs to, as compilers of files have it: many
/// sources rely on that. Lines keep their numbers.
pub(super) fn allowed(source: &str) -> Cow<'_, str> {
    let said = ["GL_GOOGLE_include_directive", "GL_ARB_shading_language_include"];
    let version = source.lines().position(|line| line.trim_start().starts_with("#version"));
    let (true, false, Some(line)) =
        (is_in(source), said.iter().any(|e| source.contains(e)), version)
    else {
        return source.into();
    };
    let at = source.split_inclusive('\n').take(line + 1).map(str::len).sum();
    let (head, rest) = source.split_at(at);
    let extension = "#extension GL_GOOGLE_include_directive : enable";
    format!("{head}\n{extension}\n#line {}\n{rest}", line + 2).into()
}

/// Deeper nesting is taken for a file that includes itself.
const DEPTH: usize = 32;

/// Finds included files: beside the file that includes them, beside the shader, in further folders.
/// Without a folder it finds nothing.
#[derive(Clone, Debug, Default)]
pub(super) struct Finder {
    folders: Vec<PathBuf>,
}

impl Finder {
    /// For the shader at `path`, with further `folders`.
    pub fn new(path: &Path, folders: &[PathBuf]) -> Self {
        let own = path.parent().unwrap_or(Path::new("")).to_path_buf();
        Self { folders: std::iter::once(own).chain(folders.iter().cloned()).collect() }
    }

    /// Path and text of the file called `name` in an `#include` of `includer`.
    pub fn find(&self, name: &str, includer: &str, depth: usize) -> Option<(String, String)> {
        if depth > DEPTH || self.folders.is_empty() {
            return None;
        }
        // An included file is known to the compiler by the path under which it was found.
        let beside = Path::new(includer).parent().filter(|p| !p.as_os_str().is_empty());
        let folders = beside.into_iter().chain(self.folders.iter().map(PathBuf::as_path));
        folders.map(|folder| folder.join(name)).find_map(|path| {
            let text = super::compile::plain_ascii(&std::fs::read_to_string(&path).ok()?).ok()?;
            let path = path.to_str().filter(|p| !p.is_empty() && !p.contains('\0'))?;
            Some((path.to_string(), text))
        })
    }
}

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
mod tests {
    use crate::shader::Shader;

    #[test]
    fn files_are_found_beside_the_file_that_includes_them() {
        let folder = tempfile::tempdir().unwrap();
        let write =
            |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        std::fs::create_dir(folder.path().join("lib")).unwrap();
        write("lib/a.glsl", "#include \"b.glsl\"\nfloat a() { return b(); }\n");
        write("lib/b.glsl", "float b() { return 1.0; }\n");
        let body = "layout(location = 0) out vec4 color;\nvoid main() { color = vec4(a()); }\n";
        write("x.frag", &format!("#version 460\n#include \"lib/a.glsl\"\n{body}"));
        Shader::from_file(folder.path(), &folder.path().join("x.frag")).unwrap();
        write("y.frag", &format!("#version 460\n#include \"lib/a.glsl\"\n{body}oops"));
        let fault = Shader::from_file(folder.path(), &folder.path().join("y.frag")).unwrap_err();
        let text = fault.to_string();
        assert!(text.contains("y.frag") && text.contains("line 5"), "{text}");
        write("lib/b.glsl", "float b() { return missing; }\n");
        let fault = Shader::from_file(folder.path(), &folder.path().join("x.frag")).unwrap_err();
        let text = fault.to_string();
        assert!(text.contains("b.glsl line 1: 'missing'"), "{text}");
        write("lib/b.glsl", "#include \"b.glsl\"\n");
        let fault = Shader::from_file(folder.path(), &folder.path().join("x.frag"));
        assert!(fault.is_err(), "a file that includes itself");
    }
}
