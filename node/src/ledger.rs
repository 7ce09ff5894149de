//! The commands that an agent has answered: each acts at most once.

use std::collections::BTreeMap;

use proto::{Command, CommandId, CommandReply, Outcome, Rejection, Timestamp};

/// How many answers are remembered. Ids older than that are long past their deadline.
const REMEMBERED_MAX: usize = 1024;

/// Remembers answers by command id, and the newest epoch of a coordinator.
#[derive(Debug, Clone, Default)]
pub struct Ledger {
    answers: BTreeMap<CommandId, CommandReply>,
    order: std::collections::VecDeque<CommandId>,
    epoch: u64,
}

impl Ledger {
    /// Answers a command: from memory if its id is known, with a refusal if it comes too late or
    /// from a coordinator that was replaced, else with what `act` says.
    pub fn answer<A>(&mut self, now: Timestamp, command: &Command<A>, act: impl FnOnce(&A) -> Outcome) -> CommandReply {
        if let Some(known) = self.answers.get(&command.id) {
            return known.clone();
        }
        let outcome = if command.epoch < self.epoch {
            refused(Rejection::StaleEpoch, format!("epoch {} is over; the coordinator is at {}", command.epoch, self.epoch))
        } else if now > command.deadline {
            refused(Rejection::Expired, format!("the deadline was {}, it is {now}", command.deadline))
        } else {
            self.epoch = command.epoch;
            act(&command.action)
        };
        let reply = CommandReply { id: command.id.clone(), at: now, outcome };
        self.answers.insert(command.id.clone(), reply.clone());
        self.order.push_back(command.id.clone());
        if self.order.len() > REMEMBERED_MAX
            && let Some(oldest) = self.order.pop_front()
        {
            self.answers.remove(&oldest);
        }
        reply
    }
}

/// A refusal with its reason.
pub fn refused(reason: Rejection, detail: impl Into<String>) -> Outcome {
    Outcome::Rejected { reason, detail: detail.into() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proto::RobotAction;

    fn command(id: &str, epoch: u64) -> Command<RobotAction> {
        let at = Timestamp::from_unix_ms(1_000);
        Command { id: CommandId::new(id).unwrap(), epoch, at, deadline: at.plus_s(10.0), action: RobotAction::Undock }
    }

    #[test]
    fn the_same_id_acts_once_and_gets_the_same_answer() {
        let (mut ledger, mut acted) = (Ledger::default(), 0);
        let now = Timestamp::from_unix_ms(2_000);
        let first = ledger.answer(now, &command("c-1", 1), |_| {
            acted += 1;
            Outcome::Accepted
        });
        let second = ledger.answer(now.plus_s(60.0), &command("c-1", 1), |_| unreachable!("acted twice"));
        assert_eq!((first, acted), (second, 1));
    }

    #[test]
    fn late_commands_and_old_epochs_are_refused() {
        let mut ledger = Ledger::default();
        let now = Timestamp::from_unix_ms(2_000);
        ledger.answer(now, &command("c-1", 5), |_| Outcome::Accepted);
        let stale = ledger.answer(now, &command("c-2", 4), |_| unreachable!());
        assert!(matches!(stale.outcome, Outcome::Rejected { reason: Rejection::StaleEpoch, .. }));
        let late = ledger.answer(now.plus_s(60.0), &command("c-3", 5), |_| unreachable!());
        assert!(matches!(late.outcome, Outcome::Rejected { reason: Rejection::Expired, .. }));
    }
}
