//! How often an agent speaks.

use proto::Timestamp;
use serde::{Deserialize, Serialize};

/// `[publish]` in an agent's configuration: seconds between messages.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Publish {
    /// Between two messages of one gauge.
    pub gauge_period_s: f64,
    /// Between two state messages while nothing changes.
    pub state_period_s: f64,
}

impl Default for Publish {
    fn default() -> Self {
        Self { gauge_period_s: 1.0, state_period_s: 10.0 }
    }
}

/// Longest time between two messages, s: a day.
const PERIOD_MAX_S: f64 = 86_400.0;

impl Publish {
    /// Checks that both periods are positive and no longer than a day.
    ///
    /// # Errors
    /// Names the key and the allowed range.
    pub fn check(&self) -> anyhow::Result<()> {
        for (key, value) in [("gauge_period_s", self.gauge_period_s), ("state_period_s", self.state_period_s)] {
            anyhow::ensure!(value > 0.0 && value <= PERIOD_MAX_S, "publish.{key} = {value}: must be above 0 and at most {PERIOD_MAX_S} s");
        }
        Ok(())
    }
}

/// When something periodic is due next, and its period, s.
#[derive(Debug, Clone, Copy, Default)]
pub struct Due(Option<(Timestamp, f64)>);

impl Due {
    /// Whether it is due; what was never done is due at once, and so is what lies further ahead than
    /// a period: then the clock was set back, and an agent must not fall silent for that.
    #[must_use]
    pub fn is(&self, now: Timestamp) -> bool {
        self.0.is_none_or(|(due, period_s)| now >= due || due.seconds_since(now) > period_s)
    }

    /// It was done: due again on the period's grid, or a period from now when that was missed.
    pub fn done(&mut self, now: Timestamp, period_s: f64) {
        let planned = self.0.map_or(now, |(due, _)| due).plus_s(period_s);
        let on_grid = planned > now && planned.seconds_since(now) <= period_s;
        self.0 = Some((if on_grid { planned } else { now.plus_s(period_s) }, period_s));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn stays_on_its_grid_and_skips_what_it_missed() {
        let at = Timestamp::from_unix_ms;
        let mut due = Due::default();
        assert!(due.is(at(0)));
        due.done(at(0), 1.0);
        assert!(!due.is(at(999)) && due.is(at(1_000)));
        due.done(at(1_200), 1.0);
        assert!(!due.is(at(1_999)) && due.is(at(2_000)));
        due.done(at(9_500), 1.0);
        assert!(!due.is(at(10_400)) && due.is(at(10_500)));
    }

    #[test]
    fn a_clock_that_is_set_back_silences_nobody() {
        let at = Timestamp::from_unix_ms;
        let mut due = Due::default();
        due.done(at(3_600_000), 1.0);
        assert!(due.is(at(0)));
        due.done(at(0), 1.0);
        assert!(!due.is(at(999)) && due.is(at(1_000)));
    }
}
