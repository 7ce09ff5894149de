//! How long a residual remembers, and how many independent rows it is worth.
//!
//! The correlation of neighbouring rows alone says it of an error that decays (an AR(1) process). Beside the noise of a sensor, a slow error
//! shows little of itself there: equal parts of both have a correlation of a half, whether the slow one lasts for two rows or for a thousand.
//! So correlations are added up, as far as they are more than chance (Sokal, Monte Carlo Methods in Statistical Mechanics, 1997,
//! section 3: up to five times what they add up to, or as what is slow lasts). Where that is more than a decay from row to row explains, the residual is taken for white noise
//! beside a decay, `rho_k = share kept^k`, which has these two.

use nalgebra::DMatrix;

use crate::infer::noise::Noise;
use crate::residual::lag1;
use crate::whiteness::{LEAST_ROWS, Slots};

/// Correlations are added up to so many times their sum.
const WINDOW: f64 = 5.0;
/// Lags that are looked at one by one before all are.
const AT_FIRST: usize = 16;
/// Deviations of chance by which a sum must exceed what the nearest rows say.
const CHANCE: f64 = 2.0;

/// The memory of a residual.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Persistence {
    /// Autocorrelation in neighbouring rows.
    pub lag1: f64,
    /// What is slow beside white noise, where neighbouring rows do not say all.
    slow: Option<Slow>,
}

/// The slow part of a residual.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Slow {
    /// Its share of the variance.
    share: f64,
    /// Its correlation in neighbouring rows.
    kept: f64,
}

impl Persistence {
    /// Of residuals at these rows of a log, in order; about zero, not about the mean: a constant error is an error.
    #[must_use]
    pub fn of(rows: &[usize], residual: &[f64]) -> Persistence {
        let lag1 = lag1(rows, residual);
        let (sum, lags) = match sum_of_correlations(rows, residual) {
            Some(sum) if lag1 > 0.0 => sum,
            _ => return Persistence { lag1, slow: None },
        };
        let alone = decaying(lag1, rows.len());
        // What chance makes of as many of a decay (Madras and Sokal, J. Stat. Phys. 50, 1988, p. 109, eq. 2.19).
        let chance = alone * ((4 * lags + 2) as f64 / rows.len() as f64).sqrt();
        let kept = 1.0 - 2.0 * lag1 / (sum - 1.0);
        let more = sum - alone > CHANCE * chance && kept > lag1;
        Persistence { lag1, slow: more.then(|| Slow { share: lag1 / kept, kept }) }
    }

    /// Rows that are worth one independent one, for a number on which all rows have the same say, >= 1.
    #[must_use]
    pub fn rows_per_independent(&self, rows: usize) -> f64 {
        let of = |slow: Slow| 1.0 + 2.0 * slow.share * slow.kept / (1.0 - slow.kept);
        self.slow.map_or_else(|| decaying(self.lag1, rows), of).clamp(1.0, rows.max(1) as f64)
    }

    /// The same for a mean of squares (Bayley and Hammersley 1946): correlations count by their squares.
    #[must_use]
    pub fn squares_per_independent(&self) -> f64 {
        let slow = self.slow.unwrap_or(Slow { share: 1.0, kept: self.lag1 });
        let kept2 = slow.kept.powi(2);
        1.0 + 2.0 * slow.share.powi(2) * kept2 / (1.0 - kept2).max(f64::MIN_POSITIVE)
    }

    /// `Jᵀ R J` for the correlation R of these rows and their derivatives, one column for each parameter.
    #[must_use]
    pub fn spread(&self, rows: &[usize], jacobian: &DMatrix<f64>) -> DMatrix<f64> {
        let Some(Slow { share, kept }) = self.slow else {
            return jacobian.tr_mul(jacobian) * self.rows_per_independent(rows.len());
        };
        let noise = Noise { white: (1.0 - share).max(0.0).sqrt(), slow: share.sqrt(), tau_s: -kept.ln().recip() };
        let at: Vec<f64> = rows.iter().map(|&row| row as f64).collect();
        // Of one row behind the other.
        let mut spread = jacobian.transpose();
        noise.spread_all(&at, &vec![1.0; rows.len()], spread.as_mut_slice(), jacobian.ncols());
        spread * jacobian
    }
}

/// Rows that are worth one of a residual that decays from row to row.
fn decaying(lag1: f64, rows: usize) -> f64 {
    let rows = rows.max(1) as f64;
    let kept = lag1.clamp(0.0, (rows - 1.0) / (rows + 1.0));
    (1.0 + kept) / (1.0 - kept)
}

