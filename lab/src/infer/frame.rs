//! Model, logs and rough knowledge as one vector of unknowns.
//!
//! Unknowns `x`: first the model's free parameters in its own order, then what is only roughly
//! known (see [`super::rough`]). Rows: the used rows of every target of every log, one behind the
//! other.

use std::sync::Arc;

use energy::real::{Dual, LANES, derivative, variable};
use energy::{Channel, Channels, Facts, Model, Start, System};
use nalgebra::DMatrix;

use super::evidence::{Evidence, Segment};
use super::rough::{Known, Rough, knots, rough, weights};
use super::walk::{drives, walk};
use crate::prepare::predicted_channels;

/// A model on its evidence.
#[derive(Debug, Clone)]
pub struct Frame {
    /// The model; its values are where the unknowns begin.
    pub model: Arc<Model>,
    /// The logs.
    pub evidence: Arc<Evidence>,
    /// Indices of the free parameters into [`Model::parameters`].
    pub free: Vec<usize>,
    /// What is only roughly known.
    pub known: Vec<Known>,
    /// Where the error of an OCV table may bend.
    knots: Vec<f64>,
}

impl Frame {
    /// The model on these logs.
    #[must_use]
    pub fn new(model: Arc<Model>, evidence: Arc<Evidence>) -> Frame {
        let free = (0..model.parameters().len()).filter(|&index| model.parameters()[index].free).collect();
        let known = rough(&model, &evidence.logs);
        let knots = match &model.facts {
            Facts::Battery(facts) => knots(facts.ocv.points().0),
            _ => Vec::new(),
        };
        Frame { model, evidence, free, known, knots }
    }

    /// Number of unknowns.
    #[must_use]
    pub fn unknowns(&self) -> usize {
        self.free.len() + self.known.len()
    }

    /// The model's own values, and no error in what is only roughly known.
    #[must_use]
    pub fn start(&self) -> Vec<f64> {
        let free = self.free.iter().map(|&index| self.model.parameters()[index].value);
        free.chain(self.known.iter().map(|_| 0.0)).collect()
    }

