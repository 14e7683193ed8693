//! The work to do: checks the typed values together, before any device is touched.

use super::{
    args::{Backend, ParityArgs, RenderArgs, Vec3, ViewArgs},
    messages,
    output::Output,
};
use crate::{
    error::{Error, Result},
    image::Extent,
    samples::Samples,
    scene::Scene,
};
use std::{
    ffi::{OsStr, OsString},
    path::{Path, PathBuf},
};

/// Which scene.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum SceneName {
    /// A built-in scene.
    Builtin(String),
    /// A file that exists.
    File(PathBuf),
}

impl std::fmt::Display for SceneName {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            SceneName::Builtin(name) => write!(f, "builtin:{name}"),
            SceneName::File(path) => write!(f, "{}", path.display()),
        }
    }
}

impl SceneName {
    /// The name without the folder; all paths to one file give the same name.
    pub fn title(&self) -> String {
        match self {
            SceneName::Builtin(_) => self.to_string(),
            SceneName::File(path) => {
                path.file_name().unwrap_or_default().to_string_lossy().into_owned()
            }
        }
    }

    /// The scene as a user types it.
    pub fn typed(&self) -> OsString {
        match self {
            SceneName::Builtin(_) => self.to_string().into(),
            SceneName::File(path) => path.into(),
        }
    }
}

/// The camera that the scene is seen by.
#[derive(Clone, Debug, PartialEq)]
pub enum CameraChoice {
    /// The file's first camera, or one that frames the scene.
    Default,
    /// A camera of the file, by name or by number from 0.
    Named(String),
    /// One that was given on the command line.
    LookAt {
        /// Where it is.
        eye: [f64; 3],
        /// The point that it looks at.
        target: [f64; 3],
        /// Which way is up.
        up: [f64; 3],
    },
}

/// A scene and how it is seen.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// The scene.
    pub scene: SceneName,
    /// Size of the picture.
    pub extent: Extent,
    /// Samples of a pixel.
    pub samples: Samples,
    /// The camera.
    pub camera: CameraChoice,
    /// Vertical field of view in degrees, if it is not the camera's own.
    pub fov: Option<f64>,
    /// Colour behind everything, sRGB, if it is not the scene's own.
    pub background: Option<[u8; 4]>,
    /// Seconds at which animations are evaluated; `None` is the rest pose.
    pub time: Option<f64>,
}

/// `tilewright render`.
#[derive(Debug)]
pub struct RenderPlan {
    /// The scene and its view.
    pub view: View,
    /// The executor.
    pub backend: Backend,
    /// Where the picture goes.
    pub picture: Output,
    /// Where the figures go.
    pub stats: Option<Output>,
    /// Whether the picture says where it comes from.
    pub metadata: bool,
}

/// `tilewright parity`.
#[derive(Debug)]
pub struct ParityPlan {
    /// The scene and its view.
    pub view: View,
    /// Whether figures are printed as JSON.
    pub json: bool,
    /// Where the difference picture goes.
    pub difference: Option<Output>,
    /// Whether the difference picture says where it comes from.
    pub metadata: bool,
}

impl RenderPlan {
    /// Checks the typed values.
    ///
    /// # Errors
    /// [`Error::Usage`], [`Error::Input`] for a scene that is not there, [`Error::Io`] for an output
    /// that cannot be written.
    pub fn new(args: &RenderArgs) -> Result<Self> {
        let view =
            View::new(SceneName::new(&args.scene.scene)?, args.scene.size, &args.scene.view)?;
        let view = View { samples: args.samples, ..view };
        if args.output.extension().is_some_and(|ending| !ending.eq_ignore_ascii_case("png")) {
            messages::line(format_args!(
                "warning: {} will be a PNG, whatever its name says",
                args.output.display()
            ));
        }
        let picture = Output::new(&args.output)?;
        view.scene.keep_from(&picture)?;
        let stats = args.stats.as_deref().map(Output::new).transpose()?;
        if let Some(stats) = &stats {
            view.scene.keep_from(stats)?;
            if stats.collides(&picture) {
                return Err(Error::Usage("the picture and --stats go to the same place".into()));
            }
        }
        let metadata = !args.scene.no_metadata;
        Ok(Self { view, backend: args.backend, picture, stats, metadata })
    }
}

