//! Calibrates the free parameters of a model on all logs together.
//!
//! Minimises the sum of ((observed - predicted) / sigma)² over every row that counts, with exact
//! derivatives. sigma is the sensor's floor and, for a voltage, the deviation of the OCV table
//! beside it (uncertainty.ocv_sigma_v per cell): constant over a channel, so that it sets the
//! weight between channels and leaves the answer on one channel that of plain least squares, but for what
//! the noise of measured inputs does to that.

mod bounded;
pub mod calibrated;
mod certainty;
mod choice;
pub(crate) mod count;
mod dilution;
mod step;

use std::sync::Arc;

use energy::{Channel, Facts, Model};
use nalgebra::{DMatrix, DVector};

pub(crate) use bounded::held;
pub use bounded::{LeastSquares, Side, Solution, Step, minimise};
pub(crate) use certainty::wider;
pub use certainty::{Certainty, Segment, SegmentCertainty, certainty, uniform_sigma};
pub use choice::{ChoiceError, free_parameters};
pub(crate) use step::{damped_step, promised};

use crate::predict::sensitivities;
use crate::prepare::{Prepared, Target};

/// Why a fit cannot begin.
#[derive(Debug, thiserror::Error)]
pub enum FitError {
    /// Which parameters are free is not clear.
    #[error(transparent)]
    Choice(#[from] ChoiceError),
    /// Channels of different units cannot be weighed against each other.
    #[error(
        "the model states no sensor floor for {channel}, which is fitted beside {others}: add [sensor.{channel}] sigma = ... to weigh them"
    )]
    NoWeight {
        /// The channel without a floor.
        channel: &'static str,
        /// The other channels.
        others: String,
    },
    /// Fewer rows than parameters.
    #[error("{rows} rows cannot determine {parameters} parameters")]
    TooFewRows {
        /// Rows that count.
        rows: usize,
        /// Free parameters.
        parameters: usize,
    },
    /// The model leaves the range of numbers.
    #[error("the model predicts no finite number for some row at its present parameters")]
    NotFinite,
}

/// A finished fit.
#[derive(Debug, Clone)]
pub struct Fit {
    /// Indices of the free parameters into [`Model::parameters`].
    pub free: Vec<usize>,
    /// Values of all parameters after the fit, in the order of [`Model::parameters`].
    pub values: Vec<f64>,
    /// How the minimum was reached.
    pub solution: Solution,
    /// How well it is determined.
    pub certainty: Certainty,
    /// Rows that counted.
    pub rows: usize,
}

/// Fits the parameters of the given indices on all logs, and tells every step to `progress`.
///
/// # Errors
/// When channels cannot be weighed or rows are too few.
pub fn fit(model: &Arc<Model>, logs: &[Prepared], free: &[usize], progress: &mut dyn FnMut(Step)) -> Result<Fit, FitError> {
    let weights = weights(model, logs)?;
    let problem = Problem { model, logs, free, weights };
    let rows: usize = problem.targets().map(|(_, target, _)| target.used.iter().filter(|&&used| used).count()).sum();
    if rows < free.len() {
        return Err(FitError::TooFewRows { rows, parameters: free.len() });
    }
    let parameters = || free.iter().map(|&index| &model.parameters()[index]);
    let start: Vec<f64> = parameters().map(|parameter| parameter.value).collect();
    let bounds: Vec<(f64, f64)> = parameters().map(|parameter| (parameter.min, parameter.max)).collect();
    if !problem.at(&start).0.iter().all(|residual| residual.is_finite()) {
        return Err(FitError::NotFinite);
    }
    let (solution, is_noise) = problem.undiluted(minimise(&problem, &start, &bounds, progress), &bounds);
    let segments = problem.segments();
    let walks = problem.walks(&segments, &solution.at);
    let certainty = certainty(&solution.jacobian, &solution.residual, &segments, &bounds, is_noise, &walks);
    let values = problem.values(&solution.at);
    Ok(Fit { free: free.to_vec(), values, solution, certainty, rows })
}

