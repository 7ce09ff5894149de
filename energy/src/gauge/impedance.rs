//! Impedance track: counts charge, and learns the pack's resistance and capacity as it goes.
//!
//! As the gauge ICs of the thesis do (Kottas, section 3.2), on the [ledger](super::ledger) of the
//! charge count:
//!
//! * **at rest** the open-circuit voltage corrects the state of charge;
//! * **capacity** (Q_max) follows from two rests: charge counted between them over the difference
//!   of state of charge, both with their deviations, once that difference is 0.3 or more (and from
//!   the voltage under load as far from the last rest); fusing by inverse variance is what the
//!   ledger's covariance does;
//! * **resistance** is updated as each point of a grid over depth of discharge is passed under a
//!   load: `(OCV - V) / I`, at the reference temperature (see [`super::resistance`]);
//! * **near empty** the voltage under load is read every half percent: the open-circuit curve is so
//!   steep there that it overrules the count, and the energy left goes to zero as the voltage goes
//!   to the end of discharge, also on a pack that is weaker than the model;
//! * **asleep**, after half an hour without a current that the sensor could tell from none, only
//!   self-discharge is counted.

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use super::counter::Counter;
use super::follow::{Followed, go_on_like};
use super::ledger::{CAPACITY, Ledger, RESISTANCE, SOC, SURPRISE, Seen};
use super::prediction::{Believed, CurrentErrors};
use super::resistance::{self, GRID, Prior};
use super::{Gauge, Reading, Sample};
use crate::{Channel, Estimate, Model, Run, Start, forecast};

/// Least difference of state of charge between two rests that teach the capacity.
const TEACHING_SOC: f64 = 0.3;
/// Least load that teaches resistance, as a share of capacity per hour.
const LOAD_SHARE: f64 = 0.05;
/// Time constant of the means under load, s: longer than transients of a drive.
const LOAD_TAU_S: f64 = 30.0;
/// Below this state of charge the voltage under load is read every half percent.
const NEAR_EMPTY_SOC: f64 = 0.12;
/// Below this above the end of discharge, V per cell, it is read every 20 mV, whatever the count
/// says.
const NEAR_EMPTY_V: f64 = 0.5;
/// What a model's voltage under load is wrong by in ways that no state holds, V per cell (guess:
/// 0.5 to 5 mV for a fitted model).
const MODEL_V: f64 = 1e-3;
/// The same, as a share of what the voltage lies below its open-circuit value (guess: 1 % to 10 %).
const MODEL_SHARE: f64 = 0.015;
/// Drift of a resistance, as a share of itself over one full cycle (guess: cells double their
/// resistance in some hundred to a thousand cycles).
const DRIFT_PER_CYCLE: f64 = 5e-3;
/// Time without a current after which the pack is taken for asleep, s.
const SLEEP_AFTER_S: f64 = 1800.0;
/// Over this much voltage above the end of discharge, V per cell, the energy left is let go to
/// zero: the count's last error.
const SMOOTHING_V: f64 = 0.02;

/// See the module's text.
#[derive(Debug, Clone)]
pub struct ImpedanceTrack {
    counter: Counter,
    prior: Prior,
    load: Load,
    quiet_s: f64,
    /// State of charge at the last rest that taught the capacity.
    anchor: Option<f64>,
    /// Grid point or step near empty that was read last.
    mark: Option<i64>,
    drawn_since_read: f64,
    since_read_s: f64,
    factor: (f64, f64),
}

/// Means of the last half minute under load.
#[derive(Debug, Clone, Copy, Default)]
struct Load {
    /// Measured less modelled voltage of a cell, without learned resistance, V.
    residual_v: f64,
    /// Modelled voltage of a cell at the last sample, likewise, V.
    modelled_v: f64,
    /// Current through a cell, A.
    cell_a: f64,
    seen_s: f64,
    samples: f64,
}

impl Load {
    fn update(&mut self, dt_s: f64, measured_v: f64, modelled_v: f64, cell_a: f64) {
        let keep = (-dt_s / LOAD_TAU_S).exp();
        let all = |seen_s: f64| 1.0 - (-seen_s / LOAD_TAU_S).exp();
        let (before, after) = (keep * all(self.seen_s), all(self.seen_s + dt_s));
        self.residual_v = (before * self.residual_v + (1.0 - keep) * (measured_v - modelled_v)) / after;
        self.cell_a = (before * self.cell_a + (1.0 - keep) * cell_a) / after;
        self.samples = keep * self.samples + 1.0;
        self.modelled_v = modelled_v;
        self.seen_s += dt_s;
    }

    /// Voltage of a cell without noise, V, once the load has lasted.
    fn cell_v(&self) -> Option<f64> {
        (self.seen_s >= 2.0 * LOAD_TAU_S).then_some(self.modelled_v + self.residual_v)
    }
}

