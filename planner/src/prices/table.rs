//! Prices as running sums by tick, so that a stretch of ticks is priced by one subtraction.

use crate::book::Book;
use crate::problem::Problem;
use crate::way::{Choices, Mode, Way};

/// Bays, lift, slot, spares, power: so many rows have one entry per tick.
pub(super) const BY_TICK: usize = 5;
const BAY: usize = 0;
const LIFT: usize = 1;
const SLOT: usize = 2;
const SPARE: usize = 3;
const POWER: usize = 4;

/// Which row stands where, and how much of everything there is.
///
/// Rows are scaled so that one unit is about what one service takes of them: prices of bays and
/// of energy then move at the same pace.
#[derive(Debug)]
pub(super) struct Layout {
    ticks: usize,
    /// First row of each station, and the end.
    first: Vec<usize>,
    /// For each station the ticks before which energy is limited.
    before: Vec<Vec<usize>>,
    /// What there is of each row, in the row's own unit (ticks, pieces, mWh).
    pub(super) there: Vec<i64>,
    /// One over the row's own units in one unit of its price.
    inverse: Vec<f64>,
    /// The greatest draw of a way, in units of the power rows' scale, at least 1.
    draw_max: f64,
}

impl Layout {
    pub(super) fn new(problem: &Problem) -> Self {
        let ticks = problem.horizon as usize;
        let curves = problem.batteries.iter().flat_map(|battery| &battery.chargers).flat_map(|charger| &charger.curve);
        let draw = curves.map(|segment| segment.draw).max().unwrap_or(1).max(1) as f64;
        let service = (problem.batteries.iter().map(|battery| battery.capacity).max().unwrap_or(1) as f64 * 0.7).max(1.0);
        let handling = problem.stations.iter().flat_map(|station| [station.load_draw, station.unload_draw, station.swap_draw]);
        let draw_max = (handling.max().unwrap_or(0) as f64 / draw).max(1.0);
        let mut layout = Self { ticks, first: vec![0], before: Vec::new(), there: Vec::new(), inverse: Vec::new(), draw_max };
        for station in &problem.stations {
            let book = Book::new(problem, station);
            // What is overdrawn already is there for nobody, and no more than that.
            layout.there.extend(book.left().into_iter().map(|left| left.max(0)));
            for row in 0..BY_TICK {
                layout.inverse.extend(std::iter::repeat_n(if row == POWER { 1.0 / draw } else { 1.0 }, ticks));
            }
            layout.inverse.extend(book.limits().iter().map(|_| 1.0 / service));
            layout.before.push(book.limits().iter().map(|limit| limit.before as usize).collect());
            layout.first.push(layout.there.len());
        }
        layout
    }

    pub(super) fn rows(&self) -> usize {
        self.there.len()
    }

    /// The prices of a station's rows as whole numbers per unit of each.
    pub(super) fn whole(&self, station: usize, prices: &[f64], unit: i64) -> Vec<i64> {
        (self.first[station]..self.first[station + 1]).map(|row| (prices[row] * self.inverse[row] * unit as f64) as i64).collect()
    }

    /// The greatest price of a row: with it everywhere, the sums over all ticks are still whole numbers
    /// of 64 bits. Prices of any height give a valid bound, so nothing is lost by the limit.
    pub(super) fn price_max(&self, unit: i64) -> f64 {
        let limits = self.before.iter().map(Vec::len).max().unwrap_or(0);
        let counted = BY_TICK * (1 + limits) * self.ticks.max(1);
        i64::MAX as f64 / (unit as f64 * counted as f64 * self.draw_max)
    }
}

/// Running sums of whole prices; entry `[row * (ticks + 1) + t]` is the sum over ticks before t.
#[derive(Debug, Clone)]
pub(super) struct Table {
    width: usize,
    sums: Vec<i64>,
    /// The price of energy of each station where it is the same in all ticks.
    flat: Vec<Option<i64>>,
    earned: i128,
}

