//! Who goes to which station: robots are sent elsewhere, and both stations planned anew.
//!
//! Stations share nothing but robots. With everybody's station given, each is a small problem that a narrow beam all
//! but solves, where one beam over all of them would need as many beginnings as the product of these. Good plans that
//! are not the best mostly send two robots to the wrong stations.

use std::collections::BTreeSet;

use crate::draft::NONE;
use crate::narrow::beam::{Found, Given, beam_beside};
use crate::prices::Reduced;
use crate::way::Ways;

/// Beginnings of plans at a time: with 32 there was less time for others, with 6 too much was overlooked.
const WIDTH: usize = 12;
/// The station of who is not served.
const NOWHERE: u16 = u16::MAX;

/// Each robot's station.
type Sent = Vec<u16>;

/// Looks for better plans by sending robots elsewhere.
pub(super) struct Stations<'a, 'p> {
    pub(super) ways: &'a Ways<'p>,
    pub(super) reduced: &'a Reduced,
    pub(super) stranded_max: i64,
    /// Beginnings that were looked at.
    pub(super) seen: u64,
}

impl Stations<'_, '_> {
    /// A better plan, if there is one that sends one robot elsewhere than `known`, lets two change places, or sends
    /// nobody elsewhere. What was `tried` before is not tried again. `go_on` is told how many beginnings were looked at.
    pub(super) fn better(&mut self, known: &[u32], tried: &mut BTreeSet<Sent>, mut go_on: impl FnMut(u64) -> bool) -> Option<Vec<u32>> {
        let sent = self.sent(known);
        for (_, other) in self.neighbours(&sent) {
            if !go_on(self.seen) {
                return None;
            }
            if tried.insert(other.clone())
                && let Some(chosen) = self.plan(known, &sent, &other, &mut go_on)
            {
                return Some(chosen);
            }
        }
        None
    }

    fn sent(&self, chosen: &[u32]) -> Sent {
        let station = |(robot, &way): (usize, &u32)| if way == NONE { NOWHERE } else { self.ways.of(robot).ways[way as usize].station };
        chosen.iter().enumerate().map(station).collect()
    }

    /// What a robot costs at least at a station, beyond the bound.
    fn least(&self, robot: usize, station: u16) -> Option<i64> {
        if station == NOWHERE {
            return Some(self.reduced.unserved[robot]);
        }
        let ways = &self.ways.of(robot).ways;
        self.reduced.ways[robot].iter().find(|&&(_, way)| ways[way as usize].station == station).map(|&(cost, _)| cost)
    }

    /// All that are worth trying, the most promising first, with what they cost at least.
    fn neighbours(&self, sent: &Sent) -> Vec<(i64, Sent)> {
        let robots = sent.len();
        let mut all = vec![sent.clone()];
        for robot in 0..robots {
            for station in 0..self.ways.problem().stations.len() as u16 {
                if sent[robot] != station {
                    let mut other = sent.clone();
                    other[robot] = station;
                    all.push(other);
                }
            }
            for second in 0..robot {
                if sent[robot] != sent[second] {
                    let mut other = sent.clone();
                    other.swap(robot, second);
                    all.push(other);
                }
            }
        }
        let mut all: Vec<(i64, Sent)> = all.into_iter().filter_map(|sent| Some((self.least_of(&sent)?, sent))).collect();
        // The plan of now first, whatever it costs.
        let others = usize::from(all.first().is_some_and(|first| first.1 == *sent));
        all[others..].sort();
        all
    }

    fn least_of(&self, sent: &Sent) -> Option<i64> {
        let mut sum = 0;
        for (robot, &station) in sent.iter().enumerate() {
            sum += self.least(robot, station)?;
            if sum > self.reduced.room {
                return None;
            }
        }
        Some(sum)
    }

