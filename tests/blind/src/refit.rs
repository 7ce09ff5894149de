//! What a refit of the base model leaves of a hidden effect: the size of the puzzle.
//!
//! Plain least squares on noise-free truth. Everything may move that the lab has to allow for as
//! well: the base's free parameters, the state of charge at the start of each log, the OCV table
//! and each sensor's offset and gain within two deviations of what is stated. Nothing of this is
//! shared with the lab's own fit, so that neither can hide a mistake of the other.

use std::collections::BTreeMap;
use std::sync::Arc;

use energy::real::{LANES, derivative, variable};
use energy::{Channel, Dual, Facts, Model, Run, Start, System};
use nalgebra::{DMatrix, DVector};

use crate::case::Leaves;
use crate::draft::Draft;
use crate::world::Course;

/// Rounds after which no case of the plan changes by a tenth.
pub const ROUNDS: usize = 3;
/// Points of the OCV table's correction.
const KNOTS: usize = 21;
/// Share of a parameter's range that a refit moves it by without effort.
const PRIOR_SHARE: f64 = 1.0;
/// Deviations that a tolerance reaches. A log of thousands of rows would push a sensor's offset
/// any number of deviations away to win a microvolt; data sheets do not allow that.
const TOLERANCE: f64 = 2.0;

/// What may move.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Unknown {
    Parameter(usize),
    StartSoc(usize),
    CurrentOffset,
    CurrentGain,
    Offset(Channel),
    Gain(Channel),
    Ocv(usize),
}

impl Unknown {
    /// Whether its derivative comes from a walk of the model in that log.
    fn walks_in(self, log: usize) -> bool {
        match self {
            Unknown::Parameter(_) | Unknown::CurrentOffset | Unknown::CurrentGain => true,
            Unknown::StartSoc(own) => own == log,
            _ => false,
        }
    }
}

/// How a row changes: place of the unknown, derivative.
type Slopes = Vec<(usize, f64)>;

struct Refit<'a> {
    model: Arc<Model>,
    courses: Vec<&'a Course>,
    targets: Vec<Channel>,
    unknowns: Vec<(Unknown, f64)>,
    series: f64,
}

/// What is left after `rounds` of linear least squares.
#[must_use]
pub fn leaves(base: &Draft, courses: &[Course], rounds: usize) -> Leaves {
    let model = base.model();
    let courses: Vec<&Course> = courses.iter().filter(|course| !course.holdout).collect();
    let targets = model.system.targets().iter().copied();
    let targets: Vec<Channel> = targets.filter(|&channel| channel != Channel::TemperatureDegc || model.predicts_temperature()).collect();
    let series = if let Facts::Battery(facts) = &model.facts { f64::from(facts.series) } else { 1.0 };
    let unknowns = unknowns(&model, courses.len(), &targets);
    let refit = Refit { model, courses, targets, unknowns, series };
    let mut at = DVector::zeros(refit.unknowns.len());
    let mut left = BTreeMap::new();
    for round in 0..rounds.max(1) {
        let (step, after) = refit.round(&at);
        at += step;
        if round + 1 == rounds.max(1) {
            left = after;
        }
    }
    left.extend(refit.warming());
    let squares = |(channel, rms): (&Channel, &f64)| (rms / refit.model.sensor(*channel).floor()).powi(2);
    let rows: usize = refit.courses.iter().map(|course| course.time_s.len()).sum();
    let deviations = (rows as f64 * left.iter().map(squares).sum::<f64>()).sqrt();
    let by_channel: BTreeMap<Channel, f64> = left.into_iter().map(|(channel, rms)| (channel, refit.in_units(channel, rms))).collect();
    let strength = by_channel.iter().map(|(&channel, left)| if channel == Channel::VoltageV { *left } else { left / 2.0 });
    Leaves { strength: strength.fold(0.0, f64::max), by_channel, deviations }
}

fn unknowns(model: &Model, logs: usize, targets: &[Channel]) -> Vec<(Unknown, f64)> {
    let free = model.parameters().iter().enumerate().filter(|(_, p)| p.free);
    let mut unknowns: Vec<(Unknown, f64)> = free.map(|(index, p)| (Unknown::Parameter(index), PRIOR_SHARE * (p.max - p.min))).collect();
    if model.system == System::Battery {
        unknowns.extend((0..logs).map(|log| (Unknown::StartSoc(log), model.uncertainty.soc_initial_sigma)));
        let current = model.sensor(Channel::CurrentA);
        unknowns.extend([(Unknown::CurrentOffset, current.offset_sigma), (Unknown::CurrentGain, current.gain_sigma)]);
        unknowns.extend((0..KNOTS).map(|knot| (Unknown::Ocv(knot), model.uncertainty.ocv_sigma_v)));
    }
    for &target in targets {
        let sensor = model.sensor(target);
        unknowns.extend([(Unknown::Offset(target), sensor.offset_sigma), (Unknown::Gain(target), sensor.gain_sigma)]);
    }
    // What is known exactly does not move.
    unknowns.retain(|(_, sigma)| *sigma > 0.0);
    unknowns
}

