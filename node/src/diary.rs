//! What an agent tells its log: what it is asked and does, and whether a coordinator is there.

use std::fmt::Display;

use proto::{Command, CommandReply, Outcome, Timestamp, plain};
use tracing::{debug, info, warn};

/// An agent's log. What stays as it is, is told once.
#[derive(Debug)]
pub struct Diary {
    who: String,
    alone: bool,
    /// What it did last.
    act: String,
}

impl Diary {
    /// `who` is up: `robot r-1`.
    #[must_use]
    pub fn begin(who: String) -> Self {
        info!("{who} is up");
        Self { who, alone: false, act: String::new() }
    }

    /// A coordinator appeared (true) or was lost (false).
    pub fn coordinator(&self, heard: bool) {
        match heard {
            true => info!("{}: a coordinator is there", self.who),
            false => warn!("{}: the coordinator is gone", self.who),
        }
    }

    /// Whether it decides by itself now, because no coordinator was heard for `silent_s`.
    pub fn alone(&mut self, alone: bool, silent_s: f64) {
        match (std::mem::replace(&mut self.alone, alone), alone) {
            (false, true) => warn!("{}: no coordinator for {silent_s} s: it decides by itself", self.who),
            (true, false) => info!("{}: decides no longer by itself", self.who),
            _ => {}
        }
    }

    /// A command was answered at `now`.
    pub fn answered<A: Display>(&self, now: Timestamp, command: &Command<A>, reply: &CommandReply) {
        let what = plain(&answered(command, reply)).into_owned();
        match &reply.outcome {
            // Asked again, because the answer was lost or late.
            _ if reply.at != now => debug!("{}: {what}, as before", self.who),
            Outcome::Accepted => info!("{}: {what}", self.who),
            Outcome::Rejected { .. } => warn!("{}: {what}", self.who),
        }
    }

    /// Something is done.
    pub fn does(&mut self, act: &impl Display) {
        let act = act.to_string();
        if self.act != act {
            info!("{}: {act}", self.who);
            self.act = act;
        }
    }

    /// It ends: why.
    pub fn end(&self, why: &str) {
        info!("{} has stopped: {why}", self.who);
    }
}

fn answered<A: Display>(command: &Command<A>, reply: &CommandReply) -> String {
    match &reply.outcome {
        Outcome::Accepted => format!("{} ({}) is accepted", command.action, command.id),
        Outcome::Rejected { reason, detail } => format!("{} ({}) is refused, {reason}: {detail}", command.action, command.id),
    }
}

#[cfg(test)]
mod tests {
    use proto::{CommandId, Rejection, RobotAction};

    use super::*;

    #[test]
    fn a_command_is_told_with_what_became_of_it() {
        let (id, at) = (CommandId::new("c-1").unwrap(), Timestamp::from_unix_ms(0));
        let action = RobotAction::Dock { station: "mds-1".parse().unwrap(), bay: Some("b1".parse().unwrap()) };
        let command = Command { id: id.clone(), epoch: 1, at, deadline: at.plus_s(1.0), action };
        let told = |outcome| answered(&command, &CommandReply { id: id.clone(), at, outcome });
        assert_eq!(told(Outcome::Accepted), "dock at mds-1 b1 (c-1) is accepted");
        let refused = crate::refused(Rejection::UnknownTarget, "no way to station mds-1 is known");
        assert_eq!(told(refused), "dock at mds-1 b1 (c-1) is refused, unknown_target: no way to station mds-1 is known");
    }
}
