//! How surely a station's packs last until a service has ended.
//!
//! The planner counts energy: what the packs give at the station's working power, less what is taken. That errs on
//! the safe side, since not every bay charges all the time and charges end gently. What is told of a plan is exact
//! where it matters: where the packs do just about, their models are stepped along the very load of the plan, and
//! the margin is how much more than that they could carry.

use energy::load::Terminals as _;
use energy::pack::Battery as _;
use energy::units::S_PER_H;
use energy::{Need, Pack, Start};
use planner::{Mode, Session};
use statrs::distribution::{ContinuousCDF, Normal};

use super::problem::StationView;
use super::solve::WHOLE_FLEET_MAX;
use super::translate::Task;

/// Margins of more standard deviations than this are as good as certain, whatever the load looks like.
const SIGMAS_MAX: f64 = 6.0;
/// Longest step of a pack along the load, s: it is left a minute before it gives out in any case.
const STEP_MAX_S: f64 = 60.0;
/// The load is scaled by no more than this, and so often halved: by less than a thousandth in the end.
const SCALE_MAX: f64 = 1.3;
const HALVINGS: u32 = 10;

/// A part of the load: from when until when (s from now), and how much (W).
type Part = (f64, f64, f64);

/// What a station's packs are asked for.
pub(super) struct Cover<'a> {
    station: &'a StationView,
    /// When each service draws, s from now, and what it takes, in order of start.
    pub(super) draws: Vec<(f64, f64, Need)>,
    /// The same as it is drawn; none in a fleet where that would take too long.
    parts: Option<Vec<Vec<Part>>>,
}

impl<'a> Cover<'a> {
    /// The services of a plan at the station of this index, in order of start.
    pub(super) fn new(task: &'a Task, index: usize, here: &[&Session]) -> Self {
        let station = &task.view.stations[index];
        let draw = |session: &&Session| {
            let [start_s, end_s] = times_s(task, session);
            (start_s, end_s, task.need(session.robot, index, session.start, session.mode))
        };
        let draws: Vec<_> = here.iter().map(draw).collect();
        let is_stepped = task.view.robots.len() <= WHOLE_FLEET_MAX && station.packs.iter().all(|pack| pack.state.is_some());
        let parts = is_stepped.then(|| here.iter().zip(&draws).map(|(session, (.., need))| parts(task, index, session, need)).collect());
        Self { station, draws, parts }
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
        needed.filter(|&by_s| by_s > 0.0).chain([until_s]).map(|by_s| self.before(by_s)).fold(1.0, f64::min)
    }

    fn before(&self, until_s: f64) -> f64 {
        let overhead = self.station.overhead_per_h.scaled(until_s.max(self.station.committed_until_s) / S_PER_H);
        let mut need = self.station.committed.plus(&overhead);
        for (start_s, end_s, draws) in self.draws.iter().filter(|(start_s, ..)| *start_s < until_s) {
            need.add(draws, ((until_s - start_s) / (end_s - start_s)).min(1.0));
        }
        let there = self.station.packs.iter().filter(|pack| pack.available_s < until_s.max(f64::MIN_POSITIVE));
        let usable = there.fold(Need::default(), |sum, pack| sum.plus(&Need::own(pack.usable_wh))).estimate();
        let need = need.estimate();
        let sigma = usable.sigma.hypot(need.sigma).max(1e-9);
        let counted_wh = usable.value - need.value;
        let margin_wh = if counted_wh.abs() > SIGMAS_MAX * sigma { counted_wh } else { self.stepped_wh(until_s).unwrap_or(counted_wh) };
        Normal::standard().cdf(margin_wh / sigma)
    }

    /// How much more than the load until then the packs could carry, Wh, below 0 if they cannot; none where that is
    /// not known, or is far from nothing.
    fn stepped_wh(&self, until_s: f64) -> Option<f64> {
        let mut load: Vec<Part> = self.parts.as_ref()?.iter().flatten().copied().collect();
        let begun_s = self.station.committed_until_s;
        if begun_s > 0.0 {
            load.push((0.0, begun_s, self.station.committed.mean_wh / begun_s * S_PER_H));
        }
        let steps = steps(&load, self.station.overhead_per_h.mean_wh, until_s);
        let energy_wh: f64 = steps.iter().map(|step| step.dt_s * step.power_w / S_PER_H).sum();
        let lasts = |scale: f64| lasts(self.station, &steps, scale);
        let (mut low, mut high) = (1.0 / SCALE_MAX, SCALE_MAX);
        if !lasts(low) || lasts(high) {
            return None;
        }
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if lasts(middle) { low = middle } else { high = middle }
        }
        Some((f64::midpoint(low, high) - 1.0) * energy_wh)
    }
}

