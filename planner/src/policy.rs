//! Ways to plan, by name. One file per policy, one line in [`policies`].

mod earliest_deadline;
mod least_slack;
mod lowest_soc;
mod optimise;
mod threshold;

use crate::construct::greedy;
use crate::draft::Draft;
use crate::optimise::{Budget, least_stranded};
use crate::plan::Plan;
use crate::prices::{Level, Prices};
use crate::way::Ways;

/// A way to plan.
pub trait Policy: Sync + std::fmt::Debug {
    /// Name in files and on the command line.
    fn name(&self) -> &'static str;

    /// Whether it looks among many plans for the best, and so depends on what it is offered and for how long; a rule does the one thing
    /// that it says.
    fn searches(&self) -> bool {
        false
    }

    /// A plan. The same seed and number of moves give the same plan.
    fn plan(&self, ways: &Ways<'_>, seed: u64, budget: &mut dyn Budget) -> Plan;
}

static POLICIES: &[&dyn Policy] =
    &[&optimise::Optimise, &threshold::Threshold, &lowest_soc::LowestSoc, &earliest_deadline::EarliestDeadline, &least_slack::LeastSlack];

/// Every policy; the first is the default.
#[must_use]
pub fn policies() -> &'static [&'static dyn Policy] {
    POLICIES
}

/// The policy of that name.
#[must_use]
pub fn policy(name: &str) -> Option<&'static dyn Policy> {
    POLICIES.iter().copied().find(|policy| policy.name() == name)
}

/// Robots by a key, smallest first, each takes the cheapest way that is still free. One pass; who was
/// promised a service before comes first, so that a newcomer cannot take what was promised.
fn in_order(ways: &Ways<'_>, budget: &mut dyn Budget, key: impl Fn(usize) -> i64) -> Plan {
    let mut order: Vec<usize> = (0..ways.problem().robots.len()).collect();
    let held = |robot: usize| ways.problem().robots[robot].held;
    order.sort_by_key(|&robot| (!held(robot), key(robot), robot));
    let mut draft = Draft::new(ways);
    greedy(&mut draft, &order, 0.0);
    with_bound(ways, &draft, budget)
}

/// A finished plan, with what the rest of the budget can prove about it.
fn with_bound(ways: &Ways<'_>, draft: &Draft<'_, '_>, budget: &mut dyn Budget) -> Plan {
    let mut prices = Prices::new(ways, Level::Cost { stranded_max: draft.score.stranded });
    let mut moves = 0;
    while budget.used(moves) < 1.0 && prices.bound() < draft.score.cost {
        moves += prices.improve(draft.score.cost).max(1);
    }
    let energy_bound = if prices.improved() { prices.energy_bound(draft.score.cost) } else { 0 };
    Plan::new(draft, least_stranded(ways), prices.bound(), energy_bound)
}
