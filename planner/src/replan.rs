//! Mends a plan after something changed, and moves no more commitments than that takes.
//!
//! Robots that did not change keep what they were promised, as long as it still fits. The others
//! take a free place; only if that strands one, or costs it much, the neighbours' promises come
//! into question, each at a price.

use std::collections::BTreeSet;

use rand::SeedableRng;
use rand_pcg::Pcg64Mcg;

use crate::NoPlan;
use crate::construct::greedy;
use crate::draft::{Draft, NONE, broken};
use crate::guide::Guide;
use crate::optimise::{self, Budget, Clock, Moves};
use crate::plan::{Plan, Session};
use crate::prices::{Level, Prices};
use crate::problem::Problem;
use crate::search::Search;
use crate::supply;
use crate::way::{Commitment, Way, Ways};

/// Neighbours whose promises may come into question.
const NEIGHBOURS_MAX: usize = 16;
/// Ticks by which a promised service may slip when it no longer fits.
const SLIP_MAX: u32 = 18;
/// Moves between two looks at the budget.
const MOVES_AT_ONCE: u64 = 25;
/// Greatest loyalty.
const LOYALTY_MAX: u32 = 1_000_000;
/// Rounds of prices that bound a whole plan.
const BOUND_ROUNDS: u64 = 4;

/// A mended plan.
#[derive(Debug, Clone, PartialEq)]
pub struct Replanned {
    /// The plan. Its bound is the weak one that is there at once.
    pub plan: Plan,
    /// Robots that had a session and now have another, or none, in order; those that changed
    /// themselves are among them.
    pub moved: Vec<usize>,
    /// Robots without a session for which nothing came into question: the plan holds no reasons for them,
    /// those of the plan before stand.
    pub unasked: BTreeSet<usize>,
}

/// Holds promises to the certainty that they have now: what is measured may take some of it, but no
/// plan may spend it on less missed work. Raises each station's `quantile_held` to what the sessions of
/// `before`, or the nearest that there are, leave it; at most to `quantile`. A station to which somebody
/// may have to move keeps its own.
pub fn hold(problem: &mut Problem, before: &[Session]) {
    let quantiles = quantiles(problem, before);
    for (station, now) in problem.stations.iter_mut().zip(quantiles) {
        if let (Some(chance), Some(now)) = (&mut station.chance, now) {
            chance.quantile_held = chance.quantile.min(now).max(chance.quantile_held);
        }
    }
}

/// How many standard deviations each station's packs hold beyond what is promised already; none where
/// that is not uncertain, or somebody has lost a place.
fn quantiles(problem: &Problem, before: &[Session]) -> Vec<Option<f64>> {
    let ways = Ways::new(problem);
    let draft = nearest(&ways, before);
    let without = |robot: &usize| problem.robots[*robot].held && draft.chosen[*robot] == NONE;
    let mut lost = vec![false; problem.stations.len()];
    for travel in (0..problem.robots.len()).filter(without).flat_map(|robot| &problem.robots[robot].travel) {
        lost[travel.station] = true;
    }
    // A unit less, so that rounding leaves them room.
    let quantile = |(spare, sigma): (i64, f64)| (spare - 1) as f64 / sigma.max(1.0);
    draft.books.iter().zip(lost).map(|(book, lost)| book.margin().filter(|_| !lost).map(quantile)).collect()
}

/// Those to whom a service was promised, as near to their old sessions as there is a place. Who gives way to
/// one that had to move moves too.
fn nearest<'w, 'p>(ways: &'w Ways<'p>, before: &[Session]) -> Draft<'w, 'p> {
    let mut draft = Draft::new(ways);
    for session in before.iter().filter(|session| ways.problem().robots[session.robot].held) {
        let book = &draft.books[session.station];
        let just = ways.promised(session.robot, Commitment { station: session.station, start: session.start, mode: session.mode });
        if just.ways.first().is_some_and(|way| book.fits(&just, way)) {
            ways.leave(session.robot, just);
            draft.serve(session.robot, 0);
            continue;
        }
        let choices = ways.of(session.robot);
        let alike = |way: &Way| usize::from(way.station) == session.station && way.mode == session.mode && book.fits(choices, way);
        let alike = choices.ways.iter().zip(0..).filter(|(way, _)| alike(way));
        if let Some((_, nearest)) = alike.min_by_key(|(way, _)| u32::from(way.start).abs_diff(session.start)) {
            draft.serve(session.robot, nearest);
        }
    }
    draft
}

