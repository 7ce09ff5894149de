//! Bays, lift, packs and spares of one station.

use serde::{Deserialize, Serialize};

use super::check::{self, MessageError};
use super::display_as_on_the_wire;
use crate::codec::Message;
use crate::estimate::Estimate;
use crate::id::{BayId, CommandId, PackId, RobotId, SpareId};
use crate::time::Timestamp;

/// What a bay is doing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum BayPhase {
    /// Empty.
    Free,
    /// A robot is being taken in.
    Loading,
    /// A robot is in it.
    Occupied,
    /// A robot is being let out.
    Unloading,
    /// Out of order.
    Failed,
}
display_as_on_the_wire!(BayPhase);

/// One bay.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct BayState {
    /// Which bay.
    pub bay: BayId,
    /// What it is doing.
    pub phase: BayPhase,
    /// The robot in it, or on its way in or out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<RobotId>,
}

/// One exchange battery in the station's store.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SpareState {
    /// Which spare.
    pub spare: SpareId,
    /// Its state of charge, a fraction (-0.05 to 1.05).
    pub soc: Estimate,
    /// Whether it may be put into a robot now.
    pub ready: bool,
    /// Name of the battery model that describes it, as robots name theirs; left out where it is what the station's robots have.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub battery: Option<String>,
}

/// The pack that will stand in a place which is empty now, say because its own was taken to a depot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct PackReturn {
    /// When it is expected there.
    pub at: Timestamp,
    /// Its state of charge then, a fraction (-0.05 to 1.05).
    pub soc: Estimate,
}

/// One energy store of the station. Its charge is told by its own [`Gauge`](crate::Gauge).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PackState {
    /// Which pack.
    pub pack: PackId,
    /// Whether it is plugged in.
    pub connected: bool,
    /// Whether it has reached the end of its discharge.
    pub depleted: bool,
    /// What comes into its place while it is not plugged in, where that is known: plans count on it from then on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub back: Option<PackReturn>,
}

/// The state of one station.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StationState {
    /// Instant of the report.
    pub at: Timestamp,
    /// Counts up by one per message, from the start of the sender; gaps are losses.
    pub seq: u64,
    /// Every bay, each once.
    pub bays: Vec<BayState>,
    /// Whether the lift that loads and unloads robots is moving.
    pub lift_busy: bool,
    /// The robot whose battery is being exchanged.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub swapping: Option<RobotId>,
    /// Every pack, each once.
    pub packs: Vec<PackState>,
    /// The pack that feeds the station; one of `packs`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub active_pack: Option<PackId>,
    /// Whether the bays have power.
    pub powered: bool,
    /// Power drawn from the active pack, W; discharge positive.
    pub pack_power_w: f64,
    /// When it will have arrived, while it is on its way: until then no robot can come in, and travel times are to where
    /// it will stand.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub arrives: Option<Timestamp>,
    /// When it is away after it stands, one after the other: services end before, or begin once it is back. Empty while it stays.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub away: Vec<Absence>,
    /// Every spare, each once.
    pub spares: Vec<SpareState>,
    /// The last command it accepted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub last_command: Option<CommandId>,
    /// Anything a person should know.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub note: Option<String>,
}

/// A time for which a station is away from where it takes robots in.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Absence {
    /// When it sets off.
    pub leaves: Timestamp,
    /// When it takes robots in once more, there or elsewhere. None where that is not known: nobody is planned for then.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub returns: Option<Timestamp>,
}

impl Message for StationState {
    const SCHEMA: &'static str = "tender.station-state/1";

    fn validate(&self) -> Result<(), MessageError> {
        check::distinct("bays", self.bays.iter().map(|bay| &bay.bay))?;
        check::distinct("packs", self.packs.iter().map(|pack| &pack.pack))?;
        check::distinct("spares", self.spares.iter().map(|spare| &spare.spare))?;
        if let Some(active) = &self.active_pack {
            let listed = self.packs.iter().any(|pack| &pack.pack == active);
            check::require(listed, "active_pack", active, "one of `packs`")?;
        }
        check::finite("pack_power_w", self.pack_power_w)?;
        for (pack, back) in self.packs.iter().filter_map(|pack| Some((&pack.pack, pack.back?))) {
            check::soc_estimate(format_args!("packs.{pack}.back.soc"), back.soc)?;
        }
        for spare in &self.spares {
            check::soc_estimate(format_args!("spares.{}.soc", spare.spare), spare.soc)?;
        }
        Ok(())
    }
}
