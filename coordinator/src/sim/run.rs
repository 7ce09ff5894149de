//! A scenario from its first second to its last.

use std::fmt::Write as _;

use node::Telemetry;
use proto::{Event, SiteId, Timestamp};

use super::faults::Faults;
use super::host::STEP_S;
use super::measure::Measured;
use super::world::World;
use crate::core::Core;
use crate::models::Kept;
use crate::scenario::Deployment;
use crate::store::Record;

/// Simulated time begins here: 1 January 2026, 00:00 UTC.
pub(super) const START: Timestamp = Timestamp::from_unix_ms(1_767_225_600_000);

/// What came of a run.
pub struct Outcome {
    /// Counts and first promises.
    pub measured: Measured,
    /// Every event, in order.
    pub events: Vec<Event>,
    /// When the run began.
    pub start: Timestamp,
    /// The last schedule.
    pub schedule: proto::Schedule,
    /// Logs for the lab, if asked for.
    pub telemetry: Option<Telemetry>,
    /// The site.
    pub site: SiteId,
    /// The coordinator as it stood at the end.
    pub core: Core,
    /// What the coordinator kept, in order.
    pub records: Vec<Record>,
    /// When the run ended.
    pub end: Timestamp,
}

/// What whoever watches a run is shown after each step.
pub struct Step<'a> {
    /// Now.
    pub now: Timestamp,
    /// Since the start, s.
    pub elapsed_s: f64,
    /// The coordinator; what it wants done is done in the next step.
    pub core: &'a mut Core,
    /// What happened in this step.
    pub news: &'a [Event],
}

impl Outcome {
    /// One line per event: seconds since the start, kind, text. The same seed gives the same
    /// bytes.
    #[must_use]
    pub fn trace(&self) -> String {
        trace(&self.events)
    }
}

pub(super) fn trace(events: &[Event]) -> String {
    let mut trace = String::new();
    for event in events {
        let seconds = event.at.seconds_since(START);
        writeln!(trace, "{seconds:>10.2} {:<18} {}", event.kind.to_string(), event.text).expect("a text can be written to");
    }
    trace
}

/// Simulates a deployment, with logs if that is where measurements are kept. `watch` is shown every step.
///
/// # Errors
/// When a model cannot be read.
pub fn simulate(
    deployment: &Deployment,
    duration_s: f64,
    ambient_degc: f64,
    kept: Kept,
    watch: &mut dyn FnMut(Step<'_>),
) -> anyhow::Result<Outcome> {
    let mut world = World::new(deployment, Faults::none(), kept, ambient_degc, START)?;
    let steps = (duration_s / STEP_S).round() as u64;
    for step in 1..=steps {
        let (elapsed_s, known) = (step as f64 * STEP_S, world.events.len());
        let now = START.plus_s(elapsed_s);
        world.step(now)?;
        let core = world.desk.core_mut().expect("nothing goes wrong in this run");
        watch(Step { now, elapsed_s, core, news: &world.events[known..] });
    }
    world.finish();
    let (core, records) = world.desk.into_core().expect("nothing goes wrong in this run");
    Ok(Outcome {
        measured: world.measured,
        events: world.events,
        start: START,
        schedule: core.schedule().clone(),
        telemetry: world.telemetry,
        site: deployment.coordinator.site.clone(),
        core,
        records,
        end: START.plus_s(steps as f64 * STEP_S),
    })
}
