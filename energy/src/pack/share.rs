//! How cells in parallel share a current: their voltages are equal.

use super::strand::Strand;
use crate::Channel;

/// Difference of voltage that the search leaves, V. Well below what anybody measures, because
/// searches at the terminals take slopes of this result.
const TOLERANCE_V: f64 = 1e-10;
/// Bound on iterations; the voltage is so nearly affine in the current that three are usual.
const ITERATIONS_MAX: usize = 60;
/// Bound on the pairs that are levelled where slopes mislead.
const LEVELLINGS_MAX: usize = 100;
/// Least slope that is believed, ohm: a cell without any resistance has none.
const SLOPE_MIN_OHM: f64 = 1e-6;

/// Steps strands in parallel by `dt_s` under a total current, A.
///
/// Newton's iteration on the N-1 free currents: with the slope `r_k` of each strand's voltage
/// over its current, the common voltage of the next guess is the mean of `v_k` weighted by
/// `1/r_k`, and each strand's current changes by `(v_k - V) / r_k`. A guess counts only if it
/// brings the voltages closer; otherwise slopes are measured anew, then the change is halved.
/// So the result is finite whatever the strands do, and the sum of currents is always the total.
pub(super) fn share(strands: &mut [Strand], total_a: f64, dt_s: f64) {
    for strand in strands.iter_mut() {
        strand.run.save();
        strand.accepted = (strand.run.channels[Channel::TerminalCurrentA], 0.0);
    }
    if strands.iter().any(|strand| strand.slope.1 != dt_s) {
        measure_slopes(strands, dt_s);
    }
    let flowing_a: f64 = strands.iter().map(|strand| strand.accepted.0).sum();
    let conductance: f64 = strands.iter().map(|strand| 1.0 / strand.slope.0).sum();
    for strand in strands.iter_mut() {
        strand.tried.0 = strand.accepted.0 + (total_a - flowing_a) / strand.slope.0 / conductance;
    }
    let mut spread_v = try_currents(strands, total_a, dt_s);
    accept(strands);
    let (mut length, mut measured) = (1.0, false);
    for _ in 0..ITERATIONS_MAX {
        if spread_v <= TOLERANCE_V || length < 1e-6 {
            break;
        }
        let conductance: f64 = strands.iter().map(|strand| 1.0 / strand.slope.0).sum();
        let common_v = strands.iter().map(|strand| strand.accepted.1 / strand.slope.0).sum::<f64>() / conductance;
        for strand in strands.iter_mut() {
            strand.tried.0 = strand.accepted.0 + length * (strand.accepted.1 - common_v) / strand.slope.0;
        }
        let tried_v = try_currents(strands, total_a, dt_s);
        if tried_v < spread_v {
            for strand in strands.iter_mut() {
                strand.learn_slope();
            }
            accept(strands);
            (spread_v, length, measured) = (tried_v, 1.0, false);
        } else if measured {
            length /= 2.0;
        } else {
            measure_slopes(strands, dt_s);
            measured = true;
        }
    }
    for _ in 0..LEVELLINGS_MAX {
        if spread_v <= TOLERANCE_V {
            break;
        }
        let levelled_v = level(strands, dt_s);
        if levelled_v >= spread_v {
            break;
        }
        spread_v = levelled_v;
    }
    if strands.iter().any(|strand| strand.run.channels[Channel::CurrentA] != strand.accepted.0) {
        for strand in strands.iter_mut() {
            strand.try_current(strand.accepted.0, dt_s);
        }
    }
}

