//! The times of a log: strictly increasing, or an error; repeated ones become one row; gaps are
//! told.

use super::clocks::past_midnight;
use super::some_places;

/// A step longer than this many usual ones is a gap.
pub(super) const GAP: f64 = 10.0;
/// More gaps than this share of all steps are the logger's way, not accidents; a way that shows so few times is none.
const UNEVEN: f64 = 0.01;
const OFTEN: usize = 10;
/// A clock is coarser than its logger where more than this share of its times have several rows. A step of a test that ends and another that
/// begins share a time as well, but not as often.
const COARSE: f64 = 0.5;
/// And it ticks: this share of its times are one tick apart. The rest is for pauses.
const TICKS: f64 = 0.9;
/// How far such a step may lie from a tick, as a share of it: thirds of a second are written with three digits.
const TICK_TOLERANCE: f64 = 0.01;

/// Which rows of a source make which rows of a log.
#[derive(Debug)]
pub(super) struct Rows {
    /// Index of the first source row of every log row; empty when they are the same.
    first: Vec<usize>,
    /// Rows of the source.
    source: usize,
    /// Whether rows of one time are averaged; otherwise the first counts.
    averaged: bool,
}

impl Rows {
    /// Finds rows of one time, and says what becomes of them.
    ///
    /// Rows of one time: where a clock is coarser than the logger, there are several at most of its ticks; their mean is what held
    /// over that tick, so that charge is kept. Elsewhere they are written when a step ends and the
    /// next begins, or sent twice: the first is kept, since its current held until that time,
    /// whereas that of the second has held over no time yet.
    ///
    /// # Errors
    /// When time is missing or goes backwards.
    pub(super) fn of(time_s: &[f64], lines: &[u64], names: &str) -> Result<(Rows, Option<String>), (usize, String)> {
        let mut repeated = Vec::new();
        let mut earlier = f64::NEG_INFINITY;
        for (row, &now) in time_s.iter().enumerate() {
            if now.is_nan() {
                return Err((row, "every row needs a time".to_owned()));
            }
            if now < earlier {
                return Err((row, format!("time goes backwards: {now} s after {earlier} s{}", past_midnight(earlier - now))));
            }
            if now == earlier {
                repeated.push(row);
            }
            earlier = now;
        }
        if repeated.is_empty() {
            return Ok((Rows { first: Vec::new(), source: time_s.len(), averaged: false }, None));
        }
        let averaged = is_coarse(time_s);
        let places: Vec<u64> = repeated.iter().map(|&row| lines[row]).collect();
        let done = if averaged {
            "most times do, and they tick evenly, so the clock is coarse: rows of one time are averaged"
        } else {
            "the first of each is kept, whose current held until then"
        };
        let note =
            format!("{} of {} rows repeat the time before them ({}); {done}", places.len(), time_s.len(), some_places(names, &places));
        let mut repeated = repeated.into_iter().peekable();
        let first = (0..time_s.len()).filter(|row| repeated.next_if_eq(row).is_none()).collect();
        Ok((Rows { first, source: time_s.len(), averaged }, Some(note)))
    }

    /// The values of the log's rows from those of the source's.
    pub(super) fn numbers(&self, values: Vec<f64>) -> Vec<f64> {
        if self.first.is_empty() {
            return values;
        }
        let ends = self.first.iter().skip(1).copied().chain([self.source]);
        let row = |(&begin, end): (&usize, usize)| {
            let known = values[begin..end].iter().copied().filter(|value| !value.is_nan());
            if !self.averaged {
                return values[begin];
            }
            let (count, sum) = known.fold((0.0, 0.0), |(count, sum), value| (count + 1.0, sum + value));
            if count > 0.0 { sum / count } else { f64::NAN }
        };
        self.first.iter().zip(ends).map(row).collect()
    }

    /// One item per row of the log: that of its first row.
    pub(super) fn firsts<T: Clone>(&self, values: Vec<T>) -> Vec<T> {
        if self.first.is_empty() { values } else { self.first.iter().map(|&row| values[row].clone()).collect() }
    }
}

