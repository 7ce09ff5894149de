//! What comes over Zenoh, as inputs that wait for the core.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use node::Link;
use node::session::decoded;
use proto::{Key, Pattern};
use tokio::sync::{Notify, mpsc};
use zenoh::sample::{Sample, SampleKind};

use super::Kept;
use super::lead::monotonic;
use crate::core::Input;
use crate::intake::Intake;

/// The intake, between Zenoh's threads and the core's.
#[derive(Clone)]
pub(super) struct Gate {
    intake: Arc<Mutex<Intake>>,
    came: Arc<Notify>,
    since: Instant,
}

impl Gate {
    pub(super) fn new(every: Duration) -> Self {
        Self { intake: Arc::new(Mutex::new(Intake::new(every))), came: Arc::new(Notify::new()), since: monotonic() }
    }

    pub(super) fn with<T>(&self, look: impl FnOnce(&mut Intake, Duration) -> T) -> T {
        let mut intake = self.intake.lock().expect("nobody panics while he holds it");
        look(&mut intake, self.since.elapsed())
    }

    fn offer(&self, input: Input) {
        self.with(|intake, now| intake.offer(now, input));
        self.came.notify_one();
    }

    /// Waits until the core can be given something. What becomes due meanwhile is seen with the next
    /// tick.
    pub(super) async fn ready(&self) {
        while !self.with(|intake, now| intake.is_ready(now)) {
            self.came.notified().await;
        }
    }
}

/// Turns what comes over Zenoh into inputs.
pub(super) async fn subscribe(link: &Link, gate: &Gate, news: &mpsc::UnboundedSender<Input>) -> anyhow::Result<Kept> {
    let mut kept: Kept = Vec::new();
    for pattern in [Pattern::AllRobotGauges, Pattern::AllPackGauges, Pattern::AllRobotStates, Pattern::AllStationStates] {
        let gate = gate.clone();
        kept.push(Box::new(link.listen(&pattern, move |sample| gate.offer(input_of(&sample))).await?));
    }
    let news = news.clone();
    let lives = link.session.liveliness().declare_subscriber(Pattern::AllAlive.build(&link.site)).history(true).callback(move |sample| {
        let alive = sample.kind() == SampleKind::Put;
        let input = match Key::parse(sample.key_expr().as_str()) {
            Ok((_, Key::RobotAlive(robot))) => Input::RobotAlive(robot, alive),
            Ok((_, Key::StationAlive(station))) => Input::StationAlive(station, alive),
            _ => return,
        };
        let _ = news.send(input);
    });
    kept.push(Box::new(lives.await.map_err(|e| anyhow!("{e}"))?));
    Ok(kept)
}

/// One sample as an input; what cannot be read becomes a refusal that names it.
fn input_of(sample: &Sample) -> Input {
    let key = sample.key_expr().as_str();
    let read = || -> Result<Input, String> {
        let payload = sample.payload();
        let text = |error: &dyn std::fmt::Display| format!("{key}: {error}");
        let (_, parsed) = Key::parse(key).map_err(|e| text(&e))?;
        Ok(match parsed {
            Key::RobotGauge(robot) => Input::RobotGauge(robot, decoded(payload).map_err(|e| text(&e))?),
            Key::RobotState(robot) => Input::RobotState(robot, decoded(payload).map_err(|e| text(&e))?),
            Key::StationState(station) => Input::StationState(station, decoded(payload).map_err(|e| text(&e))?),
            Key::PackGauge(station, pack) => Input::PackGauge(station, pack, decoded(payload).map_err(|e| text(&e))?),
            _ => return Err(format!("{key}: nothing is expected under this key")),
        })
    };
    read().unwrap_or_else(Input::Refused)
}
