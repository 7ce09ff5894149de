//! What the core asks to be kept. Plain data: no database in here.

use std::sync::Arc;

use proto::{
    Capacity, CommandReply, Event, Explanation, Gauge, PackId, RobotCommand, RobotId, RobotState, Schedule, StationCommand, StationId,
    StationState,
};

use super::Heard;

/// One thing to keep.
#[derive(Debug, Clone, PartialEq)]
pub enum Record {
    /// A robot's gauge spoke.
    RobotGauge {
        /// Which robot.
        robot: RobotId,
        /// What it said.
        gauge: Gauge,
    },
    /// The gauge of a station's pack spoke.
    PackGauge {
        /// Where the pack is.
        station: StationId,
        /// Which pack.
        pack: PackId,
        /// What it said.
        gauge: Gauge,
    },
    /// A robot reported its state.
    RobotState {
        /// Which robot.
        robot: RobotId,
        /// Its state.
        state: RobotState,
    },
    /// A station reported its state.
    StationState {
        /// Which station.
        station: StationId,
        /// Its state.
        state: StationState,
    },
    /// Something happened.
    Event(Event),
    /// A plan was made.
    Plan(Arc<Schedule>),
    /// The packs' capacity was computed.
    Capacity(Capacity),
    /// Robots' places in the plan were explained; replaces what was kept of these robots.
    Explanations(Vec<Explanation>),
    /// A command goes to a robot.
    RobotCommand {
        /// To which.
        robot: RobotId,
        /// The command.
        command: RobotCommand,
    },
    /// A command goes to a station.
    StationCommand {
        /// To which.
        station: StationId,
        /// The command.
        command: StationCommand,
    },
    /// A command was answered; kept with its command, the first answer only.
    Reply(CommandReply),
    /// The core was told something; stands before the records that came of it.
    Heard(Heard),
}

impl Record {
    /// Whether it is something that the core decided, or noticed.
    #[must_use]
    pub fn is_decision(&self) -> bool {
        self.is_event() || self.is_command() || self.is_plan()
    }

    pub(crate) fn is_event(&self) -> bool {
        matches!(self, Record::Event(_))
    }

    pub(crate) fn is_command(&self) -> bool {
        matches!(self, Record::RobotCommand { .. } | Record::StationCommand { .. })
    }

    pub(crate) fn is_plan(&self) -> bool {
        matches!(self, Record::Plan(_))
    }

    /// Whether it is a plan or something that is told with one, and as large as the fleet.
    #[must_use]
    pub fn tells_of_fleet(&self) -> bool {
        matches!(self, Record::Plan(_) | Record::Capacity(_) | Record::Explanations(_))
    }

    /// Whether it is one of many of its kind, and may be dropped where there is no room.
    #[must_use]
    pub fn is_telemetry(&self) -> bool {
        use Record::{Heard, PackGauge, RobotGauge, RobotState, StationState};
        matches!(self, RobotGauge { .. } | PackGauge { .. } | RobotState { .. } | StationState { .. } | Heard(_))
    }
}
