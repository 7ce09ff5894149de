//! How far an agent's source has to go on, whatever the clock of its machine is set to.

use std::time::Duration;

use proto::Timestamp;
use tracing::warn;

use crate::Clock;
use crate::clock::uptime;

/// Fleet seconds between two looks at a source.
pub const LOOK_S: f64 = 1.0;
/// Real time beyond which steps are not made good one by one: then the machine slept.
const MADE_GOOD: Duration = Duration::from_secs(60);
const SECOND: Duration = Duration::from_secs(1);
/// A clock that is off by so much was set; by less, it was read to the millisecond or runs a little faster or slower.
const SET: Duration = Duration::from_millis(100);

/// How a source goes on after the machine has slept, or it was itself slower than the time between two looks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Stride {
    /// From where it was: it simulates or replays, and what was slept through nobody simulates after it.
    LeftOut,
    /// In one step: it measures what is so now, and what was meanwhile nobody can look at.
    AtOnce,
}

/// A step that a source is to make.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// When it ends, by the machine's clock.
    pub at: Timestamp,
    /// How long it is, s of fleet time.
    pub dt_s: f64,
    /// How long all steps were together at its end, s.
    pub passed_s: f64,
}

/// Counts the time that has passed by a clock that nobody sets, and that runs while the machine sleeps. The machine's clock, which may
/// be set, only says what time it is.
#[derive(Debug)]
pub struct Pace {
    stride: Stride,
    clock: Clock,
    looked: Duration,
    /// Time that has passed and is not gone through yet, s.
    owed_s: f64,
    /// What is gone through, s, and until when.
    passed_s: f64,
    at: Timestamp,
}

impl Pace {
    /// Begins to count.
    #[must_use]
    pub fn new(stride: Stride, clock: Clock) -> Self {
        Self { stride, clock, looked: uptime(), owed_s: 0.0, passed_s: 0.0, at: clock.now() }
    }

    /// Steps that are due since this was asked before.
    pub fn due(&mut self) -> impl Iterator<Item = Step> + use<> {
        let now = uptime();
        let passed = now.saturating_sub(self.looked);
        self.looked = now;
        self.after(self.clock.fleet_s(passed), self.clock.now())
    }

    fn after(&mut self, passed_s: f64, now: Timestamp) -> impl Iterator<Item = Step> + use<> {
        self.owed_s += passed_s;
        let most_s = self.clock.fleet_s(MADE_GOOD).max(2.0 * LOOK_S);
        // What is measured once cannot be looked at more often afterwards, and a device that makes one wait would take longer with each look
        // that is made good. Where the clock is made faster, recordings stand in for devices: they keep nobody waiting, and are gone through whole.
        let is_recorded = self.clock.fleet_s(SECOND) > SECOND.as_secs_f64();
        let late_s = if is_recorded { most_s } else { 2.0 * LOOK_S };
        let (count, dt_s) = match self.stride {
            Stride::AtOnce if self.owed_s >= late_s => (1, self.owed_s),
            _ => (self.steps(most_s), LOOK_S),
        };
        let all_s = f64::from(count) * dt_s;
        self.owed_s -= all_s;
        let (by_steps, by_clock) = (self.at.plus_s(all_s), now.plus_s(-self.owed_s));
        let was_set = by_steps.seconds_since(by_clock).abs() > self.clock.fleet_s(SET);
        self.at = if was_set { by_clock } else { by_steps };
        self.passed_s += all_s;
        let (end, passed_s) = (self.at, self.passed_s);
        (0..count).rev().map(move |left| {
            let left_s = f64::from(left) * dt_s;
            Step { at: end.plus_s(-left_s), dt_s, passed_s: passed_s - left_s }
        })
    }

