//! Where logs are full and empty, what lies between, and so the state of charge of every row.

use energy::Estimate;
use energy::units::H_PER_S;

use super::anchor::{Anchor, COUNTED, EXACT, anchors};
use super::counted::{Counted, because, why_no_capacity};
use super::course::{begins, course};
use super::shown::REST_S;
use super::{OcvError, Sheet};

/// A log that is stated to begin full, and rests, shows its full voltage less at most this share of what lies between; one that begins empty is
/// at most [`RECOVERED`] above its end. Guesses, wide enough for a flat voltage.
const SAGGED: f64 = 0.2;
/// See [`SAGGED`].
const RECOVERED: f64 = 0.5;
/// A way over less than this of the state of charge does not say what a battery holds.
const LONG: f64 = 0.5;
/// Passages at more than so many times the slowest one's current say less of what a battery holds, and are not asked.
const AS_SLOW: f64 = 2.0;
/// What is not known of all passages, as a share: the gain of their ammeter. A guess.
const PASSAGE_SIGMA: f64 = 0.01;
/// As much charge is given to a capacity that was stated: it is taken at its word, but for that ammeter.
const STATED_SIGMA: f64 = PASSAGE_SIGMA;
/// Ways that differ by more than so many of their deviations do not do so by chance. A guess.
const BY_FAR: f64 = 3.0;
/// A state of charge may come out so far beyond full and empty.
const BEYOND: f64 = 0.1;

/// A way of a log between full and empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Passage {
    /// Name of the log.
    pub log: String,
    /// Whether it ends empty.
    pub discharge: bool,
    /// State of charge that passed.
    pub share: f64,
    /// Charge that passed, Ah, over that share: what passes between full and empty.
    pub charge_ah: f64,
    /// Mean current while one flowed, as a share of that charge an hour.
    pub per_hour: f64,
}

/// What says how full a log begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beginning {
    /// Facts or flags.
    Stated,
    /// It begins at rest at the full voltage.
    Full,
    /// What was counted to where it is full or empty.
    Counted,
}

/// A log that begins elsewhere than is stated, by what was counted to where it is full or empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Doubted {
    /// Name of the log.
    pub log: String,
    /// State of charge that is stated, with its deviation.
    pub stated: Estimate,
    /// That which was counted.
    pub counted: Estimate,
}

/// What is known of where logs are.
pub(super) struct Known {
    pub(super) capacity_ah: Estimate,
    pub(super) passages: Vec<Passage>,
    /// State of charge where it is least and most while, or after, a battery was discharged, and charged, and how well it is known there, by log.
    pub(super) ends: Vec<[[Estimate; 2]; 2]>,
    /// State of charge of every row of every log.
    pub(super) soc: Vec<Vec<f64>>,
    pub(super) beginnings: Vec<Beginning>,
    pub(super) doubted: Vec<Doubted>,
}

/// How charge is counted, so that the state of charge falls by `per_ah` times what flowed out, less `offset_per_h` times how long.
pub(super) struct Counting {
    /// One over what the battery holds as the ammeter counts, 1/Ah: its gain is not in the deviation.
    per_ah: f64,
    /// What the ammeter is off by, as a share of that an hour.
    offset_per_h: f64,
    /// Variances of both, and covariance.
    variances: [f64; 2],
    covariance: f64,
    /// How much worse than they say ways agree, and so what is known of their ends, >= 1.
    pub(super) worse: f64,
}

impl Counting {
    /// Of a capacity, by an ammeter that is not off.
    fn by(held_ah: Estimate) -> Counting {
        let per_ah = held_ah.value.recip();
        let variance = (per_ah * held_ah.sigma / held_ah.value).powi(2);
        Counting { per_ah, offset_per_h: 0.0, variances: [variance, 0.0], covariance: 0.0, worse: 1.0 }
    }

    /// What the battery holds as the ammeter counts, Ah.
    fn held_ah(&self) -> Estimate {
        Estimate::new(self.per_ah.recip(), self.variances[0].sqrt() / self.per_ah.powi(2))
    }

    /// What the state of charge rises by from one row to another.
    pub(super) fn between(&self, log: &Counted<'_>, from: usize, to: usize) -> f64 {
        let hours = (log.time_s()[to] - log.time_s()[from]) * H_PER_S;
        -(log.drawn_ah[to] - log.drawn_ah[from]) * self.per_ah + hours * self.offset_per_h
    }

