//! What every gauge does with what it believes: energy and times with their deviations.
//!
//! A prediction steps the model to the end of discharge, once for its value and twice per
//! uncertain input for its slopes. Both are kept: the value until state of charge or power have
//! moved, the slopes, which change less, for longer. In between, the line through the last
//! prediction serves: `E = E_0 + g (x - x_0)`, `sigma² = g P g` with the covariance P of today.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::cycles::CycleCounter;
use super::power::MeanPower;
use super::rest::CURRENT_SHARE;
use super::{Reading, Sample};
use crate::units::S_PER_H;
use crate::{Channel, Estimate, Model, forecast};

/// A prediction is made anew when the state of charge has moved this far.
const FRESH_SOC: f64 = 0.005;
/// A prediction is made anew when the power has changed by this share of itself.
const FRESH_POWER: f64 = 0.05;
/// A prediction is made anew when the pack is this much warmer or colder, K. A guess: a resistance of 20 to 35 kJ/mol changes by
/// 3 to 5 % per kelvin near 25 °C, and what it takes of the energy is a small part of that.
const FRESH_K: f64 = 2.0;
/// A prediction is made anew after this many full cycles. A guess: the thesis' cells lose 2e-4 of their capacity in each.
const FRESH_CYCLES: f64 = 5.0;
/// Slopes are taken anew when the power has changed by this share of itself.
const FRESH_SLOPE_POWER: f64 = 0.2;
/// Slopes are taken anew when the state of charge has moved by this share of itself.
const FRESH_SLOPE_SOC: f64 = 0.2;

/// What the current sensor is believed to be wrong by: shown = true (1 + gain) + offset. Offset
/// (A) stands first, gain second.
#[derive(Debug, Clone)]
pub(crate) struct CurrentErrors {
    pub(crate) value: [f64; 2],
    pub(crate) covariance: [[f64; 2]; 2],
    /// Covariance of every input of a prediction with them. A capacity that was learned from a
    /// current shown too high is too high itself, so that a time to empty is nearer the truth than
    /// its energy and its power are.
    pub(crate) with_inputs: [DVector<f64>; 2],
}

impl CurrentErrors {
    /// From a filter's state and covariance, with the places there of offset, gain and inputs;
    /// none for an input that the filter does not hold.
    pub(crate) fn of(x: &DVector<f64>, p: &DMatrix<f64>, errors: [usize; 2], inputs: &[Option<usize>]) -> Self {
        Self {
            value: errors.map(|error| x[error]),
            covariance: errors.map(|one| errors.map(|other| p[(one, other)])),
            with_inputs: errors
                .map(|error| DVector::from_iterator(inputs.len(), inputs.iter().map(|input| input.map_or(0.0, |input| p[(input, error)])))),
        }
    }
}

/// What a gauge believes of its pack.
pub(crate) trait Believed {
    /// The uncertain inputs of a prediction with their covariance; state of charge comes first.
    fn inputs(&self) -> (DVector<f64>, DMatrix<f64>);

    /// Energy to the end of discharge at that power and those inputs, Wh: of the pack as its load has left it, or of one that has rested.
    /// A pack that holds more than the model's gives that much more at the same power: its ohms are those that the gauge knows, so its
    /// voltage goes the same way over its charge, only longer.
    fn discharge_wh(&self, inputs: &[f64], power_w: f64, rested: bool) -> f64;

    /// Time to full on the pack's own charger at those inputs, s, of the pack as it is.
    fn charge_s(&self, inputs: &[f64]) -> f64;

    /// What the current sensor is wrong by, as far as it is known by now.
    fn current_errors(&self) -> CurrentErrors;
}

/// Keeps predictions.
#[derive(Debug, Clone, Default)]
pub(crate) struct Predictor {
    remaining: Option<Line>,
    full: Option<Line>,
    to_full: Option<Line>,
}

/// What a prediction is made for beside its inputs.
#[derive(Debug, Clone, Copy)]
struct Conditions {
    power_w: f64,
    /// Change of the power that is none, W.
    idle_w: f64,
    temperature_degc: f64,
    cycles: f64,
}

impl Conditions {
    fn power_moved(&self, from: &Conditions, share: f64) -> bool {
        (from.power_w - self.power_w).abs() > share * from.power_w.abs() + self.idle_w
    }

    fn pack_changed(&self, from: &Conditions) -> bool {
        (from.temperature_degc - self.temperature_degc).abs() > FRESH_K || self.cycles - from.cycles > FRESH_CYCLES
    }
}

/// A prediction with its slopes, and where each was made.
#[derive(Debug, Clone)]
struct Line {
    at: DVector<f64>,
    under: Conditions,
    value: f64,
    slopes: DVector<f64>,
    slopes_soc: f64,
    slopes_under: Conditions,
}

impl Line {
    fn estimate(&self, x: &DVector<f64>, p: &DMatrix<f64>) -> Estimate {
        let value = self.value + self.slopes.dot(&(x - &self.at));
        Estimate::new(value.max(0.0), (p * &self.slopes).dot(&self.slopes).max(0.0).sqrt())
    }
}