/// Mends the plan whose sessions were `before`: their robots, stations and ticks are those of
/// `problem`. `changed` are robots for which something is different.
///
/// A moved commitment counts like `loyalty` of missed work. Sessions that have begun are no
/// business of this: they belong into the problem as ongoing charges.
#[must_use]
pub fn replan(problem: &Problem, before: &[Session], changed: &[usize], loyalty: u32, seed: u64, budget: &mut dyn Budget) -> Replanned {
    let committed = commitments(problem, before);
    let loyalty = loyalty.min(LOYALTY_MAX) as i32;
    let mut free = vec![false; problem.robots.len()];
    changed.iter().for_each(|&robot| free[robot] = true);

    // What still fits is kept, in order of start, or comes a little later: a charge that takes a tick more
    // would else cost the next robot in a full bay its promise. What fits no more is planned anew.
    let kept = Ways::new(problem);
    let mut draft = Draft::new(&kept);
    let mut now = committed.clone();
    for session in before.iter().filter(|session| !changed.contains(&session.robot)) {
        let (robot, book) = (session.robot, &draft.books[session.station]);
        let place = (session.start..=session.start + SLIP_MAX).find_map(|start| {
            let commitment = Commitment { station: session.station, start, mode: session.mode };
            let just = kept.promised(robot, commitment);
            just.ways.first().is_some_and(|way| book.fits(&just, way)).then_some((commitment, just))
        });
        match place {
            Some((commitment, just)) if draft.chosen[robot] == NONE => {
                now[robot] = Some(commitment);
                kept.leave(robot, just);
                draft.serve(robot, 0);
            }
            _ => free[robot] = true,
        }
    }
    let mut anew: Vec<usize> = (0..free.len()).filter(|&robot| free[robot]).collect();
    anew.sort_by_key(|&robot| urgency(problem, robot));
    neighbours(problem, &draft, &anew, &mut free);

    let ways = Ways::for_replanning(problem, &now, &free, loyalty, Some(&kept));
    let mut mended = draft.among(&ways);
    for &robot in &anew {
        if let Some(way) = mended.cheapest(robot, if mended.is_stranded(robot) { i64::MAX } else { mended.cost_of(robot) }) {
            mended.serve(robot, way);
        }
    }
    mended.keep();
    let movable: Vec<u32> =
        (0..free.len()).filter(|&robot| free[robot] && !ways.of(robot).ways.is_empty()).map(|robot| robot as u32).collect();
    let guide = Guide::by_cost(&ways, movable.iter().map(|&robot| robot as usize));
    let mut search = Search::among(mended, movable);
    let mut rng = Pcg64Mcg::seed_from_u64(seed);
    let mut clock = Clock { budget, moves: 0 };
    while clock.used() < 1.0 && !search.idle() {
        search.run(&guide, &mut rng, MOVES_AT_ONCE, 1.0);
        clock.moves += MOVES_AT_ONCE;
    }
    search.return_to_best();
    finished(problem, search.draft, &committed, &free)
}

/// Plans everybody anew by the policy of that name, beginning from the plan whose sessions were
/// `before`; see [`replan`] for what they and `loyalty` mean. Only a policy that searches looks back: what other
/// policies move is counted all the same. The bound is that of the whole problem, without loyalty.
///
/// # Errors
/// When there is no such policy, or no plan can keep to the rules.
pub fn renew(
    problem: &Problem,
    policy: &str,
    before: &[Session],
    loyalty: u32,
    seed: u64,
    budget: &mut dyn Budget,
) -> Result<Replanned, NoPlan> {
    let committed = commitments(problem, before);
    let looks_back = crate::policy(policy).is_some_and(crate::Policy::searches) && !before.is_empty();
    if !looks_back {
        let plan = crate::plan(problem, policy, seed, budget)?;
        let now = commitments(problem, &plan.sessions);
        let moved = (0..committed.len()).filter(|&robot| committed[robot].is_some() && committed[robot] != now[robot]).collect();
        return Ok(Replanned { plan, moved, unasked: BTreeSet::new() });
    }
    let impossible = supply::impossible(problem);
    if !impossible.is_empty() {
        return Err(NoPlan::Impossible(impossible));
    }
    let free = vec![true; problem.robots.len()];
    let ways = Ways::all_loyal(problem, &committed, loyalty.min(LOYALTY_MAX) as i32);
    let mut known = Draft::new(&ways);
    let mut in_order: Vec<&Session> = before.iter().collect();
    in_order.sort_by_key(|session| (!problem.robots[session.robot].held, session.start, session.robot));
    // A charge that takes a tick more makes those behind it a little later, each in its turn; none becomes another.
    for session in in_order {
        let (choices, book) = (ways.of(session.robot), &known.books[session.station]);
        let fits = |start: u32| choices.find(session.station, start, session.mode).filter(|&way| book.fits(choices, &choices.ways[way]));
        let place = (session.start..=session.start + SLIP_MAX).find_map(fits);
        if let Some(way) = place.filter(|_| known.chosen[session.robot] == NONE) {
            known.serve(session.robot, way as u32);
        }
    }
    // Whoever was promised a service and can no longer have just that one comes before who was not.
    let mut everyone: Vec<usize> = (0..problem.robots.len()).collect();
    everyone.sort_by_key(|&robot| urgency(problem, robot));
    greedy(&mut known, &everyone, 0.0);
    let kept = known.chosen.clone();
    let (mut draft, _) = optimise::best(&ways, Some(known), seed, budget);
    // A promise is not broken for the sake of others.
    if draft.broken() > broken(problem, &kept) {
        draft.become_choice(&kept);
    }
    let mut mended = finished(problem, draft, &committed, &free);
    // Two sets of all ways need not be in memory at once.
    drop(ways);
    let honest = Ways::all(problem);
    mended.plan.bound.stranded = optimise::least_stranded(&honest);
    mended.plan.bound.cost = bound(&honest, &mended.plan, &mut Moves(BOUND_ROUNDS * 4 * problem.robots.len() as u64));
    Ok(mended)
}

