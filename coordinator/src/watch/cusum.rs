//! Whether innovations still look as they should: a cumulative sum to either side.
//!
//! `S+ = clamp(S+ + z - K, 0, 2 H)`, `S- = clamp(S- - z - K, 0, 2 H)` (Page, Biometrika 41, 1954),
//! where `z` is an innovation over its standard deviation: standard normal as long as the model
//! is right. A doubt is raised when a sum passes `H` and is over when both are back at 0. When it
//! began is when the sum last left 0, which is the most likely instant of the change.
//!
//! A cumulative sum and not a windowed chi-square, because a wrong model moves innovations to one
//! side for long: a window must be chosen for one size of error, while the sum waits as long as a
//! small one needs and speaks at once of a large one, and it says when that began.
//!
//! `K` = 1 is best against a shift of 2 sigma; less than 1 sigma is what a model's stated sigmas
//! allow for, and is never flagged. With `H` = 7 a right model is doubted once in
//! `(exp(2 K b) - 2 K b - 1) / (2 K^2)` blocks to each side, `b = H + 1.166` (Siegmund, Sequential
//! Analysis, Springer 1985): 6.2 million, so once in 3.1 million to either. In blocks of a minute that
//! is once in 2150 days of one watched thing, a false alarm rate of 0.0005 per day, as long as
//! innovations are independent. The delay is `H / (shift - K)` blocks: 8 at 2 sigma, 4 at 3 sigma. One
//! block counts for at most `Z_MAX` = 5 sigma, so that no single one raises a doubt: the least is 2.

use proto::Timestamp;

/// Part of every innovation that is no evidence, in sigma.
const K: f64 = 1.0;
/// Sum at which a doubt is raised, in sigma.
const H: f64 = 7.0;
/// Most that one innovation counts for, in sigma.
const Z_MAX: f64 = 5.0;
/// Innovations are told up to here: beyond it their size says nothing, in sigma.
pub(super) const TOLD_MAX: f64 = 99.9;

/// A doubt in a model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Raised {
    /// When the innovations began to lie to one side.
    pub(crate) since: Timestamp,
    /// Their mean since then, in sigma.
    pub(crate) z: f64,
}

/// What an innovation changed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Change {
    /// The model is doubted from now on.
    Raised,
    /// The doubt is over.
    Cleared,
    /// What was doubted is no longer there.
    Gone,
}

/// Share of the power of what raised a doubt from which on a block can speak against it: an empty station says nothing of its chargers.
const ALIKE: f64 = 0.5;

/// The sum to one side.
#[derive(Debug, Clone, Copy, Default)]
struct Side {
    sum: f64,
    /// Highest level of a block that was evidence since it left 0.
    level: f64,
    since: Timestamp,
    z_sum: f64,
    blocks: f64,
}

impl Side {
    fn add(&mut self, begin: Timestamp, z: f64, z_max: f64, level: f64) {
        if self.sum == 0.0 {
            (self.since, self.z_sum, self.blocks, self.level) = (begin, 0.0, 0.0, 0.0);
        }
        if z > K {
            self.level = self.level.max(level);
        }
        self.sum = (self.sum + z.min(z_max) - K).clamp(0.0, 2.0 * H);
        self.z_sum += z;
        self.blocks += 1.0;
    }
}

/// Both sums.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Cusum {
    above: Side,
    below: Side,
    raised: bool,
    last_z: f64,
}

impl Cusum {
    /// Takes in the innovation of a block that began at `begin`.
    pub(crate) fn add(&mut self, begin: Timestamp, z: f64) -> Option<Change> {
        self.add_up_to(begin, z, Z_MAX, 1.0)
    }

    /// The same of a block at some level, such as the power in it: one that is far below that of a doubt does not end it.
    pub(crate) fn add_at(&mut self, begin: Timestamp, z: f64, level: f64) -> Option<Change> {
        self.add_up_to(begin, z, Z_MAX, level)
    }

    /// Takes in an innovation that is as good as many blocks: one of a whole way, say, may raise a
    /// doubt by itself.
    pub(crate) fn add_whole(&mut self, begin: Timestamp, z: f64) -> Option<Change> {
        self.add_up_to(begin, z, f64::INFINITY, 1.0)
    }

    fn add_up_to(&mut self, begin: Timestamp, z: f64, z_max: f64, level: f64) -> Option<Change> {
        let z = z.clamp(-TOLD_MAX, TOLD_MAX);
        self.last_z = z;
        let doubted_at = self.above.level.max(self.below.level);
        if self.raised && z.abs() <= K && level < ALIKE * doubted_at {
            return None;
        }
        self.above.add(begin, z, z_max, level);
        self.below.add(begin, -z, z_max, level);
        let (low, high) = (self.above.sum.min(self.below.sum), self.above.sum.max(self.below.sum));
        let change = match self.raised {
            false if high > H => Change::Raised,
            true if low + high == 0.0 => Change::Cleared,
            _ => return None,
        };
        self.raised = change == Change::Raised;
        Some(change)
    }

    /// The last innovation, and the evidence against the model as a share of what raises a doubt.
    pub(crate) fn standing(&self) -> (f64, f64) {
        (self.last_z, self.above.sum.max(self.below.sum) / H)
    }

