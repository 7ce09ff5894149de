//! Asks the planner, beginning from the last plan, and says what has moved.

mod sure;

use std::collections::BTreeSet;

use planner::problem::{Problem, Tick};
use planner::{Mode, Moves, NoPlan, Replanned, Session, Ways, renew, replan};
use proto::RobotId;

use super::again::{a_little, count_less, unsure, with_the_uncounted};
use super::effort::{Effort, WHOLE_FLEET_MAX};
use super::plan::{Plan, Rejected};
use super::problem::{RobotView, StationView, View};
use super::translate::{Offer, Task};
use super::unfit::forbid;
use crate::models::{Settings, ShortEnergy};

/// Fewest moves of a search, and most: whoever waits for a plan of a large fleet waits for all of them.
const MOVES_MIN: u64 = 400;
const MOVES_MAX: u64 = 10_000;
/// Moves of a search that mends a plan, fewer than the fewest of any other, some 10 us each: somebody waits for it.
const MENDING_MOVES_MAX: u64 = 300;
/// How often less is counted on, where what the packs were counted to hold is less sure once they are stepped.
const TIMES_LESS: usize = 16;
/// So few robots are planned anew in no time.
const FEW: usize = 16;
/// So many times the usual moves look for what a few robots can share: who has none of it runs empty, and nobody has a promise yet that a
/// plan that was found later could break.
const SHARING: u64 = 10;
/// So many times the usual moves look for a plan of a small fleet in which nobody strands anew, where the first does not prove that there is none.
const HARDER: u64 = 10;
/// The search's seed: the same beliefs and the same last plan give the same plan.
const SEED: u64 = 1;

/// A plan and the problem that it solves.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The problem.
    pub task: Task,
    /// The planner's plan, for explanations.
    pub sessions: Vec<Session>,
    /// The plan in the fleet's terms.
    pub plan: Plan,
    /// Whether anybody strands for want of a place.
    wants_place: bool,
}

impl Solved {
    fn new(task: Task, found: Replanned, before: &Plan, settings: &Settings) -> Self {
        let plan = Plan::new(&task, &found, before, settings.confidence);
        let wants_place = found.plan.unserved.iter().any(|unserved| unserved.stranded && unserved.wants_place);
        Self { sessions: found.plan.sessions, plan, task, wants_place }
    }

    /// Whether somebody strands whom the last plan did not let strand, and nothing proves that so many must.
    fn strands_unproven(&self, before: &Plan) -> bool {
        let known = |robot: &RobotId| before.rejected.iter().any(|left| left.stranded && left.robot == *robot);
        let quality = &self.plan.quality;
        quality.stranded > quality.stranded_bound && self.plan.rejected.iter().any(|left| left.stranded && !known(&left.robot))
    }

    /// How many of those whom the last plan promised a service have none.
    fn broken(&self, before: &Plan) -> usize {
        let has: BTreeSet<&RobotId> = self.plan.planned.iter().map(|planned| &planned.robot).collect();
        before.planned.iter().filter(|promised| !has.contains(&promised.robot)).count()
    }

    /// What it costs, the worst first: promises of the last plan that it breaks, robots that run empty, work that is missed, s.
    pub(super) fn loss(&self, before: &Plan) -> (usize, i64, f64) {
        (self.broken(before), self.plan.quality.stranded, self.plan.quality.missed_s)
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
    let asked = Asked { view: &view, settings, before, effort };
    let mut best = asked.attempt(Offer::Usual);
    if !asked.may_change() {
        return asked.made_sure(best, Offer::Usual);
    }
    // Neither waiting until a service is wanted nor charging to the usual level must cost another robot its turn: if
    // somebody strands for want of a place, all may come earlier, and if that does not help, leave with less. In a large
    // fleet that comes into question with the next whole plan.
    let (usual, mut offered) = (best.clone(), Offer::Usual);
    for offer in [Offer::Early, Offer::Scarce] {
        if !best.wants_place {
            break;
        }
        let is_taken;
        (best, is_taken) = asked.other(best, offer);
        if is_taken {
            offered = offer;
        }
    }
    if !asked.is_small() {
        return best;
    }
    if best.strands_unproven(before) {
        let settings = &Settings { moves_per_robot: HARDER * settings.moves_per_robot, ..*settings };
        (best, _) = Asked { settings, ..asked }.other(best, offered);
    }
    best = asked.made_sure(best, offered);
    if asked.is_better(&usual, &best) && asked.is_sure(&usual) {
        best = usual;
    }
    best = asked.as_promised(&best).unwrap_or(best);
    if best.plan.quality.stranded == 0 {
        return best;
    }
    // Else it is energy that is short: for a charge, or for that of a pack that would be left for a spare.
    best = asked.with_spares(best);
    match settings.short_energy {
        _ if best.plan.quality.stranded == 0 => best,
        ShortEnergy::WholeCharges => asked.with_the_rest(best),
        ShortEnergy::MostRobots => {
            let most = asked.made_sure(asked.other(best.clone(), Offer::Scarce).0, Offer::Scarce);
            if asked.is_better(&most, &best) { most } else { best }
        }
    }
}

/// What a plan is asked for with.
struct Asked<'a> {
    view: &'a View,
    settings: &'a Settings,
    before: &'a Plan,
    effort: Effort,
}

