//! The coordinator without clock, network or disk.
//!
//! ```text
//!   handle(now, Input) ──> beliefs ──> problem ──> plan ──> commands, records
//!   poll() -> Output   <───────────────────────────────────────┘
//! ```
//!
//! One input, then poll until nothing is left. The same inputs give the same outputs.

use std::collections::{BTreeMap, BTreeSet, VecDeque};

use proto::{
    Capacity, Command, CommandId, CommandReply, Event, EventKind, Explanation, Gauge, Outcome, PackId, RobotAction, RobotCommand, RobotId,
    RobotPhase, RobotState, Schedule, StationAction, StationCommand, StationId, StationState, Timestamp,
};

use crate::answers;
use crate::fleet::{Fleet, newer};
use crate::models::{Models, Settings};
use crate::scheduler::{Plan, Planned, Problem, construct};
use crate::service_run::{How, ServiceRun, Stage, Step};
use crate::store::Record;
use crate::view::Basis;

/// How many different refusals are told; a flood of bad messages must not fill the memory.
const REFUSED_MAX: usize = 1000;

/// What reaches the coordinator.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// A robot's gauge spoke.
    RobotGauge(RobotId, Gauge),
    /// A robot reported its state.
    RobotState(RobotId, RobotState),
    /// A robot appeared (true) or was lost (false).
    RobotAlive(RobotId, bool),
    /// A station reported its state.
    StationState(StationId, StationState),
    /// The gauge of a station's pack spoke.
    PackGauge(StationId, PackId, Gauge),
    /// A station appeared (true) or was lost (false).
    StationAlive(StationId, bool),
    /// A command was answered.
    Reply(CommandReply),
    /// Time passed. To be given about once a second.
    Tick,
    /// Something came that could not be read.
    Refused(String),
}

/// What the coordinator wants done.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Send a command to a robot.
    ToRobot(RobotId, RobotCommand),
    /// Send a command to a station.
    ToStation(StationId, StationCommand),
    /// Keep this.
    Record(Record),
}

/// Where numbering goes on, so that a restarted coordinator repeats no number.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Numbering {
    /// Counts starts of coordinators of this site; later ones overrule earlier ones.
    pub epoch: u64,
    /// Number of the next event.
    pub event: u64,
    /// Number of the next plan.
    pub plan: u64,
}

impl Default for Numbering {
    fn default() -> Self {
        Self { epoch: 1, event: 1, plan: 1 }
    }
}

/// A command that waits for its answer.
#[derive(Debug, Clone)]
struct Asked {
    command: AskedCommand,
    /// The service that it carries on and the stage that follows.
    service: Option<(RobotId, Stage)>,
    sent: Timestamp,
    deadline: Timestamp,
}

#[derive(Debug, Clone)]
enum AskedCommand {
    Robot(RobotId, RobotCommand),
    Station(StationId, StationCommand),
}

/// The coordinator.
pub struct Core {
    settings: Settings,
    models: Models,
    numbering: Numbering,
    commands: u64,
    fleet: Fleet,
    running: BTreeMap<RobotId, ServiceRun>,
    asked: BTreeMap<CommandId, Asked>,
    /// When each station was last told to select a pack.
    selected: BTreeMap<StationId, Timestamp>,
    /// The problem that the last plan solved.
    problem: Problem,
    plan: Plan,
    schedule: Schedule,
    promised: BTreeSet<RobotId>,
    started: Option<Timestamp>,
    planned: Option<Timestamp>,
    /// Why a new plan is due, if it is.
    trigger: Option<String>,
    refused: BTreeSet<String>,
    outputs: VecDeque<Output>,
}

