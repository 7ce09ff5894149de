//! Model, logs and rough knowledge as one vector of unknowns.
//!
//! Unknowns `x`: first the model's free parameters in its own order, then what is only roughly
//! known (see [`super::rough`]). Rows: the used rows of every target of every log, one behind the
//! other.

use std::sync::Arc;

use energy::{Channel, Channels, Facts, Model, Start};

use super::course::Course;
use super::evidence::Evidence;
use super::rough::{Known, Rough, knots, rough, straight, weights};
use super::walk::{Unread, drives, walk};
use crate::measurement::Unmeasured;
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
    /// Parameters that have the value of another, and that one.
    followers: Vec<(usize, usize)>,
    /// What is only roughly known.
    pub known: Vec<Known>,
    /// Where the error of an OCV table may bend.
    knots: Vec<f64>,
    /// States of charge between which that error is taken for a straight line, with the weight of every
    /// knot that counts there.
    between: Vec<(f64, [(usize, f64); 4])>,
    /// Whether the model reads its OCV table elsewhere than at the mean charge: then it bends where the
    /// mean does not say, and only steps of a row each follow it.
    reads_curve: bool,
    /// Whether it has formulas of the time, which may switch while all inputs hold: only steps of a row each follow these, too.
    tells_time: bool,
}

impl Frame {
    /// The model on these logs.
    #[must_use]
    pub fn new(model: Arc<Model>, evidence: Arc<Evidence>) -> Frame {
        let free = (0..model.parameters().len()).filter(|&index| model.parameters()[index].free).collect();
        let parameters = model.parameters().iter().enumerate();
        let place_of = |own: (&str, &str)| model.parameters().iter().position(|one| (one.effect, one.name) == own);
        let followers = parameters.filter_map(|(index, one)| Some((index, place_of(one.follows?)?))).collect();
        let known = rough(&model, &evidence.logs);
        let knots = match &model.facts {
            Facts::Battery(facts) => knots(facts.ocv.points().0),
            _ => Vec::new(),
        };
        let parts = knots.windows(2).flat_map(|pair| {
            let width = pair[1] - pair[0];
            let count = (width / PART).ceil() as u32;
            (0..count).map(move |part| pair[0] + width * f64::from(part) / f64::from(count))
        });
        let between = parts.chain(knots.last().copied()).map(|soc| (soc, weights(&knots, soc))).collect();
        let reads_curve = model.effects().any(|effect| effect.reads_curve());
        let tells_time = model.effects().any(|effect| effect.spec().tells_time());
        Frame { model, evidence, free, followers, known, knots, between, reads_curve, tells_time }
    }

    /// The same model on coarser evidence of the same logs; the same where there is none, or where that would not show what the model does.
    #[must_use]
    pub(super) fn coarse(&self) -> Frame {
        let coarse = self.evidence.coarse.as_ref().filter(|_| !self.tells_time).unwrap_or(&self.evidence);
        Frame::new(Arc::clone(&self.model), Arc::clone(coarse))
    }

    /// The same model on the same logs row by row.
    #[must_use]
    pub(super) fn by_rows(&self) -> Frame {
        Frame::new(Arc::clone(&self.model), Arc::clone(self.evidence.whole.as_ref().unwrap_or(&self.evidence)))
    }

