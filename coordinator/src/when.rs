//! Times in words, UTC: the time of day, with its date where it would be taken for another day's.

use energy::units::S_PER_H;
use proto::{Absence, Timestamp};

/// What is closer than this is told by its time of day alone, s: half a day, as no two such times look alike.
const SOON_S: f64 = 12.0 * S_PER_H;

/// `2026-01-03`.
#[must_use]
pub fn date(at: Timestamp) -> String {
    at.to_string().chars().take(10).collect()
}

/// The time of day: `14:05:00`.
#[must_use]
pub fn second(at: Timestamp) -> String {
    at.to_string().chars().skip(11).take(8).collect()
}

/// The time of day to the minute: `14:05`.
#[must_use]
pub fn minute(at: Timestamp) -> String {
    at.to_string().chars().skip(11).take(5).collect()
}

/// Whether the time of day alone says when that is, to who is told at `now`.
#[must_use]
pub fn is_soon(at: Timestamp, now: Timestamp) -> bool {
    at.seconds_since(now).abs() < SOON_S
}

/// `14:05:00` to who is told that day at `now`, else `2026-01-03 14:05:00`.
#[must_use]
pub fn second_from(now: Timestamp, at: Timestamp) -> String {
    if is_soon(at, now) { second(at) } else { format!("{} {}", date(at), second(at)) }
}

/// `14:05` to who is told that day at `now`, else `2026-01-03 14:05`.
#[must_use]
pub fn minute_from(now: Timestamp, at: Timestamp) -> String {
    if is_soon(at, now) { minute(at) } else { format!("{} {}", date(at), minute(at)) }
}

/// When a station is away: `leaves at 14:05 and is back at 14:10`, for each time.
#[must_use]
pub fn away(now: Timestamp, away: &[Absence]) -> String {
    let once = |one: &Absence| {
        let back = one.returns.map_or_else(String::new, |at| format!(" and is back at {}", minute_from(now, at)));
        format!("leaves at {}{back}", minute_from(now, one.leaves))
    };
    if away.is_empty() { "stays".to_owned() } else { away.iter().map(once).collect::<Vec<_>>().join(", ") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_time_of_another_day_has_its_date() {
        let now = Timestamp::from_unix_ms(1_767_225_600_000); // 2026-01-01T00:00:00Z
        let at = |after_s: f64| minute_from(now, now.plus_s(after_s));
        assert_eq!((at(300.0), at(-300.0)), ("00:05".to_owned(), "23:55".to_owned()));
        assert_eq!((at(43_140.0), at(43_200.0)), ("11:59".to_owned(), "2026-01-01 12:00".to_owned()));
        assert_eq!(at(2.0 * 86_400.0 + 1560.0), "2026-01-03 00:26");
        assert_eq!(second_from(now, now.plus_s(-86_400.0)), "2025-12-31 00:00:00");
    }
}
