//! What comes and goes at times that no formula says: how large, how often, how long.
//!
//! A contact that jumps, a wheel that drags now and then, a charger that falters: the residual is a size times
//! something measured (or a size alone) while it is there, and nothing while it is not. When it is there is asked of
//! every log, a held-out one too, by the way through two states of least cost (Viterbi, IEEE Trans. Inf. Theory 13,
//! 1967, p. 260), on which every change is dear. The size follows from where it is there, together with what the base
//! model can absorb, and where it is there from the size, in turn.
//!
//! A load beside the ammeter is no such multiple: it drains the battery as well, and what it polarises stays for a while. It is
//! looked for from where the shown voltage seems to come and go, as more of the current that drives the model.

mod act;
mod readings;
mod rows;

use std::sync::Arc;

use energy::Channel;

use self::act::{Act, remembered};
use self::rows::{Found, Rows};
use crate::infer::evidence::Evidence;
use crate::infer::frame::Frame;
use crate::infer::state::{State, all};

/// Something that comes and goes.
#[derive(Debug, Clone, PartialEq)]
pub struct Switching {
    /// The channel that it adds to: the one that is judged, or an input that its sensor does not see all of.
    pub channel: Channel,
    /// The channel whose error it lowers.
    pub judged: Channel,
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

/// Share by which it must lower the held-out error: half of the squares.
const FALL: f64 = 0.3;

/// What comes and goes, if that explains most of what the base leaves of its system's first target, on the held-out logs too.
#[must_use]
pub(super) fn comes_and_goes(base: &State, holdout: &Arc<Evidence>) -> Option<Switching> {
    let whole = |evidence: &Arc<Evidence>| Arc::clone(evidence.whole.as_ref().unwrap_or(evidence));
    let judged = base.frame.model.system.targets()[0];
    let frame = Frame::new(Arc::clone(&base.frame.model), whole(&base.frame.evidence));
    let train = Rows::new(&frame, base.x.clone(), all(&frame), judged);
    let without = train.without();
    let before_training = train.rms(&without);
    let found = found(&frame, train);
    // A held-out log is asked for its own numbers only; all else is what the training logs say.
    let held = Frame::new(Arc::clone(&base.frame.model), whole(holdout));
    let own: Vec<usize> = (0..held.known.len()).filter(|&place| held.known[place].log().is_some()).map(|p| held.free.len() + p).collect();
    let rows = |x: &[f64]| {
        let mut start = held.as_in(&base.frame, x, None);
        own.iter().for_each(|&unknown| start[unknown] = 0.0);
        Rows::new(&held, start, own.clone(), judged)
    };
    let alone = rows(&base.x);
    let before = alone.rms(&alone.without());
    // Of two that the training logs speak for, the held-out ones tell the better.
    let asked = found.into_iter().map(|(kind, beside, found)| {
        let after = kind.asked_of(&held, rows(&beside.moved(&frame, &found.settled)), found.size);
        (after, kind, beside, found)
    });
    let (after, kind, beside, found) = asked.min_by(|a, b| a.0.total_cmp(&b.0))?;
    if after > (1.0 - FALL) * before {
        return None;
    }
    let (channel, times) = match kind {
        Kind::Readings => (judged, None),
        Kind::Shown { times, .. } => (judged, times),
        Kind::Driving { channel, .. } => (channel, None),
    };
    // What is shown most of the time is the rule, and where the base has taken it up, the exception is told.
    let is_rule = channel == judged && 2 * found.there.iter().filter(|there| **there).count() > found.there.len() && {
        let left = |wanted: bool| {
            let own = without.alone.iter().zip(&found.there).filter(|(_, there)| **there == wanted);
            let (sum, count) = own.fold((0.0, 0_u32), |(sum, count), (left, _)| (sum + left.abs(), count + 1));
            sum / f64::from(count.max(1))
        };
        left(true) < left(false)
    };
    let there: Vec<bool> = found.there.iter().map(|there| *there != is_rule).collect();
    let (visits, rows, stays_s) = beside.visits(&frame, &there);
    Some(Switching {
        channel,
        judged,
        readings: kind == Kind::Readings,
        times,
        size: if is_rule { -found.size } else { found.size },
        sigma: if kind == Kind::Readings { found.settled.sigma } else { beside.sigma(&found.settled) },
        share: rows as f64 / beside.judged.len().max(1) as f64,
        visits,
        stays_s,
        training: (before_training, beside.rms(&found.settled)),
        holdout: (before, after),
    })
}

/// What was found to come and go.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Kind {
    /// Single readings, each off by its own amount.
    Readings,
    /// What is shown beyond the prediction.
    Shown {
        /// What it is a multiple of.
        times: Option<Channel>,
    },
    /// What drives the model beyond what is measured.
    Driving {
        /// The input.
        channel: Channel,
        /// When it is there is looked for first where what is shown is off by so much.
        shows: (Option<Channel>, f64),
    },
}

