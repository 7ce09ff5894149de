//! Instants on the wire and in the store.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// An instant as whole milliseconds since 1970-01-01T00:00:00Z (UTC, no leap seconds).
///
/// Serialized as that integer; printed and parsed as RFC 3339 with milliseconds. Every
/// `i64` is a legal value, so arithmetic saturates instead of overflowing: a message must
/// not be able to stop the program that reads it.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Timestamp(i64);

impl Timestamp {
    /// The instant `unix_ms` milliseconds after the Unix epoch (negative: before it).
    pub const fn from_unix_ms(unix_ms: i64) -> Self {
        Self(unix_ms)
    }

    /// Milliseconds since the Unix epoch.
    pub const fn unix_ms(self) -> i64 {
        self.0
    }

    /// Seconds from `earlier` to `self`; negative when `earlier` is in fact later.
    pub fn seconds_since(self, earlier: Self) -> f64 {
        self.0.saturating_sub(earlier.0) as f64 / 1000.0
    }

    /// The instant `delta_s` seconds later, rounded to the nearest millisecond.
    /// Infinite steps end at the far ends of time; a NaN step does not move.
    pub fn plus_s(self, delta_s: f64) -> Self {
        // A float-to-integer cast saturates, and maps NaN to zero.
        self.plus_ms((delta_s * 1000.0).round() as i64)
    }

    /// The instant `delta_ms` milliseconds later.
    pub const fn plus_ms(self, delta_ms: i64) -> Self {
        Self(self.0.saturating_add(delta_ms))
    }
}

impl fmt::Display for Timestamp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match jiff::Timestamp::from_millisecond(self.0) {
            // Formatted apart and then padded, so that `{:>30}` works in tables.
            Ok(instant) => f.pad(&format!("{instant:.3}")),
            // Outside the years -9999..=9999 there is no calendar text; show the number.
            Err(_) => f.pad(&format!("{}ms", self.0)),
        }
    }
}

/// A text that is not an RFC 3339 instant.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("`{text}` is not an instant like 2026-01-01T00:00:00.000Z: {detail}")]
pub struct TimeError {
    /// The offending text.
    pub text: String,
    /// What the parser objected to.
    pub detail: String,
}

impl FromStr for Timestamp {
    type Err = TimeError;

    /// Accepts any RFC 3339 instant with an offset; digits below a millisecond are cut off.
    fn from_str(text: &str) -> Result<Self, TimeError> {
        text.parse::<jiff::Timestamp>()
            .map(|instant| Self(instant.as_millisecond()))
            .map_err(|error| TimeError { text: text.to_owned(), detail: error.to_string() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prints_and_parses_rfc_3339_with_milliseconds() {
        let t = Timestamp::from_unix_ms(1_767_225_600_007);
        assert_eq!(t.to_string(), "2026-01-01T00:00:00.007Z");
        assert_eq!("2026-01-01T00:00:00.007Z".parse(), Ok(t));
        assert_eq!("2026-01-01T01:00:00.007+01:00".parse(), Ok(t));
        assert_eq!(Timestamp::default().to_string(), "1970-01-01T00:00:00.000Z");
    }

    #[test]
    fn refuses_text_without_an_offset_and_shows_it() {
        let error = "2026-01-01T00:00:00".parse::<Timestamp>().unwrap_err();
        assert!(error.to_string().contains("`2026-01-01T00:00:00`"));
    }

    #[test]
    fn serializes_as_an_integer() {
        let t = Timestamp::from_unix_ms(-5);
        assert_eq!(serde_json::to_string(&t).unwrap(), "-5");
        assert_eq!(serde_json::from_str::<Timestamp>("-5").unwrap(), t);
        assert!(serde_json::from_str::<Timestamp>("1.5").is_err());
    }

    #[test]
    fn arithmetic_rounds_to_milliseconds_and_never_overflows() {
        let t = Timestamp::from_unix_ms(1_000);
        assert_eq!(t.plus_s(1.2346).unix_ms(), 2_235);
        assert_eq!(t.plus_s(-1.0).unix_ms(), 0);
        assert_eq!(t.plus_s(f64::NAN), t);
        assert_eq!(t.plus_s(f64::INFINITY).unix_ms(), i64::MAX);
        assert_eq!(t.seconds_since(Timestamp::from_unix_ms(3_500)), -2.5);
        let ends = [i64::MIN, i64::MAX].map(Timestamp::from_unix_ms);
        assert!(ends[1].seconds_since(ends[0]) > 0.0);
        assert_eq!(ends[0].plus_ms(-1), ends[0]);
        assert_eq!(ends[1].to_string(), "9223372036854775807ms");
    }
}