    /// Bounds of every unknown.
    #[must_use]
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        let free = self.free.iter().map(|&index| (self.model.parameters()[index].min, self.model.parameters()[index].max));
        free.chain(self.known.iter().map(|known| (-ROUGH_MAX * known.sigma, ROUGH_MAX * known.sigma))).collect()
    }

    /// Values of all parameters of the model at these unknowns.
    #[must_use]
    pub fn values(&self, x: &[f64]) -> Vec<f64> {
        let mut values = self.model.values();
        for (&index, &value) in self.free.iter().zip(x) {
            values[index] = value;
        }
        values
    }

    /// Error of one rough number at these unknowns; 0 when it is not rough.
    #[must_use]
    pub fn error(&self, x: &[f64], what: Rough) -> f64 {
        self.known.iter().position(|known| known.what == what).map_or(0.0, |place| x[self.free.len() + place])
    }

    /// Error of the OCV table, as points of SoC and V per cell to be joined by straight lines; empty
    /// when the table is exact.
    #[must_use]
    pub fn ocv_error(&self, x: &[f64]) -> Vec<(f64, f64)> {
        let errors = self.knot_errors(x);
        if errors.is_empty() {
            return Vec::new();
        }
        let between = self
            .knots
            .windows(2)
            .flat_map(|pair| (0..POINTS_BETWEEN).map(move |point| pair[0] + (pair[1] - pair[0]) * point as f64 / POINTS_BETWEEN as f64));
        let all = between.chain(self.knots.last().copied());
        all.map(|soc| (soc, weights(&self.knots, soc).iter().map(|&(knot, weight)| errors[knot] * weight).sum())).collect()
    }

    /// Error of the OCV table at every knot, V per cell; empty when the table is exact.
    fn knot_errors(&self, x: &[f64]) -> Vec<f64> {
        let table_is_rough = self.known.iter().any(|known| matches!(known.what, Rough::Ocv(_)));
        let count = if table_is_rough { self.knots.len() } else { 0 };
        (0..count).map(|knot| self.error(x, Rough::Ocv(knot))).collect()
    }

    /// What the model predicts for every row.
    #[must_use]
    pub fn predict(&self, x: &[f64]) -> Vec<f64> {
        let values = self.values(x);
        let mut all = vec![0.0; self.evidence.rows()];
        for log in 0..self.evidence.logs.len() {
            self.walk_log(log, x, values.clone(), &self.model_at(x), |_, value| value, |row, shown, _, share| all[row] += shown * share);
        }
        self.delay(x, &mut all);
        all
    }

    /// What the model predicts for every row, and its derivatives by some of the unknowns, one
    /// column each.
    #[must_use]
    pub fn linearise(&self, x: &[f64], by: &[usize]) -> (Vec<f64>, DMatrix<f64>) {
        let mut all = vec![0.0; self.evidence.rows()];
        let mut columns = DMatrix::zeros(all.len(), by.len());
        let model = self.model_at(x);
        for log in 0..self.evidence.logs.len() {
            let moved: Vec<(usize, usize)> =
                by.iter().copied().enumerate().filter(|&(_, unknown)| self.moves_model(unknown, log)).collect();
            for (pass, lanes) in moved.chunks(LANES).enumerate() {
                let dual = |unknown: Option<usize>, value: f64| {
                    let lane = unknown.and_then(|unknown| lanes.iter().position(|&(_, known)| known == unknown));
                    lane.map_or_else(|| Dual::from(value), |lane| variable(value, lane))
                };
                let parameters = self.values(x).into_iter().enumerate();
                let parameters = parameters.map(|(index, value)| dual(self.unknown_of_parameter(index), value)).collect();
                let error = |what, value| dual(self.unknown_of(what), value);
                self.walk_log(log, x, parameters, &model, error, |row, shown: Dual, soc, share| {
                    for (lane, &(column, _)) in lanes.iter().enumerate() {
                        columns[(row, column)] += derivative(&shown, lane) * share;
                    }
                    if pass == 0 {
                        all[row] += shown.re * share;
                        self.additive(row, soc.re, shown.re, share, x, by, &mut columns);
                    }
                });
            }
            if moved.is_empty() {
                self.walk_log(
                    log,
                    x,
                    self.values(x),
                    &model,
                    |_, value| value,
                    |row, shown, soc, share| {
                        all[row] += shown * share;
                        self.additive(row, soc, shown, share, x, by, &mut columns);
                    },
                );
            }
        }
        self.delay_columns(x, &all, by, &mut columns);
        self.delay(x, &mut all);
        for (column, &unknown) in by.iter().enumerate() {
            let step = match self.what(unknown) {
                Some(Rough::Capacity) => CAPACITY_STEP,
                Some(Rough::TemperatureInitial(_)) => TEMPERATURE_STEP_K,
                _ => continue,
            };
            let mut beside = x.to_vec();
            beside[unknown] += step;
            let moved = self.predict(&beside);
            columns.column_mut(column).iter_mut().zip(moved.iter().zip(&all)).for_each(|(slope, (b, a))| *slope = (b - a) / step);
        }
        (all, columns)
    }

    /// RMS that the walk's channel differs by between two models, on the log where it differs most:
    /// `self` at its unknowns, and the same unknowns with some parameters at other values.
    #[must_use]
    pub fn change(&self, x: &[f64], channel: Channel, other: &[(usize, f64)]) -> f64 {
        let values = self.values(x);
        let mut without = values.clone();
        other.iter().for_each(|&(index, value)| without[index] = value);
        let model = self.model_at(x);
        let of_log = |log: usize| {
            let run = |values: Vec<f64>| {
                let mut seen = Vec::new();
                self.walk_channels(
                    log,
                    x,
                    values,
                    &model,
                    |_, value| value,
                    |row, now: &Channels<f64>| {
                        if row > 0 {
                            seen.push(now[channel])
                        }
                    },
                );
                seen
            };
            let (a, b) = (run(values.clone()), run(without.clone()));
            let squares: f64 = a.iter().zip(&b).map(|(a, b)| (a - b).powi(2)).sum();
            (squares / a.len().max(1) as f64).sqrt()
        };
        (0..self.evidence.logs.len()).map(of_log).fold(0.0, f64::max)
    }

    /// State of charge at every row of a log; empty for systems without one.
    #[must_use]
    pub fn soc(&self, x: &[f64], log: usize) -> Vec<f64> {
        let mut soc = Vec::new();
        if self.model.system == System::Battery {
            self.walk_channels(
                log,
                x,
                self.values(x),
                &self.model_at(x),
                |_, value| value,
                |_, now: &Channels<f64>| soc.push(now[Channel::Soc]),
            );
        }
        soc
    }

    fn what(&self, unknown: usize) -> Option<Rough> {
        unknown.checked_sub(self.free.len()).map(|place| self.known[place].what)
    }

    fn unknown_of(&self, what: Rough) -> Option<usize> {
        self.known.iter().position(|known| known.what == what).map(|place| self.free.len() + place)
    }

    fn unknown_of_parameter(&self, index: usize) -> Option<usize> {
        self.free.iter().position(|&free| free == index)
    }

    /// Whether the walk of this log must carry derivatives by the unknown.
    fn moves_model(&self, unknown: usize, log: usize) -> bool {
        match self.what(unknown) {
            None => true,
            Some(Rough::Offset(channel) | Rough::Gain(channel)) => self.drives_model(channel, log),
            Some(Rough::SocInitial(own)) => own == log,
            // Of the model, but dear in every lane: taken by differences.
            Some(Rough::Capacity | Rough::TemperatureInitial(_)) => false,
            Some(Rough::Lag(_) | Rough::Ocv(_)) => false,
        }
    }

    /// Whether the channel is an input of the model in that log.
    fn drives_model(&self, channel: Channel, log: usize) -> bool {
        let input = self.evidence.logs[log].inputs.iter().any(|(input, _)| *input == channel);
        input && !predicted_channels(&self.model).contains(&channel)
    }

    /// The model with the capacity of these unknowns.
    fn model_at(&self, x: &[f64]) -> Arc<Model> {
        let share = self.error(x, Rough::Capacity);
        if share == 0.0 {
            return Arc::clone(&self.model);
        }
        let mut model = Model::clone(&self.model);
        if let Facts::Battery(facts) = &mut model.facts {
            facts.capacity_ah *= 1.0 + share;
        }
        Arc::new(model)
    }

    /// Walks a log and shows its channels; `error` lifts the error of a rough number.
    fn walk_channels<S: energy::effect::Lane>(
        &self,
        log: usize,
        x: &[f64],
        parameters: Vec<S>,
        model: &Arc<Model>,
        error: impl Fn(Rough, f64) -> S,
        at: impl FnMut(usize, &Channels<S>),
    ) {
        let prepared = &self.evidence.logs[log];
        let lifted = |what| -> Option<S> {
            let unknown = self.unknown_of(what)?;
            Some(error(what, x[unknown]))
        };
        let zero = S::from(0.0);
        let shift = |channel| match (lifted(Rough::Offset(channel)), lifted(Rough::Gain(channel))) {
            (None, None) => None,
            (offset, gain) => Some((offset.unwrap_or(zero), gain.unwrap_or(zero))),
        };
        let mut start: Start<S> = prepared.start.lifted();
        start.soc += lifted(Rough::SocInitial(log)).unwrap_or(zero);
        start.temperature_degc += self.error(x, Rough::TemperatureInitial(log));
        walk(model, parameters, start, &prepared.time_s, &drives(model, prepared, shift), at);
    }

    /// Walks a log and shows, for every row that counts, the judged row that it goes into, the
    /// predicted value, the state of charge and the row's share in the mean.
    fn walk_log<S: energy::effect::Lane>(
        &self,
        log: usize,
        x: &[f64],
        parameters: Vec<S>,
        model: &Arc<Model>,
        error: impl Fn(Rough, f64) -> S,
        mut at: impl FnMut(usize, S, S, f64),
    ) {
        let segments: Vec<&Segment> = self.evidence.segments.iter().filter(|segment| segment.log == log).collect();
        let mut next = vec![0; segments.len()];
        let (ocv, cells) = (self.knot_errors(x), self.cells());
        let shown: Vec<(f64, f64)> = segments
            .iter()
            .map(|segment| (self.error(x, Rough::Offset(segment.channel)), self.error(x, Rough::Gain(segment.channel))))
            .collect();
        let source = |channel| {
            let unpredicted = channel == Channel::TemperatureDegc && !model.predicts_temperature();
            if unpredicted { Channel::AmbientDegc } else { channel }
        };
        let sources: Vec<Channel> = segments.iter().map(|segment| source(segment.channel)).collect();
        self.walk_channels(log, x, parameters, model, error, |row, now| {
            for (place, segment) in segments.iter().enumerate() {
                if segment.rows.get(next[place]) != Some(&row) {
                    continue;
                }
                let mut value = now[sources[place]];
                if segment.channel == Channel::VoltageV && !ocv.is_empty() {
                    for (knot, weight) in weights(&self.knots, now[Channel::Soc]) {
                        value += weight * (ocv[knot] * cells);
                    }
                }
                let (offset, gain) = shown[place];
                let block = segment.block_of[next[place]];
                at(segment.begin + block, value * (1.0 + gain) + offset, now[Channel::Soc], segment.counts[block].recip());
                next[place] += 1;
            }
        });
    }

    /// Derivatives of one row by what is added to the model's prediction.
    #[expect(clippy::too_many_arguments, reason = "one row in all its aspects")]
    fn additive(&self, row: usize, soc: f64, shown: f64, share: f64, x: &[f64], by: &[usize], columns: &mut DMatrix<f64>) {
        let place = self.evidence.segments.partition_point(|segment| segment.begin <= row) - 1;
        let channel = self.evidence.segments[place].channel;
        let about = if channel == Channel::VoltageV && !self.knots.is_empty() { weights(&self.knots, soc) } else { [(usize::MAX, 0.0); 4] };
        for (column, &unknown) in by.iter().enumerate() {
            columns[(row, column)] += share
                * match self.what(unknown) {
                    Some(Rough::Offset(own)) if own == channel => 1.0,
                    Some(Rough::Gain(own)) if own == channel => shown / (1.0 + self.error(x, Rough::Gain(own))),
                    Some(Rough::Ocv(knot)) => {
                        about.iter().filter(|(near, _)| *near == knot).map(|(_, weight)| weight).sum::<f64>() * self.cells()
                    }
                    _ => 0.0,
                };
        }
    }

    /// Shows every target as it was a little later or, for a negative lag, earlier: on the line
    /// between judged rows.
    fn delay(&self, x: &[f64], all: &mut [f64]) {
        for segment in &self.evidence.segments {
            let lag_s = self.error(x, Rough::Lag(segment.channel));
            if lag_s != 0.0 {
                let own = &mut all[segment.range()];
                let prompt = own.to_vec();
                own.iter_mut().enumerate().for_each(|(row, value)| *value += lag_s * segment.slope(&prompt, row, lag_s));
            }
        }
    }

    /// Derivatives of what is shown late, from those of the `prompt` predictions.
    fn delay_columns(&self, x: &[f64], prompt: &[f64], by: &[usize], columns: &mut DMatrix<f64>) {
        for (column, &unknown) in by.iter().enumerate() {
            self.delay(x, columns.column_mut(column).as_mut_slice());
            let Some(Rough::Lag(channel)) = self.what(unknown) else { continue };
            for segment in self.evidence.segments.iter().filter(|segment| segment.channel == channel) {
                for row in 0..segment.counts.len() {
                    columns[(segment.begin + row, column)] = segment.slope(&prompt[segment.range()], row, x[unknown]);
                }
            }
        }
    }

    fn cells(&self) -> f64 {
        match &self.model.facts {
            Facts::Battery(facts) => f64::from(facts.series),
            _ => 1.0,
        }
    }
}

/// Deviations that a rough number may be off: what would need more is not rough knowledge, it is
/// an effect.
const ROUGH_MAX: f64 = 3.0;
/// Straight lines that stand for the curve between two knots.
const POINTS_BETWEEN: usize = 4;
/// Share of the capacity over which its derivative is taken.
const CAPACITY_STEP: f64 = 1e-4;
/// Step over which the derivative by a temperature is taken, K.
const TEMPERATURE_STEP_K: f64 = 1e-3;

#[cfg(test)]
mod tests;
