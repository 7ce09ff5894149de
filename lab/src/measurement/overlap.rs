//! Logs of which a part is the same.

use super::Log;

/// Rows that must agree where something changes before two logs share more than how they begin: at rest, two readings of a rounded
/// voltage are easily the same.
const CHANGES_MIN: usize = 10;

/// How many rows of the one log are rows of the other, with the same time and the same readings of all channels that both have; none
/// where these hardly change and may agree by chance.
#[must_use]
pub fn shared_rows(one: &Log, other: &Log) -> usize {
    let both: Vec<(&[f64], &[f64])> =
        one.channels.iter().filter_map(|(channel, values)| Some((&values[..], &other.channels.get(channel)?[..]))).collect();
    if both.is_empty() {
        return 0;
    }
    // What is missing in both is the same.
    let same = |a: f64, b: f64| a == b || a.is_nan() && b.is_nan();
    let (mut rows, mut changes) = (0, 0);
    let mut at = 0;
    for (row, time_s) in one.time_s.iter().enumerate() {
        at += other.time_s[at..].partition_point(|known_s| known_s < time_s);
        let alike = other.time_s.get(at) == Some(time_s) && both.iter().all(|(one, other)| same(one[row], other[at]));
        rows += usize::from(alike);
        changes += usize::from(alike && row > 0 && both.iter().any(|(one, _)| !same(one[row], one[row - 1])));
    }
    if changes < CHANGES_MIN { 0 } else { rows }
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
    fn logs_that_only_rest_alike_share_nothing() {
        let rest = |ends: u32| {
            let row = |row: u32| format!("{row},{},4.1\n", if row < 80 { 0 } else { ends });
            let text = (0..100).map(row).fold("time_s,current_a,voltage_v\n".to_owned(), |text, row| text + &row);
            read_log("a.csv", text.as_bytes(), LogFacts::default()).unwrap()
        };
        assert_eq!(shared_rows(&rest(1), &rest(2)), 0);
    }
}
