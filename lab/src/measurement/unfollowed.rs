//! Currents of one row that the voltage knows nothing of. A current may well last one row, so a spike
//! of it alone says nothing; but a voltage that follows every other step and not this one says that
//! nothing flowed. One such row bends every resistance that is fitted.

use energy::Channel;

use super::values::{at, count, plain};

/// What a voltage moves by itself, in its usual differences while the current holds: four deviations
/// of the difference of two readings.
const BY_ITSELF: f64 = 6.0;
/// Moves that a step must promise, in those, to be missed where there is none.
const PROMISED: f64 = 3.0;
/// Steps that the voltage must follow to say that it does.
const FOLLOWED: usize = 2;
/// What a current may lie beside the one before a spike, as a share of the spike, to be back.
const BACK: f64 = 0.2;

/// What is to be said about currents of single rows that the voltage does not follow.
pub(super) fn unfollowed(
    (channel, current_a): (Channel, &[f64]),
    (beside, voltage_v): (Channel, &[f64]),
    lines: &[u64],
    places: &str,
) -> Option<String> {
    let step = |values: &[f64], row: usize| values[row] - values[row - 1];
    let rows = || (1..current_a.len()).filter(|&row| step(current_a, row).is_finite() && step(voltage_v, row).is_finite());
    let moved = |steady: bool| usual(rows().filter(|&row| !steady || step(current_a, row) == 0.0).map(|row| step(voltage_v, row).abs()));
    let by_itself_v = BY_ITSELF * moved(true).or_else(|| moved(false))?;
    let spike = |row: usize| {
        let (up, down) = (step(current_a, row), step(current_a, row + 1));
        let least = up.abs().min(down.abs());
        (up * down < 0.0 && (up + down).abs() <= BACK * least).then_some(least)
    };
    // Late by a row is followed, too.
    let still = |row: usize| {
        let around = &voltage_v[row - 1..voltage_v.len().min(row + 3)];
        around.iter().all(|value| (value - around[0]).abs() <= by_itself_v)
    };
    let alone: Vec<(usize, f64)> =
        (1..current_a.len().saturating_sub(1)).filter(|&row| still(row)).filter_map(|row| Some((row, spike(row)?))).collect();
    let beside_a_spike = |row: usize| alone.binary_search_by_key(&row, |(spike, _)| *spike).is_ok();
    let steps = rows().filter(|&row| step(current_a, row) != 0.0 && !beside_a_spike(row) && !beside_a_spike(row - 1));
    let steps: Vec<(f64, f64)> = steps.map(|row| (step(current_a, row), step(voltage_v, row))).collect();
    // By least squares, in which the large steps count and noise at small ones does not.
    let (of_both, of_current) =
        steps.iter().fold((0.0, 0.0), |(both, own), (step_a, step_v)| (both + step_a * step_v, own + step_a * step_a));
    let ohm = f64::abs(of_both / of_current);
    let promises = |size_a: f64| ohm * size_a > PROMISED * by_itself_v;
    let (followed, not): (Vec<_>, Vec<_>) =
        steps.iter().filter(|(step_a, _)| promises(step_a.abs())).partition(|(_, step_v)| step_v.abs() > by_itself_v);
    if followed.len() < FOLLOWED || followed.len() < not.len() {
        return None;
    }
    let least_a = followed.iter().map(|(step_a, _)| step_a.abs()).fold(f64::INFINITY, f64::min);
    let missed = alone.iter().filter(|(_, size_a)| *size_a >= least_a && promises(*size_a));
    let missed: Vec<usize> = missed.map(|(row, _)| *row).collect();
    let first = *missed.first()?;
    Some(format!(
        "`{}`: {} far from both neighbours while `{}` stays where it is, which follows smaller steps, such as {} after {}; not removed, and a \
         fit takes it for true ({})",
        channel.name(),
        count(missed.len(), "single value"),
        beside.name(),
        plain(current_a[first]),
        plain(current_a[first - 1]),
        at(&missed, lines, places)
    ))
}

/// The median of what is not zero: of readings that a sensor rounds, its step. None of few.
fn usual(sizes: impl Iterator<Item = f64>) -> Option<f64> {
    let mut sizes: Vec<f64> = sizes.filter(|size| *size > 0.0).collect();
    let middle = sizes.len() / 2;
    (sizes.len() >= FOLLOWED).then(|| *sizes.select_nth_unstable_by(middle, f64::total_cmp).1)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Blocks of 20 rows at 0 and 2 A over 50 mOhm, with noise of about a millivolt, and 50 A in row 110; `follows` says
    /// whether the voltage shows blocks, and whether it shows the spike.
    fn told(follows: (bool, bool)) -> Option<String> {
        let current = |row: usize| if row == 110 { 50.0 } else { 2.0 * (row / 20 % 2) as f64 };
        let current_a: Vec<f64> = (0..200).map(current).collect();
        let noise_v = |row: usize| 1e-3 * ((row * 7919 % 13) as f64 / 6.0 - 1.0);
        let shown = |row: usize| if row == 110 { follows.1 } else { follows.0 };
        let block_a = |row: usize| {
            if shown(row) {
                current_a[row]
            } else if follows.0 {
                current_a[row - 1]
            } else {
                0.0
            }
        };
        let voltage_v: Vec<f64> = (0..200).map(|row| 4.0 - 0.05 * block_a(row) + noise_v(row)).collect();
        let lines: Vec<u64> = (2..202).collect();
        unfollowed((Channel::CurrentA, &current_a), (Channel::VoltageV, &voltage_v), &lines, "lines")
    }

    #[test]
    fn a_current_of_one_row_that_the_voltage_does_not_follow_is_told() {
        let note = "`current_a`: 1 single value far from both neighbours while `voltage_v` stays where it is, which follows smaller steps, \
                    such as 50 after 2; not removed, and a fit takes it for true (line 112)";
        assert_eq!(told((true, false)).as_deref(), Some(note));
    }

    #[test]
    fn a_current_that_the_voltage_follows_or_that_it_never_follows_is_not() {
        assert_eq!(told((true, true)), None);
        assert_eq!(told((false, false)), None);
    }
}
