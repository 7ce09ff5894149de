//! Key expressions with wildcards, for subscribers.

use crate::id::{RobotId, SiteId, StationId};
use crate::key::{ROOT, VERSION};

/// A set of keys of one site to subscribe to.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Pattern {
    /// [`Key::RobotGauge`](crate::Key::RobotGauge) of every robot.
    AllRobotGauges,
    /// [`Key::RobotState`](crate::Key::RobotState) of every robot.
    AllRobotStates,
    /// [`Key::StationState`](crate::Key::StationState) of every station.
    AllStationStates,
    /// [`Key::PackGauge`](crate::Key::PackGauge) of every pack of every station.
    AllPackGauges,
    /// Liveliness of every robot and every station. The coordinator's own token has one
    /// chunk less and is not included: watch [`Key::CoordinatorAlive`](crate::Key).
    AllAlive,
    /// [`Key::Explain`](crate::Key::Explain) of every robot.
    AllExplains,
    /// [`Key::SimSupply`](crate::Key::SimSupply) to one robot, from whichever station.
    SimSupplyTo(RobotId),
    /// [`Key::SimDraw`](crate::Key::SimDraw) at one station, by whichever robot.
    SimDrawAt(StationId),
}

/// Liveliness of the coordinator of whichever site: for who does not know which are there.
pub fn any_coordinator_alive() -> String {
    format!("{ROOT}/*/{VERSION}/coordinator/alive")
}

impl Pattern {
    /// The key expression of this pattern at `site`.
    pub fn build(&self, site: &SiteId) -> String {
        let tail = match self {
            Self::AllRobotGauges => "robot/*/gauge".to_owned(),
            Self::AllRobotStates => "robot/*/state".to_owned(),
            Self::AllStationStates => "station/*/state".to_owned(),
            Self::AllPackGauges => "station/*/pack/*/gauge".to_owned(),
            Self::AllAlive => "*/*/alive".to_owned(),
            Self::AllExplains => "coordinator/explain/*".to_owned(),
            Self::SimSupplyTo(robot) => format!("sim/station/*/robot/{robot}/supply"),
            Self::SimDrawAt(station) => format!("sim/station/{station}/robot/*/draw"),
        };
        format!("{ROOT}/{site}/{VERSION}/{tail}")
    }
}