/// The line of a prediction at these inputs, from what is kept or made anew.
fn line<'a>(kept: &'a mut Option<Line>, x: &DVector<f64>, p: &DMatrix<f64>, under: Conditions, f: impl Fn(&[f64]) -> f64) -> &'a Line {
    let (mut value, mut slopes) = (true, true);
    if let Some(line) = kept {
        value = (line.at[0] - x[0]).abs() > FRESH_SOC || under.power_moved(&line.under, FRESH_POWER) || under.pack_changed(&line.under);
        slopes = (line.slopes_soc - x[0]).abs() > (FRESH_SLOPE_SOC * line.slopes_soc).max(FRESH_SOC)
            || under.power_moved(&line.slopes_under, FRESH_SLOPE_POWER)
            || under.pack_changed(&line.slopes_under);
    }
    let line = kept.get_or_insert_with(|| Line {
        at: x.clone(),
        under,
        value: 0.0,
        slopes: DVector::zeros(x.len()),
        slopes_soc: x[0],
        slopes_under: under,
    });
    if value || slopes {
        (line.at, line.under, line.value) = (x.clone(), under, f(x.as_slice()));
    }
    if slopes {
        (line.slopes_soc, line.slopes_under) = (x[0], under);
        let mut nudged = x.clone();
        for index in 0..x.len() {
            let sigma = p[(index, index)].max(0.0).sqrt();
            line.slopes[index] = if sigma > 1e-12 {
                let held = |value: f64| if index == 0 { value.clamp(0.0, 1.0) } else { value };
                let mut at = |side: f64| {
                    nudged[index] = held(x[index] + side * sigma);
                    (nudged[index], f(nudged.as_slice()))
                };
                let ((high, above), (low, below)) = (at(1.0), at(-1.0));
                if high > low { (above - below) / (high - low) } else { 0.0 }
            } else {
                0.0
            };
            nudged[index] = x[index];
        }
    }
    line
}

/// What a gauge has beside its belief: the same for each of them.
#[derive(Debug, Clone, Default)]
pub(crate) struct Watch {
    /// Recent mean power.
    pub(crate) power: MeanPower,
    /// Temperature of the cells, °C.
    pub(crate) temperature_degc: f64,
    /// Cycles so far.
    pub(crate) cycles: CycleCounter,
    predictor: Predictor,
}

impl Watch {
    pub(crate) fn new(temperature_degc: f64) -> Self {
        Self { temperature_degc, ..Self::default() }
    }

    /// Takes in a sample, with the state of charge after it and the share of capacity drawn.
    pub(crate) fn update(&mut self, sample: &Sample, soc: f64, drawn: f64) {
        self.power.update(sample);
        self.temperature_degc = sample.temperature_degc;
        self.cycles.update(soc, drawn);
    }

    /// The same load on another pack, whose cycles begin at none.
    pub(crate) fn exchanged(&self) -> Self {
        Self { power: self.power, ..Self::new(self.temperature_degc) }
    }

    /// Everything that a gauge tells; `capacity` is what it has learned of it, as a share of the model's.
    pub(crate) fn reading(&mut self, model: &Arc<Model>, believed: &impl Believed, soc: Estimate, capacity: Estimate) -> Reading {
        let health = forecast::health(model, self.cycles.full());
        let (mut x, p) = believed.inputs();
        // A count may be a little above full; what is there to be given is not.
        x[0] = x[0].clamp(0.0, 1.0);
        let errors = believed.current_errors();
        let facts = model.battery();
        let mean_v = facts.stored_wh() / facts.capacity_ah;
        let power_w = (self.power.power_w - errors.value[0] * mean_v) * (1.0 - errors.value[1]);
        let drawn_w = power_w.max(0.0);
        // Near rest, noise is most of the power: there only a change that matters to the forecast
        // counts, which takes no power below this for one.
        let idle_w = CURRENT_SHARE * facts.stored_wh();
        let under = Conditions { power_w: drawn_w, idle_w, temperature_degc: self.temperature_degc, cycles: self.cycles.full() };
        let remaining = line(&mut self.predictor.remaining, &x, &p, under, |x| believed.discharge_wh(x, drawn_w, false));
        let remaining_wh = remaining.estimate(&x, &p);
        let remaining_slopes = remaining.slopes.clone();
        let mut at_full = (x.clone(), p.clone());
        at_full.0[0] = 1.0;
        at_full.1.row_mut(0).fill(0.0);
        at_full.1.column_mut(0).fill(0.0);
        let full = line(&mut self.predictor.full, &at_full.0, &at_full.1, under, |x| believed.discharge_wh(x, drawn_w, true));
        let full_wh = full.estimate(&at_full.0, &at_full.1);
        let charged = Conditions { power_w: 0.0, ..under };
        let time_to_full_s =
            (power_w < -idle_w).then(|| line(&mut self.predictor.to_full, &x, &p, charged, |x| believed.charge_s(x)).estimate(&x, &p));
        let time_to_empty_s = (power_w > idle_w).then(|| {
            // t = E / P: dt P is dE, and E by as much as the current was shown too high.
            let energy_wh = remaining_wh.value;
            let shown = [mean_v / power_w, 1.0];
            let noise_w = model.sensor(Channel::CurrentA).floor() * mean_v;
            let mut share2 = self.power.noise_share * (noise_w / power_w).powi(2);
            let mut square_wh2 = remaining_wh.sigma.powi(2);
            for one in 0..2 {
                square_wh2 += 2.0 * energy_wh * shown[one] * remaining_slopes.dot(&errors.with_inputs[one]);
                share2 += (0..2).map(|other| shown[one] * shown[other] * errors.covariance[one][other]).sum::<f64>();
            }
            square_wh2 += energy_wh.powi(2) * share2;
            let per_wh_s = S_PER_H / power_w;
            Estimate::new(energy_wh * per_wh_s, square_wh2.max(0.0).sqrt() * per_wh_s)
        });
        Reading {
            soc,
            remaining_wh,
            full_wh,
            time_to_empty_s,
            time_to_full_s,
            soh: Estimate::new(health * capacity.value, health * capacity.sigma),
            power_w,
            cycles: self.cycles.full(),
            pseudo_cycles: self.cycles.pseudo(),
        }
    }
}
