//! A scenario: a fleet, a world, what is believed of it, and what is expected to happen.
//!
//! ```text
//!   file.rs    the TOML file as it is written, unknown keys refused
//!   check.rs   what must hold of it beyond its types
//!   places.rs  where the key stands that a message names
//!   expect.rs  what is measured in a run, and what is expected of it
//!   deploy.rs  one run as configurations of coordinator, agents and their true worlds
//! ```
//!
//! World and belief are separate: a world model may have an effect that the coordinator's lacks.

mod check;
mod deploy;
mod expect;
mod file;
mod places;

pub use deploy::Deployment;
pub use expect::{Expectation, METRICS, Verdict};
pub use file::{Changes, PackEntry, RobotEntry, RunEntry, Scenario, SpareEntry, StationEntry};

#[cfg(test)]
mod tests;
