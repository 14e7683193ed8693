//! Do the benchmark's scenes draw the same picture by both executors? Smaller ones of the same kind, so
//! that every shader, pipeline and order is among them.

use crate::common::gpu;
use std::collections::HashSet;
use tilewright::{
    Samples,
    bench::{self, Executors, Recipe},
    compare::Both,
    image::Extent,
};

/// A smaller scene of the same kind.
fn small(scene: bench::Named) -> Recipe {
    let mut recipe = scene.recipe;
    recipe.count = recipe.count.map(|count| count.min(4000));
    recipe.depth = recipe.depth.map(|depth| depth.min(6));
    recipe.draws = recipe.draws.min(40);
    recipe.pipelines = recipe.pipelines.min(2);
    recipe.materials = recipe.materials.min(3);
    recipe
}

#[test]
fn every_scene_is_the_same_picture_by_both() {
    let gpu = gpu();
    let mut executors = Executors::new(&gpu).unwrap();
    for scene in bench::named() {
        let name = scene.name;
        let pass = bench::pass(name, &small(scene), Extent::new(128, 128)).unwrap();
        let Executors { compute, classic } = &mut executors;
        let both = Both::draw(compute, classic, &pass, |_| {}).unwrap();
        assert!(both.same(), "{name}: {:?}", both.difference);
        // A scene that shows nothing would be the same too.
        let ids = tilewright::compare::ids(&both.compute.1.colors[0]).unwrap();
        let covered = ids.iter().filter(|id| **id != tilewright::compare::NO_PRIMITIVE).count();
        assert!(covered > 128 * 128 / 8, "{name}: {covered} pixels");
    }
}

/// Each target has a picture of its own, and samples smooth the edges in all of them.
#[test]
fn scenes_of_several_samples_and_targets_are_the_same_pictures_by_both() {
    let gpu = gpu();
    let mut executors = Executors::new(&gpu).unwrap();
    let scenes = bench::named().into_iter().step_by(2);
    for (targets, scene) in (1..=8).zip(scenes) {
        let name = scene.name;
        let recipe = Recipe { targets, ..small(scene) };
        let Executors { compute, classic } = &mut executors;
        let mut draw = |samples| {
            let recipe = Recipe { samples, ..recipe.clone() };
            let pass = bench::pass(name, &recipe, Extent::new(128, 128)).unwrap();
            let both = Both::draw(compute, classic, &pass, |_| {}).unwrap();
            let found = both.difference;
            assert!(both.same(), "{name}, {samples:?}, {targets} targets: {found:?}");
            both.compute.0.colors
        };
        let (one, four) = (draw(Samples::One), draw(Samples::Four));
        let pictures: HashSet<_> = one.iter().chain(&four).map(|color| &color.bytes).collect();
        // A layer that covers everything has no edge inside.
        let ways = if recipe.area == Some(f32::INFINITY) { 1 } else { 2 };
        assert_eq!(pictures.len(), ways * targets as usize, "{name}");
    }
}
