//! What is said to be proven is not undercut by anybody.

use planner::draft::Draft;
use planner::problem::Problem;
use planner::{Moves, Ways, plan, policies};
use proptest::prelude::*;

use crate::any;

/// Enough to go through all that a better plan could be.
const MOVES: u64 = 60_000;
/// Plans that are tried one by one.
const PLANS_MAX: usize = 1_000_000;

/// The best of all plans in stranded robots and missed work.
fn best_of_all(draft: &mut Draft<'_, '_>, robot: usize) -> (i64, i64) {
    let ways = draft.ways;
    if robot == ways.problem().robots.len() {
        return (draft.score.stranded, draft.score.cost);
    }
    let mut best = best_of_all(draft, robot + 1);
    let choices = ways.of(robot);
    for (way, place) in choices.ways.iter().zip(0..) {
        if draft.books[usize::from(way.station)].fits(choices, way) {
            let mark = draft.mark();
            draft.serve(robot, place);
            best = best.min(best_of_all(draft, robot + 1));
            draft.undo(mark);
        }
    }
    best
}

fn all_plans(problem: &Problem) -> usize {
    let ways = Ways::all(problem);
    (0..problem.robots.len()).map(|robot| ways.of(robot).ways.len() + 1).fold(1, usize::saturating_mul)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, ..ProptestConfig::default() })]

    #[test]
    fn no_other_plan_is_below_a_bound(problem in any::problem()) {
        let known = plan(&problem, "optimise", 1, &mut Moves(MOVES)).expect("a problem that can be planned");
        let seeds = (2..5).map(|seed| plan(&problem, "optimise", seed, &mut Moves(MOVES / 20)));
        let others = policies().iter().map(|policy| plan(&problem, policy.name(), 1, &mut Moves(600)));
        for other in seeds.chain(others) {
            let other = other.expect("a problem that can be planned").objective;
            prop_assert!(other.stranded >= known.bound.stranded);
            prop_assert!(other.stranded > known.objective.stranded || other.cost >= known.bound.cost, "{other:?} is below {:?}", known.bound);
        }
    }

    #[test]
    fn the_best_of_all_plans_is_found(problem in any::problem(), robots in 2_usize..5) {
        let mut problem = problem;
        problem.robots.truncate(robots);
        while all_plans(&problem) > PLANS_MAX {
            problem.robots.pop();
        }
        let known = plan(&problem, "optimise", 1, &mut Moves(MOVES)).expect("a problem that can be planned");
        let best = best_of_all(&mut Draft::new(&Ways::all(&problem)), 0);
        prop_assert_eq!((known.objective.stranded, known.objective.cost), best);
        prop_assert!(known.bound.stranded <= best.0 && known.bound.cost <= best.1, "{:?} is above {best:?}", known.bound);
    }

    #[test]
    fn whoever_cannot_be_saved_is_given_up(problem in any::doubtful()) {
        let plan = plan(&problem, "optimise", 1, &mut Moves(MOVES)).expect("stations that may go dark can always be planned");
        prop_assert!(plan.bound.stranded <= plan.objective.stranded);
    }
}
