//! Sigma points: a Kalman filter whose points are runs of the model.
//!
//! The state is all that the model is unsure of:
//!
//! ```text
//!   states of the run (SoC, polarisation, temperature ...), every parameter with a sigma,
//!   error of the capacity, offset and gain of the current sensor                         | runs
//!   resistance left out, offset of the voltage sensor, error of the OCV table at its
//!   knots and between them                                                               | lines
//! ```
//!
//! Each direction of uncertainty (a column of the covariance's Cholesky factor) is followed by two
//! runs, h deviations to either side; differences of what they show replace derivatives (second
//! order divided differences, Nørgaard et al. 2000; h = √3 fits a normal distribution). The last
//! group only adds to the voltage shown, so its columns, which come last, need no runs. Errors of
//! table and voltage sensor are states, because they are the same in every sample: a filter that
//! took them for noise would soon believe itself far better than it is.
//!
//! Samples are gathered for at most two minutes, in which all runs go on; then the mean of the voltages is
//! one observation (`shown.rs`). The covariance stays positive since it is formed as a product
//! (Joseph's form on the factor).

mod layout;
mod pack;
mod shown;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use self::layout::{Layout, start_sigma};
use self::pack::Pack;
use super::follow::follow;
use super::prediction::Watch;
use super::resistance::{Prior, temperature_factor};
use super::{Gauge, Reading, Sample};
use crate::ocv_error::{self, KNOTS};
use crate::units::{S_PER_DAY, S_PER_H};
use crate::{Channel, Estimate, Model, Run, Sensor, Start};

/// Time over which samples are gathered, s (guess: 1 to 5 minutes; of 10, 30, 60 and 120 s the last, by how many readings
/// it covered in development worlds of `tests/it/coverage.rs`). Where a window finds the pack decides how the next
/// one is read, so that noise pushes the state of charge to one side: the less, the more of it a window averages.
const WINDOW_S: f64 = 120.0;
/// State of charge that a window passes through at most (guess: a fast load is read as often as it moves
/// by a few of the OCV table's points).
const WINDOW_SOC: f64 = 0.02;
/// Distance of the points in deviations.
const REACH: f64 = 1.732_050_807_568_877_2;
/// What a model's voltage is wrong by in ways that no state holds, V per cell in one window
/// (guess: 0.2 to 5 mV for a fitted model).
const MODEL_V: f64 = 2e-4;
/// State of charge over which the resistance left out forgets itself, as a multiple of the model's
/// `ocv_length_soc`: where a smooth error with that length (Matern 3/2) is still like itself to 0.9, an
/// exponential of this length is too.
const RESISTANCE_LENGTHS: f64 = 2.9;
/// State of charge over which what the line between two knots of the OCV table's error leaves out
/// forgets itself: half their distance.
const FINE_LENGTH: f64 = 0.5 * ocv_error::SPACING;
/// Drift of the capacity over a full cycle, as a share of it (the thesis' cells: 2e-4).
const CAPACITY_PER_CYCLE: f64 = 2e-4;
/// Drift of the current sensor's offset over a day, as a share of its deviation.
const OFFSET_PER_DAY: f64 = 0.1;
/// An innovation beyond this many of its deviations is a surprise, and widens what may differ
/// from pack to pack.
const SURPRISE: f64 = 4.0;
/// Most that one surprise widens a deviation by.
const DOUBT_MAX: f64 = 1.5;

/// See the module's text.
#[derive(Clone)]
pub struct SigmaPoint {
    model: Arc<Model>,
    layout: Layout,
    x: DVector<f64>,
    p: DMatrix<f64>,
    /// Cholesky factor that the points were drawn from.
    factor: DMatrix<f64>,
    /// The middle, then two points for each column that needs runs.
    points: Vec<Point>,
    gathered: Gathered,
    /// Windows since the gauge was last told of its start, or surprised.
    windows: u32,
    current: Sensor,
    /// Resistance of a cell by the model, and deviation of what it leaves out, ohm.
    prior: Prior,
    /// What the line between two knots leaves out of the table's error, V.
    fine_v: f64,
    warmth: (f64, f64),
    watch: Watch,
}

