//! The coordinator's journal on a simulated disk. A batch is kept as a whole or not at all, as the real
//! store keeps it (its own tests tear the real file); what was kept survives every kill.

use std::collections::BTreeMap;
use std::sync::Arc;

use proto::CommandId;

use crate::core::Numbering;
use crate::store::{Heard, Record};

/// The disk does not take it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Full;

/// What one coordinator, from its start to its end, has told and kept.
#[derive(Debug, Clone)]
pub(super) struct Reign {
    /// Its numbers at the start.
    pub(super) numbering: Numbering,
    /// What it kept, in order.
    pub(super) records: Vec<Record>,
}

/// The journal.
#[derive(Debug, Default)]
pub(super) struct Disk {
    /// The coordinators so far.
    pub(super) reigns: Vec<Reign>,
    /// Until when it takes nothing, s of the run.
    pub(super) full: bool,
    /// Whether it ever refused: then commands may have left that are not in it.
    pub(super) refused: bool,
    /// Two records under one name.
    pub(super) conflicts: Vec<String>,
    events: BTreeMap<u64, proto::Event>,
    plans: BTreeMap<u64, Arc<proto::Schedule>>,
    commands: BTreeMap<CommandId, Record>,
}

impl Disk {
    /// Counts a start: the numbers go on where what is kept ends.
    pub(super) fn start(&mut self) -> Numbering {
        let after = |last: Option<&u64>| last.map_or(1, |last| last + 1);
        let numbering = Numbering {
            epoch: self.reigns.len() as u64 + 1,
            event: after(self.events.keys().next_back()),
            plan: after(self.plans.keys().next_back()),
        };
        self.reigns.push(Reign { numbering, records: Vec::new() });
        numbering
    }

    /// The plan kept last.
    pub(super) fn latest_schedule(&self) -> Option<Arc<proto::Schedule>> {
        self.plans.values().next_back().cloned()
    }

    /// Keeps a batch.
    pub(super) fn append(&mut self, records: &[Record]) -> Result<(), Full> {
        if self.full {
            self.refused |= !records.is_empty();
            return Err(Full);
        }
        for record in records {
            let told_twice = match record {
                Record::Event(event) => self.events.insert(event.seq, event.clone()).is_some_and(|known| known != *event),
                Record::Plan(plan) => self.plans.insert(plan.plan, plan.clone()).is_some_and(|known| known != *plan),
                Record::RobotCommand { command, .. } => self.command(&command.id, record),
                Record::StationCommand { command, .. } => self.command(&command.id, record),
                _ => false,
            };
            if told_twice {
                self.conflicts.push(format!("two records under one name: {record:?}"));
            }
        }
        self.reigns.last_mut().expect("a coordinator has started").records.extend_from_slice(records);
        Ok(())
    }

    fn command(&mut self, id: &CommandId, record: &Record) -> bool {
        self.commands.insert(id.clone(), record.clone()).is_some_and(|known| known != *record)
    }

    /// Whether a command is kept.
    pub(super) fn holds(&self, id: &CommandId) -> bool {
        self.commands.contains_key(id)
    }
}

impl Reign {
    /// What it was told, in order.
    pub(super) fn heard(&self) -> impl Iterator<Item = &Heard> {
        self.records.iter().filter_map(|record| if let Record::Heard(heard) = record { Some(heard) } else { None })
    }
}
