//! A Zenoh session: publish, ask, serve, watch.

use std::time::Duration;

use crate::network::NetworkConfig;
use anyhow::{Context, anyhow};
use proto::{CodecError, Key, Message, Pattern, SiteId, any_coordinator_alive, decode, encode, plain};
use tokio::sync::mpsc;
use tracing::warn;
use zenoh::liveliness::LivelinessToken;
use zenoh::pubsub::Subscriber;
use zenoh::qos::CongestionControl;
use zenoh::query::{ConsolidationMode, Query, Queryable};
use zenoh::sample::{Sample, SampleKind};

/// Questions that wait for an answer.
pub const QUESTIONS: usize = 1024;
/// How long an agent waits for the network when it starts, before it looks after what it has without.
const PATIENCE: Duration = Duration::from_secs(10);

/// Time between the first two tries to open a session, and the longest: it doubles in between. Who starts together finds each other at once; of
/// a network that is gone an agent need not know within less than the time after which it is taken for lost.
const RETRY: Duration = Duration::from_millis(200);
const RETRY_MAX: Duration = Duration::from_secs(5);
/// While machines that were switched on together come up: for so many tries it is no longer than this.
const RETRY_SOON_MAX: Duration = Duration::from_secs(1);
const TRIES_SOON: u32 = 30;

/// A session and the site whose keys it uses.
#[derive(Clone)]
pub struct Link {
    /// The Zenoh session.
    pub session: zenoh::Session,
    /// The site.
    pub site: SiteId,
    /// Seconds without a sign of life after which others take a process of this network for dead.
    pub lease_s: f64,
}

impl Link {
    /// Opens a session; a client waits until the other side is there.
    ///
    /// # Errors
    /// When an address cannot be listened on or the configuration is refused.
    pub async fn open(network: &NetworkConfig, site: SiteId) -> anyhow::Result<Self> {
        let patient = network.listen.is_empty();
        let mut tries = Tries::default();
        loop {
            match zenoh::open(network.zenoh_config(&site)?).await {
                Ok(session) => return Ok(Self { session, site, lease_s: network.lease_s }),
                Err(error) if patient => {
                    let why = brief(&error);
                    if tries.is_new(&why) {
                        warn!("nobody answers at {} yet: {why}; waiting", network.connect.join(", "));
                    }
                    tokio::time::sleep(tries.pause()).await;
                }
                Err(error) => {
                    return Err(anyhow!("{}", brief(&error))).with_context(|| format!("cannot listen on {}", network.listen.join(", ")));
                }
            }
        }
    }

    /// The session that `opening` opens, if it is there in a moment: what has to be looked after cannot wait for a network that is gone.
    ///
    /// # Errors
    /// Those of `opening`.
    pub async fn soon(opening: std::pin::Pin<&mut impl Future<Output = anyhow::Result<Self>>>) -> anyhow::Result<Option<Self>> {
        match tokio::time::timeout(PATIENCE, opening).await {
            Ok(link) => link.map(Some),
            Err(_) => {
                warn!("goes on without the network, and looks for it");
                Ok(None)
            }
        }
    }

    /// Opens a session, giving up at once when nobody is there.
    ///
    /// # Errors
    /// When no connection can be made.
    pub async fn try_open(network: &NetworkConfig, site: SiteId) -> anyhow::Result<Self> {
        let session = zenoh::open(network.zenoh_config(&site)?).await.map_err(|error| anyhow!("{error}"))?;
        Ok(Self { session, site, lease_s: network.lease_s })
    }

    /// Says that this process is alive, until the token is dropped.
    ///
    /// # Errors
    /// When the session is closed.
    pub async fn announce(&self, key: &Key) -> anyhow::Result<LivelinessToken> {
        self.session.liveliness().declare_token(key.build(&self.site)).await.map_err(|error| anyhow!("{error}"))
    }

