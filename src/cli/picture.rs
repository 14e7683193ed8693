//! Pictures as this tool writes them: PNG files that say where they come from.

use super::plan::SceneName;
use crate::{
    error::Result,
    image::{Picture, png},
    vk::DeviceInfo,
};

/// `image` as a PNG file. With an `origin`, the file names the tool, the device and the scene. The scene is
/// named without its folder: folders are private, and the same scene gives the same bytes on every machine.
///
/// # Errors
/// As [`png::write_png`].
pub fn encode(image: &Picture, origin: Option<(&DeviceInfo, &SceneName)>) -> Result<Vec<u8>> {
    let text = origin.map(|(device, scene)| {
        [
            ("Software", format!("tilewright {}", env!("CARGO_PKG_VERSION"))),
            ("Device", device.to_string()),
            ("Scene", scene.title()),
        ]
        .map(|(key, value)| (key.to_string(), value))
    });
    let mut bytes = Vec::new();
    png::write_png(image, text.as_ref().map_or(&[], |text| text), &mut bytes)?;
    Ok(bytes)
}
