//! `[telemetry]`: how much of what is told is taken in, and how long it is kept.

use anyhow::ensure;
use serde::{Deserialize, Serialize};

/// Intake and retention of telemetry, and of what is decided.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TelemetryConfig {
    /// Of a sender that speaks more often, its newest word after this time, s. Changes of state are taken
    /// in at once.
    pub every_s: f64,
    /// Everything is kept this long, days: as long as a journal can be replayed.
    pub fine_days: f64,
    /// Older telemetry is thinned to a row in this time, s.
    pub coarse_s: f64,
    /// And deleted after this, days, as events and commands are.
    pub keep_days: f64,
}

impl Default for TelemetryConfig {
    fn default() -> Self {
        Self { every_s: 0.5, fine_days: 14.0, coarse_s: 60.0, keep_days: 365.0 }
    }
}

/// Longest time between two words of one sender, s: beyond it gauges look frozen.
const EVERY_MAX_S: f64 = 60.0;
/// Greatest number of days.
const DAYS_MAX: f64 = 36_500.0;

impl TelemetryConfig {
    /// Checks every value.
    ///
    /// # Errors
    /// Names the key and the allowed range.
    pub fn check(&self) -> anyhow::Result<()> {
        let within = |key: &str, value: f64, (least, most): (f64, f64)| {
            ensure!((least..=most).contains(&value), "telemetry.{key} = {value}: must be between {least} and {most}");
            Ok(())
        };
        within("every_s", self.every_s, (0.0, EVERY_MAX_S))?;
        within("fine_days", self.fine_days, (0.01, DAYS_MAX))?;
        within("coarse_s", self.coarse_s, (1.0, 3600.0))?;
        within("keep_days", self.keep_days, (self.fine_days, DAYS_MAX))
    }
}
