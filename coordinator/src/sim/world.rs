//! One second after the other.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use energy::Channel;
use energy::units::S_PER_H;
use node::Telemetry;
use proto::{Event, RobotId, SiteId, StationId, Timestamp};
use robot_agent::source::{RobotBody, Source as _};
use station_agent::source::{Source as _, StationBody};

use super::logs::{self, StationLogs};
use super::measure::Measured;
use super::net::{Message, Net};
use crate::core::{Core, Input, Numbering, Output};
use crate::scenario::Deployment;
use crate::store::Record;

/// Time of one step, s: agents and coordinator look at the world once a second, as live ones do.
const STEP_S: f64 = 1.0;
/// Simulated time begins here: 1 January 2026, 00:00 UTC.
const START_UNIX_MS: i64 = 1_767_225_600_000;

/// What came of a run.
pub struct Outcome {
    /// Counts and first promises.
    pub measured: Measured,
    /// Every event, in order.
    pub events: Vec<Event>,
    /// When the run began.
    pub start: Timestamp,
    /// The last schedule.
    pub schedule: proto::Schedule,
    /// Logs for the lab, if asked for.
    pub telemetry: Option<Telemetry>,
    /// The site.
    pub site: SiteId,
    /// The coordinator as it stood at the end.
    pub core: Core,
    /// When the run ended.
    pub end: Timestamp,
}

/// What whoever watches a run is shown after each step.
pub struct Step<'a> {
    /// Now.
    pub now: Timestamp,
    /// Since the start, s.
    pub elapsed_s: f64,
    /// The coordinator; what it wants done is done in the next step.
    pub core: &'a mut Core,
    /// What happened in this step.
    pub news: &'a [Event],
}

impl Outcome {
    /// One line per event: seconds since the start, kind, text. The same seed gives the same
    /// bytes.
    #[must_use]
    pub fn trace(&self) -> String {
        let mut trace = String::new();
        for event in &self.events {
            let seconds = event.at.seconds_since(self.start);
            writeln!(trace, "{seconds:>10.2} {:<18} {}", event.kind.to_string(), event.text).expect("a text can be written to");
        }
        trace
    }
}

/// How long a link must have failed until the coordinator takes a robot for lost, s: the lease of the
/// live network.
const LEASE_S: f64 = 10.0;

struct Robot {
    agent: robot_agent::Agent,
    body: RobotBody,
    mission_s: f64,
    /// Packs that it was given so far: each has its own log.
    exchanges: u32,
    /// How long it has been out of its radio's reach, s.
    unheard_s: f64,
    /// How long that was in all, s.
    unheard_all_s: f64,
    /// Whether it ever stood still because a rail could not deliver.
    browned_out: bool,
}

struct Station {
    agent: station_agent::Agent,
    body: StationBody,
    energy_wh: f64,
    drive_wh: f64,
    logs: StationLogs,
}

struct World {
    robots: BTreeMap<RobotId, Robot>,
    stations: BTreeMap<StationId, Station>,
    net: Net,
    telemetry: Option<Telemetry>,
    measured: Measured,
    ambient_degc: f64,
    start: Timestamp,
}

