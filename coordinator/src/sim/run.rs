//! A scenario from its first second to its last.

use std::fmt::Write as _;

use node::Telemetry;
use proto::{Event, Timestamp};

use super::faults::Faults;
use super::host::STEP_S;
use super::measure::Measured;
use super::world::World;
use crate::scenario::Deployment;

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

/// Simulates a deployment. `progress` is told the simulated seconds now and then.
///
/// # Errors
/// When a model cannot be read.
pub fn simulate(
    deployment: &Deployment,
    duration_s: f64,
    ambient_degc: f64,
    with_telemetry: bool,
    progress: &mut dyn FnMut(f64),
) -> anyhow::Result<Outcome> {
    let mut world = World::new(deployment, Faults::none(), with_telemetry, ambient_degc, START)?;
    let steps = (duration_s / STEP_S).round() as u64;
    for step in 1..=steps {
        world.step(START.plus_s(step as f64 * STEP_S))?;
        if step % 256 == 0 {
            progress(step as f64 * STEP_S);
        }
    }
    world.finish();
    let core = world.desk.core().expect("nothing goes wrong in this run");
    let schedule = core.schedule().clone();
    Ok(Outcome { measured: world.measured, events: world.events, start: START, schedule, telemetry: world.telemetry })
}
