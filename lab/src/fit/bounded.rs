//! Least squares within bounds: Levenberg-Marquardt with an active set.
//!
//! Each step solves (JᵀJ + λ D) δ = -Jᵀr over the parameters that are not held at a bound, with D
//! the largest diagonal of JᵀJ seen so far (Moré 1978: the answer then does not depend on the
//! units of the parameters), and is cut off at the bounds. Deterministic.

use nalgebra::{DMatrix, DVector};

use super::step::{damped_step, promised};

/// A problem.
pub trait LeastSquares {
    /// Residuals at the parameters and their derivatives, one column per parameter.
    fn at(&self, parameters: &[f64]) -> (DVector<f64>, DMatrix<f64>);
}

/// The bound that a parameter rests on.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Its least value.
    Min,
    /// Its greatest value.
    Max,
}

/// One accepted step, for progress displays.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Number of the iteration, from 0 for the start.
    pub iteration: usize,
    /// Sum of squared residuals.
    pub cost: f64,
}

/// The end of a search.
#[derive(Debug, Clone)]
pub struct Solution {
    /// Parameters.
    pub at: Vec<f64>,
    /// Residuals there.
    pub residual: DVector<f64>,
    /// Their derivatives there.
    pub jacobian: DMatrix<f64>,
    /// The bound on which each parameter rests, if any.
    pub bound: Vec<Option<Side>>,
    /// Steps taken.
    pub iterations: usize,
    /// Whether the search ended because nothing better is near.
    pub converged: bool,
}

/// Steps after which the search gives up.
const ITERATIONS_MAX: usize = 200;
/// Fall of the cost, in mean squares of a residual, of which no step is worth its time: it would move no parameter by more than a ten-thousandth of
/// its standard deviation.
const FALL_LEAST: f64 = 1e-8;
/// Cosine between residual and any column of the Jacobian that counts as a right angle.
const COSINE_TOLERANCE: f64 = 1e-9;
/// Relative fall of the cost that counts as none.
const COST_TOLERANCE: f64 = 1e-12;
/// Damping at which a step has become too short to matter.
const DAMPING_MAX: f64 = 1e14;

/// Searches for the least sum of squared residuals within the bounds, from `start`.
pub fn minimise(problem: &impl LeastSquares, start: &[f64], bounds: &[(f64, f64)], progress: &mut dyn FnMut(Step)) -> Solution {
    let clamp = |at: Vec<f64>| -> Vec<f64> { at.iter().zip(bounds).map(|(x, (min, max))| x.clamp(*min, *max)).collect() };
    let mut at = clamp(start.to_vec());
    let (mut residual, mut jacobian) = problem.at(&at);
    let freedom = residual.len().saturating_sub(at.len()).max(1) as f64;
    let mut scale = vec![0.0_f64; at.len()];
    let mut damping = 1e-4;
    let mut iteration = 0;
    let mut settled = false;
    loop {
        let cost = residual.norm_squared();
        progress(Step { iteration, cost });
        let gradient = jacobian.tr_mul(&residual);
        let normal = jacobian.tr_mul(&jacobian);
        for (index, scale) in scale.iter_mut().enumerate() {
            *scale = scale.max(normal[(index, index)]);
        }
        let moving: Vec<usize> = (0..at.len()).filter(|&index| held(at[index], bounds[index], gradient[index]).is_none()).collect();
        let steepest = moving.iter().map(|&index| cosine(gradient[index], normal[(index, index)], cost)).fold(0.0, f64::max);
        settled |= steepest <= COSINE_TOLERANCE;
        let mut next = None;
        while !settled && iteration < ITERATIONS_MAX && damping < DAMPING_MAX {
            let step = damped_step(&normal, &gradient, &scale, damping, &moving, &at, bounds);
            if promised(&normal, &gradient, &step) < FALL_LEAST * cost / freedom {
                break;
            }
            let tried = clamp(at.iter().zip(step.iter()).map(|(x, step)| x + step).collect());
            let found = problem.at(&tried);
            if found.0.norm_squared() < cost {
                damping = (damping / 10.0).max(1e-15);
                next = Some((tried, found));
                break;
            }
            damping *= 10.0;
        }
        let Some((better, found)) = next else {
            let bound = (0..at.len()).map(|index| held(at[index], bounds[index], gradient[index])).collect();
            return Solution { at, residual, jacobian, bound, iterations: iteration, converged: iteration < ITERATIONS_MAX };
        };
        (at, (residual, jacobian)) = (better, found);
        settled = cost - residual.norm_squared() <= COST_TOLERANCE * cost;
        iteration += 1;
    }
}

/// The bound that a parameter rests on and against which the cost falls.
pub(crate) fn held(x: f64, (min, max): (f64, f64), gradient: f64) -> Option<Side> {
    match () {
        () if x <= min && gradient > 0.0 => Some(Side::Min),
        () if x >= max && gradient < 0.0 => Some(Side::Max),
        () => None,
    }
}

fn cosine(gradient: f64, column_squared: f64, cost: f64) -> f64 {
    let product = (column_squared * cost).sqrt();
    if product > 0.0 { gradient.abs() / product } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Rosenbrock's valley: minimum 0 at (1, 1).
    struct Valley;

    impl LeastSquares for Valley {
        fn at(&self, x: &[f64]) -> (DVector<f64>, DMatrix<f64>) {
            let residual = DVector::from_vec(vec![10.0 * (x[1] - x[0] * x[0]), 1.0 - x[0]]);
            (residual, DMatrix::from_row_slice(2, 2, &[-20.0 * x[0], 10.0, -1.0, 0.0]))
        }
    }

    #[test]
    fn finds_the_end_of_the_valley() {
        let solution = minimise(&Valley, &[-1.2, 1.0], &[(-5.0, 5.0), (-5.0, 5.0)], &mut |_| {});
        assert!(solution.converged && solution.at.iter().all(|x| (x - 1.0).abs() < 1e-9), "{:?}", solution.at);
        assert_eq!(solution.bound, [None, None]);
    }

    #[test]
    fn rests_on_a_bound_and_says_so() {
        let solution = minimise(&Valley, &[-1.2, 1.0], &[(-5.0, 0.5), (-5.0, 5.0)], &mut |_| {});
        // With x at 0.5 the best y is its square. Of what is left, 0.5, its deviation is a tenth: a ten-thousandth of that is no step.
        assert!(solution.converged && (solution.at[1] - 0.25).abs() < 5e-6, "{:?}", solution.at);
        assert_eq!((solution.at[0], solution.bound[0]), (0.5, Some(Side::Max)));
    }
}
