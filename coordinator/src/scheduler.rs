//! Beliefs as a problem for the planner, and its plan as services.
//!
//! ```text
//!   view.rs (outside)   what is believed: robots, bays, lift, packs, spares, forecasts
//!      |
//!   problem.rs    the same as one immutable view, in seconds and Wh
//!   charging.rs   what charging takes and how long, from the energy models, once per kind
//!   usable.rs     what packs give, likewise
//!   refill.rs     what an outside supply puts into those that rest
//!   worn.rs       models of batteries as their gauges have found them
//!   tables.rs     all of these that were asked for so far
//!      |
//!   translate.rs  that view as a `planner::Problem`, on a grid of ticks
//!      |
//!   effort.rs     how much of the last plan comes into question
//!   solve.rs      the planner, beginning from that plan
//!   crowd.rs      the same with more robots side by side than a station's converters feed
//!   again.rs      once more with what packs give beyond what was counted
//!      |
//!   plan.rs       its sessions as services: bay, spare, packs, times, probability
//!   recharging.rs what packs that robots left draw while they are charged
//!   cover.rs      how surely the packs last until then, along the load of that plan
//!   carry.rs      how much more than a load packs could carry, by stepping them
//!   words.rs      why, why not, and what would have to change
//!
//!   shed.rs       who is let go where packs hold less than was promised of them
//!
//!   capacity.rs   how many robots each pack can still service, and how certainly
//! ```

mod again;
pub mod capacity;
mod carry;
pub mod charging;
mod cover;
mod crowd;
mod effort;
mod plan;
mod problem;
mod racks;
mod recharging;
mod refill;
pub mod shed;
mod solve;
pub mod tables;
pub(crate) mod translate;
mod unfit;
pub mod usable;
mod words;
pub mod worn;

pub use carry::packs_after_begun;
pub use charging::Point;
pub use crowd::{Fed, crowds, solve_side_by_side};
pub use effort::{Effort, WHOLE_FLEET_MAX};
pub use plan::{Plan, Planned, Rejected};
pub use problem::{Begun, HANDOVER_S, Lasts, PackState, PackView, RobotView, SpareView, StationView, View, WayView};
pub(crate) use racks::ALIKE_SOC;
pub use racks::Racks;
pub use recharging::Recharging;
pub use refill::{Refill, steps_s};
pub use solve::{Solved, solve};
pub use tables::Tables;
pub(crate) use translate::HORIZON_MAX_S;
pub use translate::{Grid, Task};
pub use words::{Account, Accounts, Grounds};
pub(crate) use words::{apart, short_of};

#[cfg(test)]
mod tests;
