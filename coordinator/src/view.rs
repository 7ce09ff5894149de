//! Makes the planning problem from beliefs, models and services that have begun.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use energy::units::S_PER_H;
use energy::{Estimate, Model};
use proto::{BayPhase, Gauge, PackId, RobotId, RobotPhase, RobotState, StationId, StationState, Timestamp, Travel};
use statrs::distribution::{ContinuousCDF, Normal};

use crate::fleet::{Fleet, Robot, Station};
use crate::forecast::{self, Recharge};
use crate::models::{Models, Settings, StationModels, from_wire};
use crate::scheduler::{BayView, OptionView, PackView, Problem, RobotView, SpareView, StationView, Way};
use crate::service_run::{How, ServiceRun, Stage};
use crate::watch::{Subject, Watch};
use energy::Need;

/// Share of the time to empty after which a service is wanted whatever the state of charge.
const QUEUE_SHARE: f64 = 0.9;

/// Everything that a problem is made from.
#[derive(Clone, Copy)]
pub struct Basis<'a> {
    /// Now.
    pub now: Timestamp,
    /// Beliefs.
    pub fleet: &'a Fleet,
    /// Models.
    pub models: &'a Models,
    /// How to decide.
    pub settings: &'a Settings,
    /// Services that have begun.
    pub running: &'a BTreeMap<RobotId, ServiceRun>,
    /// Robots that the last plan promised a service.
    pub promised: &'a BTreeSet<RobotId>,
    /// Doubts in models.
    pub(crate) watch: &'a Watch,
}

