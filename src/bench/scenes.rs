//! The named scenes.

use super::recipe::{Axis, Order, Recipe, Shape};

/// A generated scene.
#[derive(Clone, Debug)]
pub struct Named {
    /// As it is typed.
    pub name: &'static str,
    /// Its purpose, in a line.
    pub about: &'static str,
    /// How it is made.
    pub recipe: Recipe,
}

/// The scene that axes vary if no scene is named. A `bench` without scenes and axes does not draw it.
pub const SHEET: &str = "sheet";

/// All scenes that have names, in the order in which they are drawn; [`SHEET`] is the last.
///
/// Each is a class of work where one design or the other could be expected to win. Depth is written
/// and everything is textured and lit, where the name does not say otherwise.
pub fn named() -> Vec<Named> {
    let of = |shape, count| Recipe::new(shape, Some(count));
    let layers = |order, blend| Recipe {
        area: Some(f32::INFINITY),
        depth: Some(32),
        order,
        blend,
        ..Recipe::new(Shape::Sheet, None)
    };
    let scene = |name, about, recipe| Named { name, about, recipe };
    vec![
        scene("large", "a hall of few large triangles", Recipe::new(Shape::Hall, None)),
        scene("medium-70k", "70 k triangles of a torus knot", of(Shape::Knot, 70_000)),
        scene("small-1m", "1 M triangles of a ball", of(Shape::Ball, 1_000_000)),
        scene("small-4m", "4 M triangles of a ball", of(Shape::Ball, 4_000_000)),
        scene("layers-near", "32 full-screen layers, front to back", layers(Order::Near, false)),
        scene("layers-far", "32 full-screen layers, back to front", layers(Order::Far, false)),
        scene("layers-blended", "32 full-screen layers, blended", layers(Order::Far, true)),
        scene(
            "objects",
            "400 balls behind one another, 307 k triangles, in any order",
            Recipe { draws: 400, materials: 8, ..of(Shape::Crowd, 307_200) },
        ),
        scene("slivers", "20 k needles, a pixel wide", of(Shape::Slivers, 20_000)),
        scene(
            "draws",
            "2000 small draws of 16 pipelines",
            Recipe { draws: 2000, pipelines: 16, materials: 16, ..of(Shape::Crowd, 160_000) },
        ),
        scene(
            "heavy-vertex",
            "128 waves in the vertex shader",
            Recipe { vertex_cost: 128, ..of(Shape::Ball, 250_000) },
        ),
        scene(
            "heavy-fragment",
            "64 lamps in the fragment shader",
            Recipe { fragment_cost: 64, ..of(Shape::Knot, 70_000) },
        ),
        scene(
            "textures",
            "64 materials of 8 textures each",
            Recipe { draws: 256, textures: 8, materials: 64, ..of(Shape::Crowd, 200_000) },
        ),
        scene(
            "varyings",
            "12 further varyings of four components",
            Recipe { varyings: 12, ..of(Shape::Knot, 70_000) },
        ),
        scene("foliage", "12 k blended leaves over a lawn", of(Shape::Leaves, 24_000)),
        scene(
            SHEET,
            "one layer of triangles of 32 pixels; --axis varies it unless scenes are named",
            Recipe::new(Shape::Sheet, None),
        ),
    ]
}

/// The scene called `name`.
pub fn find(name: &str) -> Option<Named> {
    named().into_iter().find(|scene| scene.name == name)
}

/// Depths and areas of the crossover: where compute and classic change places. A budget that does not
/// suffice leaves whole curves, and those of few layers first.
pub const CROSSOVER: [(Axis, &[&str]); 2] = [
    (Axis::Depth, &["1", "4", "16"]),
    (Axis::Area, &["full", "4096", "256", "64", "16", "4", "1", "0.25"]),
];
