//! Whether sensors may be later than a descent from "prompt" leads to.
//!
//! Where inputs jump and then hold, a delay of several rows changes nothing but the row after each jump until it is a whole
//! row, and a descent may come to rest there.

use super::rough::Rough;
use super::state::{State, observed};

/// Stated deviations up to which a delay is tried, in steps of one row, and so many rows at most.
const WIDE: f64 = 3.0;
const MOST_ROWS: f64 = 30.0;

impl State {
    /// This state or, where delays of whole rows leave less, the best that is reached from the best of those; each sensor by itself.
    #[must_use]
    pub(super) fn or_with_other_delays(self) -> State {
        let frame = std::sync::Arc::clone(&self.frame);
        let lags = frame.known.iter().enumerate().filter_map(|(place, known)| match known.what {
            Rough::Lag(channel) => Some((frame.free.len() + place, frame.evidence.step_s(channel), known.sigma)),
            _ => None,
        });
        lags.fold(self, |state, (unknown, step_s, sigma_s)| {
            let rows = (WIDE * sigma_s / step_s).min(MOST_ROWS) as i32;
            let at = |row: i32| {
                let mut x = state.x.clone();
                x[unknown] = f64::from(row) * step_s;
                x
            };
            let left = |row: &i32| -> f64 {
                observed(&frame).zip(frame.predict(&at(*row))).map(|(observed, shown)| (observed - shown).powi(2)).sum()
            };
            let least = (-rows..=rows).map(|row| (left(&row), row)).min_by(|a, b| a.0.total_cmp(&b.0));
            match least.and_then(|(_, row)| state.search_elsewhere(&at(row), f64::NEG_INFINITY)) {
                Some(other) if other.cost < state.cost => other,
                _ => state,
            }
        })
    }
}
