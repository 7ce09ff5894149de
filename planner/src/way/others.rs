//! The same ways for a search that wants something else: to take little of a station, to run empty for a price, to keep to few ways.

use std::sync::{Arc, OnceLock};

use crate::thrift::Thrift;
use crate::way::{Choices, Ways};

impl Ways<'_> {
    /// The same ways of the robots that would run empty, with what they take of their station in
    /// place of their cost, in thousandths of all that the station has, and no ways for others:
    /// who plans with these strands as few robots as it can.
    #[must_use]
    pub fn thrifty(&self) -> Self {
        let thrift = Thrift::new(self.problem);
        let choices = (0..self.choices.len()).map(|robot| {
            let all = self.of(robot);
            let mut ways = Vec::new();
            if all.strands {
                ways = all.ways.clone();
                ways.iter_mut().for_each(|way| way.cost = thrift.of(way));
                ways.sort_unstable_by_key(|way| (way.cost, way.energy, way.start, way.station, way.mode));
            }
            OnceLock::from(Choices { ways, runs: Arc::clone(&all.runs), unserved_cost: 0, starts: OnceLock::new(), ..*all })
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

    /// Of each robot only some of its ways, which keep their order.
    #[must_use]
    pub(crate) fn only(&self, kept: impl Fn(usize) -> Vec<u32>) -> Self {
        let choices = (0..self.choices.len()).map(|robot| {
            let all = self.of(robot);
            let mut kept = kept(robot);
            kept.sort_unstable();
            let ways = kept.into_iter().map(|way| all.ways[way as usize]).collect();
            OnceLock::from(Choices { ways, runs: Arc::clone(&all.runs), starts: OnceLock::new(), ..*all })
        });
        Self { problem: self.problem, choices: choices.collect() }
    }
}
