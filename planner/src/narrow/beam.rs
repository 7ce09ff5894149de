//! Builds plans in the order of time: who begins in this tick, and how, then the next tick.
//!
//! What has been decided costs what [`Reduced`] says; what was left over before now is lost; whoever is
//! still to come costs at least its cheapest way that is still free. So every beginning of a plan has a
//! bound of its own, and those that cannot become better than the plan that is known are dropped, as are
//! those to which another with the same future is as good. Of the rest the most promising go on, so many
//! as there is room for. When nobody had to be left out, there is no better plan than what was found.

use std::collections::BinaryHeap;

use super::pass;
use crate::book::Book;
use crate::draft::{Draft, NONE};
use crate::prices::Reduced;
use crate::way::{NEVER, Ways};

/// Part of the room that the robots still to come will take, if they take as much as those before them in
/// a plan that is only just better than the one that is known. Without it, beginnings that have put
/// everything off look best.
const TO_COME: f64 = 0.5;

/// So many times as many beginnings as go on are kept at first, the most promising: some turn out to be dominated.
const WIDE_ENOUGH: usize = 2;

/// What came of a search.
#[derive(Debug)]
pub(super) struct Found {
    /// The best plan, if any is better than the one that is known.
    pub(super) chosen: Option<Vec<u32>>,
    /// Whether every beginning of a better plan was looked at.
    pub(super) complete: bool,
    /// Beginnings that were looked at.
    pub(super) seen: u64,
}

/// The beginning of a plan.
#[derive(Debug)]
struct Beginning {
    /// What all plans that begin so cost at least beyond the bound of all plans.
    bound: i64,
    /// What of that has been decided.
    spent: i64,
    /// Each robot's way so far.
    chosen: Vec<u32>,
    /// How promising it is; less is better.
    rank: i64,
    /// Tells who may still be served and what there is for them but energy: where it is the same, the same
    /// can follow.
    future: [u64; 2],
    /// Robots that are stranded, and worth of missed work, if nobody else is served.
    score: [i64; 2],
    /// What is left by each limit of energy.
    energy: Vec<i64>,
}

/// A way that begins in some tick.
#[derive(Debug, Clone, Copy)]
struct Start {
    robot: usize,
    way: u32,
    reduced: i64,
}

/// Where the search stands.
struct Beam<'a, 'w, 'p> {
    draft: Draft<'w, 'p>,
    reduced: &'a Reduced,
    stranded_max: i64,
    /// What begins in each tick, by robot.
    starts: Vec<Vec<Start>>,
    /// What each robot costs at least if it has not begun before a tick.
    least: Vec<Vec<i64>>,
    /// The tick from which each robot has nothing left to begin with.
    over: Vec<usize>,
    next: Vec<Beginning>,
    /// The best ranks of `next`, the worst of them first; no more than there can be of use.
    ranks: BinaryHeap<i64>,
    ranks_max: usize,
    /// Whether somebody was left out for its rank.
    left_out: bool,
    /// What each robot still to come adds to a rank.
    each_to_come: f64,
    seen: u64,
}

/// Looks for a plan within the room that `reduced` leaves and with at most so many stranded robots, with at most
/// `width` beginnings at a time. `go_on` is told now and then how many were looked at.
pub(super) fn beam(ways: &Ways<'_>, reduced: &Reduced, stranded_max: i64, width: usize, mut go_on: impl FnMut(u64) -> bool) -> Found {
    let mut beam = Beam::new(ways, reduced, stranded_max);
    beam.ranks_max = WIDE_ENOUGH * width;
    let ticks = beam.starts.len();
    let mut now = vec![beam.nothing_yet()];
    let mut tick = 0;
    while tick < ticks {
        // Between two ticks in which somebody may begin nothing is decided.
        let until = (tick + 1..ticks).find(|&tick| !beam.starts[tick].is_empty()).unwrap_or(ticks);
        for beginning in &now {
            beam.draft.become_choice(&beginning.chosen);
            beam.spread(tick, until, 0, beginning.spent);
        }
        beam.ranks.clear();
        now = undominated(std::mem::take(&mut beam.next));
        if now.len() > width {
            now.select_nth_unstable_by_key(width, |beginning| beginning.rank);
            now.truncate(width);
            beam.left_out = true;
        }
        // Neighbours have much in common: little is booked anew from one to the next.
        now.sort_unstable_by(|a, b| a.chosen.cmp(&b.chosen));
        tick = until;
        if !go_on(beam.seen) {
            return Found { chosen: None, complete: false, seen: beam.seen };
        }
    }
    let best = now.into_iter().min_by_key(|beginning| beginning.bound);
    Found { chosen: best.map(|beginning| beginning.chosen), complete: !beam.left_out, seen: beam.seen }
}

