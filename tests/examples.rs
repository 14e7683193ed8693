//! Do the examples draw what they say?

use crate::common::{gpu, on_each_gpu};
use tilewright::{image::Extent, vk::Gpu};

#[allow(dead_code)]
#[path = "../examples/culling.rs"]
mod culling;
#[allow(dead_code)]
#[path = "../examples/gbuffer.rs"]
mod gbuffer;
#[allow(dead_code)]
#[path = "../examples/particles.rs"]
mod particles;
#[allow(dead_code)]
#[path = "../examples/shadow.rs"]
mod shadow;
#[allow(dead_code)]
#[path = "../examples/turntable.rs"]
mod turntable;

#[test]
fn the_turntable_turns() {
    on_each_gpu("the turntable turns", |gpu| {
        let extent = Extent::new(160, 120);
        let [one, some] = [1, 40].map(|frames| turntable::turn(gpu, extent, frames).unwrap());
        let background = one.texel(2, 2).to_vec();
        for picture in [&one, &some] {
            let covered = picture.bytes.chunks(4).filter(|texel| *texel != background).count();
            let share = covered as f64 / extent.pixels() as f64;
            assert!((0.15..0.4).contains(&share), "the cube covers {share} of the picture");
            let blue = picture.bytes.chunks(4).filter(|t| t[2] > t[0].saturating_add(40)).count();
            let sand = picture.bytes.chunks(4).filter(|t| t[0] > 200).count();
            assert!(blue > 500 && sand > 500, "{blue} blue and {sand} sandy pixels");
        }
        assert!(one != some);
    });
}

/// The number of pixels of the floor in the light and in shadow.
fn floor(gpu: &Gpu) -> (usize, usize) {
    let picture = shadow::draw(gpu, Extent::new(320, 200)).unwrap();
    let grey = |t: &&[u8]| t.iter().take(3).all(|c| c.abs_diff(t[1]) < 12);
    let floor: Vec<_> = picture.bytes.chunks(4).filter(grey).collect();
    let lit = floor.iter().filter(|texel| texel[1] > 170).count();
    let shadowed = floor.iter().filter(|texel| (60..110).contains(&texel[1])).count();
    (lit, shadowed)
}

#[test]
fn boxes_throw_shadows() {
    let (lit, shadowed) = floor(&gpu());
    assert!(lit > 10_000, "{lit} pixels of the floor are lit");
    assert!((1500..6000).contains(&shadowed), "{shadowed} pixels of the floor are in shadow");
}

/// The picture is that of the whole field, which has many stones out of sight.
#[test]
fn culled_stones_are_out_of_sight() {
    on_each_gpu("culled stones are out of sight", |gpu| {
        let [some, all] =
            [true, false].map(|culls| culling::draw(gpu, Extent::new(160, 100), culls).unwrap());
        assert_eq!(all.1, 10_000);
        assert!((500..3000).contains(&some.1), "{} stones are drawn", some.1);
        assert!(some.0 == all.0, "the pictures are equal");
        // Stones are grey, the ground is green, the sky is blue.
        let grey = |t: &&[u8]| t[1].abs_diff(t[0]) < 20 && t[1] > t[2] && t[1] - t[2] < 30;
        let shown = some.0.bytes.chunks(4).filter(grey).count();
        assert!((600..8000).contains(&shown), "stones cover {shown} pixels");
    });
}

/// No pixel of a surface is lost between the two passes.
#[test]
fn the_gbuffer_has_no_holes() {
    on_each_gpu("the G-buffer has no holes", |gpu| {
        let extent = Extent::new(400, 250);
        let picture = gbuffer::draw(gpu, extent).unwrap();
        let background = picture.texel(2, 2).to_vec();
        let is_lit = |x: u32, y: u32| picture.texel(x, y) != background;
        let all = || (3..250).flat_map(|y| (3..397).map(move |x| (x, y)));
        let lit = all().filter(|&(x, y)| is_lit(x, y)).count();
        assert!((20_000..35_000).contains(&lit), "{lit} pixels are lit");
        let between =
            |x, y| !is_lit(x, y) && (is_lit(x - 1, y) || is_lit(x - 2, y)) && is_lit(x + 1, y);
        let holes = all().filter(|&(x, y)| between(x, y)).count();
        assert!(holes < 10, "{holes} holes");
    });
}

#[test]
fn a_fountain_has_water_in_the_air() {
    on_each_gpu("a fountain has water in the air", |gpu| {
        let extent = Extent::new(160, 120);
        let (picture, shown) = particles::fountain(gpu, extent, 5).unwrap();
        assert!((8000..20_000).contains(&shown), "{shown} particles are in the air");
        let lit = |x: u32, y: u32| picture.texel(x, y)[2] > 60;
        let count = |rows: std::ops::Range<u32>| {
            rows.flat_map(|y| (0..160).map(move |x| (x, y))).filter(|&(x, y)| lit(x, y)).count()
        };
        assert!(count(60..110) > 500, "{} pixels of water", count(60..110));
        assert_eq!(count(116..120), 0, "nothing is below the ground");
        assert!(!lit(2, 60) && !lit(157, 60), "nothing is beside the fountain");
    });
}
