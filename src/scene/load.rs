//! Opening a scene by its path: which format it has, and what is asked of it.

use super::{Scene, build::Fault, files, gltf, obj};
use crate::Result;
use std::path::Path;

/// What loading can be asked for.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoadOptions {
    /// The moment of the file's animations in seconds; `None` is the rest pose.
    pub time: Option<f64>,
}

impl Scene {
    /// Loads a glTF 2.0 (`.gltf`, `.glb`) or Wavefront OBJ (`.obj`) file with what it refers to.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) that names the file and the fault; [`Error::Shader`](crate::Error::Shader) if the engine's own
    /// shaders do not compile.
    pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
        let bytes = files::read(path)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let scene = match extension.as_str() {
            "gltf" | "glb" => gltf::load(path, &name, &bytes, options.time),
            "obj" => obj::load(path, &name, &bytes),
            _ if bytes.starts_with(b"glTF") => gltf::load(path, &name, &bytes, options.time),
            _ => Err(Fault::Input(
                "the name ends neither in .gltf, .glb nor .obj, and the content is no GLB".into(),
            )),
        };
        scene.map_err(|fault| fault.into_error(path))
    }
}
