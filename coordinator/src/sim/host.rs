//! The agents' processes on their simulated bodies: the production agents, which may be killed and
//! started again while the bodies live on.

use energy::units::S_PER_H;
use proto::{RobotCommand, RobotId, StationCommand, StationId, Timestamp};
use robot_agent::source::RobotBody;
use robot_agent::source::Source as _;
use station_agent::source::{Source as _, StationBody};

use super::check::Checks;
use super::faults::HostClock;
use super::logs::StationLogs;
use super::net::{Host, Message, Net};
use crate::core::Input;

/// Time of one step, s: agents and coordinator look at the world once a second, as live ones do.
pub(super) const STEP_S: f64 = 1.0;
/// How long a link must have failed until one side takes the other for lost, s: the lease of the live
/// network.
const LEASE_S: f64 = 10.0;

/// A process that may be killed.
#[derive(Debug, Default)]
pub(super) struct Life {
    pub(super) clock: HostClock,
    /// A kill that strikes after so many more outputs.
    pub(super) doomed: Option<u32>,
    /// How long the link to the coordinator has failed, s.
    unheard_s: f64,
    /// Whether the coordinator was told that this agent is there.
    pub(super) known: bool,
    /// Whether this agent was told that the coordinator is there.
    told: Option<bool>,
}

impl Life {
    /// One output is done; says whether the process was killed before it.
    fn worn_out(&mut self) -> bool {
        match &mut self.doomed {
            Some(0) => {
                self.doomed = None;
                true
            }
            Some(left) => {
                *left -= 1;
                false
            }
            None => false,
        }
    }

    /// A new process knows nothing of the coordinator.
    pub(super) fn restarted(&mut self) {
        self.told = None;
    }

    /// Counts a step with or without a link; tells each side when it must take the other for lost, or
    /// as back.
    fn link(&mut self, linked: bool, up: bool, coordinator_up: bool, me: &Host, now: Timestamp, net: &mut Net) {
        self.unheard_s = if linked { 0.0 } else { self.unheard_s + STEP_S };
        let heard = self.unheard_s < LEASE_S;
        let alive = up && heard;
        if coordinator_up && alive != self.known {
            let input = match me {
                Host::Robot(robot) => Input::RobotAlive(robot.clone(), alive),
                Host::Station(station) => Input::StationAlive(station.clone(), alive),
                Host::Coordinator => return,
            };
            net.tell(now, me, Message::Up(input));
        }
        // A coordinator that is not there learns of it when it starts.
        self.known = alive;
        let there = coordinator_up && heard;
        if up && self.told != Some(there) {
            self.told = Some(there);
            net.tell(now, &Host::Coordinator, Message::Coordinator(me.clone(), there));
        }
    }
}

/// A robot.
pub(super) struct Robot {
    pub(super) config: robot_agent::Config,
    pub(super) agent: Option<robot_agent::Agent>,
    pub(super) memory: Option<robot_agent::Memory>,
    pub(super) life: Life,
    pub(super) body: RobotBody,
    pub(super) mission_s: f64,
    /// Packs that it was given so far: each has its own log.
    pub(super) exchanges: u32,
    /// How long it was out of its radio's reach in all, s.
    pub(super) unheard_all_s: f64,
    /// Whether it ever stood still because a rail could not deliver.
    pub(super) browned_out: bool,
    /// A pack put in that no agent has taken note of yet.
    pub(super) missed: Option<energy::Estimate>,
}

impl Robot {
    pub(super) fn new(config: &robot_agent::Config) -> anyhow::Result<Self> {
        let (agent, body) = config.build_simulated(None)?;
        Ok(Self {
            config: config.clone(),
            agent: Some(agent),
            memory: None,
            life: Life { known: true, ..Life::default() },
            body,
            mission_s: 0.0,
            exchanges: 0,
            unheard_all_s: 0.0,
            browned_out: false,
            missed: None,
        })
    }

    /// Starts the agent anew, from what it had kept.
    pub(super) fn start(&mut self) -> anyhow::Result<()> {
        let mut agent = self.config.agent_of(&mut self.body, None)?;
        if let Some(memory) = self.memory.clone() {
            agent.restore(memory);
        }
        self.agent = Some(agent);
        self.life.restarted();
        Ok(())
    }

    pub(super) fn link(&mut self, id: &RobotId, coordinator_up: bool, now: Timestamp, net: &mut Net) {
        let me = Host::Robot(id.clone());
        let reach = self.body.in_reach();
        self.unheard_all_s += if reach { 0.0 } else { STEP_S };
        let linked = reach && net.reaches(&me) && net.reaches(&Host::Coordinator);
        self.life.link(linked, self.agent.is_some(), coordinator_up, &me, now, net);
    }

