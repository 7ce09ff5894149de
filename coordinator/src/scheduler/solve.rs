//! Asks the planner, beginning from the last plan, and says what has moved.

use planner::problem::Problem;
use planner::{Moves, NoPlan, Replanned, Session, optimise, renew, replan};

use super::plan::{Plan, Planned};
use super::problem::View;
use super::translate::{Task, worth};
use crate::models::Settings;

/// Fleets up to this size are planned as a whole whatever happens.
const WHOLE_FLEET_MAX: usize = 64;
/// Fewest moves of a search.
const MOVES_MIN: u64 = 400;
/// The search's seed: the same beliefs and the same last plan give the same plan.
const SEED: u64 = 1;

/// How much of a plan may come into question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// What no longer fits, and its neighbours.
    Mend,
    /// Everything.
    Better,
}

/// A plan and the problem that it solves.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The problem.
    pub task: Task,
    /// The planner's plan, for explanations.
    pub sessions: Vec<Session>,
    /// The plan in the fleet's terms.
    pub plan: Plan,
}

/// Plans for what is believed. `before` are the services of the last plan that have not begun: moving
/// one must save as much work as the settings say.
#[must_use]
pub fn solve(view: View, settings: &Settings, before: &[Planned], effort: Effort) -> Solved {
    let gated = Task::new(view, settings, before, true);
    let found = plan(&gated, settings, before, effort);
    // Waiting until a service is wanted must not cost a robot its turn: if somebody strands for want of a
    // place, all may come earlier.
    let strands_for_a_place = found.plan.unserved.iter().any(|unserved| unserved.stranded && unserved.wants_place);
    if strands_for_a_place && settings.policy.name() == optimise::NAME {
        let open = Task::new(gated.view.clone(), settings, before, false);
        let early = plan(&open, settings, before, effort);
        if early.plan.objective.stranded < found.plan.objective.stranded {
            return solved(open, &early, settings);
        }
    }
    solved(gated, &found, settings)
}

fn plan(task: &Task, settings: &Settings, before: &[Planned], effort: Effort) -> Replanned {
    let problem: &Problem = &task.problem;
    let sessions = task.sessions(before);
    let robots = problem.robots.len();
    let mut moves = Moves((settings.moves_per_robot * robots as u64).max(MOVES_MIN));
    let loyalty = worth(settings.loyalty_s, task.grid);
    if effort == Effort::Mend && robots > WHOLE_FLEET_MAX && settings.policy.name() == optimise::NAME && !sessions.is_empty() {
        return replan(problem, &sessions, &[], loyalty, SEED, &mut moves);
    }
    match renew(problem, settings.policy.name(), &sessions, loyalty, SEED, &mut moves) {
        Ok(found) => found,
        Err(NoPlan::Policy { .. } | NoPlan::Impossible(_)) => {
            unreachable!("the policy was looked up, and stations that may go dark can always be planned")
        }
    }
}

fn solved(task: Task, found: &Replanned, settings: &Settings) -> Solved {
    let plan = Plan::new(&task, found, settings.charge_to_soc, settings.confidence);
    Solved { sessions: found.plan.sessions.clone(), plan, task }
}
