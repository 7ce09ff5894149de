//! In which order robots are considered. One file per policy, one line in [`policies`].

mod least_slack;
mod lowest_soc;

use super::problem::{Problem, RobotView};

/// An order of robots.
pub trait Policy: Sync {
    /// Name in files and on the command line.
    fn name(&self) -> &'static str;

    /// Indices of all robots of the problem, the most pressing first.
    fn rank(&self, problem: &Problem) -> Vec<usize>;

    /// What places this robot, in words.
    fn reason(&self, robot: &RobotView) -> String;
}

static POLICIES: &[&dyn Policy] = &[&least_slack::LeastSlack, &lowest_soc::LowestSoc];

/// Every policy; the first is the default.
#[must_use]
pub fn policies() -> &'static [&'static dyn Policy] {
    POLICIES
}

/// The policy of that name.
#[must_use]
pub fn policy(name: &str) -> Option<&'static dyn Policy> {
    POLICIES.iter().copied().find(|policy| policy.name() == name)
}

/// Indices of robots by a key, smallest first, equal keys by id.
fn by_key(problem: &Problem, key: impl Fn(&RobotView) -> f64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..problem.robots.len()).collect();
    order.sort_by(|&a, &b| {
        let (a, b) = (&problem.robots[a], &problem.robots[b]);
        key(a).total_cmp(&key(b)).then_with(|| a.robot.cmp(&b.robot))
    });
    order
}
