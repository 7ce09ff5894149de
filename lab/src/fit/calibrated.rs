//! A fit beside which all that is known only roughly of sensors and logs is at its best too: offsets, gains and delays, and how logs
//! begin, each held by the deviation that the model or the log states for it.
//!
//! The sigma of a number that hangs on them is as wide as they leave it. A fit that takes them as exact gives each of their errors to the
//! parameters, and is as certain of that as of all else.

use std::sync::Arc;

use energy::Model;
use nalgebra::DMatrix;

use super::{Fit, FitError, LeastSquares as _, Problem, Side, Solution, Step, certainty, fit, weights};
use crate::infer::answer::deviations;
use crate::infer::calibrate::{corrected, fitted};
use crate::learned::{LeftOut, left_out};
use crate::prepare::Prepared;
use crate::report::discovery::learned_lines;

/// A fit, the logs as they would read had their sensors no errors, and what these were found to be.
#[derive(Debug, Clone)]
pub struct CalibratedFit {
    /// The fit, as of these logs.
    pub fit: Fit,
    /// The logs without what was found.
    pub logs: Vec<Prepared>,
    /// What sensors and starts were off by, where that is more than nothing.
    pub found: Vec<LeftOut>,
}

impl CalibratedFit {
    /// What was found, a line each.
    #[must_use]
    pub fn words(&self) -> Vec<String> {
        learned_lines(&self.found).lines().map(str::to_owned).collect()
    }
}

/// Distance from a bound, as a share of the range, at which a number rests on it.
const ON_BOUND: f64 = 1e-9;

/// Fits the parameters of the given indices together with all that model and logs state to be known only roughly of sensors and starts; as
/// [`fit`] where that is nothing.
///
/// # Errors
/// As [`fit`].
pub fn fit_calibrated(
    model: &Arc<Model>,
    logs: &[Prepared],
    free: &[usize],
    progress: &mut dyn FnMut(Step),
) -> Result<CalibratedFit, FitError> {
    let plain = fit(model, logs, free, progress)?;
    let Some(state) = fitted(model, free, logs) else {
        return Ok(CalibratedFit { fit: plain, logs: logs.to_vec(), found: Vec::new() });
    };
    let logs = corrected(&state, logs);
    let found = deviations(&state);
    let of = |index: &usize| found.iter().find(|(own, ..)| own == index).map(|(_, value, sigma)| (*value, *sigma));
    let parameters = || free.iter().map(|&index| &model.parameters()[index]);
    let at: Vec<f64> = free.iter().zip(&plain.solution.at).map(|(index, &before)| of(index).map_or(before, |(value, _)| value)).collect();
    let problem = Problem { model, logs: &logs, free, weights: weights(model, &logs)? };
    let (residual, jacobian) = problem.at(&at);
    let bounds: Vec<(f64, f64)> = parameters().map(|parameter| (parameter.min, parameter.max)).collect();
    let segments = problem.segments();
    let mut certainty = certainty(&jacobian, &residual, &segments, &bounds, false, &problem.walks(&segments, &at));
    certainty.sigma = free.iter().map(|index| of(index).and_then(|(_, sigma)| sigma)).collect();
    certainty.correlation = correlation(&state.covariance_by_rows(), &state.frame.free, free, &certainty.sigma);
    let bound = |(&value, &(min, max)): (&f64, &(f64, f64))| {
        let near = ON_BOUND * (max - min);
        (value - min <= near).then_some(Side::Min).or_else(|| (max - value <= near).then_some(Side::Max))
    };
    let bound = at.iter().zip(&bounds).map(bound).collect();
    let mut values = model.values();
    free.iter().zip(&at).for_each(|(&index, &value)| values[index] = value);
    let solution = Solution { at, residual, jacobian, bound, ..plain.solution };
    let fit = Fit { free: free.to_vec(), values, rows: solution.residual.len(), solution, certainty };
    Ok(CalibratedFit { fit, logs, found: left_out(&state) })
}

/// Correlation between the wanted of several numbers, NaN where one has no deviation.
fn correlation(covariance: &DMatrix<f64>, known: &[usize], wanted: &[usize], sigma: &[Option<f64>]) -> DMatrix<f64> {
    let place = |index: usize| known.iter().position(|&own| own == wanted[index]).filter(|_| sigma[index].is_some());
    DMatrix::from_fn(wanted.len(), wanted.len(), |i, j| {
        let pair = place(i).zip(place(j));
        pair.map_or(f64::NAN, |(i, j)| covariance[(i, j)] / (covariance[(i, i)] * covariance[(j, j)]).sqrt())
    })
}
