//! Numbers without what the noise of measured inputs does to them.
//!
//! See [`crate::input_noise::noisier`]: what the numbers move by with as much noise again is taken back, here on a straight line, by one step
//! of Gauss and Newton for each of the draws.

use std::sync::Arc;

use nalgebra::DVector;

use super::descent::{Derived, Place};
use super::frame::Frame;
use super::judge::explained;
use super::lens::Absorber;
use super::state::{State, all};
use crate::input_noise::noisier;

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
        let (mut pull, mut draws) = (DVector::zeros(by.len()), 0.0);
        for logs in noisier(&frame.model, &evidence.logs, PAIRS) {
            let noisier = Frame::new(Arc::clone(&frame.model), Arc::new(evidence.with_inputs_of(logs)));
            pull += Place::at(&noisier, self.x.clone(), self.noise.clone(), &by, Derived::Here).lens.pull;
            draws += 1.0;
        }
        let here = self.lens(&self.noise);
        let moves = Absorber::new(&here, self.held()).solve(pull / draws - &here.pull);
        let back = |((x, moves), (min, max)): ((&f64, &f64), (f64, f64))| (x - moves).clamp(min, max);
        let x = self.x.iter().zip(moves.iter()).zip(frame.bounds()).map(back).collect();
        let undiluted = State::of(Arc::clone(frame), Place::at(frame, x, self.noise.clone(), &by, Derived::Here));
        if explained(&undiluted) { undiluted } else { self }
    }
}
