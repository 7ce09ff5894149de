//! The robot's side of a service, without clock, network or hardware.
//!
//! `alone.rs` is what it does while no coordinator is heard, `memory.rs` what it must not forget,
//! `drain.rs` how it learns what it draws at work, `exchange.rs` how it notices that another pack was put in, `host.rs` what its station says of it.

mod alone;
mod charge;
mod drain;
mod exchange;
mod host;
mod memory;

use std::collections::{BTreeMap, VecDeque};

use energy::gauge::{Gauge as Estimator, Sample};
use node::{Due, Ledger, Publish, Silence, gauge_message, refused, why_senseless};
use proto::{
    BayId, CommandReply, Estimate, Gauge, Mission, NamedModel, Outcome, Rejection, RobotAction, RobotCommand, RobotId, RobotPhase,
    RobotState, StationId, StationState, Timestamp, Travel,
};

pub use alone::Alone;
pub use drain::unmeasured_w;
pub use memory::Memory;

use crate::source::{Act, Observation, Place};

/// What does not change about a robot while its agent runs.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// The robot.
    pub id: RobotId,
    /// Name of the gauge's battery model, for the coordinator to look up its own.
    pub battery: String,
    /// The model of its loads, for people; none where its drain is measured.
    pub load: Option<NamedModel>,
    /// Cells in series, for readers of the gauge.
    pub cells_series: u32,
    /// Charge current below which the pack counts as full, A.
    pub charge_cutoff_a: f64,
    /// Power drawn while working, W.
    pub drain_w: Estimate,
    /// Whether that is not known beforehand, but measured at work.
    pub measure_drain: bool,
    /// The way to each station in reach.
    pub travel: BTreeMap<StationId, Travel>,
    /// What the work is worth.
    pub mission: Mission,
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
    Command(RobotCommand),
    /// A station said how it stands.
    Station(StationId, StationState),
    /// The network is there: nobody has heard what was said before.
    Joined,
    /// A coordinator appeared (true) or was lost (false).
    Coordinator(bool),
}

/// What the agent wants done.
#[derive(Debug, Clone, PartialEq)]
pub enum Output {
    /// Publish the gauge.
    Gauge(Gauge),
    /// Publish the state.
    State(RobotState),
    /// Answer a command.
    Reply(CommandReply),
    /// Make the robot do something.
    Act(Act),
    /// Write this down before anything that follows: a restart begins with it.
    Keep(Box<Memory>),
}

/// The robot's side of a service.
///
/// Call [`Agent::handle`] with each input, then [`Agent::poll`] until it returns nothing.
pub struct Agent {
    profile: Profile,
    gauge: Box<dyn Estimator>,
    ledger: Ledger,
    phase: RobotPhase,
    station: Option<StationId>,
    bay: Option<BayId>,
    target_soc: Option<f64>,
    charge: charge::Watch,
    last: Option<Sample>,
    /// When that was seen, by the time since the start, s.
    sampled_s: Option<f64>,
    /// Nobody was told of it yet.
    fresh: bool,
    drain: drain::Drain,
    /// What the device said last of the charge before an exchange.
    said_soc: Option<energy::Estimate>,
    /// Whether another pack was seen in the robot, until the exchange is over.
    pack_seen: bool,
    /// What its station said last.
    host: Option<host::Host>,
    /// When it looked last, and how long it has been at it, s.
    looked: Option<Timestamp>,
    passed_s: f64,
    last_command: Option<proto::CommandId>,
    note: Option<String>,
    /// Why what the gauge says now is not sent.
    senseless: Option<String>,
    silence: Silence,
    /// It was restarted, and has not seen yet where it is.
    restored: Option<memory::Restored>,
    kept: Option<memory::Sketch>,
    gauge_due: Due,
    state_due: Due,
    told: Option<(RobotPhase, Option<BayId>)>,
    gauge_seq: u64,
    state_seq: u64,
    outputs: VecDeque<Output>,
}

impl Agent {
    /// An agent at work.
    #[must_use]
    pub fn new(profile: Profile, gauge: Box<dyn Estimator>) -> Self {
        Self {
            profile,
            gauge,
            ledger: Ledger::default(),
            phase: RobotPhase::Working,
            station: None,
            bay: None,
            target_soc: None,
            charge: charge::Watch::default(),
            last: None,
            sampled_s: None,
            fresh: false,
            drain: drain::Drain::default(),
            said_soc: None,
            pack_seen: false,
            host: None,
            looked: None,
            passed_s: 0.0,
            last_command: None,
            note: None,
            senseless: None,
            silence: Silence::default(),
            restored: None,
            kept: None,
            gauge_due: Due::default(),
            state_due: Due::default(),
            told: None,
            gauge_seq: 0,
            state_seq: 0,
            outputs: VecDeque::new(),
        }
    }

