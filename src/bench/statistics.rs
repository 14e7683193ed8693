//! Medians, their intervals and the verdict.
//!
//! Times of frames have no known distribution: they have a floor, a long tail, and on a shared machine
//! several humps. So nothing here assumes one. The middle is the median, and its interval is made of
//! order statistics: of `n` independent samples in ascending order, the median of what they come from
//! lies between the `k`-th smallest and the `k`-th largest with probability `1 - 2 P(B < k)`, `B`
//! binomial with `n` trials at one half. `k` is the largest for which that is at least 95 %. Five
//! samples or fewer have no such interval. A mean with its standard error was the alternative: one frame
//! that the system interrupted moves the mean by more than its standard error.

/// Relative difference below which two times count as the same, whatever their intervals.
pub const FLOOR: f64 = 0.02;

/// Fewest samples that have an interval.
pub const MIN_SAMPLES: usize = 6;

/// The median of `samples`, which this sorts; `None` if there are none.
pub fn median(samples: &mut [f64]) -> Option<f64> {
    samples.sort_by(f64::total_cmp);
    let n = samples.len();
    match n {
        0 => None,
        _ if n % 2 == 1 => Some(samples[n / 2]),
        _ => Some((samples[n / 2 - 1] + samples[n / 2]) / 2.0),
    }
}

/// The 95 % interval of the median of `samples`, which this sorts; `None` of fewer than [`MIN_SAMPLES`].
pub fn interval(samples: &mut [f64]) -> Option<[f64; 2]> {
    samples.sort_by(f64::total_cmp);
    let rank = rank(samples.len())?;
    Some([samples[rank - 1], samples[samples.len() - rank]])
}

/// The largest `k` with `P(B < k) <= 2.5 %`, `B` binomial with `n` trials at one half.
///
/// The probabilities are kept as logarithms: that of no success is 0 in 64 bits from 1075 trials on.
fn rank(n: usize) -> Option<usize> {
    let (mut ln_probability, mut below) = (n as f64 * 0.5f64.ln(), 0.0);
    let mut k = 0;
    while k < n {
        below += ln_probability.exp();
        if below > 0.025 {
            break;
        }
        ln_probability += ((n - k) as f64 / (k + 1) as f64).ln();
        k += 1;
    }
    (k > 0).then_some(k)
}

/// The result of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Compute takes less time: the whole interval of the ratio is above 1, and the ratio is above
    /// `1 +` [`FLOOR`].
    Faster,
    /// Compute takes more time: the whole interval is below 1, and the ratio is below `1 / (1 +
    /// FLOOR)`.
    Slower,
    /// The whole interval is between `1 / (1 + FLOOR)` and `1 + FLOOR`.
    Same,
    /// Anything else: more rounds or a quieter machine might decide it.
    Ambiguous,
    /// The machine was busy, so that the times prove nothing.
    Busy,
    /// The pictures differ, so that the times say nothing.
    Invalid,
}

impl Verdict {
    /// The verdict on a ratio (classic time / compute time) with its interval.
    pub fn new(ratio: f64, interval: Option<[f64; 2]>) -> Self {
        let (low, high) = (1.0 / (1.0 + FLOOR), 1.0 + FLOOR);
        match interval {
            Some([from, _]) if from > 1.0 && ratio > high => Verdict::Faster,
            Some([_, to]) if to < 1.0 && ratio < low => Verdict::Slower,
            Some([from, to]) if from >= low && to <= high => Verdict::Same,
            _ => Verdict::Ambiguous,
        }
    }

    /// As it is printed.
    pub const fn name(self) -> &'static str {
        match self {
            Verdict::Faster => "FASTER",
            Verdict::Slower => "SLOWER",
            Verdict::Same => "SAME",
            Verdict::Ambiguous => "AMBIGUOUS",
            Verdict::Busy => "BUSY",
            Verdict::Invalid => "INVALID",
        }
    }
}

/// Median and interval of times, in milliseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Summary {
    /// The median.
    pub median: f64,
    /// Its 95 % interval.
    pub interval: Option<[f64; 2]>,
}

impl Summary {
    /// Of `samples`; zero of none.
    pub fn new(samples: &[f64]) -> Self {
        let mut samples = samples.to_vec();
        Self { median: median(&mut samples).unwrap_or(0.0), interval: interval(&mut samples) }
    }
}

/// Classic time / compute time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ratio {
    /// The quotient of the medians.
    pub value: f64,
    /// The 95 % interval of the median over the rounds of one round's quotient, stretched to hold
    /// [`Ratio::value`]. The two frames of a round are neighbours in time, so a slow phase of the machine
    /// cancels out of their quotient. It does not cancel out of the quotient of two medians.
    pub interval: Option<[f64; 2]>,
}

impl Ratio {
    /// The ratio of rounds; each has the times (compute, classic).
    pub fn new(rounds: &[(f64, f64)]) -> Option<Self> {
        let mut compute: Vec<f64> = rounds.iter().map(|r| r.0).collect();
        let mut classic: Vec<f64> = rounds.iter().map(|r| r.1).collect();
        let mut quotients: Vec<f64> = rounds.iter().map(|r| r.1 / r.0).collect();
        let value = median(&mut classic)? / median(&mut compute)?;
        let interval = interval(&mut quotients).map(|[a, b]| [a.min(value), b.max(value)]);
        value.is_finite().then_some(Self { value, interval })
    }
}