impl Table {
    pub(super) fn new(layout: &Layout, prices: &[f64], unit: i64) -> Self {
        let (ticks, width) = (layout.ticks, layout.ticks + 1);
        let stations = layout.before.len();
        let mut sums = vec![0; stations * BY_TICK * width];
        let mut flat = vec![Some(0); stations];
        let mut earned = 0;
        let whole = |row: usize| (prices[row] * layout.inverse[row] * unit as f64) as i64;
        for station in 0..stations {
            let first = layout.first[station];
            let energy: Vec<i64> = (first + BY_TICK * ticks..layout.first[station + 1]).map(whole).collect();
            for (place, &price) in energy.iter().enumerate() {
                earned += i128::from(price) * i128::from(layout.there[first + BY_TICK * ticks + place]);
            }
            for row in 0..BY_TICK {
                let mut later: i64 = energy.iter().sum();
                let mut limits = layout.before[station].iter().zip(&energy).peekable();
                let rows = first + row * ticks..first + (row + 1) * ticks;
                // Most rows are asked for nothing: their sums stay zero.
                if prices[rows].iter().all(|&price| price == 0.0) && (row != POWER || later == 0) {
                    continue;
                }
                let out = &mut sums[(station * BY_TICK + row) * width..][..width];
                for tick in 0..ticks {
                    let at = first + row * ticks + tick;
                    let mut price = whole(at);
                    earned += i128::from(price) * i128::from(layout.there[at]);
                    if row == POWER {
                        // What is drawn in a tick also counts for every energy limit after it.
                        while let Some((_, passed)) = limits.next_if(|&(&before, _)| before <= tick) {
                            later -= passed;
                        }
                        price += later;
                        if tick == 0 {
                            flat[station] = Some(price);
                        } else if flat[station] != Some(price) {
                            flat[station] = None;
                        }
                    }
                    out[tick + 1] = out[tick] + price;
                }
            }
        }
        Self { width, sums, flat, earned }
    }

    /// What the prices bring in for all that there is.
    pub(super) fn earned(&self) -> i128 {
        self.earned
    }

    /// What a way pays for what it takes.
    #[inline]
    pub(super) fn of(&self, problem: &Problem, choices: &Choices, way: &Way) -> i64 {
        let width = self.width;
        let sums = &self.sums[usize::from(way.station) * BY_TICK * width..][..BY_TICK * width];
        let station = &problem.stations[usize::from(way.station)];
        let stretch = |row: usize, from: usize, to: usize| sums[row * width + to] - sums[row * width + from];
        let (start, end) = (usize::from(way.start), usize::from(way.end));
        let mut paid = if let Mode::Charge(_) = way.mode {
            let (load, unload) = (station.load_ticks as usize, station.unload_ticks as usize);
            stretch(BAY, start, end) + stretch(LIFT, start, start + load) + stretch(LIFT, end - unload, end)
        } else {
            stretch(SLOT, start, end) + stretch(SPARE, start, usize::from(way.ready).min(width - 1))
        };
        match self.flat[usize::from(way.station)] {
            Some(price) => paid += price * way.energy,
            None => choices.draws(way, station, problem.horizon, |from, to, draw| paid += draw * stretch(POWER, from, to)),
        }
        paid
    }
}

/// What all chosen ways ask for, as differences from tick to tick.
pub(super) struct Uses {
    width: usize,
    changes: Vec<i64>,
}

impl Uses {
    pub(super) fn new(layout: &Layout) -> Self {
        let width = layout.ticks + 1;
        Self { width, changes: vec![0; layout.before.len() * BY_TICK * width] }
    }

    pub(super) fn add(&mut self, problem: &Problem, choices: &Choices, way: &Way) {
        let width = self.width;
        let changes = &mut self.changes[usize::from(way.station) * BY_TICK * width..][..BY_TICK * width];
        let station = &problem.stations[usize::from(way.station)];
        let mut stretch = |row: usize, from: usize, to: usize, by: i64| {
            changes[row * width + from] += by;
            changes[row * width + to] -= by;
        };
        let (start, end) = (usize::from(way.start), usize::from(way.end));
        if let Mode::Charge(_) = way.mode {
            stretch(BAY, start, end, 1);
            stretch(LIFT, start, start + station.load_ticks as usize, 1);
            stretch(LIFT, end - station.unload_ticks as usize, end, 1);
        } else {
            stretch(SLOT, start, end, 1);
            stretch(SPARE, start, usize::from(way.ready).min(width - 1), 1);
        }
        choices.draws(way, station, problem.horizon, |from, to, draw| stretch(POWER, from, to, draw));
    }

    /// What is asked for beyond what there is, in units of the prices.
    pub(super) fn over(&self, layout: &Layout, over: &mut [f64]) {
        for station in 0..layout.before.len() {
            let first = layout.first[station];
            let mut drawn = vec![0; self.width];
            for row in 0..BY_TICK {
                let changes = &self.changes[(station * BY_TICK + row) * self.width..][..self.width];
                let mut asked = 0;
                for tick in 0..layout.ticks {
                    asked += changes[tick];
                    let at = first + row * layout.ticks + tick;
                    over[at] = (asked - layout.there[at]) as f64 * layout.inverse[at];
                    if row == POWER {
                        drawn[tick + 1] = drawn[tick] + asked;
                    }
                }
            }
            for (place, &before) in layout.before[station].iter().enumerate() {
                let at = first + BY_TICK * layout.ticks + place;
                over[at] = (drawn[before] - layout.there[at]) as f64 * layout.inverse[at];
            }
        }
    }
}
