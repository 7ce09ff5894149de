//! A plan: every robot serviced or with the reasons why not.

use proto::RobotId;

use super::feasible::Slot;

/// A plan.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Plan {
    /// Services, in order of start.
    pub planned: Vec<Planned>,
    /// Robots without one.
    pub rejected: Vec<Rejected>,
}

/// A planned service.
#[derive(Debug, Clone, PartialEq)]
pub struct Planned {
    /// The robot.
    pub robot: RobotId,
    /// Where and when.
    pub slot: Slot,
    /// Why so, and what else was possible.
    pub why: Vec<String>,
}

/// A robot without a service.
#[derive(Debug, Clone, PartialEq)]
pub struct Rejected {
    /// The robot.
    pub robot: RobotId,
    /// Why: one reason per way of servicing it.
    pub reasons: Vec<String>,
}