    /// Whether the model reads its OCV table elsewhere than at the mean charge.
    pub(super) fn reads_curve(&self) -> bool {
        self.reads_curve
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
        for &(index, first) in &self.followers {
            values[index] = values[first];
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
        let error = |weights: &[(usize, f64)]| weights.iter().map(|&(knot, weight)| errors[knot] * weight).sum();
        self.between.iter().map(|(soc, weights)| (*soc, error(weights))).collect()
    }

    /// Error of the OCV table at every knot, V per cell; empty when the table is exact.
    fn knot_errors(&self, x: &[f64]) -> Vec<f64> {
        let table_is_rough = self.known.iter().any(|known| matches!(known.what, Rough::Ocv(_)));
        let count = if table_is_rough { self.knots.len() } else { 0 };
        (0..count).map(|knot| self.error(x, Rough::Ocv(knot))).collect()
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
                self.walk_log(
                    log,
                    Steps::Rows,
                    x,
                    values,
                    &model,
                    |_, value| value,
                    |row, now: &Channels<f64>| {
                        if row > 0 {
                            seen.push(now[channel]);
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

    fn what(&self, unknown: usize) -> Option<Rough> {
        unknown.checked_sub(self.free.len()).map(|place| self.known[place].what)
    }

    fn unknown_of(&self, what: Rough) -> Option<usize> {
        self.known.iter().position(|known| known.what == what).map(|place| self.free.len() + place)
    }

    fn unknown_of_parameter(&self, index: usize) -> Option<usize> {
        let index = self.followers.iter().find(|(follower, _)| *follower == index).map_or(index, |(_, first)| *first);
        self.free.iter().position(|&free| free == index)
    }

    /// Whether the walk of this log must carry derivatives by the unknown.
    fn moves_model(&self, unknown: usize, log: usize) -> bool {
        match self.what(unknown) {
            None => true,
            Some(Rough::Offset(channel) | Rough::Gain(channel)) => self.drives_model(channel, log),
            Some(Rough::SocInitial(own) | Rough::Unmeasured { log: own, .. }) => own == log,
            // Of the model, but dear in every lane: taken by differences.
            Some(Rough::Capacity | Rough::TemperatureInitial(_) | Rough::Ambient(_) | Rough::Clock(_)) => false,
            Some(Rough::Lag(_) | Rough::Ocv(_)) => false,
        }
    }

    /// Whether the channel is an input of the model in that log.
    fn drives_model(&self, channel: Channel, log: usize) -> bool {
        let input = self.evidence.logs[log].inputs.iter().any(|(input, _)| *input == channel);
        input && !predicted_channels(&self.model).contains(&channel)
    }

    /// The model with the capacity and the OCV table of these unknowns. Effects that read the table
    /// elsewhere than at the mean charge read the same one.
    fn model_at(&self, x: &[f64]) -> Arc<Model> {
        let (share, errors) = (self.error(x, Rough::Capacity), self.ocv_error(x));
        let table_errs = errors.iter().any(|&(_, error)| error != 0.0);
        if share == 0.0 && !table_errs {
            return Arc::clone(&self.model);
        }
        let mut model = Model::clone(&self.model);
        if let Facts::Battery(facts) = &mut model.facts {
            facts.capacity_ah *= 1.0 + share;
            if table_errs {
                let soc: Vec<f64> = errors.iter().map(|&(soc, _)| soc).collect();
                facts.ocv = facts.ocv.moved(&soc, |soc| straight(&errors, soc));
            }
        }
        Arc::new(model)
    }

    /// Walks a log and shows its channels after every step; `error` lifts the error of a rough number.
    #[expect(clippy::too_many_arguments, reason = "one walk in all its aspects")]
    fn walk_log<S: energy::effect::Lane>(
        &self,
        log: usize,
        steps: Steps,
        x: &[f64],
        parameters: Vec<S>,
        model: &Arc<Model>,
        error: impl Fn(Rough, f64) -> S,
        at: impl FnMut(usize, &Channels<S>),
    ) {
        let lifted = |what| -> Option<S> {
            let unknown = self.unknown_of(what)?;
            Some(error(what, x[unknown]))
        };
        let zero = S::from(0.0);
        let around_k = self.error(x, Rough::Ambient(log));
        let shift = |channel| match (lifted(Rough::Offset(channel)), lifted(Rough::Gain(channel))) {
            (None, None) if channel == Channel::AmbientDegc && around_k != 0.0 => Some((S::from(-around_k), zero)),
            (None, None) => None,
            (offset, gain) => Some((offset.unwrap_or(zero), gain.unwrap_or(zero))),
        };
        let (prepared, course) = (&self.evidence.logs[log], self.course(log));
        let mut start: Start<S> = prepared.start.lifted();
        start.soc += lifted(Rough::SocInitial(log)).unwrap_or(zero);
        start.temperature_degc += self.error(x, Rough::TemperatureInitial(log));
        start.clock_s += self.error(x, Rough::Clock(log));
        let (time_s, inputs) = match steps {
            Steps::Rows => (&prepared.time_s, &prepared.inputs),
            Steps::Course => (&course.time_s, &course.inputs),
        };
        let of_piece = |(piece, of): (usize, &Unmeasured)| {
            Some(Unread { from_s: of.from_s, to_s: of.to_s, beyond_a: lifted(Rough::Unmeasured { log, piece })? })
        };
        let unread: Vec<Unread<S>> = prepared.unmeasured.iter().enumerate().filter_map(of_piece).collect();
        walk(model, parameters, start, time_s, &drives(model, inputs, shift), &unread, at);
    }

    /// How the model walks a log to show what is judged.
    fn course(&self, log: usize) -> &Course {
        let by_rows = (self.reads_curve || self.tells_time) && !self.evidence.fine.is_empty();
        let courses = if by_rows { &self.evidence.fine } else { &self.evidence.courses };
        &courses[log]
    }

    fn cells(&self) -> f64 {
        match &self.model.facts {
            Facts::Battery(facts) => f64::from(facts.series),
            _ => 1.0,
        }
    }
}

/// The steps of a walk.
#[derive(Debug, Clone, Copy)]
enum Steps {
    /// One for each row of the log.
    Rows,
    /// As few as show what is judged.
    Course,
}

/// Deviations that a rough number may be off: what would need more is not rough knowledge, it is
/// an effect.
const ROUGH_MAX: f64 = 3.0;
/// Length of the straight lines that stand for the curve between two knots: a quarter of their usual
/// distance.
const PART: f64 = 0.0125;

mod slopes;
#[cfg(test)]
mod tests;
