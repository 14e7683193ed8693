//! Reading what a scene file refers to, as files from other systems name it.

use crate::{Error, Result};
use std::{
    ffi::{OsStr, OsString},
    path::{Path, PathBuf},
};

/// Larger files are refused.
const MAX_FILE: u64 = 8 << 30;

/// Reads a regular file. Devices and pipes are refused: they may have no end.
pub(super) fn read(path: &Path) -> Result<Vec<u8>> {
    let io = |e: std::io::Error| Error::input(path, format!("cannot be read: {e}"));
    let meta = std::fs::metadata(path).map_err(io)?;
    if !meta.is_file() {
        return Err(Error::input(path, "is no regular file"));
    }
    if meta.len() > MAX_FILE {
        let (gib, limit) = (meta.len() >> 30, MAX_FILE >> 30);
        return Err(Error::input(path, format!("has {gib} GiB, the limit is {limit} GiB")));
    }
    std::fs::read(path).map_err(io)
}

/// Finds the file that `name` means in `folder`: as it stands, with the separators of Windows, with
/// other upper and lower case, and if it is no UTF-8, as Latin-1.
pub(super) fn find(folder: &Path, name: impl AsRef<[u8]>) -> Option<PathBuf> {
    let name = name.as_ref();
    let latin1 = || name.iter().map(|&byte| char::from(byte)).collect::<String>();
    match std::str::from_utf8(name) {
        Ok(text) => find_path(folder, text.as_ref()),
        Err(_) => {
            find_path(folder, &os_name(name)).or_else(|| find_path(folder, latin1().as_ref()))
        }
    }
}

/// The name as the system has it, where names are bytes.
#[cfg(unix)]
fn os_name(bytes: &[u8]) -> OsString {
    std::os::unix::ffi::OsStringExt::from_vec(bytes.to_vec())
}

#[cfg(not(unix))]
fn os_name(bytes: &[u8]) -> OsString {
    String::from_utf8_lossy(bytes).into_owned().into()
}

fn find_path(folder: &Path, name: &OsStr) -> Option<PathBuf> {
    // A path without a folder lies in the current one.
    let folder = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let exact = folder.join(name);
    if exact.is_file() {
        return Some(exact);
    }
    let bytes = name.as_encoded_bytes();
    let mut at = if bytes.starts_with(b"/") { PathBuf::from("/") } else { folder.to_path_buf() };
    for part in parts(bytes).filter(|p| !p.is_empty() && *p != b".") {
        let part = os_name(part);
        let next = at.join(&part);
        if part == ".." || next.exists() {
            at = next;
            continue;
        }
        let wanted = part.to_string_lossy().to_lowercase();
        at = std::fs::read_dir(&at)
            .ok()?
            .flatten()
            .find(|entry| entry.file_name().to_string_lossy().to_lowercase() == wanted)?
            .path();
    }
    at.is_file().then_some(at)
}

fn parts(name: &[u8]) -> impl Iterator<Item = &[u8]> {
    name.split(|b| matches!(b, b'/' | b'\\'))
}

/// [`find`], or else with ever fewer of the folders that the name begins with: paths in files often are
/// those of the machine they were made on.
pub(super) fn find_by_name(folder: &Path, name: impl AsRef<[u8]>) -> Option<PathBuf> {
    let name = name.as_ref();
    let mut rest = Some(name);
    std::iter::from_fn(|| {
        let current = rest?;
        let end = current.iter().position(|b| matches!(b, b'/' | b'\\'));
        rest = end.map(|end| &current[end + 1..]);
        Some(current)
    })
    .filter(|tail| !tail.is_empty())
    .find_map(|tail| find(folder, tail))
}

/// Undoes `%20` and the like; what is no valid escape stays, and so does what is no UTF-8.
pub(super) fn percent_decode(text: &str) -> String {
    String::from_utf8(percent_decode_bytes(text)).unwrap_or_else(|_| text.to_owned())
}

