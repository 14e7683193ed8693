//! Makes a list of rows to measure of the scenes, sizes and axes that were typed.

use super::super::{
    args::{BenchArgs, parse_size},
    output::Output,
    plan::{SceneName, View},
    scene_view::SceneView,
};
use crate::{
    bench::{self, Axis, Label, Named, Recipe},
    error::{Error, Result},
    image::Extent,
    pass::Pass,
};
use std::ffi::{OsStr, OsString};

/// The size that is measured if none is asked for.
const DEFAULT_SIZE: Extent = Extent::new(1920, 1080);

/// One row to measure.
pub struct Case {
    /// The scene, the size and the settings.
    pub label: Label,
    /// Whether its first frames and its memory are measured too, in processes of their own.
    pub alone: bool,
    source: Source,
}

enum Source {
    Generated(Recipe),
    Scene(View),
}

impl Case {
    /// The scene as a user types it.
    pub fn typed(&self) -> OsString {
        match &self.source {
            Source::Generated(_) => self.label.scene.clone().into(),
            Source::Scene(view) => view.scene.typed(),
        }
    }

    /// Refuses to write over the scene.
    ///
    /// # Errors
    /// [`Error::Usage`].
    pub fn keep_from(&self, output: &Output) -> Result<()> {
        match &self.source {
            Source::Generated(_) => Ok(()),
            Source::Scene(view) => view.scene.keep_from(output),
        }
    }

    /// The pass. It is made anew each time, so that only one pass is in memory.
    ///
    /// # Errors
    /// Those of the scene.
    pub fn pass(&self) -> Result<Pass> {
        match &self.source {
            Source::Generated(recipe) => bench::pass(&self.label.name(), recipe, self.label.extent),
            Source::Scene(view) => SceneView::new(view).map(|scene_view| scene_view.pass),
        }
    }
}

/// Every scene at every size along every axis. All of it is checked before anything is measured.
///
/// # Errors
/// [`Error::Usage`], [`Error::Input`] for a scene that is not there.
pub fn cases(args: &BenchArgs) -> Result<Vec<Case>> {
    let mut axes = Vec::new();
    for typed in &args.axis {
        let (axis, values) = axis(typed)?;
        if axes.iter().any(|(known, _)| *known == axis) {
            return Err(Error::Usage(format!("--axis {} is given twice", axis.name())));
        }
        axes.push((axis, values));
    }
    let mut sizes = args.size.clone();
    if let Some(at) = axes.iter().position(|(axis, _)| *axis == Axis::Size) {
        for text in axes.remove(at).1 {
            sizes.push(parse_size(&text).map_err(Error::Usage)?);
        }
    }
    if sizes.is_empty() {
        sizes.push(DEFAULT_SIZE);
    }
    let typed: Vec<OsString> = match (args.scenes.as_slice(), axes.is_empty()) {
        ([], true) => bench::named()
            .iter()
            .filter(|scene| scene.name != bench::SHEET)
            .map(|scene| scene.name.into())
            .collect(),
        ([], false) => vec![bench::SHEET.into()],
        (typed, _) => typed.to_vec(),
    };
    let settings = combinations(&axes);
    let crossover = args.scenes.is_empty() && axes.is_empty() && args.report.is_some();
    let mut cases = Vec::new();
    for extent in sizes {
        for typed in &typed {
            match typed.to_str().and_then(bench::find) {
                Some(scene) => {
                    for settings in &settings {
                        cases.push(generated(&scene, extent, settings, args.seed)?);
                    }
                }
                None => {
                    for settings in &settings {
                        cases.push(seen(typed, extent, settings, args)?);
                    }
                }
            }
        }
        if let (true, Some(sheet)) = (crossover, bench::find(bench::SHEET)) {
            let axes = bench::CROSSOVER.map(|(axis, values)| {
                (axis, values.iter().map(|value| value.to_string()).collect())
            });
            for settings in combinations(&axes) {
                // They are about frames alone, and many.
                cases.push(Case {
                    alone: false,
                    ..generated(&sheet, extent, &settings, args.seed)?
                });
            }
        }
    }
    shorten(&mut cases);
    Ok(cases)
}