impl<'a, 'w, 'p> Beam<'a, 'w, 'p> {
    fn new(ways: &'w Ways<'p>, reduced: &'a Reduced, stranded_max: i64) -> Self {
        let ticks = ways.problem().horizon as usize;
        let robots = ways.problem().robots.len();
        let mut beam = Self {
            draft: Draft::new(ways),
            reduced,
            stranded_max,
            starts: vec![Vec::new(); ticks],
            least: Vec::with_capacity(robots),
            over: vec![0; robots],
            next: Vec::new(),
            ranks: BinaryHeap::new(),
            ranks_max: 0,
            left_out: false,
            each_to_come: TO_COME * reduced.room as f64 / robots.max(1) as f64,
            seen: 0,
        };
        for robot in 0..robots {
            let mut least = vec![i64::MAX; ticks + 1];
            for &(cost, way) in &reduced.ways[robot] {
                let start = usize::from(ways.of(robot).ways[way as usize].start);
                beam.starts[start].push(Start { robot, way, reduced: cost });
                beam.over[robot] = beam.over[robot].max(start + 1);
                least[start] = least[start].min(cost);
            }
            least[ticks] = reduced.unserved[robot];
            for tick in (0..ticks).rev() {
                least[tick] = least[tick].min(least[tick + 1]);
            }
            beam.least.push(least);
        }
        beam
    }

    fn nothing_yet(&self) -> Beginning {
        let chosen = vec![NONE; self.least.len()];
        Beginning { bound: 0, spent: 0, chosen, rank: 0, future: [0; 2], score: [0; 2], energy: Vec::new() }
    }

    /// All that can begin in a tick, from this place of its list on, beside what begins already.
    fn spread(&mut self, tick: usize, until: usize, from: usize, spent: i64) {
        self.close(tick, until, spent);
        for place in from..self.starts[tick].len() {
            let Start { robot, way, reduced } = self.starts[tick][place];
            if self.draft.chosen[robot] != NONE || spent + reduced > self.reduced.room || !self.fits(robot, way) {
                continue;
            }
            let mark = self.draft.mark();
            self.draft.serve(robot, way);
            self.spread(tick, until, place + 1, spent + reduced);
            self.draft.undo(mark);
        }
    }

    fn fits(&self, robot: usize, way: u32) -> bool {
        let choices = self.draft.ways.of(robot);
        let way = &choices.ways[way as usize];
        self.draft.books[usize::from(way.station)].fits(choices, way)
    }

