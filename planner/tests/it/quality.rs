//! Against optima that another solver proved; see `tests/instances/README.md`.

use planner::{Instance, Moves, plan};
use serde::Deserialize;

use crate::checker::judged;

#[derive(Deserialize)]
struct Optimum {
    instance: String,
    stranded: i64,
    cost: i64,
}

fn instance(name: &str) -> Instance {
    let path = format!("{}/tests/instances/{name}.json", env!("CARGO_MANIFEST_DIR"));
    Instance::parse(&std::fs::read_to_string(path).expect("an instance")).expect("a valid instance")
}

#[test]
fn small_fleets_are_planned_as_well_as_can_be() {
    let optima: Vec<Optimum> = serde_json::from_str(include_str!("../instances/optima.json")).expect("a list");
    for optimum in &optima {
        let instance = instance(&optimum.instance);
        let plan = plan(&instance.problem, "optimise", 1, &mut Moves(60_000)).expect("a plan");
        assert_eq!(plan.objective.all(), judged(&instance.problem, &plan), "{}", optimum.instance);
        assert_eq!([plan.objective.stranded, plan.objective.cost], [optimum.stranded, optimum.cost], "{}", optimum.instance);
        assert!(plan.bound.cost <= optimum.cost, "{}", optimum.instance);
    }
}

/// A plan that is said to be the best is no worse than what another solver found, whichever way the search went.
#[test]
fn what_is_proven_is_not_undercut() {
    let optima: Vec<Optimum> = serde_json::from_str(include_str!("../instances/optima.json")).expect("a list");
    for optimum in &optima {
        let instance = instance(&optimum.instance);
        for seed in 1..=6 {
            let bound = plan(&instance.problem, "optimise", seed, &mut Moves(60_000)).expect("a plan").bound;
            assert!((bound.stranded, bound.cost) <= (optimum.stranded, optimum.cost), "{} by seed {seed}: {bound:?}", optimum.instance);
        }
    }
}

#[test]
fn planning_ahead_beats_what_fleets_do_today() {
    let instance = instance("12-2-1");
    let level = |policy| plan(&instance.problem, policy, 1, &mut Moves(20_000)).expect("a plan").objective;
    for other in ["threshold", "lowest_soc", "earliest_deadline", "least_slack"] {
        assert!(level("optimise") < level(other), "{other}");
    }
}
