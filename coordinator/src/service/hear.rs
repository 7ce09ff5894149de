//! What comes over Zenoh, as inputs that wait for the core.

use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use anyhow::anyhow;
use node::Link;
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

    fn hear(&self, sample: &Sample) {
        let payload = sample.payload().to_bytes();
        let first = self.with(|intake, now| {
            let before = intake.ready_at();
            intake.hear(now, sample.key_expr().as_str(), &payload);
            // Whoever waits is woken when there is something earlier than what it waits for.
            intake.ready_at() != before
        });
        if first {
            self.came.notify_one();
        }
    }

    /// Waits until the core can be given something.
    pub(super) async fn ready(&self) {
        loop {
            let (at, now) = self.with(|intake, now| (intake.ready_at(), now));
            match at {
                Some(at) if at <= now => return,
                Some(at) => drop(tokio::time::timeout(at - now, self.came.notified()).await),
                None => self.came.notified().await,
            }
        }
    }
}

/// Turns what comes over Zenoh into inputs.
pub(super) async fn subscribe(link: &Link, gate: &Gate, news: &mpsc::UnboundedSender<Input>) -> anyhow::Result<Kept> {
    let mut kept: Kept = Vec::new();
    for pattern in [Pattern::AllRobotGauges, Pattern::AllPackGauges, Pattern::AllRobotStates, Pattern::AllStationStates] {
        let gate = gate.clone();
        kept.push(Box::new(link.listen(&pattern, move |sample| gate.hear(&sample)).await?));
    }
    let (gate, site, news) = (gate.clone(), link.site.clone(), news.clone());
    let lives = link.session.liveliness().declare_subscriber(Pattern::AllAlive.build(&link.site)).history(true).callback(move |sample| {
        let alive = sample.kind() == SampleKind::Put;
        let (input, says) = match Key::parse(sample.key_expr().as_str()) {
            Ok((_, Key::RobotAlive(id))) => (Input::RobotAlive(id.clone(), alive), vec![Key::RobotState(id.clone()), Key::RobotGauge(id)]),
            Ok((_, Key::StationAlive(id))) => (Input::StationAlive(id.clone(), alive), vec![Key::StationState(id)]),
            _ => return,
        };
        // Its last words were heard before this, and may still wait for their turn: after this a state would be a sign of life.
        if !alive {
            gate.with(|intake, _| says.iter().for_each(|key| intake.withdraw(&key.build(&site))));
        }
        let _ = news.send(input);
    });
    kept.push(Box::new(lives.await.map_err(|e| anyhow!("{e}"))?));
    Ok(kept)
}
