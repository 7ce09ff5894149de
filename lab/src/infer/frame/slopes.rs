//! What a frame predicts for every judged row, and how that changes with its unknowns.

use std::sync::Arc;

use energy::effect::Lane;
use energy::real::{Derived, HalfDual, LANES};
use energy::{Channel, Channels, Facts, Model};
use nalgebra::DMatrix;

use super::{Frame, Steps};
use crate::infer::course::Show;
use crate::infer::rough::{Rough, weights};
use crate::infer::state::observed;

/// Share of the capacity over which its derivative is taken.
const CAPACITY_STEP: f64 = 1e-4;
/// Step over which the derivative by the open-circuit voltage at a knot is taken, V.
const OCV_STEP_V: f64 = 1e-5;
/// Of so many knots one behind the other, each has a walk of its own.
const APART: usize = 8;
/// Step over which the derivative by a temperature is taken, K.
const TEMPERATURE_STEP_K: f64 = 1e-3;
/// Step over which the derivative by a clock is taken, s.
const CLOCK_STEP_S: f64 = 1e-2;

/// A share in a judged row.
struct Share<S> {
    /// Place of its segment.
    segment: usize,
    /// The judged row.
    row: usize,
    /// What is shown, times its weight in the row.
    shown: S,
    /// State of charge where a step ends or begins, and the weight in the row of what is shown there.
    nodes: [(f64, f64); 3],
}

/// Where a walk by some of the unknowns tells what it has found; what is added but once, in the first of them.
struct Told<'a, 'f> {
    all: &'a mut [f64],
    soc: &'a mut [f64],
    slopes: &'a mut DMatrix<f64>,
    added: Option<&'a mut Added<'f>>,
}

impl Frame {
    /// What the model predicts for every judged row.
    #[must_use]
    pub fn predict(&self, x: &[f64]) -> Vec<f64> {
        let (mut all, model) = (vec![0.0; self.evidence.rows()], self.model_at(x));
        (0..self.evidence.logs.len()).for_each(|log| self.predict_log(log, x, &model, &mut all));
        self.delay(x, &mut all);
        all
    }

    /// What is measured beyond what the model predicts, by judged row; only the rows of one log mean
    /// anything.
    pub(in crate::infer) fn residual_of(&self, log: usize, x: &[f64]) -> Vec<f64> {
        let mut all = vec![0.0; self.evidence.rows()];
        self.predict_log(log, x, &self.model_at(x), &mut all);
        self.delay(x, &mut all);
        observed(self).zip(&all).map(|(observed, predicted)| observed - predicted).collect()
    }

    /// Adds what is shown at once in one log.
    fn predict_log(&self, log: usize, x: &[f64], model: &Arc<Model>, all: &mut [f64]) {
        self.shares(log, x, self.values(x), model, |_, value| value, |share: &Share<f64>| all[share.row] += share.shown);
    }

    /// What the model predicts for every judged row, and its derivatives by some of the unknowns: one
    /// row of the matrix for each of them, one column for each judged row.
    #[must_use]
    pub fn linearise(&self, x: &[f64], by: &[usize]) -> (Vec<f64>, DMatrix<f64>) {
        let (mut all, soc, mut slopes) = self.linearise_prompt(x, by);
        self.table_differences(x, &all, &soc, by, &mut slopes);
        self.delay(x, &mut all);
        (all, slopes)
    }

    /// The same as if the model read its OCV table at the mean charge.
    #[must_use]
    pub(in crate::infer) fn linearise_nearly(&self, x: &[f64], by: &[usize]) -> (Vec<f64>, DMatrix<f64>) {
        let (mut all, _, slopes) = self.linearise_prompt(x, by);
        self.delay(x, &mut all);
        (all, slopes)
    }

