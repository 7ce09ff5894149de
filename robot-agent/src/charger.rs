//! The charger on board of a simulated robot: the same keys in scenarios and in the agent's
//! configuration.

use energy::BatteryFacts;
use energy::charger::{Charger, PowerPath};
use node::mission::above;
use serde::{Deserialize, Serialize};

/// `charger`: how robot, battery and bay are joined. Without it the battery takes its rated charge
/// whatever the robot takes beside it.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ChargerConfig {
    /// The power path.
    pub path: Path,
    /// Most current from the charger's output, A; that of the battery's rated charge when left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub output_a_max: Option<f64>,
}

/// The power path (Kottas, section B.2.1).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Path {
    /// Charger, battery and robot on one node: the robot's own current counts against the charger's.
    Direct,
    /// The robot on the bay, the charger for the battery alone.
    Selected,
}

impl ChargerConfig {
    /// Checks the range.
    ///
    /// # Errors
    /// Names the key and what is allowed.
    pub fn check(&self) -> anyhow::Result<()> {
        self.output_a_max.map_or(Ok(()), |output_a_max| above("charger.output_a_max", output_a_max, 1e4))
    }

    /// The power path, as the physics calls it.
    #[must_use]
    pub fn power_path(&self) -> PowerPath {
        match self.path {
            Path::Direct => PowerPath::Direct,
            Path::Selected => PowerPath::Selected,
        }
    }

    /// The charger for a pack.
    #[must_use]
    pub fn device(&self, facts: &BatteryFacts) -> Charger {
        let usual = Charger::for_pack(facts, self.power_path());
        Charger { output_a_max: self.output_a_max.unwrap_or(usual.output_a_max), ..usual }
    }
}
