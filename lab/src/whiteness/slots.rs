//! Residuals in time slots of equal width, and their correlation over time.
//!
//! Time is divided into slots as wide as the median time between rows. A slot that holds several
//! rows counts their mean once; a slot that holds none is empty, and only pairs of filled slots
//! enter a correlation (Parzen 1963). A pause longer than [`LONGEST_GAP`] slots is cut to that
//! length, so that a log that stopped for a week is not mostly empty: no lag reaches across it.

use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlanner};

use super::LEAST_ROWS;

/// Slots that a pause may take.
const LONGEST_GAP: usize = 200;

/// Residuals by time slot, about their mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Slots {
    /// Width of a slot, s.
    pub interval_s: f64,
    /// Residual minus the mean; NaN in an empty slot.
    pub values: Vec<f64>,
    /// Slots that are not empty.
    pub filled: usize,
}

impl Slots {
    /// Sorts rows into slots; none when there are too few or they never differ.
    #[must_use]
    pub fn of(time_s: &[f64], residual: &[f64]) -> Option<Slots> {
        if residual.len() < LEAST_ROWS {
            return None;
        }
        let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let middle = steps.len() / 2;
        let interval_s = *steps.select_nth_unstable_by(middle, f64::total_cmp).1;
        let mut sums = vec![(0.0, 0_usize)];
        // Counted from the last row that began a slot, so that a clock a little off does not
        // drift over a boundary.
        let mut slot_s = time_s[0];
        for (&time_s, &residual) in time_s.iter().zip(residual) {
            let ahead = ((time_s - slot_s) / interval_s).round();
            if ahead >= 1.0 {
                let ahead = (ahead as usize).min(LONGEST_GAP);
                sums.resize(sums.len() + ahead, (0.0, 0));
                slot_s = time_s;
            }
            if let Some(last) = sums.last_mut() {
                *last = (last.0 + residual, last.1 + 1);
            }
        }
        let mut values: Vec<f64> = sums.iter().map(|(sum, rows)| sum / *rows as f64).collect();
        let filled = values.iter().filter(|value| value.is_finite()).count();
        let mean = values.iter().filter(|value| value.is_finite()).sum::<f64>() / filled as f64;
        values.iter_mut().for_each(|value| *value -= mean);
        let squares: f64 = values.iter().filter(|value| value.is_finite()).map(|value| value * value).sum();
        let size = residual.iter().fold(0.0_f64, |size, value| size.max(value.abs()));
        // Of a constant only rounding is left.
        (filled >= LEAST_ROWS && squares.sqrt() > 1e-12 * size).then_some(Slots { interval_s, values, filled })
    }

    /// The values, with 0 for an empty slot: adds no power, and keeps the periodogram of white
    /// noise flat.
    pub(super) fn with_zeros(&self) -> impl Iterator<Item = f64> {
        self.values.iter().map(|value| if value.is_finite() { *value } else { 0.0 })
    }

    /// Correlation of neighbouring slots, never beyond 1: each side of the pairs has its own
    /// variance, as gaps may leave out different parts of the series on each.
    pub(super) fn lag1(&self) -> f64 {
        let pairs = self.values.windows(2).filter(|pair| pair[0].is_finite() && pair[1].is_finite());
        let (mut products, mut before, mut after) = (0.0, 0.0, 0.0);
        for pair in pairs {
            products += pair[0] * pair[1];
            before += pair[0] * pair[0];
            after += pair[1] * pair[1];
        }
        let size = f64::sqrt(before * after);
        if size > 0.0 { products / size } else { 0.0 }
    }

    /// Correlation at every lag up to a quarter of the slots.
    pub(crate) fn correlation(&self) -> Correlation {
        let lags = (self.values.len() / 4).max(1);
        let products = self_products(self.with_zeros(), self.values.len(), lags);
        let pairs = if self.filled == self.values.len() {
            (0..=lags).map(|lag| (self.filled - lag) as f64).collect()
        } else {
            let present = self.values.iter().map(|value| if value.is_finite() { 1.0 } else { 0.0 });
            self_products(present, self.values.len(), lags).into_iter().map(f64::round).collect()
        };
        let variance = products[0] / self.filled as f64;
        let value = |(product, pairs): (f64, &f64)| if *pairs > 0.0 { product / pairs / variance } else { 0.0 };
        Correlation { values: products.into_iter().zip(&pairs).map(value).collect(), pairs }
    }

