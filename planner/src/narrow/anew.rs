//! Plans one station anew beside the others, where what stations were seen to serve nearly makes a better plan.

use rand::Rng;

use crate::draft::{NONE, Score, broken};
use crate::narrow::together::{Candidate, together};
use crate::narrow::{COLD, is_certain};
use crate::optimise::{Clock, heat};
use crate::prices::{Prices, Reduced};
use crate::search::Search;
use crate::way::Ways;

/// Stations that are planned anew before prices and sets are looked at again, at most.
const CANDIDATES_MAX: usize = 100;
/// Moves for each: with 500, 2000 and 3000, and with four times as many for all in a second round, fewer best plans were
/// found.
const MOVES: u64 = 1000;
/// Slices in which it cools.
const SLICES: u64 = 8;
/// Temperature at first, in units of cost: 3 and 12 were no better.
const HOT: f64 = 6.0;
/// Moves at one station that take the time of one over all.
const TO_A_MOVE: u64 = 2;
/// Sets that are looked at beside others in the time of a move.
const PAIRS_TO_A_MOVE: u64 = 200;

/// A better plan, if sets that were seen make one together, or do once a station is planned anew.
pub(super) fn anew<'w, 'p>(
    ways: &'w Ways<'p>,
    reduced: &Reduced,
    prices: &Prices<'w, 'p>,
    search: &mut Search<'w, 'p>,
    rng: &mut impl Rng,
    clock: &mut Clock<'_>,
) -> Option<Vec<u32>> {
    // What a station can promise one by one it may not be able to promise in another order.
    if !is_certain(ways) {
        return None;
    }
    let known = search.best_score;
    let robots = &ways.problem().robots;
    let held = robots.iter().zip(0..).filter(|(robot, _)| robot.held).fold(0, |held, (_, bit)| held | 1 << bit);
    let broken = broken(ways.problem(), &search.best) as u32;
    let found = together(search.sets.as_ref()?, ways, reduced, known, (held, broken));
    clock.moves += found.pairs / PAIRS_TO_A_MOVE;
    if found.better.is_some() {
        return found.better;
    }
    let mut better = None;
    for candidate in found.candidates.iter().take(CANDIDATES_MAX) {
        if better.is_some() || clock.used() >= 1.0 {
            break;
        }
        better = plan_anew(ways, candidate, prices, search, rng, known);
        clock.moves += MOVES / TO_A_MOVE;
    }
    search.return_to_best();
    better
}

/// Searches a candidate's station alone; a plan that is better than `known`.
fn plan_anew<'w, 'p>(
    ways: &'w Ways<'p>,
    candidate: &Candidate,
    prices: &Prices<'w, 'p>,
    search: &mut Search<'w, 'p>,
    rng: &mut impl Rng,
    known: Score,
) -> Option<Vec<u32>> {
    let mut sets = search.sets.take()?;
    let station = candidate.station;
    sets.stations[station].sets[candidate.places[station] as usize].in_vain = candidate.most;
    let chosen = sets.plan(&candidate.places, search.best.len());
    search.draft.become_choice(&chosen);
    let open: Vec<bool> = (0..search.draft.books.len()).map(|other| other == station).collect();
    let is_movable = |&robot: &u32| {
        let (ways, way) = (&ways.of(robot as usize).ways, chosen[robot as usize]);
        !ways.is_empty() && (way == NONE || usize::from(ways[way as usize].station) == station)
    };
    let movable: Vec<u32> = (0..chosen.len() as u32).filter(is_movable).collect();
    let mut alone = Search::among(search.draft.with_open(&open, &movable), movable);
    alone.sets = Some(sets);
    let is_better = |score: Score| (score.stranded, score.cost) < (known.stranded, known.cost);
    for slice in 0..SLICES {
        alone.run(prices.guide(), rng, MOVES / SLICES, heat([HOT, COLD], slice as f64 / (SLICES - 1) as f64));
        if is_better(alone.best_score) {
            break;
        }
    }
    search.sets = alone.sets.take();
    is_better(alone.best_score).then_some(alone.best)
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::construct::{self, Order};
    use crate::draft::Draft;
    use crate::instance::Instance;
    use crate::narrow::sets::Sets;
    use crate::optimise::Moves;
    use crate::prices::Level;

    #[test]
    fn what_stations_were_seen_to_serve_makes_plans_that_can_be_had_and_are_better() {
        let instance = Instance::parse(include_str!("../../tests/instances/16-2-1.json")).expect("a valid instance");
        let ways = Ways::all(&instance.problem);
        let mut draft = Draft::new(&ways);
        construct::greedy(&mut draft, &construct::ranked(&ways, Order::Deadline), 0.0);
        let mut rng = Pcg64Mcg::seed_from_u64(1);
        let mut prices = Prices::new(&ways, Level::Cost { stranded_max: draft.score.stranded });
        for _ in 0..20 {
            prices.improve(draft.score.cost);
        }
        let mut search = Search::new(draft);
        search.sets = Some(Sets::new(&ways));
        search.run(prices.guide(), &mut rng, 500, 5.0);
        let mut budget = Moves(1_000_000);
        let mut clock = Clock { budget: &mut budget, moves: 0 };
        let mut found = 0;
        loop {
            let known = search.best_score;
            prices.cap_stranded(known.stranded);
            let reduced = prices.reduced(known.cost);
            let Some(better) = anew(&ways, &reduced, &prices, &mut search, &mut rng, &mut clock) else { break };
            let mut anew = Draft::new(&ways);
            for (robot, &way) in better.iter().enumerate().filter(|(_, way)| **way != NONE) {
                let choices = ways.of(robot);
                let taken = &choices.ways[way as usize];
                assert!(anew.books[usize::from(taken.station)].fits(choices, taken), "robot {robot} has no place");
                anew.serve(robot, way);
            }
            assert!((anew.score.stranded, anew.score.cost) < (known.stranded, known.cost));
            search.go_on_from(&better);
            found += 1;
        }
        assert!(found > 0 && clock.moves > 0);
    }
}
