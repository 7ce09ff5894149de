//! What comes and goes at times that no formula says: how large, how often, how long.
//!
//! A contact that jumps, a wheel that drags now and then, a charger that falters: the residual is a size times
//! something measured (or a size alone) while it is there, and nothing while it is not. When it is there is asked of
//! every log, a held-out one too, by the way through two states of least cost (Viterbi, IEEE Trans. Inf. Theory 13,
//! 1967, p. 260), on which every change is dear. The size follows from where it is there, together with what the base
//! model can absorb, and where it is there from the size, in turn.

use std::sync::Arc;

use energy::Channel;
use nalgebra::{DMatrix, DVector};

use super::cheapest::cheapest;
use crate::infer::evidence::Evidence;
use crate::infer::frame::Frame;
use crate::infer::lens::{Absorber, Lens};
use crate::infer::state::{State, all, filters, observed};
use crate::prepare::Prepared;

/// Something that comes and goes.
#[derive(Debug, Clone, PartialEq)]
pub struct Switching {
    /// The channel that it adds to.
    pub channel: Channel,
    /// Whether it is no thing but single readings, each off by another amount; `size` is their mean then, and `sigma` how far they scatter.
    pub readings: bool,
    /// What it is a multiple of; none for a constant.
    pub times: Option<Channel>,
    /// Its size, in the channel's unit for each unit of what it is a multiple of.
    pub size: f64,
    /// Standard deviation of that.
    pub sigma: f64,
    /// Share of the training logs' rows in which it is there.
    pub share: f64,
    /// How often it comes, on all training logs.
    pub visits: usize,
    /// How long it stays on average, s.
    pub stays_s: f64,
    /// RMS on the training logs with the base model, and with it.
    pub training: (f64, f64),
    /// The same on the held-out logs, each asked when it was there.
    pub holdout: (f64, f64),
}

/// Rounds in which size and times are asked for in turn.
const ROUNDS: usize = 30;
/// Times that derivatives are taken anew.
const REFITS: usize = 3;
/// Shares of the rows, from either end of what one unit leaves, at which sizes begin.
const BEGINS: [f64; 4] = [0.01, 0.05, 0.15, 0.3];
/// Share of what is measured, of its largest size, below which a row says nothing of a first size.
const SAYS: f64 = 0.2;
/// Share by which it must lower the held-out error: half of the squares.
const FALL: f64 = 0.3;

/// What comes and goes, if that explains most of what the base leaves of its system's first target, on the held-out logs too.
#[must_use]
pub(super) fn comes_and_goes(base: &State, holdout: &Arc<Evidence>) -> Option<Switching> {
    let whole = |evidence: &Arc<Evidence>| Arc::clone(evidence.whole.as_ref().unwrap_or(evidence));
    let channel = base.frame.model.system.targets()[0];
    let frame = Frame::new(Arc::clone(&base.frame.model), whole(&base.frame.evidence));
    let train = Rows::new(&frame, base.x.clone(), all(&frame), channel);
    let least = train.cost(&train.without(), 0) - PER_TERM * (train.judged.len() as f64).ln();
    let multiples = std::iter::once(None).chain(train.moving(&frame).into_iter().map(Some));
    let found = multiples.filter_map(|times| train.best(&frame, times).map(|found| (times, found)));
    let found = found.filter(|(_, found)| found.cost < least).min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let off = train.readings_off();
    let readings = off.cost < found.as_ref().map_or(least, |(_, found)| found.cost);
    let (times, found) = if readings { (None, off) } else { found? };
    let before_training = train.rms(&train.without());
    let (beside, found) = if readings { train.settle_readings(&frame, found) } else { train.settle(&frame, times, found, None) };
    // A held-out log is asked for its own numbers only; all else is what the training logs say.
    let held = Frame::new(Arc::clone(&base.frame.model), whole(holdout));
    let own: Vec<usize> = (0..held.known.len()).filter(|&place| held.known[place].log().is_some()).map(|p| held.free.len() + p).collect();
    let judged = |x: &[f64]| {
        let mut start = held.as_in(&base.frame, x, None);
        own.iter().for_each(|&unknown| start[unknown] = 0.0);
        Rows::new(&held, start, own.clone(), channel)
    };
    let alone = judged(&base.x);
    let before = alone.rms(&alone.without());
    let asked = judged(&beside.moved(&frame, &found));
    let after = if readings {
        let off = asked.readings_off();
        let (asked, off) = asked.settle_readings(&held, off);
        asked.rms(&off.settled)
    } else {
        let there = asked.from(&held, times, found.size, Some(found.size));
        let (asked, there) = asked.settle(&held, times, there, Some(found.size));
        asked.rms(&there.settled)
    };
    if after > (1.0 - FALL) * before {
        return None;
    }
    // What is there most of the time is the rule: the exception is told.
    let is_rule = 2 * found.there.iter().filter(|there| **there).count() > found.there.len();
    let there: Vec<bool> = found.there.iter().map(|there| *there != is_rule).collect();
    let (visits, rows, stays_s) = beside.visits(&frame, &there);
    Some(Switching {
        channel,
        readings,
        times,
        size: if is_rule { -found.size } else { found.size },
        sigma: found.settled.sigma,
        share: rows as f64 / beside.judged.len().max(1) as f64,
        visits,
        stays_s,
        training: (before_training, beside.rms(&found.settled)),
        holdout: (before, after),
    })
}

