//! Model, logs and rough knowledge as one vector of unknowns.
//!
//! Unknowns `x`: first the model's free parameters in its own order, then what is only roughly
//! known (see [`super::rough`]). Rows: the used rows of every target of every log, one behind the
//! other.

use std::sync::Arc;

use energy::real::{Dual, LANES, derivative, variable};
use energy::{Channel, Channels, Facts, Model, Start, System};
use nalgebra::DMatrix;

use super::rough::{Known, Rough, knots, rough, weights};
use super::walk::{drives, walk};
use crate::prepare::{Prepared, predicted_channels};

/// The judged rows of one target of one log.
#[derive(Debug, Clone)]
pub struct Segment {
    /// Index of the log.
    pub log: usize,
    /// The target.
    pub channel: Channel,
    /// Rows of the log that count.
    pub rows: Vec<usize>,
    /// Among the judged rows, counted from `begin`, the one that each of them goes into.
    block_of: Vec<usize>,
    /// How many of them each judged row is the mean of.
    pub counts: Vec<f64>,
    /// Time of each judged row, s.
    pub time_s: Vec<f64>,
    /// What was measured.
    pub observed: Vec<f64>,
    /// Where its judged rows begin among all.
    pub begin: usize,
}

impl Segment {
    /// Slope of a value per judged row towards the next row (`side` > 0), the one before (< 0) or
    /// between both, per s; 0 across means and gaps, whose times say too little.
    fn slope(&self, values: &[f64], row: usize, side: f64) -> f64 {
        let towards = |other: usize| {
            let whole = other < values.len() && self.counts[row] == 1.0 && self.counts[other] == 1.0;
            whole.then(|| (values[other] - values[row]) / (self.time_s[other] - self.time_s[row]))
        };
        match (towards(row + 1), row.checked_sub(1).and_then(towards)) {
            (Some(next), _) if side > 0.0 => next,
            (_, Some(before)) if side < 0.0 => before,
            (Some(next), Some(before)) if side == 0.0 => (next + before) / 2.0,
            _ => 0.0,
        }
    }

    /// Where its judged rows stand among all.
    #[must_use]
    pub fn range(&self) -> std::ops::Range<usize> {
        self.begin..self.begin + self.counts.len()
    }
}

/// The logs, and what of them is judged.
#[derive(Debug)]
pub struct Evidence {
    /// The logs.
    pub logs: Arc<Vec<Prepared>>,
    /// What is judged.
    pub segments: Vec<Segment>,
    /// White noise of one row by channel: the known floor or, where a model states none, the noise
    /// that the measurements themselves show from row to row.
    pub floors: Vec<(Channel, f64)>,
    /// The same evidence row by row, where `segments` hold means of rows.
    pub whole: Option<Arc<Evidence>>,
}

/// Rows that a mean takes at most.
const BLOCK_MAX: usize = 12;
/// Change of an input, as a share of its range, after which means begin small again.
const JUMP: f64 = 0.02;

impl Evidence {
    /// Of these logs, prepared for this model, row by row. A battery model that does not say how
    /// its temperature moves is held to say that it is that of the surroundings, where both were
    /// measured.
    #[must_use]
    pub fn row_by_row(model: &Model, logs: Vec<Prepared>) -> Evidence {
        let mut segments = Vec::new();
        for (index, log) in logs.iter().enumerate() {
            let asked = model.system == System::Battery && !model.predicts_temperature();
            let unpredicted = if asked { both_temperatures(log) } else { None };
            let known = log.targets.iter().map(|target| (target.channel, target.observed.as_slice(), target.used.as_slice()));
            let all = vec![true; log.time_s.len()];
            for (channel, observed, used) in known.chain(unpredicted.map(|values| (Channel::TemperatureDegc, values, all.as_slice()))) {
                let rows: Vec<usize> = (1..log.time_s.len()).filter(|&row| used[row]).collect();
                let time_s: Vec<f64> = rows.iter().map(|&row| log.time_s[row]).collect();
                let observed = rows.iter().map(|&row| observed[row]).collect();
                let count = rows.len();
                segments.push(Segment {
                    log: index,
                    channel,
                    block_of: (0..count).collect(),
                    counts: vec![1.0; count],
                    rows,
                    time_s,
                    observed,
                    begin: 0,
                });
            }
        }
        place(&mut segments);
        let mut floors: Vec<(Channel, f64)> = Vec::new();
        for segment in &segments {
            if !floors.iter().any(|(channel, _)| *channel == segment.channel) {
                let of_channel = segments.iter().filter(|other| other.channel == segment.channel);
                let known = model.sensor(segment.channel).floor();
                let white = if known > 0.0 { known } else { roughness(of_channel.map(|segment| segment.observed.as_slice())) };
                floors.push((segment.channel, white));
            }
        }
        Evidence { logs: Arc::new(logs), segments, floors, whole: None }
    }

