//! What the coordinator before this one had promised: a restart, or another that takes over, breaks no word for that alone.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use proto::{Mode, RobotId, Schedule, Service, ServiceStatus, SpareId, StationId, Timestamp};

use super::Core;
use crate::models::from_wire;
use crate::scheduler::translate::{HORIZON_MAX_S, levels_soc};
use crate::scheduler::{Grounds, Plan, Planned};

/// The services of its last plan that can still be going on or to come.
#[derive(Debug, Default)]
pub(super) struct Before {
    services: BTreeMap<RobotId, Service>,
    /// Robots of which no plan of this coordinator has said yet what became of that.
    open: BTreeSet<RobotId>,
    /// What had not begun of it, as a plan: the first one moves no more of that than any other plan would.
    plan: Plan,
}

impl Before {
    /// Nothing of what was promised to that robot is still to be kept.
    pub(super) fn is_settled(&mut self, robot: &RobotId) {
        self.services.remove(robot);
        self.open.remove(robot);
    }
}

impl Core {
    /// The state of charge to which the coordinator before would have charged this robot at that station, if that can still be going on.
    pub(super) fn promised_soc(&self, now: Timestamp, robot: &RobotId, station: &StationId) -> Option<f64> {
        if let Mode::Recharge { to_soc } = self.was_promised(now, robot, station)?.mode { Some(to_soc) } else { None }
    }

    /// The spare that the coordinator before would have given this robot at that station, if that can still come.
    pub(super) fn promised_spare(&self, now: Timestamp, robot: &RobotId, station: &StationId) -> Option<SpareId> {
        if let Mode::Swap { spare } = &self.was_promised(now, robot, station)?.mode { Some(spare.clone()) } else { None }
    }

    fn was_promised(&self, now: Timestamp, robot: &RobotId, station: &StationId) -> Option<&Service> {
        self.before.services.get(robot).filter(|service| service.station == *station && self.is_current(now, service))
    }

    /// What should have been over by so long ago that it would have been given up is nobody's any more: its robot may have been serviced
    /// since, and work again. Nor is what ends later than anybody plans ahead: a clock was wrong.
    fn is_current(&self, now: Timestamp, service: &Service) -> bool {
        (-HORIZON_MAX_S..self.settings.late_s).contains(&now.seconds_since(service.end))
    }

    /// Takes over the promises of the coordinator before.
    pub(super) fn take_over(&mut self, now: Timestamp, schedule: &Schedule) {
        let current = schedule.services.iter().filter(|service| self.is_current(now, service));
        self.before.services = current.map(|service| (service.robot.clone(), service.clone())).collect();
        self.before.open = self.before.services.keys().cloned().collect();
        self.promised.extend(self.before.open.iter().cloned());
        let to_come = self.before.services.values().filter(|service| service.status == ServiceStatus::Planned && service.start > now);
        self.before.plan.planned = to_come.filter_map(|service| self.as_planned(service)).collect();
    }

    /// The plan that a new one keeps to: until there is a first one, that of the coordinator before.
    pub(super) fn plan_before(&self) -> &Plan {
        if self.schedule.plan == 0 { &self.before.plan } else { &self.plan }
    }

    /// Robots that were promised something and have not said yet how they stand.
    pub(super) fn silent_promised(&self) -> impl Iterator<Item = &RobotId> {
        self.before.open.iter().filter(|robot| self.fleet.robots.get(*robot).is_none_or(|one| one.known().is_none()))
    }

    /// A service as the planner calls it.
    fn as_planned(&self, service: &Service) -> Option<Planned> {
        let models = self.models.stations.get(&service.station)?;
        let (mode, spare, to_soc) = match &service.mode {
            Mode::Recharge { to_soc } => {
                let levels = levels_soc(&self.settings);
                let nearest = (0..levels.len()).min_by(|a, b| (levels[*a] - to_soc).abs().total_cmp(&(levels[*b] - to_soc).abs()))?;
                (planner::Mode::Charge(nearest as u8), None, *to_soc)
            }
            Mode::Swap { spare } => {
                let is_charged = models.spare_battery.is_some();
                let mode = if is_charged { planner::Mode::SwapAndRecharge } else { planner::Mode::Swap };
                (mode, Some(spare.clone()), self.settings.charge_to_soc)
            }
        };
        let need = from_wire(service.pack_energy_wh);
        let probability = service.probability.unwrap_or(1.0);
        Some(Planned {
            robot: service.robot.clone(),
            station: service.station.clone(),
            mode,
            bay: service.bay.clone(),
            spare,
            to_soc,
            leave: service.leave,
            start: service.start,
            end: service.end,
            need: energy::Need { mean_wh: need.value, own_variance: need.sigma.powi(2), ..energy::Need::default() },
            packs: service.packs.clone(),
            probability,
            covered: probability,
            why: Arc::clone(&service.why),
            grounds: Grounds::default(),
        })
    }

    /// What had been promised to those whom a plan has looked at is now its word, or that plan breaks it, or nobody needs it any more. Who is being
    /// serviced is in no plan's view, and what it is charged to holds on.
    pub(super) fn settle_promises(&mut self, plan: &Schedule) {
        let seen = self.solved.iter().flat_map(|solved| &solved.task.view.robots).map(|view| &view.robot);
        let told = plan.unserved.iter().map(|unserved| &unserved.robot);
        let settled: Vec<RobotId> = seen.chain(told).filter(|robot| self.before.open.contains(robot)).cloned().collect();
        for robot in settled {
            self.before.is_settled(&robot);
            if !plan.services.iter().any(|service| service.robot == robot) {
                self.promised.remove(&robot);
            }
        }
    }
}
