//! Does it hold for all inputs? Properties of rasterization over seeded random meshes.

use crate::{
    common::{self, on_each_gpu, random::Random},
    twin::{random_pass, shaders, varied::Variation},
};
use std::sync::Arc;
use tilewright::{
    compute,
    format::Format,
    grid::Capacities,
    image::Extent,
    pass::{BufferRange, BufferSource, Draw},
    shader::{Shader, Stage},
    state::{Blend, BlendEquation, BlendFactor, BlendOp, Compare, DepthState, Topology},
    target::{ColorTarget, DepthTarget},
};

/// Adds 1/255 to every channel of each pixel a fragment covers.
const COUNT: &str = "#version 450
layout(location = 0) out vec4 target;
void main() { target = vec4(1.0 / 255.0); }";

/// How often a mesh of triangles in clip space covers each pixel.
fn coverage(
    renderer: &mut compute::Renderer,
    extent: Extent,
    shaders: &(Arc<Shader>, Arc<Shader>),
    positions: &[[f32; 4]],
) -> Vec<u8> {
    let mut pass = random_pass(0, shaders);
    let add = BlendEquation { src: BlendFactor::One, dst: BlendFactor::One, op: BlendOp::Add };
    let pipeline = (*pass.pipelines[0])
        .clone()
        .topology(Default::default())
        .cull(Default::default())
        .depth(DepthState::OFF)
        .blend(Blend { color: add, alpha: add });
    let bytes = bytemuck::cast_slice(positions).to_vec();
    let buffer = Arc::new(BufferSource::new("mesh", bytes));
    let mut draw = Draw::new(0, positions.len() as u32);
    draw.vertex_buffers = vec![BufferRange::whole(&buffer)];
    pass = pass
        .extent(extent)
        .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
        .depth(None)
        .pipelines([pipeline])
        .draws([draw]);
    let frame = renderer.render(&pass).expect("it is drawn");
    frame.colors[0].bytes.chunks(4).map(|pixel| pixel[0]).collect()
}

fn counting_shaders() -> (Arc<Shader>, Arc<Shader>) {
    let count = Shader::from_glsl(Stage::Fragment, "count.frag", COUNT).expect("a valid shader");
    (shaders().0, Arc::new(count))
}

/// A grid of `n` x `n` cells over more than the screen with jittered inner corners, in perspective:
/// each cell two triangles, cut along either diagonal. The jitter is small enough that every cell
/// stays convex, so that nothing folds over.
fn jittered_grid(random: &mut Random, n: usize, reach: f32, behind: bool) -> Vec<[f32; 4]> {
    let corner: Vec<[f32; 4]> = (0..=n)
        .flat_map(|j| (0..=n).map(move |i| (i, j)))
        .map(|(i, j)| {
            let jitter = 0.2 * 2.0 * reach / n as f32;
            let x = (i as f32 / n as f32 * 2.0 - 1.0) * reach + random.signed() * jitter;
            let y = (j as f32 / n as f32 * 2.0 - 1.0) * reach + random.signed() * jitter;
            let w = 0.5 + random.unit();
            // A floor that reaches behind the eye crosses the near plane and w = 0.
            if behind { [x, 0.4, y * 0.5, y] } else { [x * w, y * w, 0.5 * w, w] }
        })
        .collect();
    let mut triangles = Vec::new();
    for j in 0..n {
        for i in 0..n {
            let at = |di: usize, dj: usize| corner[(j + dj) * (n + 1) + i + di];
            let (a, b, c, d) = (at(0, 0), at(1, 0), at(1, 1), at(0, 1));
            let cut = match random.below(2) {
                0 => [a, b, c, a, c, d],
                _ => [a, b, d, b, c, d],
            };
            triangles.extend(cut);
        }
    }
    triangles
}

