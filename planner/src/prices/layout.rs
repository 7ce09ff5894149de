//! Where the price of what stands, and how much of it there is.

use std::ops::Range;

use super::crowd::{Counted, Crowd};
use crate::book::Book;
use crate::way::{SHARED_MIN, Ways};

/// Bays, lift, slot, spares, power: so many rows have one entry per tick.
pub(super) const BY_TICK: usize = 5;
pub(super) const BAY: usize = 0;
pub(super) const LIFT: usize = 1;
pub(super) const SLOT: usize = 2;
pub(super) const SPARE: usize = 3;
pub(super) const POWER: usize = 4;
/// The row of those who draw most at a time, which has one entry per tick too but stands behind the others.
pub(super) const CROWD: usize = 5;
/// So many rows of a large fleet are gone through on two threads; 1,000 robots have 27,000. Until that was so, a tenth of their time was
/// one thread's. Two robots that are planned for a day may have as many, and waking a thread for each step takes longer than the step.
const SHARED_ROWS_MIN: usize = 16_384;

/// Which row stands where, and how much of everything there is.
///
/// Rows are scaled so that one unit is about what one service takes of them: prices of bays and
/// of energy then move at the same pace.
#[derive(Debug)]
pub(super) struct Layout {
    pub(super) ticks: usize,
    /// Ticks in which any way asks for anything: rows of others have no price.
    pub(super) asked: Range<usize>,
    /// First row of each station, and the end.
    pub(super) first: Vec<usize>,
    /// For each station the ticks before which energy is limited.
    pub(super) before: Vec<Vec<usize>>,
    /// What there is of each row, in the row's own unit (ticks, pieces, mWh).
    pub(super) there: Vec<i64>,
    /// One over the row's own units in one unit of its price.
    pub(super) inverse: Vec<f64>,
    /// The greatest draw of a way, in units of the power rows' scale, at least 1.
    draw_max: f64,
    /// Ticks on the lift before and after a charge, and for an exchange, at each station.
    pub(super) handling: Vec<[usize; 3]>,
    crowds: Vec<Crowd>,
    is_large_fleet: bool,
}

impl Layout {
    /// Rows of ticks in which no way asks for anything, but for those of crowds, which have their prices in all.
    pub(super) fn unasked(&self) -> Vec<usize> {
        let ticks = || (0..self.asked.start).chain(self.asked.end..self.ticks);
        let rows = self.first.iter().take(self.before.len()).flat_map(|first| (0..BY_TICK).map(move |row| first + row * self.ticks));
        rows.flat_map(|row| ticks().map(move |tick| row + tick)).collect()
    }

    pub(super) fn new(ways: &Ways<'_>) -> Self {
        let problem = ways.problem();
        let ticks = problem.horizon as usize;
        let curves = problem.batteries.iter().flat_map(|battery| &battery.chargers).flat_map(|charger| &charger.curve);
        let draw = curves.map(|segment| segment.draw).max().unwrap_or(1).max(1) as f64;
        let service = (problem.batteries.iter().map(|battery| battery.capacity).max().unwrap_or(1) as f64 * 0.7).max(1.0);
        let handling = problem.stations.iter().flat_map(|station| [station.load_draw, station.unload_draw, station.swap_draw]);
        let draw_max = (handling.max().unwrap_or(0) as f64 / draw).max(1.0);
        let mut layout = Self {
            ticks,
            asked: asked(ways),
            first: vec![0],
            before: Vec::new(),
            there: Vec::new(),
            inverse: Vec::new(),
            draw_max,
            handling: Vec::new(),
            crowds: Vec::new(),
            is_large_fleet: problem.robots.len() >= SHARED_MIN,
        };
        for station in &problem.stations {
            let book = Book::new(problem, station);
            // What is overdrawn already is there for nobody, and no more than that.
            layout.there.extend(book.left().into_iter().map(|left| left.max(0)));
            for row in 0..BY_TICK {
                layout.inverse.extend(std::iter::repeat_n(if row == POWER { 1.0 / draw } else { 1.0 }, ticks));
            }
            layout.inverse.extend(book.limits().iter().map(|_| 1.0 / service));
            let left = book.left();
            let rows = |row: usize| &left[row * ticks..][..ticks];
            let crowd = Crowd::new(problem, station, [BAY, LIFT, SLOT, SPARE, POWER].map(rows));
            layout.there.extend(&crowd.there);
            layout.inverse.extend(crowd.there.iter().map(|_| 1.0));
            layout.crowds.push(crowd);
            layout.before.push(book.limits().iter().map(|limit| limit.before as usize).collect());
            layout.first.push(layout.there.len());
            layout.handling.push([station.load_ticks, station.unload_ticks, station.swap_ticks].map(|ticks| ticks as usize));
        }
        layout
    }