    /// Whether somebody holds that token now.
    pub async fn alive(&self, key: &Key) -> bool {
        let Ok(tokens) = self.session.liveliness().get(key.build(&self.site)).timeout(Duration::from_secs(2)).await else { return false };
        while let Ok(reply) = tokens.recv_async().await {
            if reply.result().is_ok() {
                return true;
            }
        }
        false
    }

    /// The sites whose coordinators are there, as far as this process may see.
    pub async fn sites(&self) -> Vec<SiteId> {
        let tokens = self.session.liveliness().get(any_coordinator_alive()).timeout(Duration::from_secs(2)).await;
        let Ok(tokens) = tokens else { return Vec::new() };
        let mut sites = Vec::new();
        while let Ok(reply) = tokens.recv_async().await {
            if let Ok(Ok((site, Key::CoordinatorAlive))) = reply.result().map(|sample| Key::parse(sample.key_expr().as_str())) {
                sites.push(site);
            }
        }
        sites.sort();
        sites.dedup();
        sites
    }

    /// Tells of each appearance (true) and loss (false) of who holds that token, those there already
    /// included, until the subscriber is dropped.
    ///
    /// # Errors
    /// When the session is closed.
    pub async fn watch(&self, key: &Key, lives: mpsc::UnboundedSender<bool>) -> anyhow::Result<Subscriber<()>> {
        let tokens = self.session.liveliness().declare_subscriber(key.build(&self.site)).history(true);
        let subscriber = tokens.callback(move |sample| {
            let _ = lives.send(sample.kind() == SampleKind::Put);
        });
        subscriber.await.map_err(|error| anyhow!("{error}"))
    }

    /// Puts the questions that come under a key expression into a queue, until the queryable is dropped. A question that finds the queue
    /// full is dropped, since waiting would hold up the whole session: who asked gets no answer, and asks again.
    ///
    /// # Errors
    /// When the session is closed.
    pub async fn serve(&self, expression: String, queue: mpsc::Sender<Query>) -> anyhow::Result<Queryable<()>> {
        let queryable = self.session.declare_queryable(expression).callback(move |query| {
            let _ = queue.try_send(query);
        });
        queryable.await.map_err(|error| anyhow!("{error}"))
    }

    /// Calls back with each message under a pattern, until the subscriber is dropped. The callback
    /// must not wait: it would hold up every subscriber of the session.
    ///
    /// # Errors
    /// When the session is closed.
    pub async fn listen(&self, pattern: &Pattern, callback: impl Fn(Sample) + Send + Sync + 'static) -> anyhow::Result<Subscriber<()>> {
        let subscriber = self.session.declare_subscriber(pattern.build(&self.site)).callback(callback);
        subscriber.await.map_err(|error| anyhow!("{error}"))
    }

    /// The same with each message under one key.
    ///
    /// # Errors
    /// When the session is closed.
    pub async fn hear(&self, key: &Key, callback: impl Fn(Sample) + Send + Sync + 'static) -> anyhow::Result<Subscriber<()>> {
        let subscriber = self.session.declare_subscriber(key.build(&self.site)).callback(callback);
        subscriber.await.map_err(|error| anyhow!("{error}"))
    }

    /// Publishes telemetry. Under congestion this message is dropped, not one before it: what has to arrive is said anew, as states are
    /// by their period.
    ///
    /// # Errors
    /// When the session is closed.
    pub async fn publish<M: Message>(&self, key: &Key, message: &M) -> anyhow::Result<()> {
        let put = self.session.put(key.build(&self.site), encode(message));
        put.congestion_control(CongestionControl::Drop).await.map_err(|error| anyhow!("{error}"))
    }