    /// Whole steps that are owed, `most_s` seconds of them at most.
    fn steps(&mut self, most_s: f64) -> u32 {
        if self.owed_s > most_s {
            warn!("the machine slept, or has too much to do: {:.0} s are left out of what is simulated", self.owed_s - most_s);
            self.owed_s = most_s;
        }
        (self.owed_s / LOOK_S).floor() as u32
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::ClockConfig;

    fn pace(stride: Stride, speed: f64) -> Pace {
        let clock = Clock::new(Some(ClockConfig { speed, origin_unix_ms: 0 }));
        Pace { at: at(0.0), ..Pace::new(stride, clock) }
    }

    fn at(seconds: f64) -> Timestamp {
        Timestamp::from_unix_ms(0).plus_s(seconds)
    }

    fn steps(pace: &mut Pace, passed_s: f64, now_s: f64) -> Vec<(Timestamp, f64)> {
        pace.after(passed_s, at(now_s)).map(|step| (step.at, step.dt_s)).collect()
    }

    #[test]
    fn what_is_measured_is_looked_at_once_after_a_sleep() {
        let mut pace = pace(Stride::AtOnce, 1.0);
        assert_eq!(steps(&mut pace, 1.5, 1.5), [(at(1.0), 1.0)]);
        assert_eq!(steps(&mut pace, 28_800.0, 28_801.5), [(at(28_801.5), 28_800.5)]);
        let step = pace.after(1.0, at(28_802.5)).next().unwrap();
        assert_eq!(step, Step { at: at(28_802.5), dt_s: 1.0, passed_s: 28_802.5 });
    }

    #[test]
    fn a_device_that_is_slower_than_the_looks_at_it_is_looked_at_once_for_all_that_is_owed() {
        let mut pace = pace(Stride::AtOnce, 1.0);
        // Each reading takes 3.5 s: one step each, and none that grows.
        assert_eq!(steps(&mut pace, 1.2, 1.2), [(at(1.0), 1.0)]);
        assert_eq!(steps(&mut pace, 3.5, 4.7), [(at(4.7), 3.7)]);
        assert_eq!(steps(&mut pace, 3.5, 8.2), [(at(8.2), 3.5)]);
        assert_eq!(steps(&mut pace, 20.0, 28.2), [(at(28.2), 20.0)]);
        assert_eq!(steps(&mut pace, 1.0, 29.2), [(at(29.2), 1.0)]);
        // A recording that is played faster is gone through second by second.
        let mut fast = self::pace(Stride::AtOnce, 60.0);
        assert_eq!(steps(&mut fast, 5.0, 5.0).len(), 5);
    }

    #[test]
    fn a_clock_that_is_set_moves_no_charge_and_only_says_another_time() {
        for stride in [Stride::AtOnce, Stride::LeftOut] {
            for set_s in [3_600.0, -3_600.0] {
                let mut pace = pace(stride, 1.0);
                assert_eq!(steps(&mut pace, 1.0, 1.0), [(at(1.0), 1.0)]);
                assert_eq!(steps(&mut pace, 1.0, 2.0 + set_s), [(at(2.0 + set_s), 1.0)]);
                assert_eq!(steps(&mut pace, 1.0, 3.0 + set_s), [(at(3.0 + set_s), 1.0)]);
            }
        }
    }

    #[test]
    fn what_is_simulated_goes_on_from_where_it_was() {
        let mut slow = pace(Stride::LeftOut, 1.0);
        assert_eq!(steps(&mut slow, 0.9, 0.9), []);
        // On its grid, although the clock is read a little late.
        assert_eq!(steps(&mut slow, 2.3, 3.22), [(at(1.0), 1.0), (at(2.0), 1.0), (at(3.0), 1.0)]);
        assert_eq!(steps(&mut slow, 28_800.0, 28_803.2).len(), 60);
        assert_eq!(steps(&mut slow, 1.0, 28_804.2), [(at(28_804.2), 1.0)]);
        // A minute of real time is an hour of a fleet whose clock runs 60 times as fast.
        assert_eq!(steps(&mut pace(Stride::LeftOut, 60.0), 28_800.0, 28_800.0).len(), 3_600);
    }
}
