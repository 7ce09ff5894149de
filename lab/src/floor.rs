//! RMS against the known sensor floor, with its uncertainty, and a check of the floor itself.

use serde::Serialize;
use statrs::distribution::{ChiSquared, ContinuousCDF as _};

use crate::persistence::Persistence;
use crate::residual::noise_between;
use crate::rounding::{noise_of_rounded, seen};

/// RMS over floor up to which a channel is explained.
pub(crate) const EXPLAINED: f64 = 1.05;

/// RMS over floor of one channel of one log.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct FloorCheck {
    /// Lower end of the 95 % interval of RMS over floor.
    pub ratio_low: f64,
    /// Upper end of it.
    pub ratio_high: f64,
    /// Independent squares that the rows are worth.
    pub effective_rows: f64,
    /// Noise that neighbouring rows show, in the channel's unit; null when too few are neighbours.
    pub noise_seen: Option<f64>,
    /// What to think of it.
    pub opinion: FloorOpinion,
}

/// What a ratio says about the floor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum FloorOpinion {
    /// The whole interval lies above 1: the model leaves more than the sensor explains.
    AboveFloor,
    /// 1 lies in the interval.
    AtFloor,
    /// The whole interval lies below 1 by more than a trifle: the stated floor is too large.
    FloorTooLarge,
    /// Neighbouring rows alone differ by more than the floor: the stated floor is too small.
    FloorTooSmall,
}

/// How far RMS may lie below the floor before the floor is doubted.
const TRIFLE: f64 = 0.9;
/// How far the noise seen between neighbours may exceed the floor before the floor is doubted: a
/// fast effect that the model lacks looks the same, so only a clear excess counts.
const CLEARLY: f64 = 1.3;
/// Neighbours needed to see noise.
const LEAST_NEIGHBOURS: usize = 50;

impl FloorCheck {
    /// Of residuals at these rows of a log. RMS² n / sigma² is chi-square distributed; squares of
    /// residuals that follow each other are worth fewer ([`Persistence::squares_per_independent`]). `step` is that of the readings, where they are rounded.
    #[must_use]
    pub fn of(rows: &[usize], residual: &[f64], floor: f64, step: Option<f64>) -> Option<FloorCheck> {
        if residual.is_empty() || floor <= 0.0 {
            return None;
        }
        let n = residual.len() as f64;
        let squares: f64 = residual.iter().map(|value| value * value).sum();
        let effective_rows = (n / Persistence::of(rows, residual).squares_per_independent()).max(1.0);
        let ratio = (squares / n).sqrt() / floor;
        let (low, high) = rms_factors(effective_rows);
        let (ratio_low, ratio_high) = (ratio * low, ratio * high);
        let between = noise_between(rows, residual, LEAST_NEIGHBOURS);
        let noise_seen = match between.and_then(|noise| seen(step, noise)) {
            // Rounding errors may alternate, and then the second differences of rows make more of them than there is.
            Some(step) => noise_of_rounded(rows, residual, step, LEAST_NEIGHBOURS).map(|noise| noise.min((squares / n).sqrt())),
            None => between,
        };
        let opinion = if ratio_high < TRIFLE {
            FloorOpinion::FloorTooLarge
        } else if noise_seen.is_some_and(|noise| noise > CLEARLY * floor) {
            FloorOpinion::FloorTooSmall
        } else if ratio_low > 1.0 {
            FloorOpinion::AboveFloor
        } else {
            FloorOpinion::AtFloor
        };
        Some(FloorCheck { ratio_low, ratio_high, effective_rows, noise_seen, opinion })
    }
}

/// What to multiply an RMS with for the ends of the 95 % interval of sigma.
fn rms_factors(freedom: f64) -> (f64, f64) {
    let Ok(chi_square) = ChiSquared::new(freedom) else { return (0.0, f64::INFINITY) };
    let factor = |chance| (freedom / chi_square.inverse_cdf(chance)).sqrt();
    (factor(0.975), factor(0.025))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::whiteness::tests::uniform;

    fn check(residual: &[f64], floor: f64) -> FloorCheck {
        let rows: Vec<usize> = (0..residual.len()).collect();
        FloorCheck::of(&rows, residual, floor, None).unwrap()
    }

    #[test]
    fn the_interval_is_that_of_the_chi_square() {
        // tests/reference/whiteness.py, scipy.
        for (freedom, low, high) in [(50.0, 0.836709087, 1.243078162), (3.5, 0.584003986, 3.213773699)] {
            let found = rms_factors(freedom);
            assert!((found.0 - low).abs() < 1e-6 && (found.1 - high).abs() < 1e-6, "{found:?}");
        }
    }

    #[test]
    fn noise_of_the_stated_size_is_at_the_floor_and_others_are_told() {
        let noise = uniform(2000);
        let sigma = 12f64.powf(-0.5);
        assert_eq!(check(&noise, sigma).opinion, FloorOpinion::AtFloor);
        assert_eq!(check(&noise, 2.0 * sigma).opinion, FloorOpinion::FloorTooLarge);
        assert_eq!(check(&noise, 0.5 * sigma).opinion, FloorOpinion::FloorTooSmall);
        let drift: Vec<f64> = noise.iter().enumerate().map(|(k, noise)| noise + 3.0 * (k as f64 / 300.0).sin()).collect();
        let found = check(&drift, sigma);
        assert_eq!(found.opinion, FloorOpinion::AboveFloor);
        // A drift leaves few independent squares, and the noise seen is still that of the rows.
        assert!(found.effective_rows < 100.0 && (found.noise_seen.unwrap() / sigma - 1.0).abs() < 0.2, "{found:?}");
    }
}