    /// The same before what is shown is delayed, with the state of charge at every row.
    fn linearise_prompt(&self, x: &[f64], by: &[usize]) -> (Vec<f64>, Vec<f64>, DMatrix<f64>) {
        let mut all = vec![0.0; self.evidence.rows()];
        let mut soc = vec![0.0; all.len()];
        let mut slopes = DMatrix::zeros(by.len(), all.len());
        let model = self.model_at(x);
        let mut added = Added::new(self, x, by);
        for log in 0..self.evidence.logs.len() {
            let moved: Vec<(usize, usize)> =
                by.iter().copied().enumerate().filter(|&(_, unknown)| self.moves_model(unknown, log)).collect();
            if moved.is_empty() {
                self.shares(
                    log,
                    x,
                    self.values(x),
                    &model,
                    |_, value| value,
                    |share: &Share<f64>| {
                        all[share.row] += share.shown;
                        soc[share.row] = share.nodes[0].0;
                        added.add(share.segment, share.shown, share.nodes, slopes.column_mut(share.row).as_mut_slice());
                    },
                );
            }
            for (pass, lanes) in moved.chunks(LANES).enumerate() {
                let told = Told { all: &mut all, soc: &mut soc, slopes: &mut slopes, added: (pass == 0).then_some(&mut added) };
                let told_by = if lanes.len() <= HalfDual::LANES { Self::told_by::<2> } else { Self::told_by::<4> };
                told_by(self, (log, x), &model, lanes, told);
            }
        }
        self.delay_slopes(x, &all, by, &mut slopes);
        self.differences(x, &all, by, &mut slopes);
        (all, soc, slopes)
    }

    /// Derivatives that are taken by differences, one walk for each.
    fn differences(&self, x: &[f64], prompt: &[f64], by: &[usize], slopes: &mut DMatrix<f64>) {
        let mut shown = prompt.to_vec();
        self.delay(x, &mut shown);
        for (place, &unknown) in by.iter().enumerate() {
            let (step, logs) = match self.what(unknown) {
                Some(Rough::Capacity) => (CAPACITY_STEP, 0..self.evidence.logs.len()),
                Some(Rough::TemperatureInitial(log)) => (TEMPERATURE_STEP_K, log..log + 1),
                Some(Rough::Ambient(log)) => (TEMPERATURE_STEP_K, log..log + 1),
                Some(Rough::Clock(log)) => (CLOCK_STEP_S, log..log + 1),
                _ => continue,
            };
            let mut beside = x.to_vec();
            beside[unknown] += step;
            let (mut moved, model) = (prompt.to_vec(), self.model_at(&beside));
            for log in logs {
                let own = self.evidence.segments.iter().filter(|segment| segment.log == log);
                own.for_each(|segment| moved[segment.range()].fill(0.0));
                self.predict_log(log, &beside, &model, &mut moved);
            }
            self.delay(&beside, &mut moved);
            for (row, (after, before)) in moved.iter().zip(&shown).enumerate() {
                slopes[(place, row)] = (after - before) / step;
            }
        }
    }

    /// Derivatives by the errors of a table that the model reads elsewhere than at the mean charge. What a
    /// row shows is linear in them, and only knots near its charge count: those far from one another
    /// share a walk, and a row's change is put down to the nearest.
    fn table_differences(&self, x: &[f64], prompt: &[f64], soc: &[f64], by: &[usize], slopes: &mut DMatrix<f64>) {
        if !self.reads_curve {
            return;
        }
        let places: Vec<(usize, usize)> = by
            .iter()
            .enumerate()
            .filter_map(|(place, &unknown)| match self.what(unknown) {
                Some(Rough::Ocv(knot)) => Some((place, knot)),
                _ => None,
            })
            .collect();
        let mut shown = prompt.to_vec();
        self.delay(x, &mut shown);
        for first in 0..APART.min(places.len()) {
            let group: Vec<(usize, usize)> = places.iter().copied().skip(first).step_by(APART).collect();
            let mut beside = x.to_vec();
            group.iter().for_each(|&(place, _)| beside[by[place]] += OCV_STEP_V);
            let moved = self.predict(&beside);
            group.iter().for_each(|&(place, _)| slopes.row_mut(place).fill(0.0));
            for (row, (after, before)) in moved.iter().zip(&shown).enumerate() {
                let far = |&&(_, knot): &&(usize, usize)| (self.knots[knot] - soc[row]).abs();
                let nearest = group.iter().min_by(|a, b| far(a).total_cmp(&far(b)));
                if let Some(&(place, _)) = nearest {
                    slopes[(place, row)] = (after - before) / OCV_STEP_V;
                }
            }
        }
    }