#[test]
fn triangles_of_an_edge_leave_no_gap_and_share_no_pixel() {
    on_each_gpu("shared edges", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        let shaders = counting_shaders();
        for seed in 0..40 {
            let mut random = Random::new(seed);
            let n = 1 + random.below(30);
            // Up to a thousand times the screen, so that sides of the volume clip.
            let reach = [1.3, 2.0, 40.0, 1000.0][random.below(4)];
            let mesh = jittered_grid(&mut random, n, reach, false);
            let extent = Extent::new(1 + random.below(120) as u32, 1 + random.below(120) as u32);
            let counts = coverage(&mut renderer, extent, &shaders, &mesh);
            // The jitter of the outermost corners may leave the border open, not the inside.
            let open = counts.iter().filter(|&&c| c != 1).count();
            let doubled = counts.iter().filter(|&&c| c > 1).count();
            assert_eq!(doubled, 0, "seed {seed}: pixels covered twice");
            let inside = reach > 1.5;
            assert!(!inside || open == 0, "seed {seed}: {open} pixels not covered");
        }
    });
}

#[test]
fn a_floor_through_the_near_plane_has_no_gap() {
    on_each_gpu("near plane", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        let shaders = counting_shaders();
        for seed in 0..20 {
            let mut random = Random::new(100 + seed);
            let n = 2 + random.below(12);
            let mesh = jittered_grid(&mut random, n, 30.0, true);
            let extent = Extent::new(97, 61);
            let counts = coverage(&mut renderer, extent, &shaders, &mesh);
            let worst = counts.iter().max().copied().unwrap_or(0);
            assert!(worst <= 1, "seed {seed}: a pixel is covered {worst} times");
            // Each column is covered from one row down without a hole.
            for x in 0..97 {
                let column: Vec<u8> = (0..61).map(|y| counts[y * 97 + x]).collect();
                let changes = column.windows(2).filter(|w| w[0] != w[1]).count();
                assert!(changes <= 2, "seed {seed}: column {x} has a gap: {column:?}");
            }
        }
    });
}

#[test]
fn a_shift_by_whole_pixels_moves_the_picture() {
    let gpu = common::gpu();
    let mut renderer = compute::Renderer::new(&gpu).expect("kernels are made");
    let shaders = counting_shaders();
    let extent = Extent::new(128, 128);
    for seed in 0..40 {
        let mut random = Random::new(200 + seed);
        // Corners on 1/256 pixel and a power-of-two target: the shift is exact in floats.
        let mut mesh: Vec<[f32; 4]> = Vec::new();
        for _ in 0..60 {
            let coordinate =
                |random: &mut Random| random.below(100 * 256) as f32 / (64.0 * 256.0) - 1.0;
            mesh.push([coordinate(&mut random), coordinate(&mut random), 0.5, 1.0]);
        }
        let (dx, dy) = (random.below(28), random.below(28));
        let moved: Vec<[f32; 4]> = (mesh.iter())
            .map(|p| [p[0] + dx as f32 / 64.0, p[1] + dy as f32 / 64.0, p[2], p[3]])
            .collect();
        let before = coverage(&mut renderer, extent, &shaders, &mesh);
        let after = coverage(&mut renderer, extent, &shaders, &moved);
        for y in 0..128 - dy {
            for x in 0..128 - dx {
                let (a, b) = (before[y * 128 + x], after[(y + dy) * 128 + x + dx]);
                assert_eq!(a, b, "seed {seed}, shift ({dx}, {dy}), pixel ({x}, {y})");
            }
        }
    }
}

#[test]
fn the_picture_does_not_depend_on_the_batch_size() {
    on_each_gpu("batch size", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        let shaders = shaders();
        for seed in 2000..2024 {
            let variation = Variation::ALL[seed as usize % 4];
            let (_, snapshot) = variation.apply(&mut renderer, seed, random_pass(seed, &shaders));
            let mut frames = [16, 100, 1 << 17].map(|primitives| {
                renderer.set_batch_limit(Capacities {
                    primitives,
                    vertices: 4 * primitives,
                    varying_words: 1 << 20,
                });
                // What it draws over is made anew each time.
                let (pass, _) = variation.apply(&mut renderer, seed, random_pass(seed, &shaders));
                renderer.render(&pass).expect("it is drawn")
            });
            let expected = renderer.render(&snapshot).expect("it is drawn");
            for frame in &mut frames {
                let what = format!("{}, seed {seed}, {variation:?}", gpu.info());
                assert!(frame.colors == expected.colors, "{what}: colours");
                assert!(frame.depth == expected.depth, "{what}: depths");
            }
        }
    });
}

