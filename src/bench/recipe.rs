//! The recipe of a generated scene, and the axes along which recipes vary.

use super::{lines::Lines, stencil::Stencil};
use crate::{abi::MAX_COLORS, image::Extent, random::Random, samples::Samples};

/// The most triangles that stand in one pair of buffers: as many as fit the smallest that a Vulkan device
/// may call its largest.
pub const MOST_TRIANGLES: u32 = 1 << 22;

/// The most triangles of a ball, which is made of parts.
pub const MOST_OF_A_BALL: u32 = 1 << 26;

/// The geometry.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Layers of triangles of one size, upright before the viewer. Axes vary this shape.
    Sheet,
    /// A hall with pillars, seen from inside: few triangles, large on the screen.
    Hall,
    /// A torus knot.
    Knot,
    /// A ball with ripples.
    Ball,
    /// Balls in a box, behind one another.
    Crowd,
    /// Needles, a pixel wide.
    Slivers,
    /// Bushes on a lawn, each leaf a quad with a transparent texture.
    Leaves,
}

/// Which of several overlapping things is drawn first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// The nearest: hidden pixels could be rejected early.
    Near,
    /// The farthest: everything is overdrawn.
    Far,
    /// Neither.
    Random,
}

/// Everything that decides a generated scene, except for the size of the picture.
#[derive(Clone, Debug, PartialEq)]
pub struct Recipe {
    /// The geometry.
    pub shape: Shape,
    /// Triangles, about. `None` for the sheet, which derives it.
    pub count: Option<u32>,
    /// Sheet: pixels that a triangle covers, infinite for a quad per layer.
    pub area: Option<f32>,
    /// Sheet: layers.
    pub depth: Option<u32>,
    /// The order of layers and objects.
    pub order: Order,
    /// Waves that the vertex shader adds.
    pub vertex_cost: u32,
    /// Lamps that the fragment shader adds.
    pub fragment_cost: u32,
    /// Textures that the fragment shader reads, 0 to 8.
    pub textures: u32,
    /// Varyings of four components beside position, normal and texture coordinates: 0, 4, 8 or 12.
    pub varyings: u32,
    /// Everything is transparent: blended in API order, tested against depth and not written to it.
    pub blend: bool,
    /// At least so many draws.
    pub draws: u32,
    /// Draws take turns among so many pipelines.
    pub pipelines: u32,
    /// Draws take turns among so many materials, each with textures of its own.
    pub materials: u32,
    /// Samples of a pixel.
    pub samples: Samples,
    /// Colour targets, each written by the fragment shader: 1 to 8.
    pub targets: u32,
    /// What draws do with stencil values.
    pub stencil: Stencil,
    /// Lines in place of triangles: their sides.
    pub lines: Option<Lines>,
    /// Seed of the random numbers for places, colours and textures.
    pub seed: u64,
}

impl Recipe {
    /// `shape` of `count` triangles with one texture and one draw.
    pub const fn new(shape: Shape, count: Option<u32>) -> Self {
        Self {
            shape,
            count,
            area: None,
            depth: None,
            order: Order::Random,
            vertex_cost: 0,
            fragment_cost: 0,
            textures: 1,
            varyings: 0,
            blend: false,
            draws: 1,
            pipelines: 1,
            materials: 1,
            samples: Samples::One,
            targets: 1,
            stencil: Stencil::None,
            lines: None,
            seed: 0,
        }
    }

    /// The random numbers of one `purpose`: others for each purpose and each seed.
    pub(super) fn random(&self, purpose: u64) -> Random {
        Random(purpose.wrapping_add(self.seed.wrapping_mul(0xd1b5_4a32_d192_ed03)))
    }

