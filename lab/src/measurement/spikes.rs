//! Values that leave what is before and after them, for a row or a few: a reading that was lost on its way. They may
//! be real: they are counted, and stay.

use energy::Channel;

use super::values::{at, count, plain};

/// A spike leaves its neighbours by this many usual differences, and by this share of the value.
const SPIKE_DIFFERENCES: f64 = 20.0;
const SPIKE_SHARE: f64 = 0.002;
/// Rows of such a reading that may follow each other: a bus that is silent for some seconds. What lasts longer is a state of its own.
pub(super) const RUN_ROWS: usize = 10;
/// What such a run may last, where it is more than a row: rows that are minutes apart show a state, however few there are of them.
const RUN_S: f64 = 60.0;
/// What a value may lie beside the one before a run, as a share of its height, to be back.
pub(super) const BACK: f64 = 0.2;

/// The step of an input above which it may explain that a state jumps: where it moves in every row, by noise or else, a state moves
/// with it, and half as many usual steps of the one explain no spike of the other.
pub(super) fn explaining_step(input: &[f64]) -> f64 {
    let mut steps: Vec<f64> = input.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|step| step.is_finite()).collect();
    if steps.is_empty() {
        return 0.0;
    }
    let middle = steps.len() / 2;
    SPIKE_DIFFERENCES / 2.0 * *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Rows in which a value is far from what it was before and is again after.
struct Run {
    first: usize,
    last: usize,
    before: usize,
}