impl Core {
    /// A coordinator that has heard nothing yet.
    #[must_use]
    pub fn new(settings: Settings, models: Models, numbering: Numbering) -> Self {
        let schedule = Schedule {
            at: Timestamp::from_unix_ms(0),
            plan: 0,
            policy: settings.policy.name().to_owned(),
            trigger: "no plan yet".to_owned(),
            services: Vec::new(),
            unserved: Vec::new(),
        };
        Self {
            settings,
            models,
            numbering,
            commands: 0,
            fleet: Fleet::default(),
            running: BTreeMap::new(),
            asked: BTreeMap::new(),
            selected: BTreeMap::new(),
            problem: Problem { confidence: settings.confidence, robots: Vec::new(), stations: Vec::new() },
            plan: Plan::default(),
            schedule,
            promised: BTreeSet::new(),
            started: None,
            planned: None,
            trigger: None,
            refused: BTreeSet::new(),
            outputs: VecDeque::new(),
        }
    }

    /// Takes in one input.
    pub fn handle(&mut self, now: Timestamp, input: Input) {
        self.started.get_or_insert(now);
        match input {
            Input::RobotGauge(id, gauge) => self.robot_gauge(now, id, gauge),
            Input::RobotState(id, state) => self.robot_state(now, id, state),
            Input::RobotAlive(id, alive) => self.robot_alive(now, id, alive),
            Input::StationState(id, state) => self.station_state(now, id, state),
            Input::PackGauge(id, pack, gauge) => self.pack_gauge(id, pack, gauge),
            Input::StationAlive(id, alive) => self.station_alive(now, id, alive),
            Input::Reply(reply) => self.replied(now, &reply),
            Input::Tick => {}
            Input::Refused(what) => self.refuse(now, what),
        }
        self.resend(now);
        self.carry_on(now);
        if self.plan_due(now) {
            self.make_plan(now);
        }
        self.begin(now);
    }

    /// The next thing to be done, until there is none.
    pub fn poll(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// The plan as it stands, with services that have begun.
    #[must_use]
    pub fn schedule(&self) -> &Schedule {
        &self.schedule
    }

    /// How many robots each pack can still service.
    #[must_use]
    pub fn capacity(&self, now: Timestamp) -> Capacity {
        answers::capacity(&self.basis(now))
    }

    /// Why a robot is serviced as it is.
    ///
    /// # Errors
    /// When the robot is not known, with the nearest that is.
    pub fn explain(&self, now: Timestamp, robot: &RobotId) -> Result<Explanation, String> {
        answers::explain(&self.basis(now), &self.problem, &self.plan, &self.schedule, robot)
    }

    /// What is believed of robots and stations.
    #[must_use]
    pub fn fleet(&self) -> &Fleet {
        &self.fleet
    }

    fn basis(&self, now: Timestamp) -> Basis<'_> {
        Basis { now, fleet: &self.fleet, models: &self.models, settings: &self.settings, running: &self.running, promised: &self.promised }
    }

    // Beliefs.

    fn robot_gauge(&mut self, now: Timestamp, id: RobotId, gauge: Gauge) {
        let robot = self.fleet.robots.entry(id.clone()).or_default();
        if newer(gauge.at, robot.gauge.as_ref().map(|known| known.at)) {
            let first = robot.gauge.is_none();
            robot.gauge = Some(gauge.clone());
            self.record(Record::RobotGauge { robot: id.clone(), gauge });
            if first {
                self.heard_robot(now, &id);
            }
        }
    }

    fn robot_state(&mut self, now: Timestamp, id: RobotId, state: RobotState) {
        if self.models.battery(&id, &state.battery).is_none() {
            self.refuse(now, format!("robot {id} is not configured and no battery model is named `{}`", state.battery));
            return;
        }
        let robot = self.fleet.robots.entry(id.clone()).or_default();
        if !newer(state.at, robot.state.as_ref().map(|known| known.at)) {
            return;
        }
        let before = robot.phase();
        let phase = state.phase;
        robot.state = Some(state.clone());
        robot.lost = false;
        self.record(Record::RobotState { robot: id.clone(), state });
        match before {
            None => self.heard_robot(now, &id),
            Some(before) if before != phase => {
                self.event(now, EventKind::PhaseChanged, Some(&id), None, None, format!("{id}: {before} -> {phase}"));
                if phase == RobotPhase::Stranded {
                    self.replan(format!("{id} is stranded"));
                }
            }
            Some(_) => {}
        }
    }

