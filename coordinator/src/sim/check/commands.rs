//! No command acts twice, none of an old epoch acts, and every copy gets the same answer.

use std::collections::BTreeMap;

use proto::{CommandId, CommandReply, Outcome, Rejection};

use crate::sim::net::Host;

/// What agents were asked and answered.
#[derive(Debug, Default)]
pub(in crate::sim) struct Commands {
    epochs: BTreeMap<CommandId, u64>,
    answers: BTreeMap<CommandId, (Host, CommandReply)>,
    /// The newest epoch that each agent has obeyed.
    obeyed: BTreeMap<Host, u64>,
    pub(super) found: Vec<String>,
}

impl Commands {
    /// A command has reached an agent.
    pub(in crate::sim) fn arrives(&mut self, _agent: &Host, id: &CommandId, epoch: u64) {
        self.epochs.insert(id.clone(), epoch);
    }

    /// An agent answers.
    pub(in crate::sim) fn answered(&mut self, agent: &Host, reply: &CommandReply) {
        if let Some((first, known)) = self.answers.get(&reply.id) {
            // Long after its deadline a copy may be told that it is late; it must not act.
            let late = matches!(reply.outcome, Outcome::Rejected { reason: Rejection::Expired, .. });
            if first != agent || (known != reply && !late) {
                self.found.push(format!("{} was answered twice, by {first:?} and {agent:?}: {known:?} and {reply:?}", reply.id));
            }
            return;
        }
        self.answers.insert(reply.id.clone(), (agent.clone(), reply.clone()));
        if reply.outcome == Outcome::Accepted {
            let epoch = self.epochs.get(&reply.id).copied().unwrap_or(0);
            let newest = self.obeyed.entry(agent.clone()).or_insert(epoch);
            if epoch < *newest {
                self.found.push(format!("{agent:?} obeyed {} of epoch {epoch} after one of epoch {newest}", reply.id));
            }
            *newest = epoch.max(*newest);
        }
    }

    /// Every command that was obeyed must be in the journal.
    pub(in crate::sim) fn all_kept(&mut self, kept: impl Fn(&CommandId) -> bool) {
        let lost = self.answers.iter().filter(|(id, (_, reply))| reply.outcome == Outcome::Accepted && !kept(id));
        let lost: Vec<String> = lost.map(|(id, (agent, _))| format!("{id}, which {agent:?} obeyed, is not in the journal")).collect();
        self.found.extend(lost);
    }
}
