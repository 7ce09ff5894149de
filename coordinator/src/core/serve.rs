//! Begins services when their robots must leave, and carries them on as far as beliefs allow.

use proto::{BayId, BayPhase, BayState, EventKind, RobotAction, RobotId, RobotPhase, StationAction, StationId, Timestamp};

use super::leave::Leave;
use super::{Concerned, Core};
use crate::answers;
use crate::fleet::{Robot, Station};
use crate::models::from_wire;
use crate::scheduler::Planned;
use crate::service_run::{Again, How, ServiceRun, Stage, Step};

/// A robot whose station is no longer at its exchange knows of it after so long, s, however seldom that speaks: it hears it, or takes it for granted
/// where it does not. More than a robot's agent waits for that (`robot-agent/src/agent/host.rs`).
const CALLED_OFF_S: f64 = 120.0;

impl Core {
    /// Begins the services whose robots must leave now.
    pub(super) fn begin(&mut self, now: Timestamp) {
        let due: Vec<Planned> = self.plan.planned.iter().filter(|planned| planned.leave <= now).cloned().collect();
        for service in due {
            // Nobody is sent who does not hear it, nor to where nobody takes it in.
            let is_lost = self.fleet.robots.get(&service.robot).is_some_and(|robot| robot.is_lost())
                || self.fleet.stations.get(&service.station).is_some_and(|station| station.is_lost());
            if is_lost {
                continue;
            }
            // What a lift has begun ends first; then the robot is where it did not plan to be.
            if self.is_being_moved(now, &service.robot) {
                continue;
            }
            // Of two commands on their way at once the later one may come first.
            if self.has_to_answer(&service.robot) {
                continue;
            }
            let Planned { robot, station, bay, spare, to_soc, start, end, need, packs, why, .. } = service;
            let how = match (bay, spare) {
                (Some(bay), _) => How::Recharge { bay, to_soc },
                (None, Some(spare)) => How::Swap { spare },
                (None, None) => continue,
            };
            self.plan.planned.retain(|other| other.robot != robot);
            let left = now;
            let run = ServiceRun {
                robot: robot.clone(),
                station: station.clone(),
                how,
                left,
                start,
                end,
                need,
                packs,
                why,
                stage: Stage::Travelling,
                asked: None,
                hands_over: None,
                takes_none_since: None,
                called_off_since: None,
                cut_short: None,
                again: None,
            };
            let action = run.first();
            self.event(now, EventKind::ServiceStarted, Some(&robot), Some(&station), None, format!("{robot} goes to {station}"));
            self.running.insert(robot.clone(), run);
            self.ask_robot(now, &robot, action, Some((robot.clone(), Stage::Travelling)));
            self.refresh_schedule(now);
        }
    }

