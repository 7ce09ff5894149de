//! Writing beside the core: one batch at a time, in order. A batch of telemetry takes tens of milliseconds, and
//! nobody whose service is planned meanwhile should wait for it. A command waits for all that it rests on, and the
//! core goes on: commands leave with the batch that they came before.

use std::sync::Arc;
use std::time::{Duration, Instant};

use tokio::task::JoinHandle;
use tracing::{debug, error, info, warn};

use super::Service;
use super::lead::monotonic;
use super::sift::Sift;
use crate::config::Config;
use crate::core::Output;
use crate::store::{Failing, Record, Retention, Standing, Store, StoreError, Sweep};

/// Longest that commands wait for a store that neither writes nor fails: a disk that hangs, a file that somebody locks.
const HANGING: Duration = Duration::from_secs(2);
/// A step of deleting what is old takes on no further sender after this.
const SWEEPING: Duration = Duration::from_millis(200);
/// Longest that a coordinator which is told to stop waits for it.
const STOPPING: Duration = Duration::from_secs(20);

/// What the store is busy with, beside the core.
#[derive(Default)]
pub(super) struct Keeping {
    task: Option<JoinHandle<Done>>,
    /// So many records are being written.
    writing: usize,
    /// When that began.
    since: Option<Instant>,
    /// The commands that leave when it is done.
    commands: Vec<Output>,
    /// The last time it could not be written, or it has not answered for too long: since when, and why.
    failing: Option<Failing>,
    /// Records that were never written.
    dropped: u64,
    /// How far the deleting of what is old has come.
    sweep: Sweep,
    sweep_due: bool,
}

/// What was done.
pub(super) enum Done {
    /// A batch was written, or was not.
    Written(Written),
    /// A step of deleting what is old.
    Swept(Sweep),
}

/// What became of a batch.
#[derive(Default)]
pub(super) struct Written {
    /// Why it was not written to its end, where it was not.
    failure: Option<StoreError>,
    /// What may still be written.
    waiting: Vec<Record>,
    /// Why records were left out that the store will never take.
    refused: Vec<StoreError>,
}

/// Writes a batch, without what the store will never take: one bad record must not hold back the others, nor anybody
/// who waits for the core. After any other failure the rest of it waits.
async fn written(store: &Store, mut records: Vec<Record>) -> Written {
    let (mut sift, mut done) = (Sift::new(records.len()), Written::default());
    while let Some(part) = sift.next() {
        match store.append(&records[part.clone()]).await {
            Ok(()) => {}
            Err(failure) if failure.is_of_record() => {
                if sift.refused(part, &records) {
                    done.refused.push(failure);
                }
            }
            Err(failure) => {
                done.waiting = records.split_off(part.start);
                done.failure = Some(failure);
                break;
            }
        }
    }
    done
}

impl Keeping {
    /// What was done, when it is; for ever where nothing is.
    pub(super) async fn done(&mut self) -> Done {
        let Some(task) = &mut self.task else { return std::future::pending().await };
        let done = task.await.expect("the store does not panic");
        self.task = None;
        done
    }

    /// From now on a step of deleting what is old may be made.
    pub(super) fn may_sweep(&mut self) {
        self.sweep_due = true;
    }
}

impl Service {
    /// Begins to write what waits, where the store has nothing to do.
    pub(super) fn write(&mut self) {
        if self.keeping.task.is_some() {
            self.make_room();
            self.hurry();
        } else if !self.outbox.records().is_empty() {
            let (store, records) = (Arc::clone(&self.store), self.outbox.take_records());
            self.keeping.commands = self.outbox.take_commands();
            self.keeping.writing = records.len();
            self.keeping.since = Some(monotonic());
            self.keeping.task = Some(tokio::spawn(async move { Done::Written(written(&store, records).await) }));
        }
    }

    /// Lets commands go that a store keeps waiting which does not answer, as if it had failed.
    fn hurry(&mut self) {
        let waited = self.keeping.since.map_or(Duration::ZERO, |since| since.elapsed());
        if waited < HANGING && self.keeping.failing.is_none() {
            return;
        }
        self.fails(|| format!("the store has not answered for {} s", waited.as_secs()));
        let mut commands = std::mem::take(&mut self.keeping.commands);
        commands.append(&mut self.outbox.take_commands());
        self.send_all(commands);
    }

    /// Says that the store cannot be written, once.
    fn fails(&mut self, why: impl FnOnce() -> String) {
        if self.keeping.failing.is_none() {
            let why = why();
            error!("{why}; the fleet is served on, events wait in memory");
            self.keeping.failing = Some(Failing { since: self.clock.now(), why });
        }
    }

