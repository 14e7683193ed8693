//! Checks the targets of a pass.

use super::{Fault, TARGET_SIDE_PX};
use crate::{abi, grid::Grid, pass::Pass, target::ColorTarget};

/// Most colour targets.
const COLOR_TARGETS: usize = abi::MAX_COLORS as usize;

impl Pass {
    pub(super) fn check_targets(&self) -> Fault {
        let sides = 1..=TARGET_SIDE_PX;
        if !sides.contains(&self.extent.width) || !sides.contains(&self.extent.height) {
            return Err(format!("{} pixels; each side is 1 to {TARGET_SIDE_PX}", self.extent));
        }
        check_color_targets(self.colors.len())?;
        for (n, color) in self.colors.iter().enumerate() {
            color.check(self.extent).map_err(|fault| match self.colors.len() {
                1 => fault,
                _ => format!("colour target {n}: {fault}"),
            })?;
            let same = |other: &&ColorTarget| {
                let images = other.image.as_ref().zip(color.image.as_ref());
                images.is_some_and(|(a, b)| a.is(b)) && other.subresource() == color.subresource()
            };
            if let Some(image) = self.colors[..n].iter().find(same).and(color.image.as_ref()) {
                return Err(format!(
                    "colour target {n}: image `{}` is a target twice",
                    image.name()
                ));
            }
        }
        if !Grid::fits(self.extent.width, self.row_bytes(), self.samples) {
            return Err(format!(
                "{} columns of {} samples of {} bytes are more than one buffer has room for",
                self.extent.width,
                self.samples.count(),
                self.row_bytes()
            ));
        }
        self.depth.as_ref().map_or(Ok(()), |depth| depth.check(self.extent))?;
        let stencil = self.stencil.as_ref();
        stencil.map_or(Ok(()), |stencil| stencil.check(self.extent))
    }
}

/// Refuses more colour targets than there may be.
pub(crate) fn check_color_targets(targets: usize) -> Fault {
    match targets > COLOR_TARGETS {
        true => Err(format!("{targets} colour targets; there are at most {COLOR_TARGETS}")),
        false => Ok(()),
    }
}
