//! The production coordinator and agents on simulated time, over a simulated network and disk.
//!
//! ```text
//!   run.rs        a scenario from its first second to its last
//!   trial.rs      a small fleet in which things go wrong, all drawn by one seed
//!     world.rs      one second after the other: bodies, agents, messages, coordinator
//!       host.rs       agents on their bodies; desk.rs the coordinator on its disk.rs
//!       net.rs        messages in flight, lost, doubled, overtaken, cut off
//!       faults.rs     what goes wrong, and when
//!     check/        what must hold whatever goes wrong, one promise per file
//!     measure.rs    what is counted for [expect] and for the comparison of runs
//!     logs.rs       what goes into the logs for the lab
//! ```

mod check;
mod desk;
mod disk;
mod faults;
mod host;
mod logs;
mod measure;
mod net;
mod run;
mod trial;
mod world;

pub use measure::Measured;
pub use run::{Outcome, Step, simulate};
pub use trial::{Trial, forgetful_trial, large_trial, trial};
