//! What the core is told.

use std::sync::Arc;

use proto::{CommandReply, Gauge, PackId, RobotId, RobotState, Schedule, StationId, StationState};

/// What reaches the coordinator.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// A robot's gauge spoke.
    RobotGauge(RobotId, Gauge),
    /// A robot reported its state.
    RobotState(RobotId, RobotState),
    /// A robot appeared (true) or was lost (false).
    RobotAlive(RobotId, bool),
    /// A station reported its state.
    StationState(StationId, StationState),
    /// The gauge of a station's pack spoke.
    PackGauge(StationId, PackId, Gauge),
    /// A station appeared (true) or was lost (false).
    StationAlive(StationId, bool),
    /// A command was answered.
    Reply(CommandReply),
    /// Time passed. To be given about once a second.
    Tick,
    /// Something came that says nothing new, an old copy say: in a journal that is told again.
    Nothing,
    /// Something came that could not be read.
    Refused(String),
    /// Somebody asks for a new plan, and says why.
    Replan(String),
    /// Somebody says that a robot which is not heard any more is gone for good.
    Forget(RobotId),
    /// The study that was given out is done.
    Studied,
    /// The last plan of the coordinator before this one. To be given first.
    Before(Arc<Schedule>),
}

impl Input {
    /// What it is, for logs.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::RobotGauge(..) => "a robot's gauge",
            Self::RobotState(..) => "a robot's state",
            Self::RobotAlive(..) => "a robot that came or went",
            Self::StationState(..) => "a station's state",
            Self::PackGauge(..) => "a pack's gauge",
            Self::StationAlive(..) => "a station that came or went",
            Self::Reply(_) => "an answer to a command",
            Self::Tick => "the clock",
            Self::Nothing => "an old copy",
            Self::Refused(_) => "what could not be read",
            Self::Replan(_) => "a wish for a new plan",
            Self::Forget(_) => "a robot that is gone for good",
            Self::Studied => "a whole plan that was made beside the core",
            Self::Before(_) => "the last plan of the coordinator before",
        }
    }
}