impl Asked<'_> {
    /// Whether what is on offer may change: a policy that is told what to do does that, and mending must not take long.
    fn may_change(&self) -> bool {
        self.effort == Effort::Whole && self.settings.policy.searches()
    }

    /// Whether the fleet is one for which every plan is made as often as it takes.
    fn is_small(&self) -> bool {
        self.view.robots.len() <= WHOLE_FLEET_MAX
    }

    /// The plan with as much for those who strand as its own services, held like promises, leave in the packs, counted at full power.
    /// If that helps nobody, it is the same plan, and says what even the least charge is short of.
    fn with_the_rest(&self, mut best: Solved) -> Solved {
        // There is no part of an exchange.
        let left = self.left(&best, |station| !station.bays.is_empty());
        if left.is_empty() {
            return best;
        }
        let (shared, is_sure) = self.sharing(&best, &left, Effort::Mend);
        let mended = Some(&shared).filter(|shared| is_sure && self.is_better(shared, &best));
        // To mend is to find a place beside what others have. A few robots are planned anew in no time, as long as nobody rests on a promise.
        if self.view.robots.len() <= FEW && self.before.planned.is_empty() && mended.is_none_or(|mended| mended.plan.quality.stranded > 0) {
            let settings = &Settings { moves_per_robot: SHARING * self.settings.moves_per_robot, ..*self.settings };
            let (anew, is_sure) = Asked { settings, ..*self }.sharing(&best, &left, Effort::Whole);
            if is_sure && self.is_better(&anew, mended.unwrap_or(&best)) {
                return anew;
            }
        }
        if mended.is_some() {
            return shared;
        }
        if places(&shared) == places(&best) {
            best.plan.rejected = shared.plan.rejected;
        }
        best
    }

    /// A plan in which those who are left share what the packs hold, and whether that is sure enough once they are stepped. Where it is somewhat
    /// less sure than was counted, somewhat less is counted on.
    fn sharing(&self, best: &Solved, left: &BTreeSet<RobotId>, effort: Effort) -> (Solved, bool) {
        let mut view = best.task.view.clone();
        let asked = Asked { effort, ..*self };
        let beside = |view: &View| asked.beside(&best.plan, (view.clone(), &best.plan), left, Offer::Rest(left));
        let (mut shared, mut unsure) = beside(&view);
        for _ in 0..TIMES_LESS {
            if unsure.is_empty() {
                break;
            }
            count_less(&mut view, &shared.plan, &unsure, a_little);
            (shared, unsure) = beside(&view);
        }
        (shared, unsure.is_empty())
    }

    /// The plan with spares for those who strand, as far as the packs last for exchanges though not for charging all that robots leave:
    /// one after the other, who was promised one first, then who is empty first, as long as all that is promised stays sure.
    fn with_spares(&self, mut best: Solved) -> Solved {
        let has_spares = |station: &StationView| station.charges_spares && !station.spares.is_empty();
        let spares: usize = self.view.stations.iter().filter(|station| has_spares(station)).map(|station| station.spares.len()).sum();
        let left = self.left(&best, has_spares);
        let promised = |robot: &RobotView| self.before.planned.iter().any(|planned| planned.robot == robot.robot);
        let mut left: Vec<&RobotView> = self.view.robots.iter().filter(|robot| left.contains(&robot.robot)).collect();
        let mending = Asked { effort: Effort::Mend, ..*self };
        left.sort_by(|a, b| promised(b).cmp(&promised(a)).then(a.lasts.empty_s.total_cmp(&b.lasts.empty_s)));
        for robot in left.into_iter().take(spares) {
            let asked = BTreeSet::from([robot.robot.clone()]);
            let (shared, unsure) = mending.beside(&best.plan, (best.task.view.clone(), &best.plan), &asked, Offer::Spares(&asked));
            if unsure.is_empty() && self.is_better(&shared, &best) {
                best = shared;
            } else if let Some(why) = shared.plan.rejected.into_iter().find(|left| left.robot == robot.robot) {
                // What it lacks even where nothing has to be charged for it.
                best.plan.rejected.iter_mut().filter(|left| left.robot == why.robot).for_each(|left| left.clone_from(&why));
            }
        }
        best
    }

    /// All that was promised, as it was, if that is better than a plan that breaks some of it: what the packs give to just that load may be
    /// more than any plan counts on, and who was promised a spare for which the energy is short need not lose it to a plan that did not
    /// look for such.
    fn as_promised(&self, best: &Solved) -> Option<Solved> {
        if self.broken(best) == 0 {
            return None;
        }
        let spares = self.before.planned.iter().filter(|promised| promised.mode == Mode::Swap).map(|promised| promised.robot.clone());
        let spares: BTreeSet<RobotId> = spares.collect();
        // Nobody else is given anything for it.
        let is_promised = |robot: &&RobotView| self.before.planned.iter().any(|planned| planned.robot == robot.robot);
        let without = |robot: &RobotView| {
            let left_out = best.plan.rejected.iter().find(|left| left.robot == robot.robot);
            let reasons = || vec!["a service of its own would take from others what they were promised".to_owned()];
            left_out.cloned().unwrap_or_else(|| Rejected { robot: robot.robot.clone(), stranded: true, reasons: reasons(), short: None })
        };
        let rejected = self.view.robots.iter().filter(|robot| !is_promised(robot)).map(without).collect();
        let promised = Plan { planned: self.before.planned.clone(), rejected, ..Plan::default() };
        // Whether there is enough is not counted: the packs are stepped.
        let mut view = self.view.clone();
        for station in &mut view.stations {
            let here = self.before.planned.iter().filter(|planned| planned.station == station.station);
            let needed_wh: f64 = here.map(|planned| planned.need.mean_wh).sum();
            // Also of what those take that have begun: to count it at full power may say that there is not even as much.
            let more_wh = needed_wh + station.owed().mean_wh;
            if let Some(last) = station.packs.iter_mut().rfind(|pack| pack.available_s <= 0.0).filter(|_| needed_wh > 0.0) {
                last.usable_wh.value += more_wh;
                last.uncounted_wh = more_wh;
            }
        }
        let offer = if spares.is_empty() { Offer::Usual } else { Offer::Spares(&spares) };
        let (kept, unsure) = Asked { effort: Effort::Mend, ..*self }.beside(&promised, (view, &Plan::default()), &spares, offer);
        (unsure.is_empty() && self.is_better(&kept, best)).then_some(kept)
    }

    /// Whether a plan breaks fewer promises than another, or as many and misses less. Promises come first: a service hours ahead that
    /// nobody was promised is no reason to break one.
    fn is_better(&self, one: &Solved, than: &Solved) -> bool {
        one.loss(self.before) < than.loss(self.before)
    }

    /// How many of those who were promised a service have none.
    fn broken(&self, solved: &Solved) -> usize {
        solved.broken(self.before)
    }

    /// Who strands and could come to such a station.
    fn left(&self, best: &Solved, to: impl Fn(&StationView) -> bool) -> BTreeSet<RobotId> {
        let stranded: BTreeSet<&RobotId> = best.plan.rejected.iter().filter(|left| left.stranded).map(|left| &left.robot).collect();
        let comes = |robot: &&RobotView| robot.ways.iter().any(|way| to(&self.view.stations[way.station]));
        let left = self.view.robots.iter().filter(|robot| stranded.contains(&robot.robot)).filter(comes);
        left.map(|robot| robot.robot.clone()).collect()
    }

    /// The plan in which these of those who are left are offered this, or keep what they were promised, all others who have services in
    /// `kept` keep them, and nobody else is asked about whom that rejects, with the energy that a view counts on; and who of all is less
    /// sure in it than must be, also beside a plan that counted on it. Only who is asked about gets a place where the plan is mended for it.
    fn beside(
        &self,
        kept: &Plan,
        (mut view, counted): (View, &Plan),
        asked: &BTreeSet<RobotId>,
        offer: Offer<'_>,
    ) -> (Solved, BTreeSet<RobotId>) {
        let rejected = kept.rejected.iter().filter(|left| !asked.contains(&left.robot)).cloned().collect();
        let is_kept = |robot: &RobotId| kept.planned.iter().any(|planned| planned.robot == *robot);
        let promised = self.before.planned.iter().filter(|promised| asked.contains(&promised.robot) && !is_kept(&promised.robot));
        let planned = kept.planned.iter().chain(promised).cloned().collect();
        let before = Plan { planned, rejected, ..Plan::default() };
        let served: BTreeSet<&RobotId> = before.planned.iter().map(|planned| &planned.robot).collect();
        view.robots.iter_mut().for_each(|robot| robot.held |= served.contains(&robot.robot));
        let mut shared = Asked { before: &before, ..*self }.planned(view, offer);
        shared.plan.moved = shared.plan.moved_from(self.before);
        let unsure = unsure(&shared.plan, counted, &before.with_newer(self.before), self.settings.confidence);
        (shared, unsure)
    }

    /// The better of a plan and the one with something else on offer, and whether that is the other one.
    fn other(&self, best: Solved, offer: Offer<'_>) -> (Solved, bool) {
        let other = self.attempt(offer);
        let strands_fewer = other.plan.quality.stranded < best.plan.quality.stranded;
        if strands_fewer && self.broken(&other) <= self.broken(&best) { (other, true) } else { (best, false) }
    }

    /// Plans with what is on offer.
    fn attempt(&self, offer: Offer<'_>) -> Solved {
        let mut solved = self.planned(self.view.clone(), offer);
        if self.may_change()
            && let Some(other) = self.with_another_kind(&solved, offer)
        {
            solved = other;
        }
        let is_asked = self.may_change() && self.is_small() && !solved.plan.rejected.is_empty();
        is_asked.then(|| self.once_more(&solved, offer)).flatten().unwrap_or(solved)
    }

    /// A better plan, in which who strands for want of one kind of spare is given another; none where there is no such plan. What was proven of
    /// either holds only where the other says no less.
    fn with_another_kind(&self, solved: &Solved, offer: Offer<'_>) -> Option<Solved> {
        let others = solved.with_another_kind();
        let mut view = (!others.is_empty()).then(|| solved.task.view.clone())?;
        forbid(&mut view, others);
        let mut again = self.planned(view, offer);
        again.plan.quality.no_more_is_proven_than(solved.plan.quality);
        self.is_better(&again, solved).then_some(again)
    }

    /// A plan that leaves out less, with what the packs give beyond what was counted; none where there is no such plan.
    fn once_more(&self, solved: &Solved, offer: Offer<'_>) -> Option<Solved> {
        let mut but = BTreeSet::new();
        // Where it promised too much, nothing more is counted the second time.
        for _ in 0..2 {
            let other = self.planned(with_the_uncounted(solved, &but)?, offer);
            if !self.is_better(&other, solved) {
                return None;
            }
            let unsure = unsure(&other.plan, &solved.plan, self.before, self.settings.confidence);
            if unsure.is_empty() {
                return Some(other);
            }
            let promised_there =
                other.plan.planned.iter().filter(|planned| unsure.contains(&planned.robot)).map(|planned| &planned.station);
            but.extend(promised_there.filter_map(|there| self.view.stations.iter().position(|station| station.station == *there)));
        }
        None
    }

    /// A plan in whole ticks and the times at which spares are ready may differ by a little: whom a plan gives an exchange for which there
    /// is no spare then is asked again, without that kind. What all of these prove holds.
    fn planned(&self, mut view: View, offer: Offer<'_>) -> Solved {
        let mut proven = None;
        loop {
            let task = Task::new(view, self.settings, &self.before.planned, offer);
            let found = plan(&task, self.settings, self.before, self.effort);
            let mut solved = Solved::new(task, found, self.before, self.settings);
            let quality = &mut solved.plan.quality;
            quality.no_more_is_proven_than(*proven.get_or_insert(*quality));
            proven = Some(*quality);
            let without = solved.without_a_spare();
            if without.is_empty() {
                return solved;
            }
            view = solved.task.view;
            forbid(&mut view, without);
        }
    }
}

/// Who is serviced where, when and how.
fn places(solved: &Solved) -> BTreeSet<(usize, usize, Tick, Mode)> {
    solved.sessions.iter().map(|session| (session.robot, session.station, session.start, session.mode)).collect()
}

fn plan(task: &Task, settings: &Settings, before: &Plan, effort: Effort) -> Replanned {
    let problem: &Problem = &task.problem;
    let sessions = task.sessions(&before.planned);
    let robots = problem.robots.len();
    let most = if effort == Effort::Mend { MENDING_MOVES_MAX } else { MOVES_MAX };
    let mut moves = Moves((settings.moves_per_robot * robots as u64).max(MOVES_MIN).min(most));
    let loyalty = task.loyalty(settings.loyalty_s);
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
