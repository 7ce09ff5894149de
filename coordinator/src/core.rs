//! The coordinator without clock, network or disk.
//!
//! ```text
//!   handle(now, Input) ──> beliefs ──> problem ──> plan ──> commands, records
//!   poll() -> Output   <───────────────────────────────────────┘
//! ```
//!
//! One input, then poll until nothing is left. The same inputs give the same outputs.
//! `hear.rs` takes in what is said, `lost.rs` who says nothing any more, `forget.rs` who is gone for good, `plan.rs` plans, `serve.rs` carries services on, `ask.rs` sends commands
//! and waits for their answers, `strays.rs` finds robots that are somewhere without a service, `before.rs` knows what the
//! coordinator before this one had promised.

mod ask;
mod before;
mod forget;
mod hear;
mod input;
mod leave;
mod lost;
mod plan;
mod refused;
mod serve;
mod strays;
mod study;
#[cfg(test)]
mod tests;
mod untold;
mod wait;

use std::cell::OnceCell;
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use proto::{
    Capacity, CommandId, Event, EventKind, Explanation, PackId, RobotCommand, RobotId, Schedule, StationCommand, StationId, Timestamp,
};

use ask::Asked;
use before::Before;
pub use forget::NotForgotten;
pub use input::Input;
pub use study::Study;
use untold::Untold;

use crate::answers::{self, Explainer};
use crate::clocks::Clocks;
use crate::fleet::Fleet;
use crate::models::{Models, Settings};
use crate::refusals::Refusals;
use crate::scheduler::{Accounts, Plan, Solved, Tables};
use crate::service_run::ServiceRun;
use crate::store::Record;
use crate::trust::Trust;
use crate::view::Basis;
use crate::watch::{Standing, Watch};
use refused::Refused;

