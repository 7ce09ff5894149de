//! Finds the current at which a wish at the terminals is met, whatever the effects do.

use super::{Mix, Terminals};

/// Newton steps before the patient search takes over; quadratic convergence needs about five.
const NEWTON_MAX: usize = 20;
/// Bound on halvings and secants within a bracket.
const CLOSING_MAX: usize = 300;
/// Each current that the patient search looks at, as a multiple of the one before.
const STEP: f64 = 1.02;
/// How many it looks at before it refuses, unless the voltage is gone before.
const GRID: usize = 1200;
/// A peak between two currents of the grid is looked for when the grid came this close, as a
/// share of what is wanted.
const WORTH_A_LOOK: f64 = 0.1;

/// The smallest current from which on the pack gives what is wished, on the side of no load;
/// none when there is no such current. The step with that current has been taken.
pub(super) fn meet<T: Terminals + ?Sized>(pack: &mut T, dt_s: f64, start_a: f64, mix: &Mix) -> Option<f64> {
    newton(pack, dt_s, start_a, mix).or_else(|| patient(pack, dt_s, mix))
}

/// Newton's iteration. On a concave curve it approaches the root from the no-load side. The
/// answer counts only where the power rises with the current.
fn newton<T: Terminals + ?Sized>(pack: &mut T, dt_s: f64, start_a: f64, mix: &Mix) -> Option<f64> {
    let excess = |pack: &mut T, current_a: f64| {
        let (voltage_v, power_w) = pack.trial(current_a, dt_s);
        mix.excess(voltage_v, power_w)
    };
    // Excess is counted in tolerances: within 1 is found.
    let mut current_a = start_a;
    let (mut slope, mut slope_at_a) = (None, start_a);
    let mut before = f64::INFINITY;
    for _ in 0..NEWTON_MAX {
        let here = excess(pack, current_a);
        let found = here.abs() <= 1.0;
        if found && current_a == 0.0 {
            return Some(0.0);
        }
        // Where the curve bends more, near the power limit, the slope is taken anew; elsewhere
        // it bends so little over one step that its first slope serves all iterations.
        if here.abs() > 0.1 * before.abs() || (found && (current_a - slope_at_a).abs() > 0.05 * (0.1 + current_a.abs())) {
            slope = None;
        }
        before = here;
        let fresh = slope.is_none();
        let rise = match slope {
            Some(rise) => rise,
            None => {
                let nudge_a = 1e-4 * (1.0 + current_a.abs());
                slope_at_a = current_a;
                (excess(pack, current_a + nudge_a) - here) / nudge_a
            }
        };
        slope = Some(rise);
        if !(rise > 0.0 && rise.is_finite()) {
            // Beyond the peak: the start may have been there. Once more from no load.
            if current_a == 0.0 || here <= 0.0 {
                return None;
            }
            (current_a, slope, before) = (0.0, None, f64::INFINITY);
            continue;
        }
        if found {
            if fresh {
                pack.trial(current_a, dt_s);
            }
            return Some(current_a);
        }
        current_a -= here / rise;
    }
    None
}

/// Brackets the first current at which the wish is met by looking at many, and closes in.
fn patient<T: Terminals + ?Sized>(pack: &mut T, dt_s: f64, mix: &Mix) -> Option<f64> {
    let mut at = |current_a: f64| {
        let (voltage_v, power_w) = pack.trial(current_a, dt_s);
        (mix.excess(voltage_v, power_w), voltage_v, power_w)
    };
    let (none, open_v, idle_w) = at(0.0);
    if none.abs() <= 1.0 {
        return Some(0.0);
    }
    let missing_a = (mix.power_w(open_v) - idle_w).abs() / open_v.abs().max(1e-3);
    if none > 0.0 {
        // A charge, or a load that is less than what a sensor's offset lets flow.
        let mut low_a = -missing_a;
        for _ in 0..100 {
            let low = at(low_a).0;
            if low <= 1.0 {
                return close(|a| at(a).0, (low_a, low), (0.0, none));
            }
            low_a *= 2.0;
        }
        return None;
    }
    // Where the voltage falls with the current, no current below that of the open-circuit voltage
    // is enough, and no point of the grid is less than 1 / STEP of a peak to the right of it. The
    // grid begins lower: parameters within their ranges may add up to a voltage that rises.
    let (mut before, mut last) = ((0.0, none), (0.0, none));
    let mut current_a = missing_a / 32.0;
    for _ in 0..GRID {
        let (here, voltage_v, _) = at(current_a);
        if here >= -1.0 {
            return close(|a| at(a).0, last, (current_a, here));
        }
        if last.1 >= before.1 && last.1 >= here && last.1 >= -WORTH_A_LOOK * mix.power_w(voltage_v).abs() / mix.tolerance_w(voltage_v) {
            let peak = highest(|a| at(a).0, before.0, current_a);
            if peak.1 >= -1.0 {
                return close(|a| at(a).0, before, peak);
            }
        }
        if voltage_v <= 0.0 && current_a >= missing_a {
            break;
        }
        (before, last) = (last, (current_a, here));
        current_a *= STEP;
    }
    None
}

/// The highest point between two currents, or the first that is high enough (golden section).
fn highest(mut at: impl FnMut(f64) -> f64, mut low_a: f64, mut high_a: f64) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let (mut left_a, mut right_a) = (high_a - GOLDEN * (high_a - low_a), low_a + GOLDEN * (high_a - low_a));
    let (mut left, mut right) = (at(left_a), at(right_a));
    for _ in 0..80 {
        if left.max(right) >= 0.0 || high_a - low_a <= 1e-9 * high_a.abs() {
            break;
        }
        if left >= right {
            (high_a, right_a, right) = (right_a, left_a, left);
            left_a = high_a - GOLDEN * (high_a - low_a);
            left = at(left_a);
        } else {
            (low_a, left_a, left) = (left_a, right_a, right);
            right_a = low_a + GOLDEN * (high_a - low_a);
            right = at(right_a);
        }
    }
    if left >= right { (left_a, left) } else { (right_a, right) }
}

/// Closes in on a root between a current with too little and one with enough, by secants
/// (Illinois) with a halving every third time. None when the bracket closes on a jump: then no
/// current gives what is wished. The step with the current returned was the last.
fn close(mut at: impl FnMut(f64) -> f64, mut low: (f64, f64), mut high: (f64, f64)) -> Option<f64> {
    for end in [low, high] {
        if end.1.abs() <= 1.0 {
            at(end.0);
            return Some(end.0);
        }
    }
    let mut side = 0;
    for round in 0..CLOSING_MAX {
        let secant_a = low.0 + low.1 / (low.1 - high.1) * (high.0 - low.0);
        let middle_a = f64::midpoint(low.0, high.0);
        let inside = secant_a > low.0 && secant_a < high.0 && round % 3 != 2;
        let current_a = if inside { secant_a } else { middle_a };
        let here = at(current_a);
        if here.abs() <= 1.0 {
            return Some(current_a);
        }
        if current_a <= low.0 || current_a >= high.0 {
            return None;
        }
        if here < 0.0 {
            low = (current_a, here);
            high.1 *= if side < 0 { 0.5 } else { 1.0 };
            side = -1;
        } else {
            high = (current_a, here);
            low.1 *= if side > 0 { 0.5 } else { 1.0 };
            side = 1;
        }
    }
    None
}
