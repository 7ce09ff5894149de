//! Where a robot's battery power goes: converters, regulators, loads, the tree they form, radios.
//!
//! ```text
//!   converter.rs   switch-mode converter: efficiency over input voltage and output current
//!   ldo.rs         linear regulator: loss, drop-out, junction temperature
//!   consumer.rs    loads of constant current, power or resistance, and their sum
//!   tree.rs        battery -> rails -> rails -> loads: which rail hangs on which, and its checks
//!   flow.rs        a tree at work: voltages, currents and losses of every rail
//!   radio.rs       dBm, link budget, range, mismatch and its cure, supply power by duty
//! ```
//!
//! In the file of a robot's model:
//!
//! ```toml
//! [robot]
//! nominal_v = 7.4                # the pack's voltage while the channel voltage_v does not tell it
//!
//! [[rail]]
//! id = "5v"
//! from = "battery"               # or the id of another rail
//! kind = "switching"             # switching, linear or switch
//! voltage_v = 5.0
//! input_min_v = 5.8              # drop-out; 0 when not given
//! current_max_a = 1.5            # no limit when not given
//! efficiency = { input_v = [6.0, 12.0], output_a = [0.1, 1.0], efficiency = [[0.91, 0.94], [0.74, 0.89]] }
//! # or:  polynomial = { fixed_w = 0.05, linear_v = 5.3, resistance_ohm = 0.1 }
//!
//! [[rail.load]]
//! name = "camera"
//! kind = "power"                 # power (W), current (A) or resistance (ohm)
//! value = 0.5
//! when = "camera_on"             # a channel 0..1 that switches or scales it
//!
//! [[rail]]
//! id = "3v3"
//! from = "5v"
//! kind = "linear"                # voltage_v, dropout_v, quiescent_a, theta_ja_k_per_w, junction_max_degc
//! voltage_v = 3.3
//! dropout_v = 0.3
//!
//! [[rail]]
//! id = "servo"
//! from = "battery"
//! kind = "switch"                # a load switch or wire
//! resistance_ohm = 0.05
//!
//! [[effect]]
//! id = "gps"
//! rail = "3v3"                   # effects of phase Load only; on the battery when not given
//! ```
//!
//! Everything here is pure and total for numbers in the stated ranges; what cannot work (an
//! input below the drop-out, too much current) is an answer that names the rail.

mod consumer;
mod converter;
mod flow;
mod ldo;
pub mod radio;
mod tree;

pub use consumer::{Consumer, ConsumerKind, Zip};
pub use converter::{ConverterLoss, EfficiencyTable, SwitchMode};
pub use flow::{Cause, Flow, RailCannotDeliver, RailFlow};
pub use ldo::Ldo;
pub use tree::{BATTERY, PowerTree, RAILS_MAX, Rail, RailKind, Switch};
