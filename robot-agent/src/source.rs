//! Where a robot's samples come from and its actions go to.
//!
//! ```text
//!   simulated.rs   a simulated body
//!   replay.rs      a measured log
//!   measured.rs    a gauge of the world outside (crate `device`), or
//!     vda5050.rs     a vehicle of VDA 5050 over MQTT
//!     body.rs        the program that drives a real robot, and where it is
//! ```

pub mod body;
mod measured;
mod replay;
mod simulated;
pub mod vda5050;

pub use body::Body;
pub use measured::Measured;
pub use replay::Replay;
pub use simulated::{RobotBody, World};

use std::fmt;

use energy::gauge::Sample;
use energy::{Channel, Estimate};
use node::Stride;
use proto::{BayId, SimDraw, SimSupply, StationId};

/// Where the robot is, as far as its source can tell.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Place {
    /// At work.
    Mission,
    /// Between work and a station.
    Underway,
    /// At a station, outside its bays.
    AtStation,
    /// In a bay.
    InBay,
}

/// What the source knows after it moved on.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// What the pack's sensors showed since the last observation; none when there was no reading.
    pub sample: Option<Sample>,
    /// Where the robot is.
    pub place: Place,
    /// Whether a bay feeds the robot.
    pub powered: bool,
    /// A pack was put in; its state of charge as written on it.
    pub exchanged: Option<Estimate>,
    /// What the device says now of the pack's state of charge, where a pack can be put in without its noticing.
    pub said_soc: Option<Estimate>,
    /// The pack's protection has opened: nothing more can be drawn.
    pub depleted: bool,
    /// Why the robot stands still although its pack is not empty; none otherwise.
    pub why_down: Option<String>,
}

/// What the station at which a robot is says of it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Held {
    /// None is heard.
    #[default]
    Unheard,
    /// Nothing: it has the robot in no bay.
    No,
    /// It brings the robot into a bay, or exchanges its pack.
    TakesIn,
    /// It has the robot in a bay.
    InBay,
    /// It lets the robot out of its bay, or cannot.
    LetsOut,
    /// It has let the robot out.
    Out,
}

/// What an agent makes the robot do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Act {
    /// Leave the work and go to a station.
    TravelTo {
        /// Which.
        station: StationId,
        /// The bay that is meant for the robot there; none when its pack is exchanged.
        bay: Option<BayId>,
    },
    /// Go on to another place at the station to which it is on its way, or where it stands. A robot before a lift stays: the
    /// station moves it.
    GoOnTo {
        /// The same station as before.
        station: StationId,
        /// The bay that is meant for the robot now; none when its pack is exchanged.
        bay: Option<BayId>,
    },
    /// Switch the charger on.
    Charge,
    /// Switch the charger off.
    StopCharging,
    /// Go back to work.
    Resume,
}

impl fmt::Display for Act {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TravelTo { station, bay: Some(bay) } => write!(f, "goes to {station} {bay}"),
            Self::TravelTo { station, bay: None } => write!(f, "goes to {station}"),
            Self::GoOnTo { station, bay: Some(bay) } => write!(f, "goes on to {station} {bay}"),
            Self::GoOnTo { station, bay: None } => write!(f, "goes on to where packs are exchanged at {station}"),
            Self::Charge => f.write_str("begins to charge"),
            Self::StopCharging => f.write_str("ends its charge"),
            Self::Resume => f.write_str("goes back to work"),
        }
    }
}

/// A source of observations.
pub trait Source: Send {
    /// Does what the agent asked for.
    fn act(&mut self, act: &Act);

    /// Moves on by `dt_s` seconds; nothing when the source has ended.
    fn advance(&mut self, dt_s: f64) -> Option<Observation>;

    /// How it wants to be moved on after the machine has slept.
    fn stride(&self) -> Stride {
        Stride::LeftOut
    }

    /// Takes in where the robot stood when its agent was stopped. For sources that find out by themselves it is nothing new.
    fn stand(&mut self, _place: Place) {}

    /// Takes in what its station says of the robot. Sources that know where it is need not be told.
    fn held(&mut self, _held: Held) {}

    /// What a simulated bay gives. Real sources feel their bay and need not be told.
    fn supply(&mut self, _supply: &SimSupply) {}

    /// Inputs of the load in the last step, for a log; none where nobody measures them.
    fn load_inputs(&self, _channels: &[Channel]) -> Option<Vec<f64>> {
        None
    }

    /// What a simulated body takes from its bay.
    fn draw(&self) -> Option<SimDraw> {
        None
    }
}
