//! The lines and words of OBJ and MTL files, as exporters of all systems write them.
//!
//! Text stays bytes: names in it may have any encoding, and two names are the same if their bytes are.

use std::borrow::Cow;

/// The text in `bytes`: UTF-16 becomes UTF-8, everything else stays as it is.
pub(super) fn decode(bytes: &[u8]) -> Cow<'_, [u8]> {
    let head = &bytes[..bytes.len().min(16)];
    // Without a byte order mark, every other byte of ASCII text is 0.
    let zeros = |from: usize| head.len() >= 8 && head.iter().skip(from).step_by(2).all(|&b| b == 0);
    let (little, start) = match head {
        [0xff, 0xfe, ..] => (true, 2),
        [0xfe, 0xff, ..] => (false, 2),
        _ if zeros(0) == zeros(1) => return bytes.into(),
        _ => (zeros(1), 0),
    };
    let unit = |pair: &[u8]| match little {
        true => u16::from_le_bytes([pair[0], pair[1]]),
        false => u16::from_be_bytes([pair[0], pair[1]]),
    };
    let units = bytes[start..].chunks_exact(2).map(unit);
    let text: String = char::decode_utf16(units).map(|c| c.unwrap_or('\u{fffd}')).collect();
    text.into_bytes().into()
}

/// Blanks within a line. Some files are padded with zeros.
fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\x0b' | b'\x0c' | 0)
}

/// `text` without blanks at its ends.
pub(super) fn trim(mut text: &[u8]) -> &[u8] {
    while let [first, rest @ ..] = text
        && is_blank(*first)
    {
        text = rest;
    }
    while let [rest @ .., last] = text
        && is_blank(*last)
    {
        text = rest;
    }
    text
}

/// The first word of `text`, and the rest without the blanks around it.
pub(super) fn split_word(text: &[u8]) -> (&[u8], &[u8]) {
    let end = text.iter().position(|&b| is_blank(b)).unwrap_or(text.len());
    (&text[..end], trim(&text[end..]))
}

/// The words of `text`.
pub(super) fn words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    text.split(|&b| is_blank(b)).filter(|word| !word.is_empty())
}

/// The words of a statement that consists of numbers, up to a comment or a backslash that continues
/// nothing. The `#` in the `1.#INF` of Microsoft's library begins no comment.
pub(super) fn number_words(text: &[u8]) -> impl Iterator<Item = &[u8]> {
    let in_number = |i: usize| {
        let begins = |word: &[u8]| {
            text.get(i + 1..i + 1 + word.len()).is_some_and(|next| next.eq_ignore_ascii_case(word))
        };
        text[..i].ends_with(b"1.")
            && [&b"INF"[..], b"IND", b"QNAN", b"SNAN"].into_iter().any(begins)
    };
    let ends = |i: usize| match text[i] {
        b'#' => !in_number(i),
        byte => byte == b'\\',
    };
    let end = (0..text.len()).find(|&i| ends(i)).unwrap_or(text.len());
    words(&text[..end])
}

/// `text` up to a word that begins with `#`. A name may have `#` inside a word.
pub(super) fn without_comment(text: &[u8]) -> &[u8] {
    let begins = |i: usize| text[i] == b'#' && (i == 0 || is_blank(text[i - 1]));
    let end = (0..text.len()).find(|&i| begins(i)).unwrap_or(text.len());
    trim(&text[..end])
}

/// The text between the quotes that `text` begins with, or all of it.
pub(super) fn unquoted(text: &[u8]) -> &[u8] {
    let Some(inner) = text.strip_prefix(b"\"") else { return text };
    let end = inner.iter().position(|&b| b == b'"').unwrap_or(inner.len());
    &inner[..end]
}

/// The names that `text` may mean, the most literal one first: a name can have blanks and `#`, but
/// quotes, comments and escaped blanks are common too.
pub(super) fn readings(text: &[u8]) -> Vec<Vec<u8>> {
    let short = without_comment(text);
    let mut all = vec![text.to_vec()];
    for reading in [unquoted(text).to_vec(), short.to_vec(), unescaped(short)] {
        if !all.contains(&reading) && !reading.is_empty() {
            all.push(reading);
        }
    }
    all
}

/// `\ ` becomes a blank.
fn unescaped(text: &[u8]) -> Vec<u8> {
    let escapes = |i: usize| text[i] == b'\\' && text.get(i + 1).is_some_and(|&b| is_blank(b));
    (0..text.len()).filter(|&i| !escapes(i)).map(|i| text[i]).collect()
}