    fn heard_robot(&mut self, now: Timestamp, id: &RobotId) {
        if self.fleet.robots.get(id).is_some_and(|robot| robot.known().is_some()) {
            self.event(now, EventKind::Joined, Some(id), None, None, format!("{id} joined"));
            self.replan(format!("{id} joined"));
        }
    }

    fn robot_alive(&mut self, now: Timestamp, id: RobotId, alive: bool) {
        let Some(robot) = self.fleet.robots.get_mut(&id) else { return };
        if robot.lost == alive {
            robot.lost = !alive;
            let (kind, verb) = if alive { (EventKind::Joined, "is back") } else { (EventKind::Lost, "was lost") };
            self.event(now, kind, Some(&id), None, None, format!("{id} {verb}"));
            self.replan(format!("{id} {verb}"));
        }
    }

    fn station_state(&mut self, now: Timestamp, id: StationId, state: StationState) {
        if !self.models.stations.contains_key(&id) {
            self.refuse(now, format!("station {id} is not configured"));
            return;
        }
        let station = self.fleet.stations.entry(id.clone()).or_default();
        if !newer(state.at, station.state.as_ref().map(|known| known.at)) {
            return;
        }
        let before = station.state.replace(state.clone());
        station.lost = false;
        self.record(Record::StationState { station: id.clone(), state: state.clone() });
        let Some(before) = before else {
            self.event(now, EventKind::Joined, None, Some(&id), None, format!("{id} joined"));
            self.replan(format!("{id} joined"));
            return;
        };
        if before.powered && !state.powered {
            self.event(now, EventKind::StationDark, None, Some(&id), None, format!("{id} has no power left"));
            self.replan(format!("{id} has no power left"));
        }
        if before.active_pack != state.active_pack
            && let Some(pack) = &state.active_pack
        {
            self.event(now, EventKind::PackSelected, None, Some(&id), Some(pack), format!("{id} runs on {pack}"));
            self.replan(format!("{id} switched to {pack}"));
        }
        for (was, is) in before.packs.iter().zip(&state.packs) {
            if is.depleted && !was.depleted && is.pack == was.pack {
                self.event(now, EventKind::PackDepleted, None, Some(&id), Some(&is.pack), format!("{} of {id} is depleted", is.pack));
                self.replan(format!("{} of {id} is depleted", is.pack));
            }
        }
    }

    fn pack_gauge(&mut self, id: StationId, pack: PackId, gauge: Gauge) {
        if !self.models.stations.contains_key(&id) {
            return;
        }
        let station = self.fleet.stations.entry(id.clone()).or_default();
        if newer(gauge.at, station.packs.get(&pack).map(|known| known.at)) {
            station.packs.insert(pack.clone(), gauge.clone());
            self.record(Record::PackGauge { station: id, pack, gauge });
        }
    }

    fn station_alive(&mut self, now: Timestamp, id: StationId, alive: bool) {
        let Some(station) = self.fleet.stations.get_mut(&id) else { return };
        if station.lost == alive {
            station.lost = !alive;
            let (kind, verb) = if alive { (EventKind::Joined, "is back") } else { (EventKind::Lost, "was lost") };
            self.event(now, kind, None, Some(&id), None, format!("{id} {verb}"));
            self.replan(format!("{id} {verb}"));
        }
    }

    /// Says once what is wrong with an input, however often it comes.
    fn refuse(&mut self, now: Timestamp, what: String) {
        if self.refused.len() < REFUSED_MAX && self.refused.insert(what.clone()) {
            self.event(now, EventKind::InputRefused, None, None, None, what);
        }
    }

    // Planning.

