//! Rows of a log at which it is known how full the battery is, and how well.

use energy::Estimate;

use super::Sheet;
use super::counted::Counted;
use super::passage::Beginning;

/// A charge has ended full if it reached the full voltage within this share of it: chargers hold theirs to half a per cent.
const AT_FULL: f64 = 0.005;
/// And with at most this current, as a share of the capacity an hour: above, a cell takes more once its voltage is held.
const FULL_PER_HOUR: f64 = 0.1;
/// A discharge ends empty at most so fast, as a share of the capacity an hour: above, the resistance ends it early.
const EMPTY_PER_HOUR: f64 = 0.2;
/// A cell that is full and has rested shows its full voltage less at most this share of what lies between full and end.
const RESTED: f64 = 0.02;
/// What is charged by less than this share of the capacity was not charged full by that.
const LITTLE: f64 = 0.01;
/// How well a state of charge is known at full, at empty, and between them, at best. A guess.
pub(super) const COUNTED: f64 = 2e-3;
/// A stated state of charge this near to full or empty is that.
pub(super) const EXACT: f64 = 5e-4;
/// How well another one is known where nothing is stated of that. A guess, the same that a first model states.
pub(super) const STATED: f64 = 5e-3;
/// What a current costs in all, V per cell at the capacity an hour: it ends a charge or a discharge by so much early. A guess:
/// lithium cells lose some 50 to 200 mV at that.
const COST_V: f64 = 0.1;
/// And by so much early, V per cell, half of a hysteresis ends a charge whose current is not held back at its end. A guess: layered oxides have
/// some 5 to 20 mV.
pub(super) const HYSTERESIS_V: f64 = 0.01;
/// The way to full or empty over which its slope is taken, as a share of the capacity.
const SLOPE: f64 = 0.02;

/// A row at which it is known how full the battery is.
#[derive(Debug, Clone, Copy)]
pub(super) struct Anchor {
    pub(super) row: usize,
    pub(super) soc: Estimate,
}

/// Where this log is stated to begin, and where it is full or empty, in order.
pub(super) fn anchors(log: &Counted<'_>, sheet: &Sheet, nominal_ah: f64) -> (Vec<Anchor>, Beginning) {
    let mut anchors = Vec::new();
    let mut beginning = Beginning::Counted;
    let rested_v = sheet.full_v_per_cell - RESTED * sheet.span_v();
    match log.log.facts.soc_initial {
        Some(soc) => {
            let exact = soc >= 1.0 - EXACT || soc <= EXACT;
            let sigma = log.log.facts.soc_initial_sigma.unwrap_or(if exact { COUNTED } else { STATED });
            anchors.push(Anchor { row: 0, soc: Estimate::new(soc, sigma.max(COUNTED)) });
            beginning = Beginning::Stated;
        }
        None if log.cell_v[0] >= rested_v && log.rests(0) => {
            anchors.push(Anchor { row: 0, soc: Estimate::new(1.0, COUNTED) });
            beginning = Beginning::Full;
        }
        None => {}
    }
    anchors.extend(full(log, sheet, nominal_ah));
    anchors.extend(empty(log, sheet, nominal_ah));
    anchors.sort_by_key(|anchor| anchor.row);
    (anchors, beginning)
}

/// Where charges end full.
fn full(log: &Counted<'_>, sheet: &Sheet, nominal_ah: f64) -> Vec<Anchor> {
    let full_v = sheet.full_v_per_cell * (1.0 - AT_FULL);
    let mut anchors = Vec::new();
    for run in log.runs(|level_a| level_a < -log.none_a) {
        let (most_v, last) = (log.cell_v[run.clone()].iter().copied().fold(f64::NEG_INFINITY, f64::max), run.end - 1);
        let moved_ah = log.drawn_ah[run.start - 1] - log.drawn_ah[last];
        let tapered = -log.level_a[last] <= FULL_PER_HOUR * nominal_ah;
        // A log that ends within a charge does not say whether that charge had ended.
        let held = -log.level_a[last] < -log.level_a[run.start] / 2.0;
        let ended = run.end < log.level_a.len() || held || log.cell_v[last] >= full_v;
        // A slow charge beyond the full voltage was full where it passed that.
        let beyond = most_v > sheet.full_v_per_cell * (1.0 + AT_FULL);
        let passed = run.clone().find(|&row| log.cell_v[row] >= sheet.full_v_per_cell && -log.level_a[row] <= FULL_PER_HOUR * nominal_ah);
        if most_v >= full_v && moved_ah > LITTLE * nominal_ah && (beyond || tapered && ended) {
            let row = if beyond { passed } else { Some(last) };
            let early_v = |row: usize| (COST_V * -log.level_a[row] / nominal_ah).hypot(if held { 0.0 } else { HYSTERESIS_V });
            let sigma = |row| COUNTED.hypot(early_v(row) / slope_v(log, sheet, run.start, row, nominal_ah));
            anchors.extend(row.map(|row| Anchor { row, soc: Estimate::new(1.0, sigma(row)) }));
        }
    }
    anchors
}

/// Where discharges end empty.
fn empty(log: &Counted<'_>, sheet: &Sheet, nominal_ah: f64) -> Vec<Anchor> {
    let of_run = |run: std::ops::Range<usize>| {
        // A discharge ends between two readings: at the last one before its end the next would be beyond it.
        let next_v = |row: usize| log.cell_v[row] + if row > run.start { (log.cell_v[row] - log.cell_v[row - 1]).min(0.0) } else { 0.0 };
        let end_v = sheet.eod_v_per_cell + AT_FULL * sheet.span_v();
        let slow = |&row: &usize| next_v(row) <= end_v && log.level_a[row] <= EMPTY_PER_HOUR * nominal_ah;
        let row = run.clone().find(slow)?;
        let early_v = COST_V * log.level_a[row] / nominal_ah;
        let sigma = COUNTED.hypot(early_v / slope_v(log, sheet, run.start, row, nominal_ah));
        Some(Anchor { row, soc: Estimate::new(0.0, sigma) })
    };
    log.runs(|level_a| level_a > log.none_a).into_iter().filter_map(of_run).collect()
}

/// How steep the voltage was on the way to a row, V per cell and state of charge: before it was held there, if it was. What lies between
/// full and end where a run is too short to say.
fn slope_v(log: &Counted<'_>, sheet: &Sheet, begin: usize, row: usize, nominal_ah: f64) -> f64 {
    let near = |other: usize| (log.cell_v[other] - log.cell_v[row]).abs() <= AT_FULL * sheet.span_v();
    let reached = (begin..=row).find(|&other| near(other)).unwrap_or(row);
    let apart = |other: usize| (log.drawn_ah[reached] - log.drawn_ah[other]).abs() / nominal_ah;
    let from = (begin..reached).rev().find(|&other| apart(other) >= SLOPE && log.cell_v[other].is_finite());
    let slope = from.map(|from| (log.cell_v[reached] - log.cell_v[from]).abs() / apart(from));
    slope.filter(|slope| slope.is_finite() && *slope > 0.0).unwrap_or(sheet.span_v())
}
