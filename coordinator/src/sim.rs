//! The production coordinator and agents on simulated time.
//!
//! ```text
//!   world.rs      one second after the other: bodies, agents, messages, coordinator
//!     net.rs        messages in flight
//!     measure.rs    what is counted for [expect] and for the comparison of runs
//!     telemetry.rs  logs for the lab
//! ```

mod measure;
mod net;
mod telemetry;
mod world;

pub use measure::Measured;
pub use telemetry::Telemetry;
pub use world::{Outcome, simulate};
