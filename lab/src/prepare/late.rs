//! Readings whose sensor is stated to be late (`lag_s`), moved to when they were true.

/// What was read of something at an instant: on the line between two rows. NaN where no row was read so late.
///
/// `time_s` ascends strictly; `late_s` > 0 says that a reading shows what was true so much earlier, s.
pub(super) fn instants(time_s: &[f64], read: &[f64], late_s: f64) -> Vec<f64> {
    let at = |&true_s: &f64| {
        let read_s = true_s + late_s;
        let high = time_s.partition_point(|&time_s| time_s < read_s);
        match (time_s.get(high), high.checked_sub(1)) {
            (Some(&after_s), _) if after_s == read_s => read[high],
            (Some(&after_s), Some(low)) => read[low] + (read[high] - read[low]) * (read_s - time_s[low]) / (after_s - time_s[low]),
            _ => f64::NAN,
        }
    };
    time_s.iter().map(at).collect()
}

/// What was read of something that holds over the interval before each row: its mean over the interval when it was
/// true, so that no charge is lost. NaN where none of it was read.
pub(super) fn intervals(time_s: &[f64], read: &[f64], late_s: f64) -> Vec<f64> {
    let mut moved = instants(&time_s[..1], &read[..1], 0.0);
    for pair in time_s.windows(2) {
        let (from_s, to_s) = (pair[0] + late_s, pair[1] + late_s);
        let (mut sum, mut length_s) = (0.0, 0.0);
        let first = time_s.partition_point(|&time_s| time_s <= from_s).max(1);
        for row in (first..time_s.len()).take_while(|&row| time_s[row - 1] < to_s) {
            let within_s = time_s[row].min(to_s) - time_s[row - 1].max(from_s);
            sum += within_s * read[row];
            length_s += within_s;
        }
        moved.push(sum / length_s);
    }
    moved
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIME_S: [f64; 5] = [0.0, 1.0, 2.0, 4.0, 5.0];

    #[test]
    fn a_reading_that_is_late_by_a_row_is_that_of_the_next_row() {
        let moved = instants(&TIME_S[..3], &[10.0, 11.0, 13.0], 1.0);
        assert_eq!(moved[..2], [11.0, 13.0]);
        assert!(moved[2].is_nan());
    }

    #[test]
    fn between_rows_an_instant_lies_on_their_line() {
        let moved = instants(&TIME_S, &[0.0, 1.0, 2.0, 4.0, 5.0], 0.25);
        assert_eq!(moved[..4], [0.25, 1.25, 2.25, 4.25]);
        let early = instants(&TIME_S, &[0.0, 1.0, 2.0, 4.0, 5.0], -0.25);
        assert!(early[0].is_nan() && early[1..] == [0.75, 1.75, 3.75, 4.75], "{early:?}");
    }

    /// 1 A from 0 to 1 s, 2 A to 2 s, 3 A to 4 s, 4 A to 5 s, all read half a second late.
    #[test]
    fn what_holds_over_intervals_loses_no_charge() {
        let moved = intervals(&TIME_S, &[9.0, 1.0, 2.0, 3.0, 4.0], 0.5);
        assert_eq!(moved, [9.0, 1.5, 2.5, 3.25, 4.0]);
    }
}