    /// Asks once and returns the first answer that can be read. Nobody answering is no error:
    /// who asks decides whether to ask again.
    pub async fn ask<Q: Message, A: Message>(&self, key: &Key, question: Option<&Q>, timeout: Duration) -> Answer<A> {
        // The first answer counts, and it counts when it comes: of two agents with one id only one is believed.
        let mut get = self.session.get(key.build(&self.site)).timeout(timeout).consolidation(ConsolidationMode::None);
        if let Some(question) = question {
            get = get.payload(encode(question));
        }
        let Ok(replies) = get.await else { return Answer::Nobody };
        let mut refused = None;
        while let Ok(reply) = replies.recv_async().await {
            match reply.result() {
                Ok(sample) => match decode(&sample.payload().to_bytes()) {
                    Ok(answer) => return Answer::Given(answer),
                    Err(error) => refused = Some(error.to_string()),
                },
                Err(error) => refused = Some(plain(&error.payload().try_to_string().unwrap_or_default()).into_owned()),
            }
        }
        refused.map_or(Answer::Nobody, Answer::Refused)
    }
}

/// Tries to open a session that failed.
#[derive(Debug, Default)]
struct Tries {
    count: u32,
    told: Option<String>,
}

impl Tries {
    /// Whether this is not what was told before.
    fn is_new(&mut self, why: &str) -> bool {
        self.told.replace(why.to_owned()).as_deref() != Some(why)
    }

    /// The time until the next one.
    fn pause(&mut self) -> Duration {
        let longest = if self.count < TRIES_SOON { RETRY_SOON_MAX } else { RETRY_MAX };
        let pause = RETRY.saturating_mul(1_u32.checked_shl(self.count).unwrap_or(u32::MAX)).min(longest);
        self.count = self.count.saturating_add(1);
        pause
    }
}

/// An error of the network library without its trace of source files.
fn brief(error: &zenoh::Error) -> String {
    let text = error.to_string();
    text.split(" at /").next().unwrap_or(&text).trim_end_matches([' ', '!', '.']).to_owned()
}

/// What came of a question.
#[derive(Debug, Clone, PartialEq)]
pub enum Answer<A> {
    /// An answer.
    Given(A),
    /// Somebody was there but did not answer, and said why.
    Refused(String),
    /// Nobody was there, or not in time.
    Nobody,
}

/// Reads the command that came with a query; a query without one that can be read is answered
/// with what is wrong.
pub async fn command<M: Message>(query: &Query) -> Option<M> {
    let wrong = match query.payload().map(decoded::<M>) {
        Some(Ok(command)) => return Some(command),
        Some(Err(error)) => error.to_string(),
        None => "a command needs a payload".to_owned(),
    };
    refuse(query, wrong).await;
    None
}

/// Refuses a query, and says why.
pub async fn refuse(query: &Query, why: String) {
    if let Err(failure) = query.reply_err(why).await {
        warn!("a refusal was not sent: {failure}");
    }
}

/// Answers a query; an answer that is lost is asked for again.
pub async fn reply<M: Message>(query: &Query, message: &M) {
    if let Err(error) = query.reply(query.key_expr().clone(), encode(message)).await {
        warn!("an answer under {} was not sent: {error}", query.key_expr());
    }
}

/// Decodes what came with a sample or query.
///
/// # Errors
/// [`CodecError`] says what is wrong with it.
pub fn decoded<M: Message>(payload: &zenoh::bytes::ZBytes) -> Result<M, CodecError> {
    decode(&payload.to_bytes())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_network_that_is_gone_is_looked_for_less_often_and_told_of_when_it_fails_otherwise() {
        let mut tries = Tries::default();
        let ms: Vec<u128> = (0..5).map(|_| tries.pause().as_millis()).collect();
        assert_eq!(ms, [200, 400, 800, 1000, 1000]);
        // Some half a minute later it is looked for less often.
        assert!((5..TRIES_SOON).all(|_| tries.pause() == RETRY_SOON_MAX));
        (0..100).for_each(|_| assert_eq!(tries.pause(), RETRY_MAX));
        let told = ["no route", "no route", "refused", "no route"].map(|why| tries.is_new(why));
        assert_eq!(told, [true, false, true, true]);
    }
}
