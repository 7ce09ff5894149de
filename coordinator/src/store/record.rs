//! What the core asks to be kept. Plain data: no database in here.

use proto::{
    Capacity, CommandReply, Event, Explanation, Gauge, PackId, RobotCommand, RobotId, RobotState, Schedule, StationCommand, StationId,
    StationState,
};

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
    Plan(Schedule),
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
}
