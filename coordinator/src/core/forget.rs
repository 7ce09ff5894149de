//! Who is gone for good, because somebody says so: a robot that was sold is lost for ever otherwise, and whoever is alerted of lost robots hears of
//! it for ever too.

use proto::{EventKind, RobotId, Timestamp};

use super::Core;
use crate::clocks::Agent;
use crate::fleet::Robot;
use crate::trust::Owner;

/// Who gives no sign of life may be forgotten when it has not been heard for this long, s: sixty times as
/// long as Tender's agents say nothing at most. A guess.
const SILENT_S: f64 = 600.0;

/// Why a robot is not forgotten.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum NotForgotten {
    /// It is not known.
    Unknown(String),
    /// It is there to be heard, and would be known again with its next word.
    Heard(String),
}

impl Core {
    /// Whether a robot can be forgotten: nobody hears it any more.
    ///
    /// # Errors
    /// Why not.
    pub fn can_forget(&self, id: &RobotId) -> Result<(), NotForgotten> {
        match self.fleet.robots.get(id) {
            None => Err(NotForgotten::Unknown(self.fleet.unknown(id))),
            Some(robot) if !robot.is_lost() && !self.is_silent(id, robot) => {
                Err(NotForgotten::Heard(format!("{id} is there to be heard: end its agent first")))
            }
            Some(_) => Ok(()),
        }
    }

    /// Whether nothing was heard of a robot for long enough that it may be gone: one that gives no sign of life is never found lost.
    fn is_silent(&self, id: &RobotId, robot: &Robot) -> bool {
        let ago_s = |now: Timestamp| {
            let ahead_s = self.clocks.told_ahead_s(&Agent::Robot(id.clone()));
            let stated_s = robot.state.as_ref().map(|state| now.seconds_since(state.at) + ahead_s);
            let gauged_s = self.trust.heard_ago_s(now, &Owner::Robot(id.clone()));
            stated_s.into_iter().chain(gauged_s).fold(f64::INFINITY, f64::min)
        };
        self.last.is_some_and(|now| ago_s(now) > SILENT_S)
    }

    /// Forgets a robot that can be, and what it was promised. Whatever it says after all makes it known again, as one that has just joined.
    pub(super) fn forget(&mut self, now: Timestamp, id: &RobotId) {
        if self.can_forget(id).is_err() {
            return;
        }
        let why = "it is forgotten";
        let is_in_service = self.give_up(now, id, why).is_some();
        if !is_in_service && self.promised.remove(id) {
            self.event(now, EventKind::PromiseBroken, Some(id), None, None, format!("{id}: {why}"));
        }
        self.before.is_settled(id);
        self.plan.planned.retain(|planned| planned.robot != *id);
        self.asked.retain(|_, asked| !asked.is_for(id));
        self.watch.robot_gone(id);
        self.trust.forget(&Owner::Robot(id.clone()));
        self.clocks.forget(&Agent::Robot(id.clone()));
        self.refusals.forget_all_of(id);
        self.strays.remove(id);
        self.changed.remove(id);
        self.fleet.robots.remove(id);
        self.event(now, EventKind::Forgotten, Some(id), None, None, format!("{id} is forgotten, as somebody has asked"));
        self.replan(format!("{id} is forgotten"));
    }
}