    /// Carries on the services that a message concerns as far as the newest beliefs allow.
    pub(super) fn carry_on(&mut self, now: Timestamp, concerned: &Concerned) {
        let robots: Vec<RobotId> = match concerned {
            Concerned::Robot(robot) => self.running.contains_key(robot).then(|| robot.clone()).into_iter().collect(),
            Concerned::Station(station) => {
                self.running.values().filter(|run| run.station == *station).map(|run| run.robot.clone()).collect()
            }
            Concerned::Everybody => self.running.keys().cloned().collect(),
        };
        for robot in robots {
            self.note_charge(now, &robot);
            let Some(run) = self.running.get(&robot) else { continue };
            if run.asked.is_some() {
                continue;
            }
            let station = run.station.clone();
            let (Some(belief), Some(place)) = (self.fleet.robots.get(&robot), self.fleet.stations.get(&station)) else { continue };
            let late_s = now.seconds_since(run.start);
            if run.before_bay() && late_s > self.settings.late_s {
                let why = format!("not in its bay {:.0} min after it was due", late_s / 60.0);
                self.refusals.note(now, &robot, &station, run.stage != Stage::Travelling, why.clone());
                self.fail(now, &robot, &why);
                continue;
            }
            if let Some(why) = self.waits_in_vain(now, run, belief) {
                self.gave_up_waiting = true;
                self.refusals.note(now, &robot, &station, true, why.clone());
                self.fail(now, &robot, &why);
                continue;
            }
            let too_late = self.comes_too_late(now, run, place);
            if let Some(leave) = too_late.or_else(|| out_of_order(run, place).map(Leave::Otherwise)) {
                let why = self.why_left(now, &robot, &station, leave);
                self.fail(now, &robot, &why);
                continue;
            }
            if let Some(why) = self.does_not_come(now, run, belief) {
                self.refusals.note(now, &robot, &station, false, why.clone());
                self.fail(now, &robot, &why);
                continue;
            }
            if let Some(why) = self.does_not_end(now, run) {
                self.give_up(now, &robot, &why);
                continue;
            }
            let in_vain = self.charged_in_vain(now, run, belief).map(Leave::Otherwise);
            if let Some(leave) = in_vain.or_else(|| self.must_be_out(now, run, belief, place)) {
                self.let_go(now, &robot, leave);
                continue;
            }
            if self.keeps_others_out(now, run, belief, place) {
                self.give_up(now, &robot, "it is not heard, and others want its bay");
                continue;
            }
            // Nothing of this service can free it there; it is taken over as it stands.
            if let Some((taker, bay)) = self.taken_elsewhere(run, belief) {
                self.give_up(now, &robot, &format!("it was taken into {bay} of {taker}"));
                continue;
            }
            if let Some(bay) = self.another_bay(run, belief, place) {
                self.is_in(now, &robot, bay);
                continue;
            }
            if let Some(spare) = belief.known().and_then(|(_, state)| self.basis(now).ready_instead(run, state)) {
                self.is_given(now, &robot, spare);
                continue;
            }
            let unchanged = run.again.as_ref().filter(|again| again.phase == belief.phase());
            let is_early = unchanged.is_some_and(|again| now < again.at);
            if let Some(action) = self.asked_again(now, run, belief).filter(|_| !is_early) {
                let (stage, again) = (run.stage, self.again(now, belief, "it takes no charge"));
                if stage != Stage::Travelling {
                    self.running.entry(robot.clone()).and_modify(|run| run.again = Some(again));
                }
                self.ask_robot(now, &robot, action, Some((robot.clone(), stage)));
                continue;
            }
            // Who has refused to come for now is where it was.
            if unchanged.is_some() && run.stage == Stage::Travelling {
                continue;
            }
            match run.next(belief, place) {
                Step::AskRobot(..) | Step::AskStation(..) if is_early => {}
                // Somebody else stands in it, though the station calls it free.
                Step::AskStation(StationAction::Dock { ref bay, .. }, _) if self.stands_in(&robot, &station, bay) => {}
                Step::Wait => {}
                Step::Enter(stage) => self.enter(now, &robot, stage),
                Step::AskRobot(action, stage) => self.ask_robot(now, &robot, action, Some((robot.clone(), stage))),
                Step::AskStation(action, stage) => self.ask_station(now, &station, action, Some((robot, stage))),
                Step::Done => self.done(now, &robot),
                Step::Fail(why) => self.fail(now, &robot, &why),
            }
        }
        let stations: Vec<StationId> = match concerned {
            Concerned::Robot(_) => Vec::new(),
            Concerned::Station(station) => vec![station.clone()],
            Concerned::Everybody => self.models.stations.keys().cloned().collect(),
        };
        self.select_packs(now, &stations);
    }

    /// Why a robot that has agreed to come is not waited for: when it should be there it is still at work.
    fn does_not_come(&self, now: Timestamp, run: &ServiceRun, robot: &Robot) -> Option<String> {
        let works_on = run.stage == Stage::Travelling && robot.heard().is_some() && robot.phase() == Some(RobotPhase::Working);
        let is_due = run.again.is_none() && now.seconds_since(run.start.max(run.left)) > self.settings.deadline_s;
        (works_on && is_due).then(|| format!("{} agreed to come and is still at work", run.robot))
    }