impl Basis<'_> {
    /// The planning problem.
    #[must_use]
    pub fn problem(&self) -> Problem {
        let stations: Vec<StationView> =
            self.models.stations.iter().map(|(id, models)| self.station(id, models, self.fleet.stations.get(id))).collect();
        let robots = self.fleet.robots.iter().filter_map(|(id, robot)| {
            let (gauge, state) = robot.known()?;
            let plannable = !self.running.contains_key(id) && matches!(state.phase, RobotPhase::Working | RobotPhase::Waiting);
            let battery = self.models.battery(id, &state.battery)?;
            plannable.then(|| self.robot(id, gauge, state, battery, &stations))
        });
        Problem { confidence: self.settings.confidence, robots: robots.collect(), stations }
    }

    fn robot(&self, id: &RobotId, gauge: &Gauge, state: &RobotState, battery: &Arc<Model>, stations: &[StationView]) -> RobotView {
        let soc = wider(from_wire(gauge.soc), self.watch.wider(&Subject::RobotBattery(id.clone())));
        let stored_wh = battery.battery().stored_wh();
        let drain_soc_per_s = (state.drain_w.value / stored_wh / S_PER_H).max(1e-12);
        let empty_s = self.empty_s(id, gauge, state);
        // A heavy load may empty a pack soon after it reaches the level at which a service is
        // wanted, or before: it comes while there is time left for a queue.
        let wanted_s = ((soc.value - self.settings.serve_below_soc) / drain_soc_per_s).max(0.0).min(QUEUE_SHARE * empty_s);
        let options = stations.iter().enumerate().flat_map(|(index, station)| {
            state.travel.get(&station.station).map_or_else(Vec::new, |travel| {
                let ready_s = travel.time_s.max(wanted_s);
                let soc_ready = Estimate::new((soc.value - drain_soc_per_s * ready_s).clamp(0.0, 1.0), soc.sigma);
                self.options(index, station, travel.time_s, soc_ready, drain_soc_per_s, battery)
            })
        });
        RobotView {
            robot: id.clone(),
            soc,
            empty_s,
            wanted_s,
            drain_soc_per_s,
            weight: state.mission.weight,
            promised: self.promised.contains(id),
            options: options.collect(),
        }
    }

    /// Time until a robot may be empty: what its gauge has left over its drain, both pessimistic.
    fn empty_s(&self, id: &RobotId, gauge: &Gauge, state: &RobotState) -> f64 {
        let z = Normal::standard().inverse_cdf(self.settings.confidence);
        // A doubted model is less certain than it says.
        let [battery, work, on_way] = [Subject::RobotBattery(id.clone()), Subject::RobotWork(id.clone()), Subject::RobotWay(id.clone())]
            .map(|of| self.watch.wider(&of));
        let drain_w = state.drain_w.value + z * work * state.drain_w.sigma;
        // What the cheapest way home takes beyond as much work is kept back for it.
        let beyond_wh = |way: &Travel| way.energy_wh.value + z * on_way * way.energy_wh.sigma - drain_w * way.time_s / S_PER_H;
        let reserve_wh = state.travel.values().map(beyond_wh).fold(f64::INFINITY, f64::min);
        let reserve_wh = if reserve_wh.is_finite() { reserve_wh.max(0.0) } else { 0.0 };
        let energy_wh = (gauge.remaining_wh.value - z * battery * gauge.remaining_wh.sigma - reserve_wh).max(0.0);
        if drain_w <= 0.0 { f64::INFINITY } else { energy_wh / drain_w * S_PER_H }
    }

    fn options(
        &self,
        index: usize,
        station: &StationView,
        travel_s: f64,
        soc_ready: Estimate,
        drain_soc_per_s: f64,
        battery: &Arc<Model>,
    ) -> Vec<OptionView> {
        let models = &self.models.stations[&station.station];
        let mut ways = Vec::new();
        if !station.bays.is_empty() {
            let to_soc = self.settings.charge_to_soc;
            let recharge = self.recharge(&station.station, models, self.side_by_side(&station.station), battery, soc_ready, to_soc);
            let facts = battery.battery();
            let need_share_per_s = drain_soc_per_s / (to_soc - soc_ready.value).max(0.01);
            // What a robot loses while it waits is charged at full current, or at what robots that
            // share a converter get on average.
            let charge_s_per_s = if models.converter_w_max.is_finite() {
                recharge.charge_s * need_share_per_s
            } else {
                drain_soc_per_s * facts.capacity_ah / facts.charge.current_a * S_PER_H
            };
            ways.push(Way::Recharge { to_soc, recharge, charge_s_per_s, need_share_per_s });
        }
        if !station.spares.is_empty() {
            let need = forecast::exchange(models, soc_ready, self.settings.charge_to_soc);
            ways.push(Way::Swap { need: self.doubted(&station.station, need) });
        }
        ways.into_iter().map(|way| OptionView { station: index, travel_s, way }).collect()
    }

    /// One station, with what services that have begun hold of it.
    #[must_use]
    pub fn station(&self, id: &StationId, models: &StationModels, station: Option<&Station>) -> StationView {
        let mut view = StationView {
            station: id.clone(),
            out_of_order: None,
            handling: models.handling,
            bays: Vec::new(),
            lift_busy: Vec::new(),
            swap_free_s: 0.0,
            spares: Vec::new(),
            packs: Vec::new(),
            committed: Need::default(),
            committed_until_s: 0.0,
            overhead_per_h: self.doubted(id, forecast::overhead_per_h(models)),
        };
        let Some((station, state)) = station.and_then(|station| Some((station, station.known()?))) else {
            view.out_of_order = Some("it has not been heard".to_owned());
            return view;
        };
        if !state.powered {
            view.out_of_order = Some("it has no power".to_owned());
        }
        let here: Vec<&ServiceRun> = self.running.values().filter(|run| run.station == *id).collect();
        let taken_spares: Vec<_> =
            here.iter().filter_map(|run| if let How::Swap { spare } = &run.how { Some(spare) } else { None }).collect();
        // A spare at the level at which robots want a service is none.
        let charged = |soc: f64| soc > self.settings.serve_below_soc;
        let ready = state.spares.iter().filter(|s| s.ready && charged(s.soc.value) && !taken_spares.contains(&&s.spare));
        view.spares = ready.map(|spare| SpareView { spare: spare.spare.clone(), soc: from_wire(spare.soc) }).collect();
        // Packs that robots left are still to be charged.
        for left in state.spares.iter().filter(|spare| !spare.ready) {
            view.committed = view.committed.plus(&forecast::spare_again(models, from_wire(left.soc), self.settings.charge_to_soc));
        }
        view.bays = state.bays.iter().map(|bay| self.bay(&bay.bay, bay.phase, &here)).collect();
        for run in here {
            let ends_s = self.ends_s(run);
            view.committed_until_s = view.committed_until_s.max(ends_s);
            view.committed = view.committed.plus(&self.still_needs(run, models));
            match run.how {
                How::Swap { .. } => view.swap_free_s = view.swap_free_s.max(ends_s),
                How::Recharge { .. } => view.lift_busy.extend(self.lift_busy(run, models, ends_s)),
            }
        }
        view.lift_busy.sort_by(|a, b| a.0.total_cmp(&b.0));
        view.packs = self.packs(id, models, station, state);
        view
    }

    /// How many robots may charge side by side at a station: as many as it has bays, or as can come.
    #[must_use]
    pub fn side_by_side(&self, id: &StationId) -> usize {
        let bays = self.fleet.stations.get(id).and_then(|station| station.state.as_ref()).map_or(1, |state| state.bays.len());
        let reaches = |robot: &&Robot| robot.known().is_some_and(|(_, state)| state.travel.contains_key(id));
        bays.min(self.fleet.robots.values().filter(reaches).count()).max(1)
    }

    fn bay(&self, bay: &proto::BayId, phase: BayPhase, here: &[&ServiceRun]) -> BayView {
        let run = here.iter().find(|run| matches!(&run.how, How::Recharge { bay: own, .. } if own == bay));
        let free_s = match (phase, run) {
            (BayPhase::Failed, _) => None,
            (_, Some(run)) => Some(self.ends_s(run)),
            (BayPhase::Free, None) => Some(0.0),
            // Somebody is in it whom no service put there: nobody knows for how long.
            (_, None) => None,
        };
        BayView { bay: bay.clone(), free_s }
    }

    fn ends_s(&self, run: &ServiceRun) -> f64 {
        run.end.seconds_since(self.now).max(1.0)
    }

    fn lift_busy(&self, run: &ServiceRun, models: &StationModels, ends_s: f64) -> Vec<(f64, f64)> {
        let unload = (ends_s - models.handling.unload_s, ends_s);
        let load_s = models.handling.load_s;
        match run.stage {
            Stage::Travelling | Stage::Waiting => {
                let start_s = run.start.seconds_since(self.now).max(0.0);
                vec![(start_s, start_s + load_s), unload]
            }
            Stage::Loading => vec![(0.0, load_s), unload],
            Stage::ChargingItself => Vec::new(),
            _ => vec![unload],
        }
    }

    /// What a service that has begun still takes: the charge that the robot still lacks.
    fn still_needs(&self, run: &ServiceRun, models: &StationModels) -> Need {
        let How::Recharge { to_soc, .. } = run.how else { return run.need.clone() };
        let robot = self.fleet.robots.get(&run.robot);
        let Some((gauge, state)) = robot.and_then(|robot| robot.known()) else { return run.need.clone() };
        let Some(battery) = self.models.battery(&run.robot, &state.battery) else { return run.need.clone() };
        self.recharge(&run.station, models, self.side_by_side(&run.station), battery, from_wire(gauge.soc), to_soc).need
    }

    /// Packs that hold something, in the order in which they are drained: the active one, then
    /// the fullest last, so that full packs stay full.
    fn packs(&self, id: &StationId, models: &StationModels, station: &Station, state: &StationState) -> Vec<PackView> {
        let power_w = self.working_power_w(id, models, state);
        let mut packs: Vec<PackView> = state
            .packs
            .iter()
            .filter(|pack| pack.connected && !pack.depleted)
            .filter_map(|pack| {
                let (gauge, model) = (station.packs.get(&pack.pack)?, models.packs.get(&pack.pack)?);
                let usable_wh = forecast::usable_wh(model, from_wire(gauge.soc), gauge.temperature_degc, power_w);
                let factor = self.watch.wider(&Subject::Pack(id.clone(), pack.pack.clone()));
                Some(PackView { pack: pack.pack.clone(), usable_wh: wider(usable_wh, factor) })
            })
            .collect();
        let active = |pack: &PackId| state.active_pack.as_ref() == Some(pack);
        packs.sort_by(|a, b| {
            let key = |pack: &PackView| (!active(&pack.pack), pack.usable_wh.value);
            key(a).0.cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)).then_with(|| a.pack.cmp(&b.pack))
        });
        packs
    }

    /// Power out of the active pack while every bay charges: usable energy is counted at that.
    #[must_use]
    pub fn working_power_w(&self, id: &StationId, models: &StationModels, state: &StationState) -> f64 {
        let overhead_w = forecast::overhead_per_h(models).mean_wh;
        let Some(battery) = self.reference_battery() else { return overhead_w };
        let recharge = self.reference_recharge(id, models, battery, state.bays.len());
        overhead_w + state.bays.len() as f64 * recharge.need.mean_wh / (recharge.charge_s / S_PER_H).max(1e-6)
    }

    /// The battery of the service that capacity is counted in: that of the first robot known, or
    /// configured.
    #[must_use]
    pub fn reference_battery(&self) -> Option<&Arc<Model>> {
        let known = self.fleet.robots.iter().find_map(|(id, robot)| self.models.battery(id, &robot.state.as_ref()?.battery));
        known.or_else(|| self.models.robots.values().chain(self.models.batteries.values()).next())
    }

    /// The service that capacity is counted in: from where a service is wanted to where it ends,
    /// with as many robots at once as there are bays.
    #[must_use]
    pub fn reference_recharge(&self, id: &StationId, models: &StationModels, battery: &Arc<Model>, bays: usize) -> Recharge {
        let from = Estimate::exact(self.settings.serve_below_soc);
        self.recharge(id, models, bays, battery, from, self.settings.charge_to_soc)
    }

    fn recharge(
        &self,
        id: &StationId,
        models: &StationModels,
        at_once: usize,
        battery: &Arc<Model>,
        soc: Estimate,
        to_soc: f64,
    ) -> Recharge {
        let recharge = forecast::recharge(models, at_once, battery, soc, to_soc);
        Recharge { need: self.doubted(id, recharge.need), ..recharge }
    }

    /// What a station's packs must give, as much less certain as its model is doubted.
    fn doubted(&self, id: &StationId, need: Need) -> Need {
        let factor = self.watch.wider(&Subject::Station(id.clone()));
        let shared_wh = need.shared_wh.iter().map(|change_wh| factor * change_wh).collect();
        Need { mean_wh: need.mean_wh, shared_wh, own_variance: factor * factor * need.own_variance }
    }
}

fn wider(estimate: Estimate, factor: f64) -> Estimate {
    Estimate::new(estimate.value, factor * estimate.sigma)
}
