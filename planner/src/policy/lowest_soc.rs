//! The emptiest robot first.

use super::{Policy, in_order};
use crate::optimise::Budget;
use crate::plan::Plan;
use crate::problem::Problem;
use crate::way::Ways;

/// By state of charge.
#[derive(Debug)]
pub(super) struct LowestSoc;

impl Policy for LowestSoc {
    fn name(&self) -> &'static str {
        "lowest_soc"
    }

    fn plan(&self, ways: &Ways<'_>, _: u64, budget: &mut dyn Budget) -> Plan {
        let problem = ways.problem();
        in_order(ways, budget, |robot| soc(problem, robot))
    }
}

/// What is stored as a part of what the pack holds, in millionths.
fn soc(problem: &Problem, robot: usize) -> i64 {
    1_000_000 * problem.robots[robot].energy / problem.battery(robot).capacity
}
