//! Puts good plans together: the best plan that is made of their ways alone.
//!
//! A search comes across thousands of good plans. A way that none of them had is seldom in the best one, and among
//! those that some had, prices and a beam soon have gone through everything.

use crate::draft::{NONE, Score};
use crate::narrow::beam::beam;
use crate::narrow::{TO_A_MOVE, go_on_from};
use crate::optimise::Clock;
use crate::prices::{Level, Prices};
use crate::search::Search;
use crate::way::Ways;

/// Ways for each robot: with ten beams took so long that nothing was gained, with three too much was left out.
const WAYS: usize = 5;
/// Rounds of prices among them.
const ROUNDS: u32 = 4;
/// Beginnings of plans at a time.
const WIDTH: usize = 128;

/// What the best plan cost that was seen with each way.
#[derive(Debug, Clone)]
pub(crate) struct Seen {
    stranded: i64,
    least: Vec<Vec<i64>>,
}

impl Seen {
    /// None was seen yet.
    pub(crate) fn new(ways: &Ways<'_>, stranded: i64) -> Self {
        let least = (0..ways.problem().robots.len()).map(|robot| vec![i64::MAX; ways.of(robot).ways.len()]).collect();
        Self { stranded, least }
    }

    /// Notes a plan.
    pub(crate) fn note(&mut self, chosen: &[u32], score: Score) {
        if score.stranded > self.stranded {
            return;
        }
        if score.stranded < self.stranded {
            self.stranded = score.stranded;
            self.least.iter_mut().for_each(|least| least.fill(i64::MAX));
        }
        for (least, &way) in self.least.iter_mut().zip(chosen) {
            if way != NONE {
                let least = &mut least[way as usize];
                *least = score.cost.min(*least);
            }
        }
    }

    /// Takes over what was seen among fewer ways: each robot's, by their index here.
    pub(crate) fn take_over(&mut self, other: &Self, kept: &[Vec<u32>]) {
        if other.stranded != self.stranded {
            return;
        }
        for ((least, other), kept) in self.least.iter_mut().zip(&other.least).zip(kept) {
            for (&other, &way) in other.iter().zip(kept) {
                let least = &mut least[way as usize];
                *least = other.min(*least);
            }
        }
    }

    /// So many ways of the best plans, for each robot.
    fn best(&self, count: usize) -> Vec<Vec<u32>> {
        let mut all: Vec<(i64, u32, usize)> = Vec::new();
        for (robot, least) in self.least.iter().enumerate() {
            all.extend(least.iter().zip(0..).filter(|(least, _)| **least != i64::MAX).map(|(&least, way)| (least, way, robot)));
        }
        if all.len() > count {
            all.select_nth_unstable(count);
            all.truncate(count);
        }
        let mut ways = vec![Vec::new(); self.least.len()];
        all.into_iter().for_each(|(_, way, robot)| ways[robot].push(way));
        ways
    }
}

/// Looks for a better plan among the ways of the best plans that were seen. Whether there is one.
pub(super) fn merge<'w, 'p>(ways: &'w Ways<'p>, prices: &Prices<'w, 'p>, search: &mut Search<'w, 'p>, clock: &mut Clock<'_>) -> bool {
    let known = search.best_score;
    let Some(seen) = search.seen.as_ref().filter(|seen| seen.stranded == known.stranded) else { return false };
    let robots = ways.problem().robots.len();
    let kept = seen.best(WAYS * robots);
    let few = ways.only(|robot| kept[robot].clone());
    let mut priced = Prices::from(&few, Level::Cost { stranded_max: known.stranded }, prices.best());
    for _ in 0..ROUNDS {
        if priced.bound() < known.cost {
            clock.moves += priced.improve(known.cost);
        }
    }
    let reduced = priced.reduced(known.cost);
    if reduced.room < 0 {
        return false;
    }
    let began = clock.moves;
    let found = beam(&few, &reduced, known.stranded, WIDTH, |seen| clock.used_with(began + seen / TO_A_MOVE) < 1.0);
    clock.moves = began + found.seen / TO_A_MOVE;
    found.chosen.is_some_and(|chosen| go_on_from(search, &ways.translated(&few, &chosen)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instance::Instance;

    #[test]
    fn the_ways_of_the_best_plans_are_kept() {
        let instance = Instance::parse(include_str!("../../tests/instances/6-1-1.json")).expect("a valid instance");
        let ways = Ways::all(&instance.problem);
        let mut seen = Seen::new(&ways, 1);
        let plan = |way: u32| -> Vec<u32> { (0..6).map(|robot| if ways.of(robot).ways.len() > 9 { way } else { NONE }).collect() };
        let served = plan(0).iter().filter(|way| **way != NONE).count();
        assert!(served > 0);
        let score = |stranded: i64, cost: i64| Score { stranded, cost, energy: 0 };
        for (way, cost) in [(4, 30), (2, 10), (7, 20), (4, 40)] {
            seen.note(&plan(way), score(1, cost));
        }
        let of_all =
            |seen: &Seen, count: usize| -> Vec<u32> { seen.best(count).into_iter().find(|ways| !ways.is_empty()).unwrap_or_default() };
        let mut two = of_all(&seen, 2 * served);
        two.sort_unstable();
        assert_eq!(two, [2, 7]);
        // Who strands more tells nothing, who strands fewer makes the others forgotten.
        seen.note(&plan(5), score(2, 1));
        assert_eq!(of_all(&seen, served), [2]);
        seen.note(&plan(9), score(0, 99));
        assert_eq!(of_all(&seen, 3 * served), [9]);
    }
}