impl ImpedanceTrack {
    /// Starts at a known state of charge.
    #[must_use]
    pub fn new(model: Arc<Model>, soc: Estimate, temperature_degc: f64) -> Self {
        let prior = Prior::of(&model);
        Self {
            factor: (temperature_degc, resistance::temperature_factor(&model, temperature_degc)),
            counter: Counter::new(model, soc, temperature_degc, Some(&prior.covariance)),
            prior,
            load: Load::default(),
            quiet_s: 0.0,
            anchor: None,
            mark: None,
            drawn_since_read: 0.0,
            since_read_s: 0.0,
        }
    }

    /// The learned resistance of one cell over depth of discharge at the reference temperature,
    /// ohm, as `(depth of discharge, resistance)`.
    #[must_use]
    pub fn resistance(&self) -> Vec<(f64, Estimate)> {
        let point = |(index, soc): (usize, &f64)| {
            let more = self.counter.ledger.state(RESISTANCE + index);
            (1.0 - soc, Estimate::new(self.prior.modelled_ohm[index] + more.value, more.sigma))
        };
        GRID.iter().enumerate().map(point).collect()
    }

    /// Capacity of the pack, Ah: Q_max as learned.
    #[must_use]
    pub fn capacity_ah(&self) -> Estimate {
        let (design_ah, learned) = (self.counter.model.battery().capacity_ah, self.counter.ledger.state(CAPACITY));
        Estimate::new(design_ah * (1.0 + learned.value), design_ah * learned.sigma)
    }

    /// The on/off line says that nothing is connected: time passes, and only self-discharge acts.
    pub fn sleep(&mut self, dt_s: f64) {
        self.quiet_s = SLEEP_AFTER_S;
        let sample = Sample { dt_s, current_a: 0.0, voltage_v: 0.0, temperature_degc: self.counter.watch.temperature_degc };
        self.count(&sample, true);
    }

    fn count(&mut self, sample: &Sample, asleep: bool) -> Followed {
        let (followed, drawn) = self.counter.count(sample, asleep);
        self.drawn_since_read += drawn.max(0.0);
        followed
    }

    /// Whether the current has been none, for all that the sensor can tell, for long enough.
    fn asleep(&mut self, sample: &Sample) -> bool {
        let sensor = self.counter.model.sensor(Channel::CurrentA);
        let none_a = 3.0 * (sensor.offset_sigma + sensor.floor()) + 1e-6 * self.counter.model.battery().capacity_ah;
        self.quiet_s = if sample.current_a.abs() < none_a { self.quiet_s + sample.dt_s } else { 0.0 };
        self.quiet_s >= SLEEP_AFTER_S
    }

    fn learn_at_rest(&mut self, sample: &Sample, followed: &Followed) {
        let Some(rested) = self.counter.rested(sample) else { return };
        let soc = self.counter.ledger.state(SOC).value;
        let teaches_capacity = self.anchor.is_some_and(|anchor| (soc - anchor).abs() >= TEACHING_SOC);
        let (cell_v, noise_v2) = (rested.cell_v, rested.noise_v2 + followed.branch_v.powi(2));
        let seen = Seen { cell_v, noise_v2, below_v: followed.shift_v + followed.drop_v, load: None, teaches_capacity };
        self.counter.ledger.see(&self.counter.ocv, &seen);
        if teaches_capacity || self.anchor.is_none() {
            self.anchor = Some(self.counter.ledger.state(SOC).value);
        }
    }

    fn learn_under_load(&mut self, sample: &Sample, followed: &Followed) {
        let facts = self.counter.model.battery();
        let soc = self.counter.ledger.state(SOC).value;
        let cell_v = sample.voltage_v / f64::from(facts.series);
        let modelled_v = self.counter.ocv.voltage_v(soc) - followed.shift_v - followed.drop_v;
        let none_a = LOAD_SHARE * facts.capacity_ah / f64::from(facts.parallel);
        if followed.cell_a < none_a {
            (self.load, self.mark) = (Load::default(), None);
            return;
        }
        self.load.update(sample.dt_s, cell_v, modelled_v, followed.cell_a);
        self.since_read_s += sample.dt_s;
        let Some(seen_v) = self.load.cell_v().filter(|_| self.since_read_s >= 2.0 * LOAD_TAU_S) else { return };
        let mark = if seen_v < facts.eod_v_per_cell + NEAR_EMPTY_V {
            2000 + (seen_v / 0.02) as i64
        } else if soc < NEAR_EMPTY_SOC {
            1000 + (soc / 0.005) as i64
        } else {
            GRID.partition_point(|&point| point <= soc) as i64
        };
        let passed = self.mark.replace(mark).is_some_and(|last| last != mark);
        if !passed {
            return;
        }
        for (point, ohm) in self.prior.modelled_ohm.iter().enumerate() {
            self.counter.ledger.widen(RESISTANCE + point, DRIFT_PER_CYCLE * ohm * self.drawn_since_read.sqrt());
        }
        (self.drawn_since_read, self.since_read_s) = (0.0, 0.0);
        let floor_v = self.counter.model.sensor(Channel::VoltageV).floor() / f64::from(facts.series);
        let shares = resistance::shares(soc);
        let seen = Seen {
            cell_v: seen_v,
            noise_v2: floor_v * floor_v / self.load.samples
                + MODEL_V * MODEL_V
                + (MODEL_SHARE * followed.drop_v).powi(2)
                + followed.branch_v.powi(2),
            below_v: followed.shift_v + followed.drop_v,
            load: Some((self.load.cell_a * self.factor.1, &shares)),
            teaches_capacity: self.anchor.is_some_and(|anchor| (soc - anchor).abs() >= TEACHING_SOC),
        };
        if self.counter.ledger.see(&self.counter.ocv, &seen).abs() > SURPRISE {
            // Not the pack that was thought of: read again as soon as there is a new mean.
            self.mark = Some(-1);
        }
        // The means are of what was measured: they stay where the state of charge is moved.
        let moved_v = self.counter.ocv.voltage_v(self.counter.ledger.state(SOC).value) - self.counter.ocv.voltage_v(soc);
        self.load.modelled_v += moved_v;
        self.load.residual_v -= moved_v;
    }
}