/// The range of the middle half of `samples` / their median; 0 of none.
pub fn spread(samples: &[f64]) -> f64 {
    let mut sorted = samples.to_vec();
    let Some(middle) = median(&mut sorted).filter(|median| *median > 0.0) else { return 0.0 };
    let quarter = sorted.len() / 4;
    (sorted[sorted.len() - 1 - quarter] - sorted[quarter]) / middle
}

/// The geometric mean; `None` of none.
pub fn geometric_mean(ratios: impl IntoIterator<Item = f64>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0u32);
    for ratio in ratios {
        sum += ratio.ln();
        count += 1;
    }
    (count > 0).then(|| (sum / f64::from(count)).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_of_odd_even_and_no_samples() {
        assert_eq!(median(&mut [3.0, 1.0, 2.0]), Some(2.0));
        assert_eq!(median(&mut [4.0, 1.0, 2.0, 3.0]), Some(2.5));
        assert_eq!(median(&mut []), None);
    }

    #[test]
    fn ranks_are_those_of_the_published_table() {
        // Distribution-free 95 % intervals of the median, any table of nonparametric statistics.
        for (n, expected) in [
            (5, None),
            (6, Some(1)),
            (8, Some(1)),
            (9, Some(2)),
            (10, Some(2)),
            (12, Some(3)),
            (15, Some(4)),
            (20, Some(6)),
            (25, Some(8)),
            (30, Some(10)),
            (50, Some(18)),
            (100, Some(40)),
        ] {
            assert_eq!(rank(n), expected, "{n}");
        }
        assert!((0..MIN_SAMPLES).all(|n| rank(n).is_none()));
    }

    #[test]
    fn ranks_of_many_samples_are_known_too() {
        // Exact, by integers of any size.
        let exact = [
            (200, 86),
            (1000, 469),
            (1074, 505),
            (1075, 505),
            (1076, 506),
            (5000, 2431),
            (100_000, 49_690),
        ];
        for (n, expected) in exact {
            assert_eq!(rank(n), Some(expected), "{n}");
            let mut samples: Vec<f64> = (0..n).map(|i| i as f64).collect();
            let ends = [expected - 1, n - expected].map(|place| place as f64);
            assert_eq!(interval(&mut samples), Some(ends));
        }
    }

    #[test]
    fn one_wild_sample_moves_neither_median_nor_interval() {
        let mut calm: Vec<f64> = (0..20).map(|i| 10.0 + f64::from(i) * 0.01).collect();
        let (middle, sure) = (median(&mut calm), interval(&mut calm));
        calm[19] = 1e6;
        assert_eq!((median(&mut calm), interval(&mut calm)), (middle, sure));
    }

    #[test]
    fn the_interval_holds_the_median_that_often() {
        // Exponential samples by a linear congruence; their median is ln 2.
        let mut state = 1u64;
        let mut unit = || {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1_442_695_040_888_963_407);
            ((state >> 11) as f64 + 0.5) / (1u64 << 53) as f64
        };
        let tries = 2000;
        let holds = (0..tries)
            .filter(|_| {
                let mut samples: Vec<f64> = (0..15).map(|_| -unit().ln()).collect();
                let [from, to] = interval(&mut samples).unwrap();
                from <= 2f64.ln() && 2f64.ln() <= to
            })
            .count();
        // 96.5 % expected; far from both 95 % wrong and 100 % useless.
        assert!((1880..1980).contains(&holds), "{holds} of {tries}");
    }

    #[test]
    fn verdicts() {
        let of = |ratio, from, to| Verdict::new(ratio, Some([from, to]));
        assert_eq!(of(1.3, 1.1, 1.5), Verdict::Faster);
        assert_eq!(of(0.8, 0.7, 0.9), Verdict::Slower);
        assert_eq!(of(1.0, 0.99, 1.01), Verdict::Same);
        // Sure, but too little to matter; and the other way about.
        assert_eq!(of(1.01, 1.005, 1.015), Verdict::Same);
        assert_eq!(of(1.01, 1.005, 1.03), Verdict::Ambiguous);
        assert_eq!(of(1.3, 0.9, 1.6), Verdict::Ambiguous);
        assert_eq!(Verdict::new(5.0, None), Verdict::Ambiguous);
    }

    #[test]
    fn a_drift_that_both_share_leaves_the_ratio_sure() {
        let rounds: Vec<(f64, f64)> =
            (0..21).map(|i| 1.0 + f64::from(i) * 0.1).map(|slow| (slow, 1.5 * slow)).collect();
        let ratio = Ratio::new(&rounds).unwrap();
        assert!((ratio.value - 1.5).abs() < 1e-12);
        let [from, to] = ratio.interval.unwrap();
        assert!(to - from < 1e-9);
        let of_times = Summary::new(&rounds.iter().map(|r| r.0).collect::<Vec<_>>());
        assert!(of_times.interval.unwrap()[1] > 1.2 * of_times.interval.unwrap()[0]);
    }

    #[test]
    fn the_spread_is_that_of_the_middle_half() {
        assert_eq!(spread(&[]), 0.0);
        assert_eq!(spread(&[5.0]), 0.0);
        // One wild sample in eight does not count; half of them do.
        assert_eq!(spread(&[2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 2.0, 99.0]), 0.0);
        assert_eq!(spread(&[1.0, 3.0, 1.0, 3.0, 2.0]), 1.0);
    }

    #[test]
    fn the_mean_of_ratios_is_geometric() {
        assert_eq!(geometric_mean([]), None);
        let mean = geometric_mean([0.5, 2.0]).unwrap();
        assert!((mean - 1.0).abs() < 1e-12);
    }
}