    /// The best plan that sends robots so, if it is better than the one that is known.
    fn plan(&mut self, known: &[u32], before: &Sent, sent: &Sent, go_on: &mut impl FnMut(u64) -> bool) -> Option<Vec<u32>> {
        let mut changed: Vec<u16> = before.iter().zip(sent).filter(|(a, b)| a != b).flat_map(|(a, b)| [*a, *b]).collect();
        changed.sort_unstable();
        changed.dedup();
        changed.retain(|&station| station != NOWHERE);
        if changed.is_empty() {
            // Nobody is sent elsewhere: any station may do better by itself.
            for station in 0..self.ways.problem().stations.len() as u16 {
                let found = self.one(known, sent, station, &[], go_on);
                if found.chosen.is_some() {
                    return found.chosen;
                }
            }
            return None;
        }
        let mut now = known.to_vec();
        for (robot, (a, b)) in before.iter().zip(sent).enumerate() {
            if a != b {
                now[robot] = NONE;
            }
        }
        for (place, &station) in changed.iter().enumerate() {
            now = self.one(&now, sent, station, &changed[place + 1..], go_on).chosen?;
        }
        Some(now)
    }

    /// The best plan of one station while others are as they are, or `open`: to be planned later.
    fn one(&mut self, now: &[u32], sent: &Sent, station: u16, open: &[u16], go_on: &mut impl FnMut(u64) -> bool) -> Found {
        let mut given = Given { chosen: vec![NONE; now.len()], ..Given::default() };
        given.station = (!open.is_empty()).then_some(usize::from(station));
        let mut reduced = self.reduced.without_ways();
        for (robot, &at) in sent.iter().enumerate() {
            if at == station {
                let ways = &self.ways.of(robot).ways;
                let here = self.reduced.ways[robot].iter().filter(|&&(_, way)| ways[way as usize].station == station);
                reduced.ways[robot].extend(here);
            } else if open.contains(&at) {
                given.away |= 1 << robot;
                given.spent += self.least(robot, at).unwrap_or(0);
            } else if now[robot] != NONE {
                given.chosen[robot] = now[robot];
                let cost = self.reduced.ways[robot].iter().find(|&&(_, way)| way == now[robot]).map(|&(cost, _)| cost);
                // A way that leaves no room is in no better plan.
                given.spent += cost.unwrap_or(self.reduced.room + 1);
            }
        }
        let seen = self.seen;
        let found = beam_beside(self.ways, &reduced, &given, self.stranded_max, WIDTH, |more| go_on(seen + more));
        self.seen += found.seen;
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::construct::{self, Order};
    use crate::draft::Draft;
    use crate::instance::Instance;
    use crate::prices::{Level, Prices};

    #[test]
    fn a_plan_that_sends_robots_elsewhere_can_be_had_and_is_better() {
        let instance = Instance::parse(include_str!("../../tests/instances/16-2-1.json")).expect("a valid instance");
        let ways = Ways::all(&instance.problem);
        let mut draft = Draft::new(&ways);
        construct::greedy(&mut draft, &construct::ranked(&ways, Order::Deadline), 0.0);
        let (mut known, mut chosen) = (draft.score, draft.chosen);
        let mut found = 0;
        let mut prices = Prices::new(&ways, Level::Cost { stranded_max: known.stranded });
        for _ in 0..20 {
            prices.improve(known.cost);
        }
        let mut tried = BTreeSet::new();
        loop {
            prices.cap_stranded(known.stranded);
            let reduced = prices.reduced(known.cost);
            let mut stations = Stations { ways: &ways, reduced: &reduced, stranded_max: known.stranded, seen: 0 };
            let Some(better) = stations.better(&chosen, &mut tried, |_| true) else { break };
            let mut anew = Draft::new(&ways);
            for (robot, &way) in better.iter().enumerate().filter(|(_, way)| **way != NONE) {
                let choices = ways.of(robot);
                let taken = &choices.ways[way as usize];
                assert!(anew.books[usize::from(taken.station)].fits(choices, taken), "robot {robot} has no place");
                anew.serve(robot, way);
            }
            assert!((anew.score.stranded, anew.score.cost) < (known.stranded, known.cost));
            (known, chosen) = (anew.score, better);
            found += 1;
        }
        assert!(found > 0);
    }
}
