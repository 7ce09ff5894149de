//! Where logs are full and empty, what lies between, and so the state of charge of every row.

use energy::Estimate;
use energy::units::H_PER_S;

use super::counted::Counted;
use super::shown::rest_a;
use super::{OcvError, Sheet};

/// A charge has ended full if it reached the full voltage within this share of it: chargers hold theirs to half a per cent.
const AT_FULL: f64 = 0.005;
/// And with at most this current, as a share of the capacity an hour: above, a cell takes more once its voltage is held.
const FULL_PER_HOUR: f64 = 0.1;
/// A discharge ends empty at most so fast, as a share of the capacity an hour: above, the resistance ends it early.
const EMPTY_PER_HOUR: f64 = 0.2;
/// A cell that is full and has rested shows its full voltage less at most this share of what lies between full and end.
const RESTED: f64 = 0.02;
/// A log that is stated to begin full, and rests, shows its full voltage less at most this share of what lies between; one that begins empty is
/// at most [`RECOVERED`] above its end. Guesses, wide enough for a flat voltage.
const SAGGED: f64 = 0.2;
/// See [`SAGGED`].
const RECOVERED: f64 = 0.5;
/// What is charged by less than this share of the capacity was not charged full by that.
const LITTLE: f64 = 0.01;
/// Passages at more than so many times the slowest one's current say less of what a battery holds, and are not asked.
const AS_SLOW: f64 = 2.0;
/// What is not known of one passage, as a share: the gain of an ammeter and what its current leaves in the cell. A guess.
const PASSAGE_SIGMA: f64 = 0.01;
/// How well a state of charge is known that was counted from full or empty, at best. A guess.
const COUNTED: f64 = 2e-3;
/// As much charge is given to a capacity that was stated: it is taken at its word, but for that ammeter.
const STATED_SIGMA: f64 = PASSAGE_SIGMA;
/// A state of charge may come out so far beyond full and empty.
const BEYOND: f64 = 0.1;
/// A stated state of charge this near to full or empty is that.
const EXACT: f64 = 5e-4;

