//! Strands fewer robots by what stations were seen to serve, where some robots may be served twice.
//!
//! A station that can serve some robots can serve any of them without the others. So a plan that strands few is nothing
//! but a set for every station that together name nearly all robots: who is named twice is struck out at one of them.
//! Sets are collected by a search in which nothing counts but how many robots are served. It walks among plans that
//! serve equally many, and each of its plans is only as good as the worst of its stations; what two stations did at
//! different times is often better than what both did at any time.

use std::cmp::Reverse;

use rand::Rng;

use crate::draft::{Draft, NONE};
use crate::guide::Guide;
use crate::narrow::sets::{Seen, Set, Sets};
use crate::narrow::{go_on_from, is_certain};
use crate::optimise::Clock;
use crate::search::Search;
use crate::way::Ways;

/// What it counts not to serve a robot, and a temperature at which all walks are free but those to fewer robots.
const PENALTY: i32 = 1000;
const HEAT: f64 = 100.0;
/// Moves before sets are put together, and between two looks at the time. With 4,000 and 16,000 it took longer.
const MOVES: u64 = 2000;
const LOOK: u64 = 250;
/// Sets that are looked at beside others, at most: they stand by size, so those that are left out promise least.
const PAIRS_MAX: u64 = 1 << 20;

/// Looks for a plan that strands fewer than the best one known, until `until` of the time is used; `least` are stranded in
/// any case.
pub(crate) fn fewer_by_cover<'w, 'p>(
    ways: &'w Ways<'p>,
    found: &mut Search<'w, 'p>,
    least: i64,
    until: f64,
    rng: &mut impl Rng,
    clock: &mut Clock<'_>,
) {
    let stranded = |chosen: &[u32]| (0..chosen.len()).filter(|&robot| ways.of(robot).strands && chosen[robot] == NONE).count() as i64;
    if !is_certain(ways) || stranded(&found.best) <= least {
        return;
    }
    let few = ways.barely(PENALTY, |choices| choices.strands || choices.held);
    let robots = ways.problem().robots.len();
    let wanted = (0..robots).filter(|&robot| !few.of(robot).ways.is_empty()).fold(0, |wanted, robot| wanted | 1 << robot);
    let guide = Guide::latest(&few);
    let mut draft = Draft::new(&few);
    draft.become_choice(&few.translated(ways, &found.best));
    let mut search = Search::new(draft);
    search.sets = Some(Sets::new(&few));
    while stranded(&found.best) > least && clock.used() < until {
        for _ in 0..MOVES / LOOK {
            search.run(&guide, rng, LOOK, HEAT);
            clock.moves += LOOK;
            if clock.used() >= until {
                break;
            }
        }
        search.return_to_best();
        let Some(chosen) = search.sets.as_ref().map(|sets| cover(sets, wanted, robots)) else { return };
        let chosen = ways.translated(&few, &chosen);
        if stranded(&chosen) < stranded(&found.best) {
            go_on_from(found, &chosen);
        }
    }
}

/// A plan that serves as many of these robots as what was seen of stations allows.
fn cover(sets: &Sets, wanted: u32, robots: usize) -> Vec<u32> {
    let places: Vec<Vec<u32>> = sets.stations.iter().map(largest_first).collect();
    let largest = |(station, places): (&Seen, &Vec<u32>)| station.sets[places[0] as usize].robots.count_ones();
    let largest: Vec<u32> = sets.stations.iter().zip(&places).map(largest).collect();
    let to_come = (0..=largest.len()).map(|from| largest[from..].iter().sum()).collect();
    let (picked, best) = (vec![0; places.len()], vec![0; places.len()]);
    let mut walk = Walk { sets, places, to_come, picked, best, missing: u32::BITS, pairs: 0 };
    walk.go(0, wanted);
    // Who is named twice is served by the first.
    let mut chosen = vec![NONE; robots];
    for (station, &place) in sets.stations.iter().zip(&walk.best) {
        for &(robot, way) in &station.sets[place as usize].ways {
            let chosen = &mut chosen[robot as usize];
            if *chosen == NONE {
                *chosen = way;
            }
        }
    }
    chosen
}

