//! GLSL to SPIR-V, through whichever compiler the crate was built with: the system's libshaderc
//! (`system`) or the bundled glslang (`bundled`), which goes first where both are there.
//!
//! The source is compiled as it stands: nothing is inserted, so messages name the user's own lines, and any
//! other Vulkan program would get the same module. Constructs that a compute kernel cannot express (`discard`,
//! implicit derivatives) are lowered later, in SPIR-V; so modules that were handed in as SPIR-V get the same
//! treatment. (Rejected: `#define discard demote` in front of the source. It needs another extension and
//! `#line`, changes the shader that the device's own pipeline runs, and does nothing for SPIR-V.)
//!
//! The compilers may be used from any thread. The first call of a process builds the tables of built-in
//! functions, a tenth of a second and more, later ones take milliseconds.

use super::{
    Stage,
    include::{self, Finder},
    module::Outcome,
    stored::{self, Entry},
    validate,
};
use crate::{Error, Result};

#[cfg(feature = "glsl-bundled")]
use super::bundled as compiler;
#[cfg(all(feature = "glsl", not(feature = "glsl-bundled")))]
use super::system as compiler;

const HAS_COMPILER: bool = cfg!(any(feature = "glsl", feature = "glsl-bundled"));

/// Stands in for the compiler in a build without one.
#[cfg(not(any(feature = "glsl", feature = "glsl-bundled")))]
mod compiler {
    pub type Find<'a> = dyn Fn(&str, &str, usize) -> Option<(String, String)> + 'a;

    pub fn compile(_: &str, _: &str, _: &Find) -> Result<Vec<u32>, String> {
        Err("this build of tilewright has no GLSL compiler. Build it with the feature `glsl`, which uses \
             the system's libshaderc (package libshaderc-dev), or with `glsl-bundled`, which compiles a \
             compiler from C++ (some minutes); or hand in SPIR-V"
            .into())
    }
}

/// Compiles `source` to SPIR-V with entry point `main`, and validates what came out.
///
/// # Errors
/// [`Error::Shader`] with the compiler's messages, `line N: …` each, or the validator's.
pub(super) fn compile(
    stage: Stage,
    label: &str,
    source: &str,
    finder: &Finder,
) -> Result<Vec<u32>> {
    let stored = Entry::new(stored::folder().as_deref(), stage, source);
    if let Some(words) = stored.as_ref().and_then(Entry::read) {
        return Ok(words);
    }
    let stage = match stage {
        Stage::Vertex => "vert",
        Stage::Fragment => "frag",
    };
    let find = |name: &str, includer: &str, depth| finder.find(name, includer, depth);
    let words = words(stage, source, &find)
        .and_then(|words| validate::validate(&words).map(|()| words))
        .map_err(|reason| Error::shader(label, reason))?;
    if let Some(entry) = stored {
        entry.write(&words);
    }
    Ok(words)
}

/// As [`compile`], for a compute kernel. What was compiled before is not remembered.
///
/// # Errors
/// As [`compile`].
pub(super) fn kernel(label: &str, source: &str) -> Result<Vec<u32>> {
    words("comp", source, &|_, _, _| None)
        .and_then(|words| validate::validate(&words).map(|()| words))
        .map_err(|reason| Error::shader(label, reason))
}

/// As [`kernel`], with lines of `defines` and with included files, which `read` finds by the name in the include.
///
/// # Errors
/// As [`compile`].
pub(super) fn stage(
    label: &str,
    source: &str,
    defines: &str,
    read: &dyn Fn(&str) -> Option<String>,
) -> Result<Vec<u32>> {
    let find = |name: &str, _: &str, depth| {
        let text = if depth > include::DEPTH { None } else { read(name) };
        Some((name.to_string(), plain_ascii(&text?).ok()?))
    };
    words("comp", &include::with_defines(source, defines), &find)
        .and_then(|words| validate::validate(&words).map(|()| words))
        .map_err(|reason| Error::shader(label, reason))
}

fn words(stage: &str, source: &str, find: &compiler::Find) -> Outcome<Vec<u32>> {
    // Compilers take a source without a version for the first version there was. They complain of that at length, some of
    // them to standard output.
    if include::version(source).is_none() && HAS_COMPILER {
        return Err(
            "the source does not begin with a `#version` line: `#version 450` belongs at the top"
                .into(),
        );
    }
    let source = plain_ascii(source)?;
    compiler::compile(stage, &source, find).map_err(|log| match HAS_COMPILER {
        true => message(&log, &source),
        false => log,
    })
}

