//! The way to the most likely unknowns: Gauss-Newton steps, with the noise asked for again after
//! each, and damping where a step leads up (see [`crate::fit`]).

use energy::Channel;
use nalgebra::DMatrix;

use super::frame::Frame;
use super::lens::{Lens, sigma};
use super::noise::Noise;
use super::state::{filters, likelihood, noises, observed};
use crate::fit::{damped_step, held, promised};

/// Steps after which the search gives up.
const STEPS_MAX: usize = 40;
/// Damping at which a step has become too short to matter.
const DAMPING_MAX: f64 = 1e14;
/// Fall of the cost that is not worth another step: in units of two log-likelihoods, and as a share
/// of the cost, which is far above its number of rows while the model is far from right.
const ENOUGH: (f64, f64) = (0.02, 1e-6);

/// Where a search stands.
#[derive(Debug, Clone)]
pub(super) struct Place {
    pub(super) x: Vec<f64>,
    pub(super) noise: Vec<(Channel, Noise)>,
    /// Observed minus predicted.
    pub(super) residual: Vec<f64>,
    /// Derivatives of the predictions by the unknowns that move.
    pub(super) slopes: DMatrix<f64>,
    pub(super) lens: Lens,
}

impl Place {
    /// At given unknowns and noise.
    pub(super) fn at(frame: &Frame, x: Vec<f64>, noise: Vec<(Channel, Noise)>, by: &[usize]) -> Place {
        let (predicted, slopes) = frame.linearise(&x, by);
        let residual: Vec<f64> = observed(frame).zip(&predicted).map(|(observed, predicted)| observed - predicted).collect();
        let lens = Lens::new(frame, &x, by, &slopes, &residual, &noise);
        Place { x, noise, residual, slopes, lens }
    }
}

/// Whether the noise is asked for again on the way.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Asked {
    /// It stays what it is.
    Never,
    /// After every step.
    Always,
}

/// The most likely values of some unknowns, from `start` on.
pub(super) fn descend(frame: &Frame, start: &[f64], noise: &[(Channel, Noise)], by: &[usize], asked: Asked) -> Place {
    let all = frame.bounds();
    let bounds: Vec<(f64, f64)> = by.iter().map(|&unknown| all[unknown]).collect();
    let mut x = start.to_vec();
    by.iter().zip(&bounds).for_each(|(&unknown, (min, max))| x[unknown] = x[unknown].clamp(*min, *max));
    let mut place = Place::at(frame, x, noise.to_vec(), by);
    let (mut scale, mut damping) = (vec![0.0_f64; by.len()], 1e-4);
    for _ in 0..STEPS_MAX {
        let Place { x, lens, .. } = &place;
        let enough = ENOUGH.0 + ENOUGH.1 * lens.whitened.norm_squared();
        scale.iter_mut().zip(lens.normal.diagonal().iter()).for_each(|(scale, d)| *scale = scale.max(*d));
        let gradient = -&lens.pull;
        let here: Vec<f64> = by.iter().map(|&unknown| x[unknown]).collect();
        let moving: Vec<usize> = (0..by.len()).filter(|&index| held(here[index], bounds[index], gradient[index]).is_none()).collect();
        let mut next = None;
        while damping < DAMPING_MAX {
            let step = damped_step(&lens.normal, &gradient, &scale, damping, &moving, &here, &bounds);
            if promised(&lens.normal, &gradient, &step) < enough {
                break;
            }
            let mut tried = x.clone();
            for ((&unknown, step), (min, max)) in by.iter().zip(step.iter()).zip(&bounds) {
                tried[unknown] = (tried[unknown] + step).clamp(*min, *max);
            }
            let residual = super::state::residual(frame, &tried);
            let cost = likelihood(frame, &residual, &lens.filters) + known(frame, &tried, by);
            if cost < lens.cost {
                damping = (damping / 10.0).max(1e-15);
                next = Some((tried, residual, cost));
                break;
            }
            damping *= 10.0;
        }
        let Some((x, residual, cost)) = next else { break };
        let settled = lens.cost - cost <= enough;
        let mut noise = place.noise.clone();
        if asked == Asked::Always {
            let new = noises(frame, &residual);
            let better = likelihood(frame, &residual, &filters(frame, &new)) <= likelihood(frame, &residual, &lens.filters);
            noise = if better { new } else { noise };
        }
        place = Place::at(frame, x, noise, by);
        if settled {
            break;
        }
    }
    place
}

/// What is known of the rough numbers among these unknowns, against their values.
fn known(frame: &Frame, x: &[f64], by: &[usize]) -> f64 {
    by.iter().filter_map(|&unknown| Some((x[unknown] / sigma(frame, unknown)?).powi(2))).sum()
}
