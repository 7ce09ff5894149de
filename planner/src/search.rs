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
/// Robots that one move may force in after the first, for the sake of not being stranded.
const FORCED_MAX: usize = 2;
/// How often it does, rather than leave the robot stranded.
const FORCED_SHARE: f32 = 0.3;
/// The same when the move is for somebody who is stranded.
const RESCUE_SHARE: f32 = 0.75;
/// Robots among which the one with most cause to complain is moved.
const COMPARED: u32 = 4;

/// One wish of so many is for any way at all: lists by price forget what rarely pays.
const ANY_OF: u32 = 16;
/// A way that nobody has, and that is not [`NONE`] either.
const UNKNOWN: u32 = NONE - 1;
/// Rounds in which everybody may take a better place that is free, when there is time.
pub const SETTLED_MAX: u32 = 6;

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
    /// Robots that moves begin with.
    movable: Vec<u32>,
    /// Each robot's way when its regret was last asked for, and that regret.
    regrets: Vec<(u32, f32)>,
    /// The ways of a robot that have a place, while one is looked for.
    free: Vec<u32>,
}

impl<'w, 'p> Search<'w, 'p> {
    /// Starts from a plan.
    #[must_use]
    pub fn new(draft: Draft<'w, 'p>) -> Self {
        let movable = (0..draft.chosen.len()).filter(|&robot| !draft.ways.of(robot).ways.is_empty());
        let movable = movable.map(|robot| robot as u32).collect();
        Self::among(draft, movable)
    }

    /// The same, but moves begin with these robots alone.
    #[must_use]
    pub fn among(draft: Draft<'w, 'p>, movable: Vec<u32>) -> Self {
        let (best, best_score) = (draft.chosen.clone(), draft.score);
        Self { draft, best, best_score, waiting: Vec::new(), movable, regrets: Vec::new(), free: Vec::new() }
    }

    /// Robots that moves begin with.
    pub(crate) fn movable(&self) -> &[u32] {
        &self.movable
    }

    /// Goes on from what became of two copies of the plan of now that changed nothing of the same.
    pub(crate) fn join(&mut self, parts: [Self; 2]) {
        let before = self.draft.score;
        let (mut now, mut best, mut best_score) = (self.draft.chosen.clone(), self.draft.chosen.clone(), before);
        for part in &parts {
            for (robot, &was) in self.draft.chosen.iter().enumerate() {
                if part.draft.chosen[robot] != was {
                    now[robot] = part.draft.chosen[robot];
                }
                if part.best[robot] != was {
                    best[robot] = part.best[robot];
                }
            }
            best_score.stranded += part.best_score.stranded - before.stranded;
            best_score.cost += part.best_score.cost - before.cost;
            best_score.energy += part.best_score.energy - before.energy;
        }
        if best_score < self.best_score {
            (self.best, self.best_score) = (best, best_score);
        }
        self.draft.become_choice(&now);
        self.waiting = (0..now.len()).filter(|&robot| now[robot] != self.best[robot]).collect();
    }

    /// Whether there is nobody to move.
    #[must_use]
    pub fn idle(&self) -> bool {
        self.movable.is_empty()
    }

    /// Returns to the best plan.
    pub fn return_to_best(&mut self) {
        self.draft.become_choice(&self.best);
        self.waiting.clear();
    }

    /// Goes on from another plan, which is the best from now on.
    pub fn go_on_from(&mut self, chosen: &[u32]) {
        self.draft.become_choice(chosen);
        self.best.copy_from_slice(chosen);
        self.best_score = self.draft.score;
        self.waiting.clear();
    }

    /// Lets every robot in turn take the best way that is free to it, by cost and then by energy, so often.
    pub fn settle(&mut self, rounds: u32) {
        for _ in 0..rounds {
            let before = self.draft.score;
            for place in 0..self.movable.len() {
                let robot = self.movable[place] as usize;
                let old = self.draft.chosen[robot];
                if old == NONE {
                    let limit = if self.draft.is_stranded(robot) { i64::MAX } else { self.draft.cost_of(robot) };
                    if let Some(way) = self.draft.cheapest(robot, limit) {
                        self.draft.serve(robot, way);
                    }
                } else if old > 0 {
                    self.draft.release(robot);
                    let way = self.draft.first_before(robot, old).unwrap_or(old);
                    self.draft.serve(robot, way);
                }
            }
            self.accept();
            if self.draft.score >= before {
                break;
            }
        }
    }