/// A way of a log between full and empty.
#[derive(Debug, Clone, PartialEq)]
pub struct Passage {
    /// Name of the log.
    pub log: String,
    /// Whether it ends empty.
    pub discharge: bool,
    /// Charge that passed, Ah.
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

/// What is known of where logs are.
pub(super) struct Known {
    pub(super) capacity_ah: Estimate,
    pub(super) passages: Vec<Passage>,
    /// How well a state of charge is known, by log.
    pub(super) sigmas: Vec<f64>,
    /// State of charge of every row of every log.
    pub(super) soc: Vec<Vec<f64>>,
    pub(super) beginnings: Vec<Beginning>,
}

/// A row at which it is known how full the battery is.
#[derive(Clone, Copy)]
struct Anchor {
    row: usize,
    soc: f64,
}

pub(super) fn known(sheet: &Sheet, logs: &[Counted<'_>]) -> Result<Known, OcvError> {
    let nominal_ah = sheet.capacity_ah.unwrap_or_else(|| logs.iter().map(Counted::range_ah).fold(0.0, f64::max));
    let anchors: Vec<(Vec<Anchor>, Beginning)> = logs.iter().map(|log| anchors(log, sheet, nominal_ah)).collect();
    let found = logs.iter().zip(&anchors).flat_map(|(log, (anchors, _))| passages(log, anchors));
    let found: Vec<Passage> = found.collect();
    let slowest = found.iter().map(|passage| passage.per_hour).fold(f64::INFINITY, f64::min);
    let slow: Vec<Passage> = found.into_iter().filter(|passage| passage.per_hour <= AS_SLOW * slowest).collect();
    let measured = (!slow.is_empty()).then(|| mean(&slow));
    let capacity_ah = match (sheet.capacity_ah, measured) {
        // It is taken at its word, but is known no better than it agrees with what was measured.
        (Some(stated_ah), measured) => {
            let off_ah = measured.map_or(0.0, |measured| (measured.value - stated_ah).abs());
            Estimate::new(stated_ah, (STATED_SIGMA * stated_ah).max(off_ah))
        }
        (None, Some(measured)) => measured,
        (None, None) => return Err(OcvError::NoCapacity),
    };
    // Rows between full and empty are counted by what passed there: they are as uncertain as ways there differ.
    let own_ah = measured.map_or(capacity_ah.value, |measured| measured.value);
    let spread = slow.iter().map(|passage| (passage.charge_ah / own_ah - 1.0).abs()).fold(COUNTED, f64::max);
    let stated = |(log, (anchors, beginning)): (&Counted<'_>, &(Vec<Anchor>, Beginning))| {
        let sigma = log.log.facts.soc_initial_sigma.filter(|_| *beginning == Beginning::Stated && anchors.len() == 1);
        spread.hypot(sigma.unwrap_or(0.0))
    };
    let sigmas = logs.iter().zip(&anchors).map(stated).collect();
    for log in logs {
        begins_as_stated(log, sheet, rest_a(nominal_ah))?;
    }
    let soc = logs.iter().zip(&anchors).map(|(log, (anchors, _))| soc(log, anchors, capacity_ah.value)).collect::<Result<_, _>>()?;
    Ok(Known { capacity_ah, passages: slow, sigmas, soc, beginnings: anchors.into_iter().map(|(_, beginning)| beginning).collect() })
}

/// The mean of what passed. Passages that differ by more than each may be off say how well it is known.
fn mean(passages: &[Passage]) -> Estimate {
    let count = passages.len() as f64;
    let mean_ah = passages.iter().map(|passage| passage.charge_ah).sum::<f64>() / count;
    let spread_ah = (passages.iter().map(|passage| (passage.charge_ah - mean_ah).powi(2)).sum::<f64>() / (count - 1.0).max(1.0)).sqrt();
    // One ammeter counted them all.
    Estimate::new(mean_ah, (PASSAGE_SIGMA * mean_ah).max(spread_ah))
}

/// Refuses a log that is stated to begin full or empty and shows another voltage at rest.
fn begins_as_stated(log: &Counted<'_>, sheet: &Sheet, rest_a: f64) -> Result<(), OcvError> {
    let Some(soc) = log.log.facts.soc_initial.filter(|_| log.current_a[0].abs() <= rest_a) else { return Ok(()) };
    let shown_v = log.cell_v[0];
    let wrong = soc >= 1.0 - EXACT && shown_v < sheet.full_v_per_cell - SAGGED * sheet.span_v()
        || soc <= EXACT && shown_v > sheet.eod_v_per_cell + RECOVERED * sheet.span_v();
    if wrong { Err(OcvError::Begins { file: log.log.file.clone(), soc: 100.0 * soc, shown_v }) } else { Ok(()) }
}

/// Where this log is known to be full or empty, in order; else where it is stated to begin.
fn anchors(log: &Counted<'_>, sheet: &Sheet, nominal_ah: f64) -> (Vec<Anchor>, Beginning) {
    let stated = log.log.facts.soc_initial;
    let rows = log.current_a.len();
    let rest_a = rest_a(nominal_ah);
    let mut anchors = Vec::new();
    let mut beginning = Beginning::Counted;
    let rested_v = sheet.full_v_per_cell - RESTED * sheet.span_v();
    match stated {
        Some(soc) if soc >= 1.0 - EXACT || soc <= EXACT => {
            anchors.push(Anchor { row: 0, soc });
            beginning = Beginning::Stated;
        }
        None if log.cell_v[0] >= rested_v && log.current_a[0].abs() <= rest_a => {
            anchors.push(Anchor { row: 0, soc: 1.0 });
            beginning = Beginning::Full;
        }
        _ => {}
    }
    let full_v = sheet.full_v_per_cell * (1.0 - AT_FULL);
    for run in log.runs(|current_a| current_a < -rest_a) {
        let (most_v, last) = (log.cell_v[run.clone()].iter().copied().fold(f64::NEG_INFINITY, f64::max), run.end - 1);
        let moved_ah = log.drawn_ah[run.start - 1] - log.drawn_ah[last];
        let tapered = -log.current_a[last] <= FULL_PER_HOUR * nominal_ah;
        // A log that ends within a charge does not say whether that charge had ended.
        let ended = run.end < rows || -log.current_a[last] < -log.current_a[run.start] / 2.0 || log.cell_v[last] >= full_v;
        // A slow charge beyond the full voltage was full where it passed that.
        let beyond = most_v > sheet.full_v_per_cell * (1.0 + AT_FULL);
        let passed = run.clone().find(|&row| log.cell_v[row] >= sheet.full_v_per_cell && -log.current_a[row] <= FULL_PER_HOUR * nominal_ah);
        if most_v >= full_v && moved_ah > LITTLE * nominal_ah && (beyond || tapered && ended) {
            let row = if beyond { passed } else { Some(last) };
            anchors.extend(row.map(|row| Anchor { row, soc: 1.0 }));
        }
    }
    for run in log.runs(|current_a| current_a > rest_a) {
        // A discharge ends between two readings: at the last one before its end the next would be beyond it.
        let next_v = |row: usize| log.cell_v[row] + if row > run.start { (log.cell_v[row] - log.cell_v[row - 1]).min(0.0) } else { 0.0 };
        let end_v = sheet.eod_v_per_cell + AT_FULL * sheet.span_v();
        let slow = |&row: &usize| next_v(row) <= end_v && log.current_a[row] <= EMPTY_PER_HOUR * nominal_ah;
        anchors.extend(run.clone().find(slow).map(|row| Anchor { row, soc: 0.0 }));
    }
    anchors.sort_by_key(|anchor| anchor.row);
    if anchors.is_empty()
        && let Some(soc) = stated
    {
        return (vec![Anchor { row: 0, soc }], Beginning::Stated);
    }
    (anchors, beginning)
}

/// The ways between neighbours of which one is full and the other empty.
fn passages(log: &Counted<'_>, anchors: &[Anchor]) -> Vec<Passage> {
    let between = |pair: &[Anchor]| {
        let [from, to] = [pair[0], pair[1]];
        let charge_ah = log.drawn_ah[to.row] - log.drawn_ah[from.row];
        let whole = (from.soc - to.soc).abs() > 1.0 - 2.0 * EXACT && charge_ah * (from.soc - to.soc) > 0.0;
        let flowed_h: f64 = (from.row + 1..=to.row)
            .filter(|&row| log.current_a[row] * charge_ah > 0.0)
            .map(|row| (log.time_s()[row] - log.time_s()[row - 1]) * H_PER_S)
            .sum();
        whole.then(|| Passage {
            log: log.log.name.clone(),
            discharge: charge_ah > 0.0,
            charge_ah: charge_ah.abs(),
            per_hour: 1.0 / flowed_h,
        })
    };
    anchors.windows(2).filter_map(between).collect()
}

/// The state of charge of every row: between full and empty by the charge that passed there, else by the capacity.
fn soc(log: &Counted<'_>, anchors: &[Anchor], capacity_ah: f64) -> Result<Vec<f64>, OcvError> {
    let [first, ..] = anchors else {
        return Err(OcvError::NoStart { file: log.log.file.clone(), facts: format!("{}.toml", log.log.name) });
    };
    let counted = |from: &Anchor, row: usize, capacity_ah: f64| from.soc - (log.drawn_ah[row] - log.drawn_ah[from.row]) / capacity_ah;
    let mut soc: Vec<f64> = Vec::with_capacity(log.drawn_ah.len());
    let (mut last, mut next) = (first, 0);
    for row in 0..log.drawn_ah.len() {
        while next < anchors.len() && anchors[next].row <= row {
            last = &anchors[next];
            next += 1;
        }
        let passed_ah = anchors.get(next).map(|to| ((last.soc - to.soc), log.drawn_ah[to.row] - log.drawn_ah[last.row]));
        let own_ah = match passed_ah {
            Some((share, passed_ah)) if share.abs() > 1.0 - 2.0 * EXACT && share * passed_ah > 0.0 => passed_ah / share,
            _ => capacity_ah,
        };
        soc.push(counted(last, row, own_ah));
    }
    let far = soc.iter().copied().find(|soc| !(-BEYOND..=1.0 + BEYOND).contains(soc));
    far.map_or(Ok(soc), |to| Err(OcvError::Overrun { file: log.log.file.clone(), from: 100.0 * first.soc, to: 100.0 * to }))
}
