//! Only one process speaks as a robot or a station: two would both obey one command.
//!
//! Who starts looks for another first. Two that start while they cannot reach each other meet later; then each hears
//! the other under its own key, and neither obeys until that has ended.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use proto::Key;
use tokio::time::Instant;
use tracing::{error, info};
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::sample::Locality;

use crate::session::Link;

/// Beyond the network's lease, s: so long may it take to be told that a lease has ended.
const MARGIN_S: f64 = 2.0;
/// Between two looks for it.
const LOOK: Duration = Duration::from_millis(500);
/// Words of another that are one too many: a single one may be this agent's own, from before it was started again.
const WORDS: usize = 2;
/// Periods of an agent's word for which such words count.
const PERIODS: u32 = 3;

/// For how long somebody else may speak under this name at the start: the sign of life of a process whose host fell silent lasts as long
/// as the network's lease, s.
fn patience(lease_s: f64) -> Duration {
    Duration::from_secs_f64(lease_s + MARGIN_S)
}

/// The right to speak as somebody, as long as it is kept.
pub struct Sole {
    who: String,
    /// When the last words of another came.
    heard: Arc<Mutex<VecDeque<Instant>>>,
    counts: Duration,
    doubted: bool,
    _alive: LivelinessToken,
    _others: Subscriber<()>,
}

impl Sole {
    /// Says that this process is alive under the key `alive`, as `who`, which says its state under `said` every `period`.
    ///
    /// # Errors
    /// When another process does, for longer than one that has died would be missed; when the session is closed.
    pub async fn claim(link: &Link, who: String, alive: &Key, said: &Key, period: Duration) -> anyhow::Result<Self> {
        let (begin, patience) = (Instant::now(), patience(link.lease_s));
        while link.alive(alive).await {
            anyhow::ensure!(
                begin.elapsed() < patience,
                "another process speaks as {who} already: both would obey its commands; stop it, or give this one another id"
            );
            if begin.elapsed() < LOOK {
                info!("somebody speaks as {who}: waiting until it is gone, {:.0} s at most", patience.as_secs_f64());
            }
            tokio::time::sleep(LOOK).await;
        }
        let heard = Arc::new(Mutex::new(VecDeque::new()));
        let listening = link.session.declare_subscriber(said.build(&link.site)).allowed_origin(Locality::Remote);
        let hears = Arc::clone(&heard);
        let others = listening.callback(move |_| {
            let mut heard = hears.lock().expect("nobody panics while he holds it");
            heard.push_back(Instant::now());
            if heard.len() > WORDS {
                heard.pop_front();
            }
        });
        let others = others.await.map_err(|error| anyhow::anyhow!("{error}"))?;
        let alive = link.announce(alive).await?;
        Ok(Self { who, heard, counts: PERIODS * period, doubted: false, _alive: alive, _others: others })
    }

    /// Why no command may be obeyed now, if somebody else speaks under the same name.
    pub fn doubt(&mut self) -> Option<String> {
        let since = {
            let heard = self.heard.lock().expect("nobody panics while he holds it");
            heard.front().filter(|_| heard.len() == WORDS).map(Instant::elapsed)
        };
        let doubted = since.is_some_and(|since| since < self.counts);
        let why = format!("another process speaks as {} too: neither obeys until one is stopped", self.who);
        if doubted && !self.doubted {
            error!("{why}");
        }
        self.doubted = doubted;
        doubted.then_some(why)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_that_has_died_is_waited_for_until_its_lease_has_ended_however_long_that_is() {
        assert_eq!(patience(10.0), Duration::from_secs(12));
        assert!(patience(3600.0) > Duration::from_secs(3600));
    }
}
