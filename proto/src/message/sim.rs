//! The electrical coupling between simulated bodies. In reality a wire carries it; only
//! simulated robots and stations send these.

use serde::{Deserialize, Serialize};

use super::check::{self, MessageError};
use crate::codec::Message;
use crate::estimate::Estimate;
use crate::time::Timestamp;

/// What a simulated station feeds to a simulated robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SimSupply {
    /// Instant it holds from.
    pub at: Timestamp,
    /// Whether the bay has power.
    pub powered: bool,
    /// State of charge of a battery just put in, a fraction (-0.05 to 1.05).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub exchanged: Option<Estimate>,
    /// Whether the robot sits in the bay.
    pub docked: bool,
    /// Most power into the robot's battery, W (zero or more); none for no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub charge_w_max: Option<f64>,
}

impl Message for SimSupply {
    const SCHEMA: &'static str = "tender.sim-supply/1";

    fn validate(&self) -> Result<(), MessageError> {
        if let Some(soc) = self.exchanged {
            check::soc_estimate("exchanged", soc)?;
        }
        self.charge_w_max.map_or(Ok(()), |charge_w_max| check::not_negative("charge_w_max", charge_w_max))
    }
}

/// What a simulated robot draws from a simulated station.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SimDraw {
    /// Instant it holds from.
    pub at: Timestamp,
    /// Power taken at the bay, W (zero or more).
    pub charge_power_w: f64,
    /// Current taken at the bay, A (zero or more).
    pub charge_current_a: f64,
    /// Voltage at the robot's terminals, V (zero or more).
    pub voltage_v: f64,
    /// Whether it is charging.
    pub charging: bool,
    /// State of charge of the battery that it left at its last exchange, a fraction (-0.05 to 1.05).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub left_soc: Option<f64>,
    /// Power that the robot takes from its bay beside its battery, W (zero or more); none when its
    /// body does not tell.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub own_load_w: Option<f64>,
}

impl Message for SimDraw {
    const SCHEMA: &'static str = "tender.sim-draw/1";

    fn validate(&self) -> Result<(), MessageError> {
        check::not_negative("charge_power_w", self.charge_power_w)?;
        check::not_negative("charge_current_a", self.charge_current_a)?;
        check::not_negative("voltage_v", self.voltage_v)?;
        self.left_soc.map_or(Ok(()), |soc| check::within("left_soc", soc, -0.05, 1.05))?;
        self.own_load_w.map_or(Ok(()), |own_load_w| check::not_negative("own_load_w", own_load_w))
    }
}