/// Blended draws that write depth may move it away from the eye. Opaque draws after them, in the same batch or
/// another, have to be tested against the new depth and not against the bins' earlier bounds.
#[test]
fn opaque_draws_see_the_depth_of_blended_ones_before_them() {
    on_each_gpu("depth across batches", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        let base = random_pass(0, &shaders());
        let extent = Extent::new(70, 50);
        let pipeline = |compare, blend| {
            (*base.pipelines[0])
                .clone()
                .topology(Topology::TriangleStrip)
                .cull(Default::default())
                .depth(DepthState::new(compare))
                .blend(blend)
        };
        let (opaque, blended) = (0, 1);
        let pipelines = vec![
            Arc::new(pipeline(Compare::Less, None)),
            Arc::new(pipeline(Compare::Always, Some(Blend::ALPHA))),
        ];
        // Layers in order: how they are drawn, at which depth, from which x to which y of clip space.
        let layers = [
            (opaque, 0.5, -1.0, 1.0),
            (blended, 0.875, -1.0, 1.0),
            (opaque, 0.75, 0.0, 1.0),
            (blended, 0.25, -1.0, 1.0),
            (opaque, 0.375, 0.0, 1.0),
            (opaque, 0.125, -1.0, 0.0),
        ];
        let draw = |(pipeline, z, left, bottom): (usize, f32, f32, f32)| {
            let corners = [[left, -1.0], [1.0, -1.0], [left, bottom], [1.0, bottom]];
            let corners = corners.map(|[x, y]| [x, y, z, 1.0f32]);
            let bytes = bytemuck::cast_slice(&corners).to_vec();
            let mut draw = Draw::new(pipeline, 4);
            draw.vertex_buffers =
                vec![BufferRange::whole(&Arc::new(BufferSource::new("layer", bytes)))];
            draw
        };
        let draws: Vec<Draw> = layers.map(draw).to_vec();
        // Depths after each layer: top left, top right, bottom left, bottom right.
        let expected = [
            [0.5; 4],
            [0.875; 4],
            [0.875, 0.75, 0.875, 0.75],
            [0.25; 4],
            [0.25; 4],
            [0.125, 0.125, 0.25, 0.25],
        ];
        for primitives in [2, 4, 6, 1 << 17] {
            renderer.set_batch_limit(Capacities {
                primitives,
                vertices: 3 * primitives,
                varying_words: 1 << 20,
            });
            for (drawn, expected) in expected.iter().enumerate() {
                let pass = base
                    .clone()
                    .extent(extent)
                    .depth(DepthTarget::cleared(1.0))
                    .pipelines(pipelines.clone())
                    .draws(draws[..=drawn].to_vec());
                let frame = renderer.render(&pass).expect("it is drawn");
                let depths = frame.depth.expect("a depth target").depths();
                for (i, depth) in depths.iter().enumerate() {
                    let (right, bottom) = (i % 70 >= 35, i / 70 >= 25);
                    let wanted = expected[2 * usize::from(bottom) + usize::from(right)];
                    assert_eq!(
                        *depth,
                        wanted,
                        "pixel ({}, {}) after layer {drawn} by {primitives} primitives",
                        i % 70,
                        i / 70
                    );
                }
            }
        }
    });
}

