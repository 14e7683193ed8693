//! Finds the format of a file by its first bytes: a name may be wrong, and a download may be an error page.

/// The format of a scene file's content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Content {
    /// glTF, as GLB or JSON.
    Gltf,
    /// Something else, as a sentence goes on after "the content is".
    Other(&'static str),
    /// Nothing that can be told; OBJ has no mark.
    Unknown,
}

/// First bytes of formats that are no scene here.
const MARKS: &[(&[u8], &str)] = &[
    (b"ply\n", "PLY"),
    (b"ply\r", "PLY"),
    (b"solid ", "STL"),
    (b"Kaydara FBX Binary", "FBX"),
    (b"; FBX ", "FBX"),
    (b"PK\x03\x04", "a ZIP archive (USDZ, 3MF and many downloads are such): unpack it first"),
    (b"PK\x05\x06", "an empty ZIP archive"),
    (b"\x1f\x8b", "compressed by gzip: unpack it first"),
    (b"\x28\xb5\x2f\xfd", "compressed by zstd: unpack it first"),
    (b"\xfd7zXZ\0", "compressed by xz: unpack it first"),
    (b"BZh", "compressed by bzip2: unpack it first"),
    (b"7z\xbc\xaf\x27\x1c", "a 7-Zip archive: unpack it first"),
    (b"Rar!\x1a\x07", "a RAR archive: unpack it first"),
    (b"BLENDER", "a Blender file: export it as glTF"),
    (b"#usda ", "USD"),
    (b"PXR-USDC", "USD"),
    (b"ISO-10303-21", "STEP"),
    (b"OFF\n", "OFF"),
    (b"OFF\r", "OFF"),
    (b"solid\n", "STL"),
    (b"#VRML", "VRML"),
    (b"#X3D", "X3D"),
    (b"AC1", "an AutoCAD drawing (DWG)"),
    (b"\x89PNG", "a PNG picture"),
    (b"\xff\xd8\xff", "a JPEG picture"),
    (b"\x7fELF", "a compiled program (ELF)"),
    (b"\x4c\x01", "an object file of a compiler (COFF)"),
    (b"\x64\x86", "an object file of a compiler (COFF)"),
    (b"version https://git-lfs", "a pointer of Git LFS: fetch the file itself by `git lfs pull`"),
    (b"newmtl ", "an MTL library: name the OBJ that uses it"),
    (b"\xff\xfe\0\0", "text in UTF-32: save it as UTF-8"),
    (b"\0\0\xfe\xff", "text in UTF-32: save it as UTF-8"),
];

/// The format of `bytes`.
pub(super) fn of(bytes: &[u8]) -> Content {
    let marked = |mark: &[u8]| bytes.starts_with(mark);
    if marked(b"glTF") {
        return Content::Gltf;
    }
    if let Some((_, what)) = MARKS.iter().find(|(mark, _)| marked(mark)) {
        return Content::Other(what);
    }
    if is_binary_stl(bytes) {
        return Content::Other("STL");
    }
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes).trim_ascii_start();
    let begins = |word: &str| {
        let head = &text[..text.len().min(word.len())];
        head.eq_ignore_ascii_case(word.as_bytes())
    };
    match text {
        [b'{', ..] => Content::Gltf,
        _ if begins("<!doctype html") || begins("<html") => {
            Content::Other("a web page: the download has failed, or needs a login")
        }
        _ if begins("<?xml") || begins("<collada") => {
            Content::Other("XML (COLLADA and X3D are such)")
        }
        _ => Content::Unknown,
    }
}

/// A head of 80 bytes, a number of triangles, and 50 bytes for each.
fn is_binary_stl(bytes: &[u8]) -> bool {
    bytes.get(80..84).is_some_and(|count| {
        let count = u32::from_le_bytes([count[0], count[1], count[2], count[3]]);
        count > 0 && u64::from(count) * 50 + 84 == bytes.len() as u64
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn content_is_told_by_its_first_bytes() {
        for (bytes, want) in [
            (&b"glTF\x02\0\0\0"[..], Content::Gltf),
            (b"\xef\xbb\xbf \n{ \"asset\"", Content::Gltf),
            (b"ply\nformat ascii 1.0", Content::Other("PLY")),
            (b"solid cube\nfacet", Content::Other("STL")),
            (b"# solid\nv 1 2 3", Content::Unknown),
            (b"", Content::Unknown),
            (b"v 1 2 3", Content::Unknown),
        ] {
            assert_eq!(of(bytes), want, "{bytes:?}");
        }
        let mut stl = vec![b'x'; 80 + 4 + 2 * 50];
        stl[80..84].copy_from_slice(&2u32.to_le_bytes());
        assert_eq!(of(&stl), Content::Other("STL"));
        stl.push(0);
        assert_eq!(of(&stl), Content::Unknown);
        assert!(
            matches!(of(b"<!DOCTYPE HTML>"), Content::Other(what) if what.contains("web page"))
        );
    }
}