/// Whether times that do not fall are those of a clock coarser than its logger.
fn is_coarse(time_s: &[f64]) -> bool {
    let times: Vec<&[f64]> = time_s.chunk_by(|a, b| a == b).collect();
    let several = times.iter().filter(|rows| rows.len() > 1).count();
    let distinct_s: Vec<f64> = times.iter().filter_map(|rows| rows.first().copied()).collect();
    let tick_s = usual_step_s(&distinct_s);
    let is_tick = |pair: &&[f64]| (pair[1] - pair[0] - tick_s).abs() <= TICK_TOLERANCE * tick_s;
    let ticks = distinct_s.windows(2).filter(is_tick).count();
    several as f64 > COARSE * distinct_s.len() as f64 && ticks as f64 >= TICKS * (distinct_s.len() - 1) as f64
}

/// The usual step between rows, s: the median.
pub(crate) fn usual_step_s(time_s: &[f64]) -> f64 {
    let mut steps: Vec<f64> = time_s.windows(2).map(|pair| pair[1] - pair[0]).collect();
    if steps.is_empty() {
        return f64::NAN;
    }
    let middle = steps.len() / 2;
    *steps.select_nth_unstable_by(middle, f64::total_cmp).1
}

/// Rows that follow a step of more than so many usual ones.
pub(super) fn after_gaps(time_s: &[f64], steps: f64) -> Vec<usize> {
    let usual_s = usual_step_s(time_s);
    (1..time_s.len()).filter(|&row| time_s[row] - time_s[row - 1] > steps * usual_s).collect()
}

/// Whether so many gaps are the way in which a log of so many rows was made.
fn come_unevenly(gaps: usize, rows: usize) -> bool {
    gaps as f64 > UNEVEN * rows as f64 && gaps > OFTEN
}

/// Rows that follow a step of more than so many usual ones, where that is no habit of the logger.
pub(super) fn accidents(time_s: &[f64], steps: f64) -> Vec<usize> {
    let rows = after_gaps(time_s, steps);
    if come_unevenly(rows.len(), time_s.len()) { Vec::new() } else { rows }
}

/// Rows that follow a gap, where rows of a log may be means of several readings (as many as `readings` says, one where it is empty).
pub(crate) fn rows_after_gaps(time_s: &[f64], readings: &[f64]) -> Vec<usize> {
    let mut reading_s = 0.0;
    let at = |row: usize| {
        let step_s = if row == 0 { 0.0 } else { time_s[row] - time_s[row - 1] };
        reading_s += step_s / readings.get(row).copied().unwrap_or(1.0).max(1.0);
        reading_s
    };
    accidents(&(0..time_s.len()).map(at).collect::<Vec<_>>(), GAP)
}

/// What is to be said about rows that are missing.
pub(super) fn gaps(time_s: &[f64], lines: &[u64], names: &str) -> Option<String> {
    let (usual_s, rows) = (usual_step_s(time_s), after_gaps(time_s, GAP));
    let length = |row: usize| time_s[row] - time_s[row - 1];
    let longest = rows.iter().copied().max_by(|&a, &b| length(a).total_cmp(&length(b)))?;
    if come_unevenly(rows.len(), time_s.len()) {
        let (usual_s, longest_s) = (short(usual_s), short(length(longest)));
        return Some(format!(
            "rows come unevenly: mostly {usual_s} s apart, but up to {longest_s} s; the inputs of a row stand for all of the step before it"
        ));
    }
    let places: Vec<u64> = rows.iter().map(|&row| lines[row]).collect();
    let one = places.len() == 1;
    Some(format!(
        "{} {} longer than {GAP} usual steps of {} s, the longest {} s; inputs of the row after a gap stand for all of it (before {})",
        places.len(),
        if one { "gap" } else { "gaps" },
        short(usual_s),
        short(length(longest)),
        some_places(names, &places)
    ))
}

