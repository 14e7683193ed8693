//! GLSL to SPIR-V, through glslang.
//!
//! The source is compiled as it stands: nothing is inserted, so messages name the user's own lines
//! and the module is the one that any other Vulkan program would make of it. What a compute kernel
//! cannot express (`discard`, implicit derivatives) is lowered later, in SPIR-V, where modules that
//! were handed in as SPIR-V get the same treatment. (Rejected: `#define discard demote` in front of
//! the source. It needs another extension and `#line`, changes what the device's own pipeline runs,
//! and does nothing for SPIR-V.)
//!
//! How the compiler is set up is in `compiler`. One serves the whole process; it may be used from
//! any thread. The first call of a process builds the tables of built-in functions, a tenth of a
//! second and more, later ones take milliseconds.

use super::{Stage, compiler::to_spirv, include::Beside, module::Outcome, stored::Entry};
use crate::{Error, Result, cache};
use glslang::{Compiler, ShaderSource, ShaderStage, error::GlslangError, include::IncludeHandler};
use std::path::Path;

/// Compiles `source` to SPIR-V with entry point `main`. `file` is where it came from, for files that
/// it includes.
///
/// # Errors
/// [`Error::Shader`] with the compiler's messages, `line N: …` each.
pub(super) fn compile(
    stage: Stage,
    label: &str,
    source: &str,
    file: Option<&Path>,
) -> Result<Vec<u32>> {
    let stored = Entry::new(cache::folder().as_deref(), stage, source);
    if let Some(words) = stored.as_ref().and_then(Entry::read) {
        return Ok(words);
    }
    let stage = match stage {
        Stage::Vertex => ShaderStage::Vertex,
        Stage::Fragment => ShaderStage::Fragment,
    };
    let words = words(stage, source, file).map_err(|reason| Error::shader(label, reason))?;
    if let Some(entry) = stored {
        entry.write(&words);
    }
    Ok(words)
}

fn words(stage: ShaderStage, source: &str, file: Option<&Path>) -> Outcome<Vec<u32>> {
    let compiler = Compiler::acquire().ok_or("the GLSL compiler does not start")?;
    // Without one, glslang takes the source for the first version there was, and complains of that.
    let versioned = source.contains("#version");
    let source = ShaderSource::from(plain_ascii(source)?);
    let mut beside = file.map(Beside::new);
    let includes = beside.as_mut().map(|handler| handler as &mut dyn IncludeHandler);
    to_spirv(compiler, stage, &source, includes).map_err(|error| match versioned {
        true => message(error),
        false => "there is no `#version` line: `#version 450` belongs at the top".into(),
    })
}

/// The source as the compiler's bindings can take it. GLSL allows other characters than ASCII in
/// comments only, but quotes them byte by byte in its messages, which then are no text any more; a
/// character that is an error anywhere outside a comment takes their place.
pub(super) fn plain_ascii(source: &str) -> Outcome<String> {
    if let Some(at) = source.find('\0') {
        return Err(format!("line {}: a NUL byte", source[..at].matches('\n').count() + 1));
    }
    Ok(source.chars().map(|c| if c.is_ascii() { c } else { '`' }).collect())
}

/// The compiler's log as sentences that name lines.
fn message(error: GlslangError) -> String {
    let log = match error {
        GlslangError::PreprocessError(log)
        | GlslangError::ParseError(log)
        | GlslangError::MapIoError(log)
        | GlslangError::LinkError(log) => log.log,
        GlslangError::InvalidProfile(_, version, _)
        | GlslangError::VersionUnsupported(version, _) => {
            return format!("`#version {version}` is no version of GLSL that Vulkan takes");
        }
        other => return other.to_string(),
    };
    let lines: Vec<String> = log
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty() && !line.contains("No code generated"))
        .map(readable)
        .collect();
    if lines.is_empty() { "it does not compile".into() } else { lines.join("\n") }
}

/// `ERROR: 0:12: 'x' : undeclared identifier` becomes `line 12: 'x' : undeclared identifier`. In an
/// included file, its name stands where the 0 is.
fn readable(line: &str) -> String {
    let (kind, rest) = match line.split_once(": ") {
        Some(("ERROR", rest)) => ("", rest),
        Some(("WARNING", rest)) => ("warning, ", rest),
        _ => return line.to_string(),
    };
    let located = rest.split_once(": ").and_then(|(place, text)| {
        let (file, number) = place.rsplit_once(':')?;
        number.parse::<u32>().ok().map(|number| (file, number, text))
    });
    match located {
        Some(("0", number, text)) => format!("{kind}line {number}: {text}"),
        Some((file, number, text)) => format!("{kind}{file} line {number}: {text}"),
        None => format!("{kind}{rest}"),
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Compiles a compute shader for a test.
    pub fn kernel(source: &str) -> Vec<u32> {
        words(ShaderStage::Compute, source, None).unwrap()
    }

    const HEAD: &str = "#version 450\nlayout(location = 0) out vec4 color;\n";

    fn reason(source: &str) -> String {
        compile(Stage::Fragment, "bad.frag", source, None).unwrap_err().to_string()
    }

    #[test]
    fn messages_name_the_users_lines() {
        let text = reason(&format!("{HEAD}void main() {{\n  color = missing;\n}}\n"));
        assert!(text.contains("bad.frag") && text.contains("line 4: 'missing'"), "{text}");
        assert!(!text.contains("DebugLog") && !text.contains("No code generated"), "{text}");
    }

    #[test]
    fn odd_bytes_and_versions_are_errors_not_panics() {
        assert!(reason("#version 4é50\nvoid main() {}").contains("line 1"));
        assert!(reason("#version 331\nvoid main() {}").contains("331"));
        assert!(reason("#version 450\nvoid main() { \0 }").contains("line 2: a NUL"));
        assert!(reason("#version 450\nvoid main() { ä = 1; }").contains("line 2"));
        assert!(reason("").contains("bad.frag"));
        assert!(reason("void main() {}").contains("#version 450"));
    }

    #[test]
    fn comments_may_hold_any_text() {
        let source = format!("{HEAD}// größer – 深度\nvoid main() {{ color = vec4(1); }}");
        compile(Stage::Fragment, "ok.frag", &source, None).unwrap();
    }

    #[test]
    fn threads_share_the_compiler() {
        let source = format!("{HEAD}void main() {{ color = vec4(gl_FragCoord.x); }}");
        let first = compile(Stage::Fragment, "a", &source, None).unwrap();
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    assert_eq!(compile(Stage::Fragment, "a", &source, None).unwrap(), first)
                });
            }
        });
    }
}
