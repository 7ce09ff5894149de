//! What the coordinator believes of robots and stations: the newest word of each.

use std::collections::BTreeMap;

use proto::{BayId, BayPhase, BayState, Gauge, PackId, RobotId, RobotPhase, RobotState, SpareId, StationId, StationState, Timestamp};

/// What is believed of a robot.
#[derive(Debug, Clone, Default)]
pub struct Robot {
    /// Its last gauge message.
    pub gauge: Option<Gauge>,
    /// Its last state message.
    pub state: Option<RobotState>,
    /// Whether it was lost after it had spoken.
    pub lost: bool,
}

impl Robot {
    /// What it is doing, once it has said so.
    #[must_use]
    pub fn phase(&self) -> Option<RobotPhase> {
        self.state.as_ref().map(|state| state.phase)
    }

    /// Gauge and state of a robot that can be planned for.
    #[must_use]
    pub fn known(&self) -> Option<(&Gauge, &RobotState)> {
        if self.lost { None } else { Some((self.gauge.as_ref()?, self.state.as_ref()?)) }
    }
}

/// What is believed of a station.
#[derive(Debug, Clone, Default)]
pub struct Station {
    /// Its last state message.
    pub state: Option<StationState>,
    /// The last gauge message of each pack.
    pub packs: BTreeMap<PackId, Gauge>,
    /// Since when each spare's place holds a pack that a robot left and that is not charged yet.
    pub left: BTreeMap<SpareId, Timestamp>,
    /// Whether it was lost after it had spoken.
    pub lost: bool,
}

impl Station {
    /// State of one bay.
    #[must_use]
    pub fn bay(&self, bay: &BayId) -> Option<&BayState> {
        self.state.as_ref()?.bays.iter().find(|known| known.bay == *bay)
    }

    /// Phase of one bay.
    #[must_use]
    pub fn bay_phase(&self, bay: &BayId) -> Option<BayPhase> {
        self.bay(bay).map(|bay| bay.phase)
    }

    /// The state, once every pack that is in its place has spoken too.
    #[must_use]
    pub fn known(&self) -> Option<&StationState> {
        let state = self.state.as_ref()?;
        let complete = state.packs.iter().filter(|pack| pack.connected).all(|pack| self.packs.contains_key(&pack.pack));
        (complete && !self.lost).then_some(state)
    }
}

/// All robots and stations.
#[derive(Debug, Clone, Default)]
pub struct Fleet {
    /// Robots by id.
    pub robots: BTreeMap<RobotId, Robot>,
    /// Stations by id.
    pub stations: BTreeMap<StationId, Station>,
}

/// Whether a message from `at` is newer than what is known. Messages may come twice or in the
/// wrong order, and a sender's counter restarts with it, so its clock decides.
#[must_use]
pub fn newer(at: Timestamp, known: Option<Timestamp>) -> bool {
    known.is_none_or(|known| at > known)
}
