//! Where results go: files that appear whole or not at all, and standard output.
//!
//! An [`Output`] is made before any work is done, and making it proves that it can be written: a
//! render of minutes must not end with "permission denied". The bytes go to a temporary file beside
//! the target, which is then renamed over it, so that a reader never sees half a picture and a
//! failed run leaves the old one as it was.

use crate::{
    error::{Error, Result},
    vk::stdout_was_closed,
};
use std::{
    ffi::OsStr,
    fs,
    io::{self, IsTerminal, Write},
    path::{Path, PathBuf},
};
use tempfile::NamedTempFile;

/// The names of standard output.
const STDOUT: [&str; 4] = ["-", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];

/// A place that was found to be writable.
#[derive(Debug)]
pub struct Output(Place);

#[derive(Debug)]
enum Place {
    /// Standard output.
    Stdout,
    /// A regular file, there or not yet; symbolic links are followed.
    File(PathBuf),
    /// A pipe or device node, which is written to and not replaced.
    Special(PathBuf),
}

impl Output {
    /// The file at `path`, or standard output for `-`.
    ///
    /// # Errors
    /// [`Error::Usage`] if binary data would go to a terminal; [`Error::Io`] if nothing can be
    /// written there.
    pub fn new(path: &Path) -> Result<Self> {
        if STDOUT.into_iter().any(|name| path == Path::new(name)) {
            check_stdout()?;
            if io::stdout().is_terminal() {
                return Err(Error::Usage(
                    "`-o -` writes a PNG to standard output, which is a terminal: redirect it to a \
                     file or a pipe"
                        .into(),
                ));
            }
            return Ok(Self(Place::Stdout));
        }
        let refuse = |reason: &str| Error::Io {
            path: path.into(),
            source: io::Error::other(format!("cannot be written: {reason}")),
        };
        if path.as_os_str().is_empty() {
            return Err(Error::Usage("the name of the output file is empty".into()));
        }
        match fs::metadata(path) {
            Ok(found) if found.is_dir() => Err(refuse("it is a folder")),
            Ok(found) if found.is_file() => {
                let target = fs::canonicalize(path).map_err(|e| refuse(&e.to_string()))?;
                Self::probed(target).map_err(|e| refuse(&e.to_string()))
            }
            Ok(found) if is_block_device(&found) => Err(refuse("it is a disk")),
            Ok(_) => Ok(Self(Place::Special(path.into()))),
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                let target = end_of_links(path).map_err(|e| refuse(&e.to_string()))?;
                let folder = folder(&target);
                if !folder.is_dir() {
                    return Err(refuse(&format!("there is no folder {}", folder.display())));
                }
                if ends_as_folder(&target) {
                    return Err(refuse("there is no such folder, and no file has such a name"));
                }
                Self::probed(target).map_err(|e| refuse(&e.to_string()))
            }
            Err(e) => Err(refuse(&e.to_string())),
        }
    }

    /// A file whose folder takes a temporary file. The file is removed at once, not kept for later:
    /// an interrupted run must leave nothing behind.
    fn probed(target: PathBuf) -> io::Result<Self> {
        temporary(&target)?.close()?;
        Ok(Self(Place::File(target)))
    }

    /// Whether this is standard output.
    pub fn is_stdout(&self) -> bool {
        matches!(self.0, Place::Stdout)
    }

    /// Whether writing this would replace `path`.
    pub fn replaces(&self, path: &Path) -> bool {
        match &self.0 {
            Place::File(target) => canonical(target) == canonical(path),
            Place::Stdout | Place::Special(_) => false,
        }
    }

    /// Whether writing this would replace what `other` writes.
    pub fn collides(&self, other: &Output) -> bool {
        match &other.0 {
            Place::File(target) => self.replaces(target),
            Place::Stdout => self.is_stdout(),
            Place::Special(_) => false,
        }
    }

    /// Writes `bytes`, all of them or nothing.
    ///
    /// It is no error if the reader of standard output has gone away: it needs no more data.
    ///
    /// # Errors
    /// [`Error::Io`] if the system refuses.
    pub fn write(&self, bytes: &[u8]) -> Result<()> {
        match &self.0 {
            Place::Stdout => write_stdout(bytes),
            Place::File(target) => (|| {
                let mut file = temporary(target)?;
                file.write_all(bytes)?;
                file.persist(target).map_err(|e| e.error)?;
                Ok(())
            })()
            .map_err(|source| Error::Io { path: target.clone(), source }),
            Place::Special(path) => fs::OpenOptions::new()
                .write(true)
                .open(path)
                .and_then(|mut file| file.write_all(bytes))
                .map_err(|source| Error::Io { path: path.clone(), source }),
        }
    }
}

