//! A [`Pass`] of a scene for a camera: culling, order, draws.

use super::{
    Scene,
    anchor::power_of_two,
    bounds::{Bounds, Containment, Frustum},
    build::{COLOR, INSTANCE_BYTES, POSITION},
    camera::{Camera, Projection},
    place::Item,
    shading,
};
use crate::{
    Error, Result,
    format::Format,
    image::Extent,
    pass::{BindingSet, BufferRange, Draw, Indices, Pass},
    samples::Samples,
    target::{ColorTarget, DepthTarget},
};
use glam::{DMat4, DVec3};
use std::sync::Arc;

/// The options of a scene's pass, beyond its size and camera.
#[derive(Clone, Copy, Debug)]
pub struct PassOptions {
    /// Format of the colour target.
    pub format: Format,
    /// Colour behind everything, linear RGBA, not premultiplied; `None` is the scene's own, which is
    /// opaque. Over a translucent one the picture's colours come out premultiplied by its alpha, as
    /// blending makes them ([`Picture::unpremultiplied`](crate::image::Picture::unpremultiplied)).
    pub background: Option<[f32; 4]>,
    /// Whether draws outside the view are left out. Off only to measure and to test.
    pub cull: bool,
    /// Samples of a pixel of all targets: one, unless set.
    pub samples: Samples,
}

impl Default for PassOptions {
    fn default() -> Self {
        Self { format: Format::Rgba8Srgb, background: None, cull: true, samples: Samples::One }
    }
}

impl Scene {
    /// Records the scene as `camera` sees it.
    ///
    /// Opaque and masked draws come first, near ones before far ones, so that hidden fragments are
    /// known early; blended draws follow from back to front. Draws are ordered as wholes, by the
    /// distance of the middle of their bounds: what overlaps itself or another blended thing
    /// through and through is drawn as any forward renderer draws it.
    ///
    /// # Errors
    /// [`Error::Usage`] for an extent outside 1..=16384, and for a camera that is not finite.
    pub fn pass(&self, extent: Extent, camera: &Camera, options: &PassOptions) -> Result<Pass> {
        let sizes = 1..=16384;
        if !sizes.contains(&extent.width) || !sizes.contains(&extent.height) {
            return Err(Error::Usage(format!(
                "a picture of {extent} pixels was asked for; each side must be from 1 to 16384"
            )));
        }
        let matrix = camera.view_projection(extent);
        if !matrix.is_finite() {
            return Err(Error::Usage(format!(
                "the camera `{:.60}` shows nothing that is finite: {}",
                camera.name, camera.projection
            )));
        }
        let visible = match options.cull {
            true => self.visible(&Frustum::new(&matrix)),
            false => (0..self.items.len()).collect(),
        };
        let frame = shading::frame_set(camera, extent, &self.light);
        let to_clip = matrix * self.clip_unit(camera);
        let draws = self
            .in_order(visible, camera)
            .filter_map(|i| self.draw(&self.items[i], &to_clip, &frame));
        let own = || self.light.background.extend(1.0).to_array();
        let [r, g, b, a] = options.background.unwrap_or_else(own);
        Ok(Pass {
            label: self.name.clone(),
            extent,
            colors: vec![ColorTarget::cleared(options.format, [r * a, g * a, b * a, a])],
            depth: Some(DepthTarget::cleared(1.0)),
            stencil: None,
            samples: options.samples,
            draws: draws.collect(),
            pipelines: self.pipelines.clone(),
        })
    }

    /// A power of two that clip space is scaled by, which changes no picture: it brings the largest w
    /// that is seen near 1, whatever the unit of the scene is. Single precision ends at 1e38, and the
    /// stages multiply.
    fn clip_unit(&self, camera: &Camera) -> f64 {
        let Projection::Perspective { near, far, .. } = camera.projection else { return 1.0 };
        let depth = |corner| -camera.view.transform_point3(corner).z;
        let corners = self.bounds.corners().into_iter().filter(|_| !self.bounds.is_empty());
        let farthest = corners.map(depth).fold(near, f64::max);
        1.0 / power_of_two(farthest.min(far.unwrap_or(f64::INFINITY)))
    }

