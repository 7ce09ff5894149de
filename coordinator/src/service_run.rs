//! A service that has begun, and the commands that carry it on.

use std::sync::Arc;

use proto::{
    BayId, BayPhase, CommandId, Gauge, PackId, RobotAction, RobotId, RobotPhase, RobotState, ServiceStatus, SpareId, StationAction,
    StationId, Timestamp,
};

use crate::fleet::{Robot, Station};
use energy::{Estimate, Need};

/// A battery is not charged that takes less than this share of what it holds per hour: a charge usually ends at a few times as much.
const NO_CHARGE_PER_H: f64 = 0.01;

/// How a robot is serviced.
#[derive(Debug, Clone, PartialEq)]
pub enum How {
    /// Recharge in a bay.
    Recharge {
        /// The bay.
        bay: BayId,
        /// Level at which it is done.
        to_soc: f64,
    },
    /// Exchange of its pack.
    Swap {
        /// The spare that it gets.
        spare: SpareId,
    },
}

impl How {
    /// Level at which a recharge is done.
    #[must_use]
    pub fn to_soc(&self) -> Option<f64> {
        if let How::Recharge { to_soc, .. } = self { Some(*to_soc) } else { None }
    }

    /// The spare that an exchange gives.
    #[must_use]
    pub fn spare(&self) -> Option<&SpareId> {
        if let How::Swap { spare } = self { Some(spare) } else { None }
    }
}

/// Where a service stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stage {
    /// The robot is on its way.
    Travelling,
    /// The robot stands at the station.
    Waiting,
    /// The lift takes it in.
    Loading,
    /// It charges.
    Charging,
    /// It charges in a bay into which it drove by itself.
    ChargingItself,
    /// Its pack is about to be exchanged: the robot knows, the station does not yet.
    Handing,
    /// Its pack is being exchanged.
    Swapping,
    /// The lift lets it out.
    Unloading,
    /// The station has let it out, and it has not said so yet.
    LetOut,
}

/// A service that has begun.
#[derive(Debug, Clone, PartialEq)]
pub struct ServiceRun {
    /// The robot.
    pub robot: RobotId,
    /// The station.
    pub station: StationId,
    /// How.
    pub how: How,
    /// When the robot left its work.
    pub left: Timestamp,
    /// When the service was to begin; once it has, when it did.
    pub start: Timestamp,
    /// When it is expected to end; once the robot is out of its bay, when it did.
    pub end: Timestamp,
    /// What it was planned to take from the station's packs.
    pub need: Need,
    /// Packs that pay.
    pub packs: Vec<PackId>,
    /// Why it was planned so.
    pub why: Arc<[String]>,
    /// Where it stands.
    pub stage: Stage,
    /// The command that waits for an answer.
    pub asked: Option<CommandId>,
    /// State of charge of the pack that it hands over, as its robot's gauge said before: after that it may speak of the other one.
    pub hands_over: Option<Estimate>,
    /// Since when its robot takes no charge in its bay.
    pub takes_none_since: Option<Timestamp>,
    /// Since when its station is no longer at an exchange that its robot waits for.
    pub called_off_since: Option<Timestamp>,
    /// Why its robot was let go before it was charged.
    pub cut_short: Option<String>,
    /// What is asked again, since it could not be done at the moment or nothing came of it.
    pub again: Option<Again>,
}

/// A command that is asked again.
#[derive(Debug, Clone, PartialEq)]
pub struct Again {
    /// When.
    pub at: Timestamp,
    /// How often it was asked.
    pub times: u32,
    /// Why nothing came of it.
    pub why: String,
    /// What the robot said that it does: once that is something else, nothing is waited for.
    pub phase: Option<RobotPhase>,
}

/// What carries a service on.
#[derive(Debug, Clone, PartialEq)]
pub enum Step {
    /// Nothing to do but wait.
    Wait,
    /// The stage has changed by itself.
    Enter(Stage),
    /// Ask the robot, and enter the stage when it accepts.
    AskRobot(RobotAction, Stage),
    /// Ask the station, and enter the stage when it accepts.
    AskStation(StationAction, Stage),
    /// It is done.
    Done,
    /// It cannot go on.
    Fail(String),
}

