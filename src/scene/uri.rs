//! URIs of glTF: data in the document itself, and files beside it.

use super::files;
use std::{
    ffi::OsString,
    path::{Path, PathBuf},
};

type Outcome<T> = std::result::Result<T, String>;

/// Characters of a file's own words that a message repeats.
const SHORT: usize = 60;

/// `text`, shortened for a message: it comes from a file and may have any length.
pub(super) fn short(text: &str) -> String {
    match text.char_indices().nth(SHORT) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text.to_owned(),
    }
}

/// The bytes behind `uri` in a document in `folder`; a file that is read is added to `files`.
pub(super) fn read(uri: &str, folder: &Path, files: &mut Vec<PathBuf>) -> Outcome<Vec<u8>> {
    if let Some(bytes) = data(uri) {
        return bytes;
    }
    if uri.contains("://") {
        return Err(format!(
            "`{}` is not beside the file, and nothing is fetched from elsewhere",
            short(uri)
        ));
    }
    let path = find(uri, folder).ok_or_else(|| {
        let name = String::from_utf8_lossy(&percent_decode(uri)).into_owned();
        format!("the file `{}` it refers to does not exist", short(&name))
    })?;
    files::read(&path, files).map_err(|e| e.to_string())
}

/// The file that `uri` means: its name as it stands or with its escapes undone, then without a query
/// or a fragment, which tell servers and viewers something and are no part of a name.
fn find(uri: &str, folder: &Path) -> Option<PathBuf> {
    let bare = uri.split(['?', '#']).next().unwrap_or(uri);
    [uri, bare].into_iter().find_map(|name| {
        let decoded = percent_decode(name);
        files::find(folder, name).or_else(|| match String::from_utf8(decoded) {
            Ok(text) => files::find(folder, &text),
            Err(other) => {
                let path = folder.join(os_string(other.into_bytes()));
                path.is_file().then_some(path)
            }
        })
    })
}

/// A name of bytes that are no UTF-8, where the system has such names.
fn os_string(bytes: Vec<u8>) -> OsString {
    #[cfg(unix)]
    {
        std::os::unix::ffi::OsStringExt::from_vec(bytes)
    }
    #[cfg(not(unix))]
    {
        String::from_utf8_lossy(&bytes).into_owned().into()
    }
}

/// Decodes `%20` and the like; invalid escapes stay.
fn percent_decode(text: &str) -> Vec<u8> {
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

/// The bytes of a `data:` URI (RFC 2397), `None` if `uri` is none. Scheme and parameters are of
/// either case, and the data may have escapes; base64 may be wrapped in lines.
fn data(uri: &str) -> Option<Outcome<Vec<u8>>> {
    let uri = uri.trim_start();
    let scheme = uri.get(..5).filter(|scheme| scheme.eq_ignore_ascii_case("data:"))?;
    let Some((head, data)) = uri[scheme.len()..].split_once(',') else {
        return Some(Err("a data URI has no comma".into()));
    };
    let is_base64 = head.split(';').skip(1).any(|p| p.trim().eq_ignore_ascii_case("base64"));
    let bytes = percent_decode(data);
    Some(if is_base64 { base64(&bytes) } else { Ok(bytes) })
}

/// Decodes base64 of the standard or the URL alphabet, with or without padding.
fn base64(text: &[u8]) -> Outcome<Vec<u8>> {
    let mut out = Vec::with_capacity(text.len() / 4 * 3 + 3);
    let (mut bits, mut held, mut padding) = (0u32, 0u32, 0);
    for &byte in text.iter().filter(|byte| !byte.is_ascii_whitespace()) {
        let value = match byte {
            b'=' => {
                padding += 1;
                continue;
            }
            _ if padding > 0 => return Err("base64 data goes on after its padding".into()),
            b'A'..=b'Z' => byte - b'A',
            b'a'..=b'z' => byte - b'a' + 26,
            b'0'..=b'9' => byte - b'0' + 52,
            b'+' | b'-' => 62,
            b'/' | b'_' => 63,
            _ => return Err(format!("base64 data has the byte 0x{byte:02x}")),
        };
        bits = bits << 6 | u32::from(value);
        held += 6;
        if held >= 8 {
            held -= 8;
            out.push((bits >> held) as u8);
            bits &= (1 << held) - 1;
        }
    }
    if held == 6 || padding > 2 {
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
        assert_eq!(base64(b" Zm9v\r\nYmFy\n").unwrap(), b"foobar");
        for wrong in [&b"A"[..], b"A===", b"A*AA", b"Zg==Zg=="] {
            assert!(base64(wrong).is_err(), "{wrong:?}");
        }
    }

    #[test]
    fn data_uris_in_all_their_forms() {
        for (uri, want) in [
            ("data:;base64,Zm8=", &b"fo"[..]),
            ("DATA:application/octet-stream;BASE64,Zm8=", b"fo"),
            ("Data:text/plain;charset=utf-8;base64;x=1,Zm8%3D", b"fo"),
            ("data:application/gltf-buffer;base64,Zm8%3d", b"fo"),
            (" data:;base64,Z m\n8 =", b"fo"),
            ("data:text/plain,a%20b", b"a b"),
            ("data:,%00%80%ff", &[0, 0x80, 0xff]),
        ] {
            assert_eq!(data(uri).unwrap().unwrap(), want, "{uri}");
        }
        assert!(data("data:;base64").unwrap().is_err());
        assert!(data("file.bin").is_none() && data("data.bin").is_none() && data("❤❤").is_none());
    }

    #[test]
    fn names_are_found_with_and_without_escapes_queries_and_fragments() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["b in.bin", "a?b.bin", "c#d.bin", "e%20f.bin", "❤.bin"] {
            std::fs::write(folder.path().join(name), name).unwrap();
        }
        for (uri, name) in [
            ("b%20in.bin?v=3", "b in.bin"),
            ("b in.bin#part", "b in.bin"),
            ("b%20in.bin?x#y", "b in.bin"),
            ("a?b.bin", "a?b.bin"),
            ("a%3Fb.bin?v", "a?b.bin"),
            ("c%23d.bin#e", "c#d.bin"),
            ("e%20f.bin", "e%20f.bin"),
            ("%e2%9d%a4.bin?1", "❤.bin"),
            ("./sub/../b%20in.bin", "b in.bin"),
        ] {
            std::fs::create_dir_all(folder.path().join("sub")).unwrap();
            assert_eq!(
                read(uri, folder.path(), &mut Vec::new()).as_deref(),
                Ok(name.as_bytes()),
                "{uri}"
            );
        }
        for wrong in ["none.bin?b%20in.bin", "?", "", "http://x/b.bin"] {
            assert!(read(wrong, folder.path(), &mut Vec::new()).is_err(), "{wrong}");
        }
    }

    #[cfg(unix)]
    #[test]
    fn names_that_are_no_utf_8_are_found() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join(os_string(b"caf\xe9.bin".to_vec())), b"x").unwrap();
        assert_eq!(read("caf%E9.bin?v=1", folder.path(), &mut Vec::new()).unwrap(), b"x");
    }

    #[test]
    fn messages_repeat_a_part_of_what_the_file_says() {
        assert_eq!(short("name"), "name");
        assert_eq!(short(&"❤".repeat(1000)).chars().count(), SHORT + 1);
        let long = format!("{}.bin", "x".repeat(100_000));
        assert!(read(&long, Path::new(""), &mut Vec::new()).unwrap_err().len() < 200);
    }
}
