//! The station's side of a service, without clock, network or hardware.
//!
//! `alone.rs` is what it does while no coordinator is heard, `memory.rs` what it must not forget, `spares.rs` what it has to hand out,
//! `tell.rs` what it says of itself and when.

mod alone;
mod memory;
mod spares;
mod tell;

use std::collections::{BTreeMap, VecDeque};

use energy::gauge::{Gauge as Estimator, Sample};
use energy::selector::{PackSeen, Rule};
use node::{Due, Ledger, Publish, Silence, refused, wire};
use proto::{
    Absence, BayId, BayPhase, CommandReply, Gauge, Outcome, PackId, PackReturn, Rejection, RobotId, RobotPhase, RobotState, SpareId,
    SpareState, StationAction, StationCommand, StationId, StationState, Timestamp,
};

pub use alone::Alone;
pub use memory::Memory;

use crate::source::{Act, Lifted, Observation};

/// What does not change about a station while its agent runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// The station.
    pub id: StationId,
    /// Its bays.
    pub bays: Vec<BayId>,
    /// Its spares as they are at first.
    pub spares: Vec<SpareState>,
    /// When its selector changes packs, and to which.
    pub rule: Rule,
    /// How often it speaks.
    pub publish: Publish,
    /// What it does while no coordinator is heard.
    pub alone: Alone,
    /// Where samples come from, for people.
    pub source: String,
}

/// What reaches the agent.
#[derive(Debug, Clone, PartialEq)]
pub enum Input {
    /// The source moved on.
    Observed(Observation),
    /// The coordinator asks for something.
    Command(StationCommand),
    /// A robot said what it does.
    Robot(RobotId, RobotState),
    /// The network is there: nobody has heard what was said before.
    Joined,
    /// A coordinator appeared (true) or was lost (false).
    Coordinator(bool),
}

/// What the agent wants done.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Publish a pack's gauge.
    Gauge(PackId, Gauge),
    /// Publish the state.
    State(StationState),
    /// Answer a command.
    Reply(CommandReply),
    /// Make the station do something.
    Act(Act),
    /// Write this down before anything that follows: a restart begins with it.
    Keep(Box<Memory>),
}

/// An exchange of a robot's pack under way.
type Swapping = (RobotId, SpareId);

struct Bay {
    id: BayId,
    phase: BayPhase,
    robot: Option<RobotId>,
}

struct Pack {
    id: PackId,
    gauge: Box<dyn Estimator>,
    depleted: bool,
    /// What its device said last of its charge.
    said_soc: Option<energy::Estimate>,
    connected: bool,
    back: Option<PackReturn>,
    last: Option<Sample>,
    /// Nobody was told of it yet.
    fresh: bool,
    /// Why what its gauge says now is not sent.
    senseless: Option<String>,
}

impl Pack {
    fn seen(&self) -> PackSeen {
        let voltage_v = self.last.map_or(0.0, |sample| sample.voltage_v);
        PackSeen { voltage_v, usable: self.connected && !self.depleted }
    }
}

/// What was last told of power, packs and place: whether there is power, the active pack, whose pack is being
/// exchanged, which packs are in their places, and when the station arrives and leaves.
type ToldPower = (bool, Option<PackId>, Option<RobotId>, Vec<bool>, Option<Timestamp>, Vec<Absence>);

/// The station's side of a service.
///
/// Call [`Agent::handle`] with each input, then [`Agent::poll`] until it returns nothing.
pub struct Agent {
    profile: Profile,
    ledger: Ledger,
    bays: Vec<Bay>,
    packs: Vec<Pack>,
    spares: Vec<SpareState>,
    /// Lift movements to come; the first is under way when `lifting`.
    lifts: VecDeque<Lifted>,
    lifting: bool,
    swapping: Option<Swapping>,
    active_pack: Option<PackId>,
    powered: bool,
    pack_power_w: f64,
    arrives: Option<Timestamp>,
    away: Vec<Absence>,
    last_command: Option<proto::CommandId>,
    silence: Silence,
    /// Robots that said they are here, and when.
    here: BTreeMap<RobotId, (Timestamp, RobotPhase)>,
    /// It was restarted, and has not seen yet whether lift and exchange go on.
    restored: bool,
    /// Whether its source knows how it stands; once it does, it goes on to.
    known: bool,
    /// What goes wrong with the station, as its source says.
    trouble: Option<String>,
    kept: Option<memory::Sketch>,
    gauge_due: Due,
    state_due: Due,
    told: Option<Vec<(BayPhase, Option<RobotId>)>>,
    told_power: Option<ToldPower>,
    gauge_seq: u64,
    state_seq: u64,
    outputs: VecDeque<Output>,
}