/// Leaves the folder of a file out of its title, unless two titles would become equal.
fn shorten(cases: &mut [Case]) {
    let short = |case: &Case| match &case.source {
        Source::Scene(View { scene: SceneName::File(path), .. }) => {
            path.file_name().map(|name| name.to_string_lossy().into_owned())
        }
        _ => None,
    };
    let files: Vec<_> = cases.iter().map(|case| (case.label.scene.clone(), short(case))).collect();
    for (case, (scene, short)) in cases.iter_mut().zip(&files) {
        let another = |(other, name): &(String, Option<String>)| other != scene && name == short;
        if let Some(short) = short
            && !files.iter().any(another)
        {
            case.label.title = short.clone();
        }
    }
}

fn refused(axis: Axis, reason: &str) -> Error {
    Error::Usage(format!("--axis {}: {reason}", axis.name()))
}

fn generated(
    scene: &Named,
    extent: Extent,
    settings: &[(Axis, String)],
    seed: u64,
) -> Result<Case> {
    let mut recipe = Recipe { seed, ..scene.recipe.clone() };
    for (axis, text) in settings {
        recipe.set(*axis, text).map_err(|reason| refused(*axis, &reason))?;
    }
    recipe.check().map_err(|reason| Error::Usage(format!("--axis: {reason}")))?;
    let label = Label {
        scene: scene.name.into(),
        title: scene.name.into(),
        extent,
        settings: settings.to_vec(),
    };
    Ok(Case { label, alone: true, source: Source::Generated(recipe) })
}

fn seen(
    typed: &OsStr,
    extent: Extent,
    settings: &[(Axis, String)],
    args: &BenchArgs,
) -> Result<Case> {
    let text = typed.to_string_lossy();
    let scene = SceneName::new(typed).map_err(|error| match error {
        Error::Input { .. } if !text.contains(['.', '/']) => Error::Usage(format!(
            "there is no scene `{text}`: `tilewright bench --list` lists the generated scenes"
        )),
        other => other,
    })?;
    let mut view = View::new(scene, extent, &args.view)?;
    for (axis, text) in settings {
        match axis {
            Axis::Samples => view.samples = Axis::samples(text).map_err(|r| refused(*axis, &r))?,
            _ => {
                return Err(Error::Usage(format!(
                    "--axis {} varies generated scenes, and `{}` is none \
                     (tilewright bench --list names them)",
                    axis.name(),
                    typed.display()
                )));
            }
        }
    }
    let (scene, title) = (text.clone().into_owned(), text.into_owned());
    let label = Label { scene, title, extent, settings: settings.to_vec() };
    Ok(Case { label, alone: true, source: Source::Scene(view) })
}

/// `name=a,b,c`.
fn axis(typed: &str) -> Result<(Axis, Vec<String>)> {
    let wrong = |reason: String| Error::Usage(format!("--axis {typed}: {reason}"));
    let (name, values) =
        typed.split_once('=').ok_or_else(|| wrong("expected NAME=A,B,C, like area=1,16".into()))?;
    let values: Vec<String> = values.split(',').map(|value| value.trim().to_string()).collect();
    Ok((Axis::named(name.trim()).map_err(wrong)?, values))
}

/// All combinations of one value of each axis; the last axis varies fastest. Without axes, one empty combination.
fn combinations(axes: &[(Axis, Vec<String>)]) -> Vec<Vec<(Axis, String)>> {
    let mut ways = vec![Vec::new()];
    for (axis, values) in axes {
        ways = ways
            .iter()
            .flat_map(|way| {
                values.iter().map(|value| [way.as_slice(), &[(*axis, value.clone())]].concat())
            })
            .collect();
    }
    ways
}

#[cfg(test)]
mod tests {
    use super::super::super::args::{Typed, Verb};
    use super::*;
    use crate::{
        state::{LineMode, Topology},
        stencil::StencilOp,
    };
    use clap::Parser;

    fn cases_of(line: &[&str]) -> Vec<Case> {
        let typed = Typed::try_parse_from(["tilewright", "bench"].iter().chain(line));
        let Verb::Bench(args) = typed.unwrap_or_else(|e| panic!("{e}")).verb else {
            unreachable!()
        };
        cases(&args).unwrap()
    }