impl ParityPlan {
    /// Checks the typed values.
    ///
    /// # Errors
    /// As [`RenderPlan::new`].
    pub fn new(args: &ParityArgs) -> Result<Self> {
        let view =
            View::new(SceneName::new(&args.scene.scene)?, args.scene.size, &args.scene.view)?;
        let difference = args.diff.as_deref().map(Output::new).transpose()?;
        if let Some(difference) = &difference {
            view.scene.keep_from(difference)?;
            if difference.is_stdout() {
                return Err(Error::Usage(
                    "the figures go to standard output, --diff needs a file".into(),
                ));
            }
        }
        let metadata = !args.scene.no_metadata;
        Ok(Self { view, json: args.json, difference, metadata })
    }
}

impl View {
    /// Checks how `scene` is to be seen.
    ///
    /// # Errors
    /// [`Error::Usage`] for a camera without a direction.
    pub fn new(scene: SceneName, extent: Extent, args: &ViewArgs) -> Result<Self> {
        let camera = match (args.eye, args.target) {
            (Some(eye), Some(target)) => look_at(eye, target, args.up)?,
            _ => args.camera.clone().map_or(CameraChoice::Default, CameraChoice::Named),
        };
        Ok(Self {
            scene,
            extent,
            samples: Samples::One,
            camera,
            fov: args.fov,
            background: args.background,
            time: args.time,
        })
    }
}

fn look_at(Vec3(eye): Vec3, Vec3(target): Vec3, up: Option<Vec3>) -> Result<CameraChoice> {
    let up = up.map_or([0.0, 1.0, 0.0], |Vec3(up)| up);
    let [eye_v, target_v, up_v] = [eye, target, up].map(glam::DVec3::from);
    let forward = target_v - eye_v;
    if forward == glam::DVec3::ZERO {
        return Err(Error::Usage("--eye and --target are the same point".into()));
    }
    let Some(forward) = forward.try_normalize() else {
        return Err(Error::Usage(
            "--eye and --target are too close or too far apart: a distance between 1e-150 and 1e150 \
             is possible"
                .into(),
        ));
    };
    let Some(up_v) = up_v.try_normalize() else {
        return Err(Error::Usage("--up has no length: a direction like 0,1,0 is expected".into()));
    };
    if forward.cross(up_v).length() < 1e-6 {
        return Err(Error::Usage(
            "the camera looks along its up direction; choose another --up, like 0,0,1".into(),
        ));
    }
    Ok(CameraChoice::LookAt { eye, target, up })
}

impl SceneName {
    /// The scene that was typed.
    ///
    /// # Errors
    /// [`Error::Input`] for a file that is not there, [`Error::Usage`] for no built-in scene.
    pub fn new(typed: &OsStr) -> Result<Self> {
        let text = typed.to_str().unwrap_or_default();
        if let Some(name) = text.strip_prefix("builtin:") {
            Scene::check_builtin(name)?;
            return Ok(SceneName::Builtin(name.into()));
        }
        let path = Path::new(typed);
        match std::fs::metadata(path) {
            Ok(found) if found.is_dir() => Err(Error::input(path, "this is a folder, not a scene")),
            Ok(_) => Ok(SceneName::File(path.into())),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => Err(Error::input(
                path,
                match Scene::check_builtin(text) {
                    Ok(()) => format!("there is no such file, but a scene `builtin:{text}`"),
                    Err(_) => "there is no such file (scenes that need none are called \
                               builtin:NAME, see --help)"
                        .into(),
                },
            )),
            Err(e) => Err(Error::input(path, e)),
        }
    }

