//! Commands from the coordinator, and their replies.
//!
//! Commands are idempotent: an agent remembers the reply it gave to a command id, gives
//! the same reply to every repetition, and acts at most once. So a coordinator that heard
//! nothing may simply ask again under the same id, until the deadline.
//!
//! `epoch` grows with every start of a coordinator. An agent refuses a command from a
//! smaller epoch than the largest it has seen, so a coordinator that was thought dead
//! cannot steer beside its successor.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::check::{self, MessageError};
use super::display_as_on_the_wire;
use crate::codec::Message;
use crate::id::{BayId, CommandId, PackId, RobotId, SpareId, StationId};
use crate::time::Timestamp;

/// What a robot is told to do.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum RobotAction {
    /// Go to the station and into the bay.
    Dock {
        /// Where to go.
        station: StationId,
        /// Which bay to enter; none: wait there until told.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        bay: Option<BayId>,
    },
    /// Charge in the bay up to a level.
    ChargeTo {
        /// Target state of charge, a fraction (0 to 1).
        soc: f64,
    },
    /// Let the station exchange the battery.
    SwapPack {
        /// Where.
        station: StationId,
        /// For which spare.
        spare: SpareId,
    },
    /// Stop drawing current, leave the bay, go back to work.
    Undock,
}

/// What a station is told to do.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum StationAction {
    /// Take the robot into the bay.
    Dock {
        /// Which robot.
        robot: RobotId,
        /// Into which bay.
        bay: BayId,
    },
    /// Exchange the robot's battery.
    SwapPack {
        /// Which robot.
        robot: RobotId,
        /// For which spare.
        spare: SpareId,
    },
    /// Let the robot out of the bay.
    Undock {
        /// Which robot.
        robot: RobotId,
        /// Out of which bay.
        bay: BayId,
    },
    /// Feed the station from this pack.
    SelectPack {
        /// Which pack.
        pack: PackId,
    },
}

impl fmt::Display for RobotAction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Dock { station, bay: Some(bay) } => write!(f, "dock at {station} {bay}"),
            Self::Dock { station, bay: None } => write!(f, "come to {station}"),
            Self::ChargeTo { soc } => write!(f, "charge to {:.0} %", soc * 100.0),
            Self::SwapPack { station, spare } => write!(f, "swap pack at {station} for {spare}"),
            Self::Undock => f.write_str("undock"),
        }
    }
}

impl fmt::Display for StationAction {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Dock { robot, bay } => write!(f, "dock {robot} in {bay}"),
            Self::SwapPack { robot, spare } => write!(f, "swap the pack of {robot} for {spare}"),
            Self::Undock { robot, bay } => write!(f, "undock {robot} from {bay}"),
            Self::SelectPack { pack } => write!(f, "select {pack}"),
        }
    }
}

/// One command. The same `id` always gets the same reply and acts at most once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Command<A> {
    /// Identifies this command for ever; repetitions carry the same id.
    pub id: CommandId,
    /// Start count of the coordinator that sends it; smaller ones than seen are refused.
    pub epoch: u64,
    /// When it was given.
    pub at: Timestamp,
    /// After this instant it must not be started any more; not before `at`.
    pub deadline: Timestamp,
    /// What to do.
    pub action: A,
}

/// A command to a robot.
pub type RobotCommand = Command<RobotAction>;

/// A command to a station.
pub type StationCommand = Command<StationAction>;

impl<A> Command<A> {
    fn validate_times(&self) -> Result<(), MessageError> {
        let ordered = self.deadline >= self.at;
        check::require(ordered, "deadline", self.deadline, "not before `at`")
    }
}

impl Message for RobotCommand {
    const SCHEMA: &'static str = "tender.robot-command/1";

    fn validate(&self) -> Result<(), MessageError> {
        if let RobotAction::ChargeTo { soc } = self.action {
            check::within("action.soc", soc, 0.0, 1.0)?;
        }
        self.validate_times()
    }
}

impl Message for StationCommand {
    const SCHEMA: &'static str = "tender.station-command/1";

    fn validate(&self) -> Result<(), MessageError> {
        self.validate_times()
    }
}

/// Why a command was refused.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Rejection {
    /// It arrived after its deadline.
    Expired,
    /// A coordinator with a larger epoch has spoken since.
    StaleEpoch,
    /// Something else has to end first; the same action may be tried again later.
    Busy,
    /// It names a bay, pack, spare, robot or station that is not there.
    UnknownTarget,
    /// It cannot be done in the present state.
    NotPossible,
}
display_as_on_the_wire!(Rejection);

/// What became of a command.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "outcome", rename_all = "snake_case")]
pub enum Outcome {
    /// It will be carried out; progress shows in the state messages.
    Accepted,
    /// It was refused and changed nothing.
    Rejected {
        /// The reason, for programs.
        reason: Rejection,
        /// The reason, for people.
        detail: String,
    },
}

/// The answer to a command.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct CommandReply {
    /// The command answered.
    pub id: CommandId,
    /// When it was first decided; repetitions carry the same instant.
    pub at: Timestamp,
    /// What became of it.
    #[serde(flatten)]
    pub outcome: Outcome,
}

impl Message for CommandReply {
    const SCHEMA: &'static str = "tender.command-reply/1";
}