impl Agent {
    /// An agent with one gauge per pack, in the selector's order.
    #[must_use]
    pub fn new(profile: Profile, packs: Vec<(PackId, Box<dyn Estimator>)>) -> Self {
        Self {
            bays: profile.bays.iter().map(|id| Bay { id: id.clone(), phase: BayPhase::Free, robot: None }).collect(),
            spares: profile.spares.clone(),
            active_pack: packs.first().map(|(id, _)| id.clone()),
            packs: packs
                .into_iter()
                .map(|(id, gauge)| Pack {
                    id,
                    gauge,
                    depleted: false,
                    said_soc: None,
                    connected: true,
                    back: None,
                    last: None,
                    fresh: false,
                    senseless: None,
                })
                .collect(),
            profile,
            ledger: Ledger::default(),
            lifts: VecDeque::new(),
            lifting: false,
            swapping: None,
            powered: true,
            pack_power_w: 0.0,
            arrives: None,
            away: Vec::new(),
            last_command: None,
            silence: Silence::default(),
            here: BTreeMap::new(),
            restored: false,
            known: false,
            trouble: None,
            kept: None,
            gauge_due: Due::default(),
            state_due: Due::default(),
            told: None,
            told_power: None,
            gauge_seq: 0,
            state_seq: 0,
            outputs: VecDeque::new(),
        }
    }

    /// Takes in one input.
    pub fn handle(&mut self, now: Timestamp, input: Input) {
        match input {
            Input::Observed(observation) => {
                self.observed(now, observation);
                self.act_alone(now);
            }
            Input::Robot(robot, state) => self.robot_said(now, robot, &state),
            Input::Joined => (self.told, self.told_power) = (None, None),
            Input::Coordinator(heard) => self.silence.tell(now, heard),
            Input::Command(command) => {
                self.silence.speaks(now);
                let mut ledger = std::mem::take(&mut self.ledger);
                let reply = ledger.answer(now, &command, |action| self.act(action));
                self.ledger = ledger;
                // Refusals are kept too: a copy that comes after a restart gets the same one.
                self.kept = None;
                if reply.outcome == Outcome::Accepted {
                    self.last_command = Some(command.id);
                }
                self.outputs.push_back(Output::Reply(reply));
            }
        }
        self.start_next_lift();
        self.tell(now);
        self.keep();
    }