/// One point: a run with its part of the state.
#[derive(Clone)]
struct Point {
    run: Run<f64>,
    state: DVector<f64>,
    /// Voltages of a cell, and states of charge, over the window, summed.
    shown_v: f64,
    soc: f64,
}

/// What the window under way has seen.
#[derive(Debug, Clone, Copy, Default)]
struct Gathered {
    samples: f64,
    lasted_s: f64,
    cell_v: f64,
    /// Current through a cell, times how much more its resistance is than at the reference temperature, A.
    resisted_a: f64,
    moved: f64,
}

/// A state that is forgotten with the state of charge that it belongs to.
struct Local {
    state: usize,
    /// Share of it that is left after this window.
    keeps: f64,
    /// Its deviation where nothing is known.
    sigma: f64,
}

impl std::fmt::Debug for SigmaPoint {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("SigmaPoint").field("x", &self.x.as_slice()).finish_non_exhaustive()
    }
}

impl SigmaPoint {
    /// Starts at a known state of charge, on a pack that has rested.
    #[must_use]
    pub fn new(model: Arc<Model>, soc: Estimate, temperature_degc: f64) -> Self {
        let layout = Layout::of(&model);
        let (current, voltage) = (model.sensor(Channel::CurrentA), model.sensor(Channel::VoltageV));
        let prior = Prior::of(&model);
        let fine_v = ocv_error::between_v(&model.uncertainty);
        let start = Run::new(Arc::clone(&model), Start { temperature_degc, ..Start::at_soc(soc.value.clamp(0.0, 1.0)) });
        let (mut x, mut p) = (DVector::zeros(layout.len), DMatrix::zeros(layout.len, layout.len));
        let mut set = |index: usize, value: f64, sigma: f64| {
            x[index] = value;
            p[(index, index)] = sigma * sigma;
        };
        for (index, (name, &value)) in model.state_names().zip(start.states()).enumerate() {
            set(index, value, if index == 0 { soc.sigma } else { start_sigma(name, &model) });
        }
        for (index, &parameter) in layout.parameters.iter().enumerate() {
            let parameter = &model.parameters()[parameter];
            set(layout.first_parameter + index, parameter.value, parameter.sigma);
        }
        set(layout.capacity, 0.0, model.uncertainty.capacity_relative_sigma);
        set(layout.current_offset, 0.0, current.offset_sigma);
        set(layout.current_gain, 0.0, current.gain_sigma);
        set(layout.voltage_offset, 0.0, voltage.offset_sigma / f64::from(model.battery().series));
        set(layout.fine, 0.0, fine_v);
        set(layout.resistance, 0.0, prior.left_out_ohm);
        for one in 0..KNOTS {
            for other in 0..KNOTS {
                p[(layout.ocv + one, layout.ocv + other)] = ocv_error::covariance(&model.uncertainty, one, other);
            }
        }
        let middle = Point { run: start, state: x.clone(), shown_v: 0.0, soc: 0.0 };
        let mut gauge = Self {
            points: vec![middle; 1 + 2 * layout.followed()],
            factor: DMatrix::zeros(layout.len, layout.len),
            warmth: (temperature_degc, temperature_factor(&model, temperature_degc)),
            watch: Watch::new(temperature_degc),
            gathered: Gathered::default(),
            model,
            layout,
            x,
            p,
            windows: 0,
            current,
            prior,
            fine_v,
        };
        gauge.draw();
        gauge
    }

