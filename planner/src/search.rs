//! Betters a plan by large-neighbourhood search.
//!
//! A move gives one robot a way that it would rather have, releases whoever stands in that way,
//! and finds these new places. It is kept if the plan gets better, or, the hotter the search, not
//! much worse (annealing); otherwise the log takes it back.

use rand::{Rng, RngExt};

use crate::draft::{Draft, NONE, Score};
use crate::guide::Guide;

/// Robots that one move may release for the sake of others.
const RELEASED_MAX: usize = 8;
/// Robots that one move may force in after the first.
const FORCED_MAX: usize = 3;

/// A search and the best plan that it has come across.
#[derive(Debug)]
pub struct Search<'w, 'p> {
    /// The plan of now.
    pub draft: Draft<'w, 'p>,
    /// The best choice so far.
    pub best: Vec<u32>,
    /// And its score.
    pub best_score: Score,
    /// Robots that differ between now and the best, when only few moves ago.
    waiting: Vec<usize>,
}

impl<'w, 'p> Search<'w, 'p> {
    /// Starts from a plan.
    #[must_use]
    pub fn new(draft: Draft<'w, 'p>) -> Self {
        let (best, best_score) = (draft.chosen.clone(), draft.score);
        Self { draft, best, best_score, waiting: Vec::new() }
    }

    /// Returns to the best plan.
    pub fn return_to_best(&mut self) {
        let best = self.best.clone();
        self.draft.become_choice(&best);
    }

    /// Makes some moves at a temperature, in units of cost.
    pub fn run(&mut self, guide: &Guide, rng: &mut impl Rng, moves: u64, temperature: f64) {
        let robots = self.draft.chosen.len();
        if robots == 0 {
            return;
        }
        for _ in 0..moves {
            let before = self.draft.score;
            let margin = (-temperature * f64::ln(rng.random::<f64>().max(1e-12))) as i64;
            let done = if rng.random_range(0..16) == 0 { self.mix(guide, rng) } else { self.force(guide, rng, before, margin) };
            let after = self.draft.score;
            let better = after.stranded < before.stranded
                || (after.stranded == before.stranded
                    && (after.cost < before.cost + margin || (after.cost == before.cost && after.energy <= before.energy)));
            if done && better {
                self.accept();
            } else {
                self.draft.undo(0);
            }
        }
    }

    fn accept(&mut self) {
        if self.draft.score < self.best_score {
            self.best_score = self.draft.score;
            for robot in self.draft.changed(0).chain(self.waiting.drain(..)) {
                self.best[robot] = self.draft.chosen[robot];
            }
        } else {
            self.waiting.extend(self.draft.changed(0));
            if self.waiting.len() > 4 * self.best.len() + 64 {
                self.waiting.sort_unstable();
                self.waiting.dedup();
            }
        }
        self.draft.keep();
    }

    /// Someone who has cause to complain: stranded, or far from its cheapest way.
    fn pick(&self, rng: &mut impl Rng) -> usize {
        let draft = &self.draft;
        if !draft.lost.is_empty() && rng.random_range(0..4) == 0 {
            return draft.lost[rng.random_range(0..draft.lost.len())] as usize;
        }
        let mut pick = || rng.random_range(0..draft.chosen.len());
        let regret = |robot: usize| draft.ways.of(robot).ways.first().map_or(-1, |way| draft.cost_of(robot) - i64::from(way.cost));
        let (a, b) = (pick(), pick());
        if regret(a) >= regret(b) { a } else { b }
    }

    /// Gives a robot one of its promising ways and finds new places for those in the way.
    fn force(&mut self, guide: &Guide, rng: &mut impl Rng, before: Score, margin: i64) -> bool {
        let first = self.pick(rng);
        let mut queue = vec![first];
        let mut settled: Vec<usize> = Vec::new();
        let (mut released, mut forced) = (0, 0);
        while let Some(robot) = queue.pop() {
            let must = robot == first && settled.is_empty();
            let found = if must { None } else { self.place(guide, rng, robot) };
            if let Some(way) = found {
                self.draft.serve(robot, way);
            } else if must || (self.draft.ways.of(robot).strands && forced < FORCED_MAX && rng.random_range(0..4) != 0) {
                forced += u32::from(!must) as usize;
                let Some(way) = self.wish(guide, rng, robot) else { return false };
                if self.draft.chosen[robot] != NONE {
                    self.draft.release(robot);
                }
                if !self.clear(rng, robot, way, &settled, &mut queue, &mut released) {
                    return false;
                }
                self.draft.serve(robot, way);
            }
            settled.push(robot);
            // What is queued adds to the score as if unserved, so only a lower bound may stop early.
            if queue.is_empty() {
                break;
            }
            let pending: i64 = queue.iter().map(|&robot| self.hope(robot)).sum();
            if queue.iter().all(|&robot| !self.draft.ways.of(robot).strands)
                && self.draft.score.stranded >= before.stranded
                && self.draft.score.cost - pending > before.cost + margin
            {
                return false;
            }
        }
        true
    }

