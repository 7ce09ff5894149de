//! Lagrange prices on every row of the books: a proven bound and a guide in one.
//!
//! With prices on bays, lift, slot, spares, power and energy the robots no longer meet, so each
//! takes its best way by itself; what that costs, less what the prices earn for all that there is,
//! is never more than the best plan costs. Prices rise where more is asked for than there is
//! (subgradient steps with memory). All arithmetic on the bound is in whole numbers, so that it
//! is proven and not merely computed.

mod crowd;
mod layout;
mod lists;
mod reduced;
mod steps;
mod table;

use std::ops::Range;

use crate::guide::Guide;
use crate::problem::Problem;
use crate::way::{Choices, SHARED_MIN, Way, Ways};
use layout::Layout;
pub(crate) use reduced::Reduced;
use table::{Table, Uses};

/// Prices are whole numbers of this part of a unit of cost.
pub(crate) const UNIT: i64 = 1 << 20;

/// What is bounded.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Level {
    /// The number of stranded robots.
    Stranded,
    /// Worth of missed work, of plans that strand at most so many robots.
    Cost {
        /// So many.
        stranded_max: i64,
    },
}

impl Level {
    /// What a unit of cost counts, and how many may be stranded for nothing.
    fn weights(self) -> (i64, i64) {
        match self {
            Self::Stranded => (0, 0),
            Self::Cost { stranded_max } => (UNIT, stranded_max),
        }
    }
}

/// Prices that are being improved.
#[derive(Debug)]
pub struct Prices<'w, 'p> {
    ways: &'w Ways<'p>,
    layout: Layout,
    level: Level,
    /// Price of each row, per unit of the row's scale; the last is that of a stranded robot.
    now: Vec<f64>,
    best: Vec<f64>,
    /// The prices of the last steps, the last ones most: where those go to and fro, these lie between.
    mean: Vec<f64>,
    direction: Vec<f64>,
    pull: f64,
    since_better: u32,
    rounds: u32,
    /// Steps until all ways are looked at again.
    pause: u32,
    /// What is worth trying at the best prices.
    guide: Guide,
    /// The same ways of each robot with their places, side by side in memory.
    near: Vec<Vec<(Way, u32)>>,
    /// The greatest bound so far, in parts of `1 / UNIT`, and the bound's slope in `stranded_max`.
    bound: i128,
    best_stranded_price: i128,
    bounded_at: i64,
}

/// Prices to ask for.
#[derive(Debug, Clone)]
pub(crate) struct Asked {
    table: Table,
    /// Price of a stranded robot, in units of cost.
    pub(crate) stranded: f32,
}

impl Asked {
    #[inline]
    fn of(&self, problem: &Problem, choices: &Choices, way: &Way) -> i64 {
        self.table.of(problem, choices, way)
    }

    /// What a way costs beside its own cost, in units of cost.
    #[inline]
    pub(crate) fn price(&self, problem: &Problem, choices: &Choices, way: &Way) -> f32 {
        Self::in_cost(self.of(problem, choices, way))
    }

    /// A whole price in units of cost.
    pub(crate) fn in_cost(price: i64) -> f32 {
        (price as f64 / UNIT as f64) as f32
    }
}

/// What one look at all robots gives.
struct Look {
    bound: i128,
    stranded_price: i64,
    stranded: i64,
}

impl<'w, 'p> Prices<'w, 'p> {
    /// All prices zero: the bound says what each robot costs at least if it were alone.
    #[must_use]
    pub fn new(ways: &'w Ways<'p>, level: Level) -> Self {
        let layout = Layout::new(ways);
        let rows = layout.rows();
        let mut prices = Self {
            ways,
            layout,
            level,
            now: vec![0.0; rows + 1],
            best: vec![0.0; rows + 1],
            mean: vec![0.0; rows + 1],
            direction: vec![0.0; rows + 1],
            pull: 0.25,
            since_better: 0,
            rounds: 0,
            pause: 2,
            guide: Guide::empty(ways),
            near: vec![Vec::new(); ways.problem().robots.len()],
            bound: i128::MIN,
            best_stranded_price: 0,
            bounded_at: 0,
        };
        let mut usage = vec![0.0; rows];
        let look = prices.look_at_cheap(&mut usage);
        prices.note(&look);
        prices
    }

    /// The best prices so far.
    pub(crate) fn best(&self) -> &[f64] {
        &self.best
    }

    /// Fewer ways of the same problem at these prices.
    pub(crate) fn from(ways: &'w Ways<'p>, level: Level, best: &[f64]) -> Self {
        let mut prices = Prices::new(ways, level);
        prices.now.copy_from_slice(best);
        // What none of the fewer ways asks for has no price any more.
        prices.layout.unasked().into_iter().for_each(|row| prices.now[row] = 0.0);
        let mut usage = vec![0.0; prices.layout.rows()];
        let look = prices.look_at_all(&mut usage);
        prices.note(&look);
        prices
    }