    /// Whether another robot says that it stands in that bay.
    fn stands_in(&self, robot: &RobotId, station: &StationId, bay: &BayId) -> bool {
        self.fleet.robots.iter().filter(|(other, _)| *other != robot).filter_map(|(_, other)| other.heard()).any(|(_, state)| {
            let is_in_a_bay = matches!(state.phase, RobotPhase::Docked | RobotPhase::Charging | RobotPhase::Charged);
            is_in_a_bay && state.station.as_ref() == Some(station) && state.bay.as_ref() == Some(bay)
        })
    }

    /// Why a service is given up that nobody ends: an exchange, or a bay that is to be emptied.
    fn does_not_end(&self, now: Timestamp, run: &ServiceRun) -> Option<String> {
        // It may say so a moment later, or earlier, than its robot.
        if run.called_off_since.is_some_and(|since| now.seconds_since(since) > self.settings.deadline_s.max(CALLED_OFF_S)) {
            return Some(format!("{} has called its exchange off", run.station));
        }
        let what = match run.stage {
            Stage::Swapping => "its exchange",
            Stage::Unloading | Stage::LetOut => "its way out of the bay",
            Stage::ChargingItself if self.fleet.robots.get(&run.robot).and_then(Robot::phase) == Some(RobotPhase::Charged) => {
                "its way out of a bay that its station calls free"
            }
            _ => return None,
        };
        let late_s = now.seconds_since(run.end);
        (late_s > self.settings.late_s).then(|| format!("{what} has not ended {:.0} min after it was due", late_s / 60.0))
    }

    /// What a robot is asked once more: to come, where it could not at the moment; in its bay to get out, where it was to, and to charge where it does
    /// not.
    fn asked_again(&self, now: Timestamp, run: &ServiceRun, robot: &Robot) -> Option<RobotAction> {
        match (&run.how, run.stage, robot.heard().map(|(_, state)| state.phase)?) {
            (_, Stage::Travelling, phase) if run.again.as_ref().is_some_and(|again| again.phase == Some(phase)) => Some(run.first()),
            (_, Stage::Charging | Stage::ChargingItself, RobotPhase::Docked | RobotPhase::Charging) if run.cut_short.is_some() => {
                Some(RobotAction::Undock)
            }
            (How::Recharge { to_soc, .. }, Stage::Charging | Stage::ChargingItself, RobotPhase::Docked)
                if run.takes_none_since.is_some_and(|since| now.seconds_since(since) > self.settings.deadline_s) =>
            {
                Some(RobotAction::ChargeTo { soc: *to_soc })
            }
            _ => None,
        }
    }

    /// When a robot is asked for something once more, if it goes on as it does.
    pub(super) fn again(&self, now: Timestamp, robot: &Robot, why: &str) -> Again {
        Again { at: now.plus_s(self.settings.deadline_s), times: 1, why: why.to_owned(), phase: robot.phase() }
    }

    /// The bay in which station and robot say that it is, if that is another than it was told, and nobody else's.
    fn another_bay(&self, run: &ServiceRun, robot: &Robot, station: &Station) -> Option<BayId> {
        let (How::Recharge { bay: own, .. }, Stage::Loading | Stage::Charging | Stage::ChargingItself) = (&run.how, run.stage) else {
            return None;
        };
        let is_in_a_bay = matches!(robot.phase(), Some(RobotPhase::Docked | RobotPhase::Charging | RobotPhase::Charged));
        let mut holds =
            station.heard().filter(|_| is_in_a_bay)?.bays.iter().filter(|bay| bay.robot.as_ref() == Some(&run.robot)).peekable();
        let found = holds.peek()?.bay.clone();
        let is_free = !self.running.values().any(|other| other.at_place() && other.is_in(&run.station, &found));
        (is_free && holds.all(|bay| bay.bay != *own && bay.phase == BayPhase::Occupied)).then_some(found)
    }