/// What the gauge believes: the model's pack with learned capacity and resistance.
struct Pack<'a> {
    model: &'a Arc<Model>,
    ledger: &'a Ledger,
    followed: &'a Run<f64>,
    temperature_degc: f64,
    cycles: f64,
    factor: f64,
}

/// Inputs of a prediction: state of charge, capacity, resistances.
fn state_of(input: usize) -> usize {
    [SOC, CAPACITY].get(input).copied().unwrap_or(RESISTANCE + input.saturating_sub(2))
}

impl Pack<'_> {
    fn run(&self, inputs: &[f64], rested: bool) -> Run<f64> {
        let soc = inputs[0].clamp(0.0, 1.0);
        let start = Start { temperature_degc: self.temperature_degc, cycle_count: self.cycles, ..Start::at_soc(soc) };
        let mut run = Run::new(Arc::clone(self.model), start);
        if !rested {
            go_on_like(&mut run, start, self.followed, 1.0 + self.ledger.state(CAPACITY).value);
        }
        run
    }
}

impl Believed for Pack<'_> {
    fn inputs(&self) -> (DVector<f64>, DMatrix<f64>) {
        let n = 2 + GRID.len();
        let x = DVector::from_fn(n, |input, _| self.ledger.state(state_of(input)).value);
        (x, DMatrix::from_fn(n, n, |one, other| self.ledger.covariance(state_of(one), state_of(other))))
    }

    fn discharge_wh(&self, inputs: &[f64], power_w: f64, rested: bool) -> f64 {
        let facts = self.model.battery();
        let of_pack = self.factor * f64::from(facts.series) / f64::from(facts.parallel);
        let more_ohm = |soc: f64| of_pack * resistance::at(&inputs[2..], soc);
        (1.0 + inputs[1]) * forecast::discharge_behind(&mut self.run(inputs, rested), power_w, more_ohm).energy_wh
    }

    fn charge_s(&self, inputs: &[f64]) -> f64 {
        (1.0 + inputs[1]) * forecast::charge(&mut self.run(inputs, false), 1.0).time_s
    }

    fn current_errors(&self) -> CurrentErrors {
        let inputs: Vec<Option<usize>> = (0..2 + GRID.len()).map(|input| Some(state_of(input))).collect();
        self.ledger.current_errors(&inputs)
    }
}

impl Gauge for ImpedanceTrack {
    fn model(&self) -> &Arc<Model> {
        &self.counter.model
    }

    fn update(&mut self, sample: &Sample) {
        if !sample.is_reading() {
            return;
        }
        if (sample.temperature_degc - self.factor.0).abs() > 1.0 {
            let degc = sample.temperature_degc;
            self.factor = (degc, resistance::temperature_factor(&self.counter.model, degc));
        }
        let asleep = self.asleep(sample);
        let followed = self.count(sample, asleep);
        self.learn_at_rest(sample, &followed);
        self.learn_under_load(sample, &followed);
    }

    fn exchange(&mut self, soc: Estimate) {
        let fresh = Self::new(Arc::clone(&self.counter.model), soc, self.counter.watch.temperature_degc);
        *self = Self { counter: self.counter.exchanged(fresh.counter), ..fresh };
    }

    fn soc(&self) -> Estimate {
        self.counter.soc()
    }

    fn reading(&mut self) -> Reading {
        let (soc, followed) = (self.counter.soc(), self.counter.run().clone());
        let Counter { model, ledger, watch, .. } = &mut self.counter;
        let (temperature_degc, cycles) = (watch.temperature_degc, watch.cycles.full());
        let pack = Pack { model, ledger, followed: &followed, temperature_degc, cycles, factor: self.factor.1 };
        let learned = ledger.state(CAPACITY);
        let mut reading = watch.reading(model, &pack, soc, Estimate::new(1.0 + learned.value, learned.sigma));
        if let Some(cell_v) = self.load.cell_v() {
            let above_v = cell_v - model.battery().eod_v_per_cell;
            let left = (above_v / SMOOTHING_V).clamp(0.0, 1.0);
            reading.remaining_wh.value *= left;
            reading.time_to_empty_s.iter_mut().for_each(|time_s| time_s.value *= left);
        }
        reading
    }
}
