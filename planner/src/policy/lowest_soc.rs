//! The emptiest robot first.

use super::{Policy, in_order};
use crate::optimise::Budget;
use crate::plan::Plan;
use crate::way::Ways;

/// By stored energy.
pub(super) struct LowestSoc;

impl Policy for LowestSoc {
    fn name(&self) -> &'static str {
        "lowest_soc"
    }

    fn about(&self) -> &'static str {
        "the emptiest robot first"
    }

    fn plan(&self, ways: &Ways<'_>, _: u64, budget: &mut dyn Budget) -> Plan {
        let problem = ways.problem();
        in_order(ways, budget, |robot| problem.robots[robot].energy)
    }
}
