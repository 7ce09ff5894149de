//! The ways worth trying: by cost, or by Lagrange prices, which count what a way costs its robot
//! and everyone else.

use rayon::prelude::*;

use crate::draft::NONE;
use crate::prices::Asked;
use crate::way::{Choices, SHARED_MIN, Way, Ways};

/// Longest list of a robot.
pub(crate) const LISTED_MAX: usize = 48;

/// The same while only cost counts.
const CHEAPEST_MAX: usize = 48;
/// What a stranded robot counts while there are no prices.
const STRANDED_UNPRICED: f32 = 1e6;

/// A way with as much of it as its place asks for, so that many of them are looked at side by side in memory.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Spot {
    /// Index of the way.
    pub(crate) way: u32,
    pub(crate) cost: i32,
    pub(crate) station: u16,
    pub(crate) start: u16,
    pub(crate) end: u16,
    /// When its spare comes back; 0 for a charge.
    pub(crate) back: u16,
}

impl Spot {
    fn new(way: &Way, place: u32) -> Self {
        let back = if way.charges() { 0 } else { way.ready };
        Self { way: place, cost: way.cost, station: way.station, start: way.start, end: way.end, back }
    }
}

/// For each robot its most promising ways, the best first.
#[derive(Debug, Clone, Default)]
pub struct Guide {
    /// Indices of ways.
    pub listed: Vec<Vec<u32>>,
    /// All ways of each robot by price, where that is asked for.
    spots: Vec<Vec<Spot>>,
    /// What each robot pays at least, in units of cost.
    least: Vec<f32>,
    /// The prices; none when only cost counts.
    prices: Option<Asked>,
}

impl Guide {
    /// Nothing is listed yet.
    pub(crate) fn empty(ways: &Ways<'_>) -> Self {
        Self::by_cost(ways, std::iter::empty())
    }

    /// The cheapest ways of some robots.
    #[must_use]
    pub fn by_cost(ways: &Ways<'_>, robots: impl IntoIterator<Item = usize>) -> Self {
        let count = ways.problem().robots.len();
        let mut guide = Self { listed: vec![Vec::new(); count], least: vec![f32::MAX; count], spots: Vec::new(), prices: None };
        for robot in robots {
            let choices = ways.of(robot);
            guide.listed[robot] = (0..choices.ways.len().min(CHEAPEST_MAX) as u32).collect();
            guide.least[robot] = choices.ways.first().map_or(f32::MAX, |way| way.cost as f32);
        }
        guide
    }

    /// All ways, those that begin last first: who waits for as long as it can leaves the time before to others. Of thirteen
    /// fleets of 16 robots that are hard to serve nine were served when the ways of least energy came first, ten so.
    #[must_use]
    pub(crate) fn latest(ways: &Ways<'_>) -> Self {
        let mut guide = Self::by_cost(ways, 0..ways.problem().robots.len());
        for (robot, listed) in guide.listed.iter_mut().enumerate() {
            let all = &ways.of(robot).ways;
            *listed = (0..all.len() as u32).collect();
            listed.sort_by_key(|&way| std::cmp::Reverse(all[way as usize].start));
        }
        guide
    }

    /// How far a robot's way is from the best that it could have, all prices paid; 0 or more.
    #[must_use]
    pub fn regret(&self, ways: &Ways<'_>, robot: usize, chosen: u32) -> f32 {
        let choices = ways.of(robot);
        let problem = ways.problem();
        let paid = if chosen == NONE {
            let stranded = self.prices.as_ref().map_or(STRANDED_UNPRICED, |prices| prices.stranded);
            choices.unserved_cost as f32 + if choices.strands { stranded } else { 0.0 }
        } else {
            let way = &choices.ways[chosen as usize];
            way.cost as f32 + self.prices.as_ref().map_or(0.0, |prices| prices.price(problem, choices, way))
        };
        (paid - self.least[robot]).max(0.0)
    }

    /// Whether prices count, and not cost alone.
    #[must_use]
    pub fn is_priced(&self) -> bool {
        self.prices.is_some()
    }

    /// All ways of a robot, the best by price first, if they are known.
    #[inline]
    pub(crate) fn spots(&self, robot: usize) -> Option<&[Spot]> {
        self.spots.get(robot).map(Vec::as_slice)
    }

    /// Keeps what is listed as [`Self::spots`], and lists no more than so many.
    pub(crate) fn spread(&mut self, ways: &Ways<'_>, most: usize) {
        let spots = |(robot, listed): (usize, &Vec<u32>)| -> Vec<Spot> {
            let ways = &ways.of(robot).ways;
            listed.iter().map(|&place| Spot::new(&ways[place as usize], place)).collect()
        };
        self.spots = self.listed.par_iter().enumerate().map(spots).collect();
        self.listed.iter_mut().for_each(|listed| listed.truncate(most));
    }

    /// Judges by these prices from now on.
    pub(crate) fn judge_by(&mut self, prices: Asked) {
        self.prices = Some(prices);
    }

    /// Lists at most so many of each robot's ways by the price that `of` tells of each.
    pub(crate) fn list(&mut self, ways: &Ways<'_>, most: usize, of: impl Fn(&Choices, &Way) -> i64 + Sync) {
        let list = |(robot, (listed, least)): (usize, (&mut Vec<u32>, &mut f32))| {
            let choices = ways.of(robot);
            let mut priced: Vec<(i64, u32)> = choices.ways.iter().map(|way| of(choices, way)).zip(0..).collect();
            *least = Self::list_one(listed, &mut priced, most);
        };
        if self.listed.len() < SHARED_MIN {
            self.listed.iter_mut().zip(&mut self.least).enumerate().for_each(list);
        } else {
            self.listed.par_iter_mut().zip(&mut self.least).enumerate().for_each(list);
        }
    }

    /// Lists at most so many of a robot's ways by price; reorders `priced`. What it pays at least.
    fn list_one(listed: &mut Vec<u32>, priced: &mut Vec<(i64, u32)>, most: usize) -> f32 {
        if priced.len() > most {
            priced.select_nth_unstable(most);
            priced.truncate(most);
        }
        priced.sort_unstable();
        listed.clear();
        listed.extend(priced.iter().map(|&(_, way)| way));
        priced.first().map_or(f32::MAX, |&(least, _)| Asked::in_cost(least))
    }
}
