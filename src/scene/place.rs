//! From the hierarchy that loaders describe to draws, and to bounds that culling can walk.

use super::{
    anchor::{Anchor, power_of_two},
    bounds::Bounds,
    build::{Node, Part, Pipelines},
    material::Material,
    store::{Slice, Store},
};
use glam::{DMat3, DMat4, Vec4};
use std::ops::Range;

/// A node as culling walks it: subtrees are contiguous, so that skipping one is one assignment.
#[derive(Clone, Debug)]
pub(super) struct CullNode {
    /// Number of the first node after the subtree.
    pub end: usize,
    /// World bounds of the subtree.
    pub bounds: Bounds,
    /// Its own items.
    pub items: Range<usize>,
}

/// One draw of the scene.
#[derive(Clone, Debug)]
pub(super) struct Item {
    pub part: usize,
    pub pipeline: usize,
    /// From what the instance matrices give, or from the stored positions, to the world.
    pub model: DMat4,
    /// Whether `model` and the instance matrices together mirror.
    pub mirrored: bool,
    /// In the world, all instances together.
    pub bounds: Bounds,
    /// Instance rows and their number; `None` is a single identity.
    pub instances: Option<(Slice, u32)>,
}

/// What draws are made of.
pub(super) struct Placer<'a, 's> {
    pub nodes: &'a [Node],
    pub parts: &'a [Part],
    pub materials: &'a [Material],
    pub store: &'a mut Store,
    pub pipelines: &'a mut Pipelines<'s>,
}

impl Placer<'_, '_> {
    /// Resolves the hierarchy.
    pub fn place(mut self) -> Result<(Vec<CullNode>, Vec<Item>), String> {
        let (mut nodes, mut items) = (Vec::with_capacity(self.nodes.len()), Vec::new());
        let mut worlds: Vec<DMat4> = Vec::with_capacity(self.nodes.len());
        for (i, node) in self.nodes.iter().enumerate() {
            let world = node.parent.map_or(node.local, |p| worlds[p] * node.local);
            worlds.push(world);
            let first = items.len();
            self.node(node, &world, &mut items)?;
            // An object without a finite place is never drawn, and does not push the rest out of view.
            for item in items[first..].iter_mut().filter(|item| !item.bounds.is_placed()) {
                item.bounds = Bounds::EMPTY;
            }
            let bounds = union(items[first..].iter().map(|item| item.bounds));
            nodes.push(CullNode { end: i + 1, bounds, items: first..items.len() });
        }
        // Children come after their parents, so one sweep from the back sees each subtree whole.
        for i in (0..nodes.len()).rev() {
            if let Some(parent) = self.nodes[i].parent {
                let CullNode { end, bounds, .. } = nodes[i];
                let parent: &mut CullNode = &mut nodes[parent];
                parent.end = parent.end.max(end);
                parent.bounds = parent.bounds.union(bounds);
            }
        }
        Ok((nodes, items))
    }

    /// The draws of a node that `world` places.
    fn node(&mut self, node: &Node, world: &DMat4, items: &mut Vec<Item>) -> Result<(), String> {
        // The node says which side of a skin is its front, though joints alone place it.
        let flipped = mirrors(world);
        let world = if node.in_world { DMat4::IDENTITY } else { *world };
        let mirrored = mirrors(&world);
        let Some(instances) = &node.instances else {
            for &part in &node.parts {
                let bounds = self.parts[part].bounds.transformed(&world);
                let model = world * self.parts[part].anchor.matrix();
                let pipeline = self.pipeline(part, flipped);
                items.push(Item { part, pipeline, model, mirrored, bounds, instances: None });
            }
            return Ok(());
        };
        // Mirrored instances have their front on the other side: they are a draw of their own.
        let (turned, plain): (Vec<DMat4>, Vec<DMat4>) = instances.iter().partition(|m| mirrors(m));
        for (group, turned) in [(plain, false), (turned, true)] {
            if group.is_empty() {
                continue;
            }
            // Parts that need no anchors have the same rows.
            let mut shared = None;
            for &part in &node.parts {
                let Part { bounds, anchor, .. } = &self.parts[part];
                let within = union(group.iter().map(|m| bounds.transformed(m)));
                let around = Anchor::of(&within);
                let plain = *anchor == Anchor::default() && around == Anchor::default();
                let slice = match shared.filter(|_| plain) {
                    Some(slice) => slice,
                    None => self.store.push(&instance_rows(&group, anchor, &around))?,
                };
                if plain {
                    shared = Some(slice);
                }
                let bounds = union(group.iter().map(|m| bounds.transformed(&(world * *m))));
                let model = world * around.matrix();
                let instances = Some((slice, group.len() as u32));
                let (pipeline, mirrored) =
                    (self.pipeline(part, flipped != turned), mirrored != turned);
                items.push(Item { part, pipeline, model, mirrored, bounds, instances });
            }
        }
        Ok(())
    }

    /// The pipeline of a part whose front may be on the other side.
    fn pipeline(&mut self, part: usize, flipped: bool) -> usize {
        let drawn = &self.parts[part];
        self.pipelines.get(drawn, &self.materials[drawn.material], flipped)
    }
}

fn union(bounds: impl Iterator<Item = Bounds>) -> Bounds {
    bounds.fold(Bounds::EMPTY, Bounds::union)
}

/// The rows of instance matrices as the vertex shader reads them: from positions around `anchor` to
/// positions around `around`.
fn instance_rows(instances: &[DMat4], anchor: &Anchor, around: &Anchor) -> Vec<u8> {
    let to_around = around.matrix().inverse();
    let rows: Vec<[Vec4; 3]> = instances
        .iter()
        .map(|m| {
            let m = to_around * *m * anchor.matrix();
            [0, 1, 2].map(|row| m.row(row).as_vec4())
        })
        .collect();
    bytemuck::cast_slice(rows.as_flattened()).to_vec()
}

/// Whether `matrix` turns left hands into right ones, whatever its scale.
pub(super) fn mirrors(matrix: &DMat4) -> bool {
    direction_matrix(matrix).determinant() < 0.0
}

/// The linear part of `matrix` times a power of two that brings its largest component near 1: what
/// turns directions.
pub(super) fn direction_matrix(matrix: &DMat4) -> DMat3 {
    let linear = DMat3::from_mat4(*matrix);
    let largest = linear.to_cols_array().into_iter().fold(0.0, |l: f64, v| l.max(v.abs()));
    match largest > 0.0 && largest.is_finite() {
        true => linear * (1.0 / power_of_two(largest)),
        false => linear,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DQuat, DVec3};

    #[test]
    fn mirrors_are_seen_at_any_scale() {
        let turn = DMat4::from_quat(DQuat::from_rotation_x(0.7));
        for size in [1e-120, 1e-20, 1.0, 1e30, 1e120] {
            let scale = |x: f64| turn * DMat4::from_scale(DVec3::new(x, size, 2.0 * size));
            assert!(mirrors(&scale(-size)) && !mirrors(&scale(size)), "{size}");
            let largest = direction_matrix(&scale(size)).to_cols_array();
            let largest = largest.into_iter().fold(0.0, |l: f64, v| l.max(v.abs()));
            assert!((1.0..2.0).contains(&largest), "{largest}");
        }
        assert!(
            !mirrors(&DMat4::from_scale(DVec3::new(-1.0, 0.0, 1.0))),
            "flat ones do not mirror"
        );
    }
}