fn percent_decode_bytes(text: &str) -> Vec<u8> {
    let bytes = text.as_bytes();
    let digit = |at: usize| bytes.get(at).and_then(|b| (*b as char).to_digit(16));
    let (mut out, mut i) = (Vec::with_capacity(bytes.len()), 0);
    while i < bytes.len() {
        match (bytes[i], digit(i + 1), digit(i + 2)) {
            (b'%', Some(high), Some(low)) => {
                out.push((high * 16 + low) as u8);
                i += 3;
            }
            (byte, _, _) => {
                out.push(byte);
                i += 1;
            }
        }
    }
    out
}

/// The bytes of a `data:` URI, `None` if `uri` is none.
pub(super) fn data_uri(uri: &str) -> Option<std::result::Result<Vec<u8>, String>> {
    let rest = uri.strip_prefix("data:")?;
    let Some((head, data)) = rest.split_once(',') else {
        return Some(Err("a data URI has no comma".into()));
    };
    if !head.ends_with(";base64") {
        return Some(Ok(percent_decode_bytes(data)));
    }
    Some(base64(data.as_bytes()))
}

/// Decodes base64 of the standard or the URL alphabet, with or without padding.
fn base64(text: &[u8]) -> std::result::Result<Vec<u8>, String> {
    let text = match text {
        [head @ .., b'=', b'='] | [head @ .., b'='] => head,
        all => all,
    };
    let mut out = Vec::with_capacity(text.len() * 3 / 4);
    let (mut bits, mut held) = (0u32, 0u32);
    for &byte in text {
        let value = match byte {
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return Err(format!("base64 data has the byte 0x{byte:02x}")),
        };
        bits = bits << 6 | value as u32;
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
            bits &= (1 << held) - 1;
        }
    }
    if held == 6 {
        return Err("base64 data ends in the middle of a byte".into());
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn base64_known_answers() {
        for (text, want) in
            [("", ""), ("Zg==", "f"), ("Zm8=", "fo"), ("Zm9v", "foo"), ("Zm9vYmFy", "foobar")]
        {
            assert_eq!(base64(text.as_bytes()).unwrap(), want.as_bytes());
        }
        assert_eq!(base64(b"__-_").unwrap(), base64(b"//+/").unwrap());
        assert!(base64(b"A").is_err() && base64(b"A===").is_err() && base64(b"A*AA").is_err());
    }

    #[test]
    fn uris_and_escapes() {
        assert_eq!(data_uri("data:;base64,Zm8=").unwrap().unwrap(), b"fo");
        assert_eq!(data_uri("data:text/plain,a%20b").unwrap().unwrap(), b"a b");
        assert_eq!(data_uri("data:,%00%80%ff").unwrap().unwrap(), [0, 0x80, 0xff]);
        assert!(data_uri("data:;base64").unwrap().is_err());
        assert!(data_uri("file.bin").is_none());
        assert_eq!(percent_decode("a%20b%e2%9d%a4%zz%2"), "a b❤%zz%2");
    }

    #[test]
    fn names_of_other_systems_are_found() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::create_dir(dir.path().join("Textures")).unwrap();
        std::fs::write(dir.path().join("Textures/Wood.JPG"), b"x").unwrap();
        for name in ["Textures/Wood.JPG", "textures\\wood.jpg", ".\\TEXTURES/wood.jpg"] {
            assert!(find(dir.path(), name).is_some(), "{name}");
        }
        for name in
            ["C:\\Users\\me\\Textures\\Wood.jpg", "/elsewhere/textures/wood.jpg", "//wood.JPG"]
        {
            assert_eq!(find_by_name(dir.path(), name).is_some(), !name.starts_with("//"), "{name}");
        }
        std::fs::write(dir.path().join("gr\u{fc}n.png"), b"x").unwrap();
        assert!(find(dir.path(), b"gr\xfcn.png").is_some(), "Latin-1");
        assert!(find(dir.path(), b"gr\xe4n.png").is_none());
        assert!(find(dir.path(), "textures/stone.jpg").is_none());
        assert!(find(Path::new(""), "CARGO.TOML").is_some(), "tests run where Cargo.toml is");
        assert!(read(dir.path()).is_err());
    }
}
