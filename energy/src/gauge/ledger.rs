//! The ledger of a charge count: what it can be wrong by, and what that does to the rest.
//!
//! ```text
//!   SoC' = SoC - (I - o)(1 - g) dt / (Q (1 + q)) - l dt          counted (by a step of the model)
//!   V    = OCV(SoC) + e(SoC) + v - V_eta - r(SoC) I              seen
//! ```
//!
//! o and g: offset (A) and gain of the current sensor; q: relative error of the capacity; l:
//! error of the self-discharge (1/s); e: error of the OCV table (V, see [`crate::ocv_error`]); v: offset of the
//! voltage sensor (V per cell); r: resistance beyond the model's (ohm per cell). None of them is
//! noise: each is the same error all the time, so all of them are states with a covariance. That
//! is why reading the same OCV again teaches nothing, and why a capacity that was too large makes
//! the state of charge wrong in proportion to the charge moved since it was last seen.
//!
//! One observation is a scalar, linearised over the spread of state of charge that is left after
//! it (iterated posterior linearisation, García-Fernández et al. 2015): on a flat stretch of OCV
//! the slope is nearly none and the curve's bend counts as noise, so that nothing jumps. States
//! that a gauge does not learn are *considered* (Schmidt): they keep their value and variance and
//! still widen what depends on them.

use nalgebra::{DMatrix, DVector};

use super::prediction::CurrentErrors;
use crate::ocv_error;
use crate::units::S_PER_H;
use crate::{Channel, Estimate, Model, OcvTable, Sensor};

/// State of charge.
pub(crate) const SOC: usize = 0;
/// Relative error of the capacity.
pub(crate) const CAPACITY: usize = 1;
const CURRENT_OFFSET: usize = 2;
const CURRENT_GAIN: usize = 3;
const LEAK: usize = 4;
const VOLTAGE_OFFSET: usize = 5;
const OCV: usize = 6;
/// First resistance.
pub(crate) const RESISTANCE: usize = OCV + ocv_error::KNOTS;
/// An innovation beyond this many of its deviations is a surprise: the pack is not the one that
/// the model describes, and what may differ from pack to pack is doubted until it fits.
pub(crate) const SURPRISE: f64 = 3.0;
/// Most that one surprise widens a deviation by.
const DOUBT_MAX: f64 = 3.0;
/// Passes of the linearisation.
const PASSES: usize = 5;

/// See the module's text.
#[derive(Debug, Clone)]
pub(crate) struct Ledger {
    x: DVector<f64>,
    p: DMatrix<f64>,
    current: Sensor,
}

/// A voltage of one cell that was seen.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Seen<'a> {
    /// Voltage of one cell, V.
    pub(crate) cell_v: f64,
    /// Variance of it that is not in the ledger's states, V².
    pub(crate) noise_v2: f64,
    /// How far the model says it lies below the voltage of the open-circuit table, V.
    pub(crate) below_v: f64,
    /// Current through one cell, A, for the resistances; with each one's share there.
    pub(crate) load: Option<(f64, &'a [f64])>,
    /// Whether capacity, self-discharge and the errors of both sensors may be learned from it.
    pub(crate) teaches_capacity: bool,
}

impl Ledger {
    /// A ledger without resistances, or with those of the given covariance (ohm² of a cell).
    /// `leak_sigma` is what self-discharge is unsure by, 1/s.
    pub(crate) fn new(model: &Model, soc: Estimate, leak_sigma: f64, resistance: Option<&DMatrix<f64>>) -> Self {
        let n = RESISTANCE + resistance.map_or(0, DMatrix::nrows);
        let (current, voltage) = (model.sensor(Channel::CurrentA), model.sensor(Channel::VoltageV));
        let mut p = DMatrix::zeros(n, n);
        let series = f64::from(model.battery().series);
        for (state, sigma) in [
            (SOC, soc.sigma),
            (CAPACITY, model.uncertainty.capacity_relative_sigma),
            (CURRENT_OFFSET, current.offset_sigma),
            (CURRENT_GAIN, current.gain_sigma),
            (LEAK, leak_sigma),
            (VOLTAGE_OFFSET, voltage.offset_sigma / series),
        ] {
            p[(state, state)] = sigma * sigma;
        }
        for one in 0..ocv_error::KNOTS {
            for other in 0..ocv_error::KNOTS {
                p[(OCV + one, OCV + other)] = ocv_error::covariance(&model.uncertainty, one, other);
            }
        }
        if let Some(resistance) = resistance {
            p.view_mut((RESISTANCE, RESISTANCE), resistance.shape()).copy_from(resistance);
        }
        let mut x = DVector::zeros(n);
        x[SOC] = soc.value;
        Self { x, p, current }
    }