impl ServiceRun {
    /// Whether its robot has still to come to its place.
    #[must_use]
    pub fn under_way(&self) -> bool {
        matches!(self.stage, Stage::Travelling | Stage::Waiting)
    }

    /// Whether its robot takes up its place: no longer under way, and not yet let out.
    #[must_use]
    pub fn at_place(&self) -> bool {
        !self.under_way() && self.stage != Stage::LetOut
    }

    /// Whether its robot should be charged and nothing to speak of flows: it is too hot or too cold, or its charger gives nothing.
    #[must_use]
    pub fn takes_no_charge(&self, gauge: &Gauge, state: &RobotState) -> bool {
        let charges = matches!(self.stage, Stage::Charging | Stage::ChargingItself)
            && matches!(state.phase, RobotPhase::Charging | RobotPhase::Docked);
        charges && gauge.power_w > -NO_CHARGE_PER_H * gauge.full_wh.value
    }

    /// Enters a stage.
    pub fn enter(&mut self, stage: Stage, now: Timestamp) {
        let before = (self.under_way(), self.stage);
        if stage != before.1 || stage == Stage::Travelling {
            self.again = None;
        }
        self.stage = stage;
        if before.0 && self.at_place() {
            self.end = self.end.plus_s(now.seconds_since(self.start));
            self.start = now;
        }
        if stage == Stage::Travelling {
            self.left = now;
        }
        if stage == Stage::Unloading {
            self.end = self.end.max(now);
        }
        if stage == Stage::LetOut && before.1 != Stage::LetOut {
            self.end = now;
        }
    }

    /// Whether its robot comes, or came, into this bay.
    #[must_use]
    pub fn is_in(&self, station: &StationId, bay: &BayId) -> bool {
        self.station == *station && matches!(&self.how, How::Recharge { bay: own, .. } if own == bay)
    }

    /// The first command: the robot leaves its work.
    #[must_use]
    pub fn first(&self) -> RobotAction {
        let bay = match &self.how {
            How::Recharge { bay, .. } => Some(bay.clone()),
            How::Swap { .. } => None,
        };
        RobotAction::Dock { station: self.station.clone(), bay }
    }

    /// Whether the robot has not reached its bay or exchange yet.
    #[must_use]
    pub fn before_bay(&self) -> bool {
        matches!(self.stage, Stage::Travelling | Stage::Waiting | Stage::Loading | Stage::Handing)
    }

