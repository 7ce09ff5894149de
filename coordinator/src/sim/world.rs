//! One second after the other.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use energy::Channel;
use energy::units::S_PER_H;
use proto::{Event, RobotId, StationId, Timestamp};
use robot_agent::source::{Place, RobotBody, Source as _};
use station_agent::source::{Source as _, StationBody};

use super::measure::Measured;
use super::net::{Message, Net};
use super::telemetry::Telemetry;
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

/// Inputs of a station's model, as its log has them.
const INPUTS: [Channel; 6] = [
    Channel::ChargePowerW,
    Channel::RobotsDocked,
    Channel::RobotsCharging,
    Channel::BaySquaredCurrentA2,
    Channel::SelectorEvents,
    Channel::LiftActive,
];

struct Robot {
    agent: robot_agent::Agent,
    body: RobotBody,
    mission_s: f64,
    /// Packs that it was given so far: each has its own log.
    exchanges: u32,
}

struct Station {
    agent: station_agent::Agent,
    body: StationBody,
    energy_wh: f64,
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

/// Simulates a deployment. `progress` is told the simulated seconds now and then.
///
/// # Errors
/// When a model cannot be read.
pub fn simulate(
    deployment: &Deployment,
    duration_s: f64,
    ambient_degc: f64,
    with_telemetry: bool,
    progress: &mut dyn FnMut(f64),
) -> anyhow::Result<Outcome> {
    let (settings, models) = deployment.coordinator.load(None)?;
    let mut core = Core::new(settings, models, Numbering::default());
    let start = Timestamp::from_unix_ms(START_UNIX_MS);
    let mut world = World::new(deployment, with_telemetry, ambient_degc, start)?;
    let mut events = Vec::new();
    let steps = (duration_s / STEP_S).round() as u64;
    for step in 1..=steps {
        let now = start.plus_s(step as f64 * STEP_S);
        world.deliver(now, &mut core, &mut events);
        world.move_bodies(now);
        core.handle(now, Input::Tick);
        world.drain_core(now, &mut core, &mut events);
        if step % 256 == 0 {
            progress(step as f64 * STEP_S);
        }
    }
    let World { robots, stations, telemetry, mut measured, .. } = world;
    let stranded = robots.values().filter(|robot| robot.body.stranded()).count();
    let mission_s = robots.values().map(|robot| robot.mission_s).sum();
    let socs = socs(&stations);
    let energy_wh = stations.values().map(|station| station.energy_wh).sum();
    measured.finish(stranded, energy_wh, mission_s, socs);
    Ok(Outcome { measured, events, start, schedule: core.schedule().clone(), telemetry })
}

/// What a robot's load log holds beside its power: whatever an effect of a robot may ask for.
const LOAD_INPUTS: [Channel; 12] = [
    Channel::SpeedMps,
    Channel::AccelMps2,
    Channel::PitchRad,
    Channel::PayloadKg,
    Channel::YawRateRadps,
    Channel::FloorClass,
    Channel::TailAngleRad,
    Channel::CpuMhz,
    Channel::CpuUtil,
    Channel::RadioTxDbm,
    Channel::RadioDuty,
    Channel::CameraOn,
];

impl World {
    fn new(deployment: &Deployment, with_telemetry: bool, ambient_degc: f64, start: Timestamp) -> anyhow::Result<Self> {
        let mut telemetry = with_telemetry.then(Telemetry::default);
        let mut robots = BTreeMap::new();
        for config in &deployment.robots {
            let (agent, body) = config.build_simulated(None)?;
            if let Some(telemetry) = &mut telemetry {
                telemetry.battery(config.id.as_ref(), 0.0, agent.soc(), ambient_degc);
                let inputs = LOAD_INPUTS.map(Channel::name).join(",");
                telemetry.table(&load_stem(&config.id), &format!("power_w,{inputs}"));
            }
            robots.insert(config.id.clone(), Robot { agent, body, mission_s: 0.0, exchanges: 0 });
        }
        let mut stations = BTreeMap::new();
        for config in &deployment.stations {
            let (agent, body) = config.build_simulated(None)?;
            if let Some(telemetry) = &mut telemetry {
                for (pack, soc) in agent.socs() {
                    telemetry.battery(&pack_stem(&config.id, pack), 0.0, soc, ambient_degc);
                }
                let bays: String = (1..=config.bays.len()).map(|n| format!(",bay_{n}_robot,bay_{n}_current_a,bay_{n}_voltage_v")).collect();
                let columns = INPUTS.map(Channel::name).join(",") + ",pack_current_a,pack_voltage_v,pack_power_w";
                telemetry.table(config.id.as_ref(), &format!("{columns}{bays}"));
            }
            stations.insert(config.id.clone(), Station { agent, body, energy_wh: 0.0 });
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
                    if let Some(robot) = self.robots.get_mut(&id) {
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
            station.energy_wh += station.body.truth(Channel::PackPowerW) * STEP_S / S_PER_H * f64::from(u8::from(observation.powered));
            if let Some(telemetry) = &mut self.telemetry {
                log_station(telemetry, id, station, &observation, time_s, self.ambient_degc);
            }
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
            if let (Some(telemetry), Some(soc)) = (&mut self.telemetry, observation.exchanged) {
                robot.exchanges += 1;
                telemetry.battery(&battery_stem(id, robot.exchanges), time_s - STEP_S, soc, self.ambient_degc);
            }
            if let (Some(telemetry), Some(sample)) = (&mut self.telemetry, &observation.sample) {
                telemetry.battery_row(&battery_stem(id, robot.exchanges), time_s, sample, self.ambient_degc);
                if observation.place != Place::InBay && !observation.depleted {
                    let inputs = robot.body.inputs(LOAD_INPUTS).map(|value| value.to_string()).join(",");
                    let power_w = sample.current_a * sample.voltage_v;
                    telemetry.row(&load_stem(id), format_args!("{time_s},{power_w:.4},{inputs}"));
                }
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

/// A robot's first pack has the robot's name, the others are counted from 2.
fn battery_stem(robot: &RobotId, exchanges: u32) -> String {
    if exchanges == 0 { robot.to_string() } else { format!("{robot}-pack-{}", exchanges + 1) }
}

fn load_stem(robot: &RobotId) -> String {
    format!("{robot}-load")
}

fn pack_stem(station: &StationId, pack: &proto::PackId) -> String {
    format!("{station}-{pack}")
}

fn drain_robot(id: &RobotId, robot: &mut Robot, net: &mut Net, now: Timestamp) {
    use robot_agent::Output as O;
    while let Some(output) = robot.agent.poll() {
        match output {
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

fn log_station(
    telemetry: &mut Telemetry,
    id: &StationId,
    station: &Station,
    observation: &station_agent::source::Observation,
    time_s: f64,
    ambient_degc: f64,
) {
    for reading in &observation.packs {
        telemetry.battery_row(&pack_stem(id, &reading.pack), time_s, &reading.sample, ambient_degc);
    }
    let active = observation.packs.iter().find(|reading| observation.active_pack.as_ref() == Some(&reading.pack));
    let Some(sample) = active.map(|reading| reading.sample).filter(|_| observation.powered) else { return };
    let [charge_w, docked, charging, squared_a2, events, lift] = INPUTS.map(|channel| station.body.truth(channel));
    let (current_a, voltage_v) = (sample.current_a, sample.voltage_v);
    // An empty sum is -0.
    let charge_w = charge_w + 0.0;
    let mut row = format!(
        "{time_s},{charge_w:.4},{docked},{charging},{squared_a2:.5},{events},{lift},{current_a:.4},{voltage_v:.4},{:.4}",
        current_a * voltage_v
    );
    for bay in station.agent.bays() {
        let draw = bay.and_then(|robot| station.body.draws().find(|(id, _)| *id == robot).and_then(|(_, draw)| draw));
        let (current_a, voltage_v) = draw.map_or((0.0, 0.0), |draw| (draw.charge_current_a, draw.voltage_v));
        write!(row, ",{},{current_a:.4},{voltage_v:.4}", bay.map_or("", AsRef::as_ref)).expect("a text can be written to");
    }
    telemetry.row(id.as_ref(), format_args!("{row}"));
}