    /// The best value of a state, with its deviation.
    pub(crate) fn state(&self, index: usize) -> Estimate {
        Estimate::new(self.x[index], self.p[(index, index)].max(0.0).sqrt())
    }

    /// Covariance of two states.
    pub(crate) fn covariance(&self, one: usize, other: usize) -> f64 {
        self.p[(one, other)]
    }

    /// Another pack with the same sensors: what is known of those stays.
    pub(crate) fn exchange(&mut self, fresh: &Ledger) {
        let keep = [CURRENT_OFFSET, CURRENT_GAIN, VOLTAGE_OFFSET];
        let mut other = fresh.clone();
        for one in keep {
            other.x[one] = self.x[one];
            for two in keep {
                other.p[(one, two)] = self.p[(one, two)];
            }
        }
        *self = other;
    }

    /// What is known by now of the current sensor, beside a prediction's inputs: the place of each
    /// in the ledger, none for one that it does not hold.
    pub(crate) fn current_errors(&self, inputs: &[Option<usize>]) -> CurrentErrors {
        CurrentErrors::of(&self.x, &self.p, [CURRENT_OFFSET, CURRENT_GAIN], inputs)
    }

    /// What the current sensor most likely means by what it shows, A.
    pub(crate) fn current_a(&self, shown_a: f64) -> f64 {
        (shown_a - self.x[CURRENT_OFFSET]) * (1.0 - self.x[CURRENT_GAIN])
    }

    /// Counts the charge of an interval: the share of capacity that moved by the model, and the
    /// current that was shown while it did; none while the pack is known to carry none.
    pub(crate) fn count(&mut self, dt_s: f64, moved: f64, shown_a: Option<f64>, capacity_ah: f64) {
        let share = dt_s / S_PER_H / capacity_ah / (1.0 + self.x[CAPACITY]);
        let mut by = [(LEAK, -dt_s), (CAPACITY, 0.0), (CURRENT_OFFSET, 0.0), (CURRENT_GAIN, 0.0)];
        let mut noise = 0.0;
        if let Some(shown_a) = shown_a {
            by[1].1 = self.current_a(shown_a) * share / (1.0 + self.x[CAPACITY]);
            (by[2].1, by[3].1) = (share, shown_a * share);
            noise = self.current.floor() * share;
        }
        self.x[SOC] -= moved + self.x[LEAK] * dt_s;
        let carried: f64 = by.iter().flat_map(|a| by.iter().map(|b| a.1 * b.1 * self.p[(a.0, b.0)])).sum();
        for state in 0..self.x.len() {
            let moved: f64 = by.iter().map(|&(by, factor)| factor * self.p[(by, state)]).sum();
            self.p[(SOC, state)] += moved;
            self.p[(state, SOC)] += moved;
        }
        self.p[(SOC, SOC)] += carried + noise * noise;
    }

    /// Lets a state drift by this deviation.
    pub(crate) fn widen(&mut self, state: usize, sigma: f64) {
        self.p[(state, state)] += sigma * sigma;
    }