    /// The doubt as it stands.
    pub(crate) fn raised(&self) -> Option<Raised> {
        let (side, sign) = if self.above.sum >= self.below.sum { (&self.above, 1.0) } else { (&self.below, -1.0) };
        self.raised.then(|| Raised { since: side.since, z: sign * side.z_sum / side.blocks })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(block: u32) -> Timestamp {
        Timestamp::from_unix_ms(i64::from(block) * 60_000)
    }

    /// The block after which a doubt is raised, of these innovations one after the other.
    fn raised_after(z: impl IntoIterator<Item = f64>) -> Option<usize> {
        let mut cusum = Cusum::default();
        z.into_iter().zip(0..).position(|(z, block)| cusum.add(at(block), z) == Some(Change::Raised))
    }

    #[test]
    fn a_doubt_is_raised_when_the_sum_of_what_is_beyond_one_sigma_passes_seven() {
        // 3 sigma add 2 each: 2, 4, 6, 8 > 7 with the fourth.
        assert_eq!(raised_after([3.0; 10]), Some(3));
        assert_eq!(raised_after([-3.0; 10]), Some(3));
        // 50 sigma count for 5: 4, 8 with the second.
        assert_eq!(raised_after([50.0; 10]), Some(1));
        // 1 sigma for ever adds nothing.
        assert_eq!(raised_after([1.0; 10_000]), None);
        // To and fro is no shift: 2, 0, 2, 0 to either side.
        assert_eq!(raised_after((0..1000).map(|n| if n % 2 == 0 { 3.0 } else { -3.0 })), None);
    }

    #[test]
    fn it_began_when_the_sum_left_zero_and_is_as_strong_as_the_mean_since_then() {
        let mut cusum = Cusum::default();
        for (z, block) in [0.5, -0.5, 4.0, 8.0, 6.0].into_iter().zip(0..) {
            cusum.add(at(block), z);
        }
        // 3, 7 (8 counts for 5), 11: raised with the fifth block, since the third.
        assert_eq!(cusum.raised(), Some(Raised { since: at(2), z: 6.0 }));
    }

    #[test]
    fn it_is_over_when_the_innovations_have_been_as_they_should_for_long_enough() {
        let mut cusum = Cusum::default();
        for block in 0..100 {
            cusum.add(at(block), 9.0);
        }
        // Held at 14, and 1 less with every block of nothing.
        let cleared = (100..200).position(|block| cusum.add(at(block), 0.0) == Some(Change::Cleared));
        assert_eq!(cleared, Some(13));
        assert_eq!(cusum.raised(), None);
    }

    #[test]
    fn a_block_without_what_is_doubted_does_not_end_a_doubt() {
        let mut cusum = Cusum::default();
        for block in 0..20 {
            cusum.add_at(at(block), 4.0, 30.0);
        }
        // Nobody in the bays for an hour.
        assert!((20..80).all(|block| cusum.add_at(at(block), 0.0, 6.0).is_none()) && cusum.raised().is_some());
        assert!((80..100).any(|block| cusum.add_at(at(block), 0.0, 25.0) == Some(Change::Cleared)));
        // Before there is a doubt they count as all others do.
        let mut cusum = Cusum::default();
        for block in 0..100 {
            let (z, level) = if block % 4 == 0 { (3.0, 30.0) } else { (0.0, 6.0) };
            cusum.add_at(at(block), z, level);
        }
        assert_eq!(cusum.raised(), None);
    }

    /// The average run length of a right model by the Markov chain of Brook and Evans (Biometrika 59,
    /// 1972): the sum in bins, and the mean number of steps until it leaves them.
    #[test]
    fn a_right_model_is_doubted_once_in_two_thousand_days() {
        use statrs::distribution::{ContinuousCDF as _, Normal};
        const BINS: usize = 140;
        let (normal, width) = (Normal::standard(), H / (BINS as f64 - 0.5));
        // Bin i stands for a sum of i widths; bin 0 takes in all that would be negative.
        let p = |from: usize, to: usize| {
            let middle = (to as f64 - from as f64) * width + K;
            let up_to = normal.cdf(middle + width / 2.0);
            if to == 0 { up_to } else { up_to - normal.cdf(middle - width / 2.0) }
        };
        // (1 - P) L = 1, by elimination.
        let mut rows: Vec<Vec<f64>> = (0..BINS)
            .map(|from| {
                let row = (0..BINS).map(|to| f64::from(u8::from(from == to)) - p(from, to));
                row.chain([1.0]).collect()
            })
            .collect();
        for pivot in 0..BINS {
            for row in 0..BINS {
                if row != pivot {
                    let factor = rows[row][pivot] / rows[pivot][pivot];
                    let from = rows[pivot].clone();
                    rows[row].iter_mut().zip(&from).for_each(|(value, other)| *value -= factor * other);
                }
            }
        }
        let blocks = rows[0][BINS] / rows[0][0] / 2.0;
        let days = blocks / (24.0 * 60.0);
        assert!((1500.0..3000.0).contains(&days), "{days}");
    }
}