/// Rows one behind the other that still are single readings, and share of all that must be such.
const TOGETHER: usize = 2;
const MOST: f64 = 0.8;

/// Cost of a change between the states, and of another term, in logarithms of the number of rows: each is a number that is asked for, and
/// it is the best of many.
const PER_CHANGE: f64 = 2.0;
const PER_TERM: f64 = 6.0;

/// The rows of one channel, one by one, and what a linear refit of some unknowns absorbs.
struct Rows {
    /// The unknowns, and which of them may move.
    x: Vec<f64>,
    by: Vec<usize>,
    channel: Channel,
    lens: Lens,
    base: Absorber,
    /// Rows of the channel among all, and the log and row of each.
    judged: Vec<(usize, usize, usize)>,
    /// White noise of one row.
    floor: f64,
}

/// What a linear refit leaves beside something that is there in some rows.
struct Settled {
    size: f64,
    sigma: f64,
    /// Of the unknowns.
    change: DVector<f64>,
    /// Of every row of the channel that counts, without what comes and goes, and with it, in floors.
    alone: Vec<f64>,
    left: Vec<f64>,
}

struct Found {
    settled: Settled,
    size: f64,
    there: Vec<bool>,
    cost: f64,
}

impl Rows {
    fn new(frame: &Frame, x: Vec<f64>, by: Vec<usize>, channel: Channel) -> Rows {
        let (predicted, slopes) = frame.linearise(&x, &by);
        let residual: Vec<f64> = observed(frame).zip(&predicted).map(|(observed, predicted)| observed - predicted).collect();
        let lens = Lens::new(frame, &x, &by, &slopes, &residual, filters(frame, &State::white(frame)));
        let bounds = frame.bounds();
        let held = (0..by.len()).filter(|&index| x[by[index]] <= bounds[by[index]].0 || x[by[index]] >= bounds[by[index]].1).collect();
        let own = frame.evidence.segments.iter().filter(|segment| segment.channel == channel);
        let judged = own.flat_map(|segment| segment.range().zip(&segment.rows).map(|(place, &row)| (place, segment.log, row))).collect();
        Rows { base: Absorber::new(&lens, held), lens, judged, floor: frame.evidence.floor(channel), x, by, channel }
    }