/// One and twice all correlations, and how many these are; none of too few rows.
fn sum_of_correlations(rows: &[usize], residual: &[f64]) -> Option<(f64, usize)> {
    let (&first, &last) = rows.first().zip(rows.last()).filter(|_| rows.len() >= LEAST_ROWS)?;
    let mut values = vec![f64::NAN; last - first + 1];
    rows.iter().zip(residual).for_each(|(&row, &value)| values[row - first] = value);
    let variance = residual.iter().map(|value| value * value).sum::<f64>() / residual.len() as f64;
    if variance == 0.0 {
        return None;
    }
    let one_by_one = |lag: usize| {
        let pairs = values.iter().zip(&values[lag.min(values.len())..]).map(|(a, b)| a * b).filter(|product| !product.is_nan());
        let (sum, count) = pairs.fold((0.0, 0.0), |(sum, count), product| (sum + product, count + 1.0));
        if count > 0.0 { sum / count / variance } else { 0.0 }
    };
    let most = (values.len() / 4).max(1);
    let lag1 = one_by_one(1);
    // A small slow part adds little at first: what decays adds up to its correlation of neighbours times as many rows as it lasts.
    let is_seen = lag1 > CHANCE / (rows.len() as f64).sqrt();
    let wide = |sum: f64| if is_seen { WINDOW * sum.max((sum - 1.0) / (2.0 * lag1)) } else { WINDOW * sum };
    let window = |correlation: &dyn Fn(usize) -> f64, from: usize, to: usize, sum: f64| {
        let mut sum = sum;
        for lag in from..=to.min(most) {
            sum += 2.0 * correlation(lag);
            if lag as f64 >= wide(sum) || lag == most {
                return Ok((sum, lag));
            }
        }
        Err(sum)
    };
    let found = window(&one_by_one, 1, AT_FIRST, 1.0).or_else(|sum| {
        let all = Slots { interval_s: 1.0, filled: rows.len(), values: values.clone() }.correlation();
        window(&|lag| all.at(lag), AT_FIRST + 1, most, sum)
    });
    found.ok()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::whiteness::tests::uniform;

    /// White noise of deviation 1, beside a decay of deviation `slow` over `tau` rows, with one source of numbers for both.
    fn made(rows: usize, slow: f64, tau: f64) -> Vec<f64> {
        let kept = (-1.0 / tau).exp();
        let unit = 12f64.sqrt();
        let mut level = 0.0;
        let pairs = uniform(2 * rows);
        let row = |pair: &[f64]| {
            level = kept * level + (1.0 - kept * kept).sqrt() * slow * unit * pair[0];
            level + unit * pair[1]
        };
        pairs.chunks(2).map(row).collect()
    }

    fn of(residual: &[f64]) -> Persistence {
        Persistence::of(&(0..residual.len()).collect::<Vec<_>>(), residual)
    }

    #[test]
    fn white_noise_and_a_plain_decay_are_what_neighbours_say() {
        assert_eq!(of(&made(4000, 0.0, 1.0)).slow, None);
        let decay: Vec<f64> = made(8000, 1e6, 10.0);
        let found = of(&decay);
        // (1 + exp(-1/10)) / (1 - exp(-1/10)) = 20.
        assert!((found.rows_per_independent(8000) / 20.0 - 1.0).abs() < 0.3, "{found:?}");
    }

    /// Equal parts of noise and of something that lasts for 60 rows: a correlation of a half of neighbours, and 1 + 2 x 60 / 2 rows for one.
    #[test]
    fn what_is_slow_beside_noise_is_seen_by_all_its_correlations() {
        let residual = made(20_000, 1.0, 60.0);
        let found = of(&residual);
        assert!((found.lag1 - 0.5).abs() < 0.06, "{found:?}");
        assert!((found.rows_per_independent(20_000) / 61.0 - 1.0).abs() < 0.4, "{found:?}");
        // Of squares: 1 + 2 / 4 x 30 = 16.
        assert!((found.squares_per_independent() / 16.0 - 1.0).abs() < 0.5, "{found:?}");
        // All rows have the same say, or every other one the opposite.
        let rows: Vec<usize> = (0..20_000).collect();
        let say = |row: usize, _| if row.is_multiple_of(2) { 1.0 } else { -1.0 };
        let [same, opposite] =
            [DMatrix::from_element(20_000, 1, 1.0), DMatrix::from_fn(20_000, 1, say)].map(|j| found.spread(&rows, &j)[(0, 0)]);
        assert!((same / 20_000.0 / found.rows_per_independent(20_000) - 1.0).abs() < 0.02, "{same}");
        assert!(opposite < 0.6 * 20_000.0, "{opposite}");
    }

    /// A tenth of the variance: neighbours correlate by little, and yet thirteen rows are worth one.
    #[test]
    fn a_small_slow_part_is_seen_too() {
        let found = of(&made(20_000, 1.0 / 3.0, 60.0));
        // 1 + 2 x 0.1 x 60 = 13.
        assert!((found.rows_per_independent(20_000) / 13.0 - 1.0).abs() < 0.5, "{found:?}");
    }

    #[test]
    fn rows_that_are_missing_and_few_rows_change_nothing() {
        let residual = made(20_000, 1.0, 60.0);
        let rows: Vec<usize> = (0..20_000).filter(|row| row % 5 != 2 && !(7000..7500).contains(row)).collect();
        let kept: Vec<f64> = rows.iter().map(|&row| residual[row]).collect();
        let (all, some) = (of(&residual), Persistence::of(&rows, &kept));
        assert!((some.rows_per_independent(rows.len()) / all.rows_per_independent(20_000) - 1.0).abs() < 0.2, "{all:?} {some:?}");
        assert_eq!(of(&residual[..10]).slow, None);
        assert_eq!(of(&[0.0; 50]).rows_per_independent(50), 1.0);
    }
}