/// Whose services a message may carry on.
enum Concerned {
    Robot(RobotId),
    Station(StationId),
    Everybody,
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
    /// Run this beside the core, and say [`Input::Studied`] when it is done.
    Study(Arc<Study>),
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
    tables: Tables,
    /// The problem that the last plan solved; the plan itself has left it.
    solved: Option<Solved>,
    /// The last plan without the services that have begun since.
    plan: Plan,
    /// What was last changed for each robot, by which plan and why.
    changed: BTreeMap<RobotId, Vec<String>>,
    schedule: Arc<Schedule>,
    promised: BTreeSet<RobotId>,
    /// What the coordinator before this one had promised.
    before: Before,
    /// Robots that are somewhere without a service, since when.
    strays: BTreeMap<RobotId, Timestamp>,
    refusals: Refusals,
    /// Whether a robot gave up waiting for its bay since the last plan.
    gave_up_waiting: bool,
    started: Option<Timestamp>,
    /// The last instant that it was given.
    last: Option<Timestamp>,
    planned: Option<Timestamp>,
    /// When the last few plans were made.
    lately: VecDeque<Timestamp>,
    /// When a plan was last made as a whole.
    renewed: Option<Timestamp>,
    /// A whole plan that is being made beside the core, and what asked for it.
    studying: Option<(Arc<Study>, String)>,
    /// What is still to be told of the last plan.
    untold: Untold,
    /// Why a new plan is due, if it is.
    trigger: Option<String>,
    refused: Refused,
    watch: Watch,
    trust: Trust,
    clocks: Clocks,
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
            trigger: "nobody has spoken yet".to_owned(),
            services: Vec::new(),
            unserved: Vec::new(),
            doubts: Vec::new(),
            quality: None,
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
            tables: Tables::default(),
            solved: None,
            plan: Plan::default(),
            changed: BTreeMap::new(),
            schedule: Arc::new(schedule),
            promised: BTreeSet::new(),
            before: Before::default(),
            strays: BTreeMap::new(),
            refusals: Refusals::default(),
            gave_up_waiting: false,
            started: None,
            last: None,
            planned: None,
            lately: VecDeque::new(),
            renewed: None,
            studying: None,
            untold: Untold::default(),
            trigger: None,
            refused: Refused::default(),
            watch: Watch::default(),
            trust: Trust::default(),
            clocks: Clocks::default(),
            outputs: VecDeque::new(),
        }
    }

    /// Takes in one input.
    pub fn handle(&mut self, now: Timestamp, input: Input) {
        self.started.get_or_insert(now);
        if let Some(last) = self.last.replace(now).filter(|last| now < *last) {
            self.set_back(last.unix_ms() - now.unix_ms());
        }
        let Some(concerned) = self.take_in(now, input) else { return };
        // What only time can change is looked at with the clock: a message costs the same in any fleet.
        let everybody = matches!(concerned, Concerned::Everybody);
        if everybody {
            self.write_off_the_lost(now);
            self.doubt_gauges(now);
            self.resend(now);
        }
        self.carry_on(now, &concerned);
        if everybody {
            self.find_strays(now);
        }
        let due = self.plan_due(now);
        if due {
            // The first plan knows of what the coordinator before has begun.
            if self.planned.is_none() {
                self.find_strays(now);
            }
            self.make_plan(now);
        } else if everybody && self.planned.is_none() {
            self.tell_whom_it_waits_for(now);
        }
        if due || everybody {
            self.begin(now);
        }
    }

    /// Notes what an input says, and whose services it may carry on; none when it says nothing new.
    fn take_in(&mut self, now: Timestamp, input: Input) -> Option<Concerned> {
        let robot = Concerned::Robot;
        let station = Concerned::Station;
        match input {
            Input::RobotGauge(id, gauge) => self.robot_gauge(now, &id, gauge).then(|| robot(id)),
            Input::RobotState(id, state) => self.robot_state(now, &id, state).then(|| robot(id)),
            Input::RobotAlive(id, alive) => self.robot_alive(now, &id, alive).then(|| robot(id)),
            Input::StationState(id, state) => self.station_state(now, &id, state).then(|| station(id)),
            Input::PackGauge(id, pack, gauge) => self.pack_gauge(now, &id, pack, gauge).then(|| station(id)),
            Input::StationAlive(id, alive) => self.station_alive(now, &id, alive).then(|| station(id)),
            Input::Reply(reply) => {
                self.replied(now, &reply);
                Some(Concerned::Everybody)
            }
            Input::Tick => {
                self.tell_answers(now);
                Some(Concerned::Everybody)
            }
            Input::Replan(why) => {
                self.replan(why);
                Some(Concerned::Everybody)
            }
            Input::Forget(robot) => {
                self.forget(now, &robot);
                Some(Concerned::Everybody)
            }
            Input::Studied => self.studied(now).then_some(Concerned::Everybody),
            Input::Refused(what) => {
                self.refuse(now, what);
                None
            }
            Input::Before(schedule) => {
                self.take_over(now, &schedule);
                None
            }
            Input::Nothing => None,
        }
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
        answers::capacity(&self.basis(now), &self.plan)
    }

    /// Why a robot is serviced as it is.
    ///
    /// # Errors
    /// When the robot is not known, with the nearest that is.
    pub fn explain(&self, now: Timestamp, robot: &RobotId) -> Result<Explanation, String> {
        self.explain_all(now, std::iter::once(robot)).pop().expect("an answer for one robot")
    }

    /// The same for many, in order.
    fn explain_all<'a>(&self, now: Timestamp, robots: impl Iterator<Item = &'a RobotId>) -> Vec<Result<Explanation, String>> {
        let robots: Vec<&RobotId> = robots.collect();
        let asked = robots.iter().copied().collect();
        let ways = self.solved.as_ref().map(|solved| solved.ways(&asked));
        let accounts = self.solved.as_ref().zip(ways.as_ref());
        let accounts = accounts.map(|(solved, ways)| Accounts::new(&solved.task, ways, &solved.sessions));
        let mut explainer = Explainer::new(self.basis(now), accounts, &self.schedule);
        robots.into_iter().map(|robot| explainer.explain(robot, self.changed.get(robot).map_or(&[], Vec::as_slice))).collect()
    }

    /// What is believed of robots and stations.
    #[must_use]
    pub fn fleet(&self) -> &Fleet {
        &self.fleet
    }

    /// How every model stands that has been judged by its data.
    pub(crate) fn standings(&self, now: Timestamp) -> Vec<Standing> {
        self.watch.standings(now, &self.fleet, &self.models)
    }

    /// What plans and answers are made from.
    pub(crate) fn basis(&self, now: Timestamp) -> Basis<'_> {
        Basis {
            now,
            fleet: &self.fleet,
            models: &self.models,
            tables: &self.tables,
            settings: &self.settings,
            running: &self.running,
            promised: &self.promised,
            planned: &self.plan.planned,
            watch: &self.watch,
            trust: &self.trust,
            refusals: &self.refusals,
            crowd: self.plan.crowd,
            in_reach: OnceCell::new(),
        }
    }

    /// The clock was set back: what is counted from an instant is counted from as much earlier, or
    /// nothing would be due until that time came again.
    fn set_back(&mut self, by_ms: i64) {
        let earlier = |at: &mut Timestamp| *at = at.plus_ms(-by_ms);
        self.started
            .iter_mut()
            .chain(&mut self.planned)
            .chain(&mut self.renewed)
            .chain(&mut self.lately)
            .chain(&mut self.untold.counted)
            .for_each(earlier);
        self.selected.values_mut().chain(self.strays.values_mut()).for_each(earlier);
        self.trust.set_back(by_ms);
        self.refusals.set_back(by_ms);
        let lost = self.fleet.robots.values_mut().map(|robot| &mut robot.lost_since);
        lost.chain(self.fleet.stations.values_mut().map(|station| &mut station.lost_since)).flatten().for_each(earlier);
        for station in self.fleet.stations.values_mut() {
            station.left.values_mut().map(|left| &mut left.since).chain(station.relieved.iter_mut().map(|(_, at)| at)).for_each(earlier);
        }
        for run in self.running.values_mut() {
            let again = run.again.as_mut().map(|again| &mut again.at);
            [&mut run.left, &mut run.start, &mut run.end]
                .into_iter()
                .chain(again)
                .chain(&mut run.takes_none_since)
                .chain(&mut run.called_off_since)
                .for_each(earlier);
        }
        // The deadline in a command stays as it was sent; that of waiting for its answer moves.
        self.asked.values_mut().for_each(|asked| asked.set_back(by_ms));
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
