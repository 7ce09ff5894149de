//! How surely a station's packs last until a service has ended.
//!
//! The planner counts energy: what the packs give at the station's working power, less what is taken. That errs on
//! the safe side, since not every bay charges all the time and charges end gently. What is told of a plan is exact
//! where it matters: where the packs do just about, their models are stepped along the very load of the plan, and
//! the margin is how much more than that they could carry. Whoever is left out for want of energy is asked about once more
//! with what was not counted (`again.rs`).

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};

use energy::units::S_PER_H;
use energy::{Estimate, Need};
use planner::{Mode, Session};
use statrs::distribution::{ContinuousCDF, Normal};

use super::carry::{Load, Part, SIGMAS_MAX};
use super::charging::Course;
use super::effort::WHOLE_FLEET_MAX;
use super::problem::{PackView, StationView};
use super::recharging::Recharging;
use super::translate::Task;

/// What a station's packs are asked for.
pub(super) struct Cover<'a> {
    station: &'a StationView,
    /// When each service draws, s from now, and what it takes, in order of start.
    draws: Vec<(f64, f64, Need)>,
    /// What charging the packs takes that they leave.
    recharging: Vec<Option<Recharging>>,
    /// The same as it is drawn; none in a fleet where that would take too long.
    parts: Option<Vec<Vec<Part>>>,
    /// Whether robots with unlike batteries come: then the packs' energy was counted at their mean power, and counting errs on no side.
    is_mixed: bool,
    /// What was found so far, by when (bits of s).
    known: RefCell<BTreeMap<u64, f64>>,
}

impl<'a> Cover<'a> {
    /// The services of a plan at the station of this index, in order of start.
    pub(super) fn new(task: &'a Task, index: usize, here: &[&Session]) -> Self {
        let station = &task.view.stations[index];
        let draw = |session: &&Session| {
            let [start_s, end_s] = times_s(task, session);
            let need = |mode: Mode| task.need(session.robot, index, session.start, mode);
            // Also where the plan does not count on it, the station charges what robots leave.
            let (need, left) = match task.charge_after(session) {
                Some(charge) => Recharging::split(&need(Mode::SwapAndRecharge), charge, end_s),
                None => (need(session.mode), None),
            };
            ((start_s, end_s, need), left)
        };
        let (draws, recharging): (Vec<_>, Vec<_>) = here.iter().map(draw).unzip();
        let is_stepped = task.view.robots.len() <= WHOLE_FLEET_MAX;
        let parts = is_stepped.then(|| here.iter().zip(&draws).map(|(session, (.., need))| parts(task, index, session, need)).collect());
        let coming = task.view.robots.iter().filter(|robot| robot.way(index).is_some()).map(|robot| &robot.battery.name);
        let is_mixed = coming.collect::<BTreeSet<_>>().len() > 1;
        Self { station, draws, recharging, parts, is_mixed, known: RefCell::default() }
    }

    /// Probability that the packs last until then: a service that ends with others beside it is as sure as they are,
    /// for when the packs give out, all of them end. A pack that is brought later pays for nothing before; while
    /// no service draws, the station may go dark until it comes.
    pub(super) fn until(&self, until_s: f64) -> f64 {
        let comes = self.station.packs.iter().map(|pack| pack.available_s).filter(|&from_s| 0.0 < from_s && from_s < until_s);
        let needed = comes.map(|from_s| {
            let ends = self.draws.iter().filter(|(start_s, ..)| *start_s < from_s).map(|(_, end_s, _)| *end_s);
            ends.fold(self.station.committed_until_s, f64::max).min(from_s)
        });
        // What comes all the time pays for nothing before either.
        let is_refilled = self.station.packs.iter().any(|pack| pack.refill().levels().next().is_some());
        let ends = self.draws.iter().map(|(_, end_s, _)| *end_s).filter(|&end_s| is_refilled && end_s < until_s);
        needed.chain(ends).filter(|&by_s| by_s > 0.0).chain([until_s]).map(|by_s| self.known_before(by_s)).fold(1.0, f64::min)
    }

    /// Every service asks for the ends of all before it.
    fn known_before(&self, until_s: f64) -> f64 {
        let known = self.known.borrow().get(&until_s.to_bits()).copied();
        known.unwrap_or_else(|| {
            let found = self.before(until_s);
            self.known.borrow_mut().insert(until_s.to_bits(), found);
            found
        })
    }

