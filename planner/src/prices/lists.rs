//! Lists of what is promising at the prices, and looks that make and use them.

use super::table::Table;
use super::{Asked, Look, Prices, UNIT};
use crate::guide::{Guide, LISTED_MAX};
use crate::way::Ways;

impl Prices<'_, '_> {
    /// Lets every robot take the best of all its ways at the prices of now, and lists them.
    pub(super) fn look_at_all(&mut self, usage: &mut [f64]) -> Look {
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
        self.list(&mut guide, few, &self.mean, LISTED_MAX);
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
