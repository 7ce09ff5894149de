//! The best plan that the budget allows.

use super::Policy;
use crate::optimise::{Budget, optimise};
use crate::plan::Plan;
use crate::way::Ways;

/// See [`crate::optimise`].
#[derive(Debug)]
pub(super) struct Optimise;

impl Policy for Optimise {
    fn name(&self) -> &'static str {
        "optimise"
    }

    fn searches(&self) -> bool {
        true
    }

    fn plan(&self, ways: &Ways<'_>, seed: u64, budget: &mut dyn Budget) -> Plan {
        optimise(ways, seed, budget)
    }
}
