//! Tender's planner: which robot is serviced where, when and how, and what is proven about it.
//!
//! ```text
//!   instance.rs    reads mds-inst-1                      problem.rs   what is known, immutable
//!     |                                                    |
//!   way.rs         all ways to service each robot  <-------+
//!     |            book.rs: what of a station is taken; supply.rs: what its packs can give
//!     |
//!   draft.rs       a plan in the making: one way per robot, the books, a log to take back
//!     |
//!   policy/        one file per policy; optimise.rs is the default:
//!     |              construct.rs at once, turns.rs and search.rs better, prices.rs bounds and guides,
//!     |              halves.rs searches a large fleet on two threads,
//!     |              narrow.rs goes through all that is left to a better plan of a small fleet
//!     |            replan.rs mends a plan and moves little
//!     |
//!   plan.rs        sessions, packs, what is proven, reasons.rs for who is left out
//!   capacity.rs    how many robots the packs can serve
//!   explain.rs     why a robot is serviced as it is, and what else there was
//!     |
//!   solution.rs    writes mds-sol-1
//! ```
//!
//! No clock, disk or network; randomness comes from a seed. [`plan`] is the whole of it:
//!
//! ```
//! # fn main() -> Result<(), planner::InstanceError> {
//! # let text = include_str!("../tests/instances/6-1-1.json");
//! let instance = planner::Instance::parse(text)?;
//! let plan = planner::plan(&instance.problem, "optimise", 1, &mut planner::Moves(20_000)).expect("a policy and a feasible problem");
//! assert_eq!(plan.objective.all()[..2], [1, 313]);
//! # Ok(())
//! # }
//! ```
//!
#![doc = include_str!("../README.md")]

mod bits;
pub mod book;
pub mod capacity;
pub mod construct;
pub mod draft;
pub mod explain;
mod guide;
mod halves;
pub mod instance;
mod narrow;
pub mod optimise;
mod packing;
pub mod plan;
pub mod policy;
mod prices;
pub mod problem;
pub mod reasons;
pub mod replan;
mod search;
pub mod solution;
pub mod supply;
mod thrift;
mod turns;
pub mod way;

pub use capacity::{Capacity, capacity};
pub use explain::{Explained, Explainer};
pub use instance::{Instance, InstanceError};
pub use optimise::{Budget, Moves};
pub use plan::{Levels, Plan, Session, Unserved};
pub use policy::{Policy, policies, policy};
pub use problem::Problem;
pub use replan::{Replanned, hold, renew, replan};
pub use way::{Mode, Ways};

/// Why there is no plan.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum NoPlan {
    /// There is no such policy.
    #[error("there is no policy {wrong:?};{hint} allowed are {allowed}")]
    Policy {
        /// What was asked for.
        wrong: String,
        /// What was probably meant.
        hint: String,
        /// All there are.
        allowed: String,
    },
    /// No plan at all is possible: even without any service the stations cannot go on.
    #[error("no plan is possible: {}", .0.join("; "))]
    Impossible(Vec<String>),
}

/// Plans by the policy of that name.
///
/// # Errors
/// When there is no such policy, or no plan can keep to the rules, with the reasons in words.
pub fn plan(problem: &Problem, policy_name: &str, seed: u64, budget: &mut dyn Budget) -> Result<Plan, NoPlan> {
    let policy = policy(policy_name).ok_or_else(|| unknown_policy(policy_name))?;
    let impossible = supply::impossible(problem);
    if !impossible.is_empty() {
        return Err(NoPlan::Impossible(impossible));
    }
    Ok(policy.plan(&Ways::all(problem), seed, budget))
}

fn unknown_policy(wrong: &str) -> NoPlan {
    let names: Vec<&str> = policies().iter().map(|policy| policy.name()).collect();
    let near = names.iter().map(|name| (strsim::jaro_winkler(wrong, name), name)).filter(|(likeness, _)| *likeness > 0.75);
    let hint = near.max_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(String::new, |(_, name)| format!(" did you mean {name:?}?"));
    NoPlan::Policy { wrong: wrong.to_owned(), hint, allowed: names.join(", ") }
}