    fn before(&self, until_s: f64) -> f64 {
        let overhead = self.station.overhead_per_h.scaled(until_s.max(self.station.committed_until_s) / S_PER_H);
        let mut need = self.station.committed.plus(&overhead);
        for (start_s, end_s, draws) in self.draws.iter().filter(|(start_s, ..)| *start_s < until_s) {
            need.add(draws, ((until_s - start_s) / (end_s - start_s)).min(1.0));
        }
        for charged in self.recharging.iter().flatten().chain(&self.station.recharging) {
            need.add(&charged.by(until_s), 1.0);
        }
        let there = self.station.packs.iter().filter(|pack| pack.available_s < until_s.max(f64::MIN_POSITIVE));
        let counts_more = there.clone().any(|pack| pack.uncounted_wh > 0.0);
        let by = |pack: &PackView| Need::own(Estimate::new(pack.before_wh(until_s), pack.usable_wh.sigma));
        let usable = there.fold(Need::default(), |sum, pack| sum.plus(&by(pack))).estimate();
        let need = need.estimate();
        let sigma = usable.sigma.hypot(need.sigma).max(1e-9);
        let counted_wh = usable.value - need.value;
        // What was seen along one load need not be there for another: then counting no longer errs on the safe side.
        let is_close = counts_more || self.is_mixed || counted_wh.abs() <= SIGMAS_MAX * sigma;
        let margin_wh = if is_close { self.stepped_wh(until_s, sigma).unwrap_or(counted_wh) } else { counted_wh };
        Normal::standard().cdf(margin_wh / sigma)
    }

    /// How much more than the load until then the packs could carry, Wh, below 0 if they cannot; none where that is
    /// not known.
    fn stepped_wh(&self, until_s: f64, sigma_wh: f64) -> Option<f64> {
        let parts = self.load()?;
        let load = Load { parts: &parts, overhead_w: self.station.overhead_per_h.mean_wh, overhead_from_s: 0.0, until_s };
        let packs: Option<Vec<_>> = self.station.packs.iter().map(|pack| Some((pack.available_s, pack.state.as_ref()?))).collect();
        Some(load.spare_wh(&packs?, sigma_wh))
    }

    /// How much more than was counted the packs that are there give if the load goes on as it is, Wh; none where that is
    /// not known.
    pub(super) fn uncounted_wh(&self) -> Option<f64> {
        let parts = self.load()?;
        let until_s = parts.iter().map(|part| part.1).fold(self.station.committed_until_s.max(0.0), f64::max);
        let is_there = |pack: &PackView| pack.available_s <= 0.0;
        let load = Load { parts: &parts, overhead_w: self.station.overhead_per_h.mean_wh, overhead_from_s: 0.0, until_s };
        let counted_wh: f64 = self.station.packs.iter().filter(|pack| is_there(pack)).map(|pack| pack.usable_wh.value).sum();
        // What comes into them from outside is counted apart.
        let now: Option<Vec<_>> = self
            .station
            .packs
            .iter()
            .filter(|pack| is_there(pack))
            .map(|pack| Some((pack.available_s, pack.state.as_ref()?.now())))
            .collect();
        let now = now?;
        let packs: Vec<_> = now.iter().map(|(from_s, state)| (*from_s, state)).collect();
        Some(load.given_wh(&packs) - counted_wh)
    }

    /// All that services draw, also those that have begun.
    fn load(&self) -> Option<Vec<Part>> {
        let mut parts: Vec<Part> = self.parts.as_ref()?.iter().flatten().copied().collect();
        parts.extend(self.recharging.iter().flatten().map(Recharging::part));
        parts.extend(self.station.begun_parts());
        Some(parts)
    }
}

/// Begin and end of a session, s from now.
fn times_s(task: &Task, session: &Session) -> [f64; 2] {
    [session.start, session.end].map(|tick| task.grid.time(tick).seconds_since(task.view.now))
}

/// What a service draws when.
fn parts(task: &Task, index: usize, session: &Session, need: &Need) -> Vec<Part> {
    let (view, [start_s, end_s]) = (&task.view.robots[session.robot], times_s(task, session));
    let table = view.way(index).map(|way| &way.table);
    let course = match (table, session.mode) {
        (Some(table), Mode::Charge(_)) => {
            let handling = &task.view.stations[index].handling;
            Course::charge(table, task.soc_at(session.robot, index, session.start), task.to_soc(session.mode), handling.load_s)
        }
        _ => Course { even_wh: need.mean_wh, charge: Vec::new(), charge_from_s: 0.0 },
    };
    course.parts(start_s, end_s)
}