impl Refit<'_> {
    /// One round of least squares: the step, and what it leaves on each target if all is linear.
    fn round(&self, at: &DVector<f64>) -> (DVector<f64>, BTreeMap<Channel, f64>) {
        let count = self.unknowns.len();
        let (mut square, mut right) = (DMatrix::<f64>::zeros(count, count), DVector::<f64>::zeros(count));
        let mut kept: Vec<(Channel, f64, Slopes)> = Vec::new();
        for log in 0..self.courses.len() {
            self.rows(log, at, |target, residual, slopes| {
                let weight = self.model.sensor(target).floor().powi(-2);
                for &(i, slope) in &slopes {
                    right[i] += weight * slope * residual;
                    for &(j, other) in &slopes {
                        square[(i, j)] += weight * slope * other;
                    }
                }
                kept.push((target, residual, slopes));
            });
        }
        for (i, (_, sigma)) in self.unknowns.iter().enumerate() {
            square[(i, i)] += sigma.powi(-2);
            right[i] -= at[i] * sigma.powi(-2);
        }
        let step = self.within_bounds(at, &square, &right);
        let mut sums: BTreeMap<Channel, (f64, f64)> = BTreeMap::new();
        for (target, residual, slopes) in kept {
            let left = residual - slopes.iter().map(|&(i, slope)| slope * step[i]).sum::<f64>();
            let (sum, rows) = sums.entry(target).or_default();
            *sum += left * left;
            *rows += 1.0;
        }
        (step, sums.into_iter().map(|(channel, (sum, rows))| (channel, (sum / rows).sqrt())).collect())
    }

    /// Solves for the step, and holds at its tolerance whatever would leave it, until nothing does.
    fn within_bounds(&self, at: &DVector<f64>, square: &DMatrix<f64>, right: &DVector<f64>) -> DVector<f64> {
        let mut held: Vec<Option<f64>> = vec![None; at.len()];
        loop {
            let (mut matrix, mut vector) = (square.clone(), right.clone());
            for (i, held) in held.iter().enumerate() {
                let Some(step) = held else { continue };
                for j in 0..at.len() {
                    vector[j] -= matrix[(j, i)] * step;
                }
                matrix.fill_row(i, 0.0);
                matrix.fill_column(i, 0.0);
                matrix[(i, i)] = 1.0;
                vector[i] = *step;
            }
            // A held unknown keeps its step; later ones must not have moved it.
            for (i, held) in held.iter().enumerate() {
                if let Some(step) = held {
                    vector[i] = *step;
                }
            }
            let step = matrix.cholesky().map_or_else(|| DVector::zeros(at.len()), |factor| factor.solve(&vector));
            let beyond: Vec<usize> = (0..at.len()).filter(|&i| held[i].is_none() && !self.inside(i, at[i] + step[i])).collect();
            if beyond.is_empty() {
                return step;
            }
            for i in beyond {
                let (low, high) = self.bounds(i);
                held[i] = Some((at[i] + step[i]).clamp(low, high) - at[i]);
            }
        }
    }

    /// How far an unknown may lie from what is believed.
    fn bounds(&self, i: usize) -> (f64, f64) {
        match self.unknowns[i] {
            (Unknown::Parameter(index), _) => {
                let p = &self.model.parameters()[index];
                (p.min - p.value, p.max - p.value)
            }
            (_, sigma) => (-TOLERANCE * sigma, TOLERANCE * sigma),
        }
    }

    fn inside(&self, i: usize, value: f64) -> bool {
        let (low, high) = self.bounds(i);
        let slack = 1e-9 * (high - low);
        (low - slack..=high + slack).contains(&value)
    }

    /// Walks a log and hands out, row by row, what is missing and how it changes with each unknown.
    fn rows(&self, log: usize, at: &DVector<f64>, mut row: impl FnMut(Channel, f64, Slopes)) {
        let course = self.courses[log];
        let own: Vec<usize> = (0..self.unknowns.len()).filter(|&i| self.unknowns[i].0.walks_in(log)).collect();
        // One list of (row, target) per pass: the derivatives of its lanes.
        let mut walked: Vec<Vec<(f64, Vec<f64>, f64)>> = Vec::new();
        for lanes in own.chunks(LANES).chain(own.is_empty().then_some(&[][..])) {
            walked.push(self.walk(course, log, at, lanes));
        }
        let value = |wanted: Unknown| self.unknowns.iter().position(|(unknown, _)| *unknown == wanted).map_or(0.0, |i| at[i]);
        let targets = self.targets.len();
        for index in targets..walked[0].len() {
            let (target, soc) = (self.targets[index % targets], walked[0][index].2);
            let mut predicted = walked[0][index].0;
            let mut slopes: Slopes = Vec::with_capacity(self.unknowns.len());
            for (lanes, pass) in own.chunks(LANES).zip(&walked) {
                slopes.extend(lanes.iter().zip(&pass[index].1).map(|(&i, &slope)| (i, slope)));
            }
            for (i, (unknown, _)) in self.unknowns.iter().enumerate() {
                let slope = match unknown {
                    Unknown::Ocv(knot) if target == Channel::VoltageV => self.series * hat(soc, *knot),
                    Unknown::Offset(channel) if *channel == target => 1.0,
                    Unknown::Gain(channel) if *channel == target => walked[0][index].0,
                    _ => 0.0,
                };
                if slope != 0.0 {
                    predicted += slope * value(*unknown);
                    slopes.push((i, slope));
                }
            }
            let observed = course.of(target).map_or(f64::NAN, |values| values[index / targets]);
            row(target, observed - predicted, slopes);
        }
    }

    /// Predictions, derivatives in the lanes and the state of charge, for every row and target.
    fn walk(&self, course: &Course, log: usize, at: &DVector<f64>, lanes: &[usize]) -> Vec<(f64, Vec<f64>, f64)> {
        let dual = |i: usize, value: f64| lanes.iter().position(|&lane| lane == i).map_or(Dual::from(value), |lane| variable(value, lane));
        let mut parameters: Vec<Dual> = self.model.values().into_iter().map(Dual::from).collect();
        let mut soc = Dual::from(course.start.soc);
        let (mut offset_a, mut gain) = (Dual::from(0.0), Dual::from(1.0));
        for (i, (unknown, _)) in self.unknowns.iter().enumerate() {
            match unknown {
                Unknown::Parameter(index) => parameters[*index] = dual(i, self.model.parameters()[*index].value + at[i]),
                Unknown::StartSoc(own) if *own == log => soc = dual(i, course.start.soc + at[i]),
                Unknown::CurrentOffset => offset_a = dual(i, at[i]),
                Unknown::CurrentGain => gain = dual(i, 1.0 + at[i]),
                _ => {}
            }
        }
        let start = Start { soc, ..course.start.lifted() };
        let mut run = Run::with_parameters(Arc::clone(&self.model), parameters, start);
        let computed = self.model.system.computed();
        let inputs: Vec<_> =
            course.columns.iter().filter(|(channel, _)| !computed.contains(channel) && !self.targets.contains(channel)).collect();
        let mut rows = Vec::with_capacity(course.time_s.len() * self.targets.len());
        for (row, time_s) in course.time_s.iter().enumerate() {
            for (channel, values) in &inputs {
                let value = Dual::from(values[row]);
                run.channels[*channel] = if *channel == Channel::CurrentA { value * gain + offset_a } else { value };
            }
            if row > 0 {
                run.step(time_s - course.time_s[row - 1]);
            }
            for &target in &self.targets {
                let predicted = &run.channels[target];
                let slopes = (0..lanes.len()).map(|lane| derivative(predicted, lane)).collect();
                rows.push((predicted.re, slopes, run.channels[Channel::Soc].re));
            }
        }
        rows
    }

    /// A model that is told the cell's temperature and that of the surroundings, and says nothing
    /// of how one follows the other, misses their difference, less what the sensor's offset can be.
    fn warming(&self) -> Option<(Channel, f64)> {
        if self.model.system != System::Battery || self.model.predicts_temperature() {
            return None;
        }
        let both = self.courses.iter().filter_map(|course| Some((course.of(Channel::TemperatureDegc)?, course.of(Channel::AmbientDegc)?)));
        let differences: Vec<f64> =
            both.flat_map(|(cell, ambient)| cell.iter().zip(ambient).map(|(cell, ambient)| cell - ambient)).collect();
        if differences.is_empty() {
            return None;
        }
        let count = differences.len() as f64;
        let reach = TOLERANCE * self.model.sensor(Channel::TemperatureDegc).offset_sigma;
        let offset = (differences.iter().sum::<f64>() / count).clamp(-reach, reach);
        let squares: f64 = differences.iter().map(|difference| (difference - offset).powi(2)).sum();
        Some((Channel::TemperatureDegc, (squares / count).sqrt()))
    }

    /// mV per cell for a voltage, sensor floors for everything else.
    fn in_units(&self, channel: Channel, rms: f64) -> f64 {
        if channel == Channel::VoltageV { rms / self.series * 1e3 } else { rms / self.model.sensor(channel).floor() }
    }
}

/// The hat function of a knot of the OCV table's correction.
fn hat(soc: f64, knot: usize) -> f64 {
    let place = soc.clamp(0.0, 1.0) * (KNOTS - 1) as f64;
    (1.0 - (place - knot as f64).abs()).max(0.0)
}
