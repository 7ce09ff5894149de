//! One second after the other: bodies, agents, messages, coordinator, and what goes wrong.

use std::collections::BTreeMap;

use energy::units::S_PER_H;
use node::Telemetry;
use proto::{Event, RobotId, StationId, Timestamp};
use robot_agent::source::Source as _;
use station_agent::source::Source as _;

use super::check::{Checks, plan_tells_of_everybody};
use super::desk::Desk;
use super::faults::{Fault, Faults};
use super::host::{Robot, STEP_S, Station};
use super::logs;
use super::measure::Measured;
use super::net::{Host, Message, Net};
use crate::core::{Input, Output};
use crate::models::Kept;
use crate::scenario::Deployment;
use crate::store::Record;

/// The end of something that went wrong.
enum End {
    Restart,
    Join,
    DiskFree,
}

pub(super) struct World {
    pub(super) robots: BTreeMap<RobotId, Robot>,
    pub(super) stations: BTreeMap<StationId, Station>,
    /// The stations' names, for those who speak to all of them.
    names: Vec<StationId>,
    pub(super) desk: Desk,
    net: Net,
    /// What goes wrong later, the next last.
    faults: Vec<(f64, Host, Fault)>,
    ends: Vec<(Timestamp, Host, End)>,
    forgetful: bool,
    pub(super) telemetry: Option<Telemetry>,
    pub(super) measured: Measured,
    pub(super) events: Vec<Event>,
    /// What is watched, in runs where things go wrong.
    pub(super) checks: Option<Checks>,
    ambient_degc: f64,
    start: Timestamp,
}

impl World {
    pub(super) fn new(deployment: &Deployment, faults: Faults, kept: Kept, ambient_degc: f64, start: Timestamp) -> anyhow::Result<Self> {
        let (settings, mut models) = deployment.coordinator.load(None)?;
        let mut telemetry = matches!(kept, Kept::Logs(_)).then(Telemetry::default);
        models.kept = kept;
        let mut robots = BTreeMap::new();
        for config in &deployment.robots {
            let robot = Robot::new(config)?;
            if let (Some(telemetry), Some(agent)) = (&mut telemetry, &robot.agent) {
                logs::open_robot(telemetry, &config.id, agent.soc(), ambient_degc);
            }
            robots.insert(config.id.clone(), robot);
        }
        let mut stations = BTreeMap::new();
        for config in &deployment.stations {
            let station = Station::new(config)?;
            if let (Some(telemetry), Some(agent)) = (&mut telemetry, &station.agent) {
                station.logs.open(telemetry, &config.id, agent, config.bays.len(), ambient_degc);
            }
            stations.insert(config.id.clone(), station);
        }
        let mut world = Self {
            names: stations.keys().cloned().collect(),
            robots,
            stations,
            desk: Desk::new(settings, models),
            net: Net::new(faults.weather, faults.rng()),
            faults: faults.events.into_iter().rev().collect(),
            ends: Vec::new(),
            forgetful: faults.forgetful,
            telemetry,
            measured: Measured::default(),
            events: Vec::new(),
            checks: None,
            ambient_degc,
            start,
        };
        for (host, ahead_s) in faults.skews {
            world.set_clock(&host, ahead_s);
        }
        Ok(world)
    }

    /// Lives through one step.
    pub(super) fn step(&mut self, now: Timestamp) -> anyhow::Result<()> {
        self.go_wrong(now)?;
        self.deliver(now);
        self.move_bodies(now);
        self.give_core(now, Input::Tick);
        Ok(())
    }

    fn set_clock(&mut self, host: &Host, by_s: f64) {
        let clock = match host {
            Host::Coordinator => &mut self.desk.clock,
            Host::Robot(id) => &mut self.robots.get_mut(id).expect("faults name hosts of the run").life.clock,
            Host::Station(id) => &mut self.stations.get_mut(id).expect("faults name hosts of the run").life.clock,
        };
        clock.ahead_s += by_s;
    }