    /// What to do next, given the newest word of robot and station.
    #[must_use]
    pub fn next(&self, robot: &Robot, station: &Station) -> Step {
        // That it is out its station knows; that it was charged it has said itself before, heard since or not.
        match (&self.how, self.stage) {
            (How::Recharge { bay, .. }, Stage::Unloading) if station.heard().is_some() && !self.held(bay, station) => {
                return Step::Enter(Stage::LetOut);
            }
            (_, Stage::LetOut) if robot.is_lost() => return Step::Done,
            _ => {}
        }
        let (Some((gauge, state)), Some(place)) = (robot.heard(), station.heard()) else { return Step::Wait };
        if state.phase == RobotPhase::Stranded {
            return Step::Fail("the robot is stranded".to_owned());
        }
        if !place.powered {
            return Step::Fail("the station has no power".to_owned());
        }
        match (&self.how, self.stage, state.phase) {
            (_, Stage::Travelling, RobotPhase::Waiting) => Step::Enter(Stage::Waiting),
            // By its own rule, while nobody was heard: then it has what it came for, or gave it up.
            (_, Stage::Waiting | Stage::Loading | Stage::Handing, RobotPhase::Working) => Step::Fail("it has gone back to work".to_owned()),
            // It drove into its bay by itself: no lift is asked to take it in.
            (How::Recharge { to_soc, .. }, Stage::Travelling | Stage::Waiting, RobotPhase::Docked | RobotPhase::Charging) => {
                Step::AskRobot(RobotAction::ChargeTo { soc: *to_soc }, Stage::ChargingItself)
            }
            (How::Recharge { bay, .. }, Stage::Waiting, RobotPhase::Waiting) => match station.bay_phase(bay) {
                Some(BayPhase::Free) => {
                    Step::AskStation(StationAction::Dock { robot: self.robot.clone(), bay: bay.clone() }, Stage::Loading)
                }
                Some(BayPhase::Failed) | None => Step::Fail(format!("bay {bay} is out of order")),
                Some(_) => Step::Wait,
            },
            // The lift gave up: the robot is still before it.
            (How::Recharge { bay, .. }, Stage::Loading, RobotPhase::Waiting) if station.bay_phase(bay) == Some(BayPhase::Failed) => {
                Step::Fail(format!("bay {bay} is out of order"))
            }
            (How::Recharge { to_soc, .. }, Stage::Loading, RobotPhase::Docked | RobotPhase::Charging | RobotPhase::Charged) => {
                Step::AskRobot(RobotAction::ChargeTo { soc: *to_soc }, Stage::Charging)
            }
            // It drives out by itself too, unless a lift holds it after all.
            (How::Recharge { bay, .. }, Stage::ChargingItself, RobotPhase::Charged) if !self.held(bay, station) => Step::Wait,
            (How::Recharge { bay, .. }, Stage::Charging | Stage::ChargingItself, RobotPhase::Charged) => {
                Step::AskStation(StationAction::Undock { robot: self.robot.clone(), bay: bay.clone() }, Stage::Unloading)
            }
            (How::Recharge { bay, to_soc }, Stage::LetOut | Stage::ChargingItself, RobotPhase::Working) => {
                match self.held(bay, station) {
                    true => Step::Wait,
                    // Three standard deviations of two gauges' disagreement about the last percent.
                    false if gauge.soc.value >= to_soc - 0.03 => Step::Done,
                    false => {
                        let why = self.cut_short.iter().map(|why| format!(": {why}")).collect::<String>();
                        Step::Fail(format!("let go at {:.0} % charge{why}", gauge.soc.value * 100.0))
                    }
                }
            }
            // Restarted without a memory, or moved by hand.
            (How::Recharge { .. }, Stage::Charging, RobotPhase::Working | RobotPhase::Waiting | RobotPhase::Travelling) => {
                Step::Fail("the robot has left its bay".to_owned())
            }
            (How::Swap { spare }, Stage::Waiting, RobotPhase::Waiting) if place.swapping.is_none() => {
                match place.spares.iter().find(|known| known.spare == *spare) {
                    Some(known) if known.ready => {
                        let action = RobotAction::SwapPack { station: self.station.clone(), spare: spare.clone() };
                        Step::AskRobot(action, Stage::Handing)
                    }
                    // It is still charged.
                    Some(_) => Step::Wait,
                    None => Step::Fail(format!("spare {spare} is not there")),
                }
            }
            (How::Swap { spare }, Stage::Handing, RobotPhase::Swapping) => {
                let action = StationAction::SwapPack { robot: self.robot.clone(), spare: spare.clone() };
                Step::AskStation(action, Stage::Swapping)
            }
            // Planned by the gauge of the pack that it left, it would come again at once.
            (How::Swap { .. }, Stage::Swapping, RobotPhase::Working) if robot.is_gauged_since() => Step::Done,
            _ => Step::Wait,
        }
    }

    /// Whether the station says that it holds the robot in that bay.
    fn held(&self, bay: &BayId, station: &Station) -> bool {
        station.bay(bay).is_some_and(|bay| bay.robot.as_ref() == Some(&self.robot))
    }

    /// The stage as it goes on the wire.
    #[must_use]
    pub fn status(&self) -> ServiceStatus {
        match self.stage {
            Stage::Travelling => ServiceStatus::Travelling,
            Stage::Waiting => ServiceStatus::Waiting,
            Stage::Loading => ServiceStatus::Loading,
            Stage::Charging | Stage::ChargingItself => ServiceStatus::Charging,
            Stage::Handing | Stage::Swapping => ServiceStatus::Swapping,
            Stage::Unloading | Stage::LetOut => ServiceStatus::Unloading,
        }
    }
}
