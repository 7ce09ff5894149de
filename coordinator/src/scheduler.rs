//! Who docks where and when, and which packs pay for it.
//!
//! ```text
//!   problem.rs    an immutable view: robots, bays, lift, packs, spares, forecasts
//!      |
//!   policy/       the order in which robots are considered: one file per policy
//!      |
//!   feasible.rs   can this robot be serviced so? a slot, or the reasons why not
//!      |
//!   construct.rs  robot by robot, the earliest end; every robot ends up in the plan or unserved
//!      |
//!   plan.rs       bay, pack and time, reserved once
//! ```

pub mod capacity;
mod construct;
mod feasible;
mod plan;
mod policy;
mod problem;

pub use construct::construct;
pub use feasible::{Book, Refusal, Slot};
pub use plan::{Plan, Planned, Rejected};
pub use policy::{Policy, policies, policy};
pub use problem::{BayView, OptionView, PackView, Problem, RobotView, SpareView, StationView, Way};

#[cfg(test)]
mod tests;