    /// Begins and ends what goes wrong at this instant.
    fn go_wrong(&mut self, now: Timestamp) -> anyhow::Result<()> {
        let passed_s = now.seconds_since(self.start);
        while self.faults.last().is_some_and(|(at_s, ..)| *at_s <= passed_s) {
            let Some((_, host, fault)) = self.faults.pop() else { break };
            match fault {
                Fault::Kill { after, for_s } => {
                    match &host {
                        Host::Coordinator => self.desk.doom(after),
                        Host::Robot(id) => self.robots.get_mut(id).expect("a host of the run").life.doomed = Some(after),
                        Host::Station(id) => self.stations.get_mut(id).expect("a host of the run").life.doomed = Some(after),
                    }
                    self.ends.push((now.plus_s(for_s), host, End::Restart));
                }
                Fault::Cut { for_s } => {
                    self.net.cut(host.clone(), true);
                    self.ends.push((now.plus_s(for_s), host, End::Join));
                }
                Fault::Clock { by_s } => self.set_clock(&host, by_s),
                Fault::FullDisk { for_s } => {
                    self.desk.disk.full = true;
                    self.ends.push((now.plus_s(for_s), host, End::DiskFree));
                }
            }
        }
        let (over, ends) = std::mem::take(&mut self.ends).into_iter().partition(|(at, ..)| *at <= now);
        self.ends = ends;
        for (_, host, end) in over {
            match end {
                End::Restart => self.restart(&host)?,
                End::Join => self.net.cut(host, false),
                End::DiskFree => self.desk.disk.full = false,
            }
        }
        // A coordinator that could not start is started again and again by what watches over it.
        let absent = self.ends.iter().any(|(_, host, end)| *host == Host::Coordinator && matches!(end, End::Restart));
        if !self.desk.up() && !absent {
            self.desk.start();
        }
        Ok(())
    }

    /// Starts a process again; a kill that found nothing to interrupt strikes now.
    fn restart(&mut self, host: &Host) -> anyhow::Result<()> {
        match host {
            Host::Coordinator => {
                self.desk.strike();
                self.desk.start();
            }
            Host::Robot(id) => {
                let robot = self.robots.get_mut(id).expect("a host of the run");
                if self.forgetful {
                    robot.memory = None;
                }
                if robot.agent.is_none() || robot.life.doomed.take().is_some() {
                    robot.start()?;
                }
            }
            Host::Station(id) => {
                let station = self.stations.get_mut(id).expect("a host of the run");
                if self.forgetful {
                    station.memory = None;
                }
                if station.agent.is_none() || station.life.doomed.take().is_some() {
                    station.start()?;
                }
            }
        }
        Ok(())
    }

    /// Hands over every message that has arrived by now.
    fn deliver(&mut self, now: Timestamp) {
        while let Some((at, message)) = self.net.arrived(now) {
            let checks = self.checks.as_mut();
            match message {
                Message::Up(input) => self.give_core(at, input),
                Message::Robot(id, command) => {
                    if let Some(robot) = self.robots.get_mut(&id) {
                        robot.command(&id, command, at, &mut self.net, checks, &self.names);
                    }
                }
                Message::Station(id, command) => {
                    if let Some(station) = self.stations.get_mut(&id) {
                        let guests = guests_of(&self.robots, &id);
                        station.command(&id, command, at, &mut self.net, checks, &guests);
                    }
                }
                Message::Overheard(id, robot, state) => {
                    if let Some(station) = self.stations.get_mut(&id) {
                        let guests = guests_of(&self.robots, &id);
                        station.hears(&id, station_agent::Input::Robot(robot, state), at, &mut self.net, checks, &guests);
                    }
                }
                Message::Told(id, station, state) => {
                    if let Some(robot) = self.robots.get_mut(&id) {
                        robot.hears(&id, robot_agent::Input::Station(station, *state), at, &mut self.net, checks, &self.names);
                    }
                }
                Message::Coordinator(Host::Robot(id), heard) => {
                    if let Some(robot) = self.robots.get_mut(&id) {
                        robot.hears(&id, robot_agent::Input::Coordinator(heard), at, &mut self.net, checks, &self.names);
                    }
                }
                Message::Coordinator(Host::Station(id), heard) => {
                    if let Some(station) = self.stations.get_mut(&id) {
                        let guests = guests_of(&self.robots, &id);
                        station.hears(&id, station_agent::Input::Coordinator(heard), at, &mut self.net, checks, &guests);
                    }
                }
                Message::Coordinator(Host::Coordinator, _) => {}
            }
        }
    }