    /// Sets what `axis` varies.
    ///
    /// # Errors
    /// A sentence, if the text is no value of the axis or the scene has no such axis.
    pub fn set(&mut self, axis: Axis, text: &str) -> Result<(), String> {
        let number = |range: std::ops::RangeInclusive<u32>| {
            text.parse().ok().filter(|n| range.contains(n)).ok_or_else(|| {
                let (from, to) = range.into_inner();
                format!("`{text}` is no {}: a whole number from {from} to {to} is", axis.name())
            })
        };
        let sheet = |recipe: &Recipe| match recipe.shape {
            Shape::Sheet => Ok(()),
            _ => Err(format!("only the scene `sheet` has the axis `{}`", axis.name())),
        };
        match axis {
            Axis::Area => {
                sheet(self)?;
                let px = || text.parse().ok().filter(|px| (0.25..=1e9).contains(px));
                let area = if text == "full" { Some(f32::INFINITY) } else { px() };
                let expected = "pixels, 0.25 or more, or `full` is";
                self.area = Some(area.ok_or_else(|| format!("`{text}` is no area: {expected}"))?);
            }
            Axis::Depth => {
                sheet(self)?;
                self.depth = Some(number(1..=1024)?);
            }
            Axis::Count if self.shape == Shape::Hall => {
                return Err("the scene `large` has no axis `count`: it is few triangles".into());
            }
            Axis::Count => {
                let ball = self.shape == Shape::Ball;
                let most = if ball { MOST_OF_A_BALL } else { MOST_TRIANGLES };
                self.count = Some(number(1..=most)?);
            }
            Axis::Order => {
                self.order = match text {
                    "near" => Order::Near,
                    "far" => Order::Far,
                    "random" => Order::Random,
                    _ => return Err(format!("`{text}` is no order: near, far or random is")),
                }
            }
            Axis::Vertex => self.vertex_cost = number(0..=4096)?,
            Axis::Fragment => self.fragment_cost = number(0..=4096)?,
            Axis::Textures => self.textures = number(0..=8)?,
            Axis::Varyings => {
                self.varyings = number(0..=12)?;
                if !self.varyings.is_multiple_of(4) {
                    return Err(format!("`{text}` is no number of varyings: 0, 4, 8 or 12 is"));
                }
            }
            Axis::Blend => {
                self.blend = match text {
                    "no" => false,
                    "yes" => true,
                    _ => return Err(format!("`{text}` is no blend: yes or no is")),
                }
            }
            Axis::Draws => self.draws = number(1..=100_000)?,
            Axis::Pipelines => self.pipelines = number(1..=64)?,
            Axis::Samples => self.samples = Axis::samples(text)?,
            Axis::Targets => self.targets = number(1..=MAX_COLORS)?,
            Axis::Stencil => self.stencil = Stencil::named(text)?,
            Axis::Lines => self.lines = Lines::parse(text)?,
            Axis::Size => return Err("the size is not the scene's".into()),
        }
        Ok(())
    }

    /// Whether the parts of the recipe fit each other.
    ///
    /// # Errors
    /// A sentence.
    pub fn check(&self) -> Result<(), String> {
        match (self.area, self.count, self.depth) {
            (Some(_), Some(_), Some(_)) if self.shape == Shape::Sheet => {
                Err("two of area, count and depth decide the third: leave one out".into())
            }
            _ => Ok(()),
        }
    }

    /// A sheet's layers for a picture of `extent`.
    pub fn layers(&self, extent: Extent) -> Layers {
        let pixels = extent.pixels() as f32;
        let depth = self.depth.unwrap_or(1);
        let area = match (self.area, self.count) {
            (Some(area), _) => area,
            (None, Some(count)) => pixels * depth as f32 / count as f32,
            (None, None) => 32.0,
        };
        // Two triangles to a cell; a layer that is one cell cannot be cut further.
        let side = (2.0 * area).sqrt();
        let cells =
            |length: u32| (length as f32 / side).round().clamp(1.0, length as f32 * 2.0) as u32;
        let (mut columns, mut rows) = (cells(extent.width), cells(extent.height));
        let depth = match (self.area, self.count) {
            (Some(_), Some(count)) => count.div_ceil(columns * rows * 2).max(1),
            _ => depth,
        };
        // If there are too many triangles, the sheet becomes smaller; its triangles keep their size.
        let most = (MOST_TRIANGLES / 2 / depth).max(1);
        let whole = (columns, rows);
        if columns * rows > most {
            let shrink = (most as f32 / (columns * rows) as f32).sqrt();
            columns = ((columns as f32 * shrink) as u32).max(1);
            rows = (most / columns).clamp(1, rows);
        }
        let covered = [columns as f32 / whole.0 as f32, rows as f32 / whole.1 as f32];
        Layers { depth, columns, rows, covered }
    }
}

