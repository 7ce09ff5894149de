//! Messages in flight: each arrives after a delay, in order of arrival, ties in order of sending.

use std::collections::BTreeMap;

use proto::{RobotCommand, RobotId, StationCommand, StationId, Timestamp};

use crate::core::Input;

/// A message.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Message {
    /// To the coordinator.
    Up(Input),
    /// To a robot.
    Robot(RobotId, RobotCommand),
    /// To a station.
    Station(StationId, StationCommand),
}

/// Delay of every message, s: a wireless hop.
const DELAY_S: f64 = 0.02;

/// The network.
#[derive(Debug, Default)]
pub(super) struct Net {
    flying: BTreeMap<(Timestamp, u64), Message>,
    sent: u64,
}

impl Net {
    /// Sends a message.
    pub(super) fn send(&mut self, now: Timestamp, message: Message) {
        self.sent += 1;
        self.flying.insert((now.plus_s(DELAY_S), self.sent), message);
    }

    /// The next message that has arrived.
    pub(super) fn arrived(&mut self, now: Timestamp) -> Option<(Timestamp, Message)> {
        let entry = self.flying.first_entry()?;
        let at = entry.key().0;
        (at <= now).then(|| (at, entry.remove()))
    }
}
