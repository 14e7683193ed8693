//! Where every node is at one moment: the rest pose, or the animations of a file at a time.

use super::data::{Checks, Data, get};
use glam::{Mat4, Quat, Vec3};
use gltf_json::{
    animation::{Interpolation, Property, Sampler},
    validation::Checked,
};
use std::collections::HashSet;

/// A node's transform in parts.
#[derive(Clone, Copy, Debug)]
struct Placement {
    translation: Vec3,
    rotation: Quat,
    scale: Vec3,
}

/// The nodes of a file at one moment.
pub(super) struct Pose {
    /// To the parent, by node.
    pub locals: Vec<Mat4>,
    /// Weights of morph targets that an animation sets, by node.
    pub weights: Vec<Option<Vec<f32>>>,
}

impl Pose {
    /// The pose at `time` seconds, or at rest.
    ///
    /// Times before the first and after the last key hold that key, as glTF demands. Of several
    /// animations each applies whose targets no earlier one has: files that split one movement
    /// over many animations play as a whole, files that hold alternatives show the first.
    pub fn new(data: &Data, time: Option<f32>) -> Checks<Self> {
        let nodes = &data.root.nodes;
        let local = |n: &gltf_json::Node| match n.matrix {
            Some(matrix) => Mat4::from_cols_array(&matrix),
            None => placement(n).matrix(),
        };
        let mut pose =
            Self { locals: nodes.iter().map(local).collect(), weights: vec![None; nodes.len()] };
        let Some(time) = time else { return Ok(pose) };
        let mut placements: Vec<Option<Placement>> = vec![None; nodes.len()];
        let mut taken: HashSet<(usize, u8)> = HashSet::new();
        for (i, animation) in data.root.animations.iter().enumerate() {
            let mut targets = Vec::new();
            for channel in &animation.channels {
                let Checked::Valid(property) = channel.target.path else {
                    return Err(format!("animation {i} has a channel of an unknown kind"));
                };
                targets.push((channel.target.node.value(), property as u8));
            }
            if targets.iter().any(|t| taken.contains(t)) {
                continue;
            }
            for (channel, &(node, _)) in animation.channels.iter().zip(&targets) {
                let described = get(nodes, node, "node")?;
                let sampler = get(&animation.samplers, channel.sampler.value(), "sampler")?;
                let named = |e| format!("animation {i}: {e}");
                let place = placements[node].get_or_insert_with(|| match described.matrix {
                    Some(matrix) => Placement::of(&Mat4::from_cols_array(&matrix)),
                    None => placement(described),
                });
                let Checked::Valid(property) = channel.target.path else { continue };
                let value = Track::new(data, sampler, property).map_err(named)?.at(time);
                match property {
                    Property::Translation => place.translation = Vec3::from_slice(&value),
                    Property::Scale => place.scale = Vec3::from_slice(&value),
                    Property::Rotation => {
                        place.rotation = Quat::from_slice(&value).normalize();
                    }
                    Property::MorphTargetWeights => pose.weights[node] = Some(value),
                }
            }
            taken.extend(targets);
        }
        for (local, place) in pose.locals.iter_mut().zip(placements) {
            if let Some(place) = place {
                *local = place.matrix();
            }
        }
        Ok(pose)
    }
}

fn placement(node: &gltf_json::Node) -> Placement {
    let rotation = node.rotation.map_or(Quat::IDENTITY, |r| Quat::from_array(r.0));
    Placement {
        translation: node.translation.map_or(Vec3::ZERO, Vec3::from_array),
        // Files round their quaternions; a length of 0 stands for no rotation.
        rotation: if rotation.length() > 1e-6 { rotation.normalize() } else { Quat::IDENTITY },
        scale: node.scale.map_or(Vec3::ONE, Vec3::from_array),
    }
}

impl Placement {
    fn of(matrix: &Mat4) -> Self {
        let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
        Self { translation, rotation, scale }
    }

    fn matrix(&self) -> Mat4 {
        Mat4::from_scale_rotation_translation(self.scale, self.rotation, self.translation)
    }
}

/// Keys of one channel.
struct Track {
    interpolation: Interpolation,
    rotates: bool,
    times: Vec<f32>,
    /// Per key one value, or in-tangent, value and out-tangent for cubic splines.
    values: Vec<f32>,
    /// Floats of one value.
    width: usize,
}

