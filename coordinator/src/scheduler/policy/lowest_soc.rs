//! Lowest state of charge first: what fleets do that look at the gauge alone.

use super::{Policy, by_key};
use crate::scheduler::problem::{Problem, RobotView};

pub(super) struct LowestSoc;

impl Policy for LowestSoc {
    fn name(&self) -> &'static str {
        "lowest_soc"
    }

    fn rank(&self, problem: &Problem) -> Vec<usize> {
        by_key(problem, |robot| robot.soc.value)
    }

    fn reason(&self, robot: &RobotView) -> String {
        format!("at {:.0} % charge", robot.soc.value * 100.0)
    }
}
