//! Takes in what robots and stations say: the newest word of each, and what changed with it.

use std::collections::BTreeMap;

use proto::{BayPhase, EventKind, Gauge, PackId, PackState, RobotId, RobotPhase, RobotState, SpareId, StationId, StationState, Timestamp};

use super::Core;
use super::refused::kind_of_refusal;
use crate::clocks::Agent;
use crate::fleet::{LeftPack, Robot, Station, is_news};
use crate::models::from_wire;
use crate::service_run::{How, ServiceRun, Stage};
use crate::store::Record;
use crate::trust::Owner;
use crate::watch::{Change, News};
use crate::when::{self, minute_from};

/// Each says whether there was anything new.
impl Core {
    pub(super) fn robot_gauge(&mut self, now: Timestamp, id: &RobotId, gauge: Gauge) -> bool {
        let robot = self.fleet.robots.entry(id.clone()).or_default();
        let known = robot.gauge.as_ref().map(|known| (known.at, known.seq));
        if !is_news(now, (gauge.at, gauge.seq), known, robot.is_anew[0] || robot.is_lost()) {
            return false;
        }
        let first = robot.gauge.is_none();
        (robot.gauge, robot.is_anew[0]) = (Some(gauge.clone()), false);
        let phase = robot.phase();
        let swapped = phase == Some(RobotPhase::Swapping)
            || self.running.get(id).is_some_and(|run| matches!(run.how, How::Swap { .. }) && run.stage == Stage::Swapping);
        let owner = Owner::Robot(id.clone());
        let works = matches!(phase, Some(RobotPhase::Working | RobotPhase::Travelling));
        self.trust.heard(now, &owner, &gauge, works, swapped);
        self.doubt_gauge(now, &owner);
        self.heard_clock(now, &Agent::Robot(id.clone()), gauge.at);
        let name = self.fleet.robots[id].state.as_ref().map(|state| state.battery.as_str());
        let model = name.and_then(|name| self.models.battery(id, name));
        let news = self.watch.robot_gauge(id, model, &gauge);
        self.record(Record::RobotGauge { robot: id.clone(), gauge });
        if first {
            self.heard_robot(now, id);
        }
        self.doubted(now, news);
        true
    }

    pub(super) fn robot_state(&mut self, now: Timestamp, id: &RobotId, state: RobotState) -> bool {
        if self.models.battery(id, &state.battery).is_none() {
            self.refuse(
                now,
                format!(
                    "robot {id} is not configured, and its battery `{}` is neither built in nor in [batteries]: add it to [robots]",
                    state.battery
                ),
            );
            return false;
        }
        let robot = self.fleet.robots.entry(id.clone()).or_default();
        let known = robot.state.as_ref().map(|known| (known.at, known.seq));
        if !is_news(now, (state.at, state.seq), known, robot.is_anew[1] || robot.is_lost()) {
            return false;
        }
        let before = robot.phase();
        let phase = state.phase;
        robot.says(state.clone());
        self.robot_alive(now, id, true);
        self.fleet.robots.entry(id.clone()).or_default().is_anew[1] = false;
        let news = self.watch.robot_state(id, &state);
        self.doubted(now, news);
        self.record(Record::RobotState { robot: id.clone(), state: state.clone() });
        match before {
            None => self.heard_robot(now, id),
            Some(before) if before != phase => {
                self.event(now, EventKind::PhaseChanged, Some(id), None, None, format!("{id}: {before} -> {phase}"));
            }
            Some(_) => {}
        }
        if phase == RobotPhase::Stranded && before != Some(phase) {
            let why = state.note.map_or_else(String::new, |note| format!(": {note}"));
            self.event(now, EventKind::RobotStranded, Some(id), None, None, format!("{id} ran empty and cannot go on{why}"));
            self.replan(format!("{id} is stranded"));
        }
        true
    }

