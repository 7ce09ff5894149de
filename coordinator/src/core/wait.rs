//! Who waits for a place that does not come.

use proto::{BayPhase, StationId, Timestamp};

use super::Core;
use crate::fleet::Robot;
use crate::service_run::{ServiceRun, Stage};

impl Core {
    /// Why a robot waits no longer that should have been taken in: another station with a free bay is about to be out of its reach, by what its
    /// gauge is sure of.
    pub(super) fn waits_in_vain(&self, now: Timestamp, run: &ServiceRun, robot: &Robot) -> Option<String> {
        let late_s = now.seconds_since(run.start);
        // The next plan may give that bay to somebody who gave up waiting a moment ago.
        if run.stage != Stage::Waiting || late_s <= self.settings.deadline_s || self.gave_up_waiting {
            return None;
        }
        let (gauge, state) = robot.known()?;
        let battery = self.models.battery(&run.robot, &state.battery)?;
        let lasts_s = self.basis(now).surely_lasts_s(&run.robot, gauge, state, battery);
        // For how long it can wait before it must set off.
        let longest = state.travel.iter().filter(|(station, _)| **station != run.station).filter_map(|(station, way)| {
            let waits_s = lasts_s - self.models.stations.get(station)?.handling.load_s - way.time_s;
            self.has_room(now, run, station).then_some((waits_s, station))
        });
        let (longest_s, station) = longest.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let is_last_chance = (0.0..self.settings.deadline_s + self.settings.resend_s).contains(&longest_s);
        is_last_chance.then(|| format!("not in its bay {:.0} min after it was due, and {station} will soon be out of reach", late_s / 60.0))
    }

    /// Whether a station has a bay to spare for a robot that comes from another.
    fn has_room(&self, now: Timestamp, run: &ServiceRun, station: &StationId) -> bool {
        let Some(state) = self.fleet.stations.get(station).and_then(|known| known.known()) else { return false };
        let is_taken = |bay: &proto::BayState| {
            let is_promised =
                || self.plan.planned.iter().any(|planned| planned.station == *station && planned.bay.as_ref() == Some(&bay.bay));
            self.running.values().any(|other| other.is_in(station, &bay.bay)) || is_promised()
        };
        state.powered
            && state.arrives.is_none()
            && state.away.is_empty()
            && self.refusals.holds(now, &run.robot, station).is_none()
            && state.bays.iter().any(|bay| bay.phase == BayPhase::Free && !is_taken(bay))
    }
}