/// A bin that one triangle covers is shaded without asking its pixels, by the fragment kernel of that triangle
/// and no other; bins where several show something belong to several. Rectangles of three shaders, each
/// pixel's winner known.
#[test]
fn bins_are_shaded_by_the_shaders_of_what_they_show() {
    let colors = [[255, 0, 0, 255], [0, 255, 0, 255], [0, 0, 255, 255]];
    let fragment = |[r, g, b, a]: [u8; 4]| {
        let source = format!(
            "#version 450
            layout(location = 0) out vec4 target;
            void main() {{ target = vec4({r}, {g}, {b}, {a}) / 255.0; }}"
        );
        Arc::new(Shader::from_glsl(Stage::Fragment, "flat.frag", &source).expect("a valid shader"))
    };
    let fragments = colors.map(fragment);
    let base = random_pass(0, &shaders());
    on_each_gpu("covered bins", |gpu| {
        let mut renderer = compute::Renderer::new(gpu).expect("kernels are made");
        for seed in 3000..3012 {
            let mut random = Random::new(seed);
            let (compare, clear) = [(Compare::Less, 1.0), (Compare::Greater, 0.0)][random.below(2)];
            let (width, height) = (64 + random.below(60), 64 + random.below(60));
            let pipeline = |fragment: &Arc<Shader>| {
                let pipeline = (*base.pipelines[0]).clone().fragment(fragment.clone());
                let pipeline = pipeline.topology(Topology::TriangleStrip);
                Arc::new(pipeline.depth(DepthState::new(compare)))
            };
            let mut expected = vec![([0; 4], clear); width * height];
            let mut draws = Vec::new();
            for layer in 0..10 {
                // Every other one covers everything.
                let whole = layer % 2 == 0;
                let mut span = |size: usize| {
                    let first = if whole { 0 } else { random.below(size) };
                    (first, if whole { size } else { first + 1 + random.below(size - first) })
                };
                let ((left, right), (top, bottom)) = (span(width), span(height));
                let (kernel, z) = (random.below(3), (1 + random.below(255)) as f32 / 256.0);
                for y in top..bottom {
                    for x in left..right {
                        let (color, depth) = &mut expected[y * width + x];
                        if if compare == Compare::Less { z < *depth } else { z > *depth } {
                            (*color, *depth) = (colors[kernel], z);
                        }
                    }
                }
                let clip = |at: usize, size: usize| at as f32 / size as f32 * 2.0 - 1.0;
                let corners = [(left, top), (right, top), (left, bottom), (right, bottom)];
                let corners = corners.map(|(x, y)| [clip(x, width), clip(y, height), z, 1.0]);
                let bytes = bytemuck::cast_slice(&corners).to_vec();
                let mut draw = Draw::new(kernel, 4);
                draw.vertex_buffers =
                    vec![BufferRange::whole(&Arc::new(BufferSource::new("layer", bytes)))];
                draws.push(draw);
            }
            let pass = base
                .clone()
                .extent(Extent::new(width as u32, height as u32))
                .colors([ColorTarget::cleared(Format::Rgba8Unorm, [0.0; 4])])
                .depth(DepthTarget::cleared(clear))
                .pipelines(fragments.iter().map(pipeline))
                .draws(draws);
            for primitives in [2, 7, 1 << 17] {
                renderer.set_batch_limit(Capacities {
                    primitives,
                    vertices: 4 * primitives,
                    varying_words: 1 << 20,
                });
                let mut prepared = renderer.prepare(&pass).expect("a valid pass");
                for execution in 0..2 {
                    prepared.execute().expect("it is drawn");
                    let frame = prepared.read().expect("it was drawn");
                    let depths = frame.depth.expect("a depth target").depths();
                    for (i, (color, depth)) in expected.iter().enumerate() {
                        let (x, y) = (i % width, i / width);
                        let found = (&frame.colors[0].bytes[4 * i..][..4], depths[i]);
                        assert_eq!(
                            found,
                            (&color[..], *depth),
                            "seed {seed}, batches of {primitives}, execution {execution}, ({x}, {y})"
                        );
                    }
                }
            }
        }
    });
}
