//! Puts together what stations were seen to serve, each at its best.
//!
//! The cost of a plan is the bound, plus what each station's plan costs beyond its part of the bound (its *column's reduced
//! cost*), plus the same of who is not served. So sets are put together from the cheapest of these on, and what leaves no
//! room is never looked at. What comes together may be better than the best plan known at once. Where it falls short of it
//! by less than some station may still save, that station is worth planning anew beside the others.

use crate::draft::Score;
use crate::narrow::sets::Sets;
use crate::prices::{Reduced, UNIT};
use crate::way::Ways;

/// The part of its reduced cost that a station is taken to save at most when it is planned anew: with 0.8 as many best
/// plans were found as with this.
const SAVED: f64 = 0.6;
/// Sets that are looked at beside others, at most: they stand in order, so those that are left out promise least.
const PAIRS_MAX: u64 = 1 << 20;

/// A station that is worth planning anew.
#[derive(Debug)]
pub(super) struct Candidate {
    pub(super) station: usize,
    /// Where the set of each station stands.
    pub(super) places: Vec<u32>,
    /// What the station's ways may cost for a plan that is better than the best one known.
    pub(super) most: i64,
    /// The part of its reduced cost that it must save for that.
    saved: f64,
}

/// What came together.
#[derive(Debug)]
pub(super) struct Together {
    /// The best plan that is better than the one known, if there is any.
    pub(super) better: Option<Vec<u32>>,
    /// The most promising first.
    pub(super) candidates: Vec<Candidate>,
    /// Sets that were looked at beside others.
    pub(super) pairs: u64,
}

/// Puts sets together; a plan is better if it scores less than `known`, and may be without a service to no more of the
/// robots that `held` names (as the bits of a number) than `broken`.
pub(super) fn together(sets: &Sets, ways: &Ways<'_>, reduced: &Reduced, known: Score, (held, broken): (u32, u32)) -> Together {
    let columns = |(at, station): (usize, &super::sets::Seen)| {
        let cost = |(set, place): (&super::sets::Set, u32)| (reduced.column(at, set.robots, set.cost), place);
        let mut columns: Vec<(i64, u32)> = station.sets.iter().zip(0..).map(cost).collect();
        columns.retain(|&(cost, _)| cost - part(cost) <= reduced.room);
        columns.sort_unstable();
        columns
    };
    let columns: Vec<Vec<(i64, u32)>> = sets.stations.iter().enumerate().map(columns).collect();
    let least: Vec<i64> = columns.iter().map(|columns| columns.first().map_or(0, |&(least, _)| least)).collect();
    let mut walk = Walk {
        sets,
        ways,
        reduced,
        to_come: (0..=least.len()).map(|from| least[from..].iter().sum()).collect(),
        picked: vec![0; columns.len()],
        cheapest: sets.stations.iter().map(|station| vec![None; station.sets.len()]).collect(),
        columns,
        known,
        held,
        broken,
        better: None,
        pairs: 0,
    };
    walk.go(0, 0, 0, 0);
    let mut candidates = Vec::new();
    for (station, cheapest) in walk.cheapest.iter_mut().enumerate() {
        for (total, places) in cheapest.iter_mut().filter_map(Option::take) {
            let set = &sets.stations[station].sets[places[station] as usize];
            let save = total - known.cost + 1;
            let saved = (save * UNIT) as f64 / reduced.column(station, set.robots, set.cost).max(1) as f64;
            let most = set.cost - save;
            if saved < SAVED && set.in_vain < most {
                candidates.push(Candidate { station, places, most, saved });
            }
        }
    }
    candidates.sort_by(|a, b| a.saved.total_cmp(&b.saved));
    let better = walk.better.map(|(_, places)| sets.plan(&places, ways.problem().robots.len()));
    Together { better, candidates, pairs: walk.pairs }
}

/// What a station may save.
fn part(cost: i64) -> i64 {
    (SAVED * cost as f64) as i64
}

/// What a plan costs, and where its stations' sets stand.
type Plan = (i64, Vec<u32>);

/// Where the walk over all that fits together stands.
struct Walk<'a, 'p> {
    sets: &'a Sets,
    ways: &'a Ways<'p>,
    reduced: &'a Reduced,
    /// Of each station its sets, as reduced cost and place, the cheapest first.
    columns: Vec<Vec<(i64, u32)>>,
    /// What stations from each on cost at least together.
    to_come: Vec<i64>,
    /// Where the set stands that each station serves now.
    picked: Vec<u32>,
    /// The cheapest plan with each set, and where its sets stand.
    cheapest: Vec<Vec<Option<Plan>>>,
    known: Score,
    held: u32,
    broken: u32,
    better: Option<((i64, i64), Vec<u32>)>,
    pairs: u64,
}

impl Walk<'_, '_> {
    /// All sets of the stations from this one on, beside those of the ones before: these serve the robots `taken`, cost
    /// `spent` beyond the bound, and the dearest of them `dearest`.
    fn go(&mut self, station: usize, taken: u32, spent: i64, dearest: i64) {
        if station == self.columns.len() {
            self.end(taken, spent, dearest);
            return;
        }
        for at in 0..self.columns[station].len() {
            let (cost, place) = self.columns[station][at];
            let dearest = dearest.max(cost);
            self.pairs += 1;
            if spent + cost + self.to_come[station + 1] - part(dearest) > self.reduced.room || self.pairs > PAIRS_MAX {
                return;
            }
            let robots = self.sets.stations[station].sets[place as usize].robots;
            if robots & taken == 0 {
                self.picked[station] = place;
                self.go(station + 1, taken | robots, spent + cost, dearest);
            }
        }
    }

    /// A set for every station.
    fn end(&mut self, taken: u32, mut spent: i64, dearest: i64) {
        let sets = self.picked.iter().zip(&self.sets.stations).map(|(&place, station)| station.sets[place as usize].cost);
        let (mut cost, mut stranded) = (sets.sum::<i64>(), 0);
        for robot in (0..self.ways.problem().robots.len()).filter(|robot| taken >> robot & 1 == 0) {
            let choices = self.ways.of(robot);
            spent += self.reduced.unserved[robot];
            cost += i64::from(choices.unserved_cost);
            stranded += i64::from(choices.strands);
        }
        let keeps = (self.held & !taken).count_ones() <= self.broken;
        if stranded > self.known.stranded || spent - part(dearest) > self.reduced.room || !keeps {
            return;
        }
        let score = (stranded, cost);
        if score < (self.known.stranded, self.known.cost) && self.better.as_ref().is_none_or(|(better, _)| score < *better) {
            self.better = Some((score, self.picked.clone()));
        }
        for (cheapest, &place) in self.cheapest.iter_mut().zip(&self.picked) {
            let cheapest = &mut cheapest[place as usize];
            if cheapest.as_ref().is_none_or(|(least, _)| cost < *least) {
                *cheapest = Some((cost, self.picked.clone()));
            }
        }
    }
}