    /// How the store stands.
    pub(super) fn standing(&self) -> Standing {
        let waiting = self.outbox.records().len() + self.keeping.writing;
        Standing { failing: self.keeping.failing.clone(), waiting, dropped: self.keeping.dropped }
    }

    fn send_all(&self, commands: Vec<Output>) {
        if !self.leading.is_over() {
            commands.into_iter().for_each(|command| self.command(command));
        }
    }

    /// Tries once to write everything that waits, and waits for it, but not for ever: whether all of it is kept.
    pub(super) async fn flush(&mut self) -> bool {
        let flushed = async {
            self.finish().await;
            self.write();
            self.finish().await;
        };
        tokio::time::timeout(STOPPING, flushed).await.is_ok() && self.outbox.records().is_empty()
    }

    async fn finish(&mut self) {
        while self.keeping.task.is_some() {
            let done = self.keeping.done().await;
            self.kept(done).await;
        }
    }

    /// What follows from what the store has done. A record that it will never take is dropped, and said so; when the
    /// disk is full all wait, and old telemetry makes room.
    pub(super) async fn kept(&mut self, done: Done) {
        self.keeping.writing = 0;
        match done {
            Done::Swept(sweep) => self.keeping.sweep = sweep,
            Done::Written(Written { failure, waiting, refused }) => {
                for why in &refused {
                    error!("a record was dropped: {why}");
                }
                self.keeping.dropped += refused.len() as u64;
                match failure {
                    None if self.keeping.failing.take().is_some() => info!("the store can be written again"),
                    None => {}
                    Some(StoreError::Deposed { .. }) => self.leading.replaced(),
                    Some(failure) => {
                        self.fails(|| {
                            let cause = std::error::Error::source(&failure).map_or_else(String::new, |source| format!(": {source}"));
                            format!("{failure}{cause}")
                        });
                        self.outbox.put_back(waiting);
                        self.make_room();
                    }
                }
            }
        }
        let commands = std::mem::take(&mut self.keeping.commands);
        self.send_all(commands);
        if self.outbox.urgent() {
            self.write();
        }
    }

    fn make_room(&mut self) {
        let dropped = self.outbox.failed();
        if dropped > 0 {
            warn!("{dropped} records (telemetry, old plans, what was told with them) were dropped: the store cannot be written");
            self.keeping.dropped += dropped as u64;
        }
    }

    /// Begins a step of deleting what is old, where one is due and the store has nothing to do. What fails now is done
    /// later.
    pub(super) fn sweep(&mut self, config: &Config) {
        if self.keeping.task.is_some() || !std::mem::take(&mut self.keeping.sweep_due) {
            return;
        }
        let keeping = &config.telemetry;
        let ago = |days: f64| self.clock.now().plus_s(-days * energy::units::S_PER_DAY);
        let retention = Retention { fine: ago(keeping.fine_days), coarse_s: keeping.coarse_s, keep: ago(keeping.keep_days) };
        let (store, mut sweep) = (Arc::clone(&self.store), std::mem::take(&mut self.keeping.sweep));
        let begin = monotonic();
        self.keeping.since = Some(begin);
        self.keeping.task = Some(tokio::spawn(async move {
            // Rows of months lie far apart on a disk, and what is to be kept waits meanwhile.
            if let Err(failure) = store.retire(&retention, &mut sweep, || begin.elapsed() > SWEEPING).await {
                debug!("{failure}");
            }
            Done::Swept(sweep)
        }));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::tests::event;

    #[tokio::test]
    async fn a_record_that_the_store_refuses_is_left_out_and_all_others_are_kept() {
        let directory = tempfile::tempdir().unwrap();
        let store = Store::open(&directory.path().join("journal.db")).await.unwrap();
        let events = |seqs: std::ops::Range<u64>, text: &str| seqs.map(|seq| Record::Event(event(seq, text))).collect::<Vec<_>>();
        store.append(&events(700..701, "r1 joined")).await.unwrap();
        // An event of that number is there, and tells something else.
        let done = written(&store, events(1..3_000, "r2 joined")).await;
        assert!(done.failure.is_none() && done.waiting.is_empty());
        let [refused] = &done.refused[..] else { panic!("{:?}", done.refused) };
        assert!(matches!(refused, StoreError::Conflict { record, .. } if record == "event 700"), "{refused}");
        let kept = store.events(9_999).await.unwrap();
        assert!(kept.iter().map(|event| event.seq).eq(1..3_000) && kept.iter().filter(|event| event.text == "r1 joined").count() == 1);
    }
}