/// A number for people: three digits are enough to see what is meant.
pub(crate) fn short(value: f64) -> String {
    let digits = if value.abs() >= 100.0 || value == 0.0 { 0 } else { (2.0 - value.abs().log10().floor()).clamp(0.0, 9.0) as usize };
    let text = format!("{value:.digits$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lines(rows: usize) -> Vec<u64> {
        (2..rows as u64 + 2).collect()
    }

    #[test]
    fn a_row_sent_twice_is_one_row_and_the_first_counts() {
        let time_s: Vec<f64> = [0.0, 1.0, 1.0].into_iter().chain((2..40).map(f64::from)).collect();
        let (rows, note) = Rows::of(&time_s, &lines(41), "lines").unwrap();
        assert_eq!(&rows.numbers(time_s.clone())[..3], [0.0, 1.0, 2.0]);
        let values: Vec<f64> = (0..41).map(f64::from).collect();
        assert_eq!(&rows.numbers(values)[..3], [0.0, 1.0, 3.0]);
        assert_eq!(
            note.unwrap(),
            "1 of 41 rows repeat the time before them (line 4); the first of each is kept, whose current held until then"
        );
    }

    #[test]
    fn a_coarse_clock_keeps_the_charge() {
        let time_s = [0.0, 1.0, 1.0, 2.0, 2.0];
        let (rows, note) = Rows::of(&time_s, &lines(5), "lines").unwrap();
        assert_eq!(rows.numbers(vec![0.0, 1.0, 3.0, f64::NAN, 5.0]), [0.0, 2.0, 5.0]);
        assert!(rows.numbers(vec![0.0, 1.0, 3.0, f64::NAN, f64::NAN])[2].is_nan());
        assert_eq!(rows.firsts(vec!["a", "b", "c", "d", "e"]), ["a", "b", "d"]);
        assert!(note.unwrap().contains("averaged"));
    }

    /// Pulses and rests as a tester writes them: the end of a step and the begin of the next share a time.
    #[test]
    fn steps_that_share_their_ends_are_no_coarse_clock() {
        let kept = |time_s: &[f64]| {
            let (rows, note) = Rows::of(time_s, &lines(time_s.len()), "lines").unwrap();
            assert!(note.unwrap().ends_with("the first of each is kept, whose current held until then"), "{time_s:?}");
            rows.numbers((0..time_s.len()).map(|row| row as f64).collect())
        };
        // Rows every 60 s in rests and every 2 s in pulses; one step of every six at its boundary.
        let (mut now, mut uneven) = (0.0, vec![0.0]);
        for step_s in [60.0, 2.0].repeat(10) {
            uneven.extend((1..=5).map(|row| now + f64::from(row) * step_s));
            now += 5.0 * step_s;
            uneven.push(now);
        }
        assert_eq!(kept(&uneven)[4..8], [4.0, 5.0, 7.0, 8.0]);
        // Only the ends of steps are written, and every time comes twice.
        assert_eq!(kept(&[0.0, 600.0, 600.0, 610.0, 610.0, 1210.0, 1210.0])[..3], [0.0, 1.0, 3.0]);
        // All rows are a second apart, and every fourth is the end of a step.
        let even: Vec<f64> = (0..40).flat_map(|row| vec![f64::from(row); 1 + usize::from(row % 4 == 3)]).collect();
        assert_eq!(kept(&even)[2..6], [2.0, 3.0, 5.0, 6.0]);
    }

    #[test]
    fn a_clock_that_passes_midnight_is_told_with_what_to_do() {
        let (row, told) = Rows::of(&[86_398.0, 86_399.0, 0.0], &lines(3), "lines").unwrap_err();
        assert!(row == 2 && told.starts_with("time goes backwards: 0 s after 86399 s; it is about a day"), "{told}");
    }

    #[test]
    fn gaps_are_counted_against_the_usual_step() {
        let time_s: Vec<f64> = (0..10).map(f64::from).chain([3609.0, 3610.0]).collect();
        let note = gaps(&time_s, &lines(12), "lines").unwrap();
        assert!(note.starts_with("1 gap longer than 10 usual steps of 1 s, the longest 3600 s;"), "{note}");
        assert!(note.ends_with("(before line 12)"), "{note}");
        let late = |gaps: u32| (0..gaps).flat_map(|gap| (0..20).map(move |row| f64::from(row + 120 * gap))).collect::<Vec<f64>>();
        assert!(gaps(&late(11), &lines(220), "lines").unwrap().starts_with("10 gaps longer than"));
        assert!(gaps(&late(12), &lines(240), "lines").unwrap().starts_with("rows come unevenly: mostly 1 s apart, but up to 101 s;"));
        assert_eq!(gaps(&[0.0, 5.0, 10.0], &lines(3), "lines"), None);
    }

    #[test]
    fn numbers_for_people_are_short() {
        assert_eq!([1.0, 0.1, 3600.0, 12.345, 0.0, 0.01].map(short), ["1", "0.1", "3600", "12.3", "0", "0.01"]);
    }
}