    /// Of these logs, prepared for this model, in means of rows: of few after a jump of an input,
    /// when much happens, and of up to [`BLOCK_MAX`] later. A mean of measurements is compared with
    /// the mean of predictions, so that nothing is approximated; what a row says alone is lost.
    #[must_use]
    pub fn new(model: &Model, logs: Vec<Prepared>) -> Evidence {
        let whole = Evidence::row_by_row(model, logs);
        let jumps: Vec<Vec<bool>> = whole.logs.iter().map(jumps).collect();
        let mut segments: Vec<Segment> = whole.segments.iter().map(|segment| in_means(segment, &jumps[segment.log])).collect();
        place(&mut segments);
        Evidence { logs: Arc::clone(&whole.logs), segments, floors: whole.floors.clone(), whole: Some(Arc::new(whole)) }
    }

    /// Judged rows.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.segments.last().map_or(0, |segment| segment.range().end)
    }

    /// White noise of a channel, in its unit.
    #[must_use]
    pub fn floor(&self, channel: Channel) -> f64 {
        self.floors.iter().find(|(known, _)| *known == channel).map_or(1.0, |(_, floor)| *floor)
    }
}

fn place(segments: &mut [Segment]) {
    let mut begin = 0;
    for segment in segments {
        segment.begin = begin;
        begin += segment.counts.len();
    }
}

/// Rows at which an input jumps.
fn jumps(log: &Prepared) -> Vec<bool> {
    let mut jumps = vec![false; log.time_s.len()];
    for (_, values) in &log.inputs {
        let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
        for row in 1..values.len() {
            jumps[row] |= (values[row] - values[row - 1]).abs() > JUMP * (high - low);
        }
    }
    jumps
}

fn in_means(segment: &Segment, jumps: &[bool]) -> Segment {
    let (mut block_of, mut counts, mut time_s, mut observed) = (Vec::new(), Vec::<f64>::new(), Vec::<f64>::new(), Vec::<f64>::new());
    let (mut since, mut room) = (0, 0);
    for (place, &row) in segment.rows.iter().enumerate() {
        let apart = place == 0 || segment.rows[place - 1] + 1 != row;
        // The last row before a jump stands alone as well: a late reading shows what comes.
        let ends = jumps.get(row + 1) == Some(&true);
        since = if jumps[row] || apart { 0 } else { since + 1 };
        if room == 0 || since == 0 || ends {
            // One by one at first, then a quarter of the rows since the jump.
            room = if ends { 1 } else { (since / 4).clamp(1, BLOCK_MAX) };
            counts.push(0.0);
            time_s.push(0.0);
            observed.push(0.0);
        }
        let block = counts.len() - 1;
        block_of.push(block);
        room -= 1;
        counts[block] += 1.0;
        time_s[block] += (segment.time_s[place] - time_s[block]) / counts[block];
        observed[block] += (segment.observed[place] - observed[block]) / counts[block];
    }
    Segment { block_of, counts, time_s, observed, ..segment.clone() }
}

fn both_temperatures(log: &Prepared) -> Option<&[f64]> {
    let input = |wanted| log.inputs.iter().find(|(channel, _)| *channel == wanted).map(|(_, values)| values.as_slice());
    input(Channel::AmbientDegc).and(input(Channel::TemperatureDegc))
}

/// Noise of measurements as their changes from row to row show it (von Neumann's estimate, taken
/// by the median so that steps do not count), in the channel's unit.
fn roughness<'a>(observed: impl Iterator<Item = &'a [f64]>) -> f64 {
    let mut bends: Vec<f64> = Vec::new();
    let mut scale = 0.0_f64;
    for values in observed {
        bends.extend(values.windows(3).map(|v| (v[0] - 2.0 * v[1] + v[2]).abs()));
        scale = values.iter().fold(scale, |scale, value| scale.max(value.abs()));
    }
    bends.sort_by(f64::total_cmp);
    let median = bends.get(bends.len() / 2).copied().unwrap_or(0.0);
    // The median of |N(0, 6 s^2)| is 0.6745 sqrt(6) s.
    (median / (0.6745 * 6f64.sqrt())).max(1e-6 * scale).max(f64::MIN_POSITIVE)
}

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
        let between = self.knots.windows(2).flat_map(|pair| {
            (0..POINTS_BETWEEN).map(move |point| pair[0] + (pair[1] - pair[0]) * point as f64 / POINTS_BETWEEN as f64)
        });
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