    pub(super) fn heard_robot(&mut self, now: Timestamp, id: &RobotId) {
        if self.fleet.robots.get(id).is_some_and(|robot| robot.known().is_some()) {
            let other = self.other_battery(id);
            self.event(now, EventKind::Joined, Some(id), None, None, format!("{id} joined{other}"));
            self.replan(format!("{id} joined"));
        }
    }

    /// In words, where a robot counts its charge by another battery model than it is planned with: one of the two configurations is older,
    /// or its battery is another one than somebody thinks.
    fn other_battery(&self, id: &RobotId) -> String {
        let told = self.fleet.robots.get(id).and_then(|robot| robot.state.as_ref()).map(|state| state.battery.as_str());
        match (told, self.models.robots.get(id)) {
            (Some(told), Some(planned)) if planned.name != told => {
                format!(
                    ": its agent counts its charge by the battery model `{told}`, and it is planned with `{}` (robots.{id})",
                    planned.name
                )
            }
            _ => String::new(),
        }
    }

    pub(super) fn station_state(&mut self, now: Timestamp, id: &StationId, state: StationState) -> bool {
        if !self.models.stations.contains_key(id) {
            self.refuse(now, format!("station {id} is not configured"));
            return false;
        }
        let station = self.fleet.stations.entry(id.clone()).or_default();
        let known = station.state.as_ref().map(|known| (known.at, known.seq));
        if !is_news(now, (state.at, state.seq), known, station.is_anew || station.is_lost()) {
            return false;
        }
        self.record(Record::StationState { station: id.clone(), state: state.clone() });
        let state = Station::on_own_clock(state, self.clocks.told_ahead_s(&Agent::Station(id.clone())));
        let station = self.fleet.stations.entry(id.clone()).or_default();
        let before = station.state.replace(state.clone());
        self.station_alive(now, id, true);
        let station = self.fleet.stations.entry(id.clone()).or_default();
        station.is_anew = false;
        if let Some(before) = &before {
            station.is_brought(before, &state);
            let relieved = before.active_pack.clone().filter(|_| before.active_pack != state.active_pack);
            station.relieved = relieved.map(|pack| (pack, now)).or(station.relieved.take());
        }
        let here = self.running.values().filter(|run| run.station == *id);
        let taken: BTreeMap<&SpareId, &ServiceRun> = here.filter_map(|run| Some((run.how.spare()?, run))).collect();
        for spare in &state.spares {
            if spare.ready {
                station.left.remove(&spare.spare);
                continue;
            }
            // A pack that a robot left stands in its place from when that is first heard of.
            let soc = || {
                let run = taken.get(&spare.spare)?;
                let gauged = || Some(from_wire(self.fleet.robots.get(&run.robot)?.gauge.as_ref()?.soc));
                run.hands_over.or_else(gauged)
            };
            station.left.entry(spare.spare.clone()).or_insert_with(|| LeftPack { since: now, soc: soc() });
        }
        for away in state.packs.iter().filter(|pack| !pack.connected) {
            let owner = Owner::Pack(id.clone(), away.pack.clone());
            if self.trust.forget(&owner) {
                let text = format!("what the gauge of {owner} was doubted of is gone with it");
                self.event(now, EventKind::GaugeTrusted, None, Some(id), Some(&away.pack), text);
            }
        }
        let Some(before) = before else {
            let modelled = &self.models.stations[id].packs;
            let unknown: Vec<String> = state.packs.iter().filter(|p| !modelled.contains_key(&p.pack)).map(|p| p.pack.to_string()).collect();
            if !unknown.is_empty() {
                self.refuse(
                    now,
                    format!("station {id}: no model is configured for {}; they are left out of every plan", unknown.join(", ")),
                );
            }
            self.event(now, EventKind::Joined, None, Some(id), None, format!("{id} joined"));
            self.replan(format!("{id} joined"));
            return true;
        };
        let told = |state: &StationState| {
            (state.bays.clone(), state.lift_busy, [state.powered, state.arrives.is_some()], state.active_pack.clone(), state.packs.clone())
        };
        if told(&before) != told(&state) {
            let news = self.watch.station_changed(id, &before, &state);
            self.doubted(now, news);
        }
        let comes = |was: &PackState| !was.connected && state.packs.iter().any(|is| is.pack == was.pack && is.connected);
        if state.powered && (!before.powered || before.packs.iter().any(comes)) {
            self.refusals.forget_all_at(id);
        }
        if before.powered && !state.powered {
            self.event(now, EventKind::StationDark, None, Some(id), None, format!("{id} has no power left"));
            self.replan(format!("{id} has no power left"));
        }
        if before.active_pack != state.active_pack
            && let Some(pack) = &state.active_pack
        {
            self.event(now, EventKind::PackSelected, None, Some(id), Some(pack), format!("{id} runs on {pack}"));
            self.replan(format!("{id} switched to {pack}"));
        }
        if before.arrives != state.arrives {
            let when = state.arrives.map_or_else(|| "has arrived".to_owned(), |at| format!("arrives at {}", minute_from(now, at)));
            self.replan(format!("{id} {when}"));
        }
        if before.away != state.away {
            self.replan(format!("{id} {}", when::away(now, &state.away)));
        }
        self.bays_changed(now, id, &before, &state);
        for was in &before.packs {
            let Some(is) = state.packs.iter().find(|is| is.pack == was.pack) else {
                self.replan(format!("{} of {id} is no longer listed", was.pack));
                continue;
            };
            if is.back != was.back && is.connected == was.connected {
                self.replan(format!("{} of {id} is expected at another time", is.pack));
            }
            if is.connected != was.connected {
                self.replan(format!("{} of {id} {}", is.pack, if is.connected { "is there again" } else { "is away" }));
            }
            if is.depleted && !was.depleted {
                self.event(now, EventKind::PackDepleted, None, Some(id), Some(&is.pack), format!("{} of {id} is depleted", is.pack));
                self.replan(format!("{} of {id} is depleted", is.pack));
            }
        }
        true
    }

