//! No bay, lift movement, spare or joule is promised twice; the same seed gives the same plan.

use planner::{Moves, capacity, plan, policies};
use proptest::prelude::*;

use crate::any;
use crate::checker::judged;

proptest! {
    #![proptest_config(ProptestConfig { cases: 160, ..ProptestConfig::default() })]

    #[test]
    fn no_policy_ever_promises_anything_twice(problem in any::problem(), seed in 0_u64..4) {
        for policy in policies() {
            let plan = plan(&problem, policy.name(), seed, &mut Moves(600)).expect("a problem that can be planned");
            prop_assert_eq!(plan.objective.all(), judged(&problem, &plan), "policy {}", policy.name());
            prop_assert_eq!(plan.sessions.len() + plan.unserved.len(), problem.robots.len());
            prop_assert!(plan.unserved.iter().all(|one| !one.reasons.is_empty()), "{:?}", plan.unserved);
            for (level, (value, bound)) in plan.objective.all().into_iter().zip(plan.bound.all()).enumerate() {
                prop_assert!(bound <= value, "level {}: bound {} is above {}", level, bound, value);
            }
        }
    }

    #[test]
    fn a_seed_and_a_number_of_moves_make_the_plan(problem in any::problem(), seed in any::<u64>()) {
        let once = plan(&problem, "optimise", seed, &mut Moves(500)).expect("a plan");
        let again = plan(&problem, "optimise", seed, &mut Moves(500)).expect("a plan");
        prop_assert_eq!(once, again);
    }

    #[test]
    fn no_pack_pays_for_more_robots_than_it_can(problem in any::problem()) {
        let capacity = capacity(&problem);
        prop_assert!(capacity.atomic.len() <= capacity.atomic_bound);
        prop_assert!(capacity.atomic.len() <= capacity.split);
        prop_assert!(capacity.split <= capacity.split_bound);
        prop_assert!(capacity.packs.iter().all(|&(_, _, alone)| alone <= capacity.atomic_bound));
    }
}
