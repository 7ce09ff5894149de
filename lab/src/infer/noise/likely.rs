//! How likely residuals are with several kinds of noise, weighed side by side.

use super::{Noise, Rows};

/// How many kinds of noise are weighed at a time: each waits for its last row, all of them together
/// keep a processor busy.
pub(super) const LANES: usize = 4;

/// Residuals, ready to be asked how likely they are.
pub(super) struct Likely<'a> {
    white2: f64,
    logs: &'a [Rows<'a>],
    /// Steps between rows that occur, s, and which of them comes before each row of each log.
    steps_s: Vec<f64>,
    step_of: Vec<Vec<usize>>,
    /// One over the readings of each row of each log.
    inverses: Vec<Vec<f64>>,
}

impl<'a> Likely<'a> {
    pub(super) fn new(white: f64, logs: &'a [Rows<'a>]) -> Self {
        let mut steps_s: Vec<f64> = Vec::new();
        let mut place = |dt_s: f64, last: usize| {
            let alike = |&known: &f64| (known - dt_s).abs() <= ONE_STEP * dt_s.abs();
            if steps_s.get(last).is_some_and(alike) {
                return last;
            }
            let recent = steps_s.len().saturating_sub(STEPS_MAX);
            steps_s[recent..].iter().position(alike).map_or_else(
                || {
                    steps_s.push(dt_s);
                    steps_s.len() - 1
                },
                |known| recent + known,
            )
        };
        let step_of = logs.iter().map(|(time_s, ..)| {
            let mut last = 0;
            let step = |row: usize| {
                last = place(if row == 0 { 0.0 } else { time_s[row] - time_s[row - 1] }, last);
                last
            };
            (0..time_s.len()).map(step).collect()
        });
        let step_of = step_of.collect();
        let inverses = logs.iter().map(|(_, counts, _)| counts.iter().map(|count| count.recip()).collect()).collect();
        Likely { white2: white * white, logs, steps_s, step_of, inverses }
    }

    /// Minus twice the log-likelihoods with these kinds of noise, without their constant.
    ///
    /// The variance of a level is kept as a quotient: then no row waits for the division of the one before it.
    pub(super) fn costs(&self, noises: [Noise; LANES]) -> [f64; LANES] {
        // In units in which no variance is above one.
        let unit2 = noises.map(|noise| self.white2 + noise.slow * noise.slow);
        let (white2, slow2): ([f64; LANES], [f64; LANES]) =
            (unit2.map(|unit2| self.white2 / unit2), std::array::from_fn(|lane| noises[lane].slow.powi(2) / unit2[lane]));
        let decay = |dt_s: f64, lane: usize| (-dt_s / noises[lane].tau_s).exp();
        let decays: Vec<Decay> = self.steps_s.iter().map(|&dt_s| Decay::new(slow2, |lane| decay(dt_s, lane))).collect();
        let mut costs = [0.0; LANES];
        for (((_, _, residual), steps), inverses) in self.logs.iter().zip(&self.step_of).zip(&self.inverses) {
            let (mut level, mut variance, mut scale) = ([0.0; LANES], slow2, [1.0; LANES]);
            let mut squares = [0.0; LANES];
            let places = (0..steps.len()).step_by(UNSCALED).map(|begin| begin..(begin + UNSCALED).min(steps.len()));
            for rows in places {
                for ((&step, &inverse), &value) in steps[rows.clone()].iter().zip(&inverses[rows.clone()]).zip(&residual[rows]) {
                    let Decay { kept, kept2, new } = &decays[step];
                    for lane in 0..LANES {
                        // What `variance` and `scale` are the quotient of becomes that of the next row, and the
                        // quotient of two scales is the variance of the row between them.
                        let white2 = white2[lane] * inverse;
                        let before = new[lane] * scale[lane] + kept2[lane] * variance[lane];
                        let next = before + white2 * scale[lane];
                        let share = next.recip();
                        let (gain, weight) = (before * share, scale[lane] * share);
                        variance[lane] = white2 * before;
                        scale[lane] = next;
                        let innovation = value - kept[lane] * level[lane];
                        level[lane] = kept[lane] * (white2 * weight) * level[lane] + gain * value;
                        squares[lane] += innovation * innovation * weight;
                    }
                }
                // Logarithms are dear: one for many rows.
                if scale.iter().any(|scale| *scale < WORN) {
                    for lane in 0..LANES {
                        costs[lane] += scale[lane].ln();
                        variance[lane] /= scale[lane];
                        scale[lane] = 1.0;
                    }
                }
            }
            for lane in 0..LANES {
                costs[lane] += scale[lane].ln() + squares[lane] / unit2[lane] + steps.len() as f64 * unit2[lane].ln();
            }
        }
        costs
    }
}

/// What is left over one step between rows, for each kind of noise.
struct Decay {
    /// Of a level, and of its variance.
    kept: [f64; LANES],
    kept2: [f64; LANES],
    /// Variance that is new.
    new: [f64; LANES],
}

impl Decay {
    fn new(slow2: [f64; LANES], kept: impl Fn(usize) -> f64) -> Decay {
        let kept: [f64; LANES] = std::array::from_fn(kept);
        let kept2 = kept.map(|kept| kept * kept);
        Decay { kept, kept2, new: std::array::from_fn(|lane| slow2[lane] * (1.0 - kept2[lane])) }
    }
}

/// Rows after which products of variances are looked at, and where they have become so small that they begin anew.
const UNSCALED: usize = 8;
pub(super) const WORN: f64 = 1e-100;

/// Share by which steps differ that are one: clocks jitter. What is left of a level is off by less than this share over e.
const ONE_STEP: f64 = 1e-4;

/// Different steps between rows among which one is looked for again.
const STEPS_MAX: usize = 64;