    /// What was observed, with what nobody has taken note of before.
    pub(super) fn observed(
        &mut self,
        id: &RobotId,
        mut seen: robot_agent::source::Observation,
        now: Timestamp,
        net: &mut Net,
        checks: Option<&mut Checks>,
        stations: &[StationId],
    ) {
        seen.exchanged = seen.exchanged.or(self.missed.take());
        let event = seen.exchanged;
        let Some(agent) = &mut self.agent else {
            self.missed = event;
            return;
        };
        agent.handle(self.life.clock.shows(now), robot_agent::Input::Observed(seen));
        if !self.drain(id, now, net, checks, stations) {
            self.missed = event;
        }
    }

    pub(super) fn command(
        &mut self,
        id: &RobotId,
        command: RobotCommand,
        now: Timestamp,
        net: &mut Net,
        mut checks: Option<&mut Checks>,
        stations: &[StationId],
    ) {
        // Out of reach it hears nothing; the coordinator asks again.
        let Some(agent) = self.agent.as_mut().filter(|_| self.body.in_reach()) else { return };
        if let Some(checks) = checks.as_deref_mut() {
            checks.commands.arrives(&Host::Robot(id.clone()), &command.id, command.epoch);
        }
        agent.handle(self.life.clock.shows(now), robot_agent::Input::Command(command));
        self.drain(id, now, net, checks, stations);
    }

    /// Something that needs no answer.
    pub(super) fn hears(
        &mut self,
        id: &RobotId,
        input: robot_agent::Input,
        now: Timestamp,
        net: &mut Net,
        checks: Option<&mut Checks>,
        stations: &[StationId],
    ) {
        let Some(agent) = self.agent.as_mut() else { return };
        // Out of reach it hears nobody; that it does not is told by the network library itself.
        if matches!(input, robot_agent::Input::Station(..)) && !self.body.in_reach() {
            return;
        }
        agent.handle(self.life.clock.shows(now), input);
        self.drain(id, now, net, checks, stations);
    }

    /// Does what the agent wants; false when it was killed before anything was kept.
    fn drain(&mut self, id: &RobotId, now: Timestamp, net: &mut Net, mut checks: Option<&mut Checks>, stations: &[StationId]) -> bool {
        use robot_agent::Output as O;
        let me = Host::Robot(id.clone());
        let heard = self.body.in_reach();
        let mut first = true;
        while let Some(output) = self.agent.as_mut().and_then(robot_agent::Agent::poll) {
            if self.life.worn_out() {
                self.agent = None;
                return !first;
            }
            first = false;
            match output {
                O::Keep(memory) => self.memory = Some(*memory),
                O::Act(act) => self.body.act(&act),
                O::Reply(reply) => {
                    if let Some(checks) = checks.as_deref_mut() {
                        checks.commands.answered(&me, &reply);
                    }
                    if heard {
                        net.send(now, &me, Message::Up(Input::Reply(reply)));
                    }
                }
                O::Gauge(_) | O::State(_) if !heard => {}
                O::Gauge(gauge) => net.send(now, &me, Message::Up(Input::RobotGauge(id.clone(), gauge))),
                O::State(state) => {
                    for station in stations {
                        net.send(now, &me, Message::Overheard(station.clone(), id.clone(), state.clone()));
                    }
                    net.send(now, &me, Message::Up(Input::RobotState(id.clone(), state)));
                }
            }
        }
        true
    }
}

/// A station.
pub(super) struct Station {
    pub(super) config: station_agent::Config,
    pub(super) agent: Option<station_agent::Agent>,
    pub(super) memory: Option<station_agent::Memory>,
    pub(super) life: Life,
    pub(super) body: StationBody,
    pub(super) energy_wh: f64,
    pub(super) drive_wh: f64,
    pub(super) logs: StationLogs,
    /// The end of what was begun that no agent has taken note of yet.
    missed: Option<station_agent::source::Observation>,
}

impl Station {
    pub(super) fn new(config: &station_agent::Config) -> anyhow::Result<Self> {
        let (agent, body) = config.build_simulated(None)?;
        Ok(Self {
            config: config.clone(),
            agent: Some(agent),
            memory: None,
            life: Life { known: true, ..Life::default() },
            body,
            energy_wh: 0.0,
            drive_wh: 0.0,
            logs: StationLogs::default(),
            missed: None,
        })
    }

