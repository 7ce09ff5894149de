//! A log as charge drawn and voltage of one cell.

use energy::Channel;
use energy::units::H_PER_S;

use super::level::{levels, scatter};
use super::shown::REST_S;
use super::{OcvError, Sheet};
use crate::measurement::Log;
use crate::prepare::held;
use crate::report::quantity::quantity;

/// Beyond full and end, a cell's voltage may go by this share of what lies between them: it is charged or
/// drawn from too far, but it is this cell.
const BEYOND: f64 = 0.35;
/// A current that is none for all that is known, as a share of the capacity an hour: no test is as slow, and it costs less than a
/// millivolt. What an ammeter reads at rest is what it is off by. A guess.
const NONE_PER_HOUR: f64 = 5e-3;
/// An ammeter is hardly off by more than this share of the capacity an hour: where the least that it reads is more, something flows. A guess.
const OFF_PER_HOUR: f64 = 0.01;
/// A current whose readings scatter by more than this share of the capacity an hour, even where they are quiet, moves by itself: they are
/// taken as they are. A guess: ammeters of packs are good to a hundredth of what they measure up to, which is a few capacities an hour.
const MOVES_PER_HOUR: f64 = 0.05;

/// What ammeters have to do with an answer that there is not, to go on with a sentence.
pub(super) fn because(logs: &[Counted<'_>]) -> String {
    logs.iter().filter_map(|log| log.scattered().or_else(|| log.never_rests())).map(|why| format!(". {why}")).collect()
}

/// Share of what lies between full and end that a log's voltage passes which goes from one to the other.
const WHOLE: f64 = 0.7;

/// Why no log says what the battery holds, to go on with a sentence: gaps, and what was counted over those that seem to go all the way.
pub(super) fn why_no_capacity(logs: &[Counted<'_>], sheet: &Sheet) -> String {
    let of = |log: &Counted<'_>| {
        let read = || log.cell_v.iter().copied().enumerate().filter(|(_, volts)| volts.is_finite());
        let (from, to) = (read().next()?, read().next_back()?);
        if (from.1 - to.1).abs() < WHOLE * sheet.span_v() {
            return None;
        }
        let counted_ah = log.drawn_ah[to.0] - log.drawn_ah[from.0];
        let hours = (log.time_s()[to.0] - log.time_s()[from.0]) * H_PER_S;
        let per_hour = counted_ah.abs() / log.range_ah().max(f64::MIN_POSITIVE) / hours;
        let discharged = from.1 > to.1;
        let sign = if (counted_ah > 0.0) == discharged { "" } else { "the sign right (positive out of the battery), is " };
        Some(format!(
            ". {} goes from {:.2} to {:.2} V a cell, and its current counts {} out of the battery over that, in {}: is {sign}current_a in A, and time_s in s?{}",
            log.log.file,
            from.1,
            to.1,
            quantity(counted_ah, "Ah"),
            quantity(hours, "h"),
            if per_hour > SLOW_PER_HOUR && sign.is_empty() { " It may be too fast" } else { "" }
        ))
    };
    logs.iter().filter_map(of).collect::<String>() + &because(logs)
}

/// A passage that takes less time than five hours is too fast to say what a battery holds, unless it begins and ends at rest.
const SLOW_PER_HOUR: f64 = 0.2;

/// A log with its charge counted.
pub(super) struct Counted<'a> {
    pub(super) log: &'a Log,
    /// Current of every row, A: that which flowed since the row before.
    pub(super) current_a: Vec<f64>,
    /// The same without the noise of its readings.
    pub(super) level_a: Vec<f64>,
    /// A level that counts as none, A.
    pub(super) none_a: f64,
    /// By how much the current scatters from row to row, A.
    pub(super) scatter_a: f64,
    /// Voltage of one cell, V; NaN where it was not read.
    pub(super) cell_v: Vec<f64>,
    /// Charge drawn since the first row, Ah.
    pub(super) drawn_ah: Vec<f64>,
    /// Charge that went in or out since the first row, Ah.
    pub(super) moved_ah: Vec<f64>,
    /// Variance of what was drawn since the first row by the noise of the current, Ah².
    pub(super) drawn_variance_ah2: Vec<f64>,
}

