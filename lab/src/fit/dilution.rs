//! A fit without what the noise of measured inputs does to its numbers.
//!
//! See [`crate::input_noise::noisier`]: with as much noise again the numbers move on by as much again, here on a straight line. Only where a model
//! explains its logs: what else is left would move with the noise too, and nobody knows how.

use nalgebra::DVector;

use super::certainty::inverse;
use super::{LeastSquares, Problem, Side, Solution};
use crate::compare::WITHIN;
use crate::floor::EXPLAINED;
use crate::input_noise::{input_noise, noisier, with_inputs};

/// Mirrored pairs of draws: where one number of a few hangs on thousands of rows, one is as good as many.
const PAIRS: usize = 1;

impl Problem<'_> {
    /// The minimum with numbers that the noise of inputs has not drawn aside; the same where that does not count. And whether noise is all that
    /// is left.
    pub(super) fn undiluted(&self, solution: Solution, bounds: &[(f64, f64)]) -> (Solution, bool) {
        let (counts, ratio) = self.over_floor(&solution);
        if !counts || ratio > EXPLAINED {
            return (solution, ratio <= WITHIN);
        }
        let (mut pull, mut draws) = (DVector::zeros(solution.at.len()), 0.0);
        for logs in noisier(self.model, self.logs, PAIRS) {
            let problem = Problem { model: self.model, logs: &logs, free: self.free, weights: self.weights.clone() };
            let (residual, jacobian) = problem.at(&solution.at);
            pull -= jacobian.tr_mul(&residual);
            draws += 1.0;
        }
        let mut moves = pull / draws + solution.jacobian.tr_mul(&solution.residual);
        let mut normal = solution.jacobian.tr_mul(&solution.jacobian);
        // What rests on a bound stays there.
        for held in (0..moves.len()).filter(|&index| solution.bound[index].is_some()) {
            normal.row_mut(held).fill(0.0);
            normal.column_mut(held).fill(0.0);
            (normal[(held, held)], moves[held]) = (1.0, 0.0);
        }
        let moves = inverse(&normal).0 * moves;
        let back = |((at, moves), (min, max)): ((&f64, &f64), &(f64, f64))| (at - moves).clamp(*min, *max);
        let at: Vec<f64> = solution.at.iter().zip(moves.iter()).zip(bounds).map(back).collect();
        let (residual, jacobian) = self.at(&at);
        let side = |((x, (min, max)), before): ((&f64, &(f64, f64)), &Option<Side>)| match *before {
            None if x <= min => Some(Side::Min),
            None if x >= max => Some(Side::Max),
            before => before,
        };
        let bound = at.iter().zip(bounds).zip(&solution.bound).map(side).collect();
        let undiluted = Solution { at, residual, jacobian, bound, ..solution.clone() };
        (if self.over_floor(&undiluted).1 <= EXPLAINED { undiluted } else { solution }, true)
    }

    /// Whether the noise of inputs adds to the floor of any channel, and RMS over floor of the worst; infinite where a floor is not known.
    fn over_floor(&self, solution: &Solution) -> (bool, f64) {
        let values = self.values(&solution.at);
        let of_inputs: Vec<_> = self.logs.iter().map(|log| input_noise(self.model, log, &values)).collect();
        let (mut counts, mut worst) = (false, 0.0_f64);
        for ((log, target, weight), segment) in self.targets().zip(self.segments()) {
            let noise = of_inputs[log].iter().find(|(channel, _)| *channel == target.channel).map_or(0.0, |(_, noise)| *noise);
            let floor = with_inputs(target.floor, noise);
            let rows = solution.residual.rows(segment.range.start, segment.range.len());
            let rms = weight * (rows.norm_squared() / rows.len().max(1) as f64).sqrt();
            counts |= floor > target.floor;
            worst = worst.max(if floor > 0.0 && rms.is_finite() { rms / floor } else { f64::INFINITY });
        }
        (counts, worst)
    }
}