    /// Learns from a voltage that was seen. Returns the innovation over its deviation.
    pub(crate) fn see(&mut self, ocv: &OcvTable, seen: &Seen<'_>) -> f64 {
        let (mut h, mut innovation_v, mut noise_v2) = self.linearised(ocv, seen);
        let mut expected_v2 = (&self.p * &h).dot(&h) + noise_v2;
        let surprise = innovation_v / expected_v2.max(1e-12).sqrt();
        if surprise.abs() > SURPRISE {
            self.doubt(surprise.abs() / SURPRISE, seen.load.is_some());
            (h, innovation_v, noise_v2) = self.linearised(ocv, seen);
            expected_v2 = (&self.p * &h).dot(&h) + noise_v2;
        }
        let ph = &self.p * &h;
        let mut gain = &ph / expected_v2.max(1e-12);
        if !seen.teaches_capacity {
            gain.rows_mut(CAPACITY, OCV - CAPACITY).fill(0.0);
        }
        if seen.load.is_none() {
            gain.rows_mut(RESISTANCE, self.x.len() - RESISTANCE).fill(0.0);
        }
        // Any gain, also one that leaves states out, keeps this form of the covariance positive.
        self.p = &self.p - &gain * ph.transpose() - &ph * gain.transpose() + &gain * gain.transpose() * expected_v2;
        self.x += gain * innovation_v;
        // Nothing that was shown makes a pack that cannot be.
        self.x[SOC] = self.x[SOC].clamp(-0.05, 1.05);
        self.x[CAPACITY] = self.x[CAPACITY].clamp(-0.7, 0.5);
        surprise
    }

    /// A surprise widens what may differ from pack to pack: charge, and what the observation is of,
    /// capacity at rest and resistance under load. Each within what still makes sense.
    fn doubt(&mut self, factor: f64, under_load: bool) {
        let others = if under_load { RESISTANCE..self.x.len() } else { CAPACITY..CAPACITY + 1 };
        for state in std::iter::once(SOC).chain(others) {
            let most = match state {
                SOC => 0.3,
                CAPACITY => 0.1,
                _ => f64::INFINITY,
            };
            let sigma = self.p[(state, state)].max(1e-12).sqrt();
            let factor = factor.min(DOUBT_MAX).min((most / sigma).max(1.0));
            // Twice on the diagonal, once off it: the covariance stays one.
            for other in 0..self.x.len() {
                self.p[(state, other)] *= factor;
                self.p[(other, state)] *= factor;
            }
        }
    }

    /// The observation as a line over the states: its slopes, the innovation, and noise with what
    /// the line leaves out.
    fn linearised(&self, ocv: &OcvTable, seen: &Seen<'_>) -> (DVector<f64>, f64, f64) {
        let (mut at, mut sigma) = (self.x[SOC], self.p[(SOC, SOC)].max(0.0).sqrt().max(1e-6));
        let mut h = DVector::zeros(self.x.len());
        h[VOLTAGE_OFFSET] = 1.0;
        let mut resistance_v = 0.0;
        if let Some((current_a, shares)) = seen.load {
            for (index, share) in shares.iter().enumerate() {
                h[RESISTANCE + index] = -current_a * share;
                resistance_v += current_a * share * self.x[RESISTANCE + index];
            }
        }
        let mut line = (0.0, 0.0);
        for _ in 0..PASSES {
            let (knot, share) = ocv_error::weights(at);
            h.rows_mut(OCV, ocv_error::KNOTS).fill(0.0);
            (h[OCV + knot], h[OCV + knot + 1]) = (1.0 - share, share);
            let (slope, mean_v, bend_v2) = chord(ocv, at, sigma);
            h[SOC] = slope;
            let error_v = (1.0 - share) * self.x[OCV + knot] + share * self.x[OCV + knot + 1];
            let expected_v = mean_v + slope * (self.x[SOC] - at) + error_v + self.x[VOLTAGE_OFFSET] - seen.below_v - resistance_v;
            line = (seen.cell_v - expected_v, seen.noise_v2 + bend_v2);
            let ph = &self.p * &h;
            let expected_v2 = (ph.dot(&h) + line.1).max(1e-12);
            at = self.x[SOC] + ph[SOC] / expected_v2 * line.0;
            sigma = (self.p[(SOC, SOC)] - ph[SOC] * ph[SOC] / expected_v2).max(1e-12).sqrt();
        }
        (h, line.0, line.1)
    }
}

