//! Pictures as this tool writes them: PNG files that say where they come from.

use super::plan::SceneName;
use crate::{
    error::Result,
    image::{Image, png},
    vk::DeviceInfo,
};

/// `image` as a PNG file that names the tool, the device and the scene.
///
/// # Errors
/// As [`png::write_png`].
pub fn encode(image: &Image, device: &DeviceInfo, scene: &SceneName) -> Result<Vec<u8>> {
    let text = [
        ("Software", format!("tilewright {}", env!("CARGO_PKG_VERSION"))),
        ("Device", device.to_string()),
        ("Scene", scene.to_string()),
    ]
    .map(|(key, value)| (key.to_string(), value));
    let mut bytes = Vec::new();
    png::write_png(image, &text, &mut bytes)?;
    Ok(bytes)
}
