//! The rows of one channel, and what is left of them beside something that is there in some.

use energy::Channel;
use nalgebra::{DMatrix, DVector};

use super::act::Act;
use crate::infer::frame::Frame;
use crate::infer::lens::{Absorber, Lens};
use crate::infer::propose::cheapest::cheapest;
use crate::infer::state::{State, filters, observed};
use crate::persistence::Persistence;
use crate::prepare::Prepared;

/// Rounds in which size and times are asked for in turn.
pub(super) const ROUNDS: usize = 30;
/// Times that derivatives are taken anew.
pub(super) const REFITS: usize = 8;
/// Rows of a stretch that is asked alone, how many such there are at most, and how often each is asked.
const STRETCH: usize = 40;
const STRETCHES_MAX: usize = 100;
const TURNS: usize = 5;
/// Shares of the rows, from either end of what one unit leaves, at which sizes begin.
const BEGINS: [f64; 4] = [0.01, 0.05, 0.15, 0.3];
/// Share of what is measured, of its largest size, below which a row says nothing of a first size.
const SAYS: f64 = 0.2;
/// Cost of a change between the states, and of another term, in logarithms of the number of rows: each is a number that is asked for, and
/// it is the best of many.
const PER_CHANGE: f64 = 2.0;
const PER_TERM: f64 = 6.0;

/// The rows of one channel, one by one, and what a linear refit of some unknowns absorbs.
#[derive(Clone)]
pub(super) struct Rows {
    /// The unknowns, and which of them may move.
    pub(super) x: Vec<f64>,
    pub(super) by: Vec<usize>,
    pub(super) channel: Channel,
    /// What the model predicts there for every row of all.
    pub(super) predicted: Vec<f64>,
    lens: Lens,
    base: Absorber,
    /// Rows of the channel among all, and the log and row of each.
    pub(super) judged: Vec<(usize, usize, usize)>,
    /// White noise of one row.
    pub(super) floor: f64,
}

/// What a linear refit leaves beside something that is there in some rows.
#[derive(Clone)]
pub(super) struct Settled {
    pub(super) size: f64,
    pub(super) sigma: f64,
    /// Of the unknowns.
    change: DVector<f64>,
    /// Of every row of the channel that counts, without what comes and goes, and with it, in floors.
    pub(super) alone: Vec<f64>,
    pub(super) left: Vec<f64>,
}

pub(super) struct Found {
    pub(super) settled: Settled,
    pub(super) size: f64,
    pub(super) there: Vec<bool>,
    pub(super) cost: f64,
}

impl Rows {
    /// At these unknowns, of which some may move.
    pub(super) fn new(frame: &Frame, x: Vec<f64>, by: Vec<usize>, channel: Channel) -> Rows {
        Rows::along((frame, frame), x, by, channel)
    }

    /// The same with the derivatives that another frame has, where the model takes another way.
    fn along((frame, way): (&Frame, &Frame), x: Vec<f64>, by: Vec<usize>, channel: Channel) -> Rows {
        let predicted = frame.predict(&x);
        let slopes = way.linearise(&x, &by).1;
        let residual: Vec<f64> = observed(frame).zip(&predicted).map(|(observed, predicted)| observed - predicted).collect();
        let lens = Lens::new(frame, &x, &by, &slopes, &residual, filters(frame, &State::white(frame)));
        let bounds = frame.bounds();
        let held = (0..by.len()).filter(|&index| x[by[index]] <= bounds[by[index]].0 || x[by[index]] >= bounds[by[index]].1).collect();
        let own = frame.evidence.segments.iter().filter(|segment| segment.channel == channel);
        let judged = own.flat_map(|segment| segment.range().zip(&segment.rows).map(|(place, &row)| (place, segment.log, row))).collect();
        Rows { predicted, base: Absorber::new(&lens, held), lens, judged, floor: frame.evidence.floor(channel), x, by, channel }
    }

    /// The same rows with all that is only roughly known as it is stated.
    pub(super) fn unbent(&self, frame: &Frame) -> Rows {
        let mut x = self.x.clone();
        x[frame.free.len()..].fill(0.0);
        Rows::new(frame, x, self.by.clone(), self.channel)
    }

    /// The same with its unknowns where they do best alone.
    pub(super) fn bent(&self, frame: &Frame) -> Rows {
        let mut rows = self.clone();
        for _ in 0..REFITS {
            let moved = rows.moved(frame, &rows.without());
            rows = Rows::new(frame, moved, rows.by.clone(), rows.channel);
        }
        rows
    }

    /// It is there in no row.
    pub(super) fn nowhere(&self) -> Vec<bool> {
        vec![false; self.judged.len()]
    }

