//! What is said on the wire: one file per subject.

mod capacity;
mod check;
mod command;
mod event;
mod gauge;
mod robot;
mod schedule;
mod sim;
mod station;

pub use capacity::{Capacity, PackCapacity, Promise, StationCapacity};
pub use check::MessageError;
pub use command::{Command, CommandReply, Outcome, Rejection, RobotAction, RobotCommand, StationAction, StationCommand};
pub use event::{Event, EventKind};
pub use gauge::Gauge;
pub use robot::{Mission, NamedModel, RobotPhase, RobotState, Travel};
pub use schedule::{Alternative, Doubt, Explanation, Mode, Quality, Schedule, Service, ServiceStatus, Unserved};
pub use sim::{SimDraw, SimSupply};
pub use station::{Absence, BayPhase, BayState, PackReturn, PackState, SpareState, StationState};

/// Prints a unit-only enum under the very name that it has on the wire.
macro_rules! display_as_on_the_wire {
    ($name:ty) => {
        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                serde::Serialize::serialize(self, f)
            }
        }
    };
}
use display_as_on_the_wire;