/// Who was promised a service comes first, then who runs empty first.
fn urgency(problem: &Problem, robot: usize) -> (bool, i64, usize) {
    (!problem.robots[robot].held, problem.last_start(robot), robot)
}

pub(crate) fn commitments(problem: &Problem, sessions: &[Session]) -> Vec<Option<Commitment>> {
    let mut committed: Vec<Option<Commitment>> = vec![None; problem.robots.len()];
    for session in sessions {
        committed[session.robot] = Some(Commitment { station: session.station, start: session.start, mode: session.mode });
    }
    committed
}

/// Frees those who share a station with robots that are planned anew, the nearest in time first,
/// and those who have nothing to lose.
fn neighbours(problem: &Problem, draft: &Draft<'_, '_>, anew: &[usize], free: &mut [bool]) {
    let mut near: Vec<(i64, usize)> = Vec::new();
    for &robot in anew {
        let due = problem.last_start(robot);
        for travel in &problem.robots[robot].travel {
            for &other in &draft.books[travel.station].robots {
                let other = other as usize;
                let start = i64::from(draft.ways.of(other).ways[draft.chosen[other] as usize].start);
                near.push(((start - due).abs(), other));
            }
        }
    }
    near.sort_unstable();
    let mut left = NEIGHBOURS_MAX;
    for (_, robot) in near {
        if left > 0 && !free[robot] {
            free[robot] = true;
            left -= 1;
        }
    }
}

/// The plan, judged without loyalty.
fn finished<'p>(problem: &'p Problem, draft: Draft<'_, 'p>, committed: &[Option<Commitment>], asked: &[bool]) -> Replanned {
    let honest: Vec<Option<Commitment>> = (0..committed.len())
        .map(|robot| {
            let way = *draft.ways.of(robot).ways.get(draft.chosen[robot] as usize)?;
            Some(Commitment { station: usize::from(way.station), start: u32::from(way.start), mode: way.mode })
        })
        .collect();
    let moved = (0..committed.len()).filter(|&robot| committed[robot].is_some() && committed[robot] != honest[robot]).collect();
    // Who is left out and was asked about is told why, and for that all ways count.
    let is_told: Vec<bool> =
        (0..honest.len()).map(|robot| honest[robot].is_none() && (asked[robot] || committed[robot].is_some())).collect();
    let mut ways = Ways::for_replanning(problem, &honest, &is_told, 0, Some(draft.ways));
    // Without a commitment loyalty has changed nothing.
    ways.take_over(draft.ways, (0..honest.len()).filter(|&robot| is_told[robot] && asked[robot] && committed[robot].is_none()));
    let draft = draft.among(&ways);
    // What can be said of any plan without looking at the ways: it strands nobody and misses nothing.
    let mut plan = Plan::new(&draft, 0, 0, 0);
    let unasked: BTreeSet<usize> = plan.unserved.iter().map(|unserved| unserved.robot).filter(|&robot| !is_told[robot]).collect();
    for unserved in plan.unserved.iter_mut().filter(|unserved| unasked.contains(&unserved.robot)) {
        (unserved.wants_place, unserved.obstacles, unserved.reasons) = (false, Vec::new(), Vec::new());
    }
    Replanned { plan, moved, unasked }
}

/// A bound for a whole plan that was mended: as good as the budget allows.
#[must_use]
pub fn bound(ways: &Ways<'_>, plan: &Plan, budget: &mut dyn Budget) -> i64 {
    let mut prices = Prices::new(ways, Level::Cost { stranded_max: plan.objective.stranded });
    let mut moves = 0;
    while budget.used(moves) < 1.0 {
        moves += prices.improve(plan.objective.cost);
    }
    prices.bound()
}
