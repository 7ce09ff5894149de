//! Tender's agent beside a robot.
//!
//! ```text
//!   source/   where samples come from and commands go to: a simulated body, a measured log
//!     | Observation           ^ Act
//!     v                       |
//!   agent.rs  pure: gauge, phase, answers to commands
//!     | Gauge, RobotState     ^ RobotCommand
//!     v                       |
//!   service.rs  Zenoh and the clock
//! ```
//!
//! The simulator steps the same [`Agent`] and the same [`source::Source`] on simulated time.

mod agent;
mod config;
mod service;
pub mod source;

pub use agent::{Agent, Input, Output, Profile};
pub use config::{Config, Mission, SourceConfig};
pub use service::run;
