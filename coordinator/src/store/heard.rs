//! What the core was told, one line of the journal each, so that it can be told the same again.

use std::sync::Arc;

use proto::{CommandReply, EventKind, PackId, RobotId, Schedule, StationId, Timestamp};

use super::Record;
use crate::core::Input;

/// One input of the core, and when it came.
#[derive(Debug, Clone, PartialEq)]
pub struct Heard {
    /// Which start of a coordinator.
    pub epoch: u64,
    /// Counts up by one from the start of the coordinator.
    pub number: u64,
    /// The coordinator's clock.
    pub at: Timestamp,
    /// What was heard.
    pub what: What,
}

/// What was heard. Telemetry stands in tables of its own: here is only which row it was.
#[derive(Debug, Clone, PartialEq)]
pub enum What {
    /// Something came that changed nothing: an old copy, say.
    Nothing,
    /// Time passed.
    Tick,
    /// A robot's gauge.
    RobotGauge(RobotId, Timestamp, u64),
    /// A robot's state.
    RobotState(RobotId, Timestamp, u64),
    /// A robot appeared or was lost.
    RobotAlive(RobotId, bool),
    /// A station's state.
    StationState(StationId, Timestamp, u64),
    /// The gauge of a station's pack.
    PackGauge(StationId, PackId, Timestamp, u64),
    /// A station appeared or was lost.
    StationAlive(StationId, bool),
    /// An answer.
    Reply(CommandReply),
    /// Something that could not be read.
    Refused(String),
    /// A new plan was asked for.
    Replan(String),
    /// A robot was said to be gone for good.
    Forget(RobotId),
    /// A plan was made beside the core.
    Studied,
    /// The last plan of the coordinator before.
    Before(Arc<Schedule>),
}

impl Heard {
    /// The line for an input whose records are `came`.
    #[must_use]
    pub fn of((epoch, number): (u64, u64), at: Timestamp, input: Input, came: &[Record]) -> Self {
        let what = match input {
            Input::Nothing => What::Nothing,
            Input::Tick => What::Tick,
            Input::RobotAlive(robot, alive) => What::RobotAlive(robot, alive),
            Input::StationAlive(station, alive) => What::StationAlive(station, alive),
            Input::Reply(reply) => What::Reply(reply),
            Input::Refused(_) => refused(came),
            Input::Replan(why) => What::Replan(why),
            Input::Forget(robot) => What::Forget(robot),
            Input::Studied => What::Studied,
            Input::Before(schedule) => What::Before(schedule),
            Input::RobotGauge(robot, gauge) if came.iter().any(|record| matches!(record, Record::RobotGauge { .. })) => {
                What::RobotGauge(robot, gauge.at, gauge.seq)
            }
            Input::PackGauge(station, pack, gauge) if came.iter().any(|record| matches!(record, Record::PackGauge { .. })) => {
                What::PackGauge(station, pack, gauge.at, gauge.seq)
            }
            Input::RobotState(robot, state) if came.iter().any(|record| matches!(record, Record::RobotState { .. })) => {
                What::RobotState(robot, state.at, state.seq)
            }
            Input::StationState(station, state) if came.iter().any(|record| matches!(record, Record::StationState { .. })) => {
                What::StationState(station, state.at, state.seq)
            }
            // Not taken in; perhaps that was told.
            Input::RobotGauge(..) | Input::PackGauge(..) | Input::RobotState(..) | Input::StationState(..) => refused(came),
        };
        Self { epoch, number, at, what }
    }
}

/// What was refused, if that was told: a flood of the same is told once, and kept once.
fn refused(came: &[Record]) -> What {
    let told = came.iter().find_map(|record| match record {
        Record::Event(event) if event.kind == EventKind::InputRefused => Some(event.text.clone()),
        _ => None,
    });
    told.map_or(What::Nothing, What::Refused)
}
