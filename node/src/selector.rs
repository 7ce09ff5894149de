//! A simulated station's battery selector, as configurations and scenarios state it.

use anyhow::ensure;
use energy::selector::{Change, Selector};
use serde::{Deserialize, Serialize};

/// `selector`: what happens while a station changes packs. Without it changes are seamless.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SelectorConfig {
    /// Time without a pack at each change, s; 0 when it makes the new contact before it breaks the
    /// old one.
    pub gap_s: f64,
    /// Capacitance that carries the station through the gap, F.
    pub capacitance_f: f64,
    /// Least voltage at which the station's converters work, V.
    pub least_v: f64,
    /// Time that the station takes to start again when it did not live through a change, s.
    pub restart_s: f64,
}

impl SelectorConfig {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the key and the range.
    pub fn check(&self) -> anyhow::Result<()> {
        let numbers = [
            ("gap_s", self.gap_s, 10.0),
            ("capacitance_f", self.capacitance_f, 1e3),
            ("least_v", self.least_v, 1e3),
            ("restart_s", self.restart_s, 86_400.0),
        ];
        for (key, value, max) in numbers {
            ensure!((0.0..=max).contains(&value), "selector.{key} = {value}: must be between 0 and {max}");
        }
        Ok(())
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> Selector {
        Selector { change: Change::BreakBeforeMake { gap_s: self.gap_s }, capacitance_f: self.capacitance_f, least_v: self.least_v }
    }
}