/// Refuses a standard output that was closed when the process started.
///
/// # Errors
/// [`Error::Io`].
pub fn check_stdout() -> Result<()> {
    match stdout_was_closed() {
        false => Ok(()),
        true => Err(Error::Io {
            path: "standard output".into(),
            source: io::Error::other("it is closed: redirect it to a file or a pipe"),
        }),
    }
}

/// Writes `bytes` to standard output; see [`Output::write`].
///
/// # Errors
/// [`Error::Io`] if the system refuses, or if there is no standard output.
pub fn write_stdout(bytes: &[u8]) -> Result<()> {
    check_stdout()?;
    let mut out = io::stdout().lock();
    printed(out.write_all(bytes).and_then(|()| out.flush()))
}

/// The outcome of writing to standard output. It is no error if the reader has gone away.
///
/// # Errors
/// [`Error::Io`] if the system refused, or if there is no standard output.
pub fn printed(result: io::Result<()>) -> Result<()> {
    check_stdout()?;
    match result {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => {
            Err(Error::Io { path: "standard output".into(), source: e })
        }
        _ => Ok(()),
    }
}

/// Writes `value` to standard output, indented, with a line feed.
pub fn write_json(value: &serde_json::Value) -> Result<()> {
    write_stdout(format!("{value:#}\n").as_bytes())
}

/// The path that the symbolic links of `path` lead to; there is no file at that path yet.
fn end_of_links(path: &Path) -> io::Result<PathBuf> {
    let mut at = path.to_path_buf();
    // As many as Linux follows.
    for _ in 0..40 {
        match fs::read_link(&at) {
            Ok(next) => at = folder(&at).join(next),
            Err(_) => return Ok(at),
        }
    }
    Err(io::Error::other("its symbolic links lead in a circle"))
}

/// Whether only a folder can have this name: one with a separator, or a separator and a dot, at its end.
fn ends_as_folder(path: &Path) -> bool {
    let ends =
        |name: &OsStr| path.as_os_str().as_encoded_bytes().ends_with(name.as_encoded_bytes());
    !path.file_name().is_some_and(ends)
}

/// A disk or a part of one. A picture must not replace a file system by mistake.
fn is_block_device(found: &fs::Metadata) -> bool {
    #[cfg(unix)]
    {
        std::os::unix::fs::FileTypeExt::is_block_device(&found.file_type())
    }
    #[cfg(not(unix))]
    {
        let _ = found;
        false
    }
}

/// The one name of a file that may not be there yet, however it is spelled.
fn canonical(path: &Path) -> PathBuf {
    fs::canonicalize(path).unwrap_or_else(|_| {
        let end = end_of_links(path).unwrap_or_else(|_| path.into());
        match (fs::canonicalize(folder(&end)), end.file_name()) {
            (Ok(folder), Some(name)) => folder.join(name),
            _ => path.into(),
        }
    })
}

