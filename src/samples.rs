//! Samples of a pixel: how many there are, and where.

/// How many samples a pixel has. Coverage, depth and colour are kept for each of them. A fragment shader runs once for all
/// samples of a pixel that a primitive covers, unless it asks for more (`gl_SampleID`, `sample` inputs). Of a primitive that is
/// clipped at a side of its viewport, or by the near or the far plane, it runs twice in pixels on the line between two parts,
/// and sees in each of them the samples of that part alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Samples {
    /// One, in the centre.
    #[default]
    One = 1,
    /// Two.
    Two = 2,
    /// Four.
    Four = 4,
    /// Eight.
    Eight = 8,
    /// Sixteen.
    Sixteen = 16,
}

impl Samples {
    /// All of them.
    pub const ALL: [Self; 5] = [Self::One, Self::Two, Self::Four, Self::Eight, Self::Sixteen];

    /// So many samples, if pixels can have them.
    pub fn from_count(count: u32) -> Option<Self> {
        Self::ALL.into_iter().find(|samples| samples.count() == count)
    }

    /// How many.
    pub const fn count(self) -> u32 {
        self as u32
    }

    /// A bit for each sample.
    pub const fn mask(self) -> u32 {
        (1 << self.count()) - 1
    }

    /// Where each sample is, in 1/16 pixel from the left and the top of the pixel: Vulkan's standard sample locations
    /// (Vulkan 1.3, "Multisampling").
    pub const fn positions(self) -> &'static [[u8; 2]] {
        match self {
            Self::One => &[[8, 8]],
            Self::Two => &[[12, 12], [4, 4]],
            Self::Four => &[[6, 2], [14, 6], [2, 10], [10, 14]],
            Self::Eight => &[[9, 5], [7, 11], [13, 9], [5, 3], [3, 13], [1, 7], [11, 15], [15, 1]],
            Self::Sixteen => &[
                [9, 9],
                [7, 5],
                [5, 10],
                [12, 7],
                [3, 6],
                [10, 13],
                [13, 11],
                [11, 3],
                [6, 14],
                [8, 1],
                [4, 2],
                [2, 12],
                [0, 8],
                [15, 4],
                [14, 15],
                [1, 0],
            ],
        }
    }

    /// The positions as kernels have them: a byte each, the column in the low half.
    pub(crate) fn packed(self) -> [u32; 4] {
        let mut words = [0; 4];
        for (n, [x, y]) in self.positions().iter().enumerate() {
            words[n / 4] |= (u32::from(*x) | u32::from(*y) << 4) << (8 * (n % 4));
        }
        words
    }

    /// How far samples are from the centre of a pixel at most, in 1/256 pixel: to the left, and up.
    pub(crate) fn reach(self) -> i32 {
        let far = self.positions().iter().flatten().map(|place| (8 - i32::from(*place)).abs());
        16 * far.max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rule of the specification's table: each column and each row of sixteenths has at most one sample, and no place
    /// occurs twice.
    #[test]
    fn no_two_samples_share_a_column_or_a_row() {
        for samples in Samples::ALL {
            let positions = samples.positions();
            assert_eq!(positions.len(), samples.count() as usize);
            for axis in 0..2 {
                let mut places: Vec<u8> = positions.iter().map(|p| p[axis]).collect();
                places.sort_unstable();
                places.dedup();
                assert_eq!(places.len(), positions.len(), "{samples:?}, axis {axis}");
            }
            assert_eq!(Samples::from_count(samples.count()), Some(samples));
        }
        assert_eq!(Samples::from_count(3), None);
        assert_eq!((Samples::One.reach(), Samples::Four.reach()), (0, 96));
        assert_eq!(Samples::Sixteen.reach(), 128);
    }
}
