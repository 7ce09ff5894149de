//! What a service takes of all that its station has: a price where what is scarce counts, not work.

use crate::book::Book;
use crate::problem::Problem;
use crate::way::{Mode, Way};

/// What ways take of all that their stations have.
#[derive(Debug)]
pub(crate) struct Thrift {
    /// Bay ticks, lift ticks, spares and energy of each station.
    there: Vec<[f64; 4]>,
    horizon: f64,
}

impl Thrift {
    pub(crate) fn new(problem: &Problem) -> Self {
        let there = problem.stations.iter().map(|station| Book::new(problem, station).plenty()).collect();
        Self { there, horizon: f64::from(problem.horizon) }
    }

    /// Thousandths, of bays, lift or spares and of energy together.
    pub(crate) fn of(&self, way: &Way) -> i32 {
        let [bays, lift, spares, energy] = self.there[usize::from(way.station)];
        let place = match way.mode {
            Mode::Charge(_) => f64::from(way.end - way.start) / bays + 2.0 / lift,
            Mode::Swap => 0.25 / spares,
            // The spare comes back.
            Mode::SwapAndRecharge => 0.25 / spares * f64::from(way.ready - way.start) / self.horizon,
        };
        (1e3 * (place + way.energy as f64 / energy)).min(1e6) as i32 + 1
    }
}
