//! A log as charge drawn and voltage of one cell.

use energy::Channel;
use energy::units::H_PER_S;

use super::{OcvError, Sheet};
use crate::measurement::Log;
use crate::prepare::held;

/// Beyond full and end, a cell's voltage may go by this share of what lies between them: it is charged or
/// drawn from too far, but it is this cell.
const BEYOND: f64 = 0.35;

/// A log with its charge counted.
pub(super) struct Counted<'a> {
    pub(super) log: &'a Log,
    /// Current of every row, A: that which flowed since the row before.
    pub(super) current_a: Vec<f64>,
    /// Voltage of one cell, V; NaN where it was not read.
    pub(super) cell_v: Vec<f64>,
    /// Charge drawn since the first row, Ah.
    pub(super) drawn_ah: Vec<f64>,
    /// Charge that went in or out since the first row, Ah.
    pub(super) moved_ah: Vec<f64>,
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
        let cell_v: Vec<f64> = voltage_v.iter().map(|volts| volts / f64::from(sheet.series)).collect();
        let read = || cell_v.iter().copied().filter(|volts| volts.is_finite());
        let (low_v, high_v) = (read().fold(f64::INFINITY, f64::min), read().fold(f64::NEG_INFINITY, f64::max));
        let beyond_v = BEYOND * sheet.span_v();
        // A log may end at less than full and begin at more than empty, but it passes through what lies between.
        let overlaps = low_v < sheet.full_v_per_cell + beyond_v && high_v > sheet.eod_v_per_cell;
        if !overlaps || high_v > sheet.full_v_per_cell + beyond_v {
            let (eod_v, full_v) = (sheet.eod_v_per_cell, sheet.full_v_per_cell);
            return Err(OcvError::OtherCells { file: log.file.clone(), low_v, high_v, series: sheet.series, eod_v, full_v });
        }
        let (mut drawn_ah, mut moved_ah) = (vec![0.0; log.rows()], vec![0.0; log.rows()]);
        for row in 1..log.rows() {
            let flowed_ah = current_a[row] * (log.time_s[row] - log.time_s[row - 1]) * H_PER_S;
            drawn_ah[row] = drawn_ah[row - 1] + flowed_ah;
            moved_ah[row] = moved_ah[row - 1] + flowed_ah.abs();
        }
        Ok(Counted { log, current_a, cell_v, drawn_ah, moved_ah })
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
        let last = |current_a: &f64| {
            charged = if *current_a == 0.0 { charged } else { *current_a < 0.0 };
            charged
        };
        self.current_a.iter().map(last).collect()
    }

    /// Runs of rows of which this is true, as ranges; a run's current flowed from the row before its first.
    pub(super) fn runs(&self, belongs: impl Fn(f64) -> bool) -> Vec<std::ops::Range<usize>> {
        let mut runs = Vec::new();
        let mut from = None;
        for row in 1..=self.current_a.len() {
            let is_in = self.current_a.get(row).is_some_and(|&current_a| belongs(current_a));
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