/// The OCV curve as a line over a normal spread of state of charge: slope, mean, and the variance
/// that the line leaves out.
fn chord(ocv: &OcvTable, soc: f64, sigma: f64) -> (f64, f64, f64) {
    const REACH: i32 = 6;
    let points = (-REACH..=REACH).map(|step| {
        let z = 0.4 * f64::from(step);
        (z, (-z * z / 2.0).exp(), ocv.voltage_v(soc + sigma * z))
    });
    let (mut weights, mut mean_v, mut cross, mut spread, mut square) = (0.0, 0.0, 0.0, 0.0, 0.0);
    let origin_v = ocv.voltage_v(soc);
    for (z, weight, voltage_v) in points {
        let v = voltage_v - origin_v;
        weights += weight;
        mean_v += weight * v;
        cross += weight * z * v;
        spread += weight * z * z;
        square += weight * v * v;
    }
    mean_v /= weights;
    let slope = cross / spread;
    let left_v2 = (square / weights - mean_v * mean_v - slope * slope * spread / weights).max(0.0);
    (slope / sigma, origin_v + mean_v, left_v2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ledger(sigma: f64) -> Ledger {
        let model = crate::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap();
        Ledger::new(&model, Estimate::new(0.5, sigma), 0.0, None)
    }

    fn at_rest(cell_v: f64) -> Seen<'static> {
        Seen { cell_v, noise_v2: 1e-8, below_v: 0.0, load: None, teaches_capacity: true }
    }

    #[test]
    fn a_capacity_that_is_unsure_makes_the_count_unsure_in_proportion_to_the_charge() {
        let mut ledger = ledger(0.0);
        // Half of the pack, out and in again: unsure by half of 1 % at the turn, and then not.
        (0..3600).for_each(|_| ledger.count(1.0, 0.5 / 3600.0, Some(0.66), 1.32));
        let turn = ledger.state(SOC).sigma;
        (0..3600).for_each(|_| ledger.count(1.0, -0.5 / 3600.0, Some(-0.66), 1.32));
        // 1 % and 0.175 % gain of a half, and 1 mAh of offset on 1320 mAh; by hand.
        assert!((turn - (0.005_f64.powi(2) + 0.000_875_f64.powi(2) + (1.0 / 1320.0_f64).powi(2)).sqrt()).abs() < 2e-5, "{turn}");
        assert!(ledger.state(SOC).sigma < 0.002);
    }

    #[test]
    fn reading_the_same_voltage_again_teaches_nothing() {
        let ocv = OcvTable::new(vec![0.0, 1.0], vec![3.0, 4.2]).unwrap();
        let mut ledger = ledger(0.2);
        ledger.see(&ocv, &at_rest(3.72));
        let once = ledger.state(SOC);
        (0..100).for_each(|_| {
            ledger.see(&ocv, &at_rest(3.72));
        });
        assert!((once.value - 0.6).abs() < 1e-3, "{once:?}");
        // Table 3 mV and sensor 2 mV / 3 on a slope of 1.2 V.
        assert!((once.sigma * 1.2 / 3e-3_f64.hypot(2e-3 / 3.0) - 1.0).abs() < 0.08, "{once:?}");
        assert!(ledger.state(SOC).sigma > 0.97 * once.sigma);
    }

    #[test]
    fn nothing_jumps_on_a_flat_stretch() {
        let ocv = OcvTable::new(vec![0.0, 0.1, 0.9, 1.0], vec![3.0, 3.3, 3.3, 3.4]).unwrap();
        let mut ledger = ledger(0.05);
        ledger.see(&ocv, &at_rest(3.302));
        let after = ledger.state(SOC);
        assert!((after.value - 0.5).abs() < 0.01 && after.sigma > 0.045, "{after:?}");
    }

    #[test]
    fn a_wildly_wrong_start_is_given_up() {
        let ocv = OcvTable::new(vec![0.0, 1.0], vec![3.0, 4.2]).unwrap();
        let mut ledger = ledger(0.01);
        (0..10).for_each(|_| {
            ledger.see(&ocv, &at_rest(3.84));
        });
        assert!((ledger.state(SOC).value - 0.7).abs() < 0.01, "{:?}", ledger.state(SOC));
    }
}
