//! Currents of a row or a few that the voltage knows nothing of. A current may well last so long, so a spike
//! of it alone says nothing; but a voltage that follows every other step and not this one says that
//! nothing flowed. One such row bends every resistance that is fitted.

use energy::Channel;

use super::spikes::{BACK, RUN_ROWS};
use super::values::{at, count, plain};

/// What a voltage moves by itself, in its usual differences while the current holds: four deviations
/// of the difference of two readings.
const BY_ITSELF: f64 = 6.0;
/// Moves that a step must promise, in those, to be missed where there is none.
const PROMISED: f64 = 3.0;
/// Steps that the voltage must follow to say that it does.
const FOLLOWED: usize = 2;

/// A current that leaves the ones before and after it.
struct Spike {
    first: usize,
    last: usize,
    size_a: f64,
}

/// What is to be said about currents of single rows, and of a few, that the voltage does not follow.
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
    // Late by a row is followed, too.
    let still = |first: usize, last: usize| {
        let around = &voltage_v[first - 1..voltage_v.len().min(last + 3)];
        around.iter().all(|value| (value - around[0]).abs() <= by_itself_v)
    };
    let spike = |first: usize| {
        let up = step(current_a, first);
        for last in first..(first + RUN_ROWS).min(current_a.len() - 1) {
            let down = step(current_a, last + 1);
            let least = up.abs().min(down.abs());
            if up * down < 0.0 && (up + down).abs() <= BACK * least {
                return still(first, last).then_some(Spike { first, last, size_a: least });
            }
            // It holds until then.
            if down.is_nan() || down.abs() > BACK * up.abs() {
                return None;
            }
        }
        None
    };
    let alone: Vec<Spike> = (1..current_a.len().saturating_sub(1)).filter(|&row| step(current_a, row) != 0.0).filter_map(spike).collect();
    // Where a spike begins and where it ends.
    let mut edges: Vec<usize> = alone.iter().flat_map(|spike| [spike.first, spike.last + 1]).collect();
    edges.sort_unstable();
    let steps = rows().filter(|&row| step(current_a, row) != 0.0 && edges.binary_search(&row).is_err());
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
    let missed: Vec<&Spike> = alone.iter().filter(|spike| spike.size_a >= least_a && promises(spike.size_a)).collect();
    let first = missed.first()?.first;
    let most = missed.iter().map(|spike| spike.last - spike.first + 1).max().unwrap_or(1);
    let what = match most {
        1 => format!("{} far from both neighbours", count(missed.len(), "single value")),
        _ => format!("{} of up to {most} rows far from the rows before and after", count(missed.len(), "run")),
    };
    let rows: Vec<usize> = missed.iter().map(|spike| spike.first).collect();
    Some(format!(
        "`{}`: {what} while `{}` stays where it is, which follows smaller steps, such as {} after {}; not removed, and a fit takes it for \
         true ({})",
        channel.name(),
        beside.name(),
        plain(current_a[first]),
        plain(current_a[first - 1]),
        at(&rows, lines, places)
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

    /// Blocks of 20 rows at 0 and 2 A over 50 mOhm, with noise of about a millivolt, and 50 A from row 110 on for so many; `follows` says
    /// whether the voltage shows blocks, and whether it shows the spike.
    fn told(follows: (bool, bool), lasts: usize) -> Option<String> {
        let is_spike = |row: usize| (110..110 + lasts).contains(&row);
        let current = |row: usize| if is_spike(row) { 50.0 } else { 2.0 * (row / 20 % 2) as f64 };
        let current_a: Vec<f64> = (0..200).map(current).collect();
        let noise_v = |row: usize| 1e-3 * ((row * 7919 % 13) as f64 / 6.0 - 1.0);
        let shown = |row: usize| if is_spike(row) { follows.1 } else { follows.0 };
        let block_a = |row: usize| {
            if shown(row) {
                current_a[row]
            } else if follows.0 {
                current_a[109]
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
        assert_eq!(told((true, false), 1).as_deref(), Some(note));
        let run = told((true, false), 3).unwrap();
        assert!(run.contains("1 run of up to 3 rows far from the rows before and after while") && run.ends_with("(line 112)"), "{run}");
        assert_eq!(told((true, true), 3), None);
    }

    #[test]
    fn a_current_that_the_voltage_follows_or_that_it_never_follows_is_not() {
        assert_eq!(told((true, true), 1), None);
        assert_eq!(told((false, false), 1), None);
    }
}
