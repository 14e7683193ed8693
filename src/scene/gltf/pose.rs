//! Where every node is at one moment: the rest pose, or the animations of a file at a time.

use super::data::{Checks, Data, get};
use glam::{DMat4, DQuat, DVec3};
use gltf_json::{
    animation::{Interpolation, Property, Sampler},
    validation::Checked,
};
use serde_json::Value;
use std::collections::HashSet;

/// A node's transform as the file gives it, in the double precision that JSON has.
#[derive(Clone, Copy, Debug)]
pub(super) enum Local {
    Matrix(DMat4),
    Parts(Placement),
}

/// A node's transform in parts.
#[derive(Clone, Copy, Debug)]
pub(super) struct Placement {
    translation: DVec3,
    rotation: DQuat,
    scale: DVec3,
}

/// The nodes of a file at one moment.
pub(super) struct Pose {
    /// To the parent, by node.
    pub locals: Vec<DMat4>,
    /// Weights of morph targets that an animation sets, by node.
    pub weights: Vec<Option<Vec<f32>>>,
}

impl Pose {
    /// The pose at `time` seconds, or at rest.
    ///
    /// Before the first key the first key holds, and after the last key the last one, as glTF demands. If there
    /// are several animations, an animation applies if no earlier one has the same targets. So a file that
    /// splits one movement over many animations plays as a whole, and a file with alternatives shows the first.
    pub fn new(data: &Data, locals: &[Local], time: Option<f64>) -> Checks<Self> {
        let mut pose = Self {
            locals: locals.iter().map(Local::matrix).collect(),
            weights: vec![None; locals.len()],
        };
        let Some(time) = time else { return Ok(pose) };
        let mut placements: Vec<Option<Placement>> = vec![None; locals.len()];
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
                let local = get(locals, node, "node")?;
                let sampler = get(&animation.samplers, channel.sampler.value(), "sampler")?;
                let named = |e| format!("animation {i}: {e}");
                let place = placements[node].get_or_insert_with(|| local.parts());
                let Checked::Valid(property) = channel.target.path else { continue };
                let value = Track::new(data, sampler, property).map_err(named)?.at(time);
                match property {
                    Property::Translation => place.translation = DVec3::from_slice(&value),
                    Property::Scale => place.scale = DVec3::from_slice(&value),
                    Property::Rotation => place.rotation = unit(DQuat::from_slice(&value)),
                    Property::MorphTargetWeights => {
                        pose.weights[node] = Some(value.iter().map(|&w| w as f32).collect());
                    }
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

impl Local {
    /// The transform of a node's JSON; a member that is no number counts as missing.
    pub fn of(node: &Value) -> Self {
        fn numbers<const N: usize>(node: &Value, name: &str) -> Option<[f64; N]> {
            let list: Option<Vec<f64>> =
                node.get(name)?.as_array()?.iter().map(Value::as_f64).collect();
            list?.try_into().ok()
        }
        if let Some(matrix) = numbers(node, "matrix") {
            return Local::Matrix(DMat4::from_cols_array(&matrix));
        }
        Local::Parts(Placement {
            translation: numbers(node, "translation").map_or(DVec3::ZERO, DVec3::from_array),
            rotation: numbers(node, "rotation").map_or(DQuat::IDENTITY, DQuat::from_array),
            scale: numbers(node, "scale").map_or(DVec3::ONE, DVec3::from_array),
        })
    }

    fn matrix(&self) -> DMat4 {
        match self {
            Local::Matrix(matrix) => *matrix,
            Local::Parts(parts) => parts.matrix(),
        }
    }

    fn parts(&self) -> Placement {
        match self {
            Local::Matrix(matrix) => Placement::of(matrix),
            Local::Parts(parts) => *parts,
        }
    }
}

impl Placement {
    fn of(matrix: &DMat4) -> Self {
        let (scale, rotation, translation) = matrix.to_scale_rotation_translation();
        Self { translation, rotation, scale }
    }

    fn matrix(&self) -> DMat4 {
        let rotation = unit(self.rotation);
        DMat4::from_scale_rotation_translation(self.scale, rotation, self.translation)
    }
}

/// `rotation` with a length of 1. Files round their quaternions; a length of 0 stands for no
/// rotation.
fn unit(rotation: DQuat) -> DQuat {
    if rotation.length() > 1e-6 { rotation.normalize() } else { DQuat::IDENTITY }
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
    fn at(&self, time: f64) -> Vec<f64> {
        // The middle part of a cubic key is its value.
        let own = usize::from(self.interpolation == Interpolation::CubicSpline);
        let wide = |values: &[f32]| values.iter().map(|&v| f64::from(v)).collect::<Vec<f64>>();
        let next = self.times.partition_point(|&t| f64::from(t) <= time);
        if next == 0 || next == self.times.len() {
            return wide(self.value(next.saturating_sub(1), own));
        }
        let key = next - 1;
        let (start, end) = (f64::from(self.times[key]), f64::from(self.times[next]));
        let span = end - start;
        let t = if span > 0.0 { (time - start) / span } else { 0.0 };
        let (a, b) = (wide(self.value(key, own)), wide(self.value(next, own)));
        let mixed = |f: &dyn Fn(usize) -> f64| (0..self.width).map(f).collect();
        match self.interpolation {
            Interpolation::Step => a,
            Interpolation::Linear if self.rotates => {
                let (a, b) = (unit(DQuat::from_slice(&a)), unit(DQuat::from_slice(&b)));
                a.slerp(b, t).to_array().to_vec()
            }
            Interpolation::Linear => mixed(&|i| a[i] + (b[i] - a[i]) * t),
            Interpolation::CubicSpline => {
                let (out, into) = (wide(self.value(key, 2)), wide(self.value(next, 0)));
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
        let (a, b) = (DQuat::IDENTITY, -DQuat::from_rotation_y(1.0));
        let values: Vec<f32> = [a, b, b].iter().flat_map(|q| q.as_quat().to_array()).collect();
        let half = track(Interpolation::Linear, &values, 4).at(1.5);
        assert!(DQuat::from_slice(&half).dot(DQuat::from_rotation_y(0.5)).abs() > 0.999_99);
    }
}