    /// Tells which bays have failed, or work again.
    fn bays_changed(&mut self, now: Timestamp, id: &StationId, before: &StationState, state: &StationState) {
        for is in &state.bays {
            let failed = |phase: BayPhase| phase == BayPhase::Failed;
            let Some(was) = before.bays.iter().find(|was| was.bay == is.bay && failed(was.phase) != failed(is.phase)) else { continue };
            let whom = was.robot.as_ref().or(is.robot.as_ref()).map(|robot| format!(" ({robot} is in it)")).unwrap_or_default();
            let text = format!(
                "{} of {id} {}",
                is.bay,
                if failed(is.phase) { format!("is out of order{whom}") } else { "works again".to_owned() }
            );
            if !failed(is.phase) {
                self.refusals.forget_all_at(id);
            }
            self.event(now, EventKind::PhaseChanged, is.robot.as_ref(), Some(id), None, text.clone());
            self.replan(text);
        }
    }

    pub(super) fn pack_gauge(&mut self, now: Timestamp, id: &StationId, pack: PackId, gauge: Gauge) -> bool {
        if !self.models.stations.contains_key(id) {
            return false;
        }
        let station = self.fleet.stations.entry(id.clone()).or_default();
        let known = station.packs.get(&pack).map(|known| (known.at, known.seq));
        if !is_news(now, (gauge.at, gauge.seq), known, station.packs_anew.contains(&pack) || station.is_lost()) {
            return false;
        }
        station.packs_anew.remove(&pack);
        let was_known = station.known().is_some();
        let feeds = station.state.as_ref().is_some_and(|state| state.powered && state.active_pack.as_ref() == Some(&pack));
        station.gauged(pack.clone(), gauge.clone());
        // A station takes part from when all that it consists of has been heard.
        if !was_known && station.known().is_some() {
            self.replan(format!("the packs of {id} are known"));
        }
        let owner = Owner::Pack(id.clone(), pack.clone());
        self.trust.heard(now, &owner, &gauge, feeds && gauge.current_a > 0.0, false);
        self.doubt_gauge(now, &owner);
        self.heard_clock(now, &Agent::Station(id.clone()), gauge.at);
        let news = self.watch.pack_gauge(&self.fleet, &self.models.stations[id], id, &pack, &gauge);
        self.record(Record::PackGauge { station: id.clone(), pack, gauge });
        self.doubted(now, news);
        true
    }

