//! Makes the planning view from beliefs, models and services that have begun.

mod batteries;
mod begun;
mod crowd;
mod fit;
mod packs;
mod sharing;
mod spares;
mod stock;

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use energy::units::S_PER_H;
use energy::{Channel, Estimate, Model, Need};
use proto::{Absence, BayPhase, BayState, Gauge, PackId, RobotId, RobotPhase, RobotState, StationId, Timestamp};

use self::crowd::InReach;
use self::fit::SpareKind;
pub(crate) use self::stock::Stock;
use crate::fleet::{Fleet, Station};
use crate::forecast::{self, Draw};
use crate::models::{Models, Settings, StationModels, from_wire};
use crate::refusals::Refusals;
use crate::scheduler::charging::{Table, step_degc, uncritical_degc};
use crate::scheduler::{Planned, RobotView, StationView, Tables, View, WayView};
use crate::service_run::{ServiceRun, Stage};
use crate::trust::{Owner, Trust};
use crate::watch::{Subject, Watch};
use crate::when::minute_from;

/// Share of the time to empty after which a service is wanted whatever the state of charge.
const QUEUE_SHARE: f64 = 0.9;
/// A pack that should have been brought, and a station that should have arrived by now, are counted on after this time, s.
const COMES_LATE_S: f64 = 60.0;

/// Everything that a view is made from.
pub struct Basis<'a> {
    /// Now.
    pub now: Timestamp,
    /// Beliefs.
    pub fleet: &'a Fleet,
    /// Models.
    pub models: &'a Models,
    /// What charging takes.
    pub tables: &'a Tables,
    /// How to decide.
    pub settings: &'a Settings,
    /// Services that have begun.
    pub running: &'a BTreeMap<RobotId, ServiceRun>,
    /// Robots that the last plan promised a service.
    pub promised: &'a BTreeSet<RobotId>,
    /// What it promised and has not begun.
    pub planned: &'a [Planned],
    /// Doubts in models.
    pub(crate) watch: &'a Watch,
    /// Doubts in gauges.
    pub(crate) trust: &'a Trust,
    /// Services that were refused.
    pub(crate) refusals: &'a Refusals,
    /// How many more robots a station takes in side by side than its converters feed at full current. Plans try 0, and more where somebody
    /// would run empty while waiting for a bay; policies that do not search take the most.
    pub(crate) crowd: usize,
    /// What the robots that can come to each station ask of it, counted when first asked for.
    pub(crate) in_reach: OnceCell<BTreeMap<StationId, InReach>>,
}

/// What the views of all robots have in common.
struct Around<'v> {
    /// Place in the order of stations, what is believed of it, and the kinds of its spares.
    stations: BTreeMap<&'v StationId, (usize, &'v StationView, Vec<SpareKind>)>,
    /// What charging takes: at a station, for a battery, in a step of temperature.
    tables: BTreeMap<(usize, usize, i32), Arc<Table>>,
}