    fn replan(&mut self, why: String) {
        self.trigger.get_or_insert(why);
    }

    /// A plan is due when something happened or the last one is old; the first waits until
    /// everybody who is configured has spoken, but not for ever.
    fn plan_due(&mut self, now: Timestamp) -> bool {
        let Some(planned) = self.planned else {
            let all = self.models.stations.keys().all(|id| self.fleet.stations.get(id).is_some_and(|s| s.known().is_some()))
                && self.models.robots.keys().all(|id| self.fleet.robots.get(id).is_some_and(|r| r.known().is_some()));
            let waited_s = self.started.map_or(0.0, |started| now.seconds_since(started));
            return self.trigger.is_some() && (all || waited_s >= self.settings.patience_s);
        };
        if now.seconds_since(planned) >= self.settings.replan_period_s {
            self.replan("time passed".to_owned());
        }
        // One plan a second at most: a burst of news is one trigger.
        self.trigger.is_some() && now.seconds_since(planned) >= 1.0
    }

    fn make_plan(&mut self, now: Timestamp) {
        let trigger = self.trigger.take().unwrap_or_default();
        self.problem = self.basis(now).problem();
        self.plan = construct(&self.problem, self.settings.policy);
        self.planned = Some(now);
        let number = self.numbering.plan;
        self.numbering.plan += 1;
        let schedule = answers::schedule(&self.basis(now), &self.plan, number, trigger);
        for service in &schedule.services {
            self.promised.insert(service.robot.clone());
        }
        for unserved in &schedule.unserved {
            if self.promised.remove(&unserved.robot) {
                let why = unserved.reasons.join("; ");
                self.event(now, EventKind::PromiseBroken, Some(&unserved.robot), None, None, format!("{}: {why}", unserved.robot));
            }
        }
        let said = |schedule: &Schedule| (schedule.services.len(), schedule.unserved.len());
        if said(&schedule) != said(&self.schedule) || self.schedule.plan == 0 {
            let text =
                format!("plan {number}: {} services, {} unserved ({})", schedule.services.len(), schedule.unserved.len(), schedule.trigger);
            self.event(now, EventKind::PlanMade, None, None, None, text);
        }
        self.record(Record::Plan(schedule.clone()));
        self.schedule = schedule;
        self.record(Record::Capacity(self.capacity(now)));
        let known: Vec<RobotId> = self.fleet.robots.keys().cloned().collect();
        let explanations = known.iter().filter_map(|robot| self.explain(now, robot).ok()).collect();
        self.record(Record::Explanations(explanations));
    }

    // Services.

    /// Begins the services whose robots must leave now.
    fn begin(&mut self, now: Timestamp) {
        let Some(planned) = self.planned else { return };
        let due: Vec<Planned> = {
            let leaves = |planned_service: &&Planned| planned.plus_s(planned_service.slot.leave_s) <= now;
            self.plan.planned.iter().filter(leaves).cloned().collect()
        };
        for service in due {
            self.plan.planned.retain(|other| other.robot != service.robot);
            let Planned { robot, slot, why } = service;
            let station = self.models.stations.keys().nth(slot.station).expect("slots name stations of the problem").clone();
            let how = match (slot.bay, slot.spare) {
                (Some(bay), _) => How::Recharge { bay, to_soc: slot.to_soc.unwrap_or(1.0) },
                (None, Some(spare)) => How::Swap { spare },
                (None, None) => continue,
            };
            let (left, start, end) = (now, planned.plus_s(slot.start_s), planned.plus_s(slot.end_s));
            let run = ServiceRun {
                robot: robot.clone(),
                station: station.clone(),
                how,
                left,
                start,
                end,
                need: slot.need,
                packs: slot.packs,
                why,
                stage: Stage::Travelling,
                asked: None,
            };
            let action = run.first();
            self.event(now, EventKind::ServiceStarted, Some(&robot), Some(&station), None, format!("{robot} goes to {station}"));
            self.running.insert(robot.clone(), run);
            self.ask_robot(now, &robot, action, Stage::Travelling);
            self.refresh_schedule(now);
        }
    }

