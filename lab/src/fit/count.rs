//! What the noise of a current adds up to, and what that does to parameters.
//!
//! A battery's model counts charge, and so the noise of every reading stays in the count: a random walk, of which residuals at rest show
//! little from row to row, and which a fit takes for drops that come slowly. With q_j the deviation of the charge that row j counts (as state of charge),
//! and D_k what a step of charge does to the weighted residual of row k, the parameters err by
//!
//! `Cov = Σ_j q_j² g_j g_jᵀ`,  `g_j = Σ_(k >= j) A⁻¹ J_kᵀ D_k`.
//!
//! No formula per effect is needed: D is the difference of two predictions that begin at other charges.

use energy::units::S_PER_H;
use energy::{Channel, Facts, Model};
use nalgebra::{DMatrix, DVector};

use super::Problem;
use super::certainty::Segment;
use crate::predict::predict;
use crate::prepare::Prepared;

/// Step of the state of charge by which its influence on a row is taken.
pub(crate) const STEP_SOC: f64 = 1e-3;
/// A walk that has come to less than this part of a row's deviation by the end of a log is none: what it does to parameters is less than what the rows do.
pub(crate) const NOTHING: f64 = 0.05;

/// The walk of one log.
#[derive(Debug, Clone, PartialEq)]
pub struct Walk {
    /// Index of the log.
    log: usize,
    /// By row of the log: deviation of the charge that it counts, as state of charge.
    steps: Vec<f64>,
    /// By segment of the fit, in order: what a step of charge does to the weighted residual of each of its rows; empty for those of other logs.
    slopes: Vec<Vec<f64>>,
}

impl Problem<'_> {
    /// The walks of all logs that matter beside the noise of their rows.
    pub(super) fn walks(&self, segments: &[Segment], at: &[f64]) -> Vec<Walk> {
        let Facts::Battery(facts) = &self.model.facts else { return Vec::new() };
        let values = self.values(at);
        let walk = |(index, log): (usize, &Prepared)| {
            let steps = steps(self.model, log, facts.capacity_ah);
            let whole = steps.iter().map(|step| step * step).sum::<f64>().sqrt();
            let volts_per_soc = facts.stored_wh() / facts.capacity_ah;
            // No cell's voltage rises by more than it is on average over a whole charge, but where it is nearly empty.
            let most = log.targets.iter().map(|target| whole * volts_per_soc / self.weight(target.channel)).fold(0.0, f64::max);
            if most < NOTHING {
                return None;
            }
            let mut fuller = log.clone();
            fuller.start.soc += STEP_SOC;
            let (begun, fuller) = (predict(self.model, log, &values), predict(self.model, &fuller, &values));
            let slopes = segments.iter().map(|segment| {
                let both = (segment.log == index).then(|| Some((begun.of(segment.channel)?, fuller.of(segment.channel)?))).flatten();
                let weight = self.weight(segment.channel);
                both.map_or_else(Vec::new, |(begun, fuller)| {
                    segment.rows.iter().map(|&row| (begun[row] - fuller[row]) / STEP_SOC / weight).collect()
                })
            });
            Some(Walk { log: index, steps, slopes: slopes.collect() })
        };
        self.logs.iter().enumerate().filter_map(walk).collect()
    }
}

/// By row: deviation of the charge that its reading of the current counts, as state of charge.
pub(crate) fn steps(model: &Model, log: &Prepared, capacity_ah: f64) -> Vec<f64> {
    let sigma_a = model.sensor(Channel::CurrentA).floor();
    let readings = |row: usize| log.readings.get(row).copied().unwrap_or(1.0);
    let step = |row: usize| match row.checked_sub(1) {
        Some(before) => sigma_a / readings(row).sqrt() * (log.time_s[row] - log.time_s[before]) / S_PER_H / capacity_ah,
        None => 0.0,
    };
    (0..log.time_s.len()).map(step).collect()
}

/// What all walks add to the covariance of the parameters; `influence` is what each row of the fit moves each of them by.
pub(super) fn covariance(walks: &[Walk], segments: &[Segment], influence: &DMatrix<f64>) -> DMatrix<f64> {
    let count = influence.nrows();
    let mut sum = DMatrix::zeros(count, count);
    for walk in walks {
        // By row of the log, of all its segments together.
        let mut moved: Vec<DVector<f64>> = vec![DVector::zeros(count); walk.steps.len()];
        for (segment, slopes) in segments.iter().zip(&walk.slopes).filter(|(segment, _)| segment.log == walk.log) {
            for ((&row, slope), place) in segment.rows.iter().zip(slopes).zip(segment.range.clone()) {
                moved[row].axpy(*slope, &influence.column(place), 1.0);
            }
        }
        let mut after = DVector::zeros(count);
        for (moved, step) in moved.iter().zip(&walk.steps).rev() {
            after += moved;
            sum.ger(step * step, &after, &after, 1.0);
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_of_what_walks_errs_as_the_walk_says() {
        // The mean of n rows that each see all steps of the walk so far: by hand, the variance is sum of (share of rows after j)², n / 3 steps.
        let n = 300;
        let segments = [Segment { log: 0, channel: Channel::VoltageV, range: 0..n, rows: (0..n).collect(), floor: 0.0 }];
        let walk = Walk { log: 0, steps: vec![0.1; n], slopes: vec![vec![2.0; n]] };
        let found = covariance(&[walk], &segments, &DMatrix::from_element(1, n, 1.0 / n as f64))[(0, 0)];
        let expected = 0.01 * 4.0 * n as f64 / 3.0;
        assert!((found / expected - 1.0).abs() < 0.01, "{found} {expected}");
    }
}