/// The words of `text`, where one in quotes and one with escaped blanks count as one word.
pub(super) fn split_names(text: &[u8]) -> Vec<Vec<u8>> {
    let mut rest = without_comment(text);
    let mut names = Vec::new();
    while !rest.is_empty() {
        if rest[0] == b'"' {
            let name = unquoted(rest);
            rest = trim(&rest[(name.len() + 2).min(rest.len())..]);
            names.push(name.to_vec());
            continue;
        }
        let ends = |i: usize| is_blank(rest[i]) && rest[i - 1] != b'\\';
        let end = (1..rest.len()).find(|&i| ends(i)).unwrap_or(rest.len());
        names.push(unescaped(&rest[..end]));
        rest = trim(&rest[end..]);
    }
    names.retain(|name| !name.is_empty());
    names
}

/// A number as any printf has written it, infinities and what is no number included. A comma in it
/// is the decimal point of some languages.
pub(super) fn number(word: &[u8]) -> Option<f64> {
    let text = std::str::from_utf8(word).ok()?;
    if let Ok(number) = text.parse() {
        return Some(number);
    }
    let sign = if text.starts_with('-') { -1.0 } else { 1.0 };
    let lower = text.trim_start_matches(['+', '-']).to_ascii_lowercase();
    match lower.as_str() {
        text if text.starts_with("1.#inf") => Some(sign * f64::INFINITY),
        text if text.starts_with("1.#") || text.starts_with("nan(") => Some(f64::NAN),
        _ if text.matches(',').count() == 1 && !text.contains('.') => {
            text.replace(',', ".").parse().ok()
        }
        _ => None,
    }
}

/// `text` as a message shows it: readable, and not too long.
pub(super) fn shown(text: &[u8]) -> String {
    const LONGEST: usize = 80;
    let text = String::from_utf8_lossy(text);
    let mut short: String = text.chars().filter(|c| !c.is_control()).take(LONGEST).collect();
    if text.chars().count() > LONGEST {
        short.push('…');
    }
    short
}

/// The statements of a text: lines that are neither empty nor comments, those that a backslash
/// continues joined with the next.
///
/// A line ends with LF, CR LF or CR. A backslash at its end continues a statement, unless the next
/// line begins with a keyword: then it is the end of a name, such as a folder's.
pub(super) struct Statements<'a> {
    text: &'a [u8],
    /// Lines taken so far.
    number: usize,
    is_keyword: fn(&[u8]) -> bool,
}

impl<'a> Statements<'a> {
    pub fn new(text: &'a [u8], is_keyword: fn(&[u8]) -> bool) -> Self {
        Self { text, number: 0, is_keyword }
    }

    /// The next line and the text after it.
    fn peek(&self) -> (&'a [u8], &'a [u8]) {
        const BYTE_ORDER_MARK: &[u8] = b"\xef\xbb\xbf";
        let text = self.text;
        let end = text.iter().position(|b| matches!(b, b'\n' | b'\r'));
        let (line, rest) = match end {
            None => (text, &text[text.len()..]),
            Some(end) if text[end..].starts_with(b"\r\n") => (&text[..end], &text[end + 2..]),
            Some(end) => (&text[..end], &text[end + 1..]),
        };
        // Files that were put together have one in the middle.
        (trim(line.strip_prefix(BYTE_ORDER_MARK).unwrap_or(line)), rest)
    }

    fn take(&mut self) -> &'a [u8] {
        let (line, rest) = self.peek();
        self.text = rest;
        self.number += 1;
        line
    }
}

/// The line without the backslash that continues it; `None` if it ends here.
fn continued(line: &[u8]) -> Option<&[u8]> {
    let head = line.strip_suffix(b"\\")?;
    (without_comment(line).len() == line.len()).then_some(head)
}

