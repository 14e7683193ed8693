//! `#version` and `#include` of GLSL files, for shaders that come from files.

use std::{
    borrow::Cow,
    ops::Range,
    path::{Path, PathBuf},
};

/// What ends a line of text, but not a line of the source.
const CONTINUED: [&str; 3] = ["\\\r\n", "\\\n", "\\\r"];

/// `text` after blanks and comments, on the first line of the source or, if `over_lines`, on any.
fn after_blanks(mut text: &str, over_lines: bool) -> &str {
    loop {
        text = text.trim_start_matches([' ', '\t', '\x0b', '\x0c']);
        let further = if let Some(comment) = text.strip_prefix("/*") {
            comment.split_once("*/").map(|(_, after)| after)
        } else if let Some(after) = CONTINUED.iter().find_map(|end| text.strip_prefix(end)) {
            Some(after)
        } else if text.starts_with("//") {
            over_lines.then(|| &text[line_end(text)..])
        } else {
            text.strip_prefix(['\n', '\r']).filter(|_| over_lines)
        };
        match further {
            Some(after) => text = after,
            None => return text,
        }
    }
}

/// Where the first line of the source in `text` ends.
fn line_end(text: &str) -> usize {
    let (mut rest, mut is_comment) = (text, false);
    while let Some(at) = rest.find(['\n', '\r', '\\', '/']) {
        rest = &rest[at..];
        is_comment |= rest.starts_with("//");
        let opens = rest.starts_with("/*") && !is_comment;
        let comment = if opens { rest[2..].find("*/").map(|end| end + 4) } else { None };
        let continued = CONTINUED.iter().find(|end| rest.starts_with(**end)).map(|end| end.len());
        match comment.or(continued) {
            Some(passed) => rest = &rest[passed..],
            None if rest.starts_with(['\n', '\r']) => return text.len() - rest.len(),
            None => rest = &rest[1..],
        }
    }
    text.len()
}

/// The line of the `#version`, which nothing but blanks and comments may precede.
pub(super) fn version(source: &str) -> Option<Range<usize>> {
    let line = after_blanks(source, true);
    let name = after_blanks(line.strip_prefix('#')?, false);
    let start = source.len() - line.len();
    name.starts_with("version").then(|| start..start + line_end(line))
}

/// The number of the line that byte `at` is in.
pub(super) fn line_number(source: &str, at: usize) -> usize {
    source[..at].matches('\n').count() + 1
}

/// Whether an `#include` is somewhere in the source, as preprocessors read it: blanks, comments and the end of
/// a line that goes on may stand behind the `#`.
pub(super) fn is_in(source: &str) -> bool {
    let joined = CONTINUED.iter().fold(source.to_string(), |text, end| text.replace(end, ""));
    let mut directives = joined.split('#').skip(1);
    directives.any(|directive| after_blanks(directive, false).starts_with("include"))
}

/// The source with the extension on that `#include` belongs to, as compilers of files have it: many
/// sources rely on that. Lines keep their numbers.
pub(super) fn allowed(source: &str) -> Cow<'_, str> {
    let said = ["GL_GOOGLE_include_directive", "GL_ARB_shading_language_include"];
    let (true, false, Some(version)) =
        (is_in(source), said.iter().any(|e| source.contains(e)), version(source))
    else {
        return source.into();
    };
    let (head, rest) = source.split_at(version.end);
    let extension = "#extension GL_GOOGLE_include_directive : enable";
    // The rest begins with the end of the version's line.
    format!("{head}\n{extension}\n#line {}{rest}", line_number(source, version.end) + 1).into()
}

/// The source as [`allowed`] has it, with the lines of `defines` after that of the version. Lines keep their numbers.
pub(super) fn with_defines(source: &str, defines: &str) -> String {
    let source = allowed(source);
    let Some(version) = version(&source) else { return source.into() };
    let (head, rest) = source.split_at(version.end);
    format!("{head}\n{defines}#line {}{rest}", line_number(&source, version.end) + 1)
}

/// Deeper nesting is taken for a file that includes itself.
pub(super) const DEPTH: usize = 32;

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

    #[test]
    fn a_version_may_be_written_in_any_way() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("one.glsl"), "const float ONE = 1.0;\n").unwrap();
        let path = folder.path().join("x.frag");
        let body = "#include \"one.glsl\"
layout(location = 0) out vec4 color;
void main() { color = vec4(ONE); }
";
        for version in [
            "#version 460",
            "  #\t version 460 // newest",
            "// #version 300 es\n# version 460",
            "/* #version 300 es\n*/ # version 460 /* the end\n*/",
            "#version 460 core // no /* comment",
            "// no /* comment\n#version 460",
        ] {
            std::fs::write(&path, format!("{version}\n{body}")).unwrap();
            Shader::from_file(folder.path(), &path).unwrap_or_else(|e| panic!("{version}: {e}"));
            // Lines keep their numbers.
            std::fs::write(&path, format!("{version}\n{body}oops")).unwrap();
            let text = Shader::from_file(folder.path(), &path).unwrap_err().to_string();
            let line = version.matches('\n').count() + 5;
            assert!(text.contains(&format!("line {line}")), "{version}: {text}");
        }
    }

    #[test]
    fn the_line_of_the_version_is_found() {
        let found = |source: &str| super::version(source).map(|range| source[range].to_string());
        for (source, line) in [
            ("#version 450", Some("#version 450")),
            ("// #version 1\r\n\n #\t version 450\r\nvoid", Some("#\t version 450")),
            ("/*\n*/ # /* */ version 450 /*\n*/\nvoid", Some("# /* */ version 450 /*\n*/")),
            ("#\\\nversion \\\r\n450\nvoid", Some("#\\\nversion \\\r\n450")),
            ("#version 450 // /*\nvoid", Some("#version 450 // /*")),
            ("#version 450 /", Some("#version 450 /")),
            ("#version 450 /*/\n*/\nvoid", Some("#version 450 /*/\n*/")),
            ("#version 450 /*/", Some("#version 450 /*/")),
            ("void main() {}\n#version 450", None),
            ("// #version 450", None),
            ("/* #version 450", None),
            ("#define version", None),
            ("", None),
        ] {
            assert_eq!(found(source).as_deref(), line, "{source}");
        }
    }
}