    /// Moves every body on by one step: first stations, with what robots drew in the step
    /// before, then robots, with what their bays give.
    fn move_bodies(&mut self, now: Timestamp) {
        let time_s = now.seconds_since(self.start);
        let coordinator_up = self.desk.up();
        if let Some(checks) = &mut self.checks {
            checks.balance.step();
        }
        for (id, station) in &mut self.stations {
            let Some(observation) = station.body.advance(STEP_S) else { continue };
            if observation.swapped.is_some() {
                self.measured.swap();
            }
            station.count(observation.powered);
            if let Some(agent) = &station.agent {
                station.logs.rows(self.telemetry.as_mut(), id, agent, &station.body, &observation, time_s, self.ambient_degc);
            }
            for (robot, supply) in station.body.supplies() {
                if let Some(robot) = self.robots.get_mut(&robot) {
                    robot.body.supply(&supply);
                }
            }
            if let Some(checks) = &mut self.checks {
                checks.issue.ended(now, id, &observation);
                checks.balance.station(id, &station.body);
            }
            station.link(id, coordinator_up, now, &mut self.net);
            let guests = guests_of(&self.robots, id);
            station.observed(id, observation, now, &mut self.net, self.checks.as_mut(), &guests);
        }
        for (id, robot) in &mut self.robots {
            let Some(observation) = robot.body.advance(STEP_S) else { continue };
            if robot.body.at_work() {
                robot.mission_s += STEP_S;
            }
            robot.browned_out |= robot.body.browned_out();
            robot.link(id, coordinator_up, now, &mut self.net);
            robot.exchanges += u32::from(observation.exchanged.is_some());
            if let Some(telemetry) = &mut self.telemetry {
                logs::robot_rows(telemetry, id, &robot.body, robot.exchanges, &observation, time_s, self.ambient_degc);
            }
            if let Some(checks) = &mut self.checks {
                checks.balance.robot(id, &robot.body, observation.exchanged.is_some());
            }
            robot.observed(id, observation, now, &mut self.net, self.checks.as_mut(), &self.names);
            if let Some(draw) = robot.body.draw() {
                for station in self.stations.values_mut() {
                    station.body.draw(id, &draw);
                }
            }
        }
    }

    /// Gives the coordinator an input and sends what it says.
    fn give_core(&mut self, now: Timestamp, input: Input) {
        let Self { desk, measured, events, stations, .. } = self;
        let mut plan = None;
        let mut made = |record: &Record| match record {
            Record::Event(event) => {
                measured.event(event, || socs(stations));
                events.push(event.clone());
            }
            Record::Plan(schedule) => {
                measured.plan(schedule);
                plan = Some(schedule.clone());
            }
            Record::Capacity(capacity) if measured.first_capacity.is_none() => measured.first_capacity = Some(capacity.clone()),
            _ => {}
        };
        let sent = desk.take(now, input, &mut made);
        if let (Some(checks), Some(plan), Some(core)) = (&mut self.checks, plan, self.desk.core()) {
            checks.found.extend(plan_tells_of_everybody(&plan, core.fleet()));
        }
        for output in sent {
            let message = match output {
                Output::ToRobot(id, command) => Message::Robot(id, command),
                Output::ToStation(id, command) => Message::Station(id, command),
                Output::Record(_) | Output::Study(_) => continue,
            };
            self.net.send(now, &Host::Coordinator, message);
        }
    }

    /// Ends the count with what bodies hold.
    pub(super) fn finish(&mut self) {
        let robots = &self.robots;
        let hours = |s: fn(&Robot) -> f64| robots.values().map(s).sum::<f64>() / S_PER_H;
        let count = |so: fn(&Robot) -> bool| robots.values().filter(|robot| so(robot)).count() as f64;
        let sum = |of: fn(&Station) -> f64| self.stations.values().map(of).sum::<f64>();
        let totals = [
            ("robots_stranded", count(|robot| robot.body.stranded())),
            ("robots_browned_out", count(|robot| robot.browned_out)),
            ("robots_shut_in", sum(|station| station.body.shut_in() as f64)),
            ("out_of_reach_h", hours(|robot| robot.unheard_all_s)),
            ("mission_h", hours(|robot| robot.mission_s)),
            ("pack_energy_wh", sum(|station| station.energy_wh)),
            ("drive_energy_wh", sum(|station| station.drive_wh)),
            ("path_selection_saves_wh", sum(|station| station.body.path_selection_saves_wh())),
            ("depot_exchanges", sum(|station| f64::from(station.logs.exchanges()))),
        ];
        self.measured.finish(&totals, socs(&self.stations));
    }
}

/// Robots that are at a station, or on their way to it: they hear what it says.
fn guests_of(robots: &BTreeMap<RobotId, Robot>, station: &StationId) -> Vec<RobotId> {
    let is_guest = |robot: &&Robot| robot.agent.as_ref().and_then(robot_agent::Agent::station) == Some(station);
    robots.iter().filter(|(_, robot)| is_guest(robot)).map(|(id, _)| id.clone()).collect()
}

/// True state of charge of every pack. Packs of several stations are told apart by the station.
fn socs(stations: &BTreeMap<StationId, Station>) -> Vec<(String, f64)> {
    let alone = stations.len() == 1;
    let name = |station: &StationId, pack: &proto::PackId| if alone { pack.to_string() } else { format!("{station}.{pack}") };
    stations.iter().flat_map(|(id, station)| station.body.true_socs().map(move |(pack, soc)| (name(id, pack), soc))).collect()
}
