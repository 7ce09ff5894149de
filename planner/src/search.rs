//! Betters a plan by large-neighbourhood search.
//!
//! A move gives one robot a way that it would rather have, releases whoever stands in that way,
//! and finds these new places. It is kept if the plan gets better, or, the hotter the search, not
//! much worse (annealing); otherwise the log takes it back.

mod moves;

use rand::{Rng, RngExt};

use crate::draft::{Draft, NONE, Score};
use crate::guide::Guide;
use crate::narrow::{Seen, Sets};
use crate::way::{SHARED_MIN, Ways};
use moves::Most;

/// Whom moves are for.
#[derive(Debug, Clone, Copy)]
struct For {
    /// How often for somebody who is stranded.
    lost: f64,
    /// Else for the one with most cause to complain among so many robots.
    compared: u32,
}
/// While only cost counts.
const UNPRICED: For = For { lost: 0.5, compared: 4 };
/// While prices guide, in a small and in a large fleet. With eight robots of 1,000 compared less is missed than with four, and more are
/// stranded, which twice as many moves for these make good: see the README.
const PRICED: [For; 2] = [For { lost: 0.125, compared: 4 }, For { lost: 0.25, compared: 8 }];

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
    /// Robots that wait for a place while a move is made, and those that have theirs.
    queue: Vec<usize>,
    settled: Vec<usize>,
    /// Which ways good plans had, where that is asked for.
    pub(crate) seen: Option<Seen>,
    /// And what each station of them served.
    pub(crate) sets: Option<Sets>,
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
        Self {
            draft,
            best,
            best_score,
            waiting: Vec::new(),
            movable,
            regrets: Vec::new(),
            queue: Vec::new(),
            settled: Vec::new(),
            seen: None,
            sets: None,
        }
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

    /// The same search among few ways of the same problem, which are those of these places.
    pub(crate) fn among_few<'v>(&self, few: &'v Ways<'p>, kept: &[Vec<u32>]) -> Search<'v, 'p> {
        let mut search = Search::among(self.draft.clone().among(few), self.movable.clone());
        let place = |(&way, kept): (&u32, &Vec<u32>)| kept.binary_search(&way).map_or(NONE, |place| place as u32);
        search.best = self.best.iter().zip(kept).map(place).collect();
        search.best_score = self.best_score;
        search.waiting = (0..search.best.len()).filter(|&robot| search.draft.chosen[robot] != search.best[robot]).collect();
        search
    }

    /// Goes on from where a search among few ways has come to.
    pub(crate) fn go_on_with(&mut self, few: &Search<'_, 'p>, kept: &[Vec<u32>]) {
        let of = |chosen: &[u32]| -> Vec<u32> {
            chosen.iter().zip(kept).map(|(&place, kept)| kept.get(place as usize).copied().unwrap_or(NONE)).collect()
        };
        self.draft.become_choice(&of(&few.draft.chosen));
        (self.best, self.best_score) = (of(&few.best), few.best_score);
        self.waiting = (0..self.best.len()).filter(|&robot| self.draft.chosen[robot] != self.best[robot]).collect();
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
            self.note_sets();
            // A promise is not broken for the sake of others.
            if done && better && !self.draft.breaks_promise(0) {
                self.accept();
            } else {
                self.draft.undo(0);
            }
        }
    }

    /// Tries each of these ways of each robot once on the plan of now, and goes on for as long as one of them betters it.
    /// How many moves that were.
    pub(crate) fn sweep(&mut self, guide: &Guide, rng: &mut impl Rng, ways: &[Vec<u32>], mut go_on: impl FnMut(u64) -> bool) -> u64 {
        let tried: Vec<(u32, u32)> = (0..).zip(ways).flat_map(|(robot, ways)| ways.iter().map(move |&way| (robot, way))).collect();
        let (mut at, mut since_better, mut moves) = (0, 0, 0);
        while since_better < tried.len() && go_on(moves) {
            let (robot, way) = tried[at];
            at = (at + 1) % tried.len();
            since_better += 1;
            if !self.may_have(robot as usize, way) {
                continue;
            }
            moves += 1;
            let before = self.draft.score;
            let most = Most { stranded: before.stranded, cost: before.cost - 1 };
            let done = self.give(guide, rng, most, robot as usize, Some(way));
            self.note_sets();
            let after = self.draft.score;
            if done && (after.stranded, after.cost) < (before.stranded, before.cost) && !self.draft.breaks_promise(0) {
                self.accept();
                since_better = 0;
            } else {
                self.draft.undo(0);
            }
        }
        moves
    }

    /// Notes what each station serves, also where a move came to nothing: one of its stations may have done well.
    fn note_sets(&mut self) {
        if let Some(sets) = &mut self.sets {
            sets.note(&self.draft);
        }
    }

    fn accept(&mut self) {
        if let Some(seen) = &mut self.seen {
            seen.note(&self.draft.chosen, self.draft.score);
        }
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

    /// 0 for a small fleet, 1 for a large one.
    fn size(&self) -> usize {
        usize::from(self.draft.chosen.len() >= SHARED_MIN)
    }

    /// Someone who has cause to complain: stranded, or far from its cheapest way.
    fn pick(&mut self, guide: &Guide, rng: &mut impl Rng) -> usize {
        let draft = &self.draft;
        let For { lost, compared } = if guide.is_priced() { PRICED[self.size()] } else { UNPRICED };
        if !draft.lost.is_empty() && rng.random::<f64>() < lost {
            let robot = draft.lost[rng.random_range(0..draft.lost.len())] as usize;
            if !draft.ways.of(robot).ways.is_empty() {
                return robot;
            }
        }
        let mut worst = (-1.0, 0);
        for _ in 0..compared {
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
}
