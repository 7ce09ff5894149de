//! Whose clock is off, and by how much: agents time what they say by their own machines, and read deadlines there.

use std::collections::BTreeMap;

use proto::{RobotId, StationId, Timestamp};

/// A clock that is off by so much is wrong, s: no message is under way for that long.
const OFF_S: f64 = 30.0;
/// Messages that must agree on that: the first after a start may be an old one.
const OFF_MIN: u32 = 3;
/// Share by which it must change to be told anew.
const CHANGE: f64 = 0.5;

/// Whose clock it is.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub enum Agent {
    /// A robot's.
    Robot(RobotId),
    /// A station's, by which its packs are timed as well.
    Station(StationId),
}

impl std::fmt::Display for Agent {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Agent::Robot(robot) => robot.fmt(f),
            Agent::Station(station) => station.fmt(f),
        }
    }
}

/// What one clock has shown.
#[derive(Debug, Clone, Copy, Default)]
struct Shown {
    /// By how much the last message was ahead, s.
    last_s: f64,
    /// How many in a row were off.
    off: u32,
    /// By how much it is told to be ahead, s; what it shows may have moved by half of that.
    told_s: Option<f64>,
}

/// All clocks.
#[derive(Debug, Clone, Default)]
pub struct Clocks {
    shown: BTreeMap<Agent, Shown>,
}

impl Clocks {
    /// Takes in that an agent timed a message at `said`; how it is off now, in words, if that is something else than before.
    pub fn heard(&mut self, now: Timestamp, agent: &Agent, said: Timestamp) -> Option<String> {
        let shown = self.shown.entry(agent.clone()).or_default();
        let ahead_s = said.seconds_since(now);
        let off = if ahead_s.abs() > OFF_S { shown.off + 1 } else { 0 };
        let told_s = match shown.told_s {
            Some(_) if off == 0 => None,
            Some(told_s) if (ahead_s - told_s).abs() < CHANGE * told_s.abs() => Some(told_s),
            _ => (off >= OFF_MIN).then_some(ahead_s),
        };
        let news = told_s != shown.told_s;
        *shown = Shown { last_s: ahead_s, off, told_s };
        news.then(|| match told_s {
            Some(ahead_s) => {
                let side = if ahead_s > 0.0 { "ahead of" } else { "behind" };
                format!("the clock of {agent} is {:.0} s {side} the coordinator's: set one of them", ahead_s.abs())
            }
            None => format!("the clock of {agent} is right again"),
        })
    }

    /// That agent is gone for good.
    pub fn forget(&mut self, agent: &Agent) {
        self.shown.remove(agent);
    }

    /// Whether an agent's clock is known to be off.
    #[must_use]
    pub fn is_off(&self, agent: &Agent) -> bool {
        self.shown.get(agent).is_some_and(|shown| shown.told_s.is_some())
    }

    /// By how much an agent's clock was told to be ahead, s; below 0 where it is behind, 0 where it is right.
    #[must_use]
    pub fn told_ahead_s(&self, agent: &Agent) -> f64 {
        self.shown.get(agent).and_then(|shown| shown.told_s).unwrap_or(0.0)
    }

    /// How far an agent's clock is known to be ahead of the coordinator's, s, by its last message; 0 where it is not.
    #[must_use]
    pub fn ahead_s(&self, agent: &Agent) -> f64 {
        self.shown.get(agent).filter(|shown| shown.told_s.is_some()).map_or(0.0, |shown| shown.last_s.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_unix_ms(0).plus_s(seconds)
    }

    #[test]
    fn a_clock_that_is_off_is_told_once_and_again_when_it_is_right() {
        let robot = Agent::Robot(RobotId::new("r").unwrap());
        for ahead_s in [300.0, -300.0, -3600.0] {
            let mut clocks = Clocks::default();
            let told: Vec<String> = (0..400).filter_map(|n| clocks.heard(at(f64::from(n)), &robot, at(f64::from(n) + ahead_s))).collect();
            let [told] = &told[..] else { panic!("{told:?}") };
            assert!(told.contains(&format!("{:.0} s", f64::abs(ahead_s))), "{told}");
            assert_eq!(clocks.ahead_s(&robot), ahead_s.max(0.0));
            // One that drifts is told anew only when it is off by half as much more; deadlines go by what it shows now.
            assert_eq!(clocks.heard(at(400.0), &robot, at(400.0 + 1.2 * ahead_s)), None);
            assert_eq!(clocks.ahead_s(&robot), (1.2 * ahead_s).max(0.0));
            assert_eq!(clocks.heard(at(401.0), &robot, at(401.0)).as_deref(), Some("the clock of r is right again"));
            assert_eq!(clocks.ahead_s(&robot), 0.0);
        }
    }

    #[test]
    fn times_that_an_agent_tells_are_read_on_the_clock_that_it_was_told_to_have() {
        let mut clocks = Clocks::default();
        let station = Agent::Station(StationId::new("depot").unwrap());
        (0..3).for_each(|n| drop(clocks.heard(at(f64::from(n)), &station, at(f64::from(n) - 300.0))));
        assert_eq!((clocks.told_ahead_s(&station), clocks.ahead_s(&station)), (-300.0, 0.0));
        clocks.heard(at(3.0), &station, at(3.0));
        assert_eq!(clocks.told_ahead_s(&station), 0.0);
    }

    #[test]
    fn old_messages_say_nothing_of_a_clock() {
        let mut clocks = Clocks::default();
        let station = Agent::Station(StationId::new("depot").unwrap());
        for said_s in [-500.0, -500.0, 2.0, -500.0] {
            assert_eq!(clocks.heard(at(2.0), &station, at(said_s)), None);
        }
        assert!(!clocks.is_off(&station));
    }
}
