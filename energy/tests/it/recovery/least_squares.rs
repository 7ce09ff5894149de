//! Bounded least squares on the parameters of one effect, with exact derivatives.

use std::sync::Arc;

use energy::real::{LANES, derivative, variable};
use energy::{Channel, Dual, Model, Run};
use nalgebra::{DMatrix, DVector};

use super::excitation::Log;

/// A finished fit.
pub struct Fit {
    /// All parameters of the effect.
    pub values: Vec<f64>,
    /// Their deviations; zero of what was not free.
    pub sigmas: Vec<f64>,
    /// Sum of squared residuals in units of the noise, per row.
    pub chi2_per_row: f64,
}

/// Steps of the search.
const STEPS_MAX: usize = 200;

struct Problem<'a> {
    model: &'a Arc<Model>,
    /// Indices of the parameters in the model.
    free: Vec<usize>,
    logs: &'a [Log],
    channels: &'a [Channel],
    measured: &'a [f64],
    sigmas: &'a [f64],
}

impl Problem<'_> {
    fn values(&self, at: &DVector<f64>) -> Vec<f64> {
        let mut values = self.model.values();
        for (&index, &value) in self.free.iter().zip(at.iter()) {
            values[index] = value;
        }
        values
    }

    /// What the model misses, in units of the noise, and its derivatives.
    fn residuals(&self, at: &DVector<f64>) -> (DVector<f64>, DMatrix<f64>) {
        let values = self.values(at);
        let mut residuals = DVector::zeros(self.measured.len());
        let mut jacobian = DMatrix::zeros(self.measured.len(), self.free.len());
        for (pass, lanes) in self.free.chunks(LANES).enumerate() {
            let mut duals: Vec<Dual> = values.iter().map(|&value| Dual::from(value)).collect();
            for (lane, &index) in lanes.iter().enumerate() {
                duals[index] = variable(values[index], lane);
            }
            let mut row_index = 0;
            for log in self.logs {
                let mut run = Run::with_parameters(Arc::clone(self.model), duals.clone(), log.start.lifted());
                for row in &log.rows {
                    row.apply(&mut run);
                    for (&channel, sigma) in self.channels.iter().zip(self.sigmas) {
                        let predicted = &run.channels[channel];
                        residuals[row_index] = (self.measured[row_index] - predicted.re) / sigma;
                        for lane in 0..lanes.len() {
                            jacobian[(row_index, pass * LANES + lane)] = derivative(predicted, lane) / sigma;
                        }
                        row_index += 1;
                    }
                }
            }
        }
        (residuals, jacobian)
    }
}

/// Fits the parameters of one effect from the model's values on, those that `free` names, by
/// Levenberg-Marquardt steps within the parameters' bounds. A weak prior as wide as a parameter's range keeps what the logs
/// do not show where it is, and hardly moves what they do.
pub fn fit(model: &Arc<Model>, effect: &str, free: &[&str], logs: &[Log], channels: &[Channel], measured: &[f64], sigmas: &[f64]) -> Fit {
    let all = model.parameters();
    let own: Vec<usize> = (0..all.len()).filter(|&index| all[index].effect == effect).collect();
    let free: Vec<usize> = own.iter().copied().filter(|&index| free.contains(&all[index].name)).collect();
    let problem = Problem { model, free, logs, channels, measured, sigmas };
    let of = |f: fn(&energy::Parameter) -> f64| DVector::from_iterator(problem.free.len(), problem.free.iter().map(|&i| f(&all[i])));
    let (min, max, start) = (of(|p| p.min), of(|p| p.max), of(|p| p.value));
    let range = &max - &min;
    // In units of their ranges, parameters are comparable and the prior is a unit matrix.
    let prior = DMatrix::<f64>::identity(start.len(), start.len());
    let cost = |residuals: &DVector<f64>, at: &DVector<f64>| {
        let moved = (at - &start).component_div(&range);
        residuals.norm_squared() + moved.norm_squared()
    };
    let mut at = start.clone();
    let (mut residuals, mut jacobian) = problem.residuals(&at);
    let mut best = cost(&residuals, &at);
    let mut damping = 1e-3;
    for _ in 0..STEPS_MAX {
        let scaled = &jacobian * DMatrix::from_diagonal(&range);
        let moved = (&at - &start).component_div(&range);
        let slope = scaled.transpose() * &residuals - &moved;
        let curvature = scaled.transpose() * &scaled + &prior;
        // What stands at a bound and is pushed beyond it stays out of the step.
        let held: Vec<bool> = (0..at.len()).map(|i| (at[i] <= min[i] && slope[i] < 0.0) || (at[i] >= max[i] && slope[i] > 0.0)).collect();
        let (mut system, mut right) = (curvature.clone(), slope.clone());
        for i in (0..at.len()).filter(|&i| held[i]) {
            system.fill_row(i, 0.0);
            system.fill_column(i, 0.0);
            system[(i, i)] = 1.0;
            right[i] = 0.0;
        }
        for i in 0..at.len() {
            system[(i, i)] *= 1.0 + damping;
        }
        let Some(step) = system.lu().solve(&right) else { break };
        let mut next = &at + step.component_mul(&range);
        for i in 0..next.len() {
            next[i] = next[i].clamp(min[i], max[i]);
        }
        let (next_residuals, next_jacobian) = problem.residuals(&next);
        let next_cost = cost(&next_residuals, &next);
        if next_cost < best {
            let gain = best - next_cost;
            (at, residuals, jacobian, best) = (next, next_residuals, next_jacobian, next_cost);
            damping = (damping * 0.2).max(1e-12);
            if gain < 1e-6 {
                break;
            }
        } else {
            damping *= 5.0;
            if damping > 1e12 {
                break;
            }
        }
    }
    let scaled = &jacobian * DMatrix::from_diagonal(&range);
    let covariance = (scaled.transpose() * &scaled + &prior).try_inverse().expect("a prior makes it regular");
    let values = problem.values(&at);
    let sigma = |index: &usize| problem.free.iter().position(|free| free == index).map_or(0.0, |i| covariance[(i, i)].sqrt() * range[i]);
    Fit {
        values: own.iter().map(|&index| values[index]).collect(),
        sigmas: own.iter().map(sigma).collect(),
        chi2_per_row: residuals.norm_squared() / residuals.len() as f64,
    }
}
