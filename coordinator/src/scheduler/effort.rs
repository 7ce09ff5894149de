//! How much of a plan comes into question.

use std::collections::BTreeSet;

use proto::RobotId;

use super::plan::Plan;
use super::problem::View;
use crate::models::Settings;

/// Fleets up to this size are planned as a whole whatever happens.
pub const WHOLE_FLEET_MAX: usize = 64;
/// And if this share of it was not planned for yet.
const NEW_SHARE_MAX: f64 = 0.1;

/// How much of a plan may come into question.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Effort {
    /// What no longer fits, and its neighbours.
    Mend,
    /// Everything.
    Whole,
}

impl Effort {
    /// The least that makes a plan of what is believed from the last one: only of a large fleet can a plan
    /// be mended, and only when few of it are new.
    #[must_use]
    pub fn needed(view: &View, before: &Plan, settings: &Settings) -> Self {
        let known: BTreeSet<&RobotId> = before.robots().collect();
        let new = view.robots.iter().filter(|robot| !known.contains(&robot.robot)).count();
        let is_mendable = Self::takes_long(view, settings) && (new as f64) < NEW_SHARE_MAX * view.robots.len() as f64;
        if is_mendable { Self::Mend } else { Self::Whole }
    }

    /// Whether a whole plan takes longer than anybody should wait for.
    #[must_use]
    pub fn takes_long(view: &View, settings: &Settings) -> bool {
        view.robots.len() > WHOLE_FLEET_MAX && settings.policy.searches()
    }
}