/// Simulates a deployment. `watch` is shown every step.
///
/// # Errors
/// When a model cannot be read.
pub fn simulate(
    deployment: &Deployment,
    duration_s: f64,
    ambient_degc: f64,
    with_telemetry: bool,
    watch: &mut dyn FnMut(Step<'_>),
) -> anyhow::Result<Outcome> {
    let (settings, models) = deployment.coordinator.load(None)?;
    let mut core = Core::new(settings, models, Numbering::default());
    let start = Timestamp::from_unix_ms(START_UNIX_MS);
    let mut world = World::new(deployment, with_telemetry, ambient_degc, start)?;
    let mut events = Vec::new();
    let steps = (duration_s / STEP_S).round() as u64;
    for step in 1..=steps {
        let now = start.plus_s(step as f64 * STEP_S);
        let known = events.len();
        world.deliver(now, &mut core, &mut events);
        world.move_bodies(now);
        core.handle(now, Input::Tick);
        world.drain_core(now, &mut core, &mut events);
        watch(Step { now, elapsed_s: step as f64 * STEP_S, core: &mut core, news: &events[known..] });
    }
    let World { robots, stations, telemetry, mut measured, .. } = world;
    let hours = |s: fn(&Robot) -> f64| robots.values().map(s).sum::<f64>() / S_PER_H;
    let count = |so: fn(&Robot) -> bool| robots.values().filter(|robot| so(robot)).count();
    let sum = |of: fn(&Station) -> f64| stations.values().map(of).sum::<f64>();
    let totals = [
        ("robots_stranded", count(|robot| robot.body.stranded()) as f64),
        ("robots_browned_out", count(|robot| robot.browned_out) as f64),
        ("out_of_reach_h", hours(|robot| robot.unheard_all_s)),
        ("mission_h", hours(|robot| robot.mission_s)),
        ("pack_energy_wh", sum(|station| station.energy_wh)),
        ("drive_energy_wh", sum(|station| station.drive_wh)),
        ("path_selection_saves_wh", sum(|station| station.body.path_selection_saves_wh())),
        ("depot_exchanges", sum(|station| f64::from(station.logs.exchanges()))),
    ];
    measured.finish(&totals, socs(&stations));
    let end = start.plus_s(steps as f64 * STEP_S);
    Ok(Outcome {
        measured,
        events,
        start,
        schedule: core.schedule().clone(),
        telemetry,
        site: deployment.coordinator.site.clone(),
        core,
        end,
    })
}

impl Robot {
    /// Counts a step in or out of reach; says when the coordinator must take it for lost, or as back.
    fn reach(&mut self) -> Option<bool> {
        if self.body.in_reach() {
            let was_lost = self.unheard_s >= LEASE_S;
            self.unheard_s = 0.0;
            return was_lost.then_some(true);
        }
        let before_s = self.unheard_s;
        self.unheard_s += STEP_S;
        self.unheard_all_s += STEP_S;
        (before_s < LEASE_S && self.unheard_s >= LEASE_S).then_some(false)
    }
}

impl World {
    fn new(deployment: &Deployment, with_telemetry: bool, ambient_degc: f64, start: Timestamp) -> anyhow::Result<Self> {
        let mut telemetry = with_telemetry.then(Telemetry::default);
        let mut robots = BTreeMap::new();
        for config in &deployment.robots {
            let (agent, body) = config.build_simulated(None)?;
            if let Some(telemetry) = &mut telemetry {
                logs::open_robot(telemetry, &config.id, agent.soc(), ambient_degc);
            }
            let robot = Robot { agent, body, mission_s: 0.0, exchanges: 0, unheard_s: 0.0, unheard_all_s: 0.0, browned_out: false };
            robots.insert(config.id.clone(), robot);
        }
        let mut stations = BTreeMap::new();
        for config in &deployment.stations {
            let (agent, body) = config.build_simulated(None)?;
            let logs = StationLogs::default();
            if let Some(telemetry) = &mut telemetry {
                logs.open(telemetry, &config.id, &agent, config.bays.len(), ambient_degc);
            }
            stations.insert(config.id.clone(), Station { agent, body, energy_wh: 0.0, drive_wh: 0.0, logs });
        }
        Ok(Self { robots, stations, net: Net::default(), telemetry, measured: Measured::default(), ambient_degc, start })
    }

    /// Hands over every message that has arrived by now.
    fn deliver(&mut self, now: Timestamp, core: &mut Core, events: &mut Vec<Event>) {
        while let Some((at, message)) = self.net.arrived(now) {
            match message {
                Message::Up(input) => {
                    core.handle(at, input);
                    self.drain_core(at, core, events);
                }
                Message::Robot(id, command) => {
                    // Out of reach it hears nothing; the coordinator asks again.
                    if let Some(robot) = self.robots.get_mut(&id).filter(|robot| robot.body.in_reach()) {
                        robot.agent.handle(at, robot_agent::Input::Command(command));
                        drain_robot(&id, robot, &mut self.net, at);
                    }
                }
                Message::Station(id, command) => {
                    if let Some(station) = self.stations.get_mut(&id) {
                        station.agent.handle(at, station_agent::Input::Command(command));
                        drain_station(&id, station, &mut self.net, at);
                    }
                }
            }
        }
    }

    /// Moves every body on by one step: first stations, with what robots drew in the step
    /// before, then robots, with what their bays give.
    fn move_bodies(&mut self, now: Timestamp) {
        let time_s = now.seconds_since(self.start);
        for (id, station) in &mut self.stations {
            let Some(observation) = station.body.advance(STEP_S) else { continue };
            if observation.swapped.is_some() {
                self.measured.swap();
            }
            let fed = f64::from(u8::from(observation.powered));
            let driving_w = station.body.driving_w().unwrap_or(0.0);
            station.energy_wh += (station.body.truth(Channel::PackPowerW) + driving_w) * STEP_S / S_PER_H * fed;
            station.drive_wh += driving_w * STEP_S / S_PER_H * fed;
            let Station { agent, body, logs, .. } = station;
            logs.rows(self.telemetry.as_mut(), id, agent, body, &observation, time_s, self.ambient_degc);
            for (robot, supply) in station.body.supplies() {
                if let Some(robot) = self.robots.get_mut(&robot) {
                    robot.body.supply(&supply);
                }
            }
            station.agent.handle(now, station_agent::Input::Observed(observation));
            drain_station(id, station, &mut self.net, now);
        }
        for (id, robot) in &mut self.robots {
            let Some(observation) = robot.body.advance(STEP_S) else { continue };
            if robot.body.at_work() {
                robot.mission_s += STEP_S;
            }
            robot.browned_out |= robot.body.browned_out();
            let news = robot.reach();
            if let Some(alive) = news {
                self.net.send(now, Message::Up(Input::RobotAlive(id.clone(), alive)));
            }
            robot.exchanges += u32::from(observation.exchanged.is_some());
            if let Some(telemetry) = &mut self.telemetry {
                logs::robot_rows(telemetry, id, &robot.body, robot.exchanges, &observation, time_s, self.ambient_degc);
            }
            robot.agent.handle(now, robot_agent::Input::Observed(observation));
            drain_robot(id, robot, &mut self.net, now);
            if let Some(draw) = robot.body.draw() {
                for station in self.stations.values_mut() {
                    station.body.draw(id, &draw);
                }
            }
        }
    }

    fn drain_core(&mut self, now: Timestamp, core: &mut Core, events: &mut Vec<Event>) {
        while let Some(output) = core.poll() {
            match output {
                Output::ToRobot(id, command) => self.net.send(now, Message::Robot(id, command)),
                Output::ToStation(id, command) => self.net.send(now, Message::Station(id, command)),
                Output::Record(Record::Event(event)) => {
                    let socs = || socs(&self.stations);
                    self.measured.event(&event, socs);
                    events.push(event);
                }
                Output::Record(Record::Plan(plan)) if self.measured.first_plan.is_none() => self.measured.first_plan = Some(plan),
                Output::Record(Record::Capacity(capacity)) if self.measured.first_capacity.is_none() => {
                    self.measured.first_capacity = Some(capacity);
                }
                Output::Record(_) => {}
            }
        }
    }
}

/// True state of charge of every pack. Packs of several stations are told apart by the station.
fn socs(stations: &BTreeMap<StationId, Station>) -> Vec<(String, f64)> {
    let alone = stations.len() == 1;
    let name = |station: &StationId, pack: &proto::PackId| if alone { pack.to_string() } else { format!("{station}.{pack}") };
    stations.iter().flat_map(|(id, station)| station.body.true_socs().map(move |(pack, soc)| (name(id, pack), soc))).collect()
}

fn drain_robot(id: &RobotId, robot: &mut Robot, net: &mut Net, now: Timestamp) {
    use robot_agent::Output as O;
    let heard = robot.body.in_reach();
    while let Some(output) = robot.agent.poll() {
        match output {
            O::Gauge(_) | O::State(_) | O::Reply(_) if !heard => {}
            O::Gauge(gauge) => net.send(now, Message::Up(Input::RobotGauge(id.clone(), gauge))),
            O::State(state) => net.send(now, Message::Up(Input::RobotState(id.clone(), state))),
            O::Reply(reply) => net.send(now, Message::Up(Input::Reply(reply))),
            O::Act(act) => robot.body.act(&act),
        }
    }
}

fn drain_station(id: &StationId, station: &mut Station, net: &mut Net, now: Timestamp) {
    use station_agent::Output as O;
    while let Some(output) = station.agent.poll() {
        match output {
            O::Gauge(pack, gauge) => net.send(now, Message::Up(Input::PackGauge(id.clone(), pack, gauge))),
            O::State(state) => net.send(now, Message::Up(Input::StationState(id.clone(), state))),
            O::Reply(reply) => net.send(now, Message::Up(Input::Reply(reply))),
            O::Act(act) => station.body.act(&act),
        }
    }
}
