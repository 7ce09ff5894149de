//! Asks the planner, beginning from the last plan, and says what has moved.

use std::collections::BTreeSet;

use planner::problem::Problem;
use planner::{Moves, NoPlan, Replanned, Session, Ways, optimise, renew, replan};
use proto::RobotId;

use super::plan::Plan;
use super::problem::View;
use super::translate::{Offer, Task, worth};
use crate::models::Settings;

/// Fleets up to this size are planned as a whole whatever happens.
pub const WHOLE_FLEET_MAX: usize = 64;
/// And if this share of it was not planned for yet.
const NEW_SHARE_MAX: f64 = 0.1;
/// Fewest moves of a search, and most: whoever waits for a plan of a large fleet waits for all of them.
const MOVES_MIN: u64 = 400;
const MOVES_MAX: u64 = 10_000;
/// Most moves of a search that mends a plan, some 10 us each: somebody waits for it.
const MENDING_MOVES_MAX: u64 = 300;
/// The search's seed: the same beliefs and the same last plan give the same plan.
const SEED: u64 = 1;

/// How much of a plan may come into question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// What no longer fits, and its neighbours.
    Mend,
    /// Everything.
    Whole,
}

impl Effort {
    /// The least that makes a plan of what is believed from the last one: only of a large fleet can a plan
    /// be mended, and only when few of it are new.
    #[must_use]
    pub fn needed(view: &View, before: &Plan, settings: &Settings) -> Self {
        let known: BTreeSet<&RobotId> = before.robots().collect();
        let new = view.robots.iter().filter(|robot| !known.contains(&robot.robot)).count();
        let is_mendable = Self::takes_long(view, settings) && (new as f64) < NEW_SHARE_MAX * view.robots.len() as f64;
        if is_mendable { Self::Mend } else { Self::Whole }
    }

    /// Whether a whole plan takes longer than anybody should wait for.
    #[must_use]
    pub fn takes_long(view: &View, settings: &Settings) -> bool {
        view.robots.len() > WHOLE_FLEET_MAX && settings.policy.name() == optimise::NAME
    }
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

impl Solved {
    /// What there is to choose from for these robots, and what was chosen for the others.
    #[must_use]
    pub fn ways(&self, asked: &BTreeSet<&RobotId>) -> Ways<'_> {
        Ways::for_explaining(&self.task.problem, &self.sessions, |robot| asked.contains(&self.task.view.robots[robot].robot))
    }
}

/// Plans for what is believed. `before` is what the last plan holds that has not begun: moving a service
/// must save as much work as the settings say.
#[must_use]
pub fn solve(view: View, settings: &Settings, before: &Plan, effort: Effort) -> Solved {
    let mut task = Task::new(view, settings, &before.planned, Offer::Usual);
    let mut found = plan(&task, settings, before, effort);
    // Neither waiting until a service is wanted nor charging to the usual level must cost another robot its turn: if
    // somebody strands for want of a place, all may come earlier, and if that does not help, leave with less. In a large
    // fleet that comes into question with the next whole plan.
    let may_change = effort == Effort::Whole && settings.policy.name() == optimise::NAME;
    for offer in [Offer::Early, Offer::Scarce] {
        let strands_for_a_place = found.plan.unserved.iter().any(|unserved| unserved.stranded && unserved.wants_place);
        if !strands_for_a_place || !may_change {
            break;
        }
        let other = Task::new(task.view.clone(), settings, &before.planned, offer);
        let other_found = plan(&other, settings, before, effort);
        if other_found.plan.objective.stranded < found.plan.objective.stranded {
            (task, found) = (other, other_found);
        }
    }
    let plan = Plan::new(&task, &found, before, settings.confidence);
    Solved { sessions: found.plan.sessions, plan, task }
}

fn plan(task: &Task, settings: &Settings, before: &Plan, effort: Effort) -> Replanned {
    let problem: &Problem = &task.problem;
    let sessions = task.sessions(&before.planned);
    let robots = problem.robots.len();
    let most = if effort == Effort::Mend { MENDING_MOVES_MAX } else { MOVES_MAX };
    let mut moves = Moves((settings.moves_per_robot * robots as u64).max(MOVES_MIN).min(most));
    let loyalty = worth(settings.loyalty_s, task.grid);
    if effort == Effort::Mend {
        let known: BTreeSet<&RobotId> = before.robots().collect();
        let new: Vec<usize> = (0..robots).filter(|&robot| !known.contains(&task.view.robots[robot].robot)).collect();
        return replan(problem, &sessions, &new, loyalty, SEED, &mut moves);
    }
    match renew(problem, settings.policy.name(), &sessions, loyalty, SEED, &mut moves) {
        Ok(found) => found,
        Err(NoPlan::Policy { .. } | NoPlan::Impossible(_)) => {
            unreachable!("the policy was looked up, and stations that may go dark can always be planned")
        }
    }
}