    /// Draws the points anew from mean and covariance.
    fn draw(&mut self) {
        self.factor = cholesky(&self.p);
        let states = self.layout.first_parameter;
        let mut values = self.model.values();
        for (index, point) in self.points.iter_mut().enumerate() {
            point.state.copy_from(&self.x);
            if index > 0 {
                let side = if index % 2 == 1 { REACH } else { -REACH };
                point.state.axpy(side, &self.factor.column((index - 1) / 2), 1.0);
            }
            for (offset, &parameter) in self.layout.parameters.iter().enumerate() {
                let limits = &self.model.parameters()[parameter];
                values[parameter] = point.state[states + offset].clamp(limits.min, limits.max);
            }
            point.run.set_parameters(&values);
            point.run.states_mut().copy_from_slice(&point.state.as_slice()[..states]);
            (point.shown_v, point.soc) = (0.0, 0.0);
        }
        self.gathered = Gathered::default();
    }

    /// Lets every point follow a sample.
    fn follow(&mut self, sample: &Sample) {
        let (layout, cycles) = (&self.layout, self.watch.cycles.full());
        let series = f64::from(self.model.battery().series);
        for (index, point) in self.points.iter_mut().enumerate() {
            let state = &point.state;
            let true_a = (sample.current_a - state[layout.current_offset]) * (1.0 - state[layout.current_gain]);
            let soc = point.run.states()[0];
            let followed = follow(&mut point.run, sample, true_a / (1.0 + state[layout.capacity]), soc, cycles);
            // The run has the current per capacity of the model, its resistances have the pack's own.
            point.shown_v += point.run.channels[Channel::VoltageV] / series - state[layout.capacity] * followed.drop_v;
            point.soc += followed.soc;
            if index == 0 {
                self.gathered.moved += followed.moved.abs();
                self.gathered.resisted_a += self.warmth.1 * followed.cell_a;
            }
        }
        self.gathered.samples += 1.0;
        self.gathered.lasted_s += sample.dt_s;
        self.gathered.cell_v += sample.voltage_v / series;
    }

    /// Ends a window: moves mean and covariance to where the runs have gone, and learns from the
    /// mean voltage.
    fn learn(&mut self) {
        let shown = self.shown();
        let mut spread = self.travel();
        if shown.surprise() > SURPRISE {
            self.p = &spread * spread.transpose();
            self.doubt((shown.surprise() / SURPRISE).min(DOUBT_MAX));
            self.windows = 0;
        } else {
            let gain = &spread * &shown.slopes / shown.expected_v2();
            spread -= &gain * shown.slopes.transpose();
            self.p = &spread * spread.transpose() + &gain * gain.transpose() * shown.noise_v2;
            self.x += gain * shown.innovation_v;
            self.windows = self.windows.saturating_add(1);
        }
        self.drift();
        self.draw();
    }

    /// Moves the mean to where the runs have gone, and returns the factor of the covariance there.
    fn travel(&mut self) -> DMatrix<f64> {
        let states = self.layout.first_parameter;
        let mut spread = self.factor.clone();
        for column in 0..self.layout.followed() {
            let (above, below) = (&self.points[1 + 2 * column].run, &self.points[2 + 2 * column].run);
            for row in 0..states {
                spread[(row, column)] = (above.states()[row] - below.states()[row]) / (2.0 * REACH);
            }
        }
        self.x.rows_mut(0, states).copy_from_slice(self.points[0].run.states());
        for Local { state, keeps, .. } in self.local() {
            self.x[state] *= keeps;
            spread.row_mut(state).scale_mut(keeps);
        }
        spread
    }

    /// State of charge over which the resistance left out forgets itself.
    fn resistance_length(&self) -> f64 {
        RESISTANCE_LENGTHS * self.model.uncertainty.ocv_length_soc
    }

    /// What belongs to a state of charge, and is forgotten with the distance from it.
    fn local(&self) -> [Local; 2] {
        let keeps = |length: f64| (-self.gathered.moved / length).exp();
        [
            Local { state: self.layout.resistance, keeps: keeps(self.resistance_length()), sigma: self.prior.left_out_ohm },
            Local { state: self.layout.fine, keeps: keeps(FINE_LENGTH), sigma: self.fine_v },
        ]
    }

