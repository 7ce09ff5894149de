//! Whether a stated number of the model, or a sensor that reads late, would explain the logs without any effect.
//!
//! A search changes what the model marks free, and takes every other number as exact. What is wrong with one of those is
//! taken for an effect that does the same (a mass that is a fifth too small for friction in the gears), and only who
//! stated it can know.

use std::cmp::Reverse;
use std::collections::BTreeSet;
use std::sync::Arc;

use energy::{Channel, Model, Parameter, Sensor, System};
use serde::Serialize;

use super::evidence::Evidence;
use super::rough::Rough;
use super::state::State;
use crate::predict::{Prediction, predict};
use crate::prepare::Prepared;

/// Rows by which a sensor may be late or early here.
const LATE_ROWS: f64 = 10.0;
/// Share by which a sensor may show too much or too little here: also pounds for kilograms, and hardly its sign.
const WIDE_GAIN: f64 = 1.0;
/// Deviation of an offset of a measured input here, in deviations of the input itself: what was not logged at all may be more than what was.
const WIDE_OFFSET: f64 = 4.0;
/// Units in which a column may be read for the right one: thousandths and thousands, minutes for seconds, km/h for m/s, degrees for
/// radians, and the other sign.
const UNITS: [f64; 8] = [1.0, 1e3, 1e-3, 60.0, 1.0 / 60.0, 3.6, 180.0 / std::f64::consts::PI, -1.0];
/// Deviations from what is stated from which on a sensor's number is another.
const SURELY: f64 = 5.0;
/// Of the squared error beyond the floor, the most that another number may leave.
const MOST_LEFT: f64 = 0.1;
/// It may leave twice as much as what was found, and where that leaves nothing a tenth of the floor's square.
const AS_WELL: f64 = 2.0;
const SLACK: f64 = 0.1;

/// A number that would have to be another.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct OtherNumber {
    /// Where it stands in the model file: `effect.parameter`, all that have one name and one value; `sensor.channel.lag_s`. Or `gain of
    /// channel`, reading over true value, and `offset of channel`, reading less true value, which no file holds.
    pub numbers: Vec<String>,
    /// As it is stated.
    pub stated: f64,
    /// As it would have to be.
    pub found: f64,
    /// Standard deviation of that.
    pub sigma: f64,
    /// Share of the squared error beyond the sensors' noise that goes with it.
    pub explained: f64,
}

