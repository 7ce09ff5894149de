//! Spares by who takes them: what goes into the same robots is of one kind to a plan, whatever it is called.

use super::problem::{RobotView, SpareView, StationView, View};

/// Spares that hold so much less than the fullest of their kind are handed out later: a plan takes all for as full as the last one.
const ALIKE_SOC: f64 = 0.1;

/// The kinds of all stations' spares, as a plan tells them apart.
#[derive(Debug, Clone)]
pub struct Racks {
    /// By station and by the view's kind.
    kinds: Vec<Vec<u16>>,
}

impl Racks {
    /// Of the stations of a view, for its robots.
    #[must_use]
    pub fn new(view: &View) -> Self {
        let of = |(index, station): (usize, &StationView)| {
            let count = station.spares.iter().map(|spare| spare.kind + 1).max().unwrap_or(0);
            let is_here = |robot: &&RobotView| robot.travel.iter().any(|(there, ..)| *there == index);
            let here: Vec<&RobotView> = if count > 1 { view.robots.iter().filter(is_here).collect() } else { Vec::new() };
            let mut known: Vec<Vec<bool>> = Vec::new();
            let mut place = |kind: usize| {
                let takers: Vec<bool> = here.iter().map(|robot| robot.takes(index, kind)).collect();
                let place = known.iter().position(|other| *other == takers).unwrap_or(known.len());
                if place == known.len() {
                    known.push(takers);
                }
                place as u16
            };
            (0..count).map(&mut place).collect()
        };
        Self { kinds: view.stations.iter().enumerate().map(of).collect() }
    }

    /// The kind of a spare at a station.
    #[must_use]
    pub fn kind(&self, station: usize, spare: &SpareView) -> u16 {
        self.kinds[station][spare.kind]
    }

    /// The kind of spares that a robot is given at a station: of those that go into it the one with the fullest. None where
    /// no spare does.
    #[must_use]
    pub fn given(&self, view: &View, robot: &RobotView, station: usize) -> Option<u16> {
        let fitting = view.stations[station].spares.iter().filter(|spare| robot.takes(station, spare.kind));
        let fullest = fitting.max_by(|a, b| a.soc.total_cmp(&b.soc).then(b.kind.cmp(&a.kind)))?;
        Some(self.kind(station, fullest))
    }

    /// Spares of a kind that are handed out next: the fullest, and those that hold nearly as much.
    pub(super) fn next<'a>(&'a self, view: &'a View, station: usize, kind: u16) -> impl Iterator<Item = &'a SpareView> {
        let own = move || view.stations[station].spares.iter().filter(move |spare| self.kind(station, spare) == kind);
        let fullest = own().map(|spare| spare.soc).fold(0.0, f64::max);
        own().filter(move |spare| spare.soc >= fullest - ALIKE_SOC)
    }

    /// The same of all kinds.
    pub(super) fn all_next<'a>(&'a self, view: &'a View, station: usize) -> impl Iterator<Item = (u16, &'a SpareView)> {
        let kinds = self.kinds[station].iter().map(|kind| kind + 1).max().unwrap_or(0);
        (0..kinds).flat_map(move |kind| self.next(view, station, kind).map(move |spare| (kind, spare)))
    }
}
