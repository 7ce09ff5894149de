//! The commands that an agent has answered: each acts at most once.

use std::collections::BTreeMap;

use proto::{Command, CommandId, CommandReply, Outcome, Rejection, Timestamp};
use serde::{Deserialize, Serialize};

/// How many answers are remembered: more than a coordinator can give within a deadline.
const REMEMBERED_MAX: usize = 1024;
/// How long an answer is remembered after its command's deadline, s: beyond it, a late copy is
/// refused as expired, which changes nothing either.
const REMEMBERED_S: f64 = 60.0;

/// An answer, and until when the command may come again.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
struct Answer {
    reply: CommandReply,
    deadline: Timestamp,
}

/// Remembers answers by command id, and the newest epoch of a coordinator. An agent keeps it where a
/// restart does not reach: else a command whose answer was lost would act again.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Ledger {
    answers: BTreeMap<CommandId, Answer>,
    epoch: u64,
}

impl Ledger {
    /// Answers a command: from memory if its id is known, with a refusal if it comes too late or
    /// from a coordinator that was replaced, else with what `act` says.
    pub fn answer<A>(&mut self, now: Timestamp, command: &Command<A>, act: impl FnOnce(&A) -> Outcome) -> CommandReply {
        if let Some(known) = self.answers.get(&command.id) {
            return known.reply.clone();
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
        self.forget(now);
        self.answers.insert(command.id.clone(), Answer { reply: reply.clone(), deadline: command.deadline });
        reply
    }

    /// Forgets what cannot come again, and under a flood the earliest deadline.
    fn forget(&mut self, now: Timestamp) {
        self.answers.retain(|_, answer| now.seconds_since(answer.deadline) <= REMEMBERED_S);
        while self.answers.len() >= REMEMBERED_MAX {
            let earliest = self.answers.iter().min_by_key(|(_, answer)| answer.deadline).map(|(id, _)| id.clone());
            earliest.map(|id| self.answers.remove(&id));
        }
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

    #[test]
    fn what_is_written_down_and_read_again_answers_the_same() {
        let mut ledger = Ledger::default();
        let now = Timestamp::from_unix_ms(2_000);
        let first = ledger.answer(now, &command("c-1", 5), |_| Outcome::Accepted);
        let written = serde_json::to_string(&ledger).unwrap();
        let mut read: Ledger = serde_json::from_str(&written).unwrap();
        assert_eq!(read.answer(now, &command("c-1", 5), |_| unreachable!("acted twice")), first);
        let stale = read.answer(now, &command("c-2", 4), |_| unreachable!("an old epoch"));
        assert!(matches!(stale.outcome, Outcome::Rejected { reason: Rejection::StaleEpoch, .. }));
    }

    #[test]
    fn a_flood_of_commands_does_not_fill_the_memory() {
        let (mut ledger, now) = (Ledger::default(), Timestamp::from_unix_ms(2_000));
        for number in 0..10_000 {
            ledger.answer(now, &command(&format!("c-{number}"), 1), |_| Outcome::Accepted);
        }
        assert!(ledger.answers.len() <= REMEMBERED_MAX);
    }
}
