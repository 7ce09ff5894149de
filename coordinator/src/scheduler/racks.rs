//! Spares by who takes them: what goes into the same robots is of one kind to a plan, whatever it is called.

use super::problem::{RobotView, SpareView, StationView, View};

/// A plan takes all spares of a kind that are handed out next for as full as the emptiest of them. One that holds so much less (of its
/// charge) than another that is ready no later would make all of them look that empty. It waits for its turn, unless it holds as much as
/// spares that are charged again.
pub(crate) const ALIKE_SOC: f64 = 0.1;

/// The kinds of all stations' spares, as a plan tells them apart.
#[derive(Debug, Clone)]
pub struct Racks {
    /// By station and by the view's kind.
    kinds: Vec<Vec<u16>>,
    /// How many robots take each kind, by station.
    takers: Vec<Vec<usize>>,
}

impl Racks {
    /// Of the stations of a view, for its robots.
    #[must_use]
    pub fn new(view: &View) -> Self {
        let of = |(index, station): (usize, &StationView)| {
            let count = station.spares.iter().map(|spare| spare.kind + 1).max().unwrap_or(0);
            let is_here = |robot: &&RobotView| robot.way(index).is_some();
            // Where there is one kind, it does not matter who takes it.
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
            let kinds: Vec<u16> = (0..count).map(&mut place).collect();
            (kinds, known.iter().map(|takers| takers.iter().filter(|takes| **takes).count()).collect::<Vec<usize>>())
        };
        let (kinds, takers) = view.stations.iter().enumerate().map(of).unzip();
        Self { kinds, takers }
    }

    /// The kind of a spare at a station.
    #[must_use]
    pub fn kind(&self, station: usize, spare: &SpareView) -> u16 {
        self.kinds[station][spare.kind]
    }

    /// The kind of spares that a robot is given at a station: of those that go into it, and of which one is there now if any is, the
    /// one that goes into the fewest others, then the one with the fullest. None where no spare goes into it.
    #[must_use]
    pub fn given(&self, view: &View, robot: &RobotView, station: usize) -> Option<u16> {
        let fitting = view.stations[station].spares.iter().filter(|spare| robot.takes(station, spare.kind));
        let fitting = fitting.map(|spare| (self.kind(station, spare), spare));
        let best = fitting.min_by(|(one, a), (other, b)| {
            let key = |kind: u16, spare: &SpareView| (spare.ready_s > 0.0, self.takers[station][usize::from(kind)]);
            key(*one, a).cmp(&key(*other, b)).then(b.soc.total_cmp(&a.soc)).then(one.cmp(other))
        });
        best.map(|(kind, _)| kind)
    }

    /// Whether a station has spares of more than one kind.
    pub fn are_several(&self, station: usize) -> bool {
        self.kinds[station].iter().any(|kind| *kind > 0)
    }

    /// The view's kinds that are this one to a plan.
    pub fn alike(&self, station: usize, kind: u16) -> impl Iterator<Item = usize> + '_ {
        self.kinds[station].iter().enumerate().filter(move |(_, known)| **known == kind).map(|(known, _)| known)
    }

    /// Spares of a kind that are handed out next: those that hold as much as any that is charged again, or beside which none is ready that
    /// holds much more.
    pub(super) fn next<'a>(&'a self, view: &'a View, station: usize, kind: u16) -> impl Iterator<Item = &'a SpareView> {
        let own = move || view.stations[station].spares.iter().filter(move |spare| self.kind(station, spare) == kind);
        let is_behind = move |spare: &SpareView| own().any(|other| other.ready_s <= spare.ready_s && other.soc - ALIKE_SOC > spare.soc);
        own().filter(move |spare| spare.soc >= view.stations[station].ready_soc || !is_behind(spare))
    }

    /// The same of all kinds.
    pub(super) fn all_next<'a>(&'a self, view: &'a View, station: usize) -> impl Iterator<Item = (u16, &'a SpareView)> {
        let kinds = self.kinds[station].iter().map(|kind| kind + 1).max().unwrap_or(0);
        (0..kinds).flat_map(move |kind| self.next(view, station, kind).map(move |spare| (kind, spare)))
    }
}