/// How a sheet is cut.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layers {
    /// Layers.
    pub depth: u32,
    /// Cells of a layer, two triangles each.
    pub columns: u32,
    /// See [`Layers::columns`].
    pub rows: u32,
    /// The part of the picture that a layer covers, in each direction.
    pub covered: [f32; 2],
}

/// What can be varied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// [`Recipe::area`].
    Area,
    /// [`Recipe::count`].
    Count,
    /// [`Recipe::depth`].
    Depth,
    /// [`Recipe::order`].
    Order,
    /// Size of the picture.
    Size,
    /// [`Recipe::vertex_cost`].
    Vertex,
    /// [`Recipe::fragment_cost`].
    Fragment,
    /// [`Recipe::textures`].
    Textures,
    /// [`Recipe::varyings`].
    Varyings,
    /// [`Recipe::blend`].
    Blend,
    /// [`Recipe::draws`].
    Draws,
    /// [`Recipe::pipelines`].
    Pipelines,
    /// [`Recipe::samples`].
    Samples,
    /// [`Recipe::targets`].
    Targets,
    /// [`Recipe::stencil`].
    Stencil,
    /// [`Recipe::lines`].
    Lines,
}

impl Axis {
    /// All of them, with what their values are.
    pub const ALL: [(Axis, &'static str); 16] = [
        (
            Axis::Area,
            "pixels that a triangle covers, 0.25 or more, or full; of `sheet`, which covers less of\n                  the picture where all of it would take more than 4194304 triangles",
        ),
        (
            Axis::Count,
            "triangles, up to 4194304; of a ball (small-1m), up to 67108864; of `sheet` in whole layers,\n                  as many as it takes if area is given too",
        ),
        (Axis::Depth, "layers, up to 1024; of `sheet`"),
        (Axis::Order, "near, far or random: the things that are drawn first"),
        (Axis::Size, "WxH, as --size"),
        (Axis::Vertex, "waves that the vertex shader adds, up to 4096"),
        (Axis::Fragment, "lamps that the fragment shader adds, up to 4096"),
        (Axis::Textures, "textures that the fragment shader reads, up to 8"),
        (Axis::Varyings, "further varyings of four components, 0, 4, 8 or 12"),
        (Axis::Blend, "yes or no: everything blended, in order"),
        (Axis::Draws, "draws that the triangles are dealt to, at least, up to 100000"),
        (Axis::Pipelines, "pipelines that the draws take turns among, up to 64"),
        (
            Axis::Samples,
            "samples of a pixel, 1, 2, 4, 8 or 16; of files and built-in scenes too; rows of more than the\n                  device itself draws are left out and listed",
        ),
        (Axis::Targets, "colour targets that the fragment shader writes, up to 8"),
        (
            Axis::Stencil,
            "none, test (it only compares), write (each pixel gets the number of its draw) or order (each\n                  fragment adds one, in order)",
        ),
        (
            Axis::Lines,
            "no, or the sides of triangles as lines: their width, 1 to 1024, or bresenham-1 to\n                  bresenham-1024; rows of lines that the device itself does not draw are left out and listed",
        ),
    ];

    /// As it is typed.
    pub const fn name(self) -> &'static str {
        match self {
            Axis::Area => "area",
            Axis::Count => "count",
            Axis::Depth => "depth",
            Axis::Order => "order",
            Axis::Size => "size",
            Axis::Vertex => "vertex",
            Axis::Fragment => "fragment",
            Axis::Textures => "textures",
            Axis::Varyings => "varyings",
            Axis::Blend => "blend",
            Axis::Draws => "draws",
            Axis::Pipelines => "pipelines",
            Axis::Samples => "samples",
            Axis::Targets => "targets",
            Axis::Stencil => "stencil",
            Axis::Lines => "lines",
        }
    }

    /// The value `text` of [`Axis::Samples`], which scenes have too that no recipe makes.
    ///
    /// # Errors
    /// A sentence, if it is none.
    pub fn samples(text: &str) -> Result<Samples, String> {
        let samples = text.parse().ok().and_then(Samples::from_count);
        samples.ok_or_else(|| format!("`{text}` is no number of samples: 1, 2, 4, 8 or 16 is"))
    }

