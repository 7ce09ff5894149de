//! Spares: which can be handed out and when, and what those take that are still charged.

use std::collections::BTreeSet;
use std::sync::Arc;

use energy::{Estimate, Model, Need};
use proto::{RobotId, RobotState, SpareId, SpareState, StationId, StationState};

use super::Basis;
use crate::fleet::Station;
use crate::models::{StationModels, from_wire};
use crate::scheduler::charging::Table;
use crate::scheduler::translate::HORIZON_MAX_S;
use crate::scheduler::{ALIKE_SOC, Planned, Recharging, SpareView, StationView};
use crate::service_run::{How, ServiceRun, Stage};
use crate::watch::Subject;

/// A spare that should have been charged by now, and is not, is expected once more as long from now as it is late already: what is hardly
/// late comes soon, and what is very late does not. It is not expected earlier than this, s.
const LATE_S: f64 = 60.0;

/// What is left of the charge of a pack that a robot left.
struct Left {
    /// When it is a spare again, s.
    until_s: f64,
    /// What the station's packs still give for it; none where they do not.
    need: Option<Need>,
}

impl Basis<'_> {
    /// Spares that can be handed out, now or when they are charged again.
    pub(super) fn spares(
        &self,
        view: &mut StationView,
        models: &StationModels,
        station: &Station,
        state: &StationState,
        here: &[&ServiceRun],
    ) {
        let kinds = self.kinds_of_spares(models, state);
        for spare in &state.spares {
            let taker = here.iter().find(|run| run.how.spare() == Some(&spare.spare));
            // While it is handed out, a station may still speak of the spare.
            let is_charged = !spare.ready && taker.is_none_or(|run| run.under_way());
            let left = is_charged.then(|| self.left(&view.station, models, station, state, spare));
            let ready_s = left.as_ref().map_or(0.0, |left| left.until_s);
            let still = left.and_then(|left| left.need);
            view.recharging.extend(still.map(|need| Recharging { from_s: 0.0, until_s: ready_s, need }));
            let (ready_s, soc) = if let Some(run) = taker {
                // The pack that its robot leaves takes its place.
                let gauged = || self.fleet.robots.get(&run.robot)?.gauge.as_ref().map(|gauge| from_wire(gauge.soc));
                let soc = run.hands_over.or_else(gauged).unwrap_or(Estimate::exact(0.0));
                let from_s = self.ends_s(run);
                let (charge_s, need) = self.whole(&view.station, models, state, spare, soc);
                view.recharging.extend(need.map(|need| Recharging { from_s, until_s: from_s + charge_s, need }));
                (from_s + charge_s, view.ready_soc)
            } else if spare.ready {
                (0.0, spare.soc.value)
            } else {
                (ready_s, view.ready_soc)
            };
            // A spare at the level at which robots want a service is none.
            let charged = spare.soc.value > self.settings.serve_below_soc;
            if (ready_s == 0.0 && charged) || (ready_s > 0.0 && ready_s < HORIZON_MAX_S && view.charges_spares) {
                let kind = self.place_of(&kinds, models, spare);
                view.spares.push(SpareView { spare: spare.spare.clone(), soc, ready_s, kind });
            }
        }
    }

    /// When a spare can be handed out, s; 0 for now, and for one that nobody knows.
    pub(super) fn ready_s(&self, id: &StationId, spare: &SpareId) -> f64 {
        let known = self.models.stations.get(id).zip(self.fleet.stations.get(id)).and_then(|(models, station)| {
            let state = station.known()?;
            let spare = state.spares.iter().find(|known| known.spare == *spare && !known.ready)?;
            Some(self.left(id, models, station, state, spare).until_s)
        });
        known.unwrap_or(0.0)
    }

    /// The spares of a station that are ready and go into a robot.
    pub(crate) fn ready_spares(&self, station: &StationId, robot: &RobotId, state: &RobotState) -> Vec<SpareId> {
        let known = self.models.stations.get(station).zip(self.fleet.stations.get(station).and_then(Station::known));
        let (Some((models, there)), Some(battery)) = (known, self.models.battery(robot, &state.battery)) else { return Vec::new() };
        let is_charged = |spare: &&SpareState| spare.ready && spare.soc.value > self.settings.serve_below_soc;
        let fits = |spare: &&SpareState| self.kind_of(models, spare).fits(&state.battery, battery);
        there.spares.iter().filter(is_charged).filter(fits).map(|spare| spare.spare.clone()).collect()
    }

    /// A spare that a robot at a station is given, when its time has come, in place of its own which is still charged: one that is ready and
    /// goes into it, and that nobody is given before its own is ready; best one that nobody was promised.
    pub(crate) fn ready_instead(&self, run: &ServiceRun, robot: &RobotState) -> Option<SpareId> {
        let own = run.how.spare().filter(|_| run.stage == Stage::Waiting && self.now >= run.start)?;
        let (models, station) = (self.models.stations.get(&run.station)?, self.fleet.stations.get(&run.station)?.known()?);
        let known = |id: &SpareId| station.spares.iter().find(|spare| spare.spare == *id);
        if known(own).is_some_and(|spare| spare.ready) {
            return None;
        }
        let ready_s = if known(own).is_some() { self.ready_s(&run.station, own) } else { f64::INFINITY };
        if ready_s <= self.settings.deadline_s {
            return None;
        }
        let is_taken = |id: &SpareId| self.running.values().any(|other| other.station == run.station && other.how.spare() == Some(id));
        let promised = |id: &SpareId| self.planned.iter().find(|other| other.station == run.station && other.spare.as_ref() == Some(id));
        // Who was promised it gets the other one.
        let is_alike = |id: &SpareId| {
            let kinds = known(own).zip(known(id)).map(|(own, other)| [own, other].map(|spare| self.kind_of(models, spare)));
            kinds.is_some_and(|[own, other]| own.is(&other))
        };
        let can_wait = |id: &SpareId, other: &Planned| is_alike(id) && other.start.seconds_since(self.now) >= ready_s;
        let mut instead = self.ready_spares(&run.station, &run.robot, robot);
        instead.retain(|id| !is_taken(id) && promised(id).is_none_or(|other| can_wait(id, other)));
        let soc = |id: &SpareId| known(id).map_or(0.0, |spare| spare.soc.value);
        // What holds much less than the one that is waited for waits for its turn.
        let full_soc = models.spare_ready_soc.unwrap_or(self.settings.charge_to_soc);
        instead.retain(|id| soc(id) >= full_soc - ALIKE_SOC);
        instead.into_iter().min_by(|a, b| promised(a).is_some().cmp(&promised(b).is_some()).then(soc(b).total_cmp(&soc(a))))
    }

    /// Whether anybody was promised a spare at a station that has to be charged first.
    pub(super) fn waits_for_a_charge(&self, id: &StationId) -> bool {
        let Some(state) = self.fleet.stations.get(id).and_then(|station| station.state.as_ref()) else { return false };
        let taken = self.running.values().filter(|run| run.station == *id).filter_map(|run| run.how.spare());
        let promised = self.planned.iter().filter(|planned| planned.station == *id).filter_map(|planned| planned.spare.as_ref());
        let is_ready = |spare: &SpareId| state.spares.iter().any(|known| known.spare == *spare && known.ready);
        let mut given: BTreeSet<&SpareId> = taken.collect();
        promised.into_iter().any(|spare| !given.insert(spare) || !is_ready(spare))
    }

    fn left(&self, id: &StationId, models: &StationModels, station: &Station, state: &StationState, spare: &SpareState) -> Left {
        let left = station.left.get(&spare.spare);
        let since_s = left.map_or(0.0, |left| self.now.seconds_since(left.since));
        let soc = left.map_or(from_wire(spare.soc), |left| left.soc(from_wire(spare.soc)));
        let Some((table, battery)) = self.charge_of(id, models, spare) else { return Left { until_s: LATE_S, need: None } };
        let whole_s = table.at(soc.value).bare_s;
        let alone_s = whole_s - since_s;
        if alone_s <= 0.0 {
            return Left { until_s: (-alone_s).max(LATE_S), need: None };
        }
        // What it has taken since then, the packs' gauges have counted.
        let reached = table.reached_alone(soc.value, since_s);
        let need = self.bare(id, &table, Estimate::new(reached, alone_s / whole_s * soc.sigma));
        // From the last level of the table on, less and less of its charge is left.
        let share = (alone_s / table.at(reached).bare_s).min(1.0);
        let until_s = (alone_s * self.longer_beside((id, models, state), &battery, soc.value, whole_s)).max(LATE_S);
        Left { until_s, need: need.map(|need| need.scaled(share)) }
    }

    /// What a pack that a robot leaves for a spare with that much charge takes then: how long, s, and how much of the station's packs.
    fn whole(
        &self,
        id: &StationId,
        models: &StationModels,
        state: &StationState,
        spare: &SpareState,
        soc: Estimate,
    ) -> (f64, Option<Need>) {
        let Some((table, battery)) = self.charge_of(id, models, spare) else { return (0.0, None) };
        let whole_s = table.at(soc.value).bare_s;
        (whole_s * self.longer_beside((id, models, state), &battery, soc.value, whole_s), self.bare(id, &table, soc))
    }

    /// What charging takes of what is left in a spare's place, which is of its kind; where nobody said what that is, of the battery that
    /// capacity is counted in.
    fn charge_of(&self, id: &StationId, models: &StationModels, spare: &SpareState) -> Option<(Arc<Table>, Arc<Model>)> {
        let kind = self.kind_of(models, spare);
        let battery = kind.model().or_else(|| self.usual_battery(id))?;
        Some((self.table(id, models, battery, self.left_degc(id, battery)), Arc::clone(battery)))
    }

    /// What the station's packs give for it: nothing where what robots leave is put aside, or charged from outside.
    fn bare(&self, id: &StationId, table: &Table, soc: Estimate) -> Option<Need> {
        let factor = self.watch.wider(&Subject::Station(id.clone()));
        Some(table.bare(soc, factor)).filter(|need| need.mean_wh > 0.0)
    }

    /// How many times as long that takes beside all that are charged now, where they share what the converters give.
    fn longer_beside(
        &self,
        (id, models, state): (&StationId, &StationModels, &StationState),
        battery: &Arc<Model>,
        soc: f64,
        whole_s: f64,
    ) -> f64 {
        let spares = state.spares.iter().filter(|spare| !spare.ready).count();
        let robots = self.running.values().filter(|run| run.station == *id && run.at_place() && matches!(run.how, How::Recharge { .. }));
        let shared_s = self.tables.charged_beside(models, battery, spares + robots.count(), self.left_degc(id, battery), soc);
        shared_s.map_or(1.0, |shared_s| (shared_s / whole_s.max(1.0)).max(1.0))
    }
}
