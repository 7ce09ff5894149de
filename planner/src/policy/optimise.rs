//! The best plan that the budget allows.

use super::Policy;
use crate::optimise::{Budget, NAME, optimise};
use crate::plan::Plan;
use crate::way::Ways;

/// See [`crate::optimise`].
pub(super) struct Optimise;

impl Policy for Optimise {
    fn name(&self) -> &'static str {
        NAME
    }

    fn about(&self) -> &'static str {
        "the best plan that the budget allows"
    }

    fn plan(&self, ways: &Ways<'_>, seed: u64, budget: &mut dyn Budget) -> Plan {
        optimise(ways, seed, budget)
    }
}