    /// The proven bound: no plan is better.
    #[must_use]
    pub fn bound(&self) -> i64 {
        let moved = match self.level {
            Level::Stranded => 0,
            Level::Cost { stranded_max } => self.best_stranded_price * i128::from(self.bounded_at - stranded_max),
        };
        let unit = i128::from(UNIT);
        ((self.bound + moved + unit - 1).div_euclid(unit)) as i64
    }

    /// Bounds plans that strand at most so many robots from now on.
    pub fn cap_stranded(&mut self, stranded_max: i64) {
        if self.level == Level::Stranded || stranded_max == self.bounded_at {
            return;
        }
        // Another question: longer steps again.
        self.pull = self.pull.max(0.06);
        self.bound += self.best_stranded_price * i128::from(self.bounded_at - stranded_max);
        self.bounded_at = stranded_max;
        self.level = Level::Cost { stranded_max };
    }

    /// Whether any step has been taken.
    #[must_use]
    pub fn improved(&self) -> bool {
        self.rounds > 0
    }

    /// A lower bound on the energy of the services, mWh, of plans that miss at most this and strand
    /// as few as the level says: work and energy are weighed against each other at several rates.
    #[must_use]
    pub fn energy_bound(&self, cost_max: i64) -> i64 {
        let mut usage = vec![0.0; self.layout.rows()];
        let problem = self.ways.problem();
        let rates = [1, 4, 16, 32, 64, 128, 256, 1024];
        let bounds = rates.map(|rate: i64| {
            let look = self.look(&self.best, &mut usage, |choices, _, costs, price, mut least| {
                let mut best = None;
                for (way, place) in choices.ways.iter().zip(0..) {
                    let cost = i64::from(way.cost) * costs + way.energy * UNIT / rate;
                    if cost < least {
                        let priced = cost + price.of(problem, choices, way);
                        if priced < least {
                            (least, best) = (priced, Some((priced, place)));
                        }
                    }
                }
                best
            });
            (look.bound - i128::from(cost_max) * i128::from(UNIT)) * i128::from(rate) / i128::from(UNIT)
        });
        bounds.into_iter().max().unwrap_or(0).max(0) as i64
    }

    /// The promising ways at the prices of the last look.
    #[must_use]
    pub fn guide(&self) -> &Guide {
        &self.guide
    }

    fn note(&mut self, look: &Look) -> bool {
        if self.bound >= look.bound && self.bound != i128::MIN {
            return false;
        }
        self.bound = look.bound;
        self.best_stranded_price = i128::from(look.stranded_price);
        self.bounded_at = if let Level::Cost { stranded_max } = self.level { stranded_max } else { 0 };
        self.best.copy_from_slice(&self.now);
        true
    }

    /// The same without lists, in the order of cost: no price is negative, so few need a look.
    fn look_at_cheap(&self, usage: &mut [f64]) -> Look {
        let problem = self.ways.problem();
        self.look(&self.now, usage, |choices, _, costs, price, mut least| {
            let mut best = None;
            for (way, place) in choices.ways.iter().zip(0..) {
                let cost = i64::from(way.cost) * costs;
                if cost >= least {
                    break;
                }
                if let Some(price) = price.table.below(problem, choices, way, least - cost) {
                    (least, best) = (cost + price, Some((cost + price, place)));
                }
            }
            best
        })
    }

    /// Lets every robot take what `choose(choices, robot, unit of cost, price, limit)` gives it, if
    /// that is less than the limit: the price of no service.
    fn look(
        &self,
        prices: &[f64],
        usage: &mut [f64],
        choose: impl Fn(&Choices, usize, i64, &Asked, i64) -> Option<(i64, u32)> + Sync,
    ) -> Look {
        let problem = self.ways.problem();
        let table = Table::new(&self.layout, prices, UNIT);
        let (costs, stranded_max) = self.level.weights();
        let last = prices.last().copied().unwrap_or(0.0);
        let stranded_price = if costs == 0 { UNIT } else { (last * UNIT as f64) as i64 };
        let price = Asked { table, stranded: last as f32 };
        let part = |robots: Range<usize>| {
            let mut uses = Uses::new(&self.layout);
            let (mut bound, mut stranded) = (0_i128, 0);
            for robot in robots {
                let choices = self.ways.of(robot);
                let unserved = i64::from(choices.unserved_cost) * costs + if choices.strands { stranded_price } else { 0 };
                if let Some((least, way)) = choose(choices, robot, costs, &price, unserved) {
                    bound += i128::from(least);
                    uses.add(problem, choices, &choices.ways[way as usize]);
                } else {
                    bound += i128::from(unserved);
                    stranded += i64::from(choices.strands);
                }
            }
            (bound, stranded, uses)
        };
        let robots = problem.robots.len();
        let (mut bound, stranded, uses) = if robots < SHARED_MIN {
            part(0..robots)
        } else {
            // Whole numbers are the same in whatever order they are added.
            let (one, other) = rayon::join(|| part(0..robots / 2), || part(robots / 2..robots));
            (one.0 + other.0, one.1 + other.1, one.2.and(&other.2))
        };
        bound -= price.table.earned() + i128::from(stranded_price) * i128::from(stranded_max);
        uses.over(&self.layout, usage);
        Look { bound, stranded_price, stranded }
    }
}