    /// Takes in one input.
    pub fn handle(&mut self, now: Timestamp, input: Input) {
        self.pass(now);
        match input {
            Input::Observed(observation) => {
                self.observed(&observation);
                self.act_alone(now, &observation);
            }
            Input::Station(station, state) => self.station_said(now, &station, &state),
            Input::Joined => (self.told, self.state_due) = (None, Due::default()),
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
        self.tell(now);
        self.keep();
    }

    /// The next thing to be done, until there is none.
    pub fn poll(&mut self) -> Option<Output> {
        self.outputs.pop_front()
    }

    /// State of charge by the gauge.
    #[must_use]
    pub fn soc(&self) -> energy::Estimate {
        self.gauge.soc()
    }

    /// Whether a way to any station is known.
    #[must_use]
    pub fn reaches_a_station(&self) -> bool {
        !self.profile.travel.is_empty()
    }

    fn act(&mut self, action: &RobotAction) -> Outcome {
        use RobotPhase::{Charged, Charging, Docked, Stranded, Travelling, Waiting, Working};
        match (action, self.phase) {
            (_, Stranded) => refused(Rejection::NotPossible, "the robot is stranded"),
            (RobotAction::Dock { station, bay }, Working | Travelling | Waiting) => {
                if !self.profile.travel.contains_key(station) {
                    return refused(Rejection::UnknownTarget, format!("no way to station {station} is known"));
                }
                let there = self.phase != Working && self.station.as_ref() == Some(station);
                let is_told = there && self.bay == *bay;
                if !there {
                    self.leaves_host();
                }
                (self.station, self.bay) = (Some(station.clone()), bay.clone());
                let (station, bay) = (station.clone(), bay.clone());
                if !there {
                    self.phase = Travelling;
                    self.outputs.push_back(Output::Act(Act::TravelTo { station, bay }));
                } else if !is_told {
                    // A robot that came by its own rule, or for an exchange, has not heard of a bay: by itself it would never drive into it.
                    self.outputs.push_back(Output::Act(Act::GoOnTo { station, bay }));
                }
                Outcome::Accepted
            }
            (RobotAction::ChargeTo { soc }, Docked | Charging | Charged) => {
                self.target_soc = Some(*soc);
                self.charge = charge::Watch::default();
                self.phase = Charging;
                self.outputs.push_back(Output::Act(Act::Charge));
                Outcome::Accepted
            }
            (RobotAction::SwapPack { station, .. }, Waiting) if self.station.as_ref() == Some(station) => {
                (self.phase, self.pack_seen) = (RobotPhase::Swapping, false);
                Outcome::Accepted
            }
            // The charger stops before the lift moves, so that no contact opens under current.
            (RobotAction::Undock, Docked | Charging | Charged) => {
                self.stop_charging();
                Outcome::Accepted
            }
            (RobotAction::Undock, RobotPhase::Swapping) if self.is_in_hands() => {
                refused(Rejection::Busy, "its station is exchanging its pack")
            }
            (RobotAction::Undock, Travelling | Waiting | RobotPhase::Swapping) => {
                self.resume();
                Outcome::Accepted
            }
            (action, phase) => refused(Rejection::Busy, format!("{action} does not go with phase {phase}")),
        }
    }

    fn stop_charging(&mut self) {
        self.target_soc = None;
        self.phase = RobotPhase::Charged;
        self.outputs.push_back(Output::Act(Act::StopCharging));
    }

    fn resume(&mut self) {
        (self.phase, self.station, self.bay, self.target_soc) = (RobotPhase::Working, None, None, None);
        self.pack_seen = false;
        self.leaves_host();
        self.outputs.push_back(Output::Act(Act::Resume));
    }

    fn observed(&mut self, observation: &Observation) {
        use RobotPhase::{Charged, Charging, Docked, Stranded, Swapping, Travelling, Waiting, Working};
        let put_in = self.put_in(observation);
        let is_another = put_in.is_some() && self.is_another(observation);
        // What flowed while one pack took the place of the other flowed out of neither.
        let of_both = put_in.is_some() && observation.exchanged.is_none();
        if let Some(sample) = observation.sample.filter(|_| !of_both) {
            self.gauge.update(&sample);
            (self.last, self.sampled_s, self.fresh) = (Some(sample), Some(self.passed_s), true);
            if self.phase == Working && self.profile.measure_drain {
                self.learn_drain(&sample);
            }
        }
        if let Some(soc) = put_in {
            self.gauge.exchange(soc);
            if self.phase == Swapping && is_another {
                self.sees_pack();
            }
        }
        self.leave_after_exchange();
        self.remember_said(observation);
        let dark_s = self.charge.dark_s(self.passed_s, self.phase == Charging && !observation.powered);
        let is_dark = dark_s >= charge::DARK_S || dark_s > 0.0 && self.is_powered() == Some(false);
        self.note = observation.why_down.clone().or_else(|| is_dark.then(|| "the bay has no power".to_owned()));
        self.find_itself(observation);
        if matches!(self.phase, Travelling | Waiting) && observation.place == Place::InBay {
            self.bay = self.given_bay().cloned().or(self.bay.take());
        }
        match (self.phase, observation.place) {
            (Working | Travelling | Waiting, place) if observation.depleted && place != Place::InBay => self.phase = Stranded,
            (Travelling, Place::AtStation) => self.phase = Waiting,
            // Who comes for an exchange is given no bay: whatever place it stands in, it waits there.
            (Travelling | Waiting, Place::InBay) if self.station.is_some() && self.bay.is_none() && !observation.powered => {
                self.phase = Waiting;
            }
            (Working | Travelling | Waiting, Place::InBay) => self.phase = Docked,
            (Docked | Charging | Charged, Place::AtStation | Place::Underway | Place::Mission) => self.resume(),
            (Charging, Place::InBay) if observation.powered => {
                let (target, soc, facts) = (self.target_soc.unwrap_or(1.0), self.gauge.soc().value, self.gauge.model().battery());
                let ended = observation.sample.is_some_and(|sample| self.charge.sees(&sample, facts, self.profile.charge_cutoff_a));
                self.note = self.note.take().or_else(|| self.charge.note(observation.sample.as_ref()));
                if soc >= target || (ended && soc > 0.5) {
                    self.stop_charging();
                }
            }
            // It runs on its battery beside a charger that has ended.
            (Charging, Place::InBay) if dark_s >= charge::DARK_S && self.is_powered() == Some(true) => {
                if let Some(sample) = &observation.sample {
                    self.charge.feels(sample, self.gauge.model().battery());
                }
                if self.charge.was_ending() && self.gauge.soc().value > 0.5 {
                    self.stop_charging();
                } else if self.charge.is_to_be_asked_again(self.passed_s) {
                    self.outputs.push_back(Output::Act(Act::Charge));
                }
            }
            _ => {}
        }
    }

    /// Publishes what is due: the gauge by its period, the state by its period and on change.
    fn tell(&mut self, now: Timestamp) {
        // What has not been measured anew is not said anew: who listens shall see that it grows old.
        if let Some(sample) = self.last
            && self.fresh
            && self.gauge_due.is(now)
        {
            self.fresh = false;
            self.gauge_due.done(now, self.profile.publish.gauge_period_s);
            let reading = self.gauge.reading();
            self.gauge_seq += 1;
            let message = gauge_message(now, self.gauge_seq, &sample, &reading, self.profile.cells_series, &self.profile.source);
            self.senseless = why_senseless(&message);
            if self.senseless.is_none() {
                self.outputs.push_back(Output::Gauge(message));
            }
        }
        let telling = (self.phase, self.bay.clone());
        if self.told.as_ref() != Some(&telling) || self.state_due.is(now) {
            self.told = Some(telling);
            self.state_due.done(now, self.profile.publish.state_period_s);
            let message = self.state_message(now);
            self.outputs.push_back(Output::State(message));
        }
    }

    fn state_message(&mut self, now: Timestamp) -> RobotState {
        self.state_seq += 1;
        RobotState {
            at: now,
            seq: self.state_seq,
            phase: self.phase,
            station: self.station.clone(),
            bay: self.bay.clone(),
            drain_w: self.profile.drain_w,
            travel: self.profile.travel.clone(),
            mission: self.profile.mission,
            battery: self.profile.battery.clone(),
            load: self.profile.load.clone(),
            last_command: self.last_command.clone(),
            note: self.note.clone().or_else(|| self.senseless.clone()),
        }
    }
}

#[cfg(test)]
mod tests;
