//! What the readings of a voltage say of their own noise.

use super::Sheet;
use super::counted::Counted;
use crate::residual::bends;
use crate::rounding::{floor_between, step_of};

/// Readings that are looked at in one log, about.
const LOOKED_AT: usize = 20_000;
/// They are looked at so many in a row.
const STRETCH: usize = 200;
/// Times between readings are equal within this share.
const EVEN: f64 = 0.05;
/// A current is the same within this share.
const SAME: f64 = 0.01;

/// Noise of a pack's voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation of one reading before it is rounded, V.
    pub sigma_v: f64,
    /// The step to which readings are rounded, V; 0 where they are not visibly.
    pub quantum_v: f64,
}

impl Noise {
    /// Of one cell, V, with what its digits leave open.
    pub(super) fn per_cell(&self, sheet: &Sheet) -> f64 {
        self.sigma_v.hypot(self.quantum_v / 12.0_f64.sqrt()) / f64::from(sheet.series)
    }
}

/// Three readings in a row, of one current and at equal times, lie on a line but for their noise and what they are rounded by. A model says
/// both, and a reading is then as uncertain as their squares add up to: noise is what is left of that when rounding is taken off.
pub(super) fn noise(logs: &[Counted<'_>], sheet: &Sheet) -> Noise {
    let (mut squares, mut triples, mut quantum_v) = (0.0, 0.0, 0.0_f64);
    for log in logs {
        let (rows, volts) = undisturbed(log);
        // A log in which no three readings are alike says nothing.
        let count = bends(&rows, &volts).count() as f64;
        let step_v = step_of(&volts).unwrap_or(0.0);
        squares += count * (floor_between(&rows, &volts).powi(2) - step_v.powi(2) / 12.0).max(0.0);
        triples += count;
        // Of instruments with unlike digits the coarsest is stated.
        quantum_v = quantum_v.max(step_v);
    }
    let cells = f64::from(sheet.series);
    Noise { sigma_v: cells * (squares / f64::max(triples, 1.0)).sqrt(), quantum_v: cells * quantum_v }
}

/// Readings of a log and their rows, which are numbered on where the current or the time between them changes.
fn undisturbed(log: &Counted<'_>) -> (Vec<usize>, Vec<f64>) {
    let (time_s, level_a) = (log.time_s(), &log.level_a);
    let every = level_a.len().div_ceil(LOOKED_AT);
    let (mut rows, mut volts, mut breaks) = (Vec::new(), Vec::new(), 0);
    for row in 1..level_a.len() {
        let after_s = time_s[row] - time_s[row - 1];
        let even = row == 1 || (after_s - (time_s[row - 1] - time_s[row - 2])).abs() <= EVEN * after_s;
        let same = (level_a[row] - level_a[row - 1]).abs() <= (SAME * level_a[row].abs()).max(log.none_a);
        breaks += usize::from(!even || !same);
        if (row / STRETCH).is_multiple_of(every) && log.cell_v[row].is_finite() {
            rows.push(row + breaks);
            volts.push(log.cell_v[row]);
        }
    }
    (rows, volts)
}