    /// Carries on every service as far as the newest beliefs allow.
    fn carry_on(&mut self, now: Timestamp) {
        for robot in self.running.keys().cloned().collect::<Vec<_>>() {
            let Some(run) = self.running.get(&robot) else { continue };
            if run.asked.is_some() {
                continue;
            }
            let station = run.station.clone();
            let (Some(belief), Some(place)) = (self.fleet.robots.get(&robot), self.fleet.stations.get(&station)) else { continue };
            match run.next(belief, place) {
                Step::Wait => {}
                Step::Enter(stage) => self.enter(now, &robot, stage),
                Step::AskRobot(action, stage) => self.ask_robot(now, &robot, action, stage),
                Step::AskStation(action, stage) => self.ask_station(now, &station, action, Some((robot, stage))),
                Step::Done => self.done(now, &robot),
                Step::Fail(why) => self.fail(now, &robot, &why),
            }
        }
        self.select_packs(now);
    }

    fn enter(&mut self, now: Timestamp, robot: &RobotId, stage: Stage) {
        if let Some(run) = self.running.get_mut(robot) {
            run.stage = stage;
            self.refresh_schedule(now);
        }
    }

    fn done(&mut self, now: Timestamp, robot: &RobotId) {
        if let Some(run) = self.running.remove(robot) {
            self.promised.remove(robot);
            self.event(now, EventKind::ServiceDone, Some(robot), Some(&run.station), None, format!("{robot} is serviced"));
            self.replan(format!("{robot} is serviced"));
        }
    }

    fn fail(&mut self, now: Timestamp, robot: &RobotId, why: &str) {
        if let Some(run) = self.running.remove(robot) {
            self.event(now, EventKind::ServiceFailed, Some(robot), Some(&run.station), None, format!("{robot}: {why}"));
            if self.promised.remove(robot) {
                self.event(now, EventKind::PromiseBroken, Some(robot), Some(&run.station), None, format!("{robot}: {why}"));
            }
            self.replan(format!("the service of {robot} failed: {why}"));
        }
    }

    /// Hands a station over to its next pack before the active one gives out.
    fn select_packs(&mut self, now: Timestamp) {
        for id in self.models.stations.keys().cloned().collect::<Vec<_>>() {
            let Some(next) = answers::next_pack(&self.basis(now), &id) else { continue };
            // The station's word that it has switched takes a while: ask again only after that.
            let waiting = self.selected.get(&id).is_some_and(|asked| now.seconds_since(*asked) < self.settings.deadline_s);
            if !waiting {
                self.selected.insert(id.clone(), now);
                self.ask_station(now, &id, StationAction::SelectPack { pack: next }, None);
            }
        }
    }

    // Commands.

    fn next_command<A>(&mut self, now: Timestamp, action: A) -> Command<A> {
        self.commands += 1;
        let id = CommandId::new(format!("c{}-{}", self.numbering.epoch, self.commands)).expect("a valid id");
        Command { id, epoch: self.numbering.epoch, at: now, deadline: now.plus_s(self.settings.deadline_s), action }
    }

    fn ask_robot(&mut self, now: Timestamp, robot: &RobotId, action: RobotAction, then: Stage) {
        let command = self.next_command(now, action);
        self.record(Record::RobotCommand { robot: robot.clone(), command: command.clone() });
        let text = format!("{} to {robot}: {}", command.id, answers::robot_action(&command.action));
        self.event(now, EventKind::CommandSent, Some(robot), None, None, text);
        let asked = AskedCommand::Robot(robot.clone(), command.clone());
        self.remember(now, command.id.clone(), command.deadline, asked, Some((robot.clone(), then)));
        self.outputs.push_back(Output::ToRobot(robot.clone(), command));
    }

