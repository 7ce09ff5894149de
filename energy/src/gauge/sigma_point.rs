//! Sigma points: a Kalman filter whose points are runs of the model.
//!
//! The state is all that the model is unsure of:
//!
//! ```text
//!   states of the run (SoC, polarisation, temperature ...), every parameter with a sigma,
//!   error of the capacity, offset and gain of the current sensor, resistance left out    | runs
//!   offset of the voltage sensor, error of the OCV table at its knots and between them   | lines
//! ```
//!
//! Each direction of uncertainty (a column of the covariance's Cholesky factor) is followed by two
//! runs, h deviations to either side; differences of what they show replace derivatives (second
//! order divided differences, Nørgaard et al. 2000; h = √3 fits a normal distribution). The last
//! group only adds to the voltage shown, so its columns, which come last, need no runs. Errors of
//! table and voltage sensor are states, because they are the same in every sample: a filter that
//! took them for noise would soon believe itself far better than it is.
//!
//! Samples are gathered for ten seconds, in which all runs go on; then the mean of the voltages is
//! one observation. The covariance stays positive since it is formed as a product (Joseph's form
//! on the factor).

mod layout;
mod pack;

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};

use self::layout::{Layout, start_sigma};
use self::pack::Pack;
use super::follow::follow;
use super::ocv_error;
use super::prediction::Watch;
use super::resistance::{Prior, temperature_factor};
use super::{Gauge, Reading, Sample};
use crate::units::S_PER_H;
use crate::{Channel, Estimate, Model, Run, Sensor, Start};

/// Time over which samples are gathered, s.
const WINDOW_S: f64 = 10.0;
/// Distance of the points in deviations.
const REACH: f64 = 1.732_050_807_568_877_2;
/// What a model's voltage is wrong by in ways that no state holds, V per cell in one window
/// (guess: 0.2 to 5 mV for a fitted model).
const MODEL_V: f64 = 2e-4;
/// State of charge over which the resistance left out forgets itself (guess: 0.05 to 0.5).
const RESISTANCE_LENGTH: f64 = 0.15;
/// State of charge over which what the line between two knots of the OCV table's error leaves out
/// forgets itself: half their distance.
const FINE_LENGTH: f64 = 0.5 * ocv_error::SPACING;
/// Drift of the capacity over a full cycle, as a share of it (the thesis' cells: 2e-4).
const CAPACITY_PER_CYCLE: f64 = 2e-4;
/// Drift of the current sensor's offset over a day, as a share of its deviation.
const OFFSET_PER_DAY: f64 = 0.1;
/// While the state of charge is less sure than this, the curve bends too much over what is possible
/// for anything else to be learned: all other states are considered only.
const ROUGH_SOC: f64 = 0.01;
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
    shown_v: f64,
}