    /// Inputs that every log has and that move.
    fn moving(&self, frame: &Frame) -> Vec<Channel> {
        let has = |log: &Prepared, channel: Channel| log.inputs.iter().any(|(other, _)| *other == channel);
        let logs = &frame.evidence.logs;
        let everywhere = logs[0].inputs.iter().map(|(channel, _)| *channel).filter(|&channel| logs.iter().all(|log| has(log, channel)));
        let moves = |&channel: &Channel| {
            let values = self.measured(frame, Some(channel));
            let (low, high) = values.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &v| (low.min(v), high.max(v)));
            high - low > 0.1 * low.abs().max(high.abs())
        };
        everywhere.filter(moves).collect()
    }

    /// What a size is multiplied with, row by row.
    fn measured(&self, frame: &Frame, times: Option<Channel>) -> Vec<f64> {
        let value = |&(_, log, row): &(usize, usize, usize)| {
            let input = |wanted| frame.evidence.logs[log].inputs.iter().find(|(channel, _)| *channel == wanted);
            times.map_or(1.0, |wanted| input(wanted).map_or(0.0, |(_, values)| values[row]))
        };
        self.judged.iter().map(value).collect()
    }

    /// A linear refit beside a multiple of what is measured where it is there; of a size that is asked for, or given.
    fn settled(&self, measured: Option<&[f64]>, there: &[bool], size: Option<f64>) -> Settled {
        let mut column = DVector::zeros(self.lens.whitened.len());
        for ((&(place, ..), &there), index) in self.judged.iter().zip(there).zip(0..) {
            column[place] = if there { measured.map_or(1.0, |measured| measured[index]) / self.floor } else { 0.0 };
        }
        let cross: DMatrix<f64> = DMatrix::from_column_slice(self.lens.design.nrows(), 1, (&self.lens.design * &column).as_slice());
        let absorbed = self.base.absorbed(cross.clone());
        let unique = (column.norm_squared() - absorbed.norm_squared()).max(f64::MIN_POSITIVE);
        let size = size.unwrap_or_else(|| column.dot(&self.base.left) / unique);
        let change = &self.base.change - self.base.solve(cross.column(0) * size);
        let alone = &self.lens.whitened - self.lens.design.tr_mul(&change);
        let left = &alone - column * size;
        let own = |rows: &DVector<f64>| self.judged.iter().map(|&(place, ..)| rows[place]).collect();
        Settled { size, sigma: unique.sqrt().recip(), change, alone: own(&alone), left: own(&left) }
    }

    /// A linear refit alone.
    fn without(&self) -> Settled {
        self.settled(None, &vec![false; self.judged.len()], Some(0.0))
    }

    /// Single readings that are off, each by its own amount: what is left is left of all others.
    fn readings_off(&self) -> Found {
        // A reading takes all that is left of it; what that was follows once more from what the others say.
        let without = |mut settled: Settled, rows: &[bool]| {
            for _ in 0..REFITS {
                let amounts: Vec<f64> = settled.alone.iter().map(|alone| alone * self.floor).collect();
                settled = self.settled(Some(&amounts), rows, Some(1.0));
            }
            settled
        };
        let (mut settled, mut there) = (self.without(), Vec::new());
        for _ in 0..ROUNDS {
            let now: Vec<bool> = settled.alone.iter().map(|alone| alone.powi(2) > 2.0 * self.per_change()).collect();
            if now == there {
                break;
            }
            settled = without(settled, &now);
            there = now;
        }
        // Only in the end is it clear which stand alone: readings that are off bend all others at first.
        if !self.are_single(&there) {
            (settled, there) = (self.without(), vec![false; there.len()]);
        }
        let amounts: Vec<f64> =
            settled.alone.iter().zip(&there).filter(|(_, there)| **there).map(|(alone, _)| alone * self.floor).collect();
        let count = amounts.len().max(1) as f64;
        let size = amounts.iter().sum::<f64>() / count;
        settled.sigma = (amounts.iter().map(|amount| (amount - size).powi(2)).sum::<f64>() / count).sqrt();
        let cost = self.cost(&settled, 2 * amounts.len());
        settled.left = settled.left.iter().zip(&there).filter(|(_, there)| !**there).map(|(left, _)| *left).collect();
        Found { cost, settled, size, there }
    }

    /// Whether most of some rows stand alone, or two by two: what goes on for longer is no reading that is off.
    fn are_single(&self, rows: &[bool]) -> bool {
        let goes_on = |index: usize| rows[index] && rows[index - 1] && self.judged[index].1 == self.judged[index - 1].1;
        let (mut begin, mut single, mut all) = (0, 0, 0_usize);
        for index in 1..=rows.len() {
            if index == rows.len() || !goes_on(index) {
                let count = if rows[begin] { index - begin } else { 0 };
                all += count;
                single += if count <= TOGETHER { count } else { 0 };
                begin = index;
            }
        }
        single as f64 > MOST * all as f64
    }

    /// The best that comes and goes as a multiple of what is measured; none when nothing does.
    fn best(&self, frame: &Frame, times: Option<Channel>) -> Option<Found> {
        let measured = self.measured(frame, times);
        let most = measured.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let left = self.without().alone;
        let says = left.iter().zip(&measured).filter(|(_, measured)| measured.abs() > SAYS * most);
        let mut units: Vec<f64> = says.map(|(left, measured)| left * self.floor / measured).collect();
        units.sort_by(f64::total_cmp);
        let at = |share: f64| units.get((share * units.len() as f64) as usize).copied();
        let middle = at(0.5)?;
        let begins = BEGINS.iter().flat_map(|&share| [at(share), at(1.0 - share)]).flatten().map(|unit| unit - middle);
        let all = begins.filter(|size| *size != 0.0).map(|size| self.from(frame, times, size, None));
        all.filter(|found| found.there.iter().any(|there| *there)).min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// The same from a size on, or with a size that is given.
    fn from(&self, frame: &Frame, times: Option<Channel>, begin: f64, given: Option<f64>) -> Found {
        let measured = self.measured(frame, times);
        let mut size = given.unwrap_or(begin);
        let mut settled = self.without();
        let mut there = Vec::new();
        for _ in 0..ROUNDS {
            let now = self.there(&settled.alone, &measured, size);
            if now == there {
                break;
            }
            settled = self.settled(Some(&measured), &now, given);
            (there, size) = (now, settled.size);
        }
        let changes = (1..there.len()).filter(|&row| there[row] != there[row - 1] && self.judged[row].1 == self.judged[row - 1].1).count();
        Found { cost: self.cost(&settled, changes), settled, size, there }
    }

    /// Where the linear refit beside it puts the unknowns.
    fn moved(&self, frame: &Frame, found: &Found) -> Vec<f64> {
        let (mut x, bounds) = (self.x.clone(), frame.bounds());
        for (&unknown, change) in self.by.iter().zip(found.settled.change.iter()) {
            x[unknown] = (x[unknown] + change).clamp(bounds[unknown].0, bounds[unknown].1);
        }
        x
    }

    /// The same where the linear refit leads, and again from there, as long as it gets better.
    fn settle(self, frame: &Frame, times: Option<Channel>, mut found: Found, given: Option<f64>) -> (Rows, Found) {
        let mut rows = self;
        for _ in 0..REFITS {
            let moved = Rows::new(frame, rows.moved(frame, &found), rows.by.clone(), rows.channel);
            let again = moved.from(frame, times, found.size, given);
            if again.cost > found.cost {
                break;
            }
            (rows, found) = (moved, again);
        }
        (rows, found)
    }

    /// The same for single readings.
    fn settle_readings(self, frame: &Frame, mut found: Found) -> (Rows, Found) {
        let mut rows = self;
        for _ in 0..REFITS {
            let moved = Rows::new(frame, rows.moved(frame, &found), rows.by.clone(), rows.channel);
            let again = moved.readings_off();
            if again.cost > found.cost {
                break;
            }
            (rows, found) = (moved, again);
        }
        (rows, found)
    }

    /// In which rows it is there: the way of least cost.
    fn there(&self, alone: &[f64], measured: &[f64], size: f64) -> Vec<bool> {
        let logs: Vec<usize> = self.judged.iter().map(|&(_, log, _)| log).collect();
        let costs = alone.iter().zip(measured).map(|(alone, measured)| [alone.powi(2), (alone - size * measured / self.floor).powi(2)]);
        cheapest(&logs, &costs.collect::<Vec<_>>(), self.per_change())
    }

    fn per_change(&self) -> f64 {
        PER_CHANGE * (self.judged.len().max(2) as f64).ln()
    }

    fn cost(&self, settled: &Settled, changes: usize) -> f64 {
        settled.left.iter().map(|left| left.powi(2)).sum::<f64>() + changes as f64 * self.per_change()
    }

    fn rms(&self, settled: &Settled) -> f64 {
        self.floor * (settled.left.iter().map(|left| left.powi(2)).sum::<f64>() / settled.left.len().max(1) as f64).sqrt()
    }

    /// How often it comes, in how many rows it is there, and how long it stays on average, s.
    fn visits(&self, frame: &Frame, there: &[bool]) -> (usize, usize, f64) {
        let (mut visits, mut rows, mut stays_s) = (0, 0, 0.0);
        for (index, &(_, log, row)) in self.judged.iter().enumerate().filter(|(index, _)| there[*index]) {
            let goes_on = index > 0 && there[index - 1] && self.judged[index - 1].1 == log;
            visits += usize::from(!goes_on);
            rows += 1;
            stays_s += frame.evidence.logs[log].time_s[row] - frame.evidence.logs[log].time_s[row - 1];
        }
        (visits, rows, stays_s / visits.max(1) as f64)
    }
}