/// Begin and end of a session, s from now.
fn times_s(task: &Task, session: &Session) -> [f64; 2] {
    [session.start, session.end].map(|tick| task.grid.time(tick).seconds_since(task.view.now))
}

/// What a service draws when: the charge as it tapers off, with the lift's part spread over all of it.
fn parts(task: &Task, index: usize, session: &Session, need: &Need) -> Vec<Part> {
    let (view, [start_s, end_s]) = (&task.view.robots[session.robot], times_s(task, session));
    let even = |from_s: f64, wh: f64| (from_s, end_s, wh / (end_s - from_s).max(1.0) * S_PER_H);
    let table = view.travel.iter().find(|(station, ..)| *station == index).map(|(.., table)| table);
    let (Some(table), Mode::Charge(_)) = (table, session.mode) else { return vec![even(start_s, need.mean_wh)] };
    let (soc, to_soc) = (task.soc_at(session.robot, session.start), task.to_soc(session.mode));
    let mut from_s = start_s + task.view.stations[index].handling.load_s;
    let mut parts = vec![even(start_s, table.lift_wh)];
    let inner = table.points.iter().map(|point| point.soc).filter(|&at| soc < at && at < to_soc);
    let levels: Vec<f64> = std::iter::once(soc).chain(inner).chain([to_soc]).collect();
    for pair in levels.windows(2) {
        let part = table.between(pair[0], pair[1]);
        let wh = part.need_wh - table.lift_wh;
        if part.charge_s > 0.0 {
            parts.push((from_s, from_s + part.charge_s, wh / part.charge_s * S_PER_H));
        }
        from_s += part.charge_s;
    }
    parts
}

/// A stretch of constant power.
#[derive(Debug, Clone, Copy)]
struct Step {
    /// How long, s.
    dt_s: f64,
    /// How much, W.
    power_w: f64,
    /// Whether some service draws.
    serves: bool,
}

/// The load, and what the station takes beside it, W, as steps.
fn steps(load: &[Part], overhead_w: f64, until_s: f64) -> Vec<Step> {
    let mut at_s: Vec<f64> =
        load.iter().flat_map(|&(from_s, to_s, _)| [from_s, to_s]).filter(|at_s| (0.0..until_s).contains(at_s)).collect();
    at_s.extend([0.0, until_s]);
    at_s.sort_by(f64::total_cmp);
    let mut steps = Vec::new();
    for pair in at_s.windows(2).filter(|pair| pair[1] - pair[0] > 1e-6) {
        let middle_s = f64::midpoint(pair[0], pair[1]);
        let here: Vec<f64> = load.iter().filter(|(from_s, to_s, _)| (*from_s..*to_s).contains(&middle_s)).map(|part| part.2).collect();
        let count = ((pair[1] - pair[0]) / STEP_MAX_S).ceil().max(1.0);
        let power_w = overhead_w + here.iter().sum::<f64>();
        let step = Step { dt_s: (pair[1] - pair[0]) / count, power_w, serves: !here.is_empty() };
        steps.extend(std::iter::repeat_n(step, count as usize));
    }
    steps
}

/// Whether the packs, one after the other, carry a load scaled by this.
fn lasts(station: &StationView, steps: &[Step], scale: f64) -> bool {
    let mut packs = station.packs.iter().filter_map(|pack| {
        let state = pack.state.as_ref()?;
        let start = Start { temperature_degc: state.temperature_degc, ..Start::at_soc(state.soc) };
        Some((pack.available_s, Pack::new(state.model.clone(), start)))
    });
    let mut at_s = 0.0;
    let mut active = packs.next();
    for &Step { dt_s, power_w, serves } in steps {
        loop {
            let Some((_, pack)) = active.as_mut().filter(|(available_s, _)| *available_s <= at_s) else {
                if serves {
                    return false;
                }
                break;
            };
            if pack.step_power(power_w * scale, dt_s).is_ok() && !pack.is_empty() {
                break;
            }
            active = packs.next();
        }
        at_s += dt_s;
    }
    true
}
