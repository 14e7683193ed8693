//! Makes a [`Pass`] of a scene and a camera: reads the scene, finds the camera, records the draws.

use super::{
    messages,
    output::Output,
    plan::{CameraChoice, SceneName, View},
};
use crate::{
    error::{Error, Result},
    format::Format,
    image::{Picture, srgb_to_linear},
    pass::Pass,
    scene::{Camera, LoadOptions, PassOptions, Projection, Scene},
};

/// Vertical field of view of a camera that is given by `--eye` and `--target`, in degrees.
const DEFAULT_FOV: f64 = 45.0;

/// Cameras that a message lists, each with as many characters of its name as [`Scene`]'s messages have.
const LISTED: usize = 20;

/// A scene as one camera sees it.
pub struct SceneView {
    /// The scene.
    pub scene: Scene,
    /// Its draws.
    pub pass: Pass,
    /// Whether the background is translucent. The drawn picture is then premultiplied by alpha.
    translucent: bool,
}

impl SceneView {
    /// Refuses to write over a file that the scene was read from.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn keep_from(&self, output: &Output) -> Result<()> {
        match self.scene.files().iter().find(|file| output.replaces(file)) {
            Some(file) => Err(Error::Usage(format!(
                "{} is a file of the scene: writing there would replace it",
                file.display()
            ))),
            None => Ok(()),
        }
    }

    /// Reads the scene and records its pass. Warnings go to standard error.
    ///
    /// # Errors
    /// Those of [`Scene`]; [`Error::Usage`] for a camera that the scene does not have.
    pub fn new(view: &View) -> Result<Self> {
        let scene = {
            let _working = messages::working_on(format_args!("reading {}", view.scene));
            match &view.scene {
                SceneName::Builtin(name) => Scene::builtin(name)?,
                SceneName::File(path) => Scene::load(path, &LoadOptions { time: view.time })?,
            }
        };
        for warning in scene.warnings() {
            messages::line(format_args!("warning: {warning}"));
        }
        let camera = camera(&scene, view)?;
        let mut options = PassOptions {
            background: view.background.map(linear),
            samples: view.samples,
            ..Default::default()
        };
        let translucent = view.background.is_some_and(|[.., alpha]| alpha < 255);
        if translucent {
            // The colours are divided by alpha later, which needs more than 8 bits.
            options.format = Format::Rgba16Float;
        }
        let pass = scene.pass(view.extent, &camera, &options)?;
        if pass.draws.is_empty() && scene.triangles() > 0 {
            messages::line("warning: the camera sees nothing of the scene");
        }
        Ok(Self { scene, pass, translucent })
    }

    /// The picture of the pass as a file holds it: with colours that are not multiplied by alpha.
    ///
    /// # Errors
    /// Those of [`Picture::unpremultiplied`], if the pass was given another format.
    pub fn picture(&self, drawn: Picture) -> Result<Picture> {
        if self.translucent { drawn.unpremultiplied() } else { Ok(drawn) }
    }

    /// Triangles that are drawn, instances included.
    pub fn triangles(&self) -> u64 {
        let of = |draw: &crate::pass::Draw| {
            let topology = self.pass.pipelines[draw.pipeline].topology;
            u64::from(topology.primitives(draw.count)) * u64::from(draw.instances)
        };
        self.pass.draws.iter().map(of).sum()
    }
}

fn camera(scene: &Scene, view: &View) -> Result<Camera> {
    let mut camera = match &view.camera {
        CameraChoice::Default => scene.default_camera(view.extent),
        CameraChoice::Named(name) => named(scene, name)?,
        CameraChoice::LookAt { eye, target, up } => {
            let [eye, target, up] = [*eye, *target, *up].map(glam::DVec3::from);
            scene.camera_at(eye, target, up, DEFAULT_FOV.to_radians())
        }
    };
    if let Some(degrees) = view.fov {
        match &mut camera.projection {
            Projection::Perspective { yfov, .. } => *yfov = degrees.to_radians(),
            Projection::Orthographic { .. } => {
                return Err(Error::Usage(
                    "the camera is orthographic: it has no field of view for --fov to change"
                        .into(),
                ));
            }
        }
    }
    Ok(camera)
}

fn named(scene: &Scene, wanted: &str) -> Result<Camera> {
    let cameras = scene.cameras();
    let by_name = cameras.iter().find(|camera| camera.name == wanted);
    let by_number = || wanted.parse().ok().and_then(|number: usize| cameras.get(number));
    by_name.or_else(by_number).cloned().ok_or_else(|| {
        let list: Vec<_> = cameras
            .iter()
            .enumerate()
            .map(|(number, camera)| match camera.name.as_str() {
                "" => format!("number {number}"),
                name => format!("number {number} `{name:.60}`"),
            })
            .take(LISTED)
            .collect();
        let more = match cameras.len().saturating_sub(LISTED) {
            0 => String::new(),
            more => format!(", and {more} more"),
        };
        Error::Usage(match list.is_empty() {
            true => {
                format!("there is no camera `{wanted}`, the scene has none: use --eye and --target")
            }
            false => format!("there is no camera `{wanted}`, only {}{more}", list.join(", ")),
        })
    })
}

/// An sRGB colour as linear floats; alpha is linear already.
fn linear([r, g, b, a]: [u8; 4]) -> [f32; 4] {
    let channel = |value: u8| f32::from(value) / 255.0;
    let [r, g, b] = [r, g, b].map(|value| srgb_to_linear(channel(value)));
    [r, g, b, channel(a)]
}