    /// Rows that may have a price.
    pub(super) fn priced(&self) -> impl Iterator<Item = Range<usize>> + '_ {
        let ticks = move |first: usize| first + self.asked.start..first + self.asked.end;
        (0..self.before.len()).flat_map(move |station| {
            let (first, crowd, end) = (self.first[station], self.crowd(station), self.first[station + 1]);
            let by_tick = (0..BY_TICK).map(move |row| ticks(first + row * self.ticks));
            let crowded = if crowd == end { 0..0 } else { ticks(crowd) };
            by_tick.chain([first + BY_TICK * self.ticks..crowd, crowded])
        })
    }

    /// The first row of a station's crowd.
    pub(super) fn crowd(&self, station: usize) -> usize {
        self.first[station + 1] - self.crowds[station].there.len()
    }

    /// Who is in each station's crowd.
    pub(super) fn crowded(&self) -> Vec<Counted> {
        self.crowds.iter().map(|crowd| crowd.counted).collect()
    }

    /// The most there can be of a station's crowd in each tick; empty when nobody is counted.
    pub(super) fn crowd_there(&self, station: usize) -> &[i64] {
        &self.crowds[station].there
    }

    /// How much there is of each row of a station.
    pub(super) fn there(&self, station: usize) -> &[i64] {
        &self.there[self.first[station]..self.first[station + 1]]
    }

    pub(super) fn rows(&self) -> usize {
        self.there.len()
    }

    /// Whether one thread goes through all rows before others have begun.
    pub(super) fn is_small(&self) -> bool {
        !self.is_large_fleet || self.rows() < SHARED_ROWS_MIN
    }

    /// The prices of a station's rows as whole numbers per unit of each.
    pub(super) fn whole(&self, station: usize, prices: &[f64], unit: i64) -> Vec<i64> {
        (self.first[station]..self.first[station + 1]).map(|row| (prices[row] * self.inverse[row] * unit as f64) as i64).collect()
    }

    /// The greatest price of a row: with it everywhere, the sums over all ticks are still whole numbers
    /// of 64 bits. Prices of any height give a valid bound, so nothing is lost by the limit.
    pub(super) fn price_max(&self, unit: i64) -> f64 {
        let limits = self.before.iter().map(Vec::len).max().unwrap_or(0);
        // One of the crowd may count twice.
        let counted = (BY_TICK + 2) * (1 + limits) * self.ticks.max(1);
        i64::MAX as f64 / (unit as f64 * counted as f64 * self.draw_max)
    }
}

/// From the first tick in which any way begins to the last in which one draws or is to give a spare back; nil where there is no way.
fn asked(ways: &Ways<'_>) -> Range<usize> {
    let horizon = ways.problem().horizon as usize;
    let all = (0..ways.problem().robots.len()).flat_map(|robot| &ways.of(robot).ways);
    let ends = all.map(|way| (usize::from(way.start), usize::from(if way.charges() { way.end } else { way.end.max(way.ready) })));
    let span = ends.reduce(|span, way| (span.0.min(way.0), span.1.max(way.1)));
    span.map_or(0..0, |(from, to)| from..to.min(horizon))
}
