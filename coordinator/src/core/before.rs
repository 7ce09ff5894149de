//! What the coordinator before this one had promised: a restart, or another that takes over, breaks no word for that alone.

use std::collections::{BTreeMap, BTreeSet};

use proto::{Mode, RobotId, Schedule, Service, StationId, Timestamp};

use super::Core;

/// The services of its last plan that can still be going on or to come.
#[derive(Debug, Default)]
pub(super) struct Before {
    services: BTreeMap<RobotId, Service>,
    /// Robots of which no plan of this coordinator has said yet what became of that.
    open: BTreeSet<RobotId>,
}

impl Before {
    /// The recharge that this robot was promised at that station, and to which state of charge.
    pub(super) fn recharge(&self, robot: &RobotId, station: &StationId) -> Option<(&Service, f64)> {
        let service = self.services.get(robot).filter(|service| service.station == *station)?;
        if let Mode::Recharge { to_soc } = service.mode { Some((service, to_soc)) } else { None }
    }
}

impl Core {
    /// Takes over the promises of the coordinator before. What should have been over by so long ago that it would have been given up
    /// is nobody's any more: robots may have been serviced since, and work again.
    pub(super) fn take_over(&mut self, now: Timestamp, schedule: &Schedule) {
        let is_current = |service: &&Service| now.seconds_since(service.end) < self.settings.late_s;
        let services = schedule.services.iter().filter(is_current).map(|service| (service.robot.clone(), service.clone()));
        self.before.services = services.collect();
        self.before.open = self.before.services.keys().cloned().collect();
        self.promised.extend(self.before.open.iter().cloned());
    }

    /// What had been promised to whoever has been heard is now the word of a plan, or that plan breaks it, or nobody needs it any more.
    pub(super) fn settle_promises(&mut self, plan: &Schedule) {
        let heard = |robot: &RobotId| self.fleet.robots.get(robot).is_some_and(|robot| robot.known().is_some());
        let settled: Vec<RobotId> = self.before.open.iter().filter(|robot| heard(robot)).cloned().collect();
        for robot in settled {
            self.before.open.remove(&robot);
            if !plan.services.iter().any(|service| service.robot == robot) {
                self.promised.remove(&robot);
            }
        }
    }
}
