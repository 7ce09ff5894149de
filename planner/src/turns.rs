//! Strands few robots of a small fleet: who takes its turn before whom, and how each then chooses.
//!
//! Where one bay serves many robots one after the other, moving a single service helps nobody: all that
//! follow must move up. So the search is not over services but over the order in which robots choose,
//! and over what each prefers: the service that ends first, or the one that takes least of its station.
//! An order is turned into a plan from its beginning, which leaves no gaps that somebody could fill.

use rand::{Rng, RngExt};

use crate::draft::{Draft, NONE, Score};
use crate::way::Ways;

/// Orders that are worse than the best by as much as this are gone on from, now and then, in robots.
const WORSE_MAX: i64 = 1;
/// How seldom.
const WORSE_SHARE: f64 = 0.02;

/// An order, and what each robot prefers.
#[derive(Debug, Clone)]
struct Turns {
    order: Vec<u32>,
    ends_first: Vec<bool>,
}

/// The best plan of the orders that were tried, beginning from the orders given. `go_on` is told how many
/// services were looked for since it was last asked.
pub(crate) fn few_stranded<'w, 'p>(
    ways: &'w Ways<'p>,
    orders: &[Vec<usize>],
    least: i64,
    rng: &mut impl Rng,
    mut go_on: impl FnMut(u64) -> bool,
) -> Draft<'w, 'p> {
    let robots = ways.problem().robots.len();
    let mut decoder = Decoder::new(ways);
    let beginnings = orders.iter().flat_map(|order| {
        let in_question = order.iter().filter(|&&robot| !ways.of(robot).ways.is_empty());
        let order: Vec<u32> = in_question.map(|&robot| robot as u32).collect();
        [true, false].map(|ends_first| Turns { order: order.clone(), ends_first: vec![ends_first; robots] })
    });
    let mut best: Option<(Score, Turns, Vec<u32>)> = None;
    for turns in beginnings {
        decoder.place(&turns, 0, i64::MAX);
        if best.as_ref().is_none_or(|(score, ..)| decoder.draft.score < *score) {
            best = Some((decoder.draft.score, turns, decoder.draft.chosen.clone()));
        }
    }
    let Some((mut best_score, mut now, mut best)) = best else { return decoder.draft };
    decoder.place(&now, 0, i64::MAX);
    let (mut stranded, mut placed) = (best_score.stranded, 0);
    while now.order.len() > 1 && best_score.stranded > least && go_on(placed) {
        let mut tried = now.clone();
        let from = tried.change(rng);
        let worse = rng.random::<f64>() < WORSE_SHARE;
        let most = stranded.max(if worse { best_score.stranded + WORSE_MAX } else { 0 });
        let before = decoder.draft.chosen.clone();
        placed = decoder.place(&tried, from, most);
        if decoder.draft.score.stranded > most {
            decoder.restore(&now, from, &before);
            continue;
        }
        (now, stranded) = (tried, decoder.draft.score.stranded);
        if decoder.draft.score < best_score {
            best_score = decoder.draft.score;
            best.copy_from_slice(&decoder.draft.chosen);
        }
    }
    let mut draft = decoder.draft;
    draft.become_choice(&best);
    draft
}

/// Turns orders into plans.
struct Decoder<'w, 'p> {
    draft: Draft<'w, 'p>,
    /// Each robot's ways by their end.
    by_end: Vec<Vec<u32>>,
}

impl<'w, 'p> Decoder<'w, 'p> {
    fn new(ways: &'w Ways<'p>) -> Self {
        let by_end = |robot: usize| {
            let all = &ways.of(robot).ways;
            let mut sorted: Vec<u32> = (0..all.len() as u32).collect();
            sorted.sort_by_key(|&way| (all[way as usize].end, way));
            sorted
        };
        Self { draft: Draft::new(ways), by_end: (0..ways.problem().robots.len()).map(by_end).collect() }
    }

    /// Lets robots choose in turn from this place of the order on; those before have chosen. Gives up when
    /// more than `most` are stranded for certain. How many services it looked for.
    fn place(&mut self, turns: &Turns, from: usize, most: i64) -> u64 {
        for &robot in &turns.order[from..] {
            self.clear(robot as usize);
        }
        // Who has still to choose may all find something.
        let mut hopeful = turns.order.len() - from;
        for (&robot, placed) in turns.order[from..].iter().zip(1..) {
            let robot = robot as usize;
            if let Some(way) = self.choose(robot, turns.ends_first[robot]) {
                self.draft.serve(robot, way);
            }
            hopeful -= 1;
            if self.draft.score.stranded - hopeful as i64 > most {
                self.draft.keep();
                return placed;
            }
        }
        self.draft.keep();
        (turns.order.len() - from) as u64
    }

    fn choose(&self, robot: usize, ends_first: bool) -> Option<u32> {
        if !ends_first {
            return self.draft.cheapest(robot, i64::MAX);
        }
        let choices = self.draft.ways.of(robot);
        let fits = |&&way: &&u32| {
            let way = &choices.ways[way as usize];
            self.draft.books[usize::from(way.station)].fits(choices, way)
        };
        self.by_end[robot].iter().find(fits).copied()
    }

    fn restore(&mut self, turns: &Turns, from: usize, chosen: &[u32]) {
        for &robot in &turns.order[from..] {
            self.clear(robot as usize);
        }
        for &robot in &turns.order[from..] {
            if chosen[robot as usize] != NONE {
                self.draft.serve(robot as usize, chosen[robot as usize]);
            }
        }
        self.draft.keep();
    }

    fn clear(&mut self, robot: usize) {
        if self.draft.chosen[robot] != NONE {
            self.draft.release(robot);
        }
    }
}

impl Turns {
    /// Somebody comes earlier or later, or prefers something else. The first place of the order at which
    /// something is different.
    fn change(&mut self, rng: &mut impl Rng) -> usize {
        let count = self.order.len();
        let mut first = count;
        loop {
            let [from, to] = [rng.random_range(0..count), rng.random_range(0..count)];
            let robot = self.order.remove(from);
            self.order.insert(to, robot);
            first = first.min(from).min(to);
            if from == to || rng.random_range(0..3) == 0 {
                let preference = &mut self.ends_first[robot as usize];
                *preference = !*preference;
            }
            if rng.random_range(0..2) == 0 {
                return first;
            }
        }
    }
}
