//! Do the benchmark's scenes draw the same picture by both executors? Smaller ones of the same kind, so
//! that every shader, pipeline and order is among them.

use crate::common::gpu;
use tilewright::{
    bench::{self, Executors},
    compare::Both,
    image::Extent,
};

#[test]
fn every_scene_is_the_same_picture_by_both() {
    let gpu = gpu();
    let mut executors = Executors::new(&gpu).unwrap();
    for scene in bench::named() {
        let mut recipe = scene.recipe;
        recipe.count = recipe.count.map(|count| count.min(4000));
        recipe.depth = recipe.depth.map(|depth| depth.min(6));
        recipe.draws = recipe.draws.min(40);
        recipe.pipelines = recipe.pipelines.min(2);
        recipe.materials = recipe.materials.min(3);
        let pass = bench::pass(scene.name, &recipe, Extent::new(128, 128)).unwrap();
        let Executors { compute, classic } = &mut executors;
        let both = Both::draw(compute, classic, &pass, |_| {}).unwrap();
        assert!(both.same(), "{}: {:?}", scene.name, both.difference);
        // A scene that shows nothing would be the same too.
        let ids = tilewright::compare::ids(&both.compute.1.colors[0]).unwrap();
        let covered = ids.iter().filter(|id| **id != tilewright::compare::NO_PRIMITIVE).count();
        assert!(covered > 128 * 128 / 8, "{}: {covered} pixels", scene.name);
    }
}
