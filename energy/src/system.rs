//! The three systems: which phases a step has, what goes in and what comes out.
//!
//! ```text
//!   battery   shown current ──> [sensed] ─> [capacity] [leaks] ─> SoC ─> OCV [equilibrium] ─> [series] [polarisation]
//!             ─> cell voltage ─> [heat] ─> temperature ─> [connection] ─> terminal voltage ─> [shown] ─> voltage
//!   robot     speed, pitch ... ──> [loads] ─> rails ─> [converter] ─> [drive] ─> power out of the robot's pack
//!   station   charge power ──> [robots' loads] ─> [chargers] ─> [bypass] ─> [converters] ─> [hotel, lift] ─> power out of the pack
//! ```
//!
//! In brackets: the effects of the model, of which there may be none.

use std::collections::BTreeMap;

use serde::Deserialize;

use crate::effect::Phase;
use crate::ocv::OcvTable;
use crate::pack::{Balancing, CellFactors, UnlikeCell};
use crate::power::PowerTree;
use crate::protection::Limits;
use crate::{Channel, Channels, Real};

/// The kind of thing a model describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum System {
    /// A pack of cells.
    Battery,
    /// The loads of a robot on its pack.
    Robot,
    /// A docking station's load on its active pack.
    Station,
}

impl System {
    /// Name in files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            System::Battery => "battery",
            System::Robot => "robot",
            System::Station => "station",
        }
    }

    /// Phases of a step, in order.
    #[must_use]
    pub const fn phases(self) -> &'static [Phase] {
        match self {
            System::Battery => &[
                Phase::Sensed,
                Phase::Capacity,
                Phase::Current,
                Phase::Equilibrium,
                Phase::Series,
                Phase::Polarisation,
                Phase::Heat,
                Phase::Connection,
                Phase::Shown,
            ],
            System::Robot => &[Phase::Load, Phase::Converter, Phase::Drive],
            System::Station => &[Phase::Load, Phase::Charger, Phase::Bypass, Phase::Converter, Phase::Overhead],
        }
    }

    /// Channels without which a step means nothing.
    #[must_use]
    pub const fn inputs(self) -> &'static [Channel] {
        match self {
            System::Battery => &[Channel::CurrentA],
            System::Robot => &[],
            System::Station => &[Channel::ChargePowerW],
        }
    }

    /// Channels that a step calculates and no log can set.
    #[must_use]
    pub const fn computed(self) -> &'static [Channel] {
        match self {
            System::Battery => &[
                Channel::VoltageV,
                Channel::PowerW,
                Channel::Soc,
                Channel::History,
                Channel::TerminalCurrentA,
                Channel::TerminalVoltageV,
                Channel::CellMinV,
                Channel::CellMaxV,
                Channel::CapacityAh,
                Channel::CellCurrentA,
                Channel::LostCurrentA,
                Channel::SocPerA,
                Channel::CellVoltageV,
                Channel::CellDegc,
                Channel::OcvV,
                Channel::OcvShiftEmpty,
                Channel::OcvShiftFull,
                Channel::LogRelaxationTime,
                Channel::EntropyVPerK,
                Channel::OverpotentialV,
                Channel::HeatW,
            ],
            System::Robot => &[Channel::PowerW, Channel::TractionN, Channel::CopperW],
            System::Station => &[Channel::PackPowerW],
        }
    }

    /// Channels that a step predicts and a log may hold measurements of.
    #[must_use]
    pub const fn targets(self) -> &'static [Channel] {
        match self {
            System::Battery => &[Channel::VoltageV, Channel::TemperatureDegc],
            System::Robot => &[Channel::PowerW],
            System::Station => &[Channel::PackPowerW],
        }
    }
}

/// What is fixed about the thing modelled.
#[derive(Debug, Clone, PartialEq)]
pub enum Facts {
    /// A pack.
    Battery(BatteryFacts),
    /// A robot.
    Robot(RobotFacts),
    /// A station: all it is lies in its effects.
    Station,
}

impl Facts {
    /// Cells in parallel; 1 where there are none.
    #[must_use]
    pub fn parallel(&self) -> u32 {
        match self {
            Facts::Battery(battery) => battery.parallel,
            _ => 1,
        }
    }

    /// A robot of which nothing is fixed: all it is lies in its effects.
    #[must_use]
    pub fn robot() -> Self {
        Facts::Robot(RobotFacts::default())
    }

    /// The rails of a robot; none where all loads hang on the battery.
    #[must_use]
    pub fn tree(&self) -> Option<&PowerTree> {
        match self {
            Facts::Robot(robot) => robot.tree.as_ref(),
            _ => None,
        }
    }