/// Moves current from the strand of the lowest voltage to that of the highest until they are equal,
/// by halving: where a table's kink lies between two guesses, slopes lead past it again and again,
/// but a voltage still falls with its current. Returns how far apart all voltages then are, V.
fn level(strands: &mut [Strand], dt_s: f64) -> f64 {
    let by_voltage = |one: &usize, other: &usize| strands[*one].accepted.1.total_cmp(&strands[*other].accepted.1);
    let low = (0..strands.len()).min_by(by_voltage).expect("a group has cells");
    let high = (0..strands.len()).max_by(by_voltage).expect("a group has cells");
    let (low_a, high_a) = (strands[low].accepted.0, strands[high].accepted.0);
    let gap_v = strands[high].accepted.1 - strands[low].accepted.1;
    let mut left_v = |moved_a: f64| {
        let low_v = strands[low].try_current(low_a - moved_a, dt_s);
        let high_v = strands[high].try_current(high_a + moved_a, dt_s);
        (low_v, high_v)
    };
    // Too little and too much.
    let mut bracket_a = (0.0, gap_v / SLOPE_MIN_OHM);
    let mut best = (gap_v, 0.0, left_v(0.0));
    // Halved on a scale of ratios first, since the greatest change is far beyond any sensible one.
    let scale_a = 1.0 + low_a.abs() + high_a.abs();
    let mut try_a = 1e-6 * scale_a;
    while bracket_a.0 == 0.0 || bracket_a.1 - bracket_a.0 > f64::EPSILON * bracket_a.1 {
        let (low_v, high_v) = left_v(try_a);
        if (high_v - low_v).abs() < best.0 {
            best = ((high_v - low_v).abs(), try_a, (low_v, high_v));
        }
        if best.0 <= TOLERANCE_V || try_a < f64::EPSILON * scale_a {
            break;
        }
        if high_v > low_v {
            bracket_a.0 = try_a;
        } else {
            bracket_a.1 = try_a;
        }
        let far = bracket_a.1 > 4.0 * bracket_a.0;
        let between_a = if far { 2.0 * bracket_a.0 } else { f64::midpoint(bracket_a.0, bracket_a.1) };
        try_a = if bracket_a.0 == 0.0 { try_a / 16.0 } else { between_a };
    }
    let (_, moved_a, (low_v, high_v)) = best;
    strands[low].accepted = (low_a - moved_a, low_v);
    strands[high].accepted = (high_a + moved_a, high_v);
    let voltages = || strands.iter().map(|strand| strand.accepted.1);
    voltages().fold(f64::NEG_INFINITY, f64::max) - voltages().fold(f64::INFINITY, f64::min)
}

/// Steps all from the kept state with the currents to be tried, the last of which takes what
/// rounding left, and returns how far apart their voltages are, V.
fn try_currents(strands: &mut [Strand], total_a: f64, dt_s: f64) -> f64 {
    let (last, others) = strands.split_last_mut().expect("a group has cells");
    last.tried.0 = total_a - others.iter().map(|strand| strand.tried.0).sum::<f64>();
    let (mut low_v, mut high_v) = (f64::INFINITY, f64::NEG_INFINITY);
    for strand in strands {
        strand.tried.1 = strand.try_current(strand.tried.0, dt_s);
        (low_v, high_v) = (low_v.min(strand.tried.1), high_v.max(strand.tried.1));
    }
    high_v - low_v
}

fn accept(strands: &mut [Strand]) {
    for strand in strands {
        strand.accepted = strand.tried;
    }
}

fn measure_slopes(strands: &mut [Strand], dt_s: f64) {
    for strand in strands {
        let nudge_a = 1e-3 * (1.0 + strand.accepted.0.abs());
        let here_v = strand.try_current(strand.accepted.0, dt_s);
        let there_v = strand.try_current(strand.accepted.0 + nudge_a, dt_s);
        strand.slope = (((here_v - there_v) / nudge_a).max(SLOPE_MIN_OHM), dt_s);
    }
}

impl Strand {
    fn try_current(&mut self, current_a: f64, dt_s: f64) -> f64 {
        self.run.restore();
        self.run.channels[Channel::CurrentA] = current_a;
        self.run.step(dt_s);
        self.run.channels[Channel::TerminalVoltageV]
    }

    /// Takes the slope between the last accepted point and the one just tried.
    fn learn_slope(&mut self) {
        let change_a = self.tried.0 - self.accepted.0;
        if change_a.abs() > 1e-6 * (1.0 + self.tried.0.abs()) {
            let slope_ohm = (self.accepted.1 - self.tried.1) / change_a;
            if slope_ohm >= SLOPE_MIN_OHM {
                self.slope.0 = slope_ohm;
            }
        }
    }
}
