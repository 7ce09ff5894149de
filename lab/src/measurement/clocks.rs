//! What to do about times and dates as people write them, which are not read.

use energy::units::S_PER_DAY;

/// A fall of a time that is a day but for a step of a log, as a share of a day.
const ABOUT_A_DAY: f64 = 0.9;

/// That a clock began a new day, where a time fell by about one; as the end of a sentence.
pub(super) fn past_midnight(fall_s: f64) -> &'static str {
    if (ABOUT_A_DAY * S_PER_DAY..=S_PER_DAY).contains(&fall_s) {
        "; it is about a day, as where a clock passes midnight: write the date before each time (2026-03-01 23:59:59), or add 86,400 s from there on"
    } else {
        ""
    }
}

/// How a date or time could be read that is not, as the end of a sentence; nothing of what is none.
pub(super) fn how_to_write(text: &str) -> String {
    let (date, clock) =
        text.split_once([' ', 'T']).map_or(("", text), |(date, clock)| if is_date(date) { (date, clock) } else { ("", text) });
    let date = if is_date(text) { text } else { date };
    let halves = clock.to_lowercase();
    let has_halves = ["am", "pm", "a.m.", "p.m."].iter().any(|half| halves.ends_with(half));
    let is_clock = clock.contains(':') && clock.starts_with(|letter: char| letter.is_ascii_digit());
    let mut mends = Vec::new();
    if !date.is_empty() {
        mends.push("the year first, then month and day (2026-03-01), as nothing else tells which number is the day");
    }
    if has_halves && is_clock {
        mends.push("24 hours and no AM or PM");
    }
    if mends.is_empty() { String::new() } else { format!(": write {}", mends.join(", and ")) }
}

/// Whether this is a date with its year at the end, or of two digits: `03/01/2026`, `1.3.26`.
fn is_date(text: &str) -> bool {
    ['/', '.', '-'].iter().any(|&separator| {
        let parts: Vec<&str> = text.split(separator).collect();
        let is_number = |part: &&str| !part.is_empty() && part.bytes().all(|byte| byte.is_ascii_digit());
        parts.len() == 3 && parts.iter().all(is_number) && parts[0].len() <= 2 && parts[1].len() <= 2 && [2, 4].contains(&parts[2].len())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dates_and_clocks_of_people_are_told_how_to_be_written() {
        for date in ["01.03.2026 10:00:00", "3/1/26 10:00", "03-01-2026"] {
            let told = how_to_write(date);
            assert!(told.starts_with(": write the year first") && !told.contains("24 hours"), "{date}: {told}");
        }
        assert_eq!(how_to_write("11:00:00 AM"), ": write 24 hours and no AM or PM");
        assert!(how_to_write("03/01/2026 10:00:00 pm").ends_with("tells which number is the day, and 24 hours and no AM or PM"));
        for other in ["low", "10:00", "1.2.3", "team", "2026-03-01 10:00:00"] {
            assert_eq!(how_to_write(other), "", "{other}");
        }
    }

    #[test]
    fn a_time_that_falls_by_a_day_passed_midnight() {
        assert!(past_midnight(86_399.0).contains("passes midnight"));
        assert_eq!((past_midnight(3600.0), past_midnight(1e6)), ("", ""));
    }
}