    /// Inputs that every log has and that move.
    pub(super) fn moving(&self, frame: &Frame) -> Vec<Channel> {
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
    pub(super) fn measured(&self, frame: &Frame, times: Option<Channel>) -> Vec<f64> {
        let value = |&(_, log, row): &(usize, usize, usize)| {
            let input = |wanted| frame.evidence.logs[log].inputs.iter().find(|(channel, _)| *channel == wanted);
            times.map_or(1.0, |wanted| input(wanted).map_or(0.0, |(_, values)| values[row]))
        };
        self.judged.iter().map(value).collect()
    }

    /// A linear refit beside what does this to every row for each unit of its size; of a size that is asked for, or given.
    pub(super) fn settled(&self, answer: &[f64], size: Option<f64>) -> Settled {
        let mut column = DVector::zeros(self.lens.whitened.len());
        for (&(place, ..), answer) in self.judged.iter().zip(answer) {
            column[place] = answer / self.floor;
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
    pub(super) fn without(&self) -> Settled {
        self.settled(&vec![0.0; self.judged.len()], Some(0.0))
    }

    /// The best that comes and goes as a multiple of what is measured; none when nothing does.
    pub(super) fn best(&self, frame: &Frame, times: Option<Channel>) -> Option<Found> {
        let measured = self.measured(frame, times);
        let most = measured.iter().fold(0.0_f64, |most, value| most.max(value.abs()));
        let left = self.without().alone;
        let says = left.iter().zip(&measured).filter(|(_, measured)| measured.abs() > SAYS * most);
        let mut units: Vec<f64> = says.map(|(left, measured)| left * self.floor / measured).collect();
        units.sort_by(f64::total_cmp);
        let at = |share: f64| units.get((share * units.len() as f64) as usize).copied();
        let middle = at(0.5)?;
        let begins = BEGINS.iter().flat_map(|&share| [at(share), at(1.0 - share)]).flatten().map(|unit| unit - middle);
        let all = begins.filter(|size| *size != 0.0).map(|size| self.from(frame, Act::Shown(times), size, None));
        all.filter(|found| found.there.iter().any(|there| *there)).min_by(|a, b| a.cost.total_cmp(&b.cost))
    }

    /// The same from a size on, or with a size that is given.
    pub(super) fn from(&self, frame: &Frame, act: Act, begin: f64, given: Option<f64>) -> Found {
        let nothing = vec![0.0; self.judged.len()];
        self.in_turn(frame, act, (self.without(), self.nowhere(), nothing), given.unwrap_or(begin), given)
    }

    /// The same from where it is thought to be on.
    pub(super) fn begun_there(&self, frame: &Frame, act: Act, there: &[bool], begin: f64, given: Option<f64>) -> Found {
        let whole = self.whole(frame, act, there, begin);
        let settled = self.settled(&whole, given);
        let size = settled.size;
        self.in_turn(frame, act, (settled, there.to_vec(), whole), size, given)
    }

    /// Asks where it is and how large in turn, until neither changes; the best on the way.
    fn in_turn(&self, frame: &Frame, act: Act, first: (Settled, Vec<bool>, Vec<f64>), mut size: f64, given: Option<f64>) -> Found {
        let (mut settled, mut there, mut whole) = first;
        let at_once = self.at_once(frame, act, size);
        let mut best: Option<Found> = None;
        for _ in 0..ROUNDS {
            let now = self.there(&settled.alone, (&whole, &at_once), &there, size);
            if now == there && best.is_some() {
                break;
            }
            whole = self.whole(frame, act, &now, size);
            settled = self.settled(&whole, given);
            (there, size) = (now, settled.size);
            let cost = self.cost(&settled, self.changes(&there));
            if best.as_ref().is_none_or(|best| cost < best.cost) {
                best = Some(Found { cost, settled: settled.clone(), size, there: there.clone() });
            }
        }
        best.unwrap_or_else(|| unreachable!("there is a first round"))
    }

    /// Where something of this size is there, asked for stretch by stretch from the beginning of every log: what is remembered of it
    /// in a stretch is then known but for what came in the stretch itself.
    pub(super) fn forward(&self, frame: &Frame, act: Act, size: f64) -> Vec<bool> {
        let (mut there, at_once) = (self.nowhere(), self.at_once(frame, act, size));
        let alone: Vec<f64> = self.judged.iter().map(|&(place, ..)| self.lens.whitened[place]).collect();
        let mut first = 0;
        let stretches: Vec<usize> = (0..there.len())
            .map(|row| {
                first = if row > 0 && self.judged[row].1 == self.judged[row - 1].1 { first } else { row };
                row - first
            })
            .collect();
        let longest = stretches.iter().copied().max().unwrap_or(0) + 1;
        let stretches: Vec<usize> = stretches.into_iter().map(|row| row / STRETCH.max(longest / STRETCHES_MAX)).collect();
        for stretch in 0..=stretches.iter().copied().max().unwrap_or(0) {
            for _ in 0..TURNS {
                let whole = self.whole(frame, act, &there, size);
                let now = self.there(&alone, (&whole, &at_once), &there, size);
                let own = (0..there.len()).filter(|&row| stretches[row] == stretch && now[row] != there[row]).collect::<Vec<_>>();
                if own.is_empty() {
                    break;
                }
                own.into_iter().for_each(|row| there[row] = now[row]);
            }
        }
        there
    }

    /// How often it comes or goes.
    fn changes(&self, there: &[bool]) -> usize {
        (1..there.len()).filter(|&row| there[row] != there[row - 1] && self.judged[row].1 == self.judged[row - 1].1).count()
    }

    /// Where the linear refit beside it puts the unknowns.
    pub(super) fn moved(&self, frame: &Frame, settled: &Settled) -> Vec<f64> {
        let (mut x, bounds) = (self.x.clone(), frame.bounds());
        for (&unknown, change) in self.by.iter().zip(settled.change.iter()) {
            x[unknown] = (x[unknown] + change).clamp(bounds[unknown].0, bounds[unknown].1);
        }
        x
    }

    /// The same where the linear refit leads, and again from there, as long as it gets better.
    pub(super) fn settle(self, frame: &Frame, act: Act, mut found: Found, given: Option<f64>) -> (Rows, Found) {
        let mut rows = self;
        for _ in 0..REFITS {
            let x = rows.moved(frame, &found.settled);
            let moved = match act {
                Act::Shown(_) => Rows::new(frame, x, rows.by.clone(), rows.channel),
                Act::Driving(channel) => rows.driven_to(frame, channel, x, &found),
            };
            let again = match act {
                Act::Shown(_) => moved.from(frame, act, found.size, given),
                Act::Driving(_) => moved.begun_there(frame, act, &found.there, found.size, given),
            };
            // What the model remembers bends the way: a cost by straight lines may rise before it falls.
            if again.cost > found.cost && matches!(act, Act::Shown(_)) {
                break;
            }
            (rows, found) = (moved, again);
        }
        (rows, found)
    }

    /// The same at other unknowns, with the derivatives of where so much more of an input leads. Of what is at a limit only that is
    /// held which is pulled beyond it.
    fn driven_to(&self, frame: &Frame, channel: Channel, x: Vec<f64>, found: &Found) -> Rows {
        let driven = self.driven(frame, channel, &found.there, found.size);
        let mut rows = Rows::along((frame, &driven), x, self.by.clone(), self.channel);
        let whole = rows.whole(frame, Act::Driving(channel), &found.there, found.size);
        let mut left = rows.lens.whitened.clone();
        for (&(place, ..), answer) in rows.judged.iter().zip(whole) {
            left[place] -= answer * found.size / rows.floor;
        }
        let pull = &rows.lens.pull + &rows.lens.design * (left - &rows.lens.whitened);
        let bounds = frame.bounds();
        let is_pulled_out = |index: usize| {
            let (x, (low, high)) = (rows.x[rows.by[index]], bounds[rows.by[index]]);
            x <= low && pull[index] <= 0.0 || x >= high && pull[index] >= 0.0
        };
        let held = (0..rows.by.len()).filter(|&index| is_pulled_out(index)).collect();
        rows.base = Absorber::new(&rows.lens, held);
        rows
    }

    /// In which rows it is there: the way of least cost. What an earlier row left behind is as where it was thought to be.
    fn there(&self, alone: &[f64], (whole, at_once): (&[f64], &[f64]), before: &[bool], size: f64) -> Vec<bool> {
        let logs: Vec<usize> = self.judged.iter().map(|&(_, log, _)| log).collect();
        let unit = size / self.floor;
        let costs = alone.iter().zip(before).zip(whole.iter().zip(at_once)).map(|((alone, before), (whole, at_once))| {
            let left = alone - unit * if *before { whole - at_once } else { *whole };
            [left.powi(2), (left - unit * at_once).powi(2)]
        });
        cheapest(&logs, &costs.collect::<Vec<_>>(), self.per_change())
    }

    /// What another term costs.
    pub(super) fn per_term(&self) -> f64 {
        PER_TERM * (self.judged.len() as f64).ln()
    }

    pub(super) fn per_change(&self) -> f64 {
        PER_CHANGE * (self.judged.len().max(2) as f64).ln()
    }

    pub(super) fn cost(&self, settled: &Settled, changes: usize) -> f64 {
        settled.left.iter().map(|left| left.powi(2)).sum::<f64>() + changes as f64 * self.per_change()
    }

    /// The deviation of a size where more is left than the sensor's noise, or keeps its sign: as much wider as so large a rest is, and as so
    /// few rows of it are independent (as in `fit`).
    pub(super) fn sigma(&self, settled: &Settled) -> f64 {
        let left = &settled.left;
        let large = (self.rms(settled) / self.floor).max(1.0);
        let rows: Vec<usize> = (0..left.len()).collect();
        settled.sigma * large * Persistence::of(&rows, left).rows_per_independent(rows.len()).sqrt()
    }

    pub(super) fn rms(&self, settled: &Settled) -> f64 {
        self.floor * (settled.left.iter().map(|left| left.powi(2)).sum::<f64>() / settled.left.len().max(1) as f64).sqrt()
    }

    /// How often it comes, in how many rows it is there, and how long it stays on average, s.
    pub(super) fn visits(&self, frame: &Frame, there: &[bool]) -> (usize, usize, f64) {
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