    /// Walks a log by some of the unknowns, no more than a number has lanes: each with its place in the matrix.
    fn told_by<const PAIRS: usize>(&self, (log, x): (usize, &[f64]), model: &Arc<Model>, lanes: &[(usize, usize)], told: Told<'_, '_>)
    where
        Derived<PAIRS>: Lane,
    {
        let Told { all, soc, slopes, mut added } = told;
        let derived = |unknown: Option<usize>, value: f64| {
            let lane = unknown.and_then(|unknown| lanes.iter().position(|&(_, known)| known == unknown));
            lane.map_or_else(|| Derived::from(value), |lane| Derived::<PAIRS>::variable(value, lane))
        };
        let parameters = self.values(x).into_iter().enumerate();
        let parameters = parameters.map(|(index, value)| derived(self.unknown_of_parameter(index), value)).collect();
        let error = |what, value| derived(self.unknown_of(what), value);
        self.shares(log, x, parameters, model, error, |share: &Share<Derived<PAIRS>>| {
            let mut of_row = slopes.column_mut(share.row);
            let of_row = of_row.as_mut_slice();
            for (&(place, _), by_lane) in lanes.iter().zip(share.shown.lanes()) {
                of_row[place] += by_lane;
            }
            if let Some(added) = &mut added {
                all[share.row] += share.shown.re;
                soc[share.row] = share.nodes[0].0;
                added.add(share.segment, share.shown.re, share.nodes, of_row);
            }
        });
    }

    /// Walks a log and shows the share of every step in the judged rows.
    fn shares<S: Lane>(
        &self,
        log: usize,
        x: &[f64],
        parameters: Vec<S>,
        model: &Arc<Model>,
        error: impl Fn(Rough, f64) -> S,
        mut at: impl FnMut(&Share<S>),
    ) {
        let cells = self.cells();
        let source = |channel| {
            let unpredicted = channel == Channel::TemperatureDegc && !model.predicts_temperature();
            if unpredicted { Channel::AmbientDegc } else { channel }
        };
        let own: Vec<Seen> = self
            .evidence
            .segments
            .iter()
            .enumerate()
            .filter(|(_, segment)| segment.log == log)
            .map(|(place, segment)| Seen {
                place,
                source: source(segment.channel),
                offset: self.error(x, Rough::Offset(segment.channel)),
                gain: self.error(x, Rough::Gain(segment.channel)),
            })
            .collect();
        // What each segment shows at the end of a step, at its beginning and that of the step before, with the state of charge then.
        let mut shown = vec![[(S::from(0.0), 0.0); 3]; own.len()];
        let (course, segments) = (self.course(log), &self.evidence.segments);
        self.walk_log(log, Steps::Course, x, parameters, model, error, |step, now: &Channels<S>| {
            let soc = now[Channel::Soc];
            for (shown, seen) in shown.iter_mut().zip(&own) {
                *shown = [(now[seen.source] * (1.0 + seen.gain) + seen.offset, soc.re()), shown[0], shown[1]];
            }
            for share in course.shows(step) {
                let index = own.iter().position(|seen| seen.place == share.segment).unwrap_or(0);
                let nodes = &shown[index];
                let soc_at = nodes.map(|(_, soc)| soc);
                // What has no weight may not be a number yet.
                let weighted = nodes.iter().zip(share.weights).filter(|(_, weight)| *weight != 0.0);
                let mut sum = weighted.fold(S::from(0.0), |sum, ((shown, _), weight)| sum + *shown * weight);
                if share.weights[1] > 0.0 && segments[share.segment].channel == Channel::VoltageV {
                    let (volts, slope) = bend(model, share, soc_at);
                    sum += soc.chain(volts * cells, slope * cells);
                }
                let nodes = std::array::from_fn(|node| (soc_at[node], share.weights[node]));
                at(&Share { segment: share.segment, row: share.row, shown: sum, nodes });
            }
        });
    }

    /// Shows every target as it was a little earlier or, where its sensor is ahead of the log's clock, later: on the line
    /// between judged rows.
    fn delay(&self, x: &[f64], all: &mut [f64]) {
        for segment in &self.evidence.segments {
            let late_s = self.error(x, Rough::Lag(segment.channel));
            if late_s != 0.0 {
                let own = &mut all[segment.range()];
                let prompt = own.to_vec();
                for (row, value) in own.iter_mut().enumerate() {
                    let between = segment.shown_late(row, late_s);
                    *value = prompt[between.low] + between.share * (prompt[between.high] - prompt[between.low]);
                }
            }
        }
    }

    /// Derivatives of what is shown late, from those of the `prompt` predictions.
    fn delay_slopes(&self, x: &[f64], prompt: &[f64], by: &[usize], slopes: &mut DMatrix<f64>) {
        for segment in &self.evidence.segments {
            let late_s = self.error(x, Rough::Lag(segment.channel));
            if late_s != 0.0 {
                let own = slopes.columns(segment.begin, segment.counts.len()).into_owned();
                for row in 0..segment.counts.len() {
                    let between = segment.shown_late(row, late_s);
                    let shown = own.column(between.low) * (1.0 - between.share) + own.column(between.high) * between.share;
                    slopes.set_column(segment.begin + row, &shown);
                }
            }
            let lags = by.iter().enumerate().filter(|&(_, &unknown)| self.what(unknown) == Some(Rough::Lag(segment.channel)));
            for (place, &unknown) in lags {
                for row in 0..segment.counts.len() {
                    slopes[(place, segment.begin + row)] = segment.slope(&prompt[segment.range()], row, x[unknown]);
                }
            }
        }
    }
}