    /// How much the cost can fall at most by serving a robot that has no service.
    fn hope(&self, robot: usize) -> i64 {
        let choices = self.draft.ways.of(robot);
        choices.ways.first().map_or(0, |way| i64::from(choices.unserved_cost - way.cost).max(0))
    }

    /// One of a robot's promising ways that it does not have.
    fn wish(&self, guide: &Guide, rng: &mut impl Rng, robot: usize) -> Option<u32> {
        let listed = &guide.listed[robot];
        if listed.is_empty() {
            return None;
        }
        // Mostly from the top of the list: the square of a uniform number is small more often.
        let place = rng.random::<f32>();
        let way = listed[((place * place * listed.len() as f32) as usize).min(listed.len() - 1)];
        (way != self.draft.chosen[robot]).then_some(way)
    }

    /// A free place: the cheapest for the robot, or the first by prices.
    fn place(&self, guide: &Guide, rng: &mut impl Rng, robot: usize) -> Option<u32> {
        let choices = self.draft.ways.of(robot);
        let limit = if choices.strands { i64::MAX } else { i64::from(choices.unserved_cost) };
        if rng.random_range(0..2) == 0 {
            let fits = |way: &&u32| {
                let way = &choices.ways[**way as usize];
                self.draft.books[usize::from(way.station)].fits(choices, way)
            };
            if let Some(&way) = guide.listed[robot].iter().find(fits) {
                return Some(way);
            }
        }
        self.draft.cheapest(robot, limit)
    }

    /// Releases robots until a way is free.
    fn clear(
        &mut self,
        rng: &mut impl Rng,
        robot: usize,
        way: u32,
        settled: &[usize],
        queue: &mut Vec<usize>,
        released: &mut usize,
    ) -> bool {
        let choices = self.draft.ways.of(robot);
        let way = &choices.ways[way as usize];
        let station = usize::from(way.station);
        while let Some(clash) = self.draft.books[station].clash(choices, way) {
            let book = &self.draft.books[station];
            let mut victim = None;
            let mut seen = 0;
            for &other in &book.robots {
                let other = other as usize;
                let ways = &self.draft.ways.of(other).ways;
                if book.takes_part(clash, &ways[self.draft.chosen[other] as usize]) && !settled.contains(&other) {
                    seen += 1;
                    if rng.random_range(0..seen) == 0 {
                        victim = Some(other);
                    }
                }
            }
            let Some(victim) = victim else { return false };
            *released += 1;
            if *released > RELEASED_MAX {
                return false;
            }
            self.draft.release(victim);
            queue.push(victim);
        }
        true
    }

    /// Releases some robots of a station and places them anew in another order.
    fn mix(&mut self, guide: &Guide, rng: &mut impl Rng) -> bool {
        let station = rng.random_range(0..self.draft.books.len().max(1));
        let Some(book) = self.draft.books.get(station) else { return false };
        if book.robots.is_empty() {
            return false;
        }
        let mut some: Vec<usize> = book.robots.iter().map(|&robot| robot as usize).collect();
        let count = rng.random_range(2..=6).min(some.len());
        for place in 0..count {
            let other = rng.random_range(place..some.len());
            some.swap(place, other);
        }
        some.truncate(count);
        for &robot in &some {
            self.draft.release(robot);
        }
        if !self.draft.lost.is_empty() {
            some.push(self.draft.lost[rng.random_range(0..self.draft.lost.len())] as usize);
        }
        some.push(self.pick(rng));
        for place in 0..some.len() {
            let other = rng.random_range(place..some.len());
            some.swap(place, other);
        }
        for robot in some {
            if self.draft.chosen[robot] == NONE
                && let Some(way) = self.place(guide, rng, robot)
            {
                self.draft.serve(robot, way);
            }
        }
        true
    }
}
