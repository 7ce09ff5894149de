//! Messages in flight: each arrives after a delay, in order of arrival, ties in order of sending. In bad
//! weather some are lost, doubled, or overtaken; between hosts that are cut off nothing arrives.

use std::collections::{BTreeMap, BTreeSet};

use proto::{RobotCommand, RobotId, RobotState, StationCommand, StationId, StationState, Timestamp};
use rand::RngExt as _;
use rand_pcg::Pcg64Mcg;

use crate::core::Input;

/// A process of the fleet.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Host {
    /// The coordinator.
    Coordinator,
    /// A robot's agent.
    Robot(RobotId),
    /// A station's agent.
    Station(StationId),
}

/// A message.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Message {
    /// To the coordinator.
    Up(Input),
    /// To a robot.
    Robot(RobotId, RobotCommand),
    /// To a station.
    Station(StationId, StationCommand),
    /// A robot's state, as a station hears it.
    Overheard(StationId, RobotId, RobotState),
    /// A station's state, as a robot hears it.
    Told(RobotId, StationId, Box<StationState>),
    /// An agent learns that the coordinator appeared or was lost.
    Coordinator(Host, bool),
}

/// Delay of every message, s: a wireless hop.
const DELAY_S: f64 = 0.02;

/// How bad the network is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Weather {
    /// Share of messages that are lost.
    pub(super) loss: f64,
    /// Share of messages that come twice.
    pub(super) doubled: f64,
    /// Longest delay beyond the usual one, s; messages overtake each other within it.
    pub(super) delay_s: f64,
}

impl Weather {
    pub(super) const FAIR: Self = Self { loss: 0.0, doubled: 0.0, delay_s: 0.0 };
}

/// The network.
#[derive(Debug)]
pub(super) struct Net {
    flying: BTreeMap<(Timestamp, u64), (Host, Message)>,
    sent: u64,
    weather: Weather,
    rng: Pcg64Mcg,
    /// Hosts that nobody reaches.
    cut: BTreeSet<Host>,
}

impl Net {
    pub(super) fn new(weather: Weather, rng: Pcg64Mcg) -> Self {
        Self { flying: BTreeMap::new(), sent: 0, weather, rng, cut: BTreeSet::new() }
    }

    /// Whether a host can be reached by others.
    pub(super) fn reaches(&self, host: &Host) -> bool {
        !self.cut.contains(host)
    }

    /// Cuts a host off, or joins it again.
    pub(super) fn cut(&mut self, host: Host, cut: bool) {
        if cut {
            self.cut.insert(host)
        } else {
            self.cut.remove(&host)
        };
    }

    /// Sends a message from a host to who it is for.
    pub(super) fn send(&mut self, now: Timestamp, from: &Host, message: Message) {
        if self.weather == Weather::FAIR {
            return self.fly(now.plus_s(DELAY_S), from, message);
        }
        let copies = 1 + u32::from(self.rng.random::<f64>() < self.weather.doubled);
        for _ in 0..copies {
            if self.rng.random::<f64>() >= self.weather.loss {
                // Long delays are rare: the square of an even draw.
                let late = self.rng.random::<f64>().powi(2) * self.weather.delay_s;
                self.fly(now.plus_s(DELAY_S + late), from, message.clone());
            }
        }
    }

    /// Tells who is there and who is not: the network library does that by itself, in order and without
    /// loss.
    pub(super) fn tell(&mut self, now: Timestamp, from: &Host, message: Message) {
        self.fly(now.plus_s(DELAY_S), from, message);
    }

    fn fly(&mut self, at: Timestamp, from: &Host, message: Message) {
        self.sent += 1;
        self.flying.insert((at, self.sent), (from.clone(), message));
    }

    /// The next message that has arrived. What meets a cut on its way is lost.
    pub(super) fn arrived(&mut self, now: Timestamp) -> Option<(Timestamp, Message)> {
        loop {
            let entry = self.flying.first_entry()?;
            let at = entry.key().0;
            if at > now {
                return None;
            }
            let (from, message) = entry.remove();
            let to = match &message {
                Message::Up(Input::RobotAlive(..) | Input::StationAlive(..)) | Message::Coordinator(..) => return Some((at, message)),
                Message::Up(_) => Host::Coordinator,
                Message::Robot(robot, _) | Message::Told(robot, ..) => Host::Robot(robot.clone()),
                Message::Station(station, _) | Message::Overheard(station, ..) => Host::Station(station.clone()),
            };
            if self.reaches(&from) && self.reaches(&to) {
                return Some((at, message));
            }
        }
    }
}
