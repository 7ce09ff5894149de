//! Who has the least time left to set off goes first.

use super::{Policy, in_order};
use crate::optimise::Budget;
use crate::plan::Plan;
use crate::way::Ways;

/// By the time until it is empty less the way to the nearest station.
#[derive(Debug)]
pub(super) struct LeastSlack;

impl Policy for LeastSlack {
    fn name(&self) -> &'static str {
        "least_slack"
    }

    fn plan(&self, ways: &Ways<'_>, _: u64, budget: &mut dyn Budget) -> Plan {
        let problem = ways.problem();
        in_order(ways, budget, |robot| {
            let (who, floor) = (&problem.robots[robot], problem.battery(robot).floor);
            let slack = who.travel.iter().map(|travel| who.last_start(travel, floor).max(0) - i64::from(problem.soonest(travel)));
            slack.max().unwrap_or_else(|| problem.endurance(robot))
        })
    }
}
