//! Opens a scene by its path: finds the format and takes the options.

use super::{
    Scene,
    build::Fault,
    content::{self, Content},
    files, gltf, obj,
};
use crate::Result;
use std::path::Path;

/// The options of loading.
#[derive(Clone, Copy, Debug, Default)]
pub struct LoadOptions {
    /// The moment of the file's animations in seconds; `None` is the rest pose.
    pub time: Option<f64>,
}

impl Scene {
    /// Loads a glTF 2.0 (`.gltf`, `.glb`) or Wavefront OBJ (`.obj`) file with the files that it refers to. The
    /// content decides which of the two it is; if the content looks like neither, the name decides.
    ///
    /// # Errors
    /// [`Error::Input`](crate::Error::Input) that names the file and the fault;
    /// [`Error::Shader`](crate::Error::Shader) if the engine's own shaders do not compile.
    pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene> {
        let mut own = Vec::new();
        let bytes = files::read(path, &mut own)?;
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let extension = path.extension().unwrap_or_default().to_string_lossy().to_lowercase();
        let scene = match (content::of(&bytes), extension.as_str()) {
            (Content::Gltf, _) => gltf::load(path, &name, &bytes, options.time),
            (Content::Other(what), _) => Err(Fault::Input(format!(
                "the content is {what}; tilewright draws glTF 2.0 (.gltf, .glb) and OBJ (.obj)"
            ))),
            (Content::Unknown, "obj") => obj::load(path, &name, &bytes),
            _ if obj::looks_like_obj(&bytes) => obj::load(path, &name, &bytes),
            (Content::Unknown, "gltf" | "glb") => gltf::load(path, &name, &bytes, options.time),
            (Content::Unknown, _) => Err(Fault::Input(
                "the content is neither glTF nor OBJ, nor does the name end in .gltf, .glb or .obj"
                    .into(),
            )),
        };
        let mut scene = scene.map_err(|fault| fault.into_error(path))?;
        scene.files.splice(..0, own);
        Ok(scene)
    }
}