    /// Voltage of the pack that feeds a robot, V: its channel, or the nominal one when the channel
    /// is not above 0; 0 when neither is known.
    #[inline]
    pub fn supply_v<S: Real>(&self, channels: &Channels<S>) -> S {
        let voltage_v = channels[Channel::VoltageV];
        match self {
            Facts::Robot(robot) if voltage_v.re() <= 0.0 => S::from(robot.nominal_v),
            _ => voltage_v,
        }
    }

    /// The rail that an effect hangs on.
    pub(crate) fn rail_of(&self, effect: &str) -> Option<usize> {
        match self {
            Facts::Robot(robot) => robot.on_rails.get(effect).copied(),
            _ => None,
        }
    }

    /// Numbers that the system itself keeps in front of its effects' states: a battery its charge,
    /// a robot what effects ask of each rail.
    pub(crate) fn own_states(&self) -> usize {
        match self {
            Facts::Battery(_) => 1,
            Facts::Robot(_) => self.tree().map_or(0, |tree| tree.rails().len()),
            Facts::Station => 0,
        }
    }
}

/// What is fixed about a robot: the supply side of its loads.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RobotFacts {
    /// Voltage of its pack when the channel `voltage_v` does not tell, V; 0 when not known.
    pub nominal_v: f64,
    /// Its rails; none when every load hangs on the battery.
    pub tree: Option<PowerTree>,
    /// Effects of phase Load that hang on a rail: id, and place of the rail in the tree.
    pub on_rails: BTreeMap<&'static str, usize>,
}

/// Fixed facts of a pack of like cells.
#[derive(Debug, Clone, PartialEq)]
pub struct BatteryFacts {
    /// Cells in series, >= 1.
    pub series: u32,
    /// Strings in parallel, >= 1.
    pub parallel: u32,
    /// Charge of the whole pack between full and end of discharge at a low rate, Ah.
    pub capacity_ah: f64,
    /// Voltage of a full cell, V.
    pub full_v_per_cell: f64,
    /// End of discharge under load, V per cell.
    pub eod_v_per_cell: f64,
    /// Open-circuit voltage of one cell.
    pub ocv: OcvTable,
    /// How the pack is charged.
    pub charge: ChargeFacts,
    /// How all cells differ from those that the effects describe; 1 and 0 unless this is a part
    /// of a pack of unlike cells.
    pub cell: CellFactors,
    /// Cells that differ from the others: a [`crate::Pack`] steps them by themselves, a
    /// [`crate::Run`] takes all cells as alike.
    pub unlike: Vec<UnlikeCell>,
    /// How unlike cells are brought together again, if anything does that.
    pub balancing: Option<Balancing>,
    /// When the pack's own electronics stop charge and discharge.
    pub protection: Limits,
    /// Full cycles that the pack has seen beside those that the start of a run says; 0 unless the model is that of a pack that was used
    /// ([`crate::Model::worn`]).
    pub cycle_count: f64,
}

impl BatteryFacts {
    /// Pack voltage at end of discharge, V.
    #[must_use]
    pub fn eod_v(&self) -> f64 {
        self.eod_v_per_cell * f64::from(self.series)
    }

    /// Pack voltage at which charging turns from constant current to constant voltage, V.
    #[must_use]
    pub fn full_v(&self) -> f64 {
        self.full_v_per_cell * f64::from(self.series)
    }

    /// Open-circuit voltage of a cell as it is now, V: age has moved it along the table.
    #[inline(always)]
    pub(crate) fn cell_ocv_v<S: Real>(&self, soc: S, now: &Channels<S>) -> S {
        let (empty, full) = (now[Channel::OcvShiftEmpty], now[Channel::OcvShiftFull]);
        self.ocv.voltage_v(soc + empty + (full - empty) * soc)
    }

    /// Energy between full and empty at no current, Wh: the integral of OCV over charge.
    #[must_use]
    pub fn stored_wh(&self) -> f64 {
        let (soc, voltage_v) = self.ocv.points();
        let volts: f64 = soc.windows(2).zip(voltage_v.windows(2)).map(|(s, v)| (s[1] - s[0]) * (v[0] + v[1]) / 2.0).sum();
        volts * self.capacity_ah * f64::from(self.series)
    }
}

/// Constant-current, constant-voltage charging of a pack.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ChargeFacts {
    /// Current of the constant-current part, A into the pack (a positive number).
    pub current_a: f64,
    /// Current at which the constant-voltage part ends, A into the pack (a positive number).
    pub cutoff_a: f64,
}
