//! Tender's agent beside a docking station.
//!
//! ```text
//!   source.rs   packs, selector, lift: a simulated station, or a real one
//!     | Observation           ^ Act
//!     v                       |
//!   agent.rs    pure: a gauge per pack, bays, lift queue, answers to commands
//!     | Gauge, StationState   ^ StationCommand
//!     v                       |
//!   service.rs  Zenoh and the clock
//! ```
//!
//! The simulator steps the same [`Agent`] and the same [`source::Source`] on simulated time.

mod agent;
mod config;
mod service;
pub mod source;

pub use agent::{Agent, Alone, Input, Memory, Output, Profile};
pub use config::{Config, GaugeConfig, MeasuredConfig, PackConfig, SourceConfig, SpareConfig, TruePack};
pub use service::run;
