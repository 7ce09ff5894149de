//! Logs of which a part is the same.

use super::Log;

/// Rows that must agree where something changes before two logs share more than how they begin: at rest, two readings of a rounded
/// voltage are easily the same.
const CHANGES_MIN: usize = 10;
/// Share of the rows at times that both have of which one may differ: two runs of one protocol, read in coarse steps, agree in many rows, but
/// not in all.
const DIFFERENT_MAX: f64 = 0.001;

/// How many rows that are compared of the one log are such rows of the other, with the same time and the same readings of all channels that both have; none
/// where these hardly change and may agree by chance, or where others at the same times do not agree.
#[must_use]
pub fn shared_rows(one: &Log, other: &Log) -> usize {
    let both: Vec<(&[f64], &[f64])> =
        one.channels.iter().filter_map(|(channel, values)| Some((&values[..], &other.channels.get(channel)?[..]))).collect();
    if both.is_empty() {
        return 0;
    }
    // What is missing in both is the same.
    let same = |a: f64, b: f64| a == b || a.is_nan() && b.is_nan();
    let (mut rows, mut changes, mut different) = (0, 0, 0);
    let mut at = 0;
    for (row, time_s) in one.time_s.iter().enumerate() {
        at += other.time_s[at..].partition_point(|known_s| known_s < time_s);
        if other.time_s.get(at) != Some(time_s) {
            continue;
        }
        if !one.compares(row) || !other.compares(at) {
            continue;
        }
        let alike = both.iter().all(|(one, other)| same(one[row], other[at]));
        rows += usize::from(alike);
        different += usize::from(!alike);
        changes += usize::from(alike && row > 0 && both.iter().any(|(one, _)| !same(one[row], one[row - 1])));
    }
    let is_the_same = changes >= CHANGES_MIN && different as f64 <= DIFFERENT_MAX * (rows + different) as f64;
    if is_the_same { rows } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measurement::{LogFacts, read_log};

    fn log(rows: std::ops::Range<u32>, other: u32) -> Log {
        let row = |row: u32| format!("{row},{},{}\n", row / 5 % 3 + other, 4.0 - 1e-3 * f64::from(row));
        let text = rows.map(row).fold("time_s,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
        read_log("a.csv", text.as_bytes(), LogFacts::default()).unwrap()
    }

    #[test]
    fn rows_of_two_logs_that_are_the_same_are_counted() {
        assert_eq!(shared_rows(&log(0..100, 0), &log(60..200, 0)), 40);
        assert_eq!(shared_rows(&log(60..200, 0), &log(0..100, 0)), 40);
        assert_eq!(shared_rows(&log(0..100, 0), &log(0..100, 1)), 0, "another current");
        assert_eq!(shared_rows(&log(0..100, 0), &log(100..200, 0)), 0);
    }

    #[test]
    fn two_runs_of_one_protocol_in_coarse_steps_share_nothing() {
        // A voltage in steps of 1 mV, of which now and then one is off by a step.
        let run = |every: u32| {
            let row = |row: u32| {
                let off = if row.is_multiple_of(every) { 1e-3 } else { 0.0 };
                format!("{row},{},{:.3}\n", row / 50 % 2, 4.0 - 1e-3 * f64::from(row / 5) + off)
            };
            let text = (0..500).map(row).fold("time_s,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
            read_log("a.csv", text.as_bytes(), LogFacts::default()).unwrap()
        };
        assert_eq!(shared_rows(&run(7), &run(11)), 0);
        assert_eq!(shared_rows(&run(7), &run(7)), 500);
    }

    #[test]
    fn logs_that_only_rest_alike_share_nothing() {
        let rest = |ends: u32| {
            let row = |row: u32| format!("{row},{},4.1\n", if row < 80 { 0 } else { ends });
            let text = (0..100).map(row).fold("time_s,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
            read_log("a.csv", text.as_bytes(), LogFacts::default()).unwrap()
        };
        assert_eq!(shared_rows(&rest(1), &rest(2)), 0);
    }
}