    /// A robot is in another bay of its station than it was told: the station knows. Who was to come into that gets the other one.
    fn is_in(&mut self, now: Timestamp, robot: &RobotId, bay: BayId) {
        let Some(run) = self.running.get_mut(robot) else { return };
        let station = run.station.clone();
        let How::Recharge { bay: own, .. } = &mut run.how else { return };
        let text = format!("{robot} is in {bay}, not in {own}");
        let free = std::mem::replace(own, bay.clone());
        for other in self.running.values_mut().filter(|other| other.robot != *robot && other.is_in(&station, &bay)) {
            if let How::Recharge { bay, .. } = &mut other.how {
                *bay = free.clone();
            }
        }
        self.event(now, EventKind::PhaseChanged, Some(robot), Some(&station), None, text.clone());
        self.replan(text);
        self.refresh_schedule(now);
    }

    /// Notes since when a robot takes no charge, or waits for an exchange that its station is not at.
    fn note_charge(&mut self, now: Timestamp, robot: &RobotId) {
        let (Some(run), Some(belief)) = (self.running.get_mut(robot), self.fleet.robots.get(robot)) else { return };
        let none = belief.known().is_some_and(|(gauge, state)| run.takes_no_charge(gauge, state));
        run.takes_none_since = none.then(|| run.takes_none_since.unwrap_or(now));
        let is_left = |state: &proto::StationState| state.swapping.as_ref() != Some(robot);
        let is_off = run.stage == Stage::Swapping
            && belief.heard().is_some_and(|(_, state)| state.phase == RobotPhase::Swapping)
            && self.fleet.stations.get(&run.station).and_then(Station::heard).is_some_and(is_left);
        run.called_off_since = is_off.then(|| run.called_off_since.unwrap_or(now));
    }

    /// Why a robot is let go although it is not charged: it should be, and has taken nothing for long.
    fn charged_in_vain(&self, now: Timestamp, run: &ServiceRun, robot: &Robot) -> Option<String> {
        let since = run.takes_none_since.filter(|_| run.cut_short.is_none())?;
        let since = Some(since).filter(|&since| now.seconds_since(since.max(run.end)) > self.settings.late_s)?;
        let why = robot.known().and_then(|(_, state)| state.note.as_deref()).unwrap_or("its charger gives nothing");
        Some(format!("it has taken none for {:.0} min ({why})", now.seconds_since(since) / 60.0))
    }

    /// Whether a robot that is lost on its way keeps a free bay from those who come after it. Nobody can let
    /// it in before it is heard again; then it is planned for where it stands.
    fn keeps_others_out(&self, now: Timestamp, run: &ServiceRun, robot: &Robot, station: &Station) -> bool {
        let How::Recharge { bay, .. } = &run.how else { return false };
        let wanted = |planned: &Planned| planned.station == run.station && planned.bay.as_ref() == Some(bay);
        run.under_way()
            && robot.is_lost()
            && now.seconds_since(run.start) > self.settings.deadline_s
            && station.bay_phase(bay) == Some(BayPhase::Free)
            && !self.running.values().any(|other| other.at_place() && other.is_in(&run.station, bay))
            && self.plan.planned.iter().any(wanted)
    }

    /// The bay in which a station says that it holds a robot that is on its way to another: by an order from before
    /// this coordinator, or by themselves.
    fn taken_elsewhere(&self, run: &ServiceRun, robot: &Robot) -> Option<(StationId, BayId)> {
        let on_its_way = run.under_way() || run.stage == Stage::ChargingItself;
        let is_in_a_bay = matches!(robot.phase(), Some(RobotPhase::Docked | RobotPhase::Charging | RobotPhase::Charged));
        if !on_its_way || !is_in_a_bay {
            return None;
        }
        let holds = |bay: &&BayState| bay.robot.as_ref() == Some(&run.robot) && bay.phase == BayPhase::Occupied;
        let places = self.fleet.stations.iter().filter_map(|(id, station)| Some((id, station.known()?)));
        let mut holders = places.flat_map(|(id, state)| state.bays.iter().filter(holds).map(move |bay| (id, &bay.bay))).peekable();
        let (taker, bay) = holders.peek().copied()?;
        let none_is_ours = holders.all(|(taker, bay)| !run.is_in(taker, bay));
        none_is_ours.then(|| (taker.clone(), bay.clone()))
    }