/// A station's sets that are not part of another, the largest first.
fn largest_first(station: &Seen) -> Vec<u32> {
    let mut all: Vec<(u32, u32)> = station.sets.iter().map(|set| set.robots).zip(0..).collect();
    all.sort_unstable_by_key(|&(robots, place)| (Reverse(robots.count_ones()), place));
    let mut kept: Vec<(u32, u32)> = Vec::new();
    for (robots, place) in all {
        if kept.iter().all(|(other, _)| robots & !other != 0) {
            kept.push((robots, place));
        }
    }
    kept.into_iter().map(|(_, place)| place).collect()
}

/// Where the walk over all sets stands.
struct Walk<'a> {
    sets: &'a Sets,
    /// Of each station its sets, the largest first.
    places: Vec<Vec<u32>>,
    /// How many robots stations from each on serve at most together.
    to_come: Vec<u32>,
    /// Where the set of each station stands now, and in the best cover.
    picked: Vec<u32>,
    best: Vec<u32>,
    /// How many robots that leaves.
    missing: u32,
    pairs: u64,
}

impl Walk<'_> {
    /// All sets of the stations from this one on; `left` are robots that those before do not serve.
    fn go(&mut self, station: usize, left: u32) {
        let Some(places) = self.places.get(station) else {
            if left.count_ones() < self.missing {
                self.missing = left.count_ones();
                self.best.copy_from_slice(&self.picked);
            }
            return;
        };
        for at in 0..places.len() {
            let place = self.places[station][at];
            let Set { robots, .. } = &self.sets.stations[station].sets[place as usize];
            self.pairs += 1;
            if left.count_ones() >= self.missing + robots.count_ones() + self.to_come[station + 1] || self.pairs > PAIRS_MAX {
                return;
            }
            self.picked[station] = place;
            self.go(station + 1, left & !robots);
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};
    use rand_pcg::Pcg64Mcg;

    use super::*;
    use crate::instance::Instance;
    use crate::optimise::Moves;

    #[test]
    fn what_stations_serve_is_put_together_as_well_as_can_be() {
        let instance = Instance::parse(include_str!("../../tests/instances/16-2-1.json")).expect("a valid instance");
        let ways = Ways::all(&instance.problem);
        let mut rng = Pcg64Mcg::seed_from_u64(3);
        for _ in 0..200 {
            let mut sets = Sets::new(&ways);
            for station in &mut sets.stations {
                for _ in 0..6 {
                    let robots: u32 = rng.random::<u32>() & rng.random::<u32>() & 0xffff;
                    station.note(robots, 0, (0..16).filter(|robot| robots >> robot & 1 == 1).map(|robot| (robot, 0)));
                }
            }
            let served = cover(&sets, 0xffff, 16).iter().filter(|way| **way != NONE).count() as u32;
            let [one, other] = [0, 1].map(|station: usize| &sets.stations[station].sets);
            let most = one.iter().flat_map(|one| other.iter().map(|other| (one.robots | other.robots).count_ones())).max();
            assert_eq!(Some(served), most);
        }
    }

    #[test]
    fn fewer_are_stranded_and_all_services_have_their_place() {
        // Another solver says how few can be.
        for (text, fewest) in [
            (include_str!("../../tests/instances/16-2-1.json"), 0),
            (include_str!("../../tests/instances/12-2-2.json"), 0),
            (include_str!("../../tests/instances/6-1-1.json"), 1),
        ] {
            let instance = Instance::parse(text).expect("a valid instance");
            let ways = Ways::all(&instance.problem);
            let mut search = Search::new(Draft::new(&ways));
            let mut budget = Moves(60_000);
            let mut clock = Clock { budget: &mut budget, moves: 0 };
            fewer_by_cover(&ways, &mut search, fewest, 1.0, &mut Pcg64Mcg::seed_from_u64(1), &mut clock);
            assert_eq!(search.best_score.stranded, fewest, "{}", instance.problem.name);
            let mut anew = Draft::new(&ways);
            for (robot, &way) in search.best.iter().enumerate().filter(|(_, way)| **way != NONE) {
                let choices = ways.of(robot);
                let taken = &choices.ways[way as usize];
                assert!(anew.books[usize::from(taken.station)].fits(choices, taken), "robot {robot} has no place");
                anew.serve(robot, way);
            }
            assert_eq!(anew.score, search.best_score);
        }
    }
}