impl<'a> Iterator for Statements<'a> {
    /// The number of the statement's last line, and the statement.
    type Item = (usize, Cow<'a, [u8]>);

    fn next(&mut self) -> Option<Self::Item> {
        let line = loop {
            if self.text.is_empty() {
                return None;
            }
            let line = self.take();
            if !matches!(line.first(), None | Some(b'#')) {
                break line;
            }
        };
        let mut joined: Cow<[u8]> = line.into();
        let mut last = line;
        while let Some(head) = continued(last) {
            let (next, _) = self.peek();
            let all = joined.to_mut();
            let ends = self.text.is_empty() || next.starts_with(b"#");
            if ends || (self.is_keyword)(split_word(next).0) {
                // Alone, it is no part of a name.
                if head.last().is_none_or(|&byte| is_blank(byte)) {
                    all.truncate(trim(&all[..all.len() - 1]).len());
                }
                break;
            }
            all.pop();
            all.push(b' ');
            all.extend_from_slice(next);
            last = self.take();
        }
        Some((self.number, joined))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn statements(text: &[u8]) -> Vec<(usize, String)> {
        let is_keyword = |word: &[u8]| matches!(word, b"f" | b"v" | b"usemtl");
        Statements::new(text, is_keyword)
            .map(|(number, line)| (number, String::from_utf8_lossy(&line).into_owned()))
            .collect()
    }

    #[test]
    fn lines_of_all_systems() {
        for text in ["v 1\nv 2\n\n f 3", "v 1\r\nv 2\r\n\r\nf 3\r\n", "v 1\rv 2\r\r\tf 3 \r"] {
            let want = [(1, "v 1"), (2, "v 2"), (4, "f 3")].map(|(n, s)| (n, s.to_owned()));
            assert_eq!(statements(text.as_bytes()), want, "{text:?}");
            let marked = [b"\xef\xbb\xbf", text.as_bytes()].concat();
            assert_eq!(statements(&marked), want);
            let units: Vec<u16> = text.encode_utf16().collect();
            let little: Vec<u8> = units.iter().flat_map(|u| u.to_le_bytes()).collect();
            let big: Vec<u8> = units.iter().flat_map(|u| u.to_be_bytes()).collect();
            for bytes in [[b"\xff\xfe", &little[..]].concat(), [b"\xfe\xff", &big[..]].concat()] {
                assert_eq!(statements(&decode(&bytes)), want);
            }
            assert_eq!(statements(&decode(&little)), want);
            assert_eq!(statements(&decode(&big)), want);
        }
        assert!(statements(b"").is_empty() && statements(b"\0\0\n# v 1\n").is_empty());
    }

    #[test]
    fn a_backslash_continues_statements_and_not_comments_or_names() {
        for (text, want) in [
            ("f 1 \\\n2 \\  \n 3\nv", &["f 1  2  3", "v"][..]),
            ("# a\\b\\\nf 1", &["f 1"]),
            ("f 1 # a\\\nf 2", &["f 1 # a\\", "f 2"]),
            ("f 1 # a\\\n2", &["f 1 # a\\", "2"]),
            ("g a\\b\\\nusemtl x", &["g a\\b\\", "usemtl x"]),
            ("f 1\\\n# a\n2", &["f 1\\", "2"]),
            ("f 1\\", &["f 1\\"]),
            ("usemtl a \\\nf 1", &["usemtl a", "f 1"]),
            ("f 1\\\n\nf 2", &["f 1 ", "f 2"]),
        ] {
            let found: Vec<_> = statements(text.as_bytes()).into_iter().map(|(_, s)| s).collect();
            assert_eq!(found, want, "{text:?}");
        }
    }

    #[test]
    fn numbers_of_all_libraries() {
        for (word, want) in [
            ("1", 1.0),
            ("-.5e+02", -50.0),
            ("3.", 3.0),
            ("1E-0004", 1e-4),
            ("0,25", 0.25),
            ("-1.#INF00", f64::NEG_INFINITY),
            ("inf", f64::INFINITY),
        ] {
            assert_eq!(number(word.as_bytes()), Some(want), "{word}");
        }
        for word in ["nan", "-nan(ind)", "1.#QNAN", "-1.#IND00"] {
            assert!(number(word.as_bytes()).is_some_and(f64::is_nan), "{word}");
        }
        for word in ["", "x", "1,2,3", "1.0.0", "\u{fc}"] {
            assert_eq!(number(word.as_bytes()), None, "{word}");
        }
    }

    #[test]
    fn comments_end_numbers_and_are_no_part_of_them() {
        for (text, want) in [
            ("0. 0. 1.# note", &["0.", "0.", "1."][..]),
            ("0. 2.#IND", &["0.", "2."]),
            ("1.#INF00 -1.#ind 1.#QNAN#1", &["1.#INF00", "-1.#ind", "1.#QNAN"]),
            ("1 2#3", &["1", "2"]),
            ("1.#", &["1."]),
            ("#", &[]),
        ] {
            let found: Vec<_> = number_words(text.as_bytes()).collect();
            assert_eq!(found, want.iter().map(|w| w.as_bytes()).collect::<Vec<_>>(), "{text}");
        }
    }

    #[test]
    fn names_with_blanks_quotes_and_comments() {
        let shown = |names: Vec<Vec<u8>>| -> Vec<String> {
            names.into_iter().map(|name| String::from_utf8(name).unwrap()).collect()
        };
        assert_eq!(shown(readings(b"a b.png")), ["a b.png"]);
        assert_eq!(
            shown(readings(b"\"a b.png\"  # c")),
            ["\"a b.png\"  # c", "a b.png", "\"a b.png\""]
        );
        assert_eq!(shown(readings(b"wall #2.png")), ["wall #2.png", "wall"]);
        assert_eq!(shown(readings(b"a\\ b.png")), ["a\\ b.png", "a b.png"]);
        assert_eq!(
            shown(split_names(b"a.mtl \"b c.mtl\" d\\ e.mtl # f")),
            ["a.mtl", "b c.mtl", "d e.mtl"]
        );
        assert_eq!(shown(split_names(b"\"open")), ["open"]);
        assert!(split_names(b"\"\" # x").is_empty());
    }
}
