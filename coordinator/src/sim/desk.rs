//! The coordinator's process: the production core and outbox over a simulated disk. It may be killed
//! before its records are kept, after that, or between two of its commands.

use std::sync::Arc;

use proto::{Schedule, Timestamp};

use super::disk::Disk;
use super::faults::HostClock;
use crate::core::{Core, Input, Output};
use crate::models::{Models, Settings};
use crate::outbox::Outbox;
use crate::store::Record;

/// A running process.
struct Process {
    core: Core,
    outbox: Outbox,
    /// The last plan of the process before, until this one was told of it.
    before: Option<Arc<Schedule>>,
}

/// The coordinator's host.
pub(super) struct Desk {
    settings: Settings,
    models: Models,
    process: Option<Process>,
    pub(super) disk: Disk,
    pub(super) clock: HostClock,
    /// A kill that strikes after so many more steps of work.
    doomed: Option<u32>,
}

impl Desk {
    /// A coordinator that has just started.
    pub(super) fn new(settings: Settings, models: Models) -> Self {
        let mut desk = Self { settings, models, process: None, disk: Disk::default(), clock: HostClock::default(), doomed: None };
        desk.start();
        desk
    }

    /// Starts it, if it does not run. A start has to be counted, so it needs the disk.
    pub(super) fn start(&mut self) -> bool {
        if self.process.is_some() || self.disk.full {
            return false;
        }
        let (numbering, before) = (self.disk.start(), self.disk.latest_schedule());
        let core = Core::new(self.settings, self.models.clone(), numbering);
        self.process = Some(Process { core, outbox: Outbox::new(numbering.epoch), before });
        true
    }

    /// Kills it after that many more steps of work: keeping a batch is one, sending a command is one.
    pub(super) fn doom(&mut self, after: u32) {
        if self.process.is_some() {
            self.doomed = Some(after);
        }
    }

    /// Kills it now if a doom is still to strike.
    pub(super) fn strike(&mut self) {
        if self.doomed.take().is_some() {
            self.process = None;
        }
    }

    /// Whether it runs.
    pub(super) fn up(&self) -> bool {
        self.process.is_some()
    }

    /// The core, while it runs.
    pub(super) fn core(&self) -> Option<&Core> {
        self.process.as_ref().map(|process| &process.core)
    }

    /// The core, for who may ask it for something between two steps.
    pub(super) fn core_mut(&mut self) -> Option<&mut Core> {
        self.process.as_mut().map(|process| &mut process.core)
    }

    /// The core at the end of a run, and everything that was to be kept since it was started.
    pub(super) fn into_core(mut self) -> Option<(Core, Vec<Record>)> {
        let process = self.process?;
        let mut records = self.disk.reigns.pop().map_or_else(Vec::new, |reign| reign.records);
        records.extend_from_slice(process.outbox.records());
        Some((process.core, records))
    }

    pub(super) fn settings(&self) -> Settings {
        self.settings
    }

    pub(super) fn models(&self) -> &Models {
        &self.models
    }

    /// Gives it an input; calls back with each record as it is made, and returns the commands that
    /// left. Telemetry waits for the next tick to be kept, commands have everything kept first.
    pub(super) fn take(&mut self, now: Timestamp, input: Input, made: &mut dyn FnMut(&Record)) -> Vec<Output> {
        let now = self.clock.shows(now);
        let Some(process) = &mut self.process else { return Vec::new() };
        let flush = input == Input::Tick;
        let before = process.outbox.records().len();
        if let Some(schedule) = process.before.take() {
            process.outbox.handle(&mut process.core, now, Input::Before(schedule));
        }
        // Whole plans are done with the next tick; the core runs what nobody ran beside it.
        if flush && !process.outbox.take_studies().is_empty() {
            process.outbox.handle(&mut process.core, now, Input::Studied);
        }
        process.outbox.handle(&mut process.core, now, input);
        process.outbox.records()[before..].iter().for_each(made);
        if !flush && !process.outbox.urgent() {
            return Vec::new();
        }
        if self.worn_out() {
            return Vec::new();
        }
        let Some(process) = &mut self.process else { return Vec::new() };
        match self.disk.append(process.outbox.records()) {
            Ok(()) => process.outbox.written(),
            Err(_) => _ = process.outbox.failed(),
        }
        let mut sent = Vec::new();
        for command in process.outbox.take_commands() {
            if self.worn_out() {
                break;
            }
            sent.push(command);
        }
        sent
    }

    /// One step of work is done; says whether that was the last.
    fn worn_out(&mut self) -> bool {
        match &mut self.doomed {
            Some(0) => {
                self.strike();
                true
            }
            Some(left) => {
                *left -= 1;
                false
            }
            None => false,
        }
    }
}