/// The folder that holds `path`.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A new file beside `target`, with the permissions that `target` has or would get.
fn temporary(target: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".tilewright-");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // The umask restricts the permissions, as for any new file.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    // Only the kind is kept: the message would name the temporary file, which means nothing to the user.
    let file = builder.tempfile_in(folder(target)).map_err(|e| io::Error::from(e.kind()))?;
    if let Ok(found) = fs::metadata(target) {
        file.as_file().set_permissions(found.permissions())?;
    }
    Ok(file)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn a_file_appears_whole_and_nothing_else_does() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("out.png");
        let output = Output::new(&path).unwrap();
        assert!(names(folder.path()).is_empty(), "the probe leaves nothing");
        output.write(b"first").unwrap();
        Output::new(&path).unwrap().write(b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(names(folder.path()), ["out.png"]);
    }

    #[cfg(unix)]
    #[test]
    fn permissions_are_those_of_any_new_file_or_of_the_old_one() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode() & 0o777;
        let (usual, path) = (folder.path().join("usual"), folder.path().join("out"));
        fs::write(&usual, b"").unwrap();
        Output::new(&path).unwrap().write(b"x").unwrap();
        assert_eq!(mode(&path), mode(&usual));
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).unwrap();
        Output::new(&path).unwrap().write(b"y").unwrap();
        assert_eq!(mode(&path), 0o640);
    }

    #[cfg(unix)]
    #[test]
    fn a_symbolic_link_stays_one() {
        let folder = tempfile::tempdir().unwrap();
        let (real, link) = (folder.path().join("real"), folder.path().join("link"));
        fs::write(&real, b"old").unwrap();
        std::os::unix::fs::symlink(&real, &link).unwrap();
        Output::new(&link).unwrap().write(b"new").unwrap();
        assert_eq!(fs::read(&real).unwrap(), b"new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_what_is_not_there_yet_makes_it() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("sub")).unwrap();
        symlink("sub/real", at("link")).unwrap();
        symlink("link", at("again")).unwrap();
        let output = Output::new(&at("again")).unwrap();
        assert!(output.replaces(&at("sub/real")) && output.replaces(&at("link")));
        output.write(b"new").unwrap();
        assert_eq!(fs::read(at("sub/real")).unwrap(), b"new");
        for link in ["link", "again"] {
            assert!(fs::symlink_metadata(at(link)).unwrap().is_symlink(), "{link}");
        }
        assert_eq!(names(&at("sub")), ["real"]);
        symlink("none/real", at("nowhere")).unwrap();
        symlink("circle", at("circle")).unwrap();
        symlink("sub", at("folder")).unwrap();
        let refusal = |name: &str| Output::new(&at(name)).unwrap_err().to_string();
        assert!(refusal("nowhere").contains("there is no folder"), "{}", refusal("nowhere"));
        assert!(refusal("circle").contains("cannot be written"), "{}", refusal("circle"));
        assert!(refusal("folder").contains("it is a folder"), "{}", refusal("folder"));
    }

    #[test]
    fn an_unwritable_place_is_refused_with_its_reason() {
        let folder = tempfile::tempdir().unwrap();
        let refusal = |path: &Path| Output::new(path).unwrap_err().to_string();
        assert!(refusal(folder.path()).ends_with("cannot be written: it is a folder"));
        let nowhere = folder.path().join("no/such/out.png");
        assert!(refusal(&nowhere).contains("there is no folder"));
        for name in ["new/", "new//", "new/.", "new/new/"] {
            let refused = refusal(&folder.path().join(name));
            assert!(refused.contains("cannot be written: there is no "), "{refused}");
        }
        #[cfg(unix)]
        {
            std::os::unix::fs::symlink("new/", folder.path().join("link")).unwrap();
            assert!(refusal(&folder.path().join("link")).contains("there is no such folder"));
        }
        fs::write(folder.path().join("file"), b"").unwrap();
        assert!(refusal(&folder.path().join("file/out.png")).contains("cannot be written"));
    }

    #[test]
    fn the_same_file_under_two_names_collides() {
        let folder = tempfile::tempdir().unwrap();
        let a = Output::new(&folder.path().join("a")).unwrap();
        let b = Output::new(&folder.path().join("b")).unwrap();
        let again = Output::new(&folder.path().join("a")).unwrap();
        assert!(!a.collides(&b) && a.collides(&again));
        fs::write(folder.path().join("a"), b"").unwrap();
        assert!(a.replaces(&folder.path().join("./a")));
        assert!(!a.replaces(&folder.path().join("b")));
    }
}
