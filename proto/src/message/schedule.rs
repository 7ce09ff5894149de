//! What the coordinator decided, and why.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use super::check::{self, MessageError};
use super::display_as_on_the_wire;
use crate::codec::Message;
use crate::estimate::Estimate;
use crate::id::{BayId, PackId, RobotId, SpareId, StationId};
use crate::time::Timestamp;

/// How a robot gets its energy.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "mode", rename_all = "snake_case")]
pub enum Mode {
    /// Its battery is charged in a bay.
    Recharge {
        /// Target state of charge, a fraction (0 to 1).
        to_soc: f64,
    },
    /// Its battery is exchanged.
    Swap {
        /// For which spare.
        spare: SpareId,
    },
}

/// How far a service has come.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ServiceStatus {
    /// Only a plan so far.
    Planned,
    /// The robot is on its way.
    Travelling,
    /// The robot waits at the station.
    Waiting,
    /// The robot is being taken in.
    Loading,
    /// The robot is charging.
    Charging,
    /// Its battery is being exchanged.
    Swapping,
    /// The robot is being let out.
    Unloading,
    /// Ended as planned.
    Done,
    /// Ended otherwise.
    Failed,
}
display_as_on_the_wire!(ServiceStatus);

/// One visit of one robot to one station. On the wire the fields of `mode` stand among
/// the others: `"mode": "recharge", "to_soc": 0.9`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Service {
    /// Who is serviced.
    pub robot: RobotId,
    /// Where.
    pub station: StationId,
    /// How.
    #[serde(flatten)]
    pub mode: Mode,
    /// In which bay, once that is decided.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub bay: Option<BayId>,
    /// The packs that pay for it, in the order in which they are drawn from.
    pub packs: Vec<PackId>,
    /// When the robot leaves its work.
    pub leave: Timestamp,
    /// When the service begins at the station; of one that has begun, when it did.
    pub start: Timestamp,
    /// When the robot is out again; not before `start`. Of one that is out and not heard yet, when it came out.
    pub end: Timestamp,
    /// Energy taken from the packs, Wh (zero or more).
    pub pack_energy_wh: Estimate,
    /// Probability that the packs hold enough for all that is drawn until its end, also by services beside it, and
    /// that the robot lasts until its begin where that is not sure enough (0 to 1), as of when it was planned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// How far it has come.
    pub status: ServiceStatus,
    /// Why this station, mode and time.
    pub why: Arc<[String]>,
}

impl Service {
    fn validate(&self, field: &str) -> Result<(), MessageError> {
        if let Mode::Recharge { to_soc } = self.mode {
            check::within(format_args!("{field}.to_soc"), to_soc, 0.0, 1.0)?;
        }
        let ordered = self.end >= self.start;
        check::require(ordered, format_args!("{field}.end"), self.end, "not before `start`")?;
        check::within(format_args!("{field}.probability"), self.probability.unwrap_or(1.0), 0.0, 1.0)?;
        check::estimate_not_negative(format_args!("{field}.pack_energy_wh"), self.pack_energy_wh)
    }
}

/// A robot without a service in this plan.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Unserved {
    /// Which robot.
    pub robot: RobotId,
    /// Whether it runs empty for want of one, or can do without for as long as is planned.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub runs_empty: bool,
    /// What stands in the way, station by station where that differs.
    pub reasons: Vec<String>,
}

/// A model that no longer explains what is measured, and what to do about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Doubt {
    /// The robot whose battery or load the model describes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<RobotId>,
    /// The station whose load, or whose pack, the model describes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub station: Option<StationId>,
    /// That pack.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pack: Option<PackId>,
    /// When measurements began to lie to one side of the model.
    pub since: Timestamp,
    /// How far, on average since then, in standard deviations.
    pub z: f64,
    /// All of it in a sentence.
    pub text: String,
    /// What finds out what the model lacks.
    pub command: String,
}

impl Doubt {
    fn validate(&self, field: &str) -> Result<(), MessageError> {
        check::finite(format_args!("{field}.z"), self.z)
    }
}

/// The plan in force.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Schedule {
    /// When it was made.
    pub at: Timestamp,
    /// Counts up by one per plan.
    pub plan: u64,
    /// Name of the scheduling policy.
    pub policy: String,
    /// What made the coordinator plan again.
    pub trigger: String,
    /// Services running and to come.
    pub services: Vec<Service>,
    /// Robots that cannot be serviced.
    pub unserved: Vec<Unserved>,
    /// Models that no longer explain what is measured; forecasts that rest on them are
    /// taken to be less certain meanwhile.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<Doubt>,
    /// How good the plan is, and what is proven about it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub quality: Option<Quality>,
}

/// How good a plan is: what it amounts to, and below what no plan can be.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Quality {
    /// Robots that run empty.
    pub stranded: u32,
    /// No plan strands fewer.
    pub stranded_bound: u32,
    /// Work that robots miss, weighted by its worth, s (zero or more).
    pub missed_s: f64,
    /// No plan that strands as few misses less, s (zero or more). 0 says nothing: the plan of a large fleet
    /// that was only mended is not bounded.
    pub missed_bound_s: f64,
    /// Robots that the plan before had promised another service, or one at all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub moved: Vec<RobotId>,
}

impl Quality {
    /// How far the missed work may be from the least, as a share of it; 0 is proven best, none has no bound to say it by.
    #[must_use]
    pub fn gap(&self) -> Option<f64> {
        let over_s = (self.missed_s - self.missed_bound_s).max(0.0);
        (over_s == 0.0 || self.missed_bound_s > 0.0).then(|| over_s / self.missed_bound_s.max(1.0))
    }
}

impl Message for Schedule {
    const SCHEMA: &'static str = "tender.schedule/1";

    fn validate(&self) -> Result<(), MessageError> {
        for (index, service) in self.services.iter().enumerate() {
            service.validate(&format!("services[{index}]"))?;
        }
        for (index, doubt) in self.doubts.iter().enumerate() {
            doubt.validate(&format!("doubts[{index}]"))?;
        }
        if let Some(quality) = &self.quality {
            check::not_negative("quality.missed_s", quality.missed_s)?;
            check::not_negative("quality.missed_bound_s", quality.missed_bound_s)?;
        }
        Ok(())
    }
}

/// A way to service a robot that was not taken.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Alternative {
    /// Where.
    pub station: StationId,
    /// How: `recharge` or `swap`.
    pub mode: String,
    /// When it could begin, if at all.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub start: Option<Timestamp>,
    /// Why it is worse, or impossible.
    pub why_not: Vec<String>,
}

/// Why one robot is scheduled as it is.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Explanation {
    /// When the question was answered.
    pub at: Timestamp,
    /// Which robot.
    pub robot: RobotId,
    /// Its service, if it has one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub service: Option<Service>,
    /// Why so.
    pub reasons: Vec<String>,
    /// What else there was.
    pub alternatives: Vec<Alternative>,
    /// What would have to change for an earlier service.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub earlier: Vec<String>,
    /// What is different from the plan before, and which message brought it about.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub changed: Vec<String>,
    /// Doubts in the models of this robot and of the station that services it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub doubts: Vec<Doubt>,
}

impl Message for Explanation {
    const SCHEMA: &'static str = "tender.explanation/1";

    fn validate(&self) -> Result<(), MessageError> {
        for (index, doubt) in self.doubts.iter().enumerate() {
            doubt.validate(&format!("doubts[{index}]"))?;
        }
        match &self.service {
            Some(service) => service.validate("service"),
            None => Ok(()),
        }
    }
}
