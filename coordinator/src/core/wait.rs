//! Who waits for a place or a spare that does not come.

use proto::{BayPhase, EventKind, RobotId, RobotState, SpareId, StationId, Timestamp};

use super::Core;
use crate::fleet::Robot;
use crate::service_run::{How, ServiceRun, Stage};

impl Core {
    /// A robot whose own spare is still charged gets one that is ready, and who was promised that gets the other.
    pub(super) fn is_given(&mut self, now: Timestamp, robot: &RobotId, spare: SpareId) {
        let Some(run) = self.running.get_mut(robot) else { return };
        let station = run.station.clone();
        let How::Swap { spare: own } = &mut run.how else { return };
        let text = format!("{robot} gets {spare}, since {own} is still charged");
        let late = std::mem::replace(own, spare.clone());
        // What was promised of either place is now to be had in the other.
        for other in self.plan.planned.iter_mut().filter(|other| other.station == station) {
            if let Some(promised) = &mut other.spare {
                *promised = match () {
                    () if *promised == spare => late.clone(),
                    () if *promised == late => spare.clone(),
                    () => continue,
                };
            }
        }
        self.event(now, EventKind::PhaseChanged, Some(robot), Some(&station), None, text.clone());
        self.replan(text);
        self.refresh_schedule(now);
    }

    /// Why a robot waits no longer that should have been taken in: another station with a place for it is about to be out of its reach, by what its
    /// gauge is sure of.
    pub(super) fn waits_in_vain(&self, now: Timestamp, run: &ServiceRun, robot: &Robot) -> Option<String> {
        let late_s = now.seconds_since(run.start);
        // The next plan may give that bay to somebody who gave up waiting a moment ago.
        if run.stage != Stage::Waiting || late_s <= self.settings.deadline_s || self.gave_up_waiting {
            return None;
        }
        let (gauge, state) = robot.known()?;
        let battery = self.models.battery(&run.robot, &state.battery)?;
        let stock = self.basis(now).stock(&run.robot, gauge, state, battery);
        // For how long it can wait before it must set off.
        let longest = state.travel.iter().filter(|(station, _)| **station != run.station).filter_map(|(station, way)| {
            let handling = self.models.stations.get(station)?.handling;
            let (for_bay, for_spare) = self.has_room(now, run, state, station);
            let taken_in_s = if for_bay { handling.load_s } else { handling.swap_s };
            let waits_s = stock.lasts(Some(way), taken_in_s).surely_s - way.time_s;
            (for_bay || for_spare).then_some((waits_s, station))
        });
        let (longest_s, station) = longest.max_by(|a, b| a.0.total_cmp(&b.0))?;
        let is_last_chance = (0.0..self.settings.deadline_s + self.settings.resend_s).contains(&longest_s);
        is_last_chance.then(|| format!("not in its bay {:.0} min after it was due, and {station} will soon be out of reach", late_s / 60.0))
    }

    /// Whether a station has a bay, or a ready spare that fits, left for a robot that comes from another.
    fn has_room(&self, now: Timestamp, run: &ServiceRun, robot: &RobotState, station: &StationId) -> (bool, bool) {
        let Some(state) = self.fleet.stations.get(station).and_then(|known| known.known()) else { return (false, false) };
        let takes_in =
            state.powered && state.arrives.is_none() && state.away.is_empty() && self.refusals.holds(now, &run.robot, station).is_none();
        if !takes_in {
            return (false, false);
        }
        let here = || self.plan.planned.iter().filter(|planned| planned.station == *station);
        let is_taken = |bay: &proto::BayState| {
            let is_promised = || here().any(|planned| planned.bay.as_ref() == Some(&bay.bay));
            self.running.values().any(|other| other.is_in(station, &bay.bay)) || is_promised()
        };
        let for_bay = state.bays.iter().any(|bay| bay.phase == BayPhase::Free && !is_taken(bay));
        let is_given = |spare: &SpareId| {
            let is_promised = || here().any(|planned| planned.spare.as_ref() == Some(spare));
            self.running.values().any(|other| other.station == *station && other.how.spare() == Some(spare)) || is_promised()
        };
        let fitting = self.basis(now).ready_spares(station, &run.robot, robot);
        (for_bay, fitting.iter().any(|spare| !is_given(spare)))
    }
}