    /// The numbers of items that may be visible: a walk of the hierarchy that passes over subtrees
    /// outside the view and asks nothing more inside of subtrees that are visible as a whole.
    fn visible(&self, frustum: &Frustum) -> Vec<usize> {
        let (mut visible, mut i, mut inside_until) = (Vec::new(), 0, 0);
        while let Some(node) = self.nodes.get(i) {
            if i >= inside_until {
                match frustum.contains(&node.bounds) {
                    Containment::Outside => {
                        i = node.end;
                        continue;
                    }
                    Containment::Inside => inside_until = node.end,
                    Containment::Crossing => {}
                }
            }
            let may_show = |&item: &usize| {
                i < inside_until
                    || frustum.contains(&self.items[item].bounds) != Containment::Outside
            };
            visible.extend(node.items.clone().filter(may_show));
            i += 1;
        }
        visible
    }

    /// Opaque items from front to back, then blended ones from back to front.
    fn in_order(&self, items: Vec<usize>, camera: &Camera) -> impl Iterator<Item = usize> {
        let depth = |bounds: &Bounds| -camera.view.transform_point3(bounds.center()).z;
        let keyed = items.into_iter().map(|i| {
            let item = &self.items[i];
            (self.blended[self.parts[item.part].material], depth(&item.bounds), i)
        });
        let (mut blended, mut opaque): (Vec<_>, Vec<_>) = keyed.partition(|(b, _, _)| *b);
        opaque.sort_by(|a, b| a.1.total_cmp(&b.1));
        blended.sort_by(|a, b| b.1.total_cmp(&a.1));
        opaque.into_iter().chain(blended).map(|(_, _, i)| i)
    }

    /// The draw of `item`; `None` if it is so far beyond the view that single precision ends before.
    fn draw(&self, item: &Item, to_clip: &DMat4, frame: &Arc<BindingSet>) -> Option<Draw> {
        let part = &self.parts[item.part];
        let clip = (*to_clip * item.model).as_mat4();
        if !clip.is_finite() {
            return None;
        }
        let constant = |location: usize, bytes| -> BufferRange {
            self.constants.part(location * 16, bytes).range(&self.chunks)
        };
        let mut vertex_buffers: Vec<BufferRange> = part
            .streams
            .iter()
            .enumerate()
            .map(|(location, stream)| match stream {
                Some(stream) => stream.slice.range(&self.chunks),
                None => constant(location, 16),
            })
            .collect();
        vertex_buffers.push(match item.instances {
            Some((slice, _)) => slice.range(&self.chunks),
            None => constant(COLOR + 1, INSTANCE_BYTES),
        });
        debug_assert!(part.streams[POSITION].is_some());
        Some(Draw {
            sets: vec![frame.clone(), self.sets[part.material].clone()],
            push_constants: shading::push_constants(clip, &item.model, item.mirrored),
            vertex_buffers,
            indices: part
                .indices
                .map(|(slice, format)| Indices::new(slice.range(&self.chunks), format)),
            instances: item.instances.map_or(1, |(_, count)| count),
            ..Draw::new(item.pipeline, part.count)
        })
    }

    /// A camera at `eye` that looks at `target`, with near and far plane around this scene.
    pub fn camera_at(&self, eye: DVec3, target: DVec3, up: DVec3, yfov: f64) -> Camera {
        let mut camera = Camera::look_at(eye, target, up, yfov);
        camera.fit_depth(&self.bounds);
        camera
    }

    /// The scene's first camera, or one that shows all of it from the front and a little above.
    pub fn default_camera(&self, extent: Extent) -> Camera {
        let framing = || Camera::framing(&self.bounds, DVec3::new(0.45, 0.35, 1.0), 0.6, extent);
        self.cameras.first().cloned().unwrap_or_else(framing)
    }
}
