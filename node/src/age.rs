//! What a simulated pack has lived through: the same key in scenarios and agents' configurations.

use anyhow::ensure;
use energy::Start;
use serde::{Deserialize, Serialize};

/// `age`: the true history of a pack, which effects of ageing go by. Nobody tells the gauge.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Age {
    /// Full cycles so far.
    pub cycle_count: f64,
    /// Days since it was made.
    pub days: f64,
}

/// Greatest count of cycles or days that makes sense.
const MOST: f64 = 1e5;

impl Age {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the key and the range.
    pub fn check(&self) -> anyhow::Result<()> {
        for (key, value) in [("cycle_count", self.cycle_count), ("days", self.days)] {
            ensure!((0.0..=MOST).contains(&value), "age.{key} = {value}: must be between 0 and {MOST}");
        }
        Ok(())
    }

    /// Where such a pack starts.
    #[must_use]
    pub fn start(&self, soc: f64, temperature_degc: f64) -> Start {
        Start { soc, temperature_degc, cycle_count: self.cycle_count, age_days: self.days, history: 0.0, clock_s: 0.0 }
    }
}