impl<'a> Counted<'a> {
    pub(super) fn of(log: &'a Log, sheet: &Sheet) -> Result<Counted<'a>, OcvError> {
        let channel = |channel: Channel| {
            let values = log.channels.get(&channel).and_then(|values| Some((values, held(values)?)));
            let missing = || OcvError::NoChannel {
                file: log.file.clone(),
                channel: channel.name(),
                columns: log.columns().collect::<Vec<_>>().join(", "),
            };
            values.ok_or_else(missing)
        };
        let (_, current_a) = channel(Channel::CurrentA)?;
        let (voltage_v, _) = channel(Channel::VoltageV)?;
        // What was before the log is forgotten only after a while, where that is stated.
        let settled_s = log.facts.settling_s.map_or(f64::NEG_INFINITY, |settling_s| log.time_s[0] + settling_s);
        let counts = |row: usize| log.compares(row) && log.time_s[row] >= settled_s;
        let per_cell = |(row, volts): (usize, &f64)| if counts(row) { volts / f64::from(sheet.series) } else { f64::NAN };
        let cell_v: Vec<f64> = voltage_v.iter().enumerate().map(per_cell).collect();
        let read = || cell_v.iter().copied().filter(|volts| volts.is_finite());
        let (low_v, high_v) = (read().fold(f64::INFINITY, f64::min), read().fold(f64::NEG_INFINITY, f64::max));
        let beyond_v = BEYOND * sheet.span_v();
        // A log may end at less than full and begin at more than empty, but it passes through what lies between.
        let overlaps = low_v < sheet.full_v_per_cell + beyond_v && high_v > sheet.eod_v_per_cell;
        if !overlaps || high_v > sheet.full_v_per_cell + beyond_v {
            let (eod_v, full_v) = (sheet.eod_v_per_cell, sheet.full_v_per_cell);
            return Err(OcvError::OtherCells { file: log.file.clone(), low_v, high_v, series: sheet.series, eod_v, full_v });
        }
        let mut drawn_ah = vec![0.0; log.rows()];
        for row in 1..log.rows() {
            drawn_ah[row] = drawn_ah[row - 1] + current_a[row] * (log.time_s[row] - log.time_s[row - 1]) * H_PER_S;
        }
        let scatter_a = scatter(&current_a);
        let (level_a, zeros) = (Vec::new(), vec![0.0; log.rows()]);
        Ok(Counted {
            log,
            current_a,
            level_a,
            none_a: 0.0,
            scatter_a,
            cell_v,
            drawn_ah,
            moved_ah: zeros.clone(),
            drawn_variance_ah2: zeros,
        })
    }

    /// Tells what flows, and what does not, of a battery of about this capacity.
    pub(super) fn told(mut self, nominal_ah: f64) -> Counted<'a> {
        self.none_a = NONE_PER_HOUR * nominal_ah;
        let noise_a = if self.moves(nominal_ah) { 0.0 } else { self.scatter_a };
        self.level_a = levels(&self.current_a, noise_a);
        for row in 1..self.level_a.len() {
            let hours = (self.time_s()[row] - self.time_s()[row - 1]) * H_PER_S;
            self.moved_ah[row] = self.moved_ah[row - 1] + (self.level_a[row] * hours).abs();
            self.drawn_variance_ah2[row] = self.drawn_variance_ah2[row - 1] + (noise_a * hours).powi(2);
        }
        self
    }

    /// Whether the current moves from row to row by more than an ammeter's noise.
    fn moves(&self, nominal_ah: f64) -> bool {
        self.scatter_a > MOVES_PER_HOUR * nominal_ah
    }

    /// Whether nothing flows in a row, for all that is known.
    pub(super) fn rests(&self, row: usize) -> bool {
        self.level_a[row].abs() <= self.none_a
    }

    /// How long the current of a run flowed, s.
    pub(super) fn length_s(&self, run: &std::ops::Range<usize>) -> f64 {
        self.time_s()[run.end - 1] - self.time_s()[run.start - 1]
    }

    /// That single readings of the current tell nothing, in words, where that is so.
    fn scattered(&self) -> Option<String> {
        let (file, scatter) = (&self.log.file, quantity(self.scatter_a, "A"));
        let moves = self.moves(self.none_a / NONE_PER_HOUR);
        moves.then(|| format!("The current of {file} scatters by {scatter} from row to row, by its ammeter or by itself: neither rests nor steady currents show in it"))
    }

    /// That the ammeter may be off by so much that rests do not show, in words, where that is so.
    pub(super) fn never_rests(&self) -> Option<String> {
        let least_a = |within_a: f64| {
            let runs = self.runs(move |level_a| level_a.abs() <= within_a).into_iter().filter(|run| self.length_s(run) >= REST_S);
            let drawn_ah = |run: &std::ops::Range<usize>| self.drawn_ah[run.end - 1] - self.drawn_ah[run.start - 1];
            runs.map(|run| drawn_ah(&run).abs() / (self.length_s(&run) * H_PER_S)).min_by(f64::total_cmp)
        };
        let off_a = self.none_a * OFF_PER_HOUR / NONE_PER_HOUR;
        let least_a = least_a(off_a).filter(|_| least_a(self.none_a).is_none())?;
        let reads = quantity(least_a, "A");
        Some(format!(
            "{} has no rest, and its current is {reads} where it is least: is its ammeter off by that, or was that a load?",
            self.log.file
        ))
    }

    /// Deviation of what was drawn between two rows by the noise of the current, Ah.
    pub(super) fn noise_ah(&self, from: usize, to: usize) -> f64 {
        (self.drawn_variance_ah2[to] - self.drawn_variance_ah2[from]).abs().sqrt()
    }

    pub(super) fn time_s(&self) -> &[f64] {
        &self.log.time_s
    }

    /// What lies between the most and the least that was drawn, Ah.
    pub(super) fn range_ah(&self) -> f64 {
        let (low, high) = self.drawn_ah.iter().fold((0.0_f64, 0.0_f64), |(low, high), &ah| (low.min(ah), high.max(ah)));
        high - low
    }

    /// Whether the last charge that flowed went in, by row.
    pub(super) fn went_in(&self) -> Vec<bool> {
        let mut charged = false;
        let last = |row: usize| {
            charged = if self.rests(row) { charged } else { self.level_a[row] < 0.0 };
            charged
        };
        (0..self.level_a.len()).map(last).collect()
    }

    /// Runs of rows of whose level this is true, as ranges; a run's current flowed from the row before its first.
    pub(super) fn runs(&self, belongs: impl Fn(f64) -> bool) -> Vec<std::ops::Range<usize>> {
        let mut runs = Vec::new();
        let mut from = None;
        for row in 1..=self.level_a.len() {
            let is_in = self.level_a.get(row).is_some_and(|&level_a| belongs(level_a));
            match (from, is_in) {
                (None, true) => from = Some(row),
                (Some(first), false) => {
                    runs.push(first..row);
                    from = None;
                }
                _ => {}
            }
        }
        runs
    }
}