/// What would have to be another number for the model as given to explain all logs nearly as well as what was `found`, each alone;
/// empty where nothing would.
#[must_use]
pub fn other_numbers(model: &Arc<Model>, logs: &[Prepared], found: &State) -> Vec<OtherNumber> {
    let given = State::of_model(Arc::clone(model), Arc::new(Evidence::new(model, logs.to_vec())));
    let Some(asked) = Asked::between(&given, found) else { return Vec::new() };
    let evidence = &given.frame.evidence;
    let of_effects = alike(model).into_iter().filter_map(|alike| {
        // As one number: that each may be another says nothing of the one that stands in the file.
        let numbers: Vec<_> = alike.iter().map(|one| (one.effect, one.name)).collect();
        let freed = Model::clone(model).freed_as_one(&numbers);
        let state = State::of_model(Arc::new(freed), Arc::clone(evidence)).with_what_is_open_as_before();
        let own = |&index: &usize| (state.frame.model.parameters()[index].effect, state.frame.model.parameters()[index].name) == numbers[0];
        let place = state.frame.free.iter().position(own)?;
        let names = numbers.iter().map(|(effect, name)| format!("{effect}.{name}")).collect();
        asked.tell(&state, names, alike[0].value, state.x[place], state.sigmas()[place])
    });
    // What it is off by, where that is surely something, or another unit is what explains.
    let of_sensor = |logs: &[Prepared], what: Rough, wider: Sensor, in_other_unit: bool| {
        let (Rough::Lag(channel) | Rough::Gain(channel) | Rough::Offset(channel)) = what else { return None };
        let mut model = Model::clone(model);
        model.sensors.insert(channel, wider);
        let own = Arc::new(Evidence::new(&model, logs.to_vec()));
        let state = State::of_model(Arc::new(model), own);
        let place = state.frame.free.len() + state.frame.known.iter().position(|known| known.what == what)?;
        let (shift, sigma) = (state.x[place], state.covariance()[(place, place)].max(0.0).sqrt());
        let sensor = given.frame.model.sensor(channel);
        let known = match what {
            Rough::Lag(_) => sensor.lag_sigma_s,
            Rough::Offset(_) => sensor.offset_sigma,
            _ => sensor.gain_sigma,
        };
        let surely = in_other_unit || shift.abs() > SURELY * sigma.hypot(known);
        surely.then(|| asked.tell(&state, Vec::new(), 0.0, shift, sigma))?
    };
    let targets: Vec<Channel> =
        model.system.targets().iter().copied().filter(|&channel| logs.iter().any(|log| judged(log, channel))).collect();
    let late = targets.iter().filter_map(|&channel| {
        let (sensor, widest_s) = (model.sensor(channel), LATE_ROWS * evidence.step_s(channel));
        let number = of_sensor(logs, Rough::Lag(channel), Sensor { lag_sigma_s: widest_s, ..sensor }, false)?;
        let numbers = vec![format!("sensor.{}.lag_s", channel.name())];
        Some(OtherNumber { numbers, stated: sensor.lag_s, found: sensor.lag_s + number.found, ..number })
    });
    let inputs = logs.iter().flat_map(|log| log.inputs.iter()).filter(|(_, values)| !is_flag(values)).map(|&(channel, _)| channel);
    let inputs: BTreeSet<Channel> = inputs.collect();
    let gains = targets.iter().chain(&inputs).filter_map(|&channel| {
        let wider = Sensor { gain_sigma: WIDE_GAIN, ..model.sensor(channel) };
        let from = |unit: f64| {
            let read: Vec<Prepared> = logs.iter().map(|log| log.with_scaled(channel, 1.0 / unit)).collect();
            let number = of_sensor(&read, Rough::Gain(channel), wider, unit != 1.0)?;
            let numbers = vec![format!("gain of {}", channel.name())];
            Some(OtherNumber { numbers, stated: 1.0, found: unit * (1.0 + number.found), sigma: unit.abs() * number.sigma, ..number })
        };
        // No way leads from W to mW: also from the unit on in which it seems to be read.
        let other = Some(unit(model, logs, channel, evidence)).filter(|&unit| unit != 1.0);
        [Some(1.0), other].into_iter().flatten().filter_map(from).max_by(|a, b| a.explained.total_cmp(&b.explained))
    });
    // A battery's are effects of the catalogue.
    let measured = inputs.iter().filter(|_| model.system != System::Battery);
    let offsets = measured.filter_map(|&channel| {
        let wider = Sensor { offset_sigma: WIDE_OFFSET * spread(logs, channel), ..model.sensor(channel) };
        let number = of_sensor(logs, Rough::Offset(channel), wider, false)?;
        Some(OtherNumber { numbers: vec![format!("offset of {}", channel.name())], ..number })
    });
    let late_inputs = inputs.iter().filter_map(|&channel| {
        let (state, late_s, step_s) = with_late_input(&given, logs, channel)?;
        let (numbers, stated) = (format!("sensor.{}.lag_s", channel.name()), model.sensor(channel).lag_s);
        // It was sought by whole rows: it may be anything within one.
        asked.tell(&state, vec![numbers], stated, stated + late_s, step_s / 12.0_f64.sqrt())
    });
    // That all inputs are early and that what they bring about is late is one thing: what explains most comes first.
    let mut delays: Vec<OtherNumber> = late.chain(late_inputs).collect();
    delays.sort_by(|a, b| b.explained.total_cmp(&a.explained));
    let mut all: Vec<OtherNumber> = of_effects.chain(delays).chain(gains).chain(offsets).collect();
    all.sort_by_key(|number| Reverse((100.0 * number.explained).round() as i64));
    all
}

/// The model fitted to the logs with one input moved by as many whole rows as leave least, that time, and that of one row, s; none where
/// the input is best as it was read.
fn with_late_input(given: &State, logs: &[Prepared], channel: Channel) -> Option<(State, f64, f64)> {
    let model = &given.frame.model;
    let (length_s, steps) = logs.iter().fold((0.0, 0), |(length_s, steps), log| {
        let own_s = log.time_s.last().zip(log.time_s.first()).map_or(0.0, |(last, first)| last - first);
        (length_s + own_s, steps + log.time_s.len().saturating_sub(1))
    });
    let step_s = length_s / steps.max(1) as f64;
    let moved = |late_s: f64| -> Vec<Prepared> { logs.iter().map(|log| log.with_late_input(channel, late_s)).collect() };
    let values = given.frame.values(&given.x);
    let left = |rows: i32| {
        let of_logs =
            moved(f64::from(rows) * step_s).into_iter().map(|log| squares(&predict(model, &log, &values), &log, &given.frame.evidence));
        let (sum, count) = of_logs.fold((0.0, 0), |(sum, count), own| (sum + own.0, count + own.1));
        sum / f64::from(count.max(1))
    };
    let most = LATE_ROWS as i32;
    let (_, rows) = (-most..=most).map(|rows| (left(rows), rows)).min_by(|a, b| a.0.total_cmp(&b.0))?;
    let late_s = f64::from(rows) * step_s;
    let evidence = || Arc::new(Evidence::new(model, moved(late_s)));
    (rows != 0).then(|| (State::of_model(Arc::clone(model), evidence()), late_s, step_s))
}

