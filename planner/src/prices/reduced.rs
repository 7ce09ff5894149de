//! What a plan costs beyond the bound, piece by piece.
//!
//! At any prices the cost of a plan is the bound, plus what each robot pays more than it would have to
//! (its way's *reduced cost*), plus the price of everything that is left over, plus the price of robots
//! that could have been stranded and were not. No piece is below zero, so whoever looks for a plan that
//! is cheaper than a known one need not look at a way whose reduced cost alone is the whole difference.
//! All of it is in whole numbers and exact.

use super::crowd::Counted;
use super::layout::BY_TICK;
use super::{Asked, Prices, Table, UNIT};
use crate::book::Book;
use crate::way::Ways;

/// The pieces, in parts of [`UNIT`].
#[derive(Debug)]
pub(crate) struct Reduced {
    /// What the pieces of a plan may come to in all if it is to be cheaper than the one that is known.
    pub(crate) room: i64,
    /// Each robot's reduced cost without a service.
    pub(crate) unserved: Vec<i64>,
    /// Each robot's ways that leave some room, as (reduced cost, index).
    pub(crate) ways: Vec<Vec<(i64, u32)>>,
    /// What each robot pays at least.
    least: Vec<i64>,
    /// What the prices of each station bring in for all that it has.
    earned: Vec<i64>,
    /// Price of a unit of each row of each station, in the order of [`Book::left`].
    rows: Vec<Vec<i64>>,
    /// Who is in each station's crowd, how many there can be in each tick, and what each pays.
    crowds: Vec<(Counted, Vec<i64>, Vec<i64>)>,
}

impl Reduced {
    /// The room in units of cost.
    pub(crate) fn room_in_cost(&self) -> f64 {
        self.room as f64 / UNIT as f64
    }

    /// What a station's plan for these robots (the bits of a number) costs beyond its part of the bound, if it costs this.
    pub(crate) fn column(&self, station: usize, set: u32, cost: i64) -> i64 {
        let least = self.least.iter().enumerate().filter(|(robot, _)| set >> robot & 1 == 1).map(|(_, least)| least);
        cost * UNIT + self.earned[station] - least.sum::<i64>()
    }

    /// Price of a unit of each row of a station, in the order of [`Book::left`].
    pub(crate) fn prices(&self, station: usize) -> &[i64] {
        &self.rows[station]
    }

    /// Who is in a station's crowd, how many there can be in each tick, and what each pays.
    pub(crate) fn crowd(&self, station: usize) -> (Counted, &[i64], &[i64]) {
        let (counted, there, prices) = &self.crowds[station];
        (*counted, there, prices)
    }

    /// What a robot pays at least.
    pub(crate) fn least(&self, robot: usize) -> i64 {
        self.least[robot]
    }

    /// What is left over in a tick, at its price; limits of energy count in the last tick before them.
    pub(crate) fn slack(&self, station: usize, ways: &Ways<'_>, book: &Book<'_>, tick: usize) -> i64 {
        let (rows, ticks) = (&self.rows[station], book.horizon() as usize);
        // Most rows have no price.
        let priced = (0..BY_TICK).filter(|row| rows[row * ticks + tick] != 0);
        let by_tick = priced.map(|row| book.left_at(row, tick).max(0) * rows[row * ticks + tick]);
        let limits = book.limits().iter().zip(&rows[BY_TICK * ticks..]).filter(|(limit, _)| limit.before as usize == tick + 1);
        by_tick.sum::<i64>()
            + self.crowd_slack(station, ways, book, tick)
            + limits.map(|(limit, price)| limit.energy.max(0) * price).sum::<i64>()
    }

    /// What is left over of a station's crowd in a tick, at its price.
    fn crowd_slack(&self, station: usize, ways: &Ways<'_>, book: &Book<'_>, tick: usize) -> i64 {
        let (counted, there, prices) = &self.crowds[station];
        let price = prices.get(tick).copied().unwrap_or(0);
        if price == 0 {
            return 0;
        }
        let mut count = 0;
        for (&robot, way) in book.robots.iter().zip(&book.taken) {
            ways.of(robot as usize).draws(way, book.station(), book.horizon(), |from, to, draw| {
                if (from..to).contains(&tick) {
                    count += counted.weight(way.charges(), draw);
                }
            });
        }
        (there[tick] - count).max(0) * price
    }
}

impl Prices<'_, '_> {
    /// The price of a stranded robot, in units of cost.
    pub(crate) fn stranded(&self) -> f64 {
        self.best.last().copied().unwrap_or(0.0)
    }

    /// The pieces at the best prices, for plans that cost less than this and strand as few as the level says.
    pub(crate) fn reduced(&self, below: i64) -> Reduced {
        let (costs, stranded_max) = self.level.weights();
        let problem = self.ways.problem();
        let last = self.best.last().copied().unwrap_or(0.0);
        let stranded_price = if costs == 0 { UNIT } else { (last * UNIT as f64) as i64 };
        let price = Asked { table: Table::new(&self.layout, &self.best, UNIT), stranded: last as f32 };
        let mut bound = -price.table.earned() - i128::from(stranded_price) * i128::from(stranded_max);
        let mut all: Vec<Vec<(i64, u32)>> = Vec::with_capacity(problem.robots.len());
        let mut unserved = Vec::with_capacity(problem.robots.len());
        let mut leasts = Vec::with_capacity(problem.robots.len());
        for robot in 0..problem.robots.len() {
            let choices = self.ways.of(robot);
            let without = i64::from(choices.unserved_cost) * costs + if choices.strands { stranded_price } else { 0 };
            let priced =
                choices.ways.iter().zip(0..).map(|(way, place)| (i64::from(way.cost) * costs + price.of(problem, choices, way), place));
            let mut priced: Vec<(i64, u32)> = priced.collect();
            let least = priced.iter().map(|&(priced, _)| priced).min().map_or(without, |least| least.min(without));
            bound += i128::from(least);
            priced.iter_mut().for_each(|(priced, _)| *priced -= least);
            unserved.push(without - least);
            leasts.push(least);
            all.push(priced);
        }
        let room = (i128::from(below) - 1) * i128::from(UNIT) - bound;
        let room = room.clamp(-1, i128::from(i64::MAX / 4)) as i64;
        for ways in &mut all {
            ways.retain(|&(reduced, _)| reduced <= room);
            ways.sort_unstable();
        }
        let rows: Vec<Vec<i64>> = (0..problem.stations.len()).map(|station| self.layout.whole(station, &self.best, UNIT)).collect();
        let crowds = self.layout.crowded().into_iter().zip(&rows).enumerate().map(|(station, (counted, rows))| {
            let there = self.layout.crowd_there(station).to_vec();
            let prices = rows[rows.len() - there.len()..].to_vec();
            (counted, there, prices)
        });
        let crowds = crowds.collect();
        let earned = (0..problem.stations.len())
            .map(|station| self.layout.there(station).iter().zip(&rows[station]).map(|(there, price)| there * price).sum());
        let earned = earned.collect();
        Reduced { room, unserved, ways: all, least: leasts, earned, rows, crowds }
    }
}
