//! The same ways for a search that wants something else: to take little of a station, to run empty for a price, to keep to few ways.

use std::sync::{Arc, OnceLock};

use crate::thrift::Thrift;
use crate::way::{Choices, SHARED_MIN, Way, Ways};

/// The most that a way may cost where costs are made larger.
const COST_MAX: i64 = 1 << 26;

impl Ways<'_> {
    /// The same ways of the robots that would run empty, with what they take of their station in
    /// place of their cost, in thousandths of all that the station has, and no ways for others:
    /// who plans with these strands as few robots as it can.
    #[must_use]
    pub fn thrifty(&self) -> Self {
        let thrift = Thrift::new(self.problem);
        Self::made(self.problem, |robot| {
            let all = self.of(robot);
            let mut ways = Vec::new();
            if all.strands {
                ways = all.ways.clone();
                ways.iter_mut().for_each(|way| way.cost = thrift.of(way));
                ways.sort_unstable_by_key(|way| (way.cost, way.energy, way.start, way.station, way.mode));
            }
            Choices { ways, runs: Arc::clone(&all.runs), unserved_cost: 0, starts: OnceLock::new(), ..*all }
        })
    }

    /// The same ways of the robots that are wanted, as if nothing counted but `penalty` for each that gets none. Those that
    /// hold their place for the shortest time come first.
    #[must_use]
    pub(crate) fn barely(&self, penalty: i32, is_wanted: impl Fn(&Choices) -> bool) -> Self {
        let choices = (0..self.choices.len()).map(|robot| {
            let all = self.of(robot);
            let is_wanted = is_wanted(all);
            let mut ways = if is_wanted { all.ways.clone() } else { Vec::new() };
            ways.iter_mut().for_each(|way| way.cost = 0);
            ways.sort_unstable_by_key(|way| (way.end - way.start, way.energy, way.start, way.station, way.mode));
            let unserved_cost = if is_wanted { penalty } else { 0 };
            OnceLock::from(Choices { ways, runs: Arc::clone(&all.runs), unserved_cost, strands: false, starts: OnceLock::new(), ..*all })
        });
        Self { problem: self.problem, choices: choices.collect() }
    }

    /// The same ways where a robot that runs empty counts as so much missed work, and as no more than that.
    #[must_use]
    pub(crate) fn lenient(&self, penalty: i32) -> Self {
        let choices = (0..self.choices.len()).map(|robot| {
            let all = self.of(robot).clone();
            let unserved_cost = all.unserved_cost + if all.strands { penalty } else { 0 };
            OnceLock::from(Choices { strands: false, unserved_cost, ..all })
        });
        Self { problem: self.problem, choices: choices.collect() }
    }

    /// Of each robot only those of these ways that are at one station, `scale` times as dear and less the worth of the robot,
    /// who may do without for nothing. Also the index of each here. None if that is too dear to be counted.
    pub(crate) fn apart(&self, station: usize, kept: &[Vec<u32>], scale: i64, worth: &[i64]) -> Option<(Self, Vec<Vec<u32>>)> {
        let mut places = Vec::with_capacity(kept.len());
        let mut choices = Vec::with_capacity(kept.len());
        for (robot, kept) in kept.iter().enumerate() {
            let all = self.of(robot);
            let mut here: Vec<u32> = kept.iter().copied().filter(|&way| usize::from(all.ways[way as usize].station) == station).collect();
            here.sort_unstable();
            let dearer = |&way: &u32| {
                let way = all.ways[way as usize];
                let cost = i64::from(way.cost) * scale - worth[robot];
                (cost.abs() <= COST_MAX).then_some(Way { cost: cost as i32, ..way })
            };
            let ways = here.iter().map(dearer).collect::<Option<Vec<Way>>>()?;
            let (runs, starts) = (Arc::clone(&all.runs), OnceLock::new());
            choices.push(OnceLock::from(Choices { ways, runs, unserved_cost: 0, strands: false, held: false, starts, ..*all }));
            places.push(here);
        }
        Some((Self { problem: self.problem, choices }, places))
    }

    /// Of each robot only some of its ways, which keep their order.
    #[must_use]
    pub(crate) fn only(&self, kept: impl Fn(usize) -> Vec<u32> + Sync) -> Self {
        Self::made(self.problem, |robot| {
            let all = self.of(robot);
            let mut kept = kept(robot);
            kept.sort_unstable();
            let mut ways: Vec<Way> = kept.into_iter().map(|way| all.ways[way as usize]).collect();
            // A large fleet's runs do not fit into the caches, those of a few ways do.
            let is_large = self.choices.len() >= SHARED_MIN;
            let runs = if is_large { Arc::new(all.runs.only(&mut ways)) } else { Arc::clone(&all.runs) };
            Choices { ways, runs, starts: OnceLock::new(), ..*all }
        })
    }
}