/// Sum and count of the squares of what a prediction misses, in squares of the sensors' floors.
fn squares(shown: &Prediction, log: &Prepared, evidence: &Evidence) -> (f64, u32) {
    let mut told = (0.0, 0);
    for target in &log.targets {
        let floor = evidence.floor(target.channel);
        for (row, shown) in shown.of(target.channel).unwrap_or_default().iter().enumerate().filter(|(row, _)| target.used[*row]) {
            told = (told.0 + ((target.observed[row] - shown) / floor).powi(2), told.1 + 1);
        }
    }
    told
}

/// What is left by the model as given, and by what was found.
pub(super) struct Asked {
    given: f64,
    found: f64,
}

impl Asked {
    /// Of these; nothing where nothing is left by the model as given that could be explained.
    pub(super) fn between(given: &State, found: &State) -> Option<Self> {
        let asked = Self { given: unexplained(given), found: unexplained(found) };
        (asked.given > 0.0).then_some(asked)
    }

    /// Whether a model without what was found leaves no more than that did.
    pub(super) fn leaves_no_more(&self, state: &State) -> bool {
        unexplained(state) <= self.found + SLACK
    }

    /// Whether a model without what was found explains nearly as much, and most of all.
    pub(super) fn does_as_well(&self, state: &State) -> bool {
        unexplained(state) <= (AS_WELL * self.found + SLACK).min(MOST_LEFT * self.given)
    }

    /// Another number, where it explains nearly as much as what was found.
    fn tell(&self, state: &State, numbers: Vec<String>, stated: f64, found: f64, sigma: f64) -> Option<OtherNumber> {
        // A share of next to nothing is none.
        let explained = if self.given > SLACK { 1.0 - unexplained(state) / self.given } else { return None };
        self.does_as_well(state).then_some(OtherNumber { numbers, stated, found, sigma, explained })
    }
}

/// The numbers that are not free, those of one name and value together: the mass of a robot stands with all that it does.
fn alike(model: &Model) -> Vec<Vec<&Parameter>> {
    let mut all: Vec<Vec<&Parameter>> = Vec::new();
    for parameter in model.parameters().iter().filter(|parameter| !parameter.free && parameter.max > parameter.min) {
        let known = all.iter_mut().find(|alike| alike[0].name == parameter.name && alike[0].value.to_bits() == parameter.value.to_bits());
        match known {
            Some(alike) => alike.push(parameter),
            None => all.push(vec![parameter]),
        }
    }
    all
}

/// Whether something is only there or not: it has no gain.
fn is_flag(values: &[f64]) -> bool {
    values.iter().all(|&value| value == 0.0 || value == 1.0)
}

/// In how many of the right units a channel seems to be read: of [`UNITS`] the one with which the model as it stands leaves least.
fn unit(model: &Arc<Model>, logs: &[Prepared], channel: Channel, evidence: &Evidence) -> f64 {
    let values = model.values();
    let left = |unit: f64| -> f64 {
        let read = logs.iter().map(|log| log.with_scaled(channel, 1.0 / unit));
        let sum: f64 = read.map(|log| squares(&predict(model, &log, &values), &log, evidence).0).sum();
        // What cannot be predicted at all explains nothing.
        if sum.is_finite() { sum } else { f64::INFINITY }
    };
    UNITS.into_iter().map(|unit| (left(unit), unit)).min_by(|a, b| a.0.total_cmp(&b.0)).map_or(1.0, |(_, unit)| unit)
}

/// Standard deviation of an input over all rows.
fn spread(logs: &[Prepared], channel: Channel) -> f64 {
    let inputs = logs.iter().flat_map(|log| &log.inputs).filter(|(input, _)| *input == channel);
    let values: Vec<f64> = inputs.flat_map(|(_, values)| values.iter().copied()).filter(|value| value.is_finite()).collect();
    let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
    (values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len().max(1) as f64).sqrt()
}

fn judged(log: &Prepared, channel: Channel) -> bool {
    log.targets.iter().any(|target| target.channel == channel)
}

/// What is left beyond the sensors' noise, in squares of it, over all channels.
fn unexplained(state: &State) -> f64 {
    let beyond = |(channel, rms): (Channel, f64)| ((rms / state.frame.evidence.floor(channel)).powi(2) - 1.0).max(0.0);
    state.rms().into_iter().map(beyond).sum()
}
