//! Pictures as PNG files.
//!
//! A file says where it comes from: the caller's key and text pairs become `tEXt` chunks, and the
//! command-line tool puts the device there. The `png` crate is used directly because the `image`
//! crate offers no way to write text.

use super::Picture;
use crate::error::{Error, Result};
use std::io::Write;

/// Writes `image` to `out` as an 8-bit RGBA PNG with `text` as key and value pairs.
///
/// Keys are 1 to 79 Latin-1 characters; characters outside Latin-1 become `?`.
///
/// # Errors
/// [`Error::Usage`] for a depth image; the writer's own error is passed on by `out`'s `io::Error`.
pub fn write_png(image: &Picture, text: &[(String, String)], out: impl Write) -> Result<()> {
    let pixels = image.display_rgba8()?;
    let mut info = png::Info::with_size(image.extent.width, image.extent.height);
    info.color_type = png::ColorType::Rgba;
    info.bit_depth = png::BitDepth::Eight;
    info.srgb = Some(png::SrgbRenderingIntent::Perceptual);
    let mut encoder = png::Encoder::with_info(out, info).map_err(fault)?;
    encoder.set_compression(png::Compression::Fast);
    for (key, value) in text {
        encoder.add_text_chunk(latin1(key), latin1(value)).map_err(fault)?;
    }
    let mut writer = encoder.write_header().map_err(fault)?;
    writer.write_image_data(&pixels).map_err(fault)?;
    writer.finish().map_err(fault)
}

fn latin1(text: &str) -> String {
    text.chars().map(|c| if (c as u32) < 256 && c != '\0' { c } else { '?' }).collect()
}

fn fault(error: png::EncodingError) -> Error {
    let source = match error {
        png::EncodingError::IoError(source) => source,
        other => std::io::Error::other(other.to_string()),
    };
    Error::Io { path: "PNG".into(), source }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{format::Format, image::Extent};

    #[test]
    fn pixels_and_text_come_back() {
        let mut image = Picture::zeroed(Extent::new(3, 2), Format::Rgba8Srgb);
        for (i, byte) in image.bytes.iter_mut().enumerate() {
            *byte = i as u8 * 7;
        }
        let text = [("Device".to_string(), "llvmpipe (€)".to_string())];
        let mut file = Vec::new();
        write_png(&image, &text, &mut file).unwrap();

        let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
        let mut pixels = vec![0; reader.output_buffer_size().unwrap()];
        reader.next_frame(&mut pixels).unwrap();
        assert_eq!(pixels, image.bytes);
        let chunk = &reader.info().uncompressed_latin1_text[0];
        assert_eq!((chunk.keyword.as_str(), chunk.text.as_str()), ("Device", "llvmpipe (?)"));
    }

    #[test]
    fn a_depth_image_is_no_picture() {
        let depth = Picture::zeroed(Extent::new(1, 1), Format::D32Float);
        assert!(matches!(write_png(&depth, &[], Vec::new()), Err(Error::Usage(_))));
    }
}