    /// Makes some moves at a temperature, in units of cost.
    pub fn run(&mut self, guide: &Guide, rng: &mut impl Rng, moves: u64, temperature: f64) {
        if self.idle() {
            return;
        }
        // Another guide: other regrets.
        self.regrets.clear();
        self.regrets.resize(self.draft.chosen.len(), (UNKNOWN, 0.0));
        for _ in 0..moves {
            let before = self.draft.score;
            let margin = (-temperature * f64::ln(rng.random::<f64>().max(1e-12))) as i64;
            let done = self.force(guide, rng, before, margin);
            let after = self.draft.score;
            let better = after.stranded < before.stranded
                || (after.stranded == before.stranded
                    && (after.cost < before.cost + margin || (after.cost == before.cost && after.energy <= before.energy)));
            // A promise is not broken for the sake of others.
            if done && better && !self.draft.breaks_promise(0) {
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
    fn pick(&mut self, guide: &Guide, rng: &mut impl Rng) -> usize {
        let draft = &self.draft;
        let share = if guide.is_priced() { 0.125 } else { 0.5 };
        if !draft.lost.is_empty() && rng.random::<f64>() < share {
            let robot = draft.lost[rng.random_range(0..draft.lost.len())] as usize;
            if !draft.ways.of(robot).ways.is_empty() {
                return robot;
            }
        }
        let mut worst = (-1.0, 0);
        for _ in 0..COMPARED {
            let robot = self.movable[rng.random_range(0..self.movable.len())] as usize;
            let (chosen, known) = (draft.chosen[robot], &mut self.regrets[robot]);
            if known.0 != chosen {
                *known = (chosen, guide.regret(draft.ways, robot, chosen));
            }
            let regret = known.1;
            if regret > worst.0 {
                worst = (regret, robot);
            }
        }
        worst.1
    }

    /// Gives a robot one of its promising ways and finds new places for those in the way.
    fn force(&mut self, guide: &Guide, rng: &mut impl Rng, before: Score, margin: i64) -> bool {
        let first = self.pick(guide, rng);
        // For somebody who would be stranded more is turned upside down.
        let forced_share = if self.draft.is_stranded(first) { RESCUE_SHARE } else { FORCED_SHARE };
        let mut queue = vec![first];
        let mut settled: Vec<usize> = Vec::new();
        let (mut released, mut forced) = (0, 0);
        while let Some(robot) = queue.pop() {
            // Whoever still waits may at best get its cheapest way; what is too dear even then is given up.
            let (hope, rescued) = self.hopes(&queue);
            let room = before.cost + margin - (self.draft.score.cost - hope);
            let stranded = self.draft.score.stranded - rescued - i64::from(self.draft.is_stranded(robot));
            if stranded > before.stranded || (stranded == before.stranded && room + self.hope(robot) < 0) {
                return false;
            }
            let must = robot == first && settled.is_empty();
            let found = if must {
                None
            } else {
                let limit = if stranded < before.stranded { i64::MAX } else { room.saturating_add(self.draft.cost_of(robot)).max(0) };
                self.place(guide, rng, robot, limit)
            };
            if let Some(way) = found {
                self.draft.serve(robot, way);
            } else if must || (self.draft.ways.of(robot).strands && forced < FORCED_MAX && rng.random::<f32>() < forced_share) {
                forced += usize::from(!must);
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
        }
        true
    }

    /// How far the cost, and the number of stranded robots, can fall at most if all of these are served.
    fn hopes(&self, robots: &[usize]) -> (i64, i64) {
        let hope = robots.iter().map(|&robot| self.hope(robot)).sum();
        (hope, robots.iter().filter(|&&robot| self.draft.is_stranded(robot)).count() as i64)
    }

    /// How much the cost can fall at most by giving a robot its cheapest way.
    fn hope(&self, robot: usize) -> i64 {
        let choices = self.draft.ways.of(robot);
        choices.ways.first().map_or(0, |way| (self.draft.cost_of(robot) - i64::from(way.cost)).max(0))
    }

    /// One of a robot's promising ways that it does not have.
    fn wish(&self, guide: &Guide, rng: &mut impl Rng, robot: usize) -> Option<u32> {
        let listed = &guide.listed[robot];
        if listed.is_empty() {
            return None;
        }
        if rng.random_range(0..ANY_OF) == 0 {
            let way = rng.random_range(0..self.draft.ways.of(robot).ways.len()) as u32;
            return self.may_have(robot, way).then_some(way);
        }
        // Mostly from the top of the list: the square of a uniform number is small more often.
        let place = rng.random::<f32>();
        let way = listed[((place * place * listed.len() as f32) as usize).min(listed.len() - 1)];
        self.may_have(robot, way).then_some(way)
    }

    /// Whether a robot does not have a way, and its station is open.
    fn may_have(&self, robot: usize, way: u32) -> bool {
        let station = self.draft.ways.of(robot).ways[way as usize].station;
        way != self.draft.chosen[robot] && !self.draft.books[usize::from(station)].is_closed()
    }

    /// A free place: the cheapest for the robot, or the first by prices.
    fn place(&mut self, guide: &Guide, rng: &mut impl Rng, robot: usize, limit: i64) -> Option<u32> {
        let choices = self.draft.ways.of(robot);
        let limit = if choices.strands { limit } else { limit.min(i64::from(choices.unserved_cost) - 1) };
        let mut free = std::mem::take(&mut self.free);
        free.clear();
        let starts = choices.starts(self.draft.problem().horizon);
        for at in starts.at(limit) {
            self.draft.books[usize::from(at.station)].tell_places(starts, at, limit, &mut |way| free.push(way));
        }
        let fits = |way: u32| {
            let way = &choices.ways[way as usize];
            self.draft.books[usize::from(way.station)].fits(choices, way)
        };
        let mut listed = None;
        if rng.random_range(0..2) == 0 && !free.is_empty() {
            listed = guide.listed[robot].iter().copied().find(|&way| free.contains(&way) && fits(way));
        }
        // The cheapest of those that fit.
        let found = listed.or_else(|| {
            let mut least = NONE;
            free.iter().for_each(|&way| {
                if way < least && fits(way) {
                    least = way;
                }
            });
            (least != NONE).then_some(least)
        });
        self.free = free;
        found
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
            for (&other, taken) in book.robots.iter().zip(&book.taken) {
                let other = other as usize;
                if book.takes_part(clash, taken) && !settled.contains(&other) {
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
}