/// How far the mean of the open-circuit voltages of the rows of a step or two lies from what their ends say of it, V per
/// cell, and how that changes with the state of charge of all of them. `soc` is that at the end, where the step begins, and where
/// the one before does.
fn bend(model: &Model, show: &Show, soc: [f64; 3]) -> (f64, f64) {
    let Facts::Battery(facts) = &model.facts else { return (0.0, 0.0) };
    let at = |soc: f64| facts.ocv.line_v(soc);
    let [rows, before] = show.rows;
    let (first, last) = (at(if before > 0 { soc[2] } else { soc[1] }), at(soc[0]));
    if first.1.to_bits() == last.1.to_bits() {
        // One and the same line of the table.
        return (0.0, 0.0);
    }
    let (mut volts, mut slope) = (0.0, 0.0);
    let mut add = |weight: f64, (here, steep): (f64, f64)| {
        volts += weight * here;
        slope += weight * steep;
    };
    for (rows, begin, end) in [(before, soc[2], soc[1]), (rows, soc[1], soc[0])] {
        add(show.each, facts.ocv.sums_v(begin, end, rows));
    }
    soc.into_iter().zip(show.weights).filter(|(_, weight)| *weight != 0.0).for_each(|(soc, weight)| add(-weight, at(soc)));
    (volts, slope)
}

/// How a segment's channel is shown.
struct Seen {
    place: usize,
    source: Channel,
    offset: f64,
    gain: f64,
}

/// Unknowns that are added to what the model predicts: the places of their derivatives.
struct Added<'a> {
    frame: &'a Frame,
    /// By segment: place of the offset; place and value of the gain.
    offsets: Vec<Option<usize>>,
    gains: Vec<Option<(usize, f64)>>,
    /// By knot of the OCV table.
    knots: Vec<Option<usize>>,
    /// The last states of charge and the knots about them: where one step ends the next begins.
    last: [(f64, About); 3],
    /// Which of them is the oldest.
    oldest: usize,
}

/// Knots about a state of charge, and their weights.
type About = [(usize, f64); 4];

impl<'a> Added<'a> {
    fn new(frame: &'a Frame, x: &[f64], by: &[usize]) -> Added<'a> {
        let place = |what| by.iter().position(|&unknown| frame.what(unknown) == Some(what));
        let segments = || frame.evidence.segments.iter();
        Added {
            offsets: segments().map(|segment| place(Rough::Offset(segment.channel))).collect(),
            gains: segments()
                .map(|segment| Some((place(Rough::Gain(segment.channel))?, frame.error(x, Rough::Gain(segment.channel)))))
                .collect(),
            knots: (0..frame.knots.len()).map(|knot| place(Rough::Ocv(knot))).collect(),
            last: [(f64::NAN, [(0, 0.0); 4]); 3],
            oldest: 0,
            frame,
        }
    }

    /// Adds the derivatives of one share to those of its row.
    fn add(&mut self, segment: usize, shown: f64, nodes: [(f64, f64); 3], of_row: &mut [f64]) {
        if let Some(place) = self.offsets[segment] {
            of_row[place] += nodes.iter().map(|(_, weight)| weight).sum::<f64>();
        }
        if let Some((place, gain)) = self.gains[segment] {
            of_row[place] += shown / (1.0 + gain);
        }
        if self.frame.evidence.segments[segment].channel == Channel::VoltageV && !self.knots.is_empty() {
            let cells = self.frame.cells();
            for (soc, weight) in nodes.into_iter().filter(|(_, weight)| *weight != 0.0) {
                for (knot, share) in self.about(soc) {
                    if let Some(place) = self.knots[knot] {
                        of_row[place] += weight * cells * share;
                    }
                }
            }
        }
    }

    fn about(&mut self, soc: f64) -> About {
        if let Some((_, about)) = self.last.iter().find(|(known, _)| *known == soc) {
            return *about;
        }
        let about = weights(&self.frame.knots, soc);
        self.last[self.oldest] = (soc, about);
        self.oldest = (self.oldest + 1) % self.last.len();
        about
    }
}