impl Basis<'_> {
    /// What is believed, for planning.
    #[must_use]
    pub fn view(&self) -> View {
        let stations: Vec<StationView> =
            self.models.stations.iter().map(|(id, models)| self.station(id, models, self.fleet.stations.get(id))).collect();
        let kinds = |station: &StationView| {
            let (models, known) = (&self.models.stations[&station.station], self.fleet.stations.get(&station.station));
            known.and_then(Station::known).map_or_else(Vec::new, |state| self.kinds_of_spares(models, state))
        };
        let mut around = Around {
            stations: stations.iter().enumerate().map(|(index, station)| (&station.station, (index, station, kinds(station)))).collect(),
            tables: BTreeMap::new(),
        };
        let robots = self.fleet.robots.iter().filter_map(|(id, robot)| {
            let (gauge, state) = robot.known()?;
            let plannable = !self.running.contains_key(id) && matches!(state.phase, RobotPhase::Working | RobotPhase::Waiting);
            let battery = self.battery(id, gauge, state)?;
            plannable.then(|| self.robot(id, gauge, state, &battery, &mut around))
        });
        let robots = robots.collect();
        View { now: self.now, robots, stations, crowd: self.crowd }
    }

    /// What a robot's pack holds against what it draws.
    pub(crate) fn stock(&self, id: &RobotId, gauge: &Gauge, state: &RobotState, battery: &Model) -> Stock {
        let (soc, remaining_wh) = self.trust.belief(self.now, &Owner::Robot(id.clone()), gauge, battery.battery().stored_wh());
        // How much less certain is what is known of its battery, its work and its ways.
        let doubt = |subject: fn(RobotId) -> Subject| if self.watch.is_doubting() { self.watch.wider(&subject(id.clone())) } else { 1.0 };
        let [of_battery, of_work, on_way] = [Subject::RobotBattery, Subject::RobotWork, Subject::RobotWay].map(doubt);
        Stock {
            soc: wider(soc, of_battery),
            remaining_wh: wider(remaining_wh, of_battery),
            stored_wh: battery.battery().stored_wh(),
            drain_w: wider(from_wire(state.drain_w), of_work),
            on_way,
            caution: self.settings.caution(),
            held: self.promised.contains(id),
        }
    }

    fn robot(&self, id: &RobotId, gauge: &Gauge, state: &RobotState, battery: &Arc<Model>, around: &mut Around<'_>) -> RobotView {
        let stock = self.stock(id, gauge, state, battery);
        let per_s = |power_w: f64| (power_w / stock.stored_wh / S_PER_H).max(1e-12);
        let drain_soc_per_s = per_s(stock.drain_w.value);
        let mut view = RobotView {
            robot: id.clone(),
            battery: Arc::clone(battery),
            temperature_degc: gauge.temperature_degc,
            charge_degc: charge_degc(battery, gauge.temperature_degc, stock.held),
            soc: stock.soc,
            lasts: stock.lasts(None, 0.0),
            wanted_s: ((stock.soc.value - self.settings.serve_below_soc) / drain_soc_per_s).max(0.0),
            is_hurried: false,
            drain_soc_per_s,
            drain_hi_soc_per_s: per_s(stock.drain_hi_w()),
            weight: state.mission.weight,
            until_s: state.mission.until.map(|until| until.seconds_since(self.now)),
            held: stock.held,
            ways: Vec::new(),
            unfit: Vec::new(),
            closed: Vec::new(),
        };
        // Ways are in order of station, as stations are.
        for (station, travel) in &state.travel {
            let Some((index, station, kinds)) = around.stations.get(station) else { continue };
            let index = *index;
            if let Some(why) = &station.out_of_order {
                view.closed.push((station.station.clone(), why.clone()));
                continue;
            }
            if let Some(refusal) = self.refusals.holds(self.now, id, &station.station) {
                let [at, until] = [refusal.at, refusal.until].map(|at| minute_from(self.now, at));
                view.closed.push((station.station.clone(), format!("at {at} {}; not tried again before {until}", refusal.why)));
                continue;
            }
            let kind = (index, Arc::as_ptr(battery).addr(), view.charge_degc as i32);
            let made = || self.table(&station.station, &self.models.stations[&station.station], battery, view.charge_degc);
            let table = Arc::clone(around.tables.entry(kind).or_insert_with(made));
            let (extra_soc, lasts) = (stock.extra_soc(travel), stock.lasts(Some(travel), station.taken_in_s()));
            view.ways.push(WayView { station: index, time_s: travel.time_s, extra_soc, lasts, table });
            let unfit = kinds.iter().enumerate().filter(|(_, kind)| !kind.fits(&state.battery, battery));
            view.unfit.extend(unfit.map(|(kind, _)| (index, kind)));
        }
        // A heavy load may empty a pack soon after it reaches the level at which a service is
        // wanted, or before: it comes while there is time left for a queue, where it can wait longest for one.
        let longest_s = view.ways.iter().map(|way| way.lasts.surely_s).max_by(f64::total_cmp).unwrap_or(view.lasts.surely_s);
        let with_a_queue_s = QUEUE_SHARE * longest_s.max(0.0);
        view.is_hurried = with_a_queue_s < view.wanted_s;
        view.wanted_s = view.wanted_s.min(with_a_queue_s);
        view
    }

    /// What charging a battery takes at a station, in its robot, where it comes that warm, and where that left it.
    #[must_use]
    pub fn table(&self, id: &StationId, models: &StationModels, battery: &Arc<Model>, temperature_degc: f64) -> Arc<Table> {
        self.table_beside(self.side_by_side(id), id, models, battery, temperature_degc)
    }

    /// The same where so many robots are side by side.
    fn table_beside(
        &self,
        at_once: usize,
        id: &StationId,
        models: &StationModels,
        battery: &Arc<Model>,
        temperature_degc: f64,
    ) -> Arc<Table> {
        self.table_at(at_once, id, models, battery, [temperature_degc, self.left_degc(id, battery)])
    }

    /// The same where it is that warm at the station.
    fn table_at(
        &self,
        at_once: usize,
        id: &StationId,
        models: &StationModels,
        battery: &Arc<Model>,
        [temperature_degc, left_degc]: [f64; 2],
    ) -> Arc<Table> {
        // Without a bay only what was left is charged.
        let state = self.fleet.stations.get(id).and_then(|station| station.state.as_ref());
        let in_robot_degc = if state.is_some_and(|state| state.bays.is_empty()) { left_degc } else { temperature_degc };
        // Where what the converters give is limited, any spare may be charged beside all others.
        let alone = state.filter(|_| models.converter_w_max.is_finite()).map_or(1, |state| state.spares.len().max(1));
        self.tables.of(models, [at_once, alone], battery, [in_robot_degc, left_degc], self.levels())
    }

    /// States of charge at which a service is wanted and done.
    fn levels(&self) -> [f64; 2] {
        [self.settings.serve_below_soc, self.settings.charge_to_soc]
    }

    /// The temperature at which a battery is charged that a robot left at a station, °C; as of a promise that was given where one waits for that.
    #[must_use]
    pub fn left_degc(&self, id: &StationId, battery: &Model) -> f64 {
        charge_degc(battery, self.surroundings_degc(id), self.waits_for_a_charge(id))
    }

    /// One station, with what services that have begun hold of it.
    #[must_use]
    pub fn station(&self, id: &StationId, models: &StationModels, station: Option<&Station>) -> StationView {
        let reference = self.reference(id, models);
        let factor = self.watch.wider(&Subject::Station(id.clone()));
        let mut view = StationView {
            station: id.clone(),
            out_of_order: None,
            opens_s: 0.0,
            away_s: Vec::new(),
            handling: models.handling,
            bays: Vec::new(),
            unfed: 0,
            begun: Vec::new(),
            spares: Vec::new(),
            charges_spares: models.spare_battery.is_some(),
            ready_soc: models.spare_ready_soc.unwrap_or(self.settings.charge_to_soc),
            packs: Vec::new(),
            committed: Need::default(),
            committed_until_s: 0.0,
            recharging: Vec::new(),
            overhead_per_h: self.doubted(id, forecast::overhead_per_h(models)),
            shared_per_wh: reference.map_or_else(Vec::new, |table| table.shared_per_wh.iter().map(|change| factor * change).collect()),
        };
        let Some((station, state)) = station.and_then(|station| Some((station, station.known()?))) else {
            view.out_of_order = Some(station.map_or_else(|| "it has not been heard".to_owned(), Station::why_unknown));
            return view;
        };
        if !state.powered {
            view.out_of_order = Some("it has no power".to_owned());
        }
        view.opens_s = state.arrives.map_or(0.0, |at| self.comes_s(at));
        let away_s = |away: &Absence| away.leaves.seconds_since(self.now)..away.returns.map_or(f64::INFINITY, |at| self.comes_s(at));
        view.away_s = state.away.iter().map(away_s).collect();
        let here: Vec<&ServiceRun> = self.running.values().filter(|run| run.station == *id).collect();
        self.spares(&mut view, models, station, state, &here);
        view.bays = state.bays.iter().filter(|bay| self.usable(&bay.bay, bay.phase, &here)).map(|bay| bay.bay.clone()).collect();
        for run in here.into_iter().filter(|run| run.stage != Stage::LetOut) {
            let ends_s = self.ends_s(run);
            view.committed_until_s = view.committed_until_s.max(ends_s);
            view.committed = view.committed.plus(&self.still_needs(run, models, ends_s));
            view.begun.push(self.begun(run, ends_s));
        }
        self.leave_unfed(&mut view);
        view.packs = self.packs(id, models, station, state);
        view
    }

    /// When something comes that is expected at a time, s: soon, if it is late.
    fn comes_s(&self, at: Timestamp) -> f64 {
        let left_s = at.seconds_since(self.now);
        if left_s > 0.0 { left_s } else { COMES_LATE_S }
    }

    /// Whether a bay of a station can take a robot in, once whoever is in it is out.
    pub(crate) fn takes_in(&self, id: &StationId, bay: &BayState) -> bool {
        let here: Vec<&ServiceRun> = self.running.values().filter(|run| run.station == *id).collect();
        self.usable(&bay.bay, bay.phase, &here)
    }

    /// Whether a bay works, and is free or held by a service that has begun. If somebody is in it whom no
    /// service put there, nobody knows for how long.
    fn usable(&self, bay: &proto::BayId, phase: BayPhase, here: &[&ServiceRun]) -> bool {
        let held = here.iter().any(|run| run.is_in(&run.station, bay));
        phase != BayPhase::Failed && (held || phase == BayPhase::Free)
    }

    /// State of charge that a pack in its place is believed to have.
    pub(crate) fn believed(&self, id: &StationId, pack: &PackId, gauge: &Gauge, model: &Model) -> Estimate {
        self.trust.belief(self.now, &Owner::Pack(id.clone(), pack.clone()), gauge, model.battery().stored_wh()).0
    }

    /// Power out of the active pack while as many charge side by side as can come, and how it falls at the end of that: usable energy is
    /// counted for this load.
    fn working_draw(&self, id: &StationId, models: &StationModels, bays: usize) -> Draw {
        let overhead_w = forecast::overhead_per_h(models).mean_wh;
        let Some(battery) = self.usual_battery(id) else { return Draw::steady(overhead_w) };
        let table = |battery: &Arc<Model>| self.tables.of(models, [bays, 1], battery, [energy::units::REFERENCE_DEGC; 2], self.levels());
        let service = |table: &Table| table.at(self.settings.serve_below_soc);
        let usual = table(battery);
        let usual_w = service(&usual).mean_w();
        let each_w = self.mixed_w(id, bays, |battery| service(&table(battery))).unwrap_or(usual_w);
        let scaled = |(time_s, power_w): (f64, f64)| (time_s, power_w * each_w / usual_w);
        let taper: Vec<_> = usual.taper(usual_w).into_iter().map(scaled).collect();
        Draw {
            power_w: overhead_w + bays as f64 * each_w,
            ending: forecast::ending(&taper, each_w, bays, models.handling.unload_s, overhead_w),
        }
    }

    /// What charging takes at a station where it is neither hot nor cold, for a battery like that of most robots that come there.
    #[must_use]
    pub fn reference(&self, id: &StationId, models: &StationModels) -> Option<Arc<Table>> {
        Some(self.table_at(self.side_by_side(id), id, models, self.usual_battery(id)?, [energy::units::REFERENCE_DEGC; 2]))
    }

    /// How warm it is at a station, °C.
    fn surroundings_degc(&self, id: &StationId) -> f64 {
        self.fleet.stations.get(id).and_then(|station| station.surroundings_degc).unwrap_or(energy::units::REFERENCE_DEGC)
    }

    /// What a station's packs must give, as much less certain as its model is doubted.
    fn doubted(&self, id: &StationId, need: Need) -> Need {
        let factor = self.watch.wider(&Subject::Station(id.clone()));
        let shared_wh = need.shared_wh.iter().map(|change_wh| factor * change_wh).collect();
        Need { mean_wh: need.mean_wh, shared_wh, own_variance: factor * factor * need.own_variance }
    }
}