    /// Starts the agent anew, from what it had kept.
    pub(super) fn start(&mut self) -> anyhow::Result<()> {
        let mut agent = self.config.agent_of(&mut self.body, None)?;
        if let Some(memory) = self.memory.clone() {
            agent.restore(memory);
        }
        self.agent = Some(agent);
        self.life.restarted();
        Ok(())
    }

    pub(super) fn link(&mut self, id: &StationId, coordinator_up: bool, now: Timestamp, net: &mut Net) {
        let me = Host::Station(id.clone());
        let linked = net.reaches(&me) && net.reaches(&Host::Coordinator);
        self.life.link(linked, self.agent.is_some(), coordinator_up, &me, now, net);
    }

    /// Counts what its packs gave in a step.
    pub(super) fn count(&mut self, powered: bool) {
        let fed = f64::from(u8::from(powered));
        let driving_w = self.body.driving_w().unwrap_or(0.0);
        self.energy_wh += (self.body.truth(energy::Channel::PackPowerW) + driving_w) * STEP_S / S_PER_H * fed;
        self.drive_wh += driving_w * STEP_S / S_PER_H * fed;
    }

    /// What was observed, with what nobody has taken note of before: a lift's or exchange's controller
    /// shows that it is done until somebody looks.
    pub(super) fn observed(
        &mut self,
        id: &StationId,
        mut seen: station_agent::source::Observation,
        now: Timestamp,
        net: &mut Net,
        checks: Option<&mut Checks>,
        guests: &[RobotId],
    ) {
        if let Some(missed) = self.missed.take() {
            seen.lifted = seen.lifted.or(missed.lifted);
            seen.swapped = seen.swapped.or(missed.swapped);
            seen.called_off = seen.called_off.or(missed.called_off);
            seen.charged.splice(0..0, missed.charged);
            for (pack, before) in seen.packs.iter_mut().zip(missed.packs) {
                pack.exchanged = pack.exchanged.or(before.exchanged);
            }
        }
        let events = seen.clone();
        let Some(agent) = &mut self.agent else {
            self.missed = Some(events);
            return;
        };
        agent.handle(self.life.clock.shows(now), station_agent::Input::Observed(seen));
        if !self.drain(id, now, net, checks, guests) {
            self.missed = Some(events);
        }
    }

    pub(super) fn command(
        &mut self,
        id: &StationId,
        command: StationCommand,
        now: Timestamp,
        net: &mut Net,
        mut checks: Option<&mut Checks>,
        guests: &[RobotId],
    ) {
        let Some(agent) = &mut self.agent else { return };
        if let Some(checks) = checks.as_deref_mut() {
            checks.commands.arrives(&Host::Station(id.clone()), &command.id, command.epoch);
        }
        agent.handle(self.life.clock.shows(now), station_agent::Input::Command(command));
        self.drain(id, now, net, checks, guests);
    }

    /// Something that needs no answer.
    pub(super) fn hears(
        &mut self,
        id: &StationId,
        input: station_agent::Input,
        now: Timestamp,
        net: &mut Net,
        checks: Option<&mut Checks>,
        guests: &[RobotId],
    ) {
        let Some(agent) = &mut self.agent else { return };
        agent.handle(self.life.clock.shows(now), input);
        self.drain(id, now, net, checks, guests);
    }

    /// Does what the agent wants; false when it was killed before anything was kept.
    fn drain(&mut self, id: &StationId, now: Timestamp, net: &mut Net, mut checks: Option<&mut Checks>, guests: &[RobotId]) -> bool {
        use station_agent::Output as O;
        let me = Host::Station(id.clone());
        let mut first = true;
        while let Some(output) = self.agent.as_mut().and_then(station_agent::Agent::poll) {
            if self.life.worn_out() {
                self.agent = None;
                return !first;
            }
            first = false;
            match output {
                O::Keep(memory) => self.memory = Some(*memory),
                O::Act(act) => {
                    if let Some(checks) = checks.as_deref_mut() {
                        checks.issue.begins(now, id, &act);
                    }
                    self.body.act(&act);
                }
                O::Gauge(pack, gauge) => net.send(now, &me, Message::Up(Input::PackGauge(id.clone(), pack, gauge))),
                O::State(state) => {
                    for robot in guests {
                        net.send(now, &me, Message::Told(robot.clone(), id.clone(), Box::new(state.clone())));
                    }
                    net.send(now, &me, Message::Up(Input::StationState(id.clone(), state)));
                }
                O::Reply(reply) => {
                    if let Some(checks) = checks.as_deref_mut() {
                        checks.commands.answered(&me, &reply);
                    }
                    net.send(now, &me, Message::Up(Input::Reply(reply)));
                }
            }
        }
        true
    }
}
