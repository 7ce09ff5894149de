//! The numbers that are told and written.
//!
//! Where a model explains its logs, they are the most likely ones. Where it does not, what is left lasts,
//! and beside slow noise the most likely numbers need not lower the error at all: the noise may last instead.
//! Nobody who reads an error or plans with a model wants that. So there the least squares are told: all rows
//! weigh the same, as if the noise were white, and as uncertain as the slow noise makes a level, so that what
//! is only roughly known is not bent to hide the error.
//!
//! Their deviations are those that the slow noise gives them: with derivatives J, weights W, covariance V of the
//! rows and prior information P, `H^-1 (J' W V W J + P) H^-1` where `H = J' W J + P` (the sandwich of White,
//! Econometrica 48, 1980, p. 817, for correlated rows as in Newey and West, Econometrica 55, 1987, p. 703).

use std::sync::Arc;

use energy::Channel;
use nalgebra::DMatrix;

use super::descent::{Asked, Place, descend_from};
use super::frame::Frame;
use super::judge::explained;
use super::lens::{Lens, square};
use super::noise::Noise;
use super::state::{State, all, filters, noises};

/// Times that the weights are asked for: they follow from what the fit before left.
const ROUNDS: usize = 2;
/// Share of the information in the clearest direction below which there is none.
const NONE: f64 = 1e-12;

impl State {
    /// This state with the numbers that are told: its own where it explains its logs, the least squares
    /// elsewhere.
    #[must_use]
    pub fn told(&self) -> &State {
        if explained(self) { self } else { self.least_squares.get_or_init(|| Box::new(self.with_least_squares())) }
    }

    /// The noise by which the numbers told weigh rows.
    pub(super) fn weights(&self) -> Vec<(Channel, Noise)> {
        if explained(self) { self.noise.clone() } else { levelled(&self.frame, &self.noise) }
    }

    fn with_least_squares(&self) -> State {
        let frame = &self.frame;
        let by = all(frame);
        let seen = |place: &Place, noise: Vec<(Channel, Noise)>| Place {
            lens: Lens::new(frame, &place.x, &by, &place.slopes, &place.residual, filters(frame, &noise)),
            noise,
            ..place.clone()
        };
        let mut place = self.place();
        let mut lens = None;
        for _ in 0..ROUNDS {
            place = descend_from(frame, seen(&place, levelled(frame, &place.noise)), &by, Asked::Never);
            place.noise = as_large_as_what_is_left(frame, noises(frame, &place.residual), &place.residual);
            lens = Some((place.lens.clone(), place.slopes.clone()));
        }
        let mut state = State::of(Arc::clone(frame), seen(&place, place.noise.clone()));
        if let Some((lens, slopes)) = lens {
            state.normal = information(&state, &lens, slopes);
        }
        state
    }
}

/// The same noise with a slow part of all that is left beside the white one. What is left of a wrong model is smoother from row to row
/// than noise that forgets, and the most likely such noise too small for it: the same steps, but a level that is as uncertain as
/// what is left is large.
fn as_large_as_what_is_left(frame: &Frame, noise: Vec<(Channel, Noise)>, residual: &[f64]) -> Vec<(Channel, Noise)> {
    let left = super::state::rms(&frame.evidence, residual);
    let of = |(channel, noise): (Channel, Noise)| {
        let rms = left.iter().find(|(of, _)| *of == channel).map_or(0.0, |(_, rms)| *rms);
        (channel, noise.with_slow((rms.powi(2) - noise.white.powi(2)).max(0.0).sqrt()))
    };
    noise.into_iter().map(of).collect()
}

/// The same noise with nothing slow in it; see [`Noise::levelled`].
fn levelled(frame: &Frame, noise: &[(Channel, Noise)]) -> Vec<(Channel, Noise)> {
    let of = |&(channel, noise): &(Channel, Noise)| (channel, noise.levelled(frame.evidence.step_s(channel)));
    noise.iter().map(of).collect()
}

/// The inverse of the covariance of numbers that were found by these weights, under the state's noise.
fn information(state: &State, weighed: &Lens, slopes: DMatrix<f64>) -> DMatrix<f64> {
    let frame = &state.frame;
    let columns = slopes.nrows();
    if columns == 0 {
        return weighed.normal.clone();
    }
    // W J', and V of it.
    let mut weighted = weighed.design.clone();
    for (segment, filter) in frame.evidence.segments.iter().zip(&weighed.filters) {
        filter.apply_to_all(&mut weighted.as_mut_slice()[segment.range().start * columns..segment.range().end * columns], columns);
    }
    let mut spread = weighted.clone();
    for segment in &frame.evidence.segments {
        let Some((_, noise)) = state.noise.iter().find(|(channel, _)| *channel == segment.channel) else { continue };
        let range = segment.range().start * columns..segment.range().end * columns;
        noise.spread_all(&segment.time_s, &segment.worth, &mut spread.as_mut_slice()[range], columns);
    }
    let meat = super::lens::product(&weighted, &spread) + (&weighed.normal - square(&weighed.design));
    let inverse = pseudo_inverse(&meat, &weighed.normal);
    &weighed.normal * inverse * &weighed.normal
}

/// The inverse within what the matrix determines, in units of what another says of each unknown alone.
fn pseudo_inverse(matrix: &DMatrix<f64>, units: &DMatrix<f64>) -> DMatrix<f64> {
    let scale: Vec<f64> = units.diagonal().iter().map(|d| if *d > 0.0 { d.sqrt() } else { 1.0 }).collect();
    let size = scale.len();
    let eigen = DMatrix::from_fn(size, size, |i, j| 0.5 * (matrix[(i, j)] + matrix[(j, i)]) / (scale[i] * scale[j])).symmetric_eigen();
    let floor = NONE * eigen.eigenvalues.max().max(0.0);
    let determined = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter()).filter(|(value, _)| **value > floor);
    let inverse =
        determined.fold(DMatrix::zeros(size, size), |sum: DMatrix<f64>, (value, vector)| sum + vector * vector.transpose() / *value);
    DMatrix::from_fn(size, size, |i, j| inverse[(i, j)] / (scale[i] * scale[j]))
}
