//! What the readings of a voltage say of their own noise.

use super::Sheet;
use super::counted::Counted;

/// A median of sizes is so many deviations of a Gauss curve.
const MEDIAN: f64 = 0.6745;
/// Three readings of which the middle one is taken twice and negative: their noise adds up to so many deviations.
const BENT: f64 = 2.449_489_742_783_178;
/// What is less is how numbers are kept, V.
const DIGITS_V: f64 = 1e-7;
/// Readings that are looked at in one log.
const LOOKED_AT: usize = 20_000;

/// Noise of a pack's voltage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Noise {
    /// Standard deviation of one reading, V.
    pub sigma_v: f64,
    /// The least by which two readings differ, V; 0 where none do.
    pub quantum_v: f64,
}

impl Noise {
    /// Of one cell, V, with what its digits leave open.
    pub(super) fn per_cell(&self, sheet: &Sheet) -> f64 {
        self.sigma_v.hypot(self.quantum_v / 12.0_f64.sqrt()) / f64::from(sheet.series)
    }
}

/// Three readings in a row, of one current and at equal times, lie on a line but for their noise.
pub(super) fn noise(logs: &[Counted<'_>], sheet: &Sheet) -> Noise {
    let (mut bends, mut least_v) = (Vec::new(), f64::INFINITY);
    for log in logs {
        let (time_s, volts, amps) = (log.time_s(), &log.cell_v, &log.current_a);
        let every = volts.len().div_ceil(LOOKED_AT);
        for row in (2..volts.len()).step_by(every) {
            let (before_s, after_s) = (time_s[row - 1] - time_s[row - 2], time_s[row] - time_s[row - 1]);
            let even = (before_s - after_s).abs() <= 0.05 * after_s;
            let steady = (amps[row] - amps[row - 1]).abs() <= 0.01 * amps[row].abs()
                && (amps[row - 1] - amps[row - 2]).abs() <= 0.01 * amps[row].abs();
            let bend = volts[row] - 2.0 * volts[row - 1] + volts[row - 2];
            if even && steady && bend.is_finite() {
                bends.push(bend.abs());
            }
            let step = (volts[row] - volts[row - 1]).abs();
            if step > DIGITS_V {
                least_v = least_v.min(step);
            }
        }
    }
    let cells = f64::from(sheet.series);
    bends.sort_by(f64::total_cmp);
    let sigma_v = bends.get(bends.len() / 2).map_or(0.0, |middle| middle / MEDIAN / BENT * cells);
    let quantum_v = if least_v.is_finite() { least_v * cells } else { 0.0 };
    Noise { sigma_v, quantum_v }
}
