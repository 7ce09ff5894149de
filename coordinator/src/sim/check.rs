//! What must hold whatever goes wrong: each promise in a file of its own, fed by the simulator with what
//! bodies, agents and disk really did, never with what anybody believes.

mod commands;
mod energy;
mod issue;
mod journal;
mod plans;

use proto::Timestamp;

pub(super) use commands::Commands;
pub(super) use energy::Balance;
pub(super) use issue::Issue;
pub(super) use journal::replays;
pub(super) use plans::plan_tells_of_everybody;

/// The promises that are watched while a run goes on.
#[derive(Debug, Default)]
pub(super) struct Checks {
    /// No bay and no spare is issued twice.
    pub(super) issue: Issue,
    /// No command acts twice, none of an old epoch acts, each gets one answer.
    pub(super) commands: Commands,
    /// Energy comes from somewhere.
    pub(super) balance: Balance,
    /// Whatever else was found.
    pub(super) found: Vec<String>,
}

impl Checks {
    /// Everything that was broken.
    pub(super) fn violations(&self) -> Vec<String> {
        let parts = [&self.issue.found, &self.commands.found, &self.balance.found, &self.found];
        parts.into_iter().flatten().cloned().collect()
    }
}

/// A moment of a run, for people.
fn moment(at: Timestamp) -> String {
    at.to_string()
}
