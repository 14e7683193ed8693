//! Records the commit that is built, for the benchmark's results.

use std::process::Command;

/// Sets `TILEWRIGHT_COMMIT` for the compiler: the commit, followed by `-changed` where files differ from it.
/// It stays unset if the commit is not known: in a package from a registry, or without git.
pub fn tell() {
    // Only files that are built count. A later commit with the same sources does not run this again, and the
    // recorded commit still describes the build.
    for source in ["src", "Cargo.toml", "Cargo.lock"] {
        println!("cargo:rerun-if-changed={source}");
    }
    // A package inside somebody else's repository is none of that repository's commits.
    let own = git(&["rev-parse", "--show-prefix"]).is_some_and(|prefix| prefix.is_empty());
    let Some(commit) = git(&["rev-parse", "HEAD"]).filter(|_| own) else { return };
    let changed = git(&["status", "--porcelain", "--", "src", "glsl", "Cargo.toml", "Cargo.lock"]);
    let changed = if changed.is_none_or(|files| files.is_empty()) { "" } else { "-changed" };
    println!("cargo:rustc-env=TILEWRIGHT_COMMIT={commit}{changed}");
}

/// What git prints; `None` if it fails.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
