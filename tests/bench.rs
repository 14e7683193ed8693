//! Do the benchmark's scenes draw the same picture by both executors? Smaller ones of the same kind, so
//! that every shader, pipeline and order is among them.

use crate::common::gpu;
use std::collections::HashSet;
use tilewright::{
    Samples,
    bench::{self, Executors, Lines, Recipe, Stencil},
    compare::Both,
    image::Extent,
    reference,
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

/// The picture of all is the same, and stencil values are compared with it.
#[test]
fn scenes_with_stencil_tests_are_the_same_pictures_by_both() {
    let gpu = gpu();
    let Executors { mut compute, mut classic } = Executors::new(&gpu).unwrap();
    for scene in bench::named() {
        let name = scene.name;
        let mut draw = |stencil| {
            let recipe = Recipe { stencil, ..small(scene.clone()) };
            let pass = bench::pass(name, &recipe, Extent::new(128, 128)).unwrap();
            let both = Both::draw(&mut compute, &mut classic, &pass, |_| {}).unwrap();
            assert!(both.same(), "{name}, {stencil:?}: {:?}", both.difference);
            let frame = both.compute.0;
            let values = frame.stencil.map(|values| HashSet::<u8>::from_iter(values.bytes));
            (frame.colors, values, pass.draws.len())
        };
        let [none, test, write, order] = Stencil::ALL.map(|(stencil, _)| draw(stencil));
        assert!([&test, &write, &order].iter().all(|frame| frame.0 == none.0), "{name}");
        assert_eq!((none.1, test.1), (None, Some(HashSet::from([0]))), "{name}");
        let (numbers, counted) = (write.1.unwrap(), order.1.unwrap());
        assert!(numbers.iter().all(|number| usize::from(*number) < write.2), "{name}");
        assert!(counted.iter().any(|count| *count > 0), "{name}");
    }
}

/// Lines of `large` reach behind the eye, where lavapipe drops some and cuts others in its own way: they are compared with the
/// reference.
#[test]
fn scenes_drawn_as_lines_are_the_same_pictures_by_both() {
    let gpu = gpu();
    let Executors { mut compute, mut classic } = Executors::new(&gpu).unwrap();
    for scene in bench::named() {
        let name = scene.name;
        let kinds = ["no", "1", "8", "bresenham-1", "bresenham-8"];
        let pictures = kinds.map(|kind| {
            let recipe = Recipe { lines: Lines::parse(kind).unwrap(), ..small(scene.clone()) };
            let pass = bench::pass(name, &recipe, Extent::new(128, 128)).unwrap();
            let both = Both::draw(&mut compute, &mut classic, &pass, |_| {}).unwrap();
            let is_same = match name == "large" && kind != "no" {
                true => {
                    let (_, trace) = compute.trace(&pass).unwrap();
                    reference::first_difference(&pass, &trace).is_none()
                }
                false => both.same(),
            };
            assert!(is_same, "{name}, lines={kind}: {:?}", both.difference);
            both.compute.0.colors[0].bytes.clone()
        });
        let different: HashSet<_> = pictures.iter().collect();
        assert_eq!(different.len(), kinds.len(), "{name}");
    }
}