/// The temperature that charging a robot is planned with, °C: a new promise allows for what the gauge's thermometer may be off, so that
/// one that was given is not broken over as much.
pub(crate) fn charge_degc(battery: &Model, gauged_degc: f64, held: bool) -> f64 {
    let doubt_degc = if held { 0.0 } else { battery.sensor(Channel::TemperatureDegc).offset_sigma };
    let [hot_degc, cold_degc] = uncritical_degc(battery);
    match gauged_degc {
        _ if gauged_degc + doubt_degc > hot_degc => step_degc(battery, gauged_degc + doubt_degc),
        _ if gauged_degc - doubt_degc < cold_degc => step_degc(battery, gauged_degc - doubt_degc),
        _ => step_degc(battery, gauged_degc),
    }
}

fn wider(estimate: Estimate, factor: f64) -> Estimate {
    Estimate::new(estimate.value, factor * estimate.sigma)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_new_promise_allows_for_what_the_thermometer_may_be_off_and_a_kept_one_does_not() {
        // Its thermometer is within 1 K; 5 and 40 °C are where its protection lets it be charged again.
        let battery = energy::load_model("explorer-3s1p-1320mah", &|_| unreachable!("built in")).unwrap();
        for (gauged_degc, new_degc, held_degc) in
            [(0.5, -1.0, 0.0), (5.5, 4.0, 5.0), (25.0, 25.0, 25.0), (29.6, 31.0, 30.0), (39.2, 40.0, 39.0)]
        {
            let told = [false, true].map(|held| charge_degc(&battery, gauged_degc, held));
            assert_eq!(told, [new_degc, held_degc], "{gauged_degc}");
        }
    }
}