    /// The axis called `name`.
    ///
    /// # Errors
    /// A sentence that lists them.
    pub fn named(name: &str) -> Result<Self, String> {
        let found = Self::ALL.iter().find(|(axis, _)| axis.name() == name);
        found.map(|(axis, _)| *axis).ok_or_else(|| {
            let names: Vec<_> = Self::ALL.iter().map(|(axis, _)| axis.name()).collect();
            format!("there is no axis `{name}`; there are {}", names.join(", "))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FULL_HD: Extent = Extent::new(1920, 1080);

    fn sheet(settings: &[(Axis, &str)]) -> Result<Recipe, String> {
        let mut recipe = Recipe::new(Shape::Sheet, None);
        for (axis, text) in settings {
            recipe.set(*axis, text)?;
        }
        recipe.check().map(|()| recipe)
    }

    #[test]
    fn two_of_area_count_and_depth_decide_the_third() {
        let layers = |settings: &[(Axis, &str)]| sheet(settings).unwrap().layers(FULL_HD);
        let triangles = |l: Layers| l.depth * l.columns * l.rows * 2;
        let by_area = triangles(layers(&[(Axis::Area, "8"), (Axis::Depth, "3")]));
        assert!(by_area.abs_diff(3 * 1920 * 1080 / 8) < 8000, "{by_area}");
        let by_count = triangles(layers(&[(Axis::Count, "70000")]));
        assert!(by_count.abs_diff(70000) < 1000, "{by_count}");
        assert_eq!(layers(&[(Axis::Area, "8"), (Axis::Count, "777600")]).depth, 3);
        let all = [(Axis::Area, "8"), (Axis::Count, "7"), (Axis::Depth, "2")];
        assert!(sheet(&all).unwrap_err().contains("leave one out"));
    }

    #[test]
    fn a_full_layer_is_two_triangles_and_too_many_are_a_smaller_sheet() {
        let full = sheet(&[(Axis::Area, "full"), (Axis::Depth, "60")]).unwrap().layers(FULL_HD);
        assert_eq!(full, Layers { depth: 60, columns: 1, rows: 1, covered: [1.0, 1.0] });
        let many = sheet(&[(Axis::Area, "0.25"), (Axis::Depth, "16")]).unwrap().layers(FULL_HD);
        let triangles = many.depth * many.columns * many.rows * 2;
        assert!(triangles <= MOST_TRIANGLES && triangles > MOST_TRIANGLES * 9 / 10);
        assert!(many.covered[0] < 0.2 && many.covered[1] < 0.2);
    }

    #[test]
    fn what_is_no_value_is_refused_with_what_is() {
        for (axis, text, said) in [
            (Axis::Area, "0.1", "0.25 or more"),
            (Axis::Area, "nan", "0.25 or more"),
            (Axis::Depth, "0", "1 to 1024"),
            (Axis::Order, "up", "near, far or random"),
            (Axis::Varyings, "5", "0, 4, 8 or 12"),
            (Axis::Blend, "1", "yes or no"),
            (Axis::Textures, "9", "0 to 8"),
            (Axis::Draws, "", "1 to 100000"),
            (Axis::Samples, "3", "1, 2, 4, 8 or 16"),
            (Axis::Samples, "32", "1, 2, 4, 8 or 16"),
            (Axis::Targets, "0", "1 to 8"),
            (Axis::Targets, "9", "1 to 8"),
            (Axis::Stencil, "yes", "none, test, write or order"),
            (Axis::Lines, "0", "1 to 1024"),
            (Axis::Lines, "nan", "1 to 1024"),
            (Axis::Lines, "bresenham", "bresenham-1"),
            (Axis::Lines, "bresenham-2000", "bresenham-1"),
        ] {
            let refused = sheet(&[(axis, text)]).unwrap_err();
            assert!(refused.contains(said), "{refused}");
        }
        let mut knot = Recipe::new(Shape::Knot, Some(70_000));
        assert!(knot.set(Axis::Area, "8").unwrap_err().contains("`sheet`"));
        assert!(Axis::named("colour").unwrap_err().contains("area, count, depth"));
        for (axis, _) in Axis::ALL {
            assert_eq!(Axis::named(axis.name()), Ok(axis));
        }
    }
}
