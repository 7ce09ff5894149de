//! What the core wants done, until it may be done: what a command rests on is in the store before the
//! command leaves. The live service and the simulator both work through it.
//!
//! ```text
//!   Core::poll ──> take ──> records ──> the store ──> written ──> commands leave
//!                                          └─ failed: the fleet is served on, records wait
//! ```

use std::collections::BTreeSet;
use std::sync::Arc;

use proto::Timestamp;

use crate::core::{Core, Input, Output, Study};
use crate::store::{Heard, Record};

/// Records that wait while the store cannot be written; beyond this telemetry is dropped.
const RECORDS_MAX: usize = 100_000;

/// Plans, and what is told with them, that wait likewise: each is as large as the fleet. Beyond this only the newest of what is
/// told with plans waits, and then only so many plans.
const PLANS_MAX: usize = 300;

/// Records to be kept, and commands that wait for them.
#[derive(Debug)]
pub struct Outbox {
    epoch: u64,
    records: Vec<Record>,
    commands: Vec<Output>,
    studies: Vec<Arc<Study>>,
    /// How many inputs the core was given.
    heard: u64,
}

impl Outbox {
    /// That of the coordinator of this epoch.
    #[must_use]
    pub fn new(epoch: u64) -> Self {
        Self { epoch, records: Vec::new(), commands: Vec::new(), studies: Vec::new(), heard: 0 }
    }

    /// Gives the core an input and takes everything that comes of it. The input is kept too, so that
    /// the journal can be replayed.
    pub fn handle(&mut self, core: &mut Core, now: Timestamp, input: Input) {
        core.handle(now, input.clone());
        self.came(core, now, input);
    }

    /// Takes everything that has come of an input that the core was given by somebody else.
    pub fn came(&mut self, core: &mut Core, now: Timestamp, input: Input) {
        let place = self.records.len();
        while let Some(output) = core.poll() {
            match output {
                Output::Record(record) => self.records.push(record),
                Output::Study(study) => self.studies.push(study),
                command => self.commands.push(command),
            }
        }
        self.heard += 1;
        let heard = Heard::of((self.epoch, self.heard), now, input, &self.records[place..]);
        self.records.insert(place, Record::Heard(heard));
    }

    /// What is to be kept next, in order.
    #[must_use]
    pub fn records(&self) -> &[Record] {
        &self.records
    }

    /// Whether commands wait for the records to be kept.
    #[must_use]
    pub fn urgent(&self) -> bool {
        !self.commands.is_empty()
    }

    /// Everything was kept.
    pub fn written(&mut self) {
        self.records.clear();
    }

    /// Nothing could be kept for now: it waits. Beyond a bound telemetry, what is told with plans, and old plans make
    /// room; says how many records did.
    pub fn failed(&mut self) -> usize {
        let before = self.records.len();
        if before > RECORDS_MAX {
            self.records.retain(|record| !record.is_telemetry());
        }
        if self.records.iter().filter(|record| record.tells_of_fleet()).count() > PLANS_MAX {
            self.leave_newest_answers();
        }
        let mut too_many = self.records.iter().filter(|record| record.is_plan()).count().saturating_sub(PLANS_MAX);
        self.records.retain(|record| {
            let is_dropped = too_many > 0 && record.is_plan();
            too_many -= usize::from(is_dropped);
            !is_dropped
        });
        before - self.records.len()
    }

    /// Leaves one capacity, and of each robot one explanation: these follow from what is believed, and a replay does not ask for
    /// them, as it does for every plan.
    fn leave_newest_answers(&mut self) {
        let (mut has_capacity, mut explained) = (false, BTreeSet::new());
        self.records.reverse();
        self.records.retain_mut(|record| match record {
            Record::Capacity(_) => !std::mem::replace(&mut has_capacity, true),
            Record::Explanations(told) => {
                told.retain(|one| explained.insert(one.robot.clone()));
                !told.is_empty()
            }
            _ => true,
        });
        self.records.reverse();
    }

    /// Takes the records out, to be kept; what is still to be kept comes back by [`Outbox::put_back`].
    pub fn take_records(&mut self) -> Vec<Record> {
        std::mem::take(&mut self.records)
    }

    /// Records that were taken out and wait on, before those that came since.
    pub fn put_back(&mut self, mut records: Vec<Record>) {
        records.append(&mut self.records);
        self.records = records;
    }

    /// What is to be run beside the core: it rests on nothing that has to be kept first.
    pub fn take_studies(&mut self) -> Vec<Arc<Study>> {
        std::mem::take(&mut self.studies)
    }

    /// The commands that may leave now.
    pub fn take_commands(&mut self) -> Vec<Output> {
        std::mem::take(&mut self.commands)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::tests::{capacity, event, explanation, schedule};

    fn plans(outbox: &Outbox) -> Vec<u64> {
        outbox.records().iter().filter_map(|record| if let Record::Plan(plan) = record { Some(plan.plan) } else { None }).collect()
    }

    #[test]
    fn of_plans_that_wait_the_newest_do_and_events_all() {
        let mut outbox = Outbox::new(1);
        for plan in 0..PLANS_MAX as u64 + 20 {
            outbox.records.extend([Record::Event(event(plan, "r1 joined")), Record::Plan(Arc::new(schedule(plan)))]);
        }
        assert_eq!([outbox.failed(), outbox.failed()], [20, 0]);
        let plans = plans(&outbox);
        assert_eq!((plans.len(), plans[0], plans[PLANS_MAX - 1]), (PLANS_MAX, 20, PLANS_MAX as u64 + 19));
        assert_eq!(outbox.records().iter().filter(|record| record.is_event()).count(), PLANS_MAX + 20);
    }

    #[test]
    fn what_is_told_with_plans_makes_room_before_any_plan_does() {
        let mut outbox = Outbox::new(1);
        for plan in 0..PLANS_MAX as u64 {
            let told = Record::Explanations(vec![explanation(["r1", "r2"][plan as usize % 2], &plan.to_string())]);
            outbox.records.extend([Record::Plan(Arc::new(schedule(plan))), Record::Capacity(capacity(plan as u32)), told]);
        }
        assert_eq!(outbox.failed(), 2 * PLANS_MAX - 3);
        assert_eq!(plans(&outbox), (0..PLANS_MAX as u64).collect::<Vec<_>>());
        let [.., before, Record::Plan(_), newest, last] = outbox.records() else { panic!("{:?}", outbox.records()) };
        let told = [before, newest, last].map(Record::clone);
        let explained = |robot, plan: usize| Record::Explanations(vec![explanation(robot, &plan.to_string())]);
        let newest = Record::Capacity(capacity(PLANS_MAX as u32 - 1));
        assert_eq!(told, [explained("r1", PLANS_MAX - 2), newest, explained("r2", PLANS_MAX - 1)]);
        assert_eq!(outbox.failed(), 0);
    }
}
