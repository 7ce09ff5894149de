//! Services that have begun: when they end, what they hold, and what they still take.

use energy::units::S_PER_H;
use energy::{Estimate, Model, Need};
use proto::{RobotState, StationId};

use super::Basis;
use crate::fleet::Robot;
use crate::forecast;
use crate::models::{StationModels, from_wire};
use crate::scheduler::Begun;
use crate::scheduler::charging::uncritical_degc;
use crate::service_run::{How, ServiceRun, Stage};
use crate::watch::Subject;

impl Basis<'_> {
    /// When a service that has begun ends, s from now; negative once the robot is out. Once it charges, its gauge says so
    /// better than the plan; one whose robot takes no charge is given up after a while ([`ServiceRun::takes_no_charge`]).
    #[must_use]
    pub fn ends_s(&self, run: &ServiceRun) -> f64 {
        if run.stage == Stage::LetOut {
            return run.end.seconds_since(self.now);
        }
        let planned_s = (run.end.seconds_since(self.now) + self.late_s(run)).max(1.0);
        if !matches!(run.stage, Stage::Charging | Stage::ChargingItself) {
            return self.shared_end_s(run).unwrap_or(planned_s);
        }
        if let Some(since) = run.takes_none_since {
            let given_up_s = since.max(run.end).seconds_since(self.now) + self.settings.late_s;
            return if run.end > self.now { planned_s } else { given_up_s.max(1.0) };
        }
        let unload_s = self.models.stations.get(&run.station).map_or(0.0, |models| models.handling.unload_s);
        let charging = self.charges_for_s(run).map(|left_s| left_s + unload_s);
        charging.map_or(planned_s, |left_s| left_s.max(1.0))
    }

    /// How much later than planned a service can begin, s: as long as somebody else is still in its bay, or comes into it
    /// before, or its spare is still charged, and never earlier than now.
    #[must_use]
    pub fn late_s(&self, run: &ServiceRun) -> f64 {
        if !run.under_way() {
            return 0.0;
        }
        let bay = match &run.how {
            How::Recharge { bay, .. } => bay,
            How::Swap { spare } => {
                let ready_s = self.ready_s(&run.station, spare);
                return if ready_s > 0.0 { (ready_s - run.start.seconds_since(self.now)).max(0.0) } else { 0.0 };
            }
        };
        let ahead = |other: &&ServiceRun| {
            other.is_in(&run.station, bay) && (!other.under_way() || (other.start, &other.robot) < (run.start, &run.robot))
        };
        let free_s = self.running.values().filter(ahead).map(|other| self.ends_s(other)).fold(0.0, f64::max);
        (free_s - run.start.seconds_since(self.now)).max(0.0)
    }

    /// What an exchange takes without the charge of the pack that is left.
    #[must_use]
    pub fn exchange(&self, station: &StationId, models: &StationModels) -> Need {
        self.doubted(station, forecast::exchange(models))
    }

    pub(super) fn begun(&self, run: &ServiceRun, until_s: f64) -> Begun {
        let bay = if let How::Recharge { bay, .. } = &run.how { Some(bay.clone()) } else { None };
        let from_s = if run.under_way() { self.begins_s(run) } else { 0.0 };
        let load_s = self.models.stations.get(&run.station).map_or(0.0, |models| models.handling.load_s);
        let load_s = match run.stage {
            _ if run.under_way() => load_s,
            // It takes some while yet, however late it is.
            Stage::Loading => (load_s - self.now.seconds_since(run.start)).max(1.0),
            _ => 0.0,
        };
        Begun { bay, from_s, load_s, until_s }
    }

    /// When a recharge ends that has yet to begin, s, where the converters may feed it less by then than was planned.
    fn shared_end_s(&self, run: &ServiceRun) -> Option<f64> {
        let models = self.models.stations.get(&run.station).filter(|models| models.converter_w_max.is_finite())?;
        if !run.under_way() && run.stage != Stage::Loading {
            return None;
        }
        let (gauge, state) = self.fleet.robots.get(&run.robot).and_then(Robot::known)?;
        let battery = &self.battery(&run.robot, gauge, state)?;
        let begun = self.begun(run, 0.0);
        let drained_wh = self.until_taken_in_wh(run, state) + state.drain_w.value.max(0.0) * begun.load_s / S_PER_H;
        let drained = drained_wh / battery.battery().stored_wh();
        let table =
            self.table_beside(self.sharing(&run.station), &run.station, models, battery, warmed_degc(battery, gauge.temperature_degc));
        let charge_s = table.between((gauge.soc.value - drained).max(0.0), run.how.to_soc()?).charge_s;
        Some(begun.from_s + begun.load_s + charge_s + models.handling.unload_s)
    }

    /// When a service begins whose robot is under way, s.
    fn begins_s(&self, run: &ServiceRun) -> f64 {
        (run.start.seconds_since(self.now) + self.late_s(run)).max(0.0)
    }

    /// What a robot under way still draws until its service begins, Wh: the rest of its way, and work that waiting counts as.
    fn until_taken_in_wh(&self, run: &ServiceRun, state: &RobotState) -> f64 {
        let begins_s = self.begins_s(run);
        let worked_wh = state.drain_w.value * begins_s / S_PER_H;
        let way = state.travel.get(&run.station).filter(|way| run.stage == Stage::Travelling && way.time_s > 0.0);
        let extra_wh = way.map_or(0.0, |way| {
            let left = (run.start.seconds_since(self.now) / way.time_s).clamp(0.0, 1.0);
            left * (way.energy_wh.value - state.drain_w.value * way.time_s / S_PER_H)
        });
        (worked_wh + extra_wh).max(0.0)
    }

    /// What a service that has begun and ends then still takes: the charge that the robot still lacks, or the exchange alone. What the
    /// lift takes in its last moments goes with the time that is left: the packs are not asked for all of it within a second.
    pub(crate) fn still_needs(&self, run: &ServiceRun, models: &StationModels, ends_s: f64) -> Need {
        let handling = &models.handling;
        let left = |whole_s: f64| (ends_s / whole_s.max(1.0)).clamp(0.0, 1.0);
        let Some(to_soc) = run.how.to_soc() else {
            return self.exchange(&run.station, models).scaled(left(handling.swap_s));
        };
        let Some((gauge, state)) = self.fleet.robots.get(&run.robot).and_then(Robot::known) else { return run.need.clone() };
        let Some(battery) = &self.battery(&run.robot, gauge, state) else { return run.need.clone() };
        let factor = self.watch.wider(&Subject::Station(run.station.clone()));
        let table =
            self.table_beside(self.sharing(&run.station), &run.station, models, battery, warmed_degc(battery, gauge.temperature_degc));
        // Until it is in its bay it lives on its own pack, and that is charged as well.
        let drained_wh = if run.under_way() { self.until_taken_in_wh(run, state) } else { 0.0 };
        let drained = drained_wh / battery.battery().stored_wh();
        let soc = from_wire(gauge.soc);
        let need = table.need_to(Estimate::new((soc.value - drained).max(0.0), soc.sigma), to_soc, factor);
        if run.stage == Stage::Unloading { need.scaled(left(handling.load_s + handling.unload_s)) } else { need }
    }
}

/// The temperature at which a charge that goes on is looked up, °C: the battery has warmed itself, and a table would take that for the
/// warmth of what is around it.
pub(super) fn warmed_degc(battery: &Model, gauged_degc: f64) -> f64 {
    let [hot_degc, cold_degc] = uncritical_degc(battery);
    gauged_degc.clamp(cold_degc, hot_degc)
}