    pub(super) fn enter(&mut self, now: Timestamp, robot: &RobotId, stage: Stage) {
        if let Some(run) = self.running.get_mut(robot) {
            if stage == Stage::Handing {
                run.hands_over = self.fleet.robots.get(robot).and_then(|robot| robot.gauge.as_ref()).map(|gauge| from_wire(gauge.soc));
            }
            run.enter(stage, now);
            if matches!(stage, Stage::Charging | Stage::ChargingItself | Stage::Swapping) {
                self.refusals.forget(robot, &run.station);
            }
            self.refresh_schedule(now);
        }
    }

    pub(super) fn done(&mut self, now: Timestamp, robot: &RobotId) {
        if let Some(run) = self.running.remove(robot) {
            self.promised.remove(robot);
            self.before.is_settled(robot);
            self.event(now, EventKind::ServiceDone, Some(robot), Some(&run.station), None, format!("{robot} is serviced"));
            self.replan(format!("{robot} is serviced"));
        }
    }

    /// Gives a service up, and leaves robot and station as they are.
    pub(super) fn give_up(&mut self, now: Timestamp, robot: &RobotId, why: &str) -> Option<ServiceRun> {
        let run = self.running.remove(robot)?;
        self.event(now, EventKind::ServiceFailed, Some(robot), Some(&run.station), None, format!("{robot}: {why}"));
        if self.promised.remove(robot) {
            self.event(now, EventKind::PromiseBroken, Some(robot), Some(&run.station), None, format!("{robot}: {why}"));
        }
        if matches!(run.how, How::Swap { .. }) {
            self.before.is_settled(robot);
        }
        self.replan(format!("the service of {robot} failed: {why}"));
        Some(run)
    }

    /// Gives a service up, and frees robot and bay from it as far as they can be. What a station has
    /// begun is never cut short: a robot that drives off from under a lift is a broken robot.
    pub(super) fn fail(&mut self, now: Timestamp, robot: &RobotId, why: &str) {
        let Some(run) = self.give_up(now, robot, why) else { return };
        let phase = self.fleet.robots.get(robot).and_then(Robot::phase);
        let powered = self.fleet.stations.get(&run.station).and_then(Station::heard).is_some_and(|state| state.powered);
        match (phase, &run.how) {
            (Some(RobotPhase::Travelling | RobotPhase::Waiting), _) if matches!(run.stage, Stage::Travelling | Stage::Waiting) => {
                self.ask_robot(now, robot, RobotAction::Undock, None);
            }
            (Some(RobotPhase::Docked | RobotPhase::Charging | RobotPhase::Charged), How::Recharge { bay, .. }) if powered => {
                self.ask_robot(now, robot, RobotAction::Undock, None);
                let undock = StationAction::Undock { robot: robot.clone(), bay: bay.clone() };
                self.ask_station(now, &run.station, undock, None);
            }
            _ => {}
        }
    }

    /// Hands stations over to their next pack before the active one gives out.
    fn select_packs(&mut self, now: Timestamp, stations: &[StationId]) {
        for id in stations {
            let Some(next) = answers::next_pack(&self.basis(now), id) else { continue };
            // The station's word that it has switched takes a while: ask again only after that.
            let waiting = self.selected.get(id).is_some_and(|asked| now.seconds_since(*asked) < self.settings.deadline_s);
            if !waiting {
                self.selected.insert(id.clone(), now);
                self.ask_station(now, id, StationAction::SelectPack { pack: next }, None);
            }
        }
    }
}

/// Why a robot in a bay is let go: the bay has failed, and gives it nothing.
fn out_of_order(run: &ServiceRun, station: &Station) -> Option<String> {
    let How::Recharge { bay, .. } = &run.how else { return None };
    let has_failed = run.takes_none_since.is_some() && station.bay_phase(bay) == Some(BayPhase::Failed);
    has_failed.then(|| format!("bay {bay} is out of order"))
}
