//! How single cells differ from the pack's others, and what brings them together again.

use crate::system::BatteryFacts;

/// How a cell differs from the one that the model's effects describe.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellFactors {
    /// Its capacity, times that of the others.
    pub capacity: f64,
    /// Its resistances, times those of the others. It stands for less electrode: the effects
    /// that make voltage out of current see so many times the current, so a law that bends with
    /// the current bends earlier. Heat and charge follow the true current.
    pub resistance: f64,
    /// Its state of charge at the start, beyond that of the others; it never starts above full.
    pub soc_offset: f64,
    /// The charge that is lost inside it, times that of the others.
    pub self_discharge: f64,
}

impl Default for CellFactors {
    fn default() -> Self {
        Self { capacity: 1.0, resistance: 1.0, soc_offset: 0.0, self_discharge: 1.0 }
    }
}

impl CellFactors {
    /// State of charge that this cell starts from when the others start from `soc`.
    #[must_use]
    pub fn starts_at(&self, soc: f64) -> f64 {
        (soc + self.soc_offset).min(soc.max(1.0))
    }
}

/// A cell, or a group of parallel cells, that differs from the others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct UnlikeCell {
    /// Its group in series, counted from 0.
    pub series: u32,
    /// Its place in the group, counted from 0; none for all of the group.
    pub parallel: Option<u32>,
    /// How it differs.
    pub factors: CellFactors,
}

/// Passive balancing: a resistor beside each group of parallel cells, switched on by what the
/// pack's electronics measured at the end of the step before.
///
/// A group is bypassed while the pack charges (or rests, if so wished), when its voltage is at
/// least `start_v` and more than `difference_v` above that of the lowest group.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Balancing {
    /// Current past a group of cells, A: the most that resistor and duty cycle allow on average.
    pub bypass_a_max: f64,
    /// Cell voltage from which on there is balancing, V.
    pub start_v: f64,
    /// Difference from the lowest cell beyond which a cell is bypassed, V.
    pub difference_v: f64,
    /// Whether cells are also bypassed while no current flows.
    pub at_rest: bool,
}

impl BatteryFacts {
    /// How the cell at that place (counted from 0) differs from the pack's others.
    #[must_use]
    pub fn factors(&self, series: u32, parallel: u32) -> CellFactors {
        let here = |cell: &&UnlikeCell| cell.series == series && cell.parallel.is_none_or(|own| own == parallel);
        self.unlike.iter().find(here).map_or_else(CellFactors::default, |cell| cell.factors)
    }

    /// Whether no cell differs from the others.
    #[must_use]
    pub fn all_alike(&self) -> bool {
        self.unlike.iter().all(|cell| cell.factors == CellFactors::default())
    }

    /// Facts of `count` like cells in parallel out of this pack.
    #[must_use]
    pub(crate) fn part(&self, count: u32, cell: CellFactors) -> BatteryFacts {
        let share = f64::from(count) / f64::from(self.parallel);
        BatteryFacts {
            series: 1,
            parallel: count,
            capacity_ah: self.capacity_ah * share * cell.capacity,
            cell,
            unlike: Vec::new(),
            balancing: None,
            ..self.clone()
        }
    }
}
