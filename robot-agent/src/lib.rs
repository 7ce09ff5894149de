//! Tender's agent beside a robot.
//!
//! ```text
//!   source/   where samples come from and commands go to: a simulated body, a measured log, a gauge
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
mod charger;
mod config;
mod radio;
mod service;
pub mod source;
mod way;

pub use agent::{Agent, Alone, Input, Memory, Output, Profile};
pub use charger::{ChargerConfig, Path};
pub use config::{Config, SourceConfig, SourceKind};
pub use node::mission::{Leg, Mission};
pub use radio::Radio;
pub use service::run;
pub use way::{Piece, Ways};
