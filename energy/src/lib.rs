//! Energy models of batteries, robots and docking stations: physics without I/O.
//!
//! ```text
//!   effect/      one file per physical effect, and the catalogue that orders them
//!     |          (an effect adds its share to a channel)
//!   system.rs    battery, robot, station: which channels go in and out, and the order of a step
//!     |
//!   model.rs     facts + effects + parameters, read from a TOML text
//!   run.rs       a model in motion: channels, state, step(dt_s); batch.rs: many at once
//!   pack.rs      cells that differ, each in motion by itself
//!     |          protection.rs: which switch of a pack opens, and why
//!     |
//!   power/       a robot's power tree: converters, regulators, loads, radios
//!   load.rs      what holds at the terminals: constant power or resistance, CC-CV charge
//!   forecast.rs  energy and time to the end of a discharge or a charge, with sigma
//!   charger.rs   the CC-CV charger as a device; selector.rs: the switch between packs
//!   service.rs   what one service of a robot takes from a station's packs (need.rs), by cause
//!   gauge/       estimators that turn raw samples into state of charge and energy
//! ```
//!
//! The gauge in the agent, the forecast in the coordinator, the body in the simulator and the
//! curve in the lab all step the same [`Run`]. Discharge current and drawn power are positive.
//!
#![doc = include_str!("../README.md")]

mod batch;
pub mod channel;
pub mod charger;
pub mod document;
pub mod drive;
pub mod effect;
mod estimate;
pub mod forecast;
pub mod gauge;
pub mod load;
pub mod model;
mod need;
pub mod ocv;
mod ocv_error;
pub mod pack;
mod params;
pub mod power;
pub mod protection;
pub mod real;
pub mod relaxation;
mod run;
pub mod selector;
pub mod service;
mod step;
pub mod system;
pub mod units;

pub use batch::Batch;
pub use channel::{Channel, Channels};
pub use document::DocumentError;
pub use effect::{Effect, EffectSpec, Own, ParameterSpec, Phase, catalogue, find};
pub use estimate::{Estimate, propagate};
pub use model::{Model, Parameter, Sensor, Uncertainty};
pub use need::Need;
pub use ocv::OcvTable;
pub use pack::Pack;
pub use params::{FoundModel, built_in, built_in_names, find_model, load_model, parse_beside};
pub use protection::Protection;
pub use real::{Dual, HalfDual, Real};
pub use run::Run;
pub use run::Start;
pub use system::{BatteryFacts, ChargeFacts, Facts, RobotFacts, System};
