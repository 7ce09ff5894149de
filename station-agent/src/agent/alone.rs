//! What a station does by itself while no coordinator is heard: it takes in robots that wait before it,
//! and lets out those that are charged. What was begun goes on, and the selector feeds the load, in
//! any case.

use anyhow::ensure;
use proto::{BayPhase, RobotId, RobotPhase, RobotState, Timestamp};
use serde::{Deserialize, Serialize};

use super::Agent;
use crate::source::Lifted;

/// A robot's word counts for this long, s: three of its state messages at the usual period.
const FRESH_S: f64 = 30.0;

/// `[alone]`: what a station does by itself while no coordinator is heard.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Alone {
    /// Time without a coordinator after which it decides by itself, s.
    pub silent_s: f64,
}

impl Default for Alone {
    fn default() -> Self {
        Self { silent_s: 60.0 }
    }
}

impl Alone {
    /// Checks the range.
    ///
    /// # Errors
    /// Names the key and the allowed range.
    pub fn check(&self) -> anyhow::Result<()> {
        ensure!((0.0..=86_400.0).contains(&self.silent_s), "alone.silent_s = {}: must be between 0 and 86400", self.silent_s);
        Ok(())
    }
}

impl Agent {
    /// Whether it decides by itself: no coordinator has been heard for long enough.
    pub fn is_alone(&mut self, now: Timestamp) -> bool {
        self.silence.lasts_s(now) >= self.profile.alone.silent_s
    }

    pub(super) fn robot_said(&mut self, now: Timestamp, robot: RobotId, state: &RobotState) {
        if state.station.as_ref() == Some(&self.profile.id) {
            self.here.insert(robot, (now, state.phase));
        } else {
            self.here.remove(&robot);
        }
    }

    pub(super) fn act_alone(&mut self, now: Timestamp) {
        if !self.is_alone(now) || !self.powered {
            return;
        }
        self.here.retain(|_, (heard, _)| now.seconds_since(*heard).abs() <= FRESH_S);
        let phase = |robot: &RobotId| self.here.get(robot).map(|(_, phase)| *phase);
        let charged =
            |bay: &&mut super::Bay| bay.phase == BayPhase::Occupied && bay.robot.as_ref().and_then(phase) == Some(RobotPhase::Charged);
        for bay in self.bays.iter_mut().filter(charged) {
            bay.phase = BayPhase::Unloading;
            let robot = bay.robot.clone().expect("an occupied bay has its robot");
            self.lifts.push_back(Lifted { robot, bay: bay.id.clone(), into: false });
        }
        let waiting: Vec<RobotId> =
            self.here.iter().filter(|(_, (_, phase))| *phase == RobotPhase::Waiting).map(|(id, _)| id.clone()).collect();
        for robot in waiting {
            if self.whereabouts(&robot).is_some() {
                continue;
            }
            let Some(bay) = self.bays.iter_mut().find(|bay| bay.phase == BayPhase::Free) else { return };
            (bay.phase, bay.robot) = (BayPhase::Loading, Some(robot.clone()));
            self.lifts.push_back(Lifted { robot, bay: bay.id.clone(), into: true });
        }
    }
}