    /// The next thing to be done, until there is none.
    pub fn poll(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// State of charge of every pack by its gauge.
    pub fn socs(&self) -> impl Iterator<Item = (&PackId, energy::Estimate)> {
        self.packs.iter().map(|pack| (&pack.id, pack.gauge.soc()))
    }

    /// The robot in each bay.
    pub fn bays(&self) -> impl Iterator<Item = Option<&RobotId>> {
        self.bays.iter().map(|bay| bay.robot.as_ref())
    }

    /// Where a robot is that the station already has to do with: nothing is in two places.
    fn whereabouts(&self, robot: &RobotId) -> Option<String> {
        let bay = self.bays.iter().find(|bay| bay.robot.as_ref() == Some(robot)).map(|bay| format!("{robot} has bay {}", bay.id));
        bay.or_else(|| {
            self.swapping.as_ref().is_some_and(|(known, _)| known == robot).then(|| format!("the pack of {robot} is being exchanged"))
        })
    }

    fn act(&mut self, action: &StationAction) -> Outcome {
        if !self.powered {
            return refused(Rejection::NotPossible, "the station has no power");
        }
        match action {
            StationAction::Dock { robot, bay } => {
                let elsewhere = self.whereabouts(robot);
                let Some(known) = self.bays.iter_mut().find(|known| known.id == *bay) else {
                    return refused(Rejection::UnknownTarget, format!("there is no bay {bay}"));
                };
                if known.phase != BayPhase::Free {
                    let by = known.robot.as_ref().map_or_else(|| "nobody".to_owned(), ToString::to_string);
                    return refused(Rejection::Busy, format!("bay {bay} is {} by {by}", known.phase));
                }
                if let Some(elsewhere) = elsewhere {
                    return refused(Rejection::Busy, elsewhere);
                }
                (known.phase, known.robot) = (BayPhase::Loading, Some(robot.clone()));
                self.lifts.push_back(Lifted { robot: robot.clone(), bay: bay.clone(), into: true });
                Outcome::Accepted
            }
            StationAction::Undock { robot, bay } => {
                let Some(known) = self.bays.iter_mut().find(|known| known.id == *bay) else {
                    return refused(Rejection::UnknownTarget, format!("there is no bay {bay}"));
                };
                if known.phase != BayPhase::Occupied || known.robot.as_ref() != Some(robot) {
                    return refused(Rejection::NotPossible, format!("{robot} is not in bay {bay}"));
                }
                known.phase = BayPhase::Unloading;
                self.lifts.push_back(Lifted { robot: robot.clone(), bay: bay.clone(), into: false });
                Outcome::Accepted
            }
            StationAction::SwapPack { robot, spare } => {
                if let Some((other, _)) = &self.swapping {
                    return refused(Rejection::Busy, format!("the pack of {other} is being exchanged"));
                }
                if let Some(elsewhere) = self.whereabouts(robot) {
                    return refused(Rejection::Busy, elsewhere);
                }
                let Some(known) = self.spares.iter_mut().find(|known| known.spare == *spare) else {
                    return refused(Rejection::UnknownTarget, format!("there is no spare {spare}"));
                };
                if !known.ready {
                    return refused(Rejection::NotPossible, format!("spare {spare} is not ready"));
                }
                known.ready = false;
                self.swapping = Some((robot.clone(), spare.clone()));
                self.outputs.push_back(Output::Act(Act::Swap { robot: robot.clone(), spare: spare.clone() }));
                Outcome::Accepted
            }
            StationAction::SelectPack { pack } => {
                let Some(wanted) = self.packs.iter().position(|known| known.id == *pack) else {
                    return refused(Rejection::UnknownTarget, format!("there is no pack {pack}"));
                };
                if self.chosen(Some(wanted)) != Some(wanted) {
                    let why = if self.packs[wanted].connected { "depleted" } else { "away" };
                    return refused(Rejection::NotPossible, format!("pack {pack} is {why}"));
                }
                self.outputs.push_back(Output::Act(Act::Select { pack: pack.clone() }));
                Outcome::Accepted
            }
        }
    }

    /// The selector's choice among the packs as they are seen.
    fn chosen(&self, request: Option<usize>) -> Option<usize> {
        let packs: Vec<PackSeen> = self.packs.iter().map(Pack::seen).collect();
        let active = self.packs.iter().position(|pack| Some(&pack.id) == self.active_pack.as_ref());
        self.profile.rule.choose(&packs, active.unwrap_or(0), request)
    }

    /// Leaves a pack whose voltage is low for one that is good.
    fn leave_a_low_pack(&mut self) {
        if !self.powered || !self.known {
            return;
        }
        if let Some(pack) = self.chosen(None).map(|index| self.packs[index].id.clone())
            && self.active_pack.as_ref().is_some_and(|active| *active != pack)
        {
            self.outputs.push_back(Output::Act(Act::Select { pack }));
        }
    }

    fn start_next_lift(&mut self) {
        if !self.lifting
            && let Some(next) = self.lifts.front()
        {
            self.lifting = true;
            self.outputs.push_back(Output::Act(Act::Lift(next.clone())));
        }
    }

    /// Takes in what the lift has done, and what it cannot do.
    fn moved(&mut self, lifted: Option<Lifted>, given_up: Option<Lifted>, mended: &[BayId]) {
        // What an agent before this one had begun and seen is not taken twice.
        let is_own = |done: &Lifted| self.lifting && self.lifts.front() == Some(done);
        let ended = lifted.iter().chain(&given_up).any(is_own);
        for bay in &mut self.bays {
            let about = |done: &&Lifted| done.bay == bay.id;
            let robot = bay.robot.clone();
            if let Some(done) = given_up.as_ref().filter(about).filter(|_| ended) {
                // Whom it could not let out it still holds.
                (bay.phase, bay.robot) = (BayPhase::Failed, robot.filter(|_| !done.into));
            } else if let Some(done) = lifted.as_ref().filter(about).filter(|done| ended || bay.phase == BayPhase::Failed && !done.into) {
                (bay.phase, bay.robot) = if done.into { (BayPhase::Occupied, robot) } else { (BayPhase::Free, None) };
            } else if bay.phase == BayPhase::Failed && bay.robot.is_none() && mended.contains(&bay.id) {
                bay.phase = BayPhase::Free;
            }
        }
        if ended {
            self.lifts.pop_front();
            self.lifting = false;
        }
    }

    fn observed(&mut self, now: Timestamp, observation: Observation) {
        for reading in observation.packs {
            if let Some(pack) = self.packs.iter_mut().find(|pack| pack.id == reading.pack) {
                (pack.depleted, pack.connected) = (reading.depleted, reading.connected);
                pack.said_soc = if reading.depleted { pack.said_soc } else { None }.or(reading.said_soc).or(pack.said_soc);
                let was = pack.back.map(|back| back.at);
                pack.back = reading.back.map(|(in_s, soc)| PackReturn { at: tell::again(was, now.plus_s(in_s)), soc: wire(soc) });
                if let Some(soc) = reading.exchanged {
                    pack.gauge.exchange(soc);
                }
                let Some(sample) = reading.sample.filter(|_| reading.connected) else { continue };
                pack.gauge.update(&sample);
                (pack.last, pack.fresh) = (Some(sample), true);
                if observation.active_pack.as_ref() == Some(&pack.id) {
                    self.pack_power_w = sample.current_a * sample.voltage_v;
                }
            }
        }
        self.active_pack = observation.active_pack;
        self.known |= observation.known;
        self.powered = observation.powered || !self.known;
        self.arrives = observation.arrives_s.map(|in_s| tell::again(self.arrives, now.plus_s(in_s)));
        self.away = tell::away(&self.away, now, &observation.away_s);
        self.leave_a_low_pack();
        self.moved(observation.lifted, observation.given_up, &observation.mended);
        self.trouble = observation.trouble;
        self.exchanged(observation.swapped);
        self.called_off(observation.called_off);
        self.lie_there(observation.charged, true);
        self.lie_there(observation.uncharged, false);
        if self.restored && !observation.lift_active {
            self.begin_again();
        }
    }
}

#[cfg(test)]
mod tests;