    /// Tells of models that began or ceased to be doubted, and plans anew: forecasts are less or more
    /// certain now.
    fn doubted(&mut self, now: Timestamp, news: News) {
        for (subject, change) in news {
            let (robot, station, pack) = subject.ids();
            let (kind, text) = match change {
                Change::Raised => {
                    let doubt = self.watch.doubt(now, &subject, &self.fleet, &self.models);
                    (EventKind::ModelDoubted, doubt.map_or_else(String::new, |doubt| doubt.text))
                }
                Change::Cleared => (EventKind::ModelTrusted, format!("{subject} explains its data again")),
                Change::Gone => {
                    (EventKind::ModelTrusted, format!("what {subject} was doubted of is gone: what came in its place is watched anew"))
                }
            };
            self.event(now, kind, robot, station, pack, text);
            let word = match change {
                Change::Raised => "is doubted",
                Change::Cleared => "is trusted again",
                Change::Gone => "begins anew",
            };
            self.replan(format!("{subject} {word}"));
        }
    }

    /// Tells of a clock that is off or right again, and plans anew: deadlines are read on it.
    fn heard_clock(&mut self, now: Timestamp, agent: &Agent, said: Timestamp) {
        let Some(text) = self.clocks.heard(now, agent, said) else { return };
        let kind = if self.clocks.is_off(agent) { EventKind::GaugeDoubted } else { EventKind::GaugeTrusted };
        let (robot, station) = match agent {
            Agent::Robot(robot) => (Some(robot), None),
            Agent::Station(station) => (None, Some(station)),
        };
        self.event(now, kind, robot, station, None, text.clone());
        self.replan(text);
    }

    /// Tells of gauges that began or ceased to be doubted, and plans anew.
    pub(super) fn doubt_gauges(&mut self, now: Timestamp) {
        for owner in self.trust.owners().cloned().collect::<Vec<_>>() {
            let drawn_w = match &owner {
                Owner::Robot(id) => self.fleet.robots.get(id).map_or(0.0, Robot::drawn_w),
                Owner::Pack(id, pack) => self.fleet.stations.get(id).map_or(0.0, |station| station.drawn_w(pack)),
            };
            self.trust.drawn(now, &owner, drawn_w);
            self.doubt_gauge(now, &owner);
        }
    }

    fn doubt_gauge(&mut self, now: Timestamp, owner: &Owner) {
        let (is_lost, robot, station, pack) = match owner {
            Owner::Robot(id) => (self.fleet.robots.get(id).is_none_or(|belief| belief.is_lost()), Some(id), None, None),
            Owner::Pack(id, pack) => (self.fleet.stations.get(id).is_none_or(|belief| belief.is_lost()), None, Some(id), Some(pack)),
        };
        // Who is lost says nothing, and that is told already.
        if is_lost {
            return;
        }
        let Some(fault) = self.trust.news(now, owner) else { return };
        let (kind, text) = match fault {
            Some(fault) => (EventKind::GaugeDoubted, format!("the gauge of {owner} {fault}")),
            None => (EventKind::GaugeTrusted, format!("the gauge of {owner} is believed again")),
        };
        self.event(now, kind, robot, station, pack, text.clone());
        self.replan(text);
    }

    /// Says once what is wrong with an input, however often it comes and with whatever numbers.
    pub(super) fn refuse(&mut self, now: Timestamp, what: String) {
        if self.refused.is_new(now, kind_of_refusal(&what)) {
            self.event(now, EventKind::InputRefused, None, None, None, what);
        }
    }
}