    /// Whether rows are correlated with the next, however long that comes after, by more than 1/e.
    pub(super) fn neighbours_agree(&self) -> bool {
        let rows: Vec<f64> = self.values.iter().copied().filter(|value| value.is_finite()).collect();
        let products: f64 = rows.windows(2).map(|pair| pair[0] * pair[1]).sum();
        let squares: f64 = rows.iter().map(|value| value * value).sum();
        products > (-1.0_f64).exp() * squares
    }

    /// The same slots with those between two rows filled on a straight line, but for pauses: as the residual goes on over time, however
    /// often it is read.
    pub(super) fn filled_between(&self) -> Slots {
        let mut values = self.values.clone();
        let mut last = 0;
        for slot in (1..values.len()).filter(|&slot| self.values[slot].is_finite()) {
            if slot - last < LONGEST_GAP {
                let (from, to, wide) = (values[last], values[slot], (slot - last) as f64);
                (last + 1..slot).for_each(|between| values[between] = from + (to - from) * (between - last) as f64 / wide);
            }
            last = slot;
        }
        let known = || values.iter().filter(|value| value.is_finite());
        let filled = known().count();
        let mean = known().sum::<f64>() / filled as f64;
        values.iter_mut().for_each(|value| *value -= mean);
        Slots { filled, values, ..*self }
    }
}

/// Correlation by lag in slots: mean product of pairs over variance.
pub(crate) struct Correlation {
    values: Vec<f64>,
    /// Pairs of filled slots at each lag.
    pub(super) pairs: Vec<f64>,
}

impl Correlation {
    /// The mean product of pairs at this lag over the variance; 0 beyond the last known lag.
    pub(crate) fn at(&self, lag: usize) -> f64 {
        self.values.get(lag).copied().unwrap_or(0.0)
    }

    /// When the correlation falls below 1/e, between lags by a straight line.
    pub(super) fn time_s(&self, interval_s: f64) -> Option<f64> {
        let level = (-1.0_f64).exp();
        let after = self.values.iter().position(|&value| value < level)?;
        let (before, now) = (self.values[after - 1], self.values[after]);
        Some((after as f64 - 1.0 + (before - level) / (before - now)) * interval_s)
    }
}

/// Σ x\[k\] x\[k+lag\] for all lags, through the power spectrum.
fn self_products(values: impl Iterator<Item = f64>, length: usize, lags: usize) -> Vec<f64> {
    // Padded by more than the largest lag, so that the end does not meet the beginning.
    let padded = (length + lags + 1).next_power_of_two();
    let mut buffer: Vec<Complex<f64>> = values.map(|value| Complex::new(value, 0.0)).collect();
    buffer.resize(padded, Complex::default());
    transform(padded, false).process(&mut buffer);
    buffer.iter_mut().for_each(|value| *value = Complex::new(value.norm_sqr(), 0.0));
    transform(padded, true).process(&mut buffer);
    buffer.iter().take(lags + 1).map(|value| value.re / padded as f64).collect()
}

/// A Fourier transform, without scaling.
pub(super) fn transform(length: usize, inverse: bool) -> Arc<dyn Fft<f64>> {
    let mut planner = FftPlanner::new();
    if inverse { planner.plan_fft_inverse(length) } else { planner.plan_fft_forward(length) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_crowd_counts_once_and_a_long_pause_is_cut() {
        let mut time_s: Vec<f64> = (0..30).map(f64::from).collect();
        time_s.extend([29.1, 1e6, 1e6 + 1.0]);
        let residual: Vec<f64> = (0..33).map(f64::from).collect();
        let slots = Slots::of(&time_s, &residual).unwrap();
        assert_eq!((slots.interval_s, slots.filled, slots.values.len()), (1.0, 32, 31 + LONGEST_GAP));
        // 29 and 30 share a slot.
        assert!((slots.values[29] - slots.values[28] - 1.5).abs() < 1e-9);
    }

    #[test]
    fn correlation_by_hand() {
        // +1 -1 +1 -1 ...: at lag 1 every pair has the product -1, at lag 2 +1.
        let time_s: Vec<f64> = (0..40).map(f64::from).collect();
        let residual: Vec<f64> = (0..40).map(|k| if k % 2 == 0 { 1.0 } else { -1.0 }).collect();
        let correlation = Slots::of(&time_s, &residual).unwrap().correlation();
        assert!((correlation.at(1) + 1.0).abs() < 1e-12 && (correlation.at(2) - 1.0).abs() < 1e-12);
        assert!((Slots::of(&time_s, &residual).unwrap().lag1() + 1.0).abs() < 1e-12);
        assert_eq!(correlation.pairs[3], 37.0);
        let below = (1.0 - (-1.0_f64).exp()) / 2.0;
        assert!((correlation.time_s(2.0).unwrap() - 2.0 * below).abs() < 1e-12);
    }
}
