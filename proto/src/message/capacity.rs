//! What the packs can still pay for.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::check::{self, MessageError};
use crate::codec::Message;
use crate::estimate::Estimate;
use crate::id::{PackId, RobotId, StationId};
use crate::time::Timestamp;

/// What one station pack can still pay for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct PackCapacity {
    /// Where the pack is.
    pub station: StationId,
    /// Which pack.
    pub pack: PackId,
    /// Energy left in it, Wh.
    pub remaining_wh: Estimate,
    /// The part of it that can go into services, Wh.
    pub usable_wh: Estimate,
    /// What one more service takes out of it, Wh (zero or more).
    pub service_wh: Estimate,
    /// Where the energy goes, Wh by cause (robots' batteries, conversion loss, idle ...).
    pub breakdown_wh: BTreeMap<String, f64>,
    /// Further services to expect: as many as the expected values allow.
    pub robots_expected: u32,
    /// Further services that hold with probability `confidence` or more.
    pub robots_promised: u32,
    /// Probability behind `robots_promised` (0 to 1).
    pub confidence: f64,
    /// Energy lacking for one promised service more, Wh (zero or more).
    pub short_for_next_wh: f64,
    /// Whether its station has no power, however many bays it has and whatever its packs hold.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lacks_power: bool,
    /// Whether that service lacks a bay to charge in, however much energy there is.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lacks_bay: bool,
    /// Whether that service lacks a charged spare, however much energy there is.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lacks_spare: bool,
    /// Whether its robot's battery is too hot or too cold to be charged, and stays so, however much energy there is.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lacks_right_temperature: bool,
    /// Service after service, in the order in which they will be wanted, how certainly the pack pays
    /// for all of them up to it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub promises: Vec<Promise>,
}

/// One more service, and how certainly the energy does for it and all before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Promise {
    /// Whose; left out for a further one like the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub robot: Option<RobotId>,
    /// Where it is planned to be charged to less than the usual level: to which (0 to 1).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub part_to_soc: Option<f64>,
    /// Probability that there is enough (0 to 1).
    pub probability: f64,
    /// What all services up to this one take, with what the station takes meanwhile, Wh (zero or more).
    pub need_wh: Estimate,
}

/// What all packs of a station together can still pay for: a service may begin on one and end
/// on the next.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StationCapacity {
    /// Which station.
    pub station: StationId,
    /// Energy that can go into services, Wh.
    pub usable_wh: Estimate,
    /// Further services to expect.
    pub robots_expected: u32,
    /// Further services that hold with the probability `confidence`.
    pub robots_promised: u32,
    /// Energy lacking for one promised service more, Wh (zero or more).
    pub short_for_next_wh: f64,
    /// Whether its station has no power, however many bays it has and whatever its packs hold.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lacks_power: bool,
    /// Whether that service lacks a bay to charge in, however much energy there is.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lacks_bay: bool,
    /// Whether that service lacks a charged spare, however much energy there is.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lacks_spare: bool,
    /// Whether its robot's battery is too hot or too cold to be charged, and stays so, however much energy there is.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub lacks_right_temperature: bool,
    /// Service after service; see [`PackCapacity::promises`].
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub promises: Vec<Promise>,
}

/// What all packs of the site can still pay for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Capacity {
    /// When it was computed.
    pub at: Timestamp,
    /// Pack by pack.
    pub packs: Vec<PackCapacity>,
    /// Station by station.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub stations: Vec<StationCapacity>,
    /// Further services to expect at the whole site.
    pub robots_expected: u32,
    /// Further services at the whole site that hold with probability `confidence`.
    pub robots_promised: u32,
    /// Probability behind `robots_promised` (0 to 1).
    pub confidence: f64,
}

impl Capacity {
    /// The packs at a station.
    pub fn packs_at(&self, station: &StationId) -> impl Iterator<Item = &PackCapacity> {
        self.packs.iter().filter(move |pack| pack.station == *station)
    }
}

impl Message for Capacity {
    const SCHEMA: &'static str = "tender.capacity/1";

    fn validate(&self) -> Result<(), MessageError> {
        for (index, pack) in self.packs.iter().enumerate() {
            let field = |name: &str| format!("packs[{index}].{name}");
            check::estimate(field("remaining_wh"), pack.remaining_wh)?;
            check::estimate(field("usable_wh"), pack.usable_wh)?;
            check::estimate_not_negative(field("service_wh"), pack.service_wh)?;
            for (cause, &energy_wh) in &pack.breakdown_wh {
                check::finite(field(&format!("breakdown_wh.{cause}")), energy_wh)?;
            }
            check::within(field("confidence"), pack.confidence, 0.0, 1.0)?;
            check::not_negative(field("short_for_next_wh"), pack.short_for_next_wh)?;
            promises(&field("promises"), &pack.promises)?;
        }
        for (index, station) in self.stations.iter().enumerate() {
            let field = |name: &str| format!("stations[{index}].{name}");
            check::estimate(field("usable_wh"), station.usable_wh)?;
            check::not_negative(field("short_for_next_wh"), station.short_for_next_wh)?;
            promises(&field("promises"), &station.promises)?;
        }
        check::within("confidence", self.confidence, 0.0, 1.0)
    }
}

fn promises(field: &str, promises: &[Promise]) -> Result<(), MessageError> {
    for (index, promise) in promises.iter().enumerate() {
        check::within(format_args!("{field}[{index}].probability"), promise.probability, 0.0, 1.0)?;
        check::estimate_not_negative(format_args!("{field}[{index}].need_wh"), promise.need_wh)?;
        if let Some(to_soc) = promise.part_to_soc {
            check::within(format_args!("{field}[{index}].part_to_soc"), to_soc, 0.0, 1.0)?;
        }
    }
    Ok(())
}
