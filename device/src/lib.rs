//! The world outside an agent: gauges that measure batteries, and programs that act.
//!
//! ```text
//!   power_supply.rs   /sys/class/power_supply of Linux ─┐
//!   sbs.rs            a Smart Battery over I2C          ├─ Report ─> reader.rs ─> what a gauge is fed with
//!   ros2.rs           BatteryState through rmw_zenoh    │
//!   log.rs            a measured log                   ─┘
//!   script.rs         what a trial lays out
//!   program.rs        a program of the user's, started anew for every act
//! ```
//!
//! Adding a gauge is one file here that implements [`Device`], and a line in each list of the agents' configurations
//! (`robot-agent/src/config/source.rs`, `station-agent/src/config/measured.rs`).

pub mod log;
pub mod power_supply;
pub mod program;
pub mod reader;
mod report;
pub mod ros2;
pub mod sbs;
mod script;

pub use log::Log;
pub use program::Program;
pub use reader::{Reader, Reading, Unmeasured};
pub use report::{Device, Report, Supply, UNKNOWN_SOC};
pub use script::Script;