    fn names(line: &[&str]) -> Vec<String> {
        let name = |case: &Case| format!("{} {}", case.label.name(), case.label.extent);
        cases_of(line).iter().map(name).collect()
    }

    #[test]
    fn without_scenes_all_named_ones_and_for_a_page_the_crossover() {
        let all = cases_of(&[]);
        assert_eq!(all.len(), bench::named().len() - 1);
        assert!(all.iter().all(|case| case.alone && case.label.scene != bench::SHEET));
        let page = cases_of(&["--report", "page.html"]);
        assert_eq!(page.len(), all.len() + 24);
        assert!(page[all.len()..].iter().all(|case| !case.alone));
    }

    #[test]
    fn the_last_axis_varies_fastest_and_sizes_slowest() {
        let line = ["--axis", "depth=1,2", "--axis", "size=8x8,9x9", "--axis", "area=4, full"];
        assert_eq!(
            names(&line),
            [
                "sheet depth=1 area=4 8x8",
                "sheet depth=1 area=full 8x8",
                "sheet depth=2 area=4 8x8",
                "sheet depth=2 area=full 8x8",
                "sheet depth=1 area=4 9x9",
                "sheet depth=1 area=full 9x9",
                "sheet depth=2 area=4 9x9",
                "sheet depth=2 area=full 9x9",
            ]
        );
    }

    #[test]
    fn samples_and_targets_reach_the_pass() {
        let line = ["large", "builtin:cube", "--axis", "samples=1,8", "--size", "8x8"];
        assert_eq!(
            names(&line),
            [
                "large samples=1 8x8",
                "large samples=8 8x8",
                "builtin:cube samples=1 8x8",
                "builtin:cube samples=8 8x8",
            ]
        );
        let passes = |line: &[&str]| -> Vec<(u32, usize)> {
            let of = |pass: Pass| (pass.samples.count(), pass.colors.len());
            cases_of(line).iter().map(|case| of(case.pass().unwrap())).collect()
        };
        assert_eq!(passes(&line), [(1, 1), (8, 1), (1, 1), (8, 1)]);
        let line = ["--axis", "targets=1,3,8", "--axis", "samples=2", "--size", "8x8"];
        assert_eq!(passes(&line), [(2, 1), (2, 3), (2, 8)]);
    }

    #[test]
    fn stencil_and_lines_reach_the_pass() {
        let line = ["large", "--axis", "lines=no,8,bresenham-2", "--axis", "stencil=none,write"];
        let of = |pass: Pass| {
            let pipeline = &pass.pipelines[0];
            let is_written = pipeline.stencil.is_some_and(|s| s.front.pass == StencilOp::Replace);
            assert_eq!(pass.stencil.is_some(), is_written);
            (pipeline.topology, pipeline.line_width, pipeline.line_mode, is_written)
        };
        let line: Vec<_> = line.into_iter().chain(["--size", "8x8"]).collect();
        assert_eq!(names(&line)[3], "large lines=8 stencil=write 8x8");
        let found: Vec<_> = cases_of(&line).iter().map(|case| of(case.pass().unwrap())).collect();
        let (rectangular, bresenham) = (LineMode::Rectangular, LineMode::Bresenham);
        let wanted = [
            (Topology::TriangleList, 1.0, rectangular),
            (Topology::LineList, 8.0, rectangular),
            (Topology::LineList, 2.0, bresenham),
        ];
        let both = |(topology, width, mode)| {
            [false, true].map(|is_written| (topology, width, mode, is_written))
        };
        assert_eq!(found, wanted.map(both).concat());
    }

    #[test]
    fn files_are_shown_without_their_folders_if_they_still_differ() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str| {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(&path, "").unwrap();
            path.to_str().unwrap().to_string()
        };
        let [a, b, c] = ["one/a.glb", "two/a.glb", "two/c.glb"].map(file);
        let found = names(&[&a, &b, &c, "--size", "8x8"]);
        assert_eq!(found, [format!("{a} 8x8"), format!("{b} 8x8"), "c.glb 8x8".to_string()]);
    }
}
