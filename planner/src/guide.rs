//! The ways worth trying, by Lagrange prices: what a way costs its robot and everyone else.

use crate::prices::Prices;
use crate::way::Ways;

/// Longest list of a robot.
const LISTED_MAX: usize = 48;

/// For each robot its most promising ways, the best first.
#[derive(Debug, Default)]
pub struct Guide {
    /// Indices of ways.
    pub listed: Vec<Vec<u32>>,
}

impl Guide {
    /// The guide at the best prices known.
    #[must_use]
    pub fn new(ways: &Ways<'_>, prices: &Prices<'_, '_>) -> Self {
        let table = prices.table();
        let mut priced: Vec<(f32, u32)> = Vec::new();
        let robots = 0..ways.problem().robots.len();
        let listed = robots.map(|robot| {
            priced.clear();
            prices.priced(&table, robot, |way, price| priced.push((price, way as u32)));
            let less = |a: &(f32, u32), b: &(f32, u32)| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1));
            if priced.len() > LISTED_MAX {
                priced.select_nth_unstable_by(LISTED_MAX, less);
                priced.truncate(LISTED_MAX);
            }
            priced.sort_unstable_by(less);
            priced.iter().map(|&(_, way)| way).collect()
        });
        Self { listed: listed.collect() }
    }
}
