//! What the noise of measured inputs does to the numbers of a model.
//!
//! A model is fitted to a current that was measured, and the cell felt another. Least squares then take every resistance for a
//! little less than it is, the more the noise is beside what the current does (regression dilution: Fuller, Measurement Error
//! Models, 1987, section 1.1). How much follows from doing it once more: with as much noise again in the inputs the numbers move on by as
//! much again (simulation and extrapolation: Cook and Stefanski, Journal of the American Statistical Association 89, 1994, p. 1314; here on a
//! straight line, one step of Gauss and Newton for each of the draws, which come in mirrored pairs, so that only what does not average out is
//! left). No formula per effect is needed.

use std::sync::Arc;

use nalgebra::DVector;

use super::descent::{Derived, Place};
use super::frame::Frame;
use super::judge::explained;
use super::lens::Absorber;
use super::state::{State, all};
use crate::input_noise::with_more_noise;

/// Mirrored pairs of draws.
const PAIRS: usize = 4;

impl State {
    /// The state that explains its rows as well, with numbers that the noise of inputs has not drawn aside. The same where that noise does not
    /// count, or where something is left that is no noise.
    #[must_use]
    pub fn undiluted(self) -> State {
        let (frame, evidence) = (&self.frame, &self.frame.evidence);
        if !evidence.noise_of_inputs_counts() || !explained(&self) {
            return self;
        }
        let by = all(frame);
        let mut pull = DVector::zeros(by.len());
        for (sequence, mirrored) in (0..PAIRS).flat_map(|sequence| [(sequence, false), (sequence, true)]) {
            let logs = evidence.logs.iter().map(|log| with_more_noise(&frame.model, log, sequence, mirrored)).collect();
            let noisier = Frame::new(Arc::clone(&frame.model), Arc::new(evidence.with_inputs_of(logs)));
            pull += Place::at(&noisier, self.x.clone(), self.noise.clone(), &by, Derived::Here).lens.pull;
        }
        let here = self.lens(&self.noise);
        let moves = Absorber::new(&here, self.held()).solve(pull / (2 * PAIRS) as f64 - &here.pull);
        let back = |((x, moves), (min, max)): ((&f64, &f64), (f64, f64))| (x - moves).clamp(min, max);
        let x = self.x.iter().zip(moves.iter()).zip(frame.bounds()).map(back).collect();
        let undiluted = State::of(Arc::clone(frame), Place::at(frame, x, self.noise.clone(), &by, Derived::Here));
        if explained(&undiluted) { undiluted } else { self }
    }
}
