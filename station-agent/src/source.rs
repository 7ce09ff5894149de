//! Where a station's samples come from and its actions go to: a simulated station, or devices beside its packs and a program
//! that works it.

pub mod measured;
mod simulated;

pub use measured::MeasuredStation;
pub use simulated::{StationBody, World, WorldPack};

use std::fmt;

use energy::gauge::Sample;
use energy::{Channel, Estimate};
use node::Stride;
use proto::{BayId, PackId, RobotId, SimDraw, SimSupply, SpareId};
use serde::{Deserialize, Serialize};

/// How well the charge is known that is written on a pack (standard deviation). A guess: whoever charged it knew it by a gauge or by the
/// end of the charger's taper, and these agree within a percent or so.
const LABEL_SIGMA: f64 = 0.01;

/// The charge that is written on a pack.
pub(crate) fn label(soc: f64) -> Estimate {
    Estimate::new(soc, LABEL_SIGMA)
}

/// What the source knows after it moved on.
#[derive(Debug, Clone, PartialEq)]
pub struct Observation {
    /// Reading of every pack, in the station's order.
    pub packs: Vec<PackReading>,
    /// The pack that feeds the station.
    pub active_pack: Option<PackId>,
    /// Whether the bays have power.
    pub powered: bool,
    /// While it is on its way to where it takes robots in: seconds until it is there.
    pub arrives_s: Option<f64>,
    /// When it is away after that, one after the other: seconds until it sets off, and until it takes robots in once more, where
    /// that is known.
    pub away_s: Vec<(f64, Option<f64>)>,
    /// A lift movement that has just ended.
    pub lifted: Option<Lifted>,
    /// A lift movement that will not be done: its bay is out of order.
    pub given_up: Option<Lifted>,
    /// Bays that were out of order and can be used again.
    pub mended: Vec<BayId>,
    /// An exchange of a robot's pack that has just ended.
    pub swapped: Option<Swapped>,
    /// An exchange that cannot be done: the robot has its own pack still.
    pub called_off: Option<(RobotId, SpareId)>,
    /// Whether the lift moves, or a pack is being exchanged.
    pub lift_active: bool,
    /// Packs that are charged and can be handed out as spares from now on, with their state of charge.
    pub charged: Vec<(SpareId, Estimate)>,
    /// What lies in the places of spares and cannot be handed out, or not any more, with its state of charge.
    pub uncharged: Vec<(SpareId, Estimate)>,
    /// Whether something is known of each of its packs, if only that it is silent: before that it is not said how the station stands.
    pub known: bool,
    /// What goes wrong, for people.
    pub trouble: Option<String>,
}

/// Reading of one pack.
#[derive(Debug, Clone, PartialEq)]
pub struct PackReading {
    /// Which pack.
    pub pack: PackId,
    /// What its sensors showed since the last observation; none when there was no reading.
    pub sample: Option<Sample>,
    /// Whether its protection has opened.
    pub depleted: bool,
    /// Whether it is in its place; the sample counts only then.
    pub connected: bool,
    /// When it is not: in how many seconds a charged one will be, and how full.
    pub back: Option<(f64, Estimate)>,
    /// Another pack was put in its place; its state of charge as written on it.
    pub exchanged: Option<Estimate>,
    /// What its device says now of its state of charge, where that outlives the agent.
    pub said_soc: Option<Estimate>,
}

/// A finished lift movement.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Lifted {
    /// The robot that was moved.
    pub robot: RobotId,
    /// Into or out of which bay.
    pub bay: BayId,
    /// Whether into it.
    pub into: bool,
}

/// A finished exchange of a robot's pack.
#[derive(Debug, Clone, PartialEq)]
pub struct Swapped {
    /// The robot.
    pub robot: RobotId,
    /// The spare that it got.
    pub spare: SpareId,
    /// State of charge of the pack that it gave, as far as known.
    pub given_soc: Estimate,
}

/// What an agent makes the station do.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Act {
    /// Move a robot by the lift.
    Lift(Lifted),
    /// Exchange a robot's pack for a spare.
    Swap {
        /// The robot.
        robot: RobotId,
        /// The spare to put in.
        spare: SpareId,
    },
    /// Feed the station from this pack.
    Select {
        /// Which.
        pack: PackId,
    },
}

impl fmt::Display for Act {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Lift(Lifted { robot, bay, into: true }) => write!(f, "lifts {robot} into {bay}"),
            Self::Lift(Lifted { robot, bay, into: false }) => write!(f, "lifts {robot} out of {bay}"),
            Self::Swap { robot, spare } => write!(f, "exchanges the pack of {robot} for {spare}"),
            Self::Select { pack } => write!(f, "selects {pack}"),
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

    /// Takes in which packs had given out when its agent was stopped, and what their devices said of their charge then. Sources that keep
    /// their packs themselves need not be told.
    fn gave_out(&mut self, _depleted: &[(PackId, Option<Estimate>)]) {}

    /// Inputs of the station's load in the last step, for a log; none where nobody measures them.
    fn load_inputs(&self, _channels: &[Channel]) -> Option<Vec<f64>> {
        None
    }

    /// What a simulated robot takes from its bay. Real stations measure it.
    fn draw(&mut self, _robot: &RobotId, _draw: &SimDraw) {}

    /// What simulated robots are given, since the last call.
    fn supplies(&mut self) -> Vec<(RobotId, SimSupply)> {
        Vec::new()
    }
}
