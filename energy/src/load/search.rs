//! Finds the current at which a wish at the terminals is met, whatever the effects do.

use super::{Mix, Terminals};

/// Newton steps before the patient search takes over; quadratic convergence needs about five.
const NEWTON_MAX: usize = 20;
/// Bound on halvings and secants within a bracket.
const CLOSING_MAX: usize = 300;
/// Currents that the patient search looks at before it refuses.
const GRID: usize = 256;
/// Parts into which the neighbourhood of a peak is divided before it is closed in on.
const PARTS: usize = 16;
/// Bound on doublings and halvings of the highest current of interest.
const DOUBLINGS_MAX: usize = 100;

/// A current at which the power rises through what is wished, the nearest to no load when a
/// search has to be made; none when there is no such current. The step with that current has been taken.
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

/// Looks outward from no load for the first current at which the power rises through the wish:
/// first on the side where it lies on a plain curve, then on the other. A sensor's dead band
/// may let more flow at no load than at some currents that it shows.
fn patient<T: Terminals + ?Sized>(pack: &mut T, dt_s: f64, mix: &Mix) -> Option<f64> {
    let (open_v, idle_w) = pack.trial(0.0, dt_s);
    let none = mix.excess(open_v, idle_w);
    if none.abs() <= 1.0 {
        return Some(0.0);
    }
    let scale_a = 2.0 * (mix.power_w(open_v).abs() + idle_w.abs()) / open_v.abs().max(1e-3);
    let likely = if none < 0.0 { 1.0 } else { -1.0 };
    [likely, -likely].into_iter().find_map(|side| {
        let high_a = farthest(pack, dt_s, mix, side * scale_a).abs();
        // The charge side is turned around, so that on both the wish is met from below.
        let at = |size_a: f64| {
            let (voltage_v, power_w) = pack.trial(side * size_a, dt_s);
            side * mix.excess(voltage_v, power_w)
        };
        walk(at, high_a).map(|size_a| side * size_a)
    })
}

/// The current farthest from no load that is of interest, beginning from a guess. A discharge
/// ends where it gives enough, or where the voltage is gone: then not far beyond that. A charge
/// ends where more flows in than is wished. Reversed or lagging, a pack may still give power
/// while its sensor shows a charge.
fn farthest<T: Terminals + ?Sized>(pack: &mut T, dt_s: f64, mix: &Mix, guess_a: f64) -> f64 {
    let mut far_a = guess_a;
    for _ in 0..DOUBLINGS_MAX {
        let (voltage_v, power_w) = pack.trial(far_a, dt_s);
        let excess = mix.excess(voltage_v, power_w);
        let ends = if far_a > 0.0 { excess >= 0.0 || voltage_v <= 0.0 } else { excess <= 0.0 && voltage_v > 0.0 && power_w < 0.0 };
        if ends {
            break;
        }
        far_a *= 2.0;
    }
    for _ in 0..DOUBLINGS_MAX {
        if far_a < 0.0 || pack.trial(0.5 * far_a, dt_s).0 > 0.0 {
            break;
        }
        far_a *= 0.5;
    }
    far_a
}

/// The first root met from below between no load and a current, by looking at many.
fn walk(mut at: impl FnMut(f64) -> f64, high_a: f64) -> Option<f64> {
    // Denser towards no load: a voltage that falls steeply at first has its peak there.
    let grid_a = |point: usize| high_a * (point as f64 / GRID as f64).powi(2);
    let mut last = (0.0, at(0.0));
    let mut before = last;
    for point in 1..=GRID {
        let here = (grid_a(point), at(grid_a(point)));
        // A peak or a dip between points may reach what no point does.
        if last.1 < 0.0 && here.1 < 0.0 && last.1 > before.1 && last.1 >= here.1 {
            let peak = highest(&mut at, before.0, here.0);
            if peak.1 >= -1.0
                && let Some(found_a) = close(&mut at, before, peak)
            {
                return Some(found_a);
            }
        } else if last.1 > 0.0 && here.1 > 0.0 && last.1 < before.1 && last.1 <= here.1 {
            let dip = highest(|a| -at(a), before.0, here.0);
            if dip.1 >= -1.0
                && let Some(found_a) = close(&mut at, (dip.0, -dip.1), here)
            {
                return Some(found_a);
            }
        }
        // Where a bracket closes on a jump, a root may still lie beyond.
        if last.1 < 0.0
            && here.1 >= -1.0
            && let Some(found_a) = close(&mut at, last, here)
        {
            return Some(found_a);
        }
        (before, last) = (last, here);
    }
    None
}

/// The highest point between two currents, or the first that is high enough: golden section
/// around the best of a few, for a jump hides the peak from the golden section alone.
fn highest(mut at: impl FnMut(f64) -> f64, from_a: f64, to_a: f64) -> (f64, f64) {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    let part_a = (to_a - from_a) / PARTS as f64;
    let mut best = (from_a, f64::NEG_INFINITY);
    for point in 0..=PARTS {
        let current_a = from_a + part_a * point as f64;
        let here = at(current_a);
        if here >= 0.0 {
            return (current_a, here);
        }
        if here > best.1 {
            best = (current_a, here);
        }
    }
    let (mut low_a, mut high_a) = ((best.0 - part_a).max(from_a), (best.0 + part_a).min(to_a));
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
    for end in [(left_a, left), (right_a, right)] {
        if end.1 > best.1 {
            best = end;
        }
    }
    best
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
