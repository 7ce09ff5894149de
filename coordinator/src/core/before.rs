//! What the coordinator before this one had promised: a restart, or another that takes over, breaks no word for that alone.

use std::collections::{BTreeMap, BTreeSet};

use proto::{Mode, RobotId, Schedule, Service, SpareId, StationId, Timestamp};

use super::Core;
use crate::scheduler::translate::HORIZON_MAX_S;

/// The services of its last plan that can still be going on or to come.
#[derive(Debug, Default)]
pub(super) struct Before {
    services: BTreeMap<RobotId, Service>,
    /// Robots of which no plan of this coordinator has said yet what became of that.
    open: BTreeSet<RobotId>,
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