impl Track {
    fn new(data: &Data, sampler: &Sampler, property: Property) -> Checks<Self> {
        let Checked::Valid(interpolation) = sampler.interpolation else {
            return Err("a sampler has an unknown interpolation".into());
        };
        let times = data.accessor(sampler.input.value())?;
        let output = data.accessor(sampler.output.value())?;
        let (times, values) = (times.floats(), output.floats());
        let per_key = if interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        let keys = times.len() * per_key;
        let width = match property {
            Property::Translation | Property::Scale => 3,
            Property::Rotation => 4,
            Property::MorphTargetWeights => values.len() / keys.max(1),
        };
        if times.is_empty() || width == 0 || values.len() != keys * width {
            return Err(format!(
                "a sampler has {} keys of {width} values, but {} values",
                times.len(),
                values.len()
            ));
        }
        let rotates = property == Property::Rotation;
        Ok(Self { interpolation, rotates, times, values, width })
    }

    /// Part `part` of key `key`.
    fn value(&self, key: usize, part: usize) -> &[f32] {
        let parts = if self.interpolation == Interpolation::CubicSpline { 3 } else { 1 };
        &self.values[(key * parts + part) * self.width..][..self.width]
    }

    /// The value at `time`.
    fn at(&self, time: f32) -> Vec<f32> {
        // The middle part of a cubic key is its value.
        let own = usize::from(self.interpolation == Interpolation::CubicSpline);
        let next = self.times.partition_point(|&t| t <= time);
        if next == 0 || next == self.times.len() {
            return self.value(next.saturating_sub(1), own).to_vec();
        }
        let key = next - 1;
        let span = self.times[next] - self.times[key];
        let t = if span > 0.0 { (time - self.times[key]) / span } else { 0.0 };
        let (a, b) = (self.value(key, own), self.value(next, own));
        let mixed = |f: &dyn Fn(usize) -> f32| (0..self.width).map(f).collect();
        match self.interpolation {
            Interpolation::Step => a.to_vec(),
            Interpolation::Linear if self.rotates => {
                let (a, b) = (Quat::from_slice(a).normalize(), Quat::from_slice(b).normalize());
                a.slerp(b, t).to_array().to_vec()
            }
            Interpolation::Linear => mixed(&|i| a[i] + (b[i] - a[i]) * t),
            Interpolation::CubicSpline => {
                let (out, into) = (self.value(key, 2), self.value(next, 0));
                let (t2, t3) = (t * t, t * t * t);
                mixed(&|i| {
                    (2.0 * t3 - 3.0 * t2 + 1.0) * a[i]
                        + span * (t3 - 2.0 * t2 + t) * out[i]
                        + (3.0 * t2 - 2.0 * t3) * b[i]
                        + span * (t3 - t2) * into[i]
                })
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn track(interpolation: Interpolation, values: &[f32], width: usize) -> Track {
        let rotates = width == 4;
        let times = vec![1.0, 2.0, 4.0];
        Track { interpolation, rotates, times, values: values.to_vec(), width }
    }

    #[test]
    fn keys_hold_before_the_first_and_after_the_last() {
        for kind in [Interpolation::Linear, Interpolation::Step] {
            let t = track(kind, &[5.0, 7.0, 11.0], 1);
            assert_eq!((t.at(-1.0)[0], t.at(1.0)[0], t.at(99.0)[0]), (5.0, 5.0, 11.0));
            assert_eq!(t.at(2.0), [7.0]);
        }
    }

    #[test]
    fn each_interpolation_between_keys() {
        assert_eq!(track(Interpolation::Linear, &[5.0, 7.0, 11.0], 1).at(3.0), [9.0]);
        assert_eq!(track(Interpolation::Step, &[5.0, 7.0, 11.0], 1).at(3.0), [7.0]);
        // Slopes of a straight line make a cubic spline that line; slopes are per second.
        let line: Vec<f32> = [1.0f32, 2.0, 4.0].iter().flat_map(|t| [3.0, 3.0 * t, 3.0]).collect();
        let t = track(Interpolation::CubicSpline, &line, 1);
        for time in [1.0, 1.3, 2.0, 2.5, 3.7, 4.0] {
            assert!((t.at(time)[0] - 3.0 * time).abs() < 1e-5, "{time}");
        }
    }

    #[test]
    fn rotations_take_the_short_way_round() {
        let (a, b) = (Quat::IDENTITY, -Quat::from_rotation_y(1.0));
        let values: Vec<f32> = [a, b, b].iter().flat_map(|q| q.to_array()).collect();
        let half = track(Interpolation::Linear, &values, 4).at(1.5);
        assert!(Quat::from_slice(&half).dot(Quat::from_rotation_y(0.5)).abs() > 0.999_99);
    }
}
