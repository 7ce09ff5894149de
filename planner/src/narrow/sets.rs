//! Which robots each station was seen to serve together, and at what least cost.
//!
//! Stations share nothing but robots, so a plan is a set of robots for each station, and what each station makes of its
//! own. A search comes across thousands of sets, those of the best plan mostly among them, but seldom across all of
//! these at a time, each at its best.

use crate::draft::{Draft, NONE};
use crate::way::Ways;

/// Sets that are remembered of each station: beyond that those that are known are bettered only.
const SETS_MAX: usize = 1 << 16;
/// Places in a table of sets at first.
const PLACES: usize = 1 << 10;

/// What was seen of all stations.
#[derive(Debug, Clone)]
pub(crate) struct Sets {
    pub(super) stations: Vec<Seen>,
}

/// What was seen of a station. The first set is the empty one.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub(super) sets: Vec<Set>,
    /// By hash one more than where each stands in `sets`, or 0.
    places: Vec<u32>,
}

/// Robots that a station can serve together.
#[derive(Debug, Clone)]
pub(super) struct Set {
    /// As the bits of a number.
    pub(super) robots: u32,
    /// What their ways cost at least, as far as is known.
    pub(super) cost: i64,
    /// These ways.
    pub(super) ways: Vec<(u32, u32)>,
}

impl Sets {
    /// None was seen yet but that each station serves nobody.
    pub(crate) fn new(ways: &Ways<'_>) -> Self {
        Self { stations: ways.problem().stations.iter().map(|_| Seen::new()).collect() }
    }

    /// Notes what each station of a plan serves.
    pub(crate) fn note(&mut self, draft: &Draft<'_, '_>) {
        for (station, book) in self.stations.iter_mut().zip(&draft.books) {
            let (mut robots, mut cost) = (0, 0);
            for (&robot, way) in book.robots.iter().zip(&book.taken) {
                robots |= 1 << robot;
                cost += i64::from(way.cost);
            }
            station.note(robots, cost, book.robots.iter().map(|&robot| (robot, draft.chosen[robot as usize])));
        }
    }

    /// Takes over what was seen among fewer ways: each robot's, by their index here.
    pub(crate) fn take_over(&mut self, other: &Self, kept: &[Vec<u32>]) {
        for (station, other) in self.stations.iter_mut().zip(&other.stations) {
            for set in &other.sets {
                let ways = set.ways.iter().map(|&(robot, way)| (robot, kept[robot as usize][way as usize]));
                station.note(set.robots, set.cost, ways);
            }
        }
    }

    /// Whether some station may have been seen to serve a set that is not remembered.
    pub(super) fn is_full(&self) -> bool {
        self.stations.iter().any(|station| station.sets.len() >= SETS_MAX)
    }

    /// Another number for whatever is seen that is new.
    pub(super) fn sum(&self) -> (usize, i64) {
        let all = || self.stations.iter().flat_map(|station| &station.sets);
        (all().count(), all().map(|set| set.cost).sum())
    }

    /// The plan in which each station serves the set that stands here, and that its robots share with nobody.
    pub(super) fn plan(&self, places: &[u32], robots: usize) -> Vec<u32> {
        let mut chosen = vec![NONE; robots];
        for (station, &place) in self.stations.iter().zip(places) {
            station.sets[place as usize].ways.iter().for_each(|&(robot, way)| chosen[robot as usize] = way);
        }
        chosen
    }
}

impl Seen {
    fn new() -> Self {
        let mut seen = Self { sets: Vec::new(), places: vec![0; PLACES] };
        seen.add(Set { robots: 0, cost: 0, ways: Vec::new() });
        seen
    }

    /// Where a set stands in `places`, or would.
    fn place(&self, robots: u32) -> usize {
        let last = self.places.len() - 1;
        // The golden ratio's odd multiplier: its upper bits are the well spread ones.
        let mut at = (robots.wrapping_mul(0x9e37_79b9) >> 7) as usize & last;
        while self.places[at] != 0 && self.sets[self.places[at] as usize - 1].robots != robots {
            at = (at + 1) & last;
        }
        at
    }

    pub(super) fn note(&mut self, robots: u32, cost: i64, ways: impl Iterator<Item = (u32, u32)>) {
        let place = self.places[self.place(robots)] as usize;
        if place == 0 {
            if self.sets.len() < SETS_MAX {
                self.add(Set { robots, cost, ways: ways.collect() });
            }
            return;
        }
        let set = &mut self.sets[place - 1];
        if cost < set.cost {
            set.cost = cost;
            set.ways.clear();
            set.ways.extend(ways);
        }
    }

    fn add(&mut self, set: Set) {
        let at = self.place(set.robots);
        self.sets.push(set);
        self.places[at] = self.sets.len() as u32;
        if 2 * self.sets.len() > self.places.len() {
            self.places = vec![0; 4 * self.places.len()];
            for (set, place) in self.sets.iter().zip(1..) {
                let at = self.place(set.robots);
                self.places[at] = place;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_least_cost_of_each_set_is_remembered() {
        let mut seen = Seen::new();
        let set = |number: u32| number.wrapping_mul(2_654_435_769) | 1;
        for (round, dearer) in [(0, 5), (1, 3), (2, 9)] {
            for number in 0..5000 {
                let cost = i64::from(number) + dearer;
                seen.note(set(number), cost, [(number % 32, round)].into_iter());
            }
        }
        assert_eq!(seen.sets.len(), 5001);
        for number in 0..5000 {
            let found = &seen.sets[seen.places[seen.place(set(number))] as usize - 1];
            assert_eq!((found.robots, found.cost, &found.ways[..]), (set(number), i64::from(number) + 3, &[(number % 32, 1)][..]));
        }
    }
}
