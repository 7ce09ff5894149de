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
