//! Asks the planner, beginning from the last plan, and says what has moved.

use std::collections::BTreeSet;

use planner::problem::Problem;
use planner::{Moves, NoPlan, Replanned, Session, Ways, optimise, renew, replan};
use proto::RobotId;

use super::again::{unsure, with_the_uncounted};
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
    fn new(task: Task, found: Replanned, before: &Plan, settings: &Settings) -> Self {
        let plan = Plan::new(&task, &found, before, settings.confidence);
        Self { sessions: found.plan.sessions, plan, task }
    }

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
    let may_change = effort == Effort::Whole && settings.policy.name() == optimise::NAME;
    let (mut best, mut strands) = attempt(view.clone(), settings, before, effort, Offer::Usual);
    if !may_change {
        return best;
    }
    // Neither waiting until a service is wanted nor charging to the usual level must cost another robot its turn: if
    // somebody strands for want of a place, all may come earlier, and if that does not help, leave with less. In a large
    // fleet that comes into question with the next whole plan.
    for offer in [Offer::Early, Offer::Scarce] {
        if !strands {
            break;
        }
        let (other, other_strands) = attempt(view.clone(), settings, before, effort, offer);
        if other.plan.quality.stranded < best.plan.quality.stranded {
            (best, strands) = (other, other_strands);
        }
    }
    best
}

/// Plans with what is on offer, and says whether a robot strands for want of a place.
fn attempt(view: View, settings: &Settings, before: &Plan, effort: Effort, offer: Offer) -> (Solved, bool) {
    let task = Task::new(view, settings, &before.planned, offer);
    let found = plan(&task, settings, before, effort);
    let strands = found.plan.unserved.iter().any(|unserved| unserved.stranded && unserved.wants_place);
    let solved = Solved::new(task, found, before, settings);
    let may_change = effort == Effort::Whole && settings.policy.name() == optimise::NAME;
    let leaves_out = !solved.plan.rejected.is_empty() && solved.task.view.robots.len() <= WHOLE_FLEET_MAX;
    let better = (may_change && leaves_out).then(|| once_more(&solved, settings, before, offer)).flatten();
    match better {
        Some(better) => {
            let strands = strands && better.plan.quality.stranded > 0;
            (better, strands)
        }
        None => (solved, strands),
    }
}

/// A plan that leaves out less, with what the packs give beyond what was counted; none where there is no such plan.
fn once_more(solved: &Solved, settings: &Settings, before: &Plan, offer: Offer) -> Option<Solved> {
    let missed = |solved: &Solved| (solved.plan.quality.stranded, solved.plan.quality.missed_s);
    let mut but = BTreeSet::new();
    // Where it promised too much, nothing more is counted the second time.
    for _ in 0..2 {
        let view = with_the_uncounted(solved, &but)?;
        let task = Task::new(view, settings, &before.planned, offer);
        let found = plan(&task, settings, before, Effort::Whole);
        let other = Solved::new(task, found, before, settings);
        if missed(&other) >= missed(solved) {
            return None;
        }
        let unsure = unsure(&other.task, &other.plan, &solved.plan, before, settings.confidence);
        if unsure.is_empty() {
            return Some(other);
        }
        but.extend(unsure);
    }
    None
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
