//! Who is lost, who is back, and who is written off: `fleet.rs` says what these words mean.

use std::collections::BTreeSet;

use proto::{EventKind, PackId, RobotId, StationId, Timestamp};

use super::Core;
use crate::fleet::{Fleet, STATION_WRITTEN_OFF_S, WRITTEN_OFF_S};
use crate::trust::Owner;

impl Core {
    /// Takes in that a robot is there to be heard, or not; whether that is new.
    pub(super) fn robot_alive(&mut self, now: Timestamp, id: &RobotId, alive: bool) -> bool {
        let Some(robot) = self.fleet.robots.get_mut(id) else { return false };
        let new = robot.is_lost() == alive;
        if new {
            robot.lost_since = if alive { None } else { Some(now) };
            // Who was lost for a moment is planned for as before.
            let was_written_off = std::mem::take(&mut robot.written_off) && alive;
            let (kind, verb) = if alive { (EventKind::Joined, "is back") } else { (EventKind::Lost, "was lost") };
            self.event(now, kind, Some(id), None, None, format!("{id} {verb}"));
            if alive {
                self.trust.back(now, &Owner::Robot(id.clone()));
                self.fleet.robots.entry(id.clone()).or_default().is_anew = [true; 2];
            }
            if was_written_off {
                self.replan(format!("{id} {verb}"));
            }
        }
        new
    }

    /// The same of a station.
    pub(super) fn station_alive(&mut self, now: Timestamp, id: &StationId, alive: bool) -> bool {
        let Some(station) = self.fleet.stations.get_mut(id) else { return false };
        let new = station.is_lost() == alive;
        if new {
            station.lost_since = if alive { None } else { Some(now) };
            let was_written_off = std::mem::take(&mut station.written_off) && alive;
            let packs: Vec<PackId> = station.packs.keys().cloned().collect();
            let (kind, verb) = if alive { (EventKind::Joined, "is back") } else { (EventKind::Lost, "was lost") };
            self.event(now, kind, None, Some(id), None, format!("{id} {verb}"));
            if alive {
                let station = self.fleet.stations.entry(id.clone()).or_default();
                (station.is_anew, station.packs_anew) = (true, packs.iter().cloned().collect());
                packs.into_iter().for_each(|pack| self.trust.back(now, &Owner::Pack(id.clone(), pack)));
            }
            if was_written_off {
                self.replan(format!("{id} {verb}"));
            }
        }
        new
    }

    /// Writes off whom nobody waits for any longer: who was promised a service is waited for until it would have to leave for it, and a
    /// station until somebody would have to leave for it.
    pub(super) fn write_off_the_lost(&mut self, now: Timestamp) {
        let lasts = |since: Option<Timestamp>, least_s: f64| since.is_some_and(|since| now.seconds_since(since) >= least_s);
        let Fleet { robots, stations } = &self.fleet;
        let robots = robots.iter().filter(|(_, one)| !one.written_off && lasts(one.lost_since, WRITTEN_OFF_S));
        let robots: Vec<&RobotId> = robots.map(|(id, _)| id).collect();
        let stations = stations.iter().filter(|(_, one)| !one.written_off && lasts(one.lost_since, WRITTEN_OFF_S));
        let stations: Vec<(&StationId, bool)> = stations.map(|(id, one)| (id, lasts(one.lost_since, STATION_WRITTEN_OFF_S))).collect();
        if robots.is_empty() && stations.is_empty() {
            return;
        }
        let waited: BTreeSet<&RobotId> = self.plan.planned.iter().filter(|one| one.leave > now).map(|one| &one.robot).collect();
        let robots: Vec<RobotId> = robots.into_iter().filter(|id| !waited.contains(id)).cloned().collect();
        let is_due = |id: &StationId| {
            let mut there = self.plan.planned.iter().filter(|one| one.station == *id).peekable();
            there.peek().is_none() || there.any(|one| one.leave <= now)
        };
        let stations: Vec<StationId> = stations.into_iter().filter(|(id, long)| *long || is_due(id)).map(|(id, _)| id.clone()).collect();
        for id in robots {
            self.fleet.robots.entry(id.clone()).or_default().written_off = true;
            self.replan(format!("{id} was lost"));
        }
        for id in stations {
            self.fleet.stations.entry(id.clone()).or_default().written_off = true;
            self.replan(format!("{id} was lost"));
        }
    }
}
