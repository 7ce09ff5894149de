//! Where a robot is in its work, and what reaching each station would cost it.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::check::{self, MessageError};
use super::display_as_on_the_wire;
use crate::codec::Message;
use crate::estimate::Estimate;
use crate::id::{BayId, CommandId, StationId};
use crate::time::Timestamp;

/// What a robot is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RobotPhase {
    /// On its mission.
    Working,
    /// On the way to a station.
    Travelling,
    /// At a station, outside its bays.
    Waiting,
    /// In a bay, without current flowing.
    Docked,
    /// In a bay, charging.
    Charging,
    /// In a bay, charged to the level that was commanded.
    Charged,
    /// Its battery is being exchanged.
    Swapping,
    /// Out of energy, or otherwise unable to move by itself.
    Stranded,
}
display_as_on_the_wire!(RobotPhase);

/// The way from where the robot is now to a station.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Travel {
    /// Travel time, s (zero or more).
    pub time_s: f64,
    /// Energy drawn from the robot's battery on the way, Wh.
    pub energy_wh: Estimate,
}

/// How much the robot's present work matters.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Mission {
    /// Worth of one second of work relative to other robots (zero or more; 1 is usual).
    pub weight: f64,
    /// When the mission ends, if that is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub until: Option<Timestamp>,
}

/// A model by name: built in, or a file on the machine of whoever names it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct NamedModel {
    /// The name or path.
    pub model: String,
    /// Effects of it that are left out; `*` for all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub without: Vec<String>,
}

/// The state of one robot.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RobotState {
    /// Instant of the report.
    pub at: Timestamp,
    /// Counts up by one per message, from the start of the sender; gaps are losses.
    pub seq: u64,
    /// What the robot is doing.
    pub phase: RobotPhase,
    /// The station it travels to, waits at or is docked in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub station: Option<StationId>,
    /// The bay of that station; given only together with `station`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bay: Option<BayId>,
    /// Power drawn while working, W; discharge positive.
    pub drain_w: Estimate,
    /// The way to every station the robot can go to.
    pub travel: BTreeMap<StationId, Travel>,
    /// What its present work is worth.
    pub mission: Mission,
    /// Name of the battery model that describes this robot's battery.
    pub battery: String,
    /// The model of what it draws, as its agent was told of it, for people who compare it with the robot's logs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub load: Option<NamedModel>,
    /// The last command it accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_command: Option<CommandId>,
    /// Anything a person should know.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// Largest drain that a robot may tell, W.
const POWER_W_MAX: f64 = 1e6;
/// Longest way, s: eleven days.
const TIME_S_MAX: f64 = 1e6;
/// Largest energy of a way, Wh.
const ENERGY_WH_MAX: f64 = 1e6;
/// Largest weight of a mission: weights say how robots compare.
const WEIGHT_MAX: f64 = 1e6;

impl Message for RobotState {
    const SCHEMA: &'static str = "tender.robot-state/1";

    fn validate(&self) -> Result<(), MessageError> {
        if let (None, Some(bay)) = (&self.station, &self.bay) {
            check::require(false, "bay", bay, "a bay only together with `station`")?;
        }
        check::estimate_within("drain_w", self.drain_w, POWER_W_MAX)?;
        for (station, travel) in &self.travel {
            check::within(format_args!("travel.{station}.time_s"), travel.time_s, 0.0, TIME_S_MAX)?;
            // May be negative: a way downhill gives energy back.
            check::estimate_within(format_args!("travel.{station}.energy_wh"), travel.energy_wh, ENERGY_WH_MAX)?;
        }
        check::within("mission.weight", self.mission.weight, 0.0, WEIGHT_MAX)
    }
}
