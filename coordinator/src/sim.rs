//! The production coordinator and agents on simulated time.
//!
//! ```text
//!   world.rs      one second after the other: bodies, agents, messages, coordinator
//!     net.rs        messages in flight
//!     measure.rs    what is counted for [expect] and for the comparison of runs
//!     logs.rs       what goes into the logs for the lab
//! ```

mod logs;
mod measure;
mod net;
mod world;

pub use measure::Measured;
pub use world::{Outcome, Step, simulate};
