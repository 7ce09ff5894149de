//! Writing beside the core: one batch at a time, in order. A batch of telemetry takes tens of milliseconds, and
//! nobody whose service is planned meanwhile should wait for it; a command waits for all that it rests on.

use std::sync::Arc;

use tokio::task::JoinHandle;
use tracing::{debug, error, info, warn};

use super::Service;
use crate::config::Config;
use crate::store::{Record, Retention, StoreError};

/// A batch, and what became of it.
pub(super) type Batch = (Vec<Record>, Result<(), StoreError>);

/// The batch under way, when it is done; for ever where there is none.
pub(super) async fn done(writing: &mut Option<JoinHandle<Batch>>) -> Batch {
    let Some(batch) = writing else { return std::future::pending().await };
    let batch = batch.await.expect("writing a batch does not panic");
    *writing = None;
    batch
}

impl Service {
    /// Begins to write what waits, where nothing is being written.
    pub(super) fn write(&mut self) {
        if self.writing.is_some() {
            self.make_room();
        } else if !self.outbox.records().is_empty() {
            let (store, records) = (Arc::clone(&self.store), self.outbox.take_records());
            self.writing = Some(tokio::spawn(async move {
                let written = store.append(&records).await;
                (records, written)
            }));
        }
    }

    /// Writes everything that waits, and waits for it.
    pub(super) async fn flush(&mut self) {
        self.finish().await;
        self.write();
        self.finish().await;
    }

    async fn finish(&mut self) {
        if self.writing.is_some() {
            let batch = done(&mut self.writing).await;
            self.written(batch).await;
        }
    }

    /// What follows from a batch. A record that the store will never take is dropped, and said so; when the disk is
    /// full all wait, and old telemetry makes room.
    pub(super) async fn written(&mut self, (records, written): Batch) {
        match written {
            Ok(()) => {
                if std::mem::take(&mut self.store_failed) {
                    info!("the store can be written again");
                }
            }
            Err(StoreError::Deposed { .. }) => self.replaced = true,
            Err(failure) => {
                if !std::mem::replace(&mut self.store_failed, true) {
                    error!("{failure}; the fleet is served on, events wait in memory");
                }
                let waiting = if failure.may_pass() { records } else { self.write_singly(records).await };
                self.outbox.put_back(waiting);
                self.make_room();
            }
        }
    }

    /// One bad record must not hold back the others. Those that may still be kept.
    async fn write_singly(&self, records: Vec<Record>) -> Vec<Record> {
        let mut waiting = Vec::new();
        for record in records {
            if let Err(failure) = self.store.append(std::slice::from_ref(&record)).await {
                if failure.may_pass() {
                    waiting.push(record);
                } else {
                    error!("a record was dropped: {failure}");
                }
            }
        }
        waiting
    }

    fn make_room(&mut self) {
        if self.outbox.failed() {
            warn!("telemetry was dropped: the store cannot be written");
        }
    }

    /// A step of deleting what is old, between two batches. What fails now is done later.
    pub(super) async fn sweep(&mut self, config: &Config) {
        if self.writing.is_some() || !std::mem::take(&mut self.sweep_due) {
            return;
        }
        let keeping = &config.telemetry;
        let ago = |days: f64| self.clock.now().plus_s(-days * energy::units::S_PER_DAY);
        let retention = Retention { fine: ago(keeping.fine_days), coarse_s: keeping.coarse_s, keep: ago(keeping.keep_days) };
        if let Err(failure) = self.store.retire(&retention, &mut self.sweep).await {
            debug!("{failure}");
        }
    }
}
