//! Colours of vertices, which OBJ does not know and every program writes in its own way.

use crate::image::srgb_to_linear;
use glam::Vec3;

/// The colours in `of_vertices`, or else those that comments of `text` have, for as many as `vertices`.
///
/// Files have them from 0 to 1, or as integers up to 255 or 65535, and
/// they were chosen or photographed for the eye: they are sRGB.
pub(super) fn linear(of_vertices: &[[f32; 3]], text: &[u8], vertices: usize) -> Vec<Vec3> {
    let painted = of_vertices.is_empty();
    let polypaint = if painted { polypaint(text) } else { Vec::new() };
    let raw = if painted { &polypaint[..] } else { of_vertices };
    let values = || raw.as_flattened().iter().filter(|v| v.is_finite());
    let largest = values().copied().fold(0.0, f32::max);
    let range = match largest {
        _ if painted => 255.0,
        ..=1.0 => 1.0,
        // A little too bright.
        ..2.0 if values().any(|v| v.fract() != 0.0) => 1.0,
        ..=255.0 => 255.0,
        ..=65535.0 => 65535.0,
        largest => largest,
    };
    let linear = |c: &[f32; 3]| {
        Vec3::from_array(c.map(|v| match v.is_nan() {
            true => 1.0,
            false => srgb_to_linear((v / range).clamp(0.0, 1.0)),
        }))
    };
    let mut out: Vec<Vec3> = raw.iter().map(linear).collect();
    if !out.is_empty() {
        out.resize(vertices, Vec3::ONE);
    }
    out
}

/// The colours that ZBrush writes in comments: `#MRGB` and eight digits (mask, red, green and blue)
/// for each vertex, in the order of vertices.
fn polypaint(text: &[u8]) -> Vec<[f32; 3]> {
    const MARK: &[u8] = b"#MRGB ";
    let mut colors = Vec::new();
    let mut at = 0;
    while let Some(found) = text[at..].iter().position(|&b| b == b'#') {
        at += found + 1;
        if !text[at - 1..].starts_with(MARK) {
            continue;
        }
        let digits = &text[at - 1 + MARK.len()..];
        let end = digits.iter().position(|b| !b.is_ascii_hexdigit()).unwrap_or(digits.len());
        let byte = |pair: &[u8]| {
            let digit = |b: u8| (b as char).to_digit(16).unwrap_or(0) as f32;
            digit(pair[0]) * 16.0 + digit(pair[1])
        };
        let color = |d: &[u8]| [byte(&d[2..4]), byte(&d[4..6]), byte(&d[6..8])];
        colors.extend(digits[..end].chunks_exact(8).map(color));
    }
    colors
}

#[cfg(test)]
mod tests {
    use super::*;

    fn of(colors: &[[f32; 3]]) -> Vec<Vec3> {
        linear(colors, b"", colors.len())
    }

    #[test]
    fn colours_of_all_ranges_are_linear() {
        let colors = of(&[[255.0, 0.0, 128.0], [0.0, 255.0, 0.0]]);
        assert!((colors[0].z - srgb_to_linear(128.0 / 255.0)).abs() < 1e-6);
        assert_eq!((colors[0].x, colors[1].y), (1.0, 1.0));
        assert_eq!(of(&[[65535.0, 0.0, 0.0]]), [Vec3::X]);
        assert_eq!(of(&[[1.0, 0.0, 0.0], [f32::NAN; 3]]), [Vec3::X, Vec3::ONE]);
        let bright = of(&[[1.1, 0.5, 0.0]]);
        assert_eq!(bright[0].x, 1.0);
        assert!(bright[0].y > 0.2, "from 0 to 1, one is a little brighter");
        assert_eq!(linear(&[[0.0; 3]], b"", 2), [Vec3::ZERO, Vec3::ONE]);
        assert!(linear(&[], b"# MRGB", 2).is_empty());
    }

    #[test]
    fn colours_in_comments_of_zbrush() {
        let text = b"#MRGB ffff0000ff00ff00\n#MRGB ff0000ffxx\n";
        assert_eq!(linear(&[], text, 4), [Vec3::X, Vec3::Y, Vec3::Z, Vec3::ONE]);
    }
}
