//! Who has refused a service: robot and station are not brought together again at once, and each time they refuse later.

use std::collections::BTreeMap;

use proto::{RobotId, StationId, Timestamp};

/// For how long after the first refusal, s, and at most: each one doubles it. Guesses: a minute is long for a robot's state to change by itself, and
/// half an hour is not long for somebody to come and look.
const FIRST_S: f64 = 60.0;
const LONGEST_S: f64 = 1800.0;

/// A service that was refused.
#[derive(Debug, Clone, PartialEq)]
pub struct Refusal {
    /// The last time.
    pub at: Timestamp,
    /// Until then it is not tried again.
    pub until: Timestamp,
    /// Whether the robot was in its place already.
    pub at_place: bool,
    /// Who refused what, and why.
    pub why: String,
    times: u32,
}

/// All of them.
#[derive(Debug, Clone, Default)]
pub struct Refusals(BTreeMap<(RobotId, StationId), Refusal>);

impl Refusals {
    /// Notes one more.
    pub fn note(&mut self, now: Timestamp, robot: &RobotId, station: &StationId, at_place: bool, why: String) {
        let pair = (robot.clone(), station.clone());
        let times = self.0.get(&pair).map_or(0, |refusal| refusal.times);
        let for_s = (FIRST_S * f64::from(2_u32.saturating_pow(times))).min(LONGEST_S);
        self.0.insert(pair, Refusal { at: now, until: now.plus_s(for_s), at_place, why, times: times + 1 });
    }

    /// The one for which these two are not brought together now.
    #[must_use]
    pub fn holds(&self, now: Timestamp, robot: &RobotId, station: &StationId) -> Option<&Refusal> {
        self.0.get(&(robot.clone(), station.clone())).filter(|refusal| now < refusal.until)
    }

    /// They have come together.
    pub fn forget(&mut self, robot: &RobotId, station: &StationId) {
        self.0.remove(&(robot.clone(), station.clone()));
    }

    /// That robot is gone for good.
    pub fn forget_all_of(&mut self, robot: &RobotId) {
        self.0.retain(|(known, _), _| known != robot);
    }

    /// At that station something works again.
    pub fn forget_all_at(&mut self, station: &StationId) {
        self.0.retain(|(_, known), _| known != station);
    }

    /// The clock was set back.
    pub fn set_back(&mut self, by_ms: i64) {
        self.0.values_mut().for_each(|refusal| {
            (refusal.at, refusal.until) = (refusal.at.plus_ms(-by_ms), refusal.until.plus_ms(-by_ms));
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_refusal_holds_for_twice_as_long_until_the_two_have_come_together() {
        let (robot, station) = (RobotId::new("r").unwrap(), StationId::new("s").unwrap());
        let at = |seconds: f64| Timestamp::from_unix_ms(0).plus_s(seconds);
        let mut refusals = Refusals::default();
        let (mut now_s, mut held_s) = (0.0, Vec::new());
        for _ in 0..7 {
            refusals.note(at(now_s), &robot, &station, false, "busy".to_owned());
            let until = refusals.holds(at(now_s), &robot, &station).unwrap().until;
            held_s.push(until.seconds_since(at(now_s)));
            now_s += held_s[held_s.len() - 1];
            assert_eq!(refusals.holds(at(now_s), &robot, &station), None);
        }
        assert_eq!(held_s, [60.0, 120.0, 240.0, 480.0, 960.0, 1800.0, 1800.0]);
        assert_eq!(refusals.holds(at(0.0), &RobotId::new("q").unwrap(), &station), None);
        refusals.forget(&robot, &station);
        refusals.note(at(now_s), &robot, &station, false, "busy".to_owned());
        assert_eq!(refusals.holds(at(now_s), &robot, &station).unwrap().until, at(now_s + 60.0));
    }
}
