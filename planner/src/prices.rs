//! Lagrange prices on every row of the books: a proven bound and a guide in one.
//!
//! With prices on bays, lift, slot, spares, power and energy the robots no longer meet, so each
//! takes its best way by itself; what that costs, less what the prices earn for all that there is,
//! is never more than the best plan costs. Prices rise where more is asked for than there is
//! (subgradient steps with memory). All arithmetic on the bound is in whole numbers, so that it
//! is proven and not merely computed.

mod table;

use crate::way::{Choices, Ways};
use table::{Layout, Table};

/// Prices are whole numbers of this part of a unit of cost.
const UNIT: i64 = 1 << 20;

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

/// Prices that are being improved.
#[derive(Debug)]
pub struct Prices<'w, 'p> {
    ways: &'w Ways<'p>,
    layout: Layout,
    level: Level,
    /// Price of each row, per unit of the row's scale; the last is that of a stranded robot.
    now: Vec<f64>,
    best: Vec<f64>,
    direction: Vec<f64>,
    pull: f64,
    since_better: u32,
    /// The greatest bound so far, in parts of `1 / UNIT`, and the bound's slope in `stranded_max`.
    bound: i128,
    best_stranded_price: i128,
    bounded_at: i64,
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
        let layout = Layout::new(ways.problem());
        let rows = layout.rows();
        let mut prices = Self {
            ways,
            layout,
            level,
            now: vec![0.0; rows + 1],
            best: vec![0.0; rows + 1],
            direction: vec![0.0; rows + 1],
            pull: 1.0,
            since_better: 0,
            bound: i128::MIN,
            best_stranded_price: 0,
            bounded_at: 0,
        };
        let mut usage = vec![0.0; rows];
        let look = prices.look(&mut usage);
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
        if self.level == Level::Stranded {
            return;
        }
        self.bound += self.best_stranded_price * i128::from(self.bounded_at - stranded_max);
        self.bounded_at = stranded_max;
        self.level = Level::Cost { stranded_max };
    }

    /// Takes `steps` steps; `aim` is the value of the best plan known.
    pub fn improve(&mut self, steps: u32, aim: i64) {
        let mut usage = vec![0.0; self.layout.rows()];
        for _ in 0..steps {
            let look = self.look(&mut usage);
            if self.note(&look) {
                self.since_better = 0;
                self.pull = (self.pull * 1.05).min(1.5);
            } else {
                self.since_better += 1;
                if self.since_better > 12 {
                    self.since_better = 0;
                    self.pull *= 0.7;
                    if self.pull < 1e-3 {
                        self.pull = 0.3;
                    }
                    self.now.copy_from_slice(&self.best);
                    self.direction.fill(0.0);
                    continue;
                }
            }
            self.step(&look, &usage, aim);
        }
    }

    /// Whether the pull has become so weak that more steps hardly help.
    #[must_use]
    pub fn settled(&self) -> bool {
        self.pull < 0.01
    }

    /// p
    #[must_use]
    pub fn pull(&self) -> f64 {
        self.pull
    }

    /// Price of a stranded robot at the best prices, in units of cost.
    #[must_use]
    pub fn stranded_price(&self) -> f64 {
        self.best.last().copied().unwrap_or(0.0)
    }

    /// Calls `each(way, price)` for a robot's ways with their cost at the best prices, in units of cost.
    pub fn priced(&self, table: &Priced, robot: usize, mut each: impl FnMut(usize, f32)) {
        let choices = self.ways.of(robot);
        for (place, way) in choices.ways.iter().enumerate() {
            let priced = i64::from(way.cost) * UNIT + table.0.of(self.ways.problem(), choices, way);
            each(place, (priced as f64 / UNIT as f64) as f32);
        }
    }

    /// The best prices, ready to be asked.
    #[must_use]
    pub fn table(&self) -> Priced {
        Priced(Table::new(&self.layout, &self.best, UNIT))
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

    /// Lets every robot take its best way at the prices of now.
    fn look(&self, usage: &mut [f64]) -> Look {
        let problem = self.ways.problem();
        let table = Table::new(&self.layout, &self.now, UNIT);
        let (costs, stranded_max) = match self.level {
            Level::Stranded => (0, 0),
            Level::Cost { stranded_max } => (UNIT, stranded_max),
        };
        let last = self.now.last().copied().unwrap_or(0.0);
        let stranded_price = if costs == 0 { UNIT } else { (last * UNIT as f64) as i64 };
        let mut uses = table::Uses::new(&self.layout);
        let (mut bound, mut stranded) = (0_i128, 0);
        for robot in 0..problem.robots.len() {
            let choices = self.ways.of(robot);
            let mut least = i64::from(choices.unserved_cost) * costs + if choices.strands { stranded_price } else { 0 };
            let mut best = None;
            for way in &choices.ways {
                // No price is negative, and the ways stand in order of cost.
                let cost = i64::from(way.cost) * costs;
                if cost >= least {
                    break;
                }
                let priced = cost + table.of(problem, choices, way);
                if priced < least {
                    (least, best) = (priced, Some(way));
                }
            }
            bound += i128::from(least);
            match best {
                Some(way) => uses.add(problem, choices, way),
                None => stranded += i64::from(choices.strands),
            }
        }
        bound -= table.earned();
        if costs != 0 {
            bound -= i128::from(stranded_price) * i128::from(stranded_max);
        }
        uses.over(&self.layout, usage);
        Look { bound, stranded_price, stranded }
    }

    /// Moves the prices towards what is asked for too much.
    fn step(&mut self, look: &Look, usage: &[f64], aim: i64) {
        const MEMORY: f64 = 0.7;
        let rows = usage.len();
        let over_stranded = match self.level {
            Level::Stranded => 0.0,
            Level::Cost { stranded_max } => (look.stranded - stranded_max) as f64 * STRANDED_SCALE,
        };
        let mut square = 0.0;
        for row in 0..=rows {
            let over = if row < rows { usage[row] } else { over_stranded };
            let direction = MEMORY * self.direction[row] + (1.0 - MEMORY) * over;
            self.direction[row] = direction;
            if direction > 0.0 || self.now[row] > 0.0 {
                square += direction * direction;
            }
        }
        if square <= 0.0 {
            return;
        }
        let value = look.bound as f64 / UNIT as f64;
        let gap = (aim as f64 - value).max(0.002 * aim.abs() as f64).max(0.05);
        let step = self.pull * gap / square;
        for row in 0..=rows {
            let scale = if row < rows { 1.0 } else { STRANDED_SCALE };
            self.now[row] = (self.now[row] + step * scale * self.direction[row]).max(0.0);
        }
    }
}

/// The price of a stranded robot is far above that of a tick in a bay, so it moves in larger steps.
const STRANDED_SCALE: f64 = 3.0;

/// Prices, ready to be asked; see [`Prices::priced`].
#[derive(Debug)]
pub struct Priced(Table);

/// What a robot's way costs beside its own cost.
impl Priced {
    /// In units of cost.
    #[must_use]
    pub fn of(&self, ways: &Ways<'_>, choices: &Choices, way: &crate::way::Way) -> f64 {
        self.0.of(ways.problem(), choices, way) as f64 / UNIT as f64
    }
}
