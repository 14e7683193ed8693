//! How much two drawings may differ before they count as different.

use super::Difference;

/// The most of each figure that still counts as the same picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// The limit of [`Difference::coverage_differing`].
    pub coverage_differing: u64,
    /// The limit of [`Difference::winner_differing`].
    pub winner_differing: u64,
    /// The limit of [`Difference::colour_over_1`].
    pub colour_over_1: u64,
    /// The limit of [`Difference::depth_max`].
    pub depth_max: f32,
}

impl Limits {
    /// The limits for a picture of `pixels` pixels; `crosses` says whether triangles cross the
    /// border of the viewport.
    ///
    /// Coverage inside the viewport is exact by the Vulkan specification: fixed-point positions,
    /// and a top-left rule without freedom. A clipped triangle has new vertices, whose rounding is
    /// the implementation's, so a few pixels along its edges may change sides: 20 in 2 million.
    /// Where depths of two triangles meet, interpolation decides, in which the specification leaves
    /// the last bits free: 30 in 2 million. Counts are rounded down, but never to nothing: a
    /// freedom per picture does not vanish because the picture is small.
    pub fn new(pixels: u64, crosses: bool) -> Self {
        let per_2_million = |count: u64| (pixels * count / 2_000_000).max(1);
        Self {
            coverage_differing: if crosses { per_2_million(20) } else { 0 },
            winner_differing: per_2_million(30),
            colour_over_1: per_2_million(400),
            depth_max: if crosses { 1e-4 } else { 2e-5 },
        }
    }

    /// Whether `difference` is within all limits.
    pub fn allow(&self, difference: &Difference) -> bool {
        difference.coverage_differing <= self.coverage_differing
            && difference.winner_differing <= self.winner_differing
            && difference.colour_over_1 <= self.colour_over_1
            && difference.depth_max <= self.depth_max
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_hd_inside_and_across_the_border() {
        let pixels = 1920 * 1080;
        let inside = Limits::new(pixels, false);
        let across = Limits::new(pixels, true);
        assert_eq!((inside.coverage_differing, across.coverage_differing), (0, 20));
        assert_eq!((inside.winner_differing, across.winner_differing), (31, 31));
        assert_eq!(inside.colour_over_1, 414); // 0.02 %
        assert_eq!((inside.depth_max, across.depth_max), (2e-5, 1e-4));
    }

    #[test]
    fn each_figure_can_fail() {
        let limits = Limits::new(2_000_000, true);
        let at = Difference {
            pixels: 2_000_000,
            coverage_differing: 20,
            winner_differing: 30,
            colour_over_1: 400,
            colour_max: 255,
            depth_max: 1e-4,
        };
        assert!(limits.allow(&at));
        for over in [
            Difference { coverage_differing: 21, ..at },
            Difference { winner_differing: 31, ..at },
            Difference { colour_over_1: 401, ..at },
            Difference { depth_max: 1.01e-4, ..at },
        ] {
            assert!(!limits.allow(&over), "{over:?}");
        }
    }

    #[test]
    fn small_pictures_keep_their_freedoms() {
        let limits = Limits::new(1, true);
        assert_eq!((limits.coverage_differing, limits.winner_differing), (1, 1));
        assert_eq!(Limits::new(1, false).coverage_differing, 0);
    }
}