/// What the window under way has seen.
#[derive(Debug, Clone, Copy, Default)]
struct Gathered {
    samples: f64,
    lasted_s: f64,
    cell_v: f64,
    moved: f64,
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
        set(layout.resistance, 0.0, prior.left_out_ohm);
        set(layout.voltage_offset, 0.0, voltage.offset_sigma / f64::from(model.battery().series));
        set(layout.fine, 0.0, fine_v);
        for one in 0..ocv_error::KNOTS {
            for other in 0..ocv_error::KNOTS {
                p[(layout.ocv + one, layout.ocv + other)] = ocv_error::covariance(&model.uncertainty, one, other);
            }
        }
        let middle = Point { run: start, state: x.clone(), shown_v: 0.0 };
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
            point.shown_v = 0.0;
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
            let left_out_v = state[layout.resistance] * self.warmth.1 * followed.cell_a + state[layout.capacity] * followed.drop_v;
            point.shown_v += point.run.channels[Channel::VoltageV] / series - left_out_v;
            if index == 0 {
                self.gathered.moved += followed.moved.abs();
            }
        }
        self.gathered.samples += 1.0;
        self.gathered.lasted_s += sample.dt_s;
        self.gathered.cell_v += sample.voltage_v / series;
    }

    /// What the errors of sensor and table add to the voltage of a point at a state of charge.
    fn line_v(&self, state: &DVector<f64>, soc: f64) -> f64 {
        let (knot, share) = ocv_error::weights(soc);
        let at = self.layout.ocv + knot;
        state[self.layout.voltage_offset] + state[self.layout.fine] + (1.0 - share) * state[at] + share * state[at + 1]
    }

    /// Ends a window: moves mean and covariance, and learns from the mean voltage.
    fn learn(&mut self) {
        let Gathered { samples, lasted_s, cell_v, moved } = self.gathered;
        let (layout, states) = (self.layout.clone(), self.layout.first_parameter);
        // Where the runs have gone.
        let mut spread = self.factor.clone();
        for column in 0..layout.followed() {
            let (above, below) = (&self.points[1 + 2 * column].run, &self.points[2 + 2 * column].run);
            for row in 0..states {
                spread[(row, column)] = (above.states()[row] - below.states()[row]) / (2.0 * REACH);
            }
        }
        self.x.rows_mut(0, states).copy_from_slice(self.points[0].run.states());
        // What belongs to a state of charge is forgotten with the distance from it.
        let fine_v = self.fine_v;
        let local = [(layout.resistance, RESISTANCE_LENGTH, self.prior.left_out_ohm), (layout.fine, FINE_LENGTH, fine_v)];
        for (state, length, _) in local {
            let keeps = (-moved / length).exp();
            self.x[state] *= keeps;
            spread.row_mut(state).scale_mut(keeps);
        }

        // What the points show.
        let shown = |point: &Point| point.shown_v / samples + self.line_v(&point.state, point.run.states()[0]);
        let middle_v = shown(&self.points[0]);
        let middle_soc = self.points[0].run.states()[0];
        let mut slopes = DVector::zeros(layout.len);
        let (mut mean_v, mut bend_v2) = (middle_v, 0.0);
        for column in 0..layout.len {
            if column < layout.followed() {
                let (above_v, below_v) = (shown(&self.points[1 + 2 * column]), shown(&self.points[2 + 2 * column]));
                let bend_v = above_v + below_v - 2.0 * middle_v;
                slopes[column] = (above_v - below_v) / (2.0 * REACH);
                mean_v += bend_v / (2.0 * REACH * REACH);
                bend_v2 += (REACH * REACH - 1.0) * (bend_v / (2.0 * REACH * REACH)).powi(2);
            } else {
                slopes[column] = self.line_v(&self.factor.column(column).into_owned(), middle_soc);
            }
        }
        let floor_v = self.model.sensor(Channel::VoltageV).floor() / f64::from(self.model.battery().series);
        let noise_v2 = floor_v * floor_v / samples + MODEL_V * MODEL_V + bend_v2;
        let expected_v2 = slopes.norm_squared() + noise_v2;
        let innovation_v = cell_v / samples - mean_v;
        let surprise = innovation_v.abs() / expected_v2.sqrt();
        if surprise > SURPRISE {
            self.p = &spread * spread.transpose();
            self.doubt((surprise / SURPRISE).min(DOUBT_MAX));
        } else {
            let mut gain = &spread * &slopes / expected_v2;
            if self.p[(0, 0)] > ROUGH_SOC * ROUGH_SOC {
                gain.rows_mut(1, layout.len - 1).fill(0.0);
            }
            spread -= &gain * slopes.transpose();
            self.p = &spread * spread.transpose() + &gain * gain.transpose() * noise_v2;
            self.x += gain * innovation_v;
        }

        // What drifts.
        let capacity_ah = self.model.battery().capacity_ah;
        let mut widen = |state: usize, variance: f64| self.p[(state, state)] += variance;
        widen(0, (self.current.floor() * lasted_s / S_PER_H / capacity_ah).powi(2) / samples);
        widen(layout.capacity, CAPACITY_PER_CYCLE.powi(2) * moved);
        widen(layout.current_offset, (OFFSET_PER_DAY * self.current.offset_sigma).powi(2) * lasted_s / 86_400.0);
        for (state, length, sigma) in local {
            widen(state, sigma * sigma * (1.0 - (-2.0 * moved / length).exp()));
        }
        self.draw();
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
        if (sample.temperature_degc - self.warmth.0).abs() > 1.0 {
            self.warmth = (sample.temperature_degc, temperature_factor(&self.model, sample.temperature_degc));
        }
        self.follow(sample);
        if self.gathered.lasted_s >= WINDOW_S {
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
        let soh = Estimate::new(1.0 + self.x[capacity], self.p[(capacity, capacity)].max(0.0).sqrt());
        let mut watch = std::mem::take(&mut self.watch);
        let pack = Pack { gauge: self, temperature_degc: watch.temperature_degc, cycles: watch.cycles.full() };
        let reading = watch.reading(&self.model, &pack, self.soc(), soh);
        self.watch = watch;
        reading
    }
}
