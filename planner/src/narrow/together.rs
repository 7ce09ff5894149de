//! Puts together what stations were seen to serve, each at its best.
//!
//! The cost of a plan is the bound, plus what each station's plan costs beyond its part of the bound (its *column's reduced
//! cost*), plus the same of who is not served. So sets are put together from the cheapest of these on, and what leaves no
//! room is never looked at.

use crate::draft::Score;
use crate::narrow::sets::Sets;
use crate::prices::Reduced;
use crate::way::Ways;

/// Sets that are looked at beside others, at most: they stand in order, so those that are left out promise least.
const PAIRS_MAX: u64 = 1 << 20;

/// What came together.
#[derive(Debug)]
pub(super) struct Together {
    /// The best plan that is better than the one known, if there is any.
    pub(super) better: Option<Vec<u32>>,
    /// Whether all was looked at that could make one.
    pub(super) complete: bool,
}

/// Puts sets together; a plan is better if it scores less than `known`, and may be without a service to no more of the
/// robots that `held` names (as the bits of a number) than `broken`.
pub(super) fn together(sets: &Sets, ways: &Ways<'_>, reduced: &Reduced, known: Score, (held, broken): (u32, u32)) -> Together {
    let columns = |(at, station): (usize, &super::sets::Seen)| {
        let cost = |(set, place): (&super::sets::Set, u32)| (reduced.column(at, set.robots, set.cost), place);
        let mut columns: Vec<(i64, u32)> = station.sets.iter().zip(0..).map(cost).collect();
        columns.retain(|&(cost, _)| cost <= reduced.room);
        columns.sort_unstable();
        columns
    };
    let columns: Vec<Vec<(i64, u32)>> = sets.stations.iter().enumerate().map(columns).collect();
    let least: Vec<i64> = columns.iter().map(|columns| columns.first().map_or(0, |&(least, _)| least)).collect();
    let to_come = (0..=least.len()).map(|from| least[from..].iter().sum()).collect();
    let picked = vec![0; columns.len()];
    let mut walk = Walk { sets, ways, reduced, columns, to_come, picked, known, held, broken, better: None, pairs: 0 };
    walk.go(0, 0, 0);
    let better = walk.better.map(|(_, places)| sets.plan(&places, ways.problem().robots.len()));
    Together { better, complete: walk.pairs <= PAIRS_MAX }
}

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
    known: Score,
    held: u32,
    broken: u32,
    better: Option<((i64, i64), Vec<u32>)>,
    pairs: u64,
}

impl Walk<'_, '_> {
    /// All sets of the stations from this one on, beside those of the ones before: these serve the robots `taken` and cost
    /// `spent` beyond the bound.
    fn go(&mut self, station: usize, taken: u32, spent: i64) {
        if station == self.columns.len() {
            self.end(taken, spent);
            return;
        }
        for at in 0..self.columns[station].len() {
            let (cost, place) = self.columns[station][at];
            self.pairs += 1;
            if spent + cost + self.to_come[station + 1] > self.reduced.room || self.pairs > PAIRS_MAX {
                return;
            }
            let robots = self.sets.stations[station].sets[place as usize].robots;
            if robots & taken == 0 {
                self.picked[station] = place;
                self.go(station + 1, taken | robots, spent + cost);
            }
        }
    }

    /// A set for every station.
    fn end(&mut self, taken: u32, mut spent: i64) {
        let sets = self.picked.iter().zip(&self.sets.stations).map(|(&place, station)| station.sets[place as usize].cost);
        let (mut cost, mut stranded) = (sets.sum::<i64>(), 0);
        for robot in (0..self.ways.problem().robots.len()).filter(|robot| taken >> robot & 1 == 0) {
            let choices = self.ways.of(robot);
            spent += self.reduced.unserved[robot];
            cost += i64::from(choices.unserved_cost);
            stranded += i64::from(choices.strands);
        }
        let keeps = (self.held & !taken).count_ones() <= self.broken;
        if stranded > self.known.stranded || spent > self.reduced.room || !keeps {
            return;
        }
        let score = (stranded, cost);
        if score < (self.known.stranded, self.known.cost) && self.better.as_ref().is_none_or(|(better, _)| score < *better) {
            self.better = Some((score, self.picked.clone()));
        }
    }
}
