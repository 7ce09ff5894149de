//! A depot that exchanges a simulated station's packs: the same key in scenarios and in the station
//! agent's configuration.

use anyhow::ensure;
use energy::units::S_PER_DAY;
use serde::{Deserialize, Serialize};

/// `depot`: when a pack of a station is exchanged, how long that takes, and what comes back.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Depot {
    /// A pack that does not feed the station is taken away below this state of charge.
    pub below_soc: f64,
    /// Time until a charged pack is in its place, s.
    pub away_s: f64,
    /// State of charge of the pack that is brought.
    #[serde(default = "default_soc")]
    pub soc: f64,
    /// How many packs may be away at once.
    #[serde(default = "default_at_once")]
    pub at_once: u32,
}

fn default_soc() -> f64 {
    1.0
}

fn default_at_once() -> u32 {
    1
}

impl Depot {
    /// Checks the ranges.
    ///
    /// # Errors
    /// Names the key and the range.
    pub fn check(&self) -> anyhow::Result<()> {
        for (key, value, max) in [("below_soc", self.below_soc, 1.0), ("soc", self.soc, 1.0), ("away_s", self.away_s, 30.0 * S_PER_DAY)] {
            ensure!((0.0..=max).contains(&value), "depot.{key} = {value}: must be between 0 and {max}");
        }
        ensure!(self.at_once >= 1, "depot.at_once = 0: at least one pack must be let go, or nothing is ever exchanged");
        ensure!(
            self.soc > self.below_soc,
            "depot.soc = {} must lie above depot.below_soc = {}: what is brought would be taken away again",
            self.soc,
            self.below_soc
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_depot_that_brings_what_it_takes_away_is_refused() {
        let depot = Depot { below_soc: 0.2, away_s: 600.0, soc: 1.0, at_once: 1 };
        depot.check().unwrap();
        let refused = |depot: Depot| depot.check().unwrap_err().to_string();
        assert!(refused(Depot { soc: 0.2, ..depot }).contains("must lie above depot.below_soc = 0.2"));
        assert!(refused(Depot { at_once: 0, ..depot }).contains("depot.at_once = 0"));
        assert!(refused(Depot { away_s: -1.0, ..depot }).contains("depot.away_s = -1: must be between 0 and"));
    }
}