/// The deviation by which a channel's residuals are divided.
fn weights(model: &Model, logs: &[Prepared]) -> Result<Vec<(Channel, f64)>, FitError> {
    let mut sigmas: Vec<(Channel, f64)> = Vec::new();
    for target in logs.iter().flat_map(|log| &log.targets) {
        if sigmas.iter().any(|(channel, _)| *channel == target.channel) {
            continue;
        }
        let table_v = match &model.facts {
            Facts::Battery(facts) if target.channel == Channel::VoltageV => model.uncertainty.ocv_sigma_v * f64::from(facts.series),
            _ => 0.0,
        };
        sigmas.push((target.channel, target.floor.hypot(table_v)));
    }
    let several = sigmas.len() > 1;
    if let Some((unknown, _)) = sigmas.iter().find(|(_, sigma)| *sigma == 0.0 && several) {
        let others = sigmas.iter().filter(|(channel, _)| channel != unknown).map(|(channel, _)| channel.name());
        return Err(FitError::NoWeight { channel: unknown.name(), others: others.collect::<Vec<_>>().join(", ") });
    }
    // Alone, a channel's weight does not move the answer.
    Ok(sigmas.into_iter().map(|(channel, sigma)| (channel, if sigma == 0.0 { 1.0 } else { sigma })).collect())
}

/// The fit as a problem in free parameters only.
struct Problem<'a> {
    model: &'a Arc<Model>,
    logs: &'a [Prepared],
    free: &'a [usize],
    weights: Vec<(Channel, f64)>,
}

impl Problem<'_> {
    fn values(&self, at: &[f64]) -> Vec<f64> {
        let mut values = self.model.values();
        for (&index, &value) in self.free.iter().zip(at) {
            values[index] = value;
        }
        values
    }

    fn weight(&self, channel: Channel) -> f64 {
        self.weights.iter().find(|(known, _)| *known == channel).map_or(1.0, |(_, sigma)| *sigma)
    }

    fn targets(&self) -> impl Iterator<Item = (usize, &Target, f64)> {
        let logs = self.logs.iter().enumerate();
        logs.flat_map(move |(index, log)| log.targets.iter().map(move |target| (index, target, self.weight(target.channel))))
    }

    /// Which rows of the problem belong to which log and channel.
    fn segments(&self) -> Vec<Segment> {
        let mut begin = 0;
        let segment = |(log, target, sigma): (usize, &Target, f64)| {
            let rows: Vec<usize> = used(target).collect();
            let range = begin..begin + rows.len();
            begin = range.end;
            Segment { log, channel: target.channel, range, rows, floor: target.floor / sigma }
        };
        self.targets().map(segment).collect()
    }
}

fn used(target: &Target) -> impl Iterator<Item = usize> {
    target.used.iter().enumerate().filter(|(_, used)| **used).map(|(row, _)| row)
}

impl LeastSquares for Problem<'_> {
    fn at(&self, parameters: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
        let values = self.values(parameters);
        let mut columns: Vec<Vec<f64>> = vec![Vec::new(); self.free.len()];
        let mut residual = Vec::new();
        let mut by_log: Vec<_> = self.logs.iter().map(|log| sensitivities(self.model, log, &values, self.free).into_iter()).collect();
        for (log, target, sigma) in self.targets() {
            let seen = by_log[log].next().unwrap_or_default();
            residual.extend(used(target).map(|row| (target.observed[row] - seen.predicted[row]) / sigma));
            for (column, derivatives) in columns.iter_mut().zip(seen.by) {
                column.extend(used(target).map(|row| -derivatives[row] / sigma));
            }
        }
        (DVector::from_vec(residual), DMatrix::from_vec(columns.first().map_or(0, Vec::len), self.free.len(), columns.concat()))
    }
}