/// The source as the compiler's bindings can take it. GLSL allows other characters than ASCII in
/// comments only, but quotes them byte by byte in its messages, which then are no text any more; a
/// character that is an error anywhere outside a comment takes their place.
pub(super) fn plain_ascii(source: &str) -> Outcome<String> {
    if let Some(at) = source.find('\0') {
        return Err(format!("line {}: a NUL byte", include::line_number(source, at)));
    }
    Ok(source.chars().map(|c| if c.is_ascii() { c } else { '`' }).collect())
}

/// The compiler's log as sentences that name lines.
fn message(log: &str, source: &str) -> String {
    if log.contains("version not supported") {
        let line = include::version(source).unwrap_or_default();
        let (number, text) = (include::line_number(source, line.start), source[line].trim());
        return format!("line {number}: `{text}` is no version of GLSL that Vulkan takes");
    }
    let lines: Vec<String> = log
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.contains("No code generated"))
        .map(readable)
        .collect();
    if lines.is_empty() { "it does not compile".into() } else { lines.join("\n") }
}

/// `ERROR: 0:12: 'x' : undeclared identifier` (glslang's form) and `0:12: error: 'x' : undeclared
/// identifier` (shaderc's) become `line 12: 'x' : undeclared identifier`. In an included file, its name
/// stands where the 0 is.
fn readable(line: &str) -> String {
    let (kind, rest) = match line.split_once(": ") {
        Some(("ERROR", rest)) => ("", rest),
        Some(("WARNING", rest)) => ("warning, ", rest),
        _ => ("", line),
    };
    let Some((place, text)) = rest.split_once(": ") else { return rest.into() };
    let (kind, text) = match text.split_once(": ") {
        Some(("error", text)) => ("", text),
        Some(("warning", text)) => ("warning, ", text),
        _ => (kind, text),
    };
    let number = place.rsplit_once(':').and_then(|(f, n)| Some((f, n.parse::<u32>().ok()?)));
    match (number, place) {
        (Some(("0", number)), _) => format!("{kind}line {number}: {text}"),
        (Some((file, number)), _) => format!("{kind}{file} line {number}: {text}"),
        (None, "0") => format!("{kind}{text}"),
        (None, _) => format!("{kind}{rest}"),
    }
}

#[cfg(all(test, any(feature = "glsl", feature = "glsl-bundled")))]
pub(super) mod tests {
    use super::*;

    /// Compiles a compute shader for a test.
    pub fn kernel(source: &str) -> Vec<u32> {
        words("comp", source, &|_, _, _| None).unwrap()
    }

    const HEAD: &str = "#version 450\nlayout(location = 0) out vec4 color;\n";

    fn reason(source: &str) -> String {
        compile(Stage::Fragment, "bad.frag", source, &Finder::default()).unwrap_err().to_string()
    }

    #[test]
    fn messages_name_the_users_lines() {
        let text = reason(&format!("{HEAD}void main() {{\n  color = missing;\n}}\n"));
        assert!(text.contains("bad.frag") && text.contains("line 4: 'missing'"), "{text}");
        assert!(!text.contains("DebugLog") && !text.contains("No code generated"), "{text}");
    }

    #[test]
    fn odd_bytes_and_versions_are_errors_not_panics() {
        let odd = reason("#version 4é50\nvoid main() {}");
        assert!(odd.contains("line 1"), "{odd}");
        let old = reason("#version 331\nvoid main() {}");
        assert!(old.contains("331"), "{old}");
        let old = reason("\n//\n#  version 331\nvoid main() {}");
        assert!(old.contains("line 3: `#  version 331`"), "{old}");
        let odd = reason("# version 450\nvoid main() { oops; }");
        assert!(odd.contains("line 2: 'oops'"), "{odd}");
        assert!(reason("#version 450\nvoid main() { \0 }").contains("line 2: a NUL"));
        assert!(reason("#version 450\nvoid main() { ä = 1; }").contains("line 2"));
        assert!(reason("").contains("bad.frag"));
        assert!(reason("void main() {}").contains("#version 450"));
    }

    #[test]
    fn comments_may_hold_any_text() {
        let source = format!("{HEAD}// größer – 深度\nvoid main() {{ color = vec4(1); }}");
        compile(Stage::Fragment, "ok.frag", &source, &Finder::default()).unwrap();
    }

    #[test]
    fn threads_share_the_compiler() {
        let source = format!("{HEAD}void main() {{ color = vec4(gl_FragCoord.x); }}");
        let first = compile(Stage::Fragment, "a", &source, &Finder::default()).unwrap();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    assert_eq!(
                        compile(Stage::Fragment, "a", &source, &Finder::default()).unwrap(),
                        first
                    )
                });
            }
        });
    }
}