    /// The same with its deviation.
    pub(super) fn way(&self, log: &Counted<'_>, from: usize, to: usize) -> Estimate {
        let hours = (log.time_s()[to] - log.time_s()[from]) * H_PER_S;
        let drawn_ah = log.drawn_ah[to] - log.drawn_ah[from];
        let known = drawn_ah.powi(2) * self.variances[0] + hours.powi(2) * self.variances[1] - 2.0 * drawn_ah * hours * self.covariance;
        let moved = (log.moved_ah[to] - log.moved_ah[from]).abs() * self.per_ah;
        let noise = log.noise_ah(from, to) * self.per_ah;
        Estimate::new(self.between(log, from, to), (COUNTED * moved).hypot(known.max(0.0).sqrt()).hypot(noise))
    }
}

/// What the battery holds as far as it is known before anything else, Ah.
pub(super) fn nominal_ah(sheet: &Sheet, logs: &[Counted<'_>]) -> f64 {
    sheet.capacity_ah.unwrap_or_else(|| logs.iter().map(Counted::range_ah).fold(0.0, f64::max))
}

pub(super) fn known(sheet: &Sheet, logs: &[Counted<'_>], nominal_ah: f64) -> Result<Known, OcvError> {
    let anchors: Vec<(Vec<Anchor>, Beginning)> = logs.iter().map(|log| anchors(log, sheet, nominal_ah)).collect();
    let found: Vec<Way> = logs.iter().zip(&anchors).flat_map(|(log, (anchors, _))| ways(log, anchors)).collect();
    let slowest = found.iter().map(|way| way.passage.per_hour).fold(f64::INFINITY, f64::min);
    let slow: Vec<Way> = found.into_iter().filter(|way| way.passage.per_hour <= AS_SLOW * slowest).collect();
    let measured = (!slow.is_empty()).then(|| held(&slow, quiet_a(logs)));
    let (capacity_ah, counting) = match (sheet.capacity_ah, measured) {
        // It is taken at its word, but is known no better than it agrees with what was measured.
        (Some(stated_ah), measured) => {
            let off_ah = measured.map_or(0.0, |(counting, _)| (counting.held_ah().value - stated_ah).abs());
            let capacity_ah = Estimate::new(stated_ah, (STATED_SIGMA * stated_ah).max(off_ah));
            (capacity_ah, Counting::by(Estimate::new(stated_ah, off_ah)))
        }
        (None, Some((counting, spread_ah))) => {
            let Estimate { value, sigma } = counting.held_ah();
            (Estimate::new(value, sigma.hypot(PASSAGE_SIGMA * value).max(spread_ah)), counting)
        }
        (None, None) => return Err(OcvError::NoCapacity { because: why_no_capacity(logs, sheet) }),
    };
    for log in logs {
        begins_as_stated(log, sheet)?;
    }
    let (mut soc, mut ends, mut doubted) = (Vec::new(), Vec::new(), Vec::new());
    for (log, (anchors, beginning)) in logs.iter().zip(&anchors) {
        let no_start = || OcvError::NoStart { file: log.log.file.clone(), facts: format!("{}.toml", log.log.name) };
        let course = course(log, anchors, &counting).ok_or_else(no_start)?;
        if let Some(&to) = course.soc.iter().find(|soc| !(-BEYOND..=1.0 + BEYOND).contains(*soc)) {
            return Err(OcvError::Overrun {
                file: log.log.file.clone(),
                from: 100.0 * course.soc[anchors[0].row],
                to: 100.0 * to,
                because: because(logs),
            });
        }
        let stated = anchors[0].soc;
        let counted = begins(log, &anchors[1..], &counting).filter(|_| *beginning == Beginning::Stated);
        if let Some(counted) = counted.filter(|counted| (counted.value - stated.value).abs() > stated.sigma + counted.sigma) {
            doubted.push(Doubted { log: log.log.name.clone(), stated, counted });
        }
        soc.push(course.soc);
        ends.push(course.ends);
    }
    let beginnings = anchors.into_iter().map(|(_, beginning)| beginning).collect();
    Ok(Known { capacity_ah, passages: slow.into_iter().map(|way| way.passage).collect(), ends, soc, beginnings, doubted })
}

/// A passage as it was counted.
struct Way {
    passage: Passage,
    /// State of charge that went out.
    out: Estimate,
    /// Charge that went out, Ah.
    out_ah: f64,
    /// For so long, h.
    hours: f64,
}

/// What an ammeter may be off by, A: what it reads, on average, where it is quietest for as long as a rest, and as well as its noise lets that
/// be known. 0 where it never is.
fn quiet_a(logs: &[Counted<'_>]) -> f64 {
    let quiet = logs.iter().flat_map(|log| {
        let runs = log.runs(|level_a| level_a.abs() <= log.none_a);
        let mean_a = |run: std::ops::Range<usize>| {
            let (from, to, length_s) = (run.start - 1, run.end - 1, log.length_s(&run));
            (length_s >= REST_S).then(|| (log.drawn_ah[to] - log.drawn_ah[from]).hypot(log.noise_ah(from, to)) / (length_s * H_PER_S))
        };
        runs.into_iter().filter_map(mean_a).collect::<Vec<_>>()
    });
    let least = quiet.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 0.0 }
}

/// What a battery holds, and what its ammeter is off by, from ways between full and empty: least squares of
/// `out = per_ah out_ah - offset_per_h hours`, with the offset as well known before as `offset_a` says. And by how much the ways differ, Ah,
/// where that is more than each may be off.
fn held(ways: &[Way], offset_a: f64) -> (Counting, f64) {
    let before = offset_a * ways.len() as f64 / ways.iter().map(|way| way.passage.charge_ah).sum::<f64>();
    let weighted = |of: &dyn Fn(&Way) -> f64| ways.iter().map(|way| of(way) / way.out.sigma.powi(2)).sum::<f64>();
    let (charge, both) = (weighted(&|way| way.out_ah.powi(2)), weighted(&|way| -way.out_ah * way.hours));
    let (right, right_hours) = (weighted(&|way| way.out_ah * way.out.value), weighted(&|way| -way.hours * way.out.value));
    let mut counting = if before > 0.0 {
        let hours = weighted(&|way| way.hours.powi(2)) + before.powi(-2);
        let determinant = charge * hours - both.powi(2);
        Counting {
            per_ah: (hours * right - both * right_hours) / determinant,
            offset_per_h: (charge * right_hours - both * right) / determinant,
            variances: [hours / determinant, charge / determinant],
            covariance: -both / determinant,
            worse: 1.0,
        }
    } else {
        Counting { per_ah: right / charge, offset_per_h: 0.0, variances: [charge.recip(), 0.0], covariance: 0.0, worse: 1.0 }
    };
    let own_ah = |way: &Way| way.out_ah / (way.out.value + counting.offset_per_h * way.hours);
    let off = |way: &Way| (way.out.value - counting.per_ah * way.out_ah + counting.offset_per_h * way.hours).powi(2);
    let squared = weighted(&off) + if before > 0.0 { (counting.offset_per_h / before).powi(2) } else { 0.0 };
    let others = (ways.len() as f64 - 1.0).max(1.0);
    let spread_ah = (ways.iter().map(|way| (own_ah(way) - counting.held_ah().value).powi(2)).sum::<f64>() / others).sqrt();
    if squared <= others {
        return (counting, 0.0);
    }
    counting.worse = (squared / others).sqrt();
    if counting.worse > BY_FAR {
        // Nothing says which of them is wrong: charge is not counted better than they differ.
        counting.variances[0] = counting.variances[0].max((spread_ah * counting.per_ah.powi(2)).powi(2));
    }
    (counting, spread_ah)
}

/// Refuses a log that is stated to begin full or empty and shows another voltage at rest.
fn begins_as_stated(log: &Counted<'_>, sheet: &Sheet) -> Result<(), OcvError> {
    let Some(soc) = log.log.facts.soc_initial.filter(|_| log.rests(0)) else { return Ok(()) };
    let shown_v = log.cell_v[0];
    let wrong = soc >= 1.0 - EXACT && shown_v < sheet.full_v_per_cell - SAGGED * sheet.span_v()
        || soc <= EXACT && shown_v > sheet.eod_v_per_cell + RECOVERED * sheet.span_v();
    if wrong { Err(OcvError::Begins { file: log.log.file.clone(), soc: 100.0 * soc, shown_v }) } else { Ok(()) }
}

/// The ways between neighbours that lie far apart.
fn ways(log: &Counted<'_>, anchors: &[Anchor]) -> Vec<Way> {
    let between = |pair: &[Anchor]| {
        let [from, to] = [pair[0], pair[1]];
        let out = from.soc.value - to.soc.value;
        let out_ah = log.drawn_ah[to.row] - log.drawn_ah[from.row];
        let flowed_h: f64 = (from.row + 1..=to.row)
            .filter(|&row| !log.rests(row) && log.level_a[row] * out_ah > 0.0)
            .map(|row| (log.time_s()[row] - log.time_s()[row - 1]) * H_PER_S)
            .sum();
        let passage = Passage {
            log: log.log.name.clone(),
            discharge: out_ah > 0.0,
            share: out.abs(),
            charge_ah: (out_ah / out).abs(),
            per_hour: out.abs() / flowed_h,
        };
        let hours = (log.time_s()[to.row] - log.time_s()[from.row]) * H_PER_S;
        let noise = log.noise_ah(from.row, to.row) * out.abs() / out_ah.abs().max(f64::MIN_POSITIVE);
        let out = Estimate::new(out, from.soc.sigma.hypot(to.soc.sigma).hypot(COUNTED).hypot(noise));
        (out.value.abs() >= LONG && out_ah * out.value > 0.0).then_some(Way { passage, out, out_ah, hours })
    };
    anchors.windows(2).filter_map(between).collect()
}