    fn ask_station(&mut self, now: Timestamp, station: &StationId, action: StationAction, service: Option<(RobotId, Stage)>) {
        let command = self.next_command(now, action);
        self.record(Record::StationCommand { station: station.clone(), command: command.clone() });
        let text = format!("{} to {station}: {}", command.id, answers::station_action(&command.action));
        self.event(now, EventKind::CommandSent, service.as_ref().map(|(robot, _)| robot).cloned().as_ref(), Some(station), None, text);
        let asked = AskedCommand::Station(station.clone(), command.clone());
        self.remember(now, command.id.clone(), command.deadline, asked, service);
        self.outputs.push_back(Output::ToStation(station.clone(), command));
    }

    fn remember(&mut self, now: Timestamp, id: CommandId, deadline: Timestamp, command: AskedCommand, service: Option<(RobotId, Stage)>) {
        if let Some((robot, _)) = &service
            && let Some(run) = self.running.get_mut(robot)
        {
            run.asked = Some(id.clone());
        }
        self.asked.insert(id, Asked { command, service, sent: now, deadline });
    }

    fn replied(&mut self, now: Timestamp, reply: &CommandReply) {
        // A late copy of an answer that was already taken in.
        let Some(asked) = self.asked.remove(&reply.id) else { return };
        self.record(Record::Reply(reply.clone()));
        let Some((robot, stage)) = asked.service else {
            if let Outcome::Rejected { detail, .. } = &reply.outcome {
                self.event(now, EventKind::CommandRejected, None, None, None, format!("{}: {detail}", reply.id));
            }
            return;
        };
        if let Some(run) = self.running.get_mut(&robot) {
            run.asked = None;
        }
        match &reply.outcome {
            Outcome::Accepted => self.enter(now, &robot, stage),
            Outcome::Rejected { reason, detail } => {
                self.event(now, EventKind::CommandRejected, Some(&robot), None, None, format!("{}: {reason}: {detail}", reply.id));
                self.fail(now, &robot, detail);
            }
        }
    }

    /// Sends again what was not answered, with the same id, until its deadline.
    fn resend(&mut self, now: Timestamp) {
        let overdue: Vec<CommandId> = self
            .asked
            .iter()
            .filter(|(_, asked)| now.seconds_since(asked.sent) >= self.settings.resend_s)
            .map(|(id, _)| id.clone())
            .collect();
        for id in overdue {
            let Some(asked) = self.asked.get_mut(&id) else { continue };
            if now > asked.deadline {
                let service = asked.service.clone();
                self.asked.remove(&id);
                self.event(
                    now,
                    EventKind::CommandUnanswered,
                    service.as_ref().map(|(robot, _)| robot),
                    None,
                    None,
                    format!("{id} was not answered"),
                );
                if let Some((robot, _)) = service {
                    self.fail(now, &robot, "a command was not answered");
                }
                continue;
            }
            asked.sent = now;
            self.outputs.push_back(match asked.command.clone() {
                AskedCommand::Robot(robot, command) => Output::ToRobot(robot, command),
                AskedCommand::Station(station, command) => Output::ToStation(station, command),
            });
        }
    }

    // Records.

    fn refresh_schedule(&mut self, now: Timestamp) {
        let (number, trigger) = (self.schedule.plan, self.schedule.trigger.clone());
        self.schedule = answers::schedule(&self.basis(self.planned.unwrap_or(now)), &self.plan, number, trigger);
    }

    fn event(
        &mut self,
        at: Timestamp,
        kind: EventKind,
        robot: Option<&RobotId>,
        station: Option<&StationId>,
        pack: Option<&PackId>,
        text: String,
    ) {
        let seq = self.numbering.event;
        self.numbering.event += 1;
        let event = Event { at, seq, kind, robot: robot.cloned(), station: station.cloned(), pack: pack.cloned(), text };
        self.record(Record::Event(event));
    }

    fn record(&mut self, record: Record) {
        self.outputs.push_back(Output::Record(record));
    }
}
