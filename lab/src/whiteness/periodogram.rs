//! The periodogram of a residual: is its power spread evenly, or does a period stand out?

use rustfft::num_complex::Complex;
use serde::Serialize;

use super::slots::{Slots, transform};

/// Bartlett's test: the cumulative periodogram of white noise is a straight line.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Cumulative {
    /// Frequencies that enter.
    pub frequencies: usize,
    /// Largest distance from the straight line (Kolmogorov and Smirnov).
    pub distance: f64,
    /// The distance that white noise exceeds in one case of twenty.
    pub distance_5_percent: f64,
    /// Chance of a distance this large, if white.
    pub p_value: f64,
}

/// A period that stands out of its surroundings.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Period {
    /// The period, s.
    pub period_s: f64,
    /// Share of the variance about the mean, 0..1.
    pub share: f64,
}

/// Neighbours on each side that a peak is compared with, beyond those that it leaks into.
const NEIGHBOURS: usize = 10;
/// Frequencies on each side into which a peak leaks.
const LEAKAGE: usize = 2;
/// Periods that a log must hold before one of them can be told from a drift.
const LEAST_PERIODS: usize = 5;
/// Share of the variance below which a period is not worth naming.
const LEAST_SHARE: f64 = 0.1;
/// Chance that the largest ordinate of white noise stands out, by order of magnitude.
const BY_CHANCE: f64 = 1e-3;

/// Power by frequency: ordinate j, counted from 1, belongs to j periods in the log.
pub(super) struct Spectrum {
    power: Vec<f64>,
    /// Length of the log, s.
    span_s: f64,
}

impl Spectrum {
    /// Over all slots, empty ones as 0; without the mean, and without the highest frequency of an
    /// even number of slots, which has another distribution.
    pub(super) fn of(slots: &Slots) -> Spectrum {
        let n = slots.values.len();
        let mut buffer: Vec<Complex<f64>> = slots.with_zeros().map(|value| Complex::new(value, 0.0)).collect();
        transform(n, false).process(&mut buffer);
        let power = buffer[1..=(n - 1) / 2].iter().map(Complex::norm_sqr).collect();
        Spectrum { power, span_s: n as f64 * slots.interval_s }
    }

    /// Sums of power up to each frequency, as shares of the whole.
    fn sums(&self) -> Vec<f64> {
        let whole: f64 = self.power.iter().sum();
        let mut sum = 0.0;
        let next = |power| {
            sum += power;
            sum / whole
        };
        self.power.iter().map(next).collect()
    }

    /// The test. The ordinates of white noise are independent exponentials, so all but the last of
    /// the sums are distributed as sorted uniform numbers.
    pub(super) fn cumulative(&self) -> Cumulative {
        let sums = self.sums();
        let n = sums.len() - 1;
        let far = |(index, sum): (usize, &f64)| (sum - index as f64 / n as f64).max((index + 1) as f64 / n as f64 - sum);
        let distance = sums[..n].iter().enumerate().map(far).fold(0.0, f64::max);
        // Stephens, J. R. Stat. Soc. B 32 (1970) 115: makes the limit for many numbers good for few.
        let root = (n as f64).sqrt();
        let scale = root + 0.12 + 0.11 / root;
        Cumulative { frequencies: sums.len(), distance, distance_5_percent: 1.358_1 / scale, p_value: kolmogorov(scale * distance) }
    }

    /// Frequency in Hz and share of the power up to it.
    pub(super) fn curve(&self) -> Vec<(f64, f64)> {
        let frequency = |index: usize| (index + 1) as f64 / self.span_s;
        self.sums().into_iter().enumerate().map(|(index, sum)| (frequency(index), sum)).collect()
    }

    /// The largest peak above its surroundings, when that is no accident. A steep slope is no peak:
    /// it must stand out of both sides.
    pub(super) fn period(&self) -> Option<Period> {
        let count = self.power.len();
        let whole: f64 = self.power.iter().sum();
        let least = |level: f64| -2.0 * (BY_CHANCE / count as f64).ln() * level;
        let peak = |index: usize| {
            let left = index.saturating_sub(LEAKAGE + NEIGHBOURS)..index.saturating_sub(LEAKAGE);
            let right = (index + LEAKAGE + 1).min(count)..(index + LEAKAGE + 1 + NEIGHBOURS).min(count);
            // The median of exponentials is ln 2 of their mean.
            let level = median(&self.power[left]).max(median(&self.power[right])) / std::f64::consts::LN_2;
            let line = index.saturating_sub(LEAKAGE)..(index + LEAKAGE + 1).min(count);
            let share = (self.power[line.clone()].iter().sum::<f64>() - level * line.len() as f64) / whole;
            (self.power[index] > least(level) && share >= LEAST_SHARE).then_some((index, line, share))
        };
        let (_, line, share) = (LEAST_PERIODS - 1..count)
            .filter_map(peak)
            .max_by(|a, b| a.2.total_cmp(&b.2).then(self.power[a.0].total_cmp(&self.power[b.0])))?;
        // Between two frequencies, the centre of the line's power is nearer than either.
        let (sum, moment) = line.fold((0.0, 0.0), |sum, index| (sum.0 + self.power[index], sum.1 + self.power[index] * (index + 1) as f64));
        Some(Period { period_s: self.span_s * sum / moment, share: share.min(1.0) })
    }
}

/// Power at multiples of a quarter of the least frequency, that of one period in all slots, from none on.
pub(crate) fn quarters(slots: &Slots) -> Vec<f64> {
    let length = 4 * slots.values.len();
    let mut buffer: Vec<Complex<f64>> = slots.with_zeros().map(|value| Complex::new(value, 0.0)).collect();
    buffer.resize(length, Complex::default());
    transform(length, false).process(&mut buffer);
    buffer.iter().take(length / 2 + 1).map(Complex::norm_sqr).collect()
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(0.0)
}

/// Chance that a Kolmogorov variable exceeds x.
fn kolmogorov(x: f64) -> f64 {
    if x < 0.3 {
        // The series below converges too slowly, and the chance is 1 to four digits.
        return 1.0;
    }
    let term = |k: i32| (if k % 2 == 1 { 2.0 } else { -2.0 }) * (-2.0 * f64::from(k * k) * x * x).exp();
    (1..=20).map(term).sum::<f64>().clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::whiteness::Whiteness;
    use crate::whiteness::tests::{seconds, uniform};

    #[test]
    fn agrees_with_scipy() {
        // tests/reference/whiteness.py: scipy's exact distribution; Stephens' formula is within 0.02.
        for (n, distance, p_value) in REFERENCE {
            let found = Whiteness::of(&seconds(n), &uniform(n)).unwrap().cumulative_periodogram;
            assert!((found.distance - distance).abs() < 1e-9, "{found:?}");
            assert!((found.p_value - p_value).abs() < 0.02, "{found:?}");
        }
    }

    const REFERENCE: [(usize, f64, f64); 2] = [(500, 0.037014026648, 0.873345604949), (61, 0.127969128614, 0.682106879637)];

    #[test]
    fn kolmogorov_of_the_textbook() {
        assert!((kolmogorov(1.358_1) - 0.05).abs() < 1e-4);
        assert!((kolmogorov(1.627_6) - 0.01).abs() < 1e-4);
    }
}
