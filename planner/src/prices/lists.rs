//! Lists of what is promising at the prices, and looks that make and use them.

use rayon::prelude::*;

use super::table::Table;
use super::{Asked, Look, Prices, UNIT};
use crate::guide::{Guide, LISTED_MAX};
use crate::way::{SHARED_MIN, Way, Ways};

/// So many of each robot's ways are looked at by steps of a large fleet, between two looks at all. With 48 the bound rose no higher.
const NEAR: usize = 20;

impl Prices<'_, '_> {
    /// Lets every robot take the best of all its ways at the prices of now, and lists them.
    pub(super) fn look_at_all(&mut self, usage: &mut [f64]) -> Look {
        if self.near.len() >= SHARED_MIN {
            self.find_near();
            return self.look_at_listed(usage);
        }
        let mut guide = std::mem::take(&mut self.guide);
        self.list(&mut guide, self.ways, &self.now, LISTED_MAX);
        for (robot, near) in self.near.iter_mut().enumerate() {
            let ways = &self.ways.of(robot).ways;
            near.clear();
            near.extend(guide.listed[robot].iter().map(|&place| (ways[place as usize], place)));
        }
        self.guide = guide;
        self.look_at_listed(usage)
    }

    /// Finds each robot's few best ways in a large fleet. Those of the last time tell how dear they are at most, and no price is
    /// negative, so few others need a look.
    fn find_near(&mut self) {
        let mut near = std::mem::take(&mut self.near);
        let problem = self.ways.problem();
        let table = Table::new(&self.layout, &self.now, UNIT);
        let (costs, _) = self.level.weights();
        near.par_iter_mut().enumerate().for_each_init(Vec::new, |priced, (robot, near)| {
            let choices = self.ways.of(robot);
            let of = |way: &Way| i64::from(way.cost) * costs + table.of(problem, choices, way);
            let known = near.iter().map(|(way, _)| of(way)).max();
            let limit = known.filter(|_| near.len() == NEAR).map_or(i64::MAX, |most| most.saturating_add(1));
            priced.clear();
            for (way, place) in choices.ways.iter().zip(0..) {
                let cost = i64::from(way.cost) * costs;
                if cost >= limit {
                    break;
                }
                priced.extend(table.below(problem, choices, way, limit - cost).map(|price| (cost + price, place)));
            }
            if priced.len() > NEAR {
                priced.select_nth_unstable(NEAR);
                priced.truncate(NEAR);
            }
            priced.sort_unstable();
            near.clear();
            near.extend(priced.iter().map(|&(_, place): &(i64, u32)| (choices.ways[place as usize], place)));
        });
        self.near = near;
    }

    /// The same with the listed ways alone: no bound.
    pub(super) fn look_at_listed(&self, usage: &mut [f64]) -> Look {
        let problem = self.ways.problem();
        self.look(&self.now, usage, |choices, robot, costs, price, mut least| {
            let mut best = None;
            for &(ref way, place) in &self.near[robot] {
                let cost = i64::from(way.cost) * costs;
                if let Some(price) = price.table.below(problem, choices, way, least - cost) {
                    (least, best) = (cost + price, Some((cost + price, place)));
                }
            }
            best
        })
    }

    /// Each robot's most promising ways at the best prices, at most so many, in no order.
    pub(crate) fn promising(&self, most: usize) -> Vec<Vec<u32>> {
        let mut guide = Guide::empty(self.ways);
        self.list(&mut guide, self.ways, &self.best, most);
        guide.listed
    }

    /// The promising ones among few ways of the same problem, at the mean of the last prices.
    pub(crate) fn guide_among(&self, few: &Ways<'_>) -> Guide {
        let mut guide = Guide::empty(few);
        self.list(&mut guide, few, &self.mean, usize::MAX);
        guide.spread(few, LISTED_MAX);
        guide
    }

    fn list(&self, guide: &mut Guide, ways: &Ways<'_>, prices: &[f64], most: usize) {
        let problem = self.ways.problem();
        let stranded = prices.last().copied().unwrap_or(0.0) as f32;
        let asked = Asked { table: Table::new(&self.layout, prices, UNIT), stranded };
        let (costs, _) = self.level.weights();
        guide.list(ways, most, |choices, way| i64::from(way.cost) * costs + asked.of(problem, choices, way));
        guide.judge_by(asked);
    }
}