    /// Nobody else begins before `until`: keeps what may still become a better plan.
    fn close(&mut self, tick: usize, until: usize, mut spent: i64) {
        self.seen += 1;
        let room = self.reduced.room;
        let mut still = 0;
        let (mut stranded, mut to_come) = (0, 0);
        for robot in self.unserved() {
            still += self.least[robot][until];
            let is_over = self.over[robot] <= until;
            stranded += i64::from(is_over && self.draft.ways.of(robot).strands);
            to_come += u32::from(!is_over);
        }
        let put_off = (self.each_to_come * f64::from(to_come)) as i64;
        if stranded > self.stranded_max || spent + still > room || self.is_behind(spent + still + put_off) {
            return;
        }
        for (station, book) in self.draft.books.iter().enumerate() {
            spent += (tick..until).map(|tick| self.reduced.slack(station, self.draft.ways, book, tick)).sum::<i64>();
        }
        if spent + still > room || self.is_behind(spent + still + put_off) {
            return;
        }
        let Some(bound) = self.bound(until, spent + still) else { return };
        let rank = bound + put_off;
        if self.is_behind(rank) {
            return;
        }
        if self.ranks.len() == self.ranks_max {
            self.ranks.pop();
        }
        self.ranks.push(rank);
        let future = self.future(until);
        let energy = self.draft.books.iter().flat_map(Book::limits).map(|limit| limit.energy).collect();
        let score = [self.draft.score.stranded, self.draft.score.cost];
        self.next.push(Beginning { bound, spent, chosen: self.draft.chosen.clone(), rank, future, score, energy });
    }

    /// Whether a beginning of this rank, or a worse one, is sure to be left out.
    fn is_behind(&mut self, rank: i64) -> bool {
        let behind = self.ranks.len() == self.ranks_max && self.ranks.peek().is_some_and(|&worst| rank > worst);
        self.left_out |= behind;
        behind
    }

    fn unserved(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.least.len()).filter(|&robot| self.draft.chosen[robot] == NONE)
    }

    /// What follows costs at least, when ways that are no longer free do not count; none when that is too much.
    fn bound(&self, until: usize, mut bound: i64) -> Option<i64> {
        for robot in self.unserved().filter(|&robot| self.over[robot] > until) {
            let (least, without) = (self.least[robot][until], self.reduced.unserved[robot]);
            let ways = &self.draft.ways.of(robot).ways;
            let most = self.reduced.room - bound + least;
            let affordable = self.reduced.ways[robot].iter().take_while(|&&(cost, _)| cost <= most && cost < without);
            let free = affordable.into_iter().find(|&&(_, way)| usize::from(ways[way as usize].start) >= until && self.fits(robot, way));
            bound += free.map_or(without, |&(cost, _)| cost) - least;
            if bound > self.reduced.room {
                return None;
            }
        }
        Some(bound)
    }

    fn future(&self, until: usize) -> [u64; 2] {
        let mut future = [0; 2];
        let mut tell = |word: u64| pass::tell(&mut future, word);
        self.unserved().filter(|&robot| self.over[robot] > until).for_each(|robot| tell(robot as u64));
        // What is still going on takes the same of its station whatever there was before.
        for (robot, &way) in self.draft.chosen.iter().enumerate().filter(|(_, way)| **way != NONE) {
            let taken = &self.draft.ways.of(robot).ways[way as usize];
            if usize::from(taken.end) > until || (taken.ready != NEVER && usize::from(taken.ready) > until) {
                tell(!((robot as u64) << 32 | u64::from(way)));
            }
        }
        self.draft.books.iter().for_each(|book| book.spares_from(until, &mut tell));
        future
    }
}

/// Those to which no other with the same future is as good in everything.
fn undominated(mut all: Vec<Beginning>) -> Vec<Beginning> {
    all.sort_unstable_by(|a, b| (a.future, a.score, &a.chosen).cmp(&(b.future, b.score, &b.chosen)));
    let mut kept: Vec<Beginning> = Vec::with_capacity(all.len());
    let mut first = 0;
    for beginning in all {
        if kept.get(first).is_none_or(|other| other.future != beginning.future) {
            first = kept.len();
        }
        let as_good = |other: &Beginning| {
            let no_more = other.score.iter().zip(&beginning.score).all(|(other, this)| other <= this);
            no_more && other.energy.iter().zip(&beginning.energy).all(|(other, this)| other >= this)
        };
        if !kept[first..].iter().any(as_good) {
            kept.push(beginning);
        }
    }
    kept
}