/// What the training logs speak for, with the rows beside it: nothing, one, or what is shown and what drives.
fn found(frame: &Frame, train: Rows) -> Vec<(Kind, Rows, Found)> {
    let least = train.cost(&train.without(), 0) - train.per_term();
    let multiples = std::iter::once(None).chain(train.moving(frame).into_iter().map(Some));
    let shown = multiples.filter_map(|times| train.best(frame, times).map(|found| (times, found)));
    let shown = shown.filter(|(_, found)| found.cost < least).min_by(|a, b| a.1.cost.total_cmp(&b.1.cost));
    let off = train.readings_off();
    if off.cost < shown.as_ref().map_or(least, |(_, found)| found.cost) {
        let (beside, off) = train.settle_readings(frame, off);
        return vec![(Kind::Readings, beside, off)];
    }
    let Some((times, shown)) = shown else { return Vec::new() };
    let driving = remembered(frame.model.system).map(|channel| {
        let (beside, found) = driving(frame, channel, [&train.unbent(frame), &train], vec![shown.there.clone()], None);
        (Kind::Driving { channel, shows: (times, shown.size) }, beside, found)
    });
    let (beside, shown) = train.settle(frame, Act::Shown(times), shown, None);
    // What the model remembers of it must say so.
    let least = shown.cost - beside.per_term();
    let driving = driving.filter(|(_, _, found)| found.cost < least);
    driving.into_iter().chain([(Kind::Shown { times }, beside, shown)]).collect()
}

/// The size of what drives a model at which its answer is looked at where none is known yet, in the unit of the input.
const FIRST: f64 = 0.01;

/// More of an input, of a size that is asked for or given, from where it is thought to be on. Rows see it as numbers that are known only roughly
/// are stated, and as they are when they have been bent to do without it, often up to their limits: when it is there shows beside
/// either, how large it is and what it leaves beside what is stated only.
fn driving(frame: &Frame, channel: Channel, [stated, bent]: [&Rows; 2], mut begins: Vec<Vec<bool>>, given: Option<f64>) -> (Rows, Found) {
    let act = Act::Driving(channel);
    let settled = |rows: &Rows, there: &[bool]| {
        rows.clone().settle(frame, act, rows.begun_there(frame, act, there, given.unwrap_or(FIRST), given), given)
    };
    begins.extend(begins.iter().map(|there| settled(bent, there).1.there).collect::<Vec<_>>());
    let all = begins.iter().map(|there| settled(stated, there));
    all.min_by(|a, b| a.1.cost.total_cmp(&b.1.cost)).unwrap_or_else(|| settled(stated, &stated.nowhere()))
}

impl Kind {
    /// What is left of rows that are asked when it was there, of the size that was found elsewhere.
    fn asked_of(self, frame: &Frame, rows: Rows, size: f64) -> f64 {
        let (rows, found) = match self {
            Kind::Readings => {
                let off = rows.readings_off();
                rows.settle_readings(frame, off)
            }
            Kind::Shown { times } => {
                let found = rows.from(frame, Act::Shown(times), size, Some(size));
                rows.settle(frame, Act::Shown(times), found, Some(size))
            }
            Kind::Driving { channel, shows: (times, shown) } => {
                let bent = rows.bent(frame);
                // What is shown of it is as large as on the training logs, or as it looks beside what is drained here.
                let begins = [&rows, &bent].into_iter().flat_map(|rows| {
                    let as_there = rows.from(frame, Act::Shown(times), shown, Some(shown));
                    [Some(as_there), rows.best(frame, times)].into_iter().flatten().map(|found| found.there)
                });
                let forward = rows.forward(frame, Act::Driving(channel), size);
                driving(frame, channel, [&rows, &bent], begins.chain([forward]).collect(), Some(size))
            }
        };
        rows.rms(&found.settled)
    }
}
