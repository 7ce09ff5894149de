//! Charged spares of a station that nobody was promised, by kind: whom one does not fit gains nothing by it.

use super::counters::Counters;
use crate::bits::Bits;
use crate::problem::{Station, Tick};

/// What is left of each kind in each tick.
#[derive(Debug, Clone)]
pub(super) struct Rack {
    /// By kind; of one kind at least.
    kinds: Vec<Counters>,
}

impl Rack {
    pub(super) fn new(station: &Station, horizon: Tick) -> Self {
        let ticks = horizon as usize;
        let none = Counters::new(ticks, 0, station.spares.len() + station.ongoing.len());
        let mut kinds = vec![none; station.kinds_of_spares().max(1)];
        for spare in station.spares.iter().filter(|spare| spare.ready < horizon) {
            kinds[usize::from(spare.kind)].change(spare.ready as usize, ticks, 1);
        }
        Self { kinds }
    }

    /// How many kinds there are.
    pub(super) fn len(&self) -> usize {
        self.kinds.len()
    }

    /// One more (`1`) or one less (`-1`) of a kind in these ticks.
    pub(super) fn change(&mut self, kind: u16, from: usize, to: usize, by: i32) {
        self.kinds[usize::from(kind)].change(from, to, by);
    }

    /// The ticks in which nothing is left of a kind.
    pub(super) fn none(&self, kind: u16) -> &Bits {
        self.kinds[usize::from(kind)].none()
    }

    /// The same of all kinds, in order.
    pub(super) fn all_none(&self) -> impl Iterator<Item = &Bits> {
        self.kinds.iter().map(Counters::none)
    }

    /// What is left in a tick, of all kinds together.
    pub(super) fn left_at(&self, tick: usize) -> i64 {
        self.kinds.iter().map(|kind| kind.left_at(tick)).sum()
    }

    /// Tells in words how many are left from a tick on, kind by kind.
    pub(super) fn from(&self, tick: usize, mut tell: impl FnMut(u64)) {
        self.kinds.iter().for_each(|kind| kind.from(tick, &mut tell));
    }
}
