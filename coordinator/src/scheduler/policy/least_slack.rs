//! Least slack first: who has the least time between reaching a station and being empty.

use super::{Policy, by_key};
use crate::scheduler::problem::{Problem, RobotView};

pub(super) struct LeastSlack;

fn slack_s(robot: &RobotView) -> f64 {
    let nearest_s = robot.options.iter().map(|option| option.travel_s).fold(f64::INFINITY, f64::min);
    if nearest_s.is_finite() { robot.empty_s - nearest_s } else { f64::INFINITY }
}

impl Policy for LeastSlack {
    fn name(&self) -> &'static str {
        "least_slack"
    }

    fn rank(&self, problem: &Problem) -> Vec<usize> {
        by_key(problem, slack_s)
    }

    fn reason(&self, robot: &RobotView) -> String {
        let slack_s = slack_s(robot);
        if slack_s.is_finite() { format!("{:.0} min of slack", slack_s / 60.0) } else { "nothing presses".to_owned() }
    }
}