    /// Widens what has drifted in a window.
    fn drift(&mut self) {
        let (Gathered { samples, lasted_s, moved, .. }, local) = (self.gathered, self.local());
        let capacity_ah = self.model.battery().capacity_ah;
        let mut widen = |state: usize, sigma: f64| self.p[(state, state)] += sigma * sigma;
        widen(0, self.current.floor() * lasted_s / S_PER_H / capacity_ah / samples.sqrt());
        widen(self.layout.capacity, CAPACITY_PER_CYCLE * moved.sqrt());
        widen(self.layout.current_offset, OFFSET_PER_DAY * self.current.offset_sigma * (lasted_s / S_PER_DAY).sqrt());
        for Local { state, keeps, sigma } in local {
            widen(state, sigma * (1.0 - keeps * keeps).sqrt());
        }
    }

    /// A surprise widens what may differ from pack to pack: charge, capacity, resistance.
    fn doubt(&mut self, factor: f64) {
        for (state, most) in [(0, 0.3), (self.layout.capacity, 0.1), (self.layout.resistance, f64::INFINITY)] {
            let factor = factor.min((most / self.p[(state, state)].max(1e-12).sqrt()).max(1.0));
            // Twice on the diagonal, once off it: the covariance stays one.
            self.p.row_mut(state).scale_mut(factor);
            self.p.column_mut(state).scale_mut(factor);
        }
    }
}

/// The lower Cholesky factor; what rounding made slightly negative is lifted first.
fn cholesky(p: &DMatrix<f64>) -> DMatrix<f64> {
    let mut p = (p + p.transpose()) * 0.5;
    let mut lift = 1e-12;
    for index in 0..p.nrows() {
        p[(index, index)] += 1e-18;
    }
    loop {
        if let Some(factor) = p.clone().cholesky() {
            return factor.l();
        }
        for index in 0..p.nrows() {
            p[(index, index)] = p[(index, index)].abs() * (1.0 + lift) + 1e-18;
        }
        lift *= 10.0;
    }
}

impl Gauge for SigmaPoint {
    fn model(&self) -> &Arc<Model> {
        &self.model
    }

    fn update(&mut self, sample: &Sample) {
        if !sample.is_reading() {
            return;
        }
        if (sample.temperature_degc - self.warmth.0).abs() > 1.0 {
            self.warmth = (sample.temperature_degc, temperature_factor(&self.model, sample.temperature_degc));
        }
        self.follow(sample);
        if self.gathered.lasted_s >= WINDOW_S || self.gathered.moved >= WINDOW_SOC {
            self.learn();
        }
        let capacity_ah = self.points[0].run.channels[Channel::CapacityAh] * (1.0 + self.x[self.layout.capacity]);
        let drawn = sample.current_a * sample.dt_s / S_PER_H / capacity_ah;
        self.watch.update(sample, self.soc().value, drawn);
    }

    fn exchange(&mut self, soc: Estimate) {
        let mut fresh = Self::new(Arc::clone(&self.model), soc, self.watch.temperature_degc);
        let keep = [self.layout.current_offset, self.layout.current_gain, self.layout.voltage_offset];
        for one in keep {
            fresh.x[one] = self.x[one];
            for other in keep {
                fresh.p[(one, other)] = self.p[(one, other)];
            }
        }
        fresh.watch = self.watch.exchanged();
        fresh.draw();
        *self = fresh;
    }

    fn soc(&self) -> Estimate {
        let soc = self.points[0].run.states()[0];
        Estimate::new(soc.clamp(0.0, 1.0), self.p[(0, 0)].max(0.0).sqrt())
    }

    fn reading(&mut self) -> Reading {
        let capacity = self.layout.capacity;
        let learned = Estimate::new(1.0 + self.x[capacity], self.p[(capacity, capacity)].max(0.0).sqrt());
        let mut watch = std::mem::take(&mut self.watch);
        let pack = Pack { gauge: self, temperature_degc: watch.temperature_degc, cycles: watch.cycles.full() };
        let reading = watch.reading(&self.model, &pack, self.soc(), learned);
        self.watch = watch;
        reading
    }
}
