//! What the station at which a robot is says of it. Without that nothing but currents tell whether it stands in a bay, or was let out of it.

use node::LOOK_MAX_S;
use proto::{BayId, BayPhase, RobotPhase, StationId, StationState, Timestamp, newer};

use super::{Agent, Output};
use crate::source::{Act, Held};

/// A station's word counts for so long, s: longer than one that is restarted says nothing (a minute, and its period). A guess.
const FRESH_S: f64 = 90.0;
/// And for so many times as long as there was between two of its words.
const FRESH_PERIODS: f64 = 3.0;
/// No station speaks less often than this, s: between two words that follow each other it was not heard.
const APART_MAX_S: f64 = 600.0;

/// The newest word of the robot's station.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Host {
    station: StationId,
    /// When it was heard, s since the agent's start.
    heard_s: f64,
    /// The longest time between two of its words so far, s.
    apart_s: f64,
    /// Whether that was after another pack was seen in the robot.
    is_of_new_pack: bool,
    stamp: (Timestamp, u64),
    /// The bay that has to do with this robot, and what it does.
    bay: Option<(BayId, BayPhase)>,
    /// Whether it has let the robot out since it had it in a bay.
    let_out: bool,
    /// Whether this robot's pack is being exchanged.
    swaps: bool,
    powered: bool,
}

impl Agent {
    /// The station at which the robot is, or to which it is on its way: whose word it has to hear.
    #[must_use]
    pub fn station(&self) -> Option<&StationId> {
        self.station.as_ref()
    }

    /// What that station says of the robot.
    #[must_use]
    pub fn held(&self) -> Held {
        match self.word() {
            None => Held::Unheard,
            Some(Host { bay: Some((_, BayPhase::Occupied)), .. }) => Held::InBay,
            Some(Host { bay: Some((_, BayPhase::Unloading | BayPhase::Failed)), .. }) => Held::LetsOut,
            Some(Host { bay: None, swaps: false, let_out: true, .. }) => Held::Out,
            Some(Host { bay: None, swaps: false, .. }) => Held::No,
            Some(_) => Held::TakesIn,
        }
    }

    /// Counts the time since the agent's start, whatever its clock is set to.
    pub(super) fn pass(&mut self, now: Timestamp) {
        let passed_s = self.looked.replace(now).map_or(0.0, |looked| now.seconds_since(looked));
        self.passed_s += passed_s.clamp(0.0, LOOK_MAX_S);
    }

    /// Takes in what a station says.
    pub(super) fn station_said(&mut self, now: Timestamp, station: &StationId, state: &StationState) {
        let known = self.host.as_ref().filter(|host| host.station == *station);
        if self.station.as_ref() != Some(station) || !newer(now, (state.at, state.seq), known.map(|host| host.stamp)) {
            return;
        }
        let robot = &self.profile.id;
        let bay = state.bays.iter().find(|bay| bay.robot.as_ref() == Some(robot)).map(|bay| (bay.bay.clone(), bay.phase));
        let swaps = state.swapping.as_ref() == Some(robot);
        // Words that were lost are no measure of how often it speaks.
        let apart_s = known.filter(|host| state.seq == host.stamp.1 + 1 && host.heard_s.is_finite());
        let apart_s = apart_s.map(|host| (self.passed_s - host.heard_s).min(APART_MAX_S));
        let was_let_out = |host: &Host| host.let_out || matches!(host.bay, Some((_, BayPhase::Unloading | BayPhase::Failed)));
        let host = Host {
            station: station.clone(),
            heard_s: self.passed_s,
            apart_s: apart_s.unwrap_or(0.0).max(known.map_or(0.0, |host| host.apart_s)),
            is_of_new_pack: true,
            stamp: (state.at, state.seq),
            // A station that was restarted meanwhile may have forgotten whom it holds.
            let_out: bay.is_none() && !swaps && known.filter(|host| state.seq > host.stamp.1).is_some_and(was_let_out),
            bay,
            swaps,
            powered: state.powered,
        };
        self.host = Some(host);
        self.hears_its_bay();
        self.leave_after_exchange();
    }

    /// A robot that waits without a bay is given one: where nothing moves it there, it has to go by itself.
    fn hears_its_bay(&mut self) {
        let Some((bay, phase)) = self.word().and_then(|host| host.bay.clone()) else { return };
        let is_new = self.phase == RobotPhase::Waiting && self.bay.is_none();
        if is_new && matches!(phase, BayPhase::Loading | BayPhase::Occupied) {
            self.bay = Some(bay.clone());
        }
        if let Some(station) = self.station.clone().filter(|_| is_new && phase == BayPhase::Loading) {
            self.outputs.push_back(Output::Act(Act::GoOnTo { station, bay: Some(bay) }));
        }
    }

    /// What a station said until now says nothing of the next visit, but for how often it speaks.
    pub(super) fn leaves_host(&mut self) {
        if let Some(host) = &mut self.host {
            (host.heard_s, host.bay, host.swaps, host.let_out) = (f64::NEG_INFINITY, None, false, false);
        }
    }

    /// Whether its station says that it is at this robot's exchange.
    pub(super) fn is_in_hands(&self) -> bool {
        self.word().is_some_and(|host| host.swaps)
    }

    /// Takes in that another pack is in the robot: what was said before says nothing of what is done with it.
    pub(super) fn sees_pack(&mut self) {
        if !std::mem::replace(&mut self.pack_seen, true)
            && let Some(host) = &mut self.host
        {
            host.is_of_new_pack = false;
        }
    }

    /// The bay in which its station has the robot, by its fresh word.
    pub(super) fn given_bay(&self) -> Option<&BayId> {
        self.word().and_then(|host| host.bay.as_ref()).map(|(bay, _)| bay)
    }

    /// Whether its station says that it has power; nothing where it is not heard.
    pub(super) fn is_powered(&self) -> Option<bool> {
        self.word().map(|host| host.powered)
    }

    /// Whether a robot with another pack still has to stand: its station has not said since that it is done. Where no station is heard for a
    /// while, it is taken to be.
    pub(super) fn is_still_exchanged(&self) -> bool {
        match self.word() {
            Some(host) => host.swaps || !host.is_of_new_pack,
            None => self.passed_s < FRESH_S,
        }
    }

    fn word(&self) -> Option<&Host> {
        let counts_s = |host: &Host| FRESH_S.max(FRESH_PERIODS * host.apart_s);
        let is_current = |host: &&Host| self.station.as_ref() == Some(&host.station) && self.passed_s - host.heard_s < counts_s(host);
        self.host.as_ref().filter(is_current)
    }
}