    /// Refuses to write over the scene.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn keep_from(&self, output: &Output) -> Result<()> {
        match self {
            SceneName::File(path) if output.replaces(path) => Err(Error::Usage(format!(
                "{} is the scene itself: writing there would replace it",
                path.display()
            ))),
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cli::args::{Typed, Verb};
    use clap::Parser;

    fn render(line: &[&str]) -> Result<RenderPlan> {
        let typed = Typed::try_parse_from(["tilewright", "render"].iter().chain(line))
            .unwrap_or_else(|e| panic!("{e}"));
        let Verb::Render(args) = typed.verb else { unreachable!() };
        RenderPlan::new(&args)
    }

    fn folder_with(name: &str) -> (tempfile::TempDir, String) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(name);
        std::fs::write(&path, b"").unwrap();
        (folder, path.to_str().unwrap().into())
    }

    #[test]
    fn a_camera_is_the_files_or_the_given_one() {
        let (_folder, out) = folder_with("out.png");
        let camera = |more: &[&str]| {
            render(&[&["builtin:teapot", "-o", &out], more].concat()).unwrap().view.camera
        };
        assert_eq!(camera(&[]), CameraChoice::Default);
        assert_eq!(camera(&["--camera", "2"]), CameraChoice::Named("2".into()));
        assert_eq!(
            camera(&["--eye", "-1,2,3", "--target=-4,5,6"]),
            CameraChoice::LookAt {
                eye: [-1.0, 2.0, 3.0],
                target: [-4.0, 5.0, 6.0],
                up: [0.0, 1.0, 0.0]
            }
        );
    }

    #[test]
    fn a_camera_without_a_direction_is_refused() {
        let (_folder, out) = folder_with("out.png");
        for (line, reason) in [
            (["1,2,3", "1,2,3", "0,1,0"], "same point"),
            (["0,9,0", "0,0,0", "0,1,0"], "along its up"),
            (["1e200,0,0", "0,0,0", "0,1,0"], "too far apart"),
            (["0,0,9", "0,0,0", "0,0,0"], "--up has no length"),
        ] {
            let [eye, target, up] = line;
            let camera = ["--eye", eye, "--target", target, "--up", up];
            let refused = render(&[&["builtin:teapot", "-o", &out], &camera[..]].concat());
            let Err(Error::Usage(said)) = refused else { panic!("{line:?}") };
            assert!(said.contains(reason), "{said}");
        }
    }

    #[test]
    fn nothing_that_is_read_or_written_is_written_over() {
        let (folder, scene) = folder_with("scene.glb");
        let again = folder.path().join("./scene.glb");
        let refused = render(&[&scene, "-o", again.to_str().unwrap()]).unwrap_err();
        assert!(refused.to_string().contains("the scene itself"), "{refused}");
        let out = folder.path().join("out.png");
        let out = out.to_str().unwrap();
        assert!(matches!(render(&[&scene, "-o", out, "--stats", out]), Err(Error::Usage(_))));
        let again = folder.path().join("./new/../out.png");
        std::fs::create_dir(folder.path().join("new")).unwrap();
        let again = again.to_str().unwrap();
        assert!(matches!(render(&[&scene, "-o", out, "--stats", again]), Err(Error::Usage(_))));
        assert!(matches!(render(&[&scene, "-o", out, "--stats", &scene]), Err(Error::Usage(_))));
    }

    #[test]
    fn a_scene_that_is_not_there_is_named() {
        let (folder, out) = folder_with("out.png");
        let missing = folder.path().join("missing.glb");
        let missing = missing.to_str().unwrap();
        let refused = render(&[missing, "-o", &out]).unwrap_err().to_string();
        assert!(refused.starts_with(missing) && refused.contains("no such file"), "{refused}");
        let refused = render(&["teapot", "-o", &out]).unwrap_err().to_string();
        assert!(refused.ends_with("`builtin:teapot`"), "{refused}");
        for wrong in ["builtin:", "builtin:teapt", "builtin:soup:x"] {
            assert!(matches!(render(&[wrong, "-o", &out]), Err(Error::Usage(_))), "{wrong}");
        }
        let folder = folder.path().to_str().unwrap();
        assert!(matches!(render(&[folder, "-o", &out]), Err(Error::Input { .. })));
    }
}