/// What is to be said about values that leave what is before and after them, for a row or as many as `longest` within [`RUN_S`]. Only of states: an input
/// may well last some rows. `moves` tells rows at which an input changed, which explains a jump.
pub(super) fn spikes(
    (channel, values): (Channel, &[f64]),
    (time_s, longest): (&[f64], usize),
    moves: impl Fn(usize) -> bool,
    is_as_written: impl Fn(f64) -> bool,
    (lines, places): (&[u64], &str),
) -> Option<String> {
    let state = matches!(
        channel,
        Channel::VoltageV | Channel::TemperatureDegc | Channel::AmbientDegc | Channel::PackVoltageV | Channel::CycleCount
    );
    if !state || values.len() < 3 {
        return None;
    }
    let mut differences: Vec<f64> = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|d| *d > 0.0).collect();
    if differences.is_empty() {
        return None;
    }
    let middle = (differences.len() - 1) / 2;
    let usual = *differences.select_nth_unstable_by(middle, f64::total_cmp).1;
    // A logger that stumbles over a reading may well lose the one beside it.
    let known = |row: usize| values.get(row).is_some_and(|value| value.is_finite()).then_some(row);
    let before = |row: usize| known(row - 1).or_else(|| known(row.checked_sub(2)?));
    let after = |row: usize| known(row + 1).or_else(|| known(row + 2));
    let run = |first: usize| {
        let before = before(first)?;
        let up = values[first] - values[before];
        let least = (SPIKE_DIFFERENCES * usual).max(SPIKE_SHARE * values[before].abs());
        for last in first..values.len().saturating_sub(1).min(first + longest) {
            let height = (values[last] - values[before]) * up.signum();
            // A reading within a run may be missing.
            let is_off = height > least || last > first && height.is_nan();
            let is_brief = last == first || time_s[last] - time_s[first] <= RUN_S;
            if !is_off || !is_brief {
                return None;
            }
            let Some(after) = after(last) else { continue };
            let down = values[after] - values[last];
            // The longer it lasts the more it must be what it was, for it not to have changed meanwhile.
            let is_back = last == first || (values[after] - values[before]).abs() <= BACK * up.abs().min(down.abs());
            if up * down < 0.0 && down.abs() > least && is_back {
                return (!(before + 1..=after).any(&moves)).then_some(Run { first, last, before });
            }
        }
        None
    };
    let (mut found, mut row): (Vec<Run>, usize) = (Vec::new(), 1);
    while row + 1 < values.len() {
        let next = run(row);
        row = next.as_ref().map_or(row, |run| run.last) + 1;
        found.extend(next);
    }
    let Run { first, before, .. } = *found.first()?;
    let rows: Vec<usize> = found.iter().map(|run| run.first).collect();
    let most = found.iter().map(|run| run.last - run.first + 1).max().unwrap_or(1);
    let mut all = found.iter().flat_map(|run| &values[run.first..=run.last]).filter(|value| !value.is_nan());
    let is_one = all.all(|value| *value == values[first]) && is_as_written(values[first]);
    let name = channel.name();
    let how = format!(", unless --missing {name}={} says that this is no measurement", plain(values[first]));
    let how = if is_one && values[first].to_string() == plain(values[first]) { how } else { String::new() };
    let what = match most {
        1 => format!("{} far from both neighbours", count(rows.len(), "single value")),
        _ => format!("{} of up to {most} rows far from the rows before and after", count(rows.len(), "run")),
    };
    Some(format!(
        "`{name}`: {what} (by more than {SPIKE_DIFFERENCES} usual differences), such as {} after {}; not removed{how} ({})",
        plain(values[first]),
        plain(values[before]),
        at(&rows, lines, places)
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINES: [u64; 5] = [2, 3, 4, 5, 6];
    const TIME_S: [f64; 5] = [0.0, 1.0, 2.0, 3.0, 4.0];

    #[test]
    fn a_spike_is_told_unless_an_input_explains_it() {
        let values = [3.70, 3.701, 2.9, 3.70, 3.701];
        assert!(
            spikes((Channel::VoltageV, &values), (&TIME_S, RUN_ROWS), |_| false, |_| true, (&LINES, "lines"))
                .unwrap()
                .contains("such as 2.9 after 3.701")
        );
        assert_eq!(spikes((Channel::VoltageV, &values), (&TIME_S, RUN_ROWS), |row| row == 2, |_| true, (&LINES, "lines")), None);
        assert_eq!(spikes((Channel::CurrentA, &values), (&TIME_S, RUN_ROWS), |_| false, |_| true, (&LINES, "lines")), None);
        let told =
            spikes((Channel::VoltageV, &[3.7, 3.701, 0.0, 3.70, 3.701]), (&TIME_S, RUN_ROWS), |_| false, |_| true, (&LINES, "lines"))
                .unwrap();
        assert!(told.ends_with("not removed, unless --missing voltage_v=0 says that this is no measurement (line 4)"), "{told}");
        let mapped = spikes((Channel::VoltageV, &values), (&TIME_S, RUN_ROWS), |_| false, |_| false, (&LINES, "lines")).unwrap();
        assert!(mapped.ends_with("such as 2.9 after 3.701; not removed (line 4)"), "what the logger wrote is not known: {mapped}");
        // Also beside a reading that is missing, but not alone among such.
        for missing in [1, 3] {
            let mut gone = values;
            gone[missing] = f64::NAN;
            assert!(
                spikes((Channel::VoltageV, &gone), (&TIME_S, RUN_ROWS), |_| false, |_| true, (&LINES, "lines"))
                    .unwrap()
                    .contains("such as 2.9 after 3.7"),
                "{gone:?}"
            );
            assert_eq!(
                spikes((Channel::VoltageV, &gone), (&TIME_S, RUN_ROWS), |row| row == 3, |_| true, (&LINES, "lines")),
                None,
                "{gone:?}"
            );
        }
        let alone = [f64::NAN, f64::NAN, 2.9, f64::NAN, 3.7];
        assert_eq!(spikes((Channel::VoltageV, &alone), (&TIME_S, RUN_ROWS), |_| false, |_| true, (&LINES, "lines")), None);
        // Noise of a current explains nothing, a step of it does, and one in a current that else holds still as well.
        assert_eq!(explaining_step(&[0.0, 0.001, 0.0, 2.0, 2.001]), 0.01);
        assert_eq!(explaining_step(&[0.0, 0.0, 0.0, 0.001]), 0.0);
    }

    #[test]
    fn values_that_are_lost_for_some_rows_are_told_as_well() {
        let every = |step_s: f64, lost: usize, value: f64, longest: usize, moves: usize| {
            let time_s: Vec<f64> = (0..100).map(|row| step_s * row as f64).collect();
            let mut values: Vec<f64> = (0..100).map(|row| 3.8 - 1e-4 * row as f64).collect();
            values[50..50 + lost].fill(value);
            let lines: Vec<u64> = (2..102).collect();
            spikes((Channel::VoltageV, &values), (&time_s, longest), |row| row == moves, |_| true, (&lines, "lines"))
        };
        let told = |lost: usize, value: f64, longest: usize, moves: usize| every(1.0, lost, value, longest, moves);
        let note = "`voltage_v`: 1 run of up to 4 rows far from the rows before and after (by more than 20 usual differences), such as 0 after \
                    3.8; not removed, unless --missing voltage_v=0 says that this is no measurement (line 52)";
        assert_eq!(told(4, 0.0, RUN_ROWS, 0).as_deref(), Some(note));
        assert!(told(10, 6.5535, RUN_ROWS, 0).unwrap().contains("1 run of up to 10 rows"));
        // Longer, it is a state; with an input that moves, its answer; where nobody knows the input, it may be that.
        assert_eq!(told(11, 0.0, RUN_ROWS, 0), None);
        assert_eq!(told(4, 0.0, RUN_ROWS, 54), None);
        assert_eq!(told(4, 0.0, 1, 0), None);
        // What lasts minutes is a state as well, but for a single row.
        assert!(every(20.0, 4, 0.0, RUN_ROWS, 0).is_some());
        assert_eq!(every(21.0, 4, 0.0, RUN_ROWS, 0), None);
        assert_eq!(every(300.0, 9, 0.0, RUN_ROWS, 0), None);
        assert!(every(300.0, 1, 0.0, RUN_ROWS, 0).unwrap().contains("1 single value"));
        // A step that stays is none.
        assert_eq!(told(50, 3.0, RUN_ROWS, 0), None);
    }
}
