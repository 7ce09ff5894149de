//! Residual rows: observed minus predicted, against the known sensor floor.

use serde::Serialize;

use crate::predict::Prediction;
use crate::prepare::{Prepared, Target};

/// One row of one target channel.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Residual {
    /// Row of the log.
    pub row: usize,
    /// Measured, in the channel's unit.
    pub observed: f64,
    /// Predicted, same unit.
    pub predicted: f64,
    /// Known standard deviation of the measurement, same unit; 0 when not known.
    pub sigma: f64,
    /// Residual over sigma; NaN when sigma is not known.
    pub whitened: f64,
    /// Whether the row counts.
    pub used: bool,
}

impl Residual {
    /// Observed minus predicted, in the channel's unit.
    #[must_use]
    pub fn value(&self) -> f64 {
        self.observed - self.predicted
    }
}

/// Every row of a target.
#[must_use]
pub fn residuals(prepared: &Prepared, prediction: &Prediction, target: &Target) -> Vec<Residual> {
    let predicted = prediction.of(target.channel).unwrap_or_default();
    let row = |(row, (&observed, &predicted)): (usize, (&f64, &f64))| {
        let sigma = target.floor;
        let whitened = if sigma > 0.0 { (observed - predicted) / sigma } else { f64::NAN };
        Residual { row, observed, predicted, sigma, whitened, used: target.used[row] }
    };
    debug_assert_eq!(predicted.len(), prepared.time_s.len());
    target.observed.iter().zip(predicted).enumerate().map(row).collect()
}

/// Size of a set of residuals, in their channel's unit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize)]
pub struct Size {
    /// Rows that count.
    pub rows: usize,
    /// Root of the mean square.
    pub rms: f64,
    /// Mean; its sign is that of observed minus predicted.
    pub mean: f64,
    /// Largest absolute value.
    pub max_abs: f64,
}

impl Size {
    /// Of the given residuals; all zero when there is none.
    pub fn of(values: impl Iterator<Item = f64>) -> Size {
        let (mut rows, mut sum, mut squares, mut max_abs) = (0_usize, 0.0, 0.0, 0.0_f64);
        for value in values {
            rows += 1;
            sum += value;
            squares += value * value;
            max_abs = max_abs.max(value.abs());
        }
        let n = rows.max(1) as f64;
        Size { rows, rms: (squares / n).sqrt(), mean: sum / n, max_abs }
    }

    /// Sum of squares, in the square of the channel's unit.
    #[must_use]
    pub fn squares(&self) -> f64 {
        self.rms * self.rms * self.rows as f64
    }
}

/// Autocorrelation of residuals in neighbouring rows of a log. About zero, not about the mean: a
/// constant error is an error.
#[must_use]
pub fn lag1(rows: &[usize], residual: &[f64]) -> f64 {
    let neighbours = rows.windows(2).zip(residual.windows(2)).filter(|(rows, _)| rows[1] == rows[0] + 1);
    let sums = neighbours.fold((0.0, 0.0), |sum, (_, x)| (sum.0 + x[0] * x[1], sum.1 + (x[0] * x[0] + x[1] * x[1]) / 2.0));
    if sums.1 > 0.0 { sums.0 / sums.1 } else { 0.0 }
}

/// A median of sizes is so many deviations of a Gauss curve.
pub(crate) const MEDIAN: f64 = 0.674_49;
/// Three readings of which the middle one is taken twice and negative: their noise adds up to so many deviations, the root of 6.
pub(crate) const BENT: f64 = 2.449_489_742_783_178;

/// Second differences of neighbouring rows.
pub(crate) fn bends(rows: &[usize], values: &[f64]) -> impl Iterator<Item = f64> {
    let thirds = rows.windows(3).zip(values.windows(3)).filter(|(rows, _)| rows[2] == rows[0] + 2);
    thirds.map(|(_, x)| x[0] - 2.0 * x[1] + x[2])
}

/// Standard deviation of white noise from second differences of neighbouring rows, which lines and
/// slow curves do not enter; none with fewer than `least` of them. The median keeps steps out:
/// |x - 2y + z| of noise has the median 0.6745 sqrt(6) sigma.
#[must_use]
pub fn noise_between(rows: &[usize], values: &[f64], least: usize) -> Option<f64> {
    let mut sizes: Vec<f64> = bends(rows, values).map(f64::abs).collect();
    if sizes.len() < least.max(1) {
        return None;
    }
    let middle = sizes.len() / 2;
    Some(*sizes.select_nth_unstable_by(middle, f64::total_cmp).1 / (MEDIAN * BENT))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn size_by_hand() {
        let size = Size::of([3.0, -4.0, 0.0, 0.0].into_iter());
        assert_eq!((size.rows, size.rms, size.mean, size.max_abs), (4, 2.5, -0.25, 4.0));
        assert_eq!(size.squares(), 25.0);
        assert_eq!(Size::of(std::iter::empty()), Size::default());
    }
}
