//! One planning problem. Times are seconds from `now`.

use energy::Estimate;
use proto::{BayId, PackId, RobotId, SpareId, StationId};

use crate::forecast::{Handling, Recharge};
use energy::Need;

/// Everything a plan is made from.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Probability with which a promised service must find its energy.
    pub confidence: f64,
    /// Robots that may need a service, in order of id.
    pub robots: Vec<RobotView>,
    /// Stations, in order of id.
    pub stations: Vec<StationView>,
}

/// A robot.
#[derive(Debug, Clone)]
pub struct RobotView {
    /// Which.
    pub robot: RobotId,
    /// Its state of charge.
    pub soc: Estimate,
    /// Time until it is empty if it goes on working, s, pessimistic at the problem's confidence.
    pub empty_s: f64,
    /// Time before which a service is not wanted, s: it has charge enough.
    pub wanted_s: f64,
    /// Charge that it loses while it works, SoC per s.
    pub drain_soc_per_s: f64,
    /// Worth of its work.
    pub weight: f64,
    /// Whether the last plan promised it a service.
    pub promised: bool,
    /// Ways to service it.
    pub options: Vec<OptionView>,
}

/// One way to service a robot.
#[derive(Debug, Clone)]
pub struct OptionView {
    /// Index of the station.
    pub station: usize,
    /// Time to get there, s.
    pub travel_s: f64,
    /// How.
    pub way: Way,
}

/// Recharge or exchange.
#[derive(Debug, Clone)]
pub enum Way {
    /// In a bay.
    Recharge {
        /// Level at which it is done.
        to_soc: f64,
        /// What it takes if the robot is serviced as soon as it is wanted.
        recharge: Recharge,
        /// What each second of waiting adds to the time on the charger, s.
        charge_s_per_s: f64,
        /// What each second of waiting adds to the energy, as a share of it.
        need_share_per_s: f64,
    },
    /// Pack for pack.
    Swap {
        /// What the station's packs give for it.
        need: Need,
    },
}

/// A station.
#[derive(Debug, Clone)]
pub struct StationView {
    /// Which.
    pub station: StationId,
    /// Whether it takes part at all, or why not.
    pub out_of_order: Option<String>,
    /// How long it takes to handle a robot.
    pub handling: Handling,
    /// Its bays.
    pub bays: Vec<BayView>,
    /// Lift movements that are already promised, as (from, to), s.
    pub lift_busy: Vec<(f64, f64)>,
    /// When the place for exchanges is free, s.
    pub swap_free_s: f64,
    /// Its spares.
    pub spares: Vec<SpareView>,
    /// Its packs, in the order in which they are to be drained.
    pub packs: Vec<PackView>,
    /// What services that have begun still take.
    pub committed: Need,
    /// When the last of these ends, s.
    pub committed_until_s: f64,
    /// What the station takes in an hour beside services.
    pub overhead_per_h: Need,
}

/// A bay.
#[derive(Debug, Clone)]
pub struct BayView {
    /// Which.
    pub bay: BayId,
    /// When it is free, s; none while it is out of order.
    pub free_s: Option<f64>,
}

/// A spare pack for robots.
#[derive(Debug, Clone)]
pub struct SpareView {
    /// Which.
    pub spare: SpareId,
    /// Its state of charge.
    pub soc: Estimate,
}

/// A pack of a station.
#[derive(Debug, Clone)]
pub struct PackView {
    /// Which.
    pub pack: PackId,
    /// What it still gives at the station's working power, Wh.
    pub usable_wh: Estimate,
}
