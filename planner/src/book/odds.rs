//! Whether a station's packs hold what is promised with the probability that is asked for.

use crate::problem::{Chance, Station, Tick};
use crate::way::{Choices, Way};

/// What is promised of the energy of a station whose packs are not known for certain.
#[derive(Debug, Clone)]
pub(super) struct Odds<'p> {
    chance: &'p Chance,
    /// What the packs hold, less what services that have begun take.
    held: i64,
    /// What the services in the book take.
    taken: i64,
    /// Variance of that which is their own, units². Whole, so that what is struck out leaves no trace.
    variance: i64,
    /// Services that were not promised before.
    new: u32,
    /// How many services end in each tick.
    ends: Vec<u16>,
    /// When the last service ends, of those that had begun too.
    last: Tick,
    /// The same without those in the book.
    last_begun: Tick,
}

impl<'p> Odds<'p> {
    pub(super) fn new(chance: &'p Chance, station: &Station, horizon: Tick) -> Self {
        let held = station.packs.iter().map(|pack| pack.usable().max(0)).sum::<i64>() - chance.begun;
        let last = station.ongoing.iter().map(|ongoing| ongoing.until).max().unwrap_or(0);
        Self { chance, held, taken: 0, variance: 0, new: 0, ends: vec![0; horizon as usize + 1], last, last_begun: last }
    }

    /// What is missing if this way is promised too; 0 or less when there is enough.
    pub(super) fn short(&self, choices: &Choices, way: &Way) -> i64 {
        let last = self.last.max(Tick::from(way.end));
        let (spare, sigma) = self.with(last, self.taken + way.energy, self.variance + way.variance as i64);
        let quantile = if self.new == 0 && choices.held { self.chance.quantile_held } else { self.chance.quantile };
        (quantile * sigma).ceil() as i64 - spare
    }

    pub(super) fn margin(&self) -> (i64, f64) {
        self.with(self.last, self.taken, self.variance)
    }

    fn with(&self, last: Tick, taken: i64, variance: i64) -> (i64, f64) {
        let spare = self.held - taken - i64::from(last) * self.chance.hotel;
        (spare, self.chance.sigma(last, taken, variance as f64))
    }

    pub(super) fn change(&mut self, choices: &Choices, way: &Way, sign: i32) {
        // What the book takes falls by a negative sign of what is left.
        let sign = i64::from(-sign);
        self.taken += sign * way.energy;
        self.variance += sign * way.variance as i64;
        let end = usize::from(way.end);
        if sign > 0 {
            self.ends[end] += 1;
            self.new += u32::from(!choices.held);
            self.last = self.last.max(Tick::from(way.end));
            return;
        }
        self.ends[end] -= 1;
        self.new -= u32::from(!choices.held);
        while self.last > self.last_begun && self.ends.get(self.last as usize).is_none_or(|&ends| ends == 0) {
            self.last -= 1;
        }
    }
}
