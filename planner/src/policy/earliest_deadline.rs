//! Who is empty first goes first.

use super::{Policy, in_order};
use crate::optimise::Budget;
use crate::plan::Plan;
use crate::way::Ways;

/// By the time until it is empty.
#[derive(Debug)]
pub(super) struct EarliestDeadline;

impl Policy for EarliestDeadline {
    fn name(&self) -> &'static str {
        "earliest_deadline"
    }

    fn plan(&self, ways: &Ways<'_>, _: u64, budget: &mut dyn Budget) -> Plan {
        let problem = ways.problem();
        in_order(ways, budget, |robot| problem.last_start(robot))
    }
}
